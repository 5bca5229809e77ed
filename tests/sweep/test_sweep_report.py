"""The report on a study: what it says of a table whose numbers are known."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy import stats

from feedsim.design.sweep.design import Design, Outcome, design
from feedsim.design.sweep.table import Table
from feedsim.design.sweep.table import table_of as made
from feedsim.foundation.errors import Finding
from feedsim.report import sweep as report
from feedsim.report.chart.svg import EDGE
from feedsim.report.formatting import scale
from feedsim.report.page import html
from feedsim.report.sweep.account import Account, details, quantile_interval
from feedsim.report.sweep.figure_plots import running_median
from feedsim.report.sweep.report import pictures_of, report_of
from feedsim.scenario.study import Study, load_study

ROOT = Path(__file__).resolve().parents[2]

SAMPLED = """
  F_C: {key: machine.axes.X.friction.F_C, from: 1 N.m, to: 3 N.m}
  feed: {key: motions.0.feed, from: 1000 mm/min, to: 5000 mm/min}
  scheme: {key: coupling.scheme, values: [extrapolated, parallel]}
"""
GRID = """
  feed: {key: motions.0.feed, from: 1000 mm/min, to: 5000 mm/min, count: 5}
  radius: {key: motions.0.radius, values: [5 mm, 10 mm, 20 mm]}
"""


def study_of(folder: Path, sampling: str, parameters: str, name: str = "A study") -> tuple[Study, Design]:
    file = folder / "study.yaml"
    scenario = ROOT / "scenarios" / "xz_circle.yaml"
    file.write_text(f"name: {name!r}\nscenario: {scenario}\nsampling: {sampling}\nparameters:{parameters}")
    study = load_study(file)
    return study, design(study)


def table_of(
    study: Study,
    plan: Design,
    figures: dict[str, tuple[str, Any]],
    *,
    failed: Mapping[int, str] | None = None,
    warned: Mapping[int, Finding] | None = None,
    done: int | None = None,
) -> Table:
    """A table of the first `done` runs, default all; figures: name -> SI unit and (runs,) values."""
    messages, told = failed or {}, warned or {}
    runs = range(plan.runs if done is None else done)
    outcomes = [
        Outcome(
            run,
            None if run in messages else {name: (float(values[run]), unit) for name, (unit, values) in figures.items()},
            messages.get(run),
            0.1,
            (told[run],) if run in told else (),
        )
        for run in runs
    ]
    return made(plan, runs, outcomes, None, {})


def glitch(plan: Design) -> Any:
    """[m]: known to hang on F_C alone."""
    return 4e-6 * plan.values[:, 0]


def page(table: Table, study: Study, plan: Design) -> str:
    account = Account(table, study, plan)
    return html(report_of(account, *pictures_of(account)))


def cells(text: str, first: str) -> list[str]:
    """Texts of the first row of a table that begins with a cell."""
    row = re.search(rf"<tr><td>(?:<code>)?{re.escape(first)}(?:</code>)?</td>.*?</tr>", text)
    assert row, first
    return [re.sub(r"<[^>]+>", "", cell) for cell in re.findall(r"<td.*?</td>", row[0])]


def test_statistics_in_units_for_people(tmp_path: Path) -> None:
    study, plan = study_of(tmp_path, "{method: latin_hypercube, runs: 101}", SAMPLED)
    values = 1e-6 * np.linspace(2, 12, 101)
    text = page(table_of(study, plan, {"XZ.G": ("m", values)}), study, plan)
    # mean 7, std of even spacing 10/100 sqrt(101 102/12), quantiles at 5, 50 and 95 of 100 steps
    found = cells(text, "XZ.G")
    assert [*found[:4], *found[7:]] == ["XZ.G", "µm", "7.00", "2.93", "2", "12", "101"]
    # Of 101 values, the number below the quantile is binomial: 1 to 10 at 5 %, 41 to 60 at 50 % (outside it is
    # less than 2.5 % on a side), so that the 1st and 11th, the 41st and 61st value enclose it.
    assert np.all(stats.binom.cdf([0, 40], 101, [0.05, 0.5]) < 0.025)
    assert np.all(stats.binom.sf([10, 60], 101, [0.05, 0.5]) < 0.025)
    assert found[4:7] == ["2.50 (2.00 to 3.00)", "7.0 (6.0 to 8.0)", "11.50 (11.00 to 12.00)"]


def test_summary_is_in_SI_and_holds_the_indices(tmp_path: Path) -> None:
    study, plan = study_of(tmp_path, "{method: sensitivity, runs: 64}", SAMPLED)
    # 320 runs of 0.1 s by two processes within 20 s
    record = {"began": "2026-01-01T10:00:00+00:00", "ended": "2026-01-01T10:00:20+00:00", "processes": 2}
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "study.json").write_text(json.dumps(record))
    written = report.write(table_of(study, plan, {"XZ.G": ("m", glitch(plan))}), study, plan, tmp_path / "out")
    assert {"report.html", "summary.json"} <= {path.name for path in written}
    found = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert found["figures"]["XZ.G"]["unit"] == "m"
    assert found["figures"]["XZ.G"]["q50"] == pytest.approx(8e-6, rel=0.03)
    indices = found["sobol_indices"]["XZ.G"]["parameters"]
    assert indices["F_C"]["total"] == pytest.approx(1, abs=0.1)  # 64 points; the truth is 1
    assert indices["feed"]["total"] == indices["scheme"]["total"] == 0
    assert found["performance"]["efficiency"] == pytest.approx(0.8)
    assert found["runs"] == {"asked": 320, "done": 320, "failed": 0}
    assert set(found["files"]) == {str(path.relative_to(tmp_path / "out")) for path in written}


def test_failed_runs_are_grouped_and_located(tmp_path: Path) -> None:
    study, plan = study_of(tmp_path, "{method: latin_hypercube, runs: 60}", SAMPLED)
    fast = np.argsort(plan.values[:, 1])[-6:]
    failed = {int(run): f"axis <Z> reaches {30 + k}.5 m/min" for k, run in enumerate(fast)}
    slow = int(np.argmin(plan.values[:, 1]))
    failed[slow] = "something else"
    table = table_of(study, plan, {"XZ.G": ("m", glitch(plan))}, failed=failed)
    account = Account(table, study, plan)
    first, second = account.failures
    assert (len(first.runs), len(second.runs)) == (6, 1)
    assert set(first.runs) == set(fast.tolist())
    low, high = 60e3 * plan.values[fast, 1].min(), 60e3 * plan.values[fast, 1].max()
    assert account.where(first) == f"feed {low:.4g} to {high:.4g} mm/min (6 of 6 runs there)"
    assert account.where(second) == ""  # one run is no place
    text = page(table, study, plan)
    assert "axis &lt;Z&gt; reaches" in text
    assert "<Z>" not in text
    assert "7 of 60 runs failed and have no figures; statistics are of the others." in text
    assert cells(text, "XZ.G")[-1] == "53"


def test_a_figure_that_some_runs_do_not_have_is_counted(tmp_path: Path) -> None:
    study, plan = study_of(tmp_path, "{method: latin_hypercube, runs: 40}", SAMPLED)
    values = np.where(np.arange(40) < 3, np.nan, 0.1 + plan.values[:, 0])
    account = Account(table_of(study, plan, {"Z.settling_time": ("s", values)}, failed={39: "no"}), study, plan)
    told = {finding.code: finding for finding in account.warnings}
    assert told["figure-not-determined"].place == "Z.settling_time"
    assert "in 3 of 39 runs" in told["figure-not-determined"].text
    assert account.outputs[0].statistics["min"] > 0


def test_warnings_of_runs_are_told_once(tmp_path: Path) -> None:
    study, plan = study_of(tmp_path, "{method: latin_hypercube, runs: 20}", SAMPLED)
    told = {k: Finding("exchange-loses-energy", "doubt", f"residual {k}.5 J", "Z") for k in range(5)}
    told[7] = Finding("loop-unstable", "wrong", "axis Z: the position loop is unstable", "Z")
    account = Account(table_of(study, plan, {"XZ.G": ("m", glitch(plan))}, warned=told), study, plan)
    lost, wrong = (finding for finding in account.warnings if finding.place == "Z")
    assert (lost.code, lost.severity) == ("exchange-loses-energy", "doubt")
    assert lost.text == "5 of 20 runs warn: residual 0.5 J"
    assert (wrong.code, wrong.severity) == ("loop-unstable", "wrong")
    assert wrong.text == "1 of 20 runs: axis Z: the position loop is unstable"


def test_too_many_failures_for_indices_leave_rank_correlations(tmp_path: Path) -> None:
    study, plan = study_of(tmp_path, "{method: sensitivity, runs: 32}", SAMPLED)
    failed = {5 * k: "no" for k in range(10)}
    text = page(table_of(study, plan, {"XZ.G": ("m", glitch(plan))}, failed=failed), study, plan)
    assert "XZ.G: no Sobol indices: 10 of 32 base points have a run without a value" in text
    assert "rank correlation" in text


def test_a_part_of_a_study(tmp_path: Path) -> None:
    study, plan = study_of(tmp_path, "{method: sensitivity, runs: 32}", SAMPLED)
    # 16 whole base points and a piece of the next
    part = table_of(study, plan, {"XZ.G": ("m", glitch(plan))}, done=83)
    account = Account(part, study, plan)
    assert account.sensitivities.sobol["XZ.G"].used == 16
    assert account.sensitivities.sobol["XZ.G"].left_out == 0
    (unfinished,) = (finding for finding in account.warnings if finding.code == "study-not-finished")
    assert "83 of 160 runs" in unfinished.text


def test_constant_figures_are_told_but_not_drawn(tmp_path: Path) -> None:
    study, plan = study_of(tmp_path, "{method: sensitivity, runs: 16}", SAMPLED)
    table = table_of(study, plan, {"XZ.G": ("m", glitch(plan)), "XZ.still": ("m", np.full(plan.runs, 3e-6))})
    account = Account(table, study, plan)
    whole, single = pictures_of(account)
    assert [each.stem for each in single] == ["distribution-XZ-G", "scatter-XZ-G"]
    assert ("sobol-missing", "XZ.still") in [(finding.code, finding.place) for finding in account.warnings]
    assert cells(html(report_of(account, whole, single)), "XZ.still")[2:4] == ["3", "0"]


ONE_RADIUS = GRID.replace("values: [5 mm, 10 mm, 20 mm]", "values: [15 mm]")


@pytest.mark.parametrize(("parameters", "compared"), [(GRID, 1), (ONE_RADIUS, 0)], ids=["map", "line"])
def test_grids_are_drawn_as_such(tmp_path: Path, parameters: str, compared: int) -> None:
    """A figure that is the feed: all of its scatter lies between feeds; with a run per feed no share can be told."""
    study, plan = study_of(tmp_path, "{method: grid}", parameters)
    table = table_of(study, plan, {"XZ.G": ("m", 1e-4 * plan.values[:, 0])}, failed={2: "no"})
    account = Account(table, study, plan)
    whole, single = pictures_of(account)
    assert [each.stem for each in single] == ["grid-XZ-G"]
    assert len(whole) == compared
    share = account.sensitivities.trends["XZ.G"].share
    np.testing.assert_allclose(share[0], 1 if compared else np.nan)


def test_names_with_signs_of_other_languages(tmp_path: Path) -> None:
    """What is markup to HTML or XML is a letter here."""
    parameters = SAMPLED.replace("F_C:", "a$b^<i>&:")
    study, plan = study_of(tmp_path, "{method: latin_hypercube, runs: 30}", parameters, name="<b>A</b> & $x$")
    table = table_of(study, plan, {"XZ.glitch_X+": ("m", glitch(plan)), "XZ.glitch_X-": ("m", glitch(plan))})
    account = Account(table, study, plan)
    whole, single = pictures_of(account)
    assert len({each.stem for each in [*whole, *single]}) == len(whole) + len(single)
    for picture in [*whole, *single]:
        ElementTree.fromstring(picture.svg.replace("xlink:href", "href"))  # well-formed
    text = html(report_of(account, whole, single))
    assert "<i>" not in text
    assert "&lt;b&gt;A&lt;/b&gt; &amp; $x$" in text


def test_ten_thousand_rows_stay_small_and_the_same(tmp_path: Path) -> None:
    study, plan = study_of(tmp_path, "{method: latin_hypercube, runs: 10000}", SAMPLED)
    noise = 1e-7 * np.random.default_rng(0).standard_normal(10000)
    table = table_of(study, plan, {"XZ.G": ("m", glitch(plan) + noise)})
    text = page(table, study, plan)
    assert len(text) < 1_000_000  # a scatter plot of vectors would have some 10 MB
    assert text == page(table, study, plan)


def test_running_median() -> None:
    x = np.random.default_rng(1).random(600)
    at, median = running_median(x, 3 * x)
    np.testing.assert_allclose(median, 3 * at, atol=1e-12)
    assert len(at) == 24
    assert np.all(np.diff(at) > 0)
    assert len(running_median(x[:20], x[:20])[0]) == 0


@pytest.mark.parametrize(
    ("unit", "largest", "shown"),
    [("m", 8e-6, "um"), ("m", 0.03, "mm"), ("m/s", 0.05, "mm/min"), ("s", 0.099, "ms"), ("s", 1.2, "s"),
     ("N.m", 3.0, "N.m"), ("1/s", 66.7, "(m/min)/mm"), ("rad", 0.04, "rad"), ("1", 0.3, "1")],
)  # fmt: skip
def test_units_for_people(unit: str, largest: float, shown: str) -> None:
    from feedsim.foundation import units

    found = scale(unit, np.array([np.nan, -largest, 0.0]))
    assert found.unit == shown
    assert found.factor == pytest.approx(units.convert(1.0, unit, shown), rel=1e-12)


def test_the_laws_numbers_and_the_nominal_value_are_told(tmp_path: Path) -> None:
    parameters = """
  a: {key: machine.axes.X.friction.F_C, factor: true, distribution: normal, mean: 1, deviation: 0.05, from: 0.8}
  b: {key: motions.0.feed, distribution: triangular, from: 1000 mm/min, mode: 2000 mm/min, to: 5000 mm/min}
  c: {key: motions.0.radius, distribution: lognormal, mean: 15 mm, deviation: 1 mm}
  scheme: {key: coupling.scheme, values: [extrapolated, parallel]}
"""
    study, plan = study_of(tmp_path, "{method: latin_hypercube, runs: 50}", parameters)
    table = table_of(study, plan, {"XZ.G": ("m", glitch(plan))})
    account = Account(table, study, plan, {"nominal": {"XZ.G": 9.6e-6}})
    text = html(report_of(account, *pictures_of(account)))
    listed = text[text.index('id="parameters"') :]
    assert [cells(listed, name)[2] for name in ("a", "b", "c", "scheme")] == [
        "factor, normal, mean 1, deviation 0.05, from 0.8",
        "triangular, from 1000, mode 2000, to 5000",
        "lognormal, mean 15, deviation 1",
        "one of 2 values",
    ]
    assert cells(text, "XZ.G")[2] == "9.60"
    assert ">Nominal<" in text
    assert details(account)["figures"]["XZ.G"]["nominal"] == pytest.approx(9.6e-6)


@pytest.mark.parametrize("share", [0.05, 0.5, 0.95])
def test_intervals_of_quantiles_hold(share: float) -> None:
    """Of an exponential distribution; the steps between ranks make it a little more often than they say."""
    random = np.random.default_rng(6)
    truth = -np.log(1 - share)
    studies = 600
    held = 0
    for _ in range(studies):
        low, high = quantile_interval(np.sort(random.exponential(size=120)), share)
        held += low <= truth <= high
    assert 0.95 - 3 * np.sqrt(0.95 * 0.05 / studies) < held / studies < 0.995
    assert np.isnan(quantile_interval(np.arange(20.0), 0.05)).all()


def test_a_study_for_indices_shows_the_cheap_measures_too(tmp_path: Path) -> None:
    study, plan = study_of(tmp_path, "{method: sensitivity, runs: 64}", SAMPLED)
    text = page(table_of(study, plan, {"XZ.G": ("m", glitch(plan))}), study, plan)
    row = cells(text[text.index("What moves the figures") :], "F_C")
    assert row[-2:] == ["1.00", "1.00"]  # rank correlation and regression of a figure that is F_C
    assert "the regression explains 100 % of the scatter (R²)" in text


def test_a_picture_says_by_itself_what_it_shows(tmp_path: Path) -> None:
    """Title and caption stand above the chart in a file, and the drawing in the page is without them."""
    study, plan = study_of(tmp_path, "{method: latin_hypercube, runs: 30}", SAMPLED)
    account = Account(table_of(study, plan, {"XZ.G": ("m", glitch(plan))}), study, plan)
    whole, single = pictures_of(account)
    for picture in [*whole, *single]:
        width, height = (int.from_bytes(picture.png[at : at + 4], "big") for at in (16, 20))
        box = re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', picture.svg)
        assert box
        per = width / (float(box[1]) + 2 * EDGE)
        assert height >= per * (float(box[2]) + 2 * EDGE + 30)  # a line of title and one of caption
        text = picture.content("svg").decode()
        assert picture.title in text
        assert picture.title not in picture.svg.partition(">")[2]
