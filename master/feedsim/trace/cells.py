"""Cells of a CSV file by column, and numbers of them.

Commas, semicolons or tabs between the columns, decimal commas with the latter two, a byte-order mark, UTF-16 and
Windows-1252, quotes. Where the table begins: layout.py; time stamps: stamps.py.
What is not clear is refused with its line, never guessed.
"""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np

from feedsim import units
from feedsim.errors import InputError, few
from feedsim.files.regular import content
from feedsim.files.spellings import spelled
from feedsim.trace.layout import Layout, layout_of, plain_number, titles
from feedsim.trace.stamps import INTERVAL_ADVICE, STAMP_FORMS, Stamps, epoch, is_stamp, like_a_stamp, stamps
from feedsim.trace.trace import MAX_MAGNITUDE, Array, check_name, check_unit, recorded, suggest

_HEADER = re.compile(r"(.*?)\s*(?:\[([^\[\]]*)\])?")
_ROUND = re.compile(r"(.*?[^\s])(\s*)\(([^()]*[^()0-9\s][^()]*)\)")
_PLAIN_COLUMN = re.compile(r"[0-9eE+\-.\n]*")
# Could mark thousands just as well as a decimal: 1,234 or 12,345, but not 0,125 or 1,25 or 1234,567.
_THOUSANDS = re.compile(r"[+-]?[1-9][0-9]{0,2}(?:,[0-9]{3})+")

TIME_NAMES = ("time", "t", "zeit", "temps")  # in any case
_SPREADSHEETS = (b"PK\x03\x04", b"\xd0\xcf\x11\xe0")  # .xlsx and .ods; .xls
MAX_DATED = 20  # columns of time stamps that are read; more are text
MAX_SHOWN, MAX_HEAD = 60, 1000  # characters: of a cell in a message; of the head of a column
_WINDOWS = "cp1252"  # of programs that know no UTF-8; it has no byte for five values, and digits are the same

Decimal = Literal[".", ","]
# Heads of the columns, and where they stand -> names and units; of a blank head a blank name. InputError.
Header = Callable[[Sequence[str], str], tuple[tuple[str, ...], tuple[str, ...]]]


@dataclass(frozen=True)
class Table:
    """Cells of a file by column, all of one length, with the line of every row; `where` is the file's name.

    numbers: (N, M) in place of the cells, where they were asked for and are nothing else. remarks: lines ahead of the
    header, which are no part of the table. dates: columns of time stamps, by their index: what was read of them, or why
    they cannot be read; their unit is s. notes: what a reader of the file should know.
    """

    where: str
    header_line: int
    names: tuple[str, ...]
    units: tuple[str, ...]
    columns: tuple[Sequence[str], ...]
    lines: Sequence[int]
    decimal_comma: bool  # may a comma stand in a number
    numbers: Array | None = None
    remarks: tuple[str, ...] = ()
    dates: Mapping[int, Stamps | InputError] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def head(self) -> str:
        """Where the columns are named, for messages: "file.csv:1"."""
        return f"{self.where}:{self.header_line}"

    @property
    def day(self) -> str:
        """Of the first row, ISO 8601, as time stamps have it; "" where they have none."""
        return next((read.day for read in self.dates.values() if isinstance(read, Stamps) and read.day), "")

    @cached_property
    def _indices(self) -> Mapping[str, int]:
        return {name: i for i, name in enumerate(self.names)}

    def index(self, name: str) -> int:
        """A column by its name, or by its path as a control has it: "/Nck/!SD/nckServoDataActCurr32 [u1; 1]"."""
        for text in (name, *titles([name])):
            if text in self._indices:
                return self._indices[text]
        raise InputError(f"{self.head}: no column {name!r}{suggest(name, self.names)}")

    def axis(self, given: str | None, usual: Sequence[str], unit: str) -> int:
        """The column over which the others run: `given`, else as of usual_column(). InputError: there is none."""
        if given is not None:
            return self.index(given)
        if (index := usual_column(self.names, self.units, usual, unit, self.head)) is not None:
            return index
        raise InputError(
            f"{self.head}: no {usual[0]} column; name one '{usual[0]} [{unit}]'{suggest(usual[0], self.names)}"
        )

    def factor(self, index: int, unit: str, what: str, usual: str) -> float:
        """From a column's unit to another one; without a unit it is in the usual one. InputError: of another kind."""
        try:
            return float(units.factor(self.units[index] or usual, unit))
        except InputError as error:
            raise InputError(f"{self.head}: {what} {self.names[index]!r}: {error}") from None

    def values(self, indices: Iterable[int]) -> dict[int, Array]:
        """Numbers of columns. InputError with line and column: a cell that is none, unclear decimal marks."""
        used = list(dict.fromkeys(indices))
        mark: Decimal = "."
        if self.decimal_comma:
            written = [self.columns[i] for i in used if i not in self.dates]
            mark = decimal_mark(written, self.lines, self.where)
        return {i: self._values(i, mark) for i in used}

    def _values(self, index: int, mark: Decimal) -> Array:
        read = self.dates.get(index)
        if read is None:
            return numbers(self.columns[index], mark, self.lines, self.where, self.names[index])
        if isinstance(read, InputError):
            raise read
        return read.seconds


def usual_column(
    names: Sequence[str], header_units: Sequence[str], usual: Sequence[str], unit: str, where: str
) -> int | None:
    """The column with one of the usual names in any case, else the first one where its unit fits; None: there is none.

    InputError: several are called so.
    """
    for name in usual:
        if matches := [i for i, known in enumerate(names) if known.lower() == name]:
            exact = [i for i in matches if names[i] == name]
            if len(exact or matches) > 1:
                raise InputError(f"{where}: several columns are called {name!r} in some case")
            return (exact or matches)[0]
    return 0 if names and fits(spelled(header_units[0]), unit) else None


def read_table(path: Path, split: Header | None = None, *, as_numbers: bool = False) -> Table:
    """Cells of a file under its header. InputError with file and line.

    Lines of other kinds may stand ahead of the header, as logs of drives and simulators have them, and a row of units
    below the names. A column without a name is not used.

    split: takes the heads of the columns apart into names and units; default: name [unit], each name once.
    as_numbers: numbers alone where nothing else stands in the file, many times faster than cells.
    """
    lines = io.StringIO(_text(path), newline="")
    try:
        layout = layout_of(lines, str(path))
    except csv.Error as error:
        raise InputError(f"{path}: the header: {error}") from None
    begin = lines.tell()
    read = _numbers(lines, layout) if as_numbers else None
    if read is not None:
        body_lines: Sequence[int] = range(layout.lines + 1, layout.lines + 1 + len(read))
        body: Sequence[Sequence[str]] = ()
    else:
        lines.seek(begin)
        body, body_lines = _rows(lines, layout, path)
    if not len(body_lines):
        raise InputError(f"{path}:{layout.header_line}: no rows below the header")
    header = _complete(layout, body)
    where = f"{path}:{layout.header_line}"
    heads = [cell.replace("[", "(").replace("]", ")") for cell in header] if layout.units and not split else header
    if layout.units:
        heads = [f"{name} [{unit}]" if unit else name for name, unit in zip(heads, layout.units, strict=True)]
    if long := next((cell for cell in heads if len(cell) > MAX_HEAD), None):
        raise InputError(
            f"{where}: a column is headed {shown(long)}, {len(long)} characters; allowed: up to {MAX_HEAD}"
        )
    names, header_units = (split or _header)(titles(heads), where)
    _check_widths(body, body_lines, header, layout, path)
    columns = [tuple(cell.strip() for cell in column) for column in zip(*body, strict=True)]
    used = [i for i, name in enumerate(names) if name]
    if len(used) < 2:
        raise InputError(f"{where}: {len(used)} columns have a name; at least two are needed, the time among them")
    ahead = f"{path}: the header is taken to be line {layout.header_line}; the lines ahead of it are not read"
    notes = [ahead] if layout.remarks else []
    notes += [
        f"{path}: column {i + 1} has no name; it is not used"
        for i, name in enumerate(names)
        if not name and (read is not None or any(columns[i]))
    ]
    columns = [columns[i] for i in used] if read is None else []
    table = Table(
        str(path), layout.header_line, tuple(names[i] for i in used), tuple(header_units[i] for i in used),
        tuple(columns), body_lines, layout.separator != "," and read is None,
        None if read is None else read[:, used], layout.remarks, {}, tuple(notes),
    )  # fmt: skip
    return _dated(table)


def _rows(lines: io.StringIO, layout: Layout, path: Path) -> tuple[list[list[str]], list[int]]:
    """Rows below the header, and their lines. InputError: quotes that do not fit."""
    reader = csv.reader(lines, delimiter=layout.separator, strict=True)
    rows: list[list[str]] = []
    numbers_of_lines: list[int] = []
    try:
        for row in reader:
            rows.append(row)
            numbers_of_lines.append(reader.line_num + layout.lines)
    except csv.Error as error:
        raise InputError(f"{path}:{reader.line_num + layout.lines}: {error}") from None
    while rows and not any(cell.strip() for cell in rows[-1]):
        rows.pop()
        numbers_of_lines.pop()
    return rows, numbers_of_lines


def _complete(layout: Layout, body: Sequence[Sequence[str]]) -> list[str]:
    """The header, with blank heads for columns that it leaves away: row names as R writes them, an end of every row."""
    header = layout.header
    if not body or any(len(row) != len(header) + 1 for row in body):
        return header
    if not any(row[-1].strip() for row in body):
        return [*header, ""]
    # With commas between columns decimal commas look the same, but for names of rows in words.
    named = all(row[0].strip() and not plain_number(row[0]) for row in body)
    return ["", *header] if layout.separator != "," or named else header


def _check_widths(
    body: Sequence[Sequence[str]], lines: Sequence[int], header: Sequence[str], layout: Layout, path: Path
) -> None:
    """InputError: a row that is empty, or of another length than the header."""
    for line, row in zip(lines, body, strict=False):
        if not any(cell.strip() for cell in row):
            raise InputError(f"{path}:{line}: the row is empty")
        if len(row) != len(header):
            hint = (
                "; decimal commas need semicolons or tabs between the columns"
                if layout.separator == "," and len(row) > len(header)
                else ""
            )
            raise InputError(f"{path}:{line}: {len(row)} values, the header has {len(header)} columns{hint}")


def _dated(table: Table) -> Table:
    """With its columns of time stamps as seconds, and those of milliseconds since 1970 from their first row on."""
    dates: dict[int, Stamps | InputError] = {}
    names, header_units = table.names, list(table.units)
    for i, column in enumerate(table.columns):
        if len(dates) < MAX_DATED and is_stamp(column[0]):
            try:
                dates[i] = stamps(column, table.lines, table.where, names[i])
            except InputError as error:
                dates[i] = error
            header_units[i] = "s"
    for i, name in enumerate(names):
        if (values := _whole(table, i)) is not None and not header_units[i] and (begin := epoch(name, values)):
            note = f"{table.where}: column {name!r} is taken as milliseconds since 1970; time counts from {begin} UTC"
            dates[i] = Stamps(values - values[0], note, begin[:10])
            header_units[i] = "ms"
    if not dates:
        return table
    if table.numbers is not None:
        for i, read in dates.items():
            assert isinstance(read, Stamps)
            table.numbers[:, i] = read.seconds
    notes = (*table.notes, *(read.note for read in dates.values() if isinstance(read, Stamps)))
    return replace(table, units=tuple(header_units), dates=dates, notes=notes)


def _whole(table: Table, index: int) -> Array | None:
    """Values of a column of whole numbers of 12 or 13 digits; None of any other."""
    if table.numbers is not None:
        return table.numbers[:, index]
    column = table.columns[index]
    if not (column[0].isdecimal() and column[-1].isdecimal() and 12 <= len(column[0]) <= 13):
        return None
    return np.array(column, dtype=np.float64) if all(cell.isdecimal() for cell in column) else None


def _numbers(lines: io.StringIO, layout: Layout) -> Array | None:
    """Rows of nothing but numbers with decimal points, one line a row; None of any other."""
    body = lines.read().rstrip("\r\n")
    if not body:
        return None
    try:
        values = np.loadtxt(io.StringIO(body), delimiter=layout.separator, comments=None, ndmin=2)
    except ValueError:
        return None
    # Empty lines, or a header that is not that of the rows.
    return values if values.shape == (body.count("\n") + 1, len(layout.header)) else None


def _text(path: Path) -> str:
    raw = content(path, pipes=True)
    if raw.startswith(_SPREADSHEETS):
        raise InputError(
            f"{path} is a spreadsheet, or another packed file; save its sheet as CSV UTF-8 (in Excel: File, "
            "Save As) with a header of name [unit]"
        )
    wide = raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        text = raw.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        try:
            text = raw.decode("utf-16" if wide else _WINDOWS)
        except UnicodeDecodeError:
            raise InputError(
                f"{path}:{line}: neither UTF-8 (byte 0x{raw[error.start]:02x}) nor Windows-1252; save the file as UTF-8"
            ) from None
    if "\0" in text:
        raise InputError(f"{path}:{text.count(chr(10), 0, text.index(chr(0))) + 1}: a zero byte; this is no text file")
    if not text.strip():
        raise InputError(f"{path}: the file is empty")
    return text


def _header(cells: Sequence[str], where: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    pairs = [_head(i, cell.strip(), where) for i, cell in enumerate(cells)]
    check_unlike([name for name, _ in pairs], where)
    for name, unit in pairs:
        try:
            check_unit(unit)
            name in ("", "time") or check_name(name)
        except InputError as error:
            raise InputError(f"{where}: {error}") from None
    return tuple(name for name, _ in pairs), tuple(unit for _, unit in pairs)


def _head(index: int, cell: str, where: str) -> tuple[str, str]:
    match = _HEADER.fullmatch(cell)
    if not match or (cell and not match[1]):
        raise InputError(f"{where}: column {index + 1} is headed {shown(cell)}; expected is name [unit]")
    if match[2] is None:  # no square brackets; "x (mm) []" says that there is no unit
        return round_unit(match[1]) or (match[1], "")
    return match[1], match[2].strip()


def check_unlike(names: Sequence[str], where: str) -> None:
    """InputError: names of columns that are there twice, or numbers in their place."""
    seen: dict[str, int] = {}
    for i, name in enumerate(names):
        if name and (first := seen.setdefault(name, i)) != i:
            raise InputError(f"{where}: duplicate column {shown(name)} (columns {first + 1} and {i + 1})")
    if seen and all(re.fullmatch(r"[-+0-9.,eE]+", name) for name in seen):
        raise InputError(f"{where}: the first line holds numbers; a header of name [unit] is needed")


def round_unit(cell: str) -> tuple[str, str] | None:
    """Name and unit of a head such as "angle (deg)"; None where what stands in round brackets is no unit.

    In "Speed(A)" they may belong to the name: without a blank before them, only a time has its unit there.
    """
    match = _ROUND.fullmatch(cell)
    if not match or not (match[2] or match[1].lower() in TIME_NAMES):
        return None
    try:
        units.unit(match[3])
    except InputError:
        return None
    return match[1], match[3].strip()


def fits(unit: str, wanted: str) -> bool:
    """Whether a unit is of the kind of the wanted one."""
    try:
        units.factor(unit or "1", wanted)
    except InputError:
        return False
    return True


def shown(cell: str) -> str:
    """A cell for a message."""
    return repr(cell if len(cell) <= MAX_SHOWN else f"{cell[:MAX_SHOWN]}...")


def instead_of(cell: str) -> str:
    """What to do about a cell that is no number, where it looks like a date."""
    return f"; {STAMP_FORMS}; or {INTERVAL_ADVICE}" if like_a_stamp(cell) else ""


def decimal_mark(columns: Sequence[Sequence[str]], lines: Sequence[int], where: str) -> Decimal:
    """Decimal mark of all cells together. `lines` are the file's line numbers of the rows.

    InputError with the line: both marks occur, or every comma may stand for thousands as well.
    """
    unclear: tuple[int, str] | None = None
    comma: tuple[int, str] | None = None
    point: tuple[int, str] | None = None
    for column in columns:
        for line, cell in zip(lines, column, strict=True):
            if "," in cell:
                if "." in cell or cell.count(",") > 1:
                    raise InputError(f"{where}:{line}: {cell!r} marks thousands; write numbers without them")
                if not _THOUSANDS.fullmatch(cell):
                    comma = comma or (line, cell)
                else:
                    unclear = unclear or (line, cell)
            elif "." in cell:
                point = point or (line, cell)
    if point and (other := comma or unclear):
        first, second = sorted((point, other))
        raise InputError(
            f"{where}:{second[0]}: {second[1]!r}, but {first[1]!r} in line {first[0]}; decimal point and comma mixed"
        )
    if unclear and not comma:
        number = unclear[1]
        raise InputError(
            f"{where}:{unclear[0]}: {number!r} may mean {number.replace(',', '.')} or {number.replace(',', '')}, and "
            "no other number in the file shows which; write it with a decimal point"
        )
    return "," if comma else "."


def numbers(cells: Sequence[str], decimal: Decimal, lines: Sequence[int], where: str, name: str) -> Array:
    """Values of a column. InputError with line and column name: an empty cell, text, NaN or infinity."""
    plain = [cell.replace(",", ".") for cell in cells] if decimal == "," else list(cells)
    if _PLAIN_COLUMN.fullmatch("\n".join(plain)):
        try:
            values = np.array(plain, dtype=np.float64)
        except ValueError:
            pass
        else:
            if not recorded(values)[1].any():
                return values
    for line, cell, text in zip(lines, cells, plain, strict=True):
        if not cell:
            raise InputError(f"{where}:{line}: no value in column {name!r}")
        if cell.lower().lstrip("+-") in ("nan", "inf", "infinity", "#n/a", "n/a", "null", "none"):
            raise InputError(f"{where}:{line}: {cell!r} in column {name!r}; every value must be a finite number")
        if not plain_number(text):
            raise InputError(f"{where}:{line}: {shown(cell)} in column {name!r} is no number{instead_of(cell)}")
        if abs(float(text)) > MAX_MAGNITUDE:
            raise InputError(
                f"{where}:{line}: {few([cell], 1)} in column {name!r} is too large; allowed: up to {MAX_MAGNITUDE:g}"
            )
    return np.array([float(text) for text in plain], dtype=np.float64)
