"""Arcs and circles in the plane of two axes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import chain, pairwise
from math import pi
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, StrictInt, field_validator, model_validator

from feedsim.files.fields import AxisName, Quantity, fault
from feedsim.foundation.errors import InputError
from feedsim.motions.kind import Array, Course, Geometry, HeldPoints, JoinedPoints, Peaks, Start, whole_cycles
from feedsim.motions.move import Path, PathMotion, Position, steady_phase
from feedsim.motions.profile import Profile

Direction = Literal["counterclockwise", "clockwise"]
# Sense of a turn -> its word: +1 from the first axis towards the second.
SENSE_WORDS: dict[int, Direction] = {1: "counterclockwise", -1: "clockwise"}

# How far an arc's programmed end point may lie off the circle through its start [m]; it then ends on the circle.
END_POINT_TOLERANCE = 1e-6
# Phases of the profile may be shorter than a cycle; the peak of the combined acceleration lies within one.
POINTS_PER_PHASE = 33
# Instants that are looked at together: a long circle has millions.
INSTANTS = 1 << 15
# Rest [s] between a circle and the same one in the other direction: what the stop leaves dies away in it.
REST_BETWEEN_CIRCLES = 0.3


class PlaneMotion(PathMotion):
    """A motion in the plane of two axes. Counterclockwise turns from the first axis towards the second."""

    plane: tuple[AxisName, AxisName] = Field(description="First and second axis of the plane, for example [X, Z]")

    @field_validator("plane")
    @classmethod
    def _two_axes(cls, plane: tuple[str, str]) -> tuple[str, str]:
        if plane[0] == plane[1]:
            raise fault(f"a plane needs two different axes, not {plane[0]} twice")
        return plane

    @property
    def axes(self) -> tuple[str, ...]:
        return self.plane


def _sense(direction: Direction) -> int:
    return {word: sense for sense, word in SENSE_WORDS.items()}[direction]


class Arc(PlaneMotion):
    """A circular arc from where the axes are, about a centre, to an end point or through an angle."""

    kind: Literal["arc"] = "arc"
    direction: Direction = Field(
        default="counterclockwise", description="Counterclockwise turns the first axis towards the second"
    )
    centre: dict[AxisName, Position] = Field(default={}, description="Centre, as positions of both axes of the plane")
    centre_by: dict[AxisName, Position] = Field(default={}, description="Centre, relative to the start of the arc")
    to: dict[AxisName, Position] = Field(default={}, description="End point, as positions of both axes of the plane")
    by: dict[AxisName, Position] = Field(default={}, description="End point, relative to the start of the arc")
    angle: Annotated[float, Quantity("rad", above=0, example="90 deg")] | None = Field(
        default=None, description="Angle through which the arc turns, in place of an end point"
    )

    @model_validator(mode="after")
    def _check_centre_and_end(self) -> Self:
        if bool(self.centre) == bool(self.centre_by):
            raise fault("an arc needs its centre once: 'centre' (positions) or 'centre_by' (from its start)")
        if [bool(self.to), bool(self.by), self.angle is not None].count(True) != 1:
            raise fault("an arc needs its end once: 'to' (positions), 'by' (from its start) or 'angle'")
        for name in ("centre", "centre_by", "to", "by"):
            point = getattr(self, name)
            if point and set(point) != set(self.plane):
                raise fault(f"{name!r} must give {self.plane[0]} and {self.plane[1]}, the axes of the plane")
        return self

    @property
    def needs(self) -> tuple[str, ...]:
        return self.plane if self.centre or self.to else ()

    @property
    def ends(self) -> Mapping[str, float]:
        return self.to

    @property
    def description(self) -> str:
        return f"arc in {self.plane[0]}-{self.plane[1]}, {self.direction}, {self.at_feed}"

    def path(self, position: Mapping[str, float]) -> CircularPath:
        """Path of the arc. An end point equal to the start means a full turn.

        Raises InputError: centre on the start, or end point off the circle about the centre through the start.
        """
        first, second = self.plane
        sense = _sense(self.direction)
        offset = self.centre_by or {axis: self.centre[axis] - position[axis] for axis in self.plane}
        centre = (position[first] + offset[first], position[second] + offset[second])
        radius = math.hypot(offset[first], offset[second])
        if radius < END_POINT_TOLERANCE:
            raise InputError(
                f"the centre of the arc lies {radius * 1e6:.4g} um from its start; "
                f"allowed: {END_POINT_TOLERANCE * 1e6:g} um or more"
            )
        start_angle = math.atan2(-offset[second], -offset[first])
        if self.angle is not None:
            return CircularPath(self.plane, centre, radius, start_angle, self.angle, sense)
        end = self.to or {axis: position[axis] + self.by[axis] for axis in self.plane}
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
        return CircularPath(self.plane, centre, radius, start_angle, sweep, sense)


class Circle(PlaneMotion):
    """Full circles that begin and end where the axes are."""

    returns: ClassVar[bool] = True
    kind: Literal["circle"] = "circle"
    direction: Literal["counterclockwise", "clockwise", "both"] = Field(
        default="counterclockwise",
        description="Counterclockwise turns the first axis towards the second; both: so first, then clockwise",
    )
    radius: Annotated[float, Quantity("m", above=0, example="15 mm")] = Field(description="Radius")
    turns: Annotated[StrictInt, Field(ge=1, le=100_000)] = Field(default=1, description="Number of full turns")
    start_angle: Annotated[float, Quantity("rad", minimum=-2 * pi, maximum=2 * pi, example="0 deg")] = Field(
        default=0.0, description="Direction from the centre to the start, from the first axis towards the second"
    )

    @property
    def description(self) -> str:
        turns = f"{self.turns} turn{'s'[: self.turns != 1]}"
        way = "counterclockwise, then clockwise" if self.direction == "both" else self.direction
        text = " each" if self.direction == "both" else ""
        plane = f"{self.plane[0]}-{self.plane[1]}"
        return f"circle in {plane}, {way}, R {self.radius * 1e3:.6g} mm, {turns}{text}, {self.at_feed}"

    def path(self, position: Mapping[str, float]) -> CircularPath:
        """Path of the circle; its start lies at its start angle."""
        first, second = self.plane
        centre = (
            position[first] - self.radius * math.cos(self.start_angle),
            position[second] - self.radius * math.sin(self.start_angle),
        )
        sense = 1 if self.direction == "both" else _sense(self.direction)
        return CircularPath(self.plane, centre, self.radius, self.start_angle, 2 * math.pi * self.turns, sense)

    def target(self, path: Path) -> dict[str, float]:
        return {}

    def plan(self, start: Start) -> Course:
        there = super().plan(start)
        if self.direction != "both":
            return there
        pause = whole_cycles(REST_BETWEEN_CIRCLES, start.T_ipo)
        begin = there.cycles + pause
        clockwise = self.model_copy(update={"direction": "clockwise"})
        again = clockwise.plan(
            replace(start, time=start.time + begin * start.T_ipo, most=max(start.most - begin, 0))
        )  # fmt: skip
        geometry = there.geometry
        assert isinstance(geometry, Circular)
        assert isinstance(again.geometry, Circular)
        return replace(
            there,
            duration=begin * start.T_ipo + again.duration,
            cycles=begin + again.cycles,
            points={
                axis: JoinedPoints([points, HeldPoints(start.position[axis], pause), again.points[axis]])
                for axis, points in there.points.items()
            },
            peaks={axis: there.peaks[axis].with_(again.peaks[axis]) for axis in again.peaks},
            geometry=replace(geometry, back=again.geometry),
        )


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
        return self.axes

    @property
    def length(self) -> float:
        return self.radius * self.sweep

    def angle(self, s: Array) -> Array:
        """Angle about the centre [rad] at path lengths ``s`` (N,) [m]."""
        return self.start_angle + self.sense * s / self.radius

    def position(self, s: Array) -> dict[str, Array]:
        phi = self.angle(s)
        return {
            self.axes[0]: self.centre[0] + self.radius * np.cos(phi),
            self.axes[1]: self.centre[1] + self.radius * np.sin(phi),
        }

    def peaks(self, profile: Profile, step: float) -> dict[str, Peaks]:
        """Peaks of both axes. The path is looked at every ``step`` [s], at 33 instants of every phase of the profile,
        where the path speed is at an extreme, and where an axis is at an extreme of its motion.

        Acceleration is the axis' share of tangential acceleration and centripetal acceleration v^2/R together.
        """
        within_phases = np.linspace(profile.times[:-1], profile.times[1:], POINTS_PER_PHASE).ravel()
        special = np.concatenate([within_phases, profile.turning_points, self._crossings(profile)])
        on_grid = math.ceil(profile.duration / step)
        stretches = (
            np.arange(first, min(first + INSTANTS, on_grid), dtype=np.float64) * step
            for first in range(0, on_grid, INSTANTS)
        )
        result = dict.fromkeys(self.axes, Peaks(math.inf, -math.inf, 0.0, 0.0))
        for t in chain([special], stretches):
            for axis, now in self._peaks_at(profile, t).items():
                result[axis] = result[axis].with_(now)
        return result

    def _peaks_at(self, profile: Profile, t: Array) -> dict[str, Peaks]:
        """The same at the instants ``t`` [s] alone."""
        s, v, a = profile.at(t)
        phi = self.angle(s)
        tangent = (-self.sense * np.sin(phi), self.sense * np.cos(phi))
        inward = (-np.cos(phi), -np.sin(phi))
        peaks = {}
        for axis, x, along, towards in zip(self.axes, self.position(s).values(), tangent, inward, strict=True):
            acceleration = a * along + v**2 / self.radius * towards
            largest = float(np.abs(v * along).max()), float(np.abs(acceleration).max())
            peaks[axis] = Peaks(float(x.min()), float(x.max()), *largest)
        return peaks

    def _crossings(self, profile: Profile) -> Array:
        """Instants [s] at which the path crosses a half axis of its circle."""
        quarter = math.pi / 2
        begin = self.sense * self.start_angle / quarter
        crossed = np.arange(math.ceil(begin), math.floor(begin + self.sweep / quarter) + 1, dtype=np.float64) * quarter
        return profile.time_at((crossed - self.sense * self.start_angle) * self.radius)

    def geometry(self, profile: Profile, start: float) -> Circular:
        turns = math.floor(self.sweep / (2 * math.pi) + 1e-9)
        instants = start + profile.time_at(self.radius * (2 * math.pi * np.arange(turns + 1, dtype=np.float64)))
        return Circular(
            axes=self.axes,
            centre=self.centre,
            radius=self.radius,
            sense=self.sense,
            start_angle=self.start_angle,
            sweep=self.sweep,
            turns=tuple(pairwise(instants.tolist())),
            steady=steady_phase(profile, start),
            turn_time=_turn_time(profile, 2 * math.pi * self.radius),
        )


def _turn_time(profile: Profile, length: float) -> float:
    return length / float(profile.velocity.max())


@dataclass(frozen=True)
class Circular(Geometry):
    """Circular path in the plane of two axes."""

    axes: tuple[str, str]
    """First and second axis of the plane; angles run from the first towards the second."""
    centre: tuple[float, float]
    """Programmed centre [m], first and second axis."""
    radius: float
    """Programmed radius [m]."""
    sense: int
    """+1 counterclockwise (from the first axis towards the second), -1 clockwise."""
    start_angle: float
    """Angle of the start as seen from the centre [rad]."""
    sweep: float
    """Angle that the path covers, positive [rad]."""
    turns: tuple[tuple[float, float], ...]
    """Begin and end of every full turn [s], program time: where the path length is a multiple of 2 pi R."""
    steady: tuple[float, float] | None
    """Begin and end of the constant-speed phase [s], program time; None where there is none."""
    turn_time: float | None
    """Duration of a full turn at the highest speed of the path [s]; None where the path is known by its setpoints."""
    back: Circular | None = None
    """The same circle in the other sense, driven behind this one; None where there is none."""

    @property
    def text(self) -> str:
        turns = f" ({len(self.turns)} full turn{'s'[: len(self.turns) != 1]})" if self.turns else ""
        both = ", and back" if self.back is not None else ""
        return f"R {self.radius * 1e3:.6g} mm, {math.degrees(self.sweep):.6g}°{turns}{both}"
