"""Least squares within bounds where calls are dear: Gauss-Newton steps, whose Jacobian the steps themselves tell.

Differences are a call for every parameter. They are taken once; every step then corrects them along itself (Broyden,
Math. Comp. 19 (1965), 577-593). They are taken anew where a step fails, and where steps have gained much since.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import inf

import numpy as np
from scipy.optimize import lsq_linear

from feedsim.errors import InputError
from feedsim.trace.trace import Array

STALE = 0.02  # of the cost: what steps may have gained until differences are due
# Of a step, in every parameter: a longer one may lead into another valley, where the prior is far.
LONGEST, SHORTEST = 0.25, 1e-4
GOOD, POOR = 0.75, 0.25  # share of what was promised: the step may be twice as long, has to be half as long
FAILURES = 2  # steps that gain nothing until differences are due
MOST = 8  # times that differences are taken


@dataclass(frozen=True, eq=False)
class Point:
    """Where a search is or ends.

    x: (P,) parameters. errors: (N,) there. slopes: (N, P) d errors/d x; exact: by differences there.
    """

    x: Array
    errors: Array
    slopes: Array
    exact: bool = False


@dataclass(frozen=True, eq=False)
class Least:
    """The least sum of squares of errors(x)/weights and prior(x).

    Attributes:
        errors: (P,) to (N,), the dear one; raises InputError where there is nothing. prior: (P,) to (M,), further
            residuals. weights: (N,).
        low, high: (P,) bounds. steps: (P,) of the differences. Parameters are scaled: 1 is a long way.
    """

    errors: Callable[[Array], Array]
    prior: Callable[[Array], Array]
    weights: Array
    low: Array
    high: Array
    steps: Array

    def residuals(self, point: Point) -> Array:
        """(N + M,)"""
        return np.concatenate([point.errors / self.weights, self.prior(point.x)])

    def jacobian(self, point: Point) -> Array:
        """(N + M, P)"""
        beside = self.differences(self.prior, point.x, self.prior(point.x), range(len(point.x)))
        return np.vstack([point.slopes / self.weights[:, None], beside])

    def cost(self, x: Array, errors: Array) -> float:
        """Half the sum of squares."""
        return 0.5 * float(np.sum((errors / self.weights) ** 2) + np.sum(self.prior(x) ** 2))

    def differences(
        self, of: Callable[[Array], Array], x: Array, here: Array, which: Iterable[int], central: bool = False
    ) -> Array:
        """(N, K) by differences of `of` in K of its parameters, to the side that has room, or to both sides."""
        columns = []
        for k in which:
            ahead, behind = x.copy(), x.copy()
            ahead[k], behind[k] = min(x[k] + self.steps[k], self.high[k]), max(x[k] - self.steps[k], self.low[k])
            if not central:
                behind, ahead = (x, ahead) if ahead[k] - x[k] >= x[k] - behind[k] else (behind, x)
            first, second = (here if side is x or side[k] == x[k] else of(side) for side in (behind, ahead))
            columns.append((second - first) / (ahead[k] - behind[k]))
        return np.column_stack(columns) if columns else np.zeros((len(here), 0))

    def exact(self, point: Point, central: bool = False) -> Point:
        """The same with slopes by differences."""
        if point.exact and not central:
            return point
        slopes = self.differences(self.errors, point.x, point.errors, range(len(point.x)), central)
        return Point(point.x, point.errors, slopes, True)

    def found(self, begin: Array, slopes: Array, promises: float) -> Point:
        """From `begin` to where no step promises more than a share of the cost.

        slopes: (N, P) from nearby, nan in the columns that nothing is known of.

        Raises InputError: nothing is there at the begin.
        """
        errors = self.errors(begin)
        unknown = np.flatnonzero(np.isnan(slopes[0]))
        slopes = slopes.copy()
        slopes[:, unknown] = self.differences(self.errors, begin, errors, map(int, unknown))
        here = Point(begin, errors, slopes, len(unknown) == len(begin))
        cost = since = self.cost(begin, errors)
        radius, failed, taken = LONGEST, 0, 0
        while taken < MOST:
            step, promised = self._step(here, radius)
            bound = float(np.max(np.abs(step), initial=0.0))
            if promised <= promises * cost or bound < SHORTEST:
                if here.exact or (since - cost <= STALE * cost and bound < radius):
                    break
                failed = FAILURES
            else:
                ahead = self._ahead(here, step)
                gained = -inf if ahead is None else cost - self.cost(ahead.x, ahead.errors)
                if gained > GOOD * promised and bound > 0.99 * radius:
                    radius = min(2 * radius, LONGEST)
                elif gained < POOR * promised:
                    radius = 0.5 * bound
                if ahead is not None and gained > 0:
                    here, cost, failed = ahead, cost - gained, 0
                else:
                    failed += 1
                    if ahead is not None and not here.exact:
                        here = Point(here.x, here.errors, ahead.slopes)
            if failed >= FAILURES and not here.exact:
                if taken and since - cost <= promises * cost:  # nor did the last differences lead further
                    break
                here = self.exact(here)
                since, taken, failed, radius = cost, taken + 1, 0, max(radius, 0.1 * LONGEST)
        return here

    def _ahead(self, here: Point, step: Array) -> Point | None:
        """A step further, with slopes that agree with it; None: there is nothing."""
        x = np.clip(here.x + step, self.low, self.high)
        try:
            errors = self.errors(x)
        except InputError:
            return None
        along = (errors - here.errors - here.slopes @ step) / (step @ step)
        return Point(x, errors, here.slopes + np.outer(along, step))

    def _step(self, here: Point, radius: float) -> tuple[Array, float]:
        """The best step by the slopes, no longer than `radius` in any parameter, and what it promises."""
        both = np.asarray(np.linalg.qr(np.column_stack([self.jacobian(here), self.residuals(here)]), mode="r"))
        size = len(here.x)
        R, r = both[:size, :size], both[:size, size]
        low, high = np.maximum(self.low - here.x, -radius), np.minimum(self.high - here.x, radius)
        step = np.asarray(lsq_linear(R, -r, (low, high), method="bvls").x)
        return step, 0.5 * float(r @ r - np.sum((R @ step + r) ** 2))
