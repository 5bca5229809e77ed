"""Covariance of least squares whose residuals are correlated: over stretches of time, or within blocks of samples.

With residuals r = y - f(x), Jacobian J and the inverse N of the normal matrix, an estimate errs by N J^T r. Its
covariance is N M N with M = J^T E[r r^T] J: the sandwich of H. White, Econometrica 48 (1980) 817-838, and for
correlated residuals of W. K. Newey, K. D. West, Econometrica 55 (1987) 703-708.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
