"""Recorded position setpoints in place of the interpolator's: a cubic spline through the rows of a CSV file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from feedsim.nc.limits import violations
from feedsim.nc.segment import whole_cycles
from feedsim.scenario import Axis, MeasuredSetpoints
from feedsim.trace import read_setpoints

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Recording:
    """Recorded setpoints at the position cycle from their first row on.

    duration: from the first row to the last [s]; x_s, v_s: axis -> (N,) position [m] and its derivative [m/s], from 0
    to the first instant at or after the end, where the last row stands.
    """

    duration: float
    x_s: Mapping[str, Array]
    v_s: Mapping[str, Array]


def recorded(motion: MeasuredSetpoints, start: Mapping[str, float], cycle: float) -> Recording:
    """Setpoints of ``motion`` at multiples of ``cycle`` [s], from the positions ``start`` [m].

    Raises InputError where the file cannot be read, lacks a column or a unit, or has too few rows.
    """
    rows = read_setpoints(
        motion.file,
        {axis: (column.column, column.unit) for axis, column in motion.columns.items()},
        time=(motion.time.column, motion.time.unit),
        between=motion.between,
    )
    duration = float(rows.time[-1])
    grid = np.minimum(np.arange(whole_cycles(duration, cycle) + 1) * cycle, duration)
    x_s, v_s = {}, {}
    for axis in motion.columns:
        x = rows[axis]
        spline = CubicSpline(rows.time, x - x[0] + start[axis] if motion.relative else x)
        x_s[axis], v_s[axis] = spline(grid), spline(grid, 1)
    return Recording(duration, x_s, v_s)


def recording_violations(name: str, axis: Axis, start: float, x_s: Array, v_s: Array, cycle: float) -> list[str]:
    """What is wrong with recorded setpoints of axis ``name`` that stands at ``start`` [m] before them.

    The acceleration is the second difference over the position cycle, which includes the jump into the recording.
    """
    jump = abs(float(x_s[0]) - start)
    if jump > axis.max_acceleration * cycle**2:
        return [
            f"axis {name} stands at {start * 1e3:.7g} mm, its recording begins at {float(x_s[0]) * 1e3:.7g} mm; "
            "move there first, or set relative: true"
        ]
    steps = np.diff(np.concatenate([[start, start], x_s, [x_s[-1], x_s[-1]]]), 2) / cycle**2
    return violations(
        name, axis, start, float(x_s.min()), float(x_s.max()), float(np.abs(v_s).max()), float(np.abs(steps).max())
    )
