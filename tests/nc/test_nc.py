"""NC: planning of moves, circles and arcs, limits, messages. Oracles are closed forms."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from feedsim.foundation.errors import InputError
from feedsim.motions import Arc, Circle, Dwell, Move
from feedsim.motions.circular import Circular
from feedsim.motions.move import Straight
from feedsim.motions.profile import rest_to_rest
from feedsim.scenario import load
from feedsim.simulation.nc import Program, plan
from scenario_helpers import MACHINE, default_machine, scenario

POSE = {"X": 0.8, "Y": 0.327, "Z": 0.1}
LEAD = 0.020 / (2 * math.pi)
T_IPO, JERK = 2e-3, 150.0


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
    assert program.until(move, "Z") == program.duration


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
    assert program.until(first, "Z") == second.start
    # the dwell still belongs to the stop, and so does the move of another axis
    assert program.until(second, "Z") == program.duration
    assert program.until(second, "X") == last.start
    assert [segment.axes for segment in program.segments] == [("Z",), ("Z",), (), ("X",)]
    assert [segment.index for segment in program.segments] == [0, 1, 2, 3]


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
        InputError, match=r"^motions\.0 \(arc\): the end point .* 20\.1 mm .* 20 mm.*allowed difference: 1 um"
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
    assert travel == "motions.0 (move): axis Z reaches 700 mm; allowed travel 0 to 685 mm"
    assert speed == "motions.1 (move): axis Z reaches a speed of 36 m/min; allowed at most 30 m/min"
    assert "motions.2 (move): axis X reaches an acceleration of 20 m/s^2; allowed at most 14.4 m/s^2" in acceleration


def test_short_move_is_judged_by_the_speed_that_it_reaches() -> None:
    """100 mm at 150 m/s3 reach j (L/2j)^(2/3) = 43.3 m/min however much more is programmed; 14.4 m/s2 are not."""
    with pytest.raises(InputError, match=r"axis Z reaches a speed of 43\.267 m/min; allowed at most 30 m/min"):
        plan(scenario(Move(by={"Z": 0.1}, feed=1.0)))
    # a move whose feed is within the limit, and one too short to exceed it, are fine
    plan(scenario(Move(by={"Z": 0.1}, feed=0.5)))
    plan(scenario(Move(by={"Z": 0.05}, feed=1.0)))
    with pytest.raises(InputError, match=r"axis Z reaches a speed of 38\.547"):
        plan(scenario(Move(by={"X": 0.1, "Z": 0.1}, feed=1.0)))


def test_short_arc_is_judged_by_the_speed_that_it_reaches() -> None:
    """A quarter circle of 157 mm reaches 0.974 m/s in its middle, where both axes have 0.707 of it."""
    length = 0.1 * math.pi / 2
    profile = rest_to_rest(length, 1.2, 14.4, JERK)
    peak = JERK * (length / (2 * JERK)) ** (2 / 3)
    assert profile.turning_points == pytest.approx([profile.duration / 2])
    arc = Arc(plane=("X", "Z"), centre_by={"X": -0.1, "Z": 0.0}, angle=math.pi / 2, feed=1.2)
    with pytest.raises(InputError, match="axis Z reaches a speed of") as caught:
        plan(scenario(arc))
    found = float(caught.value.problems[0].partition("speed of ")[2].split()[0]) / 60
    s, v, _ = profile.at(np.linspace(0, profile.duration, 200_001))
    assert found == pytest.approx(np.abs(v * np.sin(s / 0.1)).max(), rel=1e-4)
    assert found > peak * math.sqrt(0.5)


def test_after_a_motion_that_is_not_usable_the_others_are_judged_as_far_as_they_can() -> None:
    off = Arc(plane=("X", "Z"), centre_by={"X": -0.02, "Z": 0.0}, by={"X": -0.02, "Z": 0.03}, feed=0.05)
    motions = [
        off,
        Move(by={"Y": 0.4}, feed=0.1),  # 727 of 655 mm
        Move(by={"X": 0.2}, feed=0.6),  # too fast wherever it begins; where it ends is not known
        Move(by={"X": 5.0}, feed=0.1),  # perhaps too far
        Move(to={"X": 5.0}, feed=0.1),  # neither length nor start are known
        Move(by={"X": 0.1}, feed=0.1),  # from where the last one should have ended: beyond the travel
        Arc(plane=("X", "Z"), centre={"X": 0.8, "Z": 0.1}, angle=1.0, feed=0.1),  # Z is not known
    ]
    with pytest.raises(InputError) as caught:
        plan(scenario(*motions))
    assert [problem.partition(":")[0] for problem in caught.value.problems] == [
        "motions.0 (arc)", "motions.1 (move)", "motions.2 (move)", "motions.5 (move)",
    ]  # fmt: skip


def test_messages_name_the_line_of_the_motion_and_what_was_set(tmp_path: Path) -> None:
    file = tmp_path / "s.yaml"
    lines = [
        "name: s", f"machine: {MACHINE}", "motions:", "  - {kind: dwell, duration: 1 s}",
        "  - kind: move", "    by: {Z: 100 mm}", "    feed: 40 m/min", "  - {kind: move, to: {Y: 9 m}, feed: 5 m/min}",
    ]  # fmt: skip
    file.write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        plan(load(file))
    assert caught.value.problems == (
        f"{file}:5: motions.1 (move): axis Z reaches a speed of 40 m/min; allowed at most 30 m/min",
        f"{file}:8: motions.2 (move): axis Y reaches 9000 mm; allowed travel 0 to 655 mm",
    )
    with pytest.raises(InputError) as caught:
        plan(load(file, ["motions.1.feed=50 m/min", "motions.2={kind: move, by: {X: 9 m}, feed: 5 m/min}"]))
    first, second = caught.value.problems
    assert first.startswith(f"{file}:5, --set motions.1.feed=50 m/min: motions.1 (move): axis Z reaches a speed of 43.")
    assert second.startswith("--set motions.2={kind: move, by: {X: 9 m}, feed: 5 m/min}: motions.2 (move): axis X")


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
        "motions.0 (circle): axis X reaches an acceleration of 14.44 m/s^2; allowed at most 14.4 m/s^2"
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
    with pytest.raises(InputError, match=r"motions\.1 \(dwell\): the program lasts .* s up to its end.*allowed"):
        plan(scenario(Move(by={"X": 0.1}, feed=0.1), Dwell(duration=1e9)))


def test_cycles_of_the_machine_count() -> None:
    machine = default_machine()
    cycles = machine.cycles.model_copy(update={"position": 0.5e-3, "interpolation": 4e-3})
    program = plan(scenario(Move(by={"Z": 0.1}, feed=5 / 60), machine=machine.model_copy(update={"cycles": cycles})))
    assert np.diff(program.time) == pytest.approx(0.5e-3, abs=1e-12)
    assert program.duration == pytest.approx(1.248, abs=1e-12)
    profile = rest_to_rest(0.1, 5 / 60, 14.4, JERK)
    assert program.x_s["Z"][::8] == pytest.approx(0.1 + profile.at(program.time[::8])[0], abs=1e-15)


def test_messages_on_limits_say_where_these_come_from() -> None:
    """The travel of a machine that was identified is that of its record; the axis itself may have more."""
    machine = default_machine()
    axis = machine.axes["Z"].model_copy(update={"limits_from": "that of the record"})
    machine = machine.model_copy(update={"axes": {**machine.axes, "Z": axis}})
    with pytest.raises(InputError, match=r"allowed travel 0 to 685 mm \(that of the record\)$"):
        plan(scenario(Move(by={"Z": 0.6}, feed=0.1), machine=machine))
