"""A least-squares problem as every method sees it: parameters, a model, a prior, and derivatives by differences.

The sum of squares is that of model(values)/weights and of prior(position). Methods move positions (parameter.py).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from feedsim.errors import InputError
from feedsim.estimation.parameter import Array, Parameter

Model = Callable[[Mapping[str, float]], Array]


@dataclass(frozen=True, eq=False)
class Point:
    """Where a search is or ends.

    x: (P,) positions. errors: (N,) of the model there. slopes: (N, P) d errors/d x; exact: by differences there.
    """

    x: Array
    errors: Array
    slopes: Array
    exact: bool = False


def no_prior(x: Array) -> Array:
    """(0,): nothing is known beforehand."""
    return np.zeros(0)


class LeastSquares:
    """Model and prior over positions within bounds.

    Args:
        model: name -> value to (N,), N the same at every call; raises InputError where there is nothing.
        parameters: those that are free.
        steps: of the differences, of positions: one, or (P,).
        prior: (P,) positions to (M,) further residuals.
        weights: of the model's errors: one, or (N,).
    """

    def __init__(
        self,
        model: Model,
        parameters: Sequence[Parameter],
        steps: float | Array,
        prior: Callable[[Array], Array] = no_prior,
        weights: float | Array = 1.0,
    ) -> None:
        self.model, self.parameters, self.prior = model, tuple(parameters), prior
        self.names = tuple(parameter.name for parameter in parameters)
        self.steps = np.broadcast_to(np.asarray(steps, dtype=np.float64), (len(self.parameters),))
        self.weights = np.asarray(weights, dtype=np.float64)
        low, high = zip(*(parameter.bounds() for parameter in parameters), strict=True)
        self.low, self.high = np.array(low), np.array(high)

    def position(self, values: Mapping[str, float]) -> Array:
        """(P,) within the bounds, of values or else starts."""
        moved = [(p, float(values.get(p.name, p.start))) for p in self.parameters]
        return np.array([p.inward(min(max(value, p.lower), p.upper)) for p, value in moved])

    def values(self, x: Array) -> dict[str, float]:
        """Name -> value; a model that checks its bounds sees nothing outside of them."""
        return {p.name: p.outward(float(at)) for p, at in zip(self.parameters, x, strict=True)}

    def errors(self, x: Array) -> Array:
        """(N,) the model's own. Raises InputError: they are not finite."""
        values = self.values(x)
        errors = np.asarray(self.model(values), dtype=np.float64)
        if not np.all(np.isfinite(errors)):
            shown = ", ".join(f"{name} = {value:.6g}" for name, value in values.items())
            raise InputError(f"the residuals are not finite at {shown}")
        return errors

    def residuals(self, point: Point) -> Array:
        """(N + M,) weighted errors, and those of the prior."""
        return self.weighted(point.x, point.errors)

    def weighted(self, x: Array, errors: Array) -> Array:
        """(N + M,) weighted errors, and those of the prior."""
        return np.concatenate([errors / self.weights, self.prior(x)])

    def jacobian(self, point: Point) -> Array:
        """(N + M, P) d residuals / d x."""
        beside = self.differences(self.prior, point.x, self.prior(point.x), range(len(point.x)))
        return np.vstack([point.slopes / self.weights[..., None], beside])

    def cost(self, x: Array, errors: Array) -> float:
        """Half the sum of squares."""
        return 0.5 * float(np.sum((errors / self.weights) ** 2) + np.sum(self.prior(x) ** 2))

    def differences(
        self, of: Callable[[Array], Array], x: Array, here: Array, which: Iterable[int], central: bool = False
    ) -> Array:
        """(N, K) by differences of `of` in K of its positions, to the side that has room, or to both sides.

        here: (N,) of(x).
        """
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
