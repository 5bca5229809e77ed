"""feedsim show: results and records over each other."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from feedsim import cli
from feedsim.analysis import diagnoses, evaluate
from feedsim.report import run as report
from report_helpers import circle_run


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Two circles, the second with another gain in its summary and 1 um more of G."""
    folder = tmp_path_factory.mktemp("results")
    run = circle_run()
    first, second = folder / "as_is", folder / "changed"
    for place in (first, second):
        report.write(run, evaluate(run), place)
    told = json.loads((second / "summary.json").read_text())
    told["machine"]["axes"]["X"]["drive"]["K_v"]["value"] *= 1.25
    told["figures"]["XZ.G"]["value"] += 1.0
    (second / "summary.json").write_text(json.dumps(told))
    assert diagnoses(run)
    return first, second


def show(out: Path, *sources: Path) -> int:
    return cli.main(["show", *map(str, sources), "--out", str(out)])


def test_what_differs_is_told(results: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert show(tmp_path / "out", *results) == 0
    said = capsys.readouterr().out
    assert "differs: machine.axes.X.drive.K_v: 4 (m/min)/mm | 5 (m/min)/mm\n" in said
    assert said.count("differs: ") == 1
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert list(summary["differing"]) == ["machine.axes.X.drive.K_v"]
    assert [source["name"] for source in summary["sources"]] == ["as_is", "changed"]
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "+1.00<" in page  # the difference of G
    assert set(re.findall(r'<figure id="([\w-]+)" class="chart(?: lead)?"', page)) >= {"contour-XZ", "position"}


def test_a_record_lies_beside_a_result(results: tuple[Path, Path], tmp_path: Path) -> None:
    """Units of the file are converted; a signal that it lacks is missing from its picture alone."""
    t = np.arange(200) * 10.0
    table = np.column_stack([t, 785 + np.sin(t / 300), 3 * np.cos(t / 300)])
    np.savetxt(tmp_path / "record.csv", table, "%.6f", ",", header="t [ms],X.x_a [mm],X.M_a [N.m]", comments="")
    assert show(tmp_path / "out", results[0], tmp_path / "record.csv") == 0
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert {"contour-XZ", "position", "torque"} <= set(
        re.findall(r'<figure id="([\w-]+)" class="chart(?: lead)?"', page)
    )
    assert "Parameters that differ" not in page  # one of them has none


def test_sources_of_one_name_are_told_apart(results: tuple[Path, Path], tmp_path: Path) -> None:
    assert show(tmp_path / "out", results[0] / "result.csv", results[1] / "result.csv") == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert [source["name"] for source in summary["sources"]] == ["as_is/result.csv", "changed/result.csv"]


def test_what_cannot_be_shown_is_refused_at_once(
    results: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "untimed.csv").write_text("a [m],b [m]\n1,2\n2,3\n")
    (tmp_path / "back.csv").write_text("t [s],b [m]\n1,2\n0,3\n")
    assert show(tmp_path / "out", results[0], *(tmp_path / name for name in ("empty", "untimed.csv", "back.csv"))) == 2
    said = capsys.readouterr().err
    for message in ("has no result.csv", "has no column of time", "its time does not rise"):
        assert message in said
    assert not (tmp_path / "out" / "report.html").exists()


def test_a_result_is_not_written_over(results: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    before = (results[0] / "summary.json").read_bytes()
    assert show(results[0], *results) == 4
    assert "is an input" in capsys.readouterr().err
    assert (results[0] / "summary.json").read_bytes() == before
