"""NC: the profile along a path and the spline through its samples. Oracles are closed forms."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from feedsim.foundation.errors import InputError
from feedsim.motions.profile import rest_to_rest, speed_change
from feedsim.simulation.nc import RestSpline

JERK = 150.0


def closed_form_duration(length: float, speed: float, acceleration: float, jerk: float) -> float:
    """Rest-to-rest time with limited jerk, from the three textbook cases (cruise; acceleration reached; neither)."""

    def ramp(v: float) -> float:
        return v / acceleration + acceleration / jerk if v * jerk >= acceleration**2 else 2 * math.sqrt(v / jerk)

    if length >= speed * ramp(speed):
        return length / speed + ramp(speed)
    half = acceleration**2 / (2 * jerk)
    v = -half + math.sqrt(half**2 + acceleration * length)
    if v * jerk >= acceleration**2:
        return 2 * ramp(v)
    return 4 * math.sqrt((length**2 * jerk / 4) ** (1 / 3) / jerk)


def test_default_z_move_lasts_as_long_as_the_closed_form() -> None:
    profile = rest_to_rest(0.1, 5.0 / 60, 14.4, JERK)
    assert profile.duration == pytest.approx(0.1 / (5 / 60) + 2 * math.sqrt(5 / 60 / JERK), rel=1e-14)
    assert profile.duration == pytest.approx(1.2471, abs=5e-5)
    assert profile.steady == pytest.approx((2 * math.sqrt(5 / 60 / JERK), 0.1 / (5 / 60)), rel=1e-12)


@settings(max_examples=200, derandomize=True)
@given(
    length=st.floats(-9, 4), speed=st.floats(-6, 1), acceleration=st.floats(-3, 2.5), jerk=st.floats(-2, 5)
)  # decimal exponents
def test_profile_keeps_its_limits_and_is_as_fast_as_the_closed_form(
    length: float, speed: float, acceleration: float, jerk: float
) -> None:
    limits = [10.0**exponent for exponent in (length, speed, acceleration, jerk)]
    profile = rest_to_rest(*limits)
    # rounding: lengths and times are scaled twice, 1e-12 is some thousand units of the last place
    assert profile.duration == pytest.approx(closed_form_duration(*limits), rel=1e-12)
    t = np.linspace(0, profile.duration, 400)
    s, v, a = profile.at(t)
    assert (s[0], s[-1]) == (0.0, pytest.approx(limits[0], rel=1e-13))
    assert np.all(np.diff(s) >= -1e-13 * limits[0])
    assert np.abs(v).max() <= limits[1] * (1 + 1e-9)
    assert np.abs(a).max() <= limits[2] * (1 + 1e-9)
    assert np.abs(profile.jerk).max() <= limits[3] * (1 + 1e-9)
    # at the end, an instant rounded to 2e-16 of the duration is worth that much speed
    assert v[[0, -1]] == pytest.approx(0, abs=1e-9 * profile.peak_speed + 1e-15 * profile.duration * limits[2])
    # time_at is the inverse of at, where the path moves
    wanted = limits[0] * np.array([0.0, 0.1, 0.5, 0.9, 1.0])
    assert profile.at(profile.time_at(wanted))[0] == pytest.approx(wanted, rel=1e-12)


@pytest.mark.parametrize(
    ("limits", "speed", "acceleration"),
    [
        # neither limit is reached: four phases of T = (L / 2j)^(1/3), with j T^2 and j T at their ends
        ((0.1, 1.0, 14.4, 150.0), 150 * (0.1 / 300) ** (2 / 3), 150 * (0.1 / 300) ** (1 / 3)),
        # the acceleration is reached: v (v/a + a/j) = L
        ((0.5, 10.0, 2.0, 100.0), -0.02 + math.sqrt(0.02**2 + 1.0), 2.0),
        # the speed is reached
        ((0.5, 0.1, 2.0, 100.0), 0.1, 2.0),
    ],
)
def test_peaks_of_triangular_and_other_profiles(
    limits: tuple[float, float, float, float], speed: float, acceleration: float
) -> None:
    profile = rest_to_rest(*limits)
    assert profile.peak_speed == pytest.approx(speed, rel=1e-12)
    assert profile.peak_acceleration == pytest.approx(acceleration, rel=1e-12)
    assert (profile.steady is not None) == (speed == limits[1])


@settings(max_examples=200, derandomize=True)
@given(
    length=st.floats(-6, 2), speed=st.floats(-4, 1), acceleration=st.floats(-2, 2.5), jerk=st.floats(-1, 5)
)  # decimal exponents
def test_peaks_are_those_of_a_dense_sampling(length: float, speed: float, acceleration: float, jerk: float) -> None:
    profile = rest_to_rest(*(10.0**exponent for exponent in (length, speed, acceleration, jerk)))
    edges = np.unique(np.concatenate([profile.times, [0.0]]))
    t = np.concatenate([np.linspace(a, b, 2001) for a, b in pairwise(edges)])
    _, v, a = profile.at(t)
    # 2000 samples of a phase miss the top of its parabola by up to (1/2000)^2 of its height: 3e-7
    assert profile.peak_speed == pytest.approx(np.abs(v).max(), rel=3e-7)
    assert profile.peak_speed >= np.abs(v).max() * (1 - 1e-12)
    assert profile.peak_acceleration == pytest.approx(np.abs(a).max(), rel=1e-9)
    # a phase of constant speed is at the peak speed
    if profile.steady is not None:
        assert profile.at(np.array([sum(profile.steady) / 2]))[1] == pytest.approx(profile.peak_speed, rel=1e-9)


def test_profile_without_length_takes_no_time() -> None:
    profile = rest_to_rest(0.0, 1.0, 1.0, 1.0)
    assert profile.duration == 0
    assert profile.steady is None
    assert profile.at(np.array([0.0, 1.0]))[0].tolist() == [0, 0]


@pytest.mark.parametrize(
    "bad", [(-1.0, 1, 1, 1), (1, 0.0, 1, 1), (1, 1, math.nan, 1), (1, 1, 1, -2.0), (math.inf, 1, 1, 1)]
)
def test_profile_refuses_limits_that_make_no_sense(bad: tuple[float, float, float, float]) -> None:
    with pytest.raises(InputError, match="not allowed; allowed: limits above 0"):
        rest_to_rest(*bad)


@pytest.mark.parametrize("speed", [0.2, -0.2, 1e-4, 0.0])
def test_a_change_of_speed_is_as_fast_as_the_closed_form(speed: float) -> None:
    """Up to a^2/j in speed the acceleration is a triangle, beyond it a trapezium; halfway there in either case."""
    change = speed_change(speed, 2.0, 50.0)
    size = abs(speed)
    duration = size / 2.0 + 2.0 / 50.0 if size >= 2.0**2 / 50.0 else 2 * math.sqrt(size / 50.0)
    assert change.duration == pytest.approx(duration, rel=1e-14)
    assert change.distance == pytest.approx(speed * duration / 2, rel=1e-13)
    x, v = change.at(np.array([-1.0, 0.0, duration / 2, change.duration, change.duration + 0.3]))
    assert v == pytest.approx([0.0, 0.0, speed / 2, speed, speed], rel=1e-13)
    assert x[[0, 1]] == pytest.approx(0, abs=0)
    assert x[-1] - x[-2] == pytest.approx(0.3 * speed, rel=1e-13)
    # An object of ruckig that lives on until the interpreter ends is complained of on standard error.
    parts = [*vars(change).values(), *vars(change.profile).values()]
    assert not [one for one in parts if type(one).__module__.startswith("ruckig")]


def test_spline_is_the_c2_interpolant_at_rest_on_both_sides() -> None:
    """Against the textbook's tridiagonal system for the slopes, solved densely."""
    rng = np.random.default_rng(7)
    points = np.cumsum(rng.normal(size=12))
    pad = 40
    y = np.concatenate([np.full(pad, points[0]), points, np.full(pad, points[-1])])
    n = len(y)
    matrix, right = np.eye(n), np.zeros(n)
    for i in range(1, n - 1):
        matrix[i, i - 1 : i + 2] = (1, 4, 1)
        right[i] = 3 * (y[i + 1] - y[i - 1])
    slopes = np.linalg.solve(matrix, right)
    spline = RestSpline(points, 0.25)
    x, v = spline(np.arange(12) * 0.25)
    # the pad of the unit under test is shorter: 0.268**28 = 1e-16 of the slopes, which are about 1
    assert x == pytest.approx(points, abs=1e-14)
    assert v * 0.25 == pytest.approx(slopes[pad : pad + 12], abs=1e-13)
    u = 0.3  # Hermite form between two knots
    k = pad + 4
    between = (
        y[k] * (1 + 2 * u) * (1 - u) ** 2 + slopes[k] * u * (1 - u) ** 2
        + y[k + 1] * u**2 * (3 - 2 * u) + slopes[k + 1] * u**2 * (u - 1)
    )  # fmt: skip
    assert spline(np.array([(4 + u) * 0.25]))[0] == pytest.approx([between], abs=1e-13)
    outside, speed = spline(np.array([-100.0, 100.0]))
    assert outside == pytest.approx(points[[0, -1]], abs=1e-15)
    assert speed == pytest.approx(0, abs=1e-15)
