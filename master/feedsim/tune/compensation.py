"""A friction compensation of axes, found on some circles and judged on others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from feedsim.analysis.figures import Array
from feedsim.cosim.feedforward import TorqueFeedforward, friction_feedforward, lag_of
from feedsim.cosim.friction_law import FrictionLaw
from feedsim.errors import InputError
from feedsim.scenario import Machine, Scenario
from feedsim.tune.circles import Circles, Pair, practical, size, tuned_on
from feedsim.tune.compensators import NEVER_WORSE, Found, Progress, PulseGrid, instant, pulse, table

FRICTION_CHANGE = 0.2  # of the friction, with which a setting is tried besides
SCALED = ("F_C", "F_S", "F_log")


@dataclass(frozen=True, eq=False)
class Judged:
    """A compensation and what it does.

    Attributes:
        scenario, plane, axes: of what. objective: what was minimised.
        found: kind and values.
        tuned, held: pairs that it was found on, and other ones. Errors are (pairs, 2 axes of the plane) [m]:
        tuned_before, tuned_after, held_before, held_after: without and with it.
        changed: change of the friction [1] -> (2, pairs, 2) errors [m] of the pairs held out, without and with it.
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
    changed: Mapping[float, Array]

    @property
    def columns(self) -> list[int]:
        """Places of the compensated axes in the plane."""
        return [self.plane.index(axis) for axis in self.axes]

    def reduction(self, before: Array, after: Array) -> Array:
        """(pairs, compensated axes) by how much the error falls [1]; below 0 it grows."""
        columns = self.columns
        return np.asarray(1 - after[:, columns] / before[:, columns])

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
    fmus: Path | None, progress: Progress,
) -> Judged:  # fmt: skip
    """Find a compensation on short circles and judge it on the practical range of radii and feeds.

    plane: axes of the circles. axes: those that are compensated, of the plane. Raises InputError: no circle of the
    practical range fits the travel, a drive or a friction of another maker; SimulationError as a run.
    """
    machine = scenario.machine
    held = practical(machine, plane)
    if len(held) < 4:
        raise InputError(
            f"{plane[0]}-{plane[1]}: {len(held)} circles of the practical range fit travel, speed and acceleration of "
            "these axes; at least 4 are needed"
        )
    tuned = tuned_on(held)
    on, off = Circles.of(scenario, plane, tuned), Circles.of(scenario, plane, held)
    found = _found(on, machine, kind, axes, objective, fmus, progress)

    def errors(circles: Circles, own: Machine, *, compensated: bool) -> Array:
        if not compensated:
            return size(circles.errors(own, fmus=fmus))
        torque = _feedforward(circles, machine, axes) if kind == "model" else None
        return size(circles.errors(found.on(own), fmus=fmus, torque=torque))

    total = 4 + 2 * 2
    results: list[Array] = []
    for circles, compensated in ((on, False), (on, True), (off, False), (off, True)):
        progress("judging", len(results), total)
        results.append(errors(circles, machine, compensated=compensated))
    changed: dict[float, Array] = {}
    for change in (FRICTION_CHANGE, -FRICTION_CHANGE):
        progress("judging", 4 + 2 * len(changed), total)
        own = _with_friction(machine, axes, 1 + change)
        changed[change] = np.array([errors(off, own, compensated=each) for each in (False, True)])
    progress("judging", total, total)
    tuned_before, tuned_after, held_before, held_after = results
    return Judged(
        scenario, plane, tuple(axes), objective, found, tuple(tuned), tuple(held), tuned_before, tuned_after,
        held_before, held_after, changed,
    )  # fmt: skip


def _found(
    on: Circles, machine: Machine, kind: str, axes: Sequence[str], objective: str, fmus: Path | None, progress: Progress
) -> Found:
    if kind == "model":
        return Found(kind, {axis: {} for axis in axes}, 0)
    if kind == "table":
        return table(on, machine, objective, fmus=fmus, progress=progress, axes=axes)
    grid = PulseGrid.measured(on, machine, fmus=fmus, progress=progress, axes=axes)
    accelerations = np.array([each.acceleration for each in on.pairs])
    values = {
        axis: {
            **pulse(grid, on.plane.index(axis), accelerations, objective, adapted=kind == "pulse_characteristic"),
            "delay": instant(machine, axis),
        }
        for axis in axes
    }
    return Found(kind, values, int(np.prod(grid.errors.shape[:2])))


def _feedforward(circles: Circles, machine: Machine, axes: Sequence[str]) -> TorqueFeedforward:
    """The friction model of the machine file as torque feedforward, as feedsim compensate has it."""
    frictions = {axis: machine.shipped_friction(axis, "the model") for axis in axes}
    delays = {axis: lag_of(machine.shipped_drive(axis, "the model"), machine.cycles).delay for axis in axes}
    with FrictionLaw() as law:
        return friction_feedforward(machine, circles.program, frictions, delays, law)


def _with_friction(machine: Machine, axes: Sequence[str], factor: float) -> Machine:
    own = {}
    for axis in axes:
        friction = machine.shipped_friction(axis, "a changed friction")
        scaled = {name: factor * getattr(friction, name) for name in SCALED}
        own[axis] = machine.axes[axis].model_copy(update={"friction": friction.model_copy(update=scaled)})
    return machine.model_copy(update={"axes": {**machine.axes, **own}})
