"""feedsim circle: what is the matter with a record is said by name, and of a sound one nothing is."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.drawn_circles import Causes, driven
from feedsim import cli
from feedsim.analysis.circle import CircleUnderTest

RADIUS, SPEED, SAMPLES = 0.05, 0.03, 2000
CIRCLE = CircleUnderTest(("X", "Y"), RADIUS, SPEED)
CAUSES = Causes(offset=(5e-6, -3e-6), squareness=30e-6, lost=(2e-6, 0.0), peak=(0.0, 4e-6), noise=0.1e-6)
Table = dict[str, np.ndarray]


def scales(seed: int = 3) -> Table:
    """A turn and a half of linear scales in m over time, about a centre elsewhere."""
    path = driven(CIRCLE, CAUSES, 1, np.random.default_rng(seed), SAMPLES)
    angle = np.unwrap(path.angle)
    angle = np.concatenate([angle, angle[: SAMPLES // 2] + 2 * math.pi])
    radius = RADIUS + np.concatenate([path.deviation, path.deviation[: SAMPLES // 2]])
    time = np.arange(len(angle)) * (2 * math.pi * RADIUS / SPEED / SAMPLES)
    return {"time [s]": time, "X [mm]": 1e3 * (0.4 + radius * np.cos(angle)), "Y [mm]": 1e3 * radius * np.sin(angle)}


def bar() -> Table:
    path = driven(CIRCLE, CAUSES, 1, np.random.default_rng(4), SAMPLES)
    return {"Angle [deg]": np.degrees(np.unwrap(path.angle)), "Deviation [um]": 1e6 * path.deviation}


def diagnosed(
    table: Table, folder: Path, capsys: pytest.CaptureFixture[str], *words: str, form: str = "%.9g"
) -> tuple[int, str, dict[str, Any]]:
    """Exit code, what is said besides the result, and summary.json."""
    file = folder / "circle.csv"
    np.savetxt(file, np.column_stack(list(table.values())), form, ",", header=",".join(table), comments="")
    code = cli.main(["circle", str(file), "--out", str(folder / "out"), *words])
    found = json.loads((folder / "out" / "summary.json").read_text()) if not code else {}
    return code, capsys.readouterr().err, found


GIVEN = ("--radius", "50 mm", "--feed", "1800 mm/min")


@pytest.mark.parametrize("words", [(), GIVEN])
def test_a_sound_record_has_no_doubts(
    words: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, said, found = diagnosed(scales(), tmp_path, capsys, *words)
    assert (code, said, found["findings"]) == (0, "", [])
    code, said, found = diagnosed(bar(), tmp_path, capsys, *GIVEN, "--out", str(tmp_path / "bar"))
    assert (code, said, found["findings"]) == (0, "", [])


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--radius", "100 mm"), "the turns have a radius of 50 mm, given is 100 mm: the diameter?"),
        (("--radius", "25 mm"), "given is 25 mm: the diameter?"),
        (("--radius", "75 mm"), "given is 75 mm, 1.5 times as much"),
        (
            ("--feed", "9000 mm/min"),
            "driven at 1800 mm/min, by their radius and their time; given is 9000 mm/min, 5 times",
        ),
        (("--feed", "30 mm/min"), "given is 30 mm/min: per minute for per second?"),
    ],
)
def test_a_radius_or_feed_of_another_circle(
    words: tuple[str, str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, said, _ = diagnosed(scales(), tmp_path, capsys, *words)
    assert code == 2
    assert message.replace("50.0", "50") in said.replace("49.9998", "50").replace("50.0002", "50").replace(
        "50.0001", "50"
    )
    assert not (tmp_path / "out").exists()


def inches(table: Table) -> Table:
    return {name: values / (25.4 if "mm" in name else 1) for name, values in table.items()}


@pytest.mark.parametrize("words", [GIVEN[:2], GIVEN[2:]])
def test_inches_under_a_header_of_mm(
    words: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, said, _ = diagnosed(inches(scales()), tmp_path, capsys, *words)
    assert code == 2
    assert "inches, under a header of mm?" in said


def test_inches_of_which_nobody_says_the_radius(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, said, found = diagnosed(inches(scales()), tmp_path, capsys)
    assert code == 0
    assert "the radius is 1.9685 mm; were the record in inches, it would be 50" in said
    assert [each["code"] for each in found["findings"]] == ["radius-unusual"]


def scaled(table: Table, part: str, factor: float) -> Table:
    return {name: values * (factor if part in name else 1) for name, values in table.items()}


@pytest.mark.parametrize(
    ("part", "factor", "words"),
    [
        ("mm", 1e-3, "the radius is 0.05 mm; were the record in m, it would be 50"),
        ("mm", 1e3, "the radius is 50000 mm; were the record in mm, it would be 50"),
        ("time", 1e3, "the feed is 1.8 mm/min, by radius and time; were the time in ms, it would be 1800 mm/min"),
        ("time", 1e-3, "the feed is 1.8e+06 mm/min, by radius and time; were the time in s, it would be 1800 mm/min"),
    ],
)
def test_units_a_thousand_times_off_of_which_nobody_says_more(
    part: str, factor: float, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, said, found = diagnosed(scaled(scales(), part, factor), tmp_path, capsys)
    assert code == 0
    assert words in said
    assert [each["code"] for each in found["findings"]] == [f"{'feed' if part == 'time' else 'radius'}-unusual"]


def test_a_sample_that_stands_out_far_is_no_missing_sector(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By so much that its angle jumps, too."""
    table = scales()
    table["Y [mm]"][SAMPLES // 2] += 6.0
    code, said, _ = diagnosed(table, tmp_path, capsys, *GIVEN)
    assert code == 0
    assert "one sample stands out alone" in said
    assert "missing" not in said


def test_inches_that_the_header_tells(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    told = {name.replace("mm", "inch"): values for name, values in inches(scales()).items()}
    code, said, found = diagnosed(told, tmp_path, capsys, *GIVEN)
    assert (code, said, found["findings"]) == (0, "", [])


def spike(table: Table) -> Table:
    name = list(table)[1]
    table[name][1100] += 0.04 if "mm" in name else 40.0
    return table


def sector(table: Table) -> Table:
    keep = np.ones(len(table[next(iter(table))]), dtype=bool)
    keep[900:1000] = False
    return {name: values[keep] for name, values in table.items()}


def coarse(table: Table) -> Table:
    return {name: np.round(values, 1) if "mm" in name else values for name, values in table.items()}


def clipped(table: Table) -> Table:
    """The scale ends 0.2 mm short of the circle."""
    return table | {"X [mm]": np.minimum(table["X [mm]"], 449.8)}


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (spike, "one sample stands out alone, at 175.5 deg by -40"),
        (sector, "samples are missing from 139.3 to 157.5 deg: what happens there is not seen, and G may be larger"),
        (coarse, "X has steps of 100 um, the radial deviation ranges over"),
        (clipped, "X stands at its largest value for"),
    ],
)
def test_faults_of_scales(
    fault: Callable[[Table], Table], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, said, found = diagnosed(fault(scales()), tmp_path, capsys)
    assert code == 0
    assert f"circle.csv, a turn counterclockwise, {1900 if fault is sector else 2000} samples: {message}" in said
    assert [each["severity"] for each in found["findings"]] == ["doubt"] * len(found["findings"])
    assert found["findings"]
    words = found["findings"][0]["text"].rpartition(" ")[0][-20:]
    assert words in (tmp_path / "out" / "report.html").read_text()


def test_a_spike_is_left_out_of_g(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, make in (("scales", scales), ("bar", bar)):
        figures = [diagnosed(table, tmp_path, capsys, *GIVEN)[2]["figures"] for table in (make(), spike(make()))]
        sound, spoilt = (each["XY.G"]["value"] for each in figures)
        assert abs(sound - spoilt) < 0.05 * sound, name


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (spike, "one sample stands out alone, at 175.5 deg by 40"),
        (sector, "samples are missing from 139.3 to 157.5"),
        (
            lambda table: table | {"Deviation [um]": np.minimum(table["Deviation [um]"], 1.0)},
            "at its largest value of 1 um",
        ),
        (lambda table: table | {"Deviation [um]": 5 * np.round(table["Deviation [um]"] / 5)}, "steps of 5 um"),
    ],
)
def test_faults_of_a_ballbar(
    fault: Callable[[Table], Table], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, said, _ = diagnosed(fault(bar()), tmp_path, capsys, *GIVEN)
    assert code == 0
    assert message in said


def test_time_that_runs_back(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = scales()
    table["time [s]"][700:] -= 1.0
    code, said, _ = diagnosed(table, tmp_path, capsys)
    assert code == 2
    assert "circle.csv:702: the time runs back," in said


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("samples", [200, 400, 1000, 8000])
def test_peaks_of_friction_are_no_spikes(
    samples: int, seed: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of any width, high above all else, with little noise; no clipping, no steps and no gaps either."""
    rng = np.random.default_rng(seed)
    causes = Causes(lost=(1e-6, 2e-6), peak=(15e-6, 10e-6), noise=float(rng.choice([0.0, 0.02e-6, 0.5e-6])))
    path = driven(CIRCLE, causes, 1, rng, samples)
    table = {"Angle [deg]": np.degrees(np.unwrap(path.angle)), "Deviation [um]": 1e6 * path.deviation}
    code, said, found = diagnosed(table, tmp_path, capsys, *GIVEN, form="%.6f")
    assert (code, said, found["findings"]) == (0, "", [])
