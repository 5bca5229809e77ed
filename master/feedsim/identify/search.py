"""The least-squares problem of the output-error fit: which parameters move, their bounds, what is known before."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

from feedsim.identify.fit import Fit, Parameter, Prior, fit
from feedsim.identify.parameters import KINDS
from feedsim.identify.torque import START_PRIOR, STARTS, RecordTorque

Array = NDArray[np.float64]

# F_S moves as its excess over F_C: F_S >= F_C then is a bound like any other.
EXCESS = "excess"
LOGARITHMIC = ("sigma_0", "W", "v_s")  # known by their order of magnitude at first, and above 0
SCALES = {"delay": 1e-4, "asymmetry": 0.1}
# Bounds of the search, within what is physical (KINDS).
DECADES = {"sigma_0": 2.0, "W": 1.5, "v_s": 1.5}  # either way from their start, which is of the right order
DELAYS = (-5e-3, 20e-3)  # [s]: filters and buses make the torque late; what makes it early is less
MOST_EXCESS = 2.0  # of the friction: static friction beyond three times Coulomb's is none
MOST_ASYMMETRY = 0.6  # beyond, it plays the constant load's part
LEAST_SHARE = 1e-3  # of the start: the law and the scales divide by F_C, beta, v_log and J
LEAST_GAMMA = 1e-3  # at 0 nothing is engaged at a reversal, and sigma_0 acts on nothing
REACH = {"z": 1.0, "c": 0.5}


def inner(name: str) -> str:
    """Name under which the solver moves a parameter."""
    return EXCESS if name == "F_S" else name


def outer(name: str) -> str:
    """The parameter's own name."""
    return "F_S" if name == EXCESS else name


def with_excess(prior: Prior) -> Prior:
    """The prior of F_C, F_S as one of F_C, F_S - F_C."""
    if not {"F_C", "F_S"} <= set(prior.names):
        return prior
    turn = np.eye(len(prior.names))
    turn[prior.names.index("F_S"), prior.names.index("F_C")] = -1
    names = tuple(inner(name) for name in prior.names)
    return Prior(names, turn @ prior.values, turn @ prior.covariance @ turn.T)


def joined(priors: Sequence[Prior]) -> Prior:
    """Independent priors as one."""
    names = tuple(name for prior in priors for name in prior.names)
    covariance = np.zeros((len(names), len(names)))
    at = 0
    for prior in priors:
        size = len(prior.names)
        covariance[at : at + size, at : at + size] = prior.covariance
        at += size
    return Prior(names, np.concatenate([np.zeros(0), *(prior.values for prior in priors)]), covariance)


@dataclass(frozen=True, eq=False)
class Solution:
    """values: every parameter's, by name. states: (records, 2) z, c at the begin, as shares. fit: of inner names."""

    values: dict[str, float]
    states: Array
    fit: Fit

    def covariance(self, names: Sequence[str]) -> Array:
        """Of parameters by their own names, all of them free."""
        turn = np.zeros((len(names), len(self.fit.names)))
        for row, name in enumerate(names):
            turn[row, self.fit.names.index(inner(name))] = 1
            if name == "F_S" and "F_C" in self.fit.names:
                turn[row, self.fit.names.index("F_C")] = 1
        used = np.any(turn != 0, axis=0)
        return np.asarray(turn[:, used] @ self.fit.covariance[np.ix_(used, used)] @ turn[:, used].T, dtype=np.float64)

    def sigma(self, name: str) -> float:
        """Standard deviation of a parameter by its inner name (`excess` for F_S)."""
        return self.fit.sigma[name]


class Search:
    """Fits of the same models with the same priors, with ever other parameters free.

    Attributes:
        models, priors: what is fitted and what is known before.
        weights: per model, standard deviation of the residuals of each of its stretches [N.m].
    """

    def __init__(self, models: Sequence[RecordTorque], prior: Prior, weights: Sequence[Array]) -> None:
        self.models, self.prior, self.weights = tuple(models), with_excess(prior), tuple(weights)

    def residuals(self, values: Mapping[str, float], states: Array) -> list[Array]:
        """Per model, (rows,) over their weights."""
        return [
            model.residual(values, float(state[0]), float(state[1])) / weight[model.stretch]
            for model, weight, state in zip(self.models, self.weights, states, strict=True)
        ]

    def cost(self, solution: Solution) -> float:
        """Sum of squares of the residuals at a solution, without the prior's."""
        return float(sum(np.sum(part**2) for part in self.residuals(solution.values, solution.states)))

    def solve(
        self, values: Mapping[str, float], states: Array, free: Sequence[str], *, tolerance: float, limit: int
    ) -> Solution:
        """Best values of `free` from `values` on."""
        begin = {**values, EXCESS: max(values["F_S"] - values["F_C"], 0.0)}
        parameters = [_parameter(inner(name), begin) for name in free]
        starts = [(k, name) for k in range(len(self.models)) for name in STARTS]
        parameters += [
            Parameter(f"{name}_{k}", float(states[k, STARTS.index(name)]), -REACH[name], REACH[name], scale=REACH[name])
            for k, name in starts
        ]
        loose = Prior(
            tuple(f"{name}_{k}" for k, name in starts),
            np.zeros(len(starts)),
            np.diag([START_PRIOR[name] ** 2 for _, name in starts]),
        )

        def full(moved: Mapping[str, float]) -> tuple[dict[str, float], Array]:
            point = dict(values)
            point |= {name: moved[name] for name in free if name in moved}
            if EXCESS in moved:
                point["F_S"] = point["F_C"] + moved[EXCESS]
            elif "F_C" in moved:
                point["F_S"] = point["F_C"] + begin[EXCESS]
            shares = np.array([[moved[f"{name}_{k}"] for name in STARTS] for k in range(len(self.models))])
            return point, shares

        def residuals(moved: Mapping[str, float]) -> Array:
            return np.concatenate(self.residuals(*full(moved)))

        found = fit(
            residuals, parameters, prior=joined([self.prior, loose]), difference=1e-5, tolerance=tolerance, limit=limit
        )
        point, shares = full(found.mapping())
        return Solution(point, shares, found)


def _parameter(name: str, begin: Mapping[str, float]) -> Parameter:
    start = begin[name]
    if name in LOGARITHMIC:
        span = 10 ** DECADES[name]
        return Parameter(name, start, *_within(name, start / span, start * span), log=True)
    lower, upper = -inf, inf
    if name == "delay":
        lower, upper = DELAYS
    elif name in ("F_C", "beta", "v_log", "J"):
        lower = LEAST_SHARE * start
    elif name == "asymmetry":
        lower, upper = -MOST_ASYMMETRY, MOST_ASYMMETRY
    elif name == "gamma":
        lower = LEAST_GAMMA
    elif name == EXCESS:
        lower, upper = 0.0, MOST_EXCESS * max(begin["F_C"], begin["F_S"])
    if name != EXCESS:
        lower, upper = _within(name, lower, upper)
    scale = {
        "sigma_1": max(abs(start), 1e-4 * begin["sigma_0"]),
        "sigma_2": max(abs(start), 1e-4 * begin["F_C"]),
        "M_0": begin["F_C"],
        "F_log": begin["F_C"],
        EXCESS: begin["F_C"],
        "gamma": 1.0,
    }.get(name, SCALES.get(name))
    return Parameter(name, start, lower, upper, scale=scale)


def _within(name: str, lower: float, upper: float) -> tuple[float, float]:
    """Bounds, no wider than physical."""
    return max(lower, KINDS[name].lower), min(upper, KINDS[name].upper)


def spread(residual: Array) -> float:
    """Standard deviation that residuals (N,) of a stretch are worth.

    White ones: their RMS, single outliers cut. Those that hang together in time, which is the model's error and not
    noise, tell less than their number says: their variance counts 1 + 2 sum(rho) times, rho being the autocorrelation
    up to where it drowns.
    """
    scale = 1.4826 * float(np.median(np.abs(residual)))
    cut = np.clip(residual, -4 * scale, 4 * scale) if scale > 0 else residual
    variance = float(np.mean(cut**2))
    if variance == 0:
        return 0.0
    count = len(cut)
    power = np.abs(np.fft.rfft(cut, 2 * count)) ** 2
    rho = np.fft.irfft(power)[: count // 4] / (count * variance)
    drowned = 3 / np.sqrt(count)
    silent = np.flatnonzero(rho < drowned)
    last = int(silent[0]) if len(silent) else len(rho)
    return float(np.sqrt(variance * (1 + 2 * np.sum(rho[1:last]))))
