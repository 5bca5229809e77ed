"""Geometry of the programmed motions: from path length to axis positions."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from feedsim.errors import InputError
from feedsim.nc.profile import Profile
from feedsim.scenario import Arc, Circle, Move

Array = NDArray[np.float64]

# How far an arc's programmed end point may lie off the circle through its start [m]; it then ends on the circle.
END_POINT_TOLERANCE = 1e-6
# Phases of the profile may be shorter than a cycle; the peak of the combined acceleration lies within one.
POINTS_PER_PHASE = 33
# Instants that are looked at together: a long circle has millions.
INSTANTS = 1 << 15


@dataclass(frozen=True)
class Line:
    """Straight line; ``direction`` has length 1 (or 0 where nothing moves) over the axes that it names."""

    origin: Mapping[str, float]
    direction: Mapping[str, float]
    length: float

    @property
    def axes(self) -> tuple[str, ...]:
        """Axes that the path names, those that stand among them."""
        return tuple(self.direction)

    @property
    def moving(self) -> tuple[str, ...]:
        """Axes that the path moves."""
        return tuple(axis for axis, share in self.direction.items() if share != 0)

    def position(self, s: Array) -> dict[str, Array]:
        """Axis positions [m] at path lengths ``s`` (N,) [m]."""
        return {axis: self.origin[axis] + share * s for axis, share in self.direction.items()}

    def peaks(self, profile: Profile, step: float) -> dict[str, tuple[float, float, float, float]]:
        """Per axis: least and largest position [m], largest speed [m/s] and acceleration [m/s2] (magnitudes)."""
        found = {}
        for axis, share in self.direction.items():
            ends = (self.origin[axis], self.origin[axis] + share * self.length)
            speed, acceleration = abs(share) * profile.peak_speed, abs(share) * profile.peak_acceleration
            found[axis] = (min(ends), max(ends), speed, acceleration)
        return found


@dataclass(frozen=True)
class CircularPath:
    """Circular path about ``centre`` through ``sweep`` [rad] > 0; ``sense`` +1 turns the first axis to the second."""

    axes: tuple[str, str]
    centre: tuple[float, float]
    radius: float
    start_angle: float
    sweep: float
    sense: int

    @property
    def moving(self) -> tuple[str, ...]:
        """Axes that the path moves."""
        return self.axes

    @property
    def length(self) -> float:
        """Length of the path [m]."""
        return self.radius * self.sweep

    def angle(self, s: Array) -> Array:
        """Angle about the centre [rad] at path lengths ``s`` (N,) [m]."""
        return self.start_angle + self.sense * s / self.radius

    def position(self, s: Array) -> dict[str, Array]:
        """Axis positions [m] at path lengths ``s`` (N,) [m]."""
        phi = self.angle(s)
        return {
            self.axes[0]: self.centre[0] + self.radius * np.cos(phi),
            self.axes[1]: self.centre[1] + self.radius * np.sin(phi),
        }

    def peaks(self, profile: Profile, step: float) -> dict[str, tuple[float, float, float, float]]:
        """As for a line. The path is looked at every ``step`` [s], at 33 instants of every phase of the profile, where
        the path speed is at an extreme, and where an axis is at an extreme of its motion.

        Acceleration is the axis' share of tangential acceleration and centripetal acceleration v^2/R together.
        """
        within_phases = np.linspace(profile.times[:-1], profile.times[1:], POINTS_PER_PHASE).ravel()
        special = np.concatenate([within_phases, profile.turning_points, self._crossings(profile)])
        on_grid = math.ceil(profile.duration / step)
        stretches = (
            np.arange(first, min(first + INSTANTS, on_grid), dtype=np.float64) * step
            for first in range(0, on_grid, INSTANTS)
        )
        found = dict.fromkeys(self.axes, (math.inf, -math.inf, 0.0, 0.0))
        for t in chain([special], stretches):
            for axis, (low, high, speed, acceleration) in self._peaks_at(profile, t).items():
                least, largest, fastest, hardest = found[axis]
                found[axis] = min(least, low), max(largest, high), max(fastest, speed), max(hardest, acceleration)
        return found

    def _peaks_at(self, profile: Profile, t: Array) -> dict[str, tuple[float, float, float, float]]:
        """The same at the instants ``t`` [s] alone."""
        s, v, a = profile.at(t)
        phi = self.angle(s)
        tangent = (-self.sense * np.sin(phi), self.sense * np.cos(phi))
        inward = (-np.cos(phi), -np.sin(phi))
        found = {}
        for axis, x, along, towards in zip(self.axes, self.position(s).values(), tangent, inward, strict=True):
            acceleration = a * along + v**2 / self.radius * towards
            found[axis] = (
                float(x.min()),
                float(x.max()),
                float(np.abs(v * along).max()),
                float(np.abs(acceleration).max()),
            )
        return found

    def _crossings(self, profile: Profile) -> Array:
        """Instants [s] at which the path crosses a half axis of its circle."""
        quarter = math.pi / 2
        begin = self.sense * self.start_angle / quarter
        crossed = np.arange(math.ceil(begin), math.floor(begin + self.sweep / quarter) + 1, dtype=np.float64) * quarter
        return profile.time_at((crossed - self.sense * self.start_angle) * self.radius)


def line(motion: Move, start: Mapping[str, float]) -> Line:
    """Path of a move from the positions ``start`` [m]."""
    distance = {axis: d for axis, d in motion.by.items()} | {axis: x - start[axis] for axis, x in motion.to.items()}
    length = math.sqrt(sum(d * d for d in distance.values()))
    direction = {axis: d / length if length > 0 else 0.0 for axis, d in distance.items()}
    return Line(dict(start), direction, length)


def full_circle(motion: Circle, start: Mapping[str, float]) -> CircularPath:
    """Path of a circle that begins and ends at ``start`` [m], which lies at its start angle."""
    first, second = motion.plane
    centre = (
        start[first] - motion.radius * math.cos(motion.start_angle),
        start[second] - motion.radius * math.sin(motion.start_angle),
    )
    return CircularPath(
        motion.plane, centre, motion.radius, motion.start_angle, 2 * math.pi * motion.turns, _sense(motion.direction)
    )


def arc(motion: Arc, start: Mapping[str, float]) -> CircularPath:
    """Path of an arc from ``start`` [m]. An end point equal to the start means a full turn.

    Raises InputError: centre on the start, or end point off the circle about the centre through the start.
    """
    first, second = motion.plane
    offset = motion.centre_by or {axis: motion.centre[axis] - start[axis] for axis in motion.plane}
    centre = (start[first] + offset[first], start[second] + offset[second])
    radius = math.hypot(offset[first], offset[second])
    if radius < END_POINT_TOLERANCE:
        raise InputError(
            f"the centre of the arc lies {radius * 1e6:.4g} um from its start; "
            f"allowed: {END_POINT_TOLERANCE * 1e6:g} um or more"
        )
    start_angle = math.atan2(-offset[second], -offset[first])
    sense = _sense(motion.direction)
    if motion.angle is not None:
        return CircularPath(motion.plane, centre, radius, start_angle, motion.angle, sense)
    end = motion.to or {axis: start[axis] + motion.by[axis] for axis in motion.plane}
    u, w = end[first] - centre[0], end[second] - centre[1]
    if abs(math.hypot(u, w) - radius) > END_POINT_TOLERANCE:
        raise InputError(
            f"the end point of the arc is {math.hypot(u, w) * 1e3:.7g} mm from the centre, "
            f"its start {radius * 1e3:.7g} mm; "
            f"allowed difference: {END_POINT_TOLERANCE * 1e6:g} um"
        )
    sweep = (sense * (math.atan2(w, u) - start_angle)) % (2 * math.pi)
    # Where the end is the start to within the tolerance, a full turn is meant, not none.
    if min(sweep, 2 * math.pi - sweep) * radius <= END_POINT_TOLERANCE:
        sweep = 2 * math.pi
    return CircularPath(motion.plane, centre, radius, start_angle, sweep, sense)


def _sense(direction: str) -> int:
    return 1 if direction == "counterclockwise" else -1
