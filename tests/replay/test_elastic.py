"""Elastic modes out of logs of simulated axes, whose modes are known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import drive_helpers
from feedsim.estimation.identify import Record
from feedsim.estimation.replay.closed_loop import AxisRecord, cut_window, read_axes
from feedsim.estimation.replay.identified import identify_drives
from feedsim.estimation.replay.machine_files import ElasticMode, resonance, with_modes
from feedsim.files.columns import load_columns
from feedsim.files.trace import write_csv
from feedsim.foundation.errors import InputError
from feedsim.jobs.identify_drive import count_of_modes
from feedsim.scenario import load, load_machine
from feedsim.simulation.cosim import run
from feedsim.structure import checked_modes
from machine_helpers import rigid_copy

SCENARIO = """
name: log
machine: {machine}
motions:
  - {{kind: dwell, duration: 0.1 s}}
  - {{kind: move, by: {{X: 40 mm}}, feed: 15000 mm/min}}
  - {{kind: dwell, duration: 0.2 s}}
  - {{kind: move, by: {{X: -3 mm}}, feed: 1000 mm/min}}
  - {{kind: move, by: {{X: -17 mm}}, feed: 9000 mm/min}}
  - {{kind: dwell, duration: 0.3 s}}
recording: {{interval: 1 ms}}
logging:
  interval: 2 ms
  axes: [X]
  signals: [x_s, x_a, x_e, n_s, n_ffw, M_a]
  noise: {{M_a: 5 %, x_a: 0.1 um}}
  seed: 1
"""
COLUMNS = drive_helpers.COLUMNS + "speed_setpoint: {column: X.n_s}\nfeedforward: {column: X.n_ffw}\n"
TWO = [ElasticMode(24.0, 0.03, 0.2, 0.2), ElasticMode(47.0, 0.02, 0.35, -0.3)]


def test_modes_of_a_simulated_axis_come_back(tmp_path: Path) -> None:
    """Two modes, a log of 2 ms, 5 % noise on the torque and 0.1 um on the position: two modes are found, no more, and
    their frequencies within 2 %. The position is met nearly to its noise (a rigid axis: 0.35 um and more), and what is
    written is a machine with these modes."""
    rigid_copy(drive_helpers.MACHINES / "sinumerik_840d", tmp_path / "true")
    elastic = with_modes(load_machine(tmp_path / "true"), "X", TWO)
    (tmp_path / "true" / "modes.csv").write_bytes(elastic.modes.content or b"")
    (tmp_path / "moves.yaml").write_text(SCENARIO.format(machine=tmp_path / "true"))
    log = run(load(tmp_path / "moves.yaml")).log
    assert log is not None
    write_csv(tmp_path / "log.csv", log)
    (tmp_path / "columns.yaml").write_text(COLUMNS)
    read = read_axes(tmp_path / "log.csv", ["X"], None, load_columns(tmp_path / "columns.yaml"))
    records = {"X": cut_window("X", read["X"], None)}
    found = identify_drives(read, records, None, ["by a test"], "made", "by a test", modes=None)
    one = found.drives["X"]
    assert [mode.frequency for mode in one.modes] == pytest.approx([24.0, 47.0], rel=0.02)
    assert one.position < 0.16e-6
    assert one.modes_predicted[2] < 0.6 * one.modes_predicted[0]
    for name, text in found.files.items():
        (tmp_path / name).write_text(text)
    own = checked_modes(load_machine(tmp_path))
    assert own.frequency[1:] == pytest.approx([mode.frequency for mode in one.modes])
    assert own.ports["n_X"][1] / own.ports["n_X"][0] == pytest.approx(one.modes[0].motor)


def test_a_resonance_is_found_in_what_a_rigid_axis_leaves() -> None:
    """A record that is the rigid motion and the swinging of one resonance, 31 Hz and 3 %, in closed form: within the
    grid of frequencies, 5 % apart, and with its gain."""
    h, w, D = 1e-3, 2 * np.pi * 31.0, 0.03
    t = np.arange(0.0, 1.2, h)
    acceleration = np.where((t > 0.1) & (t < 0.2), 2.0, np.where((t > 0.3) & (t < 0.4), -2.0, 0.0))
    rigid = np.cumsum(np.cumsum(acceleration)) * h**2
    q = np.zeros_like(t)
    damped = w * np.sqrt(1 - D**2)
    for at, step in ((0.1, 2.0), (0.2, -2.0), (0.3, -2.0), (0.4, 2.0)):
        s = np.maximum(t - at, 0.0)
        answer = 1 - np.exp(-D * w * s) * (np.cos(damped * s) + D * w / damped * np.sin(damped * s))
        q += step * answer
    record = Record("made", time=t, torque=np.zeros_like(t), angle=rigid + 1e-6 * q, setpoint=rigid)
    each = AxisRecord("X", record, 1.0, np.ones(len(t), dtype=bool))
    found = resonance(each, rigid, 1, 30.0)
    assert found is not None
    assert found.frequency == pytest.approx(31.0, rel=0.05)
    assert abs(found.gain) == pytest.approx(1e-6, rel=0.3)


def test_how_many_modes_are_meant() -> None:
    """0 to 5 or auto; none where the machine has its own."""
    assert [count_of_modes(text, False) for text in ("0", "5", "auto", 3)] == [0, 5, None, 3]
    assert count_of_modes("0", True) == 0
    for text in ("6", "many", "-1"):
        with pytest.raises(InputError, match=f"modes {text}: 0 to 5, or auto"):
            count_of_modes(text, False)
    with pytest.raises(InputError, match="the structure is that of machine"):
        count_of_modes("auto", True)
