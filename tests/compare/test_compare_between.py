"""How much of a result a comparison covers, and thinned references that hold what lies between their rows."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from compare_helpers import changed, wave, written
from feedsim.cli import main
from feedsim.comparison import Options, Tolerances, compare, thin_series
from feedsim.files.trace import Array, Series, as_series

TIGHT = Tolerances.parse(["1e-6"])
DENSE = wave(3201)
KEPT, BOUNDS = thin_series(DENSE, 32)


def at(time: Array) -> Series:
    """The dense reference as a simulator with another grid has it."""
    columns = {name: np.interp(time, DENSE.time, values) for name, values in DENSE.columns.items()}
    return Series(time, columns, DENSE.units)


def off_between(amount: float) -> Series:
    """M_a off in the 31 of 32 rows that the thinned reference has not."""
    return changed(DENSE, Z__M_a=DENSE["Z.M_a"] + amount * (np.arange(3201) % 32 != 0))


def planted(folder: Path, *, bounds: bool) -> list[str]:
    result, reference = written(folder / "result.csv", off_between(0.5)), written(folder / "case_ref.csv", KEPT)
    if bounds:
        written(folder / "case_ref.bounds.csv", BOUNDS)
    return ["compare", str(result), str(reference), "--tol", "1e-3"]


def test_a_thinned_reference_says_which_share_of_the_rows_it_covers(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    outputs = {kind: tmp_path / f"out.{kind}" for kind in ("html", "xml")}
    words = planted(tmp_path, bounds=False)
    given = ["--report", str(outputs["html"]), "--junit", str(outputs["xml"])]
    assert main([*words, *given]) == 0
    first = capsys.readouterr().out.splitlines()[0]
    assert "same in 3 % of the rows: 3 variables; compared 101 of 3201 rows (3 %), all columns" in first
    page = outputs["html"].read_text(encoding="utf-8")
    assert "Comparison: same in 3 % of the rows" in page
    assert "The other rows may hold anything" in page
    assert ElementTree.parse(outputs["xml"]).find(".//property").attrib == {  # type: ignore[union-attr]
        "name": "compared", "value": "101 of 3201 rows (3 %), all columns",
    }  # fmt: skip
    assert main([*words, "--json"]) == 0
    (told,) = json.loads(capsys.readouterr().out)["comparisons"]
    assert (told["coverage"]["rows"], told["coverage"]["of_rows"]) == (101, 3201)
    assert main([*words, "--cover", "90 %"]) == 1
    assert "101 of 3201 rows of the result are compared, 90 % are asked for" in capsys.readouterr().out
    assert main([*words, "--cover", "3 %"]) == 0
    assert main([*words, "--cover", "101 %"]) == 2


def test_bounds_find_what_lies_between_the_rows(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(planted(tmp_path, bounds=True)) == 1
    out = capsys.readouterr().out
    assert "1 of 3 variables outside; compared all 3201 rows, all columns; worst Z.M_a: off by 0.5" in out
    assert main(["compare", str(written(tmp_path / "result.csv", DENSE)), str(tmp_path / "case_ref.csv")]) == 0
    assert "same: 3 variables; compared all 3201 rows" in capsys.readouterr().out
    assert main(["compare", str(tmp_path / "a"), str(tmp_path), "--quiet"]) == 2  # the bounds are no reference


@pytest.mark.parametrize("off", [0.0, 3e-5])
@pytest.mark.parametrize(
    ("time", "share"),
    [
        pytest.param(np.linspace(0, 2, 801), 1.0, id="sparser"),
        pytest.param(np.linspace(0, 2, 9601), 1.0, id="denser"),
        pytest.param(np.r_[0.0, np.linspace(3e-4, 2 - 3e-4, 3199), 2.0], 1.0, id="shifted"),
        pytest.param(np.linspace(-1, 3, 6401), 0.5, id="longer"),
        pytest.param(np.linspace(0, 2, 40), 1.0, id="sparser than the thinned one"),
    ],
)
def test_other_grids(time: Array, share: float, off: float) -> None:
    result = at(time)
    result = changed(result, Z__x_a=result["Z.x_a"] + off * (np.arange(len(time)) % 2))
    found = compare(result, KEPT, Tolerances.parse(["1e-4"]), between=BOUNDS)
    assert found.same is (off == 0), found.line
    assert found.coverage is not None
    assert found.coverage.share == pytest.approx(share, abs=1e-3)
    # without bounds: whatever rests on the rows looked at
    bare = compare(at(time), KEPT, Tolerances.parse(["1e-1"]), Options(at="reference")).coverage
    assert bare is not None
    assert bare.rows <= 2 * len(KEPT)
    assert bare.rows == min(len(time), bare.rows)


def test_a_shorter_result_is_different_and_says_so() -> None:
    found = compare(at(np.linspace(0, 1, 1601)), KEPT, TIGHT, between=BOUNDS)
    assert found.verdict == "different"
    assert "ends at 1 s" in found.line
    assert "compared all 1601 rows" in found.line


def test_time_may_be_off_between_the_rows_as_far_as_it_is_allowed() -> None:
    late = Series(DENSE.time, at((DENSE.time - 4e-4).clip(0)).columns, DENSE.units)
    for reach, same in (("5e-4 s", True), ("2e-4 s", False)):
        assert compare(late, KEPT, Tolerances.parse(["1e-9", reach]), between=BOUNDS).same is same


def test_the_least_covered_variable_counts() -> None:
    half = np.where(DENSE.time < 1, DENSE["Z.M_a"], np.nan)
    found = compare(DENSE, changed(DENSE, Z__M_a=half), TIGHT)
    assert found.coverage is not None
    assert found.same
    assert found.coverage.share == pytest.approx(0.5, abs=1e-3)
    assert "same in 49 % of the rows" in found.line or "same in 50 % of the rows" in found.line


def test_a_tolerance_as_wide_as_the_reference_is_told() -> None:
    flat = changed(DENSE, Z__M_a=0 * DENSE.time)
    found = compare(flat, DENSE, Tolerances.parse(["Z.M_a=3 N.m"]))
    assert found.same
    assert "Z.M_a: the tolerance is as wide as what the reference does: a constant would be the same too" in found.notes
    late = compare(DENSE, DENSE, Tolerances.parse(["Z.x_a=1 s"]))
    assert any(note.startswith("Z.x_a: the tolerance is as wide") for note in late.notes)
    assert not any("as wide" in note for note in compare(DENSE, DENSE).notes)
    assert not any("as wide" in note for note in compare(DENSE, flat, Tolerances.parse(["Z.M_a=3 N.m"])).notes)


def test_files_that_are_not_compared_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("results/a.csv", "results/b.csv", "references/a.csv"):
        written(tmp_path / name, DENSE)
    assert main(["compare", str(tmp_path / "results"), str(tmp_path / "references")]) == 0
    assert "results: 1 CSV files have no reference: b.csv" in capsys.readouterr().out
    same = str(tmp_path / "results" / "a.csv")
    assert main(["compare", same, same]) == 0
    assert "note: result and reference are the same file" in capsys.readouterr().out


def test_columns_and_time_that_are_left_out_are_told() -> None:
    more = Series(DENSE.time, {**DENSE.columns, "extra": DENSE.time})
    assert "3 of 4 columns" in compare(more, DENSE).line
    ignored = compare(DENSE, DENSE, Tolerances.parse(["Z.M_a=ignore"])).line
    assert "2 of 3 columns, 2 of 3 of the reference's" in ignored
    part = compare(DENSE, DENSE, None, Options(start=0.5, end=1.0)).line
    assert "same in 25 % of the rows" in part
    assert "0.5 of 2 s" in part


@pytest.mark.parametrize(
    ("between", "reason"),
    [
        (thin_series(DENSE, 16)[1], "of another one: 201 rows"),
        (Series(BOUNDS.time, {"Z.x_a.below": BOUNDS["Z.x_a.below"]}), "column 'Z.x_a.below'; pairs"),
        (Series(BOUNDS.time, {"b.below": BOUNDS.time, "b.above": BOUNDS.time}), "NAME a column of the reference"),
        (changed(BOUNDS, Z__x_a__below=BOUNDS.time * np.nan), "no number in column 'Z.x_a.below' at 0 s"),
    ],
)
def test_bounds_of_something_else_are_refused(between: Series, reason: str, tmp_path: Path) -> None:
    from feedsim.comparison import compare_files

    result, reference = written(tmp_path / "r.csv", DENSE), written(tmp_path / "case.csv", KEPT)
    written(tmp_path / "case.bounds.csv", between)
    found = compare_files(result, reference)
    assert found.verdict == "unusable"
    assert reason in found.line


def test_bounds_are_those_of_the_dense_reference() -> None:
    """Brute force: line plus bounds hold every dense row, and one of them is touched in every interval."""
    random = np.random.default_rng(3)
    dense = as_series(Series(np.cumsum(random.uniform(0.1, 1, 101)), {"a": random.normal(size=101)}))
    kept, between = thin_series(dense, 7)
    assert kept.time[-1] == dense.time[-1]
    for k in range(1, len(kept)):
        rows = (dense.time >= kept.time[k - 1]) & (dense.time <= kept.time[k])
        off = dense["a"][rows] - np.interp(dense.time[rows], kept.time[k - 1 : k + 1], kept["a"][k - 1 : k + 1])
        assert between["a.below"][k] == pytest.approx(min(off.min(), 0), abs=1e-14)
        assert between["a.above"][k] == pytest.approx(max(off.max(), 0), abs=1e-14)
