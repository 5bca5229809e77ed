"""Acceptance sheets: readings from which the figures follow, limits, verdicts with their uncertainty."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import openpyxl
import pytest

import feedsim as fs
from command_helpers import feedsim, summary_of
from feedsim.foundation import installation
from feedsim.report.run.files import _name
from feedsim.report.run.sheet import FAILS, NO_LIMIT_TEXT, OPEN, PASSES, judge_figure

ROOT = Path(__file__).resolve().parents[2]
CYCLE = """
name: cycle & <b>
machine: {machine}
motions:
  - {{kind: positioning_cycle, axis: Z, targets: [62 mm, 81.3 mm, 101.7 mm], runs: 3, overrun: 2 mm, feed: 10 m/min,
      rest: 0.1 s}}
recording: {{interval: 2 ms, variables: ["Z.*"]}}
set: {{machine.structure: null}}
evaluate:
  - {{kind: positioning_accuracy, noise: 0.3 um, seed: 4{sheet}}}
"""
CIRCLE = """
name: circle
machine: {machine}
motions:
  - {{kind: circle, plane: [X, Z], radius: 2 mm, feed: 3000 mm/min, turns: 3}}
recording: {{interval: 1 ms}}
set: {{machine.structure: null}}
evaluate:
  - {{kind: circle{sheet}}}
"""
SHEET = ", sheet: {limits: {A: 10 um, R: 1 nm}, uncertainty: 0.05 um, conditions: {instrument: 'laser <1>'}}"


def ran(folder: Path, text: str, sheet: str, fmus: Path) -> tuple[Path, str]:
    machine = ROOT / "scenarios" / "machines" / "test_centre"
    (folder / "s.yaml").write_text(text.format(machine=machine, sheet=sheet), encoding="utf-8")
    done = feedsim("run", "s.yaml", "--out", "out", fmus=fmus, cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder / "out", done.stdout


def rows_of(folder: Path, part: str) -> list[dict[str, str]]:
    with (folder / "sheet.csv").open(newline="", encoding="utf-8") as file:
        return [row for row in csv.DictReader(file) if row["Part"] == part]


def iso230_2(readings: Sequence[dict[str, str]]) -> dict[str, float]:
    """Clause 2 of ISO 230-2 written down once more, from the rows of sheet.csv [um]."""
    up: dict[str, list[float]] = {}
    down: dict[str, list[float]] = {}
    for row in readings:
        (up if row["Approach"] == "↑" else down).setdefault(row["Target [mm]"], []).append(float(row["Value"]))

    def mean(x: list[float]) -> float:
        return sum(x) / len(x)

    def s(x: list[float]) -> float:
        return math.sqrt(sum((each - mean(x)) ** 2 for each in x) / (len(x) - 1))

    sides = [*up.values(), *down.values()]
    B = {place: mean(up[place]) - mean(down[place]) for place in up}
    R = {p: max(2 * s(up[p]) + 2 * s(down[p]) + abs(B[p]), 4 * s(up[p]), 4 * s(down[p])) for p in up}
    middle = [(mean(up[place]) + mean(down[place])) / 2 for place in up]
    return {
        "A": max(mean(x) + 2 * s(x) for x in sides) - min(mean(x) - 2 * s(x) for x in sides),
        "A↑": max(mean(x) + 2 * s(x) for x in up.values()) - min(mean(x) - 2 * s(x) for x in up.values()),
        "A↓": max(mean(x) + 2 * s(x) for x in down.values()) - min(mean(x) - 2 * s(x) for x in down.values()),
        "R": max(R.values()),
        "R↑": max(4 * s(x) for x in up.values()),
        "R↓": max(4 * s(x) for x in down.values()),
        "B": max(map(abs, B.values())),
        "B\u0305": mean([*B.values()]),
        "E": max(map(mean, sides)) - min(map(mean, sides)),
        "E↑": max(map(mean, up.values())) - min(map(mean, up.values())),
        "E↓": max(map(mean, down.values())) - min(map(mean, down.values())),
        "M": max(middle) - min(middle),
    }


def test_figures_follow_from_the_readings_of_the_sheet(fmus: Path, tmp_path: Path) -> None:
    out, said = ran(tmp_path, CYCLE, SHEET, fmus)
    readings = rows_of(out, "reading")
    assert len(readings) == 3 * 2 * 3
    wanted = iso230_2(readings)
    figures = {row["Item"]: row for row in rows_of(out, "figure")}
    assert {*figures} == {*wanted}
    for symbol, value in wanted.items():
        assert float(figures[symbol]["Value"]) == pytest.approx(value, abs=5e-6), symbol
    assert summary_of(out)["figures"]["Z.A"]["value"] == pytest.approx(wanted["A"], abs=5e-6)
    assert (figures["A"]["Verdict"], figures["R"]["Verdict"], figures["B"]["Verdict"]) == (PASSES, FAILS, "")
    assert said.startswith("Positioning of Z FAILS (ISO 230-2): R ")
    conditions = {row["Item"]: row["Value"] for row in rows_of(out, "condition")}
    assert conditions["instrument"] == "laser <1>"
    assert conditions["Approaches"] == "3 of each side of each target"
    assert "Nothing was measured" in conditions["Kind of test"]


def test_the_sheet_for_print(fmus: Path, tmp_path: Path) -> None:
    out, _ = ran(tmp_path, CYCLE, SHEET, fmus)
    page = (out / "sheet.html").read_text(encoding="utf-8")
    assert '<p class="verdict">fail</p>' in page
    for text in ("<td>A↑</td>", "<td>R↓</td>", "laser &lt;1&gt;", "cycle &amp; &lt;b&gt;", "ISO 230-2", "0.05 µm"):
        assert text in page, text
    assert "<script" not in page
    assert not re.search(r"\bnan\b", re.sub(r"<svg.*?</svg>", "", page, flags=re.DOTALL))
    report = (out / "report.html").read_text(encoding="utf-8")
    assert '<a href="sheet.html">' in report
    assert "accuracy of positioning A (limit 10 µm)</span>" in report
    assert {"sheet.html", "sheet.csv"} <= set(summary_of(out)["files"])
    ran(tmp_path, CYCLE, "", fmus)  # without the key nothing of it stays
    assert not (out / "sheet.html").exists()
    assert not (out / "sheet.csv").exists()


def test_a_circle_in_the_letters_of_iso_230_4(fmus: Path, tmp_path: Path) -> None:
    out, said = ran(tmp_path, CIRCLE, ", sheet: {limits: {G: 100 um}}", fmus)
    readings = [row for row in rows_of(out, "reading") if row["Approach"] == "counterclockwise"]
    values = np.array([float(row["Value"]) for row in readings])
    assert [float(row["Angle [deg]"]) for row in readings] == [*range(360)]
    figures = {row["Item"]: row for row in rows_of(out, "figure")}
    assert float(figures["G_XZ"]["Value"]) == pytest.approx(np.ptp(values), rel=0.02)  # readings are a degree apart
    assert float(figures["F_XZ,max"]["Value"]) == pytest.approx(values.max(), rel=0.02)
    assert figures["G_XZ"]["Verdict"] == PASSES
    page = (out / "sheet.html").read_text(encoding="utf-8")
    assert "<td>G<sub>XZ</sub></td>" in page
    assert "<td>F<sub>XZ,max</sub></td>" in page
    assert said.startswith("Circle XZ passes (ISO 230-4): G_XZ ")


def test_the_workbook_has_the_numbers_of_the_table(fmus: Path, tmp_path: Path) -> None:
    """Read by a second implementation, openpyxl: readings, figures, limits as numbers; texts as texts."""
    out, _ = ran(tmp_path, CYCLE, SHEET.replace("conditions: {", "xlsx: true, conditions: {note: '=1+1', "), fmus)
    page = openpyxl.load_workbook(out / "sheet.xlsx")["Positioning of Z"]
    rows = [[cell for cell in row if cell is not None] for row in page.iter_rows(values_only=True)]
    assert rows[0] == ["Positioning of Z"]
    assert ["FAIL"] in rows
    assert ["note", "=1+1"] in rows
    assert ["instrument", "laser <1>"] in rows
    figures = {row[0]: row for row in rows if len(row) >= 4 and isinstance(row[2], float)}
    for row in rows_of(out, "figure"):
        _, _, value, *judged_by, verdict = figures[row["Item"]]
        assert value == pytest.approx(float(row["Value"]), abs=1e-6)
        assert judged_by == ([float(row["Limit"]), 0.05] if row["Limit"] else [0.05])
        assert verdict == (row["Verdict"] or NO_LIMIT_TEXT)
    head = next(k for k, row in enumerate(rows) if row and row[0] == "Target [mm]")
    readings: dict[tuple[str, str], list[float]] = {}
    for row in rows_of(out, "reading"):
        readings.setdefault((row["Target [mm]"], row["Approach"]), []).append(float(row["Value"]))
    for row in rows[head + 1 : head + 7]:
        own = readings.pop((f"{row[0]:g}", row[1]))
        assert row[2:5] == pytest.approx(own, abs=1e-6)
        assert row[5] == pytest.approx(np.mean(own), abs=1e-6)
        assert row[6] == pytest.approx(np.std(own, ddof=1), abs=1e-6)
    assert not readings
    assert "sheet.xlsx" in summary_of(out)["files"]
    report = (out / "report.html").read_text(encoding="utf-8")
    assert '<a href="sheet.xlsx">as a workbook</a>' in report
    assert '<a href="sheet.csv">as CSV</a>' in report
    before = (out / "sheet.xlsx").read_bytes()
    again, _ = ran(tmp_path, CYCLE, SHEET.replace("conditions: {", "xlsx: true, conditions: {note: '=1+1', "), fmus)
    assert (again / "sheet.xlsx").read_bytes() == before
    ran(tmp_path, CYCLE, SHEET, fmus)
    assert not (out / "sheet.xlsx").exists()


def test_a_workbook_without_its_package_is_refused_before_the_run(
    fmus: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(installation.EXTRAS, "xlsx", ("no_such_package",))
    machine = ROOT / "scenarios" / "machines" / "test_centre"
    (tmp_path / "s.yaml").write_text(CYCLE.format(machine=machine, sheet=", sheet: {xlsx: true}"), encoding="utf-8")
    with pytest.raises(installation.MissingPackage, match=r'pip install "feedsim\[xlsx\]"'):
        fs.run(tmp_path / "s.yaml", fmus=fmus, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_names_of_worksheets() -> None:
    taken: set[str] = set()
    names = [_name(title, taken) for title in ("Circle XZ#2", "circle xz#2", "[a]:*?/\\'", 40 * "x", 41 * "x")]
    assert names[:2] == ["Circle XZ#2", "circle xz#2 (2)"]
    assert names[2] == "a"
    assert [len(name) for name in names[3:]] == [31, 31]
    assert len({name.casefold() for name in names}) == 5


@pytest.mark.parametrize(
    ("value", "limit", "uncertainty", "verdict"),
    [
        (5.0, 6.0, 0.0, PASSES), (6.0, 6.0, 0.0, PASSES), (6.1, 6.0, 0.0, FAILS), (5.8, 6.0, 0.5, OPEN),
        (6.4, 6.0, 0.5, OPEN), (6.6, 6.0, 0.5, FAILS), (-6.6, 6.0, 0.5, FAILS), (-5.0, 6.0, 0.5, PASSES),
        (math.nan, 6.0, 0.0, OPEN), (5.0, math.nan, 0.0, NO_LIMIT_TEXT),
    ],
)  # fmt: skip
def test_verdicts(value: float, limit: float, uncertainty: float, verdict: str) -> None:
    assert judge_figure(value, limit, uncertainty) == verdict


@pytest.mark.parametrize(
    ("sheet", "said"),
    [
        (", sheet: {limits: {Q: 1 um}}", "limits: no figure 'Q'"),
        (", sheet: {limits: {A: 1 kg}}", "1 kg"),
        (", sheet: {limits: {A: 0 um}}", "more than 0"),
        (", sheet: {limit: {A: 1 um}}", "did you mean 'limits'?"),
    ],
)
def test_sheets_that_cannot_be(sheet: str, said: str, fmus: Path, tmp_path: Path) -> None:
    machine = ROOT / "scenarios" / "machines" / "test_centre"
    (tmp_path / "s.yaml").write_text(CYCLE.format(machine=machine, sheet=sheet), encoding="utf-8")
    done = feedsim("run", "s.yaml", "--out", "out", fmus=fmus, cwd=tmp_path)
    assert done.returncode == 2
    assert said in done.stderr
    assert not (tmp_path / "out").exists()
