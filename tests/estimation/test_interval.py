"""Intervals, the rule for "not determined", and covariances of correlated residuals against many fits."""

from __future__ import annotations

import doctest
import math

import numpy as np
import pytest
from scipy import signal, stats

from feedsim.estimation import least_squares
from feedsim.estimation.identify.result import Estimate, Status
from feedsim.estimation.least_squares import Covariance, correlated_middle, correlation_length

ROWS, RUNS, POLE = 2000, 400, 0.9


def test_examples_of_docstrings() -> None:
    assert doctest.testmod(least_squares).failed == 0


@pytest.mark.parametrize(
    ("value", "half", "determined", "shows"),
    [(1.0, 0.5, True, True), (1.0, 0.51, False, True), (-1.0, 0.5, True, True), (-1.0, 0.99, False, True),
     (1.0, 1.0, False, False), (-1.0, 1.01, False, False), (0.0, 1e-9, False, False), (1.0, math.inf, False, False),
     (1.0, math.nan, True, True)],
)  # fmt: skip
def test_the_rule(value: float, half: float, determined: bool, shows: bool) -> None:
    assert least_squares.is_determined(value, half) is determined
    assert least_squares.is_significant(value, half) is shows


@pytest.mark.parametrize(
    ("name", "status", "sigma", "becomes"),
    [("sigma_0", "estimated", 0.25, "estimated"), ("sigma_0", "estimated", 0.26, "undetermined"),
     ("M_0", "estimated", 3.0, "estimated"), ("sigma_0", "held", math.nan, "held"),
     ("sigma_0", "given", math.nan, "given")],
)  # fmt: skip
def test_an_estimate_is_judged_by_it(name: str, status: Status, sigma: float, becomes: str) -> None:
    """What judges parameters of friction and of drives; the value stays."""
    judged = Estimate(name, -1.0, "", "", sigma, status).judged()
    assert (judged.status, judged.value) == (becomes, -1.0)
    if becomes == "undetermined":
        assert judged.reason == "its 95 % interval is +-51 % of the value"


def test_the_interval_is_that_of_a_normal_distribution() -> None:
    assert least_squares.half_width(2.0) == pytest.approx(2 * stats.norm.ppf(0.975), rel=1e-6)


@pytest.mark.parametrize("of_mean", [True, False])
def test_rows_that_count_as_one(of_mean: bool) -> None:
    """Of a process of first order with the pole a: (1 + a)/(1 - a) rows, and one of white noise."""
    noise = np.random.default_rng(5).standard_normal(400_000)
    assert correlation_length(noise, of_mean=of_mean) == pytest.approx(1.0, abs=0.1)
    # The estimate of a sum over some hundred lags scatters by a few percent on so many rows.
    correlated = signal.lfilter([1.0], [1.0, -POLE], noise)
    assert correlation_length(correlated, of_mean=of_mean) == pytest.approx((1 + POLE) / (1 - POLE), rel=0.12)


def test_rows_that_count_as_one_where_errors_swing() -> None:
    """A sine of P rows: its correlation is a cosine, whose sum up to the first zero is P/(2 pi); over all it is 0."""
    wave = np.sin(2 * np.pi * np.arange(40_000) / 400)
    assert correlation_length(wave) == pytest.approx(2 * 400 / (2 * np.pi), rel=0.01)
    assert correlation_length(wave, of_mean=True) < 0.01 * len(wave)


def test_an_offset_is_correlated_over_all_rows() -> None:
    assert correlation_length(np.ones(1000)) == pytest.approx(1000, rel=0.3)


def test_the_covariance_is_the_scatter_of_many_fits() -> None:
    """A slope and a level fitted to correlated residuals, again and again: what the formula says is what they scatter.

    White residuals would be 4.4 times too sure here.
    """
    rng = np.random.default_rng(8)
    matrix = np.column_stack([np.ones(ROWS), np.linspace(-1.0, 1.0, ROWS)])
    normal = matrix.T @ matrix
    noise = rng.standard_normal((RUNS, ROWS + 500))
    noise = signal.lfilter([1.0], [1.0, -POLE], noise, axis=1)[:, 500:]
    values = np.linalg.solve(normal, matrix.T @ noise.T).T
    told = []
    for each, own in zip(noise, values, strict=True):
        middle = correlated_middle(matrix, each - matrix @ own, 0.0, correlation_length)
        told.append(Covariance.of(normal, hermitian=True).by(middle))
    scatter = np.std(values, axis=0)
    # 400 fits tell a standard deviation to 3.5 %; the fit takes two values of some 105 independent ones.
    assert np.sqrt(np.diag(np.mean(told, axis=0))) == pytest.approx(scatter, rel=0.12)


def test_blocks_that_share_their_noise() -> None:
    """A mean of blocks of equal noise: the variance of the mean over as many values as there are blocks."""
    rng = np.random.default_rng(3)
    blocks, size = 40, 25
    own = rng.standard_normal(blocks)
    block = np.repeat(np.arange(blocks), size)
    matrix = np.ones((blocks * size, 1))
    residual = (own - own.mean())[block]
    found = Covariance.of(matrix.T @ matrix).of_blocks(matrix, residual, block, blocks - 1)
    assert found[0, 0] == pytest.approx(np.var(own, ddof=1) / blocks)
    single = Covariance.of(matrix.T @ matrix).of_samples(matrix, residual)
    assert single[0, 0] == pytest.approx(found[0, 0] * (blocks - 1) / blocks / size)


def test_the_autocorrelation_is_the_sum_of_products() -> None:
    values = np.random.default_rng(2).standard_normal(50)
    expected = np.correlate(values, values, "full")[49:]
    assert least_squares.autocorrelation(values)[:50] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("free", [2, 7, 40, 1e6])
def test_a_pair_of_values_has_the_quantile_of_fisher(free: float) -> None:
    assert least_squares.pair_quantile(free) == pytest.approx(math.sqrt(2 * stats.f.ppf(0.95, 2, free)), rel=1e-9)
