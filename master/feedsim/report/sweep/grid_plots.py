"""Pictures of a figure over a grid of one or two parameters: a line, lines, or a map."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from feedsim.report.formatting import number, plain
from feedsim.report.labels import legend_above
from feedsim.report.style import (
    BLUE,
    GREEN,
    ORANGE,
    PURPLE,
    SKY,
    VERMILLION,
    Array,
    Picture,
    drawing,
    finish,
)
from feedsim.report.sweep.account import Account, Input, Output

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LINES = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY)
MOST_WRITTEN = 12  # columns up to which the cells of a map show their numbers
PALE = 0.55  # share of the map's range above which the ground is light


def grid_picture(account: Account, output: Output, stem: str) -> Picture | None:
    """The figure over a grid of one or two parameters; None for other designs."""
    inputs = [each for each in account.inputs if len(np.unique(each.values)) > 1]
    if account.study.sampling.method != "grid" or not 1 <= len(inputs) <= 2 or not len(output.known):
        return None
    title = f"{output.name} over {' and '.join(each.name for each in inputs)}"
    if len(inputs) == 1:
        with drawing(6.5, 3.6) as figure:
            axes = figure.subplots()
            _line(axes, inputs[0], output.values, inputs[0].values, BLUE, None)
            _finish_line(axes, inputs[0], output)
            return finish(figure, f"grid-{stem}", title, "A point per run.", worded=True)
    first, second = inputs
    few = [each for each in inputs if each.words and len(np.unique(each.values)) <= len(LINES)]
    if few:  # words have no order that a map could show: a line each
        lines = few[-1]
        along = second if lines is first else first
        with drawing(7.5, 3.8) as figure:
            axes = figure.subplots()
            for colour, level in zip(LINES, np.unique(lines.values), strict=False):
                rows = lines.values == level
                _line(axes, along, output.values[rows], along.values[rows], colour, plain(lines.text(level)))
            legend_above(axes)
            _finish_line(axes, along, output)
            return finish(figure, f"grid-{stem}", title, f"A line for each {lines.name}.", worded=True)
    with drawing(7.5, 4.6) as figure:
        _map(figure, figure.subplots(), first, second, output)
        return finish(
            figure, f"grid-{stem}", title, "Empty: the run failed, or the figure could not be determined.", worded=True
        )


def _line(axes: Axes, along: Input, values: Array, x: Array, colour: str, label: str | None) -> None:
    order = np.argsort(x, kind="stable")
    axes.plot(x[order], values[order], color=colour, marker="o", markersize=4, label=label)


def _finish_line(axes: Axes, along: Input, output: Output) -> None:
    axes.set_xlabel(plain(along.label))
    axes.set_ylabel(plain(output.label))
    if along.words:
        axes.set_xticks(range(len(along.words)), [plain(word) for word in along.words])
    elif along.logarithmic:
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axes.xaxis.set_minor_formatter(lambda value, _: f"{value:g}" if f"{value:e}"[0] in "25" else "")


def _map(figure: Any, axes: Axes, first: Input, second: Input, output: Output) -> None:
    across, i = np.unique(first.values, return_inverse=True)
    up, j = np.unique(second.values, return_inverse=True)
    cells = np.full((len(up), len(across)), np.nan)
    cells[j, i] = output.values
    axes.grid(visible=False)
    # Cells of one size, whatever the distance of the values: the ticks say which they are.
    image = axes.pcolormesh(np.ma.masked_invalid(cells), cmap="cividis", rasterized=cells.size > 400)
    axes.set_facecolor("none")
    bar = figure.colorbar(image, ax=axes, label=plain(output.label), pad=0.02)
    bar.outline.set_visible(False)
    for axis, each, levels in ((axes.xaxis, first, across), (axes.yaxis, second, up)):
        step = -(-len(levels) // MOST_WRITTEN)
        axis.set_ticks(np.arange(0, len(levels), step) + 0.5, [plain(each.text(value)) for value in levels[::step]])
        axis.set_label_text(plain(each.label))
    if max(cells.shape) <= MOST_WRITTEN:
        low, high = np.nanmin(cells), np.nanmax(cells)
        for row, column in np.ndindex(*cells.shape):
            value = cells[row, column]
            if np.isfinite(value):
                light = high > low and (value - low) / (high - low) > PALE
                axes.text(
                    column + 0.5, row + 0.5, number(float(value), 3), ha="center", va="center", fontsize=8,
                    color="#000000" if light else "#ffffff",  # the ground is the same on dark pages
                )  # fmt: skip
