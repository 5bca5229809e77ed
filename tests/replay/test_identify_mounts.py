"""Levelling mounts from ring-downs: machines drawn at random, linear ones, unseen jerks, sensors, refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import pyuff
import yaml

import feedsim as fs
from command_helpers import feedsim, summary_of
from feedsim import scenario
from feedsim.estimation.replay.mounts import MEANINGS, StopLog, identify_mounts, rests, swings, with_accelerometer
from feedsim.files.trace.trace import Array
from feedsim.scenario import Machine
from feedsim.simulation.cosim import Follower
from feedsim.simulation.nc import plan

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
STOP = SCENARIOS / "z_elastomer_mounts.yaml"
LOGS = [SCENARIOS / "records" / "elastomer_mounts" / f"stop_{jerk}.csv" for jerk in (150, 500)]
SAMPLE = {"K_e": 0.94, "F_max": 1.25, "x_2": 0.82, "K_v": 1.10, "c": 0.88}  # that the sample logs were computed with
SHORT = ["motions.0.by.Z=20 mm", "motions.0.feed=5000 mm/min", "motions.1.duration=0.4 s"]


def with_factors(machine: Machine, factors: dict[str, float]) -> Machine:
    assert machine.mounts is not None
    return machine.model_copy(update={"mounts": machine.mounts.model_copy(update=factors)})


def signal_of(machine: Machine, jerk: int, fmus: Path, column: str = "Z.x_a") -> tuple[Array, Array, scenario.Scenario]:
    """Time and a signal of a stop with that jerk, every 0.5 ms."""
    stop = scenario.load(STOP, [f"machine.path.jerk={jerk} m/s^3", *SHORT])
    with Follower(fmus=fmus) as follower:
        trace = follower.follow(machine, plan(stop), [column], 500e-6)
    return np.array(trace.time), np.array(trace[column]), stop


def logs_of(machine: Machine, jerks: tuple[int, ...], fmus: Path, seed: int) -> list[StopLog]:
    """Stops with 0.1 um of noise."""
    random, result = np.random.default_rng(seed), []
    for jerk in jerks:
        time, x, stop = signal_of(machine, jerk, fmus)
        noisy = x + 0.1e-6 * random.standard_normal(len(x))
        result.append(StopLog(f"stop_{jerk}", "Z.x_a", "m", time, noisy, plan(stop), {}, 0.0))
    return result


@pytest.fixture(scope="module")
def rubber() -> Machine:
    return scenario.load(STOP).machine


@pytest.mark.parametrize("seed", [1])
def test_drawn_mounts_are_found_and_predict_unseen_jerks(rubber: Machine, fmus: Path, seed: int) -> None:
    """Wide draws, narrow intervals: three of four values in theirs, all within twice theirs; and what nobody logged."""
    random = np.random.default_rng(seed)
    truth = {name: float(np.exp(random.uniform(-0.4, 0.4))) for name in MEANINGS}
    drawn = with_factors(rubber, truth)
    found = identify_mounts(rubber, logs_of(drawn, (150, 500), fmus, seed), fmus)
    assert found.verdict == "not linear"
    off = {name: abs(one.value - truth[name]) / one.sigma for name, one in found.estimates.items() if one.sigma > 0}
    assert len(off) == 5
    assert max(off.values()) < 2 * 1.96
    assert sum(value < 1.96 for value in off.values()) >= 4
    for jerk in (250, 400):
        times, x, stop = signal_of(drawn, jerk, fmus)
        _, own, _ = signal_of(with_factors(rubber, dict(found.factors)), jerk, fmus)
        ((begin, _),) = rests(plan(stop))
        rows = times >= begin
        settled = [times[np.flatnonzero(np.abs(y - y[-1]) > 1e-6)[-1]] - begin for y in (x, own)]
        assert settled[1] == pytest.approx(settled[0], rel=0.05)
        first, second = (swings(times[rows] - begin, y[rows], 20.0)[1] for y in (x, own))
        assert second.frequency == pytest.approx(first.frequency, rel=0.05)


@pytest.mark.extensive
def test_a_linear_machine_is_called_linear(rubber: Machine, fmus: Path) -> None:
    """The default machine, whose mounts are springs and whose modes are damped instead."""
    default = scenario.load_machine(SCENARIOS / "machines" / "test_centre")
    found = identify_mounts(rubber, logs_of(default, (150, 500), fmus, 3), fmus)
    assert found.verdict == "linear"
    assert found.estimates["F_max"].status == found.estimates["x_2"].status == "undetermined"
    assert found.factors["F_max"] == 0
    assert found.estimates["K_e"].value == pytest.approx(45 / 25, rel=0.05)


def test_small_amplitudes_leave_it_open(rubber: Machine, fmus: Path) -> None:
    found = identify_mounts(rubber, logs_of(rubber, (50,), fmus, 4), fmus)
    assert found.verdict == "open"
    assert all(one.status == "undetermined" and "amplitudes" in one.reason for one in found.estimates.values())


def test_swings_are_those_of_a_decaying_oscillation() -> None:
    """Frequency and damping of an oscillation that is known, in their intervals."""
    random, w, D = np.random.default_rng(5), 2 * np.pi * 21.0, 0.05
    time = np.arange(0, 0.5, 1e-3)
    x = 3e-6 * np.exp(-D * w * time) * np.cos(w * np.sqrt(1 - D**2) * time) + 1e-6 * time
    found = swings(time, x + 2e-8 * random.standard_normal(len(time)), 19.0)
    assert len(found) >= 6
    inside = [abs(one.frequency - 21.0) < 1.96 * one.frequency_sigma for one in found]
    assert np.mean(inside) > 0.7
    assert all(abs(one.damping - D) < 4 * one.damping_sigma for one in found)


# --- the command ------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def identified(tmp_path_factory: pytest.TempPathFactory, fmus: Path) -> Path:
    folder = tmp_path_factory.mktemp("mounts")
    done = feedsim("identify", "mounts", *LOGS, "--machine", STOP, "--out", "r", fmus=fmus, cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "not linear" in done.stdout
    assert "Next: Run the scenario with these mounts" in done.stdout
    return folder


@pytest.mark.extensive
def test_the_sample_logs_are_explained(identified: Path) -> None:
    summary = summary_of(identified / "r")
    assert summary["verdict"] == "not linear"
    for name, one in summary["estimates"].items():
        assert one["status"] == "estimated"
        assert one["low"] < SAMPLE[name] < one["high"], name
    text = (identified / "r" / "report.html").read_text(encoding="utf-8")
    assert "Frequency and damping over the amplitude" in text


def test_a_run_takes_what_was_found(identified: Path, fmus: Path) -> None:
    group = yaml.safe_load((identified / "r" / "mounts.yaml").read_text(encoding="utf-8"))
    assert group["table"] == "mounts.csv"
    assert set(MEANINGS) < set(group)
    done = feedsim(
        "run", STOP, "--set", "machine.mounts=r/mounts.yaml", "--out", "run", fmus=fmus, cwd=identified
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert summary_of(identified / "run")["figures"]["Z.settling_time"]["value"] > 0


@pytest.mark.extensive
def test_speed_and_accelerometer_say_the_same(rubber: Machine, fmus: Path, tmp_path: Path) -> None:
    """Actual speed with its setpoint, and a universal file of an accelerometer whose clock is its own."""
    truth = with_factors(rubber, {"K_e": 0.9, "F_max": 1.2})
    seen = with_accelerometer(truth)
    logs, files = [], []
    random = np.random.default_rng(6)
    for jerk in (150, 500):
        time, n, stop = signal_of(truth, jerk, fmus, "Z.n_a")
        x_s = np.interp(time, plan(stop).time, plan(stop).x_s["Z"])
        file = tmp_path / f"speed_{jerk}.csv"
        rows = np.column_stack([time, 1e3 * x_s, n + 1e-3 * random.standard_normal(len(n))])
        np.savetxt(file, rows, delimiter=",", header="time [s],Z.x_s [mm],Z.n_a [rad/s]", comments="", fmt="%.9g")
        files.append(file)
        time, x, _ = signal_of(seen, jerk, fmus, "tool.x_Z")
        a = np.gradient(np.gradient(x, 500e-6), 500e-6)[40:] + 2e-3 * random.standard_normal(len(x) - 40)
        log = tmp_path / f"tool_{jerk}.uff"
        pyuff.UFF(str(log)).write_sets(
            {
                "type": 58, "func_type": 1, "rsp_node": 1, "rsp_dir": 3, "ref_node": 0, "ref_dir": 0, "data": a,
                "x": time[40:] - time[40], "abscissa_spec_data_type": 17, "ordinate_spec_data_type": 12, "id1": "tool",
                "ordinate_axis_units_lab": "m/s^2", "orddenom_spec_data_type": 0, "binary": 0, "abscissa_spacing": 1,
                "abscissa_inc": 500e-6, "abscissa_min": 0.0, "num_pts": len(a),
            },
            "overwrite",
        )  # fmt: skip
        logs.append(log)
    short = {key: value for key, _, value in (text.partition("=") for text in SHORT)}
    by_speed = fs.identify_mounts(files, STOP, set=short, fmus=fmus)
    by_tool = fs.identify_mounts(logs, STOP, accelerometer="Z=1:+Z", jerks="150 m/s^3,500 m/s^3", set=short, fmus=fmus)
    for found in (by_speed, by_tool):
        assert found.mounts.verdict == "not linear"
        for name, value in (("K_e", 0.9), ("F_max", 1.2)):
            assert found.estimates[name].value == pytest.approx(value, abs=2 * 1.96 * found.estimates[name].sigma), name


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([LOGS[0], "--machine", SCENARIOS / "machines" / "test_centre"], "its mounts are springs"),
        ([SCENARIOS / "z_positioning.yaml", "--machine", STOP], "takes a record"),
        ([LOGS[0], "--machine", STOP, "--axes", "B"], "no axis 'B'"),
        ([LOGS[0], "--machine", STOP, "--accelerometer", "W=a"], "DIRECTION=NAME"),
        ([LOGS[0], "--machine", STOP, "--accelerometer", "Z=a"], "no column 'a'"),
        ([LOGS[0], "--machine", STOP, "--jerks", "150 m/s^3"], "have their setpoints"),
        (["motion.csv", "--machine", STOP], "no stop with 150 ms of rest"),
        (["still.csv", "--machine", STOP], "no position setpoint"),
    ],
)
def test_what_cannot_be_used_is_refused(words: list[str | Path], said: str, fmus: Path, tmp_path: Path) -> None:
    rows = LOGS[0].read_text(encoding="utf-8").splitlines()
    (tmp_path / "motion.csv").write_text("\n".join(rows[:400]) + "\n", encoding="utf-8")
    (tmp_path / "still.csv").write_text(
        "\n".join(",".join(row.split(",")[::2]) for row in rows) + "\n", encoding="utf-8"
    )  # fmt: skip
    done = feedsim("identify", "mounts", *words, "--out", "r", fmus=fmus, cwd=tmp_path)
    assert done.returncode == 2
    assert said in done.stderr, done.stderr
    assert not (tmp_path / "r").exists()
