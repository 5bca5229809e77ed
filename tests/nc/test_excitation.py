"""Excitation signals: their spectrum, their grid, and that no excited line is the image of another."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from feedsim.foundation.errors import InputError
from feedsim.scenario import Cycles
from feedsim.simulation.cosim.excitation import Excitation, binary_sequence, distinct_lines, multisine

CYCLES = Cycles(control=125e-6, position=1e-3, interpolation=2e-3)


def spectrum(excitation: Excitation) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Amplitudes of the harmonics."""
    return np.abs(np.fft.rfft(excitation.samples)) * 2 / len(excitation.samples)


@pytest.mark.parametrize(
    ("options", "period"),
    [
        ({}, 2.0),
        ({"band": (1, 500)}, 1.0),
        ({"band": (5, 400), "resolution": 2.0}, 0.5),
        ({"band": (5, 3900), "resolution": 10.0}, 0.8),
        ({"spacing": "logarithmic"}, 2.0),
    ],
)
def test_multisine(options: dict[str, Any], period: float) -> None:
    signal = multisine(CYCLES, 4.0, **options)
    assert signal.period == pytest.approx(period, rel=1e-12)
    assert len(signal.samples) % 8 == 0  # whole position cycles
    assert signal.rms == pytest.approx(4.0, rel=1e-12)
    amplitudes = spectrum(signal)
    # equal amplitudes at the lines, nothing between them: rounding of the transform alone
    np.testing.assert_allclose(amplitudes[signal.lines], 4.0 * np.sqrt(2 / len(signal.lines)), rtol=1e-10)
    amplitudes[signal.lines] = 0
    assert amplitudes.max() < 1e-12
    low, high = options.get("band", (1, 1000))
    assert low <= signal.frequency[0]
    assert signal.frequency[-1] <= high


def images(lines: np.ndarray[Any, np.dtype[np.int64]], position_cycles: int) -> list[int]:
    """Where every line appears to a controller that samples once per position cycle."""
    return [min(int(k) % position_cycles, -int(k) % position_cycles) for k in lines]


@pytest.mark.parametrize(
    "signal",
    [
        multisine(CYCLES, 1.0),
        multisine(CYCLES, 1.0, band=(1, 500)),
        multisine(CYCLES, 1.0, band=(1, 3999), resolution=4.0),
        multisine(CYCLES, 1.0, spacing="logarithmic"),
        binary_sequence(CYCLES, 1.0),
        binary_sequence(CYCLES, 1.0, band=(1, 3999)),
    ],
)
def test_no_line_is_the_image_of_another(signal: Excitation) -> None:
    position_cycles = len(signal.samples) // 8
    found = images(signal.lines, position_cycles)
    assert len(set(found)) == len(found)
    assert 0 not in found


def test_a_sequence_held_for_position_cycles_has_images() -> None:
    signal = binary_sequence(CYCLES, 1.0, stages=8, hold=8, band=(1, 900))
    found = images(signal.lines, len(signal.samples) // 8)
    assert len(set(found)) < len(found)


def test_density_of_distinct_lines() -> None:
    """Every zone keeps its share: what the docstring says of the resolution."""
    lines = distinct_lines(np.arange(1, 4000), 2000, 4)  # a period of 2 s, up to 2 kHz
    for zone in range(4):
        assert np.sum((lines >= 1000 * zone) & (lines < 1000 * (zone + 1))) == pytest.approx(250, abs=1)


def test_crest_factor_and_seeds() -> None:
    """Random phases alone have a crest factor of 3 and more at this many lines."""
    first, again, other = (multisine(CYCLES, 1.0, seed=seed) for seed in (3, 3, 4))
    assert first.peak / first.rms < 1.8
    np.testing.assert_array_equal(first.samples, again.samples)
    np.testing.assert_array_equal(first.lines, other.lines)
    phases = [np.angle(np.fft.rfft(each.samples)[each.lines]) for each in (first, other)]
    # other phases, not the same ones turned a little: their differences fill the circle
    assert abs(np.mean(np.exp(1j * (phases[0] - phases[1])))) < 0.15


def test_logarithmic_spacing() -> None:
    signal = multisine(CYCLES, 1.0, band=(10, 500), resolution=0.25, spacing="logarithmic", lines_per_decade=20)
    ratios = signal.frequency[1:] / signal.frequency[:-1]
    # 10^(1/20) = 1.122; a line is at most half a resolution off its place
    np.testing.assert_allclose(ratios, 10 ** (1 / 20), atol=0.25 / 10)
    assert len(signal.lines) == 35


def test_binary_sequence() -> None:
    signal = binary_sequence(CYCLES, 2.0, stages=9, seed=7)
    assert signal.period == pytest.approx(511 * 8 * CYCLES.T_c)
    once = signal.samples[:511]
    np.testing.assert_array_equal(np.tile(once, 8), signal.samples)
    assert len(np.unique(once)) == 2
    assert signal.rms == pytest.approx(2.0, rel=1e-12)
    assert abs(signal.samples.mean()) < 1e-14
    # the spectrum of a maximum-length sequence is flat
    amplitudes = np.abs(np.fft.rfft(once))[1:]
    np.testing.assert_allclose(amplitudes, amplitudes.mean(), rtol=1e-10)
    assert np.all(signal.lines % 8 == 0)


@pytest.mark.parametrize(("stages", "seeds"), [(6, range(6)), (9, range(1, 9)), (11, (1, 2, 175))])
def test_binary_sequences_of_other_seeds_are_not_the_same_one_shifted(stages: int, seeds: Iterable[int]) -> None:
    def once(seed: int) -> NDArray[np.float64]:
        return binary_sequence(CYCLES, 1.0, stages=stages, seed=seed, band=(0, 3999)).samples[: 2**stages - 1]

    def largest(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
        """Of the cyclic cross-correlation, 1 where one is the other shifted."""
        return float(np.fft.irfft(np.fft.rfft(a) * np.fft.rfft(b).conj(), len(a)).max()) / len(a)

    signals = [once(seed) for seed in seeds]
    for signal in signals:
        assert largest(np.roll(signal, 5), signal) == pytest.approx(1.0)
        # the spectrum of each is flat still: another sequence of greatest length
        amplitudes = np.abs(np.fft.rfft(signal))[1:]
        np.testing.assert_allclose(amplitudes, amplitudes.mean(), rtol=1e-10)
    for first, second in combinations(signals, 2):
        assert largest(first, second) < 0.9


def test_held_binary_sequence_leaves_out_the_zeros_of_the_hold() -> None:
    signal = binary_sequence(CYCLES, 1.0, stages=8, hold=4, band=(1, 3000))
    assert np.all(np.abs(signal.frequency - 2000) > 50)  # first zero at 1/(4 T_c)
    assert np.any(signal.frequency > 2500)
    np.testing.assert_array_equal(signal.samples.reshape(-1, 4).std(axis=1), 0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"band": (1, 4000)}, "below half the sampling rate of the control cycle, 4000 Hz"),
        ({"band": (100, 10)}, "the first below the second"),
        ({"band": (-1, 10)}, "both from 0 on"),
        ({"band": (100.2, 100.8)}, "no line between 100.2 and 100.8 Hz"),
        ({"rms": 0.0}, "RMS 0 of an excitation"),
        ({"rms": float("nan")}, "must be above 0 and finite"),
        ({"resolution": -1.0}, "resolution -1 Hz"),
        ({"resolution": 1e-5}, "needs periods of 200000 s; allowed are 1000 s"),
        ({"spacing": "octaves"}, "linear or logarithmic"),
    ],
)
def test_multisine_refuses(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        multisine(CYCLES, **({"rms": 1.0} | options))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"stages": 2}, "2 stages of a binary sequence; allowed are 3 to 20"),
        ({"hold": 0}, "a hold of 0 control cycles"),
        ({"stages": 3, "band": (1, 100)}, "those of the sequence are 1142.86 Hz apart"),
        ({"stages": 20, "hold": 16}, "allowed are 1000 s"),
    ],
)
def test_binary_sequence_refuses(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        binary_sequence(CYCLES, 1.0, **options)
