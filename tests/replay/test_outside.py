"""Lines that come from outside an axis, in records in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from feedsim.estimation.identify import Record
from feedsim.estimation.replay.closed_loop import AxisRecord
from feedsim.estimation.replay.moving_lines import Line, in_words, without_outside
from feedsim.files.trace.trace import Array

H = 2e-3
TIME = H * np.arange(700)
MOVE = (0.5, 0.8)  # [s]


def record(added: Array, torque: Array | None = None) -> AxisRecord:
    """A motion of 10 mm between two rests, on which `added` [m] lies. The lead is 1 m/rad."""
    s = np.clip((TIME - MOVE[0]) / (MOVE[1] - MOVE[0]), 0.0, 1.0)
    setpoint = 10e-3 * (10 * s**3 - 15 * s**4 + 6 * s**5)
    force = np.full_like(TIME, np.nan) if torque is None else torque
    made = Record("made", time=TIME, torque=force, angle=setpoint + added, setpoint=setpoint)
    return AxisRecord("X", made, 1.0, np.ones(len(TIME), dtype=bool))


def test_a_line_through_both_rests_is_found_and_taken_out() -> None:
    """27.3 Hz, 0.6 um and 0.1 N.m, in noise of a fifth: frequency within 0.1 Hz, amplitudes within 10 %. What is taken
    out is the sine, in the motion between as well: noise is left."""
    noise = np.random.default_rng(3)
    line = np.sin(2 * np.pi * 27.3 * TIME + 0.7)
    scatter = 0.12e-6 * noise.standard_normal(len(TIME))
    each = record(0.6e-6 * line + scatter, 3.0 + 0.1 * line)
    clean, lines = without_outside(each)
    (one,) = lines
    assert one.frequency == pytest.approx(27.3, abs=0.1)
    assert (one.position, one.torque) == (pytest.approx(0.6e-6, rel=0.1), pytest.approx(0.1, rel=0.1))
    within = (one.begin - H / 2 < TIME) & (one.end + H / 2 > TIME)
    assert within[np.searchsorted(TIME, MOVE[0]) : np.searchsorted(TIME, MOVE[1])].all()
    left = (clean.position - each.setpoint - scatter)[within]
    assert np.sqrt(np.mean(left**2)) < 0.06e-6
    assert clean.record.torque[within] == pytest.approx(np.full(np.count_nonzero(within), 3.0), abs=0.01)
    assert "27.3 Hz" in one.text
    assert "0.1 N.m" in one.text


def test_what_the_record_drives_is_not_from_outside() -> None:
    """Harmonics of a recorded load, and a torque that moves the inertia: the same lines without that are."""
    square = np.sign(np.sin(2 * np.pi * 7.0 * TIME + 0.3))
    noise = 0.05e-6 * np.random.default_rng(1).standard_normal(len(TIME))
    position = 0.5e-6 * np.sin(2 * np.pi * 7.0 * TIME) + 0.3e-6 * np.sin(2 * np.pi * 21.0 * TIME + 1.0) + noise
    each = record(position)
    assert {round(line.frequency) for line in without_outside(each)[1]} == {7, 21}
    loaded = replace(each, record=replace(each.record, load=5.0 * square))
    clean, lines = without_outside(loaded)
    assert (clean, lines) == (loaded, ())
    # J [kg.m2] times the acceleration of the line; a drive that holds the axis has another torque.
    J, wave = 0.02, 0.5e-6 * np.sin(2 * np.pi * 30.0 * TIME)
    driving = -J * (2 * np.pi * 30.0) ** 2 * wave
    assert not without_outside(record(wave + noise, driving), J)[1]
    assert without_outside(record(wave + noise, 0.3 * driving), J)[1]
    assert without_outside(record(wave + noise, -driving), J)[1]


def test_a_note_names_the_first_lines() -> None:
    lines = [Line(27.0 + 3 * k, 0.6e-6, 0.0, float(k), k + 0.8) for k in range(6)]
    text = in_words("X", lines)
    assert text.count("Hz") == 4
    assert "3 to 3.8 s and 2 more: vibration from outside the axis" in text
    assert " more:" not in in_words("X", lines[:4])
    assert in_words("X", lines[:1], moving=True).startswith("axis X: while it moves the record has 27 Hz")


def test_a_note_names_a_frequency_once() -> None:
    """Rests of 0.8 s tell frequencies to 1.25 Hz."""
    lines = [Line(27.0 + 0.1 * k, 1e-7 * (k + 1), 0.1, float(k), k + 0.8) for k in range(6)]
    assert "27.2 Hz" not in in_words("X", lines)
    assert "with 0.6 um and 0.1 N.m (amplitudes), 0 to 5.8 s: vibration" in in_words("X", lines)


def test_two_lines_and_no_torque() -> None:
    """18 and 41 Hz, 0.5 and 0.3 um, in a record without a torque."""
    clean, lines = without_outside(
        record(0.5e-6 * np.sin(2 * np.pi * 18 * TIME) + 0.3e-6 * np.cos(2 * np.pi * 41 * TIME))
    )
    assert sorted(one.frequency for one in lines) == pytest.approx([18.0, 41.0], abs=0.2)
    assert not clean.record.driven
    assert all(one.torque == 0 for one in lines)


@pytest.mark.parametrize("rest", [0.3, 0.5, 0.8])
def test_every_motion_between_short_rests_loses_the_line(rest: float) -> None:
    """A rest that is behind one motion and ahead of the next one is looked at as it was recorded, for both. Three
    motions; 0.6 um of a line, of which a fit to noise of a fifth may leave a tenth."""
    begins = 0.6 + (0.3 + rest) * np.arange(3)
    time = H * np.arange(round((begins[-1] + 0.3 + rest) / H))
    setpoint = np.zeros_like(time)
    for k, begin in enumerate(begins):
        s = np.clip((time - begin) / 0.3, 0.0, 1.0)
        setpoint += (-1) ** k * 10e-3 * (10 * s**3 - 15 * s**4 + 6 * s**5)
    line = np.sin(2 * np.pi * 27.3 * time + 0.7)
    scatter = 0.12e-6 * np.random.default_rng(3).standard_normal(len(time))
    made = Record(
        "made", time=time, torque=3.0 + 0.1 * line, angle=setpoint + 0.6e-6 * line + scatter, setpoint=setpoint
    )
    clean, lines = without_outside(AxisRecord("X", made, 1.0, np.ones(len(time), dtype=bool)))
    assert [one.frequency for one in lines] == pytest.approx([27.3] * 3, abs=0.1)
    for begin in begins:
        rows = (time >= begin) & (time <= begin + 0.3)
        assert np.sqrt(np.mean((clean.position - setpoint - scatter)[rows] ** 2)) < 0.06e-6
        assert clean.record.torque[rows] == pytest.approx(np.full(np.count_nonzero(rows), 3.0), abs=0.01)


@pytest.mark.parametrize(
    "added",
    [
        pytest.param(0.3e-6 * np.random.default_rng(5).standard_normal(len(TIME)), id="noise"),
        pytest.param(1e-6 * np.where(TIME > 0.8, np.exp(-(TIME - 0.8) / 0.1), 0) * np.sin(150 * TIME), id="ring-down"),
        pytest.param(1e-6 * np.where(TIME < 0.6, 1.0, 0.0) * np.sin(170 * TIME), id="ends within the motion"),
        pytest.param(0.3e-6 * np.exp(-TIME), id="creep"),
        pytest.param(1e-9 * np.sin(170 * TIME), id="digits"),
    ],
)
def test_what_is_no_line_from_outside(added: Array) -> None:
    """The record stays as it is where either side does not predict the other."""
    each = record(added)
    clean, lines = without_outside(each)
    assert lines == ()
    assert clean is each
