"""One meaning per colour and line, in the pictures of every kind of report."""

from __future__ import annotations

import ast
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from feedsim.files.trace import Mark
from feedsim.report import formatting
from feedsim.report.chart import Curve
from feedsim.report.replay.report import MOST_NAMES, names_of
from feedsim.report.show import looks_of

REPORT = Path(formatting.__file__).parent
MEANINGS = ("SIMULATED", "RECORDED", "SETPOINT", "AT_TOOL", "RESIDUAL_COLOUR", "ALLOWED", "FRICTION", "OTHERWISE")
# Word with which the name of a curve begins -> meanings that its colour may have.
WORDS = {
    "recorded": {"RECORDED"},
    "measured": {"RECORDED"},
    "reference": {"RECORDED"},
    "without": {"BEFORE"},
    "simulated": {"SIMULATED"},
    "model": {"SIMULATED"},
    "fit": {"SIMULATED"},
    "result": {"SIMULATED"},
    "linear scales": {"SIMULATED"},
    "with compensation": {"AFTER"},
    "setpoint": {"SETPOINT"},
    "friction": {"FRICTION"},
    "tolerance": {"ALLOWED"},
    "outside": {"RESIDUAL_COLOUR"},
}
# Modules whose colours are a list of many alike things: levels of a parameter, bodies, signals, stretches, sources.
LISTS = {
    "sweep/figure_plots.py", "sweep/report.py", "machine/model.py", "machine/report.py", "run/axis_plots.py",
    "identify/report.py", "identify/stribeck_plots.py", "show/report.py", "frf/bode.py", "frf/report.py",
    "chart/model.py", "chart/svg.py", "run/contour.py",
}  # fmt: skip
RAW = {"BLUE", "VERMILLION", "GREEN", "PURPLE", "ORANGE", "SKY"}


def test_no_two_meanings_share_a_colour() -> None:
    colours = [getattr(formatting, name) for name in MEANINGS]
    assert len(set(colours)) == len(colours)
    assert (formatting.BEFORE, formatting.AFTER) == (formatting.RECORDED, formatting.SIMULATED)


def test_colours_are_taken_by_their_meaning() -> None:
    """A module that needs a colour as such draws a list of many things, and is listed."""
    found = set()
    for file in REPORT.rglob("*.py"):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        names = {alias.name for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)
                 and node.module == "feedsim.report.formatting" for alias in node.names}  # fmt: skip
        if names & RAW:
            found.add(file.relative_to(REPORT).as_posix())
    assert found <= LISTS, found - LISTS


def test_a_curve_has_the_colour_of_its_name() -> None:
    seen = 0
    for file in REPORT.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            elements = node.args if isinstance(node, ast.Call) else node.elts if isinstance(node, ast.Tuple) else []
            if not elements or not isinstance(elements[0], ast.Constant) or not isinstance(elements[0].value, str):
                continue
            meanings = {each.id for each in elements if isinstance(each, ast.Name)} & {*MEANINGS, "BEFORE", "AFTER"}
            words = [word for word in WORDS if elements[0].value.startswith(word)]
            if meanings and words:
                seen += 1
                assert meanings <= WORDS[max(words, key=len)], (file.name, elements[0].value, meanings)
    assert seen >= 12


@dataclass(frozen=True)
class OneOf:
    figures: dict[str, float] = field(default_factory=dict)
    parameters: dict[str, str] = field(default_factory=dict)


RESULT, RECORD = OneOf(figures={"XZ.G": 1.0}), OneOf()


@pytest.mark.parametrize(
    ("sources", "colours"),
    [
        ([RESULT, RESULT], [formatting.BEFORE, formatting.AFTER]),
        ([RESULT, RECORD], [formatting.SIMULATED, formatting.RECORDED]),
        ([RECORD, RESULT, RESULT], [formatting.RECORDED, formatting.SIMULATED, formatting.SKY]),
    ],
)
def test_results_over_each_other(sources: list[OneOf], colours: list[str]) -> None:
    assert [colour for colour, _ in looks_of(sources)] == colours  # type: ignore[arg-type]


def test_many_results_are_told_apart() -> None:
    for sources in ([RESULT] * 15, [RECORD] * 3, [RESULT, RECORD, RECORD]):
        looks = looks_of(sources)  # type: ignore[arg-type]
        assert len(set(looks)) == len(looks)


def test_names_of_blocks_have_room() -> None:
    time = np.linspace(0.0, 9.0, 901)
    marks = [Mark(0.1 * k, f"N{k} G1 X{k}.123456 Y1") for k in range(90)]
    names = names_of(marks, time)
    shown = [mark.time for mark, name in zip(marks, names, strict=True) if name]
    assert 2 <= len(shown) <= MOST_NAMES
    assert np.diff(shown).min() >= 9.0 / MOST_NAMES - 1e-9
    assert all(len(name) <= 16 for name in names)
    assert names_of([Mark(1.0, "N10"), Mark(5.0, "N20")], time) == ["N10", "N20"]


def test_curves_take_their_meaning_by_default() -> None:
    assert Curve("", np.zeros(1), np.zeros(1)).colour == formatting.SIMULATED
