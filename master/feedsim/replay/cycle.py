"""The cycle in which a control closes its position loop: the axis fitted with another one, and a test between both.

Two cycles are two models that do not contain one another. The record decides between them where the sum of the rows'
logarithms of the likelihood differs by more than its own scatter, 95 % (Q. H. Vuong, Econometrica 57 (1989), 307-333).
That holds for models neither of which is quite the axis. Rows depend on each other, so that the scatter counts their
correlation over time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from math import hypot, inf, log, sqrt

import numpy as np

from feedsim.errors import InputError
from feedsim.estimation.covariance import correlation_length
from feedsim.estimation.interval import NORMAL_95, half_width
from feedsim.identify.position_loop import rms
from feedsim.identify.result import Estimate
from feedsim.replay.parameters import TABLE
from feedsim.replay.start import of_cycle
from feedsim.replay.tuning import COMPARED_TOLERANCE, Problem, Tuned, first_weights
from feedsim.trace.trace import Array

OTHERWISE = "with a position cycle of {:g} ms, which fits as well, it is {:.4g} {}"


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
    problem: Problem, fit: Tuned, cycle: float, judged: Callable[[Tuned], Mapping[str, Estimate]]
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
        fits = [_refitted(problem, fit)]
        if fit.values["T_sym"] <= TABLE["T_sym"].lower:
            # A wrong cycle has driven the delay to its bound; what it leaves of the position has no weight any more.
            problem.weights = first_weights(problem.each)
            with suppress(InputError):
                fits.append(problem.first(fit.names))
        best = max(fits, key=lambda one: float(np.sum(_likelihood(one))))
        gain, sigma = gain_of(_likelihood(best) - _likelihood(fit))
        if gain < -NORMAL_95 * sigma:
            return OtherCycle(cycle, gain, sigma)
        problem.weigh(best)
        best = problem.exact(problem.fitted(best.names, best.values, best), central=True)
        return OtherCycle(cycle, gain, sigma, judged(best))
    finally:
        problem.machine, problem.weights, problem.start = machine, weights, start


def _refitted(problem: Problem, fit: Tuned) -> Tuned:
    """A fit near another one, whose weights are those of what is left."""
    fit = problem.fitted(fit.names, fit.values, fit, COMPARED_TOLERANCE)
    problem.weigh(fit)
    return problem.fitted(fit.names, fit.values, fit, COMPARED_TOLERANCE)


def _likelihood(fit: Tuned) -> Array:
    """(N,) logarithm of the likelihood of every row, normally distributed by what the fit leaves of either channel."""
    torque = np.zeros(len(fit.counted))
    torque[fit.counted] = _of_channel(fit.torque)
    return _of_channel(fit.position) + torque


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
            reason = OTHERWISE.format(1e3 * other.cycle, value, one.unit)
            result[name] = replace(one, status="undetermined", reason=reason)
        else:
            both = max(half, moved + half_width(other.estimates[name].sigma))
            result[name] = replace(one, sigma=both / NORMAL_95).judged()
    return result
