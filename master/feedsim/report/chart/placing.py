"""Words within the panels of a drawing, each where no curve is; nothing is left to the data's mercy."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from feedsim.report.style import MUTED, PAPER, Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.text import Text

CELL = 2.0  # points: how finely a panel is looked at
LABEL_DISTANCE, LED_DISTANCE = 3.5, 9.0  # points between a point and its label; from which on a line leads to it
MAX_LABEL_DISTANCE = 12.0  # points, of a label from its line
WORD_GAP = 2  # cells between words
COVERED = 1e4  # what it costs to stand on a curve, against points of distance
# points: of words, of those that need to be smaller, about a note
LABEL_POINTS, MIN_LABEL_POINTS, NOTE_POINTS = 8.5, 6.5, 5.0


def fit(axes: Axes, title: Text) -> None:
    """Make title and names of axes as small as their panel needs them."""
    room = axes.get_window_extent()
    across, up = axes.xaxis.label, axes.yaxis.label
    for text, most in ((title, room.width + 30), (across, room.width + 20), (up, room.height + 16)):
        extent = text.get_window_extent()
        size = extent.height if text is up else extent.width
        if size > most:
            text.set_fontsize(max(MIN_LABEL_POINTS, float(text.get_fontsize()) * most / size))


class Ground:
    """A panel in small squares: which of them are taken by curves and words."""

    def __init__(self, axes: Axes) -> None:
        self.axes = axes
        self.per = axes.figure.dpi / 72  # pixels of a point
        self.room = axes.get_window_extent()
        self.cell = CELL * self.per
        shape = (int(self.room.width / self.cell) + 1, int(self.room.height / self.cell) + 1)
        self.taken: NDArray[np.bool_] = np.zeros(shape, dtype=bool)
        for line in axes.lines:
            if line.get_transform().contains_branch_seperately(axes.transData) == (True, True):
                self.take(np.asarray(line.get_xydata(), dtype=float), lines=line.get_linestyle() != "None")
        for segments in axes.collections:
            for each in getattr(segments, "get_segments", list)():
                self.take(np.asarray(each, dtype=float))

    def take(self, points: Array, *, lines: bool = True, about: int = 0) -> None:
        """Squares of points (N, 2) in the panel's coordinates, of the lines between them, and so many about them."""
        if not len(points):
            return
        with np.errstate(all="ignore"):
            at = (self.axes.transData.transform(points) - (self.room.x0, self.room.y0)) / self.cell
        at = at[np.isfinite(at).all(axis=1)] if not lines else at
        if lines and len(at) > 1:
            at = np.clip(at, -2.0 * max(self.taken.shape), 3.0 * max(self.taken.shape))
            steps = np.abs(np.diff(at, axis=0)).max(axis=1)
            count = np.where(np.isfinite(steps), np.ceil(steps), 0).astype(int) + 1
            first = np.repeat(np.arange(len(count)), count)
            share = (np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)) / np.repeat(count, count)
            at = at[first] + share[:, None] * (at[first + 1] - at[first])
            at = at[np.isfinite(at).all(axis=1)]
        beside = np.arange(-about, about + 1)
        offsets = np.stack(np.meshgrid(beside, beside), axis=-1).reshape(-1, 2)
        cells = (np.floor(at).astype(int)[:, None] + offsets).reshape(-1, 2)
        inside = ((cells >= 0) & (cells < self.taken.shape)).all(axis=1)
        self.taken[tuple(cells[inside].T)] = True

    def beside(self, x: float, y: float, text: str, colour: str) -> None:
        """A label close to a point."""
        a, b = self._pixels(x, y)
        label = self._label(text, colour)

        def far(left: Array, low: Array, wide: float, tall: float) -> Array:
            gap = np.hypot(np.maximum(0, np.maximum(left - a, a - left - wide)),
                           np.maximum(0, np.maximum(low - b, b - low - tall)))  # fmt: skip
            middle = np.hypot(left + wide / 2 - a, low + tall / 2 - b)
            near = LABEL_DISTANCE * self.per
            return np.where(gap < near, COVERED, gap - near) + 0.05 * middle - 0.1 * np.clip(low - b, 0, near)

        left, low, wide, tall = self._put(label, far)
        to = (np.clip(a, left, left + wide), np.clip(b, low, low + tall))
        if np.hypot(to[0] - a, to[1] - b) > LED_DISTANCE * self.per:
            ends = self.axes.transData.inverted().transform([(a, b), to])
            self.axes.plot(*ends.T, color=MUTED, linewidth=0.7, zorder=5)

    def along(self, y: float, text: str, colour: str, ends: tuple[float, float] | None) -> None:
        """A label of a level line: above or below it, as far right as may be."""
        _, b = self._pixels(self.axes.get_xlim()[0], y)
        right = self.room.x1 if ends is None else self._pixels(ends[1], y)[0]
        begin = self.room.x0 if ends is None else self._pixels(ends[0], y)[0]

        def far(left: Array, low: Array, wide: float, tall: float) -> Array:
            gap = np.maximum(low - b, b - low - tall)
            aside = np.abs(right - left - wide) if ends is None else 0.3 * np.abs((begin + right) / 2 - left - wide / 2)
            cost = np.where(gap < self.per, COVERED, 2 * gap) + 0.1 * aside - 0.5 * np.clip(low - b, 0, self.per)
            return np.asarray(cost)

        self._put(self._label(text, colour), far)

    def upright(self, x: float, text: str, colour: str) -> None:
        """A label of an upright line: beside it, as high as may be."""
        a, _ = self._pixels(x, self.axes.get_ylim()[0])

        def far(left: Array, low: Array, wide: float, tall: float) -> Array:
            gap = np.maximum(left - a, a - left - wide)
            off = np.where(
                (gap < 2 * self.per) | (gap > MAX_LABEL_DISTANCE * self.per), 3 * COVERED, 4 * gap
            )  # else it is another's
            return np.asarray(off + 0.1 * (self.room.y1 - low - tall) + (left < a))

        self._put(self._label(text, colour), far)

    def corner(self, text: str, colour: str) -> None:
        """A note, in the lower left where that is free, else near another corner."""

        def far(left: Array, low: Array, wide: float, tall: float) -> Array:
            aside = np.minimum(left - self.room.x0, 40 + self.room.x1 - left - wide)
            return np.asarray(aside + np.minimum(low - self.room.y0, 20 + self.room.y1 - low - tall))

        self._put(self._label(text, colour), far, NOTE_POINTS * self.per)

    def _pixels(self, x: float, y: float) -> tuple[float, float]:
        a, b = self.axes.transData.transform((x, y))
        return float(a), float(b)

    def _label(self, text: str, colour: str) -> Text:
        ground = {"facecolor": PAPER, "edgecolor": "none", "pad": 1.0, "alpha": 0.7}
        look: dict[str, Any] = {
            "fontsize": LABEL_POINTS,
            "color": colour,
            "linespacing": 1.3,
            "zorder": 8,
            "bbox": ground,
        }
        label = self.axes.text(0, 0, text, ha="left", va="bottom", transform=None, **look)
        label.set_in_layout(False)
        return label

    def _put(self, label: Text, far: Any, edge: float = 1.0) -> tuple[float, float, float, float]:
        """Put a label where it covers least and is least far, `edge` pixels inside the panel; its place in pixels."""
        extent = label.get_window_extent()
        wide, tall = extent.width, extent.height
        across, up = (int(np.ceil(size / self.cell)) + 1 for size in (wide, tall))
        sums = np.zeros(tuple(n + 1 for n in self.taken.shape))
        sums[1:, 1:] = np.cumsum(np.cumsum(self.taken, axis=0), axis=1)
        n, m = (max(1, size - taken) for size, taken in zip(self.taken.shape, (across, up), strict=True))
        i, j = np.arange(n)[:, None], np.arange(m)[None, :]
        i1, j1 = (np.minimum(at + more, size) for at, more, size in
                  zip((i, j), (across, up), self.taken.shape, strict=True))  # fmt: skip
        covered = sums[i1, j1] - sums[i, j1] - sums[i1, j] + sums[i, j]
        left, low = self.room.x0 + i * self.cell, self.room.y0 + j * self.cell
        inside = (left >= self.room.x0 + edge) & (left + wide <= self.room.x1 - edge)
        inside = inside & (low >= self.room.y0 + edge) & (low + tall <= self.room.y1 - edge)
        cost = (
            np.where(inside, 0.0, 100 * COVERED)
            + far(left, low, wide, tall)
            + np.where(covered > 0, COVERED, 0.0)
            + 50 * covered
        )
        a, b = np.unravel_index(int(np.argmin(cost)), cost.shape)
        self.taken[max(0, a - WORD_GAP) : a + across + WORD_GAP, b : b + up] = True
        x, y = float(left[a, 0]), float(low[0, b])
        label.set_transform(self.axes.transAxes)
        at = self.axes.transAxes.inverted().transform((x, y))
        label.set_position((float(at[0]), float(at[1])))
        return x, y, wide, tall
