"""HTML report of comparisons."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from math import isfinite

from feedsim.compare import Comparison, Variable
from feedsim.report.compare.plots import picture_of, reach_text
from feedsim.report.frame import Tile, frame, picture_section
from feedsim.report.tables import table
from feedsim.report.words import counted, display_unit, minus, powers

MOST_PICTURES = 12
WORDS = {"same": "same", "different": "different", "unusable": "unusable", "missing": "missing"}


def page(comparisons: Sequence[Comparison]) -> str:
    """HTML text."""
    counts = {kind: sum(each.verdict == kind for each in comparisons) for kind in ("same", "different", "unusable")}
    verdict = next((kind for kind in ("unusable", "different") if counts[kind]), "same")
    one = comparisons[0] if len(comparisons) == 1 else None
    title = f"Comparison: {verdict}" if one else f"{counted(len(comparisons), 'comparison')}: {verdict}"
    subtitle = (
        f"{one.result} against {one.reference}"
        if one
        else ", ".join(f"{number} {kind}" for kind, number in counts.items() if number)
    )
    sections = [] if one else [_pairs(comparisons)]
    pictures = 0
    ordered = sorted(enumerate(comparisons, 1), key=lambda item: item[1].same)
    for number, comparison in ordered:
        if not one:
            sections.append(f'<h2 id="pair-{number}">{escape(comparison.result)}</h2>')
            sections.append(f'<p class="muted">against {escape(comparison.reference)}</p>')
        sections.append(f"<p>{escape(minus(comparison.line))}</p>" if not one or comparison.problem else "")
        sections += [f'<p class="note">{escape(note)}</p>' for note in comparison.notes]
        if (one or not comparison.same) and pictures < MOST_PICTURES and (picture := picture_of(comparison, number)):
            sections.append(picture_section(picture))
            pictures += 1
        if comparison.variables:
            sections.append(_variables(comparison))
    return frame(
        title,
        subtitle,
        warnings=[each.problem for each in comparisons if each.problem] if one else [],
        notes=(),
        tiles=_tiles(comparisons, counts),
        main=sections,
        footer="Deviation: distance of the result from the reference, less what the tolerance in time forgives. "
        "How results are compared: docs/comparing.md.",
    )


def _tiles(comparisons: Sequence[Comparison], counts: dict[str, int]) -> list[Tile]:
    compared = [each for pair in comparisons for each in pair.those("same", "different")]
    outside = [each for each in compared if each.verdict == "different"]
    missing = [each for pair in comparisons for each in pair.those("missing")]
    tiles = [Tile(f"{len(outside)} of {len(compared)}", "variables outside", "variables that leave their tube")]
    if missing:
        tiles.append(Tile(str(len(missing)), "variables missing", "columns of the reference that the result lacks"))
    worst = max(compared, key=lambda each: (each.ratio, each.deviation), default=None)
    if worst is not None:
        tiles.append(Tile(worst.name, "worst variable", worst.line))
        tiles.append(Tile(_number(worst.deviation, worst.unit), "off by", worst.line))
        tiles.append(Tile(_number(worst.allowed, worst.unit), "allowed", worst.line))
        tiles.append(Tile(f"{worst.time:.6g} s", "at", worst.line))
    if len(comparisons) > 1:
        tiles += [Tile(str(number), kind, f"pairs that are {kind}") for kind, number in counts.items() if number]
    return tiles


def _number(value: float, unit: str) -> str:
    return f"{minus(powers(f'{value:.4g}'))} {display_unit(unit)}".strip() if isfinite(value) else "no number"


def _pairs(comparisons: Sequence[Comparison]) -> str:
    rows = []
    for number, each in enumerate(comparisons, 1):
        worst = each.worst
        told = each.problem or (f"{worst.name}: {worst.line}" if worst else "")
        rows.append(
            f'<tr><td><a href="#pair-{number}">{escape(each.result)}</a></td><td>{escape(each.reference)}</td>'
            f'<td>{_verdict(each.verdict)}</td><td class="meaning">{escape(minus(told))}</td></tr>'
        )
    heads = [("Result", False), ("Reference", False), ("Verdict", False), ("Worst", False)]
    return "<h2>All pairs</h2>\n" + table(heads, rows)


def _variables(comparison: Comparison) -> str:
    ranked = sorted(comparison.variables, key=lambda each: -each.ratio if each.verdict != "same" else 1.0)
    heads = [
        ("Variable", False), ("Verdict", False), ("Off by", True), ("Allowed", True), ("Unit", False),
        ("In time", True), ("Worst at [s]", True), ("Result", True), ("Reference", True), ("Rows outside", True),
    ]  # fmt: skip
    return table(heads, [_row(each) for each in ranked])


def _row(each: Variable) -> str:
    name = f"<td><code>{escape(each.name)}</code>"
    if each.source and each.source != each.name:
        name += f' <span class="muted">{escape(each.source)}</span>'
    if each.verdict in ("missing", "unusable"):
        return f'<tr>{name}</td><td>{_verdict(each.verdict)}</td><td colspan="8">{escape(each.reason)}</td></tr>'
    if each.reason:
        name += f"<br>{escape(each.reason)}"
    numbers = [
        _number(each.deviation, ""), _number(each.allowed, ""), None, reach_text(each), f"{each.time:.9g}",
        minus(f"{each.value:.9g}"), minus(f"{each.expected:.9g}"), f"{each.outside} of {each.rows}",
    ]  # fmt: skip
    cells = "".join(
        f"<td>{escape(display_unit(each.unit))}</td>" if text is None else f'<td class="number">{escape(text)}</td>'
        for text in numbers
    )
    return f"<tr>{name}</td><td>{_verdict(each.verdict)}</td>{cells}</tr>"


def _verdict(verdict: str) -> str:
    return WORDS[verdict] if verdict == "same" else f'<strong style="color:var(--vermillion)">{WORDS[verdict]}</strong>'
