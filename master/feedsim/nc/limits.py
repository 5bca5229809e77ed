"""Checks of the planned motion against the axes' limits; every violation is found before any is reported."""

from __future__ import annotations

import numpy as np

from feedsim.motions.kind import Array, Peaks
from feedsim.scenario import Axis

# Limits are compared with results of arithmetic on them: a relative 1e-9, and 1 nm of travel, are rounding.
ROUNDING = 1e-9


def violations(name: str, axis: Axis, start: float, peaks: Peaks) -> list[str]:
    """What is wrong with a motion of axis ``name`` that has these peaks.

    Where it stands at ``start`` [m] is not its own fault: the motion before it was blamed for that.
    """
    found = []
    least, most = axis.travel
    outside = [x for x in (peaks.low, peaks.high) if x != start and not least - ROUNDING <= x <= most + ROUNDING]
    if outside:
        reached = " and ".join(f"{x * 1e3:.7g}" for x in dict.fromkeys(outside))
        found.append(f"axis {name} reaches {reached} mm; allowed travel {least * 1e3:.7g} to {most * 1e3:.7g} mm")
    if peaks.speed > axis.max_speed * (1 + ROUNDING):
        found.append(
            f"axis {name} reaches a speed of {peaks.speed * 60:.5g} m/min; "
            f"allowed at most {axis.max_speed * 60:.5g} m/min"
        )
    if peaks.acceleration > axis.max_acceleration * (1 + ROUNDING):
        found.append(
            f"axis {name} reaches an acceleration of {peaks.acceleration:.5g} m/s^2; "
            f"allowed at most {axis.max_acceleration:.5g} m/s^2"
        )
    return found


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
    speed, acceleration = float(np.abs(v_s).max()), float(np.abs(steps).max())
    return violations(name, axis, start, Peaks(float(x_s.min()), float(x_s.max()), speed, acceleration))
