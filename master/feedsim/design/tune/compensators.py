"""Kinds of friction compensation, and how their values are found on a simulated machine.

pulse, pulse_characteristic: amplitude and time constant enter a run once each, so that a grid of runs over both shows
the error of every circle for any characteristic: peak and dip are close to straight lines in the amplitude. The search
itself is on that grid, from many starts, and costs no runs. table: Gauss-Newton on the contour would need its samples;
the torques are found by coordinate steps on the errors, for both axes in the same runs. model: nothing to find, the
friction model of the machine is the compensation.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feedsim.analysis.figures import Array
from feedsim.analysis.proposals import axis_lag
from feedsim.design.tune.circles import Circles, Contour, Pair, extremes, practical, size, tuned_on
from feedsim.design.tune.knobs import Effect, effects_of, frictionless, with_groups
from feedsim.design.uncertainty import JUDGE_SEED, SEARCH_DRAWS, SEARCH_SEED, Cloud, draw_named, torque_scale
from feedsim.foundation.errors import InputError
from feedsim.scenario import Drive, Machine, Scenario
from feedsim.simulation.cosim.feedforward import TorqueFeedforward, friction_feedforward, lag_of
from feedsim.simulation.cosim.friction_law import FrictionLaws

# --- Circles that a friction compensation is found on, and what friction alone does to them ---------------------------


@dataclass(frozen=True, eq=False)
class Trials:
    """Circles that values are found on, on a machine and on draws of it.

    free: per machine the contours without friction. What they have is no error that a friction compensation is to
    take off: a pulse that made the ellipse of the drives smaller on one circle would make it larger on another.
    """

    circles: Circles
    machines: Sequence[Machine]
    free: Sequence[Sequence[Contour]]
    fmus: Path | None

    @classmethod
    def of(cls, circles: Circles, machines: Sequence[Machine], fmus: Path | None) -> Trials:
        """With the runs without friction. Raises as :meth:`errors`."""
        free = []
        for k, machine in enumerate(machines):
            with _name_draw(k, machines):
                free.append(circles.contours(frictionless(machine, circles.plane), fmus=fmus))
        return cls(circles, machines, free, fmus)

    def errors(self, group: str = "", values: Mapping[str, Mapping[str, float | bool | int]] | None = None) -> Array:
        """(machines x pairs, axes, 2) peaks and dips [m] that friction makes, where axes have a group of their drives
        with other values. Raises as :func:`feedsim.simulation.cosim.run`."""
        result = []
        for k, (machine, free) in enumerate(zip(self.machines, self.free, strict=True)):
            own = with_groups(machine, self.machines[0], group, values or {})
            with _name_draw(k, self.machines):
                result.append(extremes(self.circles.contours(own, fmus=self.fmus), free))
        return np.concatenate(result)


def _name_draw(k: int, machines: Sequence[Machine]) -> AbstractContextManager[None]:
    return draw_named(k - 1, len(machines) - 1, "which the values are found on") if k else nullcontext()


COMPENSATOR_KINDS = ("pulse", "pulse_characteristic", "table", "model")
OBJECTIVES = ("ratio", "worst", "largest")
GROUP_OF_KIND = {"pulse": "friction_pulse", "pulse_characteristic": "friction_pulse", "table": "friction_table"}
Progress = Callable[[str, int, int], None]

# Amplitudes in shares of 2 F_C/K_p, the speed error that turns the friction torque round; time constants [s].
AMPLITUDE_SHARES = (0.0, 0.08, 0.16, 0.25, 0.35, 0.5, 0.7, 1.0)
TIME_CONSTANTS = (0.01, 0.02, 0.035, 0.06, 0.1, 0.17, 0.3)
POPULATION, SURVIVORS, GENERATIONS, NARROWER = 4000, 200, 40, 0.88  # of the search on the grid
NEVER_WORSE = 1.05  # of the error without compensation, where a pair counts as worse
WEIGHT = 4.0  # exponent of the mean of ratios: large ones count more
# Speeds of the table's points [m/s]: from standstill, where friction turns round, to fast circles.
SPEEDS = tuple(speed / 60000 for speed in (0.0, 10.0, 30.0, 90.0, 250.0, 700.0, 2000.0, 6000.0))
DISTANCE = 1e-6  # [m] the longest that the control allows
PULSE_STEPS = (0.15, 0.08)  # of amplitudes and time constants, by which pulses of both axes are changed
TORQUE_STEPS = (0.5, 0.25, 0.12)  # of the friction F_C, by which torques are changed


@dataclass(frozen=True, eq=False)
class FoundCompensation:
    """A compensation of some axes.

    values: axis -> parameter of its drive (or of its group) -> SI. runs: that it took.
    """

    kind: str
    values: Mapping[str, Mapping[str, float | bool | int]]
    runs: int

    def on(self, machine: Machine, of: Machine) -> Machine:
        """A draw of the machine `of`, or that machine, with it; "model" is no part of the drive and changes nothing."""
        group = GROUP_OF_KIND.get(self.kind)
        return machine if group is None else with_groups(machine, of, group, self.values)


def remove_compensation(machine: Machine, kind: str, axes: Sequence[str]) -> Machine:
    """The machine without a compensation of that kind on some axes: one that its file has is no part of the search."""
    if (group := GROUP_OF_KIND.get(kind)) is None:
        return machine
    changed = dict(machine.axes)
    for axis in axes:
        drive = changed[axis].drive.model_copy(update={group: None})
        changed[axis] = changed[axis].model_copy(update={"drive": drive})
    return machine.model_copy(update={"axes": changed})


def scale_of(machine: Machine, axis: str) -> float:
    """2 F_C/K_p I_P [m/s]: the speed error whose torque turns the friction round. InputError: another maker's unit."""
    friction = machine.friction_of(axis, "tuning of a compensation")
    drive = machine.shipped_drive(axis, "tuning of a compensation")
    if drive.K_p <= 0:
        raise InputError(f"axis {axis}: K_p is 0; a pulse on the speed setpoint has no effect")
    return 2 * friction.F_C / drive.K_p * machine.axes[axis].I_P


def score(ratios: Array, errors: Array, objective: str) -> Array:
    """What is minimised, of ratios and errors [m] (..., pairs): the mean of the ratios with large ones counting more,
    the worst ratio, or the largest error."""
    if objective == "worst":
        return np.asarray(ratios.max(axis=-1))
    if objective == "largest":
        return np.asarray(errors.max(axis=-1))
    return np.asarray(np.mean(ratios**WEIGHT, axis=-1) ** (1 / WEIGHT))


@dataclass(frozen=True, eq=False)
class PulseGrid:
    """Errors over amplitude and time constant, of every pair and axis: (shares, times, pairs, axes, 2) [m]."""

    scales: tuple[float, float]
    errors: Array

    @classmethod
    def measured(cls, trials: Trials, *, progress: Progress, axes: Sequence[str]) -> PulseGrid:
        """Runs for every point of the grid, with both axes at the same share: pairs of all machines stand behind one
        another."""
        machine, plane = trials.machines[0], trials.circles.plane
        scales = tuple(scale_of(machine, axis) if axis in axes else 0.0 for axis in plane)
        none = trials.errors()
        values = np.empty((len(AMPLITUDE_SHARES), len(TIME_CONSTANTS), *none.shape))
        values[0] = none
        total, done = (len(AMPLITUDE_SHARES) - 1) * len(TIME_CONSTANTS), 0
        for i, share in enumerate(AMPLITUDE_SHARES[1:], start=1):
            for j, time in enumerate(TIME_CONSTANTS):
                progress("pulses", done, total)
                groups = {
                    axis: {"amplitude": share * scale, "time": time, "delay": instant(machine, axis)}
                    for axis, scale in zip(plane, scales, strict=True)
                    if scale
                }
                values[i, j] = trials.errors("friction_pulse", groups)
                done += 1
        progress("pulses", total, total)
        return cls((scales[0], scales[1]), values)

    def sizes(self, axis: int, amplitudes: Array, time: Array) -> Array:
        """(candidates, pairs) errors [m] of an axis; amplitudes (candidates, pairs) [m/s], time (candidates,) [s].

        Linear between the points of the grid, over the amplitude and the logarithm of the time constant.
        """
        i, p = _grid_position(np.array(AMPLITUDE_SHARES), amplitudes / self.scales[axis])
        j, q = _grid_position(np.log(TIME_CONSTANTS), np.log(time)[:, None])
        of, pairs = self.errors[..., axis, :], np.arange(amplitudes.shape[1])
        p, q = p[..., None], q[..., None]
        low = (1 - p) * of[i, j, pairs] + p * of[i + 1, j, pairs]
        high = (1 - p) * of[i, j + 1, pairs] + p * of[i + 1, j + 1, pairs]
        return size((1 - q) * low + q * high)


def _grid_position(grid: Array, x: Array) -> tuple[NDArray[np.int64], Array]:
    """Index of the interval of the grid that x lies in, and its share of it; beyond the ends as there."""
    i = np.clip(np.searchsorted(grid, x) - 1, 0, len(grid) - 2)
    return i, np.clip((x - grid[i]) / (grid[i + 1] - grid[i]), 0.0, 1.0)


def amplitude(values: Mapping[str, float | bool | int], a: Array) -> Array:
    """Amplitude [m/s] of a pulse over the acceleration [m/s^2], as the control's manual draws it."""
    if not values.get("adaptation"):
        return np.full(np.shape(a), float(values["amplitude"]))
    edges = [float(values[f"acceleration_{i}"]) for i in (1, 2, 3)]
    row = np.array([[values["amplitude"], values["amplitude_min"], *edges]], dtype=np.float64)
    return np.asarray(_characteristic(row, a)[0])


def _characteristic(x: Array, a: Array) -> Array:
    """(candidates, pairs) amplitudes; x (candidates, 5): dn_max, dn_min, a_1, a_2, a_3."""
    top, low, a_1, a_2, a_3 = (x[:, i, None] for i in range(5))
    share = np.clip((a - a_2) / np.maximum(a_3 - a_2, 1e-12), 0.0, 1.0)
    return np.asarray(np.where(a < a_1, top * a / a_1, top + (low - top) * share))


def pulse(
    grid: PulseGrid, axis: int, accelerations: Array, objective: str, *, adapted: bool
) -> dict[str, float | bool]:
    """The values of an axis that score best on the grid: a random population, its best ones varied ever less.

    accelerations: (pairs,) [m/s^2]. The random numbers are the same in every call.
    """
    before, scale = size(grid.errors[0, 0, :, axis]), grid.scales[axis]
    edges = math.log(accelerations.min()) - 0.5, math.log(accelerations.max()) + 0.5
    low = np.array([0.0, math.log(TIME_CONSTANTS[0]), *([0.0, edges[0], edges[0], edges[0]] if adapted else [])])
    high = np.array([1.0, math.log(TIME_CONSTANTS[-1]), *([1.0, edges[1], edges[1], edges[1]] if adapted else [])])

    def costs(x: Array) -> Array:
        top, time = scale * x[:, 0], np.exp(x[:, 1])
        at = np.repeat(top[:, None], len(accelerations), axis=1)
        if adapted:
            at = _characteristic(np.column_stack([top, scale * x[:, 2], np.exp(x[:, 3:6])]), accelerations)
        errors = grid.sizes(axis, at, time)
        return score(errors / before, errors, objective)

    random = np.random.default_rng(1)
    population = random.uniform(low, high, (POPULATION, len(low)))
    width = 0.25 * (high - low)
    for _ in range(GENERATIONS):
        population[:, 3:] = np.sort(population[:, 3:], axis=1)
        best = population[np.argsort(costs(population), kind="stable")[:SURVIVORS]]
        varied = best[random.integers(0, SURVIVORS, POPULATION - SURVIVORS)]
        varied = varied + width * random.normal(size=varied.shape)
        population = np.clip(np.concatenate([best, varied]), low, high)
        width = width * NARROWER
    population[:, 3:] = np.sort(population[:, 3:], axis=1)
    x = population[int(np.argmin(costs(population)))]
    values: dict[str, float | bool] = {"amplitude": scale * float(x[0]), "time": float(np.exp(x[1]))}
    if adapted:
        values |= {"adaptation": True, "amplitude_min": scale * float(x[2])}
        values |= {f"acceleration_{i}": float(np.exp(edge)) for i, edge in enumerate(x[3:6], start=1)}
    return values


def tune_pulses_together(
    trials: Trials, values: Mapping[str, Mapping[str, float | bool]], objective: str, *, before: Array,
    progress: Progress,
) -> tuple[dict[str, dict[str, float | bool]], int]:  # fmt: skip
    """Pulses of several axes, changed step by step where all axes together get better, and the runs that it took.

    On the grid all axes have one time constant. On small fast circles the pulse of an axis lasts into the reversal of
    the other one, so that pulses of different time constants disturb one another. Only runs with both show that.

    before: (machines x pairs, axes) errors [m] without compensation.
    """
    columns = [trials.circles.plane.index(axis) for axis in values]
    best = {axis: dict(value) for axis, value in values.items()}

    def cost(at: Mapping[str, Mapping[str, float | bool]]) -> float:
        errors = size(trials.errors("friction_pulse", at))[:, columns]
        return float(score((errors / before[:, columns]).T, errors.T, objective).mean())

    least, runs = cost(best), 1
    names = ("amplitude", "amplitude_min", "time")
    free = [(axis, name) for axis, value in best.items() for name in names if value.get(name)]  # 0 stays 0
    total = 2 * len(PULSE_STEPS) * len(free)
    for step in PULSE_STEPS:
        for axis, name in free:
            for factor in (1 + step, 1 / (1 + step)):
                progress("both axes", runs, total)
                runs += 1
                tried = {**best, axis: {**best[axis], name: factor * best[axis][name]}}
                if (result := cost(tried)) < least:
                    best, least = tried, result
                    break
    progress("both axes", total, total)
    return best, len(trials.machines) * runs


def instant(machine: Machine, axis: str) -> float:
    """Delay of a pulse [s] behind T_dyn: it begins where the axis itself reverses, its lag less T_dyn."""
    drive = machine.shipped_drive(axis, "tuning of a compensation")
    return max(0.0, axis_lag(drive) - drive.T_dyn)


def table(trials: Trials, objective: str, *, progress: Progress, axes: Sequence[str]) -> FoundCompensation:
    """Torques over the commanded speed, all at least 0, by coordinate steps of both axes in the same runs."""
    plane, machine = trials.circles.plane, trials.machines[0]
    level = {axis: machine.friction_of(axis, "tuning of a compensation").F_C for axis in axes}
    delay = {axis: _delay(machine, axis) for axis in axes}
    before = size(trials.errors())
    torques = {axis: np.zeros(len(SPEEDS)) for axis in axes}
    runs = len(trials.machines)

    def values_of(axis: str, at: Array) -> dict[str, float | bool | int]:
        values: dict[str, float | bool | int] = {"points": len(SPEEDS), "distance": DISTANCE, "delay": delay[axis]}
        values |= {f"speed_{i}": speed for i, speed in enumerate(SPEEDS)}
        return values | {f"torque_{i}": float(torque) for i, torque in enumerate(at)}

    def scores(candidates: Mapping[str, Array]) -> dict[str, float]:
        nonlocal runs
        groups = {axis: values_of(axis, at) for axis, at in candidates.items()}
        errors = size(trials.errors("friction_table", groups))
        runs += len(trials.machines)
        return {
            axis: float(score(errors[:, k] / before[:, k], errors[:, k], objective))
            for k, axis in enumerate(plane)
            if axis in candidates
        }

    best = scores(torques)
    directions = [np.ones(len(SPEEDS)), *np.eye(len(SPEEDS)), *(_step_from(i) for i in range(1, len(SPEEDS)))]
    total, done = len(TORQUE_STEPS) * len(directions) * 2, 0
    for step in TORQUE_STEPS:
        for direction in directions:
            for sign in (1.0, -1.0):
                progress("torques", done, total)
                done += 1
                tried = {axis: np.maximum(torques[axis] + sign * step * level[axis] * direction, 0.0) for axis in axes}
                if all(np.array_equal(tried[axis], torques[axis]) for axis in axes):
                    continue
                result = scores(tried)
                for axis in axes:
                    if result[axis] < best[axis]:
                        best[axis], torques[axis] = result[axis], tried[axis]
    progress("torques", total, total)
    return FoundCompensation("table", {axis: values_of(axis, torques[axis]) for axis in axes}, runs)


def _step_from(i: int) -> Array:
    return np.concatenate([np.zeros(i), np.ones(len(SPEEDS) - i)])


def _delay(machine: Machine, axis: str) -> float:
    """So that the torque acts when the axis reverses: its lag less that of its torque, less T_dyn + T_sym [s]."""
    drive = machine.shipped_drive(axis, "tuning of a compensation")
    assert isinstance(drive, Drive)
    return lag_of(drive, machine.cycles).delay - drive.T_dyn - drive.T_sym


# --- A friction compensation of axes, found on some circles and judged on others --------------------------------------


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
class JudgedCompensation:
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
    found: FoundCompensation
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
) -> JudgedCompensation:  # fmt: skip
    """Find a compensation on short circles and judge it on the practical range of radii and feeds.

    plane: axes of the circles. axes: those that are compensated, of the plane. cloud: draws of the machine that the
    values are good for; they are found on a few, and judged on `count` other ones. Raises InputError: no circle of the
    practical range fits the travel, a drive or a friction of another maker; SimulationError as a run.
    """
    machine = remove_compensation(scenario.machine, kind, axes)
    pairs = practical(machine, plane)
    if len(pairs) < 4:
        raise InputError(
            f"{plane[0]}-{plane[1]}: {len(pairs)} circles of the practical range fit travel, speed and acceleration of "
            "these axes; at least 4 are needed"
        )
    tuned = tuned_on(pairs)
    on, off = Circles.of(scenario, plane, tuned), Circles.of(scenario, plane, pairs)

    def draws(count: int, seed: int) -> Iterator[Machine]:
        return (
            (remove_compensation(draw, kind, axes) for draw in cloud.draws(count, seed))
            if cloud is not None
            else iter(())
        )

    machines = [machine, *(draws(SEARCH_DRAWS, SEARCH_SEED) if kind != "model" else ())]
    result = _find_compensation(on, machines, kind, axes, objective, fmus, progress)

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
    return JudgedCompensation(
        scenario, plane, tuple(axes), objective, result, tuple(tuned), tuple(pairs), tuned_errors, held_errors,
        size(extremes(free)), changed, drawn or None, cloud,
    )  # fmt: skip


def _find_compensation(
    on: Circles,
    machines: Sequence[Machine],
    kind: str,
    axes: Sequence[str],
    objective: str,
    fmus: Path | None,
    progress: Progress,
) -> FoundCompensation:
    if kind == "model":
        return FoundCompensation(kind, {axis: {} for axis in axes}, 0)
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
    values, runs = tune_pulses_together(trials, values, objective, before=size(grid.errors[0, 0]), progress=progress)
    return FoundCompensation(kind, values, runs + len(machines) * int(np.prod(grid.errors.shape[:2])))


def _feedforward(circles: Circles, machine: Machine, axes: Sequence[str], fmus: Path | None) -> TorqueFeedforward:
    """The friction model of the machine file as torque feedforward, as feedsim tune feedforward has it."""
    frictions = {axis: machine.friction_of(axis, "the model") for axis in axes}
    delays = {axis: lag_of(machine.shipped_drive(axis, "the model"), machine.cycles).delay for axis in axes}
    with FrictionLaws(fmus) as laws:
        return friction_feedforward(machine, circles.program, frictions, delays, laws)
