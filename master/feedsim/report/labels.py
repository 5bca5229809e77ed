"""Titles, legends and labels that keep clear of the curves, whatever the data."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from feedsim.report.style import MUTED, PAPER, Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.text import Text

LEGEND_ROW = 20.0  # points between axes and title, for a legend in one row
CLEAR = 0.05  # of the height of the axes: a label this far from every curve is far enough


def heading(axes: Axes, title: str) -> None:
    """Title above a row that is kept for the legend; titles of neighbours stand at the same height then."""
    axes.set_title(title, pad=LEGEND_ROW)


def legend_above(axes: Axes) -> None:
    """Legend in one row between axes and title, where no curve can be."""
    handles = axes.get_legend_handles_labels()[0]
    if handles:
        axes.legend(
            handles=handles, loc="lower left", bbox_to_anchor=(0, 1), ncols=len(handles), fontsize=8.5,
            handlelength=1.7, handletextpad=0.5, columnspacing=1.2, borderaxespad=0.25, borderpad=0.1,
        )  # fmt: skip


def torque_label(sign: int) -> str:
    """Ordinate of torques that are drawn with a display sign, +-1."""
    return "torque [N·m]" if sign > 0 else "torque, sign reversed [N·m]"


def reversed_note(axes: Iterable[str], signs: Mapping[str, int]) -> str:
    """The end of a caption: axes whose torques are drawn with the display sign -1; empty without any."""
    reversed_ones = [axis for axis in axes if signs.get(axis, 1) < 0]
    return f" Torques of {', '.join(reversed_ones)} are drawn with reversed sign." if reversed_ones else ""


def mark_instant(axes: Axes, instant: float, text: str) -> None:
    """Dotted vertical line with a label beside it: to the right, or to the left where it would leave the axes.

    Call when limits and curves are final.
    """
    axes.axvline(instant, color=MUTED, linewidth=0.9, linestyle=(0, (1, 2)))
    low, high = axes.get_xlim()
    share = (instant - low) / (high - low)
    label = axes.annotate(
        text, (instant, 0.5), xycoords=("data", "axes fraction"), xytext=(5, 0), textcoords="offset points",
        color=MUTED, fontsize=9, va="center",
    )  # fmt: skip
    width, height = _size(axes, label)
    to_left = share + width > 1
    if to_left:
        label.set(ha="right", x=-5)
    begin = share - width if to_left else share
    heights = (0.06, 0.94, *np.linspace(0.14, 0.86, 10))
    label.xy = (instant, clearest(axes, begin, begin + width, heights, height / 2))
    keep_inside(label)


def clearest(axes: Axes, begin: float, end: float, heights: Sequence[float], half: float = 0.0) -> float:
    """First of ``heights`` that keeps clear of all curves between begin and end, or the one that is farthest from them.

    All in shares of the axes; half: half the height of what is to be placed.
    """
    rooms = _rooms(axes, begin, end, heights, half)
    return heights[next((k for k, room in enumerate(rooms) if room >= CLEAR), int(np.argmax(rooms)))]


def place_beside_level(axes: Axes, label: Text, at: float, level: float) -> None:
    """Put a centred label above or below the point (at, level) (data), as close to it as the curves allow.

    Away from zero is tried first; sideways, the label may move by a third of the axes.
    """
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    share, height = (at - left) / (right - left), (level - low) / (high - low)
    width, tall = _size(axes, label)
    outwards = 1 if level >= 0 else -1
    best = (-np.inf, share, height)
    for step, side, shift in product(range(1, 10), (outwards, -outwards), (0.0, -0.1, 0.1, -0.2, 0.2, -0.3, 0.3)):
        x, y = share + shift, height + side * step * 0.09
        if width / 2 < x < 1 - width / 2 and 0.05 <= y <= 0.95:
            (room,) = _rooms(axes, x - width / 2, x + width / 2, (y,), tall / 2)
            best = max(best, (min(room, 0.5 * CLEAR), x, y), key=lambda found: found[0])
    label.set(transform=axes.transAxes, position=best[1:], bbox=plain_box())
    keep_inside(label)


def _rooms(axes: Axes, begin: float, end: float, heights: Sequence[float], half: float) -> list[float]:
    """Distance of what stands at each of ``heights`` from the nearest curve between begin and end."""
    curves = [
        _between(axes, line.get_xydata(), begin, end)
        for line in axes.lines
        if line.get_transform().contains_branch_seperately(axes.transData) == (True, True)
    ]
    occupied = np.concatenate([*curves, [np.inf]])
    return [float(np.abs(occupied - height).min()) - half for height in heights]


def beside(axes: Axes, label: Text, at: float, distance: float) -> Literal["left", "right"]:
    """Alignment of a label ``distance`` points beside ``at`` (data): to the right of it where it fits, else left."""
    low, high = axes.get_xlim()
    gap = distance / 72 * axes.figure.dpi / axes.get_window_extent().width
    return "left" if (at - low) / (high - low) + gap + _size(axes, label)[0] < 1 else "right"


def keep_inside(label: Text) -> Text:
    """Clip a label to its axes and leave it out of the layout: it never shrinks the figure."""
    label.set_in_layout(False)
    label.set_clip_on(True)
    return label


def plain_box() -> dict[str, Any]:
    """Ground for a label over a grid."""
    return {"facecolor": PAPER, "edgecolor": "none", "pad": 1.0}


def _size(axes: Axes, label: Text) -> tuple[float, float]:
    """Width and height of a label in shares of the axes, which the layout has not yet given their final size."""
    room, text = axes.get_window_extent(), label.get_window_extent()
    return 1.05 * text.width / room.width, 1.05 * text.height / room.height


def _between(axes: Axes, points: Any, begin: float, end: float) -> Array:
    """Heights, as shares of the axes, that a curve takes between two shares of their width."""
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    x = (np.asarray(points, dtype=float)[:, 0] - left) / (right - left)
    y = (np.asarray(points, dtype=float)[:, 1] - low) / (high - low)
    if len(x) < 2 or np.any(np.diff(x) < 0):  # a marker or a loop
        return np.asarray(y[(x >= begin) & (x <= end)])
    at = np.linspace(max(begin, x[0]), min(end, x[-1]), 200)
    inner = y[(x >= begin) & (x <= end)]
    return np.concatenate([np.interp(at, x, y), inner]) if begin <= x[-1] and end >= x[0] else inner
