"""Oracles of comparisons: the tube by brute force, and CSV files to compare."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from feedsim.files.trace import Array, Series


def brute_bounds(time: Sequence[float], values: Sequence[float], at: float, reach: float) -> tuple[float, float]:
    """Least and largest value of a polyline within [at - reach, at + reach], segment by segment."""
    begin, end = max(at - reach, time[0]), min(at + reach, time[-1])
    found: list[float] = [v for t, v in zip(time, values, strict=True) if begin <= t <= end]
    for k in range(len(time) - 1):
        (t0, v0), (t1, v1) = (time[k], values[k]), (time[k + 1], values[k + 1])
        for edge in (begin, end):
            if t0 < t1 and t0 <= edge <= t1:
                found.append(v0 + (v1 - v0) * (edge - t0) / (t1 - t0))
    return min(found), max(found)


def wave(rows: int = 401, end: float = 2.0) -> Series:
    """A position and a torque of a move there and back, and a flag."""
    time = np.linspace(0.0, end, rows)
    columns: dict[str, Array] = {
        "Z.x_a": 0.1 + 0.05 * np.sin(2 * np.pi * time),
        "Z.M_a": 3.0 * np.cos(2 * np.pi * time),
        "Z.limited": (np.cos(2 * np.pi * time) > 0.5).astype(float),
    }
    return Series(time, columns, {"Z.x_a": "m", "Z.M_a": "N.m", "Z.limited": "1"})


def changed(series: Series, **columns: Array) -> Series:
    """With other values of columns; a dot in a name is written as two underscores."""
    new = {name.replace("__", "."): values for name, values in columns.items()}
    return Series(series.time, {**series.columns, **new}, series.units)


def written(path: Path, series: Series, *, heads: Sequence[str] | None = None, separator: str = ",") -> Path:
    """A CSV file with the series's names and units, or with `heads`, the time's first."""
    names = [f"{name} [{unit}]" if unit else name for name, unit in series.units.items()]
    lines = [separator.join(heads or ["time [s]", *names])]
    table = np.column_stack([series.time, *series.columns.values()])
    lines += [separator.join(repr(float(value)) for value in row) for row in table]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
