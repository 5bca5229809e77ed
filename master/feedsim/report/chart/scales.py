"""What a panel shows at first: the ranges of its axes, and the ticks along them. The page's script does the same."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from itertools import pairwise

import numpy as np

from feedsim.report.chart.model import (
    MAX_DIGITS,
    MIN_TICKS,
    NARROWEST,
    PHASES,
    ROOM,
    UNITS_WITH_PREFIX,
    Axis,
    Curve,
    Panel,
    spans,
)
from feedsim.report.formatting import SUPERSCRIPTS, Array, minus

Range = tuple[float, float]
EXPONENT_BELOW, EXPONENT_FROM = 1e-4, 1e7  # of a number that is written digit by digit


@dataclass(frozen=True)
class Ticks:
    """Marks along an axis.

    Attributes:
        marks: value and text of each; without text it is a thin line.
        common: what stands at the axis because all texts are added to it.
        unit: of the texts, where it is not that of the axis.
    """

    marks: list[tuple[float, str]] = field(default_factory=list)
    common: str = ""
    unit: str = ""

    def title(self, axis: Axis) -> str:
        """What stands along the axis."""
        if self.common:
            return f"{axis.label} − {self.common}{f' [{self.unit}]' if self.unit else ''}"
        return replace(axis, unit=self.unit).title if self.unit else axis.title

    @property
    def texts(self) -> list[str]:
        """Those that are not empty."""
        return [text for _, text in self.marks if text]

    @property
    def has_powers(self) -> bool:
        """Whether a text has a power of ten."""
        return any("×" in text for text in self.texts)


def ranges(panel: Panel) -> tuple[Range, Range]:
    """Abscissae and ordinates that are shown: as the axes say, else those of curves and marks, with room about them."""
    across = panel.x.span or _whole(panel)
    return across, panel.y.span or _heights(panel, across)


def _whole(panel: Panel) -> Range:
    low, high = spans([_shown(panel.x, curve.x) for curve in panel.curves]) or (0.0, 1.0)
    return (low, high) if high > low else (low - 0.5, low + 0.5)


def _heights(panel: Panel, across: Range) -> Range:
    axis = panel.y
    heights = [_seen(curve, across) for curve in panel.curves]
    heights.append(np.array([mark.y for mark in panel.marks if across[0] <= mark.x <= across[1]]))
    result = spans([_shown(axis, height) for height in heights])
    if result is None:
        return (0.1, 10.0) if axis.log else (-1.0, 1.0)
    low, high = result
    if axis.log:
        return low / 1.3, high * 1.3
    if axis.symlog:  # room in the measure of the axis, on either side of zero
        more = 0.0 if high > low else axis.symlog
        return low - 3 * ROOM * abs(low) - more, high + 3 * ROOM * abs(high) + more
    if high > low and high - low < (least := NARROWEST * max(abs(low), abs(high))):
        low, high = (low + high - least) / 2, (low + high + least) / 2
    room = ROOM * (high - low) or 0.05 * abs(high) or 1.0
    on_ground = low == 0 and any(curve.filled for curve in panel.curves)
    return low - (0.0 if on_ground else room), high + room


def _shown(axis: Axis, values: Array) -> Array:
    return np.where(values > 0, values, np.nan) if axis.log else values


def _seen(curve: Curve, span: Range) -> Array:
    inside = curve.y[(curve.x >= span[0]) & (curve.x <= span[1])]
    return np.append(inside, 0.0) if curve.filled else inside


def measured(axis: Axis, values: Array | float) -> Array:
    """Values in the measure of an axis, which is linear on paper; not finite where a logarithmic axis has none."""
    values = np.asarray(values, dtype=float)
    if axis.symlog:  # linear within this distance from zero
        return np.asarray(np.sign(values) * np.log10(1 + np.abs(values) / axis.symlog))
    if axis.log:
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.log10(np.where(values > 0, values, np.nan))
    return values


def ticks(axis: Axis, span: Range, most: float) -> Ticks:
    """Where an axis is marked, and with what: some `most` round values, angles in parts of a turn.

    Where a text would have a power of ten, the texts are in the first unit with a prefix in which none has one, from
    that on in which the largest value is 1 or more.
    """
    result = _marks(axis, span, most)
    if result.common or axis.names or not result.has_powers:
        return result
    known = UNITS_WITH_PREFIX.get(axis.unit, ((1, axis.unit),))
    for factor, unit in known[known.index(_with_prefix(known, max(map(abs, span)))) :]:
        scaled = replace(axis, unit=unit, symlog=axis.symlog * factor)
        there = _marks(scaled, (span[0] * factor, span[1] * factor), most)
        if not there.has_powers:
            return Ticks([(at / factor, text) for at, text in there.marks], unit=unit)
    return result


def _with_prefix(known: Sequence[tuple[float, str]], size: float) -> tuple[float, str]:
    """Factor and unit in which a size is 1 or more, else the finest that is known."""
    return next((pair for pair in known if size * pair[0] >= 1), known[-1])


def _marks(axis: Axis, span: Range, most: float) -> Ticks:
    low, high = span
    if axis.names:
        every = math.ceil(len(axis.names) / max(1.0, most))
        return Ticks([(float(k), name) for k, name in enumerate(axis.names) if k % every == 0 and low <= k <= high])
    if axis.symlog and len(marks := _both_ways(axis.symlog, span)) > 1:
        return Ticks(marks)
    if axis.log and high / low > 8:
        return Ticks(_decades(span, most))
    turns = axis.unit == "°" and high - low > 60
    step = (
        float(next((number for number in PHASES if (high - low) / number <= most), 3600))
        if turns
        else round_step((high - low) / most)
    )
    while (count := _marked(span, step)) < MIN_TICKS:  # one or two ticks are no scale
        finer = _finer(step, turns)
        if not finer or (count > 1 and _marked(span, finer) > most + 2):
            break
        step = finer
    return _stepped(axis, span, step)


def _both_ways(within: float, span: Range) -> list[tuple[float, str]]:
    low, high = span
    first, last = math.ceil(math.log10(2 * within) - 1e-9), math.floor(math.log10(max(-low, high, within)) + 1e-9)
    decades = [10.0**k for k in range(first, last + 1)]
    marks = [*(-decade for decade in reversed(decades)), 0.0, *decades]
    return [(at, tick_text(at)) for at in marks if low <= at <= high]


def _decades(span: Range, most: float) -> list[tuple[float, str]]:
    low, high = span
    decades = math.log10(high / low)
    few, every = decades < 2.2, max(1, math.floor(decades / most + 0.5))
    return [
        (at, tick_text(at) if (part == 1 and k % every == 0) or (few and part in (2, 5)) else "")
        for k in range(math.floor(math.log10(low)), math.floor(math.log10(high)) + 1)
        for part in range(1, 10)
        if low * 0.9999 <= (at := part * 10.0**k) <= high * 1.0001
    ]


def round_step(rough: float) -> float:
    decade: float = 10.0 ** math.floor(math.log10(rough)) if rough > 0 else 1.0
    return decade * next((entry for entry in (1, 2, 5) if entry * decade >= 0.999 * rough), 10)


def _marked(span: Range, step: float) -> int:
    return math.floor(span[1] / step + 1e-9) - math.ceil(span[0] / step - 1e-9) + 1


def _finer(step: float, turns: bool) -> float:
    """The next smaller round step; 0 without one."""
    if turns:
        return float(max((number for number in PHASES if number < step), default=0))
    decade: float = 10.0 ** math.floor(math.log10(step) + 1e-9)
    return decade * {1: 0.5, 2: 1, 5: 2}[round(step / decade)]


def _stepped(axis: Axis, span: Range, step: float) -> Ticks:
    """Ticks a step apart, with as many digits as the step asks for."""
    low, high = span
    power = math.floor(math.log10(step) + 1e-9)
    values = []
    k = math.ceil(low / step - 1e-9)
    while k * step <= high + 1e-9 * step:
        values.append(k * step)
        k += 1
    digits = [max(6, math.floor(math.log10(abs(at) or step)) - power + 1) for at in values]
    if max(digits, default=0) <= MAX_DIGITS:
        return Ticks([(at, tick_text(at, n)) for at, n in zip(values, digits, strict=True)])
    whole = 10.0 ** math.ceil(math.log10(high - low) - 1e-9)
    common = math.floor(low / whole + 1e-9) * whole
    factor, unit = _with_prefix(UNITS_WITH_PREFIX.get(axis.unit, ((1, axis.unit),)), high - common)
    marks = [(at, tick_text(round((at - common) / step) * step * factor, 4)) for at in values]
    count = math.floor(math.log10(abs(common) or 1)) - math.floor(math.log10(whole) + 1e-9) + 1
    return Ticks(marks, f"{tick_text(common, max(1, count))}{f' {axis.unit}' if axis.unit else ''}", unit)


def tick_text(value: float, digits: int = 6) -> str:
    """A number with at most so many digits that count."""
    rounded = float(f"{value:.{digits}g}")
    if not rounded or EXPONENT_BELOW <= abs(rounded) < EXPONENT_FROM:
        return minus(repr(rounded).removesuffix(".0"))
    mantissa, _, power = f"{Decimal(repr(rounded)).normalize():e}".partition("e")
    return minus(f"{mantissa}×10{str(int(power)).translate(SUPERSCRIPTS)}")


def apart(found_of: Callable[[int], Ticks], place: Callable[[float], float], most: int, end: float) -> Ticks:
    """Ticks whose texts do not touch: fewer of them, in the end every second one without its text.

    found_of: ticks of which there are some number; place: where a value stands [pixels]; end: of the last text.
    """

    def touching(all_of: Ticks) -> bool:
        middles = [(min(place(at), end - 3.6 * len(text)), len(text)) for at, text in all_of.marks if text]
        return any(abs(b - a) < 3.5 * (n + m) + 6 for (a, n), (b, m) in pairwise(middles))

    result = found_of(most)
    while most > 2 and touching(result):
        most -= 1
        result = found_of(most)
    for _ in range(3):
        if touching(result):
            with_text = [at for at, text in result.marks if text]
            kept = set(with_text[::2])
            result = replace(result, marks=[(at, text if at in kept else "") for at, text in result.marks])
    return result
