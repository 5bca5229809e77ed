"""Tables, lists and files of other controls; cells, and bytes of any kind; values by hand."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from control_helpers import DRIVE, INI, NC, TABLE, reasons, values
from feedsim.files.control.archive import scalar
from feedsim.files.control.formats import parse_file
from feedsim.files.control.reading import read_values
from feedsim.foundation.errors import InputError


def test_tables() -> None:
    found = read_values(
        [parse_file("list.csv", TABLE.replace("S-0-0100;nothing\n", "").encode("utf-8-sig"))], {"X": "X"}
    )
    assert values(found, "X") == {"drive.K_p": 7.5, "drive.current.K_p": 10.4}  # the file states the unit of p1715
    assert reasons(found)["p1462"] == "no number"  # 12,5 may be two numbers
    assert reasons(found)["p1520"] == "the file has it in 'mNm', the table of names in N.m"
    idn = "IDN,Text,Value\nS-0-0100,Velocity loop gain,0.6\nS-0-0296,Feedforward,95\nP-AXIS-00099,kv,5000\n"
    found = read_values([parse_file("ax.csv", idn.encode("utf-16"))], {"X": "X"})
    assert values(found, "X") == {"drive.k_ffw": pytest.approx(0.95), "drive.K_v": 50.0}
    assert "no public source" in reasons(found)["S-0-0100"]  # N.m.s/rad or A.s/rad, by a bit of another parameter
    unsure = parse_file("ax.csv", b"S-0-0100,0.6,0.7\nS-0-0101,5\n")
    assert [each.reason for each in unsure.odd] == ["which cell is the value is not known"]


def test_a_list_of_twincat_cnc() -> None:
    text = (
        "# X axis\nkopf.log_achs_name   X_Achse\ngetriebe[0].kv   5000   # 0.01/s\ngetriebe[1].kv  100\n"
        "getriebe[0].dynamik.vb_max 500000\ngetriebe[0].dynamik.a_max 14400\ngetriebe[0].lose 120\nodd\n"
    )
    found = read_values([parse_file("x.lis", text.encode())], {"X": "X_Achse"})
    assert values(found, "X") == {
        "drive.K_v": 50.0,
        "max_speed": pytest.approx(0.5),
        "max_acceleration": pytest.approx(14.4),
        "drive.backlash_compensation.value": pytest.approx(12e-6),
    }
    (doubt,) = found.doubts
    assert (doubt.code, doubt.place) == ("value-differs-between-sets", "X")
    assert "P-AXIS-00099 getriebe[i].kv" in doubt.text


def test_an_xti_of_twincat_nc() -> None:
    text = (
        '<?xml version="1.0"?>\n<TcSmItem><!-- <Velo Maximum="9"/> --><Axis Id="1"><Name>X</Name><AxisPara>\n'
        "<Dynamic AccelerationMaximum=\"1500\"/><Velo Maximum='250'/></AxisPara></Axis></TcSmItem>"
    )
    archive = parse_file("axis.xti", text.encode())
    assert values(read_values([archive], {"X": "X"}), "X") == {}
    found = read_values([archive], {"X": "X"}, checked=["Velo@Maximum", "Dynamic@AccelerationMaximum"])
    assert values(found, "X") == {"max_speed": 0.25, "max_acceleration": 1.5}


def test_linuxcnc() -> None:
    found = read_values([parse_file("mill.ini", INI.encode())], {"X": "X", "Z": "JOINT_1"})
    assert values(found, "X") == {
        "max_speed": pytest.approx(0.254),
        "max_acceleration": pytest.approx(2.54),
        "travel.0": 0.0,
        "travel.1": pytest.approx(0.508),
        "drive.backlash_compensation.value": pytest.approx(25.4e-6),
    }
    assert values(found, "Z") == {"max_speed": pytest.approx(0.2)}
    assert values(found, "") == {"cycles.position": 0.001}
    assert "its wiring is in the HAL file" in reasons(found)["pid.Pgain"]
    assert reasons(found)["BACKLASH"] == "COMP_FILE takes its place"
    found = read_values([parse_file("mill.ini", INI.replace("TYPE = LINEAR", "TYPE = ANGULAR").encode())], {"X": "X"})
    assert values(found, "X") == {}
    found = read_values([parse_file("mill.ini", INI.replace("= inch", "= furlong").encode())], {"X": "X"})
    assert values(found, "X") == {}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("5", 5.0), ("-.5", -0.5), ("5.", 5.0), ("1e-3", 1e-3), ("1.5EX-3", 1.5e-3), ("+2", 2.0), ("TRUE", True),
        ("false", False), ("'H8029'", 0x8029), ("1H", 1.0), ("fH", 15.0), ("8029H", 0x8029), ("'B101'", 5.0),
        ('"X1"', "X1"), ("#x0000ffff", 65535.0),
    ],
)  # fmt: skip
def test_scalars(text: str, value: object) -> None:
    assert scalar(text) == value


@pytest.mark.parametrize(
    "text", ["", "5,0", "5 6", "(1,2)", "R5", "nan", "inf", "0x10", "'H'", "--5", "1e", "5'", "0101B", "GH", "H"]
)
def test_no_scalars(text: str) -> None:
    with pytest.raises(ValueError, match=r"no number|invalid literal"):
        scalar(text)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_a_byte_order_mark_is_of_no_line(encoding: str) -> None:
    archive = parse_file("d.tea", "p1460[0]=5\np1462[0]=10\n".encode(encoding))
    assert values(read_values([archive], {"X": "X"}), "X") == {"drive.K_p": 5.0, "drive.T_n": 0.01}
    assert [archive.text[slice(*each.span)] for each in archive.entries] == ["5", "10"]
    assert parse_file("d.tea", "; gain\np1460=5\n".encode(encoding)).odd == []


SEEDS = [NC, DRIVE, TABLE, INI, 'getriebe[0].kv 5\n<TcSmItem><Axis><Velo Maximum="3"/></Axis>', "p1460[0]=1\n"]


@settings(max_examples=300)
@given(st.data())
def test_no_bytes_end_in_anything_but_a_sentence(data: st.DataObject) -> None:
    raw = bytearray(data.draw(st.sampled_from(SEEDS)).encode())
    for _ in range(data.draw(st.integers(0, 12))):
        at = data.draw(st.integers(0, len(raw)))
        piece = data.draw(
            st.one_of(st.binary(max_size=6), st.sampled_from([b"[", b"]=", b"'H", b"\n", b"$MA_", b",AX1]"]))
        )
        raw[at : at + data.draw(st.integers(0, 8))] = piece
    try:
        archive = parse_file("file.arc", bytes(raw))
        axes = [each.axis for each in archive.entries if each.axis][:1] or ["X"]
        found = read_values([archive], {"X": axes[0]}, checked=["all"])
    except InputError:
        return
    assert all(not isinstance(each.value, float) or math.isfinite(each.value) for each in found.taken)
    assert all(archive.text[slice(*each.span)] == each.text for each in archive.entries)


@settings(max_examples=200)
@given(st.binary(max_size=300))
def test_any_bytes(data: bytes) -> None:
    try:
        parse_file("file", data)
    except InputError:
        return
    assert data
