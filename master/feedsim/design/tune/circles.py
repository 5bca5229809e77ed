"""Circles of many radii and feeds in one run, and how far each axis leaves the circle where it reverses.

Every circle is an arc of a turn and a run-in. What counts is the turn behind the run-in, in which both axes reverse
twice at constant speed, and in which what the start has left has died away. All circles stand behind each other in one
program, so that a candidate costs one run.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feedsim.analysis.circularity import quadrant
from feedsim.analysis.evaluate import RUN_IN
from feedsim.analysis.figures import Array
from feedsim.foundation.errors import InputError
from feedsim.motions.circular import Arc
from feedsim.motions.dwell import Dwell
from feedsim.motions.move import Move
from feedsim.scenario import Machine, Scenario
from feedsim.scenario.model import Recording
from feedsim.simulation.cosim.feedforward import TorqueFeedforward
from feedsim.simulation.cosim.run import run
from feedsim.simulation.nc import Program, plan

# The practical range: accelerations v^2/r at the reversals [m/s^2], of radii [m] and feeds [m/s] of circular tests.
ACCELERATIONS = (0.01, 2.0)
RADII = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2)
FEEDS = tuple(feed / 60 for feed in (0.5, 1.0, 2.0, 5.0, 10.0))
RUN_IN_ANGLE, RUN_OUT_ANGLE = math.radians(60), math.radians(30)  # of an arc, at least
REST_TIME = 0.2  # [s] ahead of a circle
INTERVAL = 1e-3  # [s] between the rows that are looked at
COUNT = 8  # of accelerations that are tuned on


@dataclass(frozen=True)
class Pair:
    """A circle: radius [m] and feed [m/s]."""

    radius: float
    feed: float

    @property
    def acceleration(self) -> float:
        """At the reversals, v^2/r [m/s^2]."""
        return self.feed**2 / self.radius

    @property
    def duration(self) -> float:
        """Of a turn [s]."""
        return 2 * math.pi * self.radius / self.feed

    @property
    def text(self) -> str:
        return f"R {self.radius * 1e3:g} mm at {self.feed * 60:g} m/min"


def practical(machine: Machine, plane: Sequence[str]) -> list[Pair]:
    """The pairs of the practical range that the axes have travel, speed and acceleration for, by acceleration."""
    span = min(machine.axes[axis].travel[1] - machine.axes[axis].travel[0] for axis in plane)
    speed = min(machine.axes[axis].max_speed for axis in plane)
    most = min([machine.path.acceleration, *(machine.axes[axis].max_acceleration for axis in plane)])
    pairs = [Pair(radius, feed) for radius in RADII for feed in FEEDS]
    low, high = ACCELERATIONS
    return sorted(
        (pair for pair in pairs if low <= pair.acceleration <= min(high, most) and 2 * pair.radius < 0.9 * span
         and pair.feed <= speed),
        key=lambda pair: (pair.acceleration, pair.radius),
    )  # fmt: skip


def tuned_on(pairs: Sequence[Pair]) -> list[Pair]:
    """Short circles over the accelerations of some pairs, none of which is among them: to tune on.

    What a compensation has to do at a reversal follows most from the acceleration; small radii give it in little time.
    """
    low, high = (pairs[i].acceleration for i in (0, -1))
    fastest, largest = max(pair.feed for pair in pairs), max(pair.radius for pair in pairs)
    smallest = min(pair.radius for pair in pairs)
    result = []
    for k, a in enumerate(np.geomspace(low, high, COUNT)):
        radius = min(smallest * (1, 1, 2, 2, 2, 3, 3, 2)[k % 8], largest, fastest**2 / a)
        result.append(Pair(radius, float(f"{math.sqrt(a * radius) * 60:.3g}") / 60))
    # The smallest circle at nearly the highest acceleration: there a pulse has the least time to decay.
    result.append(Pair(smallest, float(f"{math.sqrt(0.9 * high * smallest) * 60:.3g}") / 60))
    return [pair for pair in result if pair not in pairs]


@dataclass(frozen=True, eq=False)
class Contour:
    """The turn of a circle that counts: angle [rad] and deviation of the radius [m], (rows,) at equal times."""

    angle: Array
    deviation: Array


@dataclass(frozen=True, eq=False)
class Circles:
    """Circles on a machine, planned.

    scenario: with the motions. program: of them. pairs: in their order. turns: per pair the rows that count, of the
    recorded table. centres: (2,) per pair [m].
    """

    scenario: Scenario
    program: Program
    plane: tuple[str, str]
    pairs: tuple[Pair, ...]
    turns: tuple[tuple[float, float], ...]
    centres: tuple[tuple[float, float], ...]

    @classmethod
    def of(cls, scenario: Scenario, plane: tuple[str, str], pairs: Sequence[Pair]) -> Circles:
        """Plan the circles in the middle of the travel. Raises InputError: limits of the axes forbid one."""
        first, second = plane
        machine = scenario.machine
        middle = {axis: sum(machine.axes[axis].travel) / 2 for axis in plane}
        motions: list[Move | Arc | Dwell] = []
        for pair in pairs:
            start = {first: middle[first] + pair.radius, second: middle[second]}
            motions += [
                Move(to=start, feed=0.9 * min(machine.axes[axis].max_speed for axis in plane)),
                Dwell(duration=REST_TIME),
                Arc(
                    plane=plane, feed=pair.feed, centre_by={first: -pair.radius, second: 0.0},
                    angle=sweep_of(pair, machine),
                ),
            ]  # fmt: skip
        columns = tuple(f"{axis}.x_a" for axis in plane)
        own = scenario.model_copy(
            update={
                "motions": (*motions, Dwell(duration=REST_TIME)),
                "recording": Recording(interval=_interval(machine), variables=columns),
                "logging": None,
                "evaluate": (),
                "loads": (),
            }
        )
        program = plan(own)
        centre = (middle[first], middle[second])
        arcs = [segment for segment, motion in zip(program.segments, own.motions, strict=True) if motion.kind == "arc"]
        turns = tuple(
            turn_of(program, plane, centre, segment.start, segment.end, run_in(value, machine))
            for segment, value in zip(arcs, pairs, strict=True)
        )
        return cls(own, program, plane, tuple(pairs), turns, (centre,) * len(pairs))

    def with_machine(self, machine: Machine) -> Scenario:
        """The scenario on another machine of the same axes and limits."""
        return self.scenario.model_copy(update={"machine": machine})

    def contours(
        self, machine: Machine, *, fmus: Path | None = None, torque: TorqueFeedforward | None = None
    ) -> tuple[Contour, ...]:
        """What the linear scales see of every circle. Raises as :func:`feedsim.simulation.cosim.run`."""
        results = run(self.with_machine(machine), program=self.program, fmus=fmus, torque_feedforward=torque)
        x, z = (np.asarray(results.trace[f"{axis}.x_a"]) for axis in self.plane)
        time, result = results.trace.time, []
        for pair, (begin, end), centre in zip(self.pairs, self.turns, self.centres, strict=True):
            rows = (time >= begin) & (time <= end)
            u, w = x[rows] - centre[0], z[rows] - centre[1]
            result.append(Contour(np.arctan2(w, u), np.hypot(u, w) - pair.radius))
        return tuple(result)

    def errors(self, machine: Machine, *, fmus: Path | None = None) -> Array:
        """(pairs, 2 axes, 2) peaks and dips [m] of all circles, as :func:`extremes`. Raises as :meth:`contours`."""
        return extremes(self.contours(machine, fmus=fmus))


def extremes(contours: Sequence[Contour], free: Sequence[Contour] | None = None) -> Array:
    """(pairs, 2 axes, 2) peak and dip [m] of the radius where an axis reverses, from the median of the turn.

    The larger of two reversals each. free: contours of the same circles without friction. With them it is the part that
    friction makes: the difference of both radii at the same instant. Drives alone make ellipses of fast circles, which
    no friction compensation takes off.
    """
    result = np.empty((len(contours), 2, 2))
    for i, contour in enumerate(contours):
        deviation = contour.deviation if free is None else contour.deviation - free[i].deviation
        deviation = deviation - np.median(deviation)
        for k in range(2):
            near = quadrant(contour.angle, k * math.pi / 2) | quadrant(contour.angle, k * math.pi / 2 + math.pi)
            result[i, k] = deviation[near].max(), deviation[near].min()
    return result


def size(errors: Array) -> Array:
    """max(peak, -dip) [m] of errors (..., 2)."""
    return np.asarray(np.maximum(errors[..., 0], -errors[..., 1]))


def _interval(machine: Machine) -> float:
    return max(1, round(INTERVAL / machine.cycles.T_c)) * machine.cycles.T_c


def run_in(pair: Pair, machine: Machine) -> float:
    """Angle [rad] from the start of an arc to the turn that counts: the path's way to its speed, and RUN_IN behind."""
    path = machine.path
    rising = pair.feed / path.acceleration + path.acceleration / path.jerk
    return max(RUN_IN_ANGLE, (RUN_IN + rising) * pair.feed / pair.radius)


def sweep_of(pair: Pair, machine: Machine) -> float:
    """Angle [rad] of an arc with run-in, turn and run-out; whole degrees."""
    return math.radians(math.ceil(math.degrees(run_in(pair, machine) + 2 * math.pi + RUN_OUT_ANGLE)))


def turn_of(
    program: Program, plane: tuple[str, str], centre: tuple[float, float], start: float, end: float, begin: float
) -> tuple[float, float]:
    """Begin and end [s] of the turn that counts, by the setpoints. begin: angle from the start of the arc [rad]."""
    rows: NDArray[np.bool_] = (program.time >= start) & (program.time <= end)
    time = program.time[rows]
    x, z = (np.asarray(program.x_s[axis][rows]) - c for axis, c in zip(plane, centre, strict=True))
    angle = np.unwrap(np.arctan2(z, x))
    angle = np.maximum.accumulate(angle - angle[0])
    if angle[-1] < begin + 2 * math.pi:
        raise InputError("a circle has no full turn at constant speed; take larger radii or lower feeds")
    return float(np.interp(begin, angle, time)), float(np.interp(begin + 2 * math.pi, angle, time))
