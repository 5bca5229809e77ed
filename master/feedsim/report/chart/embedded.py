"""The charts of a page as one text of JSON, with the numbers of their curves as 32-bit floats."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from feedsim.report.chart.model import Axis, Band, Chart, Curve, Grid, Level, Mark, Part, Polar
from feedsim.report.style import PALETTE, Array, named

# An offset this many times as large as what varies would cost a 32-bit float more digits than can be seen.
FAR = 100.0


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
        self.arrays: list[tuple[float, str]] = []
        self._known: dict[tuple[float, bytes], int] = {}

    def __call__(self, values: Array) -> int:
        finite = values[np.isfinite(values)]
        about = 0.0
        if len(finite) and abs(float(finite[0])) > FAR * float(np.ptp(finite)):
            about = float(finite[0])
        content = (np.asarray(values, dtype=np.float64) - about).astype("<f4").tobytes()
        found = self._known.setdefault((about, content), len(self.arrays))
        if found == len(self.arrays):
            self.arrays.append((about, base64.b64encode(content).decode("ascii")))
        return found


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
            "values": pool(part.values.ravel()), "span": list(part.span), "decimals": part.decimals,
            **({} if part.bold is None else {"bold": np.flatnonzero(part.bold).tolist()}),
        }  # fmt: skip
    return {
        "kind": "xy", "title": part.title, "x": _axis(part.x), "y": _axis(part.y),
        "curves": [_curve(curve, pool) for curve in part.curves], "levels": [_level(level) for level in part.levels],
        "bands": [_band(band, pool) for band in part.bands], "marks": [_mark(mark) for mark in part.marks],
        "linked": part.linked, "note": part.note, "height": part.height,
    }  # fmt: skip


def _axis(axis: Axis) -> dict[str, Any]:
    span = list(axis.span) if axis.span is not None else None
    more = {name: value for name, value in (("symlog", axis.symlog), ("also", list(axis.also or ()))) if value}
    return {"label": axis.label, "unit": axis.unit, "log": axis.log, "span": span, "names": list(axis.names), **more}


def _curve(curve: Curve, pool: _Pool) -> dict[str, Any]:
    kept = curve.thinned()
    return {
        "name": kept.name, "x": pool(kept.x), "y": pool(kept.y), "colour": named(kept.colour), "dash": kept.dash,
        "width": kept.width, "dots": kept.dots, "faint": kept.faint, "filled": kept.filled,
        "ascending": kept.ascending,
    }  # fmt: skip


def _level(level: Level) -> dict[str, Any]:
    ends = list(level.ends) if level.ends is not None else None
    return {"at": level.at, "text": level.text, "upright": level.upright, "colour": named(level.colour),
            "dash": level.dash, "ends": ends}  # fmt: skip


def _band(band: Band, pool: _Pool) -> dict[str, Any]:
    edges = {name: edge if isinstance(edge, float) else {"array": pool(edge)}
             for name, edge in (("low", band.low), ("high", band.high))}  # fmt: skip
    return {"name": band.name, "x": None if band.x is None else pool(band.x), "colour": named(band.colour), **edges}


def _mark(mark: Mark) -> dict[str, Any]:
    return {"x": mark.x, "y": mark.y, "text": mark.text, "colour": named(mark.colour), "hollow": mark.hollow}
