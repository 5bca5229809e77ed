"""What a kind of motion is: its fields, what the planner asks of it, and what it answers."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import Discriminator

from feedsim.files.fields import Model
from feedsim.foundation.errors import InputError

if TYPE_CHECKING:
    from feedsim.motions.planner import Limits


Array = NDArray[np.float64]

# An instant within this share of a cycle of the grid lies on it: exact ends carry rounding errors.
ON_GRID = 1e-6


# Tells values that are a list ("[list]") from those that are {from: ..., to: ..., count: ...} ("[range]").
LIST_OR_RANGE = Discriminator(lambda value: "[range]" if isinstance(value, (dict, Model)) else "[list]")


class MotionKind(Model):
    """Base of the kinds: a subclass has its fields, a field ``kind`` with its name, and answers what follows."""

    returns: ClassVar[bool] = False
    """Whether it ends where it begins."""
    names_axes: ClassVar[bool] = True
    """Whether its fields name the axes that it moves; else any may move, as its plan has it."""

    @property
    def axes(self) -> tuple[str, ...]:
        """Axes that it names, in its order."""
        return ()

    @property
    def needs(self) -> tuple[str, ...]:
        """Axes whose positions at its start decide what it does: without them nothing can be said of it."""
        return ()

    @property
    def ends(self) -> Mapping[str, float]:
        """Axis -> position [m] where its fields alone say that it ends."""
        return {}

    @property
    def held(self) -> float:
        """Time [s] for which all axes are held before one moves."""
        return 0.0

    @property
    def files(self) -> Mapping[str, Path]:
        """Field -> file of data that it names."""
        return {name: value for name in type(self).model_fields if isinstance(value := getattr(self, name), Path)}

    @property
    @abstractmethod
    def description(self) -> str:
        """It in a line of a report."""

    @abstractmethod
    def plan(self, start: Start) -> Course:
        """Its course from ``start``.

        Raises InputError that lists everything for which it cannot be driven. Limits of the axes are the planner's
        matter, which compares them with the course.
        """


@dataclass(frozen=True)
class Start:
    """Where and when a motion begins, and what it is planned with.

    Attributes:
        position: of all axes [m].
        time: on the grid of the interpolator [s], program time.
        T_ipo, T_pos: cycles of the interpolator and of the position controller [s].
        most: cycles of the interpolator that the program has room for.
        acceleration, jerk: the machine's limits along a path [m/s2, m/s3].
        travel: axis -> lowest and highest position [m].
        limits: of axes and path, which NC programs keep.
    """

    position: Mapping[str, float]
    time: float
    T_ipo: float
    T_pos: float
    most: int
    acceleration: float
    jerk: float
    travel: Mapping[str, tuple[float, float]]
    limits: Limits | None = None


class Points(Protocol):
    """Points that may be computed when they are asked for."""

    def __len__(self) -> int: ...
    def __getitem__(self, rows: slice, /) -> Array:
        """Points of a range of rows; step 1, within the length."""


@dataclass(frozen=True)
class Peaks:
    """Least and largest position [m], largest speed [m/s] and acceleration [m/s2] (magnitudes) of an axis."""

    low: float
    high: float
    speed: float
    acceleration: float

    def with_(self, other: Peaks) -> Peaks:
        """Peaks of two stretches together."""
        return Peaks(
            min(self.low, other.low), max(self.high, other.high),
            max(self.speed, other.speed), max(self.acceleration, other.acceleration),
        )  # fmt: skip


class Geometry(ABC):
    """What figures and reports know of the way of a motion."""

    @property
    @abstractmethod
    def text(self) -> str:
        """It in a cell of a table."""


@dataclass(frozen=True, eq=False)
class Course:
    """A planned motion, from rest to rest. Axes that it says nothing of are held.

    Attributes:
        duration: exact [s].
        cycles: of the interpolator, up to its first instant at or after the end.
        points: axis -> its ``cycles`` positions [m] at the instants T_ipo, 2 T_ipo ... from the start. A spline is laid
            through them.
        peaks: of these axes.
        setpoints: axis -> position [m] and speed [m/s], (N,) each, at the instants 0, T_pos, 2 T_pos ... from the start
            up to its end: what is not interpolated but taken as it is. A motion has these or ``points``.
        target: axis -> position [m] at the end; of the axes that are then elsewhere, at least.
        absolute: the axes end there wherever they began.
        moving: axes whose setpoint moves.
        geometry: of its way; None where there is none.
    """

    duration: float
    cycles: int
    points: Mapping[str, Points] = field(default_factory=dict)
    peaks: Mapping[str, Peaks] = field(default_factory=dict)
    setpoints: Mapping[str, tuple[Array, Array]] = field(default_factory=dict)
    target: Mapping[str, float] = field(default_factory=dict)
    absolute: bool = False
    moving: tuple[str, ...] = ()
    geometry: Geometry | None = None


def whole_cycles(duration: float, cycle: float) -> int:
    """Cycles up to the first instant of the grid at or after ``duration`` [s]."""
    return max(0, math.ceil(duration / cycle - ON_GRID))


def in_turn(durations: Sequence[float], rest: float, start: Start) -> list[tuple[float, int, int]]:
    """Pieces of these ``durations`` [s] one after another, each from the grid on, with ``rest`` [s] in between.

    Of each: its begin [s, program time], its cycles of the interpolator, and those of rest behind it.
    Raises InputError where the program has no room for them.
    """
    pause = whole_cycles(rest, start.T_ipo)
    counts = [whole_cycles(duration, start.T_ipo) for duration in durations]
    total = sum(counts) + pause * len(counts)
    if total > start.most:
        raise InputError(
            f"lasts {total * start.T_ipo:.6g} s; allowed in this program: {max(start.most, 0) * start.T_ipo:.6g} s"
        )
    begins = accumulate((count + pause for count in counts[:-1]), initial=0)
    pauses = [pause] * (len(counts) - 1) + [0]
    return [
        (start.time + n * start.T_ipo, count, behind) for n, count, behind in zip(begins, counts, pauses, strict=True)
    ]


# --- Points of an axis that are computed when they are asked for: held, and one after the other -----------------------


@dataclass(frozen=True)
class HeldPoints:
    """An axis that stays at ``value`` for ``count`` points."""

    value: float
    count: int

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, rows: slice) -> Array:
        return np.full(len(range(self.count)[rows]), self.value)


class JoinedPoints:
    """Points one after the other."""

    def __init__(self, pieces: Sequence[Points]) -> None:
        self._pieces = tuple(pieces)
        self._ends = np.cumsum([len(piece) for piece in self._pieces])

    def __len__(self) -> int:
        return int(self._ends[-1])

    def __getitem__(self, rows: slice) -> Array:
        wanted = range(len(self))[rows]
        result = []
        i, first = int(np.searchsorted(self._ends, wanted.start, side="right")), wanted.start
        while first < wanted.stop:
            begin, end = int(self._ends[i]) - len(self._pieces[i]), int(self._ends[i])
            last = min(end, wanted.stop)
            result.append(self._pieces[i][first - begin : last - begin])
            i, first = i + 1, last
        return np.concatenate(result) if result else np.zeros(0)
