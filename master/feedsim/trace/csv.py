"""CSV files of traces: a header of `name [unit]`, then numbers.

What feedsim writes: commas, decimal points, LF, `time [s]` first, every number in its shortest form that reads back the
same. What it reads besides: semicolons or tabs, decimal commas with them, a byte-order mark, UTF-16, quotes, uneven
time, the time in another unit or another column. What is not clear is refused with its line, never guessed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from pydantic_core import to_json

from feedsim import units
from feedsim.errors import InputError, OutputError
from feedsim.trace.cells import TIME_NAMES, read_table, round_unit
from feedsim.trace.files import written_whole
from feedsim.trace.trace import Array, Trace, first_not_finite, stretches

ROWS = 1 << 12  # that are written at a time


def read_csv(
    path: str | Path, *, columns: Iterable[str] | None = None, time: str | None = None, time_unit: str | None = None
) -> Trace:
    """Read a trace.

    columns    names (without unit) to read; default all but the time. Others may hold anything.
    time       name of the time column; default "time" or "t" in any case, else a first column whose unit is a time
    time_unit  unit of the time where the header does not give it; default s

    Units of columns stay as written; the time is converted to s. Raises InputError with file and line.

    >>> import feedsim as fs
    >>> fs.read_trace("log.csv").names
    ('Z.x_s', 'Z.x_a', 'Z.n_a', 'Z.i_q')
    """
    path = Path(path)
    table = read_table(path)
    at = table.axis(time, TIME_NAMES, "s")
    others = [i for i in range(len(table.names)) if i != at]
    wanted = others if columns is None else [table.index(name) for name in columns]
    values = table.values([at, *wanted])
    seconds = values[at] * table.factor(at, "s", "time column", time_unit or "s")
    if (wrong := np.flatnonzero(np.diff(seconds) <= 0)).size:
        row = int(wrong[0]) + 1
        raise InputError(
            f"{path}:{table.lines[row]}: time {values[at][row]:.9g} follows {values[at][row - 1]:.9g}; it must increase"
        )
    chosen = {table.names[i]: values[i] for i in wanted}
    try:
        return Trace(seconds, chosen, {table.names[i]: table.units[i] for i in wanted})
    except InputError as error:
        raise InputError(f"{table.head}: {error}") from None


read_trace = read_csv  # its name in `import feedsim`


def read_signals(
    path: str | Path,
    columns: Mapping[str, tuple[str, str | None]],
    unit: str,
    *,
    time: tuple[str, str | None] = ("time", None),
    between: tuple[float, float] | None = None,
    fewest: int = 2,
) -> Trace:
    """Signals of one dimension over time from a recording.

    columns  signal -> (column name, unit or None for that of the header)
    unit     SI unit of the signals
    time     (column name, unit or None); without any unit: s
    between  part to read, first and last recorded time [s]
    fewest   rows that are needed

    Returns a trace with a column per signal, over the time as recorded. Raises InputError: what read_csv() refuses, a
    unit that is missing, contradicts the header or is of another dimension, too few rows in the part.
    """
    path = Path(path)
    time_name, time_unit = time
    names = dict.fromkeys(name for name, _ in columns.values())
    trace = read_csv(path, columns=names, time=time_name, time_unit=time_unit)
    whole = trace
    if between is not None:
        trace = trace.between(*between)
    if len(trace) < fewest:
        part = f" between {between[0]:.9g} and {between[1]:.9g} s" if between else ""
        raise InputError(
            f"{path}: {len(trace)} row{'s'[: len(trace) != 1]}{part}; at least {fewest} are needed "
            f"(the file runs from {whole.time[0]:.9g} to {whole.time[-1]:.9g} s)"
        )
    values = {}
    for signal, (name, column) in columns.items():
        known = trace.unit(name)
        if column and known and units.unit(column).factor != units.unit(known).factor:
            raise InputError(f"{path}:1: column {name!r} is in {known} by its header, in {column} by the scenario")
        if not (given := column or known):
            example = {"m": "mm"}.get(unit, unit)
            raise InputError(
                f"{path}:1: column {name!r} has no unit; write '{name} [{example}]' in the header or give the unit"
            )
        try:
            factor = units.factor(given, unit)
        except InputError as error:
            raise InputError(f"{path}:1: column {name!r}: {error}") from None
        values[signal] = trace[name] * float(factor)
    return Trace(trace.time, values, dict.fromkeys(values, unit))


def write_csv(path: str | Path, trace: Trace) -> None:
    """Write a trace, whole or not at all. OutputError: a value is not finite, or the file cannot be written."""
    path = Path(path)
    for name, values in trace.columns.items():
        if (row := first_not_finite(values)) is not None:
            raise OutputError(f"{path} is not written: {name} is {values[row]} at {trace.time[row]:.9g} s")
    with written_whole(path) as file:
        file.write(heading(trace))
        for columns in stretches(trace.time, *trace.columns.values(), rows=ROWS):
            file.write(lines_of(columns))


def heading(trace: Trace) -> bytes:
    """The first line of a trace's file."""
    units = [(name, trace.unit(name)) for name in trace.columns]
    heads = ["time [s]", *(f"{name} [{unit}]" if unit or round_unit(name) else name for name, unit in units)]
    return f"{','.join(quoted(cell) for cell in heads)}\n".encode()


def lines_of(columns: Sequence[Array]) -> bytes:
    """Rows of a file, the time being the first of the columns."""
    text = zip(*(shortest(values) for values in columns), strict=True)
    return "".join(f"{','.join(cells)}\n" for cells in text).encode()


def shortest(values: Array) -> list[str]:
    """Every number in its shortest form that reads back the same, as repr() writes it, whole ones without ".0"."""
    if not values.size:
        return []
    if (values.view(np.uint64) == values[:1].view(np.uint64)).all():  # of an axis that stands: many columns
        return [repr(float(values[0])).removesuffix(".0")] * len(values)
    numbers, size = values.tolist(), np.abs(values)
    # The digits are those of repr, which takes five times as long. Its exponents have two digits, and begin below 1e-4.
    text = to_json(numbers).decode()[1:-1].replace("e-", "e-0").split(",")
    same = (size >= 1e-9) & (size < 1e-5) | (size >= 1e-4) & (size < 1e16) | (size == 0)
    for i in np.flatnonzero(~same).tolist():
        text[i] = repr(numbers[i])
    for i in np.flatnonzero(values == np.trunc(values)).tolist():
        text[i] = text[i].removesuffix(".0")
    return text


def quoted(cell: str) -> str:
    """A cell as it stands in a file."""
    return '"' + cell.replace('"', '""') + '"' if any(c in cell for c in ',;"') else cell
