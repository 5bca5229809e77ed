"""What a panel shows at first: the ranges of its axes, and the ticks along them."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from feedsim.report.chart.model import Axis, Curve, Panel, spans
from feedsim.report.formatting import minus, powers
from feedsim.report.style import Array

Range = tuple[float, float]
ROOM = 0.07  # of their range, above and below the curves
MIN_TICKS = 3  # ticks
PHASES = (15, 30, 45, 90, 180, 360, 720, 1440)


def ranges(panel: Panel) -> tuple[Range, Range]:
    """Abscissae and ordinates that are shown: as the axes say, else those of curves and marks, with room about them."""
    curves = [each for each in panel.curves if len(each.x)]
    across = _reach(panel.x, spans([_shown(panel.x, each.x) for each in curves]), 0.0)
    heights = [*(_seen(each, panel.x, across) for each in curves), np.array([mark.y for mark in panel.marks])]
    return across, _reach(panel.y, spans([_shown(panel.y, each) for each in heights]), ROOM)


def bent(within: float, values: Array | float) -> Array:
    """Values on an axis that is logarithmic in both directions, linear within a distance from zero."""
    return np.asarray(np.sign(values) * np.log10(1 + np.abs(values) / within))


def unbent(within: float, values: Array | float) -> Array:
    """The way back."""
    return np.asarray(np.sign(values) * within * (10 ** np.abs(values) - 1))


def _shown(axis: Axis, values: Array) -> Array:
    return np.where(values > 0, values, np.nan) if axis.log else values


def _seen(curve: Curve, axis: Axis, span: Range) -> Array:
    if axis.span is None:
        return np.append(curve.y, 0.0) if curve.filled else curve.y
    return curve.y[(curve.x >= span[0]) & (curve.x <= span[1])]


def _reach(axis: Axis, found: Range | None, room: float) -> Range:
    if axis.span is not None:
        return axis.span
    low, high = found or ((0.1, 10.0) if axis.log else (0.0, 1.0))
    if axis.log:
        return (low, high) if not room and high > low else (low / 1.3, high * 1.3)
    if axis.symlog:
        return low * (1 + 3 * room), high * (1 + 3 * room)
    more = room * (high - low) or (0.0 if high > low else 0.05 * abs(high) or 0.5)
    return low - more, high + more


def ticks(axis: Axis, span: Range, most: float) -> Iterator[tuple[float, str]]:
    """Where an axis is marked, and with what: some `most` round values, angles in parts of a turn."""
    low, high = span
    most = max(2.0, most)
    if axis.names:
        every = math.ceil(len(axis.names) / most)
        yield from ((float(k), name) for k, name in enumerate(axis.names) if k % every == 0 and low <= k <= high)
        return
    if axis.symlog:
        first, last = math.floor(math.log10(axis.symlog) + 1e-9), math.floor(math.log10(max(-low, high, axis.symlog)))
        powers_of_ten = [10.0**k for k in range(first, last + 1) if 10.0**k >= 2 * axis.symlog]
        for at in (*(-each for each in reversed(powers_of_ten)), 0.0, *powers_of_ten):
            if low <= at <= high:
                yield at, minus(powers(f"{at:g}"))
        return
    if axis.log and high / low > 8:
        decades = math.log10(high / low)
        every = max(1, round(decades / most))
        for k in range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1):
            for part in (1, 2, 5) if decades < 2.2 else (1,) if k % every == 0 else ():
                if low * 0.9999 <= part * 10.0**k <= high * 1.0001:
                    yield part * 10.0**k, powers(f"{part * 10.0**k:g}")
        return
    rough = (high - low) / most
    if axis.unit == "°" and high - low > 60:
        step = float(next((each for each in PHASES if each >= rough), PHASES[-1]))
    else:
        decade = 10.0 ** math.floor(math.log10(rough)) if rough > 0 else 1.0
        step = decade * next((each for each in (1, 2, 5, 10) if each * decade >= 0.999 * rough), 10)
    while (fewer := _marked(span, step)) < MIN_TICKS:  # one or two ticks are no scale
        finer = _finer(axis, step)
        if not finer or (fewer > 1 and _marked(span, finer) > most + 2):
            break
        step = finer
    for k in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1):
        yield k * step, minus(powers(f"{k * step:.{_digits(k * step, step)}g}"))


def _digits(at: float, step: float) -> int:
    """As many as separate a tick from the next one."""
    return max(6, math.floor(math.log10(abs(at) or step)) - math.floor(math.log10(step) + 1e-9) + 1)


def _marked(span: Range, step: float) -> int:
    return math.floor(span[1] / step + 1e-9) - math.ceil(span[0] / step - 1e-9) + 1


def _finer(axis: Axis, step: float) -> float:
    """The next smaller round step; 0 without one."""
    if axis.unit == "°" and step in PHASES:
        return float(max((each for each in PHASES if each < step), default=0))
    decade = 10.0 ** math.floor(math.log10(step) + 1e-9)
    return decade * {1: 0.5, 2: 1, 5: 2}[round(step / decade)]
