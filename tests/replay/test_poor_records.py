"""Records that determine a part of a drive: torque cut off, position alone, one direction, a torque of no motion."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drive_helpers import COLUMNS, MACHINES, SCENARIO, logged
from feedsim.cli import main
from feedsim.estimation.replay.closed_loop import cut_window, read_axes
from feedsim.estimation.replay.identified import DrivesFound, identify_drives
from feedsim.files.columns import load_columns
from feedsim.files.trace import write_csv
from feedsim.scenario import Machine, load, load_machine
from feedsim.simulation.cosim import run
from feedsim.structure import checked_modes
from machine_helpers import rigid_copy

GENTLE = """
name: gentle
machine: {machine}
motions:
  - {{kind: dwell, duration: 0.05 s}}
  - {{kind: move, by: {{X: 12 mm}}, feed: 9000 mm/min}}
  - {{kind: dwell, duration: 0.05 s}}
  - {{kind: move, by: {{X: -8 mm}}, feed: 5000 mm/min}}
  - {{kind: dwell, duration: 0.05 s}}
recording: {{interval: 1 ms}}
logging: {{interval: 2 ms, axes: [X], signals: [x_s, x_a, M_a], noise: {{M_a: 2 %, x_a: 0.1 um}}, seed: {seed}}}
"""


def simple_axis(
    folder: Path, monkeypatch: pytest.MonkeyPatch, *, limit: float = 1.0, seed: int = 1
) -> tuple[Machine, DrivesFound]:
    """A rigid axis whose friction has no further parts, and its drive from position, setpoint and torque.

    limit: share of the largest torque at which the record is cut off; the axis had all of it.
    """
    monkeypatch.setattr(
        "feedsim.estimation.replay.drive.friction_parts", lambda problem, found, progress: ((), {}, found, [])
    )
    machine = rigid_copy(MACHINES / "sinumerik_840d", folder / "rigid")
    (folder / "moves.yaml").write_text(GENTLE.format(machine=machine, seed=seed))
    axis = "machine.axes.X"
    changes = [f"{axis}.drive.K_p=6.5 N.m.s/rad", f"{axis}.drive.T_n=4.9 ms", f"{axis}.max_acceleration=10 m/s^2",
               f"{axis}.friction.F_log=0 N.m", f"{axis}.friction.gamma=1"]  # fmt: skip
    scenario = load(folder / "moves.yaml", changes)
    log = run(scenario).log
    assert log is not None
    torque = np.asarray(log.columns["X.M_a"])
    most = limit * float(np.max(np.abs(torque)))
    write_csv(folder / "log.csv", replace(log, columns={**log.columns, "X.M_a": np.clip(torque, -most, most)}))
    (folder / "columns.yaml").write_text(COLUMNS.replace("deviation: {column: X.x_e}\n", ""))
    read = read_axes(folder / "log.csv", ["X"], None, load_columns(folder / "columns.yaml"))
    records = {"X": cut_window("X", read["X"], None)}
    return scenario.machine, identify_drives(read, records, None, [], "made", "by a test", position_cycle=125e-6)


@pytest.mark.extensive
@pytest.mark.parametrize("limit", [0.8, 0.65])
def test_torque_that_is_cut_off_determines_nothing(
    limit: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A record that ends at a share of the largest torque: J came out 3 and 11 % small, four standard deviations."""
    true, found = simple_axis(tmp_path, monkeypatch, limit=limit)
    one, J = found.drives["X"].estimates, checked_modes(true).J_tot("X")
    assert one["J"].value == pytest.approx(J, rel=0.01)
    assert one["J"].status == one["K_p"].status == "estimated"
    for name, value in (("J", J), ("K_p", 6.5), ("F_C", true.axes["X"].friction.F_C)):
        assert one[name].interval[0] <= value <= one[name].interval[1], name
    # Where a fourth of the rows is cut off, the rest of them do not separate the two, though the axis moves both ways.
    assert limit == 0.8 or one["F_C"].reason.startswith("torque that is not cut off determines only M_0 + friction")
    (said,) = found.clipped
    assert (said.code, said.place) == ("record-clipped", "X")
    assert said.text.startswith("axis X: log.csv: the torque is cut off at +")
    assert "the torque of these rows is left out of the fit" in said.text


def test_a_record_of_the_position_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither following error nor speed setpoint: feedforward and delays show as one lag. T_sym came out at 2.6 ms (0.8
    to 4.4) where it is 0.6 ms, and k_ffw at 1.07, as estimated, in a fit that meets the record to its noise."""
    true, found = simple_axis(tmp_path, monkeypatch)
    one, own = found.drives["X"].estimates, true.axes["X"].drive
    assert not found.clipped
    for name in ("k_ffw", "T_sym", "T_dyn"):
        assert one[name].status == "undetermined", name
        assert one[name].reason.startswith("without the control's own following error only the lag shows"), name
        assert one[name].interval[0] <= getattr(own, name) <= one[name].interval[1], name
    assert one["K_v"].reason.startswith("without the control's own speed setpoint it rests on an axis")
    lag = one["T_dyn"].value + one["T_sym"].value + (1 - one["k_ffw"].value) / one["K_v"].value
    assert lag == pytest.approx(own.T_dyn + own.T_sym + (1 - own.k_ffw) / own.K_v, abs=5e-6)
    assert one["J"].interval[0] <= checked_modes(true).J_tot("X") <= one["J"].interval[1]


@pytest.mark.parametrize("torque", [True, False], ids=["torque", "no torque"])
def test_a_record_of_the_position_alone_on_a_known_machine(torque: bool, tmp_path: Path) -> None:
    """The structure is known, and the lag is shared as it is without: T_sym and k_ffw were called estimated."""
    known = MACHINES / "one_axis"
    path = logged(tmp_path, "X", "M_a: 2 %, x_a: 0.1 um", machine=known)
    columns = COLUMNS.replace("deviation: {column: X.x_e}\n", "")
    (tmp_path / "columns.yaml").write_text(columns if torque else columns.replace("torque: {column: X.M_a}\n", ""))
    words = [str(path), "--axes", "X", "--columns", str(tmp_path / "columns.yaml"), "--machine", str(known)]
    assert main(["identify", "drive", *words, "--quiet", "--out", str(tmp_path / "own")]) == 0
    found = json.loads((tmp_path / "own" / "summary.json").read_text())["axes"]["X"]["parameters"]
    true = load_machine(known).axes["X"].drive
    for name in ("k_ffw", "T_sym", "T_dyn"):
        assert found[name]["status"] == "undetermined", name
        assert found[name]["reason"].startswith("without the control's own following error only the lag shows"), name
        assert abs(found[name]["value"] - getattr(true, name)) <= 2 * found[name]["sigma"], name
    value = {name: found[name]["value"] for name in found}
    lag = value["T_dyn"] + value["T_sym"] + (1 - value["k_ffw"]) / value["K_v"]
    assert lag == pytest.approx(true.T_dyn + true.T_sym + (1 - true.k_ffw) / true.K_v, abs=20e-6)


ONE_WAY = """
name: one_way
machine: {machine}
motions:
  - {{kind: dwell, duration: 0.05 s}}
  - {{kind: move, by: {{Y: {by} mm}}, feed: {feed} mm/min}}
  - {{kind: dwell, duration: 0.1 s}}
recording: {{interval: 1 ms}}
logging:
  {{interval: 2 ms, axes: [Y], signals: [x_s, x_a, x_e, n_s, M_a], noise: {{M_a: 0.3 N.m, x_a: 0.3 um}}, seed: {seed}}}
"""


@pytest.mark.extensive
def test_an_axis_that_is_refused_does_not_take_another_along(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """X moves both ways, Y stands still or is not in the record: X is written as by itself, the status is 1, and the
    reason is there."""
    monkeypatch.setattr(
        "feedsim.estimation.replay.drive.friction_parts", lambda problem, found, progress: ((), {}, found, [])
    )
    text = GENTLE.format(machine=MACHINES / "sinumerik_840d", seed=1).replace("axes: [X]", "axes: [X, Y]")
    (tmp_path / "moves.yaml").write_text(text)
    log = run(load(tmp_path / "moves.yaml", ["machine.axes.X.max_acceleration=10 m/s^2"])).log
    assert log is not None
    write_csv(tmp_path / "log.csv", log)
    (tmp_path / "columns.yaml").write_text(COLUMNS.replace("axis: X\n", "").replace("deviation: {column: X.x_e}\n", ""))
    record = [str(tmp_path / "log.csv"), "--position-cycle", "125us", "--quiet"]
    own = ["--columns", str(tmp_path / "columns.yaml"), "--out", str(tmp_path / "X")]
    assert main(["identify", "drive", *record, "--axes", "X", *own]) == 0
    machine = ["--machine", str(MACHINES / "sinumerik_840d")]
    assert main(["identify", "drive", *record, "--axes", "X,Y", *machine, "--out", str(tmp_path / "known")]) == 1
    known = json.loads((tmp_path / "known" / "summary.json").read_text())
    assert list(known["axes"]) == ["X"]
    assert not (tmp_path / "known" / "drive_Y.yaml").exists()
    said = capsys.readouterr().err
    assert f"WRONG: axis Y has no drive: {known['refused']['Y']}" in said
    assert "axis Y" in known["refused"]["Y"]
    # Without the machine the record lacks the pitch of both: nothing is written.
    assert main(["identify", "drive", *record, "--axes", "X,Y", "--out", str(tmp_path / "none")]) == 2
    assert not (tmp_path / "none").exists()


@pytest.mark.extensive
@pytest.mark.parametrize(("by", "feed"), [(-3.0, 350.0), (-30.0, 6000.0), (60.0, 18000.0), (5.0, 600.0)])
def test_motion_of_a_loaded_axis_in_one_direction(
    by: float, feed: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An axis under its weight, moved one way: weight and friction are one sum. Either the weight comes out within
    10 %, in an interval that holds it, or the record is refused with that sum. It came out near 0, with status 0."""
    machine = MACHINES / "sinumerik_840d"
    (tmp_path / "moves.yaml").write_text(ONE_WAY.format(machine=machine, by=by, feed=feed, seed=1))
    log = run(load(tmp_path / "moves.yaml", ["machine.axes.Y.max_acceleration=10 m/s^2"])).log
    assert log is not None
    write_csv(tmp_path / "log.csv", log)
    (tmp_path / "columns.yaml").write_text(COLUMNS.replace("X", "Y") + "speed_setpoint: {column: Y.n_s}\n")
    words = [str(tmp_path / "log.csv"), "--axes", "Y", "--columns", str(tmp_path / "columns.yaml"), "--quiet", "--out"]
    status = main(["identify", "drive", *words, str(tmp_path / "own")])
    true = load_machine(machine).axes["Y"].M_0
    if status == 0:
        found = json.loads((tmp_path / "own" / "summary.json").read_text())["axes"]["Y"]["parameters"]["M_0"]
        assert found["status"] == "undetermined"
        assert "motion in one direction determines only M_0" in found["reason"]
        assert found["value"] == pytest.approx(true, rel=0.1)
        assert abs(found["value"] - true) <= 2 * found["sigma"]
    else:
        assert status == 2
        said = re.search(r"determines only M_0 ([+-]) friction: ([\d.]+) N.m", capsys.readouterr().err)
        assert said is not None
        assert said[1] == ("+" if by > 0 else "-")
        friction = load_machine(machine).axes["Y"].friction.F_C
        # At speed the logarithmic and the viscous part add up to 1.6 N.m.
        assert float(said[2]) == pytest.approx(true + np.sign(by) * friction, abs=2.0)
        assert not (tmp_path / "own" / "summary.json").exists()


@pytest.mark.extensive
def test_a_fit_that_leaves_most_of_the_torque_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A torque that is not of this motion: no drive is written, and the status says so."""
    machine = rigid_copy(MACHINES / "sinumerik_840d", tmp_path / "rigid")
    (tmp_path / "moves.yaml").write_text(SCENARIO.format(machine=machine, axis="X", noise="M_a: 0.1 N.m", seed=1))
    log = run(load(tmp_path / "moves.yaml")).log
    assert log is not None
    torque = np.asarray(log.columns["X.M_a"])
    beside = 2 * np.std(torque) * np.sin(2 * np.pi * 41 * 2e-3 * np.arange(len(torque)))
    write_csv(tmp_path / "log.csv", replace(log, columns={**log.columns, "X.M_a": torque + beside}))
    (tmp_path / "columns.yaml").write_text(COLUMNS)
    words = [str(tmp_path / "log.csv"), "--axes", "X", "--columns", str(tmp_path / "columns.yaml"), "--quiet", "--out"]
    assert main(["identify", "drive", *words, str(tmp_path / "own")]) == 2
    assert re.search(r"axis X: the best fit leaves [\d.]+ N.m rms of a torque of [\d.]+ N.m", capsys.readouterr().err)
    assert not (tmp_path / "own").exists()
