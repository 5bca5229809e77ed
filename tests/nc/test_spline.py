"""The spline's tridiagonal system against LAPACK."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import solve_banded

from feedsim.simulation.nc import _slopes


@pytest.mark.parametrize("count", [3, 4, 5, 58, 1000, 16384])
def test_slopes_solve_the_system(count: int) -> None:
    """Both eliminate in the same order. Where a processor fuses multiplication and addition the last bits differ."""
    rng = np.random.default_rng(count)
    right = rng.normal(size=count - 2) * 10.0 ** rng.integers(-6, 3)
    bands = np.ones((3, count))
    bands[1, 1:-1] = 4.0
    bands[0, 1] = bands[2, -2] = 0.0
    expected = solve_banded((1, 1), bands, np.concatenate([[0.0], right, [0.0]]))
    found = np.array(_slopes(right.tolist()))
    assert np.abs(found - expected).max() <= 4e-16 * np.abs(right).max()
    assert found[0] == found[-1] == 0.0


def test_two_knots_are_at_rest() -> None:
    assert _slopes([]) == [0.0, 0.0]
