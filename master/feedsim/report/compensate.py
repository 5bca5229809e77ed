"""The report on a friction compensation: its page, summary.json and compensation.csv."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from feedsim.analysis import Contour, Figure, Turn, contour
from feedsim.analysis.circularity import quadrant
from feedsim.analysis.compensation import Compensation, Quality, Variation
from feedsim.files import sheets
from feedsim.report.chart import Axis, Chart, Curve, Level, Panel, spans
from feedsim.report.content import (
    Picture,
    Report,
    Section,
    Step,
    Table,
    Text,
    Tile,
    code,
    figures_footer,
    figures_section,
    files_table,
    with_remark,
)
from feedsim.report.formatting import (
    AFTER_COLOUR,
    ALTERNATIVE_COLOUR,
    BEFORE_COLOUR,
    FRICTION_COLOUR,
    Array,
    display_unit,
    minus,
    powers,
    typeset,
)
from feedsim.report.provenance import InputFile, Parameter, axis_parameters, hash_files, inputs_part, quantity
from feedsim.report.run.axis_plots import TIME, circle, circle_chart, reversed_note, torque_axis, turn_curve
from feedsim.report.run.files import details as details_of_run
from feedsim.report.run.report import motions_section, provenance
from feedsim.report.uncertainty import BANDS

if TYPE_CHECKING:
    from feedsim.design.uncertainty import Uncertainty

# --- The pictures of a report on friction compensation ----------------------------------------------------------------


TIME_AROUND_REVERSAL = 0.03  # s to either side of a reversal


def pictures_of(compensation: Compensation) -> list[Picture]:
    """Contour, reversals, torques and, where there is a table, what errors cost."""
    turn = compensation.turn
    before, after = (contour(run.trace, turn) for run in (compensation.before, compensation.after))
    plane = f"{turn.axes[0]}-{turn.axes[1]}"
    pictures: list[Picture | None] = [
        _contour_picture(turn, before, after, plane),
        _reversals_picture(before, after, plane),
        _torque_picture(compensation),
    ]
    pictures += [_errors_picture(compensation)] if compensation.table else []
    return [picture for picture in pictures if picture is not None]


def _contour_picture(turn: Turn, before: Contour, after: Contour, plane: str) -> Picture:
    on = circle(turn, float(np.abs(before.deviation).max()))
    title = f"Circular test in the plane {plane}, without and with friction compensation"
    caption = (
        f"Radius {turn.radius * 1e3:.6g} mm, turn from {turn.begin:.4f} to {turn.end:.4f} s, by the linear scales. "
        f"Radius deviation magnified {on.magnification:,.0f} times; rings "
        f"at ±{on.ring:g} µm about the programmed circle."
    )
    curves = [
        turn_curve(name, colour, value.angle, value.deviation) for name, colour, value in _label_contours(before, after)
    ]
    return Picture("compensation-contour", title, caption, circle_chart(on, curves, sense=turn.sense))


def _label_contours(before: Contour, after: Contour) -> list[tuple[str, str, Contour]]:
    return [("without", BEFORE_COLOUR, before), ("with compensation", AFTER_COLOUR, after)]


def _reversals_picture(before: Contour, after: Contour, plane: str) -> Picture:
    title = f"Circular test in the plane {plane}: the contour around the reversals"
    caption = (
        "Radius deviation by the linear scales within ±45° of every crossing. Below: the compensated contour "
        "alone, on a scale of its own."
    )
    panels = []
    across = Axis("angle from the crossing", "°", span=(-45.0, 45.0))
    for both in (_label_contours(before, after), _label_contours(before, after)[1:]):
        row = [
            [Curve(name, *_quadrant_curve(value, glitch.crossing), colour) for name, colour, value in both]
            for glitch in before.glitches
        ]
        low, high = spans([curve.y for curves in row for curve in curves]) or (0.0, 1.0)
        more = 0.07 * (high - low) or 1.0
        up = Axis("radius deviation", "µm", span=(low - more, high + more))
        for glitch, curves in zip(before.glitches, row, strict=True):
            heads = f"{minus(glitch.name)}: {f'{glitch.axis} reverses' if len(both) > 1 else 'compensated alone'}"
            panels.append(Panel(heads, across, up, curves, [Level(0.0, dash="")]))
    return Picture("compensation-reversals", title, caption, Chart(panels, (1.0,) * 4))


def _quadrant_curve(measured: Contour, crossing: float) -> tuple[Array, Array]:
    """Angle [deg] and deviation [um] within a quadrant about a crossing."""
    near = quadrant(measured.angle, crossing)
    angle = np.rad2deg((measured.angle[near] - crossing + math.pi) % (2 * math.pi) - math.pi)
    order = np.argsort(angle)
    return angle[order], measured.deviation[near][order] * 1e6


def _torque_picture(compensation: Compensation) -> Picture | None:
    turn, feedforward = compensation.turn, compensation.feedforward
    axes_of = [axis for axis in turn.axes if f"{axis}.M_ff" in feedforward.columns]
    signs = {axis: compensation.scenario.machine.axes[axis].display_sign for axis in axes_of}
    torque = feedforward.between(turn.begin, turn.end)
    if not axes_of:
        return None
    real = compensation.after.trace.between(turn.begin, turn.end)
    title = "Torque feedforward of the friction compensation"
    caption = (
        "Feedforward as it is added to the torque setpoint, and the friction torque of the compensated run. The "
        "feedforward is ahead by the lag of the torque behind its setpoint." + reversed_note(axes_of, signs)
    )
    panels = []
    for axis in axes_of:
        curves = [
            Curve("feedforward M_ff", torque.time, signs[axis] * torque[f"{axis}.M_ff"], ALTERNATIVE_COLOUR),
            Curve("friction M_fr", real.time, signs[axis] * real[f"{axis}.M_fr"], FRICTION_COLOUR, "dashed"),
        ]
        reversal = _reversal(real.time, real[f"{axis}.n_a"])
        near = Axis("time", "s", span=(reversal - TIME_AROUND_REVERSAL, reversal + TIME_AROUND_REVERSAL))
        ordinate = torque_axis(signs[axis])
        zero = [Level(0.0, dash="")]
        panels += [
            Panel(f"Axis {axis}: torque over the turn", TIME, ordinate, curves, zero, linked="t"),
            Panel("Around a reversal", near, ordinate, curves, zero),
        ]
    return Picture("compensation-torque", title, caption, Chart(panels, (1.5, 1.0)))


def _reversal(time: Array, n: Array) -> float:
    """First instant at which the speed changes its sign within the inner nine tenths of the time, else the middle."""
    begin, end = time[0] + 0.05 * np.ptp(time), time[-1] - 0.05 * np.ptp(time)
    at = time[1:][(np.sign(n[1:]) != np.sign(n[:-1])) & (time[1:] > begin) & (time[1:] < end)]
    return float(at[0]) if at.size else float(time[len(time) // 2])


def _errors_picture(compensation: Compensation) -> Picture:
    by_delay = [variation for variation in compensation.table if variation.what == "delay"]
    others = [variation for variation in compensation.table if variation.what != "delay"]
    names = list(dict.fromkeys(other.what for other in others))

    title = "What errors of the compensation cost"
    caption = (
        "Circular deviation G of the compensated circle when the delay or a parameter of all axes is wrong. "
        "Dotted: without the error. Without compensation G is "
        f"{compensation.figures['before.G'].value:.3g} µm."
    )
    error, G = _by_change(by_delay, compensation.figures["after.G"].value)
    without = Level(compensation.figures["after.G"].value, upright=True, dash="dotted")
    rows = {name: float(i) for i, name in enumerate(reversed(names))}
    curves = []
    for offset, low, colour in ((0.19, True, ALTERNATIVE_COLOUR), (-0.19, False, AFTER_COLOUR)):
        chosen = [other for other in others if (other.change < 0) == low]
        x = np.array([value for variation in chosen for value in (0.0, variation.quality.G * 1e6, math.nan)])
        y = np.array([value for variation in chosen for value in (*(2 * [rows[variation.what] + offset]), math.nan)])
        share = next((variation.change for variation in chosen), 0.0)
        curves.append(Curve(minus(f"{share:+.3g} %"), x, y, colour, width=8.0))
    axis = Axis("", names=list(rows), span=(-0.6, len(rows) - 0.4))
    points = [
        Curve("", np.array(error), np.array(G), AFTER_COLOUR, width=width, dots=width > 2) for width in (1.4, 2.4)
    ]
    G_axis = Axis("circular deviation G", "µm")
    panels = [Panel("Delay", Axis("error of the delay", "ms"), G_axis, points)]
    if others:
        panels.append(Panel("Parameters", G_axis, axis, curves, [without]))
    return Picture("compensation-errors", title, caption, Chart(panels, (1.0,) * len(panels)))


def _by_change(variations: Sequence[Variation], without_error: float) -> tuple[list[float], list[float]]:
    points = sorted(
        [(0.0, without_error), *((variation.change, variation.quality.G * 1e6) for variation in variations)]
    )
    return [change for change, _ in points], [G for _, G in points]


RESULT, UNCOMPENSATED, FEEDFORWARD, TABLE = "result.csv", "uncompensated.csv", "feedforward.csv", "compensation.csv"
FILES = (RESULT, UNCOMPENSATED, FEEDFORWARD, TABLE, BANDS)  # besides report.html and summary.json

Row = tuple[str, float, str, Quality]


def report_of(compensation: Compensation, files: Mapping[str, Path]) -> Report:
    """Content of the report. files: axis -> file of its compensation's friction."""
    scenario = compensation.scenario
    pictures = with_remark(pictures_of(compensation), f"{scenario.machine.name}. {scenario.machine.note}")
    return Report(
        f"Friction compensation: {scenario.name}",
        f"{scenario.machine.name} · torque feedforward on {', '.join(compensation.frictions)}",
        answer=answers(compensation),
        warnings=compensation.warnings,
        notes=(scenario.machine.note, scenario.note),
        tiles=list(_tiles(compensation)),
        next_step=Step("Find values of a compensation that controls have", "tune compensation", {"friction": None}),
        main=[
            *pictures,
            _errors(compensation) if compensation.table else None,
            _effects(compensation) if compensation.changed else None,
            _frictions(compensation, files),
            figures_section(compensation.figures),
            motions_section(compensation.after),
        ],
        provenance=provenance(compensation.after),
        footer=figures_footer(
            "Values in full precision: summary.json; time series: result.csv, uncompensated.csv, feedforward.csv.",
            "docs/figures.md, docs/tuning.md",
        ),
    )


def answers(compensation: Compensation) -> list[str]:
    """What the compensation takes away, and what its errors would leave of that."""
    figures = compensation.figures
    named = [("G", "the circular deviation G")]
    named += [(f"glitch_{axis}", f"the quadrant glitch of {axis}") for axis in compensation.turn.axes]
    reported = [
        f"{what} from {_um(figures[f'before.{key}'])} to {_um(figures[f'after.{key}'])} um" for key, what in named
    ]
    lines = [f"Friction compensation takes {', '.join(reported[:-1])} and {reported[-1]}."]
    if compensation.table:
        worst = max(compensation.table, key=lambda variation: variation.quality.G)
        lines.append(
            f"It is as good as its model: {worst.what} wrong by {worst.change:+.3g} {worst.unit} leaves G at "
            f"{1e6 * worst.quality.G:.2f} um."
        )
    if compensation.changed:
        most = max(compensation.changed, key=lambda changed: changed.after.G)
        lines.append(
            f"With {most.words} it takes G from {1e6 * most.before.G:.2f} to {1e6 * most.after.G:.2f} um, the largest "
            "of the effects that were tried."
        )
    return lines


def _tiles(compensation: Compensation) -> Iterable[Tile]:
    figures = compensation.figures
    named = [("G", "circular deviation G")]
    named += [(f"glitch_{axis}", f"quadrant glitch, {axis} reverses") for axis in compensation.turn.axes]
    for key, label in named:
        before, after = figures[f"before.{key}"], figures[f"after.{key}"]
        yield Tile(f"{_um(before)} → {_um(after)} µm", label, typeset(f"without and {after.meaning}"))
    for axis in compensation.frictions:
        delay = figures[f"{axis}.delay"]
        yield Tile(minus(f"{delay.value:.3g} ms"), f"{axis}: delay of the feedforward", typeset(delay.meaning))


def _um(figure: Figure) -> str:
    """To 0.01 um; what is smaller to its first digit."""
    small = 0 < abs(figure.value) < 0.01
    return minus(powers(f"{figure.value:.1g}" if small else f"{figure.value:.2f}"))


def _errors(compensation: Compensation) -> Section:
    """Peaks, dips and G for every error."""
    rows = []
    for what, change, unit, quality in rows_of(compensation):
        numbers = [*quality.peak.values(), *quality.dip.values(), quality.G]
        amount = minus(f"{change:+.3g} {unit}") if unit else ""
        rows.append((what, amount, *(minus(f"{1e6 * number:.3f}") for number in numbers)))
    entry = [f"{kind}, {axis} reverses [µm]" for kind in ("glitch", "dip") for axis in compensation.turn.axes]
    note = (
        "An error of the delay or of a parameter, of all axes at once. Glitch and dip: largest and smallest radius "
        "deviation within ±45° of the reversals of an axis, less the median of the turn. Too little compensation "
        "leaves glitches, too much leaves dips."
    )
    table = Table("lrr" + "r" * len(entry), ("Compensation", "Error", *entry, "G [µm]"), rows, note)
    return Section("What errors cost", [table], "errors")


def _effects(compensation: Compensation) -> Section:
    """G and peaks on changed machines, without and with the same compensation."""
    rows: list[tuple[Text, ...]] = []
    nominal = ("as the machine file has it", compensation.left_before, compensation.left_after)
    for words, before, after in (
        nominal,
        *((entry.words, entry.before, entry.after) for entry in compensation.changed),
    ):
        cells = [1e6 * quality.G for quality in (before, after)]
        cells += [
            1e6 * max(quality.peak[axis], -quality.dip[axis])
            for axis in compensation.turn.axes for quality in (before, after)
        ]  # fmt: skip
        rows.append((words, *(minus(f"{cell:.2f}") for cell in cells)))
    item = ["G without [µm]", "with"]
    for axis in compensation.turn.axes:
        item += [f"peak or dip, {axis} reverses, without [µm]", "with"]
    note = "The same compensation on a changed machine. The sizes are usual ones, not measured ones."
    table = Table("l" + "r" * len(item), ("Machine", *item), rows, note)
    return Section("With other effects of the machine", [table], "effects")


def _cell(value: Parameter) -> str:
    return value if isinstance(value, str) else minus(f"{value:.6g}")


def _frictions(compensation: Compensation, files: Mapping[str, Path]) -> Section:
    """Parameters of the compensation beside the machine's own."""
    machine = compensation.scenario.machine
    sets = []
    for axis, friction in compensation.frictions.items():
        own = machine.axes[axis]
        sets += [axis_parameters(axis)["friction"] for axis in (own.model_copy(update={"friction": friction}), own)]
    rows: list[tuple[Text, ...]] = []
    for name in dict.fromkeys(name for entry in sets for name in entry):
        result = [entry.get(name) for entry in sets]
        unit = next(value[1] for value in result if value is not None)
        rows.append((code(name), display_unit(unit), *(_cell(v[0]) if v else "–" for v in result)))
    whose = [f"{axis}, {whose}" for axis in compensation.frictions for whose in ("compensation", "machine")]
    table = Table("ll" + "r" * len(whose), ("Parameter", "SI unit", *whose), rows)
    given = files_table(friction_files(files)) if files else None
    return Section("Friction of the compensation and of the machine", [table, given])


def rows_of(compensation: Compensation) -> list[Row]:
    """What is compensated with, its error with unit, and what is left: first nothing, then the set as it is."""
    return [
        ("none", 0.0, "", compensation.left_before),
        ("as computed", 0.0, "", compensation.left_after),
        *((variation.what, variation.change, variation.unit, variation.quality) for variation in compensation.table),
    ]


def table_csv(compensation: Compensation) -> str:
    """The table as CSV."""
    axes = compensation.turn.axes
    columns = [f"{kind}_{axis} [um]" for kind in ("peak", "dip") for axis in axes]
    rows: list[Sequence[str]] = [["compensation", "error", "unit of the error", *columns, "G [um]"]]
    for what, change, unit, quality in rows_of(compensation):
        numbers = [*quality.peak.values(), *quality.dip.values(), quality.G]
        rows.append([what, f"{change:.6g}", unit, *(f"{1e6 * number:.6g}" for number in numbers)])
    return sheets.text_of(rows)


def friction_files(files: Mapping[str, Path]) -> list[InputFile]:
    """Files of the frictions that the compensation uses, with their hashes."""
    return hash_files([(f"friction of the compensation of {axis}", path) for axis, path in files.items()])


def details(
    compensation: Compensation, files: Mapping[str, Path], uncertainty: Uncertainty | None = None
) -> dict[str, Any]:
    """What summary.json has besides the figures: that of the compensated run, and the compensation."""
    content = details_of_run(compensation.after, compensation.figures, {}, (), uncertainty)
    machine = compensation.scenario.machine
    content["inputs"] += inputs_part(friction_files(files))
    content["compensation"] = {
        "turn": {
            "plane": list(compensation.turn.axes),
            "begin": quantity(compensation.turn.begin, "s"),
            "end": quantity(compensation.turn.end, "s"),
        },
        "axes": {
            axis: {
                "delay": quantity(compensation.delays[axis], "s"),
                "delay_from": "the drive's parameters" if axis in compensation.lags else "given",
                "friction_from": files[axis].name if axis in files else "the machine",
                "friction": {
                    name: quantity(value, unit)
                    for name, (value, unit) in axis_parameters(
                        machine.axes[axis].model_copy(update={"friction": friction})
                    )["friction"].items()
                },
            }
            for axis, friction in compensation.frictions.items()
        },
        "effects": [
            {
                "with": entry.words,
                "G_before": quantity(1e6 * entry.before.G, "um"),
                "G_after": quantity(1e6 * entry.after.G, "um"),
            }
            for entry in compensation.changed
        ],
        "errors": [
            {
                "of": what,
                "change": quantity(change, unit),
                "G": quantity(1e6 * quality.G, "um"),
                **{
                    f"{kind}_{axis}": quantity(1e6 * value, "um")
                    for kind, values in (("peak", quality.peak), ("dip", quality.dip))
                    for axis, value in values.items()
                },
            }
            for what, change, unit, quality in rows_of(compensation)[2:]
        ],
    }
    return content


def summary_line(compensation: Compensation) -> str:
    """G and glitches before and after, in one line."""
    keys = ["G", *(f"glitch_{axis}" for axis in compensation.turn.axes)]
    figures = compensation.figures
    pairs = ((key, figures[f"before.{key}"], figures[f"after.{key}"]) for key in keys)
    return ", ".join(f"{key} {before.value:.3g} -> {after.value:.3g} {after.unit}" for key, before, after in pairs)
