"""What the planner hands on about each motion: when it runs, where it begins and ends, and its geometry."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from feedsim.motions.kind import Array, Geometry
from feedsim.trace import least_and_largest


@dataclass(frozen=True)
class Segment:
    """One motion of the program.

    kind: that of the motion, as scenarios name it; index: its place in the scenario's list, from 0; start, end: exact
    begin and end of the motion [s], the start on the T_ipo grid; origin, target: positions of all axes there [m]; axes:
    those whose setpoint it moves; geometry: None for a dwell.
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

    @property
    def way(self) -> str:
        """Its way in a cell of a table; empty for a dwell."""
        return "" if self.geometry is None else self.geometry.text


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
