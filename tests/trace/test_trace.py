"""Traces: the value itself, CSV as people and programs write it, recorded setpoints, MAT files."""

import os
import stat
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from feedsim.files.trace import Trace, convert, read_csv, read_signals, write_csv, written_whole
from feedsim.files.trace.cells import shortest_numbers
from feedsim.foundation.errors import InputError, OutputError


def trace(rows: int = 5) -> Trace:
    time = np.asarray(np.arange(rows) * 125e-6, dtype=np.float64)
    return Trace(
        time,
        {"Z.x_a": np.square(time), "Z.n_a": np.negative(time), "X.x_a": time + time},
        {"Z.x_a": "m", "Z.n_a": "rad/s"},
    )


def file(tmp_path: Path, content: str | bytes) -> Path:
    path = tmp_path / "t.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8"))
    return path


# --- the value ------------------------------------------------------------------------------------------------------


def test_columns_units_and_rows() -> None:
    t = trace()
    assert t.names == tuple(t) == ("Z.x_a", "Z.n_a", "X.x_a")
    assert len(t) == 5
    assert "Z.x_a" in t
    assert (t.unit("Z.x_a"), t.unit("X.x_a")) == ("m", "")
    np.testing.assert_array_equal(t["X.x_a"], 2 * t.time)
    with pytest.raises(InputError, match=r"no column 'Z\.x_b'; did you mean 'Z\.x_a'"):
        t["Z.x_b"]
    with pytest.raises(InputError, match="no column"):
        t.unit("missing")


def test_arrays_are_copies_that_nobody_changes() -> None:
    values = np.zeros(3)
    t = Trace(np.arange(3.0), {"a": values})
    values[0] = 1
    assert t["a"][0] == 0
    with pytest.raises(ValueError, match="read-only"):
        t["a"][0] = 1


def test_between_keeps_rows_at_both_ends_in_spite_of_rounding() -> None:
    t = trace(10_000)
    for k in (1, 3, 7, 4801, 9999):
        part = t.between(k * 125e-6, (k + 2) / 8000)
        assert part.time[0] == t.time[k]
        assert len(part) == min(3, 10_000 - k)
    assert len(t.between(5.0, 6.0)) == 0
    assert len(Trace(np.array([1.0]), {}).between(1.0, 1.0)) == 1


def test_select_by_pattern() -> None:
    assert trace().select(["X.*", "*.x_a"]).names == ("Z.x_a", "X.x_a")
    with pytest.raises(InputError, match=r"no column matches 'Y\.\*'"):
        trace().select(["Y.*"])


@pytest.mark.parametrize(
    ("time", "columns", "message"),
    [
        ([0, 1], {"a": [1]}, "column 'a' has 1 values, the time has 2"),
        ([0, 0], {}, "time must increase: 0 s follows 0 s at row 1"),
        ([0, np.nan], {}, "time is not finite at row 1"),
        ([[0, 1]], {}, "must be one-dimensional"),
        ([0], {"a [m]": [1]}, "without brackets"),
        ([0], {" a": [1]}, "without blanks at its ends"),
        ([0], {"": [1]}, "must be printable"),
        ([0], {"time": [1]}, "the time is not a column"),
    ],
)
def test_traces_that_make_no_sense(time: list[float], columns: dict[str, list[float]], message: str) -> None:
    with pytest.raises(InputError, match=message.replace("[", r"\[")):
        Trace(time, columns)  # type: ignore[arg-type]


# --- CSV ------------------------------------------------------------------------------------------------------------


def test_what_is_written(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    columns = {"Z.x_a": np.array([0.1, -2, 1e-9]), "flag": np.array([0.0, 1, 0])}
    write_csv(path, Trace(np.array([0, 0.1, 0.2]), columns, {"Z.x_a": "m"}))
    assert path.read_bytes() == b"time [s],Z.x_a [m],flag\n0,0.1,0\n0.1,-2,1\n0.2,1e-09,0\n"


names = st.text(st.characters(exclude_categories=["C", "Z"], exclude_characters="[]"), min_size=1, max_size=8).filter(
    lambda name: name.lower() not in ("time", "t")
)
cell_units = st.text(st.characters(codec="ascii", exclude_categories=["C", "Z"], exclude_characters="[]"), max_size=5)
finite = st.floats(-1e100, 1e100)  # as far as a table is read


@settings(derandomize=True)
@given(
    time=st.lists(finite, min_size=1, max_size=8, unique=True).map(sorted),
    heads=st.lists(st.tuples(names, cell_units), max_size=4, unique_by=lambda head: head[0]),
    data=st.data(),
)
def test_csv_round_trip_is_exact(
    tmp_path_factory: pytest.TempPathFactory, time: list[float], heads: list[tuple[str, str]], data: st.DataObject
) -> None:
    heads = [*heads, ("in round brackets (mm)", ""), ("r0078 (1)", ""), ("Speed(A)", "")]
    columns = {name: data.draw(st.lists(finite, min_size=len(time), max_size=len(time))) for name, _ in heads}
    written = Trace(np.array(time), {name: np.array(column) for name, column in columns.items()}, dict(heads))
    path = tmp_path_factory.mktemp("round") / "t.csv"
    write_csv(path, written)
    back = read_csv(path)
    assert back.names == written.names
    assert dict(back.units) == dict(written.units)
    assert back.time.tobytes() == written.time.tobytes()
    for name in written:
        assert back[name].tobytes() == written[name].tobytes()


PLAIN = "time [s],x [mm]\n0,0.5\n0.001,0.25\n0.003,-1e3\n"


@pytest.mark.parametrize(
    "content",
    [
        PLAIN,
        PLAIN.replace("\n", "\r\n"),
        "\ufeff" + PLAIN,
        PLAIN.replace(",", ";"),
        PLAIN.replace(",", "\t"),
        PLAIN.replace(",", ";").replace(".", ","),
        PLAIN.replace(",", "\t").replace(".", ","),
        "sep=;\n" + PLAIN.replace(",", ";").replace(".", ","),
        PLAIN.replace(",", " , "),
        '"time [s]","x [mm]"\n"0","0.5"\n"0.001","0.25"\n"0.003","-1e3"\n',
        PLAIN + "\n\n",
        PLAIN.replace("\n", ",\n"),  # a separator at the end of every line
        "x [mm],time [s]\n0.5,0\n0.25,0.001\n-1e3,0.003\n",
        "x [mm],T [s]\n0.5,0\n0.25,0.001\n-1e3,0.003\n",
        "time [ms],x [mm]\n0,0.5\n1,0.25\n3,-1e3\n",
        "time (s),x (mm)\n0,0.5\n0.001,0.25\n0.003,-1e3\n",
        "Time(ms);x (mm)\n0;0.5\n1;0.25\n3;-1e3\n",
        "clock [us],x [mm]\n0,0.5\n1000,0.25\n3000,-1e3\n",
        PLAIN.replace("time [s]", "time"),
        PLAIN.replace(",", ";").encode("utf-16"),
        "time [s];x [mm]\n0;,5\n0,001;+0,25\n,003;-1000,\n",
    ],
)
def test_what_is_clear_is_read(tmp_path: Path, content: str | bytes) -> None:
    t = read_csv(file(tmp_path, content))
    np.testing.assert_allclose(t.time, [0, 0.001, 0.003], rtol=3e-16)  # one rounding where the time is converted
    np.testing.assert_array_equal(t["x"], [0.5, 0.25, -1000])
    assert t.unit("x") == "mm"


def test_columns_that_are_not_asked_for_may_hold_anything(tmp_path: Path) -> None:
    path = file(tmp_path, "clock,pos,state\n0,1,idle\n2,3,\n")
    assert read_csv(path, columns=["pos"], time="clock", time_unit="min").time.tolist() == [0, 120]
    with pytest.raises(InputError, match="'idle' in column 'state' is no number"):
        read_csv(path, time="clock")
    with pytest.raises(InputError, match="no column 'poss'; did you mean 'pos'"):
        read_csv(path, columns=["poss"], time="clock")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("time,x\n0,1\n1,\n", "t.csv:3: no value in column 'x'"),
        ("time,x\n0,1\n1,NaN\n", "t.csv:3: 'NaN' in column 'x'; every value must be a finite number"),
        ("time,x\n0,1\n1,inf\n", "t.csv:3: 'inf' in column 'x'"),
        ("time,x\n0,1\n1,1e999\n", "t.csv:3: 1e999 in column 'x' is too large; allowed: up to 1e+100"),
        ("time,x\n0,1\n1,1_0\n", "t.csv:3: '1_0' in column 'x' is no number"),
        ("time,x\n0,1\n1,2 3\n", "t.csv:3: '2 3' in column 'x' is no number"),
        ("time,x\n0,1\n1,0x10\n", "t.csv:3: '0x10' in column 'x' is no number"),
        ("time,x\n0,1\n1\n", "t.csv:3: 1 values, the header has 2 columns"),
        ("time,x\n0,1\n1,2,3\n", "t.csv:3: 3 values, the header has 2 columns; decimal commas need semicolons"),
        ("time,x\n0,1\n\n1,2\n", "t.csv:3: the row is empty"),
        ("time,x\n0,1\n2,1\n1,1\n", "t.csv:4: time 1 follows 2; it must increase"),
        ("time,x\n0,1\n0,1\n", "t.csv:3: time 0 follows 0; it must increase"),
        ("time,x,x\n0,1,2\n", "t.csv:1: duplicate column 'x' (columns 2 and 3)"),
        ("time,x [m],x [mm]\n0,1,2\n", "t.csv:1: duplicate column 'x'"),
        ("time,[m]\n0,1\n", "t.csv:1: column 2 is headed '[m]'"),
        ("0,1\n1,2\n", "t.csv:1: the first line holds numbers; a header of name [unit] is needed"),
        ("time,x\n", "t.csv:1: no rows below the header"),
        ("time\n0\n", "t.csv:1: the header has one column only"),
        ("a [m],b [m]\n0,1\n", "t.csv:1: no time column"),
        ("time [mm],x\n0,1\n", "t.csv:1: time column 'time': unit 'mm' is that of a length; one of a time is expected"),
        ("Time,TIME,x\n0,1,2\n", "t.csv:1: several columns are called 'time'"),
        ("time;x\n0;1,234\n1;2,345\n", "t.csv:2: '1,234' may mean 1.234 or 1234"),
        ("time;x\n0;1.234,5\n", "t.csv:2: '1.234,5' marks thousands"),
        ("time;x\n0;1,234,567\n", "t.csv:2: '1,234,567' marks thousands"),
        ("time;x\n0;0,5\n1;0.5\n", "t.csv:3: '0.5', but '0,5' in line 2; decimal point and comma mixed"),
        ("time;x\n0;0.5\n1;1,234\n", "t.csv:3: '1,234', but '0.5' in line 2; decimal point and comma mixed"),
        ('time,x\n0,"1\n', "t.csv:2: unexpected end of data"),
        ("", "t.csv: the file is empty"),
        (b"time,x [\x81m]\n0,1\n", "t.csv:1: neither UTF-8 (byte 0x81) nor Windows-1252"),
        (b"time,x\n0,1\n1,\x00\n", "t.csv:3: a zero byte; this is no text file"),
        (b"PK\x03\x04time,x\n0,1\n", "t.csv is a spreadsheet, or another packed file; save its sheet as CSV UTF-8"),
        (b"\xd0\xcf\x11\xe0time,x\n", "t.csv is a spreadsheet"),
    ],
)
def test_what_is_not_clear_is_refused_with_its_row(tmp_path: Path, content: str | bytes, message: str) -> None:
    with pytest.raises(InputError) as caught:
        read_csv(file(tmp_path, content))
    assert message in str(caught.value)


def test_one_clear_number_settles_the_others(tmp_path: Path) -> None:
    t = read_csv(file(tmp_path, "time;x\n0;1,234\n1;0,5\n"))
    assert t["x"].tolist() == [1.234, 0.5]


def test_missing_file_and_folder(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        read_csv(tmp_path / "none.csv")
    with pytest.raises(InputError, match="is a folder, not a file"):
        read_csv(tmp_path)


# --- whole or not at all --------------------------------------------------------------------------------------------


@given(st.lists(st.floats(), max_size=20))
def test_the_shortest_form_is_that_of_repr(values: list[float]) -> None:
    assert shortest_numbers(np.array(values)) == [repr(value).removesuffix(".0") for value in values]


def test_the_shortest_form_where_it_changes() -> None:
    powers = [10.0**k for k in range(-30, 31)] + [2.0**k for k in range(-80, 81)]
    around = [float(np.nextafter(power, towards)) for power in powers for towards in (0.0, np.inf)]
    values = np.array([0.0, *powers, *around, 123456789012345680.0, 5e-324, np.finfo(float).max])
    values = np.concatenate([values, -values])
    assert shortest_numbers(values) == [repr(value).removesuffix(".0") for value in values.tolist()]


def test_a_value_that_is_not_finite_is_not_written(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text("old")
    with pytest.raises(OutputError, match="a is nan at 1 s"):
        write_csv(path, Trace(np.arange(2.0), {"a": np.array([0, np.nan])}))
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_failure_half_way_leaves_the_old_file_alone(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text("old")

    def fail_half_way() -> None:
        with written_whole(path) as out:
            out.write(b"half")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail_half_way()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_places_that_cannot_be_written(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="cannot be written: No such file or directory"):
        write_csv(tmp_path / "none" / "t.csv", trace())
    with pytest.raises(OutputError, match="cannot be written: it is a folder"):
        write_csv(tmp_path, trace())


@pytest.mark.skipif(os.name != "posix", reason="file modes of POSIX")
def test_permissions_are_those_of_any_new_file(tmp_path: Path) -> None:
    (tmp_path / "plain").write_text("")
    write_csv(tmp_path / "t.csv", trace())
    assert stat.S_IMODE((tmp_path / "t.csv").stat().st_mode) == stat.S_IMODE((tmp_path / "plain").stat().st_mode)


# --- recorded signals -----------------------------------------------------------------------------------------------

RECORDING = "t [ms];q [mm];y\n" + "".join(f"{k};{k * k},5;{k}\n" for k in range(10, 20))


def test_signals_are_si_over_the_recorded_time(tmp_path: Path) -> None:
    path = file(tmp_path, RECORDING)
    setpoints = read_signals(path, {"Z": ("q", None), "X": ("y", "um")}, "m", time=("t", None))
    np.testing.assert_allclose(setpoints.time, np.arange(10, 20) * 1e-3, rtol=3e-16)
    np.testing.assert_allclose(setpoints["Z"], (np.arange(10, 20) ** 2 + 0.5) * 1e-3, rtol=3e-16)
    np.testing.assert_allclose(setpoints["X"], np.arange(10, 20) * 1e-6, rtol=3e-16)
    assert setpoints.unit("Z") == "m"
    part = read_signals(path, {"Z": ("q", "mm")}, "m", time=("t", None), between=(0.012, 0.016))
    assert len(part) == 5
    assert part["Z"][0] == 0.1445


@pytest.mark.parametrize(
    ("columns", "between", "message"),
    [
        ({"Z": ("y", None)}, None, "column 'y' has no unit; write 'y [mm]' in the header or give the unit"),
        ({"Z": ("y", "N")}, None, "column 'y': unit 'N' is that of a force; one of a length is expected"),
        ({"Z": ("q", "m")}, None, "column 'q' is in mm by its header, in m by the scenario"),
        ({"Z": ("p", None)}, None, "no column 'p'"),
        (
            {"Z": ("q", None)},
            (0.0, 0.011),
            "2 rows between 0 and 0.011 s; at least 4 are needed (the file runs from 0.01 to",
        ),
    ],
)
def test_signals_that_are_refused(
    tmp_path: Path, columns: dict[str, tuple[str, str | None]], between: tuple[float, float] | None, message: str
) -> None:
    with pytest.raises(InputError) as caught:
        read_signals(file(tmp_path, RECORDING), columns, "m", time=("t", None), between=between, fewest=4)
    assert message in str(caught.value)


# --- MAT files ------------------------------------------------------------------------------------------------------


@pytest.fixture
def mat(tmp_path: Path) -> Path:
    path = tmp_path / "record.mat"
    content = {"t": np.arange(4.0)[:, None], "q": np.arange(4.0)[None, :] ** 2, "n": np.arange(4), "k": 5.0}
    content |= {"short": np.arange(3.0), "bad": np.array([0, 1, np.nan, 3]), "text": "abc", "z": np.arange(4) * 1j}
    savemat(path, {**content, "rec": {"pos": np.arange(4.0) / 8}, "back": np.arange(4.0)[::-1]})
    return path


def test_mat_to_csv(mat: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    written = convert(mat, [("t", "time", "ms"), ("q", "Z.x_s", "mm"), ("rec.pos", "X.x_s", "m"), ("n", "n", "1")], out)
    assert out.read_text().splitlines()[:3] == ["time [s],Z.x_s [mm],X.x_s [m],n [1]", "0,0,0,0", "0.001,1,0.125,1"]
    assert read_csv(out)["Z.x_s"].tolist() == written["Z.x_s"].tolist() == [0, 1, 4, 9]


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ([("t", "time", "s"), ("qq", "x", "m")], "no variable 'qq'; did you mean 'q'?"),
        ([("t", "time", "s"), ("position", "x", "m")], "no variable 'position'; there is t, q, n, short"),
        ([("t", "time", "s"), ("short", "x", "m")], "'short' has 3 values, 't' has 4"),
        ([("t", "time", "s"), ("bad", "x", "m")], "'bad' is not finite at element 3"),
        ([("t", "time", "s"), ("text", "x", "m")], "'text' (text); a vector of real numbers is needed"),
        ([("t", "time", "s"), ("z", "x", "m")], "'z' (complex128 of shape (4,)); a vector"),
        ([("t", "time", "s"), ("k", "x", "m")], "'k' is a single number; a vector"),
        ([("t", "time", "s"), ("rec", "x", "m")], "no variable 'rec'; did you mean 'rec.pos'?"),
        ([("t", "time", "s"), ("rec.po", "x", "m")], "no variable 'rec.po'; did you mean 'rec.pos'?"),
        ([("t", "time", "s"), ("q.x", "x", "m")], "no variable 'q.x'; there is t, q"),
        ([("back", "time", "s"), ("q", "x", "m")], "time must increase"),
        ([("t", "time", "m"), ("q", "x", "m")], "one of a time is expected"),
        ([("t", "time", "s"), ("q", "x", "furlong")], "unknown unit 'furlong'"),
        ([("t", "time", "s"), ("q", "x", "m"), ("n", "x", "m")], "two columns are to be called 'x'"),
        ([("q", "x", "m")], "the first column must be the time"),
        ([], "which column is the time? --column t=time:s, and one for each other column; there are "),
        ([], "q, "),
    ],
)
def test_mat_files_that_are_refused(
    mat: Path, tmp_path: Path, columns: list[tuple[str, str, str]], message: str
) -> None:
    with pytest.raises(InputError) as caught:
        convert(mat, columns, tmp_path / "out.csv")
    assert message in str(caught.value)
    assert not (tmp_path / "out.csv").exists()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"no mat file at all", "is no MAT file that can be read"),
        (b"", "is no MAT file that can be read"),
        (b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + b"\x89HDF", "version 7.3, and what follows is no HDF5"),
    ],
)
def test_files_that_are_no_mat_files(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "x.mat"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        convert(path, [("t", "time", "s"), ("q", "x", "m")], tmp_path / "out.csv")
    assert message in str(caught.value)


def test_missing_mat_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        convert(tmp_path / "none.mat", [("t", "time", "s")], tmp_path / "out.csv")


@pytest.mark.skipif("FEEDSIM_EMPS" not in os.environ, reason="FEEDSIM_EMPS names no measured data")
def test_measured_reference_of_a_real_axis(tmp_path: Path) -> None:
    out = tmp_path / "emps.csv"
    convert(os.environ["FEEDSIM_EMPS"], [("t", "time", "s"), ("qg", "Z.x_s", "m")], out)
    # Facts of the data set: 24.84 s at 1 kHz, a stroke of 246.36 mm.
    setpoints = read_signals(out, {"Z": ("Z.x_s", None)}, "m")
    assert len(setpoints) == 24841
    assert setpoints.time[-1] == pytest.approx(24.84, abs=1e-6)
    assert setpoints["Z"].max() - setpoints["Z"].min() == pytest.approx(0.24636, abs=1e-5)
