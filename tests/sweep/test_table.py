"""Tables: what is written is read back, in both formats, with units and provenance."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from feedsim.design.sweep import Design, Outcome, Table, design, read_table, write_table
from feedsim.design.sweep.table import table_of
from feedsim.foundation.errors import Finding, InputError, OutputError
from feedsim.scenario.study import load_study


@pytest.fixture
def planned(study: Callable[..., Path]) -> Design:
    return design(load_study(study()))


def outcomes(runs: int) -> list[Outcome]:
    made = []
    for run in range(runs):
        if run % 4 == 1:
            made.append(Outcome(run, None, 'two,\n "lines"; ü', 0.1))
        else:
            figures = {"Z.b": (run / 3 + 1e-7, "m"), "Z.a": (float("nan") if run % 3 else -0.1, "Hz")}
            findings = (Finding("loop-unstable", "wrong", "one"), Finding("torque-clipped", "doubt", "two"))
            made.append(Outcome(run, figures, None, 0.2, findings[: run % 3]))
    return made


def table(planned: Design, runs: int = 16, patterns: list[str] | None = None) -> Table:
    provenance = {"study": "S", "parameters": [{"name": p.name} for p in planned.parameters],
                  "sampling": {"runs": planned.runs}}  # fmt: skip
    return table_of(planned, range(runs), outcomes(runs)[::-1], patterns, provenance)


def equal(one: Table, two: Table) -> bool:
    return [*one.columns] == [*two.columns] and all(
        np.array_equal(one[name], two[name], equal_nan=one[name].dtype == float) for name in one.columns
    )


def test_columns(planned: Design) -> None:
    found = table(planned)
    assert [*map(found.label, found.columns)] == [
        "run", "F_C [N.m]", "W [1]", "scheme", "Z.b [m]", "Z.a [Hz]", "status", "message", "warnings", "seconds [s]",
    ]  # fmt: skip
    assert found.parameters == ("F_C", "W", "scheme")
    assert found.figures == ("Z.b", "Z.a")
    assert np.count_nonzero(~found.ok) == 4
    assert found["message"][1] == 'two, "lines"; ü'
    assert found["warnings"][2] == "WRONG: one | two"
    assert [finding.code for finding in found.findings[2]] == ["loop-unstable", "torque-clipped"]
    assert np.array_equal(found["F_C"], planned.values[:, 0])
    assert set(found["scheme"]) == {"extrapolated", "jacobi"}
    with pytest.raises(InputError, match=r"no column 'Z\.B'; did you mean 'Z\.b'"):
        found["Z.B"]


def test_an_outcome_of_a_run_that_is_not_done_is_in_no_row(planned: Design) -> None:
    """It must not fall into the last one."""
    other = Outcome(9, {"Z.b": (99.0, "m")}, None, 9.0, (Finding("not-settled", "doubt", "nine"),))
    found = table_of(planned, range(4), [*outcomes(4), other], None, {})
    assert equal(found, table_of(planned, range(4), outcomes(4), None, {}))


def test_patterns(planned: Design) -> None:
    assert table(planned, patterns=["*.a"]).figures == ("Z.a",)
    with pytest.raises(InputError, match=r"'Z\.c' is none of the figures"):
        table(planned, patterns=["Z.c"])


@pytest.mark.parametrize("kind", ["csv", "parquet"])
@pytest.mark.parametrize("runs", [0, 5, 16])
def test_read_back(planned: Design, tmp_path: Path, kind: str, runs: int) -> None:
    if kind == "parquet":
        pytest.importorskip("pyarrow")
    found = table(planned, runs)
    file = tmp_path / f"table.{kind}"
    write_table(found, file)
    first = file.read_bytes()
    write_table(table(planned, runs), file)
    assert file.read_bytes() == first
    (tmp_path / "study.json").write_text('{"parameters": [{"name": "F_C"}, {"name": "W"}, {"name": "scheme"}], '
                                         '"sampling": {"runs": 16}}')  # fmt: skip
    back = read_table(tmp_path)
    assert equal(found, back)
    assert dict(back.units) == dict(found.units)
    assert (back.parameters, back.figures, back.partial) == (found.parameters, found.figures, runs < 16)


def test_pandas_finds_numbers(planned: Design, tmp_path: Path) -> None:
    """No cell holds a line break, and what is missing is empty: csv readers need no options."""
    write_table(table(planned), tmp_path / "table.csv")
    lines = (tmp_path / "table.csv").read_text().splitlines()
    assert len(lines) == 17
    assert lines[2].split(",")[4:6] == ["", ""]


def test_parquet_without_pyarrow(planned: Design, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(InputError, match=r'pip install "feedsim\[parquet\]"'):
        write_table(table(planned), tmp_path / "table.parquet")
    assert not any(tmp_path.glob("table*"))


def test_what_is_no_table(tmp_path: Path, planned: Design) -> None:
    with pytest.raises(InputError, match=r"no table\.csv"):
        read_table(tmp_path)
    (tmp_path / "table.csv").write_text("time [s],Z.x_a [m]\n0,1\n")
    with pytest.raises(InputError, match="not the table of a study"):
        read_table(tmp_path)
    (tmp_path / "table.csv").write_text("run,v [m/s],status\n0,fast,ok\n")
    with pytest.raises(InputError, match="column 'v'"):
        read_table(tmp_path)
    with pytest.raises(OutputError):
        write_table(table(planned), tmp_path / "no" / "table.csv")
