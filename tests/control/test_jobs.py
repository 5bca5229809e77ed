"""Imports and exports as jobs: what is said, what a sheet shows, and when."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

import feedsim as fs
from feedsim.foundation.errors import InputError

CENTRE = Path(__file__).resolve().parents[2] / "scenarios" / "machines" / "test_centre"
DATA = """N32200 $MA_POSCTRL_GAIN[0,AX1]=5
N32450 $MA_BACKLASH[0,AX1]=0.004
N32610 $MA_VELO_FFW_WEIGHT[0,AX1]=0.9
N32620 $MA_FFW_MODE[AX1]=3
N32900 $MA_DYN_MATCH_ENABLE[AX1]=0
N32910 $MA_DYN_MATCH_TIME[0,AX1]=0.002
"""


class Heard:
    """A watch that keeps notes."""

    def __init__(self) -> None:
        self.notes: list[str] = []

    def note(self, text: str) -> None:
        self.notes.append(text)

    def progress(self, *_: object) -> None:
        """Nothing."""


def written(folder: Path, text: str, name: str = "nc.tea") -> Path:
    file = folder / name
    file.write_text(text)
    return file


def test_a_sheet_and_a_page_have_values_that_people_write(tmp_path: Path) -> None:
    result = fs.machine_import(written(tmp_path, DATA), "X=AX1", CENTRE)
    result.save(tmp_path / "new")
    with (tmp_path / "new" / "sheet.csv").open() as file:
        rows = {row["ours"]: row for row in csv.DictReader(file)}
    key = "value in the machine file"
    shown = {name.rpartition(".")[2] if "back" not in name else "backlash": row[key] for name, row in rows.items()}
    assert shown == {
        "K_v": "83.3333 1/s", "backlash": "4 um", "k_ffw": "0.9", "symmetry_lag": "false", "T_dyn": "0 s"
    }  # fmt: skip
    assert (rows["drive.T_dyn"]["number"], rows["drive.T_dyn"]["value"]) == ("MD32900", "0")
    assert "MD32900 = 0 (nc.tea:5): MD32910 does not act" in (tmp_path / "new" / "machine.yaml").read_text()
    page = (tmp_path / "new" / "report.html").read_text()
    assert "83.3333 1/s" in page
    assert "83.33333333" not in page
    assert "False" not in page
    assert result.answers == ["X: 5 values of AX1, MD32200 = 5 (1000/min)"]


def test_nothing_taken_is_said_first(tmp_path: Path) -> None:
    file = written(tmp_path, "N32200 $MA_POSCTRL_GAIN[0,AX1]=R5\n")
    assert fs.machine_import(file, "X=AX1").findings[0].code == "no-value-taken"
    result = fs.machine_import(file, "X=AX1", CENTRE)
    assert result.findings[0].code == "no-value-taken"
    assert result.findings[0].text.endswith("the machine file is as it was")


def test_nothing_is_said_to_be_replaced_by_a_job_that_fails(tmp_path: Path) -> None:
    """A result of other inputs lies there; the new inputs are faulty."""
    file = written(tmp_path, DATA)
    fs.machine_export(CENTRE, file, "X=AX1", out=tmp_path / "load")
    fs.machine_import(file, "X=AX1", out=tmp_path / "new")
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    heard = Heard()
    with pytest.raises(InputError, match="no such file"):
        fs.machine_export(CENTRE, tmp_path / "no.tea", "X=AX1", out=tmp_path / "load", watch=heard)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="no such file"):
        fs.machine_import(tmp_path / "no.tea", "X=AX1", out=tmp_path / "new", watch=heard)  # type: ignore[arg-type]
    assert heard.notes == []
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def test_a_unit_of_one_is_not_written(tmp_path: Path) -> None:
    result = fs.machine_export(CENTRE, written(tmp_path, DATA), "X=AX1")
    assert "  X MD32610 VELO_FFW_WEIGHT: 0.9 -> 1" in result.lines


def test_a_folder_is_not_a_file_of_a_control(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is a folder; name the files in it"):
        fs.machine_import(tmp_path, "X=AX1")
    with pytest.raises(InputError, match=r"rnd\.arc: holds no parameters") as refused:
        fs.machine_import(written(tmp_path, "nothing", "rnd.arc"), "X=AX1")
    assert str(tmp_path) in str(refused.value)
    with pytest.raises(InputError, match="machine: no such file: nope"):
        fs.machine_import(written(tmp_path, DATA), "X=AX1", "nope")
