"""Numbers that a page shows twice: those of its tiles, of its tables and of summary.json, for every kind of result."""

from __future__ import annotations

import html as markup
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from feedsim.report.formatting import display_unit, typeset

ROW = re.compile(r'<td><code>([^<]+)</code></td><td class="number">([^<]+)</td><td>([^<]*)</td>')
TILE = re.compile(r'<div class="key" title="([^"]+)"><b>([^<]+) <small>([^<]+)</small></b><span>([^<]*)</span>')
NUMBER = re.compile(r"[−+-]?\d[\d ]*(?:\.\d+)?(?:×10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)?")
SUPER = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
CELL = re.compile(r"<t[dh][^>]*>(.*?)</t[dh]>", re.DOTALL)

Shown = tuple[str, str, float | None]  # what and where, text, the value that it stands for


def number(text: str) -> tuple[float, float]:
    """A number as printed, and half a unit of its last digit."""
    plain = text.strip().replace("−", "-").replace(" ", "")
    mantissa, _, power = plain.partition("×10")
    scale = 10.0 ** int(power.translate(SUPER)) if power else 1.0
    return float(mantissa) * scale, 0.51 * 10.0 ** -len(mantissa.partition(".")[2]) * scale


def contradictions(page: str, summary: dict[str, Any]) -> tuple[list[str], int]:
    """Pairs of numbers of one name that differ by more than their digits; and how many pairs were compared."""
    page = re.sub(r"<svg.*?</svg>", "", page, flags=re.DOTALL)
    found, pairs = [], 0
    read = {"identify": _identified, "machine": _machine, "diff": _side_by_side, "sweep": _study}
    shown = read.get(summary.get("kind", ""), _figures)(page, summary)
    for where, text, value in shown:
        if value is None or not NUMBER.fullmatch(text.strip()):
            continue
        pairs += 1
        seen, digit = number(text)
        if abs(seen - value) > digit + 1e-9 * abs(value):
            found.append(f"{where} {text}, summary.json {value:.6g}")
    return found, pairs


def assert_numbers_agree(folder: Path, pairs: int = 4) -> None:
    """Of a folder of results: no number contradicts another of its name, and the page has what the summary answers."""
    page = (folder / "report.html").read_text(encoding="utf-8")
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    found, compared = contradictions(page, summary)
    assert not found
    assert compared >= pairs
    seen = _plain(markup.unescape(re.sub(r"<[^>]+>", " ", page)))
    for line in summary.get("answer", []):
        assert " ".join(_plain(typeset(line)).split()[:6]) in seen, line


def _plain(text: str) -> str:
    return " ".join(re.sub(r"[^\w.,]+", " ", text).split())


def _figures(page: str, summary: dict[str, Any]) -> Iterator[Shown]:
    """Of kinds with a table of figures: value, unit and meaning by name."""
    figures = summary.get("figures", {})
    for name, text, unit in ROW.findall(page):
        own = figures.get(markup.unescape(name))
        if own is not None and markup.unescape(unit) == display_unit(own["unit"]):
            yield f"{name}: table", text, own["value"]
    meanings: dict[tuple[str, str], list[float]] = {}
    for own in figures.values():
        if own.get("value") is not None:
            meanings.setdefault((own["meaning"], display_unit(own["unit"])), []).append(own["value"])
    for meaning, text, unit, _ in TILE.findall(page):
        values = meanings.get((markup.unescape(meaning), markup.unescape(unit)), [])
        if len(values) == 1:
            yield f"{meaning}: tile", text, values[0]


def _rows(page: str) -> Iterator[list[str]]:
    for row in re.findall(r"<tr>(.*?)</tr>", page, flags=re.DOTALL):
        yield [markup.unescape(re.sub(r"<[^>]+>", "", cell)).strip() for cell in CELL.findall(row)]


def _identified(page: str, summary: dict[str, Any]) -> Iterator[Shown]:
    """Parameters: tiles by meaning; rows of name, meaning, value, unit, interval, percent, value at the slide, unit."""
    parameters = summary["parameters"]
    for meaning, text, unit, _ in TILE.findall(page):
        for name, own in parameters.items():
            if own["meaning"] == markup.unescape(meaning) and display_unit(own["unit"]) == markup.unescape(unit):
                yield f"{name}: tile", text, own["value"]
    seen: set[str] = set()  # a second row of a name is of the rigid axis with simple friction
    for row in _rows(page):
        own = summary["rigid_axis" if row[0] in seen else "parameters"].get(row[0]) if len(row) == 9 else None
        seen.add(row[0])
        if own is not None and row[3] == display_unit(own["unit"]):
            yield f"{row[0]}: table", row[2], own["value"]
            for end, text in zip(own["interval"] or (), row[4].split(" to "), strict=bool(own["interval"])):
                yield f"{row[0]}: interval", text, end
            if own.get("at_slide") and row[7] == display_unit(own["at_slide"]["unit"]):
                yield f"{row[0]}: at the slide", row[6], own["at_slide"]["value"]


def _machine(page: str, summary: dict[str, Any]) -> Iterator[Shown]:
    """Mass, lowest mode, moving masses; the table of axes, the table of modes."""
    axes, modes = summary["axes"], [each["frequency"]["value"] for each in summary["modes"]]
    lowest = next(each for each in modes if each > 1.0)
    for _, text, _, label in TILE.findall(page):
        axis, _, what = label.partition(": ")
        if what == "moving mass":
            yield f"{label}: tile", text, axes[axis]["moving_mass"]["value"]
        elif label in ("total mass", "lowest elastic mode"):
            yield f"{label}: tile", text, lowest if "mode" in label else summary["total_mass"]["value"]
    words = re.search(r"lowest elastic mode is at ([\d.]+) Hz", page)
    assert words
    yield "lowest elastic mode: answer", words[1], lowest
    for row in _rows(page):
        own = [each for axis in axes.values() for each in axis.values() if each["meaning"].replace("^2", "²") == row[0]]
        if len(own) == len(axes) and len(row) == 2 + len(axes):
            yield from ((f"{row[0]}: table", text, each["value"]) for text, each in zip(row[2:], own, strict=True))
        if len(row) == 4 and row[0].isdigit() and int(row[0]) < len(modes):
            yield f"mode {row[0]}: table", row[1], modes[int(row[0])]


def _side_by_side(page: str, summary: dict[str, Any]) -> Iterator[Shown]:
    """Figures of every source; tiles from one to the other of two."""
    figures = [source["figures"] for source in summary["sources"]]
    for row in _rows(page):
        if all(row[0] in own for own in figures) and row[-1] == display_unit(figures[0][row[0]]["unit"]):
            cells = [row[1], *row[2:-1:2]]
            yield from (
                (f"{row[0]}: table", text, own[row[0]]["value"]) for text, own in zip(cells, figures, strict=True)
            )
            for text, own in zip(row[3:-1:2], figures[1:], strict=True):
                pair = own[row[0]]["value"], figures[0][row[0]]["value"]
                yield f"{row[0]}: difference", text, None if None in pair else pair[0] - pair[1]
    for title, text, _, _ in TILE.findall(page):
        name = title.partition(",")[0]
        yield from (
            (f"{name}: tile", part, own[name]["value"]) for part, own in zip(text.split(" → "), figures, strict=True)
        )


def _study(page: str, summary: dict[str, Any]) -> Iterator[Shown]:
    """Statistics of every figure, in the unit that its row names, and the tiles of the figure that is asked about."""
    heads = {"Nominal": "nominal", "Mean": "mean", "Std": "std", "5 %": "q5", "50 %": "q50", "95 %": "q95",
             "Min": "min", "Max": "max"}  # fmt: skip
    factors = {("m", "µm"): 1e6, ("s", "ms"): 1e3}
    table = [row for row in _rows(page) if row[0] == "Figure" or row[0] in summary["figures"]]
    columns = {}
    for row in table:
        if row[0] == "Figure":
            columns = {k: heads[head] for k, head in enumerate(row) if head in heads}
            continue
        own = summary["figures"][row[0]]
        unit = display_unit(own["unit"])
        if row[1] != unit and (own["unit"], row[1]) not in factors:
            continue
        factor = factors.get((own["unit"], row[1]), 1.0)
        for k, key in columns.items():
            yield f"{row[0]} {key}: table", row[k], None if own[key] is None else factor * own[key]
    for _, text, unit, label in TILE.findall(page):
        what, _, name = label.partition(" ")
        name = name.partition(",")[0]
        if what in ("smallest", "largest") and (own := summary["figures"].get(name)):
            factor = factors.get((own["unit"], unit), 1.0)
            yield f"{label}: tile", text, factor * own["min" if what == "smallest" else "max"]
