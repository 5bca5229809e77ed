"""One C2 cubic spline through equidistant points, at rest on both sides.

The interpolator hands points to the position controllers every T_ipo; between them the drives see a cubic spline. A
global spline has continuous acceleration (a local one, Catmull-Rom, has not, and moves the overshoot by several per
cent). The points are extended by rest points on both sides; there the spline is clamped to speed zero.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

Array = NDArray[np.float64]

# A disturbance of a cubic spline decays by 2 - sqrt(3) = 0.268 per knot: after 28 knots it is below 1e-16 of its size.
REST_POINTS = 28


class RestSpline:
    """C2 cubic spline through ``points`` (K + 1,) at the instants 0, step, ... K step [s]."""

    def __init__(self, points: Array, step: float) -> None:
        self._step = step
        self._constant = float(points[0]) if np.all(points == points[0]) else None
        if self._constant is not None:
            return
        before = np.full(REST_POINTS, points[0])
        after = np.full(REST_POINTS, points[-1])
        # Knots are whole numbers, so that a long program loses no digits in the differences of instants.
        knots = np.arange(-REST_POINTS, len(points) + REST_POINTS, dtype=np.float64)
        # Deviations from the first point keep the digits of a small motion far from the origin.
        deviation = np.concatenate([before, points, after]) - points[0]
        self._origin = float(points[0])
        self._spline = CubicSpline(knots, deviation, bc_type="clamped", extrapolate=False)

    def __call__(self, time: Array) -> tuple[Array, Array]:
        """Position [unit of the points] and speed [per s] at ``time`` (N,) [s], at rest outside the points."""
        if self._constant is not None:
            return np.full(len(time), self._constant), np.zeros(len(time))
        knot = np.clip(time / self._step, self._spline.x[0], self._spline.x[-1])
        return self._origin + self._spline(knot), self._spline(knot, 1) / self._step
