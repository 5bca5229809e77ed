"""Files that are compared: CSV of any tool, tolerance files, pairs and folders."""

from __future__ import annotations

import os
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pytest

from compare_helpers import wave, written
from feedsim.comparison import Tolerances, compare_files, pairs_of, tolerances_of
from feedsim.files.columns import load_tolerances
from feedsim.files.trace import read_series
from feedsim.foundation.errors import InputError
from feedsim.scenario.schema import json_schema


def file(tmp_path: Path, content: str | bytes, name: str = "t.csv") -> Path:
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8"))
    return path


# --- reading --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("time,Z.x_a\n0,1\n0.5,2.5\n", ""),
        ('"time","Z.x_a"\n0,1\n0.5,2.5\n', ""),  # FMI cross-check
        ("Time,StepCount,Z.x_a\n0,0,1\n0.5,1,2.5\n", ""),  # libcosim
        ("iterations, time, Z.x_a[REAL]\n0, 0, 1.000000\n1, 0.5, 2.500000\n", ""),  # ecos
        ("\ufefft;Z.x_a [mm]\r\n0;1\r\n0,5;2,5\r\n", "mm"),  # spreadsheet in German
        ("Time [ms]\tZ.x_a (mm)\n0\t1\n500\t2.5\n", "mm"),
        ("Time(s),Z.x_a [mm],\n0,1,\n0.5,2.5,\n", "mm"),  # every line ends with a separator
        ("sep=;\ntime [s];Z.x_a [mm]\n0;1\n0.5;2.5\n", "mm"),
        ("n,time,Z.x_a\n1,0,1\n2,0.5,2.5\n\n\n", ""),
    ],
)
def test_csv_of_any_tool(tmp_path: Path, text: str, unit: str) -> None:
    found = read_series(file(tmp_path, text))
    np.testing.assert_array_equal(found.time, [0, 0.5])
    np.testing.assert_array_equal(found["Z.x_a"], [1, 2.5])
    assert found.units["Z.x_a"] == unit


def test_events_missing_values_words_and_arrays(tmp_path: Path) -> None:
    rows = ("0,1,,true,idle,1,1", "1,NaN,inf,False,run,2,2", "1,3,-1,true,run,3,3", "")
    found = read_series(file(tmp_path, "\n".join(("time,x[1],x[2],on,state,der(x),n [1]", *rows))))
    np.testing.assert_array_equal(found.time, [0, 1, 1])
    np.testing.assert_array_equal(found["x[1]"], [1, np.nan, 3])
    np.testing.assert_array_equal(found["x[2]"], [np.nan, np.inf, -1])
    np.testing.assert_array_equal(found["on"], [1, 0, 1])
    assert found.skipped == ("state",)
    assert dict(found.units) == {"x[1]": "", "x[2]": "", "on": "", "der(x)": "", "n": "1"}


def test_time_of_another_name(tmp_path: Path) -> None:
    path = file(tmp_path, "k,clock,x\n0,0,1\n1,1000,2\n")
    np.testing.assert_array_equal(read_series(path, time="clock:us").time, [0, 1e-3])
    with pytest.raises(InputError, match="no time column"):
        read_series(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time,x\n0,1\n1\n", "t.csv:3: 1 values, the header has 2 columns"),
        ("time,x\n0,1\n2,1\n1,1\n", "t.csv:4: time 1 follows 2; it must not run back"),
        ("time,x\n0,1\n,1\n", "t.csv:3: '' in the time column 'time'"),
        ("time,x\n0,1\nnan,1\n", "every instant must be a finite number"),
        ("time,x,x\n0,1,1\n", "duplicate column 'x'"),
        ("0,1\n1,2\n", "the first line holds numbers"),
        ("time,x\n", "no rows below the header"),
        ("", "the file is empty"),
    ],
)
def test_what_cannot_be_read_is_unusable(tmp_path: Path, text: str, message: str) -> None:
    good = written(tmp_path / "good.csv", wave())
    bad = file(tmp_path, text)
    for pair in ((bad, good), (good, bad)):
        found = compare_files(*pair)
        assert (found.verdict, found.exit_code) == ("unusable", 2)
        assert message in found.problem
    assert "no such file" in compare_files(tmp_path / "nix.csv", good).problem


# --- tolerance files ------------------------------------------------------------------------------------------------

TOLERANCES = """
name: Z move
value: 1e-6
time: 125 us
variables:
  "*.x_a": 2 nm
  "*.M_a": {value: 1e-3 N.m, time: 1 ms}
  "*.limited": {hold: true}
  "Y.*": ignore
  "X.x_a": 0.1 %
"""


def test_tolerance_file(tmp_path: Path) -> None:
    found = Tolerances.of_file(load_tolerances(file(tmp_path, TOLERANCES, "a.yaml")))
    assert found.of("other").value == 1e-6
    assert found.of("other").relative
    assert found.of("other").time == 125e-6
    assert (found.of("Z.x_a").value, found.of("Z.x_a").unit, found.of("Z.x_a").time) == (2, "nm", 125e-6)
    assert (found.of("Z.M_a").value, found.of("Z.M_a").unit, found.of("Z.M_a").time) == (1e-3, "N.m", 1e-3)
    assert found.of("Z.limited").hold
    assert found.of("Y.x").ignore
    assert (found.of("X.x_a").value, found.of("X.x_a").relative) == (1e-3, True)


def test_all_problems_of_a_tolerance_file(tmp_path: Path) -> None:
    bad = 'value: -1\ntime: 2 mm\nvariables:\n  "a": 2 furlong\n  "b": {vlaue: 1}\n  "c": true\n'
    with pytest.raises(InputError) as caught:
        load_tolerances(file(tmp_path, bad, "a.yaml"))
    for part in ("a.yaml:1", "a.yaml:2", "a.yaml:4", "furlong", "a.yaml:5", "did you mean 'value'", "a.yaml:6"):
        assert part in str(caught.value)


def test_schema_of_tolerance_files() -> None:
    jsonschema = pytest.importorskip("jsonschema")
    import yaml

    schema = json_schema("tolerances")
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    assert not list(validator.iter_errors(yaml.safe_load(TOLERANCES)))
    for bad in (
        {"value": -1},
        {"value": "nm"},
        {"vale": 1},
        {"variables": {"a": True}},
        {"variables": {"a": {"x": 1}}},
    ):
        assert list(validator.iter_errors(bad)), bad


def test_tolerances_beside_the_reference(tmp_path: Path) -> None:
    reference = written(tmp_path / "case_ref.csv", wave())
    assert tolerances_of(reference, None, []).of("Z.x_a").value == 1e-3
    file(tmp_path, "value: 1e-4", "tolerances.yaml")
    assert tolerances_of(reference, None, []).of("Z.x_a").value == 1e-4
    own = file(tmp_path, "value: 1e-5", "case.tolerances.yaml")
    assert tolerances_of(reference, None, []).of("Z.x_a").value == 1e-5
    assert tolerances_of(reference, None, ["1e-7"]).of("Z.x_a").value == 1e-7
    assert tolerances_of(tmp_path / "other.csv", own, []).of("Z.x_a").value == 1e-5


# --- pairs ----------------------------------------------------------------------------------------------------------


def test_pairs(tmp_path: Path) -> None:
    results, references = tmp_path / "results", tmp_path / "references"
    for name in ("a.csv", "deep/b.csv"):
        written(references / name, wave())
        written(results / name, wave())
    written(references / "lost.csv", wave())
    written(results / "more.csv", wave())
    assert pairs_of([results, references]) == [
        (results / name, references / name) for name in ("a.csv", Path("deep/b.csv"), "lost.csv")
    ]
    a, b = results / "a.csv", references / "deep" / "b.csv"
    assert pairs_of([a, b, b, a]) == [(a, b), (b, a)]
    assert pairs_of([a, references]) == [(a, references / "a.csv")]
    for wrong in ([a], [a, b, a], []):
        with pytest.raises(InputError, match="in turn"):
            pairs_of(wrong)
    with pytest.raises(InputError, match="no such folder of results"):
        pairs_of([tmp_path / "nix", references])
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="no CSV file"):
        pairs_of([results, tmp_path / "empty"])


def test_folders_in_the_layout_of_the_cross_check(tmp_path: Path) -> None:
    results, references = tmp_path / "results", tmp_path / "references"
    for name in ("one_ref.csv", "one_in.csv", "one_par.csv", "held/two_ref.csv"):
        written(references / name, wave())
    written(results / "one.csv", wave())
    assert pairs_of([results, references]) == [
        (results / "held" / "two_ref.csv", references / "held" / "two_ref.csv"),
        (results / "one.csv", references / "one_ref.csv"),
    ]


def test_folders_that_vanish_while_it_looks_are_passed_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("ours", "theirs"):
        (tmp_path / name / "gone").mkdir(parents=True)
        file(tmp_path / name, "time,x\n0,1\n")
    scandir = os.scandir

    def vanished(path: Any = ".") -> Any:
        if Path(path).name == "gone":
            raise FileNotFoundError(path)
        return scandir(path)

    monkeypatch.setattr(os, "scandir", vanished)
    assert pairs_of([tmp_path / "ours", tmp_path / "theirs"]) == [
        (tmp_path / "ours" / "t.csv", tmp_path / "theirs" / "t.csv")
    ]


@pytest.mark.extensive
def test_time_of_a_comparison_grows_with_the_number_of_columns_alone(tmp_path: Path) -> None:
    """Of columns that are the same, differ or are missing; four times as many would take sixteen times as long."""

    def seconds(count: int) -> float:
        rows = [",".join([str(k), *("1.5" if i % 3 else str(k + 1) for i in range(count))]) for k in range(3)]
        ours = file(tmp_path, "\n".join([",".join(["time", *(f"a{i}.x [m]" for i in range(count))]), *rows]), "a.csv")
        names = [f"a{i}.x [m]" if i % 2 else f"b{i}.y [m]" for i in range(count)]
        other = [row.replace("1.5", "1.75") for row in rows]
        theirs = file(tmp_path, "\n".join([",".join(["time", *names]), *other]), "b.csv")
        begin = process_time()
        assert compare_files(ours, theirs).verdict == "different"
        return process_time() - begin

    seconds(10)
    assert seconds(8000) < 9 * seconds(2000)
