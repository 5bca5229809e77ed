"""Intervals of 95 %, and the one rule that says whether a value is determined.

A value is determined where half of its interval is at most half of the value: the interval is no wider than the value.
Something shows where its interval does not hold 0. Values that may be 0 in the middle of their range (``ANY_VALUE``)
are not judged: their interval says all.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

NORMAL_95 = 1.959964  # standard deviations on either side that hold 95 % of a normal distribution
MAX_RELATIVE_HALF = 0.5  # half of the interval of a value that is determined, over the value
# Loads, delays and differences of both directions have no scale of their own to which an interval could be compared.
ANY_VALUE = frozenset({"M_0", "asymmetry", "skew", "delay", "k_ffw", "T_sym", "T_dyn"})


def half_width(sigma: float) -> float:
    """Half of the interval of 95 % of a value with that standard deviation, in its unit."""
    return NORMAL_95 * sigma


def determined(value: float, half: float) -> bool:
    """Whether half of the interval is at most that share of the value; a value without an interval (NaN) is.

    >>> determined(2.0, 0.9), determined(-2.0, 1.1), determined(2.0, math.nan)
    (True, False, True)
    """
    return not half > MAX_RELATIVE_HALF * abs(value)


def shows(value: float, half: float) -> bool:
    """Whether the interval does not hold 0: what the value stands for is there. Without an interval (NaN) it is.

    >>> shows(-2.0, 1.9), shows(2.0, 2.1), shows(2.0, math.nan)
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


def stretched(matrix: Array, residuals: Array, least: float, length: Callable[[Array], float]) -> Array:
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
