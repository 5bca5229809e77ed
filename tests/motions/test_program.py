"""The kind of motion `program`: where it leads, what its overrides change, and every block that leaves the travel."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import feedsim as fs
from feedsim.motions import PartProgram
from feedsim.motions.kind import Start, whole_cycles
from feedsim.motions.part_program import Blending, Motion
from feedsim.motions.planner import Limits
from feedsim.motions.program import ProgrammedGeometry
from feedsim.simulation import nc

HERE = {"X": 0.8, "Y": 0.3, "Z": 0.1}
AXES = tuple(HERE)
START = Start(
    position=HERE, time=0.4, T_ipo=2e-3, T_pos=1e-3, most=100_000, acceleration=14.4, jerk=150.0,
    travel={"X": (0.0, 1.77), "Y": (0.0, 0.6), "Z": (0.0, 0.685)},
    limits=Limits(AXES, np.full(3, 0.5), np.full(3, 10.0), np.full(3, 150.0), 2e-3, 14.4, 150.0),
)  # fmt: skip


def program(folder: Path, text: str, **fields: object) -> PartProgram:
    file = folder / "part.mpf"
    file.write_text(text)
    return PartProgram.model_validate({"file": str(file), **fields})


def test_a_course_begins_where_the_axes_are_and_ends_where_the_program_does(tmp_path: Path) -> None:
    """The way to the program's first point is part of it; the path is the programmed one within the tolerance."""
    motion = program(tmp_path, "G90 G642 CTOL=0.01\nG0 X810 Y305\nG1 X830 F3000\nY325\nG4 F0.1\nG3 X830 Y325 I-5 J0\n")
    course = motion.plan(START)
    assert course.cycles == whole_cycles(course.duration, START.T_ipo)
    assert course.moving == ("X", "Y")
    assert course.target == {"X": 0.83, "Y": 0.325}
    geometry = course.geometry
    assert isinstance(geometry, ProgrammedGeometry)
    x = np.column_stack([course.points["X"], course.points["Y"], np.full(course.cycles, HERE["Z"])])
    assert np.abs(x[0, :2] - [0.8, 0.3]).max() < 1e-6
    assert x[-1] == pytest.approx([0.83, 0.325, 0.1], abs=1e-15)
    feet = geometry.path.nearest(x, geometry.s[1:], np.full(course.cycles, 1e-3))
    assert np.linalg.norm(x - feet.point, axis=1).max() <= 10e-6 * 1.001
    assert np.all(np.diff(geometry.s) >= -1e-12)
    for axis, limit in (("X", 10.0), ("Y", 10.0)):
        way = np.concatenate([[HERE[axis]] * 2, course.points[axis], [course.points[axis][-1]] * 2])
        assert np.abs(np.diff(way)).max() / START.T_ipo <= 0.5 * (1 + 1e-9)
        assert np.abs(np.diff(way, 2)).max() / START.T_ipo**2 <= limit * (1 + 1e-6)
        assert np.abs(np.diff(way, 3)).max() / START.T_ipo**3 <= 150.0 * (1 + 1e-6)


def test_fields_stand_in_place_of_what_the_program_says(tmp_path: Path) -> None:
    text = "G90 G64 G1 X810 F3000\nG642 CTOL=0.02 COMPCAD X820\nG641 ADIS=0.5 COMPOF X830\nG4 F0.1\nG60 X840\nG0 X800"
    plain = program(tmp_path, text).moves(START)
    moves = program(tmp_path, text, feed_override=0.5, tolerance=5e-6, compressor=True).moves(START)
    np.testing.assert_array_equal(moves.feed, 0.5 * plain.feed)
    rounded = (plain.blending == Blending.TOLERANCE) | (plain.blending == Blending.DISTANCE)
    assert rounded.any()
    assert moves.tolerance[rounded] == pytest.approx(5e-6)
    np.testing.assert_array_equal(moves.compressed, moves.motion == Motion.LINE)
    stops = program(tmp_path, text, blending="exact_stop").moves(START)
    moving = stops.dwell == 0
    assert (stops.blending[moving] == Blending.EXACT_STOP).all()
    corners = program(tmp_path, text, blending="tolerance").moves(START)
    assert (corners.blending[moving] == Blending.TOLERANCE).all()
    assert np.isfinite(corners.tolerance[moving]).all()


def test_rapids_at_half_the_speed_take_about_twice_the_time(tmp_path: Path) -> None:
    """A rapid of 400 mm at 0.5 m/s with 10 m/s^2 and 150 m/s^3: t = s/v + v/a + a/j, or with less than a^2/j of speed
    t = s/v + 2 sqrt(v/j)."""
    text = "G90 G0 X1200\n"
    for override in (1.0, 0.5, 0.1):
        v = 0.5 * override
        course = program(tmp_path, text, rapid_override=override).plan(START)
        least = 0.4 / v + (v / 10 + 10 / 150 if v >= 10**2 / 150 else 2 * np.sqrt(v / 150))
        assert least - 1e-9 <= course.duration <= least * 1.05


def test_every_block_that_leaves_the_travel_is_named(tmp_path: Path) -> None:
    """Ends, and what an arc reaches between its ends."""
    text = (
        "G90 G17\nN10 G1 X1780 F5000\nX1760 ; back\nG3 X1760 Y300 I5 J0\nG1 X1750\nG3 X1750 Y300 I15 J0\n"
        "N70 G1 Y-10 X1800\nY300 X800\n"
    )
    motion = program(tmp_path, text)
    with pytest.raises(fs.InputError) as caught:
        motion.plan(START)
    file = motion.file
    assert list(caught.value.problems) == [
        f"{file}:2: N10 G1 X1780 F5000: axis X reaches 1780 mm; allowed travel 0 to 1770 mm",
        f"{file}:6: G3 X1750 Y300 I15 J0: axis X reaches 1780 mm; allowed travel 0 to 1770 mm",
        f"{file}:7: N70 G1 Y-10 X1800: axis X reaches 1800 mm; allowed travel 0 to 1770 mm",
        f"{file}:7: N70 G1 Y-10 X1800: axis Y reaches -10 mm; allowed travel 0 to 600 mm",
    ]


def test_of_many_blocks_outside_the_first_hundred_are_named(tmp_path: Path) -> None:
    motion = program(tmp_path, "G91 G1 F1000\n" + "X10\n" * 250)
    with pytest.raises(fs.InputError) as caught:
        motion.plan(START)
    problems = caught.value.problems
    assert len(problems) == 101
    assert problems[-1].endswith("and 53 blocks more")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("G90 G1 X800 F100\n", "part.mpf: the program moves no axis"),
        ("; nothing\n", r"part.mpf:1: .*no movement"),
        ("G1 A10 F100\n", r"part.mpf:1: A: no linear axis"),
        ("G1 X810 F1000\nG1 X/ F100\n", r"part.mpf:2: .*"),
        ("WHILE 1\nENDIF\n", r"part.mpf:2: .*"),
        ("", "part.mpf:1: .*empty"),
    ],
)
def test_what_cannot_be_driven_is_a_sentence_with_file_and_line(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(fs.InputError) as caught:
        program(tmp_path, text).plan(START)
    assert len(caught.value.problems) == 1
    assert re.search(said, caught.value.problems[0])


def test_a_program_among_motions_goes_on_where_the_others_have_stopped(tmp_path: Path) -> None:
    (tmp_path / "part.mpf").write_text("G91 G1 X10 F3000\nX-10 Z5\n")
    (tmp_path / "s.yaml").write_text(
        f"name: s\nmachine: {Path('scenarios/machines/test_centre').absolute()}\nmotions:\n"
        "- {kind: move, by: {Z: 10 mm}, feed: 3000 mm/min}\n- {program: part.mpf, feed_override: 50 %}\n"
        "- {kind: move, by: {X: 1 mm}, feed: 3000 mm/min}\nevaluate: [{kind: contour}]\n"
    )
    planned = nc.plan(fs.load(tmp_path / "s.yaml"))
    assert [segment.kind for segment in planned.segments] == ["move", "program", "move"]
    part = planned.segments[1]
    assert part.origin["Z"] == pytest.approx(0.11)
    assert part.target == pytest.approx({"X": 0.8, "Y": 0.327, "Z": 0.115})
    assert planned.x_s["X"][-1] == pytest.approx(0.801, abs=1e-12)
    (tmp_path / "part.mpf").write_text("G91 G1 X10 F3000\nX3000\n")
    with pytest.raises(
        fs.InputError, match=r"s.yaml:5: motions.1 \(program\): .*part.mpf:2: X3000: axis X reaches 3810 mm"
    ):
        nc.plan(fs.load(tmp_path / "s.yaml"))
