"""Pictures of one figure of a study: its distribution with what moves it, and it over each parameter or over a grid."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from feedsim.report import style
from feedsim.report.formatting import number, plain
from feedsim.report.labels import heading, legend_above
from feedsim.report.picture import Picture
from feedsim.report.style import Array, Drawn, drawing, finish, thinned
from feedsim.report.sweep.account import QUANTILES, RANK, TOTAL, Account, Input, Measure, Output
from feedsim.report.sweep.charts import distribution_chart, lines_chart, map_chart, scatter_chart, scatter_panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_BARS = 14
MOST_PANELS = 12
PANELS = 4  # in a row
FEW_BINS, MANY_BINS = 8, 50
VECTORS = 200  # points of a panel up to which they are drawn as vectors; beyond, as an image
LEAST_OF_BIN = 25  # rows behind a point of the running median
MEDIANS = 24  # points of it at most
LINES = (style.BLUE, style.VERMILLION, style.GREEN, style.PURPLE, style.ORANGE, style.SKY)  # over a grid
MOST_WRITTEN = 12  # columns up to which the cells of a map show their numbers
PALE = 0.55  # share of the map's range above which the ground is light
GOLDEN = 0.6180339887498949  # spreads points evenly beside a level


def distribution_picture(
    output: Output, inputs: Sequence[Input], measure: Measure, stem: str, exceedance: bool = True
) -> Picture | None:
    """Histogram with quantiles, and beside it what moves the figure; None without values.

    exceedance: with the share of runs above each value, which on a grid would be no probability.
    """
    if not len(output.known):
        return None
    telling = measure.telling()[:MOST_BARS]
    bars = len(telling)

    def draw() -> Drawn:
        with drawing(10.0 if bars else 6.5, max(3.3, 1.5 + 0.27 * bars)) as figure:
            rooms = figure.subplots(1, 2 if bars else 1, squeeze=False, width_ratios=[1.15, 1][: 2 if bars else 1])[0]
            _histogram(rooms[0], output, exceedance)
            if bars:
                _bars(rooms[1], inputs, measure, telling)
            return finish(figure, f"distribution-{stem}", f"Distribution of {output.name}", caption, worded=True)

    caption = "Left the runs' values with 5 %, 50 % and 95 % quantile" if bars else "The runs' values with "
    caption += "" if bars else "5 %, 50 % and 95 % quantile"
    caption += ", and the share of the runs that lie above a value (vermillion)" if exceedance else ""
    caption += "; " if bars else "."
    if bars:
        caption += _right(measure, len(inputs) - bars)
    chart = distribution_chart(output, _edges(output.known), inputs, measure, telling, exceedance)
    return Picture(f"distribution-{stem}", f"Distribution of {output.name}", caption, draw, chart)


def scatter_picture(output: Output, inputs: Sequence[Input], measure: Measure, stem: str) -> Picture | None:
    """The figure over each parameter, the strongest first, every run a point; None without values."""
    shown = [inputs[k] for k in measure.telling()[:MOST_PANELS] or range(len(inputs))[:MOST_PANELS]]
    shown = [each for each in shown if len(np.unique(each.values)) > 1]
    if not len(output.known) or not shown:
        return None
    missing = len(output.known) < len(output.sample)
    across = min(PANELS, len(shown))
    down = -(-len(shown) // across)

    def draw() -> Drawn:
        with drawing(max(5.0, 2.6 * across), 0.3 + 2.5 * down) as figure:
            rooms = figure.subplots(down, across, squeeze=False, sharey=True).ravel()
            for axes, each in zip(rooms, shown, strict=False):
                _panel(axes, output, each)
            for axes in rooms[len(shown) :]:
                axes.remove()
            for axes in rooms[::across]:
                axes.set_ylabel(plain(output.label))
            return finish(figure, f"scatter-{stem}", f"{output.name} over the parameters", caption, worded=True)

    left_out = len(inputs) - len(shown)
    caption = "A point per run, a cross on the axis one without a value" if missing else "A point per run"
    caption += "; the line is the running median"
    caption += ", the bars the medians of each value" if any(len(each.levels) for each in shown) else ""
    caption += f". {left_out} of {len(inputs)} parameters, which move it less, are not drawn." if left_out else "."
    known = np.isfinite(output.sample)
    panels = [
        scatter_panel(output, each, running_median(each.sample[known], output.sample[known]), _beside(int(known.sum())))
        for each in shown
    ]
    return Picture(f"scatter-{stem}", f"{output.name} over the parameters", caption, draw, scatter_chart(panels))


def _beside(count: int) -> Array:
    """How far points stand beside their level, spread evenly."""
    return np.asarray(0.5 * ((np.arange(count) * GOLDEN) % 1 - 0.5))


def running_median(x: Array, y: Array) -> tuple[Array, Array]:
    """Medians of x and y of parts with equally many points, in the order of x; empty with too few points."""
    parts = min(MEDIANS, len(x) // LEAST_OF_BIN)
    if parts < 2:
        return x[:0], y[:0]
    order = np.argsort(x, kind="stable")
    pieces = np.array_split(order, parts)
    return np.array([np.median(x[rows]) for rows in pieces]), np.array([np.median(y[rows]) for rows in pieces])


def _histogram(axes: Axes, output: Output, exceedance: bool) -> None:
    known = output.known
    edges = _edges(known)
    counts, edges = np.histogram(known, edges)
    axes.bar(edges[:-1], counts, np.diff(edges), align="edge", color=style.SKY, alpha=0.55, linewidth=0)
    axes.set_ylim(0, 1.14 * counts.max())
    axes.set_xlabel(plain(output.label))
    axes.set_ylabel("runs")
    top = axes.get_xaxis_transform()
    statistics = output.statistics
    for share in QUANTILES:
        value = statistics[f"q{share}"]
        colour, dash = (style.INK, "-") if share == 50 else (style.MUTED, "--")
        axes.axvline(value, color=colour, linewidth=1.1, linestyle=dash)
    ends = {5: ("right", -3), 50: ("center", 0), 95: ("left", 3)}
    if np.ptp(known) > 0:
        for share, (side, shift) in ends.items():
            axes.annotate(
                f"{share} %", (statistics[f"q{share}"], 1.0), xycoords=top, xytext=(shift, 2),
                textcoords="offset points", ha=side, va="bottom", fontsize=8, color=style.MUTED, annotation_clip=False,
            ).set_in_layout(False)  # fmt: skip
    text = (
        f"mean {number(statistics['mean'], 3)}, std {number(statistics['std'], 3)} {output.scale.shown_unit}".rstrip()
    )
    heading(axes, text)
    if exceedance and np.ptp(known) > 0:
        _exceedance(axes, known)


def _exceedance(axes: Axes, known: Array) -> None:
    """Share of the runs whose figure is larger than a limit, over the limit: the empirical distribution turned over."""
    limits = np.sort(known)
    share = 100 * (1 - np.arange(1, len(limits) + 1) / len(limits))
    limits, share = thinned(np.concatenate([limits[:1], limits]), np.concatenate([[100.0], share]))
    beside = axes.twinx()
    beside.plot(limits, share, color=style.VERMILLION, linewidth=1.3, drawstyle="steps-post")
    beside.set_ylim(0, 114)  # the histogram leaves as much above its highest bar
    beside.set_yticks(range(0, 101, 25))
    beside.set_ylabel("runs above [%]", color=style.VERMILLION)
    beside.grid(visible=False)


def _edges(known: Array) -> Array:
    if np.ptp(known) <= 1e-9 * np.abs(known).max():
        centre = float(known[0])
        half = 0.5 * abs(centre) * 0.01 or 0.5
        return np.array([centre - half, centre + half])
    many = int(np.clip(len(np.histogram_bin_edges(known, "auto")) - 1, FEW_BINS, MANY_BINS))
    return np.linspace(known.min(), known.max(), many + 1)


def _bars(axes: Axes, inputs: Sequence[Input], measure: Measure, ranked: Sequence[int]) -> None:
    rows = np.arange(len(ranked))
    axes.set_yticks(rows, [plain(inputs[k].name) for k in ranked])
    axes.set_ylim(len(ranked) - 0.4, -0.6)
    axes.grid(axis="y", visible=False)
    axes.tick_params(axis="y", length=0)
    values = measure.values[ranked]
    if measure.kind == TOTAL:
        assert measure.first is not None
        assert measure.first_interval is not None
        assert measure.interval is not None
        _with_intervals(
            axes, rows - 0.19, measure.first[ranked], measure.first_interval[ranked], style.BLUE, "first order"
        )
        _with_intervals(axes, rows + 0.19, values, measure.interval[ranked], style.ORANGE, "total")
        legend_above(axes)
        axes.set_xlabel("Sobol index, 95 % interval")
        ends = np.concatenate([measure.interval[ranked], measure.first_interval[ranked]])
        low, high = (float(pick([*ends.ravel(), *measure.first[ranked]])) for pick in (np.nanmin, np.nanmax))
        axes.set_xlim(min(0.0, 1.05 * low), max(1.0, 1.03 * high))
    else:
        if measure.kind == RANK:
            axes.axvspan(-measure.noise, measure.noise, color=style.GRID, alpha=0.7, linewidth=0, label="chance")
            axes.set_xlim(-1, 1)
            legend_above(axes)
        else:
            axes.set_xlim(0, 1)
        colours = [style.BLUE if value >= 0 else style.VERMILLION for value in values]
        axes.barh(rows, np.nan_to_num(values), 0.6, color=colours, linewidth=0)
        axes.set_xlabel(measure.kind)
        for row, value in zip(rows, values, strict=True):
            if not np.isfinite(value):
                axes.annotate("not ranked", (0, row), xytext=(4, 0), textcoords="offset points", va="center",
                              fontsize=8, color=style.MUTED)  # fmt: skip
    axes.axvline(0, color=style.MUTED, linewidth=0.8)
    heading(axes, "what moves it")


def _with_intervals(axes: Axes, rows: Any, values: Array, interval: Array, colour: str, label: str) -> None:
    axes.barh(rows, values, 0.36, color=colour, linewidth=0, label=label, alpha=0.85)
    axes.hlines(rows, interval[:, 0], interval[:, 1], color=style.INK, linewidth=1.0)


def _right(measure: Measure, left_out: int) -> str:
    text = {
        TOTAL: "right the share of its scatter that each parameter makes alone (first order) and with all its joint "
        "effects (total), with 95 % intervals. Where both are alike, the parameter acts on its own.",
        RANK: "right Spearman's rank correlation with each parameter; within the grey band it can be chance.",
    }.get(measure.kind, "right the share of its scatter that lies between the values of each parameter.")
    return text + (f" {left_out} more parameters, which move it less, are not drawn." if left_out else "")


def _panel(axes: Axes, output: Output, each: Input) -> None:
    known = np.isfinite(output.sample)
    x, y = each.sample[known], output.sample[known]
    without = each.sample[~known]  # failed, or not determined
    if len(each.levels):
        without = np.searchsorted(each.levels, without) + _beside(len(without))
    axes.plot(
        without, np.full(len(without), 0.02), "x", markersize=4, markeredgewidth=0.9, color=style.VERMILLION,
        transform=axes.get_xaxis_transform(), rasterized=len(without) > VECTORS,
    )  # fmt: skip
    many = len(x) > VECTORS
    size, alpha = (5.0, 0.6) if len(x) <= 200 else (3.0, 0.4) if len(x) <= 2000 else (1.5, 0.2)
    look: dict[str, Any] = {"s": size, "alpha": alpha, "color": style.BLUE, "linewidths": 0, "rasterized": many}
    if len(each.levels):
        at = np.searchsorted(each.levels, x)
        beside = _beside(len(x))
        axes.scatter(at + beside, y, **look)
        for k in range(len(each.levels)):
            if np.any(at == k):
                axes.hlines(np.median(y[at == k]), k - 0.32, k + 0.32, color=style.VERMILLION, linewidth=1.8)
        axes.set_xticks(range(len(each.levels)), [plain(each.text(value)) for value in each.levels])
        if len(each.levels) > 5 or sum(len(each.text(value)) for value in each.levels) > 18:
            axes.tick_params(axis="x", labelrotation=45)
        axes.set_xlim(-0.6, len(each.levels) - 0.4)
    else:
        axes.scatter(x, y, **look)
        axes.plot(*running_median(x, y), color=style.VERMILLION, linewidth=1.6)
        if each.logarithmic:
            _logarithmic(axes)
    axes.set_xlabel(plain(each.label))


def of_account(account: Account, output: Output, measure: Measure, stem: str) -> list[Picture]:
    """Both pictures, as far as there is something to show."""
    random = account.study.sampling.method != "grid"
    found = (
        distribution_picture(output, account.inputs, measure, stem, random),
        scatter_picture(output, account.inputs, measure, stem),
    )
    return [picture for picture in found if picture is not None]


def grid_picture(account: Account, output: Output, stem: str) -> Picture | None:
    """The figure over a grid of one or two parameters; None for other designs."""
    inputs = [each for each in account.inputs if len(np.unique(each.values)) > 1]
    if account.study.sampling.method != "grid" or not 1 <= len(inputs) <= 2 or not len(output.known):
        return None
    title = f"{output.name} over {' and '.join(each.name for each in inputs)}"
    if len(inputs) == 1:

        def draw() -> Drawn:
            with drawing(6.5, 3.6) as figure:
                axes = figure.subplots()
                _line(axes, inputs[0], output.values, inputs[0].values, style.BLUE, None)
                _finish_line(axes, inputs[0], output)
                return finish(figure, f"grid-{stem}", title, "A point per run.", worded=True)

        chart = lines_chart(output, inputs[0], [("", inputs[0].values, output.values, style.BLUE)])
        return Picture(f"grid-{stem}", title, "A point per run.", draw, chart)
    first, second = inputs
    few = [each for each in inputs if each.words and len(np.unique(each.values)) <= len(LINES)]
    if few:  # words have no order that a map could show: a line each
        lines = few[-1]
        along = second if lines is first else first

        def draw() -> Drawn:
            with drawing(7.5, 3.8) as figure:
                axes = figure.subplots()
                for colour, level in zip(LINES, np.unique(lines.values), strict=False):
                    rows = lines.values == level
                    _line(axes, along, output.values[rows], along.values[rows], colour, plain(lines.text(level)))
                legend_above(axes)
                _finish_line(axes, along, output)
                return finish(figure, f"grid-{stem}", title, f"A line for each {lines.name}.", worded=True)

        own = [
            (lines.text(level), along.values[lines.values == level], output.values[lines.values == level], colour)
            for colour, level in zip(LINES, np.unique(lines.values), strict=False)
        ]
        chart = lines_chart(output, along, own)
        return Picture(f"grid-{stem}", title, f"A line for each {lines.name}.", draw, chart)

    def draw_map() -> Drawn:
        with drawing(7.5, 4.6) as figure:
            _map(figure, figure.subplots(), first, second, output)
            return finish(
                figure,
                f"grid-{stem}",
                title,
                "Empty: the run failed, or the figure could not be determined.",
                worded=True,
            )

    empty = "Empty: the run failed, or the figure could not be determined."
    return Picture(f"grid-{stem}", title, empty, draw_map, map_chart(output, first, second))


def _line(axes: Axes, along: Input, values: Array, x: Array, colour: str, label: str | None) -> None:
    order = np.argsort(x, kind="stable")
    axes.plot(x[order], values[order], color=colour, marker="o", markersize=4, label=label)


def _finish_line(axes: Axes, along: Input, output: Output) -> None:
    axes.set_xlabel(plain(along.label))
    axes.set_ylabel(plain(output.label))
    if along.words:
        axes.set_xticks(range(len(along.words)), [plain(word) for word in along.words])
    elif along.logarithmic:
        _logarithmic(axes)


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


def _logarithmic(axes: Axes) -> None:
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.xaxis.set_minor_formatter(lambda value, _: f"{value:g}" if f"{value:e}"[0] in "25" else "")
