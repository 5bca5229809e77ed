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
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feedsim.errors import InputError
from feedsim.motions import Motion
from feedsim.motions.kind import Array, Course, Peaks, Points, Start
from feedsim.motions.points import Held, Joined
from feedsim.nc.segment import Program, Segment
from feedsim.nc.spline import SPLINE_POINTS, LongSpline
from feedsim.scenario import Axis, Machine, Scenario
from feedsim.trace import Table

# Position cycles that a program may have; its setpoints then take about 2 GB for three axes, in a file.
MAX_POSITION_CYCLES = 40_000_000
# Limits are compared with results of arithmetic on them: a relative 1e-9, and 1 nm of travel, are rounding.
LIMIT_ROUNDING = 1e-9


# Position [m] and speed [m/s] of an axis at position cycles, counted from the first one of its piece.
Sampled = Callable[[NDArray[np.int64]], tuple[Array, Array]]


@dataclass
class _Stretch:
    """Points of all axes on the T_ipo grid from ``first`` on, between two recordings."""

    first: int
    points: dict[str, list[Points]]

    def sampled(self, axis: str, begin: float, ratio: int, T_ipo: float) -> Sampled:
        """An axis on the spline through its points; ``ratio`` position cycles per ``T_ipo`` [s]."""
        # Knots 1 apart: a position cycle is then 1/ratio, exact for the usual ratios, however long the program.
        spline = LongSpline(Joined(self.points[axis]))

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

    def sampled(self, axis: str, begin: float, ratio: int, T_ipo: float) -> Sampled:
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
        state.problems += [f"{scenario.at('motions', index)} ({motion.kind}): {problem}" for problem in result]
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
            points.append(course.points[axis] if axis in course.points else Held(origin[axis], course.cycles))
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
    return _Stretch(state.instant, {axis: [Held(x, 1)] for axis, x in state.position.items()})


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
