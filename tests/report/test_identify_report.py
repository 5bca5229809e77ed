"""What an identification leaves: friction.yaml, tables, page, figures; what it says where a stage is absent."""

from __future__ import annotations

import csv
import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agreement_helpers import assert_numbers_agree
from feedsim.estimation.identify.friction_file import open_loop_line
from feedsim.estimation.identify.result import Balance, Correlation, Identification
from feedsim.foundation.errors import Finding, OutputError
from feedsim.jobs.identify import KIND, result_of
from feedsim.report.chart import Grid
from feedsim.report.identify import headline, rigid_line, table_lines, terminal_warnings
from feedsim.report.identify.report import (
    _length,
    correlation_picture,
    describe,
    loops_picture,
    open_loop_picture,
    report_of,
    residuals_picture,
)
from feedsim.report.identify.stribeck_plots import at_slide, curve_error, plateaus_picture, stribeck_picture
from feedsim.report.page import html
from feedsim.report.provenance import friction_origins
from feedsim.scenario import load_machine
from feedsim.scenario.load import read_friction
from identification_helpers import I_P, TRUE, J, balance, identification, identified, provenance, records, stretch
from report_helpers import Page, contents
from scenario_helpers import MACHINE

FIGURES = {"stribeck", "plateaus", "loops-speed", "loops-position", "residuals", "correlation"}


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("identified") / "out"
    result_of(identified()).save(folder, figures=("png",))
    return folder


def told(folder: Path) -> dict[str, Any]:
    text = (folder / "summary.json").read_text(encoding="utf-8")
    content: dict[str, Any] = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    return content


def test_everything_is_there_and_listed(written: Path) -> None:
    files = set(contents(written))
    named = {"friction.yaml", "plateaus.csv", "residuals.csv", "report.html", "summary.json"}
    assert files == named | {f"figures/{stem}.png" for stem in FIGURES}
    assert set(told(written)["files"]) == files


def test_a_friction_that_cannot_be_is_not_written(tmp_path: Path) -> None:
    found = identification()
    wrong = {**found.estimates, "gamma": replace(found.estimates["gamma"], value=1.2)}
    with pytest.raises(OutputError, match=r"friction\.yaml is not written: gamma"):
        result_of(identified(found=replace(found, estimates=wrong))).save(tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_summary(written: Path) -> None:
    summary = told(written)
    parameters = summary["parameters"]
    assert list(parameters) == list(TRUE)
    assert parameters["sigma_0"]["at_slide"] == {"value": pytest.approx(300 / I_P**2 * 1e-6), "unit": "N/um"}
    assert parameters["J"]["interval"] is None
    assert parameters["J"]["status"] == "given"
    assert summary["curve"]["plateaus"] == 24
    assert summary["curve"]["error"]["value"] == pytest.approx(0.0053, abs=2e-4)
    assert len(summary["pre_sliding"]["stretches"]) == 4
    assert summary["pre_sliding"]["sigma_were_the_delay_known"] == {"sigma_1": 0.011}
    assert summary["machine"]["note"].startswith("Synthetic")
    assert summary["settings"] == {"hold": "beta=1"}
    assert [item["role"] for item in summary["inputs"]][:2] == ["trace", "trace"]
    assert {"feedsim", "numpy", "scipy"} <= set(summary["software"])


def test_the_simple_model_stands_beside(written: Path) -> None:
    assert_numbers_agree(written, pairs=20)
    assert set(told(written)["rigid_axis"]) == {"J", "F_C"}
    text = (written / "report.html").read_text(encoding="utf-8")
    assert "Rigid axis with simple friction" in text
    assert rigid_line(identified()).startswith("rigid axis with simple friction: J 0.01640 kg.m^2, F_C 1.9000 N.m")
    without = identified(found=identification(rigid={}))
    assert rigid_line(without) == ""
    assert "Rigid axis" not in html(report_of(without, []))


def test_a_run_tells_where_its_friction_is_from(written: Path) -> None:
    machine = load_machine(MACHINE, [f"axes.Z.friction={written / 'friction.yaml'}"])
    assert friction_origins(machine) == {"Z": "identified 2026-01-31 from constant.csv, sine.csv"}
    odd = machine.axes["Z"].friction.model_copy(update={"identified": {"traces": 3, "date": [1]}})
    axes = {"Z": machine.axes["Z"].model_copy(update={"friction": odd})}
    assert friction_origins(machine.model_copy(update={"axes": axes})) == {"Z": "identified [1]"}
    assert friction_origins(load_machine(MACHINE)) == {}


def test_tables_read_back(written: Path) -> None:
    with (written / "plateaus.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    assert rows[0] == ["record", "begin [s]", "end [s]", "speed [rad/s]", "torque [N.m]", "sigma [N.m]", "rows"]
    stage = identification().stationary
    assert stage is not None
    assert [float(row[3]) for row in rows[1:]] == [p.speed for p in stage.plateaus]
    with (written / "residuals.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    dynamic = identification().dynamic
    assert dynamic is not None
    assert len(rows) - 1 == sum(len(each.time) for each in dynamic.stretches)
    assert {row[0] for row in rows[1:]} == {"1", "2", "3", "4"}
    measured, model, left = (np.array([float(row[i]) for row in rows[1:]]) for i in (5, 6, 7))
    assert np.array_equal(measured - model, left)


def test_page(written: Path) -> None:
    text = (written / "report.html").read_text(encoding="utf-8")
    words_of_page = " ".join(Page(text).words)
    for words in ("Friction of axis Z", "error of the curve", "Synthetic machine", "N/µm", "kg·m²", "2 µm at 20 Hz",
                  "sigma_1 is known to 6.7 % only", "constant_load", "Were the delay known"):  # fmt: skip
        assert words in words_of_page, words
    assert all(f'<figure id="{stem}" class="chart' in text for stem in FIGURES)
    assert not re.search(r"\bnan\b", re.sub(r"<svg.*?</svg>|data:[^\"]*", "", text, flags=re.S))
    assert str(Path.cwd()) not in text
    # sigma_0 at the slide, beside the motor side's
    assert f"{300e-6 / I_P**2:.3f}"[:4] in words_of_page


def open_loop_text(found: Identification) -> str:
    """The section of the page, without its tags."""
    text = html(report_of(identified(found=found), []))
    start = text.index('id="position-in-open-loop"')
    return re.sub(r"<[^>]+>", " ", text[start : text.index("<h2", start)])


def test_position_in_open_loop(tmp_path: Path) -> None:
    found = identification(balance=balance())
    result_of(identified(found=found)).save(tmp_path)
    before = balance().position[0]
    assert open_loop_line(found) == (
        f"position off by {100 * before * I_P:.3g} mm rms instead of {1e3 * before * I_P:.3g} mm; "
        "F_C and F_S -4 %, M_0 +0.01 N.m; torque residual +2 %"
    )
    part = told(tmp_path)["open_loop"]
    assert (part["applied"], part["reason"], part["records"]) == (True, "", ["move.csv"])
    assert part["position"]["before"] == before
    assert part["position"]["at_slide"] == {
        "before": pytest.approx(before * I_P), "after": pytest.approx(0.1 * before * I_P), "unit": "m"
    }  # fmt: skip
    assert part["torque"]["after"] == 0.051
    assert part["changes"]["M_0"] == {"before": 0.24, "after": 0.25, "unit": "N.m"}
    assert read_friction(tmp_path / "friction.yaml").identified["open_loop"] == open_loop_line(found)
    text = open_loop_text(found)
    for words in ("Applied", f"{before:.4g}", f"{1e3 * before * I_P:.4g}", "+2 %", "−4 %", "+0.01 N·m", "1.667"):
        assert words in text, words
    report = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert '<figure id="open-loop" class="chart" ' in report
    assert "open_loop.csv" in report
    with (tmp_path / "open_loop.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    assert rows[0] == ["record", "time [s]", "angle [rad]", "error before [rad]", "error after [rad]"]
    drift = balance().drifts[0]
    for column, values in zip((1, 2, 3, 4), (drift.time, drift.angle, drift.before, drift.after), strict=True):
        assert [float(row[column]) for row in rows[1:]] == list(values)
    result_of(identified()).save(tmp_path)
    assert not (tmp_path / "open_loop.csv").exists()


def test_open_loop_that_was_tried_and_refused(tmp_path: Path) -> None:
    found = identification(balance=balance(applied=False, reason="F_C would change by +23 %"))
    result_of(identified(found=found)).save(tmp_path)
    assert open_loop_line(found) == "not applied: F_C would change by +23 %"
    text = open_loop_text(found)
    assert "Not applied: F_C would change by +23 %." in text
    assert "Tried" in text
    assert told(tmp_path)["open_loop"]["applied"] is False
    assert '<figure id="open-loop" class="chart" ' in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_open_loop_is_not_spoken_of_where_it_is_none(tmp_path: Path) -> None:
    sines = Balance({}, False, "sine.csv: sines; the open loop needs general motion", applies=False)
    found = identification(balance=sines)
    result_of(identified(found=found)).save(tmp_path)
    assert open_loop_line(found) == ""
    assert "sine.csv: sines" in open_loop_text(found)
    assert "rms" not in open_loop_text(found)
    part = told(tmp_path)["open_loop"]
    assert part["applies"] is False
    assert part["position"]["before"] is None
    assert "open_loop" not in read_friction(tmp_path / "friction.yaml").identified
    assert not (tmp_path / "open_loop.csv").exists()
    assert open_loop_line(identification()) == ""
    assert "open-loop" not in html(report_of(identified(), []))


def test_doubts_of_a_stage_1_that_was_not_used(tmp_path: Path) -> None:
    stage = identification().stationary
    assert stage is not None
    at_bound = Finding("parameter-at-bound", "doubt", "F_log sits at its bound 0", "F_log")
    doubtful = replace(stage, warnings=(at_bound,))
    apart = identified(found=identification(stationary=doubtful, prior=False))
    result_of(apart).save(tmp_path)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert text.index("<main>") < text.index("F_log sits at its bound 0")  # in its section, not above all
    assert told(tmp_path)["curve"]["warnings"] == ["F_log sits at its bound 0"]
    assert told(tmp_path)["curve"]["used"] is False
    assert "F_log sits at its bound 0" not in told(tmp_path)["warnings"]
    assert headline(apart).startswith("curve of stage 1 alone within")
    assert 'id="stage-1"' not in html(report_of(identified(found=identification(stationary=doubtful)), []))


def test_warnings_that_the_table_holds_are_not_told_twice() -> None:
    found = identification()
    vague = replace(found.estimates["F_S"], status="undetermined", reason="its 95 % interval is +-281 % of the value")
    also = replace(found.estimates["v_s"], status="undetermined", reason="no Stribeck effect shows")
    both = {**found.estimates, "F_S": vague, "v_s": also}
    wide = "its 95 % interval is +-281 % of the value"
    repeating = (
        Finding("parameter-undetermined", "doubt", f"F_S: {wide}", "F_S"),
        Finding("parameter-held", "doubt", "v_s is not estimated but held at 2: no Stribeck effect shows", "v_s"),
        Finding("parameter-undetermined", "doubt", f"F_S and W: {wide}", "F_S, W"),
    )
    telling = (
        Finding("parameter-uncertain", "doubt", "sigma_1 is known to 6.7 % only", "sigma_1"),
        Finding("parameter-undetermined", "doubt", f"W: {wide}", "W"),
        Finding("stribeck-curve-missing", "doubt", "no Stribeck effect shows"),
        Finding("parameter-held", "doubt", "v_s is not estimated but held at 2: another reason", "v_s"),
    )
    whole = identified(found=replace(found, estimates=both, warnings=(*repeating, *telling)))
    assert terminal_warnings(whole.warnings, whole.found.estimates.values()) == list(telling)
    assert whole.warnings == [*repeating, *telling]


@pytest.mark.parametrize("absent", ["stationary", "dynamic", "both warnings"])
def test_a_stage_may_be_absent(tmp_path: Path, absent: str) -> None:
    changes: dict[str, Any] = {absent: None} if absent != "both warnings" else {"warnings": (), "advice": ()}
    whole = identified(found=identification(**changes), subject=None)
    names = {path.name for path in result_of(whole).save(tmp_path, figures=("png",))}
    assert ("plateaus.csv" in names) == (absent != "stationary")
    assert ("residuals.csv" in names) == (absent != "dynamic")
    assert {"friction.yaml", "report.html", "correlation.png"} <= names
    assert ("stribeck.png" in names) == (absent != "stationary")
    assert told(tmp_path)["machine"] is None
    line = headline(whole)
    assert ("curve within" in line) == (absent != "stationary")


def test_files_of_an_earlier_run_go(tmp_path: Path) -> None:
    result_of(identified()).save(tmp_path)
    result_of(identified(found=identification(dynamic=None))).save(tmp_path)
    assert set(contents(tmp_path)) == set(told(tmp_path)["files"])
    assert not (tmp_path / "residuals.csv").exists()


def test_place_is_checked_ahead(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="is a file"):
        KIND.check_place(tmp_path / "file")
    KIND.check_place(tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_table_for_the_terminal() -> None:
    lines = table_lines(identified())
    assert len(lines) == 1 + len(TRUE)
    assert any(re.fullmatch(r"  F_C +1\.6000 N\.m +1\.5956 to 1\.6044 +0\.27 %", line) for line in lines)
    assert any(line.startswith("  delay") and "0.50 ms" in line for line in lines)
    assert all(line.isascii() and len(line) <= 120 for line in lines)


def test_reasons_are_cut_at_a_word() -> None:
    found = identification()
    reason = "the first words say what matters and all others may as well be left out where there is no room for them"
    long = {**found.estimates, "W": replace(found.estimates["W"], status="undetermined", reason=reason)}
    lines = table_lines(identified(found=replace(found, estimates=long)))
    (line,) = (line for line in lines if line.startswith("  W "))
    said = line[line.index("undetermined: ") + len("undetermined: ") :].removesuffix(" ...")
    assert line.endswith(" ...")
    assert len(line) <= 120
    assert reason.startswith(f"{said} ")
    assert len(said) > 30


def test_values_at_the_slide() -> None:
    """x = I_P angle and F = M/I_P, by dimensions."""
    lead = 0.02 / (2 * math.pi)
    expected = {
        "F_C": (1.6 / lead, "N"),
        "sigma_0": (300 / lead**2 * 1e-6, "N/um"),
        "sigma_2": (0.006 / lead**2 * 1e-3, "N.s/mm"),
        "v_s": (0.6 * lead * 60e3, "mm/min"),
        "W": (0.04 * lead * 1e6, "um"),
        "J": (J / lead**2, "kg"),
    }
    for name, (value, unit) in expected.items():
        found = at_slide(name, lead)
        assert found is not None
        assert (found[0] * TRUE[name][0], found[1]) == (pytest.approx(value), unit)
    assert at_slide("gamma", lead) is None
    assert expected["J"][0] == pytest.approx(1618.6, abs=0.1)  # a slide of some 1.6 t


def test_error_of_the_curve_is_that_between_the_plateaus() -> None:
    stage = identification().stationary
    assert stage is not None
    wide = replace(stage, sigma=np.where(stage.speeds > 50, 1.0, stage.sigma), range=(stage.range[0], 40.0))
    assert curve_error(wide) < 0.01 < curve_error(replace(wide, range=stage.range))


class TestFigures:
    found: Identification = identification()

    def test_stribeck_headline_is_the_error_of_the_curve(self) -> None:
        assert self.found.stationary is not None
        picture = stribeck_picture(self.found, self.found.stationary)
        assert "of its direction (dashed)" in picture.caption
        assert "plateau 0.4 %" in picture.caption
        plain = {**self.found.stationary.estimates}
        plain["asymmetry"] = replace(plain["asymmetry"], value=0.0)
        other = stribeck_picture(self.found, replace(self.found.stationary, estimates=plain))
        assert "of its direction (dashed)" not in other.caption
        assert other.png != picture.png

    def test_one_direction_alone(self) -> None:
        stage = self.found.stationary
        assert stage is not None
        one = replace(stage, plateaus=tuple(p for p in stage.plateaus if p.speed > 0))
        assert stribeck_picture(self.found, one).png

    def test_plateaus_in_their_records(self) -> None:
        stage = self.found.stationary
        assert stage is not None
        assert plateaus_picture(self.found, stage, records()[1:]) is None
        many = [replace(records()[0], name=f"piece {k}") for k in range(5)]
        spread = tuple(replace(p, record=f"piece {k % 5}") for k, p in enumerate(stage.plateaus))
        picture = plateaus_picture(self.found, replace(stage, plateaus=spread), many)
        assert picture is not None
        assert "2 more records with plateaus are not shown" in picture.caption
        assert picture.png

    def test_loops_show_each_move_once(self) -> None:
        stage = self.found.dynamic
        assert stage is not None
        picture = loops_picture(self.found, stage, "speed")
        assert picture is not None
        assert "further stretches" not in picture.caption
        twice = replace(stage, stretches=stage.stretches * 2)
        again = loops_picture(self.found, twice, "speed")
        assert again is not None
        assert "4 further stretches" in again.caption
        assert again.png == picture.png or "not shown" in again.caption
        assert loops_picture(self.found, replace(stage, stretches=()), "speed") is None
        assert residuals_picture(self.found, replace(stage, stretches=())) is None

    def test_moves_in_words(self) -> None:
        assert describe(stretch(20e-6, 5.0, 0.0), I_P) == "20 µm, 5 Hz"
        general = replace(stretch(0.1, 5.0, 0.0), kind="motion", frequency=math.nan)
        assert describe(general, I_P) == "motion of ±100 mm"

    def test_units_follow_the_length_of_the_moves(self) -> None:
        assert _length([stretch(20e-6, 5.0, 0.0)], I_P) == (pytest.approx(1e6 * I_P), "µm")
        assert _length([stretch(20e-6, 5.0, 0.0), stretch(0.1, 5.0, 0.0)], I_P) == (pytest.approx(1e3 * I_P), "mm")

    def test_open_loop(self) -> None:
        once = balance()
        picture = open_loop_picture(self.found, once)
        assert picture is not None
        assert "not shown" not in picture.caption
        assert "not taken" not in picture.caption
        many = open_loop_picture(self.found, replace(once, drifts=once.drifts * 4, applied=False))
        assert many is not None
        assert "1 further record is not shown" in many.caption
        assert "What was tried was not taken." in many.caption
        assert open_loop_picture(self.found, replace(once, drifts=())) is None

    def test_correlation_leaves_open_what_is_not_known(self) -> None:
        names = ("F_C", "sigma_0", "W")
        matrix = np.array([[1, 0.95, np.nan], [0.95, 1, -0.2], [np.nan, -0.2, 1]])
        picture = correlation_picture("Z", Correlation(names, matrix))
        assert picture is not None
        assert picture.chart is not None
        (grid,) = picture.chart.panels
        assert isinstance(grid, Grid)
        np.testing.assert_array_equal(
            grid.values, [[np.nan, 0.95, np.nan], [0.95, np.nan, -0.2], [np.nan, -0.2, np.nan]]
        )
        assert grid.bold is not None
        assert np.argwhere(grid.bold).tolist() == [[0, 1], [1, 0]]
        assert picture.png
        assert correlation_picture("Z", Correlation(("F_C",), np.eye(1))) is None


def test_text_of_others_is_escaped() -> None:
    whole = identified(sources=(provenance("<b>.csv", note="a < b"),))
    text = html(report_of(whole, []))
    assert "<b>.csv" not in text
    assert "&lt;b&gt;.csv" in text
    assert "a &lt; b" in text
