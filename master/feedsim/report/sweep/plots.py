"""All pictures of a study in the order of the page, and the first of them: which parameter moves which figure."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from feedsim.report.formatting import plain
from feedsim.report.picture import Picture
from feedsim.report.run.report import HEADER, is_leading
from feedsim.report.style import BLUE, GRID, VERMILLION, Drawn, drawing, finish
from feedsim.report.sweep.account import NOTHING, Account, Measure, Output, measures
from feedsim.report.sweep.charts import matrix_chart
from feedsim.report.sweep.figure_plots import grid_picture, of_account
from feedsim.sweep.sensitivity import is_constant

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_FIGURES = 8  # drawn one by one; the tables hold all
MOST_ROWS, MOST_COLUMNS = 30, 20  # of the overview
DEPTH = 0.8  # of the colour of a 1


def varying(account: Account) -> list[Output]:
    """Figures that are not the same in all runs."""
    return [each for each in account.outputs if len(each.known) and not is_constant(each.known)]


def drawn(account: Account) -> list[Output]:
    """Figures that are drawn one by one: those that differ from run to run, the leading ones first."""
    known = varying(account)
    leading = [each for each in known if is_leading(each.name, HEADER)]
    return [*leading, *(each for each in known if each not in leading)][:MOST_FIGURES]


def pictures_of(account: Account) -> tuple[list[Picture], list[Picture]]:
    """Pictures of the whole study, and those of single figures."""
    overview = overview_picture(account)
    found = measures(account)
    single: list[Picture] = []
    taken: set[str] = set()
    for output in drawn(account):
        stem = _stem(output.name, taken)
        over_grid = grid_picture(account, output, stem)
        single += [over_grid] if over_grid is not None else of_account(account, output, found[output.name], stem)
    return [overview] if overview is not None else [], single


def _stem(name: str, taken: set[str]) -> str:
    """A figure's name as part of a file name, different from those taken."""
    stem = re.sub(r"[^A-Za-z0-9_-]+", "-", name.replace("+", "-plus")).strip("-") or "figure"
    number = 2
    unique = stem
    while unique in taken:
        unique, number = f"{stem}-{number}", number + 1
    taken.add(unique)
    return unique


def overview_picture(account: Account) -> Picture | None:
    """The matrix in colours and numbers; None where there is nothing to compare."""
    found = [each for each in measures(account).values() if each.known]
    found = [each for each in found if each.kind == found[0].kind][:MOST_ROWS]
    if not found or len(account.inputs) < 2:
        return None
    ranks = sorted(range(len(account.inputs)), key=lambda k: -max(each.size(k) for each in found))
    columns = sorted(ranks[:MOST_COLUMNS])
    width = max(6.0, 2.2 + 0.62 * len(columns))

    def draw() -> Drawn:
        with drawing(width, max(2.4, 1.5 + 0.32 * len(found))) as figure:
            _matrix(figure.subplots(), account, found, columns)
            return finish(
                figure, "sensitivities", "Which parameter moves which figure", found[0].caption + more, worded=True
            )

    left_out = len(account.inputs) - len(columns)
    more = f" {left_out} parameters that move no figure more are left out." if left_out else ""
    chart = matrix_chart([each.name for each in account.inputs], found, columns)
    return Picture("sensitivities", "Which parameter moves which figure", found[0].caption + more, draw, chart)


def _matrix(axes: Axes, account: Account, found: Sequence[Measure], columns: Sequence[int]) -> None:
    from matplotlib.patches import Rectangle

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
