"""The report of a tuned friction compensation: error over radius and feed, characteristic, values to type."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from feedsim.analysis import Figure
from feedsim.analysis.figures import Array
from feedsim.design.tune.circles import Pair
from feedsim.design.tune.compensators import GROUP_OF_KIND, NEVER_WORSE, Errors, JudgedCompensation, amplitude
from feedsim.design.uncertainty import interval, share_of
from feedsim.files import sheets
from feedsim.files.control import Name, names_of
from feedsim.foundation.errors import Finding
from feedsim.foundation.units import convert, parameters
from feedsim.report import content
from feedsim.report.chart import Axis, Chart, Curve, Dash, Panel
from feedsim.report.content import (
    Paragraph,
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
from feedsim.report.formatting import AFTER_COLOUR, BEFORE_COLOUR, NARROW, minus, typeset
from feedsim.report.provenance import input_files, inputs_part, machine_part
from feedsim.report.tune.drive import new_values
from feedsim.report.uncertainty import drawn_values

DASHES: tuple[Dash, ...] = ("", "dashed", "dotted")  # of axes in one panel
SETTINGS, SHEET = "settings.yaml", "sheet.csv"
FILES = (SETTINGS, SHEET)  # besides report.html and summary.json
CONTROL_OF_KIND = {"pulse": "sinumerik", "pulse_characteristic": "sinumerik", "table": "twincat"}
WORDS = {
    "pulse": "a constant pulse on the speed setpoint",
    "pulse_characteristic": "a pulse on the speed setpoint with a characteristic over the acceleration",
    "table": "a torque over the commanded speed",
    "model": "the friction model as torque feedforward",
}
OBJECTIVES = {
    "ratio": "the mean of the ratios of errors with and without, large ratios counting more",
    "worst": "the largest ratio of errors with and without",
    "largest": "the largest error, in um: slow circles then count little",
}
LIMITS_UNKNOWN = (
    "Of the real control the instant of the pulse, its exact shape and the order within a cycle are not public; here "
    "the pulse begins where the axis reverses. Try the values with one circle, and vary the amplitude first"
)


def figures_of(judged: JudgedCompensation) -> dict[str, Figure]:
    """How much errors at the reversals fall, on the circles that were not used for tuning."""
    whole = "reduction of the error at the reversals"
    own = "reduction of the part of the error at the reversals that friction makes"
    others = "of all axes and of the circles that were not used for tuning"
    figures = {}
    cases = {"held_out": ("", judged.held_errors)}
    cases |= {effect.name: (f", with {effect.words}", errors) for effect, errors in judged.changed.items()}
    for name, (case, errors) in cases.items():
        for prefix, words, values in (
            ("", whole, judged.reduction(errors)), ("friction_", own, judged.own_reduction(errors)),
        ):  # fmt: skip
            for key, word, value in (("median", "median", np.median(values)), ("worst", "least", values.min())):
                meaning = f"{word} {words}, {others}{case}"
                figures[f"{name}.{prefix}{key}"] = Figure(100 * float(value), "%", meaning)
    for name, (low, high) in drawn_intervals(judged).items():
        for end, value in (("from", low), ("to", high)):
            figures[f"held_out.{name}_{end}"] = Figure(
                value, "%", f"{'lower' if end == 'from' else 'upper'} end of the interval of held_out.{name}, "
                f"{100 * share_of(len(judged.drawn)):.0f} % of draws of the machine",  # type: ignore[arg-type]
            )  # fmt: skip
    for axis, k in zip(judged.axes, judged.columns, strict=True):
        for name, values in (("before", judged.held_errors.before), ("after", judged.held_errors.after)):
            figures[f"{axis}.largest_{name}"] = Figure(
                1e6 * float(values[:, k].max()), "um", f"largest error where {axis} reverses, {name} tuning: peak or "
                "dip of the radius against the median of the turn",
            )  # fmt: skip
    return figures


def drawn_intervals(judged: JudgedCompensation) -> dict[str, tuple[float, float]]:
    """Intervals [%] of the median and of the least reduction over draws of the machine; empty without."""
    if judged.drawn is None:
        return {}
    entry = [100 * judged.reduction(errors) for errors in judged.drawn]
    result = {"median": np.array([np.median(one) for one in entry]), "worst": np.array([one.min() for one in entry])}
    return {name: tuple(map(float, interval(values))) for name, values in result.items()}  # type: ignore[misc]


def findings(judged: JudgedCompensation) -> list[Finding]:
    """What is to be known before the values are typed."""
    worse = ", ".join(
        f"{axis} on {pair.text}: {1e6 * before:.3g} -> {1e6 * after:.3g} um"
        for axis, pair, before, after in judged.worse
    )
    text = f"worse with compensation than without: {worse}"
    result = [Finding("compensation-worse", "wrong", text)] if worse else []
    figures = figures_of(judged)
    for effect, errors in judged.changed.items():
        if (judged.reduction(errors) < 1 - NEVER_WORSE).any():
            most = -figures[f"{effect.name}.worst"].value
            text = f"with {effect.words} a circle gets worse than without compensation, by {most:.0f} %"
            result.append(Finding("compensation-worse-with-effects", "doubt", text))
    if judged.drawn is not None:
        worst = 100 * np.array([judged.reduction(errors).min() for errors in judged.drawn])
        bad = int((worst < 100 * (1 - NEVER_WORSE)).sum())
        if bad:
            text = f"in {bad} of {len(worst)} draws of the machine a circle gets worse than without compensation"
            result.append(Finding("compensation-worse-in-draws", "doubt", text))
    if others := judged.beyond_friction:
        axis, pair, free, before = others[0]
        more = f" (and {len(others) - 1} more)" if len(others) > 1 else ""
        result.append(Finding(
            "error-not-of-friction", "doubt",
            f"{axis} on {pair.text}{more}: {1e6 * free:.3g} of {1e6 * before:.3g} um at the reversals are there "
            "without friction, too: the drives make them, and no friction compensation takes them off",
            axis,
        ))  # fmt: skip
    if judged.found.kind == "model":
        text = "the compensation has the friction of the machine itself; a real one is never known so well"
        result.append(Finding("friction-known-exactly", "note", text))
    else:
        result.append(Finding("control-details-unknown", "note", LIMITS_UNKNOWN))
    return result


def answers(judged: JudgedCompensation) -> list[str]:
    """What the compensation does to circles that it was not found on."""
    figures = figures_of(judged)
    where = f"{judged.plane[0]}-{judged.plane[1]}"
    median, worst, of_friction, worst_of_it = (
        _percent(figures[f"held_out.{name}"]) for name in ("median", "worst", "friction_median", "friction_worst")
    )
    return [
        f"{where}: reversal errors fall by {median} (median of {len(judged.held_out)} test circles; worst {worst}) "
        f"with {WORDS[judged.found.kind]} of {', '.join(judged.axes)}. The part that friction makes "
        f"falls by {of_friction} (worst {worst_of_it}).",
        *_drawn_answer(judged),
    ]


def _percent(figure: Figure) -> str:
    return f"{figure.value:.2g} %" if math.isfinite(figure.value) else "an unknown share"


def _drawn_answer(judged: JudgedCompensation) -> list[str]:
    """What the intervals of identified values make of it."""
    result = drawn_intervals(judged)
    if not result or judged.drawn is None:
        return []
    median, worst = ("{:.0f} to {:.0f} %".format(*result[name]) for name in ("median", "worst"))
    share = f"{100 * share_of(len(judged.drawn)):.0f} %, {len(judged.drawn)} draws"
    return [f"With what identification leaves open: median {median}, least {worst} ({share})."]


def rows(judged: JudgedCompensation) -> Iterator[tuple[str, str, Name | None, Any, Any]]:
    """Axis, parameter, its name in a control, old and new value in SI."""
    if judged.found.kind not in GROUP_OF_KIND:
        return
    group, names = GROUP_OF_KIND[judged.found.kind], names_of(CONTROL_OF_KIND[judged.found.kind])
    table = parameters("controller")
    for axis, values in judged.found.values.items():
        present = getattr(judged.scenario.machine.axes[axis].drive, group, None)
        for name, value in values.items():
            row = table[f"{group}.{name}"]
            old = getattr(present, name) if present is not None else row.start
            yield axis, f"{group}.{name}", names.get(f"drive.{group}.{name}"), old, value


def settings(judged: JudgedCompensation) -> str:
    """The `set` group of a scenario with the values."""
    lines = ["# Values of feedsim tune compensation, for the group `set` of a scenario.", "set:"]
    table = parameters("controller")
    for axis, parameter, _, _, value in rows(judged):
        unit = table[parameter].unit
        text = str(value).lower() if isinstance(value, bool) else str(value) if isinstance(value, int) else (
            f"{value!r} {unit}".removesuffix(" 1")
        )  # fmt: skip
        lines.append(f"  machine.axes.{axis}.drive.{parameter}: {text}")
    return "\n".join(lines) + "\n"


def sheet(judged: JudgedCompensation) -> str:
    """Values to type: old and new, in the control's unit where its name is known."""
    sheet_rows = [["axis", "number", "name", "old", "new", "unit", "unit confirmed", "parameter"]]
    for axis, parameter, name, old, value in rows(judged):
        if name is not None:
            known = "yes" if name.confirmed else "no"
            cells = [name.number, name.name, *(f"{name.shown(float(x)):.6g}" for x in (old, value)), name.unit, known]
        else:
            unit, display = _units(parameter)
            cells = ["", "", *(_value_text(x, unit, display) for x in (old, value)), display, ""]
        sheet_rows.append([axis, *cells, parameter])
    return sheets.text_of(sheet_rows)


def _units(parameter: str) -> tuple[str, str]:
    row = parameters("controller")[parameter]
    return row.unit, row.display_unit


def _value_text(value: Any, unit: str, display: str) -> str:
    if isinstance(value, bool) or not unit:
        return str(int(value))
    return f"{convert(float(value), unit, display):.6g}"


def report_of(judged: JudgedCompensation) -> Report:
    """Content of the report."""
    figures, machine = figures_of(judged), judged.scenario.machine
    tiles = [
        Tile(tile_value(figures[name]), label, typeset(figures[name].meaning))
        for name, label in (
            ("held_out.median", "median reduction"),
            ("held_out.worst", "least reduction"),
            ("held_out.friction_median", "median reduction, friction's part"),
            ("held_out.friction_worst", "least reduction, friction's part"),
        )
    ]
    notes = [note for note in (machine.note, judged.scenario.note) if note]
    rows_ = [
        ("Scenario", f"{judged.scenario.name} ({judged.scenario.file.name})"),
        ("Machine", machine.name),
        ("Minimised", OBJECTIVES[judged.objective]),
        ("Runs to find it", str(judged.found.runs)),
    ]
    pictures = with_remark(pictures_of(judged), f"{machine.name}. {machine.note}", *NARROW)
    return Report(
        f"Friction compensation of {', '.join(judged.axes)}",
        f"{machine.name} · {WORDS[judged.found.kind]}",
        answer=answers(judged),
        warnings=findings(judged),
        notes=notes,
        tiles=tiles,
        main=[
            _values(judged),
            *pictures,
            _effects(judged, figures),
            _errors(
                "Circles not used for tuning", judged.held_out, judged.held_errors, judged, judged.held_frictionless
            ),
            _errors("Circles tuned on", judged.tuned, judged.tuned_errors, judged),
            content.figures_section(figures),
        ],
        provenance=content.provenance_section(rows_, input_files(judged.scenario)),
        footer=content.figures_footer(f"Values to load: {SETTINGS}; to type: {SHEET}.", "docs/tuning.md"),
        next_step=Step("Run with these values", "run", new_values(judged.scenario)) if judged.found.values else None,
    )


def _values(judged: JudgedCompensation) -> Section | None:
    lines: list[tuple[Text, ...]] = [
        tuple(code(cell) if i == 7 else minus(cell) for i, cell in enumerate(line.split(",")))
        for line in sheet(judged).splitlines()[1:]
    ]
    if not lines:
        return None
    heads = ("Axis", "Number", "Name in the control", "Old", "New", "Unit", "Unit confirmed", "Parameter")
    table = Table("lllrrlll", heads, lines)
    return Section("Values to type", [table, Paragraph(LIMITS_UNKNOWN + ".", "muted")], unfolded=True)


def _effects(judged: JudgedCompensation, figures: Mapping[str, Figure]) -> Section:
    """What the same values do where the machine is another one."""
    lines: list[tuple[Text, ...]] = [("as the machine file has it", *_four_figures(figures, "held_out"))]
    lines += [(effect.words, *_four_figures(figures, effect.name)) for effect in judged.changed]
    for name, (low, high) in drawn_intervals(judged).items():
        if name == "median":
            worst = drawn_intervals(judged)["worst"]
            lines.append(
                ("draws of identified values", *(minus(f"{a:.0f} to {b:.0f}") for a, b in ((low, high), worst)), "", "")
            )
    note = (
        "The same values on a changed machine. The sizes are usual ones, not measured ones. What friction makes is the "
        "difference from the same machine without friction, at the same instant."
    )
    heads = (
        "Machine",
        "Median reduction [%]",
        "Least [%]",
        "Median, friction's part [%]",
        "Least, friction's part [%]",
    )
    drawn = [] if judged.cloud is None else [drawn_values(judged.cloud)]
    return Section("With other effects of the machine", [Table("lrrrr", heads, lines, note), *drawn], "effects")


def _four_figures(figures: Mapping[str, Figure], name: str) -> tuple[str, ...]:
    keys = ("median", "worst", "friction_median", "friction_worst")
    return tuple(minus(f"{figures[f'{name}.{key}'].value:.0f}") for key in keys)


def _errors(
    title: str, pairs: Sequence[Pair], errors: Errors, judged: JudgedCompensation, free: Array | None = None
) -> Section:  # fmt: skip
    """free: errors without friction, where they are known."""
    lines: list[tuple[Text, ...]] = []
    before, after = errors.before, errors.after
    for i, pair in enumerate(pairs):
        cells = [f"{pair.radius * 1e3:.4g}", f"{pair.feed * 60:.4g}", f"{pair.acceleration:.3g}"]
        for k in judged.columns:
            cells += [
                f"{1e6 * before[i, k]:.2f}", f"{1e6 * after[i, k]:.2f}",
                minus(f"{100 * (1 - after[i, k] / before[i, k]):.0f}"),
            ]  # fmt: skip
            cells += [f"{1e6 * free[i, k]:.2f}"] if free is not None else []
        lines.append(tuple(cells))
    heads = ["Radius [mm]", "Feed [m/min]", "v²/r [m/s²]"]
    for axis in judged.axes:
        heads += [f"{axis} without [µm]", f"{axis} with [µm]", f"{axis} less by [%]"]
        heads += [f"{axis} without friction [µm]"] if free is not None else []
    return Section(title, [Table("r" * len(heads), heads, lines)])


def pictures_of(judged: JudgedCompensation) -> list[Picture]:
    """Errors over the acceleration without and with, and the characteristic as the control's manual draws it."""
    accelerations = np.array([pair.acceleration for pair in judged.held_out])
    across = Axis("acceleration at the reversal, v²/r", "m/s²", log=True)
    panels = [
        Panel(
            f"{axis}",
            across,
            Axis("error at the reversals", "µm"),
            [
                Curve(name, accelerations, 1e6 * errors[:, k], colour, dots=True)
                for name, errors, colour in (
                    ("without", judged.held_errors.before, BEFORE_COLOUR),
                    ("with", judged.held_errors.after, AFTER_COLOUR),
                )
            ],
        )
        for axis, k in zip(judged.axes, judged.columns, strict=True)
    ]
    pictures = [
        Picture(
            "tune-errors", "Errors at the reversals, circles not used for tuning",
            "The larger of peak and dip of the radius, against the median of the turn.",
            Chart(panels, (1.0,) * len(panels)),
        )
    ]  # fmt: skip
    if judged.found.kind == "pulse_characteristic":
        a = np.geomspace(accelerations.min() / 2, accelerations.max() * 1.5, 200)
        curves = [
            Curve(axis, a, 6e4 * amplitude(values, a), AFTER_COLOUR, dash)
            for (axis, values), dash in zip(judged.found.values.items(), DASHES, strict=False)
        ]
        panel = Panel("Amplitude of the pulse", across, Axis("amplitude", "mm/min"), curves)
        pictures.append(
            Picture("tune-characteristic", "Characteristic over the acceleration",
                    "As the manual of the control draws it.", Chart([panel]))
        )  # fmt: skip
    return pictures


def details(judged: JudgedCompensation) -> Mapping[str, Any]:
    """What summary.json has besides the figures."""
    return {
        "kind_of_compensation": judged.found.kind,
        "objective": judged.objective,
        "values": {axis: dict(values) for axis, values in judged.found.values.items()},
        "runs": judged.found.runs,
        **({"uncertain": {"draws": len(judged.drawn)}} if judged.drawn is not None else {}),
        "circles": {
            name: [
                {"radius": pair.radius, "feed": pair.feed, "before": list(before), "after": list(after)}
                for pair, before, after in zip(pairs, errors.before.tolist(), errors.after.tolist(), strict=True)
            ]
            for name, pairs, errors in (
                ("tuned", judged.tuned, judged.tuned_errors),
                ("held_out", judged.held_out, judged.held_errors),
            )
        },
        "axes": list(judged.plane),
        "machine": machine_part(judged.scenario.machine),
        "inputs": inputs_part(input_files(judged.scenario)),
    }
