"""What machines of the same kind have, as a prior of stage 1: against least squares of prior and data together."""

from __future__ import annotations

import numpy as np
import pytest

from feedsim.estimation.identify.parameters import CONSTANT_SPEED, estimate
from feedsim.estimation.identify.result import Correlation, Stationary
from feedsim.estimation.identify.stages import with_fleet
from feedsim.estimation.parameter import Prior
from identify_records import TRUE

NAMES = ("F_C", "F_S", "v_s", "F_log", "sigma_2")


def stage(covariance: np.ndarray, drift: np.ndarray) -> Stationary:
    """A stage 1 with that covariance, of the values of the records' friction."""
    sigma = np.sqrt(np.diag(covariance))
    estimates = {name: estimate(name, TRUE[name], status="held") for name in CONSTANT_SPEED}
    estimates |= {name: estimate(name, TRUE[name], float(each)) for name, each in zip(NAMES, sigma, strict=True)}
    matrix = Correlation(NAMES, covariance / np.outer(sigma, sigma))
    speeds = np.array([0.5, 300.0])
    return Stationary((), estimates, matrix, covariance, drift, speeds, speeds, speeds, (0.5, 300.0), 0.0, 0.0)


@pytest.mark.parametrize("wide", [1.0, 1e4])
def test_fleet_and_data_together(wide: float) -> None:
    random = np.random.default_rng(1)
    scale = np.array([0.01, 0.005, 0.02, 0.01, 2e-4])
    root = np.linalg.qr(random.normal(size=(5, 5)))[0] * [3.0, 1.0, 1.0, 0.3, 0.1]
    weighed = root @ root.T * np.outer(scale, scale)
    drift = np.diag(0.3 * np.diag(weighed))
    covariance = weighed + drift
    means, deviations = np.array([1.7, 0.65, 0.0065]), wide * np.array([0.02, 0.02, 3e-4])
    fleet = Prior(("F_C", "v_s", "sigma_2"), means, np.diag(deviations**2))
    found = with_fleet(stage(covariance, drift), fleet)
    values = np.array([TRUE[name] for name in NAMES])
    at = [0, 2, 4]
    white = np.linalg.inv(np.linalg.cholesky(weighed))
    rows = np.vstack([white, np.eye(5)[at] / deviations[:, None]])
    right = np.concatenate([white @ values, means / deviations])
    expected = np.linalg.lstsq(rows, right, rcond=None)[0]
    assert [found.estimates[name].value for name in NAMES] == pytest.approx(list(expected), rel=1e-9)
    assert found.covariance - found.drift == pytest.approx(np.linalg.inv(rows.T @ rows), rel=1e-6, abs=1e-12)
    assert found.estimates["beta"] == stage(covariance, drift).estimates["beta"]
    if wide > 1:  # what the data determine hardly moves
        assert expected == pytest.approx(values, rel=1e-6)


def test_without_a_common_parameter_nothing_changes() -> None:
    before = stage(np.diag([1e-4] * 5), np.zeros((5, 5)))
    assert with_fleet(before, Prior(("W",), np.array([0.04]), np.array([[1e-4]]))) is before
