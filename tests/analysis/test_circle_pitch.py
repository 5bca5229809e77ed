"""Errors that repeat with the pitch, on circles that are fast for the position loop: from a differential equation that
the diagnosis does not know."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from feedsim.analysis.circle import CircleUnderTest, Diagnosis, TurnedPath, diagnose

Array = NDArray[np.float64]
PITCH, RATE, DAMPING = 0.02, 2 * math.pi * 14.0, 0.6  # m, rad/s, 1


def follows(frequency: Array) -> NDArray[np.complex128]:
    """-x_a over an error of the measured position, of a loop of second order [1]."""
    s = 2j * math.pi * frequency / RATE
    return np.asarray(1 / (s**2 + 2 * DAMPING * s + 1))


def path(radius: float, speed: float, sense: int, errors: dict[int, tuple[float, float]]) -> TurnedPath:
    """A turn, steady: axis number -> amplitude [m] and phase [rad] of its error; 10 nm of noise."""
    omega = speed / radius
    time = np.linspace(0, 2 * math.pi / omega, 4001)[:-1]

    def nominal(i: int, t: Array) -> Array:
        return radius * (np.cos(omega * t) if i == 0 else sense * np.sin(omega * t))

    positions = np.array([nominal(i, time) for i in (0, 1)])
    for i, (size, phase) in errors.items():

        def slope(t: float, y: Array, i: int = i, size: float = size, phase: float = phase) -> list[float]:
            error = size * np.cos(2 * math.pi * nominal(i, np.array(t)) / PITCH + phase)
            return [y[1], float(-(RATE**2) * (error + y[0]) - 2 * DAMPING * RATE * y[1])]

        end = 4 * math.pi / omega  # the first turn lets it settle
        solved = solve_ivp(slope, (0, end), [0, 0], t_eval=time + end / 2, rtol=1e-8, atol=1e-12, max_step=0.002)
        positions[i] += solved.y[0]
    positions += 10e-9 * np.random.default_rng(7 + sense).standard_normal(positions.shape)
    return TurnedPath(np.arctan2(positions[1], positions[0]), np.hypot(*positions) - radius, sense, omega * time)


def diagnosed(radius: float, speed: float, errors: dict[int, tuple[float, float]], known: bool = True) -> Diagnosis:
    multiples = speed / radius / (2 * math.pi) * np.arange(1, 60)
    following = dict.fromkeys("XY", follows(multiples)) if known else {}
    circle = CircleUnderTest(("X", "Y"), radius, speed, dict.fromkeys("XY", PITCH), following=following)
    return diagnose(circle, [path(radius, speed, sense, errors) for sense in (1, -1)])


@pytest.mark.parametrize(("radius", "speed"), [(0.03, 10 / 60), (0.06, 10 / 60), (0.045, 3 / 60)])
def test_the_error_is_that_of_the_scale(radius: float, speed: float) -> None:
    found = diagnosed(radius, speed, {0: (2e-6, 0.7), 1: (1e-6, -1.9)})
    for axis, size in (("X", 2e-6), ("Y", 1e-6)):
        term = found[f"pitch {axis}"]
        assert abs(term.value - size) < max(term.half, 5e-9)  # 1024 points of the course, linear between: 2e-3 of it
        assert term.value == pytest.approx(size, rel=0.01)
        assert abs(found[f"lost_motion {axis}"].value) < 20e-9


def test_of_an_unknown_machine_it_is_what_the_slide_does() -> None:
    """Ahead of its resonance the loop follows a fast error late, which in two senses is another curve."""
    known, unknown = (diagnosed(0.06, 10 / 60, {0: (2e-6, 0.7)}, known=each) for each in (True, False))
    assert known["rest"].size < 0.2e-6 < unknown["rest"].size
    assert abs(unknown["pitch X"].value / 2e-6 - 1) > 0.05


@pytest.mark.parametrize("pitches", [0.7, 1.2, 1.8])
def test_an_error_of_few_pitches_is_no_lost_motion(pitches: float) -> None:
    """It is not named, either: the circle is too small for it."""
    found = diagnosed(pitches * PITCH / 2, 0.01, {0: (2e-6, 0.7)})
    assert found.left_out == ("X", "Y")
    assert not [term for term in found.terms if term.key == "pitch"]
    for axis in "XY":
        lost = found[f"lost_motion {axis}"]
        assert abs(lost.value) < 0.1e-6
        assert abs(lost.value) <= lost.half
