"""The units on one record, over the parameters of a drive: what they leave of position and torque, by least squares.

The parameters are those of the drive and the friction, but for three: K_i = K_p/T_n, `excess` = F_S/F_C - 1, and
`delay`, by how much the torque is logged later than the motion.

A run of the units is what costs, and a Jacobian by differences is a run for every parameter. It is therefore taken
over from one fit to the next (secant.py); what is left out of a fit, and intervals, are told from differences.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import exp, inf, log, nan, sqrt

import numpy as np
from numpy.typing import NDArray

from feedsim.errors import FeedsimError, InputError
from feedsim.estimation.covariance import correlation_length
from feedsim.identify.position_loop import rms
from feedsim.replay.closed_loop import AxisRecord, Replay, per_row_of
from feedsim.replay.elastic import modes_of, with_modes
from feedsim.replay.secant import Least, Point
from feedsim.scenario import Machine
from feedsim.trace.trace import Array

Rows = NDArray[np.int64]

# Deviations of the logarithm (of the value itself where it is not in LOGARITHMIC) about the start: what is usual. The
# inertia begins with the rigid line's, which accelerations tell well; where they do not, its deviation is that line's.
# A mode's place is told by regression ahead of the fit.
LOGARITHMIC = ("J", "K_p", "K_i", "K_v", "omega_0", "D", "F_C", "sigma_0", "sigma_1", "sigma_2", "v_s", "W")
OF_MODES = {"mode_f": 0.1, "mode_D": 0.7, "mode_u": 0.7}  # of the logarithm
USUAL = {
    "J": 0.05, "K_p": 1.0, "K_i": 1.5, "K_v": 1.0, "omega_0": 0.7, "D": 0.5, "F_C": 0.7, "sigma_0": 1.5,
    "sigma_1": 2.0, "sigma_2": 1.5, "v_s": 1.5, "W": 1.5, "gamma": 0.5, "excess": 0.5, "asymmetry": 0.2,
    "T_sym": 3e-3, "T_dyn": 10e-3, "k_ffw": 0.5, "delay": 1e-3,
}  # fmt: skip
BOUNDS = {"gamma": (1e-3, 1.0), "excess": (0.0, 3.0), "asymmetry": (-0.6, 0.6), "F_log": (0.0, inf),
          "T_sym": (0.0, 0.02), "T_dyn": (0.0, 0.1), "k_ffw": (0.0, 1.5), "delay": (-5e-3, 5e-3)}  # fmt: skip
# Where a part of the friction law has no effect, or runs away.
ENDS = {"gamma": (1.0,), "excess": (0.0, 3.0), "asymmetry": (-0.6, 0.6), "F_log": (0.0,)}
# A tuned speed loop has this damping at least, give or take BARELY of the logarithm.
DAMPED, BARELY = 0.7, 0.2
SPAN = 4.0  # usual deviations that a logarithm may be off its start
LEAST = {"position": 1e-9, "torque": 1e-3}  # [m], share of the torque: no channel is weighted as better than that

# Of the cost: what a step has to promise. The cost counts what rows say of their own, some hundred pieces. A fit that
# ends COMPARED off its least is off by a few hundredths of the logarithm of the likelihood, or a fifth of a standard
# deviation; FINAL is a tenth of that, and a third of the deviation. ROUGH is to begin with, where weights are guessed.
ROUGH, COMPARED, FINAL = 3e-3, 2e-4, 3e-5
LEAST_SHAPE = 1e-3  # of a mode at the scale, over the rigid motion's
DIFFERENCE = 1e-3  # of the logarithm, or of a tenth of the usual deviation


def logarithmic(name: str) -> bool:
    """Whether a parameter is scaled by its logarithm."""
    return name in LOGARITHMIC or name.rpartition("_")[0] in OF_MODES


@dataclass(frozen=True, eq=False)
class Tuned:
    """A fit.

    Attributes:
        names, values: of what was free. point: in usual deviations from the start.
        residuals: (2 N + M,) of position and torque in their weights, and of what is usual. jacobian: (2 N + M, P) of
            them, over usual deviations.
    """

    names: tuple[str, ...]
    values: Mapping[str, float]
    point: Point
    residuals: Array
    jacobian: Array

    @property
    def position(self) -> Array:
        """(N,) what is left [m]."""
        return self.point.errors[: len(self.point.errors) // 2]

    @property
    def torque(self) -> Array:
        """(N,) what is left [N.m]."""
        return self.point.errors[len(self.point.errors) // 2 :]


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
        torques = {name: values[name] / scale for name in ("F_C", "sigma_0", "sigma_1", "sigma_2", "F_log")}
        friction = self.machine.shipped_friction(self.each.axis, "the identification of a drive").model_copy(
            update={
                **torques, "F_S": torques["F_C"] * (1 + values["excess"]),
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
    def per_row(self) -> int:
        """Samples of the simulation per row: the delay of the torque lies between rows."""
        return per_row_of(self.replay.interval, self.machine)

    def errors(self, values: Mapping[str, float]) -> tuple[Array, Array]:
        """(N,) of the position [m] and (N,) of the torque [N.m], at the rows of the record."""
        machine, scale = self.tuned(values)
        self.runs += 1
        try:
            found = self.replay.follow(machine, ("x_a", "M_a"), self.per_row, scale)[self.each.axis]
        except FeedsimError as error:  # a drive that is unstable runs away until its numbers do
            raise InputError(str(error)) from None
        delay = (self.start | dict(values))["delay"]
        time, h = self.replay.time, self.replay.interval / self.per_row
        fine = time[0] + h * np.arange(len(found["M_a"]))
        torque = scale * np.interp(time - delay, fine, found["M_a"])
        off = torque - self.each.record.torque if self.each.record.driven else np.zeros(len(time))
        return found["x_a"][:: self.per_row] - self.each.position, off

    def rings(self, values: Mapping[str, float]) -> float:
        """How far the speed loop is less damped than anybody leaves it: J s^2 + K_p s + K_i."""
        values = self.start | dict(values)
        damping = values["K_p"] / (2 * sqrt(values["J"] * values["K_i"]))
        return max(0.0, log(DAMPED / damping)) / BARELY

    def away(self, name: str, value: float) -> float:
        start = self.start[name]
        usual = self.usual(name)
        return log(value / start) / usual if logarithmic(name) else (value - start) / usual

    def at_end(self, name: str, value: float) -> bool:
        """Whether a value has run to where it has no effect, or to where it ends."""
        if logarithmic(name):
            return abs(self.away(name, value)) > 0.95 * SPAN
        return any(abs(value - end) < 0.01 * self.usual(name) for end in ENDS.get(name, ()))

    def usual(self, name: str) -> float:
        """Deviation from the start that is usual, of the logarithm or of the value."""
        key = name.rpartition("_")[0]
        if key in OF_MODES:
            return OF_MODES[key]
        if key == "mode_v":
            return max(abs(self.start[name]), LEAST_SHAPE)
        if name == "J":
            return max(USUAL["J"], self.start.get("J_sigma", 0.0))
        return USUAL[name] if name in USUAL else 2.0 * self.start["F_C"] if name == "F_log" else 5 * self.start["F_C"]

    def at(self, name: str, away: float) -> float:
        """The value that is so many usual deviations off the start."""
        off = away * self.usual(name)
        if logarithmic(name):
            return self.start[name] * exp(off)
        low, high = BOUNDS.get(name, (-inf, inf))  # the way there and back rounds
        return min(max(self.start[name] + off, low), high)

    def bounds(self, names: Sequence[str]) -> tuple[Array, Array]:
        """(P,) and (P,), in usual deviations from the start."""
        ends = [
            (-SPAN, SPAN) if logarithmic(name) else tuple(self.away(name, end) for end in BOUNDS.get(name, (-inf, inf)))
            for name in names
        ]
        low, high = zip(*ends, strict=True)
        return np.array(low), np.array(high)

    def spread(self, name: str, values: Mapping[str, float]) -> float:
        """The usual deviation of a parameter, in its own unit."""
        return self.usual(name) * (abs(values[name]) if logarithmic(name) else 1.0)

    def weigh(self, found: Tuned) -> None:
        """Take what is left with what was found as what a residual is worth.

        What is left of either channel is correlated over rows, and counts by as many as say something of their own:
        so the channels are weighed against each other, and against what is usual.
        """
        position, torque = found.position, found.torque
        least = LEAST["torque"] * rms(self.each.record.torque[self.rows]) if self.each.record.driven else 1.0
        self.weights = {
            "position": max(rms(position), LEAST["position"]) * sqrt(correlation_length(position)),
            "torque": max(rms(torque), least) * sqrt(correlation_length(torque)),
        }

    def fitted(
        self, free: Sequence[str], begin: Mapping[str, float], near: Tuned | None = None, promises: float = COMPARED
    ) -> Tuned:
        """From `begin`, with the weights as they are, to where no step promises more than a share of the cost.

        near: a fit nearby, whose Jacobian is taken over.
        """
        names = tuple(free)
        least = self._least(names)
        x = np.array([self.away(name, begin.get(name, self.start[name])) for name in names])
        slopes = np.full((2 * len(self.rows), len(names)), nan)
        for k, name in enumerate(names):
            if near is not None and name in near.names:
                slopes[:, k] = near.point.slopes[:, near.names.index(name)]
        return self._told(names, least, least.found(np.clip(x, least.low, least.high), slopes, promises))

    def exact(self, found: Tuned, central: bool = False) -> Tuned:
        """The same with its Jacobian by differences, which what is left out and intervals are told from."""
        least = self._least(found.names)
        return self._told(found.names, least, least.exact(found.point, central))

    def _least(self, names: tuple[str, ...]) -> Least:
        """The sum of squares over both channels in their weights and over how far every parameter is off its start."""

        def values(x: Array) -> dict[str, float]:
            return {name: self.at(name, float(away)) for name, away in zip(names, x, strict=True)}

        def errors(x: Array) -> Array:
            position, torque = self.errors(values(x))
            return np.concatenate([position[self.rows], torque[self.rows]])

        count = len(self.rows)
        weights = np.repeat([self.weights["position"], self.weights["torque"]], count)
        steps = np.array([DIFFERENCE / self.usual(name) if logarithmic(name) else 0.1 * DIFFERENCE for name in names])
        return Least(
            errors, lambda x: np.append(x, self.rings(values(x))), weights, *self.bounds(names), steps
        )  # fmt: skip

    def _told(self, names: tuple[str, ...], least: Least, point: Point) -> Tuned:
        values = {name: self.at(name, float(away)) for name, away in zip(names, point.x, strict=True)}
        return Tuned(names, values, point, least.residuals(point), least.jacobian(point))
