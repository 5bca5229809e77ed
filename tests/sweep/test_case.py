"""Runs of a study that is done, named by number or by what stands out, and made once more."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from feedsim import analysis
from feedsim.cli import main
from feedsim.design.sweep import Table
from feedsim.design.sweep.bundle import case, scenario_of
from feedsim.design.sweep.study import run
from feedsim.foundation.errors import InputError
from feedsim.scenario.study import load_study
from feedsim.simulation import cosim

Write = Callable[..., Path]


@pytest.fixture
def done(study: Write, fmus: Path, tmp_path: Path) -> tuple[Path, Table]:
    folder = tmp_path / "results" / "out"
    return folder, run(load_study(study(), runs=4), folder, workers=0, fmus=fmus)


def test_a_case_runs_what_its_row_has(done: tuple[Path, Table], monkeypatch: pytest.MonkeyPatch) -> None:
    folder, table = done
    largest = case(f"{folder}:max=Z.overshoot")
    assert largest is not None
    assert largest.run == int(table["run"][table["Z.overshoot"].argmax()])
    assert largest.name == f"out run {largest.run}, largest Z.overshoot"
    monkeypatch.chdir(folder.parent)  # the study is found from the folder, not from where one is
    scenario, archives = scenario_of(case("out:2"))  # type: ignore[arg-type]
    found = analysis.evaluate(cosim.run(scenario, fmus=archives))
    assert found["Z.overshoot"].value * 1e-6 == table["Z.overshoot"][2]  # bit for bit, but for the unit
    assert case(str(folder)) is None


def test_what_is_no_case_is_refused(done: tuple[Path, Table]) -> None:
    folder, _ = done
    for text, message in (
        ("9", r"run 9 is not done; the table has 4 of 4 runs"),
        ("max=Z.overshot", r"none of the study's figures; did you mean 'Z.overshoot'"),
    ):
        with pytest.raises(InputError, match=message):
            case(f"{folder}:{text}")
    with pytest.raises(InputError, match=r"no table\.csv"):
        case(f"{folder.parent}:1")


def test_a_study_that_has_changed_is_not_made_anew(done: tuple[Path, Table], short: Path) -> None:
    folder, _ = done
    chosen = case(f"{folder}:1")
    assert chosen is not None
    short.write_text(short.read_text().replace("0.8 mm", "0.9 mm"))
    with pytest.raises(InputError, match=r"since its runs were made scenario and machine changed.* --row 1`"):
        scenario_of(chosen)
    record = json.loads((folder / "study.json").read_text())
    del record["place"]
    (folder / "study.json").write_text(json.dumps(record))
    with pytest.raises(InputError, match="does not say where its study file is"):
        scenario_of(chosen)


def test_cases_lie_over_each_other(
    done: tuple[Path, Table], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, table = done
    names = [f"{folder}:min=Z.overshoot", f"{folder}:max=Z.overshoot"]
    assert main(["diff", *names, "--out", str(tmp_path / "over"), "--quiet"]) == 0
    summary = json.loads((tmp_path / "over" / "summary.json").read_text())
    values = [each["figures"]["Z.overshoot"]["value"] for each in summary["sources"]]
    assert values == pytest.approx([1e6 * table["Z.overshoot"].min(), 1e6 * table["Z.overshoot"].max()], rel=1e-12)
    assert "machine.axes.Z.friction.F_C" in summary["differing"]
    page = (tmp_path / "over" / "report.html").read_text(encoding="utf-8")
    assert '<figure id="stop" class="chart lead"' in page
    assert "least Z.overshoot" in page
