"""Strokes at constant speeds, there and back, as long as the experiment asks and the travel allows."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, StrictInt, Tag, model_validator

from feedsim.files.fields import AxisName, Model, Quantity, fault
from feedsim.foundation.errors import InputError
from feedsim.motions.kind import LIST_OR_RANGE, Array, Course, Geometry, MotionKind, Peaks, Start, in_turn
from feedsim.motions.profile import Profile, rest_to_rest

# Time at constant speed [s] below which a stroke says nothing of the stationary friction: the drive settles in it.
MIN_CONSTANT_TIME = 0.1

Speed = Annotated[float, Quantity("m/s", above=0)]


class SpeedRange(Model):
    """Speeds in equal ratios, both ends included."""

    first: Speed = Field(alias="from", description="First speed")
    last: Speed = Field(alias="to", description="Last speed")
    count: Annotated[StrictInt, Field(ge=2, le=1000)] = Field(default=12, description="Number of speeds")

    @model_validator(mode="after")
    def _a_range(self) -> Self:
        if self.first == self.last:
            raise fault(f"'from' and 'to' are both {self.first:.9g} m/s; give a list for a single speed")
        return self


Speeds = Annotated[
    Annotated[Annotated[tuple[Speed, ...], Field(min_length=1)], Tag("[list]")] | Annotated[SpeedRange, Tag("[range]")],
    LIST_OR_RANGE,
]


class ConstantSpeed(MotionKind):
    """Strokes at constant speeds, there and back: what the stationary friction torque is identified from."""

    returns: ClassVar[bool] = True
    kind: Literal["constant_speed"] = "constant_speed"
    axis: AxisName = Field(description="Axis that moves")
    speeds: Speeds = Field(description="List of speeds, or {from: ..., to: ..., count: ...} in equal ratios")
    duration: Annotated[float, Quantity("s", above=0, example="1 s")] = Field(
        default=1.0, description="Least time at constant speed, as far as the travel allows"
    )
    distance: Annotated[float, Quantity("m", above=0, example="1 mm")] = Field(
        default=1e-3, description="Least travel at constant speed: slow strokes last longer"
    )
    stroke: Annotated[float, Quantity("m", above=0, example="200 mm")] | None = Field(
        default=None, description="Longest stroke (default: from where the axis is to the farther end of its travel)"
    )
    rest: Annotated[float, Quantity("s", minimum=0, example="0.2 s")] = Field(
        default=0.2, description="Time at rest between strokes"
    )
    acceleration: Annotated[float, Quantity("m/s^2", above=0)] | None = Field(
        default=None, description="Highest acceleration in place of the machine's"
    )
    jerk: Annotated[float, Quantity("m/s^3", above=0)] | None = Field(
        default=None, description="Highest jerk in place of the machine's"
    )

    @property
    def feeds(self) -> tuple[float, ...]:
        """Speeds [m/s] in the order in which they are driven."""
        if isinstance(self.speeds, SpeedRange):
            spaced = np.geomspace(self.speeds.first, self.speeds.last, self.speeds.count)
            return (self.speeds.first, *map(float, spaced[1:-1]), self.speeds.last)
        return self.speeds

    @property
    def axes(self) -> tuple[str, ...]:
        return (self.axis,)

    @property
    def needs(self) -> tuple[str, ...]:
        return (self.axis,)

    @property
    def description(self) -> str:
        feeds = [feed * 6e4 for feed in self.feeds]
        return f"constant speeds of {self.axis}: {len(feeds)}, {min(feeds):.6g} to {max(feeds):.6g} mm/min"

    def plan(self, start: Start) -> Course:
        """Strokes towards the side with more room, each back again before the next speed.

        Every stroke starts on the grid of the interpolator. Raises InputError that lists every speed for which there is
        not travel enough; or where they last too long.
        """
        here, cycle = start.position[self.axis], start.T_ipo
        least, most = start.travel[self.axis]
        below, above = here - least, most - here
        side = 1.0 if above >= below else -1.0
        profiles = self._profiles(start, max(above, below, 0.0))
        strokes = [(profile, sense) for profile in profiles for sense in (side, -side)]
        turns = in_turn([profile.duration for profile, _ in strokes], self.rest, start)
        parts: list[Array] = []
        done: list[Stroke] = []
        reached = 0.0
        for (profile, sense), (begin, count, pause) in zip(strokes, turns, strict=True):
            covered = profile.at(np.arange(1, count + 1, dtype=np.float64) * cycle)[0]
            target = reached + sense * profile.length if sense == side else 0.0
            points = reached + sense * covered
            points[-1] = target  # the way back meets the start without a rounding error
            parts += [points, np.full(pause, target)]
            begun, ended = _steady_phase(profile)
            done.append(
                Stroke(
                    speed=sense * profile.peak_speed,
                    steady=(begin + begun, begin + ended),
                    start=begin,
                    end=begin + profile.duration,
                )
            )
            reached = target
        longest = max(profile.length for profile in profiles)
        return Course(
            duration=done[-1].end - start.time,
            cycles=sum(map(len, parts)),
            points={self.axis: here + np.concatenate(parts)},
            peaks={
                self.axis: Peaks(
                    low=here + min(0.0, side * longest),
                    high=here + max(0.0, side * longest),
                    speed=max(profile.peak_speed for profile in profiles),
                    acceleration=max(profile.peak_acceleration for profile in profiles),
                )
            },
            moving=(self.axis,),
            geometry=Strokes(self.axis, tuple(done)),
        )

    def _profiles(self, start: Start, travel: float) -> list[Profile]:
        """Profile of every speed's stroke, where there are ``travel`` [m] to the farther side."""
        room = travel if self.stroke is None else min(travel, self.stroke)
        acceleration, jerk = self.acceleration or start.acceleration, self.jerk or start.jerk
        profiles, problems = [], []
        for speed in self.feeds:
            ramp = ramp_time(speed, acceleration, jerk)
            at_speed = min(max(self.duration, self.distance / speed), room / speed - ramp)
            wanted = min(MIN_CONSTANT_TIME, self.duration)
            if at_speed >= wanted:
                profiles.append(rest_to_rest(speed * (ramp + at_speed), speed, acceleration, jerk))
                continue
            problems.append(
                f"axis {self.axis} needs {speed * (wanted + ramp) * 1e3:.5g} mm for {wanted:.3g} s at "
                f"{speed * 6e4:.6g} mm/min and for getting to that speed and back to rest; there are "
                f"{room * 1e3:.5g} mm{self._whose(room)}"
            )
        if problems:
            raise InputError.of(f"axis {self.axis} has not travel enough", problems)
        return profiles

    def _whose(self, room: float) -> str:
        if self.stroke is not None and room == self.stroke:
            return " (stroke); allow a longer one or leave it out"
        return " up to the farther end of the travel; begin nearer to an end, or move slower"


def ramp_time(speed: float, acceleration: float, jerk: float) -> float:
    """Shortest time [s] from rest to ``speed`` [m/s] within limits of acceleration [m/s2] and jerk [m/s3].

    The distance is half of speed times this time, since the speed rises point-symmetrically.
    """
    if speed * jerk <= acceleration**2:
        return 2 * math.sqrt(speed / jerk)
    return speed / acceleration + acceleration / jerk


def _steady_phase(profile: Profile) -> tuple[float, float]:
    if profile.steady is None:  # the stroke is made for one
        raise InputError(f"no phase of constant speed in a stroke of {profile.length:g} m")
    return profile.steady


@dataclass(frozen=True)
class Stroke:
    """A move at constant speed, from rest to rest."""

    speed: float
    """Constant speed [m/s], signed."""
    steady: tuple[float, float]
    """Begin and end of the constant speed [s], program time."""
    start: float
    end: float
    """Exact begin and end of the stroke [s], program time."""


@dataclass(frozen=True)
class Strokes(Geometry):
    """Strokes of an axis there and back, in the order in which they are driven."""

    axis: str
    strokes: tuple[Stroke, ...]

    @property
    def text(self) -> str:
        shortest = min(stroke.steady[1] - stroke.steady[0] for stroke in self.strokes)
        return f"{len(self.strokes)} strokes, {shortest:.3g} s or more at constant speed"
