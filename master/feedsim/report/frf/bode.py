"""Bode plots: magnitude, phase and coherence over frequency, a column of panels per axis.

Closed forms are lines, measured responses are points (paler where their coherence is low), curves laid over are dashed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from feedsim.analysis import Figure
from feedsim.analysis.responses import Responses
from feedsim.linear.judgement import GAIN_MARGIN, PHASE_MARGIN
from feedsim.linear.margins import Bandwidth, Margins, Pair
from feedsim.report import chart
from feedsim.report.chart import Axis, Chart, Level, Mark, Panel
from feedsim.report.formatting import ALTERNATIVE_COLOUR, GREEN, INK, PURPLE, RECORDED_COLOUR, SIMULATED_COLOUR, Array

Complexes = NDArray[np.complex128]
Kind = Literal["closed form", "measured", "overlaid"]

HIGH_COHERENCE = 0.99
COLOURS = {"closed form": SIMULATED_COLOUR, "measured": ALTERNATIVE_COLOUR}
OVERLAY_COLOURS = (RECORDED_COLOUR, GREEN, PURPLE)  # of several overlaid curves
LOWEST_DB = -400.0  # what is exactly zero
CROSSING_RATIO = 1.01  # crossings closer than this ratio are one
EDGE = 1e-9  # of a frequency: quotients of times carry rounding


@dataclass(frozen=True, eq=False)
class Curve:
    """A response as it is drawn.

    Attributes:
        kind: closed form, measured or overlaid; decides the style.
        label: for the legend.
        frequency: (N,) [Hz], ascending.
        value: (N,) complex.
        coherence: (N,) from 0 to 1, or None where it is not known.
    """

    kind: Kind
    label: str
    frequency: Array
    value: Complexes
    coherence: Array | None = None

    @property
    def sure(self) -> NDArray[np.bool_]:
        """(N,) where the coherence is high, or not known."""
        if self.coherence is None:
            return np.ones(len(self.frequency), dtype=bool)
        return np.asarray(self.coherence > HIGH_COHERENCE)

    def scaled(self, factor: float | Array) -> Curve:
        """The same curve, multiplied."""
        return Curve(self.kind, self.label, self.frequency, self.value * factor, self.coherence)


@dataclass(frozen=True)
class Ordinate:
    """How a magnitude is shown: in dB, or on a logarithmic axis in a unit of its own."""

    label: str
    unit: str = "dB"
    decibel: bool = True
    scale: float = 1.0  # display unit per SI unit

    def of(self, value: Complexes | Array) -> Array:
        """Magnitude in display units, or dB of it."""
        size: Array = np.asarray(np.abs(value) * self.scale, dtype=np.float64)
        if not self.decibel:
            return size
        with np.errstate(divide="ignore"):
            return np.asarray(np.maximum(20 * np.log10(size), LOWEST_DB))


@dataclass(frozen=True)
class Column:
    """The panels of one column: title and curves; the first closed form is what phases of the others follow."""

    title: str
    curves: Sequence[Curve]


@dataclass(frozen=True)
class Marks:
    """What is marked in a column: lines and points of the magnitude, lines and points of the phase, words."""

    levels: Sequence[Level] = ()
    marks: Sequence[Mark] = ()
    phase_levels: Sequence[Level] = ()
    phase_marks: Sequence[Mark] = ()
    note: str = ""


def bode_chart(
    columns: Sequence[Column],
    ordinate: Ordinate,
    reported: Mapping[str, Marks],
    *,
    phase: bool = True,
    span: tuple[float, float] | None = None,
    floor: float | None = None,
) -> Chart:
    """Magnitude and, unless it is left out, phase of all columns, and the coherence of what was measured.

    shown: what is marked, by the columns' titles. span: frequencies shown [Hz]; those of the curves by default. floor:
    lowest magnitude shown, in display units.
    """
    span = span or span_of(columns)
    columns = [limit_column(column, *span) for column in columns]
    frequency = Axis("frequency", "Hz", log=True, span=span)
    heights = [(column, curve, ordinate.of(curve.value)) for column in columns for curve in column.curves]
    low_high = chart.spans([height[curve.sure & (height > -300.0)] for _, curve, height in heights])
    magnitude, coherence = [], []
    turns = []
    for column in columns:
        own = reported.get(column.title, Marks())
        curves = [entry for curve in column.curves for entry in _magnitude(curve, column, ordinate)]
        axis = Axis(ordinate.label, ordinate.unit, log=not ordinate.decibel, span=_span(low_high, ordinate, floor))
        panel = Panel(column.title, frequency, axis, curves, own.levels, marks=own.marks, linked="f", note=own.note)
        magnitude.append(panel)
        curves = [entry for curve in column.curves for entry in _phase(curve, column, ordinate, floor)]
        turns.append(Panel("", frequency, Axis("phase", "°"), curves, own.phase_levels, marks=own.phase_marks,
                           linked="f", height=0.75))  # fmt: skip
        curves = [
            _style_curve(curve, column, curve.frequency, curve.coherence)
            for curve in column.curves
            if curve.coherence is not None
        ]
        axis = Axis("coherence", "", span=(-0.04, 1.08))
        coherence.append(Panel("", frequency, axis, curves, linked="f", height=0.5))
    rows = [magnitude, *([turns] if phase else []), *([coherence] if any(panel.curves for panel in coherence) else [])]
    return Chart([panel for row in rows for panel in row], (1.0,) * len(columns))


def bandwidth_marks(bandwidth: Bandwidth | None) -> Marks:
    """The -3 dB line and where a closed loop crosses it."""
    line = Level(-3.0, "−3 dB")
    if bandwidth is None:
        return Marks([line])
    if not math.isfinite(bandwidth.first):
        return Marks([line], note="stays above −3 dB")
    first = Mark(bandwidth.first, -3.0, "", INK)
    if bandwidth.last < bandwidth.first * CROSSING_RATIO:
        return Marks([line], [first], note=f"−3 dB at {hertz(bandwidth.first)}")
    marks = [first, Mark(bandwidth.last, -3.0, "", INK, hollow=True)]
    return Marks([line], marks, note=f"−3 dB, first {hertz(bandwidth.first)}\n−3 dB, last {hertz(bandwidth.last)}")


def margin_marks(curve: Curve, margins: Margins) -> Marks:
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
    return Marks(levels, marks, phase_levels, phase_marks, "\n".join(lines))


def pair_marks(curve: Curve, pairs: Sequence[Pair]) -> Marks:
    """The most marked resonances (full) and their anti-resonances (hollow), in Hz."""
    marks = []
    for pair in pairs:
        peak, dip = pair.resonance.frequency, pair.antiresonance.frequency
        marks.append(Mark(dip, 20 * math.log10(abs(curve_value(curve, dip))), "", INK, hollow=True))
        marks.append(Mark(peak, 20 * math.log10(abs(curve_value(curve, peak))), f"{dip:.1f} / {peak:.1f}", INK))
    return Marks([Level(0.0)], marks)


def curve_value(curve: Curve, frequency: float) -> complex:
    """Value of a curve at a frequency: magnitude interpolated in its logarithm, phase continuously."""
    x = math.log(frequency)
    grid = np.log(curve.frequency)
    with np.errstate(divide="ignore"):
        size = math.exp(float(np.interp(x, grid, np.log(np.abs(curve.value)))))
    angle = float(np.interp(x, grid, np.unwrap(np.angle(curve.value))))
    return size * complex(math.cos(angle), math.sin(angle))


def phases(curve: Curve, reference: Curve | None) -> Array:
    """(N,) phase [deg], continuous; that of points on the branch nearest to the reference's phase."""
    raw = np.degrees(np.angle(curve.value))
    if reference is None or reference is curve:
        return _from_principal(np.degrees(np.unwrap(np.angle(curve.value))))
    smooth = phases(reference, None)
    expected = np.interp(np.log(curve.frequency), np.log(reference.frequency), smooth)
    return np.asarray(raw + 360 * np.round((expected - raw) / 360))


def _from_principal(phase: Array) -> Array:
    """Shifted by whole turns so that it starts between -180 (excluded) and 180 degrees."""
    finite = phase[np.isfinite(phase)]
    turns = math.ceil((finite[0] - 180) / 360 - 1e-9) if len(finite) else 0
    return phase - 360 * turns


def reference_of(curves: Sequence[Curve], curve: Curve) -> Curve | None:
    """The closed form that the phase of another curve follows."""
    closed = next((curve for curve in curves if curve.kind == "closed form"), None)
    if closed is None or curve.kind == "closed form":
        return None
    return closed


def visible(phase: Array, magnitude: Array, floor: float | None) -> Array:
    """Phases, up to where the magnitude falls below what is shown for good: from there on they say nothing."""
    if floor is None or not (above := np.flatnonzero(magnitude >= floor)).size:
        return phase
    return np.where(np.arange(len(phase)) <= above[-1], phase, np.nan)


def limit_column(column: Column, low: float, high: float) -> Column:
    """The parts of the curves between two frequencies; curves that have none are left out."""
    curves = []
    for curve in column.curves:
        rows = (curve.frequency >= low * (1 - EDGE)) & (curve.frequency <= high * (1 + EDGE))
        coherence = None if curve.coherence is None else curve.coherence[rows]
        if rows.any():
            curves.append(Curve(curve.kind, curve.label, curve.frequency[rows], curve.value[rows], coherence))
    return Column(column.title, curves)


def span_of(columns: Sequence[Column]) -> tuple[float, float]:
    """Lowest and highest frequency of all curves."""
    ends = [(curve.frequency[0], curve.frequency[-1]) for column in columns for curve in column.curves]
    return float(min(low for low, _ in ends)), float(max(high for _, high in ends))


def hertz(frequency: float) -> str:
    """A frequency in three digits."""
    return f"{frequency:.3g} Hz" if frequency < 100 else f"{frequency:.0f} Hz"


def _magnitude(curve: Curve, column: Column, ordinate: Ordinate) -> list[chart.Curve]:
    return _split(curve, column, ordinate.of(curve.value))


def _phase(curve: Curve, column: Column, ordinate: Ordinate, floor: float | None) -> list[chart.Curve]:
    turned = visible(phases(curve, reference_of(column.curves, curve)), ordinate.of(curve.value), floor)
    return _split(curve, column, turned)


def _split(curve: Curve, column: Column, y: Array) -> list[chart.Curve]:
    """A curve, and paler what of it is not sure."""
    sure = curve.sure
    if sure.all():
        return [_style_curve(curve, column, curve.frequency, y)]
    parts = ((sure, False), (~sure, True))
    return [_style_curve(curve, column, curve.frequency[rows], y[rows], faint) for rows, faint in parts if rows.any()]


def _style_curve(curve: Curve, column: Column, x: Array, y: Array, faint: bool = False) -> chart.Curve:
    overlaid = [curve for curve in column.curves if curve.kind == "overlaid"]
    if curve.kind == "measured":
        name = f"{curve.label}, low coherence" if faint else curve.label
        return chart.Curve(name, x, y, COLOURS["measured"], width=2.2, dots=True, faint=faint)
    colour = (
        OVERLAY_COLOURS[overlaid.index(curve) % len(OVERLAY_COLOURS)] if curve in overlaid else COLOURS["closed form"]
    )
    return chart.Curve(curve.label, x, y, colour, "dashed" if curve in overlaid else "", 1.4, faint=faint)


def _span(result: tuple[float, float] | None, ordinate: Ordinate, floor: float | None) -> tuple[float, float] | None:
    if result is None:
        return None
    low, high = result
    if not ordinate.decibel:
        return low / 1.3, high * 1.3
    low = max(low, floor) if floor is not None else low
    room = max(0.07 * (high - low), 1.0)
    return low - room, high + room


# --- What frequency responses come to, in a few lines: stable or not, margins, bandwidths, trust, what to do next -----


# Below these a difference of two responses means nothing to anybody.
LEAST_DB, LEAST_DEG = 0.001, 0.01
MARGIN_WORDS = f"the usual {20 * math.log10(GAIN_MARGIN):.0f} dB and {PHASE_MARGIN:g} deg"


def answers(responses: Responses) -> list[str]:
    """The verdict, of stable loops a line per axis with bandwidths and margins, and what that is worth."""
    axes = () if responses.result.unstable_poles else responses.axes
    by_axis = [f"{axis}: {_of_axis(responses.figures, axis)}" for axis in axes]
    return [verdict(responses), *by_axis, _trust(responses)]


def verdict(responses: Responses) -> str:
    """Whether the loops are stable, their least margins and where these are, what that means, and what to do next."""
    if responses.result.unstable_poles:
        return (
            f"The control loops are UNSTABLE ({responses.result.unstable_poles} growing solution(s) of the closed "
            "system): bandwidths and margins below say nothing. Change the gain that the warnings name."
        )
    loops = dict(_loops(responses))
    if not loops:
        return "No control loop is closed: the curves are those of the structure alone."
    gains = [
        (max(gain_crossing.factor, 1 / gain_crossing.factor), gain_crossing.frequency, loop)
        for loop, margins in loops.items()
        for gain_crossing in (margins.gain_margin, margins.gain_reduction)
        if 0 < gain_crossing.factor < math.inf
    ]
    phases = [
        (abs(margins.phase_margin.margin), margins.phase_margin.frequency, loop)
        for loop, margins in loops.items()
        if margins.phase
    ]
    results, thin = [], False
    if gains:
        factor, frequency, loop = min(gains)
        results.append(f"least gain margin {20 * math.log10(factor):.1f} dB ({loop}, {frequency:.3g} Hz)")
        thin |= factor < GAIN_MARGIN
    if phases:
        phase, frequency, loop = min(phases)
        results.append(f"least phase margin {phase:.0f} deg ({loop}, {frequency:.3g} Hz)")
        thin |= phase < PHASE_MARGIN
    meaning = (
        f"Less than {MARGIN_WORDS}: motions ring there. Lower that loop's gain, or damp what resonates there."
        if thin
        else f"All loops meet {MARGIN_WORDS.removeprefix('the usual ')}. No gain needs to be reduced."
    )
    return f"The control loops are stable; {', '.join(results) or 'nothing limits their gains'}. {meaning}"


def _loops(responses: Responses) -> Iterator[tuple[str, Margins]]:
    for axis in responses.axes:
        of_axis = responses.result.axes[axis]
        for kind, loop in (("speed", of_axis.speed), ("position", of_axis.position)):
            if loop is not None:
                yield f"{kind} loop of {axis}", loop.margins


def _trust(responses: Responses) -> str:
    known = "Closed form of the sampled loops without friction and limits (a warning says which loop is worse at rest)"
    if responses.campaign is not None:
        return f"{known}; how near the units come to it, measured, is said under Measured against closed form."
    if responses.result.unstable_poles:
        return f"{known}; nothing was measured."
    return f"{known}; not measured: without --no-measure the units are excited, and the two compared."


def _of_axis(figures: Mapping[str, Figure], axis: str) -> str:
    def number(name: str, digits: int = 3) -> str:
        figure = figures.get(f"{axis}.{name}")
        return f"{figure.value:.{digits}g}" if figure is not None and math.isfinite(figure.value) else "-"

    def within(name: str, least: float) -> str:
        figure = figures.get(f"{axis}.{name}")
        known = figure is not None and math.isfinite(figure.value)
        return f"{max(figure.value, least):.2g}" if known and figure is not None else "-"

    def gain(loop: str) -> str:
        figure = figures.get(f"{axis}.{loop}.gain_margin")
        known = figure is not None and math.isfinite(figure.value)
        return f"{20 * math.log10(figure.value):.1f} dB" if known and figure is not None else "-"

    parts = []
    if f"{axis}.speed.bandwidth_first" in figures:
        parts.append(
            f"speed loop -3 dB first {number('speed.bandwidth_first')} Hz, last {number('speed.bandwidth_last')} Hz, "
            f"margins {number('speed.phase_margin', 2)} deg, {gain('speed')}"
        )
    if f"{axis}.position.bandwidth_first" in figures:
        parts.append(
            f"position loop -3 dB {number('position.bandwidth_first')} Hz, "
            f"margins {number('position.phase_margin', 2)} deg, {gain('position')}"
        )
    if f"{axis}.n_M.measured_magnitude" in figures:
        parts.append(
            f"measured n/M within {within('n_M.measured_magnitude', LEAST_DB)} dB, "
            f"{within('n_M.measured_phase', LEAST_DEG)} deg"
        )
    return "; ".join(parts) or "no loop closed"
