"""The report of comparisons as HTML; for programs as JSON, and as JUnit XML, as GitHub, GitLab and Jenkins show it.

Each file is written whole or not at all.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict
from math import isfinite
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from feedsim.comparison import Comparison, Curves, Variable, interpolate_at, percent, seconds
from feedsim.files.trace.files import is_stream, written_whole
from feedsim.foundation.errors import Finding, OutputError
from feedsim.foundation.outputs import begins_with, check_file, claim_folder
from feedsim.report.chart import Axis, Band, Chart, Curve, Level, Mark, Panel
from feedsim.report.content import Paragraph, Part, Picture, Report, Section, Span, Table, Text, Tile, code
from feedsim.report.formatting import (
    ALLOWED_COLOUR,
    MUTED,
    RECORDED_COLOUR,
    RESIDUAL_COLOUR,
    SIMULATED_COLOUR,
    Array,
    count_things,
    display_unit,
    minus,
    powers,
)
from feedsim.report.page import html as as_html

# --- Pictures of a comparison: the tube around the reference, the result, and where it is outside ---------------------


MAX_VARIABLES = 4  # variables in a picture
ROWS_AROUND_WORST = 60  # rows of the result to either side of the worst one
OFF_PANEL = 1e30  # beyond every panel


def drawn_variables(comparison: Comparison) -> list[Variable]:
    """Variables that are drawn: the worst ones outside, else the one nearest to its limit."""
    kept = [variable for variable in comparison.variables if variable.curves is not None]
    outside = [variable for variable in kept if variable.verdict == "different"]
    ranked = sorted(outside or kept, key=lambda variable: (-variable.ratio, -variable.deviation))
    return ranked[: MAX_VARIABLES if outside else 1]


def picture_of(comparison: Comparison, number: int) -> Picture | None:
    """The worst variables over the whole time and around the worst instant; None where nothing was compared."""
    variables = drawn_variables(comparison)
    if not variables:
        return None
    outside = len(comparison.those("different"))
    shown = f"the {len(variables)} worst of {outside} variables outside" if outside > len(variables) else ""
    title = f"{comparison.result} against {comparison.reference}"
    caption = (
        "A pair of panels per variable: the compared time; around the worst instant, result and band "
        "less the reference. The band is the tolerance around the reference; where the result leaves it, "
        "the ground is shaded." + (f" Drawn are {shown}." if shown else "")
    )
    panels = [panel for variable in variables for panel in _panels(variable)]
    return Picture(f"comparison-{number}", title, caption, Chart(panels, (1.5, 1.0)))


def _panels(variable: Variable) -> list[Panel]:
    """The whole time, and result and band less the reference around the worst instant."""
    curves = variable.curves
    assert curves is not None
    unit = display_unit(variable.unit)
    time = Axis("time", "s")
    reference = Curve("reference", *_as_steps(curves), RECORDED_COLOUR, width=1.2)
    colour = RESIDUAL_COLOUR if variable.outside else MUTED
    whole = Panel(
        variable.name,
        time,
        Axis(variable.name, unit),
        [reference, Curve("result", curves.time, curves.values, SIMULATED_COLOUR)],
        [Level(variable.time, "worst", upright=True, colour=colour, dash="dotted")],
        [
            Band("tolerance", curves.lower, curves.upper, curves.time, ALLOWED_COLOUR),
            *_residual_bands(curves, slice(None)),
        ],
        linked=variable.name,
    )
    part = _rows_around_worst(variable, curves)
    near = curves.time[part]
    expected = interpolate_at(curves.reference_time, curves.reference, near)
    difference = [Curve("result", near, curves.values[part] - expected, SIMULATED_COLOUR)]
    band = Band("tolerance", curves.lower[part] - expected, curves.upper[part] - expected, near, ALLOWED_COLOUR)
    marks = []
    if np.isfinite(variable.value):
        there = variable.value - interpolate_at(curves.reference_time, curves.reference, np.array([variable.time]))
        marks = [Mark(variable.time, float(there[0]), "", colour)]
    detail = Panel(
        _worst_deviation_text(variable),
        time,
        Axis("less the reference", unit),
        difference,
        [Level(0.0, dash="")],
        [band, *_residual_bands(curves, part)],
        marks,
    )
    return [whole, detail]


def _as_steps(curves: Curves) -> tuple[Array, Array]:
    """The reference, as steps where it is held."""
    if not curves.hold:
        return curves.reference_time, curves.reference
    return np.repeat(curves.reference_time, 2)[1:], np.repeat(curves.reference, 2)[:-1]


def _residual_bands(curves: Curves, part: slice) -> list[Band]:
    return [Band("outside", -OFF_PANEL, OFF_PANEL, np.array(ends), RESIDUAL_COLOUR) for ends in _spans(curves, part)]


def _rows_around_worst(variable: Variable, curves: Curves) -> slice:
    """Rows about the worst instant: some tolerances in time wide, so that the tube can be read."""
    worst = int(np.argmin(np.abs(curves.time - variable.time)))
    step = float(np.ptp(curves.time)) / max(1, len(curves.time) - 1)
    rows = ROWS_AROUND_WORST + int(min(3 * variable.reach / step, 2000)) if step > 0 else ROWS_AROUND_WORST
    return slice(max(0, worst - rows), worst + rows + 1)


def _worst_deviation_text(variable: Variable) -> str:
    off = f"off by {variable.deviation:.3g}, allowed {variable.allowed:.3g} {display_unit(variable.unit)}".strip()
    return minus(powers(off)) if np.isfinite(variable.deviation) else "no number"


def _spans(curves: Curves, part: slice) -> list[tuple[float, float]]:
    """Spans of time in which the result is outside, each as wide as can be seen."""
    time, y = curves.time[part], curves.values[part]
    with np.errstate(invalid="ignore"):
        out = ~((y >= curves.lower[part]) & (y <= curves.upper[part]))
    edges = np.flatnonzero(np.diff(np.concatenate([[0], out.astype(int), [0]])))
    spans = [(float(time[a]), float(time[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    width = (float(time[-1] - time[0]) if len(time) else 0.0) / 400
    merged: list[tuple[float, float]] = []
    for begin, end in spans:  # what lies closer than a line is wide is one
        if merged and begin - merged[-1][1] < width:
            merged[-1] = (merged[-1][0], end)
        else:
            merged.append((begin, end))
    widened = ((begin, end, max(0.0, width - (end - begin)) / 2) for begin, end in merged)
    return [(begin - more, end + more) for begin, end, more in widened]


def reach_text(variable: Variable) -> str:
    """Tolerance in time for a table."""
    return seconds(variable.reach) if variable.reach else "–"


MOST_PICTURES = 12
# What the beginning of a file holds that a comparison wrote.
MARKS = {
    "html": (b'<meta name="generator" content="feedsim compare">',),
    "xml": (b'<testsuites name="feedsim compare"',),
    "json": (b'"comparisons":',),
}
LOCK = ".feedsim-compare.lock"
WAIT = 60.0  # s for others to write theirs, which takes none

# Characters that XML 1.0 cannot hold.
_ILLEGAL = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def check_writable(outputs: Mapping[str, Path | None], inputs: Sequence[Path]) -> None:
    """OutputError where an output would replace an input, another output, or a file that no comparison wrote.

    outputs: kind of the file ("html", "xml", "json") -> its path, None where it is not asked for.
    """
    seen: list[Path] = []
    for kind, path in outputs.items():
        if path is None:
            continue
        check_file(path, inputs, ours=begins_with(*MARKS[kind]), what=f"{kind.upper()} of a comparison")
        whole = path.resolve()
        if whole in seen:
            raise OutputError(f"{path}: is given for two outputs")
        seen.append(whole)


def write(
    comparisons: Sequence[Comparison],
    *,
    html: Path | None = None,
    xml: Path | None = None,
    json: Path | None = None,
    durations: Sequence[float] = (),
) -> tuple[Path, ...]:
    """Write the report, JUnit XML and JSON that are asked for; returns the paths. Folders are made. OutputError.

    They are of one comparison also where several processes write the same files: these wait for one another.
    """
    contents: list[tuple[Path | None, Callable[[], bytes]]] = [
        (html, lambda: as_html(report_of(comparisons), "compare").encode("utf-8", "backslashreplace")),
        (xml, lambda: junit(comparisons, durations)),
        (json, lambda: to_json(comparisons).encode("utf-8", "backslashreplace")),
    ]
    made = [(path, content()) for path, content in contents if path is not None]
    with ExitStack() as stack:
        folders = set()
        for path, _ in made:
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                if not is_stream(path):
                    folders.add(path.resolve().parent)
            except OSError as error:
                raise OutputError(f"{path} cannot be written: {error.strerror or error}") from error
        for folder in sorted(folders) if len(made) > 1 else ():
            stack.enter_context(claim_folder(folder, LOCK, WAIT))
        for path, data in made:
            with written_whole(path) as file:
                file.write(data)
    return tuple(path for path, _ in made)


def report_of(comparisons: Sequence[Comparison]) -> Report:
    """Content of the report: of several pairs a table of all, and those that differ first."""
    counts = {
        kind: sum(comparison.verdict == kind for comparison in comparisons)
        for kind in ("same", "different", "unusable")
    }
    verdict = next((kind for kind in ("unusable", "different") if counts[kind]), "same")
    one = comparisons[0] if len(comparisons) == 1 else None
    return Report(
        f"Comparison: {one.heading}" if one else f"{count_things(len(comparisons), 'comparison')}: {verdict}",
        f"{one.result} against {one.reference}"
        if one
        else ", ".join(f"{number} {kind}" for kind, number in counts.items() if number),
        answer=_answer(comparisons),
        warnings=[*(_problem(one) if one else []), *not_seen(comparisons)],
        tiles=_tiles(comparisons, counts),
        main=list(_single_pair_parts(one)) if one else [_pairs(comparisons), *_sections(comparisons)],
        footer="Deviation: distance of the result from the reference, less what the tolerance in time forgives. "
        "How results are compared: docs/comparing.md.",
    )


def _answer(comparisons: Sequence[Comparison]) -> list[str]:
    """What came out, where it is worst, and what to do next."""
    if len(comparisons) > 1:
        return []  # the head says how many differ, the table of all pairs which
    one = comparisons[0]
    outside, compared = one.those("different"), one.those("same", "different")
    if not compared or one.worst is None:
        return []
    if not outside:
        return [f"All {count_things(len(compared), 'variable')} that were compared stay within their tolerance."]
    return [
        f"{len(outside)} of {count_things(len(compared), 'variable')} leave their tolerance, {one.worst.name} "
        f"the furthest: "
        f"{one.worst.line}.",
        *(f"It looks like: {proposal.text}." for proposal in one.looks_like),
        "The picture shows whether it is a matter of value or of time; which differences are allowed is yours to say "
        "(--tol).",
    ]


def _problem(one: Comparison) -> list[Finding]:
    """Why a pair cannot be compared, or what of it was not."""
    if not one.problem:
        return []
    if one.verdict == "unusable":
        return [Finding("comparison-unusable", "doubt", one.problem, one.result)]
    return [Finding("comparison-not-covered", "doubt", one.problem, one.result)]


def not_seen(comparisons: Sequence[Comparison]) -> list[Finding]:
    """That rows of results were not compared, of which nobody knows whether they are the same."""
    partly = [
        comparison
        for comparison in comparisons
        if comparison.same and comparison.coverage is not None and comparison.coverage.share < 1
    ]
    if len(comparisons) == 1:
        texts = [
            f"Compared: {comparison.coverage.text}. The other rows may hold anything."
            for comparison in partly
            if comparison.coverage
        ]
        return [Finding("rows-not-compared", "doubt", text, comparisons[0].result) for text in texts]
    named = ", ".join(f"{comparison.result} ({comparison.heading})" for comparison in partly[:3])
    more = f" and {len(partly) - 3} more" if len(partly) > 3 else ""
    text = f"Of {count_things(len(partly), 'result')} not all rows are compared: {named}{more}."
    return [Finding("rows-not-compared", "doubt", text)] if partly else []


def _sections(comparisons: Sequence[Comparison]) -> Iterator[Section]:
    """A section per pair, those that differ first and, up to MOST_PICTURES, with a picture."""
    pictures = 0
    for number, comparison in sorted(enumerate(comparisons, 1), key=lambda item: item[1].same):
        parts: list[Part] = [Paragraph(f"against {comparison.reference}", "muted")]
        parts += _single(comparison, number, draw=not comparison.same and pictures < MOST_PICTURES, alone=False)
        pictures += any(isinstance(part, Picture) for part in parts)
        yield Section(comparison.result, parts, _anchor(number))


def _single_pair_parts(comparison: Comparison) -> Iterator[Part]:
    """The only pair: its picture, and all else under a title."""
    parts = list(_single(comparison, 1, draw=True, alone=True))
    yield from (part for part in parts if isinstance(part, Picture))
    if others := [part for part in parts if not isinstance(part, Picture)]:
        yield Section("Variable by variable", others)


def _single(comparison: Comparison, number: int, *, draw: bool, alone: bool) -> Iterator[Part]:
    """A pair: what came out, notes, picture, variables."""
    if not alone or comparison.problem:
        yield Paragraph(minus(comparison.line))
    if not alone:
        yield from (Paragraph(f"It looks like: {minus(proposal.text)}.") for proposal in comparison.looks_like)
    yield from (Paragraph(note, "note") for note in comparison.notes)
    if draw and (picture := picture_of(comparison, number)):
        yield picture
    if comparison.variables:
        yield _variables(comparison)


def _tiles(comparisons: Sequence[Comparison], counts: dict[str, int]) -> list[Tile]:
    compared = [variable for pair in comparisons for variable in pair.those("same", "different")]
    outside = [variable for variable in compared if variable.verdict == "different"]
    missing = [variable for pair in comparisons for variable in pair.those("missing")]
    tiles = [Tile(f"{len(outside)} of {len(compared)}", "variables outside", "variables that leave their tube")]
    covers = [comparison.coverage for comparison in comparisons if comparison.coverage is not None]
    if covers:
        least = min(covers, key=lambda coverage: coverage.share)
        tiles.append(Tile(percent(least.share), "rows compared", f"of the result, at least; {least.text}"))
    if missing:
        tiles.append(Tile(str(len(missing)), "variables missing", "columns of the reference that the result lacks"))
    worst = max(compared, key=lambda variable: (variable.ratio, variable.deviation), default=None)
    if worst is not None:
        tiles.append(Tile(worst.name, "worst variable", worst.line))
        tiles.append(Tile(_number(worst.deviation, worst.unit), "off by", worst.line))
        tiles.append(Tile(_number(worst.allowed, worst.unit), "allowed", worst.line))
        tiles.append(Tile(f"{worst.time:.6g} s", "worst instant", worst.line))
    if len(comparisons) > 1:
        tiles += [Tile(str(number), kind, f"pairs that are {kind}") for kind, number in counts.items() if number]
    return tiles


def _number(value: float, unit: str) -> str:
    return f"{minus(powers(f'{value:.4g}'))} {display_unit(unit)}".strip() if isfinite(value) else "no number"


def _pairs(comparisons: Sequence[Comparison]) -> Section:
    rows: list[tuple[Text, ...]] = []
    for number, comparison in enumerate(comparisons, 1):
        worst = comparison.problem or (f"{comparison.worst.name}: {comparison.worst.line}" if comparison.worst else "")
        compared = comparison.coverage.text if comparison.coverage else "nothing"
        link = Span(comparison.result, "link", _anchor(number))
        rows.append((link, comparison.reference, _verdict(comparison.heading), compared, minus(worst)))
    return Section("All pairs", [Table("lllpp", ("Result", "Reference", "Verdict", "Compared", "Worst"), rows)])


def _anchor(number: int) -> str:
    return f"pair-{number}"


def _variables(comparison: Comparison) -> Table:
    ranked = sorted(comparison.variables, key=lambda variable: -variable.ratio if variable.verdict != "same" else 1.0)
    heads = (
        "Variable", "Verdict", "Off by", "Allowed", "Unit", "Allowed in time", "Worst at [s]", "Result", "Reference",
        "Rows outside",
    )  # fmt: skip
    return Table("llrrlrrrrr", heads, [_row(variable) for variable in ranked])


def _row(variable: Variable) -> tuple[Text, ...]:
    name: tuple[str | Span, ...] = (code(variable.name),)
    if variable.source and variable.source != variable.name:
        name += (" ", Span(variable.source, "muted"))
    if variable.verdict in ("missing", "unusable"):
        return name, _verdict(variable.verdict), variable.reason
    if variable.reason:
        name += (f"\n{variable.reason}",)
    return (
        name,
        _verdict(variable.verdict),
        _number(variable.deviation, ""),
        _number(variable.allowed, ""),
        display_unit(variable.unit),
        reach_text(variable),
        f"{variable.time:.9g}",
        minus(powers(f"{variable.value:.9g}")),
        minus(powers(f"{variable.expected:.9g}")),
        f"{variable.outside} of {variable.rows}",
    )


def _verdict(verdict: str) -> Text:
    return verdict if verdict.startswith("same") else Span(verdict, "alarm")


def junit(comparisons: Sequence[Comparison], durations: Sequence[float] = ()) -> bytes:
    """JUnit XML: a suite per pair, called by both its files, a case per variable, and one for the pair itself.

    What differs or is missing is a failure, what cannot be compared an error. durations: [s] of the pairs.
    """
    root = ElementTree.Element("testsuites", name="feedsim compare")
    totals = dict.fromkeys(("tests", "failures", "errors"), 0)
    for i, comparison in enumerate(comparisons):
        seconds = durations[i] if i < len(durations) else 0.0
        pair = _text(f"{comparison.result} against {comparison.reference}")
        suite = ElementTree.SubElement(root, "testsuite", name=pair)
        if comparison.coverage is not None:
            properties = ElementTree.SubElement(suite, "properties")
            ElementTree.SubElement(properties, "property", name="compared", value=comparison.coverage.text)
        counts = dict.fromkeys(totals, 0)
        whole = ElementTree.SubElement(suite, "testcase", classname=pair, name="(whole)", time=f"{seconds:.3f}")
        counts["tests"] += 1
        if comparison.problem:
            broken = comparison.verdict == "unusable" and not comparison.those("same", "different")
            _fault(whole, "error" if broken else "failure", comparison.problem, comparison.problem)
            counts["errors" if broken else "failures"] += 1
        for variable in comparison.variables:
            case = ElementTree.SubElement(suite, "testcase", classname=pair, name=_text(variable.name), time="0.000")
            counts["tests"] += 1
            if variable.verdict == "unusable":
                _fault(case, "error", variable.reason, variable.reason)
                counts["errors"] += 1
            elif variable.verdict != "same":
                _fault(case, "failure", variable.line, _details(comparison, variable))
                counts["failures"] += 1
        out = [f"result: {comparison.result}", f"reference: {comparison.reference}", comparison.line, *comparison.notes]
        for name, number in counts.items():
            suite.set(name, str(number))
            totals[name] += number
        suite.set("skipped", "0")
        suite.set("time", f"{seconds:.3f}")
        ElementTree.SubElement(suite, "system-out").text = _text("\n".join(out))
    for name, number in totals.items():
        root.set(name, str(number))
    root.set("time", f"{sum(durations):.3f}")
    ElementTree.indent(root)
    text: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return text + b"\n"


def to_json(comparisons: Sequence[Comparison]) -> str:
    """JSON text: verdicts, every variable in full precision; null where there is no number."""
    data = {
        "verdict": overall(comparisons),
        "comparisons": [
            {
                "result": comparison.result,
                "reference": comparison.reference,
                "verdict": comparison.verdict,
                "problem": comparison.problem,
                "notes": list(comparison.notes),
                "looks_like": [asdict(proposal) for proposal in comparison.looks_like],
                "start": comparison.start,
                "end": comparison.end,
                "shift": comparison.shift,
                "coverage": None
                if comparison.coverage is None
                else asdict(comparison.coverage) | {"share": comparison.coverage.share},
                "worst": comparison.worst.name if comparison.worst is not None else None,
                "variables": [_variable(variable) for variable in comparison.variables],
            }
            for comparison in comparisons
        ],
    }
    return json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def overall(comparisons: Sequence[Comparison]) -> str:
    """The worst verdict of all."""
    return max((comparison for comparison in comparisons), key=lambda comparison: comparison.exit_code).verdict


def _variable(variable: Variable) -> dict[str, Any]:
    names = (
        "name", "source", "verdict", "unit", "time", "value", "expected", "deviation", "allowed", "ratio", "reach",
        "rows", "covered", "outside", "first", "reason",
    )  # fmt: skip
    values = {name: getattr(variable, name) for name in names}
    return {k: None if isinstance(v, float) and not isfinite(v) else v for k, v in values.items()}


def _details(comparison: Comparison, variable: Variable) -> str:
    if variable.verdict == "missing":
        return variable.reason
    unit = f" {variable.unit}" if variable.unit not in ("", "1") else ""
    lines = [
        f"{variable.name}: {variable.line}",
        f"outside in {variable.outside} of {variable.rows} rows, first at {variable.first} s",
        f"result {variable.value!r}{unit}, reference {variable.expected!r}{unit}",
        f"result: {comparison.result}, column {variable.source}",
        f"reference: {comparison.reference}",
    ]
    lines += [f"looks like: {proposal.text}" for proposal in comparison.looks_like if variable.name in proposal.names]
    return "\n".join(lines + ([variable.reason] if variable.reason else []))


def _fault(case: ElementTree.Element, kind: str, message: str, text: str) -> None:
    ElementTree.SubElement(case, kind, message=_text(message), type=kind).text = _text(text)


def _text(text: str) -> str:
    return _ILLEGAL.sub("\ufffd", text)
