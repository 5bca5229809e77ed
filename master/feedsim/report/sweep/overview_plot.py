"""One picture of all figures against all parameters: which moves which."""

from __future__ import annotations

import math
from collections.abc import Sequence

from feedsim.report.formatting import plain
from feedsim.report.style import BLUE, GRID, VERMILLION, Picture, drawing, finish
from feedsim.report.sweep.account import Account
from feedsim.report.sweep.measures import NOTHING, Measure, measures

MOST_ROWS, MOST_COLUMNS = 30, 20
DEPTH = 0.8  # of the colour of a 1


def overview_picture(account: Account) -> Picture | None:
    """The matrix in colours and numbers; None where there is nothing to compare."""
    found = [each for each in measures(account).values() if each.known]
    found = [each for each in found if each.kind == found[0].kind][:MOST_ROWS]
    if not found or len(account.inputs) < 2:
        return None
    ranks = sorted(range(len(account.inputs)), key=lambda k: -max(each.size(k) for each in found))
    columns = sorted(ranks[:MOST_COLUMNS])
    width = max(6.0, 2.2 + 0.62 * len(columns))
    with drawing(width, max(2.4, 1.5 + 0.32 * len(found))) as figure:
        _matrix(figure.subplots(), account, found, columns)
        left_out = len(account.inputs) - len(columns)
        more = f" {left_out} parameters that move no figure more are left out." if left_out else ""
        return finish(
            figure, "sensitivities", "Which parameter moves which figure", found[0].caption + more, worded=True
        )


def _matrix(axes: object, account: Account, found: Sequence[Measure], columns: Sequence[int]) -> None:
    from matplotlib.axes import Axes
    from matplotlib.patches import Rectangle

    assert isinstance(axes, Axes)
    axes.set_axisbelow(False)
    axes.grid(visible=False)
    for i, measure in enumerate(found):
        for j, column in enumerate(columns):
            value = float(measure.values[column])
            if not math.isfinite(value):
                continue
            depth = DEPTH * min(abs(value), 1.0)
            colour = BLUE if value > 0 else VERMILLION
            axes.add_patch(Rectangle((j, i), 1, 1, facecolor=colour, alpha=depth, linewidth=0))
            if abs(value) >= NOTHING:
                text = f"{value:.2f}".replace("-", "−")
                weight = "bold" if measure.told(column) else "normal"
                axes.text(j + 0.5, i + 0.5, text, ha="center", va="center", fontsize=8, fontweight=weight)
    for k in range(len(columns) + 1):
        axes.axvline(k, color=GRID, linewidth=0.6)
    for k in range(len(found) + 1):
        axes.axhline(k, color=GRID, linewidth=0.6)
    names = [plain(account.inputs[k].name) for k in columns]
    turned = max(map(len, names)) > 6
    axes.set_xticks(
        [k + 0.5 for k in range(len(columns))], names,
        rotation=40 if turned else 0, ha="left" if turned else "center", rotation_mode="anchor",
    )  # fmt: skip
    axes.xaxis.tick_top()
    axes.set_yticks([k + 0.5 for k in range(len(found))], [plain(each.figure) for each in found])
    axes.tick_params(length=0)
    axes.set_xlim(0, len(columns))
    axes.set_ylim(len(found), 0)
    for spine in axes.spines.values():
        spine.set_visible(False)
