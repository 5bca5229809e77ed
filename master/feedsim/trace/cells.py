"""Cells of a CSV file by column, and numbers of them.

Commas, semicolons or tabs between the columns, decimal commas with the latter two, a byte-order mark, UTF-16 and
Windows-1252, quotes.
What is not clear is refused with its line, never guessed.
"""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np

from feedsim import units
from feedsim.errors import InputError, few
from feedsim.files.regular import content
from feedsim.files.spellings import known_unit
from feedsim.trace.trace import MAX_MAGNITUDE, Array, check_name, check_unit, recorded, suggest

_HEADER = re.compile(r"(.*?)\s*(?:\[([^\[\]]*)\])?")
_ROUND = re.compile(r"(.*?[^\s])(\s*)\(([^()]*[^()0-9\s][^()]*)\)")
_SEPARATORS = {"\t": "tab", ";": "semicolon", ",": "comma"}
_PLAIN = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_PLAIN_COLUMN = re.compile(r"[0-9eE+\-.\n]*")
# Could mark thousands just as well as a decimal: 1,234 or 12,345, but not 0,125 or 1,25 or 1234,567.
_THOUSANDS = re.compile(r"[+-]?[1-9][0-9]{0,2}(?:,[0-9]{3})+")

TIME_NAMES = ("time", "t")  # in any case
LONGEST_UNIT = 60  # characters of a name or a unit in two rows of header
MOST_REMARKS = 65536  # characters within which a header is looked for
_SPREADSHEETS = (b"PK\x03\x04", b"\xd0\xcf\x11\xe0")  # .xlsx and .ods; .xls
_WINDOWS = "cp1252"  # of programs that know no UTF-8; it has no byte for five values, and digits are the same

Decimal = Literal[".", ","]
# Heads of the columns, and where they stand -> names and units; InputError.
Header = Callable[[Sequence[str], str], tuple[tuple[str, ...], tuple[str, ...]]]


@dataclass(frozen=True)
class Table:
    """Cells of a file by column, all of one length, with the line of every row; `where` is the file's name.

    numbers: (N, M) in place of the cells, where they were asked for and are nothing else. remarks: lines ahead of the
    header, which are no part of the table.
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

    @property
    def head(self) -> str:
        """Where the columns are named, for messages: "file.csv:1"."""
        return f"{self.where}:{self.header_line}"

    def index(self, name: str) -> int:
        if name in self.names:
            return self.names.index(name)
        raise InputError(f"{self.head}: no column {name!r}{suggest(name, self.names)}")

    def axis(self, given: str | None, usual: Sequence[str], unit: str) -> int:
        """The column over which the others run: `given`, else one of the usual names in any case, else the first one
        where its unit fits. InputError: there is none, or several."""
        if given is not None:
            return self.index(given)
        for name in usual:
            if matches := [i for i, known in enumerate(self.names) if known.lower() == name]:
                exact = [i for i in matches if self.names[i] == name]
                if len(exact or matches) > 1:
                    raise InputError(f"{self.head}: several columns are called {name!r} in some case")
                return (exact or matches)[0]
        if fits(self.units[0], unit):
            return 0
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
            mark = decimal_mark([self.columns[i] for i in used], self.lines, self.where)
        return {i: numbers(self.columns[i], mark, self.lines, self.where, self.names[i]) for i in used}


def read_table(
    path: Path, split: Header | None = None, *, as_numbers: bool = False, remarks_ahead: bool = False
) -> Table:
    """Cells of a file under its header. InputError with file and line.

    split: takes the heads of the columns apart into names and units; default: name [unit], each name once.
    as_numbers: numbers alone where nothing else stands in the file, many times faster than cells.
    remarks_ahead: lines of other kinds may stand ahead of the header, as logs of drives have them.
    """
    lines = io.StringIO(_text(path), newline="")
    first = lines.readline()
    separator = ""
    header_line, remarks = 1, 0
    if match := re.fullmatch(r"sep=(.)\s*", first):  # a spreadsheet's own hint
        separator, first, header_line = match[1], lines.readline(), 2
    elif remarks_ahead:
        remarks = _remarks(lines.getvalue())
        for _ in range(remarks):
            first, header_line = lines.readline(), header_line + 1
    separator = separator or _separator(first, f"{path}:{header_line}")
    if as_numbers and (table := _numbers(path, first, header_line, lines, separator, split or _header)) is not None:
        return table
    lines.seek(0)
    ahead = tuple(lines.readline().rstrip("\r\n") for _ in range(remarks))  # of any form
    reader = csv.reader(lines, delimiter=separator, strict=True)
    rows: list[list[str]] = [[] for _ in ahead]
    numbers_of_lines: list[int] = list(range(1, remarks + 1))
    try:
        for row in reader:
            rows.append(row)
            numbers_of_lines.append(reader.line_num + remarks)
    except csv.Error as error:
        raise InputError(f"{path}:{reader.line_num + remarks}: {error}") from None
    while len(rows) > header_line and not any(cell.strip() for cell in rows[-1]):
        rows.pop()
        numbers_of_lines.pop()
    if len(rows) < header_line:
        raise InputError(f"{path}:{header_line}: no rows below the header")
    header, body, body_lines = rows[header_line - 1], rows[header_line:], numbers_of_lines[header_line:]
    if not header[-1].strip() and all(len(row) == len(header) and not row[-1].strip() for row in body):
        header, body = header[:-1], [row[:-1] for row in body]  # every line ends with a separator
    above = next(csv.reader(ahead[-1:], delimiter=separator), [])
    if (both := _names_above_units(above, header)) is not None:
        names, header_units = _header([f"{name} [{unit}]" for name, unit in both], f"{path}:{header_line - 1}")
        header_line, ahead = header_line - 1, ahead[:-1]
    else:
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
    return Table(str(path), header_line, names, header_units, cells, tuple(body_lines), separator != ",", None, ahead)


def _names_above_units(above: Sequence[str], header: Sequence[str]) -> list[tuple[str, str]] | None:
    """Names and units where a row of names stands above a row of units; None where there are no such two rows."""
    if len(above) < len(header) or not all(cell.strip() for cell in above[: len(header)]):
        return None
    units_below = [cell.strip().strip("[]()").strip() for cell in header]
    if any(len(cell) > LONGEST_UNIT for cell in (*units_below, *above)):
        return None
    if not any(units_below) or not all(name in ("", "-") or known_unit(name) for name in units_below):
        return None
    if any(name in TIME_NAMES for name in units_below):
        return None  # names that are units as well: t, m
    if any(_is_number(cell) or known_unit(cell.strip()) for cell in above[: len(header)] if len(cell.strip()) > 1):
        return None
    names = [cell.strip().replace("[", "(").replace("]", ")") for cell in above]
    return [(name, "" if unit == "-" else unit) for name, unit in zip(names, units_below, strict=False)]


def _remarks(text: str) -> int:
    """How many lines stand ahead of the header: the first one with a row of as many cells, a number among them, below
    it, and none in itself; 0 where there is no such line."""
    head = text[:MOST_REMARKS].splitlines()
    for k, (line, below) in enumerate(pairwise(head)):
        for separator in _SEPARATORS:
            cells, values = (next(csv.reader([name], delimiter=separator), []) for name in (line, below))
            numbers_below = sum(_is_number(cell) for cell in values)
            if len(cells) == len(values) > 1 and numbers_below > len(values) / 2 and not any(map(_is_number, cells)):
                return k
    return 0


def _is_number(cell: str) -> bool:
    return _PLAIN.fullmatch(cell.strip().replace(",", ".")) is not None


def _numbers(path: Path, head: str, header_line: int, rest: io.StringIO, separator: str, split: Header) -> Table | None:
    """A file of nothing but numbers with decimal points, one line a row; None for any other."""
    cells = [] if head.count('"') % 2 else next(csv.reader([head], delimiter=separator))
    body = rest.read().rstrip("\r\n")
    if not body or not cells:
        return None
    try:
        values = np.loadtxt(io.StringIO(body), delimiter=separator, comments=None, ndmin=2)
    except ValueError:
        return None
    if values.shape != (body.count("\n") + 1, len(cells)):
        return None  # empty lines, or a header that is not that of the rows
    names, header_units = split(cells, f"{path}:{header_line}")
    lines = range(header_line + 1, header_line + 1 + len(values))
    return Table(str(path), header_line, names, header_units, (), lines, False, values)


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
    result: list[str] = []
    for i, cell in enumerate(cells):
        match = _HEADER.fullmatch(cell.strip())
        name, unit = (match[1], (match[2] or "").strip()) if match else ("", "")
        if match and match[2] is None:  # no square brackets; "x (mm) []" says that there is no unit
            name, unit = round_unit(name) or (name, "")
        if not match or not name:
            raise InputError(f"{where}: column {i + 1} is headed {cell!r}; expected is name [unit]")
        if name in names:
            raise InputError(f"{where}: duplicate column {name!r} (columns {names.index(name) + 1} and {i + 1})")
        names.append(name)
        result.append(unit)
    if all(re.fullmatch(r"[-+0-9.,eE]+", name) for name in names):
        raise InputError(f"{where}: the first line holds numbers; a header of name [unit] is needed")
    for name, unit in zip(names, result, strict=True):
        try:
            check_unit(unit)
            name == "time" or check_name(name)
        except InputError as error:
            raise InputError(f"{where}: {error}") from None
    return tuple(names), tuple(result)


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
        if not _PLAIN.fullmatch(text):
            raise InputError(f"{where}:{line}: {cell!r} in column {name!r} is no number")
        if abs(float(text)) > MAX_MAGNITUDE:
            raise InputError(
                f"{where}:{line}: {few([cell], 1)} in column {name!r} is too large; allowed: up to {MAX_MAGNITUDE:g}"
            )
    return np.array([float(text) for text in plain], dtype=np.float64)
