"""feedsim history: results with their dates, lists, limits of simulated figures, machines, and what is refused."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import feedsim as fs
from command_helpers import Done, feedsim, summary_of

ROOT = Path(__file__).resolve().parents[2]
LISTS = ROOT / "scenarios" / "histories"
CIRCLE = """
name: short circle
machine: {machine}
motions:
  - {{kind: circle, plane: [X, Z], radius: 2 mm, feed: 3000 mm/min, turns: 3}}
  - {{kind: dwell, duration: 250 ms}}
recording: {{interval: 1 ms}}
evaluate: [{{kind: circle}}]
set: {{machine.structure: null}}
"""
PULSE = """set:
  machine.axes.Z.drive.friction_pulse: {amplitude: 27.6 mm/min, amplitude_min: 63.3 mm/min, adaptation: true,
    acceleration_1: 0.0123 m/s^2, acceleration_2: 0.0125 m/s^2, acceleration_3: 0.433 m/s^2, time: 35 ms,
    delay: 3.528 ms}
"""
Command = Callable[..., Done]


@pytest.fixture
def history(fmus: Path, tmp_path: Path) -> Command:
    """The command, in a folder of its own."""
    return lambda *words: feedsim("history", *words, "--out", "out", fmus=fmus, cwd=tmp_path)


def result(folder: Path, F_C: float, sigma: float | None = 0.005, **more: Any) -> Path:
    """A folder with the summary of an identification of Z, as far as histories read it."""
    folder.mkdir(parents=True)
    entry = {"value": F_C, "unit": "N.m", "sigma": sigma, "status": "estimated", "reason": ""}
    content = {"kind": "identify", "axis": "Z", "parameters": {"F_C": entry}, "settings": {}, **more}
    (folder / "summary.json").write_text(json.dumps(content))
    return folder


def table(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_wear_lubrication_and_temperature_of_the_example(history: Command, tmp_path: Path) -> None:
    """What docs/histories.py has put in: -10 % of F_C and F_S as a rate, a step of F_log and sigma_2 in month 5."""
    done = history(LISTS / "z_wear.csv", "--limit", "F_C_Z=1.2 N.m")
    assert done.returncode == 0, done.stderr
    limited, first = done.stdout.splitlines()[:2]
    assert re.fullmatch(r"Z\.F_C: 1\.2 N\.m is reached on 2027-.* at this rate \(95 %: 2027-.* to 2027-.*\)\.", limited)
    assert re.match(
        r"Z\.F_S falls by .* N\.m a month since 2025-01-13: from .* to .* N\.m on 2025-12-13 \(-10 %\)\.", first
    )
    content = summary_of(tmp_path / "out")
    found = content["quantities"]
    assert {name for name, one in found.items() if one["changed"]} == {"Z.F_C", "Z.F_S", "Z.F_log", "Z.sigma_2"}
    for name, value in (("Z.F_C", 1.6), ("Z.F_S", 2.1)):
        low, high = found[name]["rate"]["interval"]
        assert low < -0.1 * value / 11 * (365.25 / 12) / 30.4 < high
        assert found[name]["steps"] == []
    for name in ("Z.F_log", "Z.sigma_2"):
        assert found[name]["rate"] is None
        assert [step["between"] for step in found[name]["steps"]] == [["2025-05-17", "2025-06-12"]]
    limit = found["Z.F_C"]["limit"]
    reached = date(2025, 1, 13) + timedelta(days=0.25 / 0.1 * 11 * 30.4)  # F_C is 1.6 N.m at first
    assert date.fromisoformat(limit["interval"][0]) < reached < date.fromisoformat(limit["interval"][1])
    assert "N.m/K" in found["Z.F_log"]["conditions"]["temperature"]
    assert {row["quantity"] for row in table(tmp_path / "out" / "changes.csv")} == set(found)
    page = (tmp_path / "out" / "report.html").read_text()
    assert "Z.F_C falls by" in page
    assert re.findall(r'class="key".*?<b[^>]*>([^<]*)', page) == ["−10 ", "−9.8 ", "−25 ", "−24 "]
    assert all(f"history-{name.replace('.', '-')}" in page for name in found)


@pytest.mark.parametrize("limit", ["F_C_Z=2 N.m", "Z.sigma_0=350 N.m/rad"])
def test_first_sentence_says_that_a_limit_is_not_reached(history: Command, tmp_path: Path, limit: str) -> None:
    """F_C moves away from 2 N.m, and sigma_0 does not change."""
    done = history(LISTS / "z_wear.csv", "--limit", limit)
    assert done.returncode == 0, done.stderr
    assert f"{limit.partition('=')[2]} is not reached: " in done.stdout.splitlines()[0]
    assert summary_of(tmp_path / "out")["answer"][0] == done.stdout.splitlines()[0]


def test_preload_that_is_lost_is_a_step_of_its_month(history: Command, tmp_path: Path) -> None:
    assert history(LISTS / "ball_screw.csv").returncode == 0
    found = summary_of(tmp_path / "out")["quantities"]
    lost = {name: one for name, one in found.items() if one["changed"]}
    assert set(lost) == {"Z.F_C", "Z.F_S", "Z.sigma_0"}
    for one in lost.values():
        assert one["rate"] is None
        assert [step["between"] for step in one["steps"]] == [["2025-08-11", "2025-09-10"]]


def test_own_table_is_a_list_again(history: Command, tmp_path: Path) -> None:
    """With one result more: the same values, and those of the new one."""
    assert history(LISTS / "ball_screw.csv").returncode == 0
    before = summary_of(tmp_path / "out")["quantities"]["Z.F_C"]
    (tmp_path / "out" / "history.csv").rename(tmp_path / "so_far.csv")
    new = result(tmp_path / "new", 0.99)
    done = history("so_far.csv", f"{new}@2026-01-12", "--quantities", "Z.F_C")
    assert done.returncode == 0, done.stderr
    after = summary_of(tmp_path / "out")["quantities"]["Z.F_C"]
    assert after["values"] == [*before["values"], 0.99]
    assert after["dates"][-1] == "2026-01-12"
    assert after["steps"][0]["between"] == before["steps"][0]["between"]


def test_results_with_the_dates_of_their_records(history: Command, tmp_path: Path) -> None:
    """Behind an @, in a list, or in the summary; in any order."""
    rows = ["result,date"]
    for k in range(6):
        month = f"2026-0{k + 1}-10"
        folder = result(tmp_path / f"r{k}", 1.6 - 0.05 * k, **({"recorded": month} if k < 2 else {}))
        if k >= 4:
            rows.append(f"{folder.name},{month}")
    (tmp_path / "list.csv").write_text("\n".join(rows))
    done = history("list.csv", "r3@2026-04-10", "r1", "r0", "r2@2026-03-10")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("Z.F_C falls by 0.050")
    assert "since 2026-01-10" in done.stdout
    assert summary_of(tmp_path / "out")["figures"]["Z.F_C.rate"]["value"] == pytest.approx(-0.0505, rel=0.02)


def test_date_of_a_record_is_in_its_result(tmp_path: Path, fmus: Path) -> None:
    """Time stamps with a date -> summary.json of the identification; a time in seconds has none."""
    time = np.arange(0, 30, 0.01)
    speed = 2.0 * np.sign(np.sin(2 * np.pi * time / 10))
    torque = np.sign(speed) * 1.6 + 0.006 * speed + 0.01 * np.random.default_rng(1).normal(size=len(time))
    stamps = [f"2026-03-04 10:00:{t:06.3f}" for t in time]
    for name, clock in (("dated", stamps), ("plain", [f"{t:.3f}" for t in time])):
        head = "Zeit" if name == "dated" else "time [s]"
        lines = [
            f"{head},Z.n_a [rad/s],Z.M_a [N.m]",
            *(f"{a},{b:.5f},{c:.5f}" for a, b, c in zip(clock, speed, torque, strict=True)),
        ]
        (tmp_path / f"{name}.csv").write_text("\n".join(lines))
        machine = ROOT / "scenarios/machines/test_centre"
        fs.identify_friction(tmp_path / f"{name}.csv", "Z", machine, stages=1, fmus=fmus, out=tmp_path / name)
    assert summary_of(tmp_path / "dated")["recorded"] == "2026-03-04"
    assert summary_of(tmp_path / "plain")["recorded"] is None


def test_temperature_of_a_record_is_no_wear(history: Command, tmp_path: Path, fmus: Path) -> None:
    """Logs with a column of the temperature, warmer every month and warming up themselves: F_C falls with it."""
    time, random = np.arange(0, 30, 0.01), np.random.default_rng(3)
    speed = np.repeat(np.ravel([[n, -n] for n in np.geomspace(0.2, 60, 15)]), 100)
    machine = ROOT / "scenarios/machines/test_centre"
    for month in range(1, 8):
        warm = 20 + 1.5 * month + random.normal() + 3 * time / time[-1]
        friction = 1.6 * (1 - 0.01 * (warm - 22))
        torque = np.sign(speed) * friction + 0.006 * speed + 0.01 * random.normal(size=len(time))
        rows = np.column_stack([time, speed, torque, warm])
        head = "time [s],Z.n_a [rad/s],Z.M_a [N.m],motor [degC]"
        np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header=head, comments="", fmt="%.6f")
        place = tmp_path / f"2026-0{month}"
        fs.identify_friction(tmp_path / "log.csv", "Z", machine, stages=1, fmus=fmus, out=place)
        assert summary_of(place)["temperature"]["value"] == pytest.approx(np.mean(warm), abs=1e-3)
    folders = [f"{tmp_path / f'2026-0{month}'}@2026-0{month}-10" for month in range(1, 8)]
    result = fs.history(folders, quantities="Z.F_C")
    (one,) = result.value.changes
    assert not one.changed
    slope, half = (part / np.std(one.series.covariates["temperature [degC]"]) for part in one.model.coefficient(1))
    assert abs(slope + 0.016) < half < 0.008


def test_dated_circles_are_a_history(history: Command, tmp_path: Path) -> None:
    """Recorded circles with time stamps: the squareness that grows from month to month, without a date being given."""
    turn, random = np.linspace(0, 2 * np.pi, 1501), np.random.default_rng(2)
    for month in range(1, 6):
        x = 50 * np.cos(turn) + 4e-3 * month * np.sin(turn) + 1e-4 * random.normal(size=len(turn))
        y = 50 * np.sin(turn) + 1e-4 * random.normal(size=len(turn))
        rows = [
            f"2026-0{month}-03 10:00:{0.02 * k:06.3f},{a:.6f},{b:.6f}"
            for k, (a, b) in enumerate(zip(x, y, strict=True))
        ]
        (tmp_path / f"c{month}.csv").write_text("\n".join(["Zeit,X [mm],Y [mm]", *rows]), encoding="utf-8")
        fs.circle(tmp_path / f"c{month}.csv", "X,Y", radius="50 mm", out=tmp_path / f"r{month}")
        assert summary_of(tmp_path / f"r{month}")["recorded"] == f"2026-0{month}-03"
    folders = [str(tmp_path / f"r{month}") for month in range(1, 6)]
    result = fs.history(folders, quantities="XY.squareness_or_servo")
    assert any("squareness_or_servo" in line and "a month" in line for line in result.answers), result.answers


@pytest.mark.parametrize("dates", [2, 4])
def test_figure_that_is_zero_at_all_dates(history: Command, tmp_path: Path, dates: int) -> None:
    """A peak that no circle has: it has not changed, and is written with the others."""
    folders = [result(tmp_path / f"r{k}", 0.0, sigma=0.0) for k in range(dates)]
    done = history(*(f"{folder.name}@2026-0{k + 1}-01" for k, folder in enumerate(folders)))
    assert done.returncode == 0, done.stderr
    assert "Warning" not in done.stderr
    rows = table(tmp_path / "out" / "history.csv")
    assert [float(row["value"]) for row in rows] == [0.0] * dates


def test_two_dates_show_no_change(history: Command, tmp_path: Path) -> None:
    done = history(f"{result(tmp_path / 'a', 1.6)}@2026-01-10", f"{result(tmp_path / 'b', 1.8)}@2026-02-10")
    assert done.returncode == 0
    assert "No change can be named" in done.stdout
    assert "differs by more than its intervals" in done.stdout


def test_parameter_that_some_months_do_not_determine_is_left_out(history: Command, tmp_path: Path) -> None:
    rows = ["date,quantity,value,unit,sigma,status"]
    for k in range(6):
        rows.append(f"2026-0{k + 1}-10,Z.gamma,0.35,1,0.003,{'undetermined' if k in (1, 4) else 'estimated'}")
        rows.append(f"2026-0{k + 1}-10,Z.W,0.04,rad,0.0001,{'estimated' if k == 3 else 'held'}")
        rows.append(f"2026-0{k + 1}-10,Z.F_C,1.6,N.m,0.01,estimated")
    (tmp_path / "list.csv").write_text("\n".join(rows))
    done = history("list.csv")
    assert "Z.gamma: left out, as not determined by the record: 2026-02-10 (undetermined), 2026-05-10" in done.stderr
    assert "Z.W: determined on 2026-04-10 alone, so it has no history" in done.stderr
    found = summary_of(tmp_path / "out")["quantities"]
    assert len(found["Z.gamma"]["dates"]) == 4
    assert "Z.W" not in found


def test_limit_of_a_simulated_figure_and_compensation(history: Command, tmp_path: Path) -> None:
    """The run of a date is the run with the friction of that date; with less friction the pulse helps less."""
    (tmp_path / "circle.yaml").write_text(CIRCLE.format(machine=ROOT / "scenarios/machines/test_centre"))
    (tmp_path / "pulse.yaml").write_text(PULSE)
    rows = ["date,quantity,value,unit,sigma"]
    friction = [1.6 - 0.12 * k for k in range(6)]
    for k, F_C in enumerate(friction):
        rows += [f"2026-0{k + 1}-10,Z.F_C,{F_C:.6g},N.m,0.005", f"2026-0{k + 1}-10,Z.F_S,{1.3 * F_C:.6g},N.m,0.005"]
    (tmp_path / "list.csv").write_text("\n".join(rows))
    done = history("list.csv", "--scenario", "circle.yaml", "--set", "pulse.yaml", "--limit", "XZ.glitch_Z=0.1 um")
    assert done.returncode == 0, done.stderr
    found = summary_of(tmp_path / "out")["quantities"]
    own = found["XZ.glitch_Z"]
    set_ = [f"machine.axes.Z.friction.F_C={friction[2]:.6g} N.m"]
    set_ += [f"machine.axes.Z.friction.F_S={1.3 * friction[2]:.6g} N.m", str(tmp_path / "pulse.yaml")]
    with_pulse = fs.run(tmp_path / "circle.yaml", set=set_).figures["XZ.glitch_Z"].value
    without = fs.run(tmp_path / "circle.yaml", set=set_[:2]).figures["XZ.glitch_Z"].value
    assert own["values"][2] == pytest.approx(abs(with_pulse), rel=1e-9)
    beside = found["XZ.glitch_Z against no compensation"]
    assert beside["values"][2] == pytest.approx(abs(with_pulse) - abs(without), rel=1e-9)
    assert own["limit"]["value"] == 0.1
    assert "XZ.glitch_Z against no compensation" in done.stdout
    assert "compensation" in done.stdout


@pytest.mark.extensive
def test_machines_of_one_kind_become_a_prior(fmus: Path, tmp_path: Path) -> None:
    """Scatter that was put in; with fleet.yaml even sines alone determine F_C and F_S."""
    random = np.random.default_rng(3)
    rows = ["date,machine,quantity,value,unit,sigma"]
    usual = {"F_C": (1.7, "N.m"), "F_S": (2.2, "N.m"), "sigma_0": (310, "N.m/rad"), "sigma_1": (0.85, "N.m.s/rad"),
             "sigma_2": (0.0062, "N.m.s/rad"), "v_s": (0.62, "rad/s"), "F_log": (0.42, "N.m"), "W": (0.041, "rad"),
             "gamma": (0.34, "1")}  # fmt: skip
    for machine in range(8):
        factors = np.exp(0.08 * random.normal(size=len(usual)))
        for day in ("2026-03-01", "2026-06-01"):
            for factor, (name, (value, unit)) in zip(factors, usual.items(), strict=True):
                now = value * factor * np.exp(0.01 * random.normal())
                rows.append(f"{day},no {machine},Z.{name},{now:.6g},{unit},{0.005 * value:.3g}")
    (tmp_path / "list.csv").write_text("\n".join(rows))
    done = feedsim("history", "list.csv", "--machines", "--out", "fleet", fmus=fmus, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    scatter = summary_of(tmp_path / "fleet")["scatter"]
    low, high = scatter["Z.F_C"]["between"]["interval"]
    assert low < 0.08 * 1.7 < high
    noise = {"logging.noise.i_q": "0.05 A", "logging.quantisation.i_q": "1 mA"}
    fs.run(ROOT / "scenarios/identify_z_sine.yaml", set=noise, fmus=fmus).save(tmp_path / "sine")
    log, centre = tmp_path / "sine" / "log.csv", ROOT / "scenarios/machines/test_centre"
    known = fs.identify_friction(log, "Z", centre, prior=tmp_path / "fleet" / "fleet.yaml", fmus=fmus).estimates
    true = {"F_C": 1.6, "F_S": 2.1, "sigma_0": 300.0, "F_log": 0.4, "W": 0.04, "gamma": 0.35}
    for name, value in true.items():
        assert known[name].status in ("estimated", "given")
        assert abs(known[name].value - value) < 3 * known[name].sigma
    assert known["F_C"].sigma < 0.3 * scatter["Z.F_C"]["new_machine"]
    assert known["sigma_2"].status == "given"


FAULTS = {
    "no date": (["a", "b@2026-02-01"], "a: its record has no date; give one"),
    "no such date": (["a@2026-13-01"], "'2026-13-01' is no date; YYYY-MM-DD"),
    "no such result": (["nothing@2026-01-01"], "no such file or folder: nothing"),
    "no result": (["."], "holds no result of feedsim"),
    "one alone": (["a@2026-01-01"], "one date alone has no history"),
    "equal dates": (["a@2026-01-01", "b@2026-01-01"], "both have Z.F_C of 2026-01-01"),
    "other law": (["a@2026-01-01", "gms@2026-02-01"], "is of the friction law lugre, gms@2026-02-01 of gms"),
    "other axis": (["a@2026-01-01", "x@2026-02-01"], "share no quantity that two dates determine (they are of Z, X)"),
    "other machine": (["m1@2026-01-01", "m2@2026-02-01"], "is of the machine mill, m2@2026-02-01 of lathe"),
    "no quantity": (["a@2026-01-01", "b@2026-02-01", "--limit", "F_c_Z=1 N.m"], "no quantity 'F_c_Z'"),
    "other unit": (["a@2026-01-01", "b@2026-02-01", "--limit", "F_C_Z=1 um"], "--limit F_C_Z=1 um:"),
    "no limit of a figure": (
        ["a@2026-01-01", "b@2026-02-01", "--limit", "F_C_Z=1 N.m", "--scenario", "circle.yaml"],
        "no --limit is of a figure of its run",
    ),
    "no such figure": (
        ["a@2026-01-01", "b@2026-02-01", "--limit", "XZ.peek=1 um", "--scenario", "circle.yaml"],
        "--limit XZ.peek: no figure of circle.yaml; did you mean XZ.peak_Z?",
    ),
    "list without dates": (["undated.csv"], "undated.csv:1: no column date"),
    "list with a word": (["word.csv"], "word.csv:3: value 'much'"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_bad_input_is_refused_in_words(fault: str, history: Command, tmp_path: Path) -> None:
    result(tmp_path / "a", 1.6)
    result(tmp_path / "b", 1.5)
    result(tmp_path / "gms", 1.5, settings={"law": "gms"})
    result(tmp_path / "x", 1.5, axis="X")
    result(tmp_path / "m1", 1.5, machine={"name": "mill"})
    result(tmp_path / "m2", 1.5, machine={"name": "lathe"})
    (tmp_path / "circle.yaml").write_text(CIRCLE.format(machine=ROOT / "scenarios/machines/test_centre"))
    (tmp_path / "undated.csv").write_text("quantity,value,unit\nZ.F_C,1,N.m\n")
    (tmp_path / "word.csv").write_text("date,quantity,value,unit\n2026-01-01,Z.F_C,1,N.m\n2026-02-01,Z.F_C,much,N.m\n")
    words, said = FAULTS[fault]
    done = history(*words)
    assert done.returncode == 2
    assert said in done.stderr
    assert not (tmp_path / "out").exists()


FLEETS = {
    "no axes": ("F_C: 1 N.m", "no group axes"),
    "no parameter": ("axes: {Z: {F_c: {mean: 1 N.m, deviation: 1 N.m}}}", "axes.Z.F_c: no parameter of friction"),
    "no deviation": ("axes: {Z: {F_C: {mean: 1 N.m}}}", "axes.Z.F_C: mean and deviation are needed"),
    "other unit": ("axes: {Z: {F_C: {mean: 1 m, deviation: 1 N.m}}}", "axes.Z.F_C: "),
    "nothing": ("axes: {Z: {F_C: {mean: 1 N.m, deviation: 0 N.m}}}", "deviation 0 N.m; more than 0 is needed"),
    "other axis": (
        "axes: {X: {F_C: {mean: 1 N.m, deviation: 1 N.m}}}",
        "the prior is of the axes X; the traces are of Z",
    ),
}


@pytest.mark.parametrize("fault", FLEETS)
def test_bad_prior_is_refused_in_words(fault: str, tmp_path: Path, fmus: Path) -> None:
    text, said = FLEETS[fault]
    (tmp_path / "fleet.yaml").write_text(text)
    (tmp_path / "log.csv").write_text(
        "time [s],Z.n_a [rad/s],Z.M_a [N.m]\n" + "".join(f"{k * 0.01:.2f},1,1\n" for k in range(99))
    )
    machine = ROOT / "scenarios/machines/test_centre"
    words = ("log.csv", "--axes", "Z", "--machine", machine, "--prior", "fleet.yaml", "--out", "out")
    done = feedsim("identify", "friction", *words, fmus=fmus, cwd=tmp_path)
    assert done.returncode == 2
    assert said in done.stderr
    assert not (tmp_path / "out").exists()
