"""Results of any simulator: like traces, but time may stand still at events, and values may be missing.

What `read_csv` refuses for good reason where numbers are calculated with, is read here and shown: rows at one instant,
empty cells, NaN and infinities, columns of text, array names such as `x[3]`, units in round brackets.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from feedsim.files.trace.cells import (
    TIME_NAMES,
    Decimal,
    Table,
    cell_text,
    check_unlike,
    decimal_mark,
    instead_of,
    is_of_kind,
    read_table,
    round_unit,
)
from feedsim.files.trace.mat import MAT, find_column, read_columns
from feedsim.files.trace.recording import of_control
from feedsim.files.trace.trace import Array, TimeColumns, Trace
from feedsim.foundation import units
from feedsim.foundation.errors import Finding, InputError, shorten_list

# "x [m]", "Z.x_a[REAL]"; an index as in "x[3]" or "A[1,2]" belongs to the name.
_UNIT_BEHIND = re.compile(r"(.*?[^\s])\s*\[([^\[\]]*)\]")
_INDEX = re.compile(r"\s*[0-9]+(?:\s*,\s*[0-9]+)*\s*")
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
class Series(TimeColumns):
    """Columns of numbers over a common time, as simulators leave them.

    time     (N,) [s], finite, never decreasing: rows at one instant are before and after an event
    columns  name -> (N,) values; NaN and infinities are possible
    units    name -> unit as written; "" where none is known
    skipped  columns of text that are not read
    broken   name -> what is wrong with a column that is not read either: of numbers, but for some cells
    notes    what a reader of the file should know

    Arrays are copied and read-only. InputError: lengths that differ, time that is not finite or runs back.
    """

    time: Array
    columns: Mapping[str, Array]
    units: Mapping[str, str] = field(default_factory=dict)
    skipped: tuple[str, ...] = ()
    broken: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[Finding, ...] = ()

    def __post_init__(self) -> None:
        self._settle()
        if (wrong := np.flatnonzero(np.diff(self.time) < 0)).size:
            row = int(wrong[0]) + 1
            raise InputError(f"time runs back: {self.time[row]:.9g} s follows {self.time[row - 1]:.9g} s at row {row}")

    @property
    def all_names(self) -> tuple[str, ...]:
        """Names of all columns of numbers, those that are broken included."""
        return (*self.columns, *self.broken)


def as_series(trace: Trace | Series) -> Series:
    """A trace as a series."""
    return trace if isinstance(trace, Series) else Series(trace.time, trace.columns, trace.units)


def read_series(path: str | Path, *, time: str | None = None) -> Series:
    """Read the CSV or MAT file of any simulator, or the record of a control; layout, separators and decimal marks as of
    records (`read_recording`).

    time   name of the time column, or NAME:UNIT where there is no column of that whole name and the header does not
           show the unit (default s); default "time" or "t" in any case, else a first column whose unit is a time

    True and false are 1 and 0. Raises InputError with file and line: layout, time that runs back or is missing, a unit
    of the time that is not the header's.
    """
    path = Path(path)
    if path.suffix.lower() == MAT:
        return _of_mat(path, time)
    if (recording := of_control(path)) is not None and time is None:
        columns = recording.read(recording.names)
        return Series(columns.pop("time"), columns, {name: recording.units[name] for name in columns}, (), {},
                      recording.notes)  # fmt: skip
    table = read_table(path, _heads, as_numbers=True)
    time_unit = None
    if time is not None and time not in table.names:
        name, colon, unit = time.rpartition(":")
        if colon and (name in table.names or is_of_kind(unit, "s")):
            time, time_unit = name, unit
    at = table.axis(time, TIME_NAMES, "s")
    if time_unit is not None and units.factor(time_unit, "s") != units.factor(table.units[at] or time_unit, "s"):
        raise InputError(f"{table.head}: the time column {table.names[at]!r} is in {table.units[at]}, not {time_unit}")
    mark: Decimal = "."
    if table.decimal_comma and any("," in cell for column in table.columns for cell in column):
        plain = [column for i, column in enumerate(table.columns) if i not in table.dates and not _is_text(column)]
        mark = decimal_mark(plain, table.lines, table.where)
    read = {i: _values(column, mark) for i, column in enumerate(table.columns) if i not in table.dates}
    if table.numbers is not None:
        read = dict(enumerate(table.numbers.T))
    if at in table.dates:
        read |= table.values([at])
    read |= {i: None if isinstance(dates, InputError) else dates.seconds for i, dates in table.dates.items()}
    instants = read[at]
    if instants is None or not np.all(np.isfinite(instants)):
        row = 0 if instants is None else int(np.argmin(np.isfinite(instants)))
        text = str(table.numbers[row, at]) if table.numbers is not None else cell_text(table.columns[at][row])
        raise InputError(
            f"{path}:{table.lines[row]}: {text} in the time column {table.names[at]!r}; "
            f"every instant must be a finite number{instead_of(text)}"
        )
    seconds = instants * table.factor(at, "s", "time column", time_unit or "s")
    if (wrong := np.flatnonzero(np.diff(seconds) < 0)).size:
        row = int(wrong[0]) + 1
        raise InputError(
            f"{path}:{table.lines[row]}: time {instants[row]:.9g} follows {instants[row - 1]:.9g}; it must not run back"
        )
    columns = {table.names[i]: values for i, values in read.items() if values is not None and i != at}
    broken = {
        table.names[i]: fault for i, values in read.items() if values is None and (fault := _fault(table, i, mark))
    }
    skipped = tuple(table.names[i] for i, values in read.items() if values is None and table.names[i] not in broken)
    of_columns = {name: unit for name, unit in zip(table.names, table.units, strict=True) if name in columns}
    return Series(seconds, columns, of_columns, skipped, broken, table.notes)


def _of_mat(path: Path, time: str | None) -> Series:
    """The columns of a MAT file that are as long as its time."""
    mat = read_columns(path)
    name, unit = time or "", ""
    if time is not None and find_column(time, mat.columns, mat.spellings) not in mat.columns:
        name, _, unit = time.rpartition(":")
    at = find_column(name, mat.columns, mat.spellings)
    if time is None:
        at = next((name for name in mat.columns if name.lower() in TIME_NAMES), "")
    if at not in mat.columns:
        first = next(iter(mat.columns))
        problem = f"no column {time!r}" if time else "which column is the time? It is called time or t, or name it"
        raise InputError(
            f"{path}: {problem}, for example {first}:s, or map all columns of a drive's record; there is "
            f"{shorten_list([*mat.columns], 20)}"
        )
    known = mat.units[at]
    if unit and known and units.factor(unit, "s") != units.factor(known, "s"):
        raise InputError(f"{path}: the time {at!r} is in {known}, not {unit}")
    seconds = mat.columns[at].astype(np.float64) * float(units.factor(unit or known or "s", "s"))
    if (wrong := np.flatnonzero(~np.isfinite(seconds))).size:
        raise InputError(f"{path}: the time {at!r} is {seconds[wrong[0]]} at element {int(wrong[0]) + 1}")
    columns = {
        name: values.astype(np.float64, copy=False)
        for name, values in mat.columns.items()
        if len(values) == len(seconds) and name != at
    }
    skipped = tuple(name for name in mat.columns if name != at and name not in columns)
    try:
        return Series(seconds, columns, {name: mat.units[name] for name in columns}, skipped)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _heads(cells: Sequence[str], where: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names and units of a header."""
    pairs = [_head(cell.strip()) for cell in cells]
    check_unlike([name for name, _ in pairs], where)
    return tuple(name for name, _ in pairs), tuple(unit for _, unit in pairs)


def _head(cell: str) -> tuple[str, str]:
    if match := _UNIT_BEHIND.fullmatch(cell):
        inner, apart = match[2].strip(), cell[len(match[1])].isspace()
        if not _INDEX.fullmatch(inner) or (inner == "1" and apart):  # "x [1]" is a plain number, "x[1]" an element
            return match[1], "" if _TYPE.fullmatch(inner) else inner
    return round_unit(cell) or (cell, "")


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


def _fault(table: Table, index: int, mark: Decimal) -> str:
    """What is wrong with a column of more numbers than text, with file and line; "" where it is one of text."""
    read = [_values([cell], mark) for cell in table.columns[index]]
    wrong = [row for row, value in enumerate(read) if value is None]
    if len(wrong) > sum(value is not None and bool(np.isfinite(value[0])) for value in read):
        return ""
    row = wrong[0]
    more = f" (and {len(wrong) - 1} more such cells)" if len(wrong) > 1 else ""
    where, name = f"{table.where}:{table.lines[row]}", table.names[index]
    return f"{where}: {table.columns[index][row]!r} in column {name!r} is no number{more}"


def _is_text(cells: Sequence[str]) -> bool:
    return _values(cells, ",") is None and _values(cells, ".") is None
