"""The charts of a page as one text of JSON, with the numbers of their curves in 32 bits each.

Along a linear axis every BLOCK_ROWS rows have a middle and a step of their own, and a value is a whole number of steps
from that middle: of an axis of 2 m far less than 1 nm, wherever one zooms in; a 32-bit float has 0.1 um there. Along a
logarithmic axis they are floats.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from feedsim.report.chart.model import Axis, Band, Chart, Curve, Grid, Level, Mark, Panel, Part, Polar
from feedsim.report.style import PALETTE, Array, named

QUANTISATION_STEPS = 2**31 - 1  # to either side of the middle; one more is no number
BLOCK_ROWS = 256  # rows; chart_use.js knows it, too


def embedded(charts: Mapping[str, Chart]) -> str:
    """JSON of charts by their stems, for an element of a page: nothing in it ends the element."""
    pool = _Pool()
    content = {
        "charts": {stem: {"widths": list(chart.widths), "panels": [_part(part, pool) for part in chart.panels]}
                   for stem, chart in charts.items()},
        "palette": {name: colour for name, colour, _ in PALETTE} | {"ground": "#ffffff"},
        "arrays": pool.arrays,
    }  # fmt: skip
    text = json.dumps(content, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


class _Pool:
    """Arrays of a page, each once."""

    def __init__(self) -> None:
        self.arrays: list[tuple[int, str]] = []
        self._known: dict[tuple[int, bytes], int] = {}

    def __call__(self, values: Array, axis: Axis | None = None, *, cells: bool = False) -> int:
        """The number of an array; axis: along which it is shown; cells: numbers of a table, of any sizes."""
        whole = not cells and (axis is None or not (axis.log or axis.symlog))
        content = (BLOCK_ROWS, steps(values)) if whole else (0, np.asarray(values).astype("<f4").tobytes())
        count = self._known.setdefault(content, len(self.arrays))
        if count == len(self.arrays):
            self.arrays.append((content[0], base64.b64encode(content[1]).decode("ascii")))
        return count


def steps(values: Array) -> bytes:
    """Values (N,) as middle + step * k: middle and step of each block as doubles, behind them all k as 32-bit integers.

    What is not finite has the least k.
    """
    values = np.asarray(values, dtype=np.float64)
    blocks = -(-len(values) // BLOCK_ROWS)
    padded = np.full(blocks * BLOCK_ROWS, np.nan)
    padded[: len(values)] = np.where(np.isfinite(values), values, np.nan)
    rows = padded.reshape(blocks, BLOCK_ROWS)
    finite = np.isfinite(rows)
    low = np.where(finite, rows, np.inf).min(axis=1, initial=np.inf)
    high = np.where(finite, rows, -np.inf).max(axis=1, initial=-np.inf)
    empty = low > high
    low, high = np.where(empty, 0.0, low), np.where(empty, 0.0, high)
    middle, half = low / 2 + high / 2, high / 2 - low / 2
    step = half / QUANTISATION_STEPS
    step[step == 0] = 1.0
    whole = np.where(
        finite,
        np.clip(np.rint((rows - middle[:, None]) / step[:, None]), -QUANTISATION_STEPS, QUANTISATION_STEPS),
        -QUANTISATION_STEPS - 1,
    )
    return (
        np.column_stack([middle, step]).astype("<f8").tobytes() + whole.ravel()[: len(values)].astype("<i4").tobytes()
    )


def _part(part: Part, pool: _Pool) -> dict[str, Any]:
    if isinstance(part, Polar):
        return {
            "kind": "polar", "title": part.title, "axes": list(part.axes), "radius": part.radius, "ring": part.ring,
            "rings": part.rings, "curves": [_curve(curve, pool) for curve in part.curves],
            "marks": [_mark(mark) for mark in part.marks], "sense": part.sense, "note": part.note,
        }  # fmt: skip
    if isinstance(part, Grid):
        return {
            "kind": "grid", "title": part.title, "columns": list(part.columns), "rows": list(part.rows),
            "values": pool(part.values.ravel(), cells=True), "span": list(part.span), "decimals": part.decimals,
            **({} if part.bold is None else {"bold": np.flatnonzero(part.bold).tolist()}),
            **({} if part.best is None else {"best": list(part.best)}),
        }  # fmt: skip
    return {
        "kind": "xy", "title": part.title, "x": _axis(part.x), "y": _axis(part.y),
        "curves": [_curve(curve, pool, part) for curve in part.curves],
        "levels": [_level(level) for level in part.levels],
        "bands": [_band(band, pool, part) for band in part.bands], "marks": [_mark(mark) for mark in part.marks],
        "linked": part.linked, "note": part.note, "height": part.height,
    }  # fmt: skip


def _axis(axis: Axis) -> dict[str, Any]:
    span = list(axis.span) if axis.span is not None else None
    more = {name: value for name, value in (("symlog", axis.symlog), ("also", list(axis.also or ()))) if value}
    return {"label": axis.label, "unit": axis.unit, "log": axis.log, "span": span, "names": list(axis.names), **more}


def _curve(curve: Curve, pool: _Pool, panel: Panel | None = None) -> dict[str, Any]:
    kept = curve.thinned()
    x, y = (None, None) if panel is None else (panel.x, panel.y)
    return {
        "name": kept.name, "x": pool(kept.x, x), "y": pool(kept.y, y), "colour": named(kept.colour), "dash": kept.dash,
        "width": kept.width, "dots": kept.dots, "faint": kept.faint, "filled": kept.filled,
        "ascending": kept.ascending,
    }  # fmt: skip


def _level(level: Level) -> dict[str, Any]:
    ends = list(level.ends) if level.ends is not None else None
    return {"at": level.at, "text": level.text, "upright": level.upright, "colour": named(level.colour),
            "dash": level.dash, "ends": ends}  # fmt: skip


def _band(band: Band, pool: _Pool, panel: Panel) -> dict[str, Any]:
    edges = {name: edge if isinstance(edge, float) else {"array": pool(edge, panel.y)}
             for name, edge in (("low", band.low), ("high", band.high))}  # fmt: skip
    return {
        "name": band.name,
        "x": None if band.x is None else pool(band.x, panel.x),
        "colour": named(band.colour),
        **edges,
    }


def _mark(mark: Mark) -> dict[str, Any]:
    return {"x": mark.x, "y": mark.y, "text": mark.text, "colour": named(mark.colour), "hollow": mark.hollow}
