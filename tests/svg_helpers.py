"""Charts as text of an SVG, read again: panels with their words and curves, in pixels of the picture."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any
from xml.etree import ElementTree

import numpy as np

from feedsim.report.chart.svg import width_of

Box = tuple[float, float, float, float]  # left, top, right, bottom


@dataclass
class Word:
    """A text, and where it stands. over: it stands over curves; upright: turned."""

    text: str
    x: float
    y: float
    anchor: str
    bold: bool = False
    over: bool = False
    upright: bool = False

    @property
    def box(self) -> Box:
        """What it covers, as the placing of words reckons."""
        wide = width_of(self.text) - 2
        left = self.x - {"start": 0, "middle": wide / 2, "end": wide}[self.anchor]
        return left, self.y - 9, left + wide, self.y + 2


@dataclass
class Drawn:
    """A panel. room: of its curves; curves: their points (N, 2), each with its attributes."""

    words: list[Word] = field(default_factory=list)
    room: Box | None = None
    curves: list[tuple[np.ndarray, dict[str, str]]] = field(default_factory=list)
    circles: list[dict[str, str]] = field(default_factory=list)
    lines: list[dict[str, str]] = field(default_factory=list)

    @property
    def texts(self) -> list[str]:
        return [word.text for word in self.words]

    @property
    def over(self) -> list[Word]:
        """Words over curves."""
        return [word for word in self.words if word.over]


def name_of(element: Any) -> str:
    return str(element.tag).rpartition("}")[2]


def moved(element: Any) -> tuple[float, float]:
    found = re.match(r"translate\(([-\d.]+) ([-\d.]+)\)", element.attrib.get("transform", ""))
    return (float(found[1]), float(found[2])) if found else (0.0, 0.0)


def drawn_panels(drawn: str) -> tuple[list[Drawn], list[str], float]:
    """Panels, names of the legend, and the room that the legend takes above the panels."""
    root = ElementTree.fromstring(drawn)
    groups = [each for each in root if name_of(each) == "g"]
    legend = [str(each.text) for each in root if name_of(each) == "text"]
    return [_panel(group) for group in groups], legend, moved(groups[0])[1] - 4.0


def _panel(group: Any) -> Drawn:
    found = Drawn()
    for element, x, y, over, inside in _walk(group, 0.0, 0.0, False, False):
        kind, known = name_of(element), element.attrib
        if kind == "text":
            found.words.append(Word(
                str(element.text), x + float(known.get("x", 0)), y + float(known.get("y", 0)),
                known.get("text-anchor", "start"), int(known.get("font-weight", 400)) > 400,
                over or "paint-order" in known, "rotate" in known.get("transform", ""),
            ))  # fmt: skip
        elif kind == "rect" and found.room is None and known.get("fill") == "none":
            left, top, wide, tall = (float(known[each]) for each in ("x", "y", "width", "height"))
            found.room = (x + left, y + top, x + left + wide, y + top + tall)
        elif kind == "path" and inside:
            points = re.findall(r"[ML](-?[\d.]+) (-?[\d.]+)", known["d"])
            found.curves.append((np.array(points, dtype=float) + np.array([x, y]), dict(known)))
        elif kind == "circle":
            found.circles.append(dict(known))
        elif kind == "line":
            found.lines.append(dict(known))
    return found


def _walk(element: Any, x: float, y: float, over: bool, inside: bool) -> Iterator[tuple[Any, float, float, bool, bool]]:
    a, b = moved(element)
    x, y = x + a, y + b
    over, inside = over or "paint-order" in element.attrib, inside or "clip-path" in element.attrib
    yield element, x, y, over, inside
    for each in element:
        yield from _walk(each, x, y, over, inside)


def overlap(one: Box, other: Box) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]


def assert_legible(drawn: str) -> None:
    """No word over the curves of a panel leaves it or covers another one, no ticks touch."""
    for panel in drawn_panels(drawn)[0]:
        assert panel.room is not None
        left, top, right, bottom = panel.room
        for word in panel.over:
            x0, y0, x1, y1 = word.box
            assert left - 1 <= x0 < x1 <= right + 3, word
            assert top - 1 <= y0 < y1 <= bottom + 1, word
        assert not any(overlap(one.box, other.box) for one, other in combinations(panel.over, 2))
        level = [word for word in panel.words if not word.upright and not word.over]
        for one, other in combinations(level, 2):
            assert not overlap(one.box, other.box), (one, other)
