"""Targets of an axis, approached from both sides again and again: the standard test cycle of ISO 230-2."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, StrictInt, Tag, model_validator

from feedsim.files.fields import AxisName, Model, Quantity, fault
from feedsim.motions.kind import LIST_OR_RANGE, Array, Course, Geometry, MotionKind, Peaks, Start, in_turn
from feedsim.motions.move import Position
from feedsim.motions.profile import rest_to_rest


class TargetRange(Model):
    """Targets at equal distances, both ends included."""

    first: Position = Field(alias="from", description="First target")
    last: Position = Field(alias="to", description="Last target")
    count: Annotated[StrictInt, Field(ge=2, le=1000)] = Field(default=5, description="Number of targets")


Targets = Annotated[
    Annotated[Annotated[tuple[Position, ...], Field(min_length=2)], Tag("[list]")]
    | Annotated[TargetRange, Tag("[range]")],
    LIST_OR_RANGE,
]


class PositioningCycle(MotionKind):
    """Targets of an axis, approached from both sides again and again: the standard test cycle of ISO 230-2."""

    kind: Literal["positioning_cycle"] = "positioning_cycle"
    axis: AxisName = Field(description="Axis that moves")
    targets: Targets = Field(
        description="List of positions, or {from: ..., to: ..., count: ...} at equal distances; the standard has them "
        "at slightly unequal ones, so that periodic errors are not met at the same phase"
    )
    runs: Annotated[StrictInt, Field(ge=2, le=1000)] = Field(
        default=5, description="Approaches of every target from either side"
    )
    overrun: Annotated[float, Quantity("m", above=0, example="5 mm")] = Field(
        default=5e-3, description="Way beyond the outermost targets, behind which the axis turns back"
    )
    feed: Annotated[float, Quantity("m/s", above=0, example="10 m/min")] = Field(description="Speed of the approaches")
    rest: Annotated[float, Quantity("s", above=0, example="0.5 s")] = Field(
        default=0.5, description="Time at rest on every target; the position counts at its end"
    )
    acceleration: Annotated[float, Quantity("m/s^2", above=0)] | None = Field(
        default=None, description="Highest acceleration in place of the machine's"
    )
    jerk: Annotated[float, Quantity("m/s^3", above=0)] | None = Field(
        default=None, description="Highest jerk in place of the machine's"
    )

    @model_validator(mode="after")
    def _check_targets_differ(self) -> Self:
        for before, after in pairwise(self.positions):
            if before == after:
                raise fault(f"the target {1e3 * before:.9g} mm is given twice")
        return self

    @property
    def positions(self) -> tuple[float, ...]:
        """Targets [m], from the lowest to the highest."""
        if isinstance(self.targets, TargetRange):
            ends = self.targets.first, self.targets.last
            return tuple(map(float, np.linspace(min(ends), max(ends), self.targets.count)))
        return tuple(sorted(self.targets))

    @property
    def axes(self) -> tuple[str, ...]:
        return (self.axis,)

    @property
    def needs(self) -> tuple[str, ...]:
        return (self.axis,)

    @property
    def ends(self) -> Mapping[str, float]:
        return {self.axis: self.positions[0] - self.overrun}

    @property
    def description(self) -> str:
        low, high = (1e3 * end for end in (self.positions[0], self.positions[-1]))
        return (
            f"positioning cycle of {self.axis}: {len(self.positions)} targets from {low:.6g} to {high:.6g} mm, "
            f"{self.runs} times from either side at {6e4 * self.feed:.6g} mm/min"
        )

    def plan(self, start: Start) -> Course:
        """To behind the first target, up and beyond the last one, down again, and so on; at rest on each.

        Raises InputError where it lasts too long.
        """
        targets = self.positions
        up, down = [*targets, targets[-1] + self.overrun], [*targets[::-1], targets[0] - self.overrun]
        way = [start.position[self.axis], targets[0] - self.overrun, *(up + down) * self.runs]
        limits = self.feed, self.acceleration or start.acceleration, self.jerk or start.jerk
        profiles = [rest_to_rest(abs(there - here), *limits) for here, there in pairwise(way)]
        turns = in_turn([profile.duration for profile in profiles], self.rest, start)
        parts: list[Array] = []
        visits: list[Visit] = []
        counts = dict.fromkeys(((target, sense) for target in targets for sense in (1, -1)), 0)
        for (here, there), profile, (begin, count, pause) in zip(pairwise(way), profiles, turns, strict=True):
            sense = 1 if there > here else -1
            covered = profile.at(np.arange(1, count + 1, dtype=np.float64) * start.T_ipo)[0]
            points = here + sense * covered
            points[-1:] = there  # it is met without a rounding error
            parts += [points, np.full(pause, there)]
            if (there, sense) in counts:
                ended = begin + count * start.T_ipo
                visits.append(Visit(there, sense, counts[there, sense], ended, ended + pause * start.T_ipo))
                counts[there, sense] += 1
        return Course(
            duration=turns[-1][0] + profiles[-1].duration - start.time,
            cycles=sum(map(len, parts)),
            points={self.axis: np.concatenate(parts)},
            peaks={
                self.axis: Peaks(
                    low=min(way), high=max(way),
                    speed=max(profile.peak_speed for profile in profiles),
                    acceleration=max(profile.peak_acceleration for profile in profiles),
                )
            },
            target={self.axis: way[-1]},
            absolute=True,
            moving=(self.axis,),
            geometry=Visits(self.axis, targets, self.runs, tuple(visits)),
        )  # fmt: skip


@dataclass(frozen=True)
class Visit:
    """An approach of a target, and the rest on it.

    Attributes:
        target: programmed position [m]. sense: +1 from below, -1 from above. run: from 0.
        begin, end: of the rest [s], program time.
    """

    target: float
    sense: int
    run: int
    begin: float
    end: float


@dataclass(frozen=True)
class Visits(Geometry):
    """Approaches of an axis, in the order in which they are driven; its targets [m], from the lowest to the highest."""

    axis: str
    targets: tuple[float, ...]
    runs: int
    visits: tuple[Visit, ...]

    @property
    def text(self) -> str:
        return f"{len(self.visits)} approaches"
