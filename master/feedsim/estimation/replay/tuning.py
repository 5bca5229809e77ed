"""The units on one record, over the parameters of a drive: residuals of position and torque, by least squares.

The parameters are in parameters.py. A run of the units is what costs, and a Jacobian by differences is a run for every
parameter. It is therefore taken over from one fit to the next (estimation/least_squares.py); cross-validation and
intervals take differences anew.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from math import exp, hypot, inf, log, log1p, nan, sqrt
from threading import Lock
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from feedsim.estimation.identify.clipping import limit_shown
from feedsim.estimation.identify.parameters import EXCESS
from feedsim.estimation.identify.position_loop import rms
from feedsim.estimation.identify.result import Estimate
from feedsim.estimation.least_squares import (
    NORMAL_95,
    GiveUp,
    LeastSquares,
    Point,
    correlation_length,
    half_width,
    never,
    secant,
    secant_from,
)
from feedsim.estimation.parameter import Parameter
from feedsim.estimation.replay.closed_loop import AxisRecord, Mask, Replay, of_cycle, per_row_of
from feedsim.estimation.replay.machine_files import KEYS, modes_of, with_modes
from feedsim.files.trace.trace import Array
from feedsim.foundation.errors import FeedsimError, InputError
from feedsim.foundation.parallel import in_parallel, in_threads
from feedsim.scenario import Filter, Machine

# --- The parameters of a fit of a drive: what each may be, how it is scaled, and what is known of it beforehand -------
# They are those of the drive and the friction, but for three: K_i = K_p/T_n, `excess` = F_S - F_C, and `delay`, by
# how
# much the torque is logged later than the motion. Every parameter has a prior: its start, and a standard deviation
# about
# it, of the logarithm where it is known by its order of magnitude.


SPAN = 4.0  # standard deviations of the prior that a logarithm may be off its start
LEAST_SHAPE = 1e-3  # of a mode at the scale, over the rigid motion's
DIFFERENCE = 1e-3  # step of differences: of the logarithm, or of a tenth of the prior's standard deviation


@dataclass(frozen=True)
class Row:
    """A row of the table.

    Attributes:
        deviation: standard deviation of the prior about the start, of the logarithm where log, else of the value.
        log: scaled by the logarithm, and bounded by SPAN deviations.
        lower, upper: bounds, where not log.
        no_effect: values at which a part of the friction law has no effect, or runs away.
        of_friction: deviation, bounds and no_effect are shares of F_C at the start.
    """

    deviation: float
    log: bool = False
    lower: float = -inf
    upper: float = inf
    no_effect: tuple[float, ...] = ()
    of_friction: bool = False


# The inertia begins with the rigid line's, which accelerations determine well; where they do not, its deviation is
# that line's (J_sigma of the start). A mode's place is known by regression ahead of the fit.
TABLE: Mapping[str, Row] = {
    "J": Row(0.05, log=True),
    "K_p": Row(1.0, log=True),
    "K_i": Row(1.5, log=True),
    "K_v": Row(1.0, log=True),
    "omega_0": Row(0.7, log=True),
    "D": Row(0.5, log=True),
    "filter_1.f": Row(0.7, log=True),  # of the low-pass that stands for a current loop
    "filter_1.D_den": Row(0.5, log=True),
    "k_ffw": Row(0.5, lower=0.0, upper=1.5),
    "T_sym": Row(3e-3, lower=0.0, upper=0.02),
    "T_dyn": Row(10e-3, lower=0.0, upper=0.1),
    "delay": Row(1e-3, lower=-5e-3, upper=5e-3),
    "M_0": Row(5.0, of_friction=True),
    "F_C": Row(0.7, log=True),
    EXCESS: Row(0.5, lower=0.0, upper=3.0, no_effect=(0.0, 3.0), of_friction=True),
    "v_s": Row(1.5, log=True),
    "F_log": Row(2.0, lower=0.0, no_effect=(0.0,), of_friction=True),
    "sigma_0": Row(1.5, log=True),
    "sigma_1": Row(2.0, log=True),
    "sigma_2": Row(1.5, log=True),
    "W": Row(1.5, log=True),
    "gamma": Row(0.5, lower=1e-3, upper=1.0, no_effect=(1.0,)),
    "asymmetry": Row(0.2, lower=-0.6, upper=0.6, no_effect=(-0.6, 0.6)),
    # Of the elastic modes, numbered from 1: mode_f_1.
    "mode_f": Row(0.1, log=True),
    "mode_D": Row(0.7, log=True),
    "mode_u": Row(0.7, log=True),
    "mode_v": Row(1.0),  # of the start
}


def row(name: str) -> Row:
    """Of a parameter, those of modes included."""
    return TABLE[name] if name in TABLE else TABLE[name.rpartition("_")[0]]


def parameter(name: str, start: Mapping[str, float]) -> Parameter:
    """With its bounds and the prior's deviation as scale; position 0 is the start.

    start: all values to begin with; J_sigma: deviation of the logarithm of the inertia, where it is known; NAME_most:
        what a logarithm's value is at most.
    """
    own, value = row(name), start[name]
    unit = start["F_C"] if own.of_friction else 1.0
    deviation = own.deviation * unit
    if name == "J":
        deviation = max(deviation, start.get("J_sigma", 0.0))
    elif name.startswith("mode_v"):
        deviation = max(abs(value), LEAST_SHAPE)
    lower, upper = own.lower * unit, own.upper * unit
    if own.log:
        lower, upper = value * exp(-SPAN * deviation), value * exp(SPAN * deviation)
        upper = min(upper, start.get(f"{name}_most", inf))
    return Parameter(name, value, lower, upper, scale=deviation, log=own.log, origin=value)


def difference(of: Parameter) -> float:
    """Step of the differences in a parameter's position."""
    return DIFFERENCE / of.step if of.log else 0.1 * DIFFERENCE


def no_effect(name: str, value: float, start: Mapping[str, float]) -> bool:
    """Whether a fit has moved a value to where it has no effect, or to the end of its range."""
    own, moved = row(name), parameter(name, start)
    if own.log:
        return abs(moved.inward(value)) > 0.95 * SPAN
    unit = start["F_C"] if own.of_friction else 1.0
    return any(abs(value - end * unit) < 0.01 * moved.step for end in own.no_effect)


Rows = NDArray[np.int64]
S = TypeVar("S")
T = TypeVar("T")

# A tuned speed loop has this damping at least, give or take DAMPING_DEVIATION of the logarithm.
LEAST_DAMPING, DAMPING_DEVIATION = 0.7, 0.2
# [m], share of the torque: no channel is weighted as better than that.
LEAST_WEIGHT = {"position": 1e-9, "torque": 1e-3}

# Share of the cost: predicted reduction of a step at which a fit ends. The cost counts independent rows, some hundred.
# A fit that ends COMPARED_TOLERANCE off its least is off by a few hundredths of the logarithm of the likelihood, or a
# fifth of a standard deviation; FINAL_TOLERANCE is a tenth of that, and a third of the deviation. FIRST_TOLERANCE is to
# begin with, where weights are guessed.
FIRST_TOLERANCE, COMPARED_TOLERANCE, FINAL_TOLERANCE = 3e-3, 2e-4, 3e-5


@dataclass(frozen=True, eq=False)
class DriveFit:
    """A fit.

    Attributes:
        names, values: of what was free. point: in usual deviations from the start.
        residuals: (2 N + M,) of position and torque in their weights, and of what is usual. jacobian: (2 N + M, P) of
            them, over usual deviations. counted: (N,) rows whose torque counts.
    """

    names: tuple[str, ...]
    values: Mapping[str, float]
    point: Point
    residuals: Array
    jacobian: Array
    counted: Mask

    @property
    def position(self) -> Array:
        """(N,) what is left [m]."""
        return self.point.errors[: len(self.point.errors) // 2]

    @property
    def torque(self) -> Array:
        """What is left [N.m], of the rows that count."""
        return self.point.errors[len(self.point.errors) // 2 :][self.counted]


def first_weights(each: AxisRecord) -> dict[str, float]:
    """What a residual is worth ahead of any fit: position [m], torque [N.m]."""
    return {"position": 1e-6, "torque": 0.05 * rms(each.record.torque) + 1e-9 if each.record.driven else 1.0}


class Simulated(NamedTuple):
    """A run of the units: of what, x_a [m] at the rows and M_a [N.m] between them, too."""

    machine: Machine
    start: Mapping[str, float]
    preloaded: bool
    values: Mapping[str, float]  # but for the delay, which does not move the units
    x_a: Array
    M_a: Array


@dataclass(eq=False)
class Problem:
    """The units on one record, over the parameters that are free."""

    machine: Machine
    each: AxisRecord
    replay: Replay
    start: dict[str, float]
    total: float | None  # T_dyn + T_sym where it is known
    J: float
    weights: dict[str, float]
    rows: Rows  # that are fitted
    runs: int = 0
    simulated: deque[Simulated] = field(default_factory=lambda: deque(maxlen=8))  # the last runs
    lock: Lock = field(default_factory=Lock)

    def branch(self, of: Callable[[Problem, S], T], values: Sequence[S]) -> list[tuple[T, Problem]]:
        """`of` every value, and the problem of its own that it was given, with what it has changed there.

        In processes side by side: threads would wait for each other, as a third of a run is Python. The runs are those
        of one after the other, since a problem does not see the last runs of those beside it.

        of: may change machine, start and weights of its problem; its result can be pickled.
        """

        def one(value: S, _: object) -> tuple[T, int, dict[str, Any]]:
            beside = replace(self, runs=0, simulated=deque(self.simulated, maxlen=8), lock=Lock())
            result = of(beside, value)
            changed = {
                name: own
                for name in ("machine", "start", "weights")
                if (own := getattr(beside, name)) is not getattr(self, name)
            }
            return result, beside.runs, changed

        done = in_parallel([partial(one, value) for value in values])
        self.runs += sum(runs for _, runs, _ in done)
        return [(result, replace(self, **changed)) for result, _, changed in done]

    def tuned(self, values: Mapping[str, float]) -> tuple[Machine, float]:
        """The machine with values, and what its torques are to be multiplied with.

        Another inertia is the same motion under torques that are that many times larger: no plant is made anew.
        """
        scale = (self.start | dict(values))["J"] / self.J
        return self.machine_of(values, scale), scale

    def machine_of(self, values: Mapping[str, float], scale: float = 1.0) -> Machine:
        """The machine with values, all torques of the axis divided by `scale`."""
        values = self.start | dict(values)
        own = self.machine.axes[self.each.axis]
        shipped = self.machine.shipped_drive(self.each.axis, "the identification of a drive")
        T_dyn = self.T_dyn(values)
        drive = shipped.model_copy(
            update={
                "K_v": values["K_v"], "k_ffw": values["k_ffw"], "T_sym": values["T_sym"], "T_dyn": T_dyn,
                "K_p": values["K_p"] / scale, "T_n": values["K_p"] / values["K_i"], "M_max": shipped.M_max / scale,
                **{name: values[name] for name in ("omega_0", "D") if shipped.reference_model},
            }
        )  # fmt: skip
        if "filter_1.f" in values:
            of_filter = {name: values[f"filter_1.{name}"] for name in ("f", "D_den") if f"filter_1.{name}" in values}
            low_pass = drive.filter_1.model_copy(update=of_filter)
            drive = drive.model_copy(update={"filter_1": low_pass})
        torques = {name: values[name] / scale for name in ("F_C", "sigma_0", "sigma_1", "sigma_2", "F_log")}
        friction = self.machine.shipped_friction(self.each.axis, "the identification of a drive").model_copy(
            update={
                **torques, "F_S": torques["F_C"] + values[EXCESS] / scale,
                **{name: values[name] for name in ("v_s", "W", "gamma", "asymmetry")},
            }
        )  # fmt: skip
        load = {"constant_load": values["M_0"] / scale, "drive": drive, "friction": friction}
        axes = self.machine.axes | {self.each.axis: own.model_copy(update=load)}
        machine = self.machine.model_copy(update={"axes": axes})
        modes = modes_of(values)
        return with_modes(machine, self.each.axis, modes) if modes else machine

    def T_dyn(self, values: Mapping[str, float]) -> float:
        """What T_sym leaves of the whole delay, where that is known."""
        return values["T_dyn"] if self.total is None else max(self.total - values["T_sym"], 0.0)

    @property
    def counted(self) -> Mask:
        """(N,) of `rows`: whether the torque counts."""
        return self.each.counted[self.rows]

    @property
    def per_row(self) -> int:
        """Samples of the simulation per row: the delay of the torque lies between rows."""
        return per_row_of(self.replay.interval, self.machine)

    def errors(self, values: Mapping[str, float]) -> tuple[Array, Array]:
        """(N,) of the position [m] and (N,) of the torque [N.m], at the rows of the record.

        A torque that the record cuts off is none that the motor has: it is 0 there.
        """
        result = self.run(values)
        delay = (self.start | dict(values))["delay"]
        time, h = self.replay.time, self.replay.interval / self.per_row
        fine = time[0] + h * np.arange(len(result.M_a))
        torque = np.interp(time - delay, fine, result.M_a)
        off = torque - self.each.record.torque if self.each.record.driven else np.zeros(len(time))
        off = np.where(self.each.counted, off, 0.0)
        return result.x_a - self.each.position, off

    def run(self, values: Mapping[str, float]) -> Simulated:
        """The units with values; one of the last runs where it had the same ones. InputError: they run away."""
        own = {name: value for name, value in values.items() if name != "delay"}
        with self.lock:
            for last in self.simulated:
                same = last.machine is self.machine and last.start is self.start
                if same and last.preloaded == self.replay.preloaded and last.values == own:
                    return last
            self.runs += 1
        machine, scale = self.tuned(values)
        try:
            result = self.replay.follow(machine, ("x_a", "M_a"), self.per_row, scale)[self.each.axis]
        except FeedsimError as error:  # a drive that is unstable runs away until its numbers do
            raise InputError(str(error)) from None
        x_a, M_a = np.array(result["x_a"][:: self.per_row]), scale * result["M_a"]
        done = Simulated(self.machine, self.start, self.replay.preloaded, own, x_a, M_a)
        with self.lock:
            self.simulated.append(done)
        return done

    def damping_penalty(self, values: Mapping[str, float]) -> float:
        """How far the speed loop J s^2 + K_p s + K_i is less damped than a tuned one, in standard deviations."""
        values = self.start | dict(values)
        damping = values["K_p"] / (2 * sqrt(values["J"] * values["K_i"]))
        return max(0.0, log(LEAST_DAMPING / damping)) / DAMPING_DEVIATION

    def no_effect(self, name: str, value: float) -> bool:
        """Whether a value has no effect, or lies at the end of its range."""
        return no_effect(name, value, self.start)

    def deviation(self, name: str, values: Mapping[str, float]) -> float:
        """Standard deviation of a parameter's prior, in its own unit, at values."""
        return parameter(name, self.start).slope(abs(values[name]))

    def weigh(self, tuned: DriveFit) -> None:
        """Take what is left with what was found as what a residual is worth.

        What is left of either channel is correlated over rows, and counts by as many as say something of their own:
        so the channels are weighed against each other, and against what is usual.
        """
        position, torque = tuned.position, tuned.torque
        least = LEAST_WEIGHT["torque"] * rms(self.each.record.torque[self.rows]) if self.each.record.driven else 1.0
        self.weights = {
            "position": max(rms(position), LEAST_WEIGHT["position"])
            * sqrt(correlation_length(position - np.mean(position))),
            "torque": max(rms(torque), least) * sqrt(correlation_length(torque - np.mean(torque))),
        }

    def first(self, free: Sequence[str]) -> DriveFit:
        """A fit from the start, whose weights are those of what is left."""
        fit = self.fitted(free, {}, tolerance=FIRST_TOLERANCE)
        self.weigh(fit)
        fit = self.continued(fit)
        self.weigh(fit)
        return fit

    def fitted(
        self,
        free: Sequence[str],
        begin: Mapping[str, float],
        near: DriveFit | None = None,
        tolerance: float = COMPARED_TOLERANCE,
        give_up: GiveUp = never,
    ) -> DriveFit:
        """From `begin`, with the weights as they are, to where no step has a predicted reduction above that share.

        near: a fit nearby, whose Jacobian is taken over. give_up: as of a search (estimation/least_squares.py).
        """
        names = tuple(free)
        problem = self._least_squares(names)
        slopes = np.full((2 * len(self.rows), len(names)), nan)
        for k, name in enumerate(names):
            if near is not None and name in near.names:
                slopes[:, k] = near.point.slopes[:, near.names.index(name)]
        return self._drive_fit(problem, secant(problem, problem.position(begin), slopes, tolerance, give_up))

    def continued(self, fit: DriveFit, tolerance: float = COMPARED_TOLERANCE) -> DriveFit:
        """From where a fit of this problem has ended, with the weights as they are."""
        problem = self._least_squares(fit.names)
        return self._drive_fit(problem, secant_from(problem, fit.point, tolerance))

    def near(self, fit: DriveFit) -> DriveFit:
        """The same with its Jacobian by differences there, or where the fit was hardly another one: what
        cross-validation is taken from."""
        problem = self._least_squares(fit.names)
        return self._drive_fit(problem, fit.point if fit.point.near else problem.exact(fit.point))

    def exact(self, fit: DriveFit, central: bool = False) -> DriveFit:
        """The same with its Jacobian by differences, which intervals are taken from."""
        problem = self._least_squares(fit.names)
        return self._drive_fit(problem, problem.exact(fit.point, central))

    def residuals(self, names: Sequence[str], values: Mapping[str, float]) -> Array:
        """(2 N + M,) as those of a fit, without one."""
        problem = self._least_squares(tuple(names))
        x = problem.position(values)
        return problem.weighted(x, problem.errors(x))

    def cost(self, names: tuple[str, ...], point: Point) -> float:
        """Half the sum of squares, with the weights as they are."""
        return self._least_squares(names).cost(point.x, point.errors)

    def moved(self, fit: DriveFit, step: Array) -> dict[str, float]:
        """The values of a fit after a step (P,) in usual deviations, within the bounds."""
        problem = self._least_squares(fit.names)
        return problem.values(np.clip(fit.point.x + step, problem.low, problem.high))

    def _least_squares(self, names: tuple[str, ...]) -> LeastSquares:
        """The sum of squares over both channels in their weights and over how far every parameter is off its start."""
        parameters = [parameter(name, self.start) for name in names]

        def errors(values: Mapping[str, float]) -> Array:
            position, torque = self.errors(values)
            return np.concatenate([position[self.rows], torque[self.rows]])

        def prior(x: Array) -> Array:
            return np.append(x, self.damping_penalty(problem.values(x)))

        weights = np.repeat([self.weights["position"], self.weights["torque"]], len(self.rows))
        steps = np.array([difference(entry) for entry in parameters])
        problem = LeastSquares(errors, parameters, steps, prior, weights, _first_and_then_others)
        return problem

    def _drive_fit(self, problem: LeastSquares, point: Point) -> DriveFit:
        values, residuals, jacobian = problem.values(point.x), problem.residuals(point), problem.jacobian(point)
        return DriveFit(problem.names, values, point, residuals, jacobian, self.counted)


def _first_and_then_others(of: Callable[[Array], Array], points: Sequence[Array]) -> list[Array]:
    """The first one is moved by the delay alone, which is the run that the others may forget."""
    return [*map(of, points[:1]), *in_threads(of, points[1:])]


# --- The cycle in which a control closes its position loop: the axis fitted with another one, and a test between both -
# Two cycles are two models that do not contain one another. The record decides between them where the sum of the
# rows'
# logarithms of the likelihood differs by more than its own scatter, 95 % (Q. H. Vuong, Econometrica 57 (1989),
# 307-333).
# That holds for models neither of which is quite the axis. Rows depend on each other, so that the scatter counts
# their
# correlation over time.


CLEARLY = 1.5  # of what decides between cycles: a fit that the record speaks against by so much is not finished
OTHER_CYCLE_TEXT = "with a position cycle of {:g} ms, which fits as well, it is {:.4g} {}"


@dataclass(frozen=True, eq=False)
class OtherCycle:
    """A fit with another cycle of the position loop than the one that was taken.

    Attributes:
        cycle: [s].
        gain: by how much the record is likelier with it (logarithm). sigma: standard deviation of that.
        estimates: with it; empty where the record speaks against it.
    """

    cycle: float
    gain: float
    sigma: float
    estimates: Mapping[str, Estimate] = field(default_factory=dict)


def decision(others: Sequence[OtherCycle]) -> int:
    """1 where the records of all axes together speak for the other cycle, -1 against it, 0 where they do not decide."""
    gain, sigma = sum(other.gain for other in others), hypot(*(other.sigma for other in others))
    return int(gain > NORMAL_95 * sigma) - int(gain < -NORMAL_95 * sigma)


def other_cycle(
    problem: Problem, fit: DriveFit, cycle: float, judged: Callable[[DriveFit], Mapping[str, Estimate]]
) -> OtherCycle:
    """A fit once more, with another cycle of the position loop [s].

    The rigid line of a record is no measure of the inertia in every cycle, so the fit may leave it as that cycle asks.

    judged: estimates of a fit.
    """
    machine, weights, start = problem.machine, problem.weights, problem.start
    cycles = machine.cycles.model_copy(update={"position": cycle})
    problem.machine = machine.model_copy(update={"cycles": cycles})
    problem.start = of_cycle(start, cycle, problem.each.record.interval)
    try:
        at_bound = fit.values["T_sym"] <= TABLE["T_sym"].lower

        def spoken_against(point: Point, predicted: float, taken: int) -> bool:
            """Whether the record speaks clearly against this cycle, were the cost twice as much less as predicted."""
            share = min(2 * predicted / problem.cost(fit.names, point), 0.99)
            reserve = -0.5 * (len(fit.counted) + np.count_nonzero(fit.counted)) * log1p(-share)
            gain, sigma = gain_of(_likelihood(point, fit.counted) - _likelihood(fit.point, fit.counted))
            return bool(gain + reserve < -CLEARLY * NORMAL_95 * sigma)

        fits = [problem.fitted(fit.names, fit.values, fit, give_up=never if at_bound else spoken_against)]
        if at_bound or not spoken_against(fits[0].point, 0.0, 0):
            problem.weigh(fits[0])
            fits = [problem.continued(fits[0])]
        if at_bound:
            # A wrong cycle has driven the delay to its bound; what it leaves of the position has no weight any more.
            problem.weights = first_weights(problem.each)
            with suppress(InputError):
                fits.append(problem.first(fit.names))
        best = max(fits, key=lambda one: float(np.sum(_likelihood(one.point, one.counted))))
        gain, sigma = gain_of(_likelihood(best.point, best.counted) - _likelihood(fit.point, fit.counted))
        if gain < -NORMAL_95 * sigma:
            return OtherCycle(cycle, gain, sigma)
        problem.weigh(best)
        best = problem.exact(problem.continued(best), central=True)
        return OtherCycle(cycle, gain, sigma, judged(best))
    finally:
        problem.machine, problem.weights, problem.start = machine, weights, start


def _likelihood(point: Point, counted: Mask) -> Array:
    """(N,) logarithm of the likelihood of every row, normally distributed by what is left there of either channel.

    counted: (N,) rows whose torque counts.
    """
    position, of_torque = np.split(point.errors, 2)
    torque = np.zeros(len(counted))
    torque[counted] = _of_channel(of_torque[counted])
    return _of_channel(position) + torque


def _of_channel(remaining: Array) -> Array:
    sigma = rms(remaining)
    return np.asarray(-0.5 * (remaining / sigma) ** 2 - log(sigma)) if sigma > 0 else np.full(len(remaining), inf)


def gain_of(differences: Array) -> tuple[float, float]:
    """Sum of the rows' differences (N,) of the logarithm of the likelihood, and its standard deviation."""
    scatter = differences - np.mean(differences)
    length = correlation_length(scatter, of_mean=True)
    return float(np.sum(differences)), sqrt(float(np.sum(scatter**2)) * length)


def with_either(estimates: Mapping[str, Estimate], other: OtherCycle) -> dict[str, Estimate]:
    """Estimates of a record that does not decide between two cycles.

    A value that lies outside of its interval with the other cycle is not determined. It keeps its interval, which
    belongs to the cycle that was taken. The other intervals include that of the other cycle.
    """
    result = dict(estimates)
    for name, one in estimates.items():
        if name not in other.estimates or one.status != "estimated":
            continue
        value, half = other.estimates[name].value, half_width(one.sigma)
        moved = abs(value - one.value)
        if moved > half:
            reason = OTHER_CYCLE_TEXT.format(1e3 * other.cycle, value, one.unit)
            result[name] = replace(one, status="undetermined", reason=reason)
        else:
            both = max(half, moved + half_width(other.estimates[name].sigma))
            result[name] = replace(one, sigma=both / NORMAL_95).judged()
    return result


# --- Rival structures of a drive: a fit is tried again with what the record may hold besides --------------------------
# A structure that the axis has and the fit lacks is made up for by parameters of the fit, in narrow intervals around
# wrong values. Every rival contains the fit as a limit, so that a test of nested models decides: twice the gain of the
# logarithm of the likelihood is chi-square distributed where the rival has nothing to explain (S. S. Wilks, Ann. Math.
# Statist. 9 (1938), 60-62). Rows count by how many say something of their own, as the weights of a problem have it.


FITTED_SHARE = 0.5  # of what the test needs: a rival that is predicted to gain less is not fitted
# A rival is given up that does not reach the fit without it by so many times of what differences predict, or has so
# many times its cost where they were taken so often.
PREDICTION_FACTOR, COST_FACTOR, DIFFERENCES_TO_JUDGE = 2.0, 2.0, 2
ERROR_RATE = 0.01  # of each test: how often a rival is taken that the axis does not have
CURRENT_DAMPING, OTHER_DAMPING = 1.0, 0.7  # of the low-pass that stands for a current loop: at first, and as it begins
BEGIN_CURRENT = 1400.0  # [Hz] of that low-pass: twice the bandwidth
BEGIN_MODEL = {"omega_0": 1000.0, "D": 1.0}  # [rad/s], [1] of a reference model
# Of elastic modes that a rigid axis may have: [Hz], damping, and shape at motor and scale over that of rigid motion.
MODE_PLACES, MODE_DAMPING, MODE_SHAPE = (25.0, 50.0, 100.0), 0.03, 0.3


@dataclass(frozen=True)
class RivalStructure:
    """A structure. drive: what it changes of the drive. begin: further parameters, with their start; a limit is no
    parameter, but what the record shows."""

    name: str
    drive: Mapping[str, Any]
    begin: Mapping[str, float] = field(default_factory=dict)

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the test."""
        return max(len(self.begin), 1)


@dataclass(frozen=True, eq=False)
class TriedRival:
    """A rival beside a fit.

    Attributes:
        gain: of the logarithm of the likelihood: of a fit with it, or predicted where that is far too little for one.
        least: what it has to be. taken: whether the fit has the rival.
        values: name -> what parameters of the fit may be with the rival, as far as the record does not exclude it.
    """

    name: str
    gain: float
    least: float
    taken: bool
    values: Mapping[str, float] = field(default_factory=dict)


def rivals_of(problem: Problem) -> list[RivalStructure]:
    """What the drive of a problem may have besides."""
    drive = problem.machine.shipped_drive(problem.each.axis, "the identification of a drive")
    result = []
    limit = limit_shown(problem.each.record)
    if limit is not None and limit < drive.M_max:
        result.append(RivalStructure("torque limit", {"M_max": limit}))
    if not drive.reference_model:
        result.append(RivalStructure("reference model", {"reference_model": True, **BEGIN_MODEL}, BEGIN_MODEL))
    if drive.ideal_current_loop and drive.filter_1.type == "off":
        low_pass = Filter.model_construct(type="low_pass", f=BEGIN_CURRENT, D_num=None, D_den=CURRENT_DAMPING)
        result.append(RivalStructure("current loop", {"filter_1": low_pass}, {"filter_1.f": BEGIN_CURRENT}))
    elif "filter_1.D_den" not in problem.start and drive.filter_1.type == "low_pass":
        result.append(RivalStructure("damping of the current loop", {}, {"filter_1.D_den": OTHER_DAMPING}))
    return result


def possible_modes(problem: Problem, fit: DriveFit) -> list[TriedRival]:
    """What an elastic mode may do to the values of a rigid axis: at places over the usual range, by two runs each, in
    which the scale moves with the motor and against it."""
    places = [(frequency, sign) for frequency in MODE_PLACES for sign in (1.0, -1.0)]

    def predict(beside: Problem, place: tuple[float, float]) -> TriedRival:
        frequency, sign = place
        mode = frequency, MODE_DAMPING, MODE_SHAPE, sign * MODE_SHAPE
        beside.start = problem.start | dict(zip((f"{key}_1" for key in KEYS), mode, strict=True))
        return _predict_rival(beside, RivalStructure(f"elastic mode of {frequency:g} Hz", {}), fit, len(places))

    tried = [one for one, _ in problem.branch(predict, places)]
    return [max(both, key=lambda one: one.gain) for both in zip(tried[::2], tried[1::2], strict=True)]


def with_rivals(
    problem: Problem, fit: DriveFit, misses: Callable[[DriveFit], bool]
) -> tuple[DriveFit, list[TriedRival]]:
    """The fit with the rivals that the record asks for, one after the other, and what was tried; the problem has their
    structure then.

    misses: whether a fit contradicts what the record shows without one, and may have ended far away.
    """
    tried: dict[str, TriedRival] = {}
    far = misses(fit)
    while True:
        fit = problem.near(fit)
        rivals = rivals_of(problem)
        predicted = [one for one, _ in problem.branch(partial(_predict_rival, fit=fit), rivals)]
        tried |= {one.name: one for one in predicted}
        asked = [
            (rival, one)
            for rival, one in zip(rivals, predicted, strict=True)
            if far or one.gain > FITTED_SHARE * one.least
        ]
        best: tuple[TriedRival, DriveFit, Problem] | None = None
        fits = problem.branch(partial(_best_fit, fit=fit, misses=misses if far else None), asked)
        for (_, one), (other, beside) in zip(asked, fits, strict=True):
            if other is None:  # it has ended elsewhere: the fit is one of it in the limit
                continue
            gain = 0.5 * float(np.sum(fit.residuals**2) - np.sum(other.residuals**2))
            tried[one.name] = replace(one, gain=gain, values=other.values)
            if gain > max(one.least, best[0].gain if best is not None else 0.0):
                best = replace(tried[one.name], taken=True, values={}), other, beside
        if best is None:
            return fit, list(tried.values())
        one, fit, beside = best
        tried[one.name], problem.machine, problem.start = one, beside.machine, beside.start
        problem.weigh(fit)
        fit, far = problem.continued(fit), False


def _predict_rival(problem: Problem, rival: RivalStructure, fit: DriveFit, tests: int = 1) -> TriedRival:
    """By one run with the rival as it begins: what a step towards it gains, and how far it may lead at 95 %.

    Of the change of the residuals, what the parameters of the fit make up for says nothing.

    problem: has the rival afterwards. tests: that share the error rate.
    """
    least = 0.5 * float(chdtri(rival.freedom, ERROR_RATE / tests))
    _apply_rival(problem, rival)
    try:
        changed = problem.residuals(fit.names, fit.values) - fit.residuals
    except InputError:  # the units cannot run it
        return TriedRival(rival.name, 0.0, least, False)
    answer = -np.linalg.lstsq(fit.jacobian, changed, rcond=None)[0]
    alone = changed + fit.jacobian @ answer
    size = float(alone @ alone)
    if not size > 0:
        return TriedRival(rival.name, 0.0, least, False)
    towards = -float(fit.residuals @ alone) / size
    share = min(max(towards, 0.0) + NORMAL_95 / np.sqrt(size), 1.0)
    values = problem.moved(fit, share * answer)
    return TriedRival(rival.name, 0.5 * max(towards, 0.0) ** 2 * size, least, False, values)


def _apply_rival(problem: Problem, rival: RivalStructure) -> None:
    axis = problem.each.axis
    own = problem.machine.axes[axis]
    drive = problem.machine.shipped_drive(axis, "the identification of a drive").model_copy(update=dict(rival.drive))
    axes = problem.machine.axes | {axis: own.model_copy(update={"drive": drive})}
    problem.machine = problem.machine.model_copy(update={"axes": axes})
    problem.start = problem.start | dict(rival.begin)


def _best_fit(
    problem: Problem,
    asked: tuple[RivalStructure, TriedRival],
    fit: DriveFit,
    misses: Callable[[DriveFit], bool] | None,
) -> DriveFit | None:
    """From the fit without the rival; where that may have ended far away, from where it began, too, unless the first
    has found what is missing. None: there is no better one.

    problem: has the rival afterwards. asked: the rival, and what is predicted of it. misses: as of with_rivals; None:
        the fit has not ended far away.
    """
    rival, least = asked[0], asked[1].least
    _apply_rival(problem, rival)
    names = [*fit.names, *rival.begin]
    without = 0.5 * float(np.sum(fit.residuals**2))

    def is_none(point: Point, predicted: float, taken: int) -> bool:
        cost = problem.cost(tuple(names), point)
        return cost - PREDICTION_FACTOR * predicted > without or (
            taken >= DIFFERENCES_TO_JUDGE and cost > COST_FACTOR * without
        )

    # What delays the speed setpoint is beside what the symmetry filter has to match.
    later = problem.start["T_sym"] + 2 * rival.begin.get("D", 0.0) / rival.begin.get("omega_0", 1.0)
    best: DriveFit | None = None
    cost = without
    for begin, near in (({**fit.values, **rival.begin}, fit), ({"T_sym": later}, None)):
        with suppress(InputError):  # the units cannot run it
            other = problem.fitted(names, begin, near, give_up=is_none)
            if (own := 0.5 * float(np.sum(other.residuals**2))) < cost:
                best, cost = other, own
        if misses is None or (best is not None and without - cost > least and not misses(best)):
            break
    return best
