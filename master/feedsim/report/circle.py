"""The report of recorded circles."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from feedsim.analysis import Diagnosis, Figure, explain_circle
from feedsim.analysis.circle import CircleUnderTest, TurnedPath, actionable_causes, term_name
from feedsim.analysis.circle.records import RecordedCircle
from feedsim.analysis.circle.words import Change, compare_terms, sure_changes
from feedsim.analysis.circularity import axis_letters
from feedsim.analysis.evaluate import FIGURE_UNITS, both_directions, cause_figures, shift_centre
from feedsim.analysis.proposals import of_circle
from feedsim.motions.circular import SENSE_WORDS
from feedsim.report import content
from feedsim.report.changes import action, changes_section, control_section
from feedsim.report.chart import Curve, Dash
from feedsim.report.content import TILES as TILES_SHOWN
from feedsim.report.content import Bullets, Paragraph, Picture, Report, Section, Span, Step, Table, Tile, tile_value
from feedsim.report.formatting import (
    AFTER_COLOUR,
    BEFORE_COLOUR,
    CLOCKWISE,
    RECORDED_COLOUR,
    SIMULATED_COLOUR,
    Array,
    count_things,
    minus,
    two_digits,
    typeset,
)
from feedsim.report.provenance import finite, hash_files, inputs_part, quantity
from feedsim.report.run import axis_plots, sheet
from feedsim.report.run.pose import cause_tile, diagnosis_part, diagnosis_section

FORMAT = 1
DASHES: dict[int, Dash] = {1: "", -1: "dashed"}  # by the sense of the turn
COLOURS = {1: RECORDED_COLOUR, -1: CLOCKWISE}
NOTHING_CHANGED = "no cause has changed beyond doubt (95 %)"
TILES = {"G": "circular deviation G", "G_b": "bidirectional deviation G(b)", "H": "circular hysteresis H"}
FULL_TURN_FIGURES = {
    "G": "ISO 230-4 circular deviation",
    "G_b": "ISO 230-4 bidirectional circular deviation",
    "D": "ISO 230-4 mean bidirectional radial deviation",
    "H": "ISO 230-4 circular hysteresis",
}


@dataclass(frozen=True, eq=False)
class _CentredTurn:
    """A turn about the centre that is fitted to all."""

    angle: Array
    deviation: Array
    sense: int


def answers(diagnosis: Diagnosis) -> list[str]:
    """Why the circle is not round, in a sentence."""
    return [f"{axis_letters(diagnosis.circle.axes)}: {explain_circle(diagnosis)}"]


def first_action(diagnosis: Diagnosis) -> str:
    """What to type for the main cause; "" where nothing of a control takes it away."""
    first = next(((term.key, term.axis) for term in actionable_causes(diagnosis)), None)
    proposals = of_circle(diagnosis, None, None)
    return action(proposals) if proposals and proposals[0].of == first else ""


def figures_of(recorded: RecordedCircle, diagnosis: Diagnosis) -> dict[str, Figure]:
    """Figures of the circle, named as those of a run."""
    circle = recorded.circle
    prefix = axis_letters(circle.axes)
    centre = "the fitted centre" if recorded.centred else "the programmed centre"
    if diagnosis.arc is not None:
        about_arc = (
            f"range of the radial deviation on an arc of {math.degrees(diagnosis.arc):.0f} deg, about its circle"
        )
        figures = {
            name: Figure(math.nan, "um", f"{meaning}: needs a full turn") for name, meaning in FULL_TURN_FIGURES.items()
        }
        figures["arc_range"] = Figure(diagnosis.G * 1e6, "um", about_arc)
        return _prefix_figures(prefix, figures | cause_figures(diagnosis))
    figures = {"G": Figure(diagnosis.G * 1e6, "um", f"range of the radial deviation of all turns, about {centre}")}
    for sense in (1, -1):
        if sense not in diagnosis.senses:
            return _prefix_figures(prefix, figures | cause_figures(diagnosis))
    one = next(turn.path for turn in recorded.turns if turn.path.sense > 0)
    other = next(turn.path for turn in recorded.turns if turn.path.sense < 0)
    curves = [(one.angle, one.deviation), (other.angle, other.deviation)]
    return _prefix_figures(
        prefix, figures | both_directions(curves, circle.radius, circle.axes) | cause_figures(diagnosis)
    )


def _prefix_figures(prefix: str, figures: Mapping[str, Figure]) -> dict[str, Figure]:
    # Nobody knows here where a position was read: by scales, or at the tool.
    return {
        f"{prefix}.{name}": Figure(figure.value, figure.unit, figure.meaning.removesuffix(", by the linear scales"))
        for name, figure in figures.items()
    }


def report_of(
    recorded: RecordedCircle, diagnosis: Diagnosis, figures: Mapping[str, Figure], files: Sequence[Path]
) -> Report:
    """Content of the report."""
    circle = recorded.circle
    prefix = axis_letters(circle.axes)
    labels = {"G": TILES["G"]} if diagnosis.arc is None else {"arc_range": "range of the deviation on the arc"}
    labels |= TILES if diagnosis.arc is None else {}
    own = {key: figures.get(f"{prefix}.{key}") for key in labels}
    tiles = [cause_tile(diagnosis, term) for term in actionable_causes(diagnosis)[:TILES_SHOWN]]
    tiles += [Tile(tile_value(figure), labels[key], typeset(figure.meaning)) for key, figure in own.items() if figure]
    return Report(
        f"Recorded circle {prefix}",
        f"{', '.join(file.name for file in files)} · {count_things(len(recorded.turns), 'turn')}",
        answer=answers(diagnosis),
        warnings=list(recorded.doubts),
        tiles=tiles,
        action=first_action(diagnosis),
        next_step=_suggest_record(files),
        main=[
            picture(circle, recorded, diagnosis),
            changes_section(of_circle(diagnosis, None, None)),
            diagnosis_section(prefix, diagnosis),
            content.figures_section(figures),
            control_section(),
            Section("How the files were read", [Bullets(recorded.notes)]),
        ],
        provenance=content.provenance_section(_facts(recorded), hash_files([("record", file) for file in files])),
        footer=content.figures_footer("Values in full precision: summary.json."),
    )


def picture(circle: CircleUnderTest, recorded: RecordedCircle, diagnosis: Diagnosis) -> Picture:
    """All turns over each other, magnified, and what the model says of them."""
    turns = _centre_turns([turn.path for turn in recorded.turns], circle, diagnosis, recorded.centred)
    fitted = _centre_turns(
        [TurnedPath(a, e, s) for (a, e), s in zip(diagnosis.rest, diagnosis.senses, strict=True)],
        circle, diagnosis, recorded.centred,
    )  # fmt: skip
    curves = [
        axis_plots.turn_curve(
            SENSE_WORDS[turn.sense], COLOURS[turn.sense], turn.angle, turn.deviation, DASHES[turn.sense]
        )
        for turn in turns
    ]
    curves += [
        axis_plots.turn_curve("model without peaks", SIMULATED_COLOUR, centred.angle, centred.deviation, "dotted", 1.1)
        for centred in fitted[:1]
    ]
    return _draw_turns(circle, recorded, turns, curves, "Dotted: the fitted model without peaks.")


def picture_of_both(before: DiagnosedRecords, after: DiagnosedRecords) -> Picture:
    """The turns before and after a change over each other, at one scale."""
    curves, every = [], []
    for words, colour, taken in (("before", BEFORE_COLOUR, before), ("after", AFTER_COLOUR, after)):
        circle, recorded = taken.recorded.circle, taken.recorded
        turns = _centre_turns([turn.path for turn in recorded.turns], circle, taken.diagnosis, recorded.centred)
        curves += [
            axis_plots.turn_curve(f"{words}, {SENSE_WORDS[t.sense]}", colour, t.angle, t.deviation, DASHES[t.sense])
            for t in turns
        ]
        every += turns
    return _draw_turns(before.recorded.circle, before.recorded, every, curves, "Both records have the same scale.")


def _draw_turns(
    circle: CircleUnderTest, recorded: RecordedCircle, turns: Sequence[_CentredTurn], curves: Sequence[Curve], note: str
) -> Picture:
    on = axis_plots.circle(circle, max(float(np.abs(turn.deviation).max()) for turn in turns))
    plane = f"{circle.axes[0]}-{circle.axes[1]}"
    caption = (
        f"Radius {circle.radius * 1e3:.6g} mm. Radius deviation magnified "
        f"{on.magnification:,.0f} times; rings at ±{on.ring:g} µm about the "
        f"circle{', about its fitted centre' if recorded.centred else ''}. {note}"
    )
    title = f"Recorded circle in the plane {plane}"
    return Picture(f"circle-{plane}", title, caption, axis_plots.circle_chart(on, curves))


def _centre_turns(
    paths: Sequence[TurnedPath], circle: CircleUnderTest, diagnosis: Diagnosis, centred: bool
) -> list[_CentredTurn]:
    centre = np.array(diagnosis.centre if centred else (0.0, 0.0))
    return [
        _CentredTurn(*shift_centre(path.angle, path.deviation, circle.radius, centre), path.sense) for path in paths
    ]


# --- Before and after a change ----------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class DiagnosedRecords:
    """Records of a circle, taken apart. files: that they were read from."""

    recorded: RecordedCircle
    diagnosis: Diagnosis
    figures: Mapping[str, Figure]
    files: Sequence[Path]


def changes_of(before: DiagnosedRecords, after: DiagnosedRecords) -> list[Change]:
    """Every cause before and after, those first that have changed beyond doubt."""
    turns, later = ([turn.path for turn in taken.recorded.turns] for taken in (before, after))
    return compare_terms(before.diagnosis, after.diagnosis, turns, later)


def answers_of_both(before: DiagnosedRecords, after: DiagnosedRecords) -> list[str]:
    """What has changed beyond doubt, and why the circle is not round now."""
    one, other = before.diagnosis, after.diagnosis
    prefix = axis_letters(one.circle.axes)
    sure = sure_changes(changes_of(before, after))
    said = f"changed beyond doubt: {'; '.join(map(_change_words, sure))}" if sure else NOTHING_CHANGED
    G = f"G = {two_digits(1e6 * one.G)} um before, {two_digits(1e6 * other.G)} um after"
    return [f"{prefix}: {G}; {said}.", f"After: {explain_circle(other)}"]


def report_of_both(before: DiagnosedRecords, after: DiagnosedRecords) -> Report:
    """Content of the report of records before and after a change."""
    prefix = axis_letters(before.recorded.circle.axes)
    changes = changes_of(before, after)
    files = [*before.files, *after.files]
    tiles = [
        Tile(
            f"{two_digits(1e6 * before.diagnosis.G)} → {two_digits(1e6 * after.diagnosis.G)} µm",
            TILES["G"],
            "of all turns",
        ),
        *(Tile(_values(change), term_name(change.after), "before → after") for change in sure_changes(changes)),
    ]
    rows = [
        (
            term_name(change.before)[:1].upper() + term_name(change.before)[1:],
            *_values(change, "|").split("|"),
            minus(_round_value(change.difference, change)) + f" ± {_round_value(change.half, change)}",
            FIGURE_UNITS[change.before.unit][1].replace("um", "µm"),
            "changed" if change.sure else "not beyond doubt",
        )
        for change in changes
    ]
    note = (
        "±: half of an interval of 95 % of the difference, from what the fits leave of both records. Changed: beyond "
        "doubt at 95 % for all causes together."
    )
    heads = ("Cause", "Before", "After", "Change", "Unit", "Beyond doubt")
    return Report(
        f"Recorded circle {prefix}, before and after",
        f"{', '.join(file.name for file in before.files)} · after: {', '.join(file.name for file in after.files)}",
        answer=answers_of_both(before, after),
        action=first_action(after.diagnosis),
        warnings=[*before.recorded.doubts, *after.recorded.doubts],
        tiles=tiles,
        next_step=_suggest_record(after.files, before=after.files),
        main=[
            Paragraph((Span("Acceptance sheet for print, before and after", "file", sheet.HTML), ".")),
            picture_of_both(before, after),
            Table("lrrrlt", heads, rows, note),
            diagnosis_section(f"{prefix}, before", before.diagnosis),
            diagnosis_section(f"{prefix}, after", after.diagnosis),
            content.figures_section(after.figures),
            control_section(),
            Section("How the files were read", [Bullets([*before.recorded.notes, *after.recorded.notes])]),
        ],
        provenance=content.provenance_section(
            _facts(before.recorded), hash_files([("record", file) for file in files])
        ),
        footer=content.figures_footer("Values in full precision: summary.json."),
    )  # fmt: skip


def sheets_of_both(before: DiagnosedRecords, after: DiagnosedRecords) -> list[sheet.FilledSheet]:
    """Acceptance sheets of the records before and after."""
    return [_sheet("before", before), _sheet("after", after)]


def _sheet(when: str, taken: DiagnosedRecords) -> sheet.FilledSheet:
    circle, turns = taken.recorded.circle, [turn.path for turn in taken.recorded.turns]
    prefix = axis_letters(circle.axes)
    seen = _centre_turns(turns, circle, taken.diagnosis, taken.recorded.centred)
    grid = np.arange(0.0, 360.0, sheet.EVERY)
    curves = []
    for turn in seen:
        angle = np.rad2deg(turn.angle) % 360.0
        order = np.argsort(angle, kind="stable")
        curves.append(np.interp(grid, angle[order], 1e6 * turn.deviation[order], period=360.0))
    names = [SENSE_WORDS[turn.sense] for turn in turns]
    results = [
        sheet.Result(f"{symbol}_{prefix}", figure.meaning, figure.value, math.nan, sheet.NO_LIMIT_TEXT)
        for key, symbol in (("G", "G"), ("G_b", "G(b)"), ("D", "D"), ("H", "H"))
        if (figure := taken.figures.get(f"{prefix}.{key}")) is not None
    ]
    conditions = [
        ("Recorded", f"{when} the change"), ("Files", ", ".join(file.name for file in taken.files)),
        ("Plane", "-".join(circle.axes)),
        ("Nominal path", f"diameter {2e3 * circle.radius:.6g} mm, feed {6e4 * circle.speed:.5g} mm/min"),
        ("Centre", "fitted to the turns" if taken.recorded.centred else "as given"), ("Direction", " and ".join(names)),
    ]  # fmt: skip
    numbers = [(float(angle), *(float(curve[k]) for curve in curves)) for k, angle in enumerate(grid)]
    readings = [("radial deviation", "", f"{angle:g}", one, "", f"{curve[k]:.6f}", "um")
                for one, curve in zip(names, curves, strict=True) for k, angle in enumerate(grid)]  # fmt: skip
    shown = picture(circle, taken.recorded, taken.diagnosis)
    return sheet.FilledSheet(
        f"Circle {prefix}, {when}", "ISO 230-4", conditions, math.nan, ("Angle [°]", *(f"{n} [µm]" for n in names)),
        numbers, results, shown, readings, every=round(sheet.PRINTED / sheet.EVERY),
    )  # fmt: skip


def _round_value(value: float, change: Change) -> str:
    """To the second digit of the interval."""
    factor, _ = FIGURE_UNITS[change.before.unit]
    half = factor * change.half
    places = max(0, 1 - math.floor(math.log10(half))) if math.isfinite(half) and half > 0 else 2
    return f"{factor * value:.{places}f}"


def _values(change: Change, between: str = " → ") -> str:
    unit = "" if between == "|" else f" {FIGURE_UNITS[change.before.unit][1]}".replace("um", "µm")
    return minus(
        f"{_round_value(change.before.value, change)}{between}{_round_value(change.after.value, change)}{unit}"
    )


def _change_words(change: Change) -> str:
    unit = FIGURE_UNITS[change.before.unit][1]
    old, new = (_round_value(term.value, change) for term in (change.before, change.after))
    return f"{term_name(change.after)} {old} -> {new} {unit}"


def _suggest_record(files: Sequence[Path], before: Sequence[Path] = ()) -> Step:
    """Records after the next change beside these."""
    later: dict[str, Any] = {"after": [str(file.with_stem(f"{file.stem}_after")) for file in files]}
    if before:
        later["records"] = list(map(str, before))
    return Step("Make the change, record the circle again (any name behind --after), and compare", "circle", later)


def _facts(recorded: RecordedCircle) -> list[tuple[str, str]]:
    circle = recorded.circle
    return [
        ("Radius", f"{circle.radius * 1e3:.6g} mm"),
        ("Path speed", f"{circle.speed * 6e4:.5g} mm/min"),
        ("Centre", "fitted to the turns" if recorded.centred else "as given"),
    ]


def changes_part(before: DiagnosedRecords, after: DiagnosedRecords) -> list[dict[str, Any]]:
    """What has changed, as summary.json has it, in SI."""
    return [
        {
            "name": term_name(change.after),
            "before": quantity(change.before.value, change.before.unit),
            "after": quantity(change.after.value, change.after.unit),
            "half_interval": finite(change.half),
            "beyond_doubt": change.sure,
        }
        for change in changes_of(before, after)
    ]


def details(
    recorded: RecordedCircle,
    diagnosis: Diagnosis,
    files: Sequence[Path],
) -> dict[str, Any]:
    """What summary.json has besides the figures."""
    circle = recorded.circle
    prefix = axis_letters(circle.axes)
    return {
        "format": FORMAT,
        "recorded": recorded.day or None,
        "diagnosis": {prefix: diagnosis_part(diagnosis)},
        "circle": {
            "axes": list(circle.axes),
            "radius": quantity(circle.radius, "m"),
            "speed": quantity(circle.speed, "m/s"),
            "centre_fitted": recorded.centred,
            "arc": None if diagnosis.arc is None else quantity(diagnosis.arc, "rad"),
            "turns": [turn.name for turn in recorded.turns],
        },
        "inputs": inputs_part(hash_files([("record", file) for file in files])),
    }
