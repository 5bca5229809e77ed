"""What every kind of motion owes the planner: a course from rest to rest, from where the axes are."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from feedsim.motions import (
    Arc,
    Circle,
    Column,
    ConstantSpeed,
    Dwell,
    MeasuredSetpoints,
    Motion,
    Move,
    Sine,
    SineMove,
)
from feedsim.motions.kind import Start, whole_cycles

HERE = {"X": 0.8, "Y": 0.3, "Z": 0.1}
START = Start(
    position=HERE, time=0.4, T_ipo=2e-3, T_pos=1e-3, most=10_000, acceleration=2.5, jerk=150.0,
    travel={"X": (0.0, 1.77), "Y": (0.0, 0.6), "Z": (0.0, 0.685)},
)  # fmt: skip
RELATIVE: list[Motion] = [
    Move(by={"X": 0.02, "Z": -0.01}, feed=0.05),
    Arc(plane=("X", "Z"), centre_by={"X": 0.01, "Z": 0.0}, angle=math.pi / 3, feed=0.03),
    Circle(plane=("Z", "Y"), radius=0.015, turns=2, feed=0.05),
    Dwell(duration=0.0331),
    ConstantSpeed(axis="Y", speeds=(0.05, 0.01), duration=0.2),
    Sine(axis="Z", moves=(SineMove(amplitude=20e-6, frequency=5.0, periods=2),)),
]


@pytest.mark.parametrize("motion", RELATIVE, ids=lambda motion: motion.kind)
def test_a_course_begins_where_the_axes_are_and_ends_at_its_target(motion: Motion) -> None:
    course = motion.plan(START)
    assert course.cycles == whole_cycles(course.duration, START.T_ipo)
    assert set(course.moving) <= set(course.points) <= set(motion.axes)
    assert set(course.peaks) == set(course.points)
    for axis, points in course.points.items():
        x, peaks = points[0 : len(points)], course.peaks[axis]
        assert len(x) == course.cycles
        # From rest: next to nothing of its way in the first cycle.
        assert abs(x[0] - HERE[axis]) <= 1e-3 * max(np.ptp(x), 1e-6)
        assert x[-1] == pytest.approx(course.target.get(axis, HERE[axis]), abs=1e-12)
        assert peaks.low - 1e-12 <= x.min()
        assert x.max() <= peaks.high + 1e-12
        step = np.diff(np.concatenate([[HERE[axis]], x])) / START.T_ipo
        assert np.abs(step).max() <= peaks.speed * (1 + 1e-9)
        assert np.abs(np.diff(step)).max() / START.T_ipo <= peaks.acceleration * (1 + 1e-6) + 1e-9
    assert motion.returns == (not course.target) or isinstance(motion, Dwell)


@pytest.mark.parametrize("motion", RELATIVE, ids=lambda motion: motion.kind)
def test_relative_motions_are_the_same_elsewhere(motion: Motion) -> None:
    """The middle of the travel: strokes go to the side with more room."""
    there = {"X": 0.8, "Y": 0.3, "Z": 0.1 + 1e-3}
    one, other = motion.plan(START), motion.plan(Start(**{**vars(START), "position": there}))
    assert one.duration == other.duration
    for axis, points in one.points.items():
        moved = other.points[axis][0 : one.cycles] - points[0 : one.cycles]
        np.testing.assert_allclose(moved, there[axis] - HERE[axis], rtol=0, atol=1e-15)


def test_a_recording_gives_setpoints_as_they_are(tmp_path: Path) -> None:
    file = tmp_path / "recorded.csv"
    file.write_text("time [s],a [mm]\n" + "".join(f"{k / 1000},{300 + 2 * (k / 100) ** 2}\n" for k in range(101)))
    motion = MeasuredSetpoints(file=file, columns={"X": Column(column="a")})
    course = motion.plan(START)
    x, v = course.setpoints["X"]
    assert course.absolute
    assert not course.points
    assert len(x) == len(v) == whole_cycles(course.duration, START.T_pos) + 1
    assert x[:101] == pytest.approx([0.3 + 2e-3 * (k / 100) ** 2 for k in range(101)], abs=1e-12)
    assert course.target["X"] == x[-1]
    assert motion.files == {"file": file}
