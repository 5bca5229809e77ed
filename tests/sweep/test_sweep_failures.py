"""Where failed runs lie: the parameter that decides is named, and none where none does."""

from __future__ import annotations

from itertools import combinations
from math import comb
from pathlib import Path

import numpy as np
import pytest

from feedsim.design.sweep.design import Outcome, design
from feedsim.design.sweep.table import FAILED, LEVEL, OK, end_chance, span_chance, table_of
from feedsim.report.chart import Panel
from feedsim.report.sweep.account import Account, measures
from feedsim.report.sweep.figure_plots import scatter_picture
from feedsim.scenario.study import load_study

ROOT = Path(__file__).resolve().parents[2]
PARAMETERS = """
  F_S: {key: machine.axes.Z.friction.F_S, from: 1.6 N.m, to: 2.6 N.m}
  W: {key: machine.axes.Z.friction.W, from: 0.02 rad, to: 0.06 rad}
  scheme: {key: coupling.scheme, values: [extrapolated, parallel, jacobi]}
"""
COLUMNS = {"F_S": 0, "W": 1, "scheme": 2}


def account_of(folder: Path, sampling: str, failing: str) -> Account:
    """A study of which runs fail by a rule: an expression in the shares F_S, W (0 to 1) and scheme (0, 1, 2)."""
    file = folder / "study.yaml"
    scenario = ROOT / "scenarios" / "xz_circle.yaml"
    file.write_text(f"name: A study\nscenario: {scenario}\nsampling: {sampling}\nparameters:{PARAMETERS}")
    study = load_study(file)
    plan = design(study)
    shares = {
        "F_S": (plan.values[:, 0] - 1.6) / 1.0,
        "W": (plan.values[:, 1] - 0.02) / 0.04,
        "scheme": plan.values[:, 2],
        "chance": np.random.default_rng(3).random(plan.runs),
    }
    failed = np.asarray(eval(failing, {}, shares), dtype=bool)
    outcomes = [
        Outcome(run, None, "no", 0.1) if failed[run] else Outcome(run, {"XZ.G": (1e-6 * run, "m")}, None, 0.1)
        for run in range(plan.runs)
    ]
    return Account(table_of(plan, range(plan.runs), outcomes, None, {}), study, plan)


@pytest.mark.parametrize("sampling", ["{method: latin_hypercube, runs: 60}", "{method: sensitivity, runs: 32}"])
@pytest.mark.parametrize(
    ("failing", "named"),
    [
        ("F_S < 0.2", ["F_S"]),  # one side
        ("W > 0.7", ["W"]),
        ("(W > 0.4) & (W < 0.6)", ["W"]),  # the middle: ranks do not tell
        ("(F_S < 0.5) & (W < 0.5)", ["F_S", "W"]),  # together
        ("(F_S > 0.3) & (chance < 0.8)", ["F_S"]),  # wide, and not all of them: no narrow range to see
        ("scheme == 1", ["scheme"]),
        ("chance < 0.2", []),
        ("chance < 0.03", []),
    ],
)
def test_the_parameter_that_decides_is_named(tmp_path: Path, sampling: str, failing: str, named: list[str]) -> None:
    account = account_of(tmp_path, sampling, failing)
    (failure,) = account.failures
    found = [account.inputs[each.parameter].name for each in failure.where]
    assert sorted(found) == sorted(named), account.where(failure)


def test_how_many_of_the_runs_there_failed(tmp_path: Path) -> None:
    account = account_of(tmp_path, "{method: latin_hypercube, runs: 60}", "(W > 0.5) & (chance < 0.9)")
    (failure,) = account.failures
    values = account.inputs[1].values
    low, high = values[~account.ok].min(), values[~account.ok].max()
    there = int(((values >= low) & (values <= high)).sum())
    assert account.where(failure) == f"W {low:.4g} to {high:.4g} rad ({len(failure.runs)} of {there} runs there)"


def test_other_failures_are_not_compared_with(tmp_path: Path) -> None:
    """Runs that fail of F_S first make those that fail of W look as if they had large F_S: nothing to be told of."""
    account = account_of(tmp_path, "{method: latin_hypercube, runs: 60}", "(F_S < 0.5) | (W > 0.3)")
    message = account.table["message"]
    message[(account.inputs[0].values < 2.1) & ~account.ok] = "first"
    where = {each.message: account.where(each) for each in account.failures}
    assert [text.split()[0] for text in where["no"].split("; ")] == ["W"]


def test_chance_names_a_parameter_in_one_study_of_twenty_at_most(tmp_path: Path) -> None:
    account = account_of(tmp_path, "{method: latin_hypercube, runs: 40}", "chance < 0")
    random = np.random.default_rng(8)
    told = 0
    studies = 300
    for _ in range(studies):
        chosen = random.random(40) < 0.25
        account.table["status"][:] = np.where(chosen, FAILED, OK)
        account.table["message"][:] = np.where(chosen, "no", "")
        account.__dict__.pop("failures", None)
        told += any(failure.where for failure in account.failures)
    assert told <= (LEVEL + 3 * np.sqrt(LEVEL * (1 - LEVEL) / studies)) * studies


def test_chances_are_those_of_counting() -> None:
    """All ways to choose 3 of 9 ranks."""
    ways = [*combinations(range(9), 3)]
    for span in range(3, 10):
        counted = sum(way[-1] - way[0] + 1 <= span for way in ways) / comb(9, 3)
        assert span_chance(3, 9, span) == pytest.approx(counted, rel=1e-9)
    for beyond in range(7):
        counted = sum(way[0] >= beyond for way in ways) / comb(9, 3)
        assert end_chance(3, 9, beyond) == pytest.approx(counted, rel=1e-9)


def test_runs_without_a_value_are_marked_in_the_picture(tmp_path: Path) -> None:
    account = account_of(tmp_path, "{method: latin_hypercube, runs: 60}", "F_S < 0.2")
    picture = scatter_picture(account.outputs[0], account.inputs, measures(account)["XZ.G"], "g")
    assert picture is not None
    assert "a stroke at the foot" in picture.caption
    assert picture.chart is not None
    panel = picture.chart.panels[0]
    assert isinstance(panel, Panel)
    output, each = account.outputs[0], next(each for each in account.inputs if each.name == panel.title)
    strokes = [level for level in panel.levels if level.upright]
    assert sorted(level.at for level in strokes) == sorted(each.sample[~np.isfinite(output.sample)].tolist())
    assert all(level.ends is not None and level.ends[1] < float(output.known.min()) for level in strokes)
