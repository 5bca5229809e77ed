"""From rest into motion and back to rest: what the ends of a recording need that was cut while the axis was moving."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from ruckig import ControlInterface, InputParameter, Result, Ruckig, Trajectory

from feedsim.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SpeedChange:
    """Fastest change from rest to ``speed`` [m/s] within limits of acceleration and jerk.

    duration [s] and distance [m, signed like the speed] until the speed is reached; 0 where there is nothing to do.
    """

    speed: float
    duration: float
    distance: float
    trajectory: Trajectory | None

    def at(self, time: Array) -> tuple[Array, Array]:
        """Distance covered [m] and speed [m/s] at ``time`` (N,) [s]: at rest before 0, at ``speed`` from the end on."""
        x, v = np.zeros(len(time)), np.zeros(len(time))
        for i, t in enumerate(time):
            if t > 0 and self.trajectory is not None:
                (x[i],), (v[i],), _ = self.trajectory.at_time(float(t))
        return x, v


def speed_change(speed: float, acceleration: float, jerk: float) -> SpeedChange:
    """Change from rest to ``speed`` [m/s], limits in m/s2 and m/s3.

    Raises InputError where ruckig finds none.
    """
    if speed == 0:
        return SpeedChange(0.0, 0.0, 0.0, None)
    task = InputParameter(1)
    task.control_interface = ControlInterface.Velocity
    task.target_velocity = [speed]
    task.max_acceleration, task.max_jerk = [acceleration], [jerk]
    trajectory = Trajectory(1)
    result = Ruckig(1).calculate(task, trajectory)
    if result not in (Result.Working, Result.Finished):
        raise InputError(f"no way from rest to {speed:g} m/s with {acceleration:g} m/s2 and {jerk:g} m/s3: {result}")
    (distance,), _, _ = trajectory.at_time(trajectory.duration)
    return SpeedChange(speed, float(trajectory.duration), float(distance), trajectory)
