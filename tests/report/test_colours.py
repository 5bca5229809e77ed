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
from feedsim.report.formatting import Array
from feedsim.report.replay import MOST_NAMES, names_of
from feedsim.report.show import looks_of

REPORT = Path(formatting.__file__).parent
MEANINGS = (
    "SIMULATED_COLOUR", "RECORDED_COLOUR", "SETPOINT_COLOUR", "AT_TOOL", "RESIDUAL_COLOUR", "ALLOWED_COLOUR",
    "FRICTION_COLOUR", "ALTERNATIVE_COLOUR", "CLOCKWISE",
)  # fmt: skip
# Word with which the name of a curve begins -> meanings that its colour may have.
WORDS = {
    "recorded": {"RECORDED_COLOUR"},
    "measured": {"RECORDED_COLOUR"},
    "reference": {"RECORDED_COLOUR"},
    "without": {"BEFORE_COLOUR"},
    "simulated": {"SIMULATED_COLOUR"},
    "model": {"SIMULATED_COLOUR"},
    "fit": {"SIMULATED_COLOUR"},
    "result": {"SIMULATED_COLOUR"},
    "linear scales": {"SIMULATED_COLOUR", "CLOCKWISE"},
    "with compensation": {"AFTER_COLOUR"},
    "setpoint": {"SETPOINT_COLOUR"},
    "friction": {"FRICTION_COLOUR"},
    "tolerance": {"ALLOWED_COLOUR"},
    "outside": {"RESIDUAL_COLOUR"},
}
# Modules whose colours are a list of many alike things: levels of a parameter, bodies, signals, stretches, sources.
LISTS = {
    "sweep/figure_plots.py", "sweep/report.py", "machine.py", "machine_record.py", "run/axis_plots.py",
    "identify/report.py", "identify/stribeck_plots.py", "show.py", "frf/bode.py", "frf/report.py",
    "chart/model.py", "chart/svg.py", "run/contour.py",
}  # fmt: skip
RAW = {"BLUE", "VERMILLION", "GREEN", "PURPLE", "ORANGE", "SKY", "WINE"}


def test_no_two_meanings_share_a_colour() -> None:
    colours = [getattr(formatting, name) for name in MEANINGS]
    assert len(set(colours)) == len(colours)
    assert (formatting.BEFORE_COLOUR, formatting.AFTER_COLOUR) == (
        formatting.RECORDED_COLOUR,
        formatting.SIMULATED_COLOUR,
    )


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
            names = {each.id for each in elements if isinstance(each, ast.Name)}
            meanings = names & {*MEANINGS, "BEFORE_COLOUR", "AFTER_COLOUR"}
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
        ([RESULT, RESULT], [formatting.BEFORE_COLOUR, formatting.AFTER_COLOUR]),
        ([RESULT, RECORD], [formatting.SIMULATED_COLOUR, formatting.RECORDED_COLOUR]),
        ([RECORD, RESULT, RESULT], [formatting.RECORDED_COLOUR, formatting.SIMULATED_COLOUR, formatting.SKY]),
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
    assert Curve("", np.zeros(1), np.zeros(1)).colour == formatting.SIMULATED_COLOUR


# What the colour-blind see of linear RGB (Machado, Oliveira, Fernandes 2009, severity 1), protan and deutan.
SEEN = {
    "all": np.eye(3),
    "without red": np.array([[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
                             [-0.003882, -0.048116, 1.051998]]),
    "without green": np.array([[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.042847],
                               [-0.011820, 0.042940, 0.968881]]),
}  # fmt: skip


def linear(colour: str) -> Array:
    """Of sRGB, after IEC 61966-2-1."""
    values = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def lab(rgb: Array) -> Array:
    """CIELAB of linear RGB under D65."""
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    xyz = to_xyz @ np.clip(rgb, 0, 1) / np.array([0.9505, 1.0, 1.089])
    x, y, z = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("ground", [0, 1])
@pytest.mark.parametrize("seen", SEEN)
def test_both_directions_of_a_circle_are_told_apart(ground: int, seen: str) -> None:
    """From each other, from the tool point, and from the ground (3:1, WCAG 2.1), with any eyes.

    A difference of 2.3 is just noticed; that of the two colours of thin lines is some ten times as large.
    """
    shades = {light: (light, dark)[ground] for _, light, dark in formatting.PALETTE}
    back, paper = shades[formatting.CLOCKWISE], shades[formatting.PAPER]
    y, y_paper = (float(linear(colour) @ [0.2126, 0.7152, 0.0722]) for colour in (back, paper))
    assert (max(y, y_paper) + 0.05) / (min(y, y_paper) + 0.05) > 3
    for other in (formatting.SIMULATED_COLOUR, formatting.RECORDED_COLOUR, formatting.AT_TOOL):
        distance = np.linalg.norm(lab(SEEN[seen] @ linear(back)) - lab(SEEN[seen] @ linear(shades[other])))
        assert distance > 20, other
