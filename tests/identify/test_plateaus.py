"""Plateaus: all of them are found, with the right torque and an honest standard deviation, and nothing else is."""

from __future__ import annotations

import numpy as np
import pytest

from feedsim.estimation.identify import plateaus as averages
from feedsim.estimation.identify.plateaus import plateaus
from feedsim.estimation.identify.record import Record
from feedsim.estimation.least_squares import correlation_length
from identify_records import I_P, SPEEDS, TRUE, J, constant_speeds, noisy, stationary


@pytest.fixture(scope="module")
def record() -> Record:
    return constant_speeds()


def only(record: Record, *, angle: bool, steps: tuple[float, float] = (0.0, 0.0)) -> Record:
    """With one of angle and speed; quantised angle [m at the scale] and torque [N.m]."""
    assert record.angle is not None
    position, torque = record.angle, record.torque
    if steps[0]:
        position = np.round(position * I_P / steps[0]) * steps[0] / I_P
    if steps[1]:
        torque = np.round(torque / steps[1]) * steps[1]
    return Record("one", record.time, torque, position if angle else None, None if angle else record.speed)


@pytest.mark.parametrize("angle", [False, True], ids=["speed", "angle"])
def test_undisturbed_plateaus_are_found_with_their_torque(record: Record, angle: bool) -> None:
    found = plateaus(only(record, angle=angle), J)
    assert [np.sign(p.speed) for p in found] == [1, -1] * 12
    np.testing.assert_allclose([abs(p.speed) for p in found], np.repeat(SPEEDS, 2), rtol=1e-6)
    # Ring-down of 0.3 N.m, 0.1 s after a stroke begins still 0.14 N.m, is what is left: 1e-4 of 2 N.m.
    np.testing.assert_allclose([p.torque for p in found], [stationary(TRUE, p.speed) for p in found], rtol=1e-4)


def test_a_plateau_knows_its_time_within_the_record(record: Record) -> None:
    later = Record("one", record.time + 1000.0, record.torque, record.angle, record.speed)
    found = plateaus(later, J)
    assert [p.elapsed for p in found] == pytest.approx([(p.begin + p.end) / 2 - 1000.0 for p in found])


def test_coarse_steps_are_told_in_the_standard_deviation(record: Record) -> None:
    found = plateaus(only(record, angle=True, steps=(1e-6, 2e-3)), J)
    assert len(found) == 24
    errors = np.array([p.torque - stationary(TRUE, p.speed) for p in found])
    assert np.max(np.abs(errors)) <= 1e-3  # half a step
    sigmas = np.array([p.sigma for p in found])
    assert np.max(np.abs(errors) / sigmas) < 4
    assert np.max(sigmas) < 2e-3


def test_standard_deviations_are_honest_with_white_and_with_coloured_noise(record: Record) -> None:
    size = len(record)
    for colour in (0.0, 0.8):
        scores: list[float] = []
        for seed in range(8):
            white = np.random.default_rng(seed).standard_normal(size + 50)
            noise = np.zeros(size + 50)
            for i in range(1, len(noise)):
                noise[i] = colour * noise[i - 1] + white[i]
            disturbed = Record("noise", record.time, record.torque + 0.1 * noise[50:], None, record.speed)
            found = plateaus(disturbed, J)
            assert len(found) == 24
            scores += [(p.torque - stationary(TRUE, p.speed)) / p.sigma for p in found]
        # 192 scores of unit variance: their rms is 1 within 0.15 (three of its own); the correlation time is itself
        # estimated, from few correlation times where the noise is coloured.
        assert 0.85 < np.sqrt(np.mean(np.square(scores))) < (1.15 if colour == 0 else 1.35)


def test_constant_load_and_known_load(record: Record) -> None:
    # The ring-down of the tests' record does not change its sign with direction: 1e-4 of 2 N.m, as above.
    lifted = constant_speeds({**TRUE, "M_0": 0.7}, SPEEDS[4:8])
    assert np.mean([p.torque for p in plateaus(lifted, J)]) == pytest.approx(0.7, abs=2e-4)
    known = Record("x", lifted.time, lifted.torque, None, lifted.speed, load=np.full(len(lifted), 0.7))
    assert np.mean([p.torque for p in plateaus(known, J)]) == pytest.approx(0.0, abs=2e-4)


def test_rest_ramps_and_sines_are_no_plateaus() -> None:
    time = np.arange(10_000) * 2e-3
    random = np.random.default_rng(4)
    noise = 0.01 * random.standard_normal(len(time))
    for speed in (
        np.zeros(len(time)),
        1e-3 * random.standard_normal(len(time)),
        0.5 * time,
        5.0 + 0.5 * time,
        10 * np.sin(2 * np.pi * 0.5 * time),
    ):
        assert plateaus(Record("x", time, 2.0 * np.sign(speed) + noise, None, speed + 1e-4 * noise), J) == ()
    ramp = 5.0 + 0.3 * time
    assert plateaus(Record("x", time, 2.0 + noise, None, ramp), J) == ()


# Amplitude [m], frequency [Hz], periods: from pre-sliding to sliding, crests of 0.1 s and of 0.4 s.
SINES = ((200e-6, 1.0, 4), (200e-6, 0.6, 3), (100e-6, 2.0, 6), (20e-6, 5.0, 12), (5e-6, 10.0, 20), (500e-6, 5.0, 8))


@pytest.mark.parametrize("rate", [250, 500, 1000])
@pytest.mark.parametrize(
    "step", [(1e-8, 0.0), (1e-7, 0.0), (1e-6, 0.0), (0.0, 0.01)], ids=["10 nm", "100 nm", "1 um", "0.01 rad/s"]
)
def test_sines_in_coarse_steps_are_no_plateaus(step: tuple[float, float], rate: int) -> None:
    for seed in range(30):
        random = np.random.default_rng(seed)
        position, speed = [np.zeros(rate // 5)], [np.zeros(rate // 5)]
        for index in random.permutation(len(SINES)):
            size, frequency, periods = SINES[index]
            size, frequency = size * np.exp(0.5 * random.standard_normal()), frequency * random.uniform(0.8, 1.2)
            phase = 2 * np.pi * frequency / rate * (np.arange(int(periods * rate / frequency)) + random.random())
            position.append(size * np.sin(phase))
            speed.append(2 * np.pi * frequency * size / I_P * np.cos(phase))
        x, n = np.concatenate(position), np.concatenate(speed)
        torque = 2 * np.tanh(n) + 0.01 * random.standard_normal(len(n))
        angle = np.round(x / step[0]) * step[0] / I_P if step[0] else None
        coarse = np.round(n / step[1]) * step[1] if step[1] else None
        assert plateaus(Record("x", np.arange(len(n)) / rate, torque, angle, coarse), J) == (), seed


@pytest.mark.parametrize("rate", [250, 500, 1000])
def test_plateaus_in_coarse_steps_of_speed_are_found(record: Record, rate: int) -> None:
    assert record.speed is not None
    time = np.arange(record.time[0], record.time[-1], 1 / rate)
    speed, torque = (np.interp(time, record.time, signal) for signal in (record.speed, record.torque))
    found = plateaus(Record("x", time, torque, None, np.round(speed / 0.01) * 0.01), J)
    assert [np.sign(p.speed) for p in found] == [1, -1] * 12


@pytest.mark.parametrize("rate", [250, 500, 1000])
@pytest.mark.parametrize("step", [1e-8, 1e-7, 1e-6], ids=["10 nm", "100 nm", "1 um"])
def test_plateaus_in_coarse_steps_are_found(record: Record, step: float, rate: int) -> None:
    assert record.angle is not None
    time = np.arange(record.time[0], record.time[-1], 1 / rate)
    angle, torque = (np.interp(time, record.time, signal) for signal in (record.angle, record.torque))
    found = plateaus(Record("x", time, torque, np.round(angle * I_P / step) * step / I_P, None), J)
    assert [np.sign(p.speed) for p in found] == [1, -1] * 12


def test_a_torque_that_has_not_settled_is_left_out_or_refused() -> None:
    time = np.arange(2000) * 2e-3
    speed = np.where((time > 0.5) & (time < 3.5), 5.0, 0.0)
    settling = 2.0 + 0.5 * np.exp(-(time - 0.5) / 0.25)
    plateau = plateaus(Record("x", time, np.where(speed > 0, settling, 0.0), None, speed), J)[0]
    assert plateau.begin > 1.2
    assert plateau.torque == pytest.approx(2.0, rel=2e-3)
    drifting = np.where(speed > 0, 1.0 + time, 0.0)
    assert plateaus(Record("x", time, drifting, None, speed), J) == ()


def test_short_strokes_are_refused() -> None:
    assert plateaus(constant_speeds(speeds=[10.0], durations=[0.25]), J) == ()


def test_noise_does_not_add_plateaus(record: Record) -> None:
    for seed in range(10):
        assert len(plateaus(noisy(record, 0.05, seed), J)) == 24


def test_a_speed_as_noisy_as_the_slowest_plateau_is_fast(record: Record) -> None:
    assert record.speed is not None
    random = np.random.default_rng(6)
    speed = record.speed + SPEEDS[0] * random.standard_normal(len(record))
    for angle in (None, record.angle):
        found = plateaus(Record("x", record.time, record.torque, angle, speed), J)
        assert [np.sign(p.speed) for p in found] == [1, -1] * 12
        # 0.2 % of the slowest torque comes of the error of its speed.
        np.testing.assert_allclose([p.torque for p in found], [stationary(TRUE, p.speed) for p in found], rtol=4e-3)


def test_windows_and_derivatives() -> None:
    weights = averages.window(101, 20)
    assert np.sum(weights) == pytest.approx(1.0)
    assert weights[0] == weights[-1] == 0.0
    time = np.arange(101) * 0.01
    # Exact for a parabola: the differences are.
    parabola = 1e3 + 2.0 * time + 3.0 * time**2
    assert averages.derivative(weights, parabola, 0.01, 1) == pytest.approx(2.0 + 6.0 * 0.5)
    assert averages.derivative(weights, parabola, 0.01, 2) == pytest.approx(6.0)
    assert correlation_length(np.random.default_rng(1).standard_normal(4000), of_mean=True) == pytest.approx(
        1.0, abs=0.15
    )
    assert averages.resolution(np.array([0.1, 0.3, 0.1, 0.7])) == pytest.approx(0.2)
    noise = 0.02 * np.random.default_rng(2).standard_normal(4000)
    assert averages.white(np.sin(np.arange(4000) * 0.01) + noise) == pytest.approx(0.02, rel=0.05)
