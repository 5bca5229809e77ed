"""Least squares: values and covariance against closed forms, bounds, starts, priors, what the data do not tell."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from feedsim.estimation.fit import correlation, fit, inverse
from feedsim.estimation.parameter import Parameter, Prior
from feedsim.foundation.errors import InputError

TIME = np.linspace(0.0, 4.0, 41)


def decay(values: Mapping[str, float]) -> np.ndarray:
    return values["a"] * np.exp(-values["r"] * TIME)


def test_a_line_has_the_covariance_of_the_normal_equations() -> None:
    noise = np.random.default_rng(1).standard_normal(TIME.size)
    measured = 3.0 - 2.0 * TIME + 0.1 * noise
    design = np.column_stack([np.ones_like(TIME), TIME])
    exact, *_ = np.linalg.lstsq(design, measured)
    found = fit(
        lambda v: (measured - v["c"] - v["m"] * TIME) / 0.1, [Parameter("c", 0.0, scale=1e3), Parameter("m", 1e-3)]
    )
    np.testing.assert_allclose(found.values, exact, rtol=1e-8)
    np.testing.assert_allclose(found.covariance, 0.01 * np.linalg.inv(design.T @ design), rtol=1e-5)
    np.testing.assert_allclose(
        correlation(found.covariance)[0, 1], -np.sqrt(0.75), rtol=0.03
    )  # of a line over 0 .. T: -sqrt(3)/2
    loose = fit(
        lambda v: measured - v["c"] - v["m"] * TIME, [Parameter("c", 0.0), Parameter("m", 1.0)], normalised=False
    )
    spread = np.sum((measured - design @ exact) ** 2) / (TIME.size - 2)
    np.testing.assert_allclose(loose.covariance, spread * np.linalg.inv(design.T @ design), rtol=1e-5)


@pytest.mark.parametrize("log", [False, True])
def test_scatter_of_a_nonlinear_fit_is_its_covariance(log: bool) -> None:
    random = np.random.default_rng(2)
    found = []
    for _ in range(200):
        measured = decay({"a": 2.0, "r": 0.7}) + 0.02 * random.standard_normal(TIME.size)
        found.append(
            fit(
                lambda v, m=measured: (m - decay(v)) / 0.02,
                [Parameter("a", 1.0), Parameter("r", 0.1, 1e-3, 10, log=log)],
            )
        )
    values = np.array([f.values for f in found])
    # 200 draws give a standard deviation within 15 % (three of its own).
    np.testing.assert_allclose(np.std(values, axis=0), np.sqrt(np.diag(found[0].covariance)), rtol=0.15)
    np.testing.assert_allclose(np.mean(values, axis=0), [2.0, 0.7], atol=4e-3)


def test_a_jump_beside_the_solution_promises_nothing() -> None:
    """A line through 2500 samples of unit noise that moves by half of it where the slope passes its value by 1e-8: a
    difference across that jump takes the slope for known to a hundredth of what the samples determine."""
    t = np.linspace(0.0, 1.0, 2500)
    noise = np.random.default_rng(3).standard_normal(t.size)
    best = 1.0 + noise @ t / (t @ t)

    def residuals(values: Mapping[str, float]) -> np.ndarray:
        return noise + (1.0 - values["m"]) * t + 0.5 * (values["m"] > best + 1e-8) * np.sin(90 * np.pi * t)

    line = 1 / np.linalg.norm(t)
    sigma = {jumps: fit(residuals, [Parameter("m", best)], jumps=jumps).sigma["m"] for jumps in (False, True)}
    assert sigma[False] < 0.01 * line
    assert sigma[True] == pytest.approx(line, rel=1e-3)


def test_bounds_are_kept_and_told() -> None:
    seen: list[float] = []

    def residuals(values: Mapping[str, float]) -> np.ndarray:
        seen.append(values["r"])
        return decay({"a": 2.0, "r": 0.7}) - decay(values)

    found = fit(residuals, [Parameter("a", 1.0), Parameter("r", 0.2, 0.1, 0.5)])
    assert found.at_bound == ("r",)
    assert found["r"] == 0.5
    assert min(seen) >= 0.1
    assert max(seen) <= 0.5


def test_further_starts_find_what_the_first_misses() -> None:
    def residuals(values: Mapping[str, float]) -> np.ndarray:
        return np.sin(3.0 * TIME) - np.sin(values["w"] * TIME)

    wave = Parameter("w", 12.0, 0.5, 20.0)
    assert abs(fit(residuals, [wave])["w"] - 3.0) > 1.0
    found = fit(residuals, [wave], starts=30, seed=3)
    assert found["w"] == pytest.approx(3.0, rel=1e-8)
    # Some starts end there, others elsewhere.
    assert 1 <= sum(start.cost <= found.cost + 1e-9 for start in found.starts) < 30
    assert len(found.starts) == 30
    again = fit(residuals, [wave], starts=30, seed=3)
    assert again.values == found.values


def test_a_prior_is_a_measurement() -> None:
    measured = 3.0 - 2.0 * TIME
    prior = Prior(("m", "held"), np.array([-1.0, 5.0]), np.array([[0.04, 0.01], [0.01, 0.09]]))
    found = fit(
        lambda v: (measured - v["c"] - v["m"] * TIME) / 0.5, [Parameter("c", 0.0), Parameter("m", 1.0)], prior=prior
    )
    design = np.column_stack([np.ones_like(TIME), TIME]) / 0.5
    information = design.T @ design + np.diag([0.0, 1 / 0.04])
    exact = np.linalg.solve(information, design.T @ (measured / 0.5) + [0.0, -1.0 / 0.04])
    np.testing.assert_allclose(found.values, exact, rtol=1e-8)
    np.testing.assert_allclose(found.covariance, np.linalg.inv(information), rtol=1e-5)
    assert found.residuals.shape == TIME.shape


def test_correlated_prior_alone_is_returned() -> None:
    covariance = np.array([[0.04, 0.05], [0.05, 0.09]])
    prior = Prior(("a", "b"), np.array([1.0, 2.0]), covariance)
    found = fit(lambda v: np.zeros(3), [Parameter("a", 0.0), Parameter("b", 0.0)], prior=prior)
    np.testing.assert_allclose(found.values, [1.0, 2.0], rtol=1e-8)
    np.testing.assert_allclose(found.covariance, covariance, rtol=1e-5)


def test_what_the_data_do_not_tell() -> None:
    measured = 3.0 - 2.0 * TIME
    parameters = [Parameter("c", 0.0), Parameter("m", 1.0), Parameter("idle", 4.0)]
    found = fit(lambda v: measured - v["c"] - v["m"] * TIME, parameters)
    assert found.silent == ("idle",)
    assert found.sigma["idle"] == np.inf
    assert found["idle"] == 4.0
    design = np.column_stack([np.ones_like(TIME), TIME])
    np.testing.assert_allclose(found.covariance[:2, :2], np.linalg.inv(design.T @ design), rtol=1e-5)
    # Only the sum of two is told: the one of the smaller scale is given up, the other is then told.
    found = fit(lambda v: measured - v["c"] - (v["m"] + v["more"]) * TIME, [*parameters[:2], Parameter("more", 0.5)])
    assert found.silent == ("more",)
    assert found["m"] + found["more"] == pytest.approx(-2.0)


def test_of_parameters_that_lead_alike_the_first_is_given_up() -> None:
    """Rounding would choose otherwise: which of two equal entries of a singular vector is larger."""
    for column in np.random.default_rng(3).normal(size=(20, TIME.size)):
        assert inverse(np.column_stack([column, TIME, column]))[1].tolist() == [True, False, False]


def test_refusals() -> None:
    line = Parameter("m", 1.0)
    with pytest.raises(InputError, match="twice"):
        fit(lambda v: TIME, [line, line])
    with pytest.raises(InputError, match="1 residuals cannot determine 2 parameters"):
        fit(lambda v: np.ones(1), [line, Parameter("c", 0.0)])
    with pytest.raises(InputError, match=r"not finite at m = 1"):
        fit(lambda v: np.full(3, np.nan), [line])
    with pytest.raises(InputError, match="leave no room"):
        Parameter("m", 1.0, 2.0, 2.0)
    with pytest.raises(InputError, match="logarithm"):
        Parameter("m", 1.0, 0.0, 2.0, log=True)
    with pytest.raises(InputError, match="normalised"):
        fit(lambda v: TIME, [line], prior=Prior(("m",), np.ones(1), np.eye(1)), normalised=False)
    with pytest.raises(InputError, match="positive definite"):
        fit(lambda v: TIME, [line, Parameter("c", 0.0)], prior=Prior(("m", "c"), np.ones(2), np.ones((2, 2))))
