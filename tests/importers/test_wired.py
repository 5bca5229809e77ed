"""The wired system through the Z move in every importer: where one differs from our master, an imitation does, too."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from feedsim import scenario
from feedsim.simulation import nc
from importers import document, loops, with_ecos, with_fmpy, with_libcosim, z_move
from importers.loops import Master
from importers.registry import IMPORTERS, Importer
from importers.system import RELEASE, Result, System

pytestmark = pytest.mark.extensive

# Our imitation makes the same calls with the same numbers: no bit differs, except in libcosim, whose steps differ from
# 125 us by some 1e-17 s (time in whole nanoseconds, handed over as differences of such times): 1.4e-7 nm and 4e-8 mN.m
# over the move. A hundred times that is allowed; another order or lag makes more than 100 nm, as tested below.
SAME_X = 1e-5  # nm
SAME_M = 1e-5  # mN.m
Imitation = Callable[[Master], Result]


def _same(a: Result, b: Result, move: z_move.Move) -> None:
    x, torque = z_move.differences(a, b, move)
    assert x <= SAME_X, f"{x} nm"
    assert torque <= SAME_M, f"{torque} mN.m"


def test_the_page_tells_how_many_steps_it_compares_and_its_commands_make(move: z_move.Move) -> None:
    whole = round(nc.plan(scenario.load(z_move.SCENARIO)).duration / z_move.STEP)
    page = " ".join(document.PAGE.read_text(encoding="utf-8").split())
    told = f"{move.experiment.steps:,} steps of 125 us (whole, as the commands below run it, {whole:,})"
    assert told in page


def test_our_master_in_parallel_is_the_plain_loop(move: z_move.Move, imitation: Imitation, parallel: Result) -> None:
    assert z_move.differences(imitation(Master()), parallel, move) == (0.0, 0.0)


def test_an_imitation_can_fail(move: z_move.Move, system: System, imitation: Imitation, parallel: Result) -> None:
    """A step's lag, another order, another first step: each is far above what is allowed."""
    found = {
        "lag": imitation(Master(lag=1)),
        "order": imitation(Master(sequential=True)),
        # A first step with zeros makes no difference to drives that are not released in it.
        "zeros": loops.run(system.without(RELEASE), move.experiment, Master(zeros=True)),
    }
    for name, result in found.items():
        x, torque = z_move.differences(result, parallel, move)
        assert x > 100.0, name
        assert torque > 50.0, name


def test_the_z_move(
    importer: Importer, move: z_move.Move, system: System, imitation: Imitation, parallel: Result, tmp_path: Path
) -> None:
    result = importer.run(system, move.experiment, tmp_path)
    _same(result, imitation(importer.master), move)
    line = document.row(
        f"{importer.name} {importer.version()}",
        f"wired by hand, {importer.how}".rstrip(", "),
        z_move.differences(result, parallel, move),
        z_move.overshoot(result, move),
        importer.does,
    )
    document.check(line)


@pytest.mark.parametrize(("late", "overshoot"), [("M_a", 2.52), ("", 2.54)])
def test_a_cycle_later_still(late: str, overshoot: float, move: z_move.Move, imitation: Imitation) -> None:
    """What the document says of masters that hand over M_a, or everything, one more cycle late."""
    result = imitation(Master(lag=1, late=late))
    assert f"{z_move.overshoot(result, move):.2f}" == f"{overshoot:.2f}"
    assert f"{overshoot} um" in document.PAGE.read_text(encoding="utf-8")


ORDERS = ["controller plant friction", "plant friction controller", "friction controller plant"]


@pytest.mark.parametrize("kinds", ORDERS)
def test_one_after_the_other(kinds: str, move: z_move.Move, system: System) -> None:
    """The document's 3.39 um for sequential masters, whatever the order within the loop."""
    names = [name for kind in ("setpoint", *kinds.split()) for name in system.components if name.startswith(kind)]
    result = loops.run(system.reordered(*names), move.experiment, Master(sequential=True))
    assert f"{z_move.overshoot(result, move):.2f}" == "3.39"


def _importer(name: str) -> Importer:
    found = next(importer for importer in IMPORTERS if importer.name == name)
    if reason := found.missing():
        pytest.skip(reason)
    return found


@pytest.fixture(scope="session")
def ssp(move: z_move.Move, fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The move as `feedsim export` writes it."""
    from feedsim.simulation import ssp as room

    path = tmp_path_factory.mktemp("ssp") / "z_move.ssp"
    room.export(move.scenario, path, fmus=fmus)
    return path


@pytest.mark.parametrize("name", ["ecos", "libcosim", "FMPy"])
def test_the_exported_ssp_file(name: str, ssp: Path, move: z_move.Move, imitation: Imitation, parallel: Result) -> None:
    """The same file, unedited, in every importer that reads SSP; compared with the system wired by hand."""
    importer = _importer(name)
    if name == "ecos":
        result = with_ecos.run(ssp, move.experiment)
    elif name == "libcosim":
        result = with_libcosim.run(ssp, move.experiment)
    else:
        result = with_fmpy.run_file(ssp, move.experiment, with_fmpy.parameters(ssp))
    _same(result, imitation(importer.master), move)
    line = document.row(
        f"{importer.name} {importer.version()}",
        "`feedsim export` file",
        z_move.differences(result, parallel, move),
        z_move.overshoot(result, move),
        importer.does,
    )
    document.check(line)


@pytest.mark.parametrize("scheme", ["extrapolated", "gauss_seidel", "jacobi", "parallel"])
def test_our_own_schemes_in_the_table(scheme: str, move: z_move.Move, fmus: Path, parallel: Result) -> None:
    result = z_move.as_result(z_move.own(move, scheme, fmus), move)
    line = document.row(
        f"feedsim, `{scheme}`",
        "scenario",
        z_move.differences(result, parallel, move),
        z_move.overshoot(result, move),
        SCHEMES[scheme],
    )
    document.check(line)


SCHEMES = {
    "extrapolated": "controllers, then plant with the slopes of both torques, then friction (default)",
    "gauss_seidel": "controllers, then plant with the torque's slope, then friction with the newest speed",
    "jacobi": "controllers first; plant and friction in parallel",
    "parallel": "all units in parallel, values held: the reference of this table",
}
