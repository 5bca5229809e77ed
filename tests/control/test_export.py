"""Values written back into a control's files: no other byte differs, and reading them again gives the values."""

from __future__ import annotations

import math
from itertools import product

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from feedsim.files.control.formats import parse_file
from feedsim.files.control.reading import Value, read_values
from feedsim.files.control.writing import change_files, number
from feedsim.foundation.errors import InputError

NC = """\ufeff; Sch\xe4rfe \xb5m, by hand\r
N10000 $MN_AXCONF_MACHAX_NAME_TAB[0]="X1"\r
N30300 $MA_IS_ROT_AX[AX1]=FALSE ; 5\r
N31030 $MA_LEADSCREW_PITCH[AX1]=10\r
N31050 $MA_DRIVE_AX_RATIO_DENOM[0,AX1]=1\r
N31060 $MA_DRIVE_AX_RATIO_NUMERA[0,AX1]=2\r
  N32200 $MA_POSCTRL_GAIN[0,AX1] = 5.00   ; =5 5.00\r
N32200 $MA_POSCTRL_GAIN[1,AX1]=5.00\r
N32200 $MA_POSCTRL_GAIN[0,AX2]=5.00\r
N32610 $MA_VELO_FFW_WEIGHT[0,AX1]=1\r
N32620 $MA_FFW_MODE[AX1]=3\r
N32300 $MA_MAX_AX_ACCEL[0,AX1]=2.5\r
N32900 $MA_DYN_MATCH_ENABLE[AX1]=0\r
N32910 $MA_DYN_MATCH_TIME[0,AX1]=0.5\r
M17\r
"""
DRIVE = """[PARAMETER]
p1400[0]='H8029'
p1433[0]=120
p1460[0]=7.5
p1460[1]=9
p1462[0]=12.5
p1520[0]=80
p1521[0]=-80
p1656[0]='H0001'
p1657[0]=2
p1658[0]=455
p1659[0]=0.9
p1660[0]=455
p1661[0]=0.1
p316[0]=1.6
p314[0]=4
"""
ENCODINGS = ("utf-8", "utf-16-le", "utf-16-be")


def written_lines(text: str, new: str) -> list[tuple[str, str]]:
    """Lines that differ."""
    pairs = list(zip(text.split("\n"), new.split("\n"), strict=True))
    return [(a, b) for a, b in pairs if a != b]


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_only_the_value_differs(encoding: str) -> None:
    archive = parse_file("nc.tea", NC.encode(encoding))
    found = change_files([archive], {"X": "X1"}, {"X": {"drive.K_v": 70.0, "drive.k_ffw": 1.0, "pitch": 0.004}})
    new = found.contents["nc.tea"].decode(encoding)
    assert written_lines(NC, new) == [
        ("N31030 $MA_LEADSCREW_PITCH[AX1]=10\r", "N31030 $MA_LEADSCREW_PITCH[AX1]=8\r"),
        (
            "  N32200 $MA_POSCTRL_GAIN[0,AX1] = 5.00   ; =5 5.00\r",
            "  N32200 $MA_POSCTRL_GAIN[0,AX1] = 4.2   ; =5 5.00\r",
        ),
    ]
    assert [(each.name.number, each.old, each.new, each.written) for each in found.changes] == [
        ("MD32200", "5.00", "4.2", True), ("MD31030", "10", "8", True)
    ]  # fmt: skip


def test_latin_text_keeps_its_bytes() -> None:
    data = NC.removeprefix("\ufeff").encode("latin-1")
    found = change_files([parse_file("nc.tea", data)], {"X": "X1"}, {"X": {"drive.K_v": 250 / 3 * 1.1}})
    assert found.contents["nc.tea"] == data.replace(b" = 5.00 ", b" = 5.5 ")


def test_nothing_differs() -> None:
    found = change_files(
        [parse_file("nc.tea", NC.encode())], {"X": "X1"}, {"X": {"drive.K_v": 5000 / 60, "drive.T_dyn": 0.0}}
    )
    assert found.contents == {}
    assert found.changes == []


def test_what_goes_together_and_what_is_a_bit() -> None:
    values: dict[str, Value] = {
        "drive.filter_1.type": "band_stop", "drive.filter_1.f": 500.0, "drive.M_max": 60.0, "drive.K_p": 8.0,
        "drive.reference_model": False, "drive.p": 4.0, "drive.K_t": 2.0,
    }  # fmt: skip
    found = change_files([parse_file("ps.tea", DRIVE.encode())], {"X": "X"}, {"X": values})
    assert written_lines(DRIVE, found.contents["ps.tea"].decode()) == [
        ("p1400[0]='H8029'", "p1400[0]='H8021'"),
        ("p1460[0]=7.5", "p1460[0]=8"),
        ("p1520[0]=80", "p1520[0]=60"),
        ("p1521[0]=-80", "p1521[0]=-60"),
        ("p1658[0]=455", "p1658[0]=500"),
        ("p1660[0]=455", "p1660[0]=500"),
        ("p316[0]=1.6", "p316[0]=2.828427125"),
    ]


@pytest.mark.parametrize(
    ("values", "number_", "reason"),
    [
        ({"drive.T_dyn": 0.001}, "MD32910", "it does not act: DYN_MATCH_ENABLE is 0"),
        ({"drive.T_sym": 0.003}, "MD32810", "the files have no such parameter"),
        ({"drive.K_p": 3.0}, "p1460", "the files have no such parameter"),
    ],
)
def test_values_to_type(values: dict[str, Value], number_: str, reason: str) -> None:
    found = change_files([parse_file("nc.tea", NC.encode())], {"X": "X1"}, {"X": values})
    assert found.contents == {}
    (change,) = found.changes
    assert (change.name.number, change.written) == (number_, False)
    assert reason in change.reason


def test_a_filter_that_is_off_in_the_control() -> None:
    text = DRIVE.replace("'H0001'", "'H0000'")
    found = change_files(
        [parse_file("ps.tea", text.encode())], {"X": "X"}, {"X": {"drive.filter_1.type": "second_order"}}
    )
    assert found.contents == {}
    assert [each.name.number for each in found.changes] == ["p1656.0", "p1657"]
    assert "it does not act: p1656 is 'H0000'" in found.changes[1].reason


@pytest.mark.parametrize(("word", "old"), [("p1656[0]='H0000'\n", "0"), ("", "")])
def test_the_bit_of_a_filter_that_is_to_be_typed(word: str, old: str) -> None:
    """A filter that the files do not have is typed whole: its bit, its type, and both frequencies."""
    text = f"p1460[0]=7.5\n{word}"
    values: dict[str, Value] = {"drive.filter_1.type": "band_stop", "drive.filter_1.f": 455.0,
                                "drive.filter_1.D_den": 0.9, "drive.filter_1.D_num": 0.1,
                                "drive.filter_2.type": "off"}  # fmt: skip
    found = change_files([parse_file("ps.tea", text.encode())], {"X": "X"}, {"X": values})
    assert found.contents == {}
    typed = {each.name.number: each for each in found.changes}
    assert {number: each.new for number, each in typed.items()} == {
        "p1656.0": "1", "p1657": "2", "p1658": "455", "p1659": "0.9", "p1661": "0.1"
    }  # fmt: skip
    assert typed["p1656.0"].old == old
    assert "p1660 is to be 455 as well" in typed["p1658"].reason


def test_a_word_of_bits_keeps_its_form() -> None:
    text = DRIVE.replace("'H8029'", "8029H")
    found = change_files([parse_file("ps.tea", text.encode())], {"X": "X"}, {"X": {"drive.reference_model": False}})
    assert found.contents["ps.tea"].decode() == text.replace("8029H", "8021H")


def test_checksums_and_containers_are_not_written() -> None:
    line = "N32200 $MA_POSCTRL_GAIN[0,AX1]=5 '2C3D'\n"
    found = change_files([parse_file("nc.tea", line.encode())], {"X": "AX1"}, {"X": {"drive.K_v": 50.0}})
    assert found.contents == {}
    assert "the line has a checksum" in found.changes[0].reason
    found = change_files([parse_file("a.arc", b"\x00\x01head\n" + line[:-8].encode() + b"\n")], {"X": "AX1"},
                    {"X": {"drive.K_v": 50.0}})  # fmt: skip
    assert found.contents == {}
    assert "a container" in found.changes[0].reason


def test_every_equal_place_is_written() -> None:
    text = "CHANDATA(1)\nN32200 $MA_POSCTRL_GAIN[0,AX1]=5\nCHANDATA(2)\nN32200 $MA_POSCTRL_GAIN[0,AX1]=5\n"
    found = change_files([parse_file("nc.tea", text.encode())], {"X": "AX1"}, {"X": {"drive.K_v": 50.0}})
    assert found.contents["nc.tea"].decode() == text.replace("=5", "=3")


def test_two_axes_on_one_list_that_differ() -> None:
    archive = parse_file("ps.tea", DRIVE.encode())
    with pytest.raises(InputError, match="p1460 is to be 3 and 4, by two axes or two parameters"):
        change_files([archive], {"X": "X", "Y": "Y"}, {"X": {"drive.K_p": 3.0}, "Y": {"drive.K_p": 4.0}},
                places={"X": ["drive"], "Y": ["drive"]})  # fmt: skip


def test_a_list_of_whole_numbers() -> None:
    text = "getriebe[0].kv   5000   # gain\n"
    found = change_files([parse_file("x.lis", text.encode())], {"X": "X"}, {"X": {"drive.K_v": 60.0}})
    assert found.contents["x.lis"].decode() == text.replace("5000", "6000")
    found = change_files([parse_file("x.lis", text.encode())], {"X": "X"}, {"X": {"drive.K_v": 60.001}})
    assert found.contents == {}
    assert "whole numbers" in found.changes[0].reason


def test_inches() -> None:
    text = "[TRAJ]\nLINEAR_UNITS = inch\n[JOINT_0]\nMAX_VELOCITY = 10 # inch/s\n"
    found = change_files([parse_file("m.ini", text.encode())], {"X": "JOINT_0"}, {"X": {"max_speed": 0.508}})
    assert found.contents["m.ini"].decode() == text.replace("= 10", "= 20")


positive = st.floats(1e-4, 1e4, allow_nan=False)
RANDOM = st.fixed_dictionaries(
    {
        "drive.K_v": positive, "drive.K_p": positive, "drive.T_n": st.floats(1e-4, 10), "max_acceleration": positive,
        "drive.k_ffw": st.floats(0, 2), "pitch": st.floats(1e-4, 1), "drive.M_max": positive, "drive.K_t": positive,
        "drive.omega_0": positive, "drive.filter_1.f": positive, "drive.filter_1.D_den": positive,
        "drive.filter_1.D_num": st.floats(0, 10), "drive.reference_model": st.booleans(),
        "drive.symmetry_lag": st.booleans(), "drive.p": st.integers(1, 50).map(float),
        "drive.filter_1.type": st.sampled_from(["second_order", "band_stop"]),
    }
)  # fmt: skip


@settings(max_examples=60)
@given(RANDOM, st.sampled_from(ENCODINGS))
def test_writing_and_reading_is_the_identity(values: dict[str, Value], encoding: str) -> None:
    files = [parse_file("nc.tea", NC.encode(encoding)), parse_file("ps.tea", DRIVE.encode())]
    found = change_files(files, {"X": "X1"}, {"X": values})
    made = [parse_file(each.name, found.contents.get(each.name, each.text.encode(each.encoding))) for each in files]
    now = {each.parameter: each.value for each in read_values(made, {"X": "X1"}).taken}
    for parameter, value in values.items():
        if parameter == "drive.filter_1.type":
            assert now[parameter] == "second_order"
        elif isinstance(value, bool):
            assert now[parameter] == value
        elif parameter == "drive.omega_0" and not values["drive.reference_model"]:
            assert parameter not in now  # it does not act
        else:
            assert math.isclose(float(now[parameter]), float(value), rel_tol=1e-9, abs_tol=1e-300)
    for before, after in zip(files, made, strict=True):
        spans = zip(before.entries, after.entries, strict=True)
        cut = [(a.span, b.span) for a, b in spans]
        assert outside(before.text, [a for a, _ in cut]) == outside(after.text, [b for _, b in cut])
    # A second export changes nothing.
    assert change_files(made, {"X": "X1"}, {"X": values}).contents == {}


def outside(text: str, spans: list[tuple[int, int]]) -> str:
    """What stands between the values."""
    ends = [0, *(end for _, end in spans)]
    return "|".join(text[a:b] for a, b in zip(ends, [*(start for start, _ in spans), len(text)], strict=True))


@pytest.mark.parametrize(("value", "text"), [(4.2, "4.2"), (0.0, "0"), (-80.0, "-80"), (1e-7, "0.0000001"),
                                             (1e6, "1000000"), (0.1 + 0.2, "0.3")])  # fmt: skip
def test_numbers(value: float, text: str) -> None:
    assert number(value) == text


def test_numbers_are_near() -> None:
    for k, e in product(range(1, 60), range(-9, 9)):
        value = math.pi * k * 10.0**e
        assert math.isclose(float(number(value)), value, rel_tol=1e-9)
        assert "e" not in number(value)
