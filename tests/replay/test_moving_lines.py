"""Lines in an axis' motion that come from outside, in closed form: what is one, and what is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from feedsim.estimation.identify import Record
from feedsim.estimation.replay.closed_loop import AxisRecord
from feedsim.estimation.replay.machine_files import resonator
from feedsim.estimation.replay.moving_lines import Line, lines_in_motion
from feedsim.files.trace.trace import Array

H, I_P = 2e-3, 10e-3 / (2 * np.pi)  # [s], [m/rad] of a pitch of 10 mm
NOISE = 0.1e-6  # [m]


def axis(ways: tuple[tuple[float, float], ...], name: str = "X", ramp: float = 0.25) -> AxisRecord:
    """Motions one after the other, each (distance [m], duration [s]), and rests of 0.2 s. ramp: share of a motion in
    which it accelerates."""
    parts, at = [np.zeros(100)], 0.0
    for way, duration in ways:
        s = np.arange(round(duration / H)) * H / duration
        speed = np.clip(np.minimum(s, 1 - s) / ramp, 0.0, 1.0)
        moved = np.cumsum(speed) / np.sum(speed)
        parts += [at + way * moved, np.full(100, at + way)]
        at += way
    setpoint = np.concatenate(parts)
    time = H * np.arange(len(setpoint))
    record = Record("made", time=time, torque=np.zeros_like(time), angle=setpoint / I_P, setpoint=setpoint / I_P)
    return AxisRecord(name, record, I_P, np.ones(len(time), dtype=bool))


FAST = axis(((0.4, 1.5), (-0.2, 0.9)))


def noise(record: AxisRecord, seed: int = 1) -> Array:
    return NOISE * np.random.default_rng(seed).standard_normal(len(record.record))


def wave(record: AxisRecord, frequency: float) -> Array:
    return np.asarray(np.sin(2 * np.pi * frequency * record.record.time + 0.4))


def found(record: AxisRecord, error: Array, *others: AxisRecord) -> list[Line]:
    return list(lines_in_motion(record, error, None, [record, *others]))


@pytest.mark.parametrize("frequency", [14.0, 21.1, 36.3, 62.0])
def test_a_line_is_found_in_every_motion(frequency: float) -> None:
    """0.3 um in noise of 0.1 um, with 0.2 N.m: frequency within a tenth of a line width, amplitudes within 20 %."""
    error = noise(FAST) + 0.3e-6 * wave(FAST, frequency)
    lines = lines_in_motion(FAST, error, 0.2 * wave(FAST, frequency), [FAST])
    assert [round(line.begin, 1) for line in lines] == [0.2, 1.9]
    for line in lines:
        assert abs(line.frequency - frequency) < 0.1 / (line.end - line.begin)
        assert line.position == pytest.approx(0.3e-6, rel=0.2)
        assert line.torque == pytest.approx(0.2, rel=0.2)


def test_harmonics_of_what_lies_along_the_way_are_no_lines() -> None:
    """Speeds of 53 and 27 turns/s, one twice the other: the second order of the slow motion has the frequency of the
    first one of the fast. Waves of 2.3 per turn, as magnets of a motor or balls have, follow the speed as well."""
    both = axis(((0.4, 1.0), (-0.4, 2.0)))
    turn = both.position / (2 * np.pi * I_P)
    for orders in ((1.0, 2.0), (0.37, 0.74)):
        along = sum(0.3e-6 * np.sin(2 * np.pi * order * turn + 0.5) for order in orders)
        assert not found(both, noise(both) + along), orders


def test_two_lines_in_errors_of_friction() -> None:
    """A slow error of some micrometres does not hide them."""
    slow = 3e-6 * np.sign(np.gradient(FAST.setpoint)) + 2e-6 * np.sin(2 * np.pi * 1.3 * FAST.record.time)
    lines = found(FAST, noise(FAST) + slow + 0.4e-6 * wave(FAST, 20.0) + 0.3e-6 * wave(FAST, 35.0))
    assert sorted(line.frequency for line in lines[:2]) == pytest.approx([20.0, 35.0], abs=0.1)


def test_noise_has_none() -> None:
    """40 records of noise, white and through a low-pass: one in ten may have a line by chance."""
    named = 0
    for seed in range(20):
        white = noise(FAST, seed)
        named += bool(found(FAST, white)) + bool(
            found(FAST, np.convolve(white, np.exp(-np.arange(30) / 5))[: len(white)])
        )
    assert named <= 4


@pytest.mark.parametrize("damping", [0.015, 0.04])
@pytest.mark.parametrize("driven_by", ["the axis", "another axis"])
def test_a_mode_that_an_axis_drives_is_none(driven_by: str, damping: float) -> None:
    """Its own resonance, and one of an axis that moves at the same time otherwise."""
    other = axis(((0.05, 0.4), (0.1, 0.5), (-0.3, 1.4)), "Y")
    other = replace(other, record=other.record.between(0, len(FAST.record)))
    driver = FAST if driven_by == "the axis" else other
    acceleration = np.gradient(np.gradient(driver.setpoint, H), H)
    mode = resonator(24.3, damping, acceleration, H)[:, 0]
    assert found(FAST, noise(FAST) + 1e-6 * mode / np.std(mode), other) == []


def test_a_line_beside_a_mode_is_named_alone() -> None:
    mode = resonator(24.3, 0.03, np.gradient(np.gradient(FAST.setpoint, H), H), H)[:, 0]
    lines = found(FAST, noise(FAST) + 0.5e-6 * mode / np.std(mode) + 0.5e-6 * wave(FAST, 41.0))
    assert [line.frequency for line in lines] == pytest.approx([41.0, 41.0], abs=0.1)


@pytest.mark.parametrize("order", [1, 2])
def test_what_follows_the_speed_is_none(order: int) -> None:
    """An order of the turns: cogging, or the screw."""
    turns = FAST.setpoint / (2 * np.pi * I_P)
    assert found(FAST, noise(FAST) + 0.5e-6 * np.sin(2 * np.pi * order * turns)) == []


def test_a_line_that_may_be_an_order_needs_another_speed() -> None:
    """At 0.5 turns per second any frequency is near an order; a motion of another speed decides."""
    slow, both = axis(((5e-3, 1.0),), ramp=0.02), axis(((5e-3, 1.0), (0.3, 1.0)), ramp=0.02)
    assert found(slow, noise(slow) + 0.5e-6 * wave(slow, 30.0)) == []
    assert len(found(both, noise(both) + 0.5e-6 * wave(both, 30.0))) == 2


@pytest.mark.parametrize("share", [0.3, 0.6])
def test_a_vibration_of_a_part_of_the_motion_is_none(share: float) -> None:
    """It begins, or ends, with something that happens meanwhile."""
    single = axis(((0.4, 1.5),))
    begun = single.record.time - 0.2 < share * 1.5
    assert found(single, noise(single) + 0.8e-6 * wave(single, 30.0) * begun) == []


def test_short_motions_and_rests_say_nothing() -> None:
    short = axis(((20e-3, 0.3), (-20e-3, 0.3)))
    assert found(short, noise(short) + 2e-6 * wave(short, 30.0)) == []


def test_rows_that_are_near_are_averaged() -> None:
    """A record of 0.1 ms: the same line."""
    time = np.arange(0, FAST.record.time[-1], 1e-4)
    setpoint = np.interp(time, FAST.record.time, FAST.setpoint)
    record = Record("made", time=time, torque=np.zeros_like(time), angle=setpoint / I_P, setpoint=setpoint / I_P)
    dense = AxisRecord("X", record, I_P, np.ones(len(time), dtype=bool))
    lines = found(dense, noise(dense) + 0.3e-6 * wave(dense, 30.0))
    assert [line.frequency for line in lines] == pytest.approx([30.0, 30.0], abs=0.1)


def test_a_record_without_acceleration() -> None:
    """Constant speed from the first row to the last one: nothing is driven; a frequency between orders is a line."""
    time = H * np.arange(500)
    record = Record("made", time=time, torque=0 * time, angle=0.3 * time / I_P, setpoint=0.3 * time / I_P)
    even = AxisRecord("X", record, I_P, np.ones(len(time), dtype=bool))
    lines = found(even, noise(even) + 0.5e-6 * wave(even, 45.0))
    assert [line.frequency for line in lines] == pytest.approx([45.0], abs=0.1)


@pytest.mark.filterwarnings("error")
def test_what_is_met_exactly_has_none() -> None:
    assert found(FAST, np.zeros(len(FAST.record))) == []
    assert found(FAST, 1e-9 * noise(FAST)) == []


def test_of_a_long_motion_the_middle_is_looked_at() -> None:
    long = axis(((2.0, 12.0),))
    (line,) = found(long, noise(long) + 0.3e-6 * wave(long, 33.3))
    assert line.frequency == pytest.approx(33.3, abs=0.02)
    assert (line.begin, line.end) == (pytest.approx(4.2, abs=0.01), pytest.approx(8.2, abs=0.01))


def test_rows_too_far_apart_say_nothing() -> None:
    """Ten rows a second, and motions of three rows."""
    time = 0.1 * np.arange(60)
    setpoint = 0.02 * np.abs(time / 0.3 % 2 - 1)
    record = Record("made", time=time, torque=0 * time, angle=setpoint / I_P, setpoint=setpoint / I_P)
    coarse = AxisRecord("X", record, I_P, np.ones(len(time), dtype=bool))
    assert found(coarse, noise(coarse)) == []


def test_an_encoder_whose_steps_take_many_rows() -> None:
    """Most rows repeat the one before; its turns are those of the setpoint all the same."""
    slow = axis(((5e-3, 2.0), (0.3, 1.0)), ramp=0.02)
    steps = np.floor(slow.position / 50e-6) * 50e-6 / I_P
    stepped = replace(slow, record=replace(slow.record, angle=steps))
    lines = found(stepped, noise(stepped, 2) + 0.5e-6 * wave(stepped, 30.0))
    assert [line.frequency for line in lines] == pytest.approx([30.0, 30.0], abs=0.1)


def test_an_axis_that_does_not_follow_its_setpoint() -> None:
    still = replace(FAST, record=replace(FAST.record, angle=np.zeros(len(FAST.record))))
    assert [line.frequency for line in found(still, wave(still, 30.0) * 1e-6 + noise(still))] == pytest.approx(
        [30.0, 30.0], abs=0.1
    )
