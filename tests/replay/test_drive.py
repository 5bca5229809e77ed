"""Drives out of logs of simulated machines, whose parameters are known."""

from __future__ import annotations

import json
import re
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agreement_helpers import assert_numbers_agree
from drive_helpers import COLUMNS, MACHINES, SCENARIO, identified, logged
from feedsim.cli import main
from feedsim.estimation.identify import Record
from feedsim.estimation.replay.closed_loop import AxisRecord, read_axes
from feedsim.estimation.replay.drive import DriveFound, feedforward_of
from feedsim.estimation.replay.identified import _refuse_implausible
from feedsim.estimation.replay.tuning import Problem
from feedsim.files.columns import load_columns
from feedsim.files.trace import write_csv
from feedsim.files.trace.trace import Array
from feedsim.foundation import parallel
from feedsim.foundation.errors import InputError
from feedsim.scenario import load, load_machine
from feedsim.simulation.cosim import run
from feedsim.structure import checked_modes
from machine_helpers import rigid_copy

OFF = ["T_n=16 ms", "K_v=3.5 (m/min)/mm", "T_dyn=1 ms", "T_sym=3 ms", "k_ffw=98 %",
       "omega_0=800 rad/s", "D=1.4"]  # fmt: skip
TRUE = ("K_v", "k_ffw", "T_dyn", "T_sym", "K_p", "T_n", "omega_0", "D")


@pytest.mark.parametrize(("machine", "axis"), [("one_axis", "X")])
def test_the_shipped_drive_comes_back(machine: str, axis: str, tmp_path: Path) -> None:
    """From a log of 2 ms without noise, beginning with other values, within 1 %: in fact to the digits of the log."""
    true = load_machine(MACHINES / machine).axes[axis].drive
    off = load_machine(
        MACHINES / machine, [f"axes.{axis}.drive.{each}" for each in (*OFF, f"K_p={0.8 * true.K_p} N.m.s/rad")]
    )
    found, files = identified(logged(tmp_path, axis, machine=MACHINES / machine), axis, off)
    for name in TRUE:
        # T_dyn is 0 here: as a regression over rows has it, to a microsecond.
        assert found.estimates[name].value == pytest.approx(getattr(true, name), rel=1e-3, abs=1e-6), name
        assert found.estimates[name].status == "estimated", name
    assert set(files) == {f"drive_{axis}.yaml", f"friction_{axis}.yaml"}
    # What is written is a drive that machines take, the filters and the motor of the machine included.
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    own = load_machine(MACHINES / machine, [f"axes.{axis}.drive={tmp_path}/drive_{axis}.yaml"]).axes[axis].drive
    assert own.filter_1 == true.filter_1
    for name in ("K_p", "T_n"):
        assert getattr(own.current, name) == pytest.approx(getattr(true.current, name), rel=1e-7)
    assert own.K_p == pytest.approx(true.K_p, rel=1e-3)


@pytest.mark.parametrize("weight", ["0 %", "60 %", "100 %"])
def test_a_fit_begins_with_the_feedforward_of_the_record(weight: str, tmp_path: Path) -> None:
    """A lag by v/K_v and a delay of the setpoint look alike: from a wrong feedforward a fit ends 5 ms off the truth. It
    is a start value, from channels that a log has a cycle apart."""
    scenario = SCENARIO.format(machine=MACHINES / "one_axis", axis="X", noise="", seed=1)
    (tmp_path / "moves.yaml").write_text(scenario)
    changes = [f"machine.axes.X.drive.k_ffw={weight}", "machine.axes.X.drive.K_v=2 (m/min)/mm"]
    log = run(load(tmp_path / "moves.yaml", changes)).log
    assert log is not None
    write_csv(tmp_path / "log.csv", log)
    (tmp_path / "columns.yaml").write_text(
        COLUMNS + "speed_setpoint: {column: X.n_s}\nfeedforward: {column: X.n_ffw}\n"
    )
    read = read_axes(tmp_path / "log.csv", ["X"], None, load_columns(tmp_path / "columns.yaml"))
    found = feedforward_of(read["X"].records)
    assert found == pytest.approx(float(weight.split()[0]) / 100, abs=0.03)


@pytest.mark.statistics
def test_intervals_hold_the_truth_under_noise(tmp_path: Path) -> None:
    """5 % noise on the torque, 0.3 um on the position: 8 parameters from 3 logs, 95 % each, 4 of 24 may miss."""
    machine = load_machine(MACHINES / "one_axis")
    true = machine.axes["X"].drive
    misses = 0
    for seed in (1, 2, 3):
        noise = "M_a: 5 %, x_a: 0.3 um, x_e: 0.3 um, n_s: 1 %"
        found, _ = identified(logged(tmp_path, "X", noise, seed, MACHINES / "one_axis"), "X", machine)
        for name in TRUE:
            each = found.estimates[name]
            if each.status == "estimated":
                misses += not each.interval[0] <= getattr(true, name) <= each.interval[1]
    assert misses <= 4


def assert_same_on_one_core_and_on_three(monkeypatch: pytest.MonkeyPatch, identify: Callable[[], DriveFound]) -> None:
    found = []
    for cores in (1, 3):
        monkeypatch.setattr(parallel, "cores", lambda cores=cores: cores)
        found.append(identify())
    assert found[0].estimates == found[1].estimates
    assert found[0].parts == found[1].parts
    assert [(one.name, one.gain, one.taken) for one in found[0].rivals] == [
        (one.name, one.gain, one.taken) for one in found[1].rivals
    ]
    assert found[0].runs == found[1].runs


def test_the_values_are_the_same_with_one_core_and_with_several(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To the last bit, and so is the number of runs: threads share the runs of a Jacobian."""
    machine = load_machine(MACHINES / "one_axis")
    log = logged(tmp_path, "X", "M_a: 2 %", machine=MACHINES / "one_axis")
    assert_same_on_one_core_and_on_three(monkeypatch, lambda: identified(log, "X", machine)[0])


@pytest.mark.extensive
def test_structures_tried_side_by_side_are_those_of_one_core(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of an axis whose structure is not known: parts of the friction law and rival structures, fitted in processes."""
    monkeypatch.setattr(threading, "active_count", lambda: 1)  # whatever other tests have started in this process
    log = logged(tmp_path, "X", "M_a: 2 %", machine=MACHINES / "one_axis")
    (tmp_path / "columns.yaml").write_text(COLUMNS)
    mapping = load_columns(tmp_path / "columns.yaml")
    assert_same_on_one_core_and_on_three(monkeypatch, lambda: identified(log, "X", mapping=mapping)[0])


def test_a_problem_does_not_see_what_others_beside_it_change(monkeypatch: pytest.MonkeyPatch) -> None:
    """Start and weights are its own, runs are summed up: the same with one core and with three."""
    monkeypatch.setattr(threading, "active_count", lambda: 1)  # whatever other tests have started in this process
    nothing: Any = None
    for cores in (1, 3):
        monkeypatch.setattr(parallel, "cores", lambda cores=cores: cores)
        problem = Problem(nothing, nothing, nothing, {"J": 1.0}, None, 1.0, {}, np.arange(3), runs=5)

        def change(beside: Problem, value: float) -> dict[str, float]:
            before = beside.start
            beside.start, beside.runs = beside.start | {"J": value}, beside.runs + int(value)
            return before

        done = problem.branch(change, [2.0, 3.0, 4.0])
        assert [before for before, _ in done] == 3 * [{"J": 1.0}]
        assert [beside.start["J"] for _, beside in done] == [2.0, 3.0, 4.0]
        assert problem.start == {"J": 1.0}
        assert problem.runs == 5 + 2 + 3 + 4


@pytest.mark.extensive
def test_a_rigid_machine_is_written_whole(tmp_path: Path) -> None:
    """Without a machine: a folder is made that the master runs. The axis is not rigid, and its control has a current
    loop and a reference model that a rigid machine leaves out: its inertia comes out within 5 % all the same."""
    path = logged(tmp_path, "X", machine=MACHINES / "one_axis")
    (tmp_path / "columns.yaml").write_text(COLUMNS)
    found, files = identified(path, "X", mapping=load_columns(tmp_path / "columns.yaml"))
    folder = tmp_path / "own"
    folder.mkdir()
    for name, text in files.items():
        (folder / name).write_text(text)
    own, true = load_machine(folder), load_machine(MACHINES / "one_axis")
    assert own.axes["X"].pitch == pytest.approx(true.axes["X"].pitch)
    J = checked_modes(true).J_tot("X")
    assert checked_modes(own).J_tot("X") == pytest.approx(J, rel=0.05)
    # Nothing in this record tells K_v without the structure: it is not offered as an estimate.
    assert found.estimates["K_v"].status == "undetermined"
    # The structure bends, a rigid axis does not: some micrometres are left of a way of 20 mm.
    assert found.position < 5e-6


@pytest.mark.extensive
def test_the_cycle_of_the_position_loop_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A control that closes its position loop every 2 ms and logs it as the real one does, exact to the digits: taken
    for a drive that closes the loop every 125 us, the record was met to 10 um with T_sym at its bound of 0."""
    machine = rigid_copy(MACHINES / "sinumerik_840d", tmp_path / "rigid")
    drive = ["axes.X.drive.K_p=6.5 N.m.s/rad", "axes.X.drive.T_n=4.9 ms"]
    axis = load_machine(machine, drive).axes["X"]
    true, I_P = axis.drive, axis.I_P
    (tmp_path / "moves.yaml").write_text(
        SCENARIO.format(machine=machine, axis="X", noise="M_a: 0.2 N.m, x_a: 0.3 um", seed=1)
    )
    log = run(
        load(tmp_path / "moves.yaml", ["machine.cycles.position=2 ms", *(f"machine.{each}" for each in drive)])
    ).log
    assert log is not None
    x_s, x = np.asarray(log.columns["X.x_s"]), np.asarray(log.columns["X.x_a"])

    def earlier(rows: int) -> Array:
        return np.concatenate([np.full(rows, x_s[0]), x_s])[: len(x_s)]

    feed = np.diff(x_s, prepend=x_s[0]) / 2e-3
    own = {
        "X.x_e": 0.875 * earlier(4) + 0.125 * earlier(5) - x,  # 8.25 ms
        "X.n_ffw": feed / I_P,
        "X.n_s": (feed + true.K_v * (0.5 * earlier(1) + 0.5 * earlier(2) - x)) / I_P,
    }
    write_csv(tmp_path / "log.csv", replace(log, columns={**log.columns, **own}))
    (tmp_path / "columns.yaml").write_text(
        COLUMNS + "speed_setpoint: {column: X.n_s}\nfeedforward: {column: X.n_ffw}\n"
    )
    words = [str(tmp_path / "log.csv"), "--axes", "X", "--columns", str(tmp_path / "columns.yaml"), "--quiet", "--out"]
    assert main(["identify", "drive", *words, str(tmp_path / "own")]) == 0
    assert "position cycles of 2 ms (taken) and 0.125 ms (--position-cycle) the record speaks for the former" in (
        capsys.readouterr().err
    )
    assert load_machine(tmp_path / "own").cycles.T_pos == 2e-3
    summary = json.loads((tmp_path / "own" / "summary.json").read_text())
    assert summary["figures"]["X.position_rms"]["value"] < 0.4  # um, of which 0.3 um are noise
    found = summary["axes"]["X"]["parameters"]
    # The log has the torque at one phase of that cycle: the rigid line is 25 % too small, the units know the phase.
    for name, value in (("J", checked_modes(load_machine(machine)).J_tot("X")), ("K_p", true.K_p)):
        assert found[name]["status"] == "estimated", name
        assert abs(found[name]["value"] - value) <= 2 * found[name]["sigma"], name
        assert found[name]["value"] == pytest.approx(value, rel=0.1), name
    assert found["T_sym"]["value"] == pytest.approx(true.T_sym, abs=0.05e-3)
    assert found["k_ffw"]["value"] == pytest.approx(true.k_ffw, abs=1e-4)


def test_a_setpoint_that_is_the_position_itself(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Without a distance between them nothing shows the drive: a load came out 2 N.m too large, within 0.3 N.m."""
    path = logged(tmp_path, "X", machine=MACHINES / "one_axis")
    (tmp_path / "columns.yaml").write_text(COLUMNS.replace("setpoint: {column: X.x_s}", "setpoint: {column: X.x_a}"))
    words = [str(path), "--axes", "X", "--columns", str(tmp_path / "columns.yaml"), "--out", str(tmp_path / "out")]
    for more in ([], ["--machine", str(MACHINES / "one_axis")]):
        assert main(["identify", "drive", *words, *more]) == 2
        said = capsys.readouterr().err
        assert "axis X: the position setpoint is the recorded position (largest difference 0 nm of a way" in said
        assert not (tmp_path / "out").exists()


def test_an_axis_at_rest_is_not_its_own_setpoint() -> None:
    """What is missing there is motion, and a later check says so."""
    time = 1e-3 * np.arange(100)
    still = Record("made", time=time, torque=np.zeros(100), angle=np.ones(100), setpoint=np.ones(100))
    each = AxisRecord("X", still, 1.0, np.ones(100, dtype=bool))
    _refuse_implausible(each)
    moved = replace(each, record=replace(still, angle=time, setpoint=time))
    with pytest.raises(InputError, match="axis X: the position setpoint is the recorded position"):
        _refuse_implausible(moved)


def test_a_log_without_torque(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Position, setpoint and speed setpoint tell the position loop, and the position the speed controller, with the
    machine's friction. The replay has no torque to compare. What needs one says so."""
    path = logged(tmp_path, "X", machine=MACHINES / "one_axis")
    roles = {"position": "x_a", "setpoint": "x_s", "deviation": "x_e", "speed_setpoint": "n_s", "feedforward": "n_ffw"}
    mapping = tmp_path / "columns.yaml"
    mapping.write_text("\n".join([f"{role}: {{column: X.{name}}}" for role, name in roles.items()] + ["pitch: 10 mm"]))
    machine = ["--machine", str(MACHINES / "one_axis")]
    words = [str(path), "--axes", "X", "--columns", str(mapping), "--quiet", "--out"]
    assert main(["replay", *words, str(tmp_path / "replay"), *machine]) == 0
    figures = json.loads((tmp_path / "replay" / "summary.json").read_text())["figures"]
    assert figures["X.position_rms"]["value"] < 1e-3
    assert not [name for name in figures if "torque" in name]
    off = [f"--set=axes.X.drive.{each}" for each in ("K_v=3.5 (m/min)/mm", "T_sym=3 ms", "k_ffw=98 %", "T_n=16 ms")]
    assert main(["identify", "drive", *words, str(tmp_path / "drive"), *machine, *off]) == 0
    said = json.loads((tmp_path / "drive" / "summary.json").read_text())["answer"]
    assert re.match(r"X: K_v 4\.00 .* that the record determines\)\. It meets the position to .* um rms ", said[0]), (
        said
    )
    assert 'class="answer">X: K_v' in (tmp_path / "drive" / "report.html").read_text(encoding="utf-8")
    assert_numbers_agree(tmp_path / "drive")
    true = load_machine(MACHINES / "one_axis").axes["X"].drive
    found = json.loads((tmp_path / "drive" / "summary.json").read_text())["axes"]["X"]["parameters"]
    for name in ("K_v", "k_ffw", "T_sym", "K_p"):
        assert found[name]["value"] == pytest.approx(getattr(true, name), rel=0.01), name
    assert main(["identify", "drive", *words, str(tmp_path / "none")]) == 2
    assert "no torque, current or force is recorded" in capsys.readouterr().err
    assert (
        main(
            [
                "identify",
                "friction",
                str(path),
                "--axes",
                "X",
                "--columns",
                str(mapping),
                "--out",
                str(tmp_path / "none"),
            ]
        )
        == 2
    )
    assert "columns.yaml:1: missing: one of torque, current, force" in capsys.readouterr().err
