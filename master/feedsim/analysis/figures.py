"""A derived figure, and small tools on time series that the analyses share."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from html import escape
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from feedsim.files.trace import Trace
from feedsim.files.trace.trace import suggest_name
from feedsim.foundation.errors import InputError, UnknownName
from feedsim.foundation.installation import require_module

if TYPE_CHECKING:
    import pandas

Array = NDArray[np.float64]

# Instants within this share of a sampling interval count as the same: recorded times carry rounding errors.
SAME_INSTANT = 1e-6


@dataclass(frozen=True)
class Figure:
    """One derived number. ``value`` is NaN where the trace does not contain what the definition asks for.

    ``float(figure)`` is its value. interval: its ends of 95 %, or of the share that was asked for, in its unit; None:
    not known.

    >>> import feedsim as fs
    >>> figure = fs.run("z_positioning.yaml").figures["Z.overshoot"]
    >>> float(figure) == figure.value
    True
    >>> print(figure, "-", figure.meaning)  # doctest: +ELLIPSIS
    3.13... um - ...
    """

    value: float
    unit: str
    meaning: str
    interval: tuple[float, float] | None = None

    def __float__(self) -> float:
        return self.value

    def __str__(self) -> str:
        return f"{self.value:.4g} {self.unit}" if math.isfinite(self.value) else "not determined"


Figures = Mapping[str, Figure]


class FigureTable(dict[str, Figure]):
    """Figures by name, a table: :meth:`to_pandas`, and as notebooks show it.

    A name that is none raises UnknownName, which says which is the nearest.

    >>> FigureTable({"Z.overshoot": Figure(3.1, "um", "")})["Z.overshot"]
    Traceback (most recent call last):
    feedsim.foundation.errors.UnknownName: no figure 'Z.overshot'; did you mean 'Z.overshoot'?
    """

    def __missing__(self, name: str) -> Figure:
        raise UnknownName(f"no figure {name!r}{suggest_name(name, self)}")

    def with_intervals(self, intervals: Mapping[str, tuple[float, float]]) -> FigureTable:
        """The same with intervals of some; ends that are NaN are not known."""
        known = {name: ends for name, ends in intervals.items() if name in self and math.isfinite(ends[0])}
        return FigureTable(self | {name: replace(self[name], interval=ends) for name, ends in known.items()})

    def to_pandas(self) -> pandas.DataFrame:
        """A row per figure: value, unit, low and high end of its interval, meaning. Needs the package pandas."""
        rows = [(f.value, f.unit, *(f.interval or (math.nan, math.nan)), f.meaning) for f in self.values()]
        return require_module("pandas", "a DataFrame").DataFrame(
            rows, index=list(self), columns=["value", "unit", "low", "high", "meaning"]
        )

    def _repr_html_(self) -> str:
        rows = [
            (name, str(f), "" if f.interval is None else f"{f.interval[0]:.4g} to {f.interval[1]:.4g}", f.meaning)
            for name, f in self.items()
        ]
        cells = ["".join(f"<td style='text-align:left'>{escape(cell)}</td>" for cell in row) for row in rows]
        heads = "".join(f"<th>{head}</th>" for head in ("figure", "value", "interval", "meaning"))
        return f"<table><tr>{heads}</tr>{''.join(f'<tr>{row}</tr>' for row in cells)}</table>"


def column(trace: Trace, name: str, purpose: str) -> Array:
    """Column ``name`` of the trace; raises InputError that names the purpose and what was recorded instead."""
    if name not in trace.columns:
        recorded = ", ".join(trace.columns) or "nothing"
        raise InputError(f"{purpose} needs {name}, which is not recorded; recorded: {recorded}")
    return np.asarray(trace[name], dtype=np.float64)


def window(trace: Trace, begin: float, end: float, purpose: str, *, least: int = 2) -> slice:
    """Rows with begin <= time <= end [s]; raises InputError where the trace does not reach that far.

    The window may stick out of the recording by one sampling interval.
    """
    time = trace.time
    interval = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    slack = SAME_INSTANT * interval
    first = int(np.searchsorted(time, begin - slack, side="left"))
    last = int(np.searchsorted(time, end + slack, side="right"))
    short = len(time) == 0 or begin < time[0] - interval - slack or end > time[-1] + interval + slack
    if short or last - first < least:
        have = f"{time[0]:.6g} to {time[-1]:.6g} s" if len(time) else "nothing"
        raise InputError(
            f"{purpose} needs the trace from {begin:.6g} to {end:.6g} s with {least} samples or more; "
            f"recorded: {have}, {max(last - first, 0)} samples in that span"
        )
    return slice(first, last)


def up_crossings(time: Array, signal: Array) -> Array:
    """Instants [s], linearly interpolated, at which ``signal`` (N,) rises through zero."""
    rise = np.flatnonzero((signal[:-1] < 0) & (signal[1:] >= 0))
    share = signal[rise] / (signal[rise] - signal[rise + 1])
    return np.asarray(time[rise] + share * (time[rise + 1] - time[rise]), dtype=np.float64)


def last_outside(time: Array, deviation: Array, band: float) -> float:
    """Last instant [s] with |deviation| > band, interpolated to the crossing of the band's edge.

    -inf where the deviation never leaves the band, NaN where it is still outside at the last sample.
    """
    outside = np.flatnonzero(np.abs(deviation) > band)
    if len(outside) == 0:
        return -math.inf
    k = int(outside[-1])
    if k == len(time) - 1:
        return math.nan
    edge = math.copysign(band, deviation[k])
    share = (deviation[k] - edge) / (deviation[k] - deviation[k + 1])
    return float(time[k] + share * (time[k + 1] - time[k]))


def moving_mean(values: Array, count: int) -> Array:
    """Mean over ``count`` neighbours; fewer at the ends."""
    ones = np.ones(min(count, len(values)))
    return np.asarray(np.convolve(values, ones, "same") / np.convolve(np.ones(len(values)), ones, "same"))
