"""Bode plots as data: magnitude, phase and coherence over frequency, a column per axis."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from feedsim.linear.margins import Bandwidth, Margins, Pair
from feedsim.report import chart
from feedsim.report.chart import Axis, Chart, Level, Mark, Panel
from feedsim.report.frf.bode import (
    ALIKE,
    COLOURS,
    OTHERS,
    Column,
    Curve,
    Ordinate,
    at,
    hertz,
    phases,
    reference_of,
    span_of,
    visible,
    within,
)
from feedsim.report.style import BLUE, GREEN, INK, MUTED, ORANGE, PURPLE, VERMILLION, Array
from feedsim.trace.response import FrequencyResponse

WORDS = {"$": "", r"\;": " ", r"\,": " ", r"\omega": "ω", "{": "", "}": ""}
TABLES: tuple[tuple[str, chart.Dash], ...] = (
    (BLUE, ""),
    (VERMILLION, "dashed"),
    (GREEN, "dotted"),
    (PURPLE, "dashed"),
    (ORANGE, ""),
)


@dataclass(frozen=True)
class Told:
    """What is marked in a column: lines and points of the magnitude, lines and points of the phase, words."""

    levels: Sequence[Level] = ()
    marks: Sequence[Mark] = ()
    phase_levels: Sequence[Level] = ()
    phase_marks: Sequence[Mark] = ()
    note: str = ""


def bode_chart(
    columns: Sequence[Column],
    ordinate: Ordinate,
    told: Mapping[str, Told],
    *,
    phase: bool = True,
    span: tuple[float, float] | None = None,
    floor: float | None = None,
) -> Chart:
    """As :func:`feedsim.report.frf.bode.bode` draws it. told: what is marked, by the columns' titles."""
    span = span or span_of(columns)
    columns = [within(column, *span) for column in columns]
    frequency = Axis("frequency", "Hz", log=True, span=span)
    heights = [(column, curve, ordinate.of(curve.value)) for column in columns for curve in column.curves]
    low_high = chart.spans([height[curve.sure & (height > -300.0)] for _, curve, height in heights])
    magnitude, coherence = [], []
    turns = []
    for column in columns:
        own = told.get(column.title, Told())
        curves = [each for curve in column.curves for each in _magnitude(curve, column, ordinate)]
        axis = Axis(*_label(ordinate.label), log=not ordinate.decibel, span=_span(low_high, ordinate, floor))
        panel = Panel(column.title, frequency, axis, curves, own.levels, marks=own.marks, linked="f", note=own.note)
        magnitude.append(panel)
        curves = [each for curve in column.curves for each in _phase(curve, column, ordinate, floor)]
        turns.append(Panel("", frequency, Axis("phase", "°"), curves, own.phase_levels, marks=own.phase_marks,
                           linked="f", height=0.75))  # fmt: skip
        curves = [
            _styled(curve, column, curve.frequency, curve.coherence)
            for curve in column.curves
            if curve.coherence is not None
        ]
        axis = Axis("coherence", "", span=(-0.04, 1.08))
        coherence.append(Panel("", frequency, axis, curves, linked="f", height=0.5))
    rows = [magnitude, *([turns] if phase else []), *([coherence] if any(each.curves for each in coherence) else [])]
    return Chart([panel for row in rows for panel in row], (1.0,) * len(columns))


def truncation_chart(
    full: FrequencyResponse, others: Sequence[tuple[str, FrequencyResponse]], columns: Mapping[str, str],
    deviations: Mapping[tuple[str, str], Array], ordinate: Ordinate, cutoff: float, agreed: float,
    deviation_span: tuple[float, float],
) -> Chart:  # fmt: skip
    """Responses of several mode tables and, below, how far they are from the full one [dB]; by column and table."""
    frequency = Axis("frequency", "Hz", log=True, span=(float(full.frequency[0]), float(full.frequency[-1])))
    dropped = Level(cutoff, "cut-off", upright=True, dash="dotted")
    above, below = [], []
    for title, name in columns.items():
        curves = [chart.Curve("full", full.frequency, ordinate.of(full[name]), MUTED, width=2.6, faint=True)]
        off = []
        for (colour, dash), (table, response) in zip(TABLES, others, strict=False):
            curves.append(chart.Curve(table, response.frequency, ordinate.of(response[name]), colour, dash, 1.2))
            off.append(chart.Curve(table, full.frequency, deviations[title, table], colour, dash, 1.2))
        heading = f"{'Direction' if name.startswith('tool') else 'Axis'} {title}"
        axis = Axis(*_label(ordinate.label), log=not ordinate.decibel)
        above.append(Panel(heading, frequency, axis, curves, [dropped], linked="f"))
        axis = Axis("deviation", "dB", log=True, span=deviation_span)
        below.append(
            Panel("", frequency, axis, off, [dropped, Level(agreed, f"{agreed:g} dB")], linked="f", height=0.8)
        )
    return Chart([*above, *below], (1.0,) * len(columns))


def told_of_bandwidth(bandwidth: Bandwidth | None) -> Told:
    """The -3 dB line and where a closed loop crosses it."""
    line = Level(-3.0, "−3 dB")
    if bandwidth is None:
        return Told([line])
    if not math.isfinite(bandwidth.first):
        return Told([line], note="stays above −3 dB")
    first = Mark(bandwidth.first, -3.0, "", INK)
    if bandwidth.last < bandwidth.first * ALIKE:
        return Told([line], [first], note=f"−3 dB at {hertz(bandwidth.first)}")
    marks = [first, Mark(bandwidth.last, -3.0, "", INK, hollow=True)]
    return Told([line], marks, note=f"−3 dB, first {hertz(bandwidth.first)}\n−3 dB, last {hertz(bandwidth.last)}")


def told_of_margins(curve: Curve, margins: Margins) -> Told:
    """Where a loop's gain is 1 and what it lacks to its limit there; where its phase is at the limit."""
    marks, levels, phase_marks, phase_levels, lines = [], [Level(0.0)], [], [], []
    crossing, gain = margins.phase_margin, margins.gain_margin
    if math.isfinite(crossing.frequency):
        turned = float(np.interp(np.log(crossing.frequency), np.log(curve.frequency), phases(curve, None)))
        limit = turned - crossing.margin
        lines.append(f"phase margin {crossing.margin:.0f}° at {hertz(crossing.frequency)}".replace("-", "−"))
        marks.append(Mark(crossing.frequency, 0.0, "", INK))
        phase_marks.append(Mark(crossing.frequency, turned, "", INK))
        ends = (min(turned, limit), max(turned, limit))
        phase_levels += [Level(crossing.frequency, upright=True, colour=INK, dash="", ends=ends), Level(limit)]
    if math.isfinite(gain.frequency) and curve.frequency[0] <= gain.frequency <= curve.frequency[-1]:
        decibel = 20 * math.log10(gain.factor)
        lines.append(f"gain margin {decibel:.1f} dB at {hertz(gain.frequency)}")
        marks.append(Mark(gain.frequency, -decibel, "", INK))
        ends = (min(-decibel, 0.0), max(-decibel, 0.0))
        levels.append(Level(gain.frequency, upright=True, colour=INK, dash="", ends=ends))
    return Told(levels, marks, phase_levels, phase_marks, "\n".join(lines))


def told_of_pairs(curve: Curve, pairs: Sequence[Pair]) -> Told:
    """The most marked resonances (full) and their anti-resonances (hollow), in Hz."""
    marks = []
    for pair in pairs:
        peak, dip = pair.resonance.frequency, pair.antiresonance.frequency
        marks.append(Mark(dip, 20 * math.log10(abs(at(curve, dip))), "", INK, hollow=True))
        marks.append(Mark(peak, 20 * math.log10(abs(at(curve, peak))), f"{dip:.1f} / {peak:.1f}", INK))
    return Told([Level(0.0)], marks)


def _magnitude(curve: Curve, column: Column, ordinate: Ordinate) -> list[chart.Curve]:
    return _split(curve, column, ordinate.of(curve.value))


def _phase(curve: Curve, column: Column, ordinate: Ordinate, floor: float | None) -> list[chart.Curve]:
    turned = visible(phases(curve, reference_of(column.curves, curve)), ordinate.of(curve.value), floor)
    return _split(curve, column, turned)


def _split(curve: Curve, column: Column, y: Array) -> list[chart.Curve]:
    """A curve, and paler what of it is not sure."""
    sure = curve.sure
    if sure.all():
        return [_styled(curve, column, curve.frequency, y)]
    parts = ((sure, False), (~sure, True))
    return [_styled(curve, column, curve.frequency[rows], y[rows], faint) for rows, faint in parts if rows.any()]


def _styled(curve: Curve, column: Column, x: Array, y: Array, faint: bool = False) -> chart.Curve:
    overlaid = [each for each in column.curves if each.kind == "overlaid"]
    if curve.kind == "measured":
        name = f"{curve.label}, low coherence" if faint else curve.label
        return chart.Curve(name, x, y, COLOURS["measured"], width=1.6, dots=True, faint=faint)
    colour = OTHERS[overlaid.index(curve) % len(OTHERS)] if curve in overlaid else COLOURS["closed form"]
    return chart.Curve(curve.label, x, y, colour, "dashed" if curve in overlaid else "", 1.4, faint=faint)


def _label(text: str) -> tuple[str, str]:
    """Quantity and unit of an ordinate's label, without the signs of formulas."""
    for sign, word in WORDS.items():
        text = text.replace(sign, word)
    label, _, unit = text.removesuffix("]").rpartition(" [")
    return (label, unit) if label else (unit, "")


def _span(found: tuple[float, float] | None, ordinate: Ordinate, floor: float | None) -> tuple[float, float] | None:
    if found is None:
        return None
    low, high = found
    if not ordinate.decibel:
        return low / 1.3, high * 1.3
    low = max(low, floor) if floor is not None else low
    room = max(0.07 * (high - low), 1.0)
    return low - room, high + room
