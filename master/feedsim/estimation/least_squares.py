"""A least-squares problem as every method sees it: parameters, a model, a prior, and derivatives by differences.

The sum of squares is that of model(values)/weights and of prior(position). Methods move positions (parameter.py).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feedsim.estimation.interval import Covariance
from feedsim.estimation.parameter import Array, Parameter
from feedsim.foundation.errors import InputError

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


# --- Least squares within bounds where calls are dear: Gauss-Newton steps, whose Jacobian the steps themselves
#     correct
# Differences are a call for every parameter. They are taken once; every step then corrects them along itself (Broyden,
# Math. Comp. 19 (1965), 577-593). They are taken anew where a step fails, and where steps have gained much since.


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
    from scipy.optimize import lsq_linear  # a third of what a run loads, for the circles that need none of it

    both = np.asarray(np.linalg.qr(np.column_stack([problem.jacobian(here), problem.residuals(here)]), mode="r"))
    size = len(here.x)
    R, r = both[:size, :size], both[:size, size]
    low, high = np.maximum(problem.low - here.x, -radius), np.minimum(problem.high - here.x, radius)
    step = np.asarray(lsq_linear(R, -r, (low, high), method="bvls").x)
    return step, 0.5 * float(r @ r - np.sum((R @ step + r) ** 2))


# --- Values of a linear model from samples that do not all fit, and how well they are known ---------------------------
# Samples count less the worse they fit (Tukey's biweight). Intervals hold what neighbouring samples share, what
# rounding of a record may have added, and what is not known of values that are only known to within a spread.
# Start reading at robust_fit().


BIWEIGHT = 4.685  # 95 % as efficient as least squares where the noise is normal
MAX_REWEIGHTINGS = 6
# Harmonics of what rounding adds to a value, over where the value lies between two steps.
HARMONICS = 3
# Of normal noise the costs bend by 0.87 of what the weights say.
LEAST_CURVATURE = 0.5
MAX_SCALE = 1e6  # of a variance by samples over one by blocks, of which each has fewer samples by far
CHANGE_FLOOR = 1e-13  # changes of a term below this [m] are rounding


class Robust(NamedTuple):
    """Values (K,); of every sample its weight and how fast its influence grows with its deviation (N,); noise of a
    sample [m], and what it is worth where neighbours share it [m]."""

    values: Array
    weights: Array
    slopes: Array
    noise: float
    shared: float


def robust_fit(matrix: Array, deviation: Array, spread: Array, blocks: Array, floor: float = 0.0) -> Robust:
    """Values by least squares, each sample weighted by how well it fits.

    spread: how large the last values may be (T,) [m], what is known of them beforehand; the others are free. floor:
    what a sample is worth at best beside that [m], as no model is exact.
    """
    weights = slopes = np.ones(len(deviation))
    known = _known(matrix, spread)
    _, block = np.unique(blocks, return_inverse=True) if len(spread) else (0, np.empty(0, dtype=np.int64))
    shared = floor
    for _ in range(MAX_REWEIGHTINGS):
        normal = matrix.T @ (weights[:, None] * matrix) + shared**2 * known
        values = np.linalg.lstsq(normal, matrix.T @ (weights * deviation), rcond=None)[0]
        off = deviation - matrix @ values
        noise = float(np.median(np.abs(off))) / 0.6745
        if noise < CHANGE_FLOOR:
            break
        if len(spread):
            sums = np.bincount(block, np.clip(off, -BIWEIGHT * noise, BIWEIGHT * noise))
            shared = max(noise, math.sqrt(float(sums @ sums) / len(off)), floor)
        inner = np.clip(1 - (off / (BIWEIGHT * noise)) ** 2, 0.0, None)
        settled = float(np.abs(inner**2 - weights).max()) < 0.01
        weights, slopes = inner**2, inner * (5 * inner - 4)
        if settled:
            break
    return Robust(np.asarray(values), np.asarray(weights), np.asarray(slopes), noise, shared)


def _bounded(curved: Array, weighted: Array) -> Array:
    """The matrix of second derivatives (K, K), in every direction at least LEAST_CURVATURE of the weighted normal
    matrix (K, K).

    Samples that fit badly bend the sum of costs the other way. A few of them that matter much for one direction leave
    it flat, as if nothing were known of it.
    """
    values, vectors = np.linalg.eigh(weighted)
    usable = values > 1e-14 * values[-1]
    root = vectors[:, usable] * np.sqrt(values[usable])
    inverse = vectors[:, usable] / np.sqrt(values[usable])
    shares, directions = np.linalg.eigh(inverse.T @ curved @ inverse)
    if shares[0] >= LEAST_CURVATURE:
        return curved
    along = root @ directions
    return np.asarray((along * np.maximum(shares, LEAST_CURVATURE)) @ along.T)


def _known(matrix: Array, spread: Array) -> Array:
    """What is known of the values beforehand, as an inverse covariance (K, K) [1/m2]."""
    return np.diag(np.concatenate([np.zeros(matrix.shape[1] - len(spread)), 1 / spread**2]))


def _resolution(values: Array) -> float:
    """The step to whose multiples values are rounded, in their unit; 0 where they are not."""
    apart = np.diff(np.unique(values))
    if len(apart) == 0:
        return 0.0
    steps = apart / apart.min()
    return float(apart.min()) if float(np.abs(steps - np.round(steps)).max()) < 0.01 else 0.0


def rounding(paths: Sequence[Array], off: Sequence[Array], noise: float) -> NDArray[np.complex128]:
    """What rounding may have added to the samples of all paths, a column for each path and harmonic (N, J) [m].

    paths: recorded values of each [m]. off: what the model leaves of them [m]. noise: of a sample [m].

    Between two steps a value that noise does not move errs by up to half a step, for as long as it stays there; noise
    of more than half a step takes nearly all of it away. Where between two steps a path lies is taken to be unknown:
    the effect of a column on a value is a variance of the value.
    """
    columns = []
    for k, path in enumerate(paths):
        if (step := _resolution(path)) == 0.0:
            continue
        turns = (path - off[k]) / step
        own = math.sqrt(max(noise**2 - step**2 / 12, 0.0)) / step
        for n in range(1, HARMONICS + 1):
            amplitude = step / (math.pi * n) * math.exp(-2 * (math.pi * n * own) ** 2) / math.sqrt(2)
            column = [np.zeros(len(path), dtype=np.complex128) for path in paths]
            column[k] = amplitude * np.exp(2j * math.pi * n * turns)
            columns.append(np.concatenate(column))
    samples = sum(len(path) for path in paths)
    return np.column_stack(columns) if columns else np.empty((samples, 0), dtype=np.complex128)


def covariance_of(
    matrix: Array,
    residual: Array,
    robust: Robust,
    spread: Array,
    blocks: Array,
    rounded: NDArray[np.complex128],
) -> tuple[Array, int]:
    """Covariance of the values and its degrees of freedom.

    The larger of two: as if every sample had noise of its own, and as if only blocks of samples had. Besides, what
    rounding adds, and what is not known of the tails.
    """
    known = robust.shared**2 * _known(matrix, spread)
    weighted = matrix.T @ (robust.weights[:, None] * matrix) + known
    covariance = Covariance.of(_bounded(matrix.T @ (robust.slopes[:, None] * matrix) + known, weighted))
    influence = robust.weights * residual
    _, block = np.unique(blocks, return_inverse=True)
    free = max(int(block.max()) + 1 - matrix.shape[1] + len(spread), 2)
    single = covariance.of_samples(matrix, influence)
    blockwise = covariance.of_blocks(matrix, influence, block, free)
    # Of what is known beforehand alone, both are rounding.
    scale = np.sqrt(np.clip(np.diag(single) / np.maximum(np.diag(blockwise), 1e-300), 1.0, MAX_SCALE))
    besides = robust.shared**2 * covariance.inverse @ known @ covariance.inverse
    if rounded.shape[1]:
        moved = covariance.inverse @ (matrix.T @ (robust.weights[:, None] * rounded))
        besides += (moved @ moved.conj().T).real
    return scale[:, None] * blockwise * scale + besides, free
