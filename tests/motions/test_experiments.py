"""Planned experiments for identification: strokes at constant speed and sines. Oracles are closed forms."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from feedsim.foundation.errors import InputError
from feedsim.motions import ConstantSpeed, Dwell, Move, Sine, SineMove, SpeedRange
from feedsim.motions.constant_speed import Strokes
from feedsim.motions.sine import Oscillations, faded_sine
from feedsim.simulation.nc import Program, plan
from scenario_helpers import scenario

LEAD = 0.020 / (2 * math.pi)
T_IPO, JERK = 2e-3, 150.0
# The spline rings where the jerk of the profile steps, by 0.268 per T_ipo: 30 of them leave less than 1e-16.
RINGING = 60e-3


def strokes_of(program: Program, segment: int = 0) -> Strokes:
    geometry = program.segments[segment].geometry
    assert isinstance(geometry, Strokes)
    return geometry


def sines_of(program: Program, segment: int = 0) -> Oscillations:
    geometry = program.segments[segment].geometry
    assert isinstance(geometry, Oscillations)
    return geometry


def speeds(*feeds: float, **changes: object) -> ConstantSpeed:
    return ConstantSpeed.model_validate({"axis": "Z", "speeds": feeds, **changes})


# -- constant speeds --------------------------------------------------------------------------------------------------


def test_range_of_speeds_is_in_equal_ratios_with_both_ends() -> None:
    feeds = ConstantSpeed(axis="Z", speeds=SpeedRange.model_validate({"from": 1e-4, "to": 0.3, "count": 8})).feeds
    assert len(feeds) == 8
    assert (feeds[0], feeds[-1]) == (1e-4, 0.3)
    assert np.diff(np.log(feeds)) == pytest.approx(math.log(3000) / 7, rel=1e-12)
    falling = ConstantSpeed(axis="Z", speeds=SpeedRange.model_validate({"from": 0.3, "to": 1e-4})).feeds
    assert len(falling) == 12
    assert list(falling) == sorted(falling, reverse=True)


def test_the_range_of_the_default_machine_fits_from_its_pose() -> None:
    """10 to 20000 mm/min from Z 100 mm of 0 to 685 mm, and from X 800 mm of 0 to 1770 mm."""
    for axis in ("Z", "X"):
        range_ = {"from": 10 / 6e4, "to": 20000 / 6e4}
        program = plan(scenario(ConstantSpeed.model_validate({"axis": axis, "speeds": range_})))
        strokes = strokes_of(program).strokes
        assert len(strokes) == 24
        assert len({stroke.speed for stroke in strokes}) == 24
        durations = np.array([stroke.steady[1] - stroke.steady[0] for stroke in strokes])
        speed = np.array([abs(stroke.speed) for stroke in strokes])
        # a second, or 1 mm where that takes longer
        assert durations == pytest.approx(np.maximum(1.0, 1e-3 / speed), rel=1e-9)


@pytest.mark.parametrize("pose", [0.1, 0.6])
def test_strokes_run_at_their_speed_there_and_back_to_the_side_with_more_room(pose: float) -> None:
    feeds = (0.002, 0.05, 0.3)
    program = plan(
        scenario(Move(to={"Z": pose}, feed=0.5), speeds(*feeds, duration=0.5, rest=0.1), Dwell(duration=0.2))
    )
    geometry = strokes_of(program, 1)
    segment = program.segments[1]
    assert (segment.kind, segment.index, segment.axes) == ("constant_speed", 1, ("Z",))
    assert segment.target == segment.origin
    side = 1 if pose < 0.3425 else -1
    expected = [side * sense * feed for feed in feeds for sense in (1, -1)]
    assert [stroke.speed for stroke in geometry.strokes] == pytest.approx(expected, rel=1e-12)
    v = program.n_ffw["Z"] * LEAD
    for stroke in geometry.strokes:
        begin, end = stroke.steady
        ramp = 2 * math.sqrt(abs(stroke.speed) / JERK)
        assert (begin - stroke.start, stroke.end - end) == pytest.approx((ramp, ramp), rel=1e-9)
        inside = (program.time > begin + RINGING) & (program.time < end - RINGING)
        assert inside.sum() > 300
        # positions of 0.1 to 1 m hold 1e-16 m, differences over T_ipo 1e-13 m/s of 2 mm/s
        assert v[inside] == pytest.approx(stroke.speed, rel=1e-10)
        # outside of the interval it is not at speed
        assert abs(v[np.searchsorted(program.time, begin - ramp / 4)]) < 0.95 * abs(stroke.speed)
    x = program.x_s["Z"]
    stands = program.time >= segment.end + RINGING
    assert np.abs(x[stands] - x[-1]).max() < 1e-16 + np.spacing(1.0)
    assert x[-1] == segment.origin["Z"] == pytest.approx(pose, abs=1e-15)


def test_strokes_rest_in_between_and_begin_on_the_interpolators_grid() -> None:
    program = plan(scenario(Dwell(duration=0.1), speeds(0.05, 0.1, duration=0.2, rest=0.15)))
    strokes = strokes_of(program, 1).strokes
    assert strokes[0].start == pytest.approx(0.1)
    assert program.segments[1].end == strokes[-1].end
    for before, after in pairwise(strokes):
        assert after.start / T_IPO == pytest.approx(round(after.start / T_IPO), abs=1e-9)
        # the stroke ends within a cycle, the rest begins on the grid
        assert 0.15 - 1e-9 <= after.start - before.end < 0.15 + T_IPO
        resting = (program.time > before.end + RINGING) & (program.time < after.start - RINGING)
        assert resting.sum() > 20
        assert np.abs(program.n_ffw["Z"][resting]).max() < 1e-12
    # the last stroke is followed by no rest of its own
    assert program.duration - strokes[-1].end < T_IPO


def test_travel_shortens_the_time_at_speed_as_far_as_it_must() -> None:
    """At 0.4 m/s both ramps together take 0.4 * 2 sqrt(0.4/150) = 41.3 mm; 585 mm of travel are above 100 mm."""
    program = plan(scenario(speeds(0.4, 0.01, duration=3.0)))
    fast, _, slow, _ = strokes_of(program).strokes
    ramp = 2 * math.sqrt(0.4 / JERK)
    assert fast.steady[1] - fast.steady[0] == pytest.approx(0.585 / 0.4 - ramp, rel=1e-9)
    assert slow.steady[1] - slow.steady[0] == pytest.approx(3.0, rel=1e-9)
    # the interpolator's spline smooths the steps of the jerk: j T_ipo^3/100 = 12 nm beyond both ends
    assert program.x_s["Z"].max() == pytest.approx(0.685, abs=2e-8)
    assert program.x_s["Z"].min() == pytest.approx(0.1, abs=2e-8)
    short = plan(scenario(speeds(0.4, duration=3.0, stroke=0.2)))
    assert short.x_s["Z"].max() == pytest.approx(0.3, abs=2e-8)


def test_own_limits_of_acceleration_and_jerk_hold() -> None:
    program = plan(scenario(speeds(0.2, acceleration=1.0, jerk=20.0, duration=0.5)))
    (stroke, _) = strokes_of(program).strokes
    assert stroke.steady[0] - stroke.start == pytest.approx(0.2 / 1.0 + 1.0 / 20.0, rel=1e-9)
    assert stroke.steady[1] - stroke.steady[0] == pytest.approx(0.5, rel=1e-9)
    acceleration = np.diff(program.n_ffw["Z"] * LEAD) / 1e-3
    assert np.abs(acceleration).max() == pytest.approx(1.0, rel=1e-6)


def test_too_little_travel_names_speed_needed_and_available() -> None:
    """0.1 s at 0.5 m/s and the ramps need 0.5 (0.1 + 2 sqrt(0.5/150)) = 107.7 mm."""
    with pytest.raises(InputError) as caught:
        plan(scenario(speeds(0.5, 0.01, 0.45, stroke=0.09)))
    needed = 0.5 * (0.1 + 2 * math.sqrt(0.5 / JERK)) * 1e3
    first, second = caught.value.problems
    assert first == (
        f"motions.0 (constant_speed): axis Z needs {needed:.5g} mm for 0.1 s at 30000 mm/min and for getting to that "
        "speed and back to rest; there are 90 mm (stroke); allow a longer one or leave it out"
    )
    assert "for 0.1 s at 27000 mm/min" in second
    plan(scenario(speeds(0.5, 0.45, stroke=needed * 1e-3 * (1 + 1e-9))))


def test_axis_limits_hold_for_strokes() -> None:
    with pytest.raises(InputError, match=r"axis Z reaches a speed of 36 m/min; allowed at most 30 m/min"):
        plan(scenario(speeds(0.6, 0.1)))
    with pytest.raises(InputError, match=r"axis Z reaches an acceleration of 20 m/s\^2; allowed at most 14\.4 m/s\^2"):
        plan(scenario(speeds(0.45, acceleration=20.0, jerk=2000.0)))


def test_the_motion_behind_an_experiment_that_is_refused_is_judged_where_it_would_be() -> None:
    with pytest.raises(InputError) as caught:
        plan(scenario(speeds(0.5, stroke=0.01), Move(by={"Z": 0.6}, feed=0.1)))
    assert [problem.partition(":")[0] for problem in caught.value.problems] == [
        "motions.0 (constant_speed)",
        "motions.1 (move)",
    ]


# -- sines ------------------------------------------------------------------------------------------------------------


MOVES = (SineMove(amplitude=5e-6, frequency=10, periods=4), SineMove(amplitude=1e-4, frequency=2, periods=2))


@pytest.mark.parametrize("fade", [1.0, 1.5, 3.0])
def test_sines_have_their_amplitude_and_frequency_between_the_fades(fade: float) -> None:
    program = plan(scenario(Dwell(duration=0.1), Sine(axis="Z", moves=MOVES, fade=fade, rest=0.25)))
    segment = program.segments[1]
    assert (segment.kind, segment.axes, segment.target) == ("sine", ("Z",), segment.origin)
    first, second = sines_of(program, 1).moves
    assert first.start == pytest.approx(0.1)
    assert second.start == pytest.approx(first.end + 0.25, abs=T_IPO)
    assert second.start / T_IPO == pytest.approx(round(second.start / T_IPO), abs=1e-9)
    t, x = program.time, program.x_s["Z"] - segment.origin["Z"]
    v = program.n_ffw["Z"] * LEAD
    for move, asked in zip((first, second), MOVES, strict=True):
        A, f = asked.amplitude, asked.frequency
        assert (move.amplitude, move.frequency) == (A, f)
        assert move.full == pytest.approx((move.start + fade / f, move.start + (fade + asked.periods) / f), abs=1e-12)
        assert move.end == pytest.approx(move.start + (2 * fade + asked.periods) / f, abs=1e-12)
        # a cubic spline through points of a sine is (omega T_ipo)^4/384 off in amplitude, twice that in between
        omega = 2 * math.pi * f
        smoothed = 2 * (omega * T_IPO) ** 4 / 384 + 1e-10
        inside = (t >= move.full[0] + 4 * T_IPO) & (t <= move.full[1] - 4 * T_IPO)
        phase = omega * (t[inside] - move.full[0]) + move.phase
        assert x[inside] == pytest.approx(A * np.sin(phase), abs=smoothed * A)
        # its derivative's error is larger by 384/(2 pi)^4 ... at most 2 of (omega T_ipo)^3/24
        assert v[inside] == pytest.approx(A * omega * np.cos(phase), abs=A * omega * (omega * T_IPO) ** 3 / 12 + 1e-12)
        # while fading it is smaller
        fading = (t > move.start) & (t < move.full[0] - 0.3 * fade / f)
        assert np.abs(x[fading]).max() < A
    resting = (t > first.end + RINGING) & (t < second.start - RINGING)
    assert resting.sum() > 50
    assert np.all(np.abs(x[resting]) < 1e-16)
    assert x[-1] == 0


@pytest.mark.extensive
def test_a_faded_sine_has_a_continuous_acceleration_and_true_derivatives() -> None:
    move = SineMove(amplitude=1.0, frequency=1.0, periods=2)
    for fade in (0.5, 1.0, 1.3):
        t = np.linspace(-0.1, 2 * fade + 2.1, 400_001)
        h = t[1] - t[0]
        x, v, a = faded_sine(move, fade, t)
        # central differences are off by the third derivatives times h^2/6: some 1e3 times 1e-11
        assert (x[2:] - x[:-2]) / (2 * h) == pytest.approx(v[1:-1], abs=1e-7)
        assert (v[2:] - v[:-2]) / (2 * h) == pytest.approx(a[1:-1], abs=1e-4)
        assert np.abs(np.diff(a)).max() < 1e3 * h  # no step
        assert (x[0], v[0], a[0], x[-1], v[-1], a[-1]) == pytest.approx((0.0,) * 6, abs=1e-12)
        assert np.abs(x).max() <= 1.0


def test_peaks_of_a_sine_are_held_against_the_axis() -> None:
    """100 mm at 1 Hz: 37.7 m/min. 0.9 mm at 20 Hz: 14.2 m/s2 at full amplitude, more while it fades in one period."""

    def driven(amplitude: float, frequency: float, fade: float = 1.0) -> Program:
        moves = (SineMove(amplitude=amplitude, frequency=frequency, periods=3),)
        return plan(scenario(Sine(axis="Z", moves=moves, fade=fade)))

    with pytest.raises(InputError) as caught:
        driven(0.1, 1.0)
    assert caught.value.problems == (
        "motions.0 (sine): axis Z reaches a speed of 37.699 m/min; allowed at most 30 m/min",
    )
    s = np.linspace(0, 1, 100_001)
    while_fading = np.diff((6 * s**5 - 15 * s**4 + 10 * s**3) * np.sin(2 * np.pi * s), 2) / (s[1] * 0.05) ** 2
    with pytest.raises(InputError, match="axis Z reaches an acceleration of") as caught:
        driven(0.9e-3, 20.0)
    found = float(caught.value.problems[0].partition("acceleration of ")[2].split()[0])
    assert found == pytest.approx(0.9e-3 * np.abs(while_fading).max(), rel=1e-4)  # five digits, and its instants
    driven(0.9e-3, 20.0, fade=5.0)
    with pytest.raises(InputError, match=r"axis Z reaches -10 mm; allowed travel 0 to 685 mm"):
        driven(0.11, 0.1)
    driven(0.0999, 0.5)


def test_a_frequency_beyond_the_interpolator_is_refused() -> None:
    moves = (SineMove(amplitude=1e-6, frequency=50.0, periods=3), SineMove(amplitude=1e-6, frequency=50.1, periods=3))
    with pytest.raises(InputError) as caught:
        plan(scenario(Sine(axis="Z", moves=moves)))
    assert caught.value.problems == (
        "motions.0 (sine): moves.1: a frequency of 50.1 Hz; allowed at most 50 Hz, 10 points of the interpolator per "
        "period (T_ipo 2 ms)",
    )
    plan(scenario(Sine(axis="Z", moves=moves[:1])))


def test_experiments_that_last_too_long_are_refused_before_they_fill_the_memory() -> None:
    slow = SineMove(amplitude=1e-6, frequency=1e-6, periods=10)
    with pytest.raises(InputError, match=r"motions\.0 \(sine\): lasts 1\.2e\+07 s; allowed in this program: 40000 s"):
        plan(scenario(Sine(axis="Z", moves=(slow,))))
    with pytest.raises(InputError, match=r"motions\.0 \(constant_speed\): lasts 2e\+06 s"):
        plan(scenario(speeds(1e-9)))


def test_following_motions_are_known_as_for_any_motion() -> None:
    program = plan(scenario(speeds(0.1, duration=0.2), Dwell(duration=0.1), Sine(axis="Z", moves=MOVES[:1])))
    first, _, last = program.segments
    assert program.following(first, "Z") is last
    assert program.until(first, "Z") == last.start
    assert [segment.index for segment in program.segments] == [0, 1, 2]
