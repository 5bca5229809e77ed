"""Text files of oscilloscopes in controls: the layouts that TwinCAT Scope and halscope write, and rows of units."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from feedsim.estimation.identify import read_records
from feedsim.files.trace import convert, read_csv, read_recording
from feedsim.files.trace.recording import Recording
from feedsim.foundation.errors import InputError

PROJECT = [
    "Name\tScope Project\t",
    "File\tD:\\autosave\\axis.csv\t",
    "Starttime of export\t133238090039920000\tMontag, 20. März 2023\t19:03:23.992",
    "Endtime of export\t133238090060450000\tMontag, 20. März 2023\t19:03:26.045",
    "",
]


def head(**rows: list[str]) -> list[str]:
    """Rows of a header; each channel has its key ahead, as with a column of time for every channel."""
    return ["\t".join(f"{key}\t{cell}" for cell in cells) for key, cells in rows.items()]


def read(folder: Path, text: str, encoding: str = "utf-8") -> Recording:
    path = folder / "scope.csv"
    path.write_text(text, encoding=encoding)
    return read_recording(path)


FULL = [
    *PROJECT,
    *head(Name=["ActPos", "ActTorque"], SymbolComment=["", " of the drive"]),
    "Data-Type\tREAL64\tData-Type\tREAL64",
    "SampleTime[ms]\t2\tSampleTime[ms]\t2",
    "SymbolName\tAxes.X.ActPos\tSymbolName\tAxes.X.ActTorque",
    "Offset\t0\tOffset\t0",
    "ScaleFactor\t1\tScaleFactor\t1",
    "Unit\tmm\tUnit\t(None)",
    "",
]


COMMAS = ["Name,Project", "Starttime of export,133238090039920000", "", "Name,Pos", "SampleTime[ms],1", ""]


def test_twincat_with_quoted_decimal_commas(tmp_path: Path) -> None:
    found = read(tmp_path, "\n".join([*COMMAS, '"0,0","1,5"', '"1,0","2,5"', '"2,0","3,5"']))
    assert found.read(["time", "Pos"])["Pos"].tolist() == [1.5, 2.5, 3.5]


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252", "utf-16"])
def test_twincat_with_a_time_for_every_channel(tmp_path: Path, encoding: str) -> None:
    rows = [f"{2 * k}\t{0.5 * k:.3f}\t{2 * k}\t{-1.25 * k:.3f}".replace(".", ",") for k in range(6)]
    found = read(tmp_path, "\n".join([*FULL, *rows, "EOF"]), encoding)
    assert found.names == ("time", "ActPos", "ActTorque")
    assert dict(found.units) == {"time": "s", "ActPos": "mm", "ActTorque": ""}
    values = found.read(found.names)
    np.testing.assert_allclose(values["time"], 0.002 * np.arange(6), rtol=1e-15)
    np.testing.assert_allclose(values["ActPos"], 0.5 * np.arange(6))
    np.testing.assert_allclose(values["ActTorque"], -1.25 * np.arange(6))
    assert found.notes == ()


def test_twincat_with_a_time_for_every_sampling_time(tmp_path: Path) -> None:
    """Commas between columns, dates in 100 ns, a slower group whose cells are empty in between."""
    lines = [
        "Name,Project", "File,a.csv", "Starttime of export,133238090039920000", "",
        "Name,Pos,Speed,Name,Temp[1]", "SampleTime[ms],1,1,SampleTime[ms],3", "ScaleFactor,1,1,ScaleFactor,0.1", "",
    ]  # fmt: skip
    for k in range(9):
        slow = f"{133238090039920000 + 30000 * (k // 3)},{20 + k}" if k % 3 == 0 else ","
        lines.append(f"{133238090039920000 + 10000 * k},{0.25 * k},{k},{slow}")
    found = read(tmp_path, "\n".join(lines))
    assert found.names == ("time", "Pos", "Speed", "Temp(1)")
    values = found.read(found.names)
    # Ticks of 100 ns since 1601 have 18 digits, a double 16: 32 of them are lost in a date, 3 us.
    np.testing.assert_allclose(values["time"], 0.001 * np.arange(9), atol=4e-6)
    np.testing.assert_array_equal(values["Temp(1)"], [20, 20, 20, 23, 23, 23, 26, 26, 26])
    assert [note.code for note in found.notes] == ["channel-resampled", "scale-unclear"]
    assert all("Temp(1)" in note.text for note in found.notes)


def test_twincat_of_the_second_version(tmp_path: Path) -> None:
    """With StartRecord in its head, and flags as words."""
    lines = [
        "Name\tScope01", "File", "StartRecord\t128783093223690000", "EndRecord\t128783093339880000", "",
        *head(Name=["DREIECK", "On"], NetId=["172.16.8.205.1.1"] * 2, Port=["801"] * 2), "",
        "0\t-1,03799391\t0\tTRUE", "1\t-1,03599393\t1\tFALSE", "2\t-1,033994\t2\tTRUE",
    ]  # fmt: skip
    values = read(tmp_path, "\n".join(lines)).read(["time", "DREIECK", "On"])
    assert values["DREIECK"].tolist() == [-1.03799391, -1.03599393, -1.033994]
    assert values["On"].tolist() == [1.0, 0.0, 1.0]


def test_twincat_for_identification(tmp_path: Path) -> None:
    """Known names, and a mapping only where the unit is missing."""
    t = 0.002 * np.arange(1500)
    x, torque = 20 * np.sin(6 * t), 2 * np.sign(np.cos(6 * t)) - 0.4 * np.sin(6 * t)
    lines = [line.replace("(None)", "N.m") for line in FULL]
    rows = [f"{2 * k}\t{x[k]:.6f}\t{2 * k}\t{torque[k]:.6f}".replace(".", ",") for k in range(1500)]
    read(tmp_path, "\n".join([*lines, *rows]))
    from feedsim.files.columns import load_columns

    mapping = tmp_path / "columns.yaml"
    mapping.write_text("axis: X\npitch: 10 mm\nposition: {column: ActPos}\ntorque: {column: ActTorque}\n")
    (record,) = read_records(tmp_path / "scope.csv", load_columns(mapping)).records
    assert record.angle is not None
    np.testing.assert_allclose(record.angle, 2 * np.pi * x / 10, atol=1e-6)
    np.testing.assert_allclose(record.torque, torque, atol=1e-6)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (FULL, "a TwinCAT Scope header without a row of values below it"),
        ([*FULL, "0\t1\t0\tx", "2\t1\t2\t1"], "scope.csv:15: 'x' in 'ActTorque' is no number"),
        ([*FULL, "0\t1\t2"], "export it with a column of time"),
        ([*FULL, "0\t1\t0\t1"], "1 rows of values; at least 2"),
        ([*[line for line in FULL if not line.startswith("Name")], "0\t1\t0\t1"], "without the names of its channels"),
        ([*PROJECT, *FULL[7:], "0\t1\t0\t1", "2\t1\t2\t1"], "without the names of its channels"),
        ([*FULL, "0\t1\t0\t1", "2\t1\t2\t1\t7"], "scope.csv:16: 5 values below 4 columns of the header"),
        ([*FULL, "0\t1\t0\t1", "2\t1\t2", "4\t1\t4\t1"], "scope.csv:16: no value of 'ActTorque' beside its time"),
        ([*FULL, "0\t1\t0\t1", "4\t1\t2\t1", "2\t1\t4\t1"], "scope.csv:17: the time 2 follows 4; it must increase"),
        (
            [*COMMAS, "0,0,1,5", "1,0,2,5"],
            "4 values below 2 columns of the header; with commas between columns, numbers ",
        ),
        ([*COMMAS, "0,1", "1,2", *COMMAS, "0,1"], "'Name' in 'the time' is no number"),
    ],
)
def test_twincat_files_that_are_refused(tmp_path: Path, lines: list[str], message: str) -> None:
    with pytest.raises(InputError) as caught:
        read(tmp_path, "\n".join(lines))
    assert message in str(caught.value)


def test_halscope(tmp_path: Path) -> None:
    lines = ["Sampling period is 1000000 ns ", ""]
    lines += [f"joint.0.motor-pos-fb {0.5 * k:+.14f} joint.0.motor-pos-cmd {0.75 * k:+.14f} " for k in range(5)]
    lines.append(f"joint.0.motor-pos-fb {9e9:+.14f} joint.0.motor-pos-cmd {9e9:+.14f} ")  # beyond the buffer
    found = read(tmp_path, "\n".join(lines))
    values = found.read(found.names)
    assert found.names == ("time", "joint.0.motor-pos-fb", "joint.0.motor-pos-cmd")
    np.testing.assert_allclose(values["time"], 1e-3 * np.arange(5), rtol=1e-15)
    assert values["joint.0.motor-pos-fb"].tolist() == [0, 0.5, 1, 1.5, 2]
    assert "rows-left-out" in [note.code for note in found.notes]
    convert(tmp_path / "scope.csv", [], tmp_path / "out.csv")
    assert read_csv(tmp_path / "out.csv").names == found.names[1:]


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["Sampling period is 0 ns", "a 1", "a 2", "a 3"], "scope.csv:1: "),
        (["Sampling period is 5 ns", "a 1", "b 2", "a 3"], "scope.csv:3: holds b, the first row a"),
        (["Sampling period is 5 ns", "a 1", "a x", "a 3", "a 4"], "scope.csv:3: 'x' is no number"),
        (["Sampling period is 5 ns", "a 1"], "1 rows of samples"),
        (["Sampling period is 5 ns", "a 1", "a 1,5", "a 3", "a 4"], "scope.csv:3: '1,5' is no number"),
        ([f"Sampling period is {10**400} ns", "a 1", "a 2", "a 3", "a 4"], "of up to 12 digits"),
    ],
)
def test_halscope_files_that_are_refused(tmp_path: Path, lines: list[str], message: str) -> None:
    with pytest.raises(InputError) as caught:
        read(tmp_path, "\n".join(lines))
    assert message in str(caught.value)


@pytest.mark.parametrize("unit", ["ns", "nSec"])
@pytest.mark.parametrize("comma", [False, True])
def test_halscope_up_to_2_8(tmp_path: Path, unit: str, comma: bool) -> None:
    """Of every locale; one row more than recorded at the end."""
    rows = [f"a.in {0.5 * k:+.14f} b {-0.25 * k:+.14f} " for k in range(6)]
    text = "\n".join([f"Sampling period is 2000000 {unit} ", "", *rows])
    found = read(tmp_path, re.sub(r"(?<=\d)\.(?=\d{14})", ",", text) if comma else text)
    values = found.read(found.names)
    assert found.names == ("time", "a.in", "b")
    np.testing.assert_allclose(values["time"], 0.002 * np.arange(5), rtol=1e-15)
    assert values["b"].tolist() == [0, -0.25, -0.5, -0.75, -1]


@pytest.mark.parametrize(
    "between", [[], ["# Position: 0.500000;0.500000", "# Scale: 0;3"]], ids=["2.9", "with scales of the display"]
)
@pytest.mark.parametrize("names", [("a.in", "b"), ("a.in",)])
def test_halscope_from_2_9_on(tmp_path: Path, between: list[str], names: tuple[str, ...]) -> None:
    """Labels ahead of the values, which are as many as recorded; one channel alone has no separator."""
    rows = [";".join(f"{0.5 * k + j:.14f}" for j in range(len(names))) for k in range(5)]
    found = read(tmp_path, "\n".join(["# Sampling period is 1000000 ns", ";".join(names), *between, *rows]) + "\n")
    values = found.read(found.names)
    assert found.names == ("time", *names)
    assert found.notes == ()
    np.testing.assert_allclose(values["time"], 1e-3 * np.arange(5), rtol=1e-15)
    assert values[names[-1]].tolist() == [0.5 * k + len(names) - 1 for k in range(5)]
    convert(tmp_path / "scope.csv", [], tmp_path / "out.csv")
    assert read_csv(tmp_path / "out.csv").names == names


# --- clocks ---

DATE = 133238090039920000  # in 100 ns


def two_channels(begins: tuple[float, float], step: tuple[float, float], *, dates: bool = False, rows: int = 40) -> str:
    """A position that is the file's time in ms, a torque that is the time in s, from their begin on [ms]."""
    lines = []
    for k in range(rows):
        times = [begin + own * k for begin, own in zip(begins, step, strict=True)]
        cells = [f"{DATE + round(1e4 * time)}" if dates else f"{time:g}" for time in times]
        lines.append(f"{cells[0]}\t{times[0]:.9g}\t{cells[1]}\t{1e-3 * times[1]:.9g}")
    return "\n".join([*FULL, *lines])


@pytest.mark.parametrize("dates", [False, True])
@pytest.mark.parametrize(
    ("begins", "step"),
    [
        ((0, -6), (2, 2)),
        ((0, 6), (2, 2)),
        ((-6, 0), (2, 2)),
        ((0, 3), (2, 2)),  # between the other's instants
        ((0, 0.5), (2, 4)),
        ((5000, 4993), (1, 1)),
    ],
)
def test_channels_that_begin_apart_have_one_clock(
    tmp_path: Path, begins: tuple[float, float], step: tuple[float, float], dates: bool
) -> None:
    found = read(tmp_path, two_channels(begins, step, dates=dates))
    values = found.read(found.names)
    time, position, torque = (values[name] for name in ("time", "ActPos", "ActTorque"))
    np.testing.assert_allclose(torque, 1e-3 * position, rtol=0, atol=1e-9)
    np.testing.assert_allclose(np.diff(position), 1e3 * np.diff(time), rtol=0, atol=1e-6)
    assert position[0] >= max(begins) - 1e-6
    assert position[-1] <= min(b + s * 39 for b, s in zip(begins, step, strict=True)) + 1e-6
    assert len(time) > 10
    assert "rows-left-out" in [note.code for note in found.notes]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (two_channels((0, 500), (2, 2)), "no time in common: ActPos 0 to 0.078 s, ActTorque 0.5 to 0.578 s"),
        ("\n".join([*FULL, f"0\t1\t{DATE}\t1", f"2\t1\t{DATE + 20000}\t1"]), "counts from another instant"),
    ],
)
def test_channels_without_a_time_in_common_are_refused(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read(tmp_path, text)


def test_a_flag_between_two_instants_is_not_interpolated(tmp_path: Path) -> None:
    lines = [f"{2 * k}\t{k}\t{2 * k + 1}\t{int(k > 5)}" for k in range(12)]
    values = read(tmp_path, "\n".join([*FULL, *lines])).read(["ActTorque"])
    assert set(values["ActTorque"]) == {0.0, 1.0}


@pytest.mark.parametrize(
    ("text", "units"),
    [
        ("Time;Actual position;Flag\nms;mm;-\n0;1,5;0\n1;2,5;1\n", {"Time": "ms", "Actual position": "mm", "Flag": ""}),
        ("log of X\nx\n\nt,pos [1],n\n[s],[um],[rpm]\n0,1,2\n1,2,3\n", {"t": "s", "pos (1)": "um", "n": "rpm"}),
    ],
)
def test_a_row_of_names_above_a_row_of_units(tmp_path: Path, text: str, units: dict[str, str]) -> None:
    found = read(tmp_path, text)
    assert dict(found.units) == units
    assert all(len(values) == 2 for values in found.read(found.names).values())


def test_one_row_of_names_is_none_of_units(tmp_path: Path) -> None:
    """Names that are units as well, below a remark."""
    found = read(tmp_path, "A,remark\nt,m\n0,1\n1,2\n")
    assert found.names == ("t", "m")
