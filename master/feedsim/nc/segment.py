"""What the planner hands on about each motion: when it runs, where it begins and ends, and its geometry."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feedsim.trace import least_and_largest

Array = NDArray[np.float64]

# An instant within this share of a cycle of the grid lies on it: exact ends carry rounding errors.
ON_GRID = 1e-6


def whole_cycles(duration: float, cycle: float) -> int:
    """Cycles up to the first instant of the grid at or after ``duration`` [s]."""
    return max(0, math.ceil(duration / cycle - ON_GRID))


@dataclass(frozen=True)
class Straight:
    """Straight line in the space of the axes."""

    length: float
    """Length of the path [m]."""
    steady: tuple[float, float] | None
    """Begin and end of the constant-speed phase [s], program time; None where there is none."""


@dataclass(frozen=True)
class Circular:
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


@dataclass(frozen=True)
class Recorded:
    """Recorded setpoints.

    begin, end: instants [s] of the recording's first and last row; a run-in lies ahead, a run-out behind.
    """

    begin: float
    end: float
    file: Path
    axes: tuple[str, ...]
    """Axes with a column of their own."""


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
class Strokes:
    """Strokes of an axis there and back, in the order in which they are driven."""

    axis: str
    strokes: tuple[Stroke, ...]


@dataclass(frozen=True)
class Oscillation:
    """A sine, amplitude sin(2 pi frequency (t - full[0]) + phase) about where the axis was while at full amplitude."""

    amplitude: float
    """Amplitude [m]."""
    frequency: float
    """Frequency [Hz]."""
    phase: float
    """Phase at the begin of the full amplitude [rad]."""
    full: tuple[float, float]
    """Begin and end of the full amplitude [s], program time."""
    start: float
    end: float
    """Exact begin and end with the fading [s], program time."""


@dataclass(frozen=True)
class Oscillations:
    """Sines of an axis, in the order in which they are driven."""

    axis: str
    moves: tuple[Oscillation, ...]


Geometry = Straight | Circular | Recorded | Strokes | Oscillations


@dataclass(frozen=True)
class Segment:
    """One motion of the program.

    kind: that of the motion (move, arc, circle, dwell, setpoints, constant_speed, sine); index: its place in the
    scenario's list, from 0; start, end: exact begin and end of the motion [s], the start on the T_ipo grid; origin,
    target: positions of all axes there [m]; axes: those whose setpoint it moves; geometry: None for a dwell.
    """

    kind: str
    index: int
    start: float
    end: float
    description: str
    origin: Mapping[str, float]
    target: Mapping[str, float]
    axes: tuple[str, ...] = ()
    geometry: Geometry | None = None

    @property
    def duration(self) -> float:
        """Exact duration [s]."""
        return self.end - self.start


@dataclass(frozen=True, eq=False)
class Program:
    """Setpoints of all axes at the position cycle.

    time (N,) [s]: multiples of T_pos from 0; x_s, n_ffw: axis -> (N,) [m], [rad/s]; segments: one per motion.
    Of a long program the arrays are in a file and read page by page (:mod:`feedsim.trace.table`).
    """

    time: Array
    x_s: Mapping[str, Array]
    n_ffw: Mapping[str, Array]
    segments: tuple[Segment, ...] = field(default=())

    @property
    def duration(self) -> float:
        """Last instant of the program [s]."""
        return float(self.time[-1])

    def reached(self, axis: str) -> tuple[float, float]:
        """Least and largest setpoint of an axis [m]."""
        return least_and_largest(self.x_s[axis])

    def following(self, segment: Segment, axis: str) -> Segment | None:
        """The next motion behind ``segment`` that moves the setpoint of ``axis``; None where there is none."""
        return next((other for other in self.segments[segment.index + 1 :] if axis in other.axes), None)

    def until(self, segment: Segment, axis: str) -> float:
        """Last instant [s] at which ``axis`` stands where ``segment`` took it: the start of its next motion.

        Dwells belong to it, and so do motions of other axes: what they do to an axis at rest is coupling.
        """
        later = self.following(segment, axis)
        return self.duration if later is None else later.start
