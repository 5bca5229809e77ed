"""Rival structures of a drive: a fit is tried again with what the record may hold besides.

A structure that the axis has and the fit lacks is made up for by parameters of the fit, in narrow intervals around
wrong values. Every rival contains the fit as a limit, so that a test of nested models decides: twice the gain of the
logarithm of the likelihood is chi-square distributed where the rival has nothing to explain (S. S. Wilks, Ann. Math.
Statist. 9 (1938), 60-62). Rows count by how many say something of their own, as the weights of a problem have it.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.stats import chi2

from feedsim.errors import InputError
from feedsim.estimation.interval import NORMAL_95
from feedsim.identify.clipping import limit_shown
from feedsim.replay.tuning import Problem, Tuned
from feedsim.scenario import Filter, Machine

FITTED_SHARE = 0.5  # of what the test needs: a rival that is predicted to gain less is not fitted
ERROR_RATE = 0.01  # of each test: how often a rival is taken that the axis does not have
CURRENT_DAMPING = 1.0  # of the low-pass that stands for a current loop
BEGIN_CURRENT = 1400.0  # [Hz] of that low-pass: twice the bandwidth
BEGIN_MODEL = {"omega_0": 1000.0, "D": 1.0}  # [rad/s], [1] of a reference model


@dataclass(frozen=True)
class Rival:
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
class Tried:
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


def rivals_of(problem: Problem) -> list[Rival]:
    """What the drive of a problem may have besides."""
    drive = problem.machine.shipped_drive(problem.each.axis, "the identification of a drive")
    result = []
    limit = limit_shown(problem.each.record)
    if limit is not None and limit < drive.M_max:
        result.append(Rival("torque limit", {"M_max": limit}))
    if not drive.reference_model:
        result.append(Rival("reference model", {"reference_model": True, **BEGIN_MODEL}, BEGIN_MODEL))
    if drive.ideal_current_loop and drive.filter_1.type == "off":
        low_pass = Filter.model_construct(type="low_pass", f=BEGIN_CURRENT, D_num=None, D_den=CURRENT_DAMPING)
        result.append(Rival("current loop", {"filter_1": low_pass}, {"filter_1.f": BEGIN_CURRENT}))
    return result


def with_rivals(problem: Problem, fit: Tuned, far: bool) -> tuple[Tuned, list[Tried]]:
    """The fit with the rivals that the record asks for, one after the other, and what was tried; the problem has their
    structure then.

    far: whether the fit contradicts what the record shows without one, and may have ended far away.
    """
    tried: dict[str, Tried] = {}
    while True:
        fit = problem.exact(fit)
        machine, start = problem.machine, dict(problem.start)
        best: tuple[Tried, Tuned, Machine, dict[str, float]] | None = None
        for rival in rivals_of(problem):
            problem.machine, problem.start = _with(machine, problem.each.axis, rival), start | dict(rival.begin)
            one = _predicted(problem, fit, rival)
            if far or one.gain > FITTED_SHARE * one.least:
                other = _best_fit(problem, fit, rival, far)
                gain = 0.5 * float(np.sum(fit.residuals**2) - np.sum(other.residuals**2)) if other is not None else 0.0
                if other is not None and gain > 0:  # else it has ended elsewhere: the fit is one of it in the limit
                    one = replace(one, gain=gain, values=other.values)
                    if gain > max(one.least, best[0].gain if best is not None else 0.0):
                        best = replace(one, taken=True, values={}), other, problem.machine, problem.start
            tried[rival.name] = one
        problem.machine, problem.start = machine, start
        if best is None:
            return fit, list(tried.values())
        tried[best[0].name], fit, problem.machine, problem.start = best
        problem.weigh(fit)
        fit, far = problem.fitted(fit.names, fit.values, fit), False


def _predicted(problem: Problem, fit: Tuned, rival: Rival) -> Tried:
    """By one run with the rival as it begins: what a step towards it gains, and how far it may lead at 95 %.

    Of the change of the residuals, what the parameters of the fit make up for says nothing.
    """
    least = 0.5 * float(chi2.isf(ERROR_RATE, rival.freedom))
    try:
        changed = problem.residuals(fit.names, fit.values) - fit.residuals
    except InputError:  # the units cannot run it
        return Tried(rival.name, 0.0, least, False)
    answer = -np.linalg.lstsq(fit.jacobian, changed, rcond=None)[0]
    alone = changed + fit.jacobian @ answer
    size = float(alone @ alone)
    if not size > 0:
        return Tried(rival.name, 0.0, least, False)
    towards = -float(fit.residuals @ alone) / size
    share = min(max(towards, 0.0) + NORMAL_95 / np.sqrt(size), 1.0)
    values = problem.moved(fit, share * answer)
    return Tried(rival.name, 0.5 * max(towards, 0.0) ** 2 * size, least, False, values)


def _with(machine: Machine, axis: str, rival: Rival) -> Machine:
    own = machine.axes[axis]
    drive = machine.shipped_drive(axis, "the identification of a drive").model_copy(update=dict(rival.drive))
    return machine.model_copy(update={"axes": machine.axes | {axis: own.model_copy(update={"drive": drive})}})


def _best_fit(problem: Problem, fit: Tuned, rival: Rival, far: bool) -> Tuned | None:
    """From the fit without the rival; where that may have ended far away, from where it began, too."""
    names = [*fit.names, *rival.begin]
    fits: list[Tuned] = []
    with suppress(InputError):  # the units cannot run it
        fits.append(problem.fitted(names, {**fit.values, **rival.begin}, fit))
    # What delays the speed setpoint is beside what the symmetry filter has to match.
    later = problem.start["T_sym"] + 2 * rival.begin.get("D", 0.0) / rival.begin.get("omega_0", 1.0)
    with suppress(InputError):
        fits += [problem.fitted(names, {"T_sym": later})] if far else []
    return min(fits, key=lambda one: float(np.sum(one.residuals**2)), default=None)
