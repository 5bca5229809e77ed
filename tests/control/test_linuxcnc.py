"""INI files of LinuxCNC: which joint an axis has, which of several limits acts, older releases, included files.

Expected values by hand, after docs/src/config/ini-config.adoc and the man page kins(9) of LinuxCNC.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest

import feedsim as fs
from control_helpers import reasons, values
from feedsim.files.control.formats import parse_file
from feedsim.files.control.reading import read_values
from feedsim.files.control.writing import change_files
from feedsim.foundation.errors import InputError


def ini(kinematics: str, coordinates: str, joints: int = 6, section: str = "JOINT", more: str = "") -> bytes:
    """Joint k has a speed of 10 + k mm/s."""
    head = f"[KINS]\nKINEMATICS = {kinematics}\n" if kinematics else ""
    head += f"[TRAJ]\nCOORDINATES = {coordinates}\nLINEAR_UNITS = mm\n"
    body = "".join(f"[{section}_{k}]\nTYPE = LINEAR\nMAX_VELOCITY = {10 + k}\n" for k in range(joints))
    return (head + body + more).encode()


@pytest.mark.parametrize(
    ("kinematics", "coordinates", "joints"),
    [
        ("trivkins", "X Z", {"X": 0, "Z": 2}),
        ("trivkins", "XYZA", {"X": 0, "Y": 1, "Z": 2, "A": 3}),
        ("trivkins", "X Y Z B", {"B": 4}),
        ("trivkins coordinates=XZ", "X Z", {"X": 0, "Z": 1}),
        ("trivkins coordinates=zx", "X Z", {"X": 1, "Z": 0}),
        ("trivkins kinstype=BOTH coordinates=XYYZ", "X Y Y Z", {"X": 0, "Z": 3}),
        ("trivkins \\\n coordinates=XZ", "X Z", {"Z": 1}),
        ("", "X Y Z", {"X": 0, "Y": 1, "Z": 2}),
        ("", "X Z", {"X": 0}),
    ],
)
def test_joints_are_counted_along_the_coordinates_of_the_kinematics(
    kinematics: str, coordinates: str, joints: Mapping[str, int]
) -> None:
    archive = parse_file("mill.ini", ini(kinematics, coordinates))
    for letter, joint in joints.items():
        assert values(read_values([archive], {"X": letter}), "X") == {"max_speed": pytest.approx((10 + joint) * 1e-3)}


@pytest.mark.parametrize(
    ("kinematics", "coordinates", "letter", "reason"),
    [
        ("genserkins", "X Z", "Z", "The kinematics genserkins do not say which joint moves an axis"),
        ("corexykins", "X Y", "X", "The kinematics corexykins do not say"),
        ("", "X Z", "Z", r"no \[KINS\] KINEMATICS"),
        ("", "X Y Y Z", "Y", r"no \[KINS\] KINEMATICS"),
        ("trivkins", "X Z", "Y", "no axis 'Y'"),  # joint 1 moves no axis of this machine
    ],
)
def test_a_joint_that_is_not_known_is_asked_for(kinematics: str, coordinates: str, letter: str, reason: str) -> None:
    archive = parse_file("mill.ini", ini(kinematics, coordinates))
    with pytest.raises(InputError, match=reason):
        read_values([archive], {"X": letter})
    assert values(read_values([archive], {"X": "JOINT_3"}), "X") == {"max_speed": pytest.approx(13e-3)}


GANTRY = ini("trivkins coordinates=XYYZ", "X Y Y Z", 4, more="[JOINT_1]\nBACKLASH=0.01\n[JOINT_2]\nBACKLASH=0.02\n")


def test_both_joints_of_a_gantry_count() -> None:
    found = read_values([parse_file("g.ini", GANTRY)], {"Y": "Y"})
    assert values(found, "Y") == {"max_speed": pytest.approx(11e-3)}
    assert "several values" in reasons(found)["BACKLASH"]
    assert (
        values(read_values([parse_file("g.ini", GANTRY)], {"Y": "JOINT_2"}), "Y")["drive.backlash_compensation.value"]
        == 20e-6
    )


LIMITS = """[KINS]
KINEMATICS = trivkins
[TRAJ]
COORDINATES = X Y
LINEAR_UNITS = inch
{0}
[JOINT_0]
UNITS = mm
MAX_VELOCITY = 50
MAX_ACCELERATION = 800
MIN_LIMIT = -100
MAX_LIMIT = 100
[AXIS_X]
{1}
[JOINT_1]
MAX_VELOCITY = 1
"""


@pytest.mark.parametrize(
    ("of_all", "of_axis", "parameter", "expected", "note"),
    [
        ("", "MAX_VELOCITY = 1", "max_speed", 0.0254, "1 of [AXIS_X] acts, [JOINT_0] has 50"),
        ("", "MAX_VELOCITY = 2", "max_speed", 0.05, "50 of [JOINT_0] acts, [AXIS_X] has 2"),
        ("MAX_LINEAR_VELOCITY = .5", "MAX_VELOCITY = 2", "max_speed", 0.0127, ".5 of [TRAJ] acts, [JOINT_0] has 50"),
        ("MAX_VELOCITY = .5", "", "max_speed", 0.05, ""),  # its name up to 2.7
        ("MAX_LINEAR_ACCELERATION = 10", "", "max_acceleration", 0.254, "10 of [TRAJ] acts"),
        ("", "MAX_ACCELERATION = 20", "max_acceleration", 0.508, "20 of [AXIS_X] acts"),
        ("", "MIN_LIMIT = -3", "travel.0", -0.0762, "-3 of [AXIS_X] acts"),
        ("", "MIN_LIMIT = -5", "travel.0", -0.1, "-100 of [JOINT_0] acts"),
        ("", "MAX_LIMIT = 3", "travel.1", 0.0762, "3 of [AXIS_X] acts"),
        ("", "MAX_LIMIT = 5", "travel.1", 0.1, "100 of [JOINT_0] acts"),
    ],
)
def test_of_several_limits_the_tightest_acts(
    of_all: str, of_axis: str, parameter: str, expected: float, note: str
) -> None:
    found = read_values([parse_file("m.ini", LIMITS.format(of_all, of_axis).encode())], {"X": "X"})
    assert values(found, "X")[parameter] == pytest.approx(expected)
    assert any(note in finding.text for finding in found.notes) == bool(note)


@pytest.mark.parametrize(
    ("of_axis", "number", "reason"),
    [
        ("MAX_VELOCITY = fast", "MAX_VELOCITY", "'fast' of [AXIS_X] (m.ini:14) is no number"),
        ("MAX_VELOCITY = 1\nMAX_VELOCITY = 2", "MAX_VELOCITY", "[AXIS_X] has several values, the last in m.ini:15"),
    ],
)
def test_limits_that_cannot_be_compared_are_refused(of_axis: str, number: str, reason: str) -> None:
    found = read_values([parse_file("m.ini", LIMITS.format("", of_axis).encode())], {"X": "X"})
    assert reasons(found)[number] == reason


def test_a_default_of_linuxcnc_is_not_passed_over() -> None:
    text = LIMITS.format("", "MAX_VELOCITY = 1").replace("MAX_VELOCITY = 50\n", "")
    found = read_values([parse_file("m.ini", text.encode())], {"X": "X"})
    assert reasons(found)["MAX_VELOCITY"] == "[JOINT_0] has no MAX_VELOCITY, and LinuxCNC's default acts"


@pytest.mark.parametrize(
    ("new", "lines"),
    [
        (0.0381, [("MAX_VELOCITY = 1", "MAX_VELOCITY = 1.5")]),  # the joint has 50 mm/s
        (0.0127, [("MAX_VELOCITY = 1", "MAX_VELOCITY = 0.5")]),
        (0.0508, [("MAX_VELOCITY = 50", "MAX_VELOCITY = 50.8"), ("MAX_VELOCITY = 1", "MAX_VELOCITY = 2")]),
    ],
)
def test_limits_are_written_where_they_act(new: float, lines: Sequence[tuple[str, str]]) -> None:
    text = LIMITS.format("", "MAX_VELOCITY = 1")
    made = (
        change_files([parse_file("m.ini", text.encode())], {"X": "X"}, {"X": {"max_speed": new}})
        .contents["m.ini"]
        .decode()
    )
    pairs = zip(text.splitlines(), made.splitlines(), strict=True)
    assert [pair for pair in pairs if pair[0] != pair[1]] == lines
    assert values(read_values([parse_file("m.ini", made.encode())], {"X": "X"}), "X")["max_speed"] == pytest.approx(new)


def test_a_limit_of_all_axes_is_not_written() -> None:
    archive = parse_file("m.ini", LIMITS.format("MAX_LINEAR_VELOCITY = .5", "").encode())
    made = change_files([archive], {"X": "X"}, {"X": {"max_speed": 0.02}})
    assert made.contents == {}
    assert [change.reason for change in made.changes] == ["[TRAJ] limits all axes: type the value"]


@pytest.mark.parametrize(
    ("coordinates", "letter", "joint"), [("X Y Z", "X", 0), ("X Z", "Z", 2), ("X Y Z A", "AXIS_1", 1)]
)
def test_axes_of_older_releases_are_joints(coordinates: str, letter: str, joint: int) -> None:
    archive = parse_file("mill.ini", ini("", coordinates, section="AXIS"))
    assert archive.form == "INI file of LinuxCNC up to 2.7"
    assert values(read_values([archive], {"X": letter}), "X") == {"max_speed": pytest.approx((10 + joint) * 1e-3)}


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (("TYPE = LINEAR", "TYPE = ANGULAR"), "the joint is a rotary one"),
        (("LINEAR_UNITS = mm", "LINEAR_UNITS = furlong"), "the unit 'furlong' is not known"),
    ],
)
def test_checking_units_takes_no_value_that_is_wrong_otherwise(change: tuple[str, str], reason: str) -> None:
    archive = parse_file("mill.ini", ini("trivkins", "X Y Z").replace(change[0].encode(), change[1].encode()))
    assert reasons(read_values([archive], {"X": "X"}, checked=["all"]))["MAX_VELOCITY"] == reason


@pytest.mark.parametrize("unit", ["inch", "0.03937007874016"])
def test_units_by_name_and_by_number(unit: str) -> None:
    archive = parse_file("mill.ini", ini("trivkins", "X Y Z").replace(b"UNITS = mm", f"UNITS = {unit}".encode()))
    assert values(read_values([archive], {"X": "X"}), "X") == {"max_speed": pytest.approx(0.254)}


def test_a_section_that_is_damaged_does_not_go_on_with_the_one_before() -> None:
    text = ini("trivkins", "X Y Z", 1) + b"[HMOT-7I76]\nBACKLASH = 5\n[JOINT_1\nMAX_ACCELERATION = 7\n"
    archive = parse_file("mill.ini", text)
    assert values(read_values([archive], {"X": "X"}), "X") == {"max_speed": pytest.approx(0.01)}
    assert "a section without its closing bracket" in {line.reason for line in archive.odd}


def laid(folder: Path, files: Mapping[str, str]) -> Path:
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder / "main.ini"


JOINT = "MAX_VELOCITY = {0}\nMAX_ACCELERATION = 500\n"
HEAD = "[KINS]\nKINEMATICS = trivkins coordinates=XZ\n[TRAJ]\nCOORDINATES = X Z\nLINEAR_UNITS = mm\n"


@pytest.mark.parametrize(
    "files",
    [
        {"main.ini": "#INCLUDE all.inc\n", "all.inc": HEAD + "[JOINT_1]\n" + JOINT.format(30)},
        {"main.ini": HEAD + "[JOINT_1]\n#INCLUDE below/one.inc\n", "below/one.inc": JOINT.format(30)},
        {"main.ini": HEAD + "#INCLUDE below/a.inc\n", "below/a.inc": "[JOINT_1]\n#INCLUDE ./b.inc\n",
         "b.inc": JOINT.format(30)},
        {"main.ini": HEAD + "[JOINT_0]\n#INCLUDE a.inc\n[JOINT_1]\n#INCLUDE a.inc\n", "a.inc": JOINT.format(30)},
    ],
)  # fmt: skip
def test_included_files_are_read_as_if_they_stood_there(files: Mapping[str, str], tmp_path: Path) -> None:
    main = laid(tmp_path, files)
    result = fs.machine_import(main, "Z=Z")
    taken = {entry.parameter: entry.value for entry in result.reading.taken}
    assert taken == {"max_speed": pytest.approx(0.03), "max_acceleration": pytest.approx(0.5)}
    assert {path.name for path in result.inputs} == {Path(name).name for name in files}


@pytest.mark.parametrize(
    ("files", "reason"),
    [
        ({"main.ini": HEAD + "#INCLUDE no.inc\n"}, r"main\.ini:6: #INCLUDE no\.inc: no such file"),
        ({"main.ini": HEAD + "#INCLUDE main.ini\n"}, "includes itself"),
        ({"main.ini": HEAD + "#INCLUDE a.inc\n", "a.inc": "#INCLUDE b.inc\n", "b.inc": "#INCLUDE a.inc\n"},
         r"b\.inc:1: #INCLUDE a\.inc: the file includes itself"),
        ({"main.ini": HEAD + "#INCLUDE ../secret\n"}, r"secret is outside of the folder of the INI file"),
        ({"main.ini": HEAD + "#INCLUDE /etc/hostname\n"}, "is outside of the folder of the INI file"),
        ({"main.ini": HEAD + "#INCLUDE ~/.netrc\n"}, "is outside of the folder of the INI file"),
        ({"main.ini": HEAD + "#INCLUDE a.inc\n" * 101, "a.inc": "#\n"}, "more than 100 files are included"),
        ({"main.ini": HEAD + "#INCLUDE a.inc\n", "a.inc": "#" * 5_000_000}, "4 MB"),
    ],
)  # fmt: skip
def test_includes_that_are_refused(files: Mapping[str, str], reason: str, tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("[JOINT_0]\nMAX_VELOCITY = 1\n")
    with pytest.raises(InputError, match=reason):
        fs.machine_import(laid(tmp_path / "machine", files), "X")


def test_a_link_does_not_lead_out_of_the_folder(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("[JOINT_0]\nMAX_VELOCITY = 1\n")
    main = laid(tmp_path / "machine", {"main.ini": HEAD + "#INCLUDE a.inc\n"})
    (main.parent / "a.inc").symlink_to(tmp_path / "secret")
    with pytest.raises(InputError, match="outside of the folder"):
        fs.machine_import(main, "X")


def test_values_are_written_into_the_file_that_has_them(tmp_path: Path) -> None:
    """The acceleration differs; the main file keeps its bytes."""
    from feedsim.jobs.machine_import import read_files
    from feedsim.jobs.parameters import NO_WATCH

    main = laid(tmp_path, {"main.ini": HEAD + "[JOINT_1]\n#INCLUDE a.inc\n", "a.inc": JOINT.format(30)})
    made = change_files(read_files([main], NO_WATCH), {"Z": "Z"}, {"Z": {"max_acceleration": 0.2, "max_speed": 0.03}})
    assert made.contents == {"a.inc": b"MAX_VELOCITY = 30\nMAX_ACCELERATION = 200\n"}
