"""Numbers of one name agree on every kind of page: in tiles, in tables and in summary.json."""

from __future__ import annotations

import html as markup
import json
import re
from pathlib import Path
from typing import Any

import pytest

from command_helpers import feedsim
from feedsim.analysis import evaluate
from feedsim.report import run as report
from feedsim.report.formatting import display_unit
from report_helpers import circle_run, positioning_run

ROOT = Path(__file__).resolve().parents[2]
KINDS = ("circle", "stop", "frf", "show", "recorded", "compensate")
ROW = re.compile(r'<td><code>([^<]+)</code></td><td class="number">([^<]+)</td><td>([^<]*)</td>')
TILE = re.compile(r'<div class="key" title="([^"]+)"><b>([^<]+) <small>([^<]+)</small>')
NUMBER = re.compile(r"[−-]?\d[\d ]*(?:\.\d+)?(?:×10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)?")
SUPER = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


@pytest.fixture(scope="module")
def folders(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of the kinds that are made in a moment."""
    folder = tmp_path_factory.mktemp("kinds")
    for name, run in (("circle", circle_run()), ("stop", positioning_run())):
        report.write(run, evaluate(run), folder / name)
    machine, scenarios = ROOT / "scenarios" / "machines" / "one_axis", ROOT / "scenarios"
    for words in (
        f"frf {machine} --no-measure --out frf",
        "show stop circle --out show",
        "circle circle/result.csv --axes X,Z --out recorded",
        f"compensate {scenarios}/xz_circle.yaml --no-table --set motions.0.direction=counterclockwise --out compensate",
    ):
        done = feedsim(*words.split(), fmus=fmus, cwd=folder)
        assert done.returncode == 0, (words, done.stderr)
    return folder


def number(text: str) -> tuple[float, float]:
    """A number as printed, and half a unit of its last digit."""
    plain = text.strip().replace("−", "-").replace(" ", "")
    mantissa, _, power = plain.partition("×10")
    scale = 10.0 ** int(power.translate(SUPER)) if power else 1.0
    return float(mantissa) * scale, 0.51 * 10.0 ** -len(mantissa.partition(".")[2]) * scale


def contradictions(page: str, figures: dict[str, Any]) -> tuple[list[str], int]:
    """Pairs of numbers of one name that differ by more than their digits; and how many pairs were compared."""
    found, pairs = [], 0

    def compared(name: str, where: str, text: str, value: float | None) -> None:
        nonlocal pairs
        if value is None or not NUMBER.fullmatch(text.strip()):
            return
        pairs += 1
        shown, digit = number(text)
        if abs(shown - value) > digit + 1e-9 * abs(value):
            found.append(f"{name}: {where} {text}, summary.json {value:.6g}")

    for name, text, unit in ROW.findall(page):
        own = figures.get(markup.unescape(name))
        if own is not None and markup.unescape(unit) == display_unit(own["unit"]):
            compared(name, "table", text, own["value"])
    meanings: dict[tuple[str, str], list[float]] = {}
    for own in figures.values():
        if own.get("value") is not None:
            meanings.setdefault((own["meaning"], display_unit(own["unit"])), []).append(own["value"])
    for meaning, text, unit in TILE.findall(page):
        values = meanings.get((markup.unescape(meaning), markup.unescape(unit)), [])
        if len(values) == 1:
            compared(meaning, "tile", text, values[0])
    return found, pairs


@pytest.mark.parametrize("kind", KINDS)
def test_no_number_contradicts_another_of_its_name(kind: str, folders: Path) -> None:
    page = (folders / kind / "report.html").read_text(encoding="utf-8")
    summary = json.loads((folders / kind / "summary.json").read_text(encoding="utf-8"))
    found, pairs = contradictions(page, summary.get("figures", {}))
    assert not found
    assert pairs >= (0 if kind == "show" else 4)
    for line in summary.get("answers", []):
        words = " ".join(re.sub(r"[^\w.,]+", " ", line).split()[:6])
        seen = " ".join(re.sub(r"[^\w.,]+", " ", markup.unescape(re.sub(r"<[^>]+>", " ", page))).split())
        assert words in seen, line


def test_a_contradiction_is_found() -> None:
    figures = {"XZ.G": {"value": 8.19, "unit": "um", "meaning": "m"}}
    row = '<td><code>XZ.G</code></td><td class="number">{}</td><td>µm</td>'
    assert contradictions(row.format("8.190"), figures) == ([], 1)
    assert contradictions(row.format("8.2"), figures) == ([], 1)
    (wrong,), pairs = contradictions(row.format("8.21"), figures)
    assert wrong.startswith("XZ.G: table 8.21")
    assert pairs == 1
    tile = '<div class="key" title="m"><b>9.1 <small>µm</small>'
    assert contradictions(tile, figures)[0] == ["m: tile 9.1, summary.json 8.19"]
    assert number("−1.5×10⁻³") == pytest.approx((-1.5e-3, 0.51e-4))
