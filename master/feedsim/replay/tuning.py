"""The units on one record, over the parameters of a drive: residuals of position and torque, by least squares.

The parameters are in parameters.py. A run of the units is what costs, and a Jacobian by differences is a run for every
parameter. It is therefore taken over from one fit to the next (estimation/secant.py); cross-validation and intervals
take differences anew.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import log, nan, sqrt

import numpy as np
from numpy.typing import NDArray

from feedsim.errors import FeedsimError, InputError
from feedsim.estimation.covariance import correlation_length
from feedsim.estimation.least_squares import LeastSquares, Point
from feedsim.estimation.secant import secant
from feedsim.identify.parameters import EXCESS
from feedsim.identify.position_loop import rms
from feedsim.replay.closed_loop import AxisRecord, Mask, Replay, per_row_of
from feedsim.replay.elastic import modes_of, with_modes
from feedsim.replay.parameters import difference, no_effect, parameter
from feedsim.scenario import Machine
from feedsim.trace.trace import Array

Rows = NDArray[np.int64]

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
class Tuned:
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
            low_pass = drive.filter_1.model_copy(update={"f": values["filter_1.f"]})
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
        machine, scale = self.tuned(values)
        self.runs += 1
        try:
            result = self.replay.follow(machine, ("x_a", "M_a"), self.per_row, scale)[self.each.axis]
        except FeedsimError as error:  # a drive that is unstable runs away until its numbers do
            raise InputError(str(error)) from None
        delay = (self.start | dict(values))["delay"]
        time, h = self.replay.time, self.replay.interval / self.per_row
        fine = time[0] + h * np.arange(len(result["M_a"]))
        torque = scale * np.interp(time - delay, fine, result["M_a"])
        off = torque - self.each.record.torque if self.each.record.driven else np.zeros(len(time))
        off = np.where(self.each.counted, off, 0.0)
        return result["x_a"][:: self.per_row] - self.each.position, off

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

    def weigh(self, tuned: Tuned) -> None:
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

    def first(self, free: Sequence[str]) -> Tuned:
        """A fit from the start, whose weights are those of what is left."""
        fit = self.fitted(free, {}, tolerance=FIRST_TOLERANCE)
        self.weigh(fit)
        fit = self.fitted(free, fit.values, fit)
        self.weigh(fit)
        return fit

    def fitted(
        self,
        free: Sequence[str],
        begin: Mapping[str, float],
        near: Tuned | None = None,
        tolerance: float = COMPARED_TOLERANCE,
    ) -> Tuned:
        """From `begin`, with the weights as they are, to where no step has a predicted reduction above that share.

        near: a fit nearby, whose Jacobian is taken over.
        """
        names = tuple(free)
        problem = self._least_squares(names)
        slopes = np.full((2 * len(self.rows), len(names)), nan)
        for k, name in enumerate(names):
            if near is not None and name in near.names:
                slopes[:, k] = near.point.slopes[:, near.names.index(name)]
        return self._tuned(problem, secant(problem, problem.position(begin), slopes, tolerance))

    def exact(self, fit: Tuned, central: bool = False) -> Tuned:
        """The same with its Jacobian by differences, which cross-validation and intervals are taken from."""
        problem = self._least_squares(fit.names)
        return self._tuned(problem, problem.exact(fit.point, central))

    def residuals(self, names: Sequence[str], values: Mapping[str, float]) -> Array:
        """(2 N + M,) as those of a fit, without one."""
        problem = self._least_squares(tuple(names))
        x = problem.position(values)
        return problem.weighted(x, problem.errors(x))

    def moved(self, fit: Tuned, step: Array) -> dict[str, float]:
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
        problem = LeastSquares(errors, parameters, steps, prior, weights)
        return problem

    def _tuned(self, problem: LeastSquares, point: Point) -> Tuned:
        values, residuals, jacobian = problem.values(point.x), problem.residuals(point), problem.jacobian(point)
        return Tuned(problem.names, values, point, residuals, jacobian, self.counted)
