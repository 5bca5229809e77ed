"""Files with odd but legal contents, written after public descriptions: no wrong value, and only values are written.

Values by hand. What a file leaves open is refused with a reason, never guessed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import pytest

from feedsim.files.control.archive import Archive
from feedsim.files.control.formats import parse_file
from feedsim.files.control.reading import Reading, Value, read_values
from feedsim.files.control.writing import change_files
from feedsim.foundation.errors import InputError

LATIN = "; Sch\xe4rfe der Achsen, \xb5m\n"
# Spaces, tabs, letters of either case, no blank behind the block number, several assignments in a line, values that are
# commented out, a number without leading zero, an axis by its name, elements and axis in either order.
MACHINE_DATA = (
    LATIN
    + """%_N_INITIAL_INI
;$PATH=/_N_INI_DIR
CHANDATA(1)
N10000 $MN_AXCONF_MACHAX_NAME_TAB[0]="X1" ; "Z9"
N10000 $MN_AXCONF_MACHAX_NAME_TAB[1]="Z1"
N10000 $MN_AXCONF_MACHAX_NAME_TAB[2]=""
N10240 $MN_SCALING_SYSTEM_IS_METRIC=TRUE
N20050 $MC_AXCONF_GEOAX_ASSIGN_TAB[0]=1
CHANDATA(2)
N20050 $MC_AXCONF_GEOAX_ASSIGN_TAB[0]=2
CHANDATA(1)
N30300 $MA_IS_ROT_AX[AX1]=0
;N32200 $MA_POSCTRL_GAIN[0,AX1]=9.9
\tN32200\t$MA_POSCTRL_GAIN [ 0 , AX1 ]\t=\t+2.5 ;was 9.9 $MA_POSCTRL_GAIN[0,AX1]=9.9
n32200 $ma_posctrl_gain[1,ax1]=1.5
N32200$MA_POSCTRL_GAIN[Z1,0]=.4EX1
N32620 $MA_FFW_MODE[AX1]=3 N32610 $MA_VELO_FFW_WEIGHT[0,AX1]=.95
N32620 $MA_FFW_MODE[Z1]='H3'
N32610 $MA_VELO_FFW_WEIGHT[0,Z1]='B1'
N32300 $MA_MAX_AX_ACCEL[0,AX1]=SET(2.5,2.5,2.5)
N32300 $MA_MAX_AX_ACCEL[0,AX2]=3.
IF $MN_SCALING_SYSTEM_IS_METRIC==0
N32450 $MA_BACKLASH[0,AX1]=0.0005
ENDIF
N32450 $MA_BACKLASH[0,AX2]=-1.5E-2
M17
"""
)
# Two drives in one text, a list of words, bits, values of other data sets, a value behind a comment.
DRIVES = """[SINUMERIK_HEADER]
VERSION = 1
PD_FILE_NAME=PS000003.TEA
[PARAMETER]
p0115[0]=125
p115[1]=125
p199[0]=88
p199[1]=49
P1460[0] = 7.5 ; was 9
p1460[1]=9
;p1460[0]=11
p1461[0]=100
p1462[0]=1.25E1
r1460[0]=99
PD_FILE_NAME=PS000004.TEA
[PARAMETER]
p199[0]=90
p199[1]=49
p1460[0]=3
p1462[0]=0x10
p1520[0]=60
p1521[0]=-60
"""
AXIS_LIST = """# list of an axis
kopf.achs_nr              1
kopf.log_achs_name        X   # its name
getriebe[0].kv\t 4500 # 0.01 1/s
# getriebe[0].kv           9
getriebe[1].kv            100
getriebe[0].dynamik.a_max 2500
getriebe[0].dynamik.vb_max   0
getriebe[0].lose          twelve
"""
TABLE = """Name;Text;Wert;Einheit
"p1460[0]";"Gain; of the speed controller";"7.5";"Nms/rad"
p1462[0];Reset time;12,5;ms
p1520[0];Torque limit;80;Nm
p1521[0];Torque limit;-80;Nm
p316[0];Constant;1.6;Nm/A
"""
LINUXCNC = """[EMC]
VERSION = 1.1
[TRAJ]
COORDINATES = X Z
LINEAR_UNITS = inch  # all joints
[JOINT_0]
MAX_VELOCITY = 10\t; inch/s
MAX_ACCELERATION=40
#MAX_VELOCITY = 99
BACKLASH = 0.0005
[JOINT_1] # Z
MAX_VELOCITY = 20
UNITS = mm
COMP_FILE = z.comp
BACKLASH = 0.01
"""


@dataclass(frozen=True)
class Case:
    """A file and axes to read. values: axis -> what it gives. wanted: other values of X. change: text before, after."""

    name: str
    text: str
    axes: Mapping[str, str]
    values: Mapping[str, Mapping[str, Value]]
    wanted: Mapping[str, Value]
    change: tuple[str, str]
    places: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


CASES = (
    Case(
        "nc.tea", MACHINE_DATA, {"X": "X1", "Z": "AX2"},
        {
            "X": {"drive.K_v": 2500 / 60, "drive.k_ffw": 0.95, "drive.symmetry_lag": False},
            "Z": {"drive.K_v": 4000 / 60, "drive.k_ffw": 1.0, "drive.symmetry_lag": False, "max_acceleration": 3.0,
                  "drive.backlash_compensation.value": -15e-6},
        },
        {"drive.K_v": 50.0, "drive.k_ffw": 0.9}, ("=\t+2.5 ;was", "=\t3 ;was"),
    ),
    Case(
        "drives.tea", DRIVES, {"X": "X1", "Z": "Z1"},
        {"X": {"drive.K_p": 7.5, "drive.T_n": 0.0125}, "Z": {"drive.K_p": 3.0, "drive.M_max": 60.0}},
        {"drive.K_p": 8.0}, ("P1460[0] = 7.5 ;", "P1460[0] = 8 ;"),
    ),
    Case(
        "x.lis", AXIS_LIST, {"X": "X"}, {"X": {"drive.K_v": 45.0, "max_acceleration": 2.5, "max_speed": 0.0}},
        {"drive.K_v": 46.0}, ("kv\t 4500 #", "kv\t 4600 #"),
    ),
    Case(
        "p.csv", TABLE, {"X": "X"}, {"X": {"drive.K_p": 7.5, "drive.M_max": 80.0, "drive.K_t": 1.6 / 2**0.5}},
        {"drive.K_p": 8.0}, ('"7.5"', '"8"'), {"X": ("p",)},
    ),
    Case(
        "m.ini", LINUXCNC, {"X": "X", "Z": "JOINT_1"},
        {
            "X": {"max_speed": 0.254, "max_acceleration": 1.016, "drive.backlash_compensation.value": 12.7e-6},
            "Z": {"max_speed": 0.02},
        },
        {"max_speed": 0.508}, ("= 10\t;", "= 20\t;"),
    ),
)  # fmt: skip
FORMS = [
    (encoding, ends, mark)
    for encoding, marks in (("latin-1", ("",)), ("utf-8", ("\ufeff",)), ("utf-16-le", ("\ufeff",)))
    for ends in ("\n", "\r\n")
    for mark in marks
]


def file_of(case: Case, form: tuple[str, str, str]) -> tuple[Archive, bytes]:
    encoding, ends, mark = form
    data = (mark + case.text.replace("\n", ends)).encode(encoding)
    return parse_file(case.name, data), data


def values_of(reading: Reading, axis: str) -> dict[str, Value]:
    return {taken.parameter: taken.value for taken in reading.taken if taken.axis == axis}


@pytest.mark.parametrize("form", FORMS, ids=lambda form: "-".join(map(repr, form)))
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_no_wrong_value(case: Case, form: tuple[str, str, str]) -> None:
    archive, data = file_of(case, form)
    reading = read_values([archive], case.axes, places=case.places)
    for axis, expected in case.values.items():
        assert values_of(reading, axis) == pytest.approx(expected, rel=1e-12)
    assert archive.text.encode(archive.encoding) == data


@pytest.mark.parametrize("form", FORMS, ids=lambda form: "-".join(map(repr, form)))
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_what_was_read_is_written_back_as_it_stands(case: Case, form: tuple[str, str, str]) -> None:
    archive, data = file_of(case, form)
    reading = read_values([archive], case.axes, places=case.places)
    same = change_files(
        [archive], case.axes, {axis: values_of(reading, axis) for axis in case.axes}, places=case.places
    )
    assert same.contents == {}
    new = change_files(
        [archive], case.axes, {axis: case.wanted if axis == "X" else {} for axis in case.axes}, places=case.places
    )
    old_text, new_text = case.change
    encoding = form[0]
    expected = data.replace(old_text.encode(encoding), new_text.encode(encoding))
    if "drive.k_ffw" in case.wanted:
        expected = expected.replace("[0,AX1]=.95".encode(encoding), "[0,AX1]=0.9".encode(encoding))
    assert expected != data
    assert new.contents == {case.name: expected}
    again = read_values([parse_file(case.name, expected)], case.axes, places=case.places)
    for parameter, value in case.wanted.items():
        assert values_of(again, "X")[parameter] == pytest.approx(value, rel=1e-9)


@pytest.mark.parametrize(
    ("case", "axis", "number", "reason"),
    [
        (CASES[0], "X", "MD32300", "no number"),
        (CASES[0], "X", "MD32450", "below an IF"),
        (CASES[1], "Z", "p1462", "no number"),
        (CASES[2], "X", "P-AXIS-00103", "no number"),
        (CASES[3], "X", "p1462", "no number"),
        (CASES[4], "Z", "BACKLASH", "COMP_FILE takes its place"),
    ],
)
def test_what_is_left_open_is_refused(case: Case, axis: str, number: str, reason: str) -> None:
    archive, _ = file_of(case, FORMS[0])
    reading = read_values([archive], case.axes, places=case.places)
    refused = {(item.axis, item.name.number): item.reason for item in reading.refused}
    assert reason in refused[axis, number]


@pytest.mark.parametrize(
    "line",
    [
        "$ma_posctrl_gain[0,ax1]=3",
        "N32610 $MA_VELO_FFW_WEIGHT[0,AX1]=1 N32200 $MA_POSCTRL_GAIN[0,AX1]=3",
        "N32200 $MA_POSCTRL_GAIN[AX1]=REP(3)",
    ],
)
def test_a_second_value_in_any_form_is_seen(line: str) -> None:
    """The last one holds in a control; whoever reads the first one alone takes a wrong value."""
    text = f"N32200 $MA_POSCTRL_GAIN[0,AX1]=5\n{line}\n"
    (refused,) = [
        item
        for item in read_values([parse_file("nc.tea", text.encode())], {"X": "AX1"}).refused
        if item.name.number == "MD32200"
    ]
    assert "several values" in refused.reason


def test_a_comparison_is_no_value() -> None:
    text = "IF $MA_POSCTRL_GAIN[0,AX1]==5\nN32200 $MA_POSCTRL_GAIN[0,AX1]=3\nENDIF\nN32300 $MA_MAX_AX_ACCEL[AX1]=2\n"
    reading = read_values([parse_file("nc.tea", text.encode())], {"X": "AX1"})
    assert values_of(reading, "X") == {"max_acceleration": 2.0}
    assert [item.reason for item in reading.refused if item.name.number == "MD32200"] == ["below an IF"]


DATA = "N32200 $MA_POSCTRL_GAIN[0,AX1]=5\nN32300 $MA_MAX_AX_ACCEL[0,AX1]=6\n"
ASSIGNED = "N10 IF R1==7\nN20 $MA_MAX_AX_ACCEL[0,AX1]=4\nENDIF\n$MA_BACKLASH[0,AX1]=0.5\nRET\n"


@pytest.mark.parametrize(
    ("archive", "program"),
    [
        (
            "%_N_NC_TEA\n;$PATH=/_N_NC_ACT_DIR\n{data}M17\n%_N_SLOW_SPF\n;$PATH=/_N_CMA_DIR\nPROC SLOW\n{program}",
            "_N_SLOW_SPF",
        ),
        ("%_N_SLOW_SPF\n{program}M17\n%_N_INITIAL_INI\n{data}M17\n", "_N_SLOW_SPF"),
        ("%_N_PART_MPF\n;$PATH=/_N_WKS_DIR/_N_PART_WPD\n{program}M30\n%_N_AX_TEA\n{data}", "_N_PART_MPF"),
        ("%_N_MGUD_DEF\n{program}M17\n% _N_AX_TEA ; data\n{data}", "_N_MGUD_DEF"),
        ("{data};$PATH=/_N_CST_DIR/_N_CYCLE_SPF\n{program}", "_N_CYCLE_SPF"),
        ("{data}PROC SLOW(INT A)\n{program}", "SLOW"),
        ("%MPF12\n{program}M30\n%_N_AX_TEA\n{data}", "%MPF12"),
        ("\x02_N_AX_TEA\x00\n{data}\x00\x01/_N_CUS_DIR/\\CUS.DIR\\SLOW.SPF\x00\n{program}", "SLOW.SPF"),
        ("\x02\\CMA.DIR\\_N_SLOW_SPF\x00\n{program}RET\x00\x03_N_AX_TEA\x00\n{data}", "SLOW.SPF"),
        ("%_N_NC_TEA\n{data}%_N_NOTES_TXT\n{program}", "_N_NOTES_TXT"),
    ],
)  # fmt: skip
def test_what_programs_set_is_no_value_of_an_archive(archive: str, program: str) -> None:
    """Values of the machine data are taken all the same, and what only a program sets is refused with that reason."""
    text = archive.format(data=DATA, program=ASSIGNED)
    reading = read_values([parse_file("a.arc", text.encode())], {"X": "AX1"}, checked=["all"])
    assert values_of(reading, "X") == {"drive.K_v": pytest.approx(5000 / 60), "max_acceleration": 6.0}
    refused = {item.name.number: item.reason for item in reading.refused}
    assert refused["MD32450"] == f"only the program {program} sets it, when it runs"
    assert any(note.code == "value-set-by-programs" and "MD32300" in note.text for note in reading.notes)


def test_a_condition_that_only_a_program_sets_is_missing() -> None:
    text = "%_N_AX_TEA\nN32610 $MA_VELO_FFW_WEIGHT[0,AX1]=0.9\n%_N_A_SPF\n$MA_FFW_MODE[AX1]=3\n"
    refused = {
        item.name.number: item.reason
        for item in read_values([parse_file("a.arc", text.encode())], {"X": "AX1"}).refused
    }
    assert refused["MD32610"].endswith("only the program _N_A_SPF sets it, when it runs")


@pytest.mark.parametrize("name", ["slow.spf", "PART.MPF"])
def test_a_program_by_itself_holds_no_machine_data(name: str) -> None:
    with pytest.raises(InputError, match="only programs set machine data here"):
        parse_file(name, ASSIGNED.encode())


def test_a_value_below_an_if_is_not_taken_by_checking_units() -> None:
    text = "IF R1==1\nN32200 $MA_POSCTRL_GAIN[0,AX1]=3\nENDIF\n"
    (refused,) = read_values([parse_file("nc.tea", text.encode())], {"X": "AX1"}, checked=["all"]).refused
    assert refused.reason == "below an IF"


def test_axes_are_named_in_another_file_of_the_same_control() -> None:
    names = parse_file("nc.tea", b'N10000 $MN_AXCONF_MACHAX_NAME_TAB[1]="Y1"\n')
    data = parse_file("ax.tea", DATA.replace("AX1", "AX2").encode())
    assert values_of(read_values([names, data], {"Y": "Y1"}), "Y")["max_acceleration"] == 6.0


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("p1656[0]=1.5", None), ("p1656[0]=-1", None), ("p1656[0]=1e999", None), ("p1656[0]='H1'", 455.0),
    ],
)  # fmt: skip
def test_bits_are_those_of_a_whole_number(text: str, value: float | None) -> None:
    reading = read_values(
        [parse_file("d.tea", f"{text}\np1657=1\np1658=455\n".encode())], {"X": "X"}, places={"X": ["drive"]}
    )
    assert values_of(reading, "X").get("drive.filter_1.f") == value


def test_a_point_that_may_group_thousands_is_refused() -> None:
    table = "Parameter;Wert\np1460[0];1.250\np1462[0];12,5\np316[0];1.6\n"
    reading = read_values([parse_file("p.csv", table.encode())], {"X": "p"})
    assert values_of(reading, "X") == {"drive.K_t": pytest.approx(1.6 / 2**0.5)}
    assert {item.name.number: item.reason for item in reading.refused} == {
        "p1460": "the table has decimal commas, so that its point may group thousands", "p1462": "no number"
    }  # fmt: skip


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_the_unit_of_a_column_is_read_in_every_encoding(encoding: str) -> None:
    table = "Paramètre;Valeur;Unité\np1462[0];5;s\np316[0];1.6;Nm/A\n"
    (refused,) = read_values([parse_file("p.csv", table.encode(encoding))], {"X": "p"}).refused
    assert refused.reason == "the file has it in 's', the table of names in ms"
