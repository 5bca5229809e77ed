"""Plan a scenario's motions: from the courses of its motions to setpoints at the position cycle.

Every motion runs from rest to rest and plans its own course (:mod:`feedsim.motions`). It starts on the T_ipo grid: at
0, or at the first instant of the grid at or after the exact end of the motion before it. Its course is sampled at
T_ipo, and one C2 cubic spline per axis runs through the samples of all motions (from one recording to the next, where
there are recordings). Setpoints are its values at T_pos. They are computed stretch by stretch, so that planning needs
no more memory for an hour than for a minute.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feedsim.files.trace import Table, least_and_largest
from feedsim.foundation.errors import InputError
from feedsim.motions import Motion
from feedsim.motions.kind import Array, Course, Geometry, HeldPoints, JoinedPoints, Peaks, Points, Start
from feedsim.scenario import Axis, Machine, Scenario

# --- One C2 cubic spline through equidistant points, at rest on both sides --------------------------------------------
# The interpolator hands points to the position controllers every T_ipo; between them the drives see a cubic spline. A
# global spline has continuous acceleration (a local one, Catmull-Rom, has not, and moves the overshoot by several per
# cent). The points are extended by rest points on both sides; there the spline is clamped to speed zero.


# A disturbance of a cubic spline decays by 2 - sqrt(3) = 0.268 per knot: after 28 knots it is below 1e-16 of its size.
REST_POINTS = 28
# Points between which a spline is solved at a time, and how far it then reaches on to either side: what begins
# differently there is the same to the last bit long before.
SPLINE_POINTS, SPLINE_OVERLAP = 1 << 14, 96


class RestSpline:
    """C2 cubic spline through ``points`` (K + 1,) at the instants 0, step, ... K step [s].

    knots: first and last knot that it is needed for, those outside the points being at rest; default: all of them.
    """

    def __init__(self, points: Points, step: float, knots: tuple[int, int] | None = None) -> None:
        count = len(points)
        first, last = knots or (-REST_POINTS, count + REST_POINTS - 1)
        self._step = step
        within = points[max(first, 0) : min(last + 1, count)]
        self._origin = float(points[0:1][0])
        self._constant = knots is None and bool(np.all(within == self._origin))
        if self._constant:
            return
        before = np.full(max(0, -first), self._origin)
        after = np.full(max(0, last + 1 - count), points[count - 1 : count][0])
        # Knots are whole numbers, so that a long program loses no digits in the differences of instants.
        self._knots = first, last
        # Deviations from the first point keep the digits of a small motion far from the origin.
        self._pieces = _clamped_spline(np.concatenate([before, within, after]) - self._origin)

    def __call__(self, time: Array) -> tuple[Array, Array]:
        """Position [unit of the points] and speed [per s] at ``time`` (N,) [s], at rest outside the points."""
        if self._constant:
            return np.full(len(time), self._origin), np.zeros(len(time))
        first, last = self._knots
        knot = np.clip(time / self._step, first, last)
        below = np.minimum(np.floor(knot), last - 1)
        s, (y, dy, half, sixth) = knot - below, self._pieces[:, below.astype(np.int64) - first]
        deviation = y + dy * s + half * (s * s) + sixth * (s * s * s)
        return self._origin + deviation, (dy + half * s * 2 + sixth * (s * s) * 3) / self._step


def _clamped_spline(y: Array) -> Array:
    """(4, N - 1): powers 0 to 3 of the pieces of a C2 cubic spline through `y` (N,) at distances 1, clamped to slope 0.

    The slopes at the knots have s_(i-1) + 4 s_i + s_(i+1) = 3 (y_(i+1) - y_(i-1)).
    """
    rise = np.diff(y)
    slope = np.array(_slopes((3 * (rise[1:] + rise[:-1])).tolist()))
    bend = slope[:-1] + slope[1:] - 2 * rise
    return np.stack([y[:-1], slope[:-1], rise - slope[:-1] - bend, bend])


def _slopes(right: list[float]) -> list[float]:
    """The slopes at all knots, 0 at the first and the last one; right: (N - 2,) right sides of those between.

    Gauss elimination of the tridiagonal system (LAPACK's gtsv, which exchanges no rows here). scipy.linalg and
    scipy.interpolate have the same, with the same bits, and take longer to load than a short program to plan.
    """
    pivots, reduced = [1.0], [0.0]
    pivot = 1.0
    above, value = 0.0, 0.0  # the first row has nothing right of its diagonal
    for side in right:
        factor = 1.0 / pivot
        value = side - factor * value
        pivot = 4.0 - factor * above
        above = 1.0
        pivots.append(pivot)
        reduced.append(value)
    slope = 0.0
    values = [slope]
    for value, pivot in zip(reduced[:0:-1], pivots[:0:-1], strict=True):
        slope = (value - slope) / pivot
        values.append(slope)
    values.append(0.0)
    return values[::-1]


class LongSpline:
    """A :class:`RestSpline` of step 1, solved a block of points at a time, in memory that does not grow with them."""

    def __init__(self, points: Points, block: int = SPLINE_POINTS) -> None:
        self._points, self._block, self._count = points, block, len(points)
        self._whole = RestSpline(points, 1.0) if self._count <= block else None
        self._at, self._solved = -1, self._whole

    def __call__(self, instants: NDArray[np.int64], per_point: int) -> tuple[Array, Array]:
        """Position [unit of the points] and speed [per distance of points] at ``instants`` / per_point.

        instants: (N,) increasing.
        """
        x, v = np.empty(len(instants)), np.empty(len(instants))
        # Whole numbers over the usual numbers per point are exact, however long the program.
        knots, blocks = instants / per_point, instants // (per_point * self._block)
        ends = [0, *(np.flatnonzero(np.diff(blocks)) + 1).tolist(), len(instants)]
        for first, last in pairwise(ends):
            spline = self._whole or self._of(int(blocks[first]))
            x[first:last], v[first:last] = spline(knots[first:last])
        return x, v

    def _of(self, block: int) -> RestSpline:
        if self._at != block or self._solved is None:
            first, last = block * self._block - SPLINE_OVERLAP, (block + 1) * self._block + SPLINE_OVERLAP
            self._solved = RestSpline(
                self._points, 1.0, (max(first, -REST_POINTS), min(last, self._count + REST_POINTS - 1))
            )
            self._at = block
        return self._solved


# --- What the planner hands on about each motion: when it runs, where it begins and ends, and its geometry ------------


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
    Of a long program the arrays are in a file and read page by page (:mod:`feedsim.files.trace.trace`).
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


# Position cycles that a program may have; its setpoints then take about 2 GB for three axes, in a file.
MAX_POSITION_CYCLES = 40_000_000
# Limits are compared with results of arithmetic on them: a relative 1e-9, and 1 nm of travel, are rounding.
LIMIT_ROUNDING = 1e-9


# Position [m] and speed [m/s] of an axis at position cycles, counted from the first one of its piece.
AxisSampler = Callable[[NDArray[np.int64]], tuple[Array, Array]]


@dataclass
class _Stretch:
    """Points of all axes on the T_ipo grid from ``first`` on, between two recordings."""

    first: int
    points: dict[str, list[Points]]

    def sampled(self, axis: str, begin: float, ratio: int, T_ipo: float) -> AxisSampler:
        """An axis on the spline through its points; ``ratio`` position cycles per ``T_ipo`` [s]."""
        # Knots 1 apart: a position cycle is then 1/ratio, exact for the usual ratios, however long the program.
        spline = LongSpline(JoinedPoints(self.points[axis]))

        def at(instants: NDArray[np.int64]) -> tuple[Array, Array]:
            x, v = spline(instants, ratio)
            return x, v / T_ipo

        return at

    def end(self, axis: str, begin: float) -> float:
        """Where it leaves an axis [m]."""
        return float(self.points[axis][-1][-1:][0])


@dataclass
class _Inset:
    """Recorded setpoints, from grid instant ``first`` on: axis -> position [m] and speed [m/s] at T_pos."""

    first: int
    setpoints: Mapping[str, tuple[Array, Array]]

    def sampled(self, axis: str, begin: float, ratio: int, T_ipo: float) -> AxisSampler:
        """An axis as recorded, or where it is at the beginning (`begin`, m); at rest behind the recording."""
        x_s, v_s = self.setpoints.get(axis, (np.array([begin]), np.zeros(1)))

        def at(instants: NDArray[np.int64]) -> tuple[Array, Array]:
            row = np.minimum(instants, len(x_s) - 1)
            return x_s[row], np.where(instants < len(x_s), v_s[row], 0.0)

        return at

    def end(self, axis: str, begin: float) -> float:
        """Where it leaves an axis [m]."""
        return float(self.setpoints[axis][0][-1]) if axis in self.setpoints else begin


@dataclass
class _Plan:
    """The program so far: where the axes are, at which instant of the T_ipo grid, and what is wrong with it.

    lost: axes of which it is not known where they are, since a motion that is not usable was to take them there.
    """

    position: dict[str, float]
    instant: int = 0
    lost: set[str] = field(default_factory=set)
    pieces: list[_Stretch | _Inset] = field(default_factory=list)
    segments: list[Segment] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)


def plan(scenario: Scenario, *, scratch: Path | None = None) -> Program:
    """Setpoints of all motions of ``scenario``; axes without a motion are held.

    scratch: folder for the file without a name that holds the setpoints of a long program; default: that of the
    system for temporary files.

    Raises InputError that lists every motion and axis whose travel, speed or acceleration limit is exceeded, with
    actual and allowed values, and every motion whose geometry or recording is not usable. After one that is not usable,
    the others are judged as far as they do not depend on where it would have ended.
    """
    machine = scenario.machine
    state = _Plan({axis: float(machine.pose[axis]) for axis in machine.axes})
    state.pieces.append(_stretch(state))
    for index, motion in enumerate(scenario.motions):
        result: list[str] = []
        try:
            if state.lost.isdisjoint(motion.needs):
                result = _append(state, scenario, index, motion)
            else:
                _leave_out(state, motion)
        except InputError as error:
            result = list(error.problems)
            _leave_out(state, motion)
        cycles = state.instant * _ratio(machine)
        if cycles > MAX_POSITION_CYCLES:
            result.append(
                f"the program lasts {cycles * machine.cycles.T_pos:.6g} s up to its end, which is {cycles:.3g} "
                f"position cycles; allowed: {MAX_POSITION_CYCLES:.3g}"
            )
        # What is run is the file of the motion itself: its own lines are named, no place in a scenario.
        where = "" if scenario.file in motion.files.values() else f"{scenario.at('motions', index)} ({motion.kind}): "
        state.problems += [f"{where}{problem}" for problem in result]
        if cycles > MAX_POSITION_CYCLES:
            break
    if state.problems:
        raise InputError.of(f"{scenario.file}: the motions cannot be driven", state.problems)
    return _sample(state, scenario, scratch)


def _ratio(machine: Machine) -> int:
    """Position cycles per cycle of the interpolator."""
    return round(machine.cycles.T_ipo / machine.cycles.T_pos)


def _leave_out(state: _Plan, motion: Motion) -> None:
    """Go on behind a motion that cannot be planned: its axes are where it says, if it says so."""
    if not motion.returns:
        state.lost = (state.lost | set(motion.axes)) - set(motion.ends)
        state.position |= motion.ends


def _append(state: _Plan, scenario: Scenario, index: int, motion: Motion) -> list[str]:
    """Plan a motion and append it; what is wrong with it."""
    machine = scenario.machine
    cycles, origin = machine.cycles, dict(state.position)
    start = Start(
        position=origin,
        time=state.instant * cycles.T_ipo,
        T_ipo=cycles.T_ipo,
        T_pos=cycles.T_pos,
        most=MAX_POSITION_CYCLES // _ratio(machine) - state.instant,
        acceleration=machine.path.acceleration,
        jerk=machine.path.jerk,
        travel={name: axis.travel for name, axis in machine.axes.items()},
        limits=machine.program_limits,
    )
    course = motion.plan(start)
    problems = _violations(state, machine, course)
    if course.setpoints:
        state.pieces.append(_Inset(state.instant, course.setpoints))
    else:
        stretch = state.pieces[-1]
        if isinstance(stretch, _Inset):
            stretch = _stretch(state)
            state.pieces.append(stretch)
        for axis, points in stretch.points.items():
            points.append(course.points[axis] if axis in course.points else HeldPoints(origin[axis], course.cycles))
    state.instant += course.cycles
    state.position |= course.target
    if course.absolute:
        state.lost -= set(course.target)
    state.segments.append(
        Segment(
            kind=motion.kind,
            index=index,
            start=start.time,
            end=start.time + course.duration,
            description=motion.description,
            origin=origin,
            target=dict(state.position),
            axes=course.moving,
            geometry=course.geometry,
        )
    )
    return problems


def _violations(state: _Plan, machine: Machine, course: Course) -> list[str]:
    """Limits of the axes that a course from where the axes are does not keep."""
    problems: list[str] = []
    for axis, peaks in course.peaks.items():
        here = state.position[axis]
        if axis in state.lost:  # nothing is known of its travel
            peaks = replace(peaks, low=here, high=here)
        problems += violations(axis, machine.axes[axis], here, peaks)
    for axis, (x_s, v_s) in course.setpoints.items():
        here = float(x_s[0]) if axis in state.lost else state.position[axis]
        problems += recording_violations(axis, machine.axes[axis], here, x_s, v_s, machine.cycles.T_pos)
    return problems


def _sample(state: _Plan, scenario: Scenario, scratch: Path | None) -> Program:
    """Setpoints at T_pos: pieces in their order, each from its first instant on; the next one begins on its last."""
    machine, cycles = scenario.machine, scenario.machine.cycles
    axes = tuple(machine.axes)
    ratio = _ratio(machine)
    total = state.instant * ratio + 1
    table = Table(1 + 2 * len(axes), total, scratch)
    starts = [piece.first * ratio for piece in state.pieces]
    reached = dict(machine.pose)
    for piece, first, last in zip(state.pieces, starts, [*starts[1:], total], strict=True):
        sampled = {}
        for axis in axes:
            sampled[axis] = piece.sampled(axis, reached[axis], ratio, cycles.T_ipo)
            reached[axis] = piece.end(axis, reached[axis])
        for begin in range(first, last, SPLINE_POINTS * ratio):
            instants = np.arange(begin, min(begin + SPLINE_POINTS * ratio, last))
            block = np.empty((1 + 2 * len(axes), len(instants)))
            block[0] = instants * cycles.T_pos
            for i, axis in enumerate(axes):
                x, v = sampled[axis](instants - first)
                block[1 + i], block[1 + len(axes) + i] = x, v / machine.axes[axis].I_P
            table.append(block)
    time, *columns = table.columns()
    x_s, n_ffw = columns[: len(axes)], columns[len(axes) :]
    return Program(time, dict(zip(axes, x_s, strict=True)), dict(zip(axes, n_ffw, strict=True)), tuple(state.segments))


def _stretch(state: _Plan) -> _Stretch:
    return _Stretch(state.instant, {axis: [HeldPoints(x, 1)] for axis, x in state.position.items()})


def violations(name: str, axis: Axis, start: float, peaks: Peaks) -> list[str]:
    """What is wrong with a motion of axis ``name`` that has these peaks.

    Where it stands at ``start`` [m] is not its own fault: the motion before it was blamed for that.
    """
    result = []
    least, most = axis.travel
    outside = [
        x for x in (peaks.low, peaks.high) if x != start and not least - LIMIT_ROUNDING <= x <= most + LIMIT_ROUNDING
    ]
    if outside:
        reached = " and ".join(f"{x * 1e3:.7g}" for x in dict.fromkeys(outside))
        result.append(f"axis {name} reaches {reached} mm; allowed travel {least * 1e3:.7g} to {most * 1e3:.7g} mm")
    if peaks.speed > axis.max_speed * (1 + LIMIT_ROUNDING):
        result.append(
            f"axis {name} reaches a speed of {peaks.speed * 60:.5g} m/min; "
            f"allowed at most {axis.max_speed * 60:.5g} m/min"
        )
    if peaks.acceleration > axis.max_acceleration * (1 + LIMIT_ROUNDING):
        result.append(
            f"axis {name} reaches an acceleration of {peaks.acceleration:.5g} m/s^2; "
            f"allowed at most {axis.max_acceleration:.5g} m/s^2"
        )
    origin = f" ({axis.limits_from})" if axis.limits_from else ""
    return [f"{name}{origin}" for name in result]


def recording_violations(name: str, axis: Axis, start: float, x_s: Array, v_s: Array, cycle: float) -> list[str]:
    """What is wrong with recorded setpoints of axis ``name`` that stands at ``start`` [m] before them.

    The acceleration is the second difference over the position cycle, which includes the jump into the recording.
    """
    jump = abs(float(x_s[0]) - start)
    if jump > axis.max_acceleration * cycle**2:
        return [
            f"axis {name} stands at {start * 1e3:.7g} mm, its recording begins at {float(x_s[0]) * 1e3:.7g} mm; "
            "move there first, or set relative: true"
        ]
    steps = np.diff(np.concatenate([[start, start], x_s, [x_s[-1], x_s[-1]]]), 2) / cycle**2
    speed, acceleration = float(np.abs(v_s).max()), float(np.abs(steps).max())
    return violations(name, axis, start, Peaks(float(x_s.min()), float(x_s.max()), speed, acceleration))
