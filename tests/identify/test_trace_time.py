"""Time of recorded traces: jitter, gaps, refusals of rows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from feedsim.estimation.identify.read import read_records
from feedsim.estimation.identify.record import GRID_TOLERANCE, even_pieces
from feedsim.foundation.errors import InputError
from record_helpers import DIGITS, SPEED, TIME, TORQUE, mapped, only, refusal, simple, table

REST = "torque: {column: ActTorque}\n"

# --- time: jitter, gaps, refusals -----------------------------------------------------------------------------------


def place(row: int) -> str:
    return f"f:{row + 2}"


def test_jitter_is_evened_out() -> None:
    rng = np.random.default_rng(4)
    time = TIME + 0.9 * GRID_TOLERANCE * 0.002 * rng.uniform(-1, 1, len(TIME))
    time[[0, -1]] = TIME[[0, -1]]
    (piece,), said = even_pieces(time, place)
    np.testing.assert_allclose(piece.time, TIME, rtol=0, atol=1e-15)
    assert said == ()


def test_uneven_time_is_refused() -> None:
    time = TIME.copy()
    time[40:] += 0.0006  # 30 % of a step: neither jitter nor a missing row
    with pytest.raises(InputError, match=r"f:42: the time is not even: 0\.0806 s comes 2\.6 ms after the row"):
        even_pieces(time, place)
    # Too few digits: steps of 2 and 3 ms, or of 1 and 2 ms, which look like gaps.
    for interval in (2.5, 1.25):
        with pytest.raises(InputError, match=rf"time: {{interval: {interval} ms}}"):
            even_pieces(np.round(np.arange(500) * interval + 1e-9) * 1e-3, place)


def test_single_rows() -> None:
    with pytest.raises(InputError, match="f:2: a single row"):
        even_pieces(TIME[:1], place)
    with pytest.raises(InputError, match="no rows"):
        even_pieces(TIME[:0], place)


def test_gaps_make_pieces(tmp_path: Path) -> None:
    kept = np.r_[0:100, 150:151, 200:320, 330:500]
    path = table(tmp_path / "a.csv", {"t [s]": TIME[kept], "n [rad/s]": SPEED[kept], "M [Nm]": TORQUE[kept]})
    found = read_records(path, mapped(tmp_path, "speed: {column: n}\ntorque: {column: M}\n"))
    names = [record.name for record in found.records]
    assert names == ["a.csv, 0 to 0.198 s", "a.csv, 0.4 to 0.638 s", "a.csv, 0.66 to 0.998 s"]
    for record, rows in zip(found.records, (np.r_[0:100], np.r_[200:320], np.r_[330:500]), strict=True):
        np.testing.assert_allclose(record.time, TIME[rows], rtol=0, atol=1e-12)
        np.testing.assert_allclose(record.speed, SPEED[rows], **DIGITS)
        np.testing.assert_allclose(record.torque, TORQUE[rows], **DIGITS)
    missing, left_out = found.provenance.warnings
    assert (missing.code, missing.place, left_out.code) == ("rows-missing", f"{path}:102", "rows-left-out")
    assert "between 0.198 and 0.3 s, and at 2 more places (about 109 in all)" in missing.text
    assert left_out.text.endswith("(1 row)")


@pytest.mark.parametrize("rows", [2, 3, 7])
def test_fragments_between_gaps_do_not_cost_the_file(tmp_path: Path, rows: int) -> None:
    """Between two gaps, at the end, and uneven: too short to be a record, no reason to refuse the others."""
    kept = np.r_[0:100, 150 : 150 + rows, 200:320, 400 : 400 + rows]
    time = TIME.copy()
    time[151] += 0.0006
    path = table(tmp_path / "a.csv", {"t [s]": time[kept], "n [rad/s]": SPEED[kept], "M [Nm]": TORQUE[kept]})
    found = read_records(path, mapped(tmp_path, "speed: {column: n}\ntorque: {column: M}\n"))
    assert [len(record) for record in found.records] == [100, 120]
    assert found.provenance.warnings[1].text.endswith(f"({2 * rows} rows)")


def test_fragments_alone_are_no_record() -> None:
    with pytest.raises(InputError, match="f:2: no 8 rows follow one another without a gap"):
        even_pieces(TIME[np.r_[0:7, 10:17, 30:37]], place)
    (piece, _), _said = even_pieces(TIME[np.r_[0:8, 10:18]], place)
    assert len(piece.time) == 8
    (short,), none = even_pieces(TIME[:3], place)
    assert (len(short.time), none) == (3, ())


@pytest.mark.parametrize(
    ("line", "text", "message"),
    [
        (5, "0.006,,1", "a.csv:5: no value in column 'ActPos'"),
        (5, "0.006,nan,1", "a.csv:5: 'nan' in column 'ActPos'; every value must be a finite number"),
        (5, "0.006,1,off", "a.csv:5: 'off' in column 'ActTorque' is no number"),
        (5, "0.006,1", "a.csv:5: 2 values, the header has 3 columns"),
        (5, "0.004,1,1", "a.csv:5: time 0.004 s follows 0.004 s; it must increase"),
        (5, "0.003,1,1", "a.csv:5: time 0.003 s follows 0.004 s; it must increase"),
        (5, "", "a.csv:5: the row is empty"),
        (1, "t [s],ActPos [mm]", "a.csv:2: 3 values, the header has 2 columns"),
        (1, "t [s],ActPos [mm],ActPos [um]", "a.csv:1: duplicate column 'ActPos'"),
    ],
)
def test_bad_rows(tmp_path: Path, line: int, text: str, message: str) -> None:
    path = simple(tmp_path / "a.csv")
    lines = path.read_text().splitlines()
    lines[line - 1] = text
    path.write_text("\n".join(lines) + "\n")
    assert message in refusal(path, mapped(tmp_path, "position: {column: ActPos}\npitch: 20 mm\n" + REST))


def test_cells_of_other_columns_do_not_matter(tmp_path: Path) -> None:
    path = table(tmp_path / "a.csv", {"t [s]": TIME, "n [rad/s]": SPEED, "M [Nm]": TORQUE, "note": TIME})
    path.write_text(path.read_text().replace("0.006\n", "\n"))
    assert len(only(read_records(path, mapped(tmp_path, "speed: {column: n}\ntorque: {column: M}\n")))) == 500
