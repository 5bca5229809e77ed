"""A straight move of one or several axes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, Self

from pydantic import Field, model_validator

from feedsim.fields import AxisName, fault
from feedsim.motions.kind import Array, Geometry, Peaks
from feedsim.motions.path import Path, PathMotion, Position, steady
from feedsim.motions.profile import Profile


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
        return Straight(self.length, steady(profile, start))


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
