"""Strokes at constant speeds, there and back, as long as the experiment asks and the travel allows."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from feedsim.errors import InputError
from feedsim.nc.course import Course, check_length
from feedsim.nc.profile import Profile, rest_to_rest
from feedsim.nc.segment import Stroke, Strokes, whole_cycles
from feedsim.scenario import Axis, ConstantSpeed, PathLimits

Array = NDArray[np.float64]

# Time at constant speed [s] below which a stroke says nothing of the stationary friction: the drive settles in it.
SHORTEST = 0.1


def strokes(
    motion: ConstantSpeed, axis: Axis, position: float, limits: PathLimits, cycle: float, begin: float, most: int
) -> Course:
    """Strokes from ``position`` [m] towards the side with more room, each back again before the next speed.

    Every stroke starts on the grid of ``cycle`` [s], the interpolator's; ``begin`` [s] is the program time of the
    first, ``most`` the cycles that they may last.

    Raises InputError that lists every speed for which there is not travel enough; or where they last too long.
    """
    below, above = position - axis.travel[0], axis.travel[1] - position
    side = 1.0 if above >= below else -1.0
    room = max(above, below, 0.0)
    room = room if motion.stroke is None else min(room, motion.stroke)
    acceleration, jerk = motion.acceleration or limits.acceleration, motion.jerk or limits.jerk
    profiles, problems = [], []
    for speed in motion.feeds:
        ramp = ramp_time(speed, acceleration, jerk)
        at_speed = min(max(motion.duration, motion.distance / speed), room / speed - ramp)
        wanted = min(SHORTEST, motion.duration)
        if at_speed < wanted:
            problems.append(
                f"axis {motion.axis} needs {speed * (wanted + ramp) * 1e3:.5g} mm for {wanted:.3g} s at "
                f"{speed * 6e4:.6g} mm/min and for getting to that speed and back to rest; there are "
                f"{room * 1e3:.5g} mm{_whose(motion, room)}"
            )
            continue
        profiles.append(rest_to_rest(speed * (ramp + at_speed), speed, acceleration, jerk))
    if problems:
        raise InputError.of(f"axis {motion.axis} has not travel enough", problems)

    pause = whole_cycles(motion.rest, cycle)
    check_length(sum(2 * (whole_cycles(profile.duration, cycle) + pause) for profile in profiles), cycle, most)
    parts: list[Array] = []
    done: list[Stroke] = []
    cycles, here = 0, 0.0
    for profile in profiles:
        for sense in (side, -side):
            start = begin + cycles * cycle
            count = whole_cycles(profile.duration, cycle)
            covered = profile.at(np.arange(1, count + 1, dtype=np.float64) * cycle)[0]
            target = here + sense * profile.length if sense == side else 0.0
            points = here + sense * covered
            points[-1] = target  # the way back meets the start without a rounding error
            last = profile is profiles[-1] and sense != side
            parts += [points, np.full(0 if last else pause, target)]
            begun, ended = _steady(profile)
            done.append(
                Stroke(
                    speed=sense * profile.peak_speed,
                    steady=(start + begun, start + ended),
                    start=start,
                    end=start + profile.duration,
                )
            )
            cycles += count + (0 if last else pause)
            here = target
    longest = max(profile.length for profile in profiles)
    return Course(
        duration=done[-1].end - begin,
        points=np.concatenate(parts),
        low=min(0.0, side * longest),
        high=max(0.0, side * longest),
        speed=max(profile.peak_speed for profile in profiles),
        acceleration=max(profile.peak_acceleration for profile in profiles),
        geometry=Strokes(motion.axis, tuple(done)),
    )


def ramp_time(speed: float, acceleration: float, jerk: float) -> float:
    """Shortest time [s] from rest to ``speed`` [m/s] within limits of acceleration [m/s2] and jerk [m/s3].

    The distance is half of speed times this time, since the speed rises point-symmetrically.
    """
    if speed * jerk <= acceleration**2:
        return 2 * math.sqrt(speed / jerk)
    return speed / acceleration + acceleration / jerk


def _steady(profile: Profile) -> tuple[float, float]:
    if profile.steady is None:  # the stroke is made for one
        raise InputError(f"no phase of constant speed in a stroke of {profile.length:g} m")
    return profile.steady


def _whose(motion: ConstantSpeed, room: float) -> str:
    if motion.stroke is not None and room == motion.stroke:
        return " (stroke); allow a longer one or leave it out"
    return " up to the farther end of the travel; begin nearer to an end, or move slower"
