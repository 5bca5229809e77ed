"""feedsim circle: files of scales and of ballbars as people's machines write them, made of known causes."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.drawn_circles import Causes, driven
from feedsim import cli
from feedsim.analysis.circle import CircleUnderTest

CAUSES = Causes(
    offset=(30e-6, -10e-6), delay=(0.0, 8e-4), squareness=40e-6, lost=(3e-6, 0.0), peak=(0.0, 5e-6), noise=0.2e-6
)
RADIUS, SPEED = 0.1, 0.05
CIRCLE = CircleUnderTest(("X", "Y"), RADIUS, SPEED)
SAMPLES = 3600


def turns(samples: int = SAMPLES) -> list[tuple[np.ndarray, np.ndarray, int]]:
    """Angle from 0 on in the sense of the motion [rad], and deviation [m], of both senses."""
    rng = np.random.default_rng(7)
    found = []
    for sense in (1, -1):
        path = driven(CIRCLE, CAUSES, sense, rng, samples)
        found.append((np.unwrap(path.angle), path.deviation, sense))
    return found


def ballbar_in_one_file(folder: Path) -> list[str]:
    """An instrument's export: lines ahead of the header, degrees and micrometres, semicolons and decimal commas; one
    run after the other, each with 45 deg of run-in and run-out."""
    lines = ["Instrument: ballbar;", "Operator: unknown;", "Angle [deg];Deviation [um]"]
    for angle, deviation, sense in turns():
        first, last = SAMPLES // 8, SAMPLES // 8
        around = np.concatenate([angle[-first:] - sense * 2 * np.pi, angle, angle[:last] + sense * 2 * np.pi])
        e = np.concatenate([deviation[-first:], deviation, deviation[:last]])
        lines += [f"{np.degrees(a):.4f};{d * 1e6:.3f}".replace(".", ",") for a, d in zip(around, e, strict=True)]
    (folder / "bar.csv").write_text("\n".join(lines) + "\n")
    return [str(folder / "bar.csv"), "--radius", "100 mm", "--feed", "3000 mm/min"]


def lengths_in_two_files(folder: Path) -> list[str]:
    """Length of the bar in mm over time and angle in radians, a file for each direction, wrapped at 2 pi."""
    files = []
    for angle, deviation, sense in turns():
        time = np.arange(SAMPLES) * (2 * np.pi * RADIUS / SPEED / SAMPLES)
        file = folder / ("ccw.csv" if sense > 0 else "cw.csv")
        table = np.column_stack([time, angle % (2 * np.pi), (RADIUS + deviation) * 1e3])
        np.savetxt(file, table, "%.7f", ",", header="time [s],phi [rad],length [mm]", comments="")
        files.append(str(file))
    return [*files, "--radius", "100 mm"]


def columns_of_any_name(folder: Path) -> list[str]:
    """One file of deviations, one of radii: nothing but the units tells which column is what."""
    files = []
    for angle, deviation, sense in turns():
        file = folder / ("there.csv" if sense > 0 else "back.csv")
        value = deviation * 1e3 if sense > 0 else (RADIUS + deviation) * 1e3
        table = np.column_stack([np.degrees(angle), value])
        np.savetxt(file, table, "%.7f", "\t", header="Polar position (deg)\tBar (mm)", comments="")
        files.append(str(file))
    return [*files, "--radius", "100 mm", "--feed", "3000 mm/min"]


def scales_over_time(folder: Path) -> list[str]:
    """Linear scales in mm: at rest, a turn and a half one way, at rest, as much back; the centre is anywhere."""
    step = 2 * np.pi * RADIUS / SPEED / SAMPLES
    x, y = [], []
    for angle, deviation, sense in turns():
        half = SAMPLES // 2
        around = np.concatenate([angle, angle[:half] + sense * 2 * np.pi])
        e = np.concatenate([deviation, deviation[:half]])
        around, e = (np.concatenate([np.full(500, each[0]), each, np.full(500, each[-1])]) for each in (around, e))
        x.append(412.5 + (RADIUS + e) * 1e3 * np.cos(around))
        y.append(-73.2 + (RADIUS + e) * 1e3 * np.sin(around))
    table = np.column_stack([np.arange(2 * len(x[0])) * step * 1e3, np.concatenate(x), np.concatenate(y)])
    np.savetxt(folder / "scales.csv", table, "%.6f", ",", header="t [ms],X.x_a [mm],Y.x_a [mm]", comments="")
    return [str(folder / "scales.csv"), "--radius", "100 mm"]


def directions_beside_each_other(folder: Path) -> list[str]:
    """A ballbar's table: both directions in inches over one angle, which rises for both."""
    angle = np.linspace(0, 360, SAMPLES, endpoint=False)
    columns = [angle]
    for around, deviation, _ in turns():
        degrees = np.degrees(around) % 360
        order = np.argsort(degrees)
        columns.append(np.interp(angle, degrees[order], deviation[order], period=360) / 25.4e-3)
    table = np.column_stack(columns)
    np.savetxt(folder / "both.csv", table, "%.8f", ",", header="Angle [deg],CCW [in],CW [in]", comments="")
    return [str(folder / "both.csv"), "--radius", f"{RADIUS / 25.4e-3} in", "--feed", "3000 mm/min"]


def axes_by_other_names(folder: Path) -> list[str]:
    """A control's log in German: remarks, decimal commas, the axis somewhere in the name, a force besides."""
    files = []
    step = 2 * np.pi * RADIUS / SPEED / SAMPLES
    for angle, deviation, sense in turns():
        x, y = (100 + (RADIUS + deviation) * 1e3 * wave(angle) for wave in (np.cos, np.sin))
        rows = zip(np.arange(SAMPLES) * step * 1e3, x, y, strict=True)
        lines = ["Maschine;BAZ 3;;", "Datum;2.3.2024;;", "Zeit [ms];Achse X-Ist (mm);Y Ist-Position [mm];Kraft [N]"]
        lines += [f"{t:.4f};{a:.6f};{b:.6f};1,5".replace(".", ",") for t, a, b in rows]
        file = folder / ("hin.csv" if sense > 0 else "her.csv")
        file.write_bytes("\r\n".join(lines).encode("cp1252"))
        files.append(str(file))
    return [*files, "--radius", "100 mm"]


FORMS = (
    ballbar_in_one_file, lengths_in_two_files, columns_of_any_name, scales_over_time, directions_beside_each_other,
    axes_by_other_names,
)  # fmt: skip
FORMATS = {each.__name__: each for each in FORMS}


def run(folder: Path, words: list[str]) -> tuple[int, dict[str, Any]]:
    out = folder / "out"
    code = cli.main(["circle", *words, "--out", str(out)])
    return code, json.loads((out / "summary.json").read_text()) if (out / "summary.json").is_file() else {}


@pytest.mark.parametrize("form", FORMATS)
def test_files_of_every_form_are_diagnosed_alike(form: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, summary = run(tmp_path, FORMATS[form](tmp_path))
    assert code == 0
    figures = {name: each["value"] for name, each in summary["figures"].items()}
    # three times the half intervals of noise of 0.2 um: 0.13 um of amplitude is 5 us and 2.6 um/m
    assert figures["XY.servo_mismatch"] == pytest.approx(-0.8, abs=0.01)
    assert figures["XY.squareness"] == pytest.approx(40, abs=3)
    assert figures["XY.lost_motion_X"] == pytest.approx(3, abs=0.3)
    assert figures["XY.lost_motion_Y"] == pytest.approx(0, abs=0.3)
    assert figures["XY.peak_X"] == 0
    assert figures["XY.peak_Y"] == pytest.approx(5 * 0.72, abs=0.5)  # the highest of its rise and decay
    assert figures["XY.H"] > 2 * 0.8e-3 * SPEED / 2 * 1e6 * 0.95
    said = capsys.readouterr().out
    assert re.search(r"Y lags X by 0\.80 ms", said.splitlines()[0])
    assert (tmp_path / "out" / "report.html").is_file()


def test_one_direction_asks_for_the_other(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = lengths_in_two_files(tmp_path)
    code, summary = run(tmp_path, [words[0], *words[2:]])
    assert code == 0
    assert "XY.squareness_or_servo" in summary["figures"]
    assert "record the other direction" in capsys.readouterr().out


def test_a_turn_listed_against_its_motion_is_said_to_contradict_the_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = []
    for angle, deviation, sense in turns():
        rising = np.argsort(angle)
        table = np.column_stack([np.degrees(angle), deviation * 1e6])[rising]
        file = tmp_path / ("ccw.csv" if sense > 0 else "cw.csv")
        np.savetxt(file, table, "%.4f", ",", header="Angle [deg],Deviation [um]", comments="")
        files.append(file)
    ccw, cw = map(str, files)
    assert run(tmp_path, [ccw, cw, "--radius", "100 mm", "--feed", "3000 mm/min"])[0] == 0
    first = capsys.readouterr().out.splitlines()[0]
    assert "turns that were read as one direction contradict each other by" in first
    assert "angles that rise from row to row are read as counterclockwise" in first
    assert "No single cause" not in first
    head, *rows = files[1].read_text().splitlines()
    files[1].write_text("\n".join([head, *reversed(rows)]) + "\n")  # as the message says
    assert run(tmp_path, [ccw, cw, "--radius", "100 mm", "--feed", "3000 mm/min"])[0] == 0
    assert re.search(r"Main cause: servo mismatch: Y lags X by 0\.80 ms", capsys.readouterr().out.splitlines()[0])
    assert run(tmp_path, [ccw, ccw, "--radius", "100 mm", "--feed", "3000 mm/min"])[0] == 0
    assert "record the other direction" in capsys.readouterr().out.splitlines()[0]


@pytest.mark.parametrize(("share", "code"), [(1.015, 0), (1.025, 2)])
def test_turns_of_different_feed_are_refused(
    share: float, code: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ccw, cw, *words = lengths_in_two_files(tmp_path)
    head, *rows = Path(cw).read_text().splitlines()
    slower = [f"{float(time) * share:.9f},{rest}" for time, _, rest in (row.partition(",") for row in rows)]
    Path(cw).write_text("\n".join([head, *slower]) + "\n")
    assert run(tmp_path, [ccw, cw, *words])[0] == code
    if code:
        said = capsys.readouterr().err
        assert f"{ccw}: a turn counterclockwise, {SAMPLES} samples, from 0 s on, has a feed of 3000 mm/min" in said
        assert f"{cw}: a turn clockwise, {SAMPLES} samples, from 0 s on, has a feed of 2926.8 mm/min" in said
        assert "2.5 % apart; allowed: 2 %" in said
        assert not (tmp_path / "out").exists()


REFUSED = {
    "a deviation without radius": (lambda words: [words[0], *words[3:]], "'Deviation' is a deviation; give the radius"),
    "no feed and no time": (lambda words: words[:3], "has no column of time, and the feed is not known"),
    "one axis": (lambda words: [*words, "--axes", "X"], "two different axes of the plane are needed"),
    "another axis' pitch": (lambda words: [*words, "--pitch", "Z=10 mm"], "Z is no axis of the plane"),
    "half a centre": (lambda words: [*words, "--centre", "X=1 mm"], "give it of X and Y"),
    "a radius of nothing": (lambda words: [*words[:2], "0 mm"], "--radius 0 mm: more than zero is needed, e.g. 150 mm"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_done_is_refused(case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    changed, message = REFUSED[case]
    code, _ = run(tmp_path, changed(ballbar_in_one_file(tmp_path)))
    assert code == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out" / "report.html").exists()


def test_a_file_of_something_else_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for text, message in (
        ("time [s],force [N]\n0,1\n1,2\n", "needed are positions of both axes (X [mm], Y [mm]"),
        ("deg,um\n0,1\n1,2\n", "other.csv:1: is a row of units, deg, um; needed is one row of names"),
        ("angle,deviation\ndeg,um\n0,1\n1,2\n", "other.csv:1: 'deviation' is a deviation; give the radius"),
        ("angle [deg],deviation [N]\n0,1\n1,2\n", "column 'deviation' is in N; one such as deviation [m] is needed"),
        ("angle [deg],radius [mm]\n" + "".join(f"{i},100\n" for i in range(46)), "covers 45 deg in one direction"),
        (
            "angle [deg],radius [mm]\n" + "".join(f"{3 * i},100\n" for i in range(70)),
            "an arc of 207 deg has 70 samples",
        ),
        ("angle [deg],radius [mm]\n" + "".join(f"{3 * i},100\n" for i in range(122)), "180 or more are needed"),
    ):
        (tmp_path / "other.csv").write_text(text)
        code, _ = run(tmp_path, [str(tmp_path / "other.csv")])
        assert code == 2
        assert message in capsys.readouterr().err


def arc_of(folder: Path, form: str) -> list[str]:
    """An arc from -20 to 200 deg, both ways: angles and deviations, or positions with a way to the circle, from rest to
    rest, and one from it."""
    angle = np.radians(np.arange(-20, 200.01, 0.25))
    deviation = 2e-6 * np.cos(2 * angle) + 1.5e-6 * np.sin(2 * angle)
    both = np.concatenate([angle, angle[::-1]]), np.concatenate([deviation, deviation[::-1]])
    if form == "angles":
        table = np.column_stack([np.degrees(both[0]), both[1] * 1e6])
        np.savetxt(folder / "arc.csv", table, "%.5f", ",", header="angle [deg],deviation [um]", comments="")
        return [str(folder / "arc.csv"), "--radius", "100 mm", "--feed", "3000 mm/min"]
    step = np.radians(0.25) * RADIUS / SPEED
    in_ms = np.cumsum(np.concatenate([np.linspace(4, 1, 20), np.ones(len(angle) - 40), np.linspace(1, 4, 20)])) * step
    radius = RADIUS + deviation
    x, y = 300 + 1e3 * radius * np.cos(angle), 50 + 1e3 * radius * np.sin(angle)
    way = np.linspace(0.8, 0, 60, endpoint=False)
    ahead = np.linspace(-1, 0, 60, endpoint=False) * 0.5
    x, y = np.r_[300 + (x[0] - 300) * (1 - way), x], np.r_[50 + (y[0] - 50) * (1 - way), y]
    time = np.r_[ahead, in_ms]
    table = np.column_stack([np.r_[time, 2 * time[-1] + 1 - time[::-1]], np.r_[x, x[::-1]], np.r_[y, y[::-1]]])
    np.savetxt(folder / "arc.csv", table, "%.8f", ",", header="t [s],X [mm],Y [mm]", comments="")
    return [str(folder / "arc.csv"), "--radius", "100 mm"]


@pytest.mark.parametrize("form", ["angles", "positions"])
def test_an_arc_is_diagnosed_without_figures_of_a_full_turn(
    form: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, summary = run(tmp_path, arc_of(tmp_path, form))
    said = capsys.readouterr().out
    assert code == 0, said
    figures = {name: figure["value"] for name, figure in summary["figures"].items()}
    assert [figures[f"XY.{name}"] for name in ("G", "G_b", "D", "H")] == [None] * 4
    assert figures["XY.scale_mismatch"] == pytest.approx(40, abs=0.5)
    assert figures["XY.squareness"] == pytest.approx(30, abs=0.5)
    assert figures["XY.servo_mismatch"] == pytest.approx(0, abs=0.002)
    assert re.search(r"on an arc of 2[012]\d deg the radial deviation ranges over 4\.\d+ um", said)
    assert "figures of ISO 230-4 are not determined" in said
    assert summary["circle"]["arc"]["value"] == pytest.approx(math.radians(220), rel=0.08)
    assert "G" not in summary["diagnosis"]["XY"]
    assert "not determined" in (tmp_path / "out" / "report.html").read_text()
