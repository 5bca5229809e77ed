"""Pictures of one figure of a study: its distribution with what moves it, and it over each parameter or over a grid."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from feedsim.report.chart import Axis, Band, Chart, Curve, Grid, Level, Mark, Panel
from feedsim.report.content import Picture
from feedsim.report.formatting import BLUE, GREEN, INK, MUTED, ORANGE, PURPLE, SKY, VERMILLION, Array
from feedsim.report.sweep.account import QUANTILES, RANK, TOTAL, Account, Input, Measure, Output

MOST_BARS = 14
MOST_POINTS = 3000  # of a panel
GOLDEN = 0.6180339887498949  # spreads points evenly beside a level
MOST_PANELS = 12
PANELS = 3  # in a row
FEW_BINS, MANY_BINS = 8, 50
MOST_FEET = 200  # strokes of runs without a value
LEAST_OF_BIN = 25  # rows behind a point of the running median
MEDIANS = 24  # points of it at most
LINES = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY)  # over a grid


def of_account(account: Account, output: Output, measure: Measure, stem: str) -> list[Picture]:
    """Both pictures, as far as there is something to show."""
    random = account.study.sampling.method != "grid"
    result = (
        distribution_picture(output, account.inputs, measure, stem, random),
        scatter_picture(output, account.inputs, measure, stem, _best_row(account, output)),
    )
    return [picture for picture in result if picture is not None]


def distribution_picture(
    output: Output, inputs: Sequence[Input], measure: Measure, stem: str, exceedance: bool = True
) -> Picture | None:
    """Histogram with quantiles, and beside it what moves the figure; None without values.

    exceedance: with the share of runs above each value, which on a grid would be no probability.
    """
    if not len(output.known):
        return None
    telling = measure.notable_parameters()[:MOST_BARS]
    bars = len(telling)
    caption = "The runs' values with 5 %, 50 % and 95 % quantile"
    caption += ", and the share of the runs that lie above a value." if exceedance else "."
    if bars:
        caption += f" What moves it: {_measure_caption(measure, len(inputs) - bars)}"
    chart = _distribution(output, inputs, measure, telling, exceedance)
    return Picture(f"distribution-{stem}", f"Distribution of {output.name}", caption, chart, worded=True)


def _distribution(
    output: Output, inputs: Sequence[Input], measure: Measure, ranked: Sequence[int], exceedance: bool
) -> Chart:
    """Histogram with quantiles, the share of runs above each value, and what moves the figure."""
    known = output.known
    edges = _edges(known)
    counts, _ = np.histogram(known, edges)
    steps = Curve("runs", np.repeat(edges, 2), np.concatenate([[0], np.repeat(counts, 2), [0]]).astype(float), SKY,
                  filled=True)  # fmt: skip
    statistics = output.statistics
    quantiles = [
        Level(statistics[f"q{share}"], f"{share} %", upright=True, colour=INK if share == 50 else MUTED,
              dash="" if share == 50 else "dashed")
        for share in QUANTILES
    ]  # fmt: skip
    figure = Axis(output.name, output.scale.shown_unit)
    panels = [Panel("Distribution over the runs", figure, Axis("runs"), [steps], quantiles, linked="figure")]
    if exceedance and np.ptp(known) > 0:
        limits = np.sort(known)
        share = 100 * (1 - np.arange(1, len(limits) + 1) / len(limits))
        above = Curve("runs above a value", np.repeat(limits, 2), np.concatenate([[100.0], np.repeat(share, 2)[:-1]]),
                      VERMILLION)  # fmt: skip
        panels.append(Panel("Runs above a value", figure, Axis("runs above", "%", span=(0.0, 104.0)), [above],
                            linked="figure"))  # fmt: skip
    if len(ranked):
        panels.append(_bars(inputs, measure, ranked))
    return Chart(panels, (1.0,) * len(panels))


def _edges(known: Array) -> Array:
    if np.ptp(known) <= 1e-9 * np.abs(known).max():
        centre = float(known[0])
        half = 0.5 * abs(centre) * 0.01 or 0.5
        return np.array([centre - half, centre + half])
    many = int(np.clip(len(np.histogram_bin_edges(known, "auto")) - 1, FEW_BINS, MANY_BINS))
    return np.linspace(known.min(), known.max(), many + 1)


def _bars(inputs: Sequence[Input], measure: Measure, ranked: Sequence[int]) -> Panel:
    """Bars of the parameters, the strongest at the top."""
    rows = np.arange(len(ranked))[::-1].astype(float)
    names = Axis("", names=[inputs[k].name for k in reversed(ranked)], span=(-0.6, len(ranked) - 0.4))
    values = measure.values[ranked]
    if measure.kind == TOTAL:
        assert measure.first is not None
        assert measure.first_interval is not None
        assert measure.interval is not None
        curves = [
            *_bar("first order", rows + 0.19, measure.first[ranked], measure.first_interval[ranked], BLUE),
            *_bar("total", rows - 0.19, values, measure.interval[ranked], ORANGE),
        ]
        return Panel(
            "What moves it", Axis("Sobol index, 95 % interval"), names, curves, [Level(0.0, upright=True, dash="")]
        )
    curves = [
        *_bar("positive" if measure.kind == RANK else "", rows[values >= 0], values[values >= 0], None, BLUE),
        *_bar("negative", rows[values < 0], values[values < 0], None, VERMILLION),
    ]
    chance = [Band("chance", -0.6, len(ranked) - 0.4, np.array([-measure.noise, measure.noise]), MUTED)]
    span = (-1.0, 1.0) if measure.kind == RANK else (0.0, 1.0)
    return Panel("What moves it", Axis(measure.kind, span=span), names, curves, [Level(0.0, upright=True, dash="")],
                 chance if measure.kind == RANK else [])  # fmt: skip


def _bar(name: str, rows: Array, values: Array, interval: Array | None, colour: str) -> list[Curve]:
    """Thick lines from zero, and thin ones over the intervals."""
    if not len(rows):
        return []
    values, gaps = np.nan_to_num(values), np.full(len(rows), np.nan)
    along = np.column_stack([rows, rows, gaps]).ravel()
    curves = [Curve(name, np.column_stack([0 * values, values, gaps]).ravel(), along, colour, width=8.0)]
    if interval is not None:
        ends = np.column_stack([interval, gaps]).ravel()
        curves.append(Curve("", ends, along, INK, width=1.2))
    return curves


def _measure_caption(measure: Measure, left_out: int) -> str:
    text = {
        TOTAL: "the share of its scatter that each parameter makes alone (first order) and with all its joint "
        "effects (total), with 95 % intervals. Where both are alike, the parameter acts on its own.",
        RANK: "Spearman's rank correlation with each parameter; within the grey band it can be chance.",
    }.get(measure.kind, "the share of its scatter that lies between the values of each parameter.")
    return text + (f" {left_out} more parameters, which move it less, are not drawn." if left_out else "")


def _best_row(account: Account, output: Output) -> int | None:
    """The run that the study's goal asks for, where it is about this figure."""
    return account.best[1] if account.best is not None and account.best[0] is output else None


def scatter_picture(
    output: Output, inputs: Sequence[Input], measure: Measure, stem: str, best: int | None = None
) -> Picture | None:
    """The figure over each parameter, the strongest first, every run a point; None without values.

    best: the row that is looked for, which is marked.
    """
    shown = [inputs[k] for k in measure.notable_parameters()[:MOST_PANELS] or range(len(inputs))[:MOST_PANELS]]
    shown = [entry for entry in shown if len(np.unique(entry.values)) > 1]
    if not len(output.known) or not shown:
        return None
    missing = len(output.known) < len(output.sample)
    left_out = len(inputs) - len(shown)
    caption = "A point per run"
    caption += f", {MOST_POINTS} of {len(output.known)}" if len(output.known) > MOST_POINTS else ""
    caption += ", a stroke at the foot one without a value" if missing else ""
    caption += "; the line is the running median"
    caption += ", the marks the medians of each value" if any(len(entry.levels) for entry in shown) else ""
    caption += f". {left_out} of {len(inputs)} parameters, which move it less, are not drawn." if left_out else "."
    caption += " The ring is the run that is looked for." if best is not None else ""
    chart = Chart([_panel(output, entry, best) for entry in shown], (1.0,) * min(PANELS, len(shown)))
    return Picture(f"scatter-{stem}", f"{output.name} over the parameters", caption, chart, worded=True)


def _panel(output: Output, entry: Input, best: int | None = None) -> Panel:
    """A figure over a parameter, a point per run, and at the foot a stroke per run without a value."""
    known = np.isfinite(output.sample)
    x, y = entry.sample[known].astype(float), output.sample[known]
    without = entry.sample[~known].astype(float)  # failed, or not determined
    curves, marks = [], []
    if len(entry.levels):
        at = np.searchsorted(entry.levels, x)
        curves.append(Curve("a run", at + _spread_offsets(len(at)), y, BLUE, width=1.4, dots=True, most=MOST_POINTS))
        marks = [
            Mark(float(k), float(np.median(y[at == k])), "", VERMILLION)
            for k in range(len(entry.levels))
            if np.any(at == k)
        ]
        without = np.searchsorted(entry.levels, without) + _spread_offsets(len(without))
        axis = Axis(
            entry.name,
            entry.scale.shown_unit,
            names=[entry.text(value) for value in entry.levels],
            span=(-0.6, len(entry.levels) - 0.4),
        )
    else:
        curves.append(Curve("a run", x, y, BLUE, width=1.4, dots=True, most=MOST_POINTS))
        median = running_median(x, y)
        if len(median[0]):
            curves.append(Curve("running median", *median, VERMILLION, width=1.8))
        axis = Axis(entry.name, entry.scale.shown_unit, log=entry.logarithmic)
    if best is not None:
        value = float(entry.values[best])
        place = float(np.searchsorted(entry.levels, value)) if len(entry.levels) else value
        marks.append(Mark(place, float(output.values[best]), "", INK, hollow=True))
    low, reach = float(y.min()), float(np.ptp(y)) or 0.1 * abs(float(y.min())) or 1.0
    feet = (low - 0.07 * reach, low - 0.02 * reach)
    levels = [Level(at, upright=True, colour=VERMILLION, dash="", ends=feet) for at in without[:MOST_FEET].tolist()]
    return Panel(entry.name, axis, Axis(output.name, output.scale.shown_unit), curves, levels, marks=marks, height=1.1,
                 note=f"{int((~known).sum())} without a value" if not known.all() else "")  # fmt: skip


def _spread_offsets(count: int) -> Array:
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


def grid_picture(account: Account, output: Output, stem: str) -> Picture | None:
    """The figure over a grid of one or two parameters; None for other designs."""
    inputs = [entry for entry in account.inputs if len(np.unique(entry.values)) > 1]
    if account.study.sampling.method != "grid" or not 1 <= len(inputs) <= 2 or not len(output.known):
        return None
    title = f"{output.name} over {' and '.join(entry.name for entry in inputs)}"
    if len(inputs) == 1:
        chart = _lines(output, inputs[0], [("", inputs[0].values, output.values, BLUE)])
        return Picture(f"grid-{stem}", title, "A point per run.", chart, worded=True)
    first, second = inputs
    few = [entry for entry in inputs if entry.words and len(np.unique(entry.values)) <= len(LINES)]
    if few:  # words have no order that a map could show: a line each
        lines = few[-1]
        along = second if lines is first else first
        own = [
            (lines.text(level), along.values[lines.values == level], output.values[lines.values == level], colour)
            for colour, level in zip(LINES, np.unique(lines.values), strict=False)
        ]
        chart = _lines(output, along, own)
        return Picture(f"grid-{stem}", title, f"A line for each {lines.name}.", chart, worded=True)
    cells = "A cell per run, its colour the deeper the larger the figure."
    empty = "" if np.isfinite(output.values).all() else " Empty: the run failed, or the figure could not be determined."
    best = _best_row(account, output)
    cells += " The frame is the run that is looked for." if best is not None else ""
    return Picture(f"grid-{stem}", title, cells + empty, _map(output, first, second, best), worded=True)


def _lines(output: Output, along: Input, lines: Sequence[tuple[str, Array, Array, str]]) -> Chart:
    """A figure over one parameter: lines of name, abscissae, values and colour."""
    names = list(along.words) if along.words else []
    axis = Axis(along.name, along.scale.shown_unit, log=along.logarithmic, names=names)
    curves = []
    for name, x, y, colour in lines:
        order = np.argsort(x, kind="stable")
        curves += [Curve(name, x[order].astype(float), y[order], colour),
                   Curve(name, x[order].astype(float), y[order], colour, width=2.4, dots=True)]  # fmt: skip
    return Chart([Panel("", axis, Axis(output.name, output.scale.shown_unit), curves, height=1.3)])


def _map(output: Output, first: Input, second: Input, best: int | None = None) -> Chart:
    """A figure over a grid of two parameters. best: the row that is looked for."""
    across, i = np.unique(first.values, return_inverse=True)
    up, j = np.unique(second.values, return_inverse=True)
    cells = np.full((len(up), len(across)), np.nan)
    cells[j, i] = output.values
    low, high = float(np.nanmin(cells)), float(np.nanmax(cells))
    title = f"{output.label} over {first.label} and, upwards, {second.label}"
    framed = None if best is None else (len(up) - 1 - int(j[best]), int(i[best]))
    return Chart([Grid(title, [first.text(value) for value in across], [second.text(value) for value in up[::-1]],
                       cells[::-1], (low, high), best=framed)])  # fmt: skip
