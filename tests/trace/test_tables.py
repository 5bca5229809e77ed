"""Tables of text as tools write them: lines ahead of the header, rows of units, columns without a name, time stamps.

Every case is read as a record (`read_recording`), a trace (`read_csv`) and a series (`read_series`).
"""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from feedsim.design.sweep.table import read_table
from feedsim.files.trace import convert, read_csv, read_recording, read_series
from feedsim.foundation.errors import InputError
from feedsim.structure.modes import read_modes

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
VALUES = [1.25, 2.5, 4.0]
ROWS = ["0,1.25", "0.002,2.5", "0.004,4.0"]


def file(folder: Path, text: str) -> Path:
    path = folder / "t.csv"
    path.write_text(text, encoding="utf-8", newline="")
    return path


@pytest.mark.parametrize(
    "lines",
    [
        ["time,x", *ROWS],
        ["# written by a tool", "# version 1", "time,x", *ROWS],
        ["# time,x", *ROWS],
        ["Zeit [s],x", *ROWS],
        ["t [s], x", *ROWS],
        ["time,x", "s,m", *ROWS],
        ["log", "", "time,x", "[s],[foo]", *ROWS],
        ["time (s),x", *ROWS],
        [",time,x", *(f"{k},{row}" for k, row in enumerate(ROWS))],
        ['"","time","x"', *(f'"{k + 1}",{row}' for k, row in enumerate(ROWS))],
        ['"","time","x"', *(f'"row {k + 1}",{row}' for k, row in enumerate(ROWS))],
        ['"time","x"', *(f'"row {k + 1}",{row}' for k, row in enumerate(ROWS))],
        ["time;x", *(f"{k};{row.replace(',', ';')}" for k, row in enumerate(ROWS, 1))],
        ["x,,time", *(f"{row.split(',')[1]},7,{row.split(',')[0]}" for row in ROWS)],
        ["time,x", *(f"{row}," for row in ROWS)],
        [",time,x", ",s,m", *(f"{k},{row}" for k, row in enumerate(ROWS))],
        ["time,x,,", *(f"{row},," for row in ROWS)],
    ],
)
def test_the_same_table_in_other_forms(tmp_path: Path, lines: list[str]) -> None:
    path = file(tmp_path, "\n".join(lines) + "\n")
    recording, trace, series = read_recording(path), read_csv(path), read_series(path)
    assert set(recording.names) == {recording.clock()[0], "x"}
    np.testing.assert_array_equal(recording.read(["x"])["x"], VALUES)
    for read in (trace, series):
        assert list(read) == ["x"]
        np.testing.assert_array_equal(read["x"], VALUES)
        np.testing.assert_array_equal(read.time, [0, 0.002, 0.004])
    out = tmp_path / "out.csv"
    convert(path, [], out)
    np.testing.assert_array_equal(read_csv(out)["x"], VALUES)


def test_tables_of_studies_and_modes_may_have_an_index(tmp_path: Path) -> None:
    """As pandas writes one ahead where such a table was read and written again."""

    def indexed(text: str) -> Path:
        head, *rows = text.splitlines()
        return file(tmp_path, "\n".join([f",{head}", *(f"{k},{row}" for k, row in enumerate(rows))]) + "\n")

    study = read_table(indexed("run,seed,Z.F_C [N.m],status,seconds\n0,1,0.5,ok,0.5\n1,1,0.75,ok,0.5\n"))
    assert list(study.columns) == ["run", "seed", "Z.F_C", "status", "seconds"]
    assert study.columns["Z.F_C"].tolist() == [0.5, 0.75]
    modes = (SCENARIOS / "machines" / "test_centre" / "modes.csv").read_text()
    axes = ("X", "Y", "Z")
    plain = read_modes(SCENARIOS / "machines" / "test_centre" / "modes.csv", axes)
    np.testing.assert_array_equal(read_modes(indexed(modes), axes).frequency, plain.frequency)


def test_a_column_without_a_name_is_reported(tmp_path: Path) -> None:
    path = file(tmp_path, "\n".join([",time,x", *(f"{k},{row}" for k, row in enumerate(ROWS))]))
    assert read_recording(path).notes == read_series(path).notes
    (note,) = read_series(path).notes
    assert note.code == "column-without-name"
    assert "column 1 has no name" in note.text


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (",,\n0,1,2\n", "0 columns have a name; at least two"),
        ("x,\n0,1\n", "1 columns have a name; at least two"),
        ("time,x\n0,0,5\n1,1,5\n", "3 values, the header has 2 columns; decimal commas"),
        (f"time,x{'m' * 200_000}\n0,1\n", "field larger than field limit"),
        (f"time,x{'m' * 2000}\n0,1\n", "2001 characters; allowed: up to 1000"),
    ],
)
@pytest.mark.parametrize("read", [read_recording, read_csv, read_series])
def test_tables_that_are_refused(tmp_path: Path, text: str, message: str, read: Callable[[Path], object]) -> None:
    with pytest.raises(InputError) as caught:
        read(file(tmp_path, text))
    assert message in str(caught.value)
    assert len(str(caught.value)) < 400


SIGNAL = "+/Nck/!SD/nckServoDataActPos1stEnc32 [u1; 1]"


@pytest.mark.parametrize(
    ("header", "names"),
    [
        (f"time,{SIGNAL},x [mm]", ("time", "nckServoDataActPos1stEnc32 1", "x")),
        (f"time,{SIGNAL.replace(';', ',')},x", ("time", "nckServoDataActPos1stEnc32 1", "x")),
        (f"time;{SIGNAL} [mm];x", ("time", "nckServoDataActPos1stEnc32 1", "x")),
        ("time,/a/s [u1; 1],/b/s [u1; 1]", ("time", "/a/s 1", "/b/s 1")),
        ("time,/a/s [u1; 1],/a/s [u1; 2]", ("time", "s 1", "s 2")),
    ],
)
def test_signals_of_a_control_by_their_paths(tmp_path: Path, header: str, names: tuple[str, ...]) -> None:
    separator = header[4]
    path = file(tmp_path, "\n".join([header, *(separator.join(row) for row in (["0", "1", "2"], ["1", "2", "3"]))]))
    recording = read_recording(path)
    assert recording.names == names
    assert tuple(read_series(path)) == names[1:]
    first = header.split(separator)[1] if "/a/" not in header else names[1]
    assert recording.called(first.removesuffix(" [mm]")) in (names[1], None)


# --- time stamps ----------------------------------------------------------------------------------------------------

BEGIN = datetime(2025, 3, 4, 23, 59, 59, 996000)  # over midnight
STEPS = [timedelta(milliseconds=2 * k) for k in range(6)]


def stamped(form: str) -> list[str]:
    """Stamps in a form of strftime, in which %L are milliseconds."""
    instants = [BEGIN + step for step in STEPS]
    return [i.strftime(form.replace("%L", f"{i.microsecond // 1000:03d}")) for i in instants]


@pytest.mark.parametrize(
    "form",
    [
        "%Y-%m-%d %H:%M:%S.%L",
        "%Y-%m-%dT%H:%M:%S.%L",
        "%Y-%m-%dT%H:%M:%S.%LZ",
        "%Y-%m-%d %H:%M:%S.%L+02:00",
        "%Y-%m-%d %H:%M:%S,%L",
        "%Y/%m/%d %H:%M:%S.%L",
        "%d.%m.%Y %H:%M:%S,%L",
        "%d.%m.%y %H:%M:%S.%L",
        "%d/%m/%Y %H:%M:%S.%L",
        "%m/%d/%Y %H:%M:%S.%L",
        "%m/%d/%Y %I:%M:%S.%L %p",
        "%d-%b-%Y %H:%M:%S.%L",
        "%H:%M:%S.%L",
        "%H:%M:%S:%L",
    ],
)
@pytest.mark.parametrize("name", ["Timestamp", "time", "Zeit"])
def test_time_stamps_are_seconds_since_the_first(tmp_path: Path, form: str, name: str) -> None:
    rows = [f"{stamp};{k},5" for k, stamp in enumerate(stamped(form))]
    path = file(tmp_path, "\n".join([f"{name};x [mm]", *rows]))
    expected = [step.total_seconds() for step in STEPS]
    for read in (read_csv, read_series):
        np.testing.assert_allclose(read(path).time, expected, rtol=0, atol=1e-11)
        np.testing.assert_array_equal(read(path)["x"], np.arange(6) + 0.5)
    recording = read_recording(path)
    assert recording.clock() == (name, 1.0)
    assert "time-by-stamps" in [note.code for note in recording.notes]


def test_summer_time_with_a_zone(tmp_path: Path) -> None:
    """The local time goes back by an hour, the zone with it."""
    rows = ["2025-10-26T02:59:59.999+02:00,1", "2025-10-26T02:00:00.001+01:00,2"]
    path = file(tmp_path, "\n".join(["time,x", *rows]))
    np.testing.assert_allclose(read_csv(path).time, [0, 0.002], atol=1e-11)


def test_milliseconds_since_1970(tmp_path: Path) -> None:
    begin = 1741082400000
    for extra in ("", ",word"):
        rows = [f"{begin + 2 * k},{k}{extra}" for k in range(5)]
        path = file(tmp_path, "\n".join([f"timestamp,x{',y' if extra else ''}", *rows]))
        for read in (lambda p: read_csv(p, columns=["x"]), read_series):
            np.testing.assert_array_equal(read(path).time, 0.001 * (2 * np.arange(5)))
        assert "2025-03-04 10:00:00.000 UTC" in read_recording(path).notes[0].text
    # A counter of nanoseconds is none.
    path = file(tmp_path, "\n".join(["timestamp [ns],x", *(f"{begin + 2_000_000 * k},{k}" for k in range(5))]))
    np.testing.assert_allclose(np.diff(read_csv(path).time), 0.002, rtol=1e-9)


def test_an_hour_that_summer_time_takes_is_reported(tmp_path: Path) -> None:
    rows = ["2025-03-30 01:59:59.996,1", "2025-03-30 01:59:59.998,1", "2025-03-30 03:00:00.000,2"]
    (note,) = read_series(file(tmp_path, "\n".join(["time,x", *rows]))).notes
    assert note.code == "time-by-stamps"
    assert "in line 4 the clock goes on by an hour" in note.text


INSTEAD = "give time: {interval: 2 ms} in a mapping file"


@pytest.mark.parametrize(
    ("stamps", "messages"),
    [
        (["03/04/2025 10:00:00", "05/06/2025 10:00:00"], ["the day may stand ahead of the month", INSTEAD]),
        (["2025-10-26 02:59:59.998", "2025-10-26 02:00:00.000"], ["set back by an hour", "time zone", INSTEAD]),
        (["2025-03-04 10:00:00", "2025-03-04 10:00:00"], ["too coarse", INSTEAD]),
        (["2025-03-04 10:00:05", "2025-03-04 10:00:02"], ["t.csv:3:", "time must increase", INSTEAD]),
        (["2025-03-04 10:00:00", "2025-03-04 1O:00:01"], ["t.csv:3:", "is no time stamp"]),
        (["2025-02-30 10:00:00", "2025-02-31 10:00:00"], ["are no dates"]),
        (["2025-03-04 10:00:00", "2025-03-04 10:00:01Z"], ["in all stamps or in none"]),
        (["4 March 2025 at 10:00:00", "4 March 2025 at 10:00:01"], ["'4 March 2025 at 10:00:00'", INSTEAD]),
    ],
)
@pytest.mark.parametrize("read", [read_csv, read_series])
def test_time_stamps_that_are_refused(
    tmp_path: Path, stamps: list[str], messages: list[str], read: Callable[[Path], object]
) -> None:
    with pytest.raises(InputError) as caught:
        read(file(tmp_path, "\n".join(["time,x", *(f"{stamp},{k}" for k, stamp in enumerate(stamps))])))
    for message in messages:
        assert message in str(caught.value)
