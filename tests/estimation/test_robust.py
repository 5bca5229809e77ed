"""Robust fits of linear models: what they say of directions that outliers leave flat."""

from __future__ import annotations

import numpy as np

from feedsim.estimation.least_squares import covariance_of, robust_fit


def test_samples_that_fit_badly_do_not_leave_a_value_unknown() -> None:
    """A column that a few samples determine, all of them half outside: their costs bend the other way. Its value stays
    known to what these samples say; the matrix of second derivatives alone said nothing of it, or less than nothing."""
    rng = np.random.default_rng(5)
    worst = 0.0
    for _ in range(20):
        n, few = 2000, 40
        matrix = np.column_stack([np.ones(n), np.zeros(n)])
        matrix[:few, 1] = 1.0
        values = rng.normal(0, 1.0, n)
        values[:few] = 3.0 + np.where(np.arange(few) % 2, 1, -1) * rng.uniform(1.5, 4.0, few)
        fit = robust_fit(matrix, values, np.empty(0), np.empty(0))
        nothing = np.empty((n, 0), dtype=complex)
        covariance, _ = covariance_of(matrix, values - matrix @ fit.values, fit, np.empty(0), np.arange(n), nothing)
        worst = max(worst, float(np.sqrt(covariance[1, 1])))
    # 40 samples that scatter by 3 give 0.5; twice as much where the costs bend by half of what the weights say.
    assert worst < 1.5
