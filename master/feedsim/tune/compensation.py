"""A friction compensation of axes, found on some circles and judged on others."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from feedsim.analysis.figures import Array
from feedsim.cosim.feedforward import TorqueFeedforward, friction_feedforward, lag_of
from feedsim.cosim.friction_law import FrictionLaws
from feedsim.errors import InputError
from feedsim.scenario import Machine, Scenario
from feedsim.tune.circles import Circles, Contour, Pair, extremes, practical, size, tuned_on
from feedsim.tune.compensators import NEVER_WORSE, Found, Progress, PulseGrid, instant, pulse, table, together, without
from feedsim.tune.effects import Effect, effects_of, frictionless
from feedsim.tune.trials import Trials
from feedsim.uncertainty import JUDGE_SEED, SEARCH_DRAWS, SEARCH_SEED, Cloud, draw_named, torque_scale

OTHER_CAUSES = 0.1  # of the error without compensation, from where on a part that is not friction's is named


@dataclass(frozen=True, eq=False)
class Errors:
    """Errors of circles where an axis reverses, without and with a compensation: (pairs, 2 axes of the plane) [m].

    before, after: of the circles as they are. own_before, own_after: the part that friction makes.
    """

    before: Array
    after: Array
    own_before: Array
    own_after: Array

    @classmethod
    def of(cls, before: Sequence[Contour], after: Sequence[Contour], free: Sequence[Contour]) -> Errors:
        """free: contours of the same machine without friction."""
        return cls(*(size(extremes(contours, than)) for than in (None, free) for contours in (before, after)))


@dataclass(frozen=True, eq=False)
class Judged:
    """A compensation and what it does.

    Attributes:
        scenario, plane, axes: of what. objective: what was minimised.
        found: kind and values.
        tuned, held_out: pairs that it was found on, and other ones; tuned_errors, held_errors: of them.
        held_frictionless: errors (pairs, 2) [m] of the machine without friction, which no friction compensation takes
            off.
        changed: effect of the machine -> errors of the pairs held out.
        drawn: the same of draws of the machine from cloud; None without.
    """

    scenario: Scenario
    plane: tuple[str, str]
    axes: tuple[str, ...]
    objective: str
    found: Found
    tuned: tuple[Pair, ...]
    held_out: tuple[Pair, ...]
    tuned_errors: Errors
    held_errors: Errors
    held_frictionless: Array
    changed: Mapping[Effect, Errors]
    drawn: Sequence[Errors] | None = None
    cloud: Cloud | None = None

    @property
    def columns(self) -> list[int]:
        """Places of the compensated axes in the plane."""
        return [self.plane.index(axis) for axis in self.axes]

    def reduction(self, errors: Errors) -> Array:
        """(pairs, compensated axes) by how much the error falls [1]; below 0 it grows."""
        return np.asarray(1 - (errors.after / errors.before)[:, self.columns])

    def own_reduction(self, errors: Errors) -> Array:
        """(pairs, compensated axes) by how much the part that friction makes falls [1]."""
        return np.asarray(1 - (errors.own_after / errors.own_before)[:, self.columns])

    @property
    def beyond_friction(self) -> list[tuple[str, Pair, float, float]]:
        """Axis, pair, error without friction and before [m], of pairs held out whose error is more than friction's, the
        largest share first."""
        result = [
            (axis, pair, float(self.held_frictionless[i, k]), float(self.held_errors.before[i, k]))
            for k, axis in zip(self.columns, self.axes, strict=True)
            for i, pair in enumerate(self.held_out)
        ]
        return sorted(
            (entry for entry in result if entry[2] > OTHER_CAUSES * entry[3]),
            key=lambda entry: entry[2] / entry[3],
            reverse=True,
        )

    @property
    def worse(self) -> list[tuple[str, Pair, float, float]]:
        """Axis, pair, error before and after [m] of every pair held out that gets worse by more than 5 %."""
        before, after = self.held_errors.before, self.held_errors.after
        return [
            (axis, pair, float(before[i, k]), float(after[i, k]))
            for k, axis in zip(self.columns, self.axes, strict=True)
            for i, pair in enumerate(self.held_out)
            if after[i, k] > NEVER_WORSE * before[i, k]
        ]


def tune(
    scenario: Scenario, kind: str, plane: tuple[str, str], axes: Sequence[str], objective: str, *,
    fmus: Path | None, progress: Progress, cloud: Cloud | None = None, count: int = 0,
) -> Judged:  # fmt: skip
    """Find a compensation on short circles and judge it on the practical range of radii and feeds.

    plane: axes of the circles. axes: those that are compensated, of the plane. cloud: draws of the machine that the
    values are good for; they are found on a few, and judged on `count` other ones. Raises InputError: no circle of the
    practical range fits the travel, a drive or a friction of another maker; SimulationError as a run.
    """
    machine = without(scenario.machine, kind, axes)
    pairs = practical(machine, plane)
    if len(pairs) < 4:
        raise InputError(
            f"{plane[0]}-{plane[1]}: {len(pairs)} circles of the practical range fit travel, speed and acceleration of "
            "these axes; at least 4 are needed"
        )
    tuned = tuned_on(pairs)
    on, off = Circles.of(scenario, plane, tuned), Circles.of(scenario, plane, pairs)

    def draws(count: int, seed: int) -> Iterator[Machine]:
        return (without(draw, kind, axes) for draw in cloud.draws(count, seed)) if cloud is not None else iter(())

    machines = [machine, *(draws(SEARCH_DRAWS, SEARCH_SEED) if kind != "model" else ())]
    result = _found(on, machines, kind, axes, objective, fmus, progress)

    def compensated(circles: Circles, own: Machine) -> tuple[Contour, ...]:
        torque = None
        if kind == "model":
            made = _feedforward(circles, machine, axes, fmus)
            torque = {axis: torque_scale(machine, own, axis) * values for axis, values in made.items()}
        return circles.contours(result.on(own, machine), fmus=fmus, torque=torque)

    def judged(circles: Circles, own: Machine) -> tuple[Errors, tuple[Contour, ...]]:
        free = circles.contours(frictionless(own, plane), fmus=fmus)
        return Errors.of(circles.contours(own, fmus=fmus), compensated(circles, own), free), free

    names = list(effects_of(machine, axes))
    total, done = 2 + len(names) + count, 0

    def next_one(circles: Circles, own: Machine) -> tuple[Errors, tuple[Contour, ...]]:
        nonlocal done
        progress("judging", done, total)
        done += 1
        return judged(circles, own)

    tuned_errors, _ = next_one(on, machine)
    held_errors, free = next_one(off, machine)
    changed = {effect: next_one(off, own)[0] for effect, own in names}
    drawn = []
    for k, own in enumerate(draws(count, JUDGE_SEED)):
        with draw_named(k, count):
            drawn.append(next_one(off, own)[0])
    progress("judging", total, total)
    return Judged(
        scenario, plane, tuple(axes), objective, result, tuple(tuned), tuple(pairs), tuned_errors, held_errors,
        size(extremes(free)), changed, drawn or None, cloud,
    )  # fmt: skip


def _found(
    on: Circles,
    machines: Sequence[Machine],
    kind: str,
    axes: Sequence[str],
    objective: str,
    fmus: Path | None,
    progress: Progress,
) -> Found:
    if kind == "model":
        return Found(kind, {axis: {} for axis in axes}, 0)
    machine = machines[0]
    trials = Trials.of(on, machines, fmus)
    if kind == "table":
        return table(trials, objective, progress=progress, axes=axes)
    grid = PulseGrid.measured(trials, progress=progress, axes=axes)
    accelerations = np.array([pair.acceleration for pair in on.pairs] * len(machines))
    values = {
        axis: {
            **pulse(grid, on.plane.index(axis), accelerations, objective, adapted=kind == "pulse_characteristic"),
            "delay": instant(machine, axis),
        }
        for axis in axes
    }
    values, runs = together(trials, values, objective, before=size(grid.errors[0, 0]), progress=progress)
    return Found(kind, values, runs + len(machines) * int(np.prod(grid.errors.shape[:2])))


def _feedforward(circles: Circles, machine: Machine, axes: Sequence[str], fmus: Path | None) -> TorqueFeedforward:
    """The friction model of the machine file as torque feedforward, as feedsim tune feedforward has it."""
    frictions = {axis: machine.friction_of(axis, "the model") for axis in axes}
    delays = {axis: lag_of(machine.shipped_drive(axis, "the model"), machine.cycles).delay for axis in axes}
    with FrictionLaws(fmus) as laws:
        return friction_feedforward(machine, circles.program, frictions, delays, laws)
