"""Modes of one axis at the scale of another one, out of a log of a simulated machine that has such a mode."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from feedsim.estimation.identify import Record
from feedsim.estimation.least_squares import NORMAL_95
from feedsim.estimation.replay.closed_loop import AxisRecord, Replay, cut_window, read_axes
from feedsim.estimation.replay.identified import _couple_modes, fit_coupled_shapes
from feedsim.estimation.replay.machine_files import CoupledShape, ElasticMode, RigidAxis, machine_files, with_modes
from feedsim.files.columns import load_columns
from feedsim.files.trace import write_csv
from feedsim.foundation.errors import InputError
from feedsim.scenario import Machine, load, load_machine
from feedsim.simulation.cosim import run
from feedsim.structure import checked_modes
from machine_helpers import rigid_copy

MACHINES = Path(__file__).resolve().parents[2] / "scenarios" / "machines"
MODE = ElasticMode(24.0, 0.03, 0.2, 0.2)
SCENARIO = """
name: log
machine: {machine}
motions:
  - {{kind: dwell, duration: 0.1 s}}
  - {{kind: move, by: {{X: 30 mm}}, feed: 12000 mm/min}}
  - {{kind: dwell, duration: 0.3 s}}
  - {{kind: move, by: {{X: -20 mm}}, feed: 8000 mm/min}}
  - {{kind: dwell, duration: 0.3 s}}
  - {{kind: move, by: {{Y: 40 mm}}, feed: 5000 mm/min}}
recording: {{interval: 1 ms}}
logging: {{interval: 2 ms, axes: [X, Y], signals: [x_s, x_a, M_a], noise: {{x_a: 0.05 um}}, seed: 1}}
"""
COLUMNS = """
axis: {axis}
pitch: 10 mm
time: {{column: time}}
position: {{column: {axis}.x_a}}
setpoint: {{column: {axis}.x_s}}
torque: {{column: {axis}.M_a}}
"""


def machine_with(folder: Path, shape: float, mode: ElasticMode = MODE) -> Path:
    """The measured machine with a mode of X that moves the scale of Y by `shape` of the rigid motion of X."""
    elastic = with_modes(load_machine(rigid_copy(MACHINES / "sinumerik_840d", folder)), "X", [mode])
    header, *rows = (elastic.modes.content or b"").decode().splitlines()
    names, values = header.split(","), rows[-1].split(",")
    rigid = dict(zip(names, rows[0].split(","), strict=True))
    values[names.index("x_Y")] = values[names.index("tcp_Y")] = repr(shape * float(rigid["x_X"]))
    (folder / "modes.csv").write_text("\n".join([header, *rows[:-1], ",".join(values)]) + "\n")
    return folder


def logged(folder: Path, machine: Path) -> dict[str, AxisRecord]:
    (folder / "moves.yaml").write_text(SCENARIO.format(machine=machine))
    log = run(load(folder / "moves.yaml")).log
    assert log is not None
    write_csv(folder / "log.csv", log)
    records = {}
    for axis in "XY":
        (folder / f"{axis}.yaml").write_text(COLUMNS.format(axis=axis))
        read = read_axes(folder / "log.csv", [axis], None, load_columns(folder / f"{axis}.yaml"))
        records[axis] = cut_window(axis, read[axis], None)
    return records


@pytest.mark.parametrize("shape", [0.04, -0.15])
def test_the_shape_at_the_other_scale_comes_back(shape: float, tmp_path: Path) -> None:
    """Within 5 %, by records of 2 ms with 0.05 um of noise: Y stands still under its drive while X moves. Y, which is
    rigid, has no mode at the scale of X."""
    records = logged(tmp_path, machine_with(tmp_path / "true", shape))
    known = load_machine(machine_with(tmp_path / "known", 0.0))
    found = fit_coupled_shapes(known, records)
    assert set(found) == {(2, "Y")}
    assert found[2, "Y"].axis == "Y"
    assert found[2, "Y"].shape == pytest.approx(shape, rel=0.05)


def test_the_interval_includes_what_is_not_known_of_the_mode(tmp_path: Path) -> None:
    """A mode that turns its motor 12 % less than it does, and is 0.3 % too low: the shape comes out larger by as much.
    The record alone gives an interval that excludes the truth; with the mode's own deviations it has it."""
    records = logged(tmp_path, machine_with(tmp_path / "true", 0.1))
    off = replace(MODE, frequency=0.997 * MODE.frequency, motor=0.88 * MODE.motor)
    known = load_machine(machine_with(tmp_path / "known", 0.0, off))
    alone = fit_coupled_shapes(known, records)[2, "Y"]
    assert abs(alone.shape - 0.1) > NORMAL_95 * alone.sigma
    spread = (0.003 * MODE.frequency, 0.001, 0.12 * MODE.motor, 0.01)
    whole = fit_coupled_shapes(known, records, spread={2: spread})[2, "Y"]
    assert whole.shape == alone.shape
    assert abs(whole.shape - 0.1) <= NORMAL_95 * whole.sigma < 0.05
    assert fit_coupled_shapes(known, records, spread={2: (0.0, 0.0, 0.0, 0.0)})[2, "Y"].sigma == pytest.approx(
        alone.sigma
    )


def test_axes_that_do_not_move_one_another(tmp_path: Path) -> None:
    """Noise is no coupling; nor is a vibration of Y that X does not drive."""
    machine = machine_with(tmp_path / "true", 0.0)
    records = logged(tmp_path, machine)
    assert fit_coupled_shapes(load_machine(machine), records) == {}
    Y = records["Y"].record
    assert Y.angle is not None
    shaken = replace(Y, angle=Y.angle + 1e-6 / records["Y"].I_P * np.sin(2 * np.pi * 24.0 * Y.time))
    assert fit_coupled_shapes(load_machine(machine), {**records, "Y": replace(records["Y"], record=shaken)}) == {}


def test_a_table_of_modes_has_the_shape(tmp_path: Path) -> None:
    """What is written moves the other axis: its scale, and the tool in its direction."""
    known: Machine = load_machine(rigid_copy(MACHINES / "sinumerik_840d", tmp_path / "known"))

    axes = {}
    for axis in "XY":
        drive = known.shipped_drive(axis, "a test")
        friction = {
            name: float(getattr(known.axes[axis].friction, name))
            for name in type(known.axes[axis].friction).model_fields
            if name != "identified"
        }
        J = checked_modes(known).J_tot(axis)
        limits = {"speed": 1.0, "acceleration": 1.0, "jerk": 10.0, "low": -1.0, "high": 1.0}
        axes[axis] = RigidAxis(10e-3, 0.0, limits, drive, friction | {"J": J, "M_0": 0.0}, {})
    axes["X"] = replace(axes["X"], modes=(replace(MODE, beside=(CoupledShape("Y", 0.04, 0.001),)),))
    (tmp_path / "own").mkdir()
    for name, text in machine_files("made", "by a test", axes, 2e-3, 125e-6).items():
        (tmp_path / "own" / name).write_text(text)
    table = checked_modes(load_machine(tmp_path / "own"))
    assert table.ports["x_Y"][2] == pytest.approx(0.04 * table.ports["x_X"][0])
    assert table.ports["tcp_Y"][2] == table.ports["x_Y"][2]
    assert table.ports["n_Y"][2] == 0


def test_records_with_unlike_gaps() -> None:
    """A mode stays as it is, and a replay of both says what differs."""

    def record(axis: str, count: int) -> AxisRecord:
        time = 2e-3 * np.arange(count)
        made = Record("log.csv", time=time, torque=np.zeros(count), angle=time**2, setpoint=time**2)
        return AxisRecord(axis, made, 1.0, np.ones(count, dtype=bool))

    records = {"X": record("X", 300), "Y": record("Y", 200)}
    mode = ElasticMode(25.0, 0.04, 1.0, 1.0)
    assert _couple_modes({}, {"X": (mode,), "Y": ()}, records, None) == {"X": (mode,), "Y": ()}
    with pytest.raises(InputError, match=r"differ from axis to axis: X 0 to 0\.598 s, Y 0 to 0\.398 s; give a window"):
        Replay(load_machine(MACHINES / "sinumerik_840d"), records)
