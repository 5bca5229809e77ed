"""Least squares within bounds where calls are dear: Gauss-Newton steps, whose Jacobian the steps themselves correct.

Differences are a call for every parameter. They are taken once; every step then corrects them along itself (Broyden,
Math. Comp. 19 (1965), 577-593). They are taken anew where a step fails, and where steps have gained much since.
"""

from __future__ import annotations

from math import inf

import numpy as np
from scipy.optimize import lsq_linear

from feedsim.errors import InputError
from feedsim.estimation.least_squares import LeastSquares, Point
from feedsim.estimation.parameter import Array

STALE_SHARE = 0.02  # of the cost: what steps may have gained until differences are due
# Of a step, in every parameter: a longer one may lead into another valley, where the prior is far.
LARGEST_STEP, SMALLEST_STEP = 0.25, 1e-4
# Actual over predicted reduction: above the one the step may be twice as long, below the other it has to be half.
GOOD_RATIO, POOR_RATIO = 0.75, 0.25
MAX_FAILURES = 2  # steps that gain nothing until differences are due
MAX_JACOBIANS = 8  # times that differences are taken


def secant(problem: LeastSquares, begin: Array, slopes: Array, tolerance: float) -> Point:
    """Go from the positions `begin` (P,) to where no step has a predicted reduction above a share of the cost.

    slopes: (N, P) of the model's errors from nearby, nan in the columns of which nothing is known.

    Raises InputError: the model has nothing at the begin.
    """
    errors = problem.errors(begin)
    unknown = np.flatnonzero(np.isnan(slopes[0]))
    slopes = slopes.copy()
    slopes[:, unknown] = problem.differences(problem.errors, begin, errors, map(int, unknown))
    here = Point(begin, errors, slopes, len(unknown) == len(begin))
    cost = last = problem.cost(begin, errors)
    radius, failed, taken = LARGEST_STEP, 0, 0
    while taken < MAX_JACOBIANS:
        step, predicted = _step(problem, here, radius)
        bound = float(np.max(np.abs(step), initial=0.0))
        if predicted <= tolerance * cost or bound < SMALLEST_STEP:
            if here.exact or (last - cost <= STALE_SHARE * cost and bound < radius):
                break
            failed = MAX_FAILURES
        else:
            ahead = _ahead(problem, here, step)
            gained = -inf if ahead is None else cost - problem.cost(ahead.x, ahead.errors)
            if gained > GOOD_RATIO * predicted and bound > 0.99 * radius:
                radius = min(2 * radius, LARGEST_STEP)
            elif gained < POOR_RATIO * predicted:
                radius = 0.5 * bound
            if ahead is not None and gained > 0:
                here, cost, failed = ahead, cost - gained, 0
            else:
                failed += 1
                if ahead is not None and not here.exact:
                    here = Point(here.x, here.errors, ahead.slopes)
        if failed >= MAX_FAILURES and not here.exact:
            if taken and last - cost <= tolerance * cost:  # nor did the last differences lead further
                break
            here = problem.exact(here)
            last, taken, failed, radius = cost, taken + 1, 0, max(radius, 0.1 * LARGEST_STEP)
    return here


def _ahead(problem: LeastSquares, here: Point, step: Array) -> Point | None:
    """A step further, with slopes that agree with it; None: there is nothing."""
    x = np.clip(here.x + step, problem.low, problem.high)
    try:
        errors = problem.errors(x)
    except InputError:
        return None
    along = (errors - here.errors - here.slopes @ step) / (step @ step)
    return Point(x, errors, here.slopes + np.outer(along, step))


def _step(problem: LeastSquares, here: Point, radius: float) -> tuple[Array, float]:
    """The best step by the slopes, no longer than `radius` in any parameter, and its predicted reduction."""
    both = np.asarray(np.linalg.qr(np.column_stack([problem.jacobian(here), problem.residuals(here)]), mode="r"))
    size = len(here.x)
    R, r = both[:size, :size], both[:size, size]
    low, high = np.maximum(problem.low - here.x, -radius), np.minimum(problem.high - here.x, radius)
    step = np.asarray(lsq_linear(R, -r, (low, high), method="bvls").x)
    return step, 0.5 * float(r @ r - np.sum((R @ step + r) ** 2))
