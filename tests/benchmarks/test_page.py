"""Figures on speed in the pages are those of docs/benchmarks, of the present version, and none is typed."""

from __future__ import annotations

import json
import re
from pathlib import Path

import page
import pytest

from feedsim import __version__

FILES = {"floor": {"tables": ["| a |\n|---|\n| 1 |\n", "| b |\n|---|\n| 2 |\n"], "quoted": {"loop": "0.9 us"}}}
SETTINGS = ("125 us", "10 ms", "1 ms", "64 MB", "10 GB", "1000 Hz", "100 mm")  # of what is measured
# A cost in a sentence: of a cycle, of a step, as a multiple of real time.
COST = re.compile(
    r"[\d.,]+ (?:us|ns)\b[^.|\n]{0,40}\b(?:per|a|each) (?:control )?(?:cycle|step)\b"
    r"|\b(?:cycle|step)\b[^.|\n]{0,40}\btakes? [^.|\n]{0,40}?[\d.,]+ (?:us|ns)\b"
    r"|[\d.,]+ times as fast as real time|real-time factor (?:of )?[\d.,]+"
)


def test_tables_and_figures_find_their_markers_again_and_again() -> None:
    empty = "# P\n\n<!-- floor 2 -->\n\nIt takes <!--floor: loop-->?<!--/-->.\n\n<!-- other 1 -->\n\n| old |\n|---|\n"
    full = page.filled(empty, FILES)
    assert full == (
        "# P\n\n<!-- floor 2 -->\n\n| b |\n|---|\n| 2 |\n\n"
        "It takes <!--floor: loop-->0.9 us<!--/-->.\n\n<!-- other 1 -->\n"
    )
    assert page.filled(full, FILES) == full


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<!-- floor 3 -->\n", "floor has printed 2 tables, the page wants number 3"),
        ("<!--floor: other-->1<!--/-->", "floor quotes loop; the page wants 'other'"),
        ("<!--gone: loop-->1<!--/-->", "gone quotes nothing; the page wants 'loop'"),
    ],
)
def test_what_was_not_measured_is_an_error(text: str, said: str) -> None:
    with pytest.raises(ValueError, match=re.escape(said)):
        page.filled(text, FILES)


@pytest.mark.parametrize("path", page.PAGES, ids=lambda path: path.name)
def test_pages_have_the_figures_of_the_files(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert page.filled(text, page.read()) == text, "make bench, or benchmarks/page.py, writes the pages' figures"


def test_files_are_of_the_present_version() -> None:
    """A release of another version asks for another `make bench`."""
    files = page.read()
    assert files
    for name, file in files.items():
        assert file["versions"]["feedsim"] == __version__, name
        assert file["short"] is False, name
        assert {"date", "machine", "sources", "load"} <= file.keys(), name


@pytest.mark.parametrize("path", page.PAGES, ids=lambda path: path.name)
def test_no_cost_is_typed(path: Path) -> None:
    text = page.QUOTED.sub("", page.MEASURED.sub("", page.TABLE.sub("", path.read_text(encoding="utf-8"))))
    for setting in SETTINGS:
        text = text.replace(setting, "")
    assert not COST.findall(text)
    if path.name == "performance.md":
        assert not re.findall(r"\b\d[\d.,]* (?:ns|us|ms|s|min|MB|GB|nm|times)\b", text)


def test_short_runs_are_not_taken_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    results, figures = tmp_path / "results", tmp_path / "figures"
    results.mkdir()
    (results / "floor.json").write_text(json.dumps({"short": True}), encoding="utf-8")
    monkeypatch.setattr(page, "RESULTS", results)
    monkeypatch.setattr(page, "FIGURES", figures)
    monkeypatch.setattr(page, "PAGES", ())
    monkeypatch.setattr(page, "ROOT", tmp_path)
    assert page.main() == 0
    assert not list(figures.iterdir())
