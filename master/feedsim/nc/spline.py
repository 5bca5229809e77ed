"""One C2 cubic spline through equidistant points, at rest on both sides.

The interpolator hands points to the position controllers every T_ipo; between them the drives see a cubic spline. A
global spline has continuous acceleration (a local one, Catmull-Rom, has not, and moves the overshoot by several per
cent). The points are extended by rest points on both sides; there the spline is clamped to speed zero.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from feedsim.motions.kind import Array, Points

# A disturbance of a cubic spline decays by 2 - sqrt(3) = 0.268 per knot: after 28 knots it is below 1e-16 of its size.
REST_POINTS = 28
# Points between which a spline is solved at a time, and how far it then reaches on to either side: what begins
# differently there is the same to the last bit long before.
SPLINE_POINTS, SPLINE_OVERLAP = 1 << 14, 96


class RestSpline:
    """C2 cubic spline through ``points`` (K + 1,) at the instants 0, step, ... K step [s].

    knots: first and last knot that it is needed for, those outside the points being at rest; default: all of them.
    """

    def __init__(self, points: Points, step: float, knots: tuple[int, int] | None = None) -> None:
        count = len(points)
        first, last = knots or (-REST_POINTS, count + REST_POINTS - 1)
        self._step = step
        within = points[max(first, 0) : min(last + 1, count)]
        self._origin = float(points[0:1][0])
        self._constant = knots is None and bool(np.all(within == self._origin))
        if self._constant:
            return
        before = np.full(max(0, -first), self._origin)
        after = np.full(max(0, last + 1 - count), points[count - 1 : count][0])
        # Knots are whole numbers, so that a long program loses no digits in the differences of instants.
        self._knots = first, last
        # Deviations from the first point keep the digits of a small motion far from the origin.
        self._pieces = _clamped(np.concatenate([before, within, after]) - self._origin)

    def __call__(self, time: Array) -> tuple[Array, Array]:
        """Position [unit of the points] and speed [per s] at ``time`` (N,) [s], at rest outside the points."""
        if self._constant:
            return np.full(len(time), self._origin), np.zeros(len(time))
        first, last = self._knots
        knot = np.clip(time / self._step, first, last)
        below = np.minimum(np.floor(knot), last - 1)
        s, (y, dy, half, sixth) = knot - below, self._pieces[:, below.astype(np.int64) - first]
        deviation = y + dy * s + half * (s * s) + sixth * (s * s * s)
        return self._origin + deviation, (dy + half * s * 2 + sixth * (s * s) * 3) / self._step


def _clamped(y: Array) -> Array:
    """(4, N - 1): powers 0 to 3 of the pieces of a C2 cubic spline through `y` (N,) at distances 1, clamped to slope 0.

    The slopes at the knots have s_(i-1) + 4 s_i + s_(i+1) = 3 (y_(i+1) - y_(i-1)).
    """
    rise = np.diff(y)
    slope = np.array(_slopes((3 * (rise[1:] + rise[:-1])).tolist()))
    bend = slope[:-1] + slope[1:] - 2 * rise
    return np.stack([y[:-1], slope[:-1], rise - slope[:-1] - bend, bend])


def _slopes(right: list[float]) -> list[float]:
    """The slopes at all knots, 0 at the first and the last one; right: (N - 2,) right sides of those between.

    Gauss elimination of the tridiagonal system (LAPACK's gtsv, which exchanges no rows here). scipy.linalg and
    scipy.interpolate have the same, with the same bits, and take longer to load than a short program to plan.
    """
    pivots, reduced = [1.0], [0.0]
    pivot = 1.0
    above, value = 0.0, 0.0  # the first row has nothing right of its diagonal
    for side in right:
        factor = 1.0 / pivot
        value = side - factor * value
        pivot = 4.0 - factor * above
        above = 1.0
        pivots.append(pivot)
        reduced.append(value)
    slope = 0.0
    values = [slope]
    for value, pivot in zip(reduced[:0:-1], pivots[:0:-1], strict=True):
        slope = (value - slope) / pivot
        values.append(slope)
    values.append(0.0)
    return values[::-1]


class LongSpline:
    """A :class:`RestSpline` of step 1, solved a block of points at a time, in memory that does not grow with them."""

    def __init__(self, points: Points, block: int = SPLINE_POINTS) -> None:
        self._points, self._block, self._count = points, block, len(points)
        self._whole = RestSpline(points, 1.0) if self._count <= block else None
        self._at, self._solved = -1, self._whole

    def __call__(self, instants: NDArray[np.int64], per_point: int) -> tuple[Array, Array]:
        """Position [unit of the points] and speed [per distance of points] at ``instants`` / per_point.

        instants: (N,) increasing.
        """
        x, v = np.empty(len(instants)), np.empty(len(instants))
        # Whole numbers over the usual numbers per point are exact, however long the program.
        knots, blocks = instants / per_point, instants // (per_point * self._block)
        ends = [0, *(np.flatnonzero(np.diff(blocks)) + 1).tolist(), len(instants)]
        for first, last in pairwise(ends):
            spline = self._whole or self._of(int(blocks[first]))
            x[first:last], v[first:last] = spline(knots[first:last])
        return x, v

    def _of(self, block: int) -> RestSpline:
        if self._at != block or self._solved is None:
            first, last = block * self._block - SPLINE_OVERLAP, (block + 1) * self._block + SPLINE_OVERLAP
            self._solved = RestSpline(
                self._points, 1.0, (max(first, -REST_POINTS), min(last, self._count + REST_POINTS - 1))
            )
            self._at = block
        return self._solved
