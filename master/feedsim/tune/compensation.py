"""A friction compensation of axes, found on some circles and judged on others."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from feedsim.analysis.figures import Array
from feedsim.cosim.feedforward import TorqueFeedforward, friction_feedforward, lag_of
from feedsim.cosim.friction_law import FrictionLaw
from feedsim.errors import InputError
from feedsim.scenario import Machine, Scenario
from feedsim.tune.circles import Circles, Pair, practical, size, tuned_on
from feedsim.tune.compensators import NEVER_WORSE, Found, Progress, PulseGrid, instant, pulse, table, together, without
from feedsim.tune.effects import Effect, effects_of, frictionless
from feedsim.uncertainty import JUDGE_SEED, SEARCH_DRAWS, SEARCH_SEED, Cloud, draw_named, torque_scale

OTHER_CAUSES = 0.1  # of the error without compensation, from where on a part that is not friction's is named


@dataclass(frozen=True, eq=False)
class Judged:
    """A compensation and what it does.

    Attributes:
        scenario, plane, axes: of what. objective: what was minimised.
        found: kind and values.
        tuned, held: pairs that it was found on, and other ones. Errors are (pairs, 2 axes of the plane) [m]:
        tuned_before, tuned_after, held_before, held_after: without and with it.
        held_frictionless: errors of the machine without friction, which no friction compensation takes off.
        changed: effect of the machine -> (2, pairs, 2) errors [m] of the pairs held out, without and with it.
        drawn: (draws, 2, pairs, 2) the same, of draws of the machine from cloud; None without.
    """

    scenario: Scenario
    plane: tuple[str, str]
    axes: tuple[str, ...]
    objective: str
    found: Found
    tuned: tuple[Pair, ...]
    held: tuple[Pair, ...]
    tuned_before: Array
    tuned_after: Array
    held_before: Array
    held_after: Array
    held_frictionless: Array
    changed: Mapping[Effect, Array]
    drawn: Array | None = None
    cloud: Cloud | None = None

    @property
    def columns(self) -> list[int]:
        """Places of the compensated axes in the plane."""
        return [self.plane.index(axis) for axis in self.axes]

    def reduction(self, before: Array, after: Array) -> Array:
        """(pairs, compensated axes) by how much the error falls [1]; below 0 it grows."""
        columns = self.columns
        return np.asarray(1 - after[:, columns] / before[:, columns])

    @property
    def beyond_friction(self) -> list[tuple[str, Pair, float, float]]:
        """Axis, pair, error without friction and before [m], of pairs held out whose error is more than friction's, the
        largest share first."""
        result = [
            (axis, pair, float(self.held_frictionless[i, k]), float(self.held_before[i, k]))
            for k, axis in zip(self.columns, self.axes, strict=True)
            for i, pair in enumerate(self.held)
        ]
        return sorted(
            (entry for entry in result if entry[2] > OTHER_CAUSES * entry[3]),
            key=lambda entry: entry[2] / entry[3],
            reverse=True,
        )

    @property
    def worse(self) -> list[tuple[str, Pair, float, float]]:
        """Axis, pair, error before and after [m] of every pair held out that gets worse by more than 5 %."""
        return [
            (axis, pair, float(self.held_before[i, k]), float(self.held_after[i, k]))
            for k, axis in zip(self.columns, self.axes, strict=True)
            for i, pair in enumerate(self.held)
            if self.held_after[i, k] > NEVER_WORSE * self.held_before[i, k]
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

    def errors(circles: Circles, own: Machine, *, compensated: bool) -> Array:
        if not compensated:
            return size(circles.errors(own, fmus=fmus))
        torque = None
        if kind == "model":
            made = _feedforward(circles, machine, axes, fmus)
            torque = {axis: torque_scale(machine, own, axis) * values for axis, values in made.items()}
        return size(circles.errors(result.on(own, machine), fmus=fmus, torque=torque))

    names = list(effects_of(machine, axes))
    total, done = 5 + len(names) + count, 0

    def both(own: Machine) -> Array:
        nonlocal done
        progress("judging", done, total)
        done += 1
        return np.array([errors(off, own, compensated=entry) for entry in (False, True)])

    progress("judging", done, total)
    tuned_before, tuned_after = (errors(on, machine, compensated=entry) for entry in (False, True))
    held_before, held_after = both(machine)
    free = errors(off, frictionless(machine, plane), compensated=False)
    changed = {effect: both(own) for effect, own in names}
    drawn = []
    for k, own in enumerate(draws(count, JUDGE_SEED)):
        with draw_named(k, count):
            drawn.append(both(own))
    progress("judging", total, total)
    return Judged(
        scenario, plane, tuple(axes), objective, result, tuple(tuned), tuple(pairs), tuned_before, tuned_after,
        held_before, held_after, free, changed, np.array(drawn) if drawn else None, cloud,
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
    if kind == "table":
        return table(on, machines, objective, fmus=fmus, progress=progress, axes=axes)
    grid = PulseGrid.measured(on, machines, fmus=fmus, progress=progress, axes=axes)
    accelerations = np.array([pair.acceleration for pair in on.pairs] * len(machines))
    values = {
        axis: {
            **pulse(grid, on.plane.index(axis), accelerations, objective, adapted=kind == "pulse_characteristic"),
            "delay": instant(machine, axis),
        }
        for axis in axes
    }
    values, runs = together(
        on, machines, values, objective, before=size(grid.errors[0, 0]), fmus=fmus, progress=progress
    )
    return Found(kind, values, runs + len(machines) * int(np.prod(grid.errors.shape[:2])))


def _feedforward(circles: Circles, machine: Machine, axes: Sequence[str], fmus: Path | None) -> TorqueFeedforward:
    """The friction model of the machine file as torque feedforward, as feedsim compensate has it."""
    frictions = {axis: machine.shipped_friction(axis, "the model") for axis in axes}
    delays = {axis: lag_of(machine.shipped_drive(axis, "the model"), machine.cycles).delay for axis in axes}
    with FrictionLaw(fmus) as law:
        return friction_feedforward(machine, circles.program, frictions, delays, law)
