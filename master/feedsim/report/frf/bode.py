"""Bode plots: magnitude, phase and coherence over frequency, a column of panels per axis.

Closed forms are lines, measured responses are points (faded where their coherence is low), curves laid over are dashed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from feedsim.report.labels import heading, keep_inside, legend_above, plain_box
from feedsim.report.style import BLUE, GREEN, INK, MUTED, ORANGE, PURPLE, VERMILLION, Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

Complexes = NDArray[np.complex128]
Kind = Literal["closed form", "measured", "overlaid"]

HIGH_COHERENCE = 0.99
COLOURS = {"closed form": BLUE, "measured": VERMILLION, "overlaid": GREEN}
OTHERS = (GREEN, PURPLE, ORANGE)  # of several overlaid curves
LOWEST_DB = -400.0  # what is exactly zero
ALIKE = 1.01  # crossings closer than this ratio are one
EDGE = 1e-9  # of a frequency: quotients of times carry rounding
# Ticks of the phase [deg]: the finest that leaves this many.
PHASE_STEPS, MOST_PHASE_TICKS = (15, 30, 45, 90, 180, 360, 720, 1440), 9
MAGNITUDE_STEPS, MOST_MAGNITUDE_TICKS = (1, 2, 5, 10, 20, 40, 50, 100), 8
COLUMN_WIDTHS = {1: 9.0, 2: 5.2, 3: 4.0}  # inches per column
HEIGHTS = {"magnitude": 2.9, "phase": 2.0, "coherence": 1.05}  # inches


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
class Panels:
    """The axes of a column; coherence is None where nothing was measured."""

    magnitude: Axes
    phase: Axes | None
    coherence: Axes | None


def size(columns: Sequence[Column], *, phase: bool = True) -> tuple[float, float]:
    """Width and height of a drawing for these columns [inches]."""
    rows = ["magnitude", *(["phase"] if phase else []), *(["coherence"] if _any_coherence(columns) else [])]
    count = len(columns)
    return max(count * COLUMN_WIDTHS.get(count, COLUMN_WIDTHS[3]), 9.0), 1.0 + sum(HEIGHTS[row] for row in rows)


def bode(
    figure: Drawing,
    columns: Sequence[Column],
    ordinate: Ordinate,
    *,
    phase: bool = True,
    span: tuple[float, float] | None = None,
    floor: float | None = None,
) -> list[Panels]:
    """Draw the curves of all columns; returns their panels, for marks.

    phase: whether the phase is shown. span: frequencies shown [Hz]; those of the curves by default. floor: lowest
    magnitude shown, in display units.
    """
    with_coherence = _any_coherence(columns)
    rows = ["magnitude", *(["phase"] if phase else []), *(["coherence"] if with_coherence else [])]
    rooms = figure.subplots(
        len(rows), len(columns), sharex="col", sharey="row", squeeze=False, height_ratios=[HEIGHTS[row] for row in rows]
    )
    span = span or span_of(columns)
    columns = [within(column, *span) for column in columns]
    result = []
    for j, column in enumerate(columns):
        own = dict(zip(rows, rooms[:, j], strict=True))
        panels = Panels(own["magnitude"], own.get("phase"), own.get("coherence"))
        heading(panels.magnitude, column.title)
        for curve, style in _styled(column.curves):
            _draw(panels, curve, style, ordinate, reference_of(column.curves, curve), floor)
        own[rows[-1]].set_xlabel("frequency [Hz]")
        panels.magnitude.set_xscale("log")
        panels.magnitude.set_xlim(*span)
        if len(column.curves) > 1:
            legend_above(panels.magnitude)
        result.append(panels)
    _finish_rows(result, columns, ordinate, floor)
    return result


def note(axes: Axes, text: str, *, corner: Literal["lower left", "upper right"] = "lower left") -> None:
    """A few lines in a corner of the panel."""
    x, y, ha, va = (0.02, 0.04, "left", "bottom") if corner == "lower left" else (0.98, 0.96, "right", "top")
    box = plain_box() | {"alpha": 0.85}
    look: dict[str, Any] = {"fontsize": 8.5, "color": INK, "linespacing": 1.35, "bbox": box, "zorder": 8}
    keep_inside(axes.text(x, y, text, transform=axes.transAxes, ha=ha, va=va, **look))


def level(axes: Axes, value: float, text: str = "") -> None:
    """Dashed horizontal line, labelled at its right end."""
    axes.axhline(value, color=MUTED, linewidth=0.9, linestyle=(0, (4, 2)))
    if text:
        label = axes.annotate(
            text, (1, value), xycoords=("axes fraction", "data"), xytext=(-3, 3), textcoords="offset points",
            color=MUTED, fontsize=8.5, ha="right", va="bottom",
        )  # fmt: skip
        keep_inside(label)


def dot(axes: Axes, x: float, y: float, *, hollow: bool = False, colour: str = INK) -> None:
    """A marker on a curve."""
    face = {"markerfacecolor": "none", "markeredgewidth": 1.4} if hollow else {}
    axes.plot([x], [y], "o", color=colour, markersize=5.5, zorder=7, **face)  # type: ignore[arg-type]


def stretch(axes: Axes, x: float, low: float, high: float) -> None:
    """Vertical line between two heights: a margin."""
    axes.plot([x, x], [low, high], color=INK, linewidth=1.3, zorder=6)


def at(curve: Curve, frequency: float) -> complex:
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
    closed = next((each for each in curves if each.kind == "closed form"), None)
    if closed is None or curve.kind == "closed form":
        return None
    return closed


def _styled(curves: Sequence[Curve]) -> list[tuple[Curve, dict[str, Any]]]:
    others = iter(OTHERS * len(curves))
    styled = []
    for curve in curves:
        if curve.kind == "measured":
            style: dict[str, Any] = {
                "color": COLOURS["measured"], "linestyle": "none", "marker": ".", "markersize": 5.5,
                "markeredgewidth": 0, "zorder": 2,
            }  # fmt: skip
        elif curve.kind == "overlaid":
            style = {"color": next(others), "linestyle": (0, (4, 1.6)), "linewidth": 1.5, "zorder": 4}
        else:
            style = {"color": COLOURS["closed form"], "linewidth": 1.2, "zorder": 3}
        styled.append((curve, style))
    return styled


def _draw(
    panels: Panels,
    curve: Curve,
    style: dict[str, Any],
    ordinate: Ordinate,
    reference: Curve | None,
    floor: float | None,
) -> None:
    f, magnitude = curve.frequency, ordinate.of(curve.value)
    phase = visible(phases(curve, reference), magnitude, floor)
    for which, look in ((curve.sure, style), (~curve.sure, style | {"alpha": 0.35})):
        if not which.any():
            continue
        label = curve.label if look is style else "_faded"
        panels.magnitude.plot(f[which], magnitude[which], label=label, **look)
        if panels.phase is not None:
            panels.phase.plot(f[which], phase[which], **look)
    if panels.coherence is not None and curve.coherence is not None:
        panels.coherence.plot(f, curve.coherence, **style | {"markersize": 3.0})


def visible(phase: Array, magnitude: Array, floor: float | None) -> Array:
    """Phases, up to where the magnitude falls below what is shown for good: from there on they say nothing."""
    if floor is None or not (above := np.flatnonzero(magnitude >= floor)).size:
        return phase
    return np.where(np.arange(len(phase)) <= above[-1], phase, np.nan)


def _finish_rows(panels: Sequence[Panels], columns: Sequence[Column], ordinate: Ordinate, floor: float | None) -> None:
    curves = [curve for column in columns for curve in column.curves]
    heights = np.concatenate([ordinate.of(curve.value)[curve.sure] for curve in curves] or [np.zeros(0)])
    heights = heights[np.isfinite(heights) & ((heights > 0) | ordinate.decibel)]
    first = panels[0]
    if len(heights):
        low, high = float(heights.min()), float(heights.max())
        low = max(low, floor) if floor is not None else low
        _magnitude_axis(first.magnitude, low, high, ordinate.decibel)
    first.magnitude.set_ylabel(ordinate.label)
    turns = [
        visible(phases(curve, reference_of(column.curves, curve)), ordinate.of(curve.value), floor)[curve.sure]
        for column in columns
        for curve in column.curves
    ]
    if first.phase is not None:
        first.phase.set_ylabel("phase [°]")
        _phase_axis(first.phase, np.concatenate(turns or [np.zeros(0)]))
    if first.coherence is not None:
        first.coherence.set_ylabel("coherence [1]")
        first.coherence.set_ylim(-0.04, 1.08)
        first.coherence.set_yticks([0.0, 0.5, 1.0])
    for each in panels:
        frequency_axis(each.magnitude)


def _magnitude_axis(axes: Axes, low: float, high: float, decibel: bool) -> None:
    if not decibel:
        from matplotlib.ticker import FuncFormatter

        axes.set_yscale("log")
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.set_ylim(
            10 ** (math.floor(4 * math.log10(low)) / 4) / 1.1, 10 ** (math.ceil(4 * math.log10(high)) / 4) * 1.1
        )
        return
    room = max(0.06 * (high - low), 1.0)
    axes.set_ylim(low - room, high + room)
    _ticks(axes, MAGNITUDE_STEPS, MOST_MAGNITUDE_TICKS)


def _phase_axis(axes: Axes, values: Array) -> None:
    values = values[np.isfinite(values)]
    if len(values):
        low, high = float(values.min()), float(values.max())
        room = max(0.06 * (high - low), 8.0)
        axes.set_ylim(low - room, high + room)
    _ticks(axes, PHASE_STEPS, MOST_PHASE_TICKS)


def _ticks(axes: Axes, steps: Sequence[int], most: int) -> None:
    from matplotlib.ticker import MultipleLocator

    low, high = axes.get_ylim()
    axes.yaxis.set_major_locator(MultipleLocator(next((s for s in steps if (high - low) / s <= most), steps[-1])))


def frequency_axis(axes: Axes) -> None:
    """Plain numbers at the decades, finer lines between them."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.xaxis.set_major_locator(LogLocator(numticks=20))
    axes.xaxis.set_minor_locator(LogLocator(subs=tuple(range(2, 10)), numticks=20))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    for each in axes.figure.axes:
        each.grid(visible=True, axis="x", which="minor", linewidth=0.35)


def within(column: Column, low: float, high: float) -> Column:
    """The parts of the curves between two frequencies; curves that have none are left out."""
    curves = []
    for curve in column.curves:
        rows = (curve.frequency >= low * (1 - EDGE)) & (curve.frequency <= high * (1 + EDGE))
        coherence = None if curve.coherence is None else curve.coherence[rows]
        if rows.any():
            curves.append(Curve(curve.kind, curve.label, curve.frequency[rows], curve.value[rows], coherence))
    return Column(column.title, curves)


def _any_coherence(columns: Sequence[Column]) -> bool:
    return any(curve.coherence is not None for column in columns for curve in column.curves)


def span_of(columns: Sequence[Column]) -> tuple[float, float]:
    """Lowest and highest frequency of all curves."""
    ends = [(curve.frequency[0], curve.frequency[-1]) for column in columns for curve in column.curves]
    return float(min(low for low, _ in ends)), float(max(high for _, high in ends))


def hertz(frequency: float) -> str:
    """A frequency in three digits."""
    return f"{frequency:.3g} Hz" if frequency < 100 else f"{frequency:.0f} Hz"
