"""CSV tables for spreadsheets: no cell with text is a formula, numbers are numbers, and every text comes back."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import feedsim as fs
from feedsim.files import sheets

TEXTS = ["=1+1", "+1+1", "-2+3", "@SUM(A1)", "\t=1", "\r=1", "'=1", "''+x", "'H0003'", "-80 mm", "plain", "", "a=b"]
NUMBERS = ["-1", "+2.5", "-1e-3", "-.5", "-inf", "5."]


def is_formula(cell: str) -> bool:
    """By what spreadsheets begin a formula with, blanks ahead included."""
    try:
        float(cell)
    except ValueError:
        return cell.strip(" \t\r\n")[:1] in ("=", "+", "-", "@") or cell[:1] in ("\t", "\r")
    return False


@pytest.mark.parametrize("text", TEXTS)
def test_no_text_is_a_formula_and_comes_back(text: str) -> None:
    made = sheets.text_of([[text, "end"]])
    ((cell, _),) = csv.reader(io.StringIO(made, newline=""))
    assert not is_formula(cell)
    assert list(sheets.read_rows(io.StringIO(made, newline=""))) == [[text, "end"]]


@pytest.mark.parametrize("number", NUMBERS)
def test_numbers_stay_numbers(number: str) -> None:
    assert sheets.text_of([[number]]) == f"{number}\n"


@given(st.lists(st.text(st.characters(exclude_categories=["Cs"])), min_size=2))
def test_every_text_comes_back(row: list[str]) -> None:
    assert list(sheets.read_rows(io.StringIO(sheets.text_of([row]), newline=""))) == [row]


def test_text_of_a_file_of_a_control_is_no_formula(tmp_path: Path) -> None:
    value = '=HYPERLINK("http://x","5")'
    file = tmp_path / "bad.csv"
    file.write_text(f"parameter;name;value;unit\np1460[0];Kp;{value};Nms/rad\n")
    machine = Path(__file__).resolve().parents[1] / "scenarios" / "machines" / "test_centre"
    made = [
        fs.machine_import(file, "X=bad", machine).files()["sheet.csv"],
        fs.machine_export(machine, file, "X=bad").files()["sheet.csv"],
    ]
    for content in made:
        assert isinstance(content, str)
        cells = [cell for row in csv.reader(io.StringIO(content, newline="")) for cell in row]
        assert f"'{value}" in cells
        assert not any(map(is_formula, cells))
