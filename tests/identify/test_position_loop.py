"""The position loop out of a record: weights, delays and gains that signals were made with."""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np
import pytest

from feedsim.estimation.identify import Record, read_records
from feedsim.estimation.identify.position_loop import (
    Taps,
    gain_by_deviation,
    noisy_delay,
    setpoint_delay,
    speed_setpoint,
)
from feedsim.estimation.least_squares import NORMAL_95
from feedsim.foundation.errors import InputError

H = 2e-3


def smooth(rows: int, seed: int = 1) -> np.ndarray:
    """A way that goes to and fro with several frequencies, far from 0 [rad]."""
    t = H * np.arange(rows)
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, 5)
    return 300.0 + sum(
        20 / f * np.sin(2 * np.pi * f * t + phase) for f, phase in zip((0.7, 1.9, 4.3, 9.1, 17.0), phases, strict=True)
    )


def lagged(x: np.ndarray, first: int, weights: np.ndarray) -> np.ndarray:
    """Sum of weights times x, `first` and more rows ago; the reach of the weights is cut off from all."""
    reach = first + len(weights) - 1
    return sum(w * x[reach - first - i : len(x) - first - i] for i, w in enumerate(weights))


def record(first: int, weights: list[float], noise: float = 0.0, seed: int = 1) -> Record:
    """A record whose following error is formed with the weights; the measured angle has wishes of its own."""
    x = smooth(700, seed)
    reach = first + len(weights) - 1
    delayed = lagged(x, first, np.array(weights))
    rng = np.random.default_rng(seed)
    angle = delayed - 0.01 * np.cos(np.arange(len(delayed)) / 40) * np.gradient(delayed)
    deviation = delayed - angle + noise * rng.standard_normal(len(delayed))
    return Record("made", H * np.arange(len(delayed)), np.zeros(len(delayed)), angle=angle, setpoint=x[reach:],
                  deviation=deviation)  # fmt: skip


@pytest.mark.parametrize(
    ("first", "weights"),
    [(3, [0.1875, 0.5, 0.3125]), (0, [1.0]), (2, [1.0]), (5, [0.25, 0.75]), (7, [-0.0625, 0.5625, 0.5625, -0.0625])],
)
def test_weights_come_back(first: int, weights: list[float]) -> None:
    found = setpoint_delay([record(first, weights)])
    assert found.first == first
    assert np.allclose(found.weights, weights, atol=1e-5)
    assert found.delay == pytest.approx(H * sum(w * (first + i) for i, w in enumerate(weights)), abs=1e-9)
    assert found.rms < 1e-8


def test_interval_of_the_delay_holds_it() -> None:
    """95 % of 40 draws; 6 misses and more have a chance of 1.4 %, 8 and more of 0.1 %."""
    misses = 0
    for seed in range(40):
        found = setpoint_delay([record(4, [0.5, 0.5], noise=1e-4, seed=seed)])
        misses += abs(found.delay - 4.5 * H) > NORMAL_95 * found.sigma
    assert misses <= 7


def test_speed_setpoint_comes_back() -> None:
    base = record(0, [1.0])
    x, angle = base.setpoint, base.angle
    assert x is not None
    assert angle is not None
    reach = 2
    forward = np.gradient(x, H)
    asked = 0.9 * forward[reach:] + 33.3 * (0.5 * (x[1:-1] + x[:-2]) - angle[reach:]) + 0.02
    one = Record("made", base.time[reach:], base.torque[reach:], angle=angle[reach:], setpoint=x[reach:],
                 speed_setpoint=asked, feedforward=forward[reach:])  # fmt: skip
    found = speed_setpoint([one])
    assert found.K_v == pytest.approx(33.3, rel=1e-6)
    assert found.k_ffw == pytest.approx(0.9, rel=1e-6)
    assert found.offset == pytest.approx(0.02, rel=1e-4)
    assert (found.taps.first, list(np.round(found.taps.weights, 5))) == (1, [0.5, 0.5])
    again = found.of(one.setpoint, one.angle, one.feedforward)  # type: ignore[arg-type]
    assert np.max(np.abs(again - asked)[found.taps.reach :]) < 1e-6


def test_what_is_missing_is_named() -> None:
    base = record(0, [1.0])
    with pytest.raises(InputError, match="no speed_setpoint"):
        speed_setpoint([base])
    still = Record("still", base.time, base.torque, angle=np.zeros(len(base)), setpoint=np.zeros(len(base)),
                   deviation=np.zeros(len(base)))  # fmt: skip
    with pytest.raises(InputError, match="does not move"):
        setpoint_delay([still])


@pytest.mark.skipif("FEEDSIM_CAPTURE" not in os.environ, reason="FEEDSIM_CAPTURE names no capture")
@pytest.mark.parametrize("axis", ["X", "Y"])
def test_a_real_control_to_the_nanometre(axis: str) -> None:
    """What a SINUMERIK 840D sl shows of its position loop, from what it shows of setpoint and position."""
    read = read_records(os.environ["FEEDSIM_CAPTURE"], None, axis)
    assert read.provenance.pitch is not None
    I_P = read.provenance.pitch / (2 * np.pi)
    taps = setpoint_delay(read.records)
    assert taps.first == 3
    assert np.allclose(taps.weights, [0.1875, 0.5, 0.3125], atol=1e-4)
    assert taps.delay == pytest.approx(8.25e-3, abs=1e-7)
    assert I_P * taps.rms < 1e-9
    speed = speed_setpoint(read.records)
    assert speed.K_v == pytest.approx(100 / 3, rel=1e-4)
    assert speed.k_ffw == pytest.approx(1, abs=1e-4)
    assert I_P * speed.rms < 1e-7  # 1e-4 mm/s


def test_noise_on_the_position_widens_the_delay_alone() -> None:
    """95 % of 40 draws, as above; one weight alone stands for a delay of whole rows."""
    for first, weights in ((3, [0.1875, 0.5, 0.3125]), (2, [1.0])):
        misses = 0
        for seed in range(40):
            each = record(first, weights, noise=1e-3, seed=seed)
            found = noisy_delay([each], setpoint_delay([each]))
            true = H * sum(w * (first + i) for i, w in enumerate(weights))
            misses += not abs(found.value - true) <= NORMAL_95 * found.sigma
            assert found.sigma < 1e-5
        assert misses <= 5


@pytest.mark.parametrize("noise", [0.0, 2e-4])
def test_gain_by_the_following_error(noise: float) -> None:
    """n_s of a loop whose feedforward is 3.4 rows old; noise of x_e alone makes K_v small, and the interval says so."""
    misses = 0
    for seed in range(20):
        each = record(3, [0.1875, 0.5, 0.3125], seed=seed)
        assert each.deviation is not None
        assert each.setpoint is not None
        forward = np.gradient(each.setpoint, H)
        aged = 0.6 * np.concatenate([np.full(3, forward[0]), forward[:-3]])
        aged += 0.4 * np.concatenate([np.full(4, forward[0]), forward[:-4]])
        n_s = 33.0 * each.deviation + aged + 0.5
        noisy = each.deviation + noise * np.random.default_rng(seed).standard_normal(len(n_s))
        whole = replace(each, deviation=noisy, speed_setpoint=n_s, feedforward=forward)
        found = gain_by_deviation([whole], 6.25e-3)
        misses += not abs(found.value - 33.0) <= NORMAL_95 * found.sigma + 1e-9
        assert found.sigma < 0.5
    assert misses <= 3


def test_a_delay_that_few_stretches_determine() -> None:
    """An axis that moves in two of the eight stretches, in each with a delay that is off by an error of its own, as a
    model's is: with Student's distribution of eight stretches the interval held three of four records."""
    rows, delay = 800, 3 * H
    speed = np.zeros(rows)
    for begin in (130, 530):
        speed[begin : begin + 40] = 5 * np.sin(np.pi * np.arange(40) / 40) ** 2
    x = np.cumsum(speed)
    delayed = np.concatenate([np.full(3, x[0]), x[:-3]])
    taps = Taps(3, np.ones(1), H, 0.0, 0.0, 0.0)
    inside, rng = 0, np.random.default_rng(1)
    for _ in range(300):
        error = np.repeat(0.05 * rng.standard_normal(8), rows // 8)
        deviation = error * np.gradient(x) + 1e-3 * rng.standard_normal(rows)
        each = Record("made", H * np.arange(rows), np.zeros(rows), angle=delayed, setpoint=x, deviation=deviation)
        found = noisy_delay([each], taps)
        inside += abs(found.value - delay) <= NORMAL_95 * found.sigma
    assert 0.91 <= inside / 300 <= 0.99
