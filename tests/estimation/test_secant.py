"""Least squares with few calls, against scipy's, which takes differences at every step."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pytest
from scipy.optimize import least_squares

from feedsim.estimation.least_squares import LeastSquares, Point, secant, secant_from
from feedsim.estimation.parameter import Array, Parameter
from feedsim.foundation.errors import InputError

TIME = np.linspace(0.0, 3.0, 200)
TRUE = np.array([1.2, 0.7, 0.4, -0.3])
STEPS = np.full(4, 1e-4)
FREE = np.full(4, -np.inf), np.full(4, np.inf)


def course(x: Array) -> Array:
    """A decay beside an oscillation: curved in two of its parameters."""
    return np.asarray(x[0] * np.exp(-x[1] * TIME) + x[2] * np.sin(4 * TIME + x[3]))


class Counted:
    """What is left of a course with noise, and how often that was asked."""

    def __init__(self) -> None:
        self.calls = 0
        self.measured = course(TRUE) + 0.02 * np.random.default_rng(1).standard_normal(len(TIME))

    def __call__(self, x: Array) -> Array:
        self.calls += 1
        return course(x) - self.measured


def least(errors: Callable[[Array], Array], low: Array = FREE[0], high: Array = FREE[1]) -> LeastSquares:
    """With the noise's own weight, and a weak prior at 0."""
    parameters = [Parameter(str(k), 0.0, *both, scale=1.0) for k, both in enumerate(zip(low, high, strict=True))]

    def model(values: Mapping[str, float]) -> Array:
        return errors(np.array([*values.values()]))

    return LeastSquares(model, parameters, STEPS, lambda x: 0.01 * x, np.full(len(TIME), 0.02))


def unknown(rows: int = len(TIME), columns: int = 4) -> Array:
    return np.full((rows, columns), np.nan)


def test_the_end_is_that_of_exact_jacobians() -> None:
    """To a small share of a standard deviation, as the promise of a step that is left says; in less calls."""
    begin = np.array([0.6, 0.2, 0.2, 0.2])
    errors, exact = Counted(), Counted()
    found = secant(least(errors), begin, unknown(), 1e-6)
    other = least_squares(lambda x: np.concatenate([exact(x) / 0.02, 0.01 * x]), begin, xtol=1e-12)
    sigma = np.sqrt(np.diag(np.linalg.inv(other.jac.T @ other.jac)))
    assert np.all(np.abs(found.x - other.x) < 0.05 * sigma)
    assert errors.calls < 0.7 * exact.calls


def test_slopes_from_nearby_save_calls() -> None:
    """They are taken over, and what is not known is found by differences: three calls of four are saved."""
    near = least(Counted()).exact(secant(least(Counted()), TRUE, unknown(), 1e-4))
    slopes = near.slopes.copy()
    slopes[:, 3] = np.nan
    begin = near.x + np.array([0.001, 0.0, 0.0, 0.002])
    calls = []
    for known in (slopes, unknown()):
        errors = Counted()
        found = secant(least(errors), begin, known, 1e-4)
        assert found.x == pytest.approx(near.x, abs=1e-3)
        calls.append(errors.calls)
    assert calls[1] - calls[0] == 3


def test_bounds_hold() -> None:
    """The end lies on a bound where the free one lies behind it, and is the least of those that are allowed."""
    low, high = np.array([0.0, 0.0, 0.0, -0.1]), np.array([2.0, 2.0, 2.0, 1.0])
    begin = np.array([1.0, 0.5, 0.5, 0.5])
    found = secant(least(Counted(), low, high), begin, unknown(), 1e-6)
    errors = Counted()
    other = least_squares(lambda x: np.concatenate([errors(x) / 0.02, 0.01 * x]), begin, bounds=(low, high), xtol=1e-12)
    assert found.x[3] == -0.1
    assert found.x == pytest.approx(other.x, abs=1e-3)


def test_steps_into_nothing_are_shortened() -> None:
    """A simulation of a drive that is unstable has no result: the search goes round it, and begins nowhere there."""
    errors = Counted()

    def guarded(x: Array) -> Array:
        if x[1] > 0.75:
            raise InputError("unstable")
        return errors(x)

    problem = least(guarded)
    found = secant(problem, np.array([0.6, 0.2, 0.2, 0.2]), unknown(), 1e-5)
    assert found.x == pytest.approx(TRUE, abs=0.03)
    with pytest.raises(InputError, match="unstable"):
        secant(problem, np.array([0.6, 0.8, 0.2, 0.2]), unknown(), 1e-5)


def test_slopes_in_the_end() -> None:
    """Central differences are those of the closed form to the square of their step."""
    problem = least(Counted())
    point = problem.exact(secant(problem, TRUE, unknown(), 1e-4), central=True)
    x = point.x
    decay, angle = np.exp(-x[1] * TIME), 4 * TIME + x[3]
    form = np.column_stack([decay, -x[0] * TIME * decay, np.sin(angle), x[2] * np.cos(angle)])
    assert point.exact
    assert np.abs(point.slopes - form).max() < 1e-7


def test_a_search_goes_on_from_a_point_without_a_call() -> None:
    """Where it has ended with slopes by differences, nothing is found anew."""
    errors = Counted()
    problem = least(errors)
    point = problem.exact(secant(problem, TRUE, unknown(), 1e-6))
    errors.calls = 0
    assert secant_from(problem, point, 1e-4) is point
    assert errors.calls == 0


def test_slopes_near_the_end_are_named() -> None:
    """Those by differences at a point with about the same cost are; those from elsewhere are not."""
    problem = least(Counted())
    end = problem.exact(secant(problem, TRUE, unknown(), 1e-6))
    assert end.near
    assert not secant(problem, end.x, 1.1 * end.slopes, 1e-2).near


def test_a_search_that_leads_to_nothing_is_given_up() -> None:
    """It is asked with slopes by differences, and with what a step of any length would gain: nearly all, far away."""
    asked: list[float] = []

    def give_up(point: Point, predicted: float, taken: int) -> bool:
        assert point.exact
        assert taken == len(asked) + 1
        asked.append(predicted / problem.cost(point.x, point.errors))
        return True

    begin = np.array([0.1, 2.0, 1.0, 1.0])
    problem, whole = least(errors := Counted()), least(all_errors := Counted())
    point = secant(problem, begin, unknown(), 1e-6, give_up)
    end = secant(whole, begin, unknown(), 1e-6)
    assert len(asked) == 1
    assert 0 < asked[0] < 1
    assert errors.calls < all_errors.calls
    assert problem.cost(point.x, point.errors) > whole.cost(end.x, end.errors)
