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

from feedsim.estimation.parameter import Parameter
from feedsim.foundation.errors import InputError

# --- Intervals of 95 %, and the one rule that says whether a value is determined --------------------------------------
# A value is determined where half of its interval is at most half of the value: the interval is no wider than the
# value. Something shows where its interval does not hold 0. Values that may be 0 in the middle of their range
# (``ANY_VALUE``) are not judged: their interval says all.


NORMAL_95 = 1.959964  # standard deviations on either side that hold 95 % of a normal distribution
MAX_RELATIVE_HALF = 0.5  # half of the interval of a value that is determined, over the value
# Loads, delays and differences of both directions have no scale of their own to which an interval could be compared.
ANY_VALUE = frozenset({"M_0", "asymmetry", "skew", "delay", "k_ffw", "T_sym", "T_dyn"})


def half_width(sigma: float) -> float:
    """Half of the interval of 95 % of a value with that standard deviation, in its unit."""
    return NORMAL_95 * sigma


def is_determined(value: float, half: float) -> bool:
    """Whether half of the interval is at most that share of the value; a value without an interval (NaN) is.

    >>> is_determined(2.0, 0.9), is_determined(-2.0, 1.1), is_determined(2.0, math.nan)
    (True, False, True)
    """
    return not half > MAX_RELATIVE_HALF * abs(value)


def is_significant(value: float, half: float) -> bool:
    """Whether the interval does not hold 0: what the value stands for is there. Without an interval (NaN) it is.

    >>> is_significant(-2.0, 1.9), is_significant(2.0, 2.1), is_significant(2.0, math.nan)
    (True, False, True)
    """
    return not half >= abs(value)


def reason(value: float, half: float, of: str = "") -> str:
    """The sentence that says so of a value that is not determined; of: whose interval, where the value is a part.

    >>> reason(2.0, 2.7)
    'its 95 % interval is +-135 % of the value'
    >>> reason(0.1, 0.28, "F_S - F_C")
    'the 95 % interval of F_S - F_C is +-280 % of the value'
    """
    whose = f"the 95 % interval of {of}" if of else "its 95 % interval"
    return f"{whose} is +-{100 * half / max(abs(value), 1e-300):.0f} % of the value"


def student(free: float) -> float:
    """Quantile 0.975 of Student's distribution of so many degrees of freedom, to 2e-7 of its value.

    Many: M. Abramowitz, I. A. Stegun, Handbook of Mathematical Functions, 1964, 26.7.5. Few: SciPy, whose special
    functions take a fiftieth of a run to load.
    """
    if free < 20:
        from scipy.special import stdtrit

        return float(stdtrit(free, 0.975))
    z = 1.959963984540054  # of the normal distribution
    series = (
        z,
        (z**3 + z) / 4,
        (5 * z**5 + 16 * z**3 + 3 * z) / 96,
        (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384,
        (79 * z**9 + 776 * z**7 + 1482 * z**5 - 1920 * z**3 - 945 * z) / 92160,
    )
    return math.fsum(term / free**k for k, term in enumerate(series))


def pair_quantile(free: float) -> float:
    """Radius, in standard deviations, of the circle that holds 95 % of two values of one accuracy with so many degrees
    of freedom: sqrt(2 F), F the quantile 0.95 of Fisher's distribution of 2 and ``free``, which has a closed form.

    >>> round(pair_quantile(10), 4), round(pair_quantile(1e9), 4)
    (2.8645, 2.4477)
    """
    return math.sqrt(free * math.expm1(math.log(20) * 2 / free))


# --- Covariance of least squares whose residuals are correlated: over stretches of time, or within blocks of
#     samples
# With residuals r = y - f(x), Jacobian J and the inverse N of the normal matrix, an estimate errs by N J^T r. Its
# covariance is N M N with M = J^T E[r r^T] J: the sandwich of H. White, Econometrica 48 (1980) 817-838, and for
# correlated residuals of W. K. Newey, K. D. West, Econometrica 55 (1987) 703-708.


Array = NDArray[np.float64]
LAGS_PER_LENGTH = 5.0  # lags that are summed, in correlation lengths (Sokal's automatic window)


@dataclass(frozen=True, eq=False)
class Covariance:
    """Of a fit of P values: the inverse (P, P) of its normal matrix, and the spread of the gradient in between."""

    inverse: Array

    @classmethod
    def of(cls, normal: Array, *, hermitian: bool = False) -> Covariance:
        """By the normal matrix (P, P), priors included. hermitian: take it as symmetric to the last bit."""
        return cls(np.asarray(np.linalg.pinv(normal, hermitian=hermitian), dtype=np.float64))

    def by(self, middle: Array) -> Array:
        """(P, P) where the gradient has the covariance `middle` (P, P)."""
        return np.asarray(self.inverse @ middle @ self.inverse)

    def of_samples(self, matrix: Array, influence: Array) -> Array:
        """(P, P) where every sample has noise of its own. matrix (N, P): slopes; influence (N,): weighted residuals."""
        return self.by(matrix.T @ ((influence**2)[:, None] * matrix))

    def of_blocks(self, matrix: Array, influence: Array, block: NDArray[np.int64], free: int) -> Array:
        """(P, P) where whole blocks of samples have noise of their own.

        block (N,): number of each sample's block. free: blocks less fitted values, for the small sample.
        """
        count = int(block.max()) + 1
        sums = np.zeros((count, matrix.shape[1]))
        np.add.at(sums, block, influence[:, None] * matrix)
        return self.by(sums.T @ sums) * (count / free)


def correlated_middle(matrix: Array, residuals: Array, least: float, length: Callable[[Array], float]) -> Array:
    """(P, P) middle of residuals (N,) that are correlated over a stretch of rows.

    matrix (N, P): slopes. least: rms that the residuals have at least. length: rows that count as one, of residuals
    less their mean.
    """
    variance = max(float(np.mean(residuals**2)), least**2)
    return np.asarray(matrix.T @ matrix * length(residuals - np.mean(residuals)) * variance)


def correlation_length(residuals: Array, *, of_mean: bool = False) -> float:
    """Rows (>= 1) that count as one of residuals (N,) about 0: 1 + twice the sum of their autocorrelation.

    Summed up to the first lag without correlation: errors of a model swing, what lies behind has both signs, and it
    would shorten the length without a reason. An offset that is left is correlated over all rows.

    of_mean: of noise whose mean is asked for. Swings cancel there, so that both signs count, up to the first lag that
    is LAGS_PER_LENGTH times the sum so far (A. Sokal's window). Sums below 1 (ring-down) are not believed: they would
    promise a mean better than white noise of the same scatter gives.
    """
    correlation = autocorrelation(residuals)[: max(len(residuals) // 2, 1)]
    if not correlation[0] > 0:
        return 1.0
    correlation = correlation / correlation[0]
    if not of_mean:
        ends = np.flatnonzero(correlation <= 0)
        return max(1.0, 1.0 + 2.0 * float(np.sum(correlation[1 : ends[0] if len(ends) else None])))
    sums = 2 * np.cumsum(correlation) - 1
    ends = np.flatnonzero(np.arange(len(sums)) >= LAGS_PER_LENGTH * np.maximum(sums, 1.0))
    return max(float(sums[ends[0]] if len(ends) else np.max(sums)), 1.0)


def autocorrelation(residuals: Array) -> Array:
    """(2 N,) sums of products over all lags, of residuals (N,)."""
    spectrum = np.abs(np.fft.rfft(residuals, 2 * len(residuals))) ** 2
    return np.asarray(np.fft.irfft(spectrum))


# --- What groups of a record's rows say differently: the scatter of a fit that leaves out one group after the other ---
# Errors of a model are not drawn anew with every row, and a fit to other motion has others. Leaving out one stretch
# after the other shows how far they move the values (grouped jackknife; R. G. Miller, Biometrika 61 (1974), 1-15).


Rows = NDArray[np.int64]
RANK = 1e-12  # singular values below that share of the largest one are none


def between_groups(A: Array, b: Array, groups: Sequence[Rows], of: Array | None = None) -> Array:
    """(Q,) variance of `of` x, where x solves A x = b by least squares, by what the groups say differently.

    The scatter of the fits is compared with what errors of unit variance would make of it: groups that determine a
    value unequally scatter by more than the value does. So few groups know their own scatter roughly only: it counts by
    Student's distribution, as a variance that the normal distribution is used with. Of a value that few of them
    determine, as accelerations do an inertia, still fewer say something: what remains of two groups is one difference.
    The degrees of freedom are those of a quadratic form (F. E. Satterthwaite, Biometrics Bulletin 2 (1946), 110-114) in
    residuals (1 - H) e, H the projection on A.

    Args:
        A, b: (N, P) and (N,). groups: rows of each; rows of no group, as those of a prior, always stay.
        of: (Q, P) combinations that are asked for; None: every value.
    """
    scale = np.linalg.norm(A, axis=0)
    scale[scale == 0] = 1.0
    A = A / scale
    wanted = np.eye(A.shape[1]) / scale if of is None else of / scale

    def factors(rows: Rows) -> tuple[Array, Array]:
        """(N, R) and (P, R), of which V V^T is the inverse of the normal matrix of these rows, and V U^T b solves."""
        U, s, Vt = np.linalg.svd(A[rows], full_matrices=False)
        kept = s > RANK * s[0]
        return U[:, kept], Vt[kept].T / s[kept]

    every = np.arange(len(b))
    _, root = factors(every)
    count = len(groups)
    moved = np.empty((count, len(wanted)))
    own, shared = np.empty((count, len(wanted))), np.empty((count, len(wanted), root.shape[1]))
    for g, rows in enumerate(groups):
        others = np.delete(every, rows)
        U, V = factors(others)
        moved[g] = wanted @ (V @ (U.T @ b[others]))
        # Without the group a value moves by its slopes times the residuals of all rows.
        slopes = A[rows] @ (V @ (V.T @ wanted.T))
        own[g], shared[g] = np.sum(slopes**2, axis=0), (A[rows].T @ slopes).T @ root
    scatter = np.sum((moved - np.mean(moved, axis=0)) ** 2, axis=0)
    variance = np.sum((wanted @ root) ** 2, axis=1)
    result = np.empty(len(wanted))
    for q in range(len(wanted)):
        expected, free = scatter_of(np.diag(own[:, q]) - shared[:, q] @ shared[:, q].T)
        result[q] = scatter[q] / expected * variance[q] * (student(free) / NORMAL_95) ** 2 if expected > 0 else 0.0
    return result


def scatter_of(covariance: Array) -> tuple[float, float]:
    """Expected sum of squares of values about their mean, and its degrees of freedom (at least 1), by their covariance
    (G, G).

    >>> scatter_of(np.eye(8)), scatter_of(np.array([[1.0, -1.0], [-1.0, 1.0]]))
    ((7.0, 7.0), (2.0, 1.0))
    """
    form = covariance - np.mean(covariance, axis=0)
    expected, square = float(np.trace(form)), float(np.trace(form @ form))
    return expected, max(expected**2 / square, 1.0) if square > 0 else len(covariance) - 1.0


# --- A least-squares problem as every method sees it: parameters, a model, a prior, and derivatives by differences ----


Model = Callable[[Mapping[str, float]], Array]


@dataclass(frozen=True, eq=False)
class Point:
    """Where a search is or ends.

    x: (P,) positions. errors: (N,) of the model there. slopes: (N, P) d errors/d x; exact: by differences there; near:
    by differences there, or where the cost was hardly another one.
    """

    x: Array
    errors: Array
    slopes: Array
    exact: bool = False
    near: bool = False


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
        apply: a function to each of several positions, in any order, as `map` does.
    """

    def __init__(
        self,
        model: Model,
        parameters: Sequence[Parameter],
        steps: float | Array,
        prior: Callable[[Array], Array] = no_prior,
        weights: float | Array = 1.0,
        apply: Callable[[Callable[[Array], Array], Sequence[Array]], Iterable[Array]] = map,
    ) -> None:
        self.apply = apply
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
        ends: list[tuple[int, Array, Array]] = []
        for k in which:
            ahead, behind = x.copy(), x.copy()
            ahead[k], behind[k] = min(x[k] + self.steps[k], self.high[k]), max(x[k] - self.steps[k], self.low[k])
            if not central:
                behind, ahead = (x, ahead) if ahead[k] - x[k] >= x[k] - behind[k] else (behind, x)
            ends.append((k, behind, ahead))
        asked = [side for k, *both in ends for side in both if side[k] != x[k]]
        there = iter(list((map if of == self.prior else self.apply)(of, asked)))
        columns = []
        for k, *both in ends:
            first, second = (next(there) if side[k] != x[k] else here for side in both)
            columns.append((second - first) / (both[1][k] - both[0][k]))
        return np.column_stack(columns) if columns else np.zeros((len(here), 0))

    def exact(self, point: Point, central: bool = False) -> Point:
        """The same with slopes by differences."""
        if point.exact and not central:
            return point
        slopes = self.differences(self.errors, point.x, point.errors, range(len(point.x)), central)
        return Point(point.x, point.errors, slopes, True, True)


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


# Of a point whose slopes are by differences there, of the reduction that a step of any length is predicted to have, and
# of how often differences were taken before: whether the search ends there, as it leads to nothing.
GiveUp = Callable[[Point, float, int], bool]


def never(point: Point, predicted: float, taken: int) -> bool:
    """A search that goes on to its end."""
    return False


def secant(problem: LeastSquares, begin: Array, slopes: Array, tolerance: float, give_up: GiveUp = never) -> Point:
    """Go from the positions `begin` (P,) to where no step has a predicted reduction above a share of the cost.

    slopes: (N, P) of the model's errors from nearby, nan in the columns of which nothing is known.

    Raises InputError: the model has nothing at the begin.
    """
    errors = problem.errors(begin)
    unknown = np.flatnonzero(np.isnan(slopes[0]))
    slopes = slopes.copy()
    slopes[:, unknown] = problem.differences(problem.errors, begin, errors, map(int, unknown))
    exact = len(unknown) == len(begin)
    return secant_from(problem, Point(begin, errors, slopes, exact, exact), tolerance, give_up)


def secant_from(problem: LeastSquares, here: Point, tolerance: float, give_up: GiveUp = never) -> Point:
    """The same from a point at which the model is known."""
    begin, fresh = here, here.near
    cost = last = problem.cost(here.x, here.errors)
    radius, failed, taken = LARGEST_STEP, 0, 0
    while taken < MAX_JACOBIANS:
        step, predicted = _step(problem, here, radius)
        bound = float(np.max(np.abs(step), initial=0.0))
        if predicted <= tolerance * cost or bound < SMALLEST_STEP:
            if here.exact or (last - cost <= STALE_SHARE * cost and bound < radius):
                break
            failed = MAX_FAILURES
        else:
            ahead = _advance_point(problem, here, step)
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
            if fresh and last - cost <= tolerance * cost:  # nor did the last differences lead further
                break
            here, fresh = problem.exact(here), True
            last, taken, failed, radius = cost, taken + 1, 0, max(radius, 0.1 * LARGEST_STEP)
            if give_up is not never and give_up(here, _step(problem, here, inf)[1], taken):
                break
    near = here.exact or (fresh and last - cost <= tolerance * cost)
    return here if here is begin else Point(here.x, here.errors, here.slopes, here.exact, near)


def _advance_point(problem: LeastSquares, here: Point, step: Array) -> Point | None:
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
    known = _prior_information(matrix, spread)
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


def _bound_curvature(curved: Array, weighted: Array) -> Array:
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


def _prior_information(matrix: Array, spread: Array) -> Array:
    """What is known of the values beforehand, as an inverse covariance (K, K) [1/m2]."""
    return np.diag(np.concatenate([np.zeros(matrix.shape[1] - len(spread)), 1 / spread**2]))


def _resolution(values: Array) -> float:
    """The step to whose multiples values are rounded, in their unit; 0 where they are not."""
    apart = np.diff(np.unique(values))
    if len(apart) == 0:
        return 0.0
    steps = apart / apart.min()
    return float(apart.min()) if float(np.abs(steps - np.round(steps)).max()) < 0.01 else 0.0


def rounding_columns(paths: Sequence[Array], off: Sequence[Array], noise: float) -> NDArray[np.complex128]:
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
    known = robust.shared**2 * _prior_information(matrix, spread)
    weighted = matrix.T @ (robust.weights[:, None] * matrix) + known
    covariance = Covariance.of(_bound_curvature(matrix.T @ (robust.slopes[:, None] * matrix) + known, weighted))
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
