"""Changes of speed limited in acceleration and jerk: from rest to rest along a path, and from rest to a speed.

They come from ruckig (one degree of freedom: the path length), which returns at most seven phases of constant jerk.
ruckig's internal tolerances are absolute, so for a path it is asked for a dimensionless one of length 1 with jerk 1; a
move of 1 nm is then as accurate as one of 1 km. Units outside: m, s.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from feedsim.foundation.errors import InputError
from feedsim.foundation.installation import require_module
from feedsim.motions.kind import Array

if TYPE_CHECKING:  # files are read, and schemas printed, without it
    from ruckig import Trajectory

_FAILURE_REASONS = {
    "Error": "an unclassified error",
    "ErrorInvalidInput": "invalid limits",
    "ErrorPositionalLimits": "positional limits cannot be kept",
    "ErrorExecutionTimeCalculation": "no time-optimal profile was found",
    "ErrorSynchronizationCalculation": "no synchronised profile was found",
}

# What is smaller than this share of its peak value is rounding of the profile calculation.
_ROUNDING_SHARE = 1e-9


@dataclass(frozen=True, eq=False)
class Profile:
    """Phases of constant jerk between ``times``; the path is at rest before the first and after the last.

    times, position, velocity, acceleration: values at the K + 1 phase boundaries [s, m, m/s, m/s2];
    jerk: the K phases [m/s3].
    """

    times: Array
    position: Array
    velocity: Array
    acceleration: Array
    jerk: Array

    @property
    def duration(self) -> float:
        """Exact time from rest to rest [s]; no multiple of any cycle."""
        return float(self.times[-1])

    @property
    def length(self) -> float:
        """Length of the path [m]."""
        return float(self.position[-1])

    @property
    def peak_speed(self) -> float:
        """Largest path speed [m/s]; the programmed one unless the path is too short to reach it."""
        within = self.at(self.turning_points)[1]
        return float(max(self.velocity.max(), within.max(initial=0.0)))

    @property
    def turning_points(self) -> Array:
        """Instants [s] inside phases at which the acceleration passes through zero: the speed is at an extreme there.

        A short path is one phase from largest acceleration to largest deceleration; no boundary marks its peak speed.
        """
        before, after = self.acceleration[:-1], self.acceleration[1:]
        within = np.flatnonzero((before * after < 0) & (self.jerk != 0))
        return np.asarray(self.times[within] - before[within] / self.jerk[within], dtype=np.float64)

    @property
    def peak_acceleration(self) -> float:
        """Largest path acceleration [m/s2]; reached at a phase boundary, since it is linear between two of them."""
        return float(np.abs(self.acceleration).max())

    @property
    def steady(self) -> tuple[float, float] | None:
        """Begin and end of the constant-speed phase [s]; None where the path is too short to have one."""
        span = np.diff(self.times)
        coasting = np.abs(self.acceleration[:-1]) <= _ROUNDING_SHARE * self.peak_acceleration
        at_speed = (self.jerk == 0) & coasting & (self.velocity[:-1] > 0) & (span > _ROUNDING_SHARE * self.duration)
        if not at_speed.any():
            return None
        phase = int(np.flatnonzero(at_speed)[np.argmax(span[at_speed])])
        return float(self.times[phase]), float(self.times[phase + 1])

    def at(self, time: Array) -> tuple[Array, Array, Array]:
        """Path length [m], speed [m/s] and acceleration [m/s2] at the instants ``time`` (N,) [s]."""
        t = np.clip(time, 0.0, self.times[-1])
        k = np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, len(self.jerk) - 1)
        dt = t - self.times[k]
        j, a, v = self.jerk[k], self.acceleration[k], self.velocity[k]
        s = self.position[k] + dt * (v + dt * (a / 2 + dt * j / 6))
        return s, v + dt * (a + dt * j / 2), a + dt * j

    def time_at(self, position: Array) -> Array:
        """First instants [s] at which the path lengths ``position`` (N,) [m] are reached.

        The path length never falls, so bisection within the phase finds it; 60 halvings exhaust double precision.
        """
        s = np.clip(position, 0.0, self.length)
        k = np.clip(np.searchsorted(self.position, s, side="left") - 1, 0, len(self.jerk) - 1)
        low, high = self.times[k].copy(), self.times[k + 1].copy()
        for _ in range(60):
            middle = (low + high) / 2
            short = self.at(middle)[0] < s
            low = np.where(short, middle, low)
            high = np.where(short, high, middle)
        # At the end the path is at rest: rounding of the length would be magnified to microseconds.
        return np.where(s <= 0.0, 0.0, np.where(s >= self.length, self.times[-1], high))


_AT_REST = Profile(np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(1))


def rest_to_rest(length: float, speed: float, acceleration: float, jerk: float) -> Profile:
    """Fastest profile over ``length`` [m] >= 0 within ``speed`` [m/s], ``acceleration`` [m/s2] and ``jerk`` [m/s3].

    Raises InputError where a limit is not positive and finite, or where ruckig finds no profile.
    """
    limits = {"speed": (speed, "m/s"), "acceleration": (acceleration, "m/s2"), "jerk": (jerk, "m/s3")}
    bad = [f"{name} {value:g} {unit}" for name, (value, unit) in limits.items() if not 0 < value < np.inf]
    if bad or not 0 <= length < np.inf:
        raise InputError(
            f"path profile over {length:g} m: {', '.join(bad) or 'length'} not allowed; allowed: limits above 0 and "
            "finite, length 0 or more and finite"
        )
    if length == 0:
        return _AT_REST

    unit_time = float(np.cbrt(length / jerk))
    trajectory = _calculate_trajectory(
        f"path profile over {length:g} m with {speed:g} m/s, {acceleration:g} m/s2, {jerk:g} m/s3",
        "Position",
        current_position=0.0,
        target_position=1.0,
        max_velocity=speed * unit_time / length,
        max_acceleration=acceleration * unit_time**2 / length,
        max_jerk=1.0,
    )
    unit = _phases(trajectory)
    position = unit.position * length
    position[-1] = length  # its last digit is ruckig's rounding
    return Profile(
        times=unit.times * unit_time,
        position=position,
        velocity=unit.velocity * (length / unit_time),
        acceleration=unit.acceleration * (length / unit_time**2),
        jerk=unit.jerk * jerk,
    )


@dataclass(frozen=True, eq=False)
class SpeedChange:
    """Fastest change from rest to ``speed`` [m/s] within limits of acceleration and jerk.

    duration [s] and distance [m, signed like the speed] until the speed is reached; 0 where there is nothing to do.
    """

    speed: float
    profile: Profile

    @property
    def duration(self) -> float:
        return self.profile.duration

    @property
    def distance(self) -> float:
        return self.profile.length

    def at(self, time: Array) -> tuple[Array, Array]:
        """Distance covered [m] and speed [m/s] at ``time`` (N,) [s]: at rest before 0, at ``speed`` from the end on."""
        x, v, _ = self.profile.at(time)
        return x + self.speed * np.maximum(time - self.duration, 0.0), v


def speed_change(speed: float, acceleration: float, jerk: float) -> SpeedChange:
    """Change from rest to ``speed`` [m/s], limits in m/s2 and m/s3.

    Raises InputError where ruckig finds none.
    """
    if speed == 0:
        return SpeedChange(0.0, _AT_REST)
    trajectory = _calculate_trajectory(
        f"from rest to {speed:g} m/s with {acceleration:g} m/s2, {jerk:g} m/s3",
        "Velocity",
        target_velocity=speed,
        max_acceleration=acceleration,
        max_jerk=jerk,
    )
    return SpeedChange(speed, _phases(trajectory))


def _phases(trajectory: Trajectory) -> Profile:
    """The phases of a trajectory of one degree of freedom, as numbers: no object of ruckig outlives its calculation."""
    phases = trajectory.profiles[0][0] if isinstance(trajectory.profiles[0], list) else trajectory.profiles[0]
    return Profile(
        np.concatenate([[0.0], np.cumsum(phases.t)]), np.array(phases.p), np.array(phases.v), np.array(phases.a),
        np.array(phases.j),
    )  # fmt: skip


def _calculate_trajectory(where: str, controlled: str, **task: float) -> Trajectory:
    """ruckig's way in one degree of freedom to a position or a velocity; `task`: its input by ruckig's names.

    Raises InputError, with `where` ahead, where ruckig finds none.
    """
    ruckig = require_module("ruckig", "planning a motion")
    asked = ruckig.InputParameter(1)
    asked.control_interface = getattr(ruckig.ControlInterface, controlled)
    for name, value in task.items():
        setattr(asked, name, [value])
    trajectory: Trajectory = ruckig.Trajectory(1)
    try:
        result = ruckig.Ruckig(1).calculate(asked, trajectory)
    except ruckig.RuckigError as error:
        raise InputError(f"{where}: ruckig refuses it: {str(error).strip().splitlines()[0]}") from error
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise InputError(f"{where}: {_FAILURE_REASONS.get(result.name, f'ruckig result {result}')}")
    return trajectory
