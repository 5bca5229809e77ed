"""A straight move of one or several axes."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal, Protocol, Self

import numpy as np
from pydantic import Field, model_validator

from feedsim.files.fields import AxisName, Quantity, fault
from feedsim.motions.kind import Array, Course, Geometry, MotionKind, Peaks, Start, whole_cycles
from feedsim.motions.profile import Profile, rest_to_rest

# --- Motions along a path that the NC plans from rest to rest: what a straight line and a circle have in common -------


Position = Annotated[float, Quantity("m")]
Feed = Annotated[float, Quantity("m/s", above=0)]


class Path(Protocol):
    """A path in the space of the axes, over its own length."""

    @property
    def axes(self) -> tuple[str, ...]:
        """Axes that the path names, those that stand among them."""

    @property
    def moving(self) -> tuple[str, ...]:
        """Axes that the path moves."""

    @property
    def length(self) -> float:
        """Length of the path [m]."""

    def position(self, s: Array) -> dict[str, Array]:
        """Axis positions [m] at path lengths ``s`` (N,) [m]."""

    def peaks(self, profile: Profile, step: float) -> dict[str, Peaks]:
        """Peaks of every axis; ``step`` [s] is the cycle of the interpolator."""

    def geometry(self, profile: Profile, start: float) -> Geometry:
        """What is handed on of a path that begins at ``start`` [s]."""


class PathMotion(MotionKind):
    """A motion along a path that the NC plans from rest to rest."""

    feed: Feed = Field(description="Programmed speed along the path")
    acceleration: Annotated[float, Quantity("m/s^2", above=0)] | None = Field(
        default=None, description="Highest acceleration along the path in place of the machine's"
    )
    jerk: Annotated[float, Quantity("m/s^3", above=0)] | None = Field(
        default=None, description="Highest jerk along the path in place of the machine's"
    )

    @abstractmethod
    def path(self, position: Mapping[str, float]) -> Path:
        """Path from the positions ``position`` [m]; InputError where there is none."""

    def target(self, path: Path) -> dict[str, float]:
        """Axis -> position [m] at the end of its path, of those that are then elsewhere."""
        return {axis: float(x[0]) for axis, x in path.position(np.array([path.length])).items()}

    @property
    def at_feed(self) -> str:
        """The programmed speed as reports show it."""
        return f"at {self.feed * 6e4:.6g} mm/min"

    def plan(self, start: Start) -> Course:
        path = self.path(start.position)
        profile = rest_to_rest(path.length, self.feed, self.acceleration or start.acceleration, self.jerk or start.jerk)
        cycles = whole_cycles(profile.duration, start.T_ipo)
        return Course(
            duration=profile.duration,
            cycles=cycles,
            points={axis: PathAxis(path, profile, axis, start.T_ipo, cycles) for axis in path.axes},
            # Looking at all of a path that is too long for the program would take long.
            peaks=path.peaks(profile, start.T_ipo) if cycles <= start.most else {},
            target=self.target(path),
            moving=path.moving,
            geometry=path.geometry(profile, start.time),
        )


@dataclass(frozen=True)
class PathAxis:
    """An axis of a path: point i is where the path is (i + 1) ``cycle`` [s] after the start of its profile."""

    path: Path
    profile: Profile
    axis: str
    cycle: float
    count: int

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, rows: slice) -> Array:
        wanted = range(self.count)[rows]
        at = np.arange(wanted.start + 1, wanted.stop + 1, dtype=np.float64) * self.cycle
        return self.path.position(self.profile.at(at)[0])[self.axis]


def steady_phase(profile: Profile, start: float) -> tuple[float, float] | None:
    """Begin and end of the constant-speed phase [s] of a profile that begins at ``start``; None where there is none."""
    return None if profile.steady is None else (start + profile.steady[0], start + profile.steady[1])


# --- A straight move of one or several axes ---------------------------------------------------------------------------


class Move(PathMotion):
    """A straight move of one or several axes."""

    kind: Literal["move"] = "move"
    by: dict[AxisName, Position] = Field(default={}, description="Distances, relative to where the axes are")
    to: dict[AxisName, Position] = Field(default={}, description="Target positions")

    @model_validator(mode="after")
    def _somewhere(self) -> Self:
        if not self.by and not self.to:
            raise fault("a move needs 'by' (distances) or 'to' (positions), for example by: {Z: 100 mm}")
        if both := sorted(set(self.by) & set(self.to)):
            raise fault(f"axis {both[0]} stands in 'by' and in 'to'; one of them is meant")
        return self

    @property
    def axes(self) -> tuple[str, ...]:
        return (*self.by, *self.to)

    @property
    def needs(self) -> tuple[str, ...]:
        return tuple(self.to)

    @property
    def ends(self) -> Mapping[str, float]:
        return self.to

    @property
    def description(self) -> str:
        by = [f"{axis} by {d * 1e3:.6g} mm" for axis, d in self.by.items()]
        to = [f"{axis} to {x * 1e3:.6g} mm" for axis, x in self.to.items()]
        return f"move {', '.join(by + to)} {self.at_feed}"

    def path(self, position: Mapping[str, float]) -> Line:
        distance = {axis: d for axis, d in self.by.items()} | {axis: x - position[axis] for axis, x in self.to.items()}
        length = math.sqrt(sum(d * d for d in distance.values()))
        direction = {axis: d / length if length > 0 else 0.0 for axis, d in distance.items()}
        return Line(dict(position), direction, length)

    def target(self, path: Path) -> dict[str, float]:
        return super().target(path) | self.to  # to the last digit


@dataclass(frozen=True)
class Line:
    """Straight line; ``direction`` has length 1 (or 0 where nothing moves) over the axes that it names."""

    origin: Mapping[str, float]
    direction: Mapping[str, float]
    length: float

    @property
    def axes(self) -> tuple[str, ...]:
        return tuple(self.direction)

    @property
    def moving(self) -> tuple[str, ...]:
        return tuple(axis for axis, share in self.direction.items() if share != 0)

    def position(self, s: Array) -> dict[str, Array]:
        return {axis: self.origin[axis] + share * s for axis, share in self.direction.items()}

    def peaks(self, profile: Profile, step: float) -> dict[str, Peaks]:
        result = {}
        for axis, share in self.direction.items():
            ends = (self.origin[axis], self.origin[axis] + share * self.length)
            speed, acceleration = abs(share) * profile.peak_speed, abs(share) * profile.peak_acceleration
            result[axis] = Peaks(min(ends), max(ends), speed, acceleration)
        return result

    def geometry(self, profile: Profile, start: float) -> Straight:
        return Straight(self.length, steady_phase(profile, start))


@dataclass(frozen=True)
class Straight(Geometry):
    """Straight line in the space of the axes."""

    length: float
    """Length of the path [m]."""
    steady: tuple[float, float] | None
    """Begin and end of the constant-speed phase [s], program time; None where there is none."""

    @property
    def text(self) -> str:
        return f"length {self.length * 1e3:.6g} mm"
