"""NC: profile, spline, planning of moves, circles and arcs, limits. Oracles are closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from feedsim.errors import InputError
from feedsim.nc import Circular, Program, Straight, plan
from feedsim.nc.profile import rest_to_rest
from feedsim.nc.spline import RestSpline
from feedsim.scenario import Arc, Circle, Dwell, Move
from scenario_helpers import default_machine, scenario

POSE = {"X": 0.8, "Y": 0.327, "Z": 0.1}
LEAD = 0.020 / (2 * math.pi)
T_IPO, JERK = 2e-3, 150.0


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


# -- profile ----------------------------------------------------------------------------------------------------------


def test_default_z_move_lasts_as_long_as_the_closed_form() -> None:
    profile = rest_to_rest(0.1, 5.0 / 60, 14.4, JERK)
    assert profile.duration == pytest.approx(0.1 / (5 / 60) + 2 * math.sqrt(5 / 60 / JERK), rel=1e-14)
    assert profile.duration == pytest.approx(1.2471, abs=5e-5)
    assert profile.steady == pytest.approx((2 * math.sqrt(5 / 60 / JERK), 0.1 / (5 / 60)), rel=1e-12)


@settings(max_examples=200, derandomize=True, deadline=None)
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


# -- spline -----------------------------------------------------------------------------------------------------------


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


# -- moves ------------------------------------------------------------------------------------------------------------


def test_z_move_is_held_after_its_exact_end() -> None:
    program = plan(scenario(Move(by={"Z": 0.1}, feed=5 / 60), Dwell(duration=1.2)))
    move, dwell = program.segments
    assert move.start == 0
    assert move.duration == pytest.approx(0.1 / (5 / 60) + 2 * math.sqrt(5 / 60 / JERK), rel=1e-14)
    assert dwell.start == pytest.approx(1.248, abs=1e-12)  # the first instant of the 2 ms grid behind 1.24714 s
    assert program.duration == pytest.approx(2.448, abs=1e-12)
    assert np.diff(program.time) == pytest.approx(1e-3, abs=1e-12)
    for axis in ("X", "Y"):
        assert np.all(program.x_s[axis] == POSE[axis])
        assert np.all(program.n_ffw[axis] == 0)
    # at the instants of the interpolator the spline is on the profile, also in the last, shortened interval
    profile = rest_to_rest(0.1, 5 / 60, 14.4, JERK)
    at_ipo = program.time[::2]
    assert program.x_s["Z"][::2] == pytest.approx(0.1 + profile.at(at_ipo)[0], abs=1e-15)
    assert program.x_s["Z"][-1] == pytest.approx(0.2, abs=1e-16)
    # constant speed: the spline's ripple from the ends of the phase has died out 60 ms inside
    steady = (program.time > 0.11) & (program.time < 1.14)
    assert program.n_ffw["Z"][steady] == pytest.approx(5 / 60 / LEAD, rel=1e-12)
    assert move.geometry == Straight(pytest.approx(0.1), pytest.approx(profile.steady))
    assert program.until(move) == program.duration


def test_feedforward_is_the_derivative_of_the_position() -> None:
    program = plan(scenario(Move(by={"X": -0.05, "Y": 0.02}, feed=0.3)))
    for axis in ("X", "Y"):
        v = program.n_ffw[axis] * LEAD
        # Hermite: integral of a cubic's derivative between knots (Simpson's rule over one 2 ms interval is exact)
        distance = (v[:-2:2] + 4 * v[1:-1:2] + v[2::2]) * T_IPO / 6
        assert np.diff(program.x_s[axis][::2]) == pytest.approx(distance, abs=1e-14)


def test_move_of_several_axes_is_straight_and_feed_counts_along_it() -> None:
    program = plan(scenario(Move(by={"X": 0.03, "Y": -0.04}, to={"Z": 0.22}, feed=0.13)))
    travelled = [program.x_s[axis] - POSE[axis] for axis in "XYZ"]
    share = np.array([0.03, -0.04, 0.12]) / 0.13
    along = sum(d * s for d, s in zip(travelled, share, strict=True))
    for d, s in zip(travelled, share, strict=True):
        assert d == pytest.approx(s * along, abs=1e-15)
    speed = np.sqrt(sum((program.n_ffw[axis] * LEAD) ** 2 for axis in "XYZ"))
    middle = len(speed) // 2
    assert speed[middle] == pytest.approx(0.13, rel=1e-9)
    assert program.segments[0].target == pytest.approx({"X": 0.83, "Y": 0.287, "Z": 0.22}, abs=1e-15)


def test_next_motion_starts_at_the_next_interpolator_instant_where_the_last_ended() -> None:
    motions = [
        Move(by={"Z": 0.01}, feed=0.1),
        Move(to={"Z": 0.1}, feed=0.05),
        Dwell(duration=0.1),
        Move(by={"X": 1e-6}, feed=0.1),
    ]
    program = plan(scenario(*motions))
    for before, after in zip(program.segments[:-1], program.segments[1:], strict=True):
        assert after.start / T_IPO == pytest.approx(round(after.start / T_IPO), abs=1e-9)
        assert -1e-9 <= after.start - before.end < T_IPO - 1e-9
        assert after.origin == before.target
    dwell, last = program.segments[2:]
    assert last.start == pytest.approx(dwell.start + 0.1, abs=1e-12)  # an end on the grid costs no further cycle
    first, second = program.segments[:2]
    k = round(second.start / 1e-3)
    assert program.x_s["Z"][k] == pytest.approx(first.target["Z"], abs=1e-15)
    assert program.until(first) == second.start
    assert program.until(second) == last.start  # the dwell still belongs to the stop


def test_move_without_distance_takes_no_time() -> None:
    program = plan(scenario(Move(to={"Z": 0.1}, feed=0.1), Move(by={"X": 0.01}, feed=0.1)))
    assert program.segments[0].duration == 0
    assert program.segments[1].start == 0


# -- circles and arcs -------------------------------------------------------------------------------------------------


def circle_of(program: Program) -> Circular:
    geometry = program.segments[0].geometry
    assert isinstance(geometry, Circular)
    return geometry


@pytest.mark.parametrize("direction", ["counterclockwise", "clockwise"])
@pytest.mark.parametrize("start_angle", [0.0, 2.0])
def test_circle_runs_about_its_centre_in_its_direction(direction: str, start_angle: float) -> None:
    motion = Circle(plane=("X", "Z"), radius=0.015, feed=0.05, turns=3, direction=direction, start_angle=start_angle)  # type: ignore[arg-type]
    program = plan(scenario(motion, Dwell(duration=0.3)))
    geometry = circle_of(program)
    centre = (0.8 - 0.015 * math.cos(start_angle), 0.1 - 0.015 * math.sin(start_angle))
    assert geometry.centre == pytest.approx(centre, abs=1e-16)
    u, w = program.x_s["X"] - centre[0], program.x_s["Z"] - centre[1]
    # at constant speed the spline leaves the circle by R (v T_ipo/R)^4/384 = 7.7e-14 m; around the steps of the jerk,
    # which it smooths over some T_ipo, by less than a nanometre
    radius = np.hypot(u, w)
    steady = (program.time > 0.1) & (program.time < 5.6)
    assert radius[steady] == pytest.approx(0.015, abs=1e-13)
    assert radius == pytest.approx(0.015, abs=1e-9)
    turned = np.unwrap(np.arctan2(w, u))
    sense = 1 if direction == "counterclockwise" else -1
    assert geometry.sense == sense
    assert turned[-1] - turned[0] == pytest.approx(sense * 6 * math.pi, abs=1e-9)
    # turns from the profile: half the acceleration time is lost at the start; the middle turn is at constant speed
    lap, ramp = 2 * math.pi * 0.015 / 0.05, 2 * math.sqrt(0.05 / JERK)
    instants = [0.0, lap + ramp / 2, 2 * lap + ramp / 2, 3 * lap + ramp]
    assert np.array(geometry.turns) == pytest.approx(np.array([instants[:-1], instants[1:]]).T, rel=1e-12)
    assert program.segments[0].duration == pytest.approx(3 * lap + ramp, rel=1e-12)
    assert program.segments[1].origin == POSE


def test_arc_by_centre_and_end_point() -> None:
    """Quarter arc from (0.8, 0.1) about (0.78, 0.1) to (0.78, 0.12), then back the long way round."""
    quarter = Arc(plane=("X", "Z"), centre_by={"X": -0.02, "Z": 0.0}, to={"X": 0.78, "Z": 0.12}, feed=0.05)
    back = Arc(plane=("X", "Z"), centre={"X": 0.78, "Z": 0.1}, by={"X": 0.02, "Z": -0.02}, feed=0.05)
    program = plan(scenario(quarter, back))
    first, second = (segment.geometry for segment in program.segments)
    assert isinstance(first, Circular)
    assert isinstance(second, Circular)
    assert first.sweep == pytest.approx(math.pi / 2, rel=1e-12)
    assert second.sweep == pytest.approx(3 * math.pi / 2, rel=1e-12)
    assert (first.turns, second.turns) == ((), ())
    assert program.segments[0].target == pytest.approx({"X": 0.78, "Y": 0.327, "Z": 0.12}, abs=1e-15)
    assert program.segments[1].target == pytest.approx(POSE, abs=1e-15)
    assert np.hypot(program.x_s["X"] - 0.78, program.x_s["Z"] - 0.1) == pytest.approx(0.02, abs=1e-9)


def test_arc_by_angle_and_arc_that_ends_where_it_begins() -> None:
    by_angle = Arc(plane=("Z", "Y"), centre_by={"Z": 0.0, "Y": 0.01}, angle=math.pi, direction="clockwise", feed=0.05)
    program = plan(scenario(by_angle))
    assert program.segments[0].target == pytest.approx({"X": 0.8, "Y": 0.347, "Z": 0.1}, abs=1e-15)
    # clockwise from Z to Y: at first towards minus Z
    assert program.x_s["Z"].min() == pytest.approx(0.09, abs=4e-8)  # 0.5 ms off the extreme: v^2/R t^2/2 = 3e-8 m
    # the spline smooths the steps of the jerk: j T_ipo^3/100 = 12 nm beyond both ends
    assert program.x_s["Z"].max() == pytest.approx(0.1, abs=2e-8)
    whole = Arc(plane=("X", "Z"), centre_by={"X": -0.01, "Z": 0.0}, by={"X": 0.0, "Z": 0.0}, feed=0.05)
    geometry = circle_of(plan(scenario(whole)))
    assert geometry.sweep == pytest.approx(2 * math.pi)
    assert len(geometry.turns) == 1


def test_arc_whose_end_is_off_the_circle_is_refused() -> None:
    off = Arc(plane=("X", "Z"), centre_by={"X": -0.02, "Z": 0.0}, to={"X": 0.78, "Z": 0.1201}, feed=0.05)
    with pytest.raises(
        InputError, match=r"motion 1 \(arc\): the end point .* 20\.1 mm .* 20 mm.*allowed difference: 1 um"
    ):
        plan(scenario(off))
    with pytest.raises(InputError, match="centre of the arc lies 0 um from its start"):
        plan(scenario(Arc(plane=("X", "Z"), centre_by={"X": 0.0, "Z": 0.0}, angle=1.0, feed=0.05)))


# -- limits -----------------------------------------------------------------------------------------------------------


def test_all_violations_are_reported_with_motion_axis_actual_and_allowed() -> None:
    motions = [
        Move(by={"Z": 0.6}, feed=0.1),
        Move(to={"Z": 0.1}, feed=0.6),
        Move(by={"X": 0.1}, feed=0.5, acceleration=20, jerk=2000),
    ]
    with pytest.raises(InputError) as caught:
        plan(scenario(*motions))
    assert len(caught.value.problems) == 3
    travel, speed, acceleration = caught.value.problems
    assert travel == "motion 1 (move): axis Z reaches 700 mm; allowed travel 0 to 685 mm"
    assert speed == "motion 2 (move): axis Z reaches a speed of 36 m/min; allowed at most 30 m/min"
    assert "motion 3 (move): axis X reaches an acceleration of 20 m/s^2; allowed at most 14.4 m/s^2" in acceleration


def test_speed_counts_per_axis_not_along_the_path() -> None:
    plan(scenario(Move(by={"X": 0.2, "Z": 0.2}, feed=0.5 * math.sqrt(2))))
    with pytest.raises(InputError, match="axis X reaches a speed of 30"):
        plan(scenario(Move(by={"X": 0.2, "Z": 0.2}, feed=0.5005 * math.sqrt(2))))


def test_centripetal_acceleration_counts() -> None:
    """v^2/R: 0.38 m/s on R 10 mm is 14.44 m/s2, 0.379 m/s is 14.36 m/s2; the tangential limit stays at 1 m/s2."""

    def driven(feed: float) -> Program:
        return plan(scenario(Circle(plane=("X", "Z"), radius=0.01, feed=feed, acceleration=1.0, turns=4)))

    driven(0.379)
    with pytest.raises(InputError) as caught:
        driven(0.38)
    assert caught.value.problems[0] == (
        "motion 1 (circle): axis X reaches an acceleration of 14.44 m/s^2; allowed at most 14.4 m/s^2"
    )
    assert "axis Z" in caught.value.problems[1]


def test_tangential_and_centripetal_acceleration_are_taken_together() -> None:
    """Each alone is within 14.4 m/s2, the path turns by tens of degrees while it accelerates."""
    motion = Circle(plane=("X", "Z"), radius=0.012, feed=0.4, jerk=5000.0)
    profile = rest_to_rest(2 * math.pi * 0.012, 0.4, 14.4, 5000.0)
    t = np.linspace(0, profile.duration, 200_001)
    s, v, a = profile.at(t)
    largest = np.abs(-a * np.sin(s / 0.012) - v**2 / 0.012 * np.cos(s / 0.012)).max()
    assert profile.peak_acceleration <= 14.4 + 1e-9
    assert 0.4**2 / 0.012 < 14.4 < largest
    with pytest.raises(InputError, match="acceleration") as caught:
        plan(scenario(motion))
    found = float(caught.value.problems[0].partition("acceleration of ")[2].split()[0])
    assert found == pytest.approx(largest, rel=2e-3)  # the check looks every 2 ms


def test_arc_beyond_travel_between_two_points_within_is_found() -> None:
    arc = Arc(plane=("X", "Z"), centre_by={"X": -0.3, "Z": 0.0}, angle=math.pi, direction="clockwise", feed=0.3)
    with pytest.raises(InputError, match=r"axis Z reaches -200 mm; allowed travel 0 to 685 mm"):
        plan(scenario(arc))


# -- long programs ----------------------------------------------------------------------------------------------------


def test_an_hour_keeps_its_digits() -> None:
    """180 m in 1 mm/s would be 50 h; 1.6 m back and forth at 1 mm/s is 53 min of program."""
    program = plan(scenario(Move(to={"X": 1.6}, feed=1e-3), Move(to={"X": 0.0}, feed=1e-3)))
    assert program.duration > 2400
    late = slice(len(program.time) - 100_000, len(program.time) - 50_000)
    assert program.n_ffw["X"][late] * LEAD == pytest.approx(-1e-3, rel=1e-9)
    assert program.x_s["X"][-1] == pytest.approx(0.0, abs=1e-15)


def test_many_motions_follow_one_another() -> None:
    motions = [Move(by={"X": 1e-3 * (-1) ** k}, feed=0.1) for k in range(2000)]
    program = plan(scenario(*motions))
    assert len(program.segments) == 2000
    assert program.x_s["X"][-1] == pytest.approx(0.8, abs=1e-12)
    one = plan(scenario(motions[0])).duration
    assert program.duration == pytest.approx(2000 * one, rel=1e-9)


def test_program_without_end_is_refused() -> None:
    with pytest.raises(InputError, match=r"motion 2 \(dwell\): the program lasts .* s up to its end.*allowed"):
        plan(scenario(Move(by={"X": 0.1}, feed=0.1), Dwell(duration=1e9)))


def test_cycles_of_the_machine_count() -> None:
    machine = default_machine()
    cycles = machine.cycles.model_copy(update={"position": 0.5e-3, "interpolation": 4e-3})
    program = plan(scenario(Move(by={"Z": 0.1}, feed=5 / 60), machine=machine.model_copy(update={"cycles": cycles})))
    assert np.diff(program.time) == pytest.approx(0.5e-3, abs=1e-12)
    assert program.duration == pytest.approx(1.248, abs=1e-12)
    profile = rest_to_rest(0.1, 5 / 60, 14.4, JERK)
    assert program.x_s["Z"][::8] == pytest.approx(0.1 + profile.at(program.time[::8])[0], abs=1e-15)
