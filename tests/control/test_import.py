"""Files of a SINUMERIK: what is read from them, in SI, and what is refused; values by hand."""

from __future__ import annotations

import math
from pathlib import PurePath

import pytest

from control_helpers import DRIVE, INI, NC, reasons, values
from feedsim.files.control import table
from feedsim.files.control.formats import parse_file
from feedsim.files.control.reading import read_values, usual_ranges
from feedsim.foundation.errors import InputError


def test_machine_data() -> None:
    found = read_values([parse_file("nc.tea", NC.encode())], {"X": "X1", "Y": "AX2"})
    assert values(found, "X") == {
        "drive.K_v": pytest.approx(5000 / 60),
        "drive.k_ffw": 0.95,
        "drive.symmetry_lag": False,
        "drive.T_dyn": 0.0012,
        "pitch": pytest.approx(0.005),  # two turns of the motor for one of the screw
        "max_acceleration": 2.5,
        "drive.backlash_compensation.value": pytest.approx(12e-6),
    }
    # Without feedforward weight and symmetry are those of none, whatever the file has.
    assert values(found, "Y") == {"drive.K_v": pytest.approx(1500 / 60), "drive.k_ffw": 0.0, "drive.T_sym": 0.0}
    assert reasons(found)["MD32810"].startswith("no public source that was opened states its unit; s is supposed")
    (note,) = (note for note in found.notes if note.code == "value-differs-between-sets")
    assert "MD32200 POSCTRL_GAIN" in note.text


def test_a_unit_that_was_checked() -> None:
    archive = parse_file("nc.tea", NC.encode())
    for checked in (["MD32810"], "all", ["all"]):
        found = read_values([archive], {"X": "X1"}, checked=[checked] if isinstance(checked, str) else checked)
        assert values(found, "X")["drive.T_sym"] == 0.0035
    with pytest.raises(InputError, match="MD999 is no number of the table of names"):
        read_values([archive], {"X": "X1"}, checked=["MD999"])


def test_parameters_of_a_drive() -> None:
    found = read_values([parse_file("ps.tea", DRIVE.encode())], {"X": "X"})
    assert values(found, "X") == {
        "drive.K_p": 7.5,
        "drive.T_n": pytest.approx(0.0125),
        "drive.reference_model": True,
        "drive.omega_0": pytest.approx(2 * math.pi * 120),
        "drive.D": 1.25,
        "drive.M_max": 80.0,
        "drive.filter_1.type": "second_order",
        "drive.filter_1.f": 455.0,
        "drive.filter_1.D_den": 0.9,
        "drive.filter_1.D_num": 0.1,
        "drive.filter_2.type": "low_pass",
        "drive.filter_2.f": 1999.0,
        "drive.filter_2.D_den": 0.7,
        "drive.filter_3.type": "off",
        "drive.filter_4.type": "off",
        "drive.K_t": pytest.approx(1.6 / math.sqrt(2)),
        "drive.p": 4,
    }
    assert values(found, "") == {"cycles.control": 125e-6}
    assert [f for f in found.doubts if f.code == "value-differs-between-sets" and "p1460" in f.text]


@pytest.mark.parametrize(
    ("change", "number", "reason"),
    [
        (("p1660[0]=455", "p1660[0]=450"), "p1658", "it can be taken where p1657=1 or p1660=p1658"),
        (("p1657[0]=2", "p1657[0]=5"), "p1657", "5 is none of 1 (low_pass), 2 (second_order)"),
        (("p1521[0]=-80", "p1521[0]=-60"), "p1520", "it can be taken where p1521=-p1520"),
        (("p115[1]=125", "p115[1]=250"), "p115", "it can be taken where p115[1]=p115"),
        (("p1460[0]=7.5", "p1460[0]=7,5"), "p1460", "no number"),
        (("p1460[0]=7.5", 'p1460[0]="7.5"'), "p1460", "no number"),
        (("p1460[0]=7.5", "p1460[0]=7.5\np1460[0]=8"), "p1460", "the files have several values"),
        (("p1460[0]=7.5\n", ""), "p1460", "the file has elements of it, but not [0]"),
        (("p1400[0]='H8029'\n", ""), "p1433", "and the file has no p1400.3"),
    ],
)
def test_values_of_a_drive_that_are_refused(change: tuple[str, str], number: str, reason: str) -> None:
    found = read_values([parse_file("ps.tea", DRIVE.replace(*change).encode())], {"X": "X"})
    assert number not in {each.name.number for each in found.taken}
    assert reason in reasons(found)[number]


@pytest.mark.parametrize(
    ("change", "number", "reason"),
    [
        (("N10240 $MN_SCALING_SYSTEM_IS_METRIC=1", "N10240 $MN_SCALING_SYSTEM_IS_METRIC=0"), "MD31030", "is inch"),
        (("CHANDATA(2)", "N10220 $MN_SCALING_USER_DEF_MASK='H0'"), "MD32200", "MD10220 is 0"),
        (("CHANDATA(2)", "N10230 $MN_SCALING_FACTORS_USER_DEF[9]=1"), "MD32200", "another unit than 1000/min"),
        (("[AX1]=FALSE", "[AX1]=TRUE"), "MD31030", "it can be taken where IS_ROT_AX=0"),
        (("N31050 $MA_DRIVE_AX_RATIO_DENOM[0,AX1]=1\n", ""), "MD31030", "and the file has no MD31050"),
        (("RATIO_DENOM[0,AX1]=1", "RATIO_DENOM[0,AX1]=0"), "MD31030", "MD31050 is 0"),
        (("N32620 $MA_FFW_MODE[AX1]=3", "N32620 $MA_FFW_MODE[AX1]=4"), "MD32610", "it can be taken where FFW_MODE=1|3"),
        (("N32620 $MA_FFW_MODE[AX1]=3\n", ""), "MD32610", "and the file has no FFW_MODE"),
        (("N32450 $MA_BACKLASH", "N32451 $MA_BACKLASH"), "MD32450", "the file has MD32451 BACKLASH"),
        (("BACKLASH[0,AX1]=0.012", "BACKLASH[0,AX1]=R5"), "MD32450", "no number"),
        (("N32200 $MA_POSCTRL_GAIN[0,AX1]=5", "IF R1==1\nN32200 $MA_POSCTRL_GAIN[0,AX1]=5\nENDIF"), "MD32200", "an IF"),
        (("POSCTRL_GAIN[1,AX1]=2.5", "POSCTRL_GAIN[0,X1]=2.5"), "MD32200", "several values: nc.tea:14 (5), nc"),
    ],
)  # fmt: skip
def test_machine_data_that_are_refused(change: tuple[str, str], number: str, reason: str) -> None:
    assert change[0] in NC
    found = read_values([parse_file("nc.tea", NC.replace(*change).encode())], {"X": "X1"})
    assert number not in {each.name.number for each in found.taken}
    assert reason in reasons(found)[number]


PULSE = """N32490 $MA_FRICT_COMP_MODE[0,AX1]=1
N32500 $MA_FRICT_COMP_ENABLE[0,AX1]=1
N32510 $MA_FRICT_COMP_ADAPT_ENABLE[0,AX1]=1
N32520 $MA_FRICT_COMP_CONST_MAX[0,AX1]=17.1
N32530 $MA_FRICT_COMP_CONST_MIN[0,AX1]=34
N32540 $MA_FRICT_COMP_TIME[0,AX1]=0.055
N32550 $MA_FRICT_COMP_ACCEL1[0,AX1]=0.02
"""


def test_a_friction_pulse() -> None:
    found = read_values([parse_file("p.tea", PULSE.encode())], {"X": "AX1"}, checked=["all"])
    assert values(found, "X") == {
        "drive.friction_pulse.amplitude": pytest.approx(17.1e-3 / 60),
        "drive.friction_pulse.amplitude_min": pytest.approx(34e-3 / 60),
        "drive.friction_pulse.time": 0.055,
        "drive.friction_pulse.adaptation": True,
        "drive.friction_pulse.acceleration_1": 0.02,
    }
    off = parse_file("p.tea", PULSE.replace("ENABLE[0,AX1]=1", "ENABLE[0,AX1]=0", 1).encode())
    assert values(read_values([off], {"X": "AX1"}), "X") == {"drive.friction_pulse.amplitude": "off"}
    neural = parse_file("p.tea", PULSE.replace("MODE[0,AX1]=1", "MODE[0,AX1]=2").encode())
    found = read_values([neural], {"X": "AX1"}, checked=["all"])
    assert values(found, "X") == {}
    assert reasons(found)["MD32520"] == "it can be taken where FRICT_COMP_MODE=1; FRICT_COMP_MODE is 2"


def test_what_the_files_do_not_have_is_assumed() -> None:
    text = NC.replace("N32620 $MA_FFW_MODE[AX1]=3\n", "").replace("N31050 $MA_DRIVE_AX_RATIO_DENOM[0,AX1]=1\n", "")
    found = read_values([parse_file("nc.tea", text.encode())], {"X": "X1"}, assume={"FFW_MODE": "1", "MD31050": "1"})
    assert values(found, "X")["drive.k_ffw"] == 0.95
    assert values(found, "X")["pitch"] == pytest.approx(0.005)


@pytest.mark.parametrize("at", range(1, 42, 3))
def test_a_record_that_cuts_a_line_takes_the_value_with_it(at: int) -> None:
    """A container has binary heads between its records; a head within a line must not leave a part of a number."""
    line = "N32200 $MA_POSCTRL_GAIN[0,AX1]=16.625"
    whole = NC.replace("N32200 $MA_POSCTRL_GAIN[0,AX1]=5\n", line[:at] + "\x00\x01head\x00\x02" + line[at:] + "\n")
    found = read_values([parse_file("a.arc", whole.encode("latin-1"))], {"X": "AX1"})
    value = values(found, "X").get("drive.K_v")
    assert value is None or value == pytest.approx(16625 / 60)
    assert values(found, "X")["max_acceleration"] == 2.5


def test_a_container_with_drives() -> None:
    """Heads run into the first line of a text, as archives have them."""
    second = DRIVE.replace("PS000003", "PS000004").replace("p1460[0]=7.5", "p1460[0]=3").replace("p1460[1]=9\n", "")
    name = "".join(f"p199[{k}]={ord(c)}\n" for k, c in enumerate("SERVO_Y"))
    heads = [f"\x00\\_NC_ACT.DIR\\_N_PS00000{n}_TEAPS00000{n}.TEA\x00\x07/_N_SYSTEM_DRV/" for n in (3, 4)]
    data = ("\x02\x00_N_INITIAL_INI\x00" + NC + heads[0] + DRIVE + heads[1] + second + name).encode("latin-1")
    archive = parse_file("all.arc", data)
    assert archive.container
    assert archive.places == {"PS000003": "", "PS000004": "SERVO_Y"}
    found = read_values([archive], {"X": "X1", "Y": "Y1"})
    assert "drive.K_p" not in values(found, "X")
    assert (found.notes[0].code, found.notes[0].remedy) == ("drive-not-known", "--drives X=PS000003")
    assert "the files have PS000003, PS000004 (SERVO_Y)" in found.notes[0].text
    found = read_values([archive], {"X": "X1", "Y": "Y1"}, places={"X": ["PS000003"], "Y": ["PS000004"]})
    assert (values(found, "X")["drive.K_p"], values(found, "Y")["drive.K_p"]) == (7.5, 3.0)
    with pytest.raises(InputError, match="no drive object or list 'PS9'; the files have PS000003, PS000004"):
        read_values([archive], {"X": "X1"}, places={"X": ["PS9"]})
    with pytest.raises(InputError, match=r"no axis 'Q'; the files have AX1 \(X1\), AX2 \(Y1\)"):
        read_values([archive], {"X": "Q"})
    named = parse_file("all.arc", data.replace(b"p199[0]=83", b"p199[0]=89").replace(b"p199[1]=69", b"p199[1]=0"))
    assert named.places["PS000004"] == "YRVO_Y"


def test_drives_of_two_units_with_the_same_numbers() -> None:
    """Each unit of drives, a slave on the bus, counts its drive objects from the start."""
    head = "\x00\\_N_PS000003_TEAPS000003.TEA/_N_BUS3_DIR/_N_SLAVE{0}_DIR/\\BUS3.DIR\\SLAVE{0}.DIR\\"
    other = DRIVE.replace("p1460[0]=7.5", "p1460[0]=3")
    data = (NC + head.format(3) + DRIVE + head.format(11) + other).encode("latin-1")
    archive = parse_file("all.arc", data)
    assert [*archive.places] == ["SLAVE3.PS000003", "SLAVE11.PS000003"]
    for place, gain in (("SLAVE3.PS000003", 7.5), ("SLAVE11.PS000003", 3.0)):
        assert values(read_values([archive], {"X": "X1"}, places={"X": [place]}), "X")["drive.K_p"] == gain
    with pytest.raises(InputError, match="no drive object or list 'PS000003'; the files have SLAVE3"):
        read_values([archive], {"X": "X1"}, places={"X": ["PS000003"]})
    one = parse_file("one.arc", (NC + head.format(3) + DRIVE).encode("latin-1"))
    assert values(read_values([one], {"X": "X1"}, places={"X": ["PS000003"]}), "X")["drive.K_p"] == 7.5


def test_much_that_is_not_understood_is_counted() -> None:
    archive = parse_file("nc.tea", (NC + "what is this\n" * 5000).encode())
    assert archive.odd_count == 5000
    assert len(archive.odd) == 1000


def test_words_of_bits_in_hexadecimal() -> None:
    found = read_values([parse_file("d.tea", DRIVE.replace("'H0003'", "FH").encode())], {"X": "X"})
    assert values(found, "X")["drive.filter_1.f"] == 455.0
    # Without heads a word in letters is none: the file says no more than that the cell may be one.
    assert values(read_values([parse_file("d.csv", b"p1460;EACH;5\n")], {"X": "X"}), "X") == {"drive.K_p": 5.0}


def test_a_condition_that_cannot_be_read_is_named() -> None:
    found = read_values([parse_file("d.tea", DRIVE.replace("'H0003'", "0101B").encode())], {"X": "X"})
    said = "p1656 is '0101B' in d.tea:16, which cannot be read; --assume p1656.0=1"
    assert said in reasons(found)["p1658"]
    found = read_values(
        [parse_file("d.tea", DRIVE.replace("'H0003'", "0101B").encode())], {"X": "X"}, assume={"p1656.0": "1"}
    )
    assert values(found, "X")["drive.filter_1.f"] == 455.0


def test_a_value_by_a_condition_names_the_condition() -> None:
    text = NC.replace("N32900 $MA_DYN_MATCH_ENABLE[AX1]=1", "N32900 $MA_DYN_MATCH_ENABLE[AX1]=0")
    (case,) = (each for each in read_values([parse_file("nc.tea", text.encode())], {"X": "X1"}).taken
               if each.parameter == "drive.T_dyn")  # fmt: skip
    line = text[: text.index("N32900")].count("\n") + 1
    assert (case.number, case.text, case.unit, case.value) == ("MD32900", "0", "", 0.0)
    assert case.source == f"MD32900 = 0 (nc.tea:{line}): MD32910 does not act"
    assumed = read_values([parse_file("nc.tea", NC.encode())], {"X": "X1"}, assume={"DYN_MATCH_ENABLE": "0"})
    (case,) = (each for each in assumed.taken if each.parameter == "drive.T_dyn")
    assert case.source == "DYN_MATCH_ENABLE = 0 (assumed): MD32910 does not act"


@pytest.mark.parametrize("name", ["FOO", "MD32200", "MD32620", "p1656.7", "p1460"])
def test_what_no_value_depends_on_is_not_assumed(name: str) -> None:
    with pytest.raises(InputError, match=rf"{name} is nothing that a value .* assumed of .*FFW_MODE, .*p1656\.0"):
        read_values([parse_file("nc.tea", NC.encode())], {"X": "X1"}, assume={name: "1"})


@pytest.mark.parametrize("name", ["MD10220", "SCALING_SYSTEM_IS_METRIC", "MD10230[9]", "p1656", "p115[1]", "p1521"])
def test_what_values_depend_on_is_assumed(name: str) -> None:
    read_values([parse_file("nc.tea", NC.encode())], {"X": "X1"}, assume={name: "1"})


def test_an_axis_of_the_control_is_one_axis() -> None:
    for theirs in ("X1", "x1", "AX1"):
        with pytest.raises(InputError, match=f"X=X1 and Z={theirs}: the same axis of the control, given to two axes"):
            read_values([parse_file("nc.tea", NC.encode())], {"X": "X1", "Z": theirs})


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            ("GAIN[0,AX1]=5", "GAIN[0,AX1]=500000"),
            "MD32200 POSCTRL_GAIN = 500000 (nc.tea:14) is 8.333e+06 1/s, usual is",
        ),
        (("ACCEL[0,AX1]=2.5", "ACCEL[0,AX1]=1e6"), "1e+06 m/s^2, usual is 0.01 to 100 m/s^2: check the unit"),
    ],
)
def test_values_far_outside_of_what_is_usual(change: tuple[str, str], said: str) -> None:
    assert read_values([parse_file("nc.tea", NC.encode())], {"X": "X1"}).doubts == []
    assert change[0] in NC
    (doubt,) = read_values([parse_file("nc.tea", NC.replace(*change).encode())], {"X": "X1"}).doubts
    assert doubt.code == "value-unusual"
    assert said in doubt.text


def test_usual_ranges() -> None:
    """Every number of the table of names has a range, in the unit that the table has."""
    units = {name.parameter: name.si for name in table()}
    for parameter, usual in usual_ranges().items():
        assert usual.low < usual.high
        assert usual.unit == {"1": ""}.get(units[parameter], units[parameter]), parameter
    numbers = {name.parameter for name in table() if name.si and not name.codes}
    assert numbers == {*usual_ranges()} - {"drive.p"}


def test_no_torque_is_no_limit() -> None:
    text = DRIVE.replace("p1520[0]=80", "p1520[0]=0").replace("p1521[0]=-80", "p1521[0]=0")
    assert (
        reasons(read_values([parse_file("d.tea", text.encode())], {"X": "X"}))["p1520"]
        == "a drive without torque moves nothing"
    )


def test_no_file_of_a_control() -> None:
    with pytest.raises(InputError, match=r"archives/rnd\.arc: holds no parameters"):
        parse_file("rnd.arc", b"a", PurePath("archives/rnd.arc"))
    for data in (b"", b"a,b\nc,d\n", bytes(range(256)) * 20, b"name: machine\n", b"<a></a>"):
        with pytest.raises(InputError, match="holds no parameters of a control"):
            parse_file("file", data)


def test_files_of_several_controls() -> None:
    with pytest.raises(InputError, match="files of several controls: linuxcnc, sinumerik"):
        read_values([parse_file("a", NC.encode()), parse_file("b", INI.encode())], {"X": "X1"})
