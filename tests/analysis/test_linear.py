"""Searching curves for crossings, extremes and margins: textbook functions with known answers."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from feedsim.analysis import linear
from feedsim.structure import Modes

GRID = np.geomspace(1e-3, 1e3, 2000)


def third_order(K: float, f: NDArray[np.float64]) -> NDArray[np.complex128]:
    """K/(s (s + 1)(s + 2)): real at sqrt(2) rad/s, where it is -K/6."""
    s = 2j * np.pi * np.asarray(f)
    return np.asarray(K / (s * (s + 1) * (s + 2)))


def test_margins_of_a_third_order_loop() -> None:
    found = linear.margins(lambda f: third_order(1.0, f), GRID)
    assert found.gain_margin.factor == pytest.approx(6.0, rel=1e-9)
    assert found.gain_margin.frequency == pytest.approx(math.sqrt(2) / (2 * math.pi), rel=1e-9)
    assert found.gain_reduction.factor == 0.0
    (crossing,) = found.phase
    assert crossing.margin == pytest.approx(53.4109, abs=1e-3)  # at 0.446 rad/s
    assert found.crossover == found.last_crossover == crossing.frequency
    assert crossing.frequency * 2 * math.pi == pytest.approx(0.4457, abs=1e-4)


def test_margins_of_an_unstable_loop_are_negative() -> None:
    found = linear.margins(lambda f: third_order(12.0, f), GRID)
    assert found.gain_reduction.factor == pytest.approx(0.5, rel=1e-9)
    assert math.isinf(found.gain_margin.factor)
    assert found.phase_margin.margin < 0


def test_no_crossings() -> None:
    found = linear.margins(lambda f: third_order(1e-9, np.asarray(f) + 1.0), GRID)
    assert found.phase == ()
    assert math.isnan(found.crossover)
    assert math.isnan(found.phase_margin.margin)


def resonator(f: NDArray[np.float64], f_0: float, D: float) -> NDArray[np.complex128]:
    s = 1j * np.asarray(f) / f_0
    return np.asarray(1 / (s * s + 2 * D * s + 1))


def test_bandwidth_first_and_last_crossing() -> None:
    """A lag of 1 Hz with a resonance at 100 Hz far below: it rises above -3 dB there again."""

    def response(f: NDArray[np.float64]) -> NDArray[np.complex128]:
        return 1 / (1 + 1j * np.asarray(f)) + 0.1 * resonator(f, 100.0, 0.01)

    found = linear.bandwidth(response, GRID)
    edge = 10 ** (-3 / 20)
    for f in (found.first, found.last):
        assert abs(response(np.array([f]))[0]) == pytest.approx(edge, rel=1e-10)
    assert found.first < 2.0
    assert 100.0 < found.last < 110.0


def test_bandwidth_that_is_not_reached() -> None:
    assert math.isnan(linear.bandwidth(lambda f: np.ones(len(f), dtype=complex), GRID).first)


def test_delay_removes_the_phase_curvature() -> None:
    D, f_0 = 1.3, 100.0
    assert linear.delay(lambda f: resonator(f, f_0, D), 1.0) == pytest.approx(D / (math.pi * f_0), rel=1e-5)


def test_peak_of_a_resonator() -> None:
    """At f_0 sqrt(1 - 2 D^2), height 1/(2 D sqrt(1 - D^2)); the grid's own points are 0.7 % apart."""
    D, f_0 = 0.02, 37.0
    found = linear.peak(lambda f: np.abs(resonator(f, f_0, D)), GRID)
    assert found is not None
    assert found.frequency == pytest.approx(f_0 * math.sqrt(1 - 2 * D * D), rel=1e-7)
    assert found.value == pytest.approx(1 / (2 * D * math.sqrt(1 - D * D)), rel=1e-12)


def test_no_peak() -> None:
    assert linear.peak(lambda f: 1 / np.asarray(f), GRID) is None


def test_pairs_need_a_rise() -> None:
    def curve(f: NDArray[np.float64]) -> NDArray[np.float64]:
        ratio = resonator(f, 24.0, 0.03) / resonator(f, 20.0, 0.03) * resonator(f, 90.0, 0.3) / resonator(f, 88.0, 0.3)
        return np.asarray(20 * np.log10(np.abs(ratio)))

    (found,) = linear.pairs(curve, GRID, 1.0)
    assert found.antiresonance.frequency == pytest.approx(20.0, rel=5e-3)
    assert found.resonance.frequency == pytest.approx(24.0, rel=5e-3)


def test_extremes_and_crossings_of_a_sine() -> None:
    f = np.linspace(0.1, 12.0, 100)
    minima, maxima = linear.extremes(np.sin, f)  # two steps of this grid, 0.24, are narrowed to 1/8^6
    assert [each.frequency for each in maxima] == pytest.approx([math.pi / 2, 5 * math.pi / 2], abs=1e-6)
    assert [each.frequency for each in minima] == pytest.approx([3 * math.pi / 2, 7 * math.pi / 2], abs=1e-6)
    np.testing.assert_allclose(linear.crossings(np.sin, f), np.pi * np.arange(1, 4), rtol=1e-12)


def test_grid_follows_the_damping() -> None:
    def modes(damping: float) -> Modes:
        return Modes(Path("made-up"), np.array([0.0, 50.0]), np.array([0.0, damping]), {})

    for damping, step in ((0.02, 0.02 / 3), (1e-5, 5e-4), (0.5, 0.01)):
        f = linear.grid(modes(damping), 1.0, 1000.0)
        assert f[0] == pytest.approx(1.0)
        assert f[-1] == pytest.approx(1000.0)
        assert np.max(np.diff(np.log(f))) <= step
