"""What a page computes against a run of the same scenario with the same settings: setpoints, positions, figures,
warnings, margins. The page's scripts run in node, and the page itself in Chromium and in Firefox."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from feedsim import cli, scenario
from feedsim.analysis import Figure, evaluate
from feedsim.analysis.evaluate import cause_figures, diagnoses
from feedsim.foundation.errors import FeedsimError
from feedsim.linear.loops import position_gain
from feedsim.linear.margins import grid, margins
from feedsim.linear.system import LinearSystem
from feedsim.report.formatting import typeset
from feedsim.report.live_page.content import content, rows, segments
from feedsim.simulation import cosim, nc
from feedsim.simulation.cosim import fmus_directory
from feedsim.simulation.judge import judge_run
from feedsim.structure import checked_modes
from page_browsers import FIGURES, Firefox, Opened, address_of, number_of
from page_helpers import NODE, answers, without_loops

pytestmark = [
    pytest.mark.skipif(
        not (fmus_directory() / "machine.wasm").is_file(), reason="no module of the machine (make page-module)"
    ),
]
SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
# A millionth of a nanometre. Doubles of 1 m are 2e-7 nm apart: a few roundings of the planner, and of exp and sin in
# friction and drive, stay below it where nothing magnifies them.
SAME = 1e-15  # m
# Figures are shown with some four digits; what differs by rounding alone agrees to far more.
DIGITS = 1e-7
LARGEST = 400_000  # bytes, of the default machine: what goes into any mail
STATES = 20  # of each of the two scenarios
SHORT: dict[str, list[str]] = {"xz_circle": [], "z_positioning": ["motions.1.duration=0.4 s"]}


def settings(data: dict[str, Any], state: list[Any]) -> list[str]:
    """The state as --set has it."""
    found = []
    for knob, value in zip(data["knobs"], state, strict=True):
        text = value if knob["choices"] else f"{value!r} {knob['unit']}".removesuffix(" 1")
        found.append(f"{knob['key']}={text}")
    return found


def states(data: dict[str, Any], count: int, seed: int) -> list[list[Any]]:
    """Random ones: every number within some 40 % of the scenario's."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        state = []
        for knob in data["knobs"]:
            if knob["choices"]:
                state.append(str(rng.choice(knob["choices"])))
            else:
                value = knob["value"] * math.exp(rng.uniform(-0.35, 0.35))
                state.append(min(value, knob.get("most", math.inf)))
        found.append(state)
    return found


def same(page: Any, figure: float) -> bool:
    value = float(page)  # "NaN" and "Infinity" are text in JSON
    return bool(np.isclose(value, figure, rtol=DIGITS, atol=1e-7, equal_nan=True))


@dataclass(frozen=True, eq=False)
class Expected:
    """What a run says of a state; problem: why there is none."""

    state: list[Any]
    changes: list[str]
    asked: scenario.Scenario | None = None
    program: nc.Program | None = None
    positions: Mapping[str, np.ndarray[Any, Any]] = field(default_factory=dict)
    figures: Mapping[str, Figure] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    problem: str = ""


@cache
def expected(name: str) -> tuple[dict[str, Any], list[Expected]]:
    """A page's data, and its random states as `feedsim run` has them; once for all that computes them otherwise."""
    given = scenario.load(SCENARIOS / f"{name}.yaml", SHORT[name])
    data, found = content(given, nc.plan(given)).data, []
    for state in states(data, STATES, seed=31):
        changes = [*SHORT[name], *settings(data, state)]
        try:
            asked = scenario.load(SCENARIOS / f"{name}.yaml", changes)
            program = nc.plan(asked)
            run = judge_run(cosim.run(asked, program=program))
            moved = [axis for axis in asked.machine.axes if any(axis in motion.axes for motion in asked.motions)]
            positions = {f"{axis}.x_a": np.array(run.trace[f"{axis}.x_a"]) for axis in moved}
            warnings, causes = tuple(without_loops(run.warnings)), diagnoses(run)
            left_out = {f"{prefix}.{name}" for prefix, cause in causes.items() for name in cause_figures(cause)}
            figures = {name: figure for name, figure in evaluate(run).items() if name not in left_out}
            found.append(Expected(state, changes, asked, program, positions, figures, warnings))
        except FeedsimError as error:
            found.append(Expected(state, changes, problem=str(error)))
    assert sum(not each.problem for each in found) > STATES // 2, "most of the states can be run"
    return data, found


@pytest.mark.extensive
@pytest.mark.skipif(NODE is None, reason="no node on this machine (Debian: apt install nodejs)")
@pytest.mark.parametrize("name", SHORT)
def test_random_states_are_runs_of_the_same_settings(name: str, tmp_path: Path) -> None:
    data, wanted = expected(name)
    keep = [*next(each.positions for each in wanted if not each.problem)]
    asked = [{"state": each.state, "axis": keep[-1].partition(".")[0], "keep": keep} for each in wanted]
    for each, page in zip(wanted, answers(data, asked, tmp_path), strict=True):
        if each.problem:
            assert "problem" in page, f"{each.changes}: refused by a run, not by the page: {each.problem}"
            continue
        assert "problem" not in page, f"{each.changes}: {page['problem']}"
        assert each.asked is not None
        assert each.program is not None
        setpoints = rows(each.asked, each.program)
        planned = np.array(page["rows"]).reshape(setpoints.shape)
        assert np.abs(planned - setpoints)[:, ::2].max() <= SAME
        # A speed of 50 mm/s is 16 rad/s: the quotient of differences of positions.
        assert np.abs(planned - setpoints)[:, 1::2].max() <= 1e-9
        for column, values in each.positions.items():
            assert np.abs(np.array(page["trace"][column]) - values).max() <= SAME, (column, each.changes)
        for figure, (value, unit) in page["figures"].items():
            assert unit == each.figures[figure].unit
            assert same(value, each.figures[figure].value), (figure, value, each.figures[figure].value)
        assert [*page["figures"]] == [*each.figures]
        assert sorted(page["warnings"]) == list(each.warnings)
        for mine, its in zip(page["segments"], segments(each.program), strict=True):
            assert {key: mine[key] for key in ("kind", "index", "axes")} == {
                key: its[key] for key in ("kind", "index", "axes")
            }
            assert mine["end"] == pytest.approx(its["end"], abs=1e-12)
        _compare_loop(page["loop"], each.asked)


@pytest.mark.extensive
@pytest.mark.parametrize("name", SHORT)
def test_random_states_in_a_browser(browser: Any, name: str, tmp_path: Path) -> None:
    """The same in Chromium, as a reader of the page has it: figures to the digits shown, positions by the CSV."""
    data, wanted = expected(name)
    file = tmp_path / "page.html"
    changes = [part for change in SHORT[name] for part in ("--set", change)]
    assert cli.main(["export", str(SCENARIOS / f"{name}.yaml"), *changes, "--out", str(file)]) == 0
    assert file.stat().st_size < LARGEST
    with Opened(browser, file) as opened:
        opened.settled()
        for each in wanted:
            opened.turn_to(address_of(data, each.state))
            if each.problem:
                assert opened.page.locator("#problem").is_visible(), each.changes
                continue
            assert opened.page.locator("#problem").is_hidden(), each.changes
            seen = opened.figures()
            assert [*seen] == [*each.figures]
            for key, text in seen.items():
                value = each.figures[key].value
                if text == "not determined":
                    assert np.isnan(value)
                else:
                    # the last of four digits, where a half may be rounded either way; zeros to 1e-7
                    assert number_of(text) == pytest.approx(value, rel=5.01e-4, abs=1e-7), (key, each.changes)
            shown = opened.page.locator("#warnings li").all_inner_texts()
            assert sorted(shown) == sorted(typeset(warning) for warning in each.warnings)
            for column, mine in opened.trace([*each.positions]).items():
                assert np.abs(mine - each.positions[column]).max() <= SAME, (column, each.changes)
        assert opened.said == []
        assert [url.partition("#")[0] for url in opened.asked if not url.startswith("blob:")] == [file.as_uri()]


def test_a_page_in_firefox_is_a_run(firefox: Firefox, files: dict[str, Path]) -> None:
    for name, file in files.items():
        firefox.open(file)
        run = judge_run(cosim.run(scenario.load(SCENARIOS / f"{name}.yaml")))
        figures = evaluate(run)
        for key, text in firefox.run(FIGURES):
            if text == "not determined":
                assert np.isnan(figures[key].value)
            else:
                assert number_of(text) == pytest.approx(figures[key].value, rel=5.01e-4, abs=1e-7), key
        before = firefox.run(FIGURES)
        firefox.run(
            "(slider => { slider.value = 150; slider.dispatchEvent(new Event('input')); "
            "slider.dispatchEvent(new Event('change')); })(document.querySelectorAll('#knobs input[type=range]')[2])"
        )
        firefox.settled()
        assert firefox.run(FIGURES) != before
    assert firefox.complaints() == []


def _compare_loop(loop: dict[str, Any], asked: scenario.Scenario) -> None:
    """The page's experiment against the closed form; both without friction."""
    modes = checked_modes(asked.machine)
    system = LinearSystem(asked.machine, modes)

    def gain(frequency: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        return position_gain(system, loop["axis"], 2j * np.pi * np.asarray(frequency))

    assert not loop["growing"]
    f = np.array(loop["frequency"])
    mine = np.array(loop["real"]) + 1j * np.array(loop["imaginary"])
    # What still rings after four seconds, and the digits that a micrometre beside a metre has.
    assert np.abs(mine / gain(f) - 1).max() < 1e-3
    its = margins(gain, grid(modes, float(f[0]), float(f[-1])))
    assert float(loop["gain_margin"]) == pytest.approx(its.gain_margin.factor, rel=1e-3)
    assert float(loop["phase_margin"]) == pytest.approx(its.phase_margin.margin, abs=0.05)
