"""Figure of the correlation matrix of the estimated parameters."""

from __future__ import annotations

import math

from feedsim.identify.result import Correlation
from feedsim.report.identify.quantities import symbol
from feedsim.report.style import BLUE, GRID, MUTED, VERMILLION, Picture, drawing, finish

STRONG = 0.9  # printed bold


def correlation_picture(axis: str, correlation: Correlation) -> Picture | None:
    """The matrix in colours and numbers; None where nothing was estimated."""
    from matplotlib.patches import Rectangle

    names = correlation.names
    if len(names) < 2:
        return None
    size = len(names)
    side = max(4.5, 0.9 + 0.5 * size)
    with drawing(side + 0.9, side) as figure:
        room = figure.subplots()
        room.set_axisbelow(False)
        room.grid(visible=False)
        for i in range(size):
            for j in range(size):
                value = float(correlation.matrix[i, j])
                if not math.isfinite(value):
                    continue
                colour, depth = (MUTED, 0.25) if i == j else (BLUE if value > 0 else VERMILLION, 0.75 * abs(value))
                room.add_patch(Rectangle((j, i), 1, 1, facecolor=colour, alpha=depth, linewidth=0))
                if i != j:
                    text = f"{value:.2f}".replace("-", "−").replace("0.", ".")
                    weight = "bold" if abs(value) >= STRONG else "normal"
                    room.text(j + 0.5, i + 0.5, text, ha="center", va="center", fontsize=8.5, fontweight=weight)
        for k in range(size + 1):
            room.axhline(k, color=GRID, linewidth=0.6)
            room.axvline(k, color=GRID, linewidth=0.6)
        ticks = [k + 0.5 for k in range(size)]
        labels = [symbol(name) for name in names]
        room.set_xticks(ticks, labels)
        room.set_yticks(ticks, labels)
        room.tick_params(length=0)
        room.set_xlim(0, size)
        room.set_ylim(size, 0)
        room.set_aspect("equal")
        for spine in room.spines.values():
            spine.set_visible(False)
        room.set_title(f"Axis {axis}: correlation of the parameters")
        caption = (
            "Blue: two parameters err in the same direction, vermillion: in opposite ones. Close to ±1 (bold from "
            f"{STRONG:g}) the data tell a combination of both rather than each; the curve can be sure all "
            "the same. Empty: not known."
        )
        return finish(figure, "correlation", "Correlation matrix", caption)
