"""Logs of simulated axes for the identification of drives."""

from __future__ import annotations

from pathlib import Path

from feedsim.estimation.identify import RecordedAxis
from feedsim.estimation.replay.closed_loop import AxisRecord, cut_window, read_axes
from feedsim.estimation.replay.drive import DriveFound
from feedsim.estimation.replay.identified import identify_drives
from feedsim.files.columns import Columns
from feedsim.files.trace import write_csv
from feedsim.scenario import Machine, load
from feedsim.simulation.cosim import run

MACHINES = Path(__file__).resolve().parents[1] / "scenarios" / "machines"
SCENARIO = """
name: log
machine: {machine}
motions:
  - {{kind: dwell, duration: 0.1 s}}
  - {{kind: move, by: {{{axis}: 20 mm}}, feed: 10000 mm/min}}
  - {{kind: move, by: {{{axis}: -3 mm}}, feed: 1000 mm/min}}
  - {{kind: move, by: {{{axis}: -7 mm}}, feed: 6000 mm/min}}
  - {{kind: dwell, duration: 0.1 s}}
recording: {{interval: 1 ms}}
logging: {{interval: 2 ms, axes: [{axis}], signals: [x_s, x_a, x_e, n_s, n_ffw, M_a], noise: {{{noise}}}, seed: {seed}}}
"""

COLUMNS = """
axis: X
pitch: 10 mm
time: {column: time}
position: {column: X.x_a}
setpoint: {column: X.x_s}
deviation: {column: X.x_e}
torque: {column: X.M_a}
"""


def logged(folder: Path, axis: str, noise: str = "", seed: int = 1, machine: Path = MACHINES / "test_centre") -> Path:
    text = SCENARIO.format(machine=machine, axis=axis, noise=noise, seed=seed)
    (folder / "moves.yaml").write_text(text)
    found = run(load(folder / "moves.yaml")).log
    assert found is not None
    write_csv(folder / f"log{seed}.csv", found)
    return folder / f"log{seed}.csv"


def identified(
    path: Path,
    axis: str,
    machine: Machine | None = None,
    mapping: Columns | None = None,
    position_cycle: float | None = None,
) -> tuple[DriveFound, dict[str, str]]:
    read: dict[str, RecordedAxis] = read_axes(path, [axis], machine, mapping)
    records: dict[str, AxisRecord] = {axis: cut_window(axis, read[axis], None)}
    found = identify_drives(
        read, records, machine, ["made by a test"], "made", "by a test", position_cycle=position_cycle
    )
    return found.drives[axis], dict(found.files)
