"""Words within a panel, where no curve is: what curves and words cover, in small squares, and the place of each word.

Sizes are pixels. The page's script places words by the same rules.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from feedsim.report.chart.layout import BLOCK, LETTER
from feedsim.report.style import Array

Box = tuple[float, float, float, float]  # left, top, width, height
Place = tuple[float, float, float]  # left, foot of the first line, how far it is from what it belongs to
ASCENT, LINE = 10.0, 15.0  # of words; from line to line
OUTSIDE, COVERING, COVERED = (
    1e6,
    120.0,
    10.0,
)  # what it costs: to leave the panel, to cover curves, and a square of them


def width_of(text: str) -> float:
    """About the width of words over curves."""
    return LETTER * max(map(len, text.split("\n"))) + 2


class Covered:
    """A panel in small squares: which of them curves and words cover."""

    def __init__(self, inner: Box) -> None:
        self.inner = inner
        self.squares: NDArray[np.bool_] = np.zeros(
            (math.ceil(inner[3] / BLOCK) + 1, math.ceil(inner[2] / BLOCK) + 1), dtype=bool
        )

    def box(self, x: float, y: float, wide: float, tall: float) -> None:
        """Cover a rectangle."""
        top, bottom, left, right = self._squares(x, y, wide, tall)
        self.squares[max(0, top) : max(0, bottom), max(0, left) : max(0, right)] = True

    def path(self, x: Array, y: Array, *, dots: bool = False) -> None:
        """Cover points (N,), and unless they are dots the lines between them."""
        points = np.column_stack([x - self.inner[0], y - self.inner[1]]) / BLOCK
        if not dots and len(points) > 1:
            points = np.clip(points, -1e3, 1e4)
            with np.errstate(invalid="ignore"):
                lengths = np.abs(np.diff(points, axis=0)).max(axis=1)
            counts = np.where(np.isfinite(lengths), np.ceil(lengths * 1.3), 0).astype(int) + 1
            first = np.repeat(np.arange(len(counts)), counts)
            share = (np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)) / np.repeat(
                counts, counts
            )
            points = points[first] + share[:, None] * (points[first + 1] - points[first])
        points = points[np.isfinite(points).all(axis=1)]
        at = np.floor(points).astype(int)
        rows, columns = self.squares.shape
        inside = (at[:, 0] >= 0) & (at[:, 0] < columns) & (at[:, 1] >= 0) & (at[:, 1] < rows)
        self.squares[at[inside, 1], at[inside, 0]] = True

    def put(self, text: str, places: Sequence[Place]) -> tuple[float, float]:
        """The place that covers least and is least far, which is covered then: left, and foot of the first line."""
        left, top, width, height = self.inner
        wide, tall = width_of(text), 12 + LINE * text.count("\n")

        best = (math.inf, 0, left + 4, top + 12)
        for k in sorted(range(len(places)), key=lambda k: places[k][2]):
            x, y, far = places[k]
            if far > best[0]:
                break
            begin, end, first, last = self._squares(x, y - ASCENT, wide, tall)
            if y - ASCENT < top or y - ASCENT + tall > top + height or x < left or x + wide > left + width + 1:
                far += OUTSIDE
            elif count := int(np.count_nonzero(self.squares[begin:end, first:last])):
                far += COVERING + COVERED * count
            best = min(best, (far, k, x, y))
        _, _, x, y = best
        self.box(x, y - ASCENT, wide, tall)
        return x, y

    def _squares(self, x: float, y: float, wide: float, tall: float) -> tuple[int, int, int, int]:
        x, y = (x - self.inner[0]) / BLOCK, (y - self.inner[1]) / BLOCK
        return math.floor(y), math.floor(y + tall / BLOCK) + 1, math.floor(x), math.floor(x + wide / BLOCK) + 1
