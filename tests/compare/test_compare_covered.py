"""What a comparison must not pass over: results with too few rows, numbers that overflow, units told twice, names with
brackets and colons."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compare_helpers import changed, wave, written
from feedsim.cli import main
from feedsim.comparison import Comparison, Options, Tolerances, compare
from feedsim.files.trace import Array, Series, Trace, match_names, matches, read_series
from feedsim.foundation.errors import InputError


def at_rows(series: Series, rows: object) -> Series:
    return Series(series.time[rows], {n: v[rows] for n, v in series.columns.items()}, series.units)


def still(time: object) -> Series:
    values = np.asarray(time, dtype=float)
    return Series(values, {"x": 0 * values + 1})


def told(found: Comparison, *parts: str) -> None:
    assert found.verdict == "different", found.line
    for part in parts:
        assert part in found.line


# --- covering -------------------------------------------------------------------------------------------------------


def test_a_result_with_too_few_rows_is_different() -> None:
    thousand = still(np.linspace(0, 1, 1000))
    told(compare(still([0, 0.6]), thousand), "the result ends at 0.6 s, the reference at 1 s", "2 for 1000 of")
    told(compare(still([0, 1]), still(np.linspace(0, 1e-3, 1000))), "one row only in the compared time")
    told(compare(still([0, 1]), still(np.linspace(0, 1e-3, 1000)), None, Options(at="result")), "one row only")
    turns = wave(70_001)
    told(compare(at_rows(turns, slice(None, None, 700)), turns), "101 for 70001 of the reference", "--at result")


@pytest.mark.parametrize(("every", "good"), [(1, True), (5, True), (10, True), (11, False), (20, False)])
def test_how_few_rows_are_too_few(every: int, good: bool) -> None:
    whole = wave(11 * 20 * 10 + 1)
    few = at_rows(whole, slice(None, None, every))
    assert compare(few, whole, Tolerances.parse(["1e-9"])).same is good
    assert compare(few, whole, Tolerances.parse(["1e-9"]), Options(at="result")).same
    # chords of 20 steps: (2 pi dt)^2/8 of the amplitude
    assert compare(few, whole, Tolerances.parse(["2e-3", "Z.limited=ignore"]), Options(at="reference")).same


def test_rows_that_crowd_at_one_end_do_not_count_for_the_rest() -> None:
    whole = wave(2001)
    told(compare(at_rows(whole, np.r_[0:1000, 2000]), whole), "too few rows", "49.5 %")
    assert compare(at_rows(whole, np.r_[0:1600, 2000]), whole).same  # a hole of a fifth is told, as ever


def test_uneven_references_are_counted_by_their_rows() -> None:
    """A solver that steps 10 ms at rest and 0.1 ms in motion, its result likewise: no row is far from another."""
    time = np.concatenate([np.arange(0, 1, 0.01), np.arange(1, 1.1, 1e-4), np.arange(1.1, 2, 0.01)])
    assert compare(still(time[np.r_[1:1188:3, 1189]]), still(time)).same  # a row of 1191 less at either end
    even = still(np.arange(0, 1.995, 0.01))
    told(compare(even, still(time)), "too few rows")
    assert compare(even, still(time), None, Options(at="result")).same


def test_ends_are_those_of_the_reference() -> None:
    whole = wave(2001)  # a row per millisecond
    assert compare(at_rows(whole, slice(1, 2000)), whole).same
    told(compare(at_rows(whole, slice(0, 1990, 5)), whole), "the result ends at 1.985 s")
    # three rows in 2 s: a step of them is half of it
    told(compare(at_rows(whole, slice(0, 1100)), wave(3)), "the result ends at 1.099 s")
    assert compare(at_rows(whole, slice(1, 2000)), wave(3)).same


def test_a_tolerance_in_time_is_none_for_ending_early() -> None:
    whole = Series(np.linspace(0, 10, 1001), {"f": np.zeros(1001), "g": np.zeros(1001)})
    short = at_rows(whole, slice(0, 401))
    for texts in (["f=0.1,10 s"], ["10 s"]):
        told(compare(short, whole, Tolerances.parse(texts)), "the result ends at 4 s, the reference at 10 s")
    nearly = at_rows(whole, slice(0, 951))
    assert compare(nearly, whole, Tolerances.parse(["1 s"])).same
    told(compare(nearly, whole, Tolerances.parse(["f=1 s"])), "the result ends at 9.5 s")
    assert compare(nearly, whole, Tolerances.parse(["f=1 s", "g=ignore"])).same
    told(compare(whole, whole, None, Options(shift=-6.0)), "the result ends at 4 s")
    assert compare(whole, whole, None, Options(shift=-0.5)).same


# --- numbers --------------------------------------------------------------------------------------------------------


def test_no_number_passes_an_endless_tolerance() -> None:
    time = np.arange(3.0)
    reference = Series(time, {"x": np.array([0, 5, 10.0])})
    for value in (np.nan, np.inf):
        holed = Series(time, {"x": np.array([0, value, 10.0])})
        for text in ("1e308", "1e307", "0"):
            assert not compare(holed, reference, Tolerances.parse([text])).same
        assert compare(holed, reference, Tolerances.parse(["1e307"])).verdict == "different"
    found = compare(reference, reference, Tolerances.parse(["1e308"]))
    assert found.exit_code == 2
    assert "1e+308 of a range of 10 is no finite number" in found.variables[0].reason
    in_mm = Series(time, reference.columns, {"x": "mm"})
    assert compare(in_mm, in_mm, Tolerances.parse(["1e307 m"])).exit_code == 2


def test_differences_that_overflow_are_differences() -> None:
    time = np.arange(3.0)
    reference = Series(time, {"x": np.array([-1.7e308, 1.0, 1.7e308])})
    result = Series(time, {"x": np.array([1.7e308, 1.0, 1.7e308])})
    with np.errstate(over="ignore"):
        found = compare(result, reference, Tolerances.parse(["x=1 m"]))
        told(found, "beyond what can be calculated")
        assert compare(reference, reference, Tolerances.parse(["0"])).same


# --- names and units ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "pattern", "found"),
    [
        ("x[3]", "x[3]", True),
        ("x3", "x[3]", False),
        ("plant.x[3]", "*.x[3]", True),
        ("x[3]", "x[?]", True),
        ("x[12]", "x[*]", True),
        ("A[1,2]", "A[1,*", True),
        ("x]", "x]", True),
        ("Z.x_a", "z.x_a", False),
        ("[", "[", True),
    ],
)
def test_brackets_are_part_of_names(name: str, pattern: str, found: bool) -> None:
    assert matches(name, pattern) is found


def test_elements_of_arrays_can_be_addressed() -> None:
    time = np.arange(3.0)
    reference = Series(time, {"x[1]": time, "x[3]": time, "x3": time})
    result = changed(reference, **{"x[3]": time + 1})
    assert not compare(result, reference).same
    for options in (Options(ignore=["x[3]"]), Options(only=["x[1]", "x3"])):
        assert compare(result, reference, None, options).same
    assert compare(result, reference, Tolerances.parse(["x[3]=2 m"])).same
    assert compare(result, reference, Tolerances.parse(["x[*]=2 m"])).same
    assert not compare(result, reference, Tolerances.parse(["x3=2 m"])).same
    held = compare(
        reference, reference, None, Options(hold=["x[3]"], units={"x[3]": "mm"}, reference_units={"x[3]": "m"})
    )
    assert [each.name for each in held.those("different")] == ["x[3]"]


def test_a_name_means_itself_before_what_it_matches() -> None:
    assert match_names(["*", "a", "b"], ["*"]) == ["*"]
    assert Trace(np.arange(2.0), {"a*": np.zeros(2), "ab": np.ones(2)}).select(["a*"]).names == ("a*",)


def test_units_told_by_the_header_and_by_an_option() -> None:
    reference = wave()
    for options, whose in (
        (Options(units={"*.x_a": "mm"}), "result"),
        (Options(reference_units={"Z.x_a": "mm"}), "reference"),
    ):
        with pytest.raises(InputError, match=f"{whose}'s unit given for 'Z.x_a': mm, but its header gives m"):
            compare(reference, reference, None, options)
    found = compare(reference, reference, None, Options(units={"Z.x_a": "m"}))
    assert found.same
    assert any(note == "Z.x_a: the result's header gives m already" for note in found.notes)
    # where nothing is compared, nothing contradicts
    assert compare(reference, reference, None, Options(units={"Z.x_a": "mm"}, only=["Z.M_a"])).same
    bare = Series(reference.time, reference.columns)
    assert compare(bare, reference, None, Options(units={"Z.x_a": "m"})).same


# --- the time column ------------------------------------------------------------------------------------------------


def test_a_time_column_with_a_colon(tmp_path: Path) -> None:
    reference = written(tmp_path / "reference.csv", wave())
    whole = wave()
    theirs = Series(whole.time, whole.columns, whole.units)
    heads = ["plant::t", "Z.x_a [m]", "Z.M_a [N.m]", "Z.limited [1]"]
    result = written(tmp_path / "result.csv", theirs, heads=heads)
    in_ms = written(tmp_path / "ms.csv", Series(1e3 * whole.time, whole.columns, whole.units), heads=heads)
    assert main(["compare", str(result), str(reference), "--time", "plant::t"]) == 0
    assert main(["compare", str(in_ms), str(reference), "--time", "plant::t:ms", "--tol", "1e-9"]) == 0
    assert main(["compare", str(reference), str(in_ms), "--reference-time", "plant::t:ms", "--tol", "1e-9"]) == 0
    for words, message in (
        ("plant::x", "no column 'plant::x'; did you mean 'plant::t'"),
        ("plant:t:ms", "no column 'plant:t'; did you mean 'plant::t'"),
        ("plant::t:parsec", "unknown unit 'parsec'"),
        ("plant::t:mm", "is that of a length"),
    ):
        with pytest.raises(InputError, match=message):
            read_series(result, time=words)
    with pytest.raises(InputError, match=r"reference.csv:1: the time column 'time' is in s, not ms"):
        read_series(reference, time="time:ms")
    np.testing.assert_array_equal(read_series(reference, time="time:s").time, whole.time)


# --- large files ----------------------------------------------------------------------------------------------------


def test_files_of_numbers_are_read_the_same_way_as_others(tmp_path: Path) -> None:
    """Numbers alone take a shorter way; one word among them, and each cell is looked at. The numbers are the same."""
    rng = np.random.default_rng(5)
    values = rng.normal(size=(50, 3)) * 10.0 ** rng.integers(-300, 300, size=(50, 3))
    rows = [f"{i},{','.join(map(repr, row))}" for i, row in enumerate(values.tolist())]

    def read(*lines: str, ending: str = "\n") -> Series:
        path = tmp_path / "t.csv"
        path.write_bytes((ending.join(lines) + ending).encode("utf-8"))
        return read_series(path)

    plain, word = read("time,a,b,c", *rows), read("time,a,b,c,d", *(f"{row},true" for row in rows))
    for found in (plain, word, read("time,a,b,c", *rows, ending="\r\n"), read("time,a,b,c", *rows, "", "")):
        np.testing.assert_array_equal(np.column_stack([found[n] for n in "abc"]), values)
    semicolons = read("time;a", "0;1.5", "1;-inf", "2;nan")
    np.testing.assert_array_equal(semicolons["a"], [1.5, -np.inf, np.nan])
    np.testing.assert_array_equal(read("time;a", "0,5;1,25", "1;2")["a"], [1.25, 2])
    for lines, message in (
        (("time,a", "0,1", "", "2,1"), "t.csv:3: the row is empty"),
        (("time,a", "0,1", "1,1,1"), "t.csv:3: 3 values, the header has 2"),
        (("time,a", "0,1,1", "1,1,1"), "t.csv:2: 3 values, the header has 2"),
        (("time,a", "0,1", "nan,1"), "t.csv:3: nan in the time column"),
        (("sep=,", "time,a", "1,1", "0,1"), "t.csv:4: time 0 follows 1"),
        (("time,a,a", "0,1,2"), "duplicate column 'a'"),
        (("1,2", "3,4"), "holds numbers"),
    ):
        with pytest.raises(InputError, match=message):
            read(*lines)


def test_a_large_file_of_numbers(tmp_path: Path) -> None:
    time = np.arange(20_000) * 125e-6
    columns: Array = np.column_stack([time, *(np.sin(k * time + 0.1) for k in range(40))])
    path = tmp_path / "large.csv"
    np.savetxt(
        path, columns, fmt="%.17g", delimiter=",", header=",".join(["time", *(f"c{k}" for k in range(40))]), comments=""
    )
    found = read_series(path)
    np.testing.assert_array_equal(found["c7"], columns[:, 8])


# --- no numbers, shifts ---------------------------------------------------------------------------------------------


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("at", ["auto", "reference"])
@pytest.mark.parametrize("hold", [(), ("x",)])
def test_what_is_no_number_between_the_references_rows_is_outside(value: float, at: str, hold: tuple[str]) -> None:
    """Rows 15 of 10 and 20, which the reference has, and 20: told as it is, and once."""
    coarse, fine = still(np.arange(11.0)), still(np.linspace(0, 10, 101))
    for row, more in ((15, 1), (20, 0)):
        x = fine["x"].copy()
        x[row] = value
        found = compare(Series(fine.time, {"x": x}), coarse, None, Options(at=at, hold=hold))  # type: ignore[arg-type]
        told(found, "1 of 1 variables outside", f"no number ({value})", f"in 1 of {11 + more} rows")
        assert found.variables[0].first == fine.time[row]
    x = fine["x"].copy()
    x[95] = value
    later = compare(Series(fine.time, {"x": x}), coarse, None, Options(at=at, end=9.0))  # type: ignore[arg-type]
    assert later.same, later.line


@pytest.mark.parametrize("shift", [0.05, -0.05])
def test_a_shift_allows_for_rows_at_the_end_that_it_moves_from(shift: float) -> None:
    """Both last 1 s. Moved later, the result lacks 50 ms at the start; 40 ms that lack at its end are not due to it."""
    time = np.linspace(0, 1, 1001)
    found = compare(still(time), still(time), None, Options(shift=shift))
    assert found.same, found.line
    assert [note for note in found.notes if "its shift allows for it" in note]
    cut = still(time[time < 0.9105] if shift > 0 else time[time > 0.0895])
    word = "the result ends at 0.96 s" if shift > 0 else "the result begins at 0.04 s"
    told(compare(cut, still(time), None, Options(shift=shift)), word)
    assert not compare(still(time), still(time)).notes


def test_a_tolerance_in_time_allows_for_rows_at_either_end_and_it_is_told() -> None:
    time = np.linspace(0, 1, 1001)
    for part in (time[time < 0.96], time[time > 0.04]):
        found = compare(still(part), still(time), Tolerances.parse(["0.1,50 ms"]))
        assert found.same, found.line
        assert any("its tolerance in time allows for it" in note for note in found.notes)
        assert compare(still(part), still(time), Tolerances.parse(["0.1,30 ms"])).verdict == "different"
