"""The shift in time that is found: of the columns and the time that are compared, gaps or not, and in little time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compare_helpers import changed, wave, written
from feedsim.cli import main
from feedsim.comparison import Options, Tolerances, estimated_shift
from feedsim.files.trace import Array, Series
from feedsim.foundation.errors import InputError


def moves(time: Array, late: float = 0.0, torque_late: float | None = None) -> Series:
    """Wave of 1 Hz, its torque late by an amount of its own."""
    late_torque = late if torque_late is None else torque_late
    return Series(
        time,
        {
            "Z.x_a": 0.1 + 0.05 * np.sin(2 * np.pi * (time - late)),
            "Z.M_a": 3.0 * np.cos(2 * np.pi * (time - late_torque)),
        },
        {"Z.x_a": "m", "Z.M_a": "N.m"},
    )


@pytest.mark.parametrize("true", [7.31e-3, -12.2e-3, 0.0])
def test_estimated_shift(true: float) -> None:
    at = np.arange(0.2, 1.8, 1.7e-3)
    result = moves(at, -true)
    noisy = changed(result, Z__x_a=result["Z.x_a"] + 1e-5 * np.random.default_rng(3).normal(size=len(at)))
    # noise of 1e-4 of the range over 900 rows of slope 2 pi: 1e-4/(2 pi sqrt(900)), far below 2 us
    assert estimated_shift(noisy, wave(2001), 0.05).seconds == pytest.approx(true, abs=2e-6)
    if true:
        with pytest.raises(InputError, match="allow a larger one"):
            estimated_shift(noisy, wave(2001), 0.005)
    with pytest.raises(InputError, match="must be more than 0"):
        estimated_shift(noisy, wave(2001), 0.0)


def test_what_is_not_compared_does_not_count() -> None:
    """A torque late by 40 ms in a record whose position is early by 12.3 ms; ignored by a rule, an option, a file."""
    time = np.linspace(0, 2, 2001)
    record, result = moves(time, -12.3e-3, 40e-3), moves(time)
    both = estimated_shift(result, record, 0.05).seconds
    assert abs(both + 12.3e-3) > 5e-3  # so that the following can fail
    # straight lines between rows 1 ms apart: (2 pi)^2 h^2/8 of the amplitude, the same everywhere; below 1 us in time
    for options, tolerances in (
        (None, Tolerances.parse(["Z.M_a=ignore"])),
        (Options(ignore=["Z.M_a"]), None),
        (Options(only=["Z.x_a"]), None),
    ):
        found = estimated_shift(result, record, 0.05, options, tolerances)
        assert found.seconds == pytest.approx(-12.3e-3, abs=1e-6)
        assert found.used == ("Z.x_a",)


def test_only_the_compared_time_counts() -> None:
    """A clock that jumps by 30 ms in the middle of the record: either half has its own shift."""
    time = np.linspace(0, 4, 4001)
    early, late = moves(time, 4e-3), moves(time, 34e-3)
    record = Series(time, {n: np.where(time < 2, early[n], late[n]) for n in early}, early.units)
    result = moves(time)
    for options, shift in ((Options(end=1.9), 4e-3), (Options(start=2.1), 34e-3), (Options(start=2.1, end=2.6), 34e-3)):
        assert estimated_shift(result, record, 0.05, options).seconds == pytest.approx(shift, abs=1e-6)


def test_rows_without_numbers_are_left_out() -> None:
    time = np.linspace(0, 2, 2001)
    record, result = moves(time, 8e-3), moves(time)
    holed = changed(record, Z__x_a=np.where((time > 0.7) & (time < 0.9), np.nan, record["Z.x_a"]))
    assert estimated_shift(result, holed, 0.05).seconds == pytest.approx(8e-3, abs=1e-6)
    x = result["Z.x_a"].copy()
    x[[3, 500]] = np.nan, np.inf
    found = estimated_shift(changed(result, Z__x_a=x), record, 0.05)
    assert found.seconds == pytest.approx(8e-3, abs=1e-6)
    assert found.used == ("Z.x_a", "Z.M_a")
    still = changed(record, Z__M_a=np.zeros(2001))
    found = estimated_shift(result, still, 0.05)
    assert found.note == "the shift in time is found from Z.x_a; without Z.M_a: the reference does not move"
    empty = changed(result, Z__M_a=np.full(2001, np.nan))
    assert estimated_shift(empty, record, 0.05).left_out == {"Z.M_a": "no numbers there"}
    with pytest.raises(InputError, match="no column of the reference moves"):
        estimated_shift(result, changed(still, Z__x_a=np.zeros(2001)), 0.05)


def test_a_record_with_gaps(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A drive that stopped logging twice: each gap becomes a row without numbers."""
    time = np.arange(2001) * 1e-3
    kept = ((time < 0.5) | (time > 0.62)) & ((time < 1.2) | (time > 1.5))
    x = 0.1 + 0.05 * np.sin(2 * np.pi * (time - 0.0123))
    mapping = tmp_path / "columns.yaml"
    mapping.write_text(
        "time: {column: t, unit: s}\nposition: {column: x, unit: m}\ntorque: {column: M, unit: N.m}\npitch: 20 mm\n",
        encoding="utf-8",
    )
    rows = np.column_stack([time, x, 3 * np.cos(2 * np.pi * (time - 0.0123))])[kept]
    record = tmp_path / "record.csv"
    np.savetxt(record, rows, delimiter=",", fmt="%.17g", header="t [s],x [m],M [N.m]", comments="")
    result = written(tmp_path / "result.csv", wave(4001))
    words = [str(result), str(record), "--reference-columns", str(mapping), "--axes", "Z", "--tol", "1e-4"]
    assert main(["compare", *words, "--shift", "estimate"]) == 0
    out = capsys.readouterr().out
    assert "shifted by 12.3" in out
    assert "the shift in time is found from Z.M_a, Z.x_a" in out or "found from Z.x_a, Z.M_a" in out
    assert main(["compare", *words]) == 1


def test_a_short_motion_in_a_long_rest_is_found() -> None:
    """Fewer rows are looked at than there are: a move of 20 ms in 6 s is not between them."""
    time = np.arange(48_000) * 125e-6

    def bump(late: float) -> Series:
        return Series(time, {"x": 0.5 * (1 + np.tanh((time - 3 - late) / 2e-3)) * np.exp(-(((time - 3) / 10e-3) ** 2))})

    moved = np.interp(time, time + 21e-3, bump(0)["x"])
    found = estimated_shift(bump(0), Series(time, {"x": moved}), 0.05)
    assert found.seconds == pytest.approx(21e-3, abs=1e-6)


def test_many_rows_and_columns() -> None:
    time = np.arange(48_000) * 125e-6
    result = Series(time, {f"c{k}": np.sin((k % 7 + 1) * time + k) for k in range(40)})
    reference = Series(time, {n: np.interp(time, time + 5e-3, v) for n, v in result.columns.items()})
    # the first 5 ms of 6 s hold the first value, which is not what is shifted
    assert estimated_shift(result, reference, 0.05).seconds == pytest.approx(5e-3, abs=1e-4)
    few = Options(only=["c1", "c2"])
    assert estimated_shift(result, reference, 0.05, few).seconds == pytest.approx(5e-3, abs=1e-4)
