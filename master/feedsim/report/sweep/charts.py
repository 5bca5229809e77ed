"""The charts of a study as data: distributions, sensitivities, figures over parameters, maps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from feedsim.report.chart import Axis, Band, Chart, Curve, Grid, Level, Mark, Panel
from feedsim.report.style import BLUE, GRID, INK, MUTED, ORANGE, SKY, VERMILLION, Array
from feedsim.report.sweep.account import QUANTILES, RANK, TOTAL, Input, Measure, Output

NAMED = 0.36  # of a row: half the height of a bar


def distribution_chart(
    output: Output, edges: Array, inputs: Sequence[Input], measure: Measure, ranked: Sequence[int], exceedance: bool
) -> Chart:
    """Histogram with quantiles, the share of runs above each value, and what moves the figure."""
    known = output.known
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
    chance = [Band("chance", -0.6, len(ranked) - 0.4, np.array([-measure.noise, measure.noise]), GRID)]
    span = (-1.0, 1.0) if measure.kind == RANK else (0.0, 1.0)
    return Panel("What moves it", Axis(measure.kind, span=span), names, curves, [Level(0.0, upright=True, dash="")],
                 chance if measure.kind == RANK else [])  # fmt: skip


def _bar(name: str, rows: Array, values: Array, interval: Array | None, colour: str) -> list[Curve]:
    """Thick lines from zero, and thin ones over the intervals."""
    if not len(rows):
        return []
    values, gaps = np.nan_to_num(values), np.full(len(rows), np.nan)
    along = np.column_stack([rows, rows, gaps]).ravel()
    found = [Curve(name, np.column_stack([0 * values, values, gaps]).ravel(), along, colour, width=8.0)]
    if interval is not None:
        ends = np.column_stack([interval, gaps]).ravel()
        found.append(Curve("", ends, along, INK, width=1.2))
    return found


def scatter_chart(panels: Sequence[Panel]) -> Chart:
    """Panels of :func:`scatter_panel` side by side."""
    return Chart(panels, (1.0,) * min(3, len(panels)))


def scatter_panel(output: Output, each: Input, median: tuple[Array, Array], beside: Array) -> Panel:
    """A figure over a parameter, a point per run. beside: (runs,) how far points stand beside their level."""
    known = np.isfinite(output.sample)
    x, y = each.sample[known].astype(float), output.sample[known]
    curves, marks = [], []
    if len(each.levels):
        at = np.searchsorted(each.levels, x)
        curves.append(Curve("a run", at + beside[: len(at)], y, BLUE, width=1.4, dots=True, most=3000))
        marks = [
            Mark(float(k), float(np.median(y[at == k])), "", VERMILLION)
            for k in range(len(each.levels))
            if np.any(at == k)
        ]
        axis = Axis(
            each.name,
            each.scale.shown_unit,
            names=[each.text(value) for value in each.levels],
            span=(-0.6, len(each.levels) - 0.4),
        )
    else:
        curves.append(Curve("a run", x, y, BLUE, width=1.4, dots=True, most=3000))
        if len(median[0]):
            curves.append(Curve("running median", *median, VERMILLION, width=1.8))
        axis = Axis(each.name, each.scale.shown_unit, log=each.logarithmic)
    return Panel(each.name, axis, Axis(output.name, output.scale.shown_unit), curves, marks=marks, height=1.1,
                 note=f"{int((~known).sum())} without a value" if not known.all() else "")  # fmt: skip


def lines_chart(output: Output, along: Input, lines: Sequence[tuple[str, Array, Array, str]]) -> Chart:
    """A figure over one parameter: lines of name, abscissae, values and colour."""
    names = list(along.words) if along.words else []
    axis = Axis(along.name, along.scale.shown_unit, log=along.logarithmic, names=names)
    curves = []
    for name, x, y, colour in lines:
        order = np.argsort(x, kind="stable")
        curves += [Curve(name, x[order].astype(float), y[order], colour),
                   Curve(name, x[order].astype(float), y[order], colour, width=2.4, dots=True)]  # fmt: skip
    return Chart([Panel("", axis, Axis(output.name, output.scale.shown_unit), curves, height=1.3)])


def map_chart(output: Output, first: Input, second: Input) -> Chart:
    """A figure over a grid of two parameters."""
    across, i = np.unique(first.values, return_inverse=True)
    up, j = np.unique(second.values, return_inverse=True)
    cells = np.full((len(up), len(across)), np.nan)
    cells[j, i] = output.values
    low, high = float(np.nanmin(cells)), float(np.nanmax(cells))
    title = f"{output.label} over {first.label} and, upwards, {second.label}"
    return Chart([Grid(title, [first.text(value) for value in across], [second.text(value) for value in up[::-1]],
                       cells[::-1], (low, high))])  # fmt: skip


def matrix_chart(names: Sequence[str], found: Sequence[Measure], columns: Sequence[int]) -> Chart:
    """Every figure's sensitivity to every parameter."""
    values = np.array([[float(measure.values[k]) for k in columns] for measure in found])
    span = (-1.0, 1.0) if found[0].kind == RANK else (0.0, 1.0)
    return Chart([Grid("", [names[k] for k in columns], [each.figure for each in found], values, span)])
