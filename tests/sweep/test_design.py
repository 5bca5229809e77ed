"""Designs: what the method promises, from the study alone."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from feedsim.design.sweep import design
from feedsim.design.sweep.design import quantile
from feedsim.scenario.study import Distribution, load_study

Write = Callable[..., Path]
PARAMETERS = (
    "parameters:\n"
    "  a: {key: machine.axes.Z.friction.F_C, from: 1 N.m, to: 2 N.m}\n"
    "  b: {key: motions.0.feed, distribution: loguniform, from: 1 m/min, to: 4 m/min}\n"
    "  c: {key: coupling.scheme, values: [extrapolated, jacobi]}\n"
)


def text(method: str, runs: int, seed: int = 3) -> str:
    sampling = f"{{method: {method}, runs: {runs}, seed: {seed}}}"
    return f"name: D\nscenario: short.yaml\nsampling: {sampling}\n{PARAMETERS}"


@pytest.mark.parametrize("method", ["sobol", "latin_hypercube", "sensitivity"])
def test_the_study_alone_decides(study: Write, method: str) -> None:
    first, again = (design(load_study(study(text(method, 16)))) for _ in range(2))
    assert np.array_equal(first.values, again.values)
    other = design(load_study(study(text(method, 16, seed=4))))
    assert not np.array_equal(first.values, other.values)
    assert all(first.task(i).changes == again.task(i).changes for i in range(first.runs))


@pytest.mark.parametrize("method", ["sobol", "latin_hypercube"])
def test_each_parameter_is_spread_evenly(study: Write, method: str) -> None:
    """One value in each of as many parts of equal probability as there are runs."""
    values = design(load_study(study(text(method, 32)))).values
    shares = np.stack([values[:, 0] - 1, np.log(values[:, 1] * 60) / np.log(4)], axis=1)
    for column in shares.T:
        assert sorted(np.floor(column * 32)) == [*range(32)]
    assert np.count_nonzero(values[:, 2] == 0) == 16


def test_matrices_of_a_sensitivity_study(study: Write) -> None:
    planned = design(load_study(study(text("sensitivity", 8))))
    assert planned.matrices is not None
    a, b = planned.values[planned.matrices.a], planned.values[planned.matrices.b]
    assert planned.runs == 8 * (3 + 2)
    assert planned.matrices.ab.shape == (3, 8)
    for i, rows in enumerate(planned.matrices.ab):
        mixed = a.copy()
        mixed[:, i] = b[:, i]
        assert np.array_equal(planned.values[rows], mixed)
    every = np.concatenate([planned.matrices.a, planned.matrices.b, planned.matrices.ab.ravel()])
    assert sorted(every) == [*range(planned.runs)]


def test_grid_has_every_combination(study: Write) -> None:
    grid = text("grid", 1).replace(", runs: 1, seed: 3", "").replace("N.m}", "N.m, count: 3}")
    planned = design(load_study(study(grid.replace("m/min}", "m/min, count: 3}"))))
    rows = [tuple(row) for row in planned.values]
    assert len(set(rows)) == len(rows) == 3 * 3 * 2
    assert planned.values[:6, 0].tolist() == [1.0] * 6
    assert np.unique(planned.values[:, 1]) * 60 == pytest.approx([1, 2, 4], rel=1e-14)


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (Distribution("uniform", -1.0, 3.0), stats.uniform(-1, 4).cdf),
        (Distribution("loguniform", 0.5, 8.0), stats.loguniform(0.5, 8).cdf),
        (Distribution("triangular", 0.0, 4.0, mode=1.0), stats.triang(0.25, 0, 4).cdf),
        (Distribution("normal", mean=2.0, deviation=0.5), stats.norm(2, 0.5).cdf),
    ],
)
def test_values_are_distributed_as_asked(found: Distribution, expected: Callable[[float], float]) -> None:
    shares = np.linspace(0.001, 0.999, 101)
    # The inverse of a distribution function in doubles, near 0 and 1 of unbounded ones too.
    assert np.asarray(expected(quantile(found, shares))) == pytest.approx(shares, abs=1e-12)


def test_moments_of_lognormal_are_those_of_the_quantity() -> None:
    shares = (np.arange(200_000) + 0.5) / 200_000
    values = quantile(Distribution("lognormal", mean=3.0, deviation=0.6), shares)
    # The midpoint rule leaves out the tails: 1e-4 of the deviation at 200 000 points.
    assert (values.mean(), values.std()) == pytest.approx((3.0, 0.6), rel=2e-4)


def test_cut_distributions_stay_inside() -> None:
    shares = np.array([0.0, 1e-300, 0.25, 0.5, 1.0])
    for kind in ("normal", "lognormal"):
        values = quantile(Distribution(kind, 0.9, 1.3, mean=1.0, deviation=0.1), shares)
        assert values.min() >= 0.9
        assert values.max() <= 1.3
        assert np.all(np.diff(values) >= 0)
    cut = quantile(Distribution("normal", 0.9, 1.3, mean=1.0, deviation=0.1), shares[3:4])[0]
    below, above = stats.norm(1, 0.1).cdf([0.9, 1.3])
    assert stats.norm(1, 0.1).cdf(cut) == pytest.approx((below + above) / 2, rel=1e-12)
