"""Diagrams of the docs: as their script draws them, with words for those who do not see them, for light and dark."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "docs"))
import diagrams  # noqa: E402  (a script of the documentation, in no package)

SVG = "{http://www.w3.org/2000/svg}"


@pytest.mark.parametrize("name", diagrams.DRAWINGS)
def test_drawing_is_what_its_script_draws(name: str) -> None:
    drawn = diagrams.DRAWINGS[name]().svg()
    assert (ROOT / "docs" / "images" / name).read_text(encoding="utf-8") == drawn, "python docs/diagrams.py"
    root = ElementTree.fromstring(drawn)
    assert root.find(f"{SVG}title") is not None
    assert len(root.findtext(f"{SVG}desc", "").split()) > 20
    assert "prefers-color-scheme: dark" in drawn
    assert "href" not in drawn


@pytest.mark.parametrize("name", diagrams.DRAWINGS)
def test_words_stay_inside_of_the_drawing(name: str) -> None:
    drawing = diagrams.DRAWINGS[name]()
    for text in ElementTree.fromstring(drawing.svg()).iter(f"{SVG}text"):
        half = 4.2 * len("".join(text.itertext()))
        x, y = float(text.attrib["x"]), float(text.attrib["y"])
        begin = {"middle": x - half, "start": x}[text.attrib["text-anchor"]]
        assert begin >= 0
        assert begin + 2 * half <= drawing.width, "".join(text.itertext())
        assert 10 <= y <= drawing.height - 4


@pytest.mark.parametrize("name", diagrams.DRAWINGS)
def test_a_page_shows_it(name: str) -> None:
    pages = (page.read_text(encoding="utf-8") for page in (ROOT / "docs").rglob("*.md"))
    assert any(f"images/{name})" in page for page in pages)


@pytest.mark.parametrize(("shape", "mirrored"), [(2, -1), (4, 1)])
def test_ellipses_lie_as_their_cause_has_them(shape: int, mirrored: int) -> None:
    """At 45 degrees the deviation changes its sign with the angle, along an axis it does not."""
    deviation: Callable[[float], float] = diagrams.SHAPES[shape][2]
    assert deviation(-30.0) == pytest.approx(mirrored * deviation(30.0))


def test_figures_of_the_drawn_report_are_those_that_a_run_prints() -> None:
    """The tutorial's output is compared with a run's; the peak of X stands in the page on pages."""
    printed = (ROOT / "docs" / "tutorials" / "first-circle.md").read_text(encoding="utf-8")
    printed += (ROOT / "docs" / "page.md").read_text(encoding="utf-8")
    figures = [word for word in " ".join((*diagrams.ANSWER, *(tile for tile, _ in diagrams.TILES))).split()
               if word[0].isdigit()]  # fmt: skip
    assert len(figures) == 5
    assert not [figure for figure in figures if figure not in printed]


def test_lost_motion_steps_where_the_vertical_axis_reverses() -> None:
    deviation: Callable[[float], float] = diagrams.SHAPES[5][2]
    assert deviation(90.1) - deviation(89.9) == pytest.approx(1.4, rel=1e-3)
    assert deviation(0.1) - deviation(-0.1) == pytest.approx(0, abs=0.01)
