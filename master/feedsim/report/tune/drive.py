"""The report of a tuned drive: the values to type, the margins, and what moves and circles become."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from feedsim.analysis import Figure
from feedsim.design.tune.drive import (
    NOISE,
    TORQUE,
    WORSE_ERROR_RATIO,
    Case,
    ChangedParameter,
    Margins,
    Point,
    TunedDrive,
    decibels,
)
from feedsim.design.tune.knobs import EFFECTS
from feedsim.design.uncertainty import interval, share_of
from feedsim.estimation.replay.machine_files import drive_file, drive_text
from feedsim.files import sheets
from feedsim.files.control import Name, names_of
from feedsim.foundation.arguments import spell_argument
from feedsim.foundation.errors import Finding
from feedsim.foundation.units import convert, parameters
from feedsim.report import content
from feedsim.report.changes import requested_control
from feedsim.report.chart import Axis, Chart, Curve, Level, Mark, Panel
from feedsim.report.content import (
    FOLDER,
    Bullets,
    Paragraph,
    Part,
    Picture,
    Report,
    Section,
    Step,
    Table,
    Text,
    Tile,
    code,
    tile_value,
    with_remark,
)
from feedsim.report.formatting import (
    AFTER_COLOUR,
    ALLOWED_COLOUR,
    BEFORE_COLOUR,
    MUTED,
    NARROW,
    RESIDUAL_COLOUR,
    minus,
    typeset,
)
from feedsim.report.provenance import input_files, inputs_part, machine_part
from feedsim.report.uncertainty import drawn_values
from feedsim.scenario import Scenario

# --- What the intervals of identified values make of a tuned drive: figures, findings, a sentence and a section -------


def reductions(case: Case, name: str) -> Any:
    """By how much an error of every motion falls [%]; below 1 nm counts as 1 nm."""
    before, after = (np.maximum(getattr(errors, name), 1e-9) for errors in (case.before, case.after))
    return 100 * (1 - after / before)


def drawn_intervals(tuned: TunedDrive) -> dict[str, tuple[float, float]]:
    """Figure -> interval over draws of the machine: margins, and reductions of a drive that changes; empty without."""
    drawn = tuned.drawn
    if drawn is None:
        return {}
    values = {
        "gain_margin_after": [margin.gain for margin in drawn.margins],
        "phase_margin_after": [margin.phase for margin in drawn.margins],
    }
    for name in ("peak", "overshoot") if drawn.cases else ():
        values[f"{name}_reduction"] = [float(np.median(reductions(case, name))) for case in drawn.cases]
    return {
        name: tuple(map(float, interval(np.array(value))))  # type: ignore[misc]
        for name, value in values.items()
        if np.isfinite(value).all()
    }


def share_text(tuned: TunedDrive) -> str:
    """Share of further draws that an interval holds."""
    assert tuned.drawn is not None
    return f"{100 * share_of(tuned.drawn.count):.0f} %"


def drawn_findings(tuned: TunedDrive) -> list[Finding]:
    """What draws of the machine lack: margins, and motions that get worse."""
    drawn, limits = tuned.drawn, tuned.limits
    if drawn is None:
        return []
    result = []
    if thin := [margin for margin in drawn.margins if limits.missing(margin) > 0]:
        least = (
            f"{decibels(min(margins.gain for margins in thin))} and {min(margins.phase for margins in thin):.3g} deg"
        )
        result.append(Finding(
            "margins-thin-in-draws", "doubt",
            f"in {len(thin)} of {drawn.count} draws of the machine a margin is below {limits.gain_margin:g} dB or "
            f"{limits.phase_margin:g} deg; the least are {least}",
            tuned.axis,
        ))  # fmt: skip
    if bad := [case for case in drawn.cases if case.worse]:
        text = f"in {len(bad)} of {drawn.count} draws of the machine a motion gets worse than before"
        result.append(Finding("tuning-worse-in-draws", "doubt", text, tuned.axis))
    return result


def drawn_answer(tuned: TunedDrive) -> list[str]:
    """What the intervals of identified values make of it."""
    words = {"peak_reduction": "peaks fall by {} to {} %", "overshoot_reduction": "overshoot by {} to {} %",
             "gain_margin_after": "the gain margin is {} to {} dB",
             "phase_margin_after": "the phase margin {} to {} deg"}  # fmt: skip
    result = drawn_intervals(tuned)
    if not result or tuned.drawn is None:
        return []
    parts = [words[name].format(*(f"{end:.3g}" for end in result[name])) for name in words if name in result]
    return [
        f"With what identification leaves open: {', '.join(parts)} ({share_text(tuned)}, {tuned.drawn.count} draws)."
    ]


def drawn_section(tuned: TunedDrive, figures: Mapping[str, Figure]) -> Iterator[Section]:
    """Intervals over draws of the machine, and what was drawn."""
    if tuned.drawn is None:
        return
    lines: list[tuple[Text, ...]] = []
    for name, ends in drawn_intervals(tuned).items():
        figure = figures[f"{tuned.axis}.{name}"]
        values = (minus(f"{value:.3g}") for value in (figure.value, *ends))
        lines.append((code(f"{tuned.axis}.{name}"), *values, typeset(figure.unit)))
    note = (
        f"{tuned.drawn.count} draws of the machine, which the values were not found on. An interval holds "
        f"{share_text(tuned)} of further draws. Margins: the least over loops, poses and modes."
    )
    table = Table("lrrrl", ("Figure", "Value", "From", "To", "Unit"), lines, note)
    yield Section("What identification leaves open", [table, drawn_values(tuned.drawn.cloud)])


# --- What a tuned drive leaves beside its page: settings, drive files, and the values to type -------------------------


SETTINGS, SHEET = "settings.yaml", "sheet.csv"


def names_for(tuned: TunedDrive, control: str) -> Mapping[str, Name]:
    """Our parameter -> its name in the control that is asked for, or that the machine has; empty without one."""
    known = control or requested_control(tuned.scenario.machine)
    return names_of(known) if known else {}


def settings(tuned: TunedDrive) -> str:
    """The `set` group of a scenario with the values."""
    head = "# Values of feedsim tune drive, for the group `set` of a scenario.\n"
    lines = [f"  {change.key}: {change.text}" for change in tuned.changes]
    return head + ("set:\n" + "\n".join(lines) + "\n" if lines else "set: {}\n")


def drives(tuned: TunedDrive) -> dict[str, str]:
    """Name -> text of a drive file for the tuned axis, changed or not, and for every other that has changed.

    A machine file or --set takes them.
    """
    same = "; its values stay as they were" if tuned.kept else ""
    head = f"Drive of axis {{}} of {tuned.scenario.machine.name}, written by feedsim tune drive{same}."
    return {
        drive_file(axis): drive_text(
            tuned.machine.shipped_drive(axis, "a file"), {}, "", [head.format(axis)], exact=True
        )
        for axis in dict.fromkeys([tuned.axis, *(change.axis for change in tuned.changes)])
    }


def sheet(tuned: TunedDrive, control: str = "") -> str:
    """Values to type: old and new, in the control's unit where its name is known."""
    heads = ("axis", "number", "name", "old", "new", "unit", "unit confirmed", "parameter")
    return sheets.text_of((heads, *rows(tuned, control)))


def rows(tuned: TunedDrive, control: str = "") -> Iterator[tuple[str, ...]]:
    """Axis, number, name, old, new, unit, whether the unit is confirmed, and our parameter."""
    names = names_for(tuned, control)
    for change in tuned.changes:
        name = names.get(change.parameter)
        if name is not None:
            shown = (_in_control(name, change.old), _in_control(name, change.new))
            cells = (name.number, name.name, *shown, name.unit, "yes" if name.confirmed else "no")
        else:
            cells = ("", "", *_change_texts(change), "")
        yield (change.axis, *cells, change.parameter.removeprefix("drive."))


def _in_control(name: Name, value: Any) -> str:
    return value if isinstance(value, str) else "" if value is None else f"{name.shown(float(value)):.6g}"


def _change_texts(change: ChangedParameter) -> tuple[str, str, str]:
    """Old and new value in the unit that is shown, and the unit."""
    row = parameters("controller").get(change.parameter.removeprefix("drive."))
    unit = row.display_unit if row is not None and change.unit else ""

    def text(value: Any) -> str:
        if value is None:
            return "none"
        if isinstance(value, str | bool) or not unit:
            return str(value)
        return f"{convert(float(value), change.unit, unit):.6g}"

    return text(change.old), text(change.new), unit


def lines_of(rows: Iterable[Sequence[str]]) -> list[str]:
    """A line for every value to type, as the terminal shows it. rows: as of :func:`rows` and of sheets."""
    result = []
    for axis, number, name, old, new, unit, confirmed, parameter in rows:
        what = f"{number} {name} ({parameter})" if number else parameter
        doubt = " (unit not confirmed)" if confirmed == "no" else ""
        result.append(f"  {axis}: {what} {old} -> {new}{'' if unit in ('', '1') else f' {unit}'}{doubt}")
    return result


BINDS = 0.06  # of a limit: a margin that is as near to it binds
RIGID_WARNING = (
    "the machine has no elastic modes, and a real axis resonates. So K_p and the filters stay at most as they are, and "
    "T_n raises the gain by 1 dB at most: a resonance that nobody has measured nearly keeps its margin. Measure the "
    "frequency response of the speed loop and take its modes in (feedsim identify modes) for more"
)
COMPENSATION_ADVICE = (
    "its friction compensation was set for the present drive: tune that anew (feedsim tune compensation)"
)
CHECK = (
    "The values are as good as the machine file. At the machine: type them, measure the frequency response of the "
    "speed loop, then run one circle"
)


def figures_of(tuned: TunedDrive) -> dict[str, Figure]:
    """Errors, margins and torque before and after."""
    axis, first = tuned.axis, tuned.judged[0]
    figures: dict[str, Figure] = {}
    for name, key, unit, scale, words in (
        ("peak", "peak", "um", 1e6, f"largest deviation of the radius from its median where {axis} reverses"),
        ("overshoot", "overshoot", "um", 1e6, f"largest distance of {axis} beyond its target"),
        ("settling_time", "settling", "ms", 1e3, f"longest time of {axis} to +-1 um after the end of a motion"),
    ):
        for when, errors in (("before", first.before), ("after", first.after)):
            value = scale * float(np.max(getattr(errors, key)))
            figures[f"{axis}.{name}_{when}"] = Figure(
                value, unit, f"{words}, {when} tuning; motions not used for tuning"
            )
    for name, words in (("peak", "peak where the axis reverses"), ("overshoot", "overshoot")):
        nominal = reductions(first, name)
        every = np.concatenate([reductions(case, name) for case in tuned.judged])
        figures[f"{axis}.{name}_reduction"] = Figure(
            float(np.median(nominal)), "%", f"median reduction of the {words}, motions not used for tuning"
        )
        figures[f"{axis}.{name}_reduction_least"] = Figure(
            float(every.min()),
            "%",
            f"least reduction of the {words}, motions not used for tuning, modes and friction changed too",
        )
    for when, margins in (("before", tuned.before), ("after", tuned.after)):
        where = "over all loops of the axis, poses and modes"
        figures[f"{axis}.gain_margin_{when}"] = Figure(margins.gain, "dB", f"least gain margin {where}, {when} tuning")
        figures[f"{axis}.phase_margin_{when}"] = Figure(
            margins.phase, "deg", f"least phase margin {where}, {when} tuning"
        )
        figures[f"{axis}.noise_torque_{when}"] = Figure(
            margins.noise * tuned.limits.encoder_noise, "N.m",
            f"standard deviation of the motor torque by the encoder's noise, {when} tuning",
        )  # fmt: skip
    for name, (low, high) in drawn_intervals(tuned).items():
        words = f"of the interval of {axis}.{name}, {share_text(tuned)} of draws of the machine"
        of = figures[f"{axis}.{name}"]
        for key, end, value in (("from", "lower", low), ("to", "upper", high)):
            figures[f"{axis}.{name}_{key}"] = Figure(value, of.unit, f"{end} end {words}")
    return figures


def worse_motions(tuned: TunedDrive, *, effects: bool = False) -> list[str]:
    """Motions that get worse by more than 5 %, in words: of the machine and its modes, or with other effects."""
    names = {effect.words for effect in EFFECTS}
    return [
        f"{motion} ({case.name}): {1e6 * before:.3g} -> {1e6 * after:.3g} um"
        for case in tuned.judged
        if (case.name in names) == effects
        for motion, _, before, after in case.worse
    ]


def findings(tuned: TunedDrive) -> list[Finding]:
    """What is to be known before the values are typed."""
    found: list[Finding] = []
    if bad := worse_motions(tuned):
        text = f"worse than before on motions that were not used for tuning: {'; '.join(bad)}"
        found.append(Finding("tuning-worse", "wrong", text, tuned.axis))
    if bad := worse_motions(tuned, effects=True):
        text = f"worse than before where the machine has other effects: {'; '.join(bad)}"
        found.append(Finding("tuning-worse-with-effects", "doubt", text, tuned.axis))
    found += present_misses(tuned)
    found += drawn_findings(tuned)
    if not tuned.elastic:
        remedy = "feedsim identify modes"
        found.append(Finding("machine-rigid", "doubt" if tuned.changes else "note", RIGID_WARNING, tuned.axis, remedy))
    drive = tuned.machine.shipped_drive(tuned.axis, "a report")
    if tuned.changes and (getattr(drive, "friction_pulse", None) or getattr(drive, "friction_table", None)):
        text = f"{tuned.axis}: {COMPENSATION_ADVICE}"
        found.append(Finding("compensation-stale", "doubt", text, tuned.axis, "feedsim tune compensation"))
    if tuned.changes:
        found.append(Finding("values-to-check", "note", CHECK, tuned.axis))
    return found


def present_misses(tuned: TunedDrive) -> list[Finding]:
    """A finding for each margin that the present drive lacks, with the loop that has it."""
    limits, before, axis = tuned.limits, tuned.before, tuned.axis
    if not math.isfinite(before.phase) and before.phase < 0:
        return [Finding("present-drive-unstable", "doubt", f"{axis}: the present drive is {before.phase_of}.", axis)]
    return [
        Finding(
            "present-margins-thin", "doubt",
            f"{axis}: the {name} margin of the present drive is {shown}; {limit:g} {unit} are required "
            f"({spell_argument(f'{name}_margin')}). {_capital(loop)}.",
            axis,
        )
        for name, value, shown, limit, unit, loop in (
            ("gain", before.gain, decibels(before.gain), limits.gain_margin, "dB", before.gain_of),
            ("phase", before.phase, f"{before.phase:.3g} deg", limits.phase_margin, "deg", before.phase_of),
        )
        if value < limit
    ]  # fmt: skip


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def answers(tuned: TunedDrive) -> list[str]:
    """What the tuned drive does, or why there is none."""
    axis, after, figures = tuned.axis, tuned.after, figures_of(tuned)
    margins = f"{decibels(after.gain)} and {after.phase:.3g} deg"
    if tuned.kept:
        kept = f"{axis}: the drive stays as it is: {tuned.kept}. The present drive has {margins}."
        return [kept, *drawn_answer(tuned)]
    changed = ", with elastic modes 10 % lower and higher" if tuned.elastic else ""
    found = [
        f"{axis}: peaks at reversals fall by {_percent(figures[f'{axis}.peak_reduction'])}, overshoot by "
        f"{_percent(figures[f'{axis}.overshoot_reduction'])} (medians of motions that were not used for tuning). "
        f"Margins: {margins}{changed}."
    ]
    others = [change.axis for change in tuned.changes if change.axis != axis]
    if others:
        found.append(f"{', '.join(dict.fromkeys(others))}: T_dyn is raised, so that the axes stay equally late.")
    return found + drawn_answer(tuned)


def _percent(figure: Figure) -> str:
    return f"{figure.value:.0f} %"


def explain_values(tuned: TunedDrive) -> list[str]:
    """Why these values: what they were chosen from, and what limits them."""
    limits, after = tuned.limits, tuned.after
    allowed = [point for point in tuned.points if point.allowed]
    judged, ran = tuned.evaluations
    met = (
        f"{ran} of them were simulated. {len(allowed)} met all limits and made no error larger by more than "
        f"{100 * (WORSE_ERROR_RATIO - 1):.0f} %."
    )
    found = [f"{judged} candidates were judged by their margins and noise, {met if ran else 'none was simulated.'}"]
    if tuned.kept:
        return found
    touched = []
    if after.gain < (1 + BINDS) * limits.gain_margin:
        touched.append(f"the gain margin ({after.gain_of})")
    if after.phase < (1 + BINDS) * limits.phase_margin:
        touched.append(f"the phase margin ({after.phase_of})")
    drive = tuned.scenario.machine.shipped_drive(tuned.axis, "a report")
    if after.noise * limits.encoder_noise > (1 - BINDS) * NOISE * drive.M_max:
        touched.append("the torque of encoder noise")
    found.append(
        f"What limits the values: {' and '.join(touched)}."
        if touched
        else "No limit is reached: higher gains do not make the errors smaller on every motion."
    )
    if further := _explain_margins(tuned):
        found.append(further)
    found.append(
        f"Least gain margin: {decibels(after.gain)}, {after.gain_of}. Least phase margin: {after.phase:.3g}°, "
        f"{after.phase_of}."
    )
    return found


def _explain_margins(tuned: TunedDrive) -> str:
    """What less margin would give."""
    past = [
        point for point in tuned.points
        if point.margins.gain < tuned.limits.gain_margin or point.margins.phase < tuned.limits.phase_margin
    ]  # fmt: skip
    within = [point.ratio for point in tuned.points if point.allowed]
    if not past or not within:
        return ""
    best = min(past, key=lambda point: point.ratio)
    if best.ratio > 0.97 * min(within):
        return "Candidates with less margin are no better."
    return (
        f"With less margin, {decibels(best.margins.gain)} and {best.margins.phase:.3g}°, the errors would be "
        f"{100 * (1 - best.ratio / min(within)):.0f} % smaller still."
    )


def report_of(tuned: TunedDrive, control: str = "", folder: str = "") -> Report:
    """Content of the report. folder: where it stands, for command lines; "": not known."""
    figures, machine, axis = figures_of(tuned), tuned.scenario.machine, tuned.axis
    tiles = [
        Tile(tile_value(figures[f"{axis}.{name}"]), label, typeset(figures[f"{axis}.{name}"].meaning))
        for name, label in (
            ("peak_reduction", "less peak at reversals"), ("overshoot_reduction", "less overshoot"),
            ("gain_margin_after", "gain margin"), ("phase_margin_after", "phase margin"),
        )
        if math.isfinite(figures[f"{axis}.{name}"].value) and not (tuned.kept and name.endswith("reduction"))
    ]  # fmt: skip
    notes = [note for note in (machine.note, tuned.scenario.note) if note]
    limits = tuned.limits
    shown = {name: each for name, each in figures.items() if not tuned.kept or name.endswith("_before")}
    facts = [
        ("Scenario", f"{tuned.scenario.name} ({tuned.scenario.file.name})"),
        ("Machine", machine.name),
        ("Poses", ", ".join(tuned.poses)),
        ("Limits", f"gain margin {limits.gain_margin:g} dB, phase margin {limits.phase_margin:g}°, torque "
         f"{100 * TORQUE:g} % of its limit, torque of encoder noise {100 * NOISE:g} % of that limit"),
        ("Encoder noise", f"{1e6 * limits.encoder_noise:g} µrad, standard deviation per control cycle"),
        ("Judged in closed form, run", f"{tuned.evaluations[0]}, {tuned.evaluations[1]}"),
    ]  # fmt: skip
    return Report(
        f"Drive of {axis}, tuned within margins" if not tuned.kept else f"Drive of {axis}, kept as it is",
        machine.name,
        answer=answers(tuned),
        warnings=findings(tuned),
        notes=notes,
        tiles=tiles,
        main=[
            *with_remark([picture(tuned)], f"{machine.name}. {machine.note}", *NARROW),
            *values(tuned, control),
            Section("Why these values", [Bullets(list(explain_values(tuned)))]),
            _margins(tuned),
            *drawn_section(tuned, figures),
            *(_errors(case) for case in tuned.judged if not tuned.kept),
            content.figures_section(shown),
        ],
        provenance=content.provenance_section(facts, input_files(tuned.scenario)),
        footer=content.figures_footer(f"Values to load: {SETTINGS}; to type: {SHEET}.", "docs/tuning.md"),
        next_step=Step("Run with the new values", "run", new_values(tuned.scenario)) if tuned.changes else None,
    )


def new_values(scenario: Scenario) -> dict[str, Any]:
    """Arguments of a run of the scenario as it was tuned, with the new values."""
    return {"scenario": scenario.file, "set": [*scenario.overrides, f"{FOLDER}/{SETTINGS}"], "out": f"{FOLDER}_run"}


def values(tuned: TunedDrive, control: str = "") -> Iterator[Part]:
    """The values to type, which are not folded: they are what the report is for."""
    lines: list[tuple[Text, ...]] = []
    for axis, number, name, old, new, unit, confirmed, parameter in rows(tuned, control):
        lines.append((axis, code(parameter), minus(old), minus(new), unit, number, name, confirmed))
    if not lines:
        return
    named = bool(names_for(tuned, control))
    heads = ("Axis", "Parameter", "Old", "New", "Unit", "Number", "Name in the control", "Unit confirmed")
    count = 8 if named else 5
    yield Paragraph("Values to type:")
    yield Table("llrrllll"[:count], heads[:count], [line[:count] for line in lines])


def _margins(tuned: TunedDrive) -> Section:
    lines: list[tuple[Text, ...]] = []
    for name, own in (
        (("before", tuned.before), ("after", tuned.after)) if not tuned.kept else (("present", tuned.before),)
    ):
        torque = f"{own.noise * tuned.limits.encoder_noise:.3g}"
        lines.append((name, minus(decibels(own.gain)), own.gain_of, minus(f"{own.phase:.3g}°"), own.phase_of, torque))
    heads = ("", "Gain margin", "of", "Phase margin", "of", "Torque of noise [N·m]")
    return Section("Margins", [Table("lrtrtr", heads, lines)])


def _errors(case: Case) -> Section:
    lines: list[tuple[Text, ...]] = []
    for k, stop in enumerate(case.program.stops):
        cells = []
        for key, scale in (("overshoot", 1e6), ("miss", 1e6), ("settling", 1e3)):
            for errors in (case.before, case.after):
                value = scale * float(getattr(errors, key)[k])
                cells.append(f"{value:.2f}" if math.isfinite(value) else "never")
        lines.append((stop.text, *cells))
    stops = Table(
        "lrrrrrr",
        ("Move", "Overshoot before [µm]", "after", "Largest error before [µm]", "after", "Settling before [ms]",
         "after"),
        lines,
        "Largest error: distance from the target once the delayed setpoint has arrived.",
    )  # fmt: skip
    circles: list[tuple[Text, ...]] = [
        (each.text, f"{1e6 * float(case.before.peak[k]):.2f}", f"{1e6 * float(case.after.peak[k]):.2f}")
        for k, each in enumerate(case.program.circles)
    ]
    what = "Circle" if case.program.partner else "Sine of the radius and feed of a circle"
    reversals = Table("lrr", (what, "Peak before [µm]", "after"), circles)
    return Section(minus(f"Motions not used for tuning, {case.name}"), [stops, reversals])


def picture(tuned: TunedDrive) -> Picture:
    """Peaks of the candidates over their margin: how much each dB costs."""
    panels = []
    for title, label, unit, of, limit in (
        ("Gain margin", "least gain margin", "dB", _gain, tuned.limits.gain_margin),
        ("Phase margin", "least phase margin", "°", _phase, tuned.limits.phase_margin),
    ):
        points = [point for point in tuned.points if math.isfinite(of(point.margins))]
        curves = [
            Curve(name, *_xy(chosen, of), colour, dots=True, faint=faint)
            for name, chosen, colour, faint in (
                ("within all limits", [p for p in points if p.allowed], ALLOWED_COLOUR, False),
                ("outside of a limit, or worse somewhere", [p for p in points if not p.allowed], RESIDUAL_COLOUR, True),
            )
            if chosen
        ]
        marks = []
        for name, margins, peak, colour in (
            ("before", tuned.before, _largest_error(tuned, "before"), BEFORE_COLOUR),
            ("chosen", tuned.after, _largest_error(tuned, "after"), AFTER_COLOUR),
        ):
            if math.isfinite(of(margins)) and not (tuned.kept and name == "chosen"):
                marks.append(Mark(of(margins), peak, name, colour, hollow=True))
        panels.append(
            Panel(title, Axis(label, unit), Axis("largest peak at a reversal", "µm"), curves,
                  levels=[Level(limit, "limit", upright=True, colour=MUTED)], marks=marks)
        )  # fmt: skip
    return Picture(
        "tune-drive-margins", "Peaks at reversals against margin",
        "Every point is a candidate that ran; margins are the least over loops, poses and modes"
        f"{' and a few draws of the machine' if tuned.drawn is not None else ''}.",
        Chart(panels, (1.0, 1.0)),
    )  # fmt: skip


def _gain(margins: Margins) -> float:
    return margins.gain


def _phase(margins: Margins) -> float:
    return margins.phase


def _xy(points: Sequence[Point], of: Any) -> tuple[Any, Any]:
    order = sorted(points, key=lambda point: of(point.margins))
    return np.array([of(p.margins) for p in order]), np.array([1e6 * p.peak for p in order])


def _largest_error(tuned: TunedDrive, when: str) -> float:
    return 1e6 * float(np.max(getattr(tuned.searched, when).peak))


def details(tuned: TunedDrive, asked: Mapping[str, str]) -> Mapping[str, Any]:
    """What summary.json has besides the figures. asked: name -> text of what was asked for besides changes."""
    limits = tuned.limits
    return {
        "axis": tuned.axis,
        "changes": [
            {"axis": each.axis, "parameter": each.parameter, "old": each.old, "new": each.new, "unit": each.unit}
            for each in tuned.changes
        ],
        "kept": tuned.kept,
        "scenario": {
            "name": tuned.scenario.name, "file": tuned.scenario.file.name, "overrides": list(tuned.scenario.overrides),
        },
        "settings": dict(asked),
        "limits": {
            "gain_margin": limits.gain_margin, "phase_margin": limits.phase_margin,
            "encoder_noise": limits.encoder_noise,
        },
        "why": explain_values(tuned),
        "evaluations": {"closed_form": tuned.evaluations[0], "runs": tuned.evaluations[1]},
        **({"uncertain": {"draws": tuned.drawn.count}} if tuned.drawn is not None else {}),
        "motions": [
            {"case": case.name, "motion": motion, "figure": figure, "before": before, "after": after}
            for case in tuned.judged
            for motion, figure, before, after in case.rows
        ],
        "machine": machine_part(tuned.scenario.machine),
        "inputs": inputs_part(input_files(tuned.scenario)),
    }  # fmt: skip
