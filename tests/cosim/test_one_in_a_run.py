"""``coupling.units: one``: a run on one unit against the same run on units of their own, to the last bit."""

from __future__ import annotations

from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest

from feedsim import load_scenario
from feedsim.cli import main
from feedsim.foundation.errors import InputError
from feedsim.scenario.model import SCHEMES
from feedsim.simulation import nc
from feedsim.simulation.cosim import describe_programs, run
from feedsim.simulation.judge import JudgedRun, check, judge_run

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
SHORT = ("motions.0.by.Z=1 mm", "motions.1.duration=0.05 s", "recording.interval=125 us")
ONE = "coupling.units=one"
# Shipped scenarios, shortened where that leaves what they are about.
CASES = {
    "z_positioning": SHORT,
    "xz_circle": ("motions.0.radius=2 mm", "motions.0.direction=counterclockwise"),
    "one_axis": (),
    "z_measured": (),
    "identify_z_sine": (),
}


def both(scenario: str, *changes: str, native: bool | None = None) -> tuple[JudgedRun, JudgedRun]:
    file = SCENARIOS / f"{scenario}.yaml"
    apart = load_scenario(file, changes)
    program = nc.plan(apart)
    one = load_scenario(file, [*changes, ONE])
    return judge_run(run(apart, program=program, native=native)), judge_run(run(one, program=program, native=native))


def assert_same(apart: JudgedRun, one: JudgedRun) -> None:
    assert [*one.trace.columns] == [*apart.trace.columns]
    for name in apart.trace.columns:
        np.testing.assert_array_equal(one.trace[name], apart.trace[name], err_msg=name)
        assert one.trace.units[name] == apart.trace.units[name]
    assert one.coupling == apart.coupling
    assert repr(one.pose) == repr(apart.pose)
    assert one.loads == apart.loads
    assert one.warnings == apart.warnings


@pytest.mark.parametrize("name", CASES)
def test_every_shipped_scenario_gives_the_same(name: str) -> None:
    apart, one = both(name, *CASES[name])
    assert_same(apart, one)
    assert [*one.units] == ["machine"]


@pytest.mark.parametrize("scheme", [name for name, scheme in SCHEMES.items() if scheme.passes == 1])
def test_energies_of_every_scheme(scheme: str) -> None:
    apart, one = both("z_positioning", *SHORT, f"coupling.scheme={scheme}")
    assert_same(apart, one)
    assert all(value != 0 for name, value in one.coupling.items() if name == "Z.friction_work")


def test_by_the_loop_in_python() -> None:
    assert_same(*both("z_positioning", *SHORT, native=False))


def test_loads_logs_and_feedforward() -> None:
    changes = (
        *SHORT,
        "loads=[{kind: motor, axis: Z, table: {time: [0 s, 50 ms, 60 ms], values: [0 N.m, 1 N.m, 0 N.m]}}, "
        "{kind: slide, axis: X, table: {time: [0 s, 0.1 s], values: [5 N, 50 N]}}, "
        "{kind: tool, direction: Y, table: {time: [0 s, 0.1 s], values: [5 N, 50 N]}}]",
        "logging.interval=1 ms",
        "recording.variables=['*']",
    )
    apart, one = (load_scenario(SCENARIOS / "z_positioning.yaml", [*changes, *more]) for more in ((), (ONE,)))
    program = nc.plan(apart)
    torque = {"Z": np.sin(np.arange((len(program.time) - 1) * 8 + 1) * 0.01)}
    found = [judge_run(run(each, program=program, torque_feedforward=torque)) for each in (apart, one)]
    assert_same(*found)
    assert found[1].loads[0].given > 0
    for log in ("fine", "log"):
        traces = [getattr(each, log) for each in found]
        for name in traces[0].columns:
            np.testing.assert_array_equal(traces[1][name], traces[0][name], err_msg=name)


def test_a_plant_that_follows_its_axes(tmp_path: Path) -> None:
    plant = tmp_path / "plant.fmu"
    packed = ["machine", "pack", str(SCENARIOS / "machines" / "test_centre"), "--poses", "Z=90mm..130mm/20mm"]
    assert main([*packed, "--out", str(plant)]) == 0
    apart, one = both("z_positioning", f"machine.plant={plant}", "motions.0.by.Z=20 mm", "motions.1.duration=0.05 s")
    assert_same(apart, one)
    assert one.pose.crossings is not None
    assert one.pose.crossings.count > 0


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        (("coupling.scheme=iterated",), "scheme is iterated, allowed: extrapolated, gauss_seidel"),
        (("coupling.substeps=2",), "substeps are 2, allowed: 1; or units: separate"),
    ],
)
def test_what_cannot_be_followed_from_outside_is_refused(changes: tuple[str, ...], told: str) -> None:
    plan = load_scenario(SCENARIOS / "z_positioning.yaml", [*SHORT, *changes, ONE])
    for refused in (run, lambda each: check(each, nc.plan(each))):
        with pytest.raises(InputError, match=told):
            refused(plan)


def test_what_the_unit_says_is_told_with_the_part() -> None:
    plan = load_scenario(SCENARIOS / "z_positioning.yaml", [*SHORT, ONE])
    object.__setattr__(plan.machine.axes["Z"].drive.filter_1, "f", 5000.0)  # past the checks of the scenario
    with pytest.raises(InputError, match=r"unit machine refuses its parameters: Z\.drive: .*filter_1\.f = 5000 Hz"):
        run(plan)


def test_whose_program_is_executed_is_told(fmus: Path, tmp_path: Path) -> None:
    plan = load_scenario(SCENARIOS / "z_positioning.yaml", [ONE])
    assert describe_programs(plan.machine, fmus, plan.coupling) == []
    other = tmp_path / "machine.fmu"
    with ZipFile(fmus / "machine.fmu") as given, ZipFile(other, "w") as changed:
        for name in given.namelist():
            changed.writestr(name, given.read(name) + (b"x" if name.startswith("binaries/") else b""))
    (told,) = describe_programs(plan.machine, tmp_path, plan.coupling)
    assert told.startswith(f"executes {other} as machine: binaries/")
