"""Cogging in a circle: the torque comes back in N.m, from a differential equation that the diagnosis does not know."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from feedsim.analysis.circle import CircleUnderTest, Diagnosis, TurnedPath, diagnose, term_name

Array = NDArray[np.float64]
PITCH, LEAD = 0.02, 0.02 / (2 * math.pi)
M, D, K = 900.0, 4e4, 2.5e7  # of an axis and its loops: kg, N.s/m, N/m


def response(axis: str, frequency: Array) -> NDArray[np.complex128]:
    """x_a over a torque on the rotor [m/(N.m)]."""
    s = 2j * math.pi * frequency
    return np.asarray(1 / LEAD / (M * s**2 + D * s + K))


def path(radius: float, speed: float, sense: int, torques: dict[int, list[tuple[int, float, float]]]) -> TurnedPath:
    """A turn, steady: axis number -> order, amplitude [N.m], phase [rad] of its torques; 20 nm of noise."""
    omega = speed / radius
    time = np.linspace(0, 2 * math.pi / omega, 8001)[:-1]

    def nominal(i: int, t: Array) -> Array:
        return radius * (np.cos(omega * t) if i == 0 else sense * np.sin(omega * t))

    positions = np.array([nominal(i, time) for i in (0, 1)])
    for i, waves in torques.items():

        def slope(t: float, y: Array, i: int = i, waves: list[tuple[int, float, float]] = waves) -> list[float]:
            x = nominal(i, np.array(t))
            force = sum(A * np.sin(k * x / LEAD + psi) for k, A, psi in waves) / LEAD
            return [y[1], float(force - D * y[1] - K * y[0]) / M]

        end = 4 * math.pi / omega  # the first turn lets it settle
        solved = solve_ivp(slope, (0, end), [0, 0], t_eval=time + end / 2, rtol=1e-8, atol=1e-12, max_step=0.002)
        positions[i] += solved.y[0] - solved.y[0].mean()
    positions += 20e-9 * np.random.default_rng(7 + sense).standard_normal(positions.shape)
    angle = np.arctan2(positions[1], positions[0])
    return TurnedPath(angle, np.hypot(*positions) - radius, sense, omega * time)


def diagnosed(radius: float, speed: float, torques: dict[int, list[tuple[int, float, float]]]) -> Diagnosis:
    circle = CircleUnderTest(("X", "Y"), radius, speed, {"X": PITCH, "Y": PITCH}, response=response)
    return diagnose(circle, [path(radius, speed, sense, torques) for sense in (1, -1)])


@pytest.mark.extensive
@pytest.mark.parametrize(("radius", "speed"), [(0.03, 1 / 60), (0.06, 3 / 60), (0.06, 10 / 60)])
def test_order_and_amplitude_come_back(radius: float, speed: float) -> None:
    found = [each for each in diagnosed(radius, speed, {0: [(6, 0.05, 0.3)]}).terms if each.key == "cogging"]
    (term,) = found
    assert (term.axis, term.order, term.unit) == ("X", 6, "N.m")
    assert abs(term.value - 0.05) < term.half < 0.1 * 0.05
    assert term_name(term) == "cogging of X, 6 per turn"


@pytest.mark.extensive
def test_two_axes_have_their_own() -> None:
    diagnosis = diagnosed(0.06, 0.05, {0: [(6, 0.05, 0.3)], 1: [(10, 0.03, -1.0)]})
    found = {(each.axis, each.order): each for each in diagnosis.terms if each.key == "cogging"}
    assert set(found) == {("X", 6), ("Y", 10)}
    for key, size in ((("X", 6), 0.05), (("Y", 10), 0.03)):
        assert abs(found[key].value - size) < found[key].half
    assert diagnosis["rest"].size < 0.3e-6  # noise of 20 nm, from peak to valley of 16000 samples
    assert diagnosis.circle.response is None  # results go to other processes


def test_nothing_is_named_where_there_is_none() -> None:
    assert not [each for each in diagnosed(0.06, 0.05, {}).terms if each.key == "cogging"]
