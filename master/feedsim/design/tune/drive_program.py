"""Stops and reversals of one axis in one program, and what a drive makes of them.

Stops: moves of the axis alone. Reversals: circles with a second axis; of a machine with one axis, sines whose partner
is thought to be perfect. All stand behind one another, so that a drive costs one run.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from feedsim.analysis.circularity import quadrant
from feedsim.analysis.figures import Array
from feedsim.analysis.positioning import last_outside
from feedsim.analysis.proposals import axis_lag, check_controlled
from feedsim.design.tune.circles import REST_TIME, RUN_IN_ANGLE, Pair, run_in, sweep_of, turn_of
from feedsim.files.trace import Trace
from feedsim.foundation.errors import InputError
from feedsim.motions.circular import Arc
from feedsim.motions.dwell import Dwell
from feedsim.motions.move import Move
from feedsim.motions.sine import Sine, SineMove
from feedsim.scenario import Machine, Scenario
from feedsim.scenario.model import Recording
from feedsim.simulation.cosim.run import follow
from feedsim.simulation.nc import Program, plan

BAND = 1e-6  # [m] within which an axis has settled
USED_TRAVEL_SHARE = 0.9  # of the travel on either side of the pose that is used
SPEED_SHARE = 0.9  # of the highest speed of an axis, at most
ACCELERATION = 0.8  # of the highest acceleration, at most, on circles
RESTS = 20.0  # rest behind a move, in 1/K_v
MIN_PROGRAM_REST = 0.3  # [s]
APPROACH = 0.5  # of the highest speed, to where a circle begins
SLOWER = (1.0, 0.7, 0.5, 0.35, 0.2, 0.1)  # of the feeds: a path may ask an axis for more acceleration than it has
INTERVAL = 250e-6  # [s] between the rows that are looked at


@dataclass(frozen=True)
class Stop:
    """A move by a distance [m] at a feed [m/s]."""

    distance: float
    feed: float

    @property
    def text(self) -> str:
        return f"move of {self.distance * 1e3:.4g} mm at {self.feed * 60:.4g} m/min"


@dataclass(frozen=True, eq=False)
class Errors:
    """What is left of stops (S,) and reversals (R,).

    overshoot, miss: [m], beyond the target, and from it once the delayed setpoint has arrived. tail: [m], mean distance
    from the target from then on. settling: [s] to BAND, from the end of the setpoints' motion. peak: [m], the largest
    deviation of the radius from its median where the axis reverses. torque: largest motor torque [N.m].
    """

    overshoot: Array
    miss: Array
    tail: Array
    settling: Array
    peak: Array
    torque: float


@dataclass(frozen=True, eq=False)
class DriveProgram:
    """Stops and reversals of an axis, planned.

    partner: of the circles; "" with sines. spans: per stop begin of its rest and end [s], target [m] and sense. turns:
    per reversal begin and end [s]. centres: per reversal, of axis and partner [m].
    """

    scenario: Scenario
    program: Program
    axis: str
    partner: str
    stops: tuple[Stop, ...]
    circles: tuple[Pair, ...]
    spans: tuple[tuple[float, float, float, float], ...]
    turns: tuple[tuple[float, float], ...]
    centres: tuple[tuple[float, float], ...]
    interval: float

    @classmethod
    def of(
        cls, scenario: Scenario, axis: str, partner: str, stops: Sequence[Stop], circles: Sequence[Pair]
    ) -> DriveProgram:
        """Plan them about the machine's pose, slower where limits of the axes ask for it.

        InputError: they cannot be driven at any of SLOWER.
        """
        for slower in SLOWER[:-1]:
            with suppress(InputError):
                return cls._planned(scenario, axis, partner, stops, circles, slower)
        return cls._planned(scenario, axis, partner, stops, circles, SLOWER[-1])

    @classmethod
    def _planned(
        cls, scenario: Scenario, axis: str, partner: str, stops: Sequence[Stop], circles: Sequence[Pair], slower: float
    ) -> DriveProgram:
        machine = scenario.machine
        stops = [Stop(stop.distance, slower * stop.feed) for stop in stops]
        circles = [Pair(circle.radius, slower * circle.feed) for circle in circles]
        approach = APPROACH * slower * machine.axes[axis].max_speed
        rest = max(MIN_PROGRAM_REST, RESTS / machine.shipped_drive(axis, "tuning").K_v)
        motions: list[Move | Arc | Sine | Dwell] = [Dwell(duration=REST_TIME)]
        stopping, turning = [], []
        at = machine.pose[axis]
        for stop in stops:
            at = at + stop.distance
            stopping.append((len(motions), at, math.copysign(1.0, stop.distance)))
            motions += [Move(by={axis: stop.distance}, feed=stop.feed), Dwell(duration=rest)]
        centres = []
        for pair in circles:
            centre = tuple(_centre(machine, name, pair.radius) for name in (axis, partner) if name)
            if partner:
                start = {axis: centre[0] + pair.radius, partner: centre[1]}
                motions += [Move(to=start, feed=approach), Dwell(duration=REST_TIME)]
                turning.append(len(motions))
                motions.append(Arc(
                    plane=(axis, partner), feed=pair.feed, centre_by={axis: -pair.radius, partner: 0.0},
                    angle=sweep_of(pair, machine),
                ))  # fmt: skip
            else:
                motions += [Move(to={axis: centre[0]}, feed=approach), Dwell(duration=REST_TIME)]
                turning.append(len(motions))
                sine = SineMove(amplitude=pair.radius, frequency=pair.feed / (2 * math.pi * pair.radius), periods=2)
                motions.append(Sine(axis=axis, moves=(sine,)))
            centres.append((centre[0], centre[1] if partner else 0.0))
        interval = max(1, round(INTERVAL / machine.cycles.T_c)) * machine.cycles.T_c
        own = scenario.model_copy(
            update={
                "motions": (*motions, Dwell(duration=REST_TIME)), "logging": None, "evaluate": (), "loads": (),
                "recording": Recording(interval=interval, variables=None),
            }
        )  # fmt: skip
        program = plan(own)
        spans = []
        for index, target, sense in stopping:
            end = program.segments[index].end
            spans.append((end, end + rest, target, sense))
        turns = []
        for index, pair, (own_centre, other) in zip(turning, circles, centres, strict=True):
            segment = program.segments[index]
            if partner:
                begin = run_in(pair, machine)
                turns.append(turn_of(program, (axis, partner), (own_centre, other), segment.start, segment.end, begin))
            else:  # behind the fading a full period, which begins a sixth of it later
                period = 2 * math.pi * pair.radius / pair.feed
                turns.append((segment.start + (1 + RUN_IN_ANGLE / (2 * math.pi)) * period,
                              segment.start + (2 + RUN_IN_ANGLE / (2 * math.pi)) * period))  # fmt: skip
        return cls(own, program, axis, partner, tuple(stops), tuple(circles), tuple(spans), tuple(turns),
                   tuple(centres), interval)  # fmt: skip

    def errors(self, machine: Machine, *, fmus: Path | None = None) -> Errors:
        """What a machine of the same axes and limits makes of them. Raises as :func:`feedsim.simulation.cosim.run`."""
        columns = [f"{self.axis}.x_a", f"{self.axis}.M_a", *([f"{self.partner}.x_a"] if self.partner else [])]
        trace = follow(
            machine, self.program, columns, self.interval, coupling=self.scenario.coupling, fmus=fmus
        )  # fmt: skip
        lag = axis_lag(machine.shipped_drive(self.axis, "tuning"))
        stops = np.array([_stop(trace, self.axis, lag, *span) for span in self.spans]).reshape(-1, 4)
        peaks = [self._peak(trace, k) for k in range(len(self.circles))]
        torque = float(np.abs(trace[f"{self.axis}.M_a"]).max())
        overshoot, miss, tail, settling = stops.T
        return Errors(overshoot, miss, tail, settling, np.array(peaks), torque)

    def _peak(self, trace: Trace, k: int) -> float:
        (begin, end), (centre, other), radius = self.turns[k], self.centres[k], self.circles[k].radius
        rows = (trace.time >= begin) & (trace.time <= end)
        own = np.asarray(trace[f"{self.axis}.x_a"])[rows] - centre
        if self.partner:
            across = np.asarray(trace[f"{self.partner}.x_a"])[rows] - other
        else:  # a perfect partner: a quarter of a period ahead of the sine that the axis makes
            phase = 2 * math.pi * trace.time[rows] / (end - begin)
            (a, b, _), *_ = np.linalg.lstsq(
                np.column_stack([np.sin(phase), np.cos(phase), np.ones(len(phase))]), own, rcond=None
            )
            across = (a * np.cos(phase) - b * np.sin(phase)) * radius / math.hypot(a, b)
        deviation, angle = np.hypot(own, across) - radius, np.arctan2(across, own)
        deviation = deviation - np.median(deviation)
        near = quadrant(angle, 0.0) | quadrant(angle, math.pi)
        return float(np.abs(deviation[near]).max())


def _stop(
    trace: Trace, axis: str, lag: float, end: float, until: float, target: float, sense: float
) -> tuple[float, float, float, float]:
    rows = (trace.time >= end) & (trace.time <= until)
    time, beyond = trace.time[rows], sense * (np.asarray(trace[f"{axis}.x_a"])[rows] - target)
    arrived = np.abs(beyond[time >= end + lag]) if math.isfinite(lag) and end + lag < until else np.abs(beyond)
    settled = max(last_outside(time, beyond, BAND), end)
    return max(float(beyond.max()), 0.0), float(arrived.max()), float(arrived.mean()), settled - end


def _centre(machine: Machine, axis: str, radius: float) -> float:
    """The pose, or as near to it as a circle has room [m]."""
    low, high = machine.axes[axis].travel
    return min(max(machine.pose[axis], low + radius / USED_TRAVEL_SHARE), high - radius / USED_TRAVEL_SHARE)


def stops_of(machine: Machine, axis: str, shares: Sequence[tuple[float, float]]) -> list[Stop]:
    """Moves to and fro within the travel: distances [m] and feeds [m/s] as wanted, as far as the axis has them."""
    low, high = machine.axes[axis].travel
    up, down = high - machine.pose[axis], machine.pose[axis] - low
    sense, room = (1.0, up) if up >= down else (-1.0, down)
    stops, at = [], 0.0
    for distance, feed in shares:
        size = min(distance, USED_TRAVEL_SHARE * room / 2)
        if (
            not 0 <= at + sense * size <= USED_TRAVEL_SHARE * room
            if sense > 0
            else not -USED_TRAVEL_SHARE * room <= at + sense * size <= 0
        ):
            sense = -sense
        stops.append(Stop(sense * size, min(feed, SPEED_SHARE * machine.axes[axis].max_speed)))
        at += sense * size
        sense = -sense if abs(at) > 0 else sense
    return stops


def circles_of(machine: Machine, axis: str, partner: str, wanted: Sequence[tuple[float, float]]) -> list[Pair]:
    """Circles of radii [m] and feeds [m/s] as wanted, smaller and slower where the axes need that."""
    names = [name for name in (axis, partner) if name]
    span = min(machine.axes[name].travel[1] - machine.axes[name].travel[0] for name in names)
    speed = min(machine.axes[name].max_speed for name in names)
    most = min([machine.path.acceleration, *(machine.axes[name].max_acceleration for name in names)])
    pairs = []
    for radius, feed in wanted:
        r = min(radius, USED_TRAVEL_SHARE * span / 2)
        v = min(feed, SPEED_SHARE * speed, math.sqrt(ACCELERATION * most * r))
        # the limit of the jerk along the path holds for the turn as well: v^3/r^2
        v = min(v, (ACCELERATION * machine.path.jerk * r**2) ** (1 / 3))
        pairs.append(Pair(r, v))
    return pairs


def partner_of(scenario: Scenario, axis: str) -> str:
    """The axis that makes circles with `axis`: that of the scenario's circles, or else the first other one with a
    shipped drive; "" where there is none."""
    for motion in scenario.motions:
        plane = getattr(motion, "plane", None)
        if plane is not None and axis in plane:
            return str(next(name for name in plane if name != axis))
    foreign = {name for name, _ in scenario.machine.foreign_units}
    return next((name for name in scenario.machine.axes if name != axis and name not in foreign), "")


def check_axis(scenario: Scenario, axis: str) -> None:
    """InputError: an axis that is not there, whose units are another maker's, or an axis without position control."""
    machine = scenario.machine
    if axis not in machine.axes:
        raise InputError(f"no axis {axis!r}; there is {', '.join(machine.axes)}")
    machine.friction_of(axis, "tuning")
    for name in machine.axes:
        check_controlled(machine, name)
