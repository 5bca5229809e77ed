"""What a reference still holds of the time between its rows, where it has been thinned.

Beside `case.csv` lies `case.bounds.csv`, beside `case_ref.csv` it or `case_ref.bounds.csv`, with the same instants. Of
a variable v its columns `v.below` and `v.above` show how far v lies below and above the straight line from the row
before to this one, at most.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from feedsim.compare.tube import Rows, along, bounds, slack_of
from feedsim.errors import InputError
from feedsim.trace import Array, Series, Trace, as_series, read_series

BOUNDS = ".bounds.csv"
BELOW, ABOVE = ".below", ".above"


def thinned(dense: Series | Trace, every: int) -> tuple[Series, Series]:
    """Every `every`-th row and the last one, and the bounds of what lies between them.

    InputError: `every` below 1, or values that are no numbers.
    """
    dense = as_series(dense)
    if every < 1 or not all(np.isfinite(values).all() for values in dense.columns.values()):
        raise InputError(f"every {every}. row of a reference: 1 or more and rows of finite numbers are needed")
    rows = np.unique(np.r_[0 : len(dense) : every, len(dense) - 1])
    kept = Series(dense.time[rows], {name: values[rows] for name, values in dense.columns.items()}, dense.units)
    columns: dict[str, Array] = {}
    units: dict[str, str] = {}
    for name, values in dense.columns.items():
        below, above = _beside_the_line(dense.time, values, rows)
        columns |= {name + BELOW: below, name + ABOVE: above}
        units |= dict.fromkeys((name + BELOW, name + ABOVE), dense.units[name])
    return kept, Series(kept.time, columns, units)


def _beside_the_line(time: Array, values: Array, rows: Rows) -> tuple[Array, Array]:
    """Per kept row the least and largest distance from the line since the kept row before; 0 of the first."""
    if len(rows) < 2:
        return np.zeros(len(rows)), np.zeros(len(rows))
    off = values - along(time[rows], values[rows], time)
    off[rows] = 0.0
    result = [np.r_[0.0, extreme.reduceat(off, rows[:-1])] for extreme in (np.minimum, np.maximum)]
    return np.minimum(result[0], 0.0), np.maximum(result[1], 0.0)


def bounds_of(reference: Path) -> Series | None:
    """The bounds beside a reference; None where there are none. InputError: the file cannot be read."""
    stems = (reference.stem, reference.name.removesuffix("_ref.csv"))
    file = next((path for stem in stems if (path := reference.with_name(stem + BOUNDS)).is_file()), None)
    return read_series(file) if file is not None else None


def check_bounds(between: Series, reference: Series) -> None:
    """InputError: bounds that are of another reference."""
    time, slack = reference.time, slack_of(reference.time)
    if len(between) != len(time) or np.abs(between.time - time).max(initial=0.0) > slack:
        raise InputError(
            f"the bounds beside the reference are of another one: {len(between)} rows from {between.time[0]:.9g} to "
            f"{between.time[-1]:.9g} s, the reference has {len(time)} from {time[0]:.9g} to {time[-1]:.9g} s"
        )
    names = (*between.all_names, *between.skipped)
    for name in names:
        stem = name.removesuffix(BELOW).removesuffix(ABOVE)
        pair = (stem + BELOW, stem + ABOVE)
        if stem not in reference.all_names or stem == name or not all(name in between for name in pair):
            raise InputError(
                f"the bounds beside the reference have a column {name!r}; pairs NAME{BELOW}, NAME{ABOVE} of numbers "
                "are needed, NAME a column of the reference"
            )
        if stem in reference and (unknown := np.isfinite(reference[stem]) & ~np.isfinite(between[name])).any():
            raise InputError(
                f"the bounds beside the reference hold no number in column {name!r} at {time[np.argmax(unknown)]:.9g} s"
            )


class Between:
    """Bounds of a variable between the rows of its reference.

    time, values, below, above: (N,) of the reference and its bounds, in the same unit.
    """

    def __init__(self, time: Array, values: Array, below: Array, above: Array) -> None:
        self.rows = time
        # Lines beside the one from row to row; they jump at the rows.
        ends = np.repeat(values, 2)[1:-1]
        lines = [ends + np.repeat(np.asarray(values)[1:], 2) for values in (below, above)]
        known = np.isfinite(lines[0]) & np.isfinite(lines[1])
        self.time = np.repeat(time, 2)[1:-1][known]
        self.low, self.high = (line[known] for line in lines)

    def widened(self, low: Array, high: Array, at: Array, reach: float, slack: float) -> tuple[Array, Array]:
        """The tube around the reference alone, (M,) at instants `at`, widened by what is known to lie between its rows.

        At a row, and without a tolerance in time, the value is known.
        """
        if not self.time.size:
            return low, high
        least = np.minimum(low, bounds(self.time, self.low, at, reach, slack=slack)[0])
        most = np.maximum(high, bounds(self.time, self.high, at, reach, slack=slack)[1])
        if reach > 0:
            return least, most
        near = np.searchsorted(self.rows, at - slack).clip(max=len(self.rows) - 1)
        on = np.abs(self.rows[near] - at) <= slack
        return np.where(on, low, least), np.where(on, high, most)
