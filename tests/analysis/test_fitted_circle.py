"""A circular test on recorded setpoints, against circles that the NC planned and against closed forms."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError

from feedsim.analysis import CircleTask, Turn, tasks
from feedsim.files.trace import Trace
from feedsim.foundation.errors import InputError
from feedsim.motions import Circle, Column, MeasuredSetpoints, Move
from feedsim.scenario import CircleTest
from feedsim.simulation.nc import plan
from scenario_helpers import scenario

Array = NDArray[np.float64]


def recording(path: Path, trace: dict[str, Array], *, digits: int = 12) -> MeasuredSetpoints:
    rows = np.column_stack([trace["time"], *(trace[axis] for axis in "XZ")])
    text = "".join(",".join(f"{value:.{digits}f}" for value in row) + "\n" for row in rows)
    path.write_text("time [s],x [m],z [m]\n" + text, encoding="utf-8")
    return MeasuredSetpoints(file=path, columns={"X": Column(column="x"), "Z": Column(column="z")})


def planned(*motions: Circle | Move) -> dict[str, Array]:
    program = plan(scenario(*motions))
    return {"time": program.time, **program.x_s}


def turn_of(motion: MeasuredSetpoints, test: CircleTest) -> Turn:
    described = scenario(motion, evaluate=(test,))
    (task,) = tasks(described, plan(described))
    assert isinstance(task, CircleTask)
    return task.turn


@pytest.mark.parametrize("direction", ["counterclockwise", "clockwise"])
def test_recorded_circle_is_the_planned_one(tmp_path: Path, direction: str) -> None:
    circle = Circle(plane=("X", "Z"), radius=0.015, feed=0.05, turns=3, direction=direction, start_angle=0.7)  # type: ignore[arg-type]
    described = scenario(circle, evaluate=(CircleTest(),))
    (task,) = tasks(described, plan(described))
    expected: Turn = task.turn  # type: ignore[union-attr]
    found = turn_of(recording(tmp_path / "c.csv", planned(circle)), CircleTest())
    assert (found.axes, found.sense) == (expected.axes, expected.sense)
    # the planned samples leave the circle by less than 1 nm, at start and stop
    assert found.centre == pytest.approx(expected.centre, abs=1e-9)
    assert found.radius == pytest.approx(expected.radius, abs=1e-9)
    # turns begin at a position cycle
    assert (found.begin, found.end) == pytest.approx((expected.begin, expected.end), abs=1.001e-3)


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("first", [0.0, 0.7])
def test_recording_cut_in_motion_is_fitted_without_its_run_in(tmp_path: Path, sense: int, first: float) -> None:
    """A circle at constant speed from the first row to the last: run-in and run-out are tangents, not circle."""
    radius, feed, turns = 0.015, 0.05, 3
    t = np.arange(0.0, turns * 2 * math.pi * radius / feed + 2e-3, 1e-3)
    angle = first + sense * t * feed / radius
    motion = recording(tmp_path / "c.csv", {"time": t, "X": radius * np.cos(angle), "Z": radius * np.sin(angle)})
    motion = motion.model_copy(update={"relative": True})
    described = scenario(motion, evaluate=(CircleTest(turn=1),))
    program = plan(described)
    (task,) = tasks(described, program)
    assert isinstance(task, CircleTask)
    assert task.turn.sense == sense
    # a cubic spline through points 1 ms apart on a circle errs by 1e-14 m, rows are rounded to 1e-12 m
    assert task.turn.radius == pytest.approx(radius, abs=1e-11)
    lap = 2 * math.pi * radius / feed
    assert task.turn.end - task.turn.begin == pytest.approx(lap, abs=1.001e-3)
    # the first turn begins with the first row, which lies behind the run-in of two jerk phases (36.5 ms at 50 mm/s)
    assert 0.02 < task.turn.begin < 0.05


def test_what_is_given_is_not_fitted(tmp_path: Path) -> None:
    motion = recording(
        tmp_path / "c.csv", planned(Circle(plane=("X", "Z"), radius=0.015, feed=0.05, turns=3)), digits=6
    )
    centre = {"X": 0.785002, "Z": 0.1}
    found = turn_of(motion, CircleTest(centre=centre, radius=0.015001, plane=("Z", "X")))
    assert (found.axes, found.centre, found.radius) == (("Z", "X"), (0.1, 0.785002), 0.015001)
    assert found.sense == -1
    # mean distance from a centre 2 um off: R + d^2 / 4R
    assert turn_of(motion, CircleTest(centre=centre)).radius == pytest.approx(0.015, abs=2e-7)


def test_task_reads_measured_positions_about_the_fitted_circle(tmp_path: Path) -> None:
    motion = recording(tmp_path / "c.csv", planned(Circle(plane=("X", "Z"), radius=0.015, feed=0.05, turns=3)))
    described = scenario(motion, evaluate=(CircleTest(),))
    program = plan(described)
    (task,) = tasks(described, program)
    x, z = program.x_s["X"] - 0.785, program.x_s["Z"] - 0.1
    larger = {"X.x_a": 0.785 + x * (1 + 1e-4), "Z.x_a": 0.1 + z * (1 + 1e-4)}
    figures = task.figures(Trace(program.time, larger))
    assert task.prefix == "XZ"
    assert figures["mean"].value == pytest.approx(1.5, abs=1e-3)
    assert figures["G"].value == pytest.approx(0, abs=2e-3)


def test_recorded_turn_that_brakes_is_refused(tmp_path: Path) -> None:
    circle = planned(Circle(plane=("X", "Z"), radius=0.015, feed=0.05, turns=2))
    motion = recording(tmp_path / "c.csv", circle)
    with pytest.raises(InputError, match=r"turn 2 of 2 of the recorded setpoints is not driven at constant speed"):
        turn_of(motion, CircleTest())


def test_what_is_no_circle_is_refused(tmp_path: Path) -> None:
    t = np.arange(0, 1, 5e-3)
    half = {"time": t, "X": 0.785 + 0.015 * np.cos(math.pi * t), "Z": 0.1 + 0.015 * np.sin(math.pi * t)}
    # cut in motion, it has a run-in and a run-out of 2 mm each besides
    cut = recording(tmp_path / "half.csv", half).model_copy(update={"relative": True})
    with pytest.raises(InputError, match=r"cover (1[789]\d|20\d)[0-9.]* deg about X .* at least one full turn"):
        turn_of(cut, CircleTest())
    circle = Circle(plane=("X", "Z"), radius=0.015, feed=0.05, turns=2)
    led_in = planned(Move(by={"X": -0.005}, feed=0.05), circle)
    motion = recording(tmp_path / "lead.csv", led_in)
    with pytest.raises(InputError, match=r"evaluate\.0: circularity: .* leave the circle .* um; allowed: 20 um"):
        turn_of(motion, CircleTest())
    with pytest.raises(ValidationError, match="no column for Y; they have X, Z"):
        scenario(motion, evaluate=(CircleTest(plane=("X", "Y")),))
    with pytest.raises(ValidationError, match="centre must give X and Z"):
        scenario(motion, evaluate=(CircleTest(centre={"X": 0.8}),))
    with pytest.raises(ValidationError, match="only for recorded setpoints"):
        scenario(circle, evaluate=(CircleTest(radius=0.015),))
