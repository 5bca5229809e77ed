"""Results of any simulator: like traces, but time may stand still at events, and values may be missing.

What `read_csv` refuses for good reason where numbers are calculated with, is read here and told: rows at one instant,
empty cells, NaN and infinities, columns of text, array names such as `x[3]`, units in round brackets.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

import numpy as np

from feedsim import units
from feedsim.errors import InputError
from feedsim.trace.csv import read_table, seconds_of, time_index
from feedsim.trace.numbers import Decimal, decimal_mark
from feedsim.trace.trace import Array, Trace, suggest

# "x [m]", "Z.x_a[REAL]"; an index as in "x[3]" or "A[1,2]" belongs to the name.
_UNIT_BEHIND = re.compile(r"(.*?[^\s])\s*\[([^\[\]]*)\]")
_INDEX = re.compile(r"\s*[0-9]+(?:\s*,\s*[0-9]+)*\s*")
_ROUND = re.compile(r"(.*?[^\s])(\s*)\(([^()]*)\)")
# What tools write where a unit could stand: "[REAL]" (ecos).
_TYPE = re.compile(r"[0-9]*\s*(?:real|float|double|int|integer|bool|boolean|string|enum)[0-9]*\b.*", re.IGNORECASE)
# Values in words; what is missing is NaN.
_WORDS = {
    "true": 1.0, "false": 0.0, "": np.nan, "nan": np.nan, "-nan": np.nan, "+nan": np.nan, "nan(ind)": np.nan,
    "-nan(ind)": np.nan, "1.#qnan": np.nan, "-1.#ind": np.nan, "null": np.nan, "none": np.nan, "na": np.nan,
    "n/a": np.nan, "#n/a": np.nan, "inf": np.inf, "+inf": np.inf, "-inf": -np.inf, "infinity": np.inf,
    "+infinity": np.inf, "-infinity": -np.inf,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Series:
    """Columns of numbers over a common time, as simulators leave them.

    time     (N,) [s], finite, never decreasing: rows at one instant are before and after an event
    columns  name -> (N,) values; NaN and infinities are possible
    units    name -> unit as written; "" where none is known
    skipped  columns of text that are not read

    Arrays are copied and read-only. InputError: lengths that differ, time that is not finite or runs back.
    """

    time: Array
    columns: Mapping[str, Array]
    units: Mapping[str, str] = field(default_factory=dict)
    skipped: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        time = _frozen(self.time)
        if not np.all(np.isfinite(time)):
            raise InputError(f"time is not finite at row {int(np.argmin(np.isfinite(time)))} (counted from 0)")
        if (wrong := np.flatnonzero(np.diff(time) < 0)).size:
            row = int(wrong[0]) + 1
            raise InputError(f"time runs back: {time[row]:.9g} s follows {time[row - 1]:.9g} s at row {row}")
        columns = {name: _frozen(values) for name, values in self.columns.items()}
        for name, values in columns.items():
            if values.shape != time.shape:
                raise InputError(f"column {name!r} has {values.size} values, the time has {time.size}")
        if unknown := sorted(set(self.units) - set(columns)):
            raise InputError(f"unit given for {unknown[0]!r}, which is no column")
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "columns", MappingProxyType(columns))
        object.__setattr__(self, "units", MappingProxyType({name: self.units.get(name, "") for name in columns}))

    def __getitem__(self, name: str) -> Array:
        """Values of a column; InputError with a suggestion if there is none of that name."""
        if name not in self.columns:
            raise InputError(f"no column {name!r}{suggest(name, self.columns)}")
        return self.columns[name]

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        """Number of rows."""
        return int(self.time.size)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.columns)


def as_series(trace: Trace | Series) -> Series:
    """A trace as a series."""
    return trace if isinstance(trace, Series) else Series(trace.time, trace.columns, trace.units)


def read_series(path: str | Path, *, time: str | None = None, time_unit: str | None = None) -> Series:
    """Read the CSV file of any simulator; layout, separators and decimal marks as `read_csv`.

    time       name of the time column; default "time" or "t" in any case, else a first column whose unit is a time
    time_unit  unit of the time where the header does not tell it; default s

    True and false are 1 and 0. Raises InputError with file and line: layout, time that runs back or is missing.
    """
    path = Path(path)
    table = read_table(path, _heads)
    at = time_index(table, time)
    mark: Decimal = "."
    if table.decimal_comma and any("," in cell for column in table.columns for cell in column):
        plain = [column for column in table.columns if not _is_text(column)]
        mark = decimal_mark(plain, table.lines, table.where)
    read = {i: _values(column, mark) for i, column in enumerate(table.columns)}
    instants = read[at]
    if instants is None or not np.all(np.isfinite(instants)):
        row = 0 if instants is None else int(np.argmin(np.isfinite(instants)))
        raise InputError(
            f"{path}:{table.lines[row]}: {table.columns[at][row]!r} in the time column {table.names[at]!r}; "
            "every instant must be a finite number"
        )
    seconds = seconds_of(table, at, instants, time_unit)
    if (wrong := np.flatnonzero(np.diff(seconds) < 0)).size:
        row = int(wrong[0]) + 1
        raise InputError(
            f"{path}:{table.lines[row]}: time {instants[row]:.9g} follows {instants[row - 1]:.9g}; it must not run back"
        )
    columns = {table.names[i]: values for i, values in read.items() if values is not None and i != at}
    skipped = tuple(table.names[i] for i, values in read.items() if values is None)
    return Series(seconds, columns, {name: table.units[table.names.index(name)] for name in columns}, skipped)


def _heads(cells: Sequence[str], where: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names and units of a header."""
    pairs = [_head(cell.strip()) for cell in cells]
    names = tuple(name for name, _ in pairs)
    for i, name in enumerate(names):
        if not name:
            raise InputError(f"{where}: column {i + 1} has no name")
        if name in names[:i]:
            raise InputError(f"{where}: duplicate column {name!r} (columns {names.index(name) + 1} and {i + 1})")
    if all(re.fullmatch(r"[-+0-9.,eE]+", name) for name in names):
        raise InputError(f"{where}: the first line holds numbers; a header with the names is needed")
    return names, tuple(unit for _, unit in pairs)


def _head(cell: str) -> tuple[str, str]:
    if match := _UNIT_BEHIND.fullmatch(cell):
        inner, apart = match[2].strip(), cell[len(match[1])].isspace()
        if not _INDEX.fullmatch(inner) or (inner == "1" and apart):  # "x [1]" is a plain number, "x[1]" an element
            return match[1], "" if _TYPE.fullmatch(inner) else inner
    if (match := _ROUND.fullmatch(cell)) and (match[2] or match[1].lower() in ("time", "t")):
        try:
            units.unit(match[3])
        except InputError:
            return cell, ""
        return match[1], match[3].strip()
    return cell, ""


def _values(cells: Sequence[str], mark: Decimal) -> Array | None:
    """Numbers of a column; None where it holds text."""
    plain = [cell.replace(",", ".") for cell in cells] if mark == "," else cells
    try:
        return np.array(plain, dtype=np.float64)
    except ValueError:
        pass
    try:
        return np.array(
            [_WORDS[low] if (low := cell.lower()) in _WORDS else float(cell) for cell in plain], dtype=np.float64
        )
    except ValueError:
        return None


def _is_text(cells: Sequence[str]) -> bool:
    return _values(cells, ",") is None and _values(cells, ".") is None


def _frozen(values: Array) -> Array:
    array = np.array(values, dtype=np.float64).reshape(-1)
    array.setflags(write=False)
    return array
