"""Studies that ask something: the report answers with the run that has it, held against the table."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from agreement_helpers import assert_numbers_agree
from command_helpers import feedsim, summary_of
from report_helpers import Page
from ssp_helpers import short_scenario

STUDY = """
name: question
scenario: short.yaml
sampling: {{method: grid}}
parameters:
  feed: {{key: motions.0.feed, values: [1000 mm/min, 2000 mm/min, 3000 mm/min]}}
  K_v: {{key: machine.axes.Z.drive.K_v, values: [3 (m/min)/mm, 4 (m/min)/mm]}}
figures: [Z.peak_torque, Z.duration]
{}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    short_scenario(tmp_path)
    return tmp_path


def swept(folder: Path, question: str, fmus: Path) -> tuple[str, Page]:
    (folder / "study.yaml").write_text(STUDY.format(question), encoding="utf-8")
    done = feedsim("sweep", "study.yaml", "--workers", "1", "--out", "out", fmus=fmus, cwd=folder)
    assert done.returncode == 0, done.stderr
    return done.stdout, Page((folder / "out" / "report.html").read_text(encoding="utf-8"))


@pytest.mark.parametrize(("way", "choose"), [("smallest", min), ("largest", max)])
def test_the_answer_is_the_run_of_the_table(way: str, choose: Callable[..., Any], fmus: Path, folder: Path) -> None:
    said, page = swept(folder, f"goal: {way} Z.peak_torque", fmus)
    with (folder / "out" / "table.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    best = choose(rows, key=lambda row: float(row["Z.peak_torque [N.m]"]))
    answer = summary_of(folder / "out")["answer"][0]
    found = re.match(rf"{way.capitalize()} Z\.peak_torque: (\S+) N·m in run (\d+), with feed (\d+)", answer)
    assert found, answer
    assert int(found[2]) == int(best["run"])
    assert float(found[1]) == pytest.approx(float(best["Z.peak_torque [N.m]"]), rel=5e-3)
    assert answer.split(";")[0] in said
    words = " ".join(" ".join(page.words).split())
    assert f"feedsim check study.yaml --row {best['run']}" in words
    assert "It lies at the end of what was tried of feed" in answer
    assert_numbers_agree(folder / "out")
    shown = feedsim("check", "study.yaml", "--row", best["run"], fmus=fmus, cwd=folder).stdout
    assert shown.startswith("feedsim run")


def test_what_is_to_be_explained_comes_first(fmus: Path, folder: Path) -> None:
    swept(folder, "explain: Z.duration", fmus)
    assert summary_of(folder / "out")["answer"][0].startswith("Z.duration: ")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("study.yaml", "--trial", "--row", 3), "--trial and --row 3: one of them"),
        (("xz_circle.yaml", "--trial"), "--trial: is for a study; xz_circle.yaml is none"),
        (("xz_circle.yaml", "--row", 3), "--row 3: is for a study; xz_circle.yaml is none"),
    ],
)
def test_options_of_a_check_that_do_not_fit(words: tuple[object, ...], said: str, fmus: Path, folder: Path) -> None:
    (folder / "study.yaml").write_text(STUDY.format("explain: Z.duration"), encoding="utf-8")
    (folder / "xz_circle.yaml").write_text("", encoding="utf-8")
    done = feedsim("check", *words, fmus=fmus, cwd=folder)
    assert done.returncode == 2
    assert said in done.stderr


@pytest.mark.parametrize(
    ("question", "said"),
    [
        ("goal: least Z.overshoot", "'smallest FIGURE' or 'largest FIGURE' is expected"),
        ("goal: smallest", "'smallest FIGURE' or 'largest FIGURE' is expected"),
        ("goal: smallest Q.overshoot", "'Q.overshoot' is none of the figures"),
        ("goal: smallest Z.settling_time", "'Z.settling_time' is not among `figures`: Z.peak_torque, Z.duration"),
        ("explain: Q.overshoot", "'Q.overshoot' is none of the figures"),
    ],
)
def test_questions_that_cannot_be_answered(question: str, said: str, fmus: Path, folder: Path) -> None:
    (folder / "study.yaml").write_text(STUDY.format(question), encoding="utf-8")
    done = feedsim("check", "study.yaml", "--trial", fmus=fmus, cwd=folder)
    assert done.returncode == 2
    assert said in done.stderr
    assert not (folder / "results").exists()
