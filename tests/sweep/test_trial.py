"""What is tried before a study is made: --dry-run and validate."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from time import sleep

import pytest

from feedsim.cli import main
from feedsim.design.sweep import design
from feedsim.design.sweep.study import run
from feedsim.design.sweep.trial import TRIAL_RUN_COUNT, spread, trial
from feedsim.scenario import Scenario
from feedsim.scenario.study import load_study
from feedsim.simulation import nc

Write = Callable[..., Path]


@pytest.mark.parametrize("runs", [1, 2, 3, 7, 64, 1000])
def test_runs_that_are_tried_lie_apart(runs: int) -> None:
    order = [*spread(runs)]
    assert sorted(order) == [*range(runs)]
    assert order[0] == runs // 2
    if runs >= 64:
        assert min(abs(a - b) for a in order[:7] for b in order[:7] if a != b) >= runs // 8


def test_the_time_told_is_that_of_runs_of_the_study(
    study: Write, fmus: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Motions that differ from run to run are planned in each: the time has to be in what is told."""
    takes = 0.1

    def slowly(scenario: Scenario) -> nc.Program:
        sleep(takes)
        return nc.plan(scenario)

    monkeypatch.setattr("feedsim.design.sweep.bundle.plan", slowly)
    text = study().read_text() + "  feed: {key: motions.0.feed, from: 1 m/min, to: 3 m/min}\n"
    loaded = load_study(study(text))
    found = trial(loaded, design(loaded), fmus)
    assert len(found.runs) == TRIAL_RUN_COUNT - 1
    assert found.failed == {}
    assert "Z.overshoot" in found.figures
    assert takes < found.seconds[0] <= found.seconds[1]
    assert run(loaded, tmp_path / "out", workers=0, fmus=fmus)["seconds"].min() > takes


def test_dry_run_tells_a_range(study: Write, fmus: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sweep", str(study()), "--dry-run", "--fmus", str(fmus)]) == 0
    assert re.search(r"runs 4, 12, 2, 6, 10 took [\d.]+ s.*; all together about [\d.]+ s", capsys.readouterr().out)


def middle_refused(study: Write) -> Path:
    """A grid whose middle run alone is refused: F_C above F_S."""
    text = study().read_text().split("parameters:")[0].replace("{method: sobol, runs: 16, seed: 7}", "{method: grid}")
    return study(text + "parameters:\n  F_C: {key: machine.axes.Z.friction.F_C, values: [1 N.m, 30 N.m, 2 N.m]}\n")


def test_a_run_that_fails_is_named_and_others_are_tried(
    study: Write, fmus: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = middle_refused(study)
    assert main(["sweep", str(file), "--dry-run", "--fmus", str(fmus)]) == 0
    told = capsys.readouterr()
    assert "run 1 fails: " in told.err
    assert "1 of the 3 runs tried fail" in told.out
    assert main(["check", str(file), "--fmus", str(fmus)]) == 0
    told = capsys.readouterr()
    assert "run 1 is refused, run 0 is not: " in told.err
    assert "valid; 3 runs" in told.out


def test_where_none_works_one_is_named(study: Write, fmus: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = study(study().read_text().replace("from: 1.2 N.m, to: 2 N.m", "from: 20 N.m, to: 30 N.m"))
    assert main(["sweep", str(file), "--dry-run", "--fmus", str(fmus)]) == 3
    assert "none of the 16 runs tried is possible; run 8: " in capsys.readouterr().err
    assert main(["check", str(file), "--fmus", str(fmus)]) == 2
    assert "run 8: " in capsys.readouterr().err
