"""What intervals of stage 2 hold besides the scatter of the torque: what stage 1 may have drifted by."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from numpy.typing import NDArray

from feedsim.estimation.fit import fit
from feedsim.estimation.identify.uncertainty import drift_covariance
from feedsim.estimation.parameter import Parameter, Prior

Array = NDArray[np.float64]
NAMES = ("F_C", "sigma_2")
PRIOR = Prior(NAMES, np.array([1.6, 6e-3]), np.array([[1e-4, -4e-7], [-4e-7, 4e-8]]))


@pytest.mark.parametrize("sigma", [1e-3, 1e-1, 1e2], ids=["told", "both", "followed"])
def test_what_drifted_counts_as_far_as_the_prior_is_followed(sigma: float) -> None:
    """Of a linear problem it is the covariance of answers to priors that are off by the drift."""
    random = np.random.default_rng(3)
    slopes = random.standard_normal((40, 3)) * [1.0, 1e2, 1.0]
    data = slopes @ [1.62, 6.1e-3, 0.4] + sigma * random.standard_normal(40)

    def residuals(moved: Mapping[str, float]) -> Array:
        return np.asarray((slopes @ [moved["F_C"], moved["sigma_2"], moved["W"]] - data) / sigma)

    def answer(values: Array) -> Array:
        """By normal equations; W has no prior."""
        weight = np.zeros((3, 3))
        weight[:2, :2] = np.linalg.inv(PRIOR.covariance)
        right = slopes.T @ data / sigma**2 + weight @ [*values, 0.0]
        return np.linalg.solve(slopes.T @ slopes / sigma**2 + weight, right)

    start = [Parameter("F_C", 1.6), Parameter("sigma_2", 6e-3), Parameter("W", 0.4)]
    found = fit(residuals, start, prior=PRIOR)
    # One standard deviation of sigma_2's drift, F_C with it.
    away = np.array([-2e-3, 1e-3])
    moved = answer(PRIOR.values + away) - answer(PRIOR.values)
    drift = Prior(NAMES, np.zeros(2), np.outer(away, away))
    expected = np.outer(moved, moved)
    scale = np.sqrt(np.diag(expected))
    seen = drift_covariance(PRIOR, found, drift) / np.outer(scale, scale)
    # 1e-4: the fit's slopes are differences.
    np.testing.assert_allclose(seen, expected / np.outer(scale, scale), atol=1e-4)
    share = moved[1] / away[1]
    assert share < 0.05 if sigma == 1e-3 else share > 0.95 if sigma == 1e2 else 0.05 < share < 0.95


def test_without_a_stage_1_nothing_has_drifted() -> None:
    def residuals(moved: Mapping[str, float]) -> Array:
        return np.array([moved["W"] - 1.0, 2 * moved["W"]])

    found = fit(residuals, [Parameter("W", 0.5)])
    none = Prior((), np.zeros(0), np.zeros((0, 0)))
    np.testing.assert_array_equal(drift_covariance(none, found, None), [[0.0]])
    elsewhere = Prior(("v_s",), np.zeros(1), np.ones((1, 1)))
    np.testing.assert_array_equal(drift_covariance(elsewhere, found, elsewhere), [[0.0]])
