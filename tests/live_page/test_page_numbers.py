"""What a page computes against a run of the same scenario with the same settings: setpoints, positions, figures,
warnings, margins. The page's scripts run in node; another test has them in a browser."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from feedsim import cosim, nc, scenario
from feedsim.analysis import Figure, evaluate
from feedsim.analysis.circle import answer, swinging
from feedsim.analysis.evaluate import diagnoses, doubts
from feedsim.cosim import fmus_directory
from feedsim.errors import FeedsimError
from feedsim.linear.loops import position_gain
from feedsim.linear.margins import grid, margins
from feedsim.linear.system import LinearSystem
from feedsim.page.content import content, rows, segments
from feedsim.report.content import Table
from feedsim.report.run.diagnosis import diagnosis_section
from feedsim.structure import checked_modes
from page_helpers import NODE, answers

pytestmark = [
    pytest.mark.skipif(NODE is None, reason="no node on this machine (Debian: apt install nodejs)"),
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


@pytest.mark.parametrize("name", ["xz_circle", "z_positioning"])
def test_random_states_are_runs_of_the_same_settings(name: str, tmp_path: Path) -> None:
    given = scenario.load(SCENARIOS / f"{name}.yaml", SHORT[name])
    data = content(given, nc.plan(given)).data
    drawn = states(data, STATES, seed=31)
    axes = [axis for axis in given.machine.axes if any(axis in motion.axes for motion in given.motions)]
    keep = [f"{axis}.x_a" for axis in axes]
    found = answers(data, [{"state": state, "axis": axes[-1], "keep": keep} for state in drawn], tmp_path)
    compared = 0
    for state, page in zip(drawn, found, strict=True):
        changes = [*SHORT[name], *settings(data, state)]
        try:
            asked = scenario.load(SCENARIOS / f"{name}.yaml", changes)
            program = nc.plan(asked)
            run = cosim.run(asked, program=program)
            figures = evaluate(run)
        except FeedsimError as error:
            if "problem" not in page:
                pytest.fail(f"{changes}: refused by a run, not by the page: {error}")
            continue
        assert "problem" not in page, f"{changes}: {page['problem']}"
        compared += 1
        wanted = rows(asked, program)
        planned = np.array(page["rows"]).reshape(wanted.shape)
        assert np.abs(planned - wanted)[:, ::2].max() <= SAME
        # A speed of 50 mm/s is 16 rad/s: the quotient of differences of positions.
        assert np.abs(planned - wanted)[:, 1::2].max() <= 1e-9
        for column in keep:
            assert np.abs(np.array(page["trace"][column]) - run.trace[column]).max() <= SAME, (column, changes)
        _compare_causes(page, run, figures)
        for figure, (value, unit) in page["figures"].items():
            assert unit == figures[figure].unit
            assert same(value, figures[figure].value), (figure, value, figures[figure].value)
        assert sorted(page["warnings"]) == sorted(map(str, run.warnings))
        for mine, its in zip(page["segments"], segments(program), strict=True):
            assert {key: mine[key] for key in ("kind", "index", "axes")} == {
                key: its[key] for key in ("kind", "index", "axes")
            }
            assert mine["end"] == pytest.approx(its["end"], abs=1e-12)
        _compare_loop(page["loop"], asked)
    assert compared > STATES // 2, "most of the states can be run"


def _compare_causes(page: dict[str, Any], run: cosim.Run, figures: Mapping[str, Figure]) -> None:
    """Why the circle is not round: its figures, in the order of a run, and all that is said of them."""
    for prefix, diagnosis in diagnoses(run).items():
        found = page["causes"].pop(prefix)
        page["figures"] |= found["figures"]
        assert [*page["figures"]] == [*figures]
        assert (found["answer"], found["swinging"]) == (answer(diagnosis), swinging(diagnosis))
        table = next(part for part in diagnosis_section(prefix, diagnosis).parts if isinstance(part, Table))
        assert [tuple(row) for row in found["rows"]] == list(table.rows)
        assert found["doubts"] == [str(note) for note in doubts(figures, {prefix: diagnosis})]
    assert not page["causes"]


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
