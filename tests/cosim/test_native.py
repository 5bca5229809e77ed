"""The native cycle loop against the interpreter: the same bits, the same messages, the same behaviour around it."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

from feedsim import scenario
from feedsim.foundation.errors import Finding, InputError, SimulationError
from feedsim.scenario.model import SCHEMES
from feedsim.simulation import cosim, nc
from feedsim.simulation.cosim import exchange
from feedsim.simulation.cosim.excitation import multisine
from feedsim.simulation.cosim.excite import measure, usual_rms
from feedsim.simulation.cosim.operations import set_real
from feedsim.simulation.cosim.schedule import REPORTED_EVERY, Cycle, Loop, Progress
from feedsim.simulation.cosim.system import System
from feedsim.simulation.cosim.unit import Port
from feedsim.simulation.judge import JudgedRun, judge_run
from feedsim_packager import toolchain
from feedsim_packager.native import build as build_library
from scenario_helpers import default_machine

ROOT = Path(__file__).resolve().parents[2]
SCENARIOS = ROOT / "scenarios"
# Both scenarios with less of the way and of the time at rest; every branch is passed as in the whole ones.
SHORT = {
    "z_positioning": (
        "motions=[{kind: move, by: {Z: 4 mm}, feed: 5000 mm/min}, {kind: dwell, duration: 50 ms}]",
        "evaluate=[]",
    ),
    "xz_circle": ("motions=[{kind: circle, plane: [X, Z], radius: 1 mm, feed: 3000 mm/min, turns: 1}]", "evaluate=[]"),
}


@pytest.fixture(scope="module")
def folder(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The archives with a native loop that was built just now."""
    folder = tmp_path_factory.mktemp("native")
    for archive in fmus.glob("*.fmu"):
        (folder / archive.name).symlink_to(archive.resolve())
    build_library("exchange", folder, toolchain.find_compiler())
    return folder


def both(folder: Path, name: str, *overrides: str, **options: Any) -> tuple[JudgedRun, JudgedRun]:
    loaded = scenario.load(SCENARIOS / f"{name}.yaml", list(overrides))
    native = judge_run(cosim.run(loaded, fmus=folder, native=True, **options))
    python = judge_run(cosim.run(loaded, fmus=folder, native=False, **options))
    assert native.native
    assert not python.native
    return native, python


def assert_same(native: JudgedRun, python: JudgedRun) -> None:
    for one, other in ((native.trace, python.trace), (native.fine, python.fine), (native.log, python.log)):
        assert (one is None) == (other is None)
        if one is None or other is None:
            continue
        assert list(one) == list(other)
        np.testing.assert_array_equal(one.time, other.time)
        for column in one:
            np.testing.assert_array_equal(one[column], other[column], err_msg=column)
    assert native.coupling == python.coupling
    assert native.warnings == python.warnings


@pytest.mark.parametrize("substeps", [1, 2])
@pytest.mark.parametrize("scheme", sorted(SCHEMES))
@pytest.mark.parametrize("name", sorted(SHORT))
def test_same_bits(name: str, scheme: str, substeps: int, folder: Path) -> None:
    native, python = both(
        folder, name, *SHORT[name], f"coupling.scheme={scheme}", f"coupling.substeps={substeps}",
        "recording.interval=125 us", "recording.variables=['*']",
    )  # fmt: skip
    assert_same(native, python)
    assert "Z.residual" in native.trace
    # The comparison means something: the axis has moved, and friction has worked.
    assert np.ptp(native.trace["Z.x_a"]) > 1e-3
    assert native.coupling["Z.friction_work"] > 1e-3


def test_a_scheme_says_who_steps_when_and_who_learns_of_slopes(folder: Path) -> None:
    friction = ["friction_X", "friction_Y", "friction_Z"]
    turns = {
        "extrapolated": (["plant", *friction], {"plant", *friction}),
        "iterated": (["plant", *friction] * 2, {"plant", *friction}),
        "gauss_seidel": (["plant", *friction], {"plant"}),
        "gauss_seidel_friction_first": ([*friction, "plant"], {"plant"}),
        "jacobi": (["plant", *friction], {"plant"}),
        "jacobi_extrapolated": (["plant", *friction], {"plant", *friction}),
        "parallel": (["plant", *friction], set()),
    }
    assert turns.keys() == SCHEMES.keys()
    with System(default_machine(), folder) as system:
        for name, (steps, sloped) in turns.items():
            operations = [each for each in Cycle(system, SCHEMES[name], 125e-6, 2).operations() if each.unit]
            called = [(each.kind, each.unit.name) for each in operations if each.unit]
            controls = [f"controller_{axis}" for axis in "XYZ"]
            assert [unit for kind, unit in called if kind == "do_step"] == [*controls, *steps, *steps], name
            assert {unit for kind, unit in called if kind == "set_slopes"} == sloped, name


@pytest.mark.parametrize("name", sorted(SHORT))
def test_same_bits_over_the_whole_scenario(name: str, folder: Path) -> None:
    assert_same(*both(folder, name))


def test_same_bits_with_torque_feedforward_and_log(folder: Path) -> None:
    loaded = scenario.load(SCENARIOS / "z_positioning.yaml", [*SHORT["z_positioning"]])
    cycles = (len(nc.plan(loaded).time) - 1) * 8
    # every other of a larger array, in another type: what a caller may hand over
    torque = np.sin(np.arange(2 * cycles + 2) / 50).astype(np.float32)[::2]
    overrides = (*SHORT["z_positioning"], "logging={interval: 250 us, axes: [Z]}", "recording.interval=1 ms")
    native, python = both(folder, "z_positioning", *overrides, torque_feedforward={"Z": torque})
    assert native.fine is not None
    assert_same(native, python)
    without, _ = both(folder, "z_positioning", *overrides)
    assert np.abs(without.trace["Z.x_a"] - native.trace["Z.x_a"]).max() > 1e-6, "the torque must do something"


@pytest.mark.parametrize(
    ("inject", "options"),
    [
        ("M_add", {}),
        ("n_add", {"friction": True, "offset_speed": 5.0}),
        ("tool.F_X", {"friction": True}),
        ("tool.F_Z", {"periods": 1, "settle": 0}),
    ],
)
def test_same_bits_under_excitation(inject: str, options: dict[str, Any], folder: Path) -> None:
    machine = default_machine()
    excitation = multisine(machine.cycles, usual_rms(machine, "Z", inject), band=(50.0, 1000.0), resolution=25.0)
    native, python = (
        measure(machine, "Z", excitation, inject=inject, fmus=folder, native=wanted, **options)
        for wanted in (True, False)
    )
    assert list(native.trace) == list(python.trace)
    for column in native.trace:
        np.testing.assert_array_equal(native.trace[column], python.trace[column], err_msg=column)
    assert np.ptp(native.trace["Z.x_a"]) > 0


def messages(act: Callable[[bool], object], kind: type[Exception]) -> tuple[str, str]:
    texts = []
    for native in (True, False):
        with pytest.raises(kind) as caught:
            act(native)
        texts.append(str(caught.value))
    return texts[0], texts[1]


@pytest.mark.parametrize("substeps", [1, 2])
def test_failed_step_is_told_alike(substeps: int, folder: Path) -> None:
    overrides = [f"machine.axes.Z.drive.{e}" for e in ("K_p=1e300 N.m.s/rad", "M_max=1e308 N.m", "u_max=1e308 V")]
    overrides += [*SHORT["z_positioning"], "machine.axes.Z.drive.ideal_current_loop=true"]
    loaded = scenario.load(SCENARIOS / "z_positioning.yaml", [*overrides, f"coupling.substeps={substeps}"])
    native, python = messages(lambda native: judge_run(cosim.run(loaded, fmus=folder, native=native)), SimulationError)
    assert native == python
    assert "s failed: " in native


@pytest.mark.parametrize("after", [False, True])
@pytest.mark.parametrize(("unit", "variable"), [("controller_X", "M_add"), ("plant", "tool.F_X")])
def test_refused_input_is_told_alike_with_the_time(unit: str, variable: str, after: bool, folder: Path) -> None:
    loaded = scenario.load(SCENARIOS / "z_positioning.yaml", [*SHORT["z_positioning"]])
    program = nc.plan(loaded)
    values = np.zeros((1000, 1))
    values[700] = np.nan

    def act(native: bool) -> None:
        with System(loaded.machine, folder) as system:
            cycle = Cycle(system, SCHEMES["extrapolated"], 125e-6, 2)
            send = set_real(Port(system.units[unit], [variable]), values)
            loop = Loop(
                cycle, [] if after else send, send if after else [], exchange.choose_native_loop(native, folder)[0]
            )
            system.initialise(program, stop=1.0)
            loop.run(1000)

    native, python = messages(act, SimulationError)
    assert native == python
    stands = 0.087625 if after else 0.0875  # 700 cycles of 125 us, or one more
    assert native.startswith(f"unit {unit}, t = {stands} s: setting {variable} failed: ")
    assert "not finite" in native


def test_progress_is_told_alike(folder: Path) -> None:
    def told(native: bool) -> list[tuple[int, int]]:
        calls: list[tuple[int, int]] = []
        report: Progress = lambda done, total: calls.append((done, total))  # noqa: E731
        dwell = ["motions=[{kind: dwell, duration: 600 ms}]", "evaluate=[]"]
        loaded = scenario.load(SCENARIOS / "z_positioning.yaml", dwell)
        cosim.run(loaded, fmus=folder, native=native, progress=report)
        return calls

    native = told(True)
    assert native == told(False)
    assert [done for done, _ in native] == [REPORTED_EVERY, 2 * REPORTED_EVERY, 4800]
    assert {total for _, total in native} == {4800}


@pytest.mark.skipif(not hasattr(signal, "pthread_kill"), reason="no signals to threads on this system")
def test_interrupt_ends_a_native_run(folder: Path) -> None:
    """And other threads work meanwhile: without them the signal would never be sent."""
    loaded = scenario.load(
        SCENARIOS / "z_positioning.yaml", ["motions=[{kind: dwell, duration: 600 s}]", "evaluate=[]"]
    )
    main, begun, seen = threading.get_ident(), threading.Event(), []

    def interrupt() -> None:
        begun.wait()
        time.sleep(0.05)
        signal.pthread_kill(main, signal.SIGINT)

    def progress(done: int, total: int) -> None:
        seen.append((done, total))
        begun.set()

    sender = threading.Thread(target=interrupt)
    sender.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            cosim.run(loaded, fmus=folder, native=True, progress=progress)
    finally:
        begun.set()
        sender.join()
    assert seen[-1][0] < seen[-1][1]


def with_library(folder: Path, tmp_path: Path, content: bytes | None) -> Path:
    for archive in folder.glob("*.fmu"):
        (tmp_path / archive.name).symlink_to(archive.resolve())
    if content is not None:
        (tmp_path / exchange.LIBRARY_NAME).write_bytes(content)
    return tmp_path


def run_short(folder: Path, **options: Any) -> JudgedRun:
    """With the archives of `folder`, which is the folder of the built ones as well."""
    loaded = scenario.load(
        SCENARIOS / "z_positioning.yaml", ["motions=[{kind: dwell, duration: 20 ms}]", "evaluate=[]"]
    )
    with patch.dict(os.environ, FEEDSIM_FMUS=str(folder)):
        return judge_run(cosim.run(loaded, **options))


def test_archives_from_elsewhere_use_the_built_loop(folder: Path, tmp_path: Path) -> None:
    """Those of an SSP file lie in a folder of their own, without one."""
    loaded = scenario.load(
        SCENARIOS / "z_positioning.yaml", ["motions=[{kind: dwell, duration: 20 ms}]", "evaluate=[]"]
    )
    with patch.dict(os.environ, FEEDSIM_FMUS=str(folder)):
        assert cosim.run(loaded, fmus=with_library(folder, tmp_path, None)).native


def told_of_loop(run: JudgedRun) -> list[Finding]:
    return [finding for finding in run.warnings if finding.code == "native-loop-missing"]


def test_without_a_library_python_serves_and_says_so(folder: Path, tmp_path: Path) -> None:
    bare = with_library(folder, tmp_path, None)
    run = run_short(bare)
    assert not run.native
    (told,) = told_of_loop(run)
    assert told.severity == "note"
    assert f"{exchange.LIBRARY_NAME}: no such file beside the archives" in told.text
    assert str(bare) not in told.text
    assert not told_of_loop(run_short(bare, native=False)), "Python was asked for"
    with pytest.raises(InputError, match=r"no native cycle loop that fits this version: .* `make fmus` builds"):
        run_short(bare, native=True)
    unasked = run_short(folder)
    assert unasked.native
    assert not told_of_loop(unasked)


def test_library_that_is_none_is_left_alone(folder: Path, tmp_path: Path) -> None:
    broken = with_library(folder, tmp_path, b"no library at all")
    run = run_short(broken)
    assert not run.native
    (told,) = told_of_loop(run)
    assert "cannot be used" in told.text
    assert str(broken) not in told.text


def test_a_copy_of_a_library_is_not_loaded_again(folder: Path, tmp_path: Path) -> None:
    """Workers get one with each study, and nothing unloads it."""
    content = (folder / exchange.LIBRARY_NAME).read_bytes()
    copies = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        (tmp_path / name / exchange.LIBRARY_NAME).write_bytes(content)
        copies.append(exchange.library(tmp_path / name))
    assert not isinstance(copies[0], str)
    assert copies[0] is copies[1]


def test_stale_library_is_left_alone(folder: Path, tmp_path: Path) -> None:
    """Built from sources with another interface; its loop would do something else."""
    source = tmp_path / "stale.c"
    source.write_text(
        '#include <stdlib.h>\nconst char *exchange_interface(void) { return "0: step"; }\n'
        "int exchange_run(void) { abort(); }\n"
    )
    library = tmp_path / exchange.LIBRARY_NAME
    compiler = shlex.split(os.environ.get("CC", "cc"))
    subprocess.run([*compiler, "-shared", "-fPIC", str(source), "-o", str(library)], check=True)
    stale = with_library(folder, tmp_path, None)
    run = run_short(stale)
    assert not run.native
    (told,) = told_of_loop(run)
    assert "built from other sources (its interface is '0: step'" in told.text
