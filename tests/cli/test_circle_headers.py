"""feedsim circle: radius and feed that an instrument writes ahead of the columns, in forms that texts have."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.drawn_circles import Causes, driven
from feedsim import cli
from feedsim.analysis.circle import CircleUnderTest
from feedsim.analysis.circle.records import header_values

RADIUS, SPEED = 0.15, 1.0 / 60
CIRCLE = CircleUnderTest(("X", "Y"), RADIUS, SPEED)


def table(sense: int, separator: str = ";") -> list[str]:
    path = driven(CIRCLE, Causes(squareness=30e-6, noise=0.1e-6), sense, np.random.default_rng(1), 1000)
    rows = zip(np.degrees(np.unwrap(path.angle)), 1e6 * path.deviation, strict=True)
    return [separator.join(["Angle [deg]", "Deviation [um]"]), *(f"{a:.4f}{separator}{e:.3f}" for a, e in rows)]


def diagnosed(
    folder: Path, capsys: pytest.CaptureFixture[str], *words: str, **texts: list[str]
) -> tuple[int, str, Any]:
    files = []
    for name, lines in texts.items():
        files.append(str(folder / f"{name}.csv"))
        Path(files[-1]).write_text("\n".join(lines) + "\n", encoding="utf-8")
    code = cli.main(["circle", *files, "--out", str(folder / "out"), *words])
    found = None if code else json.loads((folder / "out" / "summary.json").read_text())
    return code, "".join(capsys.readouterr()), found


@pytest.mark.parametrize(
    "lines",
    [
        ["Ballbar test", "Radius: 150 mm", "Feed rate: 1000 mm/min"],
        ["Operator;unknown", "Radius [mm];150.0", "Feed [mm/min];1000"],
        ["# Sollradius = 150,000 mm", "# Bahnvorschub = 1,0 m/min"],
        ['"Nominal radius","150.000","mm"', '"Feedrate","1000.0","mm/min"'],
        ["ballbar length\t150 mm", "path_speed\t16.6666666666667 mm/s"],
        ["Radius (in): 5.905511811", "Feed 39.37007874 in/min"],
        ["Circle diameter: 300 mm", "Feed: 1000 mm/min"],
        ["Solldurchmesser [mm];300,0", "Prüfradius [mm];150,0", "Vorschub [mm/min];1000"],
    ],
)
def test_radius_and_feed_of_the_header(lines: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, said, found = diagnosed(tmp_path, capsys, ccw=[*lines, *table(1)], cw=[*lines, *table(-1)])
    assert code == 0, said
    assert found["circle"]["radius"]["value"] == pytest.approx(RADIUS, rel=1e-8)
    assert found["circle"]["speed"]["value"] == pytest.approx(SPEED, rel=1e-8)
    assert "ccw.csv: the radius is 150 mm, as its header says" in said
    assert "cw.csv: the feed is 1000 mm/min, as its header says" in said
    assert found["findings"] == []


def test_options_go_ahead_of_the_header(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = ["Radius: 150 mm", "Feed: 1000 mm/min", *table(1)]
    code, said, found = diagnosed(tmp_path, capsys, "--radius", "151 mm", "--feed", "990 mm/min", ccw=lines)
    assert code == 0
    assert found["circle"]["radius"]["value"] == pytest.approx(0.151)
    assert "as its header says" not in said


def test_headers_of_two_circles_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = ["Radius: 150 mm", "Feed: 1000 mm/min"]
    code, said, _ = diagnosed(tmp_path, capsys, one=[*lines, *table(1)], two=["Radius: 100 mm", *table(-1)])
    assert code == 2
    assert "two.csv: its header gives a radius of 100 mm, that of " in said


def test_a_value_without_a_unit_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, said, _ = diagnosed(tmp_path, capsys, one=["Radius: 150", "Feed: 1000 mm/min", *table(1)])
    assert code == 2
    assert "give the radius, for example --radius '100 mm'" in said
    code, said, found = diagnosed(
        tmp_path, capsys, "--radius", "150 mm", one=["Feed: 1000", "Feed: 1 m/min", *table(1)]
    )
    assert code == 0
    assert "'Feed: 1000' may be the feed, and is not read: its unit is not known" in said
    assert found["circle"]["speed"]["value"] == pytest.approx(SPEED)


def test_lines_of_other_things_tell_nothing() -> None:
    lines = [
        "Radius of the tool: 5 mm",
        "Radius deviation: 3 um",
        "Date: 2024-05-01",
        "1;2;3",
        "",
        "Feed override: 100 %",
    ]
    assert header_values(lines) == ({}, [])


@pytest.mark.parametrize("suffix", [".b5r", ".KGM"])
def test_files_of_an_instrument_alone_are_refused(
    suffix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / f"test{suffix}"
    file.write_bytes(b"\x00\x01")
    assert cli.main(["circle", str(file), "--out", str(tmp_path / "out")]) == 2
    err = capsys.readouterr().err
    assert f"{file} is a file that its instrument's own program reads; export the test as text or CSV" in err
