"""A grid of an SVG: cells coloured by their numbers, and the numbers where there is room; else a scale of colours."""

from __future__ import annotations

import math

from feedsim.report.chart.layout import CELL_WITH_NAME, CELL_WITH_NUMBER, DEPTH, ROW, SCALE_STEP, SCALE_STEPS, SLANTED
from feedsim.report.chart.model import Grid
from feedsim.report.chart.scales import tick_text
from feedsim.report.chart.shapes import fill, heading, rectangle, text, turned
from feedsim.report.formatting import minus, three
from feedsim.report.style import BLUE, GRID, INK, VERMILLION


def grid_height(grid: Grid) -> float:
    """With names and title above the cells."""
    return _over(grid) + ROW * len(grid.rows) + 12


def draw_grid(grid: Grid, width: float) -> str:
    """The grid with its names and its title."""
    left, top = min(260.0, 16 + 6.4 * max(map(len, grid.rows))), _over(grid)
    wide, count = width - left - 8, len(grid.columns)
    cell = min(wide / count, (wide - SLANTED * len(grid.columns[-1])) / (count - 0.5))
    parts = [heading(grid.title, 4, width - 4)]
    for j in range(0, count, math.ceil(CELL_WITH_NAME / cell)):
        parts.append(turned(left + (j + 0.5) * cell, top - 6, grid.columns[j], -40, 'font-size="11"'))
    for i, name in enumerate(grid.rows):
        y = top + ROW * i
        parts.append(text(left - 8, y + 16, name, 'font-size="11"', anchor="end"))
        for j in range(count):
            x, value = left + j * cell, float(grid.values[i, j])
            edge = f'stroke="{fill(GRID)}" stroke-width="0.6"'
            if not math.isfinite(value):
                parts.append(rectangle(x, y, cell, ROW, edge))
                continue
            parts.append(rectangle(x, y, cell, ROW, f"{_paint(value, grid)} {edge}"))
            if cell >= CELL_WITH_NUMBER:
                weight = 'font-weight="700"' if grid.bold is not None and grid.bold[i, j] else ""
                words = three(value) if grid.decimals is None else minus(f"{value:.{grid.decimals}f}")
                parts.append(text(x + cell / 2, y + 16, words, f'font-size="11" {weight}', anchor="middle"))
    if grid.best is not None:
        i, j = grid.best
        frame = f'stroke="{fill(INK)}" stroke-width="2.2"'
        parts.append(rectangle(left + j * cell, top + ROW * i, cell, ROW, frame))
    if cell < CELL_WITH_NUMBER:
        parts.append(_scale(grid, width))
    return "".join(parts)


def _scale(grid: Grid, width: float) -> str:
    low, high = grid.span
    end = width - 8 - 7 * len(tick_text(high, 3))
    begin = end - SCALE_STEPS * SCALE_STEP - 4
    parts = [text(begin - 4, 15, tick_text(low, 3), 'font-size="11"', anchor="end"),
             text(end, 15, tick_text(high, 3), 'font-size="11"')]  # fmt: skip
    for k in range(SCALE_STEPS):
        value = low + (high - low) * (k + 0.5) / SCALE_STEPS
        parts.append(rectangle(begin + k * SCALE_STEP, 6, SCALE_STEP, 10, _paint(value, grid)))
    return "".join(parts)


def _paint(value: float, grid: Grid) -> str:
    """The colour of a cell; about zero that of its sign."""
    low, high = grid.span
    signs = low < 0 < high
    share = abs(value) / max(-low, high) if signs else (value - low) / (high - low or 1)
    deep = DEPTH * min(1.0, max(0.0, share))
    return f'fill="{fill(VERMILLION if signs and value < 0 else BLUE)}" fill-opacity="{deep:.3f}"'


def _over(grid: Grid) -> float:
    return 36 + 4.3 * max(map(len, grid.columns))
