"""Recorded position setpoints in place of the interpolator's: a cubic spline through the rows of a CSV file.

A recording that was cut while an axis was moving begins or ends at a speed. The axis then gets a run-in from rest to
that speed ahead of the first row, and a run-out behind the last one, as fast as the limits of the path allow.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from feedsim.nc.limits import violations
from feedsim.nc.run_in import SpeedChange, speed_change
from feedsim.nc.segment import whole_cycles
from feedsim.scenario import Axis, MeasuredSetpoints, PathLimits
from feedsim.trace import read_setpoints

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Recording:
    """Recorded setpoints at the position cycle, with run-in and run-out.

    run_in: time ahead of the first row [s]; length: from the first row to the last [s]; duration: from the start of the
    run-in to the end of the run-out [s];
    x_s, v_s: axis -> (N,) position [m] and its derivative [m/s], from 0 to the first instant at or after the end.
    """

    run_in: float
    length: float
    duration: float
    x_s: Mapping[str, Array]
    v_s: Mapping[str, Array]


def recorded(motion: MeasuredSetpoints, start: Mapping[str, float], cycle: float, limits: PathLimits) -> Recording:
    """Setpoints of ``motion`` at multiples of ``cycle`` [s], from the positions ``start`` [m].

    Raises InputError where the file cannot be read, lacks a column or a unit, or has too few rows.
    """
    rows = read_setpoints(
        motion.file,
        {axis: (column.column, column.unit) for axis, column in motion.columns.items()},
        time=(motion.time.column, motion.time.unit),
        between=motion.between,
    )
    length = float(rows.time[-1])
    splines = {axis: CubicSpline(rows.time, rows[axis] - rows[axis][0]) for axis in motion.columns}
    into = {axis: _change(float(spline(0.0, 1)), cycle, limits) for axis, spline in splines.items()}
    out = {axis: _change(float(spline(length, 1)), cycle, limits) for axis, spline in splines.items()}
    # Whole cycles, so that rows recorded at the position cycle stay on it.
    before = whole_cycles(max(change.duration for change in into.values()), cycle)
    duration = before * cycle + length + max(change.duration for change in out.values())
    time: Array = (np.arange(whole_cycles(duration, cycle) + 1, dtype=np.float64) - before) * cycle
    ahead, behind = time < 0, time > length
    x_s, v_s = {}, {}
    for axis, spline in splines.items():
        origin = start[axis] + into[axis].distance if motion.relative else float(rows[axis][0])
        within = np.clip(time, 0.0, length)
        x, v = spline(within), spline(within, 1)
        covered, v[ahead] = into[axis].at(time[ahead] + into[axis].duration)
        x[ahead] = covered - into[axis].distance
        # A run-out is a run-in backwards in time.
        left, v[behind] = out[axis].at(out[axis].duration - (time[behind] - length))
        x[behind] += out[axis].distance - left
        x_s[axis], v_s[axis] = origin + x, v
    return Recording(before * cycle, length, duration, x_s, v_s)


def _change(speed: float, cycle: float, limits: PathLimits) -> SpeedChange:
    # A speed that the jerk limit could undo within a position cycle is none to speak of.
    at_rest = abs(speed) <= limits.jerk * cycle**2
    return speed_change(0.0 if at_rest else speed, limits.acceleration, limits.jerk)


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
