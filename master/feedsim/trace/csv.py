"""CSV files of traces: a header of `name [unit]`, then numbers.

What feedsim writes: commas, decimal points, LF, `time [s]` first, every number in its shortest form that reads back the
same. What it reads besides: semicolons or tabs, decimal commas with them, a byte-order mark, UTF-16, quotes, uneven
time, the time in another unit or another column. What is not clear is refused with its line, never guessed.
"""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from feedsim import units
from feedsim.errors import InputError, OutputError
from feedsim.trace.files import written_whole
from feedsim.trace.numbers import Decimal, decimal_mark, numbers
from feedsim.trace.table import stretches
from feedsim.trace.trace import Array, Trace, check_name, check_unit, first_not_finite, suggest

_HEADER = re.compile(r"(.*?)\s*(?:\[([^\[\]]*)\])?")
ROWS = 1 << 12  # that are written at a time
_SEPARATORS = {"\t": "tab", ";": "semicolon", ",": "comma"}
# Heads of the columns, and where they stand -> names and units; InputError.
Header = Callable[[Sequence[str], str], tuple[tuple[str, ...], tuple[str, ...]]]


@dataclass(frozen=True)
class Table:
    """Cells of a file by column, all of one length, with the line of every row; `where` is the file's name.

    numbers: (N, M) in place of the cells, where they were asked for and are nothing else.
    """

    where: str
    header_line: int
    names: tuple[str, ...]
    units: tuple[str, ...]
    columns: tuple[Sequence[str], ...]
    lines: Sequence[int]
    decimal_comma: bool  # may a comma stand in a number
    numbers: Array | None = None

    def index(self, name: str) -> int:
        if name in self.names:
            return self.names.index(name)
        raise InputError(f"{self.where}:{self.header_line}: no column {name!r}{suggest(name, self.names)}")


def read_csv(
    path: str | Path, *, columns: Iterable[str] | None = None, time: str | None = None, time_unit: str | None = None
) -> Trace:
    """Read a trace.

    columns    names (without unit) to read; default all but the time. Others may hold anything.
    time       name of the time column; default "time" or "t" in any case, else a first column whose unit is a time
    time_unit  unit of the time where the header does not tell it; default s

    Units of columns stay as written; the time is converted to s. Raises InputError with file and line.
    """
    path = Path(path)
    table = read_table(path)
    at = time_index(table, time)
    wanted = (
        [i for i in range(len(table.names)) if i != at] if columns is None else [table.index(name) for name in columns]
    )
    used = [at, *wanted]
    mark: Decimal = "."
    if table.decimal_comma:
        mark = decimal_mark([table.columns[i] for i in used], table.lines, table.where)
    values = {i: numbers(table.columns[i], mark, table.lines, table.where, table.names[i]) for i in used}
    seconds = seconds_of(table, at, values[at], time_unit)
    if (wrong := np.flatnonzero(np.diff(seconds) <= 0)).size:
        row = int(wrong[0]) + 1
        raise InputError(
            f"{path}:{table.lines[row]}: time {values[at][row]:.9g} follows {values[at][row - 1]:.9g}; it must increase"
        )
    chosen = {table.names[i]: values[i] for i in wanted}
    try:
        return Trace(seconds, chosen, {table.names[i]: table.units[i] for i in wanted})
    except InputError as error:
        raise InputError(f"{path}:{table.header_line}: {error}") from None


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
    heads = ["time [s]", *(f"{name} [{unit}]" if unit else name for name, unit in units)]
    return f"{','.join(quoted(cell) for cell in heads)}\n".encode()


def lines_of(columns: Sequence[Array]) -> bytes:
    """Rows of a file, the time being the first of the columns."""
    text = zip(*(shortest(values) for values in columns), strict=True)
    return "".join(f"{','.join(cells)}\n" for cells in text).encode()


def shortest(values: Array) -> list[str]:
    """Every number in its shortest form that reads back the same."""
    return [text.removesuffix(".0") for text in map(repr, values.tolist())]


def quoted(cell: str) -> str:
    """A cell as it stands in a file."""
    return '"' + cell.replace('"', '""') + '"' if any(c in cell for c in ',;"') else cell


def read_table(path: Path, split: Header | None = None, *, as_numbers: bool = False) -> Table:
    """Cells of a file under its header. InputError with file and line.

    split: takes the heads of the columns apart into names and units; default: name [unit], each name once.
    as_numbers: numbers alone where nothing else stands in the file, many times faster than cells.
    """
    lines = io.StringIO(_text(path), newline="")
    first = lines.readline()
    separator = ""
    header_line = 1
    if match := re.fullmatch(r"sep=(.)\s*", first):  # a spreadsheet's own hint
        separator, first, header_line = match[1], lines.readline(), 2
    separator = separator or _separator(first, f"{path}:{header_line}")
    if as_numbers and (table := _numbers(path, first, header_line, lines, separator, split or _header)) is not None:
        return table
    lines.seek(0)
    reader = csv.reader(lines, delimiter=separator, strict=True)
    rows: list[list[str]] = []
    numbers_of_lines: list[int] = []
    try:
        for row in reader:
            rows.append(row)
            numbers_of_lines.append(reader.line_num)
    except csv.Error as error:
        raise InputError(f"{path}:{reader.line_num}: {error}") from None
    while rows and not any(cell.strip() for cell in rows[-1]):
        rows.pop()
        numbers_of_lines.pop()
    header, body, body_lines = rows[header_line - 1], rows[header_line:], numbers_of_lines[header_line:]
    if not header[-1].strip() and all(len(row) == len(header) and not row[-1].strip() for row in body):
        header, body = header[:-1], [row[:-1] for row in body]  # every line ends with a separator
    names, header_units = (split or _header)(header, f"{path}:{header_line}")
    if not body:
        raise InputError(f"{path}:{header_line}: no rows below the header")
    for line, row in zip(body_lines, body, strict=True):
        if not any(cell.strip() for cell in row):
            raise InputError(f"{path}:{line}: the row is empty")
        if len(row) != len(header):
            hint = (
                "; decimal commas need semicolons or tabs between the columns"
                if separator == "," and len(row) > len(header)
                else ""
            )
            raise InputError(f"{path}:{line}: {len(row)} values, the header has {len(header)} columns{hint}")
    cells = tuple(tuple(cell.strip() for cell in column) for column in zip(*body, strict=True))
    return Table(str(path), header_line, names, header_units, cells, tuple(body_lines), separator != ",")


def _numbers(path: Path, head: str, header_line: int, rest: io.StringIO, separator: str, split: Header) -> Table | None:
    """A file of nothing but numbers with decimal points, one line a row; None for any other."""
    cells = [] if head.count('"') % 2 else next(csv.reader([head], delimiter=separator))
    body = rest.read().rstrip("\r\n")
    if not body or not cells:
        return None
    try:
        found = np.loadtxt(io.StringIO(body), delimiter=separator, comments=None, ndmin=2)
    except ValueError:
        return None
    if found.shape != (body.count("\n") + 1, len(cells)):
        return None  # empty lines, or a header that is not that of the rows
    names, header_units = split(cells, f"{path}:{header_line}")
    lines = range(header_line + 1, header_line + 1 + len(found))
    return Table(str(path), header_line, names, header_units, (), lines, False, found)


def _text(path: Path) -> str:
    try:
        raw = path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"no such file: {path}") from None
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from None
    wide = raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        text = raw.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise InputError(f"{path}:{line}: not UTF-8 (byte 0x{raw[error.start]:02x}); save the file as UTF-8") from None
    if not text.strip():
        raise InputError(f"{path}: the file is empty")
    return text


def _separator(header: str, where: str) -> str:
    outside_quotes = re.sub(r'"[^"]*"', "", header)
    for separator in _SEPARATORS:
        if separator in outside_quotes:
            return separator
    raise InputError(
        f"{where}: the header has one column only; at least two are needed, separated by "
        f"{', '.join(_SEPARATORS.values())}"
    )


def _header(cells: Sequence[str], where: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    names: list[str] = []
    found: list[str] = []
    for i, cell in enumerate(cells):
        match = _HEADER.fullmatch(cell.strip())
        name, unit = (match[1], (match[2] or "").strip()) if match else ("", "")
        if not match or not name:
            raise InputError(f"{where}: column {i + 1} is headed {cell!r}; expected is name [unit]")
        if name in names:
            raise InputError(f"{where}: duplicate column {name!r} (columns {names.index(name) + 1} and {i + 1})")
        names.append(name)
        found.append(unit)
    if all(re.fullmatch(r"[-+0-9.,eE]+", name) for name in names):
        raise InputError(f"{where}: the first line holds numbers; a header of name [unit] is needed")
    for name, unit in zip(names, found, strict=True):
        try:
            check_unit(unit)
            name == "time" or check_name(name)
        except InputError as error:
            raise InputError(f"{where}: {error}") from None
    return tuple(names), tuple(found)


def time_index(table: Table, name: str | None) -> int:
    if name is not None:
        return table.index(name)
    for usual in ("time", "t"):
        if matches := [i for i, known in enumerate(table.names) if known.lower() == usual]:
            exact = [i for i in matches if table.names[i] == usual]
            if len(exact or matches) > 1:
                raise InputError(
                    f"{table.where}:{table.header_line}: several columns are called {usual!r} in some case"
                )
            return (exact or matches)[0]
    try:
        units.factor(table.units[0], "s")
    except InputError:
        raise InputError(
            f"{table.where}:{table.header_line}: no time column; name one 'time [s]'{suggest('time', table.names)}"
        ) from None
    return 0


def seconds_of(table: Table, at: int, values: Array, given: str | None) -> Array:
    unit = table.units[at] or given or "s"
    try:
        factor = units.factor(unit, "s")
    except InputError as error:
        raise InputError(f"{table.where}:{table.header_line}: time column {table.names[at]!r}: {error}") from None
    return values if factor == 1 else np.asarray(values * float(factor), dtype=np.float64)
