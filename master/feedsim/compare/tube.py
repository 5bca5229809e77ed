"""The tube around a reference: what a result may be at an instant, given a tolerance in time.

The reference is the polyline through its rows, vertical where several rows share an instant. At an instant t the tube
spans from the least to the largest value that the polyline takes within [t - reach, t + reach]; the tolerance in value
comes on top. That is the set sum of the curve and a rectangle, as pyfunnel builds it, but evaluated where it is needed
in place of as a polygon: exact at steps, without rounding at late times, and O(N log N).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from feedsim.trace import Array

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
    left, right = along(time, values, begin), along(time, values, end)
    low, high = np.minimum(left, right), np.maximum(left, right)
    if (inside := last >= first).any():
        least, largest = extremes(values, first[inside], last[inside])
        low[inside] = np.minimum(low[inside], least)
        high[inside] = np.maximum(high[inside], largest)
    return low, high


def along(time: Array, values: Array, at: Array) -> Array:
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
