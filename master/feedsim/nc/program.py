"""Plan a scenario's motions: from geometry and limits to setpoints at the position cycle.

Every motion runs from rest to rest. It starts on the T_ipo grid: at 0, or at the first instant of the grid at or after
the exact end of the motion before it. Its path is sampled at T_ipo, and one C2 cubic spline per axis runs through the
samples of all motions (from one recording to the next, where there are recordings). Setpoints are its values at T_pos.
They are computed stretch by stretch, so that planning needs no more memory for an hour than for a minute.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feedsim.errors import InputError
from feedsim.nc.constant_speed import strokes
from feedsim.nc.limits import violations
from feedsim.nc.path import CircularPath, Line, arc, full_circle, line
from feedsim.nc.points import Along, Held, Joined
from feedsim.nc.profile import Profile, rest_to_rest
from feedsim.nc.recorded import recorded, recording_violations
from feedsim.nc.segment import Circular, Program, Recorded, Segment, Straight, whole_cycles
from feedsim.nc.sine import sines
from feedsim.nc.spline import BLOCK, LongSpline, Points
from feedsim.scenario import (
    Arc,
    Circle,
    ConstantSpeed,
    Dwell,
    MeasuredSetpoints,
    Motion,
    Move,
    Scenario,
    Sine,
    moved_axes,
)
from feedsim.trace import Table

Array = NDArray[np.float64]

# Position cycles that a program may have; its setpoints then take about 2 GB for three axes, in a file.
LONGEST = 40_000_000


@dataclass
class _Stretch:
    """Points of all axes on the T_ipo grid from ``first`` on, between two recordings."""

    first: int
    points: dict[str, list[Points]]


@dataclass
class _Inset:
    """Recorded setpoints, from grid instant ``first`` on."""

    first: int
    x_s: Mapping[str, Array]
    v_s: Mapping[str, Array]


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
        found: list[str] = []
        try:
            if _depends_on(motion, state.lost):
                _leave_out(state, motion)
            elif isinstance(motion, MeasuredSetpoints):
                found = _append_recording(state, scenario, index, motion)
            elif isinstance(motion, ConstantSpeed | Sine):
                found = _append_experiment(state, scenario, index, motion)
            else:
                found = _append_planned(state, scenario, index, motion)
        except InputError as error:
            found = list(error.problems)
            _leave_out(state, motion)
        cycles = state.instant * machine.cycles.T_ipo / machine.cycles.T_pos
        if cycles > LONGEST:
            found.append(
                f"the program lasts {cycles * machine.cycles.T_pos:.6g} s up to its end, which is {cycles:.3g} "
                f"position cycles; allowed: {LONGEST:.3g}"
            )
        state.problems += [f"{scenario.at('motions', index)} ({motion.kind}): {problem}" for problem in found]
        if cycles > LONGEST:
            break
    if state.problems:
        raise InputError.of(f"{scenario.file}: the motions cannot be driven", state.problems)
    return _sample(state, scenario, scratch)


def _depends_on(motion: Motion, lost: set[str]) -> bool:
    """Whether nothing can be said of a motion as long as the positions of the ``lost`` axes are not known."""
    if isinstance(motion, Move):
        return not lost.isdisjoint(motion.to)
    if isinstance(motion, Arc):
        return bool(motion.centre or motion.to) and not lost.isdisjoint(motion.plane)
    if isinstance(motion, ConstantSpeed):
        return motion.axis in lost
    return isinstance(motion, MeasuredSetpoints) and motion.relative and not lost.isdisjoint(motion.columns)


def _leave_out(state: _Plan, motion: Motion) -> None:
    """Go on behind a motion that cannot be planned: its axes are where it says, if it says so."""
    if isinstance(motion, ConstantSpeed | Sine):
        return  # ends where it begins
    if isinstance(motion, MeasuredSetpoints):
        ends: Mapping[str, float] = {}
    else:
        ends = motion.to if isinstance(motion, Move | Arc) else {}
    state.lost = (state.lost | set(moved_axes(motion))) - set(ends)
    state.position |= ends


def _append_planned(state: _Plan, scenario: Scenario, index: int, motion: Motion) -> list[str]:
    """Plan a motion and append it; what is wrong with it."""
    limits, cycles = scenario.machine.path, scenario.machine.cycles
    start = state.instant * cycles.T_ipo
    origin = dict(state.position)
    if isinstance(motion, Dwell):
        profile, path = None, None
        duration = motion.duration
    else:
        assert isinstance(motion, Move | Arc | Circle)
        path = _path(motion, origin)
        profile = rest_to_rest(
            path.length, motion.feed, motion.acceleration or limits.acceleration, motion.jerk or limits.jerk
        )
        duration = profile.duration
    count = whole_cycles(duration, cycles.T_ipo)
    if (state.instant + count) * (cycles.T_ipo / cycles.T_pos) > LONGEST:
        state.instant += count
        return []  # plan() reports it; looking at all of it would take long
    samples: Mapping[str, Points] = {}
    problems: list[str] = []
    if profile is not None and path is not None:
        samples = {axis: Along(path, profile, axis, cycles.T_ipo, count) for axis in path.axes}
        for axis, peaks in path.peaks(profile, cycles.T_ipo).items():
            if axis in state.lost:
                peaks = (origin[axis], origin[axis], *peaks[2:])
            problems += violations(axis, scenario.machine.axes[axis], origin[axis], *peaks)
    _append_points(state, samples, count)
    if path is not None:
        state.position |= {axis: float(x[0]) for axis, x in path.position(np.array([path.length])).items()}
    if isinstance(motion, Move):
        state.position |= motion.to
    elif isinstance(motion, Circle):
        state.position = dict(origin)
    state.segments.append(
        Segment(
            kind=motion.kind,
            index=index,
            start=start,
            end=start + duration,
            description=_describe(motion),
            origin=origin,
            target=dict(state.position),
            axes=() if path is None else path.moving,
            geometry=_geometry(path, profile, start) if path is not None and profile is not None else None,
        )
    )
    return problems


def _append_points(state: _Plan, samples: Mapping[str, Points], count: int) -> None:
    """The next ``count`` points of all axes; those without ``samples`` are held."""
    stretch = state.pieces[-1]
    if isinstance(stretch, _Inset):
        stretch = _stretch(state)
        state.pieces.append(stretch)
    for axis, points in stretch.points.items():
        points.append(samples[axis] if axis in samples else Held(state.position[axis], count))
    state.instant += count


def _append_experiment(state: _Plan, scenario: Scenario, index: int, motion: ConstantSpeed | Sine) -> list[str]:
    """Plan an experiment and append it; what is wrong with it."""
    machine, cycle = scenario.machine, scenario.machine.cycles.T_ipo
    start, origin = state.instant * cycle, dict(state.position)
    axis, here = machine.axes[motion.axis], origin[motion.axis]
    most = int(LONGEST * machine.cycles.T_pos / cycle) - state.instant
    if isinstance(motion, ConstantSpeed):
        course = strokes(motion, axis, here, machine.path, cycle, start, most)
    else:
        course = sines(motion, cycle, start, most)
    low, high = (here, here) if motion.axis in state.lost else (here + course.low, here + course.high)
    _append_points(state, {motion.axis: here + course.points}, len(course.points))
    state.segments.append(
        Segment(
            kind=motion.kind,
            index=index,
            start=start,
            end=start + course.duration,
            description=_describe(motion),
            origin=origin,
            target=dict(origin),
            axes=(motion.axis,),
            geometry=course.geometry,
        )
    )
    return violations(motion.axis, axis, here, low, high, course.speed, course.acceleration)


def _append_recording(state: _Plan, scenario: Scenario, index: int, motion: MeasuredSetpoints) -> list[str]:
    """Append recorded setpoints; what is wrong with them."""
    cycles = scenario.machine.cycles
    start = state.instant * cycles.T_ipo
    origin = dict(state.position)
    recording = recorded(motion, origin, cycles.T_pos, scenario.machine.path)
    problems: list[str] = []
    for axis, x_s in recording.x_s.items():
        begin = float(x_s[0]) if axis in state.lost else origin[axis]
        limits = scenario.machine.axes[axis]
        problems += recording_violations(axis, limits, begin, x_s, recording.v_s[axis], cycles.T_pos)
    if not motion.relative:
        state.lost -= set(motion.columns)
    state.pieces.append(_Inset(state.instant, recording.x_s, recording.v_s))
    state.position |= {axis: float(x[-1]) for axis, x in recording.x_s.items()}
    state.instant += whole_cycles(recording.duration, cycles.T_ipo)
    state.segments.append(
        Segment(
            kind=motion.kind,
            index=index,
            start=start,
            end=start + recording.duration,
            description=_describe(motion),
            origin=origin,
            target=dict(state.position),
            axes=tuple(axis for axis, x in recording.x_s.items() if np.any(x != origin[axis])),
            geometry=Recorded(
                begin=start + recording.run_in,
                end=start + recording.run_in + recording.length,
                file=motion.file,
                axes=tuple(motion.columns),
            ),
        )
    )
    return problems


def _sample(state: _Plan, scenario: Scenario, scratch: Path | None) -> Program:
    """Setpoints at T_pos: pieces in their order, each from its first instant on; the next one begins on its last."""
    machine, cycles = scenario.machine, scenario.machine.cycles
    axes = tuple(machine.axes)
    ratio = round(cycles.T_ipo / cycles.T_pos)
    total = state.instant * ratio + 1
    table = Table(1 + 2 * len(axes), total, scratch)
    starts = [piece.first * ratio for piece in state.pieces]
    held = dict(machine.pose)
    for piece, first, last in zip(state.pieces, starts, [*starts[1:], total], strict=True):
        sampled = {}
        for axis in axes:
            sampled[axis] = _sampled(piece, axis, held[axis], ratio, cycles.T_ipo)
            held[axis] = _end(piece, axis, held[axis])
        for begin in range(first, last, BLOCK * ratio):
            instants = np.arange(begin, min(begin + BLOCK * ratio, last))
            block = np.empty((1 + 2 * len(axes), len(instants)))
            block[0] = instants * cycles.T_pos
            for i, axis in enumerate(axes):
                x, v = sampled[axis](instants - first)
                block[1 + i], block[1 + len(axes) + i] = x, v / machine.axes[axis].I_P
            table.append(block)
    time, *columns = table.columns()
    x_s, n_ffw = columns[: len(axes)], columns[len(axes) :]
    return Program(time, dict(zip(axes, x_s, strict=True)), dict(zip(axes, n_ffw, strict=True)), tuple(state.segments))


def _sampled(
    piece: _Stretch | _Inset, axis: str, held: float, ratio: int, T_ipo: float
) -> Callable[[NDArray[np.int64]], tuple[Array, Array]]:
    """Position [m] and speed [m/s] of an axis at the position cycles of a piece, counted from its first one."""
    if isinstance(piece, _Stretch):
        # Knots 1 apart: a position cycle is then 1/ratio, exact for the usual ratios, however long the program.
        spline = LongSpline(Joined(piece.points[axis]))

        def stretch(instants: NDArray[np.int64]) -> tuple[Array, Array]:
            x, v = spline(instants, ratio)
            return x, v / T_ipo

        return stretch
    x_s = piece.x_s.get(axis, np.array([held]))
    v_s = piece.v_s.get(axis, np.zeros(1))

    def inset(instants: NDArray[np.int64]) -> tuple[Array, Array]:
        at = np.minimum(instants, len(x_s) - 1)
        return x_s[at], np.where(instants < len(x_s), v_s[at], 0.0)

    return inset


def _end(piece: _Stretch | _Inset, axis: str, held: float) -> float:
    """Where a piece leaves an axis [m]."""
    if isinstance(piece, _Stretch):
        return float(piece.points[axis][-1][-1:][0])
    return float(piece.x_s[axis][-1]) if axis in piece.x_s else held


def _stretch(state: _Plan) -> _Stretch:
    return _Stretch(state.instant, {axis: [Held(x, 1)] for axis, x in state.position.items()})


def _path(motion: Move | Arc | Circle, start: Mapping[str, float]) -> Line | CircularPath:
    if isinstance(motion, Move):
        return line(motion, start)
    return full_circle(motion, start) if isinstance(motion, Circle) else arc(motion, start)


def _geometry(path: Line | CircularPath, profile: Profile, start: float) -> Straight | Circular:
    steady = None if profile.steady is None else (start + profile.steady[0], start + profile.steady[1])
    if isinstance(path, Line):
        return Straight(path.length, steady)
    turns = math.floor(path.sweep / (2 * math.pi) + 1e-9)
    instants = start + profile.time_at(path.radius * (2 * math.pi * np.arange(turns + 1, dtype=np.float64)))
    return Circular(
        axes=path.axes,
        centre=path.centre,
        radius=path.radius,
        sense=path.sense,
        start_angle=path.start_angle,
        sweep=path.sweep,
        turns=tuple(pairwise(instants.tolist())),
        steady=steady,
    )


def _describe(motion: Motion) -> str:
    if isinstance(motion, Dwell):
        return f"dwell {motion.duration:g} s"
    if isinstance(motion, MeasuredSetpoints):
        return f"recorded setpoints of {', '.join(motion.columns)} from {motion.file.name}"
    if isinstance(motion, ConstantSpeed):
        feeds = [feed * 6e4 for feed in motion.feeds]
        return f"constant speeds of {motion.axis}: {len(feeds)}, {min(feeds):.6g} to {max(feeds):.6g} mm/min"
    if isinstance(motion, Sine):
        sizes = ", ".join(f"{move.amplitude * 1e6:.6g} um at {move.frequency:.6g} Hz" for move in motion.moves[:4])
        return f"sines of {motion.axis}: {sizes}{' ...' if len(motion.moves) > 4 else ''}"
    feed = f"at {motion.feed * 6e4:.6g} mm/min"
    if isinstance(motion, Move):
        by = [f"{axis} by {d * 1e3:.6g} mm" for axis, d in motion.by.items()]
        to = [f"{axis} to {x * 1e3:.6g} mm" for axis, x in motion.to.items()]
        return f"move {', '.join(by + to)} {feed}"
    plane = f"in {motion.plane[0]}-{motion.plane[1]}, {motion.direction}"
    if isinstance(motion, Circle):
        return f"circle {plane}, R {motion.radius * 1e3:.6g} mm, {motion.turns} turn{'s'[: motion.turns != 1]}, {feed}"
    return f"arc {plane}, {feed}"
