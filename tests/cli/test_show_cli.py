"""feedsim diff: results and records over each other."""

from __future__ import annotations

import json
import math
import re
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from command_helpers import feedsim
from feedsim import cli
from feedsim.analysis import diagnoses, evaluate
from feedsim.report.show import _figures, _values_text
from report_helpers import circle_run, write_run


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Two circles, the second with another gain in its summary and 1 um more of G."""
    folder = tmp_path_factory.mktemp("results")
    run = circle_run()
    first, second = folder / "as_is", folder / "changed"
    for place in (first, second):
        write_run(run, evaluate(run), place)
    told = json.loads((second / "summary.json").read_text())
    told["machine"]["axes"]["X"]["drive"]["K_v"]["value"] *= 1.25
    told["figures"]["XZ.G"]["value"] += 1.0
    (second / "summary.json").write_text(json.dumps(told))
    assert diagnoses(run)
    return first, second


def show(out: Path, *sources: Path) -> int:
    return cli.main(["diff", *map(str, sources), "--out", str(out)])


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


def test_a_compensated_run_lies_beside_a_run(
    results: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its turn with compensation has the names of a run; what only one result has stands in the table."""
    compensated = tmp_path / "compensated"
    shutil.copytree(results[0], compensated)
    told = json.loads((compensated / "summary.json").read_text())
    G = {"value": 0.25, "unit": "um", "meaning": ""}
    told["figures"] = {"before.G": told["figures"]["XZ.G"], "after.G": G, "X.peak_feedforward": {**G, "unit": "N.m"}}
    told |= {"kind": "compensate", "compensation": {"turn": {"plane": ["X", "Z"]}}}
    (compensated / "summary.json").write_text(json.dumps(told))
    assert show(tmp_path / "out", results[0], compensated) == 0
    said = capsys.readouterr().out
    assert "XZ: circular deviation G 0.00 -> 0.25 um." in said
    assert "before" not in said
    assert "reversal peak of" not in said  # peak_feedforward is none, and the peaks stand on one side alone
    assert "X.peak_feedforward" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


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


def test_the_first_line_says_what_has_changed(results: tuple[Path, Path], tmp_path: Path, capsys: Any) -> None:
    """G has grown by 1 um in the second summary, the peaks have not; a plain number has no unit behind it."""
    told = json.loads((results[1] / "summary.json").read_text())
    told["machine"]["axes"]["Z"]["drive"]["k_ffw"]["value"] = 0.5
    (tmp_path / "slow").mkdir()
    for file in results[1].iterdir():
        if file.is_file():
            (tmp_path / "slow" / file.name).write_bytes(file.read_bytes())
    (tmp_path / "slow" / "summary.json").write_text(json.dumps(told))
    before = json.loads((results[0] / "summary.json").read_text())["figures"]["XZ.G"]["value"]
    assert show(tmp_path / "out", results[0], tmp_path / "slow") == 0
    first, *rest = capsys.readouterr().out.splitlines()
    found = re.match(r"XZ: circular deviation G ([\d.]+) -> ([\d.]+) um; unchanged: ", first)
    assert found, first
    assert float(found[1]) == pytest.approx(before, abs=6e-3)
    assert float(found[2]) == pytest.approx(before + 1, rel=5e-3)
    assert "reversal peak of X" in first
    assert any(re.fullmatch(r"differs: machine\.axes\.Z\.drive\.k_ffw: [\d.]+ \| 0\.5", line) for line in rest), rest
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert page.index('class="answer">XZ: circular deviation G') < page.index("machine.axes.Z.drive.k_ffw")


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ([(8.0, "um"), (10.0, "um")], "8.00 -> 10.0 um (+25 %)"),
        ([(-0.0003, "ms"), (1.5, "ms")], "0.000 -> 1.50 ms"),  # of next to nothing there is no share
        ([(8.0, "um"), None, (2.0, "um")], "8.00 -> – -> 2.00 um"),
        ([(math.nan, "ms"), (99.02, "ms")], "not determined -> 99.0 ms"),
    ],
)
def test_figures_beside_one_another(values: list[tuple[float, str] | None], text: str) -> None:
    assert _values_text(values) == text


def test_results_that_are_alike_are_said_to_be(results: tuple[Path, Path], tmp_path: Path, capsys: Any) -> None:
    assert show(tmp_path / "out", results[0], results[0] / "result.csv") == 0
    capsys.readouterr()
    assert show(tmp_path / "out2", results[0]) == 0
    assert capsys.readouterr().out.startswith("XZ: circular deviation G ")


def test_values_in_unlike_units_have_no_difference() -> None:
    """A figure of an older result may have another unit: neither its value nor a difference is shown."""
    sources: Any = [
        SimpleNamespace(name=name, figures={"XZ.G": value})
        for name, value in (("first", (8.0, "um")), ("second", (9.5, "um")), ("older", (0.008, "mm")))
    ]
    (row,) = _figures(sources).parts[0].rows
    assert row[1:] == ("8.00", "9.50", "+1.50", "–", "–", "µm")


@pytest.mark.parametrize("depth", [100_000, 900])
def test_json_that_is_nested_too_deep_is_refused(depth: int, fmus: Path, tmp_path: Path) -> None:
    """As a capture, as the summary of a result, and as what lies in a folder that a result is written to."""
    deep = f'{{"a": {"[" * depth}{"]" * depth}}}'
    folder = tmp_path / "result"
    folder.mkdir()
    (folder / "result.csv").write_text("time [s],X.x_a [mm]\n0,1\n1,2\n")
    for name in ("deep.json", "result/summary.json"):
        (tmp_path / name).write_text(deep)
    for words in (("convert", "deep.json", "--out", "x.csv"), ("show", "result", "--out", "o"),
                  ("show", "deep.json", "--out", "o"), ("run", "deep.json"), ("run", "result")):  # fmt: skip
        done = feedsim(*words, fmus=fmus, cwd=tmp_path)
        assert done.returncode == 2
        assert len(done.stderr) < 1000
    assert "deep.json: its values are nested too deep" in feedsim("diff", "deep.json", fmus=fmus, cwd=tmp_path).stderr
