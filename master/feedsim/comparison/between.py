"""What a reference still holds of the time between its rows, where it has been thinned.

Beside `case.csv` lies `case.bounds.csv`, beside `case_ref.csv` it or `case_ref.bounds.csv`, with the same instants. Of
a variable v its columns `v.below` and `v.above` show how far v lies below and above the straight line from the row
before to this one, at most.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feedsim.files.trace import Array, Series, Trace, as_series, read_series
from feedsim.foundation.errors import InputError

# --- The tube around a reference: what a result may be at an instant, given a tolerance in time -----------------------
# The reference is the polyline through its rows, vertical where several rows share an instant. At an instant t the
# tube
# spans from the least to the largest value that the polyline takes within [t - reach, t + reach]; the tolerance in
# value
# comes on top. That is the set sum of the curve and a rectangle, as pyfunnel builds it, but evaluated where it is
# needed
# in place of as a polygon: exact at steps, without rounding at late times, and O(N log N).


Rows = NDArray[np.int64]
# Simulators round and add up time differently. Rows this close, in usual steps, are at one instant.
TUBE_TOLERANCE = 1e-6
# The same in shares of the largest instant: k h added up 10^5 times.
ULPS = 1e-12


def usual_step(time: Array) -> float:
    """Median of the steps that are not zero [s]; 0 with a single instant."""
    steps = np.diff(time)
    steps = steps[steps > 0]
    return float(np.median(steps)) if steps.size else 0.0


def slack_of(time: Array) -> float:
    """Instants that differ by no more than this [s] are the same instant written differently."""
    return max(TUBE_TOLERANCE * usual_step(time), ULPS * float(np.abs(time).max())) if time.size else 0.0


def bounds(
    time: Array, values: Array, at: Array, reach: float, *, slack: float = 0.0, hold: bool = False
) -> tuple[Array, Array]:
    """Least and largest value of the reference within `reach` of each instant.

    time, values  (N,) rows of the reference: never decreasing [s], finite
    at            (M,) instants within the reference's time [s]
    reach         tolerance in time [s], at least 0
    slack         rows this close to the end of the window count as inside [s]
    hold          values hold or change at an unknown instant between two rows: both of the neighbours count, no ramp
    """
    begin, end = at - reach, at + reach
    first = np.searchsorted(time, begin - slack, side="left")
    last = np.searchsorted(time, end + slack, side="right") - 1
    if hold:
        first = np.minimum(first, np.searchsorted(time, begin + slack, side="right") - 1).clip(0)
        last = np.maximum(last, np.searchsorted(time, end - slack, side="left")).clip(max=len(time) - 1)
        return extremes(values, first, last)
    left, right = interpolate_at(time, values, begin), interpolate_at(time, values, end)
    low, high = np.minimum(left, right), np.maximum(left, right)
    if (inside := last >= first).any():
        least, largest = extremes(values, first[inside], last[inside])
        low[inside] = np.minimum(low[inside], least)
        high[inside] = np.maximum(high[inside], largest)
    return low, high


def interpolate_at(time: Array, values: Array, at: Array) -> Array:
    """The polyline at instants `at` (the last of several rows at one instant); its ends are held outside."""
    if len(time) == 1:
        return np.full(len(at), values[0])
    row = (np.searchsorted(time, at, side="right") - 1).clip(0, len(time) - 2)
    step = time[row + 1] - time[row]
    share = np.where(step > 0, (at - time[row]) / np.where(step > 0, step, 1.0), 1.0).clip(0.0, 1.0)
    # Both ends exactly, and never outside them; an infinity stays one up to the next row.
    with np.errstate(invalid="ignore", over="ignore"):
        ramp = np.asarray(values[row] + share * (values[row + 1] - values[row]))
    ramp = np.where((share == 0.0) | np.isinf(values[row]), values[row], ramp)
    return np.asarray(np.where(share == 1.0, values[row + 1], ramp))


def extremes(values: Array, first: Rows, last: Rows) -> tuple[Array, Array]:
    """Least and largest of values[first..last] (both included, first <= last) for each pair of rows.

    Extremes of all windows of 1, 2, 4, ... rows in turn; each pair is covered by two windows of one such size.
    """
    level = np.log2(last - first + 1).astype(np.int64)
    low, high = np.empty(len(first)), np.empty(len(first))
    least, largest = values, values
    for k in range(int(level.max(initial=0)) + 1):
        if k:
            half = 1 << (k - 1)
            least = np.minimum(least[:-half], least[half:])
            largest = np.maximum(largest[:-half], largest[half:])
        chosen = np.flatnonzero(level == k)
        one, other = first[chosen], last[chosen] - (1 << k) + 1
        low[chosen] = np.minimum(least[one], least[other])
        high[chosen] = np.maximum(largest[one], largest[other])
    return low, high


BOUNDS = ".bounds.csv"
BELOW, ABOVE = ".below", ".above"


def thin_series(dense: Series | Trace, every: int) -> tuple[Series, Series]:
    """Every `every`-th row and the last one, and the bounds of what lies between them.

    InputError: `every` below 1, or values that are no numbers.
    """
    dense = as_series(dense)
    if every < 1 or not all(np.isfinite(values).all() for values in dense.columns.values()):
        raise InputError(f"every {every}. row of a reference: 1 or more and rows of finite numbers are needed")
    rows = np.unique(np.r_[0 : len(dense) : every, len(dense) - 1])
    kept = Series(dense.time[rows], {name: values[rows] for name, values in dense.columns.items()}, dense.units)
    columns: dict[str, Array] = {}
    units: dict[str, str] = {}
    for name, values in dense.columns.items():
        below, above = _distances_from_line(dense.time, values, rows)
        columns |= {name + BELOW: below, name + ABOVE: above}
        units |= dict.fromkeys((name + BELOW, name + ABOVE), dense.units[name])
    return kept, Series(kept.time, columns, units)


def _distances_from_line(time: Array, values: Array, rows: Rows) -> tuple[Array, Array]:
    """Per kept row the least and largest distance from the line since the kept row before; 0 of the first."""
    if len(rows) < 2:
        return np.zeros(len(rows)), np.zeros(len(rows))
    off = values - interpolate_at(time[rows], values[rows], time)
    off[rows] = 0.0
    result = [np.r_[0.0, extreme.reduceat(off, rows[:-1])] for extreme in (np.minimum, np.maximum)]
    return np.minimum(result[0], 0.0), np.maximum(result[1], 0.0)


def bounds_of(reference: Path) -> Series | None:
    """The bounds beside a reference; None where there are none. InputError: the file cannot be read."""
    stems = (reference.stem, reference.name.removesuffix("_ref.csv"))
    file = next((path for stem in stems if (path := reference.with_name(stem + BOUNDS)).is_file()), None)
    return read_series(file) if file is not None else None


def check_bounds(between: Series, reference: Series) -> None:
    """InputError: bounds that are of another reference."""
    time, slack = reference.time, slack_of(reference.time)
    if len(between) != len(time) or np.abs(between.time - time).max(initial=0.0) > slack:
        raise InputError(
            f"the bounds beside the reference are of another one: {len(between)} rows from {between.time[0]:.9g} to "
            f"{between.time[-1]:.9g} s, the reference has {len(time)} from {time[0]:.9g} to {time[-1]:.9g} s"
        )
    names = (*between.all_names, *between.skipped)
    for name in names:
        stem = name.removesuffix(BELOW).removesuffix(ABOVE)
        pair = (stem + BELOW, stem + ABOVE)
        if stem not in reference.all_names or stem == name or not all(name in between for name in pair):
            raise InputError(
                f"the bounds beside the reference have a column {name!r}; pairs NAME{BELOW}, NAME{ABOVE} of numbers "
                "are needed, NAME a column of the reference"
            )
        if stem in reference and (unknown := np.isfinite(reference[stem]) & ~np.isfinite(between[name])).any():
            raise InputError(
                f"the bounds beside the reference hold no number in column {name!r} at {time[np.argmax(unknown)]:.9g} s"
            )


class BoundsBetween:
    """Bounds of a variable between the rows of its reference.

    time, values, below, above: (N,) of the reference and its bounds, in the same unit.
    """

    def __init__(self, time: Array, values: Array, below: Array, above: Array) -> None:
        self.rows = time
        # Lines beside the one from row to row; they jump at the rows.
        ends = np.repeat(values, 2)[1:-1]
        lines = [ends + np.repeat(np.asarray(values)[1:], 2) for values in (below, above)]
        known = np.isfinite(lines[0]) & np.isfinite(lines[1])
        self.time = np.repeat(time, 2)[1:-1][known]
        self.low, self.high = (line[known] for line in lines)

    def widened(self, low: Array, high: Array, at: Array, reach: float, slack: float) -> tuple[Array, Array]:
        """The tube around the reference alone, (M,) at instants `at`, widened by what is known to lie between its rows.

        At a row, and without a tolerance in time, the value is known.
        """
        if not self.time.size:
            return low, high
        least = np.minimum(low, bounds(self.time, self.low, at, reach, slack=slack)[0])
        most = np.maximum(high, bounds(self.time, self.high, at, reach, slack=slack)[1])
        if reach > 0:
            return least, most
        near = np.searchsorted(self.rows, at - slack).clip(max=len(self.rows) - 1)
        on = np.abs(self.rows[near] - at) <= slack
        return np.where(on, low, least), np.where(on, high, most)
