"""What is wrong in a scenario or a machine file is refused with file, line, key, value and what is allowed."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from feedsim.foundation.errors import InputError
from feedsim.scenario import load, load_machine

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
MACHINE = SCENARIOS / "machines" / "test_centre" / "machine.yaml"
MOVE = "motions: [{kind: move, by: {Z: 100 mm}, feed: 5000 mm/min}]"

Refused = Callable[..., str]


@pytest.fixture
def refused(tmp_path: Path) -> Refused:
    """Message about a scenario s.yaml: name and machine are in lines 1 and 2, `lines` follow from line 3 on."""

    def message(*lines: str, machine: Path = MACHINE.parent) -> str:
        path = tmp_path / "s.yaml"
        path.write_text("\n".join(["name: s", f"machine: {machine}", *lines]) + "\n", encoding="utf-8")
        with pytest.raises(InputError) as caught:
            load(path)
        return str(caught.value)

    return message


@pytest.mark.parametrize(
    ("motion", "message"),
    [
        ("move, by: {Z: 1 mm}, feed: 5000 mm",
         ".feed: '5000 mm' is a length; a speed is expected, for example 5000 mm/min"),
        ("move, by: {Z: 1 mm}, feed: 5000", ".feed: 5000 has no unit; a speed is expected, for example 5000 mm/min"),
        ("move, by: {Z: 1 mm}, feed: 0 m/s", ".feed: 0 m/s is outside the allowed range: more than 0 m/s"),
        ("move, by: {Z: 1 mm}, feed: true", ".feed: true is no quantity; a speed is expected"),
        ("move, by: {Z: 1 mm}, feed: 1 m/s, jrk: 1 m/s^3", ".jrk: unknown key; did you mean 'jerk'?"),
        ("move, by: {Z: 1 mm}", ".feed: missing; a speed, for example feed: 5000 mm/min"),
        ("move, by: {Z: 1}, feed: 5 m/s", ".by.Z: 1 has no unit; a length is expected, for example 100 mm"),
        ("move, by: {Q: 1 mm}, feed: 5 m/s", ".by.Q: the machine has no axis 'Q'; it has X, Y, Z"),
        ("move, by: {z: 1 mm}, feed: 5 m/s", ".by.z: the machine has no axis 'z'; did you mean 'Z'?"),
        ("move, by: {Z: 1 mm}, feed: 5 mm/mn", ".feed: '5 mm/mn': unknown unit 'mn'; did you mean 'min'?; a speed"),
        ("move, by: 1 mm, feed: 5 m/s", ".by: '1 mm'; a group of keys is expected"),
        ("move, feed: 5 m/s", ": a move needs 'by' (distances) or 'to' (positions)"),
        ("move, by: {Z: 1 mm}, to: {Z: 1 mm}, feed: 5 m/s", ": axis Z stands in 'by' and in 'to'"),
        ("moove", ": unknown kind 'moove'; did you mean 'move'?"),
        ("circle, plane: [X, X], radius: 1 mm, feed: 1 m/s", ".plane: a plane needs two different axes, not X twice"),
        ("circle, plane: [X], radius: 1 mm, feed: 1 m/s", ".plane.1: the list is too short; two entries are needed"),
        ("circle, plane: [X, Y, Z], radius: 1 mm, feed: 1 m/s", ".plane: 3 entries; at most 2"),
        ("circle, plane: [X, Z], radius: 1 mm, feed: 1 m/s, turns: 1.5", ".turns: 1.5 is no whole number"),
        ("circle, plane: [X, Z], radius: 1 mm, feed: 1 m/s, turns: 0",
         ".turns: 0 is outside the allowed range: at least 1"),
        ("circle, plane: [X, Z], radius: 1 mm, feed: 1 m/s, direction: counter-clockwise",
         ".direction: 'counter-clockwise' is not allowed here; did you mean 'counterclockwise'?"),
        ("arc, plane: [X, Z], feed: 1 m/s, angle: 90 deg", ": an arc needs its centre once"),
        ("arc, plane: [X, Z], feed: 1 m/s, centre_by: {X: 1 mm, Z: 0 m}", ": an arc needs its end once"),
        ("arc, plane: [X, Z], feed: 1 m/s, angle: 1 rad, centre_by: {X: 1 mm, Y: 1 mm}",
         ": 'centre_by' must give X and Z, the axes of the plane"),
        ("dwell, duration: 0 s", ".duration: 0 s is outside the allowed range: more than 0 s"),
        ("constant_speed, axis: Z", ".speeds: missing; List of speeds, or {from: ..., to: ..., count: ...}"),
        ("constant_speed, axis: Z, speeds: 5 m/min", ".speeds: '5 m/min'; a list is expected"),
        ("constant_speed, axis: Z, speeds: []", ".speeds: 0 entries; at least 1 needed"),
        ("constant_speed, axis: Z, speeds: [1 m/min, 5 mm]", ".speeds.1: '5 mm' is a length; a speed is expected"),
        ("constant_speed, axis: Z, speeds: {from: 1 m/min}", ".speeds.to: missing; a speed, for example to: 5000"),
        ("constant_speed, axis: Z, speeds: {from: 1 m/s, to: 2 m/s, count: 1}",
         ".speeds.count: 1 is outside the allowed range: at least 2"),
        ("constant_speed, axis: Z, speeds: {from: 1 m/s, to: 2 m/s, cuont: 3}",
         ".speeds.cuont: unknown key; did you mean 'count'?"),
        ("constant_speed, axis: Z, speeds: {from: 1 m/s, to: 1 m/s}", ".speeds: 'from' and 'to' are both 1 m/s"),
        ("constant_speed, axis: Q, speeds: [1 m/min]", ".axis: the machine has no axis 'Q'; it has X, Y, Z"),
        ("constant_speed, axis: Z, speeds: [1 m/s], rest: -1 s",
         ".rest: -1 s is outside the allowed range: at least 0"),
        ("sine, axis: Z, moves: []", ".moves: 0 entries; at least 1 needed"),
        ("sine, axis: Z, moves: [{amplitude: 1 um, frequency: 10, periods: 2}]",
         ".moves.0.frequency: 10 has no unit; an angular speed or frequency is expected, for example 5 Hz"),
        ("sine, axis: Z, moves: [{amplitude: 1 um, frequency: 1 Hz, periods: 2.5}]",
         ".moves.0.periods: 2.5 is no whole number"),
        ("sine, axis: Z, fade: 0, moves: [{amplitude: 1 um, frequency: 1 Hz, periods: 2}]",
         ".fade: 0 is outside the allowed range: from 0.5 to 100"),
        ("setpoints, file: none.csv, columns: {Z: q}", ".file: no such file: "),
        ("setpoints, file: s.yaml, columns: {}", ".columns: 0 entries; at least 1 needed"),
        ("setpoints, file: s.yaml, columns: {Z: {column: q, unit: furlong}}",
         ".columns.Z.unit: unknown unit 'furlong'"),
        ("setpoints, file: s.yaml, columns: {Z: q}, between: [2 s, 1 s]", ".between: the first time 2 s is not before"),
    ],
)  # fmt: skip
def test_motions(refused: Refused, motion: str, message: str) -> None:
    found = refused("motions:", f"  - {{kind: {motion}}}")
    assert f"s.yaml:4: motions.0{message}" in found
    assert "\n" not in found


@pytest.mark.parametrize(
    ("load", "message"),
    [
        ("motor, axis: Q, file: s.yaml, column: F", ".axis: the machine has no axis 'Q'; it has X, Y, Z"),
        ("tool, direction: x, file: s.yaml, column: F", ".direction: 'x' is not allowed here; did you mean 'X'?"),
        ("spindle, file: s.yaml", ": unknown kind 'spindle'; allowed: motor, slide, tool"),
        ("slide, axis: X, table: {time: [0 s, 1 s], values: [0 N.m, 1 N]}",
         ".table.values.0: '0 N.m' is a torque; a force is expected, for example 100 N"),
        ("tool, direction: X, file: none.csv, column: F", ".file: no such file: "),
        ("tool, direction: X", ": a load is in a 'file' with its 'column', in a 'table' of 'time' and 'values',"),
        ("tool, direction: X, file: s.yaml, column: F, table: {time: [0 s, 1 s], values: [0 N, 1 N]}",
         ": a load is in a 'file' with its 'column', in a 'table' of 'time' and 'values', or at random by "
         "'noise'; file and table are given"),
        ("tool, direction: X, file: s.yaml", ": a 'file' needs the 'column' of the load, and only a file has one"),
        ("tool, direction: X, column: F, table: {time: [0 s, 1 s], values: [0 N, 1 N]}",
         ": a 'file' needs the 'column' of the load, and only a file has one"),
        ("tool, direction: X, table: {time: [0 s, 1 s], values: [0 N]}",
         ".table: 2 instants and 1 values; each instant needs a value"),
        ("tool, direction: X, table: {time: [1 s, 1 s], values: [0 N, 0 N]}", ".table.time: 1 s follows 1 s; the time"),
        ("tool, direction: X, table: {time: [0 s, 1 s], values: [0 N.m, 1 N]}",
         ".table.values.0: '0 N.m' is a torque; a force is expected, for example 100 N"),
        ("motor, axis: X, table: {time: [0 s, 1 s], values: [0 N.m, 1]}",
         ".table.values.1: 1 has no unit; a torque is expected, for example 2 N.m"),
        ("motor, axis: X, motor_torque: M, table: {time: [0 s, 1 s], values: [0 N.m, 1 N.m]}",
         ": 'motor_torque' is a column of the file with the load; a table has none"),
        ("motor, axis: X, file: s.yaml, column: F, factor: 0", ".factor: 0 leaves nothing of the load"),
        ("motor, axis: X, file: s.yaml, column: {column: F, unit: furlong}", ".column.unit: unknown unit 'furlong'"),
        ("motor, axis: X, file: s.yaml, column: F, motion: 1",
         ".motion: 1 is no entry of motions (entries: 0 only, counted from 0)"),
    ],
)  # fmt: skip
def test_loads(refused: Refused, load: str, message: str) -> None:
    found = refused(MOVE, "loads:", f"  - {{kind: {load}}}")
    assert f"s.yaml:5: loads.0{message}" in found
    assert "\n" not in found


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (
            ["motions: [{by: {Z: 1 mm}}]"],
            "s.yaml:3: motions.0: missing key 'kind'; allowed: move, arc, circle, dwell, setpoints, "
            "constant_speed, sine",
        ),
        (["motions: 5"], "s.yaml:3: motions: 5; a list is expected"),
        (["motions: []"], "s.yaml:3: motions: 0 entries; at least 1 needed"),
        ([], "s.yaml:1: motions: missing"),
        ([MOVE, "recording: {interval: 1.1 ms}"],
         "s.yaml:4: recording.interval: 0.0011 s is no whole multiple of the control"),
        ([MOVE, "recording: {interval: 1 ms, variables: []}"],
         "s.yaml:4: recording.variables: 0 entries; at least 1 needed"),
        ([MOVE, "recording:"], "s.yaml:4: recording: nothing (null); a group of keys is expected"),
        ([MOVE, "coupling: {substeps: 0}"], "s.yaml:4: coupling.substeps: 0 is outside the allowed range: at least 1"),
        ([MOVE, "evaluate: [{kind: positioning, axis: X}]"],
         "s.yaml:4: evaluate.0: positioning of axis X, which no motion moves"),
        ([MOVE, "evaluate: [{kind: circle}]"],
         "s.yaml:4: evaluate.0: a circle is to be evaluated, but no motion is of kind"),
        ([MOVE, "evaluate: [{kind: positioning, axis: Z, motion: 1}]"],
         "s.yaml:4: evaluate.0.motion: 1 is no entry of motions (entries: 0 only, counted from 0)"),
        ([MOVE, "evaluate: [{kind: positioning, axis: X, motion: 0}]"],
         "s.yaml:4: evaluate.0: positioning of axis X, which motions.0 (move) does not move"),
        ([MOVE, "evaluate: [{kind: circle, motion: 0}]"],
         "s.yaml:4: evaluate.0: a circle is to be evaluated, but motions.0 (move) is not of kind circle"),
        ([MOVE, "evaluate: [{kind: circle, motion: -1}]"],
         "s.yaml:4: evaluate.0.motion: -1 is outside the allowed range: at least 0"),
        ([MOVE, "notes: x"], "s.yaml:4: notes: unknown key; did you mean 'note'?"),
        ([MOVE, "sets: x"], "s.yaml:4: sets: unknown key; did you mean 'set'?"),
        ([MOVE, "name: t"], "s.yaml:4: duplicate key 'name' (first in line 1)"),
        ([MOVE, "note: 5"], "s.yaml:4: note: 5 is no text; put it in quotes"),
    ],
)  # fmt: skip
def test_scenario(refused: Refused, lines: list[str], message: str) -> None:
    assert message in refused(*lines)


def test_turn_beyond_the_circle(refused: Refused) -> None:
    motions = "motions: [{kind: circle, plane: [X, Z], radius: 15 mm, feed: 1 m/min, turns: 3}]"
    message = refused(motions, "evaluate: [{kind: circle, turn: 4}]")
    assert "s.yaml:4: evaluate.0.turn: turn 4 of a circle of 3 turns" in message


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("F_S: 3.1 N.m", "F_S: 2.3 N.m", "axes.X.friction.F_S: F_S 2.3 N.m is smaller than F_C 2.4 N.m"),
        ("W: 0.040 rad", "W: -1 mrad", "axes.X.friction.W: -1 mrad is outside the allowed range: at least 0 rad"),
        ("gamma: 0.35", "gamma: 135 %", "axes.X.friction.gamma: 135 % is outside the allowed range: from 0 to 1"),
        ("F_C: 2.4 N.m", "F_c: 2.4 N.m", "axes.X.friction.F_c: unknown key; did you mean 'F_C'?"),
        ("F_C: 2.4 N.m", "place_3: 20 %\n      F_C: 2.4 N.m",
         "axes.X.friction.place_3: unknown key; it belongs to the guide of the axis, "
         "guide: {share: 100 %, place_3: ...}"),
        ("position: 1 ms", "position: 1.1 ms",
         "cycles.position: 0.0011 s is no whole multiple of the control cycle, 0.000125 s"),
        ("interpolation: 2 ms", "interpolation: 1.5 ms",
         "interpolation: 0.0015 s is no whole multiple of the position cycle"),
        ("control: 125 us", "control: 125", "cycles.control: 125 has no unit; a time is expected, for example 125 us"),
        ("K_v: 4 (m/min)/mm", "K_v: 66.7 Hz",
         "drive.K_v: '66.7 Hz' is an angular speed or frequency; a position controller"),
        ("symmetry_lag: false", "symmetry_lag: off",
         "symmetry_lag: 'off' is neither true nor false; write true or false"),
        ("p: 5 ", "p: 5.0 ", "axes.X.drive.p: 5.0 is no whole number"),
        ("type: band_stop", "type: band-stop", "'band-stop' is not allowed here; did you mean 'band_stop'?"),
        ("f: 455 Hz", "f: 4000 Hz",
         "filter_1.f: 4000 Hz is not below half the sampling rate of the control cycle, 4000 Hz"),
        ("travel: [0 mm, 1770 mm]", "travel: [9 mm, 9 mm]",
         "travel: the lowest position 0.009 m is not below the highest"),
        ("display_sign: 1", "display_sign: 2", "display_sign: 2 is not allowed here; allowed: 1, -1"),
        ("  X: ", "  tool: ", "machine.axes.tool: 'tool' is no axis name"),
    ],
)  # fmt: skip
def test_machine_file_and_line_are_named(tmp_path: Path, refused: Refused, old: str, new: str, message: str) -> None:
    path, line = changed_machine(tmp_path, old, new)
    found = [problem for problem in refused(MOVE, machine=path).splitlines() if message in problem]
    assert len(found) == 1
    assert f"m.yaml:{line}: machine." in found[0]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("omega_0: 747.3 rad/s", "",
         "axes.X.drive.omega_0: missing key 'omega_0'; needed as long as reference_model is true"),
        ("travel: [0 mm, 1770 mm]", "travel: [0 mm, 700 mm]",
         "m.yaml:15: machine.pose.X: the pose of X, 0.8 m, is outside its travel, 0 to 0.7 m"),
        ("pose: {X: 800 mm, ", "pose: {", "m.yaml:15: machine.pose: the pose lacks the position of axis X"),
        ("pose: {", "pose: {A: 0 m, ", "machine.pose.A: the machine has no axis 'A'; it has X, Y, Z"),
        ("modes.csv\n", "none.csv\n", "machine.modes: no such file: "),
    ],
)  # fmt: skip
def test_what_concerns_several_lines(tmp_path: Path, refused: Refused, old: str, new: str, message: str) -> None:
    assert message in refused(MOVE, machine=changed_machine(tmp_path, old, new)[0])


def changed_machine(tmp_path: Path, old: str, new: str) -> tuple[Path, int]:
    """A copy of the default machine with the first `old` replaced, and the line of that."""
    text = MACHINE.read_text(encoding="utf-8").replace("modes: modes.csv", f"modes: {MACHINE.parent / 'modes.csv'}")
    text = text.replace("structure: structure.yaml", f"structure: {MACHINE.parent / 'structure.yaml'}")
    path = tmp_path / "m.yaml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    return path, text[: text.index(old)].count("\n") + 1


def test_a_machine_that_is_missing_is_one_problem(refused: Refused) -> None:
    message = refused(MOVE, machine=Path("nowhere"))
    assert "s.yaml:2: machine: no such file: " in message
    assert "\n" not in message


def test_a_machine_with_broken_yaml_is_one_problem(tmp_path: Path, refused: Refused) -> None:
    path, line = changed_machine(tmp_path, "control: 125 us", "control: 125: us")
    message = refused(MOVE, machine=path)
    assert f"m.yaml:{line}: a second ': ' in a line" in message
    assert "\n" not in message


def test_all_problems_are_listed_in_the_order_of_the_file(refused: Refused) -> None:
    message = refused(
        "motions:",
        "  - {kind: move, by: {Z: 100 mm}, feed: 5000 mm}",
        "  - {kind: dwell, duraton: 1 s}",
        "coupling: {scheme: jacoby}",
        "evaluate: [{kind: positioning, axis: W}]",
        "extra: 1",
        "set: {machine.axes.Z.friction.F_S: 1 N.m, machine.cycles.position: 3 us}",
    )
    lines = [int(match) for match in re.findall(r"s\.yaml:([0-9]+): ", message)]
    assert lines == [4, 5, 5, 6, 7, 8, 9, 9]
    assert "8 problems" in message


def test_a_machine_alone() -> None:
    with pytest.raises(InputError, match="no such file"):
        load_machine("nowhere")


@pytest.mark.parametrize("text", ["[1, 2]", "5", "# nothing but a remark", "null"])
def test_files_that_hold_no_keys(tmp_path: Path, text: str) -> None:
    (tmp_path / "s.yaml").write_text(text)
    with pytest.raises(InputError, match="a file of 'key: value' lines is expected"):
        load(tmp_path / "s.yaml")
