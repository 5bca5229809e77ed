"""Replays from outside: a log of a run on the machine that it was made with, on another one, windows, gaps, faults."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from agreement_helpers import assert_numbers_agree
from feedsim.cli import main
from feedsim.estimation.replay.closed_loop import Replay, cut_window, read_axes
from feedsim.files.trace import Trace, read_csv, write_csv
from feedsim.files.trace.trace import Array
from feedsim.scenario import load, load_machine
from feedsim.simulation.cosim import run
from kinds_helpers import LOGGED as SCENARIO

ROOT = Path(__file__).resolve().parents[2]
MACHINE = ROOT / "scenarios" / "machines" / "test_centre"


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the control of the simulated machine shows of a few moves."""
    folder = tmp_path_factory.mktemp("log")
    (folder / "z.yaml").write_text(SCENARIO)
    found = run(load(folder / "z.yaml")).log
    assert found is not None
    write_csv(folder / "log.csv", found)
    return folder / "log.csv"


def replayed(log: Path, out: Path, *more: str) -> dict[str, float]:
    code = main(["replay", str(log), "--machine", str(MACHINE), "--axes", "Z", "--out", str(out), "--quiet", *more])
    assert code == 0
    summary = json.loads((out / "summary.json").read_text())
    return {name.partition(".")[2]: each["value"] for name, each in summary["figures"].items()}


def test_a_log_of_the_machine_itself(log: Path, tmp_path: Path) -> None:
    """From rest on it is the same run: the setpoints of the log, splined, are those of the run but for rounding."""
    figures = replayed(log, tmp_path / "out")
    assert figures["position_rms"] < 1e-3  # um
    assert figures["torque_rms"] < 1e-4
    assert figures["torque_delay"] == 0
    beside = read_csv(tmp_path / "out" / "replay.csv")
    assert np.max(np.abs(beside["Z.x_a_simulated"] - beside["Z.x_a_recorded"])) < 1e-9
    assert {path.name for path in (tmp_path / "out").iterdir()} >= {"report.html", "summary.json", "replay.csv"}
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert '<p class="answer">Z: position the same to the last digit' in page
    assert_numbers_agree(tmp_path / "out")


@pytest.mark.parametrize("share", [0.7, 0.9])
def test_torque_that_a_record_cuts_off_counts_in_no_figure(
    share: float, log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The machine itself, whose log ends at a share of the largest torque; at 0.9 that is a few rows only."""
    own = read_csv(log)
    torque = np.asarray(own["Z.M_a"])
    most = share * float(np.max(np.abs(torque)))
    cut = {name: np.clip(torque, -most, most) if name == "Z.M_a" else own[name] for name in own}
    write_csv(tmp_path / "cut.csv", Trace(own.time, cut, own.units))
    figures = replayed(tmp_path / "cut.csv", tmp_path / "out")
    assert "the torque of these rows counts in no figure" in capsys.readouterr().err
    assert figures["position_rms"] < 1e-3
    assert figures["torque_rms"] < 0.05 * most * np.sqrt(np.mean(np.abs(torque) > most))


def test_the_torque_at_standstill_is_a_figure_of_its_own(log: Path, tmp_path: Path) -> None:
    """Rest ahead of the first move and behind the last one, with friction that is half as large: what the drive holds
    there is another torque. The figure of the motion does not show it."""
    figures = replayed(log, tmp_path / "own")
    assert figures["torque_standstill_rms"] < 1e-4
    other = replayed(log, tmp_path / "other", "--set", "axes.Z.constant_load=0.5 N.m")
    assert other["torque_standstill_rms"] == pytest.approx(0.5, rel=0.1)


def test_a_record_that_begins_in_motion(log: Path, tmp_path: Path) -> None:
    """Cut in the middle of the first move, at 100 mm/s: a run-in leads to that speed. What drive and friction bring
    along is not in the record; the first 0.1 s, in which it dies away, do not count."""
    whole = read_csv(log)
    rows = whole.time >= 0.16
    columns = {name: values[rows] for name, values in whole.columns.items()}
    write_csv(tmp_path / "cut.csv", Trace(whole.time[rows], columns, whole.units))
    figures = replayed(tmp_path / "cut.csv", tmp_path / "out")
    assert read_csv(tmp_path / "out" / "replay.csv").time[0] == pytest.approx(0.26)
    assert figures["position_rms"] < 0.3  # um
    # A window far behind the begin of a longer record begins the run in motion as well.
    later = replayed(tmp_path / "cut.csv", tmp_path / "later", "--window", "0.3 s..0.45 s")
    assert later["position_rms"] < 0.5  # the bed rings at 21 Hz


def test_a_window_is_the_same_stretch(log: Path, tmp_path: Path) -> None:
    """What is compared is the window; what the run has gone through ahead of it is as before."""
    figures = replayed(log, tmp_path / "out", "--window", "0.2 s..0.4 s")
    assert figures["position_rms"] < 1e-3
    beside = read_csv(tmp_path / "out" / "replay.csv")
    assert beside.time[0] == pytest.approx(0.2)
    assert beside.time[-1] == pytest.approx(0.4)


def test_another_machine_shows(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Without feedforward the axis lags by v/K_v: 6 m/min by 25 mm/s; the record does not."""
    figures = replayed(log, tmp_path / "out", "--set", "axes.Z.drive.k_ffw=0 %")
    v, K_v = 0.1, 4e3 / 60
    assert figures["position_largest"] == pytest.approx(1e6 * v / K_v, rel=0.02)
    assert "WRONG: axis Z: the simulated position is off by more" in capsys.readouterr().err


def test_what_does_not_fit_in_a_drive_is_a_change(log: Path, tmp_path: Path) -> None:
    """T_sym beside 2 D/omega_0 + T_pos - T_c, the lag of the speed loop with the ramped setpoint."""
    replayed(log, tmp_path / "as_is", "--control", "sinumerik")
    assert "changes" not in json.loads((tmp_path / "as_is" / "summary.json").read_text())
    replayed(log, tmp_path / "out", "--set", "axes.Z.drive.T_sym=2.9 ms", "--control", "sinumerik")
    neutral = 2 * 1.214 / 915.3 + 1e-3 - 125e-6
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    (change,) = summary["changes"]
    assert (change["parameter"], change["direction"]) == ("drive.T_sym", "higher")
    assert change["proposed"] == pytest.approx(neutral, rel=1e-6)
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "What to change" in page
    assert f"MD32810 EQUIV_SPEEDCTRL_TIME {neutral:.6g} s (unit not confirmed)" in page


def test_a_torque_limit_that_the_record_does_not_have_is_told(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    most = float(np.max(np.abs(read_csv(log)["Z.M_a"])))
    replayed(log, tmp_path / "as_is")
    assert "torque limit" not in capsys.readouterr().err
    for share in (0.6, 0.9):  # the record is above it
        replayed(log, tmp_path / f"{share}", "--set", f"axes.Z.drive.M_max={share * most} N.m")
        assert "WRONG: axis Z: the simulated drive is at its torque limit" in capsys.readouterr().err
    replayed(log, tmp_path / "same", "--set", f"axes.Z.drive.M_max={most} N.m")
    assert "torque limit" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("load_of_run", "unit", "against"), [("slide", "N", -800.0), ("motor", "N.m", 4.0)], ids=["slide", "motor"]
)
def test_a_load_that_was_recorded_acts(
    load_of_run: str, unit: str, against: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A pulse beside the motion, in the record as a column: the replay is the run again. Without it, it is not."""
    # In a run a force counts in the direction of its axis; in a record a load counts against the motor.
    value = -against if load_of_run == "slide" else against
    table = f"{{time: [0.2 s, 0.21 s, 0.26 s, 0.28 s], values: [0 {unit}, {value} {unit}, {value} {unit}, 0 {unit}]}}"
    (tmp_path / "z.yaml").write_text(SCENARIO + f"loads: [{{kind: {load_of_run}, axis: Z, table: {table}}}]\n")
    found = run(load(tmp_path / "z.yaml")).log
    assert found is not None
    pulse = np.interp(found.time, [0.2, 0.21, 0.26, 0.28], [0, against, against, 0])
    columns = {**{name: found[name] for name in found}, "pulse": pulse}
    write_csv(tmp_path / "log.csv", Trace(found.time, columns, {**found.units, "pulse": unit}))
    roles = {"position": "x_a", "setpoint": "x_s", "deviation": "x_e", "torque": "M_a"}
    lines = [f"{role}: {{column: Z.{name}}}" for role, name in roles.items()]
    (tmp_path / "with.yaml").write_text("\n".join([*lines, "load: {column: pulse}", ""]))
    figures = replayed(tmp_path / "log.csv", tmp_path / "with", "--columns", str(tmp_path / "with.yaml"))
    assert figures["position_rms"] < 1e-3
    assert figures["torque_rms"] < 1e-4
    (tmp_path / "without.yaml").write_text("\n".join([*lines, ""]))
    assert (
        replayed(tmp_path / "log.csv", tmp_path / "out", "--columns", str(tmp_path / "without.yaml"))["torque_rms"]
        > 0.5
    )
    assert "'pulse' may be a known load" in capsys.readouterr().err


def test_a_load_goes_with_the_scale_of_the_torques(log: Path) -> None:
    """An inertia that is being identified is a scale of all torques: half of each, and of the load, moves the same."""
    machine = load_machine(MACHINE)
    each = cut_window("Z", read_axes(log, ["Z"], machine)["Z"], (0.1, 0.2))
    pulse = 4.0 * np.exp(-(((each.record.time - 0.15) / 0.01) ** 2))

    def moved(load: float, scale: float) -> Array:
        record = replace(each.record, load=load * pulse)
        replayed = Replay(machine, {"Z": replace(each, record=record)})
        return replayed.follow(machine, ("x_a",), scale=scale)["Z"]["x_a"]

    assert np.array_equal(moved(1.0, 2.0), moved(0.5, 1.0))
    assert np.max(np.abs(moved(1.0, 2.0) - moved(1.0, 1.0))) > 1e-6


def test_rests_at_both_ends_are_not_run_where_motion_is_asked_for(log: Path) -> None:
    """The motion is that of the whole record; ahead of it and behind it the axis stays as the run begins and ends."""
    machine = load_machine(MACHINE)
    whole = cut_window("Z", read_axes(log, ["Z"], machine)["Z"], None)
    still = np.full(200, 1.0)

    def longer(values: Array) -> Array:
        return np.concatenate([still * values[0], values, still * values[-1]])

    assert whole.record.setpoint is not None
    assert whole.record.angle is not None
    record = replace(
        whole.record, time=whole.record.interval * np.arange(len(whole.record) + 400),
        torque=longer(whole.record.torque), angle=longer(whole.record.angle), setpoint=longer(whole.record.setpoint),
        deviation=None, speed_setpoint=None, feedforward=None, speed=None,
    )  # fmt: skip
    each = replace(whole, record=record, rows=np.ones(len(record), dtype=bool))
    with Replay(machine, {"Z": each}) as all_rows, Replay(machine, {"Z": each}, only_motion=True) as motion:
        first, last = motion.run
        assert last - first < 0.75 * len(record)
        assert first <= each.first_moving < np.max(np.flatnonzero(each.moving)) <= last
        for per_row in (1, 2):
            asked = machine, ("x_a", "M_a"), per_row
            one, other = (replay.follow(*asked)["Z"] for replay in (all_rows, motion))
            rows = np.flatnonzero(np.repeat(each.moving, per_row)[: len(one["x_a"])])
            assert other["x_a"][rows] == pytest.approx(one["x_a"][rows], abs=2e-9)
            assert other["M_a"][rows] == pytest.approx(one["M_a"][rows], abs=2e-3)
            assert np.ptp(other["x_a"][: first * per_row + 1]) == np.ptp(other["x_a"][last * per_row :]) == 0


def test_a_torque_logged_late_is_told(log: Path, tmp_path: Path) -> None:
    whole = read_csv(log)
    late = np.interp(whole.time - 0.7e-3, whole.time, whole["Z.M_a"])
    columns = {name: whole[name] for name in whole} | {"Z.M_a": late}
    write_csv(tmp_path / "late.csv", Trace(whole.time, columns, whole.units))
    figures = replayed(tmp_path / "late.csv", tmp_path / "out")
    # The log has lost what the torque does between its rows, 2 ms apart.
    assert figures["torque_delay"] == pytest.approx(0.7, abs=0.1)


def test_gaps_are_not_bridged(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole = read_csv(log)
    keep = (whole.time < 0.25) | (whole.time > 0.3)
    write_csv(tmp_path / "gap.csv", Trace(whole.time[keep], {n: whole[n][keep] for n in whole}, whole.units))
    arguments = ["replay", str(tmp_path / "gap.csv"), "--machine", str(MACHINE), "--axes", "Z", "--out"]
    assert main([*arguments, str(tmp_path / "out"), "--window", "0.2 s..0.4 s"]) == 2
    assert "no stretch without a gap holds the window 0.2 to 0.4 s; there is 0 to" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
    assert main([*arguments, str(tmp_path / "out"), "--window", "0.05 s..0.2 s"]) == 0


@pytest.mark.parametrize(
    ("left_out", "more", "told"),
    [
        ("Z.x_s", [], "no position setpoint is read"),
        ("Z.x_a", [], "position or speed"),
        ("", ["--window", "1 s"], "BEGIN..END is needed"),
        ("", ["--window", "0.3 s..0.2 s"], "not ahead of the end"),
        ("", ["--axes", "Q"], "no axis"),
        ("", ["--set=cycles.control=300 us", "--set=cycles.position=300 us", "--set=cycles.interpolation=3 ms"],
         "no whole multiple of the control cycle"),
    ],
)  # fmt: skip
def test_faults_are_told(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], left_out: str, more: list[str], told: str
) -> None:
    whole = read_csv(log)
    kept = [name for name in whole if name != left_out]
    write_csv(tmp_path / "some.csv", Trace(whole.time, {n: whole[n] for n in kept}, {n: whole.units[n] for n in kept}))
    arguments = ["replay", str(tmp_path / "some.csv"), "--machine", str(MACHINE), "--axes", "Z", *more]
    assert main([*arguments, "--out", str(tmp_path / "out")]) == 2
    assert told in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
