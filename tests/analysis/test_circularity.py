"""Figures of a circular test, against circles whose deviations are known in closed form."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError

from feedsim.analysis import CircleTask, Figure, Turn, circularity, contour, tasks
from feedsim.analysis.evaluate import bidirectional_figures
from feedsim.files.trace import Trace
from feedsim.foundation.errors import InputError
from feedsim.motions import Circle, Dwell, Move
from feedsim.scenario import CircleTest
from feedsim.simulation.nc import plan
from scenario_helpers import default_machine, scenario

RADIUS, OMEGA = 0.015, 0.05 / 0.015
CENTRE = (0.785, 0.1)
LAP = 2 * math.pi / OMEGA
Array = NDArray[np.float64]


def turn(sense: int = 1) -> Turn:
    return Turn(("X", "Z"), CENTRE, RADIUS, sense, LAP, 2 * LAP)


def bump(angle: Array, centre: float, height: float) -> Array:
    """Smooth bump of 12 deg in width, exactly zero elsewhere, highest at ``centre`` [rad]."""
    off = np.abs((angle - centre + math.pi) % (2 * math.pi) - math.pi) / np.deg2rad(6)
    return height * np.where(off < 1, np.cos(math.pi / 2 * np.minimum(off, 1)) ** 2, 0.0)


def circle(deviation: Array, angle: Array, time: Array, names: tuple[str, str] = ("X.x_a", "Z.x_a")) -> Trace:
    r = RADIUS + deviation
    return Trace(time, {names[0]: CENTRE[0] + r * np.cos(angle), names[1]: CENTRE[1] + r * np.sin(angle)})


def instants(step: float = 250e-6) -> Array:
    return np.asarray(np.arange(round(3 * LAP / step) + 1) * step, dtype=np.float64)


# heights [um] at X+, Z+, X-, Z-; the peaks lie 4 deg behind the crossings, 30 and 38 deg for the last two
HEIGHTS = {"X+": (4.0, 4.0), "Z+": (7.0, 94.0), "X-": (5.0, 210.0), "Z-": (8.0, 308.0)}


def bumpy(sense: int = 1, level: float = 0.3e-6) -> Trace:
    t = instants()
    angle = sense * OMEGA * t
    e = level + sum(bump(angle, math.radians(at), height * 1e-6) for height, at in HEIGHTS.values())
    return circle(np.asarray(e), angle, t)


def values(figures: dict[str, Figure]) -> dict[str, float]:
    return {name: figure.value for name, figure in figures.items()}


@pytest.mark.parametrize("sense", [1, -1])
def test_bumps_of_known_height(sense: int) -> None:
    figures = circularity(bumpy(sense), turn(sense))
    found = values(figures)
    # 250 us are 0.05 deg: the top of a bump of 6 deg half width is missed by up to (pi/2 0.025/6)^2 = 4e-5 of it
    tolerance = 5e-4
    for name, (height, _) in HEIGHTS.items():
        assert found[f"glitch_{name}"] == pytest.approx(height, abs=tolerance)
    # where X reverses, at the half axes X+ and X-, and likewise Z: the larger of the two
    assert found["glitch_X"] == pytest.approx(5.0, abs=tolerance)
    assert found["glitch_Z"] == pytest.approx(8.0, abs=tolerance)
    assert found["G"] == pytest.approx(8.0, abs=tolerance)
    assert found["F_max"] == pytest.approx(8.3, abs=tolerance)
    assert found["F_min"] == pytest.approx(0.3, abs=1e-6)
    assert found["median"] == pytest.approx(0.3, abs=1e-6)
    # a cos^2 bump of 12 deg holds half its height over 12 of 360 deg
    assert found["mean"] == pytest.approx(0.3 + (4 + 7 + 5 + 8) * 6 / 360, abs=1e-3)
    # ISO 230-4 names the sense by the order of the letters
    assert ("G_XZ" in figures["G"].meaning) == (sense > 0)
    assert ("G_ZX" in figures["G"].meaning) == (sense < 0)
    assert {figure.unit for figure in figures.values()} == {"um"}


def test_reversing_axis_is_the_one_whose_half_axis_is_crossed() -> None:
    """A stick at the reversal of X alone: X stays behind by 3 um after each of its extremes, Z is perfect."""
    t = instants()
    angle = OMEGA * t
    x = RADIUS * np.cos(angle)
    stuck = bump(angle, 0.05, 3e-6) - bump(angle, math.pi + 0.05, 3e-6)
    trace = Trace(t, {"X.x_a": CENTRE[0] + x + stuck, "Z.x_a": CENTRE[1] + RADIUS * np.sin(angle)})
    found = values(circularity(trace, turn()))
    assert found["glitch_X"] == pytest.approx(3.0, rel=5e-3)  # cos(0.05) of it points outwards
    assert found["glitch_Z"] == pytest.approx(0.0, abs=1e-3)
    assert {glitch.name: glitch.axis for glitch in contour(trace, turn()).glitches} == {
        "X+": "X", "Z+": "Z", "X-": "X", "Z-": "Z",
    }  # fmt: skip


def test_glitch_window_ends_at_45_degrees() -> None:
    """A bump at 50 deg belongs to Z+, one at 40 deg to X+."""
    t = instants()
    for at, owner, other in ((50.0, "glitch_Z+", "glitch_X+"), (40.0, "glitch_X+", "glitch_Z+")):
        trace = circle(bump(OMEGA * t, math.radians(at), 2e-6), OMEGA * t, t)
        found = values(circularity(trace, turn()))
        assert found[owner] == pytest.approx(2.0, abs=1e-3)
        assert found[other] < 0.5


def test_shifted_circle_is_round_about_its_own_centre() -> None:
    """A centre 5 um off: G is 10 um about the programmed centre and 0 about the least-squares one."""
    t = instants()
    trace = Trace(
        t,
        {
            "X.x_a": CENTRE[0] + 3e-6 + RADIUS * np.cos(OMEGA * t),
            "Z.x_a": CENTRE[1] - 4e-6 + RADIUS * np.sin(OMEGA * t),
        },
    )
    found = values(circularity(trace, turn()))
    assert found["G"] == pytest.approx(10.0, abs=1e-4)
    assert found["G_ls"] == pytest.approx(0.0, abs=1e-7)
    # d^2/(4 R) = 0.4 nm of mean radius from the shift; over whole turns only
    assert found["mean"] == pytest.approx(25e-12 / 4 / RADIUS * 1e6, abs=2e-3)


def test_radius_change_is_the_mean_and_no_circularity() -> None:
    t = instants()
    found = values(circularity(circle(np.full(len(t), -1.5e-6), OMEGA * t, t), turn()))
    assert found["mean"] == pytest.approx(-1.5, abs=1e-7)
    assert found["median"] == pytest.approx(-1.5, abs=1e-7)
    assert found["G"] == pytest.approx(0, abs=1e-7)


def test_both_directions_together() -> None:
    """Counterclockwise 3 um too large and 2 um high; clockwise 1 um too small. Both 5 um off in X, as one set-up is."""
    t = instants()
    there, back = circle(np.full(len(t), 3e-6), OMEGA * t, t), circle(np.full(len(t), -1e-6), -OMEGA * t, t)
    bulge = circle(3e-6 + bump(OMEGA * t, 0.5, 2e-6), OMEGA * t, t)
    for first, hysteresis, deviation in ((there, 4.0, 4.0), (bulge, 6.0, 6.0)):
        time = np.concatenate([t, t[-1] + 1 + t])
        columns = {
            name: np.concatenate([first[name], back[name]]) + 5e-6 * (name[0] == "X") for name in ("X.x_a", "Z.x_a")
        }
        later = t[-1] + 1
        found = values(
            bidirectional_figures(
                Trace(time, columns), turn(1), Turn(("X", "Z"), CENTRE, RADIUS, -1, later + LAP, later + 2 * LAP)
            )
        )
        # the bump of 2 um over 12 deg moves the fitted centre by up to 2 um / 60
        assert found["H"] == pytest.approx(hysteresis, abs=0.04)
        assert found["G_b"] == pytest.approx(deviation, abs=0.04)
        assert found["D"] == pytest.approx(1.0, abs=0.04)


def test_only_the_turn_counts() -> None:
    """A run-in error of 100 um in the first and the last turn changes nothing."""
    clean = bumpy()
    outside = (clean.time < LAP - 1e-9) | (clean.time > 2 * LAP + 1e-9)
    spoilt = Trace(clean.time, {name: x + 1e-4 * outside for name, x in clean.columns.items()})
    assert values(circularity(spoilt, turn())) == values(circularity(clean, turn()))


def test_tool_point_is_reported_beside_the_scales() -> None:
    t = instants()
    both = dict(bumpy().columns) | dict(circle(np.full(len(t), 2e-6), OMEGA * t, t, ("tcp.x_X", "tcp.x_Z")).columns)
    found = values(circularity(Trace(t, both), turn()))
    assert found["tool.mean"] == pytest.approx(2.0, abs=1e-6)
    assert found["tool.G"] == pytest.approx(0.0, abs=1e-6)
    assert found["G"] == pytest.approx(8.0, abs=1e-3)


def test_too_little_of_a_trace_is_refused() -> None:
    with pytest.raises(InputError, match=r"circularity in the plane XZ needs Z\.x_a, which is not recorded"):
        circularity(bumpy().select(["X.x_a"]), turn())
    with pytest.raises(InputError, match=r"needs the trace from 1\.88496 to 3\.76991 s"):
        circularity(bumpy().between(0.0, 1.5 * LAP), turn())
    with pytest.raises(InputError, match=r"covers 180 deg, no full turn"):
        circularity(bumpy(), Turn(("X", "Z"), CENTRE, RADIUS, 1, LAP, 1.5 * LAP))


@pytest.mark.parametrize(("turns", "chosen", "number"), [(3, None, 2), (5, None, 3), (3, 2, 2), (5, 4, 4)])
def test_task_is_the_chosen_or_the_middle_turn_of_the_last_circle(turns: int, chosen: int | None, number: int) -> None:
    circle = Circle(plane=("Z", "Y"), radius=0.01, feed=0.1, turns=turns, direction="clockwise")
    other = Circle(plane=("X", "Z"), radius=0.01, feed=0.1)
    described = scenario(
        other, Move(by={"Z": 0.1}, feed=0.1), circle, Dwell(duration=0.3), evaluate=(CircleTest(turn=chosen),)
    )
    program = plan(described)
    (task,) = tasks(described, program)
    assert isinstance(task, CircleTask)
    geometry = program.segments[2].geometry
    assert (task.turn.begin, task.turn.end) == geometry.turns[number - 1]  # type: ignore[union-attr]
    assert (task.prefix, task.turn.axes, task.turn.sense) == ("ZY", ("Z", "Y"), -1)


# turns, turn asked for, radius [m], feed [m/s] -> what is evaluated, or what to change
WINDOWS: list[tuple[int, int | None, float, float, str]] = [
    (1, None, 0.015, 0.05, r"turn 1 of 1 .* has its speed from 0\.03651 to 1\.885 s; give it turns: 3"),
    (2, None, 0.015, 0.05, "last"),
    (2, 2, 0.015, 0.05, "turn 2 of 2 .* leave 'turn' out"),
    (3, 1, 0.015, 0.05, "turn 1 of 3 .* leave 'turn' out"),
    (3, 3, 0.015, 0.05, "turn 3 of 3 .* leave 'turn' out"),
    (3, None, 0.015, 0.05, "middle"),
    (3, None, 0.002, 0.1, "give it turns: 4"),  # 0.13 s a turn: the run-in is none yet
    (4, None, 0.002, 0.1, "last"),
    (1, None, 0.001, 0.12, "too short to reach its path speed.* lower its feed, or give it more turns"),
]


@pytest.mark.parametrize("start_angle", [0.0, 0.7])
@pytest.mark.parametrize("direction", ["counterclockwise", "clockwise"])
@pytest.mark.parametrize("window", WINDOWS, ids=lambda window: "-".join(map(str, window[:4])))
def test_turn_is_full_at_constant_speed_or_refused(
    window: tuple[int, int | None, float, float, str], direction: Literal["counterclockwise", "clockwise"],
    start_angle: float,
) -> None:  # fmt: skip
    turns, chosen, radius, feed, expected = window
    motion = Circle(
        plane=("X", "Z"), radius=radius, feed=feed, turns=turns, direction=direction, start_angle=start_angle
    )
    described = scenario(motion, Dwell(duration=0.3), evaluate=(CircleTest(turn=chosen),))
    program = plan(described)
    if expected not in ("last", "middle"):
        with pytest.raises(InputError, match=expected):
            tasks(described, program)
        return
    (task,) = tasks(described, program)
    turn = task.turn  # type: ignore[union-attr]
    assert turn.end - turn.begin == pytest.approx(2 * math.pi * radius / feed, rel=1e-9)
    inside = (program.time > turn.begin - 0.2) & (program.time < turn.end)
    speed = np.hypot(*(np.gradient(program.x_s[axis], program.time) for axis in "XZ"))
    # differences over 2 ms of a circle: the chord is shorter than the arc by (angle)^2/24; and the spline through the
    # interpolator's points begins to brake within the last of its cycles
    assert np.abs(speed[inside] / feed - 1).max() < (2e-3 * feed / radius) ** 2 / 6 + 2e-5
    assert (turn.begin == program.segments[0].geometry.turns[1][0]) == (expected == "middle")  # type: ignore[union-attr]


def test_circle_can_be_chosen() -> None:
    small, large = (Circle(plane=("X", "Z"), radius=r, feed=0.1, turns=3) for r in (0.01, 0.02))
    described = scenario(
        small, Dwell(duration=0.1), large, evaluate=(CircleTest(), CircleTest(motion=0), CircleTest(motion=2, turn=2))
    )
    program = plan(described)
    found = tasks(described, program)
    assert [task.prefix for task in found] == ["XZ", "XZ#2", "XZ#3"]
    assert [task.turn.radius for task in found if isinstance(task, CircleTask)] == [0.02, 0.01, 0.02]
    assert found[2].turn.begin == program.segments[2].geometry.turns[1][0]  # type: ignore[union-attr]
    with pytest.raises(ValidationError, match=r"motions\.1 \(dwell\) is not of kind circle"):
        scenario(small, Dwell(duration=0.1), evaluate=(CircleTest(motion=1),))
    with pytest.raises(ValidationError, match="turn 4 of a circle of 3 turns"):
        scenario(
            small, Circle(plane=("X", "Z"), radius=0.01, feed=0.1, turns=9), evaluate=(CircleTest(motion=0, turn=4),)
        )


def test_setpoints_of_a_planned_circle_are_round() -> None:
    """From the planner to the figures: x_s taken as measured positions leaves nothing but the spline's 8e-14 m."""
    described = scenario(
        Circle(plane=("X", "Z"), radius=RADIUS, feed=0.05, turns=3), Dwell(duration=0.3), evaluate=(CircleTest(),)
    )
    program = plan(described)
    perfect = Trace(program.time, {f"{axis}.x_a": x for axis, x in program.x_s.items()})
    (task,) = tasks(described, program)
    found = values(task.figures(perfect))
    assert found["G"] == pytest.approx(0, abs=1e-6)
    assert found["mean"] == pytest.approx(0, abs=1e-6)


def test_gain_of_the_loops_is_that_of_a_lag_of_first_order() -> None:
    """Without speed feedforward, and with K_v so small that the loops within (5 ms) add less than 1 % to the lag."""
    machine = default_machine()
    slow = {
        name: axis.model_copy(update={"drive": axis.drive.model_copy(update={"k_ffw": 0.0, "K_v": K_v})})
        for (name, axis), K_v in zip(machine.axes.items(), (1.0, 1.0, 1.25), strict=True)
    }
    motion = Circle(plane=("X", "Z"), radius=0.02, feed=0.05, turns=3)
    described = scenario(motion, evaluate=(CircleTest(),), machine=machine.model_copy(update={"axes": slow}))
    (task,) = tasks(described, plan(described))
    assert isinstance(task, CircleTask)
    for axis, K_v in (("X", 1.0), ("Z", 1.25)):
        assert abs(task.gain[axis]) == pytest.approx(1 / math.sqrt(1 + (2.5 / K_v) ** 2), rel=0.01)
    (task,) = tasks(described := scenario(motion, evaluate=(CircleTest(),)), plan(described))
    assert isinstance(task, CircleTask)
    assert max(abs(1 - abs(gain)) for gain in task.gain.values()) < 1e-6  # with feedforward
