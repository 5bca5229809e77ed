"""Scatter of a fit that leaves out one group of rows after the other."""

from __future__ import annotations

import numpy as np
import pytest

from feedsim.estimation.least_squares import NORMAL_95, between_groups, student


def test_a_mean_of_groups_in_closed_form() -> None:
    """The groups' means y_g of equal size: the variance of their mean is their scatter over their number."""
    rng, rows, count = np.random.default_rng(1), 5, 8
    y = np.repeat(rng.standard_normal(count), rows)
    groups = np.array_split(np.arange(count * rows), count)
    (variance,) = between_groups(np.ones((count * rows, 1)), y, groups)
    means = np.array([np.mean(y[rows]) for rows in groups])
    expected = np.var(means, ddof=1) / count * (student(count - 1) / NORMAL_95) ** 2
    assert variance == pytest.approx(expected, rel=1e-9)


def test_units_of_the_columns_change_nothing() -> None:
    """Columns in units 1e9 apart, a row that always stays, a column of zeros, a sum that is asked for."""
    rng = np.random.default_rng(2)
    units = np.array([1.0, 1e-6, 1e3])
    A = rng.standard_normal((40, 3))
    b = A @ np.array([1.0, 2.0, 3.0]) + rng.standard_normal(40)
    groups = np.array_split(np.arange(39), 6)
    wanted = np.array([[1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    variance = between_groups(A, b, groups, wanted)
    scaled = between_groups(
        np.column_stack([A * units, np.zeros(40)]), b, groups, np.column_stack([wanted * units, [0, 0]])
    )
    assert scaled == pytest.approx(variance, rel=1e-9)
    assert between_groups(A, b, groups)[2] == pytest.approx(variance[1], rel=1e-9)


@pytest.mark.parametrize("determining", [8, 4, 2])
def test_groups_that_say_nothing_do_not_count(determining: int) -> None:
    """A mean of the first groups alone, rows of the others have no weight: its variance is that of the first ones'
    mean, with their degrees of freedom."""
    rng, rows = np.random.default_rng(3), 5
    weight = np.repeat(np.where(np.arange(8) < determining, 1.0, 0.0), rows)
    y = np.repeat(rng.standard_normal(8), rows)
    (variance,) = between_groups(weight[:, None], weight * y, np.array_split(np.arange(8 * rows), 8))
    expected = np.var(y[: determining * rows : rows], ddof=1) / determining
    assert variance == pytest.approx(expected * (student(determining - 1) / NORMAL_95) ** 2, rel=1e-9)


def test_intervals_of_unequal_groups() -> None:
    """A line through noise, in groups of 2 to 30 rows: at least 95 of 100 intervals have the slope, and not all of
    them: few unequal groups have between one and two degrees of freedom, for which Satterthwaite's are wide."""
    rng, inside = np.random.default_rng(4), 0
    x = np.linspace(0.0, 1.0, 100) ** 2
    A, first = np.column_stack([x, np.ones(100)]), np.array([[1.0, 0.0]])
    groups = np.split(np.arange(100), [2, 10, 25, 55, 70, 90])
    for _ in range(800):
        y = 3.0 * x + rng.standard_normal(100)
        (variance,) = between_groups(A, y, groups, first)
        inside += abs(np.linalg.lstsq(A, y, rcond=None)[0][0] - 3.0) <= NORMAL_95 * np.sqrt(variance)
    assert 0.93 <= inside / 800 <= 0.99


def test_values_that_nothing_moves() -> None:
    """A column of zeros has no variance."""
    assert between_groups(np.zeros((16, 1)), np.ones(16), np.array_split(np.arange(16), 8)) == pytest.approx([0.0])
