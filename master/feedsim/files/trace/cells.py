"""Cells of a CSV file by column, numbers of them, and how a trace's are written.

Commas, semicolons or tabs between the columns, decimal commas with the latter two, a byte-order mark, UTF-16 and
Windows-1252, quotes. Where the table begins: layout.py; time stamps: stamps.py.
What is not clear is refused with its line, never guessed.
"""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, date, datetime
from functools import cached_property
from pathlib import Path
from typing import Literal, TextIO

import numpy as np
from pydantic_core import to_json

from feedsim.files.source import content
from feedsim.files.trace.trace import (
    MAX_MAGNITUDE,
    Array,
    Trace,
    check_name,
    check_unit,
    recordable_values,
    suggest_name,
)
from feedsim.foundation import units
from feedsim.foundation.errors import Finding, InputError, shorten_list
from feedsim.foundation.units import NUMBER, known_unit, spell_unit

# --- Time stamps -> seconds since the first one: dates as loggers and gateways write them, times of day,
#     milliseconds
# since 1970.
#
# The order of day, month and year is taken from the dates themselves; where they leave it open, they are refused. Local
# time that is set back in autumn is refused; times of day without a date go on over midnight.


DAY, HOUR = 86400, 3600  # s
INTERVAL_ADVICE = "give time: {interval: 2 ms} in a mapping file, with the interval of the rows"
STAMP_FORMS = "time stamps are read such as 2025-03-04 10:00:00.002, 2025-03-04T10:00:00Z, 04.03.2025 10:00:00,002"
# Milliseconds since 1970 of the years 2000 to 2100, and the steps [ms] up to which whole numbers without a unit are
# such: a counter of us or ns makes longer ones.
EPOCH, MAX_EPOCH_STEP = (9.46e11, 4.1e12), 100.0
_EPOCH_NAME = re.compile(r"time|date|datum|zeit|stamp|epoch|unix|^t$", re.IGNORECASE)
_MONTHS = {name: k // 3 + 1 for k in range(0, 36, 3) if (name := "janfebmaraprmayjunjulaugsepoctnovdec"[k : k + 3])}
_STAMP = re.compile(
    r"""(?:(?P<date>\d{1,4}([-/.])(?:\d{1,2}|[A-Za-z]{3})\2\d{1,4})(?:T|,?\s+))?
        (?P<hour>\d{1,2}):(?P<minute>[0-5]\d):(?P<second>[0-5]\d|60)(?:[.,:](?P<part>\d{1,9}))?
        (?:\s*(?P<half>[AaPp])\.?[Mm]\.?)?
        (?:\s*(?P<zone>[Zz]|UTC|GMT|[+-]\d{2}(?::?\d{2})?))?""",
    re.VERBOSE | re.ASCII,
)
Order = Callable[[str, str, str], date]  # parts of a date -> the day; ValueError, KeyError where it is none


@dataclass(frozen=True, eq=False)
class Stamps:
    """Seconds since the first stamp, and what a reader of the file should know.

    day: of the first stamp, ISO 8601; "" where the stamps have no date, or it is not clear.
    """

    seconds: Array
    note: str
    day: str = ""


def is_stamp(cell: str) -> bool:
    """Whether a cell has the form of a time stamp."""
    return _STAMP.fullmatch(cell) is not None


def like_a_stamp(cell: str) -> bool:
    """Whether a cell that is no number looks like a date or a time of day, known here or not."""
    return re.search(r"\d[-:/.T]\d\d?[-:/.]\d", cell) is not None


def stamps(cells: Sequence[str], lines: Sequence[int], where: str, name: str) -> Stamps:
    """Seconds of a column of stamps. InputError with the line: a cell that is none, time that stands still or runs
    back, dates whose day and month are not clear."""
    clocks = np.empty(len(cells))
    parts = np.empty(len(cells))
    days, zones = [], []
    for row, cell in enumerate(cells):
        match = _STAMP.fullmatch(cell)
        if match is None or (hour := _hour(match)) is None:
            raise InputError(f"{where}:{lines[row]}: {cell!r} in column {name!r} is no time stamp; {STAMP_FORMS}")
        clocks[row] = 3600 * hour + 60 * int(match["minute"]) + int(match["second"])
        parts[row] = float(f"0.{match['part']}") if match["part"] else 0.0
        days.append(match["date"])
        zones.append(match["zone"])
    unlike = next((row for row in range(1, len(cells)) if bool(zones[row]) != bool(zones[0])
                   or bool(days[row]) != bool(days[0])), None)  # fmt: skip
    if unlike is not None:
        raise InputError(
            f"{where}:{lines[unlike]}: {cells[unlike]!r} in column {name!r}, but {cells[0]!r} in line {lines[0]}; "
            "date and time zone are needed in all stamps or in none"
        )
    offsets = {zone: _offset(zone) for zone in set(zones)}
    clocks -= np.array([offsets[zone] for zone in zones])
    day = ""
    if days[0]:
        numbers = _number_dates(days, where, lines[0], name)
        whole = DAY * np.array([numbers[day] - numbers[days[0]] for day in days], dtype=np.float64) + clocks
        day = _first_day(days, numbers)
    else:  # half a day back is midnight
        whole = clocks + DAY * np.cumsum(np.diff(clocks, prepend=clocks[0]) < -DAY / 2)
    seconds = (whole - whole[0]) + (parts - parts[0])
    note = f"{where}: time counts from the first stamp in column {name!r}, {cells[0]}"
    if (row := _check(seconds, cells, lines, where, name)) and not zones[0]:
        note += f"; in line {lines[row]} the clock goes on by an hour, as where summer time begins"
    return Stamps(seconds, note, day)


def _first_day(days: Sequence[str], numbers: Mapping[str, int]) -> str:
    """The first date, ISO 8601; "" where it alone does not show the order of its parts."""
    if len(numbers) > 1:
        return date.fromordinal(numbers[days[0]]).isoformat()
    possible = set()
    for order in _orders(days[0]):
        with suppress(ValueError, KeyError):
            possible.add(order(*re.split("[-/.]", days[0])))
    return possible.pop().isoformat() if len(possible) == 1 else ""


def _hour(match: re.Match[str]) -> int | None:
    hour = int(match["hour"])
    if not match["half"]:
        return hour if hour < 24 else None
    return hour % 12 + (12 if match["half"] in "pP" else 0) if 1 <= hour <= 12 else None


def _offset(zone: str | None) -> int:
    """Seconds that a time zone is ahead of UTC."""
    if not zone or zone[0] not in "+-":
        return 0
    digits = zone[1:].replace(":", "").ljust(4, "0")
    return (1 if zone[0] == "+" else -1) * (3600 * int(digits[:2]) + 60 * int(digits[2:]))


def _number_dates(days: Sequence[str], where: str, line: int, name: str) -> Mapping[str, int]:
    """Date -> its number. Of one date any will do; of several the order of their parts must show."""
    changes = [row for row in range(1, len(days)) if days[row] != days[row - 1]]
    if not changes:
        return {days[0]: 0}
    dates = list(dict.fromkeys(days))
    possible: list[dict[str, int]] = []
    for order in _orders(dates[0]):
        try:
            numbers = {text: order(*re.split("[-/.]", text)).toordinal() for text in dates}
        except (ValueError, KeyError):
            continue
        if all(numbers[days[row]] >= numbers[days[row - 1]] for row in changes):
            possible.append(numbers)
    # A record that goes on over midnight goes to the next day.
    next_day = [n for n in possible if all(n[days[row]] - n[days[row - 1]] == 1 for row in changes)]
    if possible and all(n == possible[0] for n in possible):
        return possible[0]
    if len(next_day) == 1:
        return next_day[0]
    example = f"{dates[0]!r} and {dates[1]!r} in column {name!r}"
    if possible:
        raise InputError(
            f"{where}:{line}: {example}: the day may stand ahead of the month or behind it; write dates as "
            f"2025-03-04, or {INTERVAL_ADVICE}"
        )
    raise InputError(
        f"{where}:{line}: {example} are no dates of which one follows the other; {STAMP_FORMS}; or {INTERVAL_ADVICE}"
    )


def _orders(text: str) -> list[Order]:
    """Orders that the parts of a date may have."""
    first, middle, last = re.split("[-/.]", text)
    if len(first) == 4:
        return [lambda y, m, d: date(int(y), int(m), int(d))]
    by_day: Order = lambda d, m, y: date(_year(y), int(m), int(d))  # noqa: E731
    by_month: Order = lambda m, d, y: date(_year(y), int(m), int(d))  # noqa: E731
    if middle.isalpha():
        return [lambda d, m, y: date(_year(y), _MONTHS[m.lower()], int(d))]
    if "." in text:
        return [by_day]
    by_year: Order = lambda y, m, d: date(_year(y), int(m), int(d))  # noqa: E731
    return [by_day, by_month, *([by_year] if len(last) == 2 else [])]


def _year(text: str) -> int:
    return int(text) if len(text) > 2 else 2000 + int(text)


def _check(seconds: Array, cells: Sequence[str], lines: Sequence[int], where: str, name: str) -> int:
    """The row before which the clock was set forward by an hour, 0: none. InputError: time that does not increase."""
    steps = np.diff(seconds)
    usual = max(1.0, 2 * float(np.quantile(steps, 0.5, method="lower"))) if steps.size else 0.0
    if not (wrong := np.flatnonzero(steps <= 0)).size:
        forward = np.flatnonzero(np.abs(steps - HOUR) <= usual) if usual < HOUR / 2 else wrong
        return int(forward[0]) + 1 if forward.size else 0
    row = int(wrong[0]) + 1
    what = f"{where}:{lines[row]}: {cells[row]!r} in column {name!r} follows {cells[row - 1]!r}"
    if steps[row - 1] == 0:
        raise InputError(f"{what}: stamps are too coarse to tell rows apart; {INTERVAL_ADVICE}")
    if abs(steps[row - 1] + HOUR) <= usual:
        raise InputError(
            f"{what}: the clock was set back by an hour; give stamps with their time zone, or {INTERVAL_ADVICE}"
        )
    raise InputError(f"{what}; time must increase. Put rows in order, or {INTERVAL_ADVICE}")


def epoch(name: str, values: Array) -> str:
    """The instant of the first row where a column without a unit has milliseconds since 1970; "" where it has not."""
    low, high = EPOCH
    if len(values) < 2 or not _EPOCH_NAME.search(name) or not (low <= values[0] <= high and low <= values[-1] <= high):
        return ""
    steps = np.diff(values)
    if np.any(values != np.floor(values)) or steps.min() < 0 or not 0 < np.median(steps) <= MAX_EPOCH_STEP:
        return ""
    return datetime.fromtimestamp(values[0] / 1000, UTC).replace(tzinfo=None).isoformat(" ", "milliseconds")


# --- Where the table of a text file begins: lines ahead of its header, what separates its columns, and their heads ----
# The header is the first line with a row of as many cells below it, most of them numbers. Of two rows, names above
# units, the names are the header.


_SEPARATORS = {"\t": "tab", ";": "semicolon", ",": "comma"}
_NO_NUMBERS = ("nan", "inf", "infinity")  # which stand in place of one
# A signal of a SINUMERIK by its path: "+/Nck/!SD/nckServoDataActPos1stEnc64 [u1, 2]", of unit 1, axis 2.
_SIGNAL = re.compile(r"(?P<path>.*?)\s*\[u\d+\s*[,;]\s*(?P<axis>\d+)\](?P<rest>.*)")
LONGEST_UNIT = 60  # characters of a name or a unit in two rows of header
HEADER_TEXT = 1 << 24  # characters within which a header ends
MOST_REMARKS = 65536  # characters within which a header is looked for
UNITS_OF_TIME = ("time", "t")  # names of the time that are units as well


@dataclass(frozen=True)
class Layout:
    """How a table begins.

    separator: between columns. header: heads of the columns. units: of a row of their own; empty where there is none.
    header_line: of the names, from 1. lines: how many stand ahead of the rows. remarks: lines ahead of the header.
    """

    separator: str
    header: list[str]
    units: tuple[str, ...]
    header_line: int
    lines: int
    remarks: tuple[str, ...] = ()


def layout_of(lines: io.StringIO, where: str) -> Layout:
    """Layout of a text, which is then read up to its first row. InputError: one column. csv.Error: a cell too long."""
    ahead, separator = _find_header(lines)
    lines.seek(0)
    remarks = [lines.readline().rstrip("\r\n") for _ in range(ahead)]
    first, count = lines.readline(), ahead + 1
    if match := re.fullmatch(r"sep=(.)\s*", first):  # a spreadsheet's own hint
        separator, first, count = match[1], lines.readline(), count + 1
    header_line = count
    while first.count('"') % 2 and (more := lines.readline()):
        first, count = first + more, count + 1
    separator = separator or _separator(first, f"{where}:{header_line}")
    header = split_cells(first, separator)
    units: tuple[str, ...] = ()
    if remarks and (both := _names_above_units(split_cells(remarks[-1], separator), header)) is not None:
        header, units = both
        header_line, remarks = header_line - 1, remarks[:-1]
    if header and header[0].lstrip().startswith("#"):  # a header that is marked as a remark
        header[0] = header[0].lstrip(" #")
    return Layout(separator, header, units, header_line, count, tuple(remarks))


def _find_header(lines: io.StringIO) -> tuple[int, str]:
    """How many lines stand ahead of the header, and what separates its columns; 0 and "" where no line is one."""
    above, line, below = "", lines.readline(), lines.readline()
    ahead = 0
    while below and (not ahead or lines.tell() < MOST_REMARKS):
        for separator in _SEPARATORS:
            if separator in line and separator in below and _is_header(above, line, below, separator):
                return ahead, separator
        above, line, below = line, below, lines.readline()
        ahead += 1
    return 0, ""


def _is_header(above: str, line: str, below: str, separator: str) -> bool:
    """Whether a line has no numbers, and a row of as many cells, most of them numbers, below it."""
    try:
        cells, values = split_cells(line, separator), split_cells(below, separator)
    except csv.Error:
        return False
    if len(cells) != len(values) or 2 * sum(map(_is_value, values)) <= len(values):
        return False
    if 2 * sum(not cell.strip() for cell in cells) > len(cells):
        return False
    if not any(map(_is_value, cells)):
        return True
    # A unit of 1 is one.
    return _names_above_units(split_cells(above, separator), cells) is not None


def _is_value(cell: str) -> bool:
    cell = cell.strip()
    return plain_number(cell.replace(",", ".")) or cell.lower().lstrip("+-") in _NO_NUMBERS or is_stamp(cell)


def plain_number(cell: str) -> bool:
    """Whether a cell is a number with a decimal point, or without one."""
    return re.fullmatch(NUMBER, cell.strip()) is not None


def split_cells(line: str, separator: str) -> list[str]:
    """Cells of a line; a separator within square brackets is none. csv.Error: a cell too long."""
    result: list[list[str]] = []
    depth = 0
    for cell in next(csv.reader([line], delimiter=separator), []):
        if depth:
            result[-1].append(cell)
        else:
            result.append([cell])
        depth = max(0, depth + cell.count("[") - cell.count("]"))
    if depth:  # a bracket that does not end
        return [cell for part in result for cell in part]
    return [separator.join(part) for part in result]


def named_columns(rows: Sequence[Sequence[str]]) -> list[list[str]]:
    """Rows of a table without its columns whose head, in the first row, is blank; rows of other lengths as they are."""
    named = [i for i, head in enumerate(rows[0]) if head.strip()] if rows else []
    if not named or len(named) == len(rows[0]):
        return [list(row) for row in rows]
    return [[row[i] for i in named] if len(row) == len(rows[0]) else list(row) for row in rows]


def duplicate_names(names: Iterable[str]) -> list[str]:
    """Names that are there more than once, each once."""
    return [name for name, count in Counter(names).items() if count > 1]


def titles(heads: Sequence[str]) -> list[str]:
    """Heads in which signals of a SINUMERIK have the name of the signal and the number of the axis, without the path
    where they differ without it: "nckServoDataActPos1stEnc64 2"."""
    signals = {k: match for k, head in enumerate(heads) if (match := _SIGNAL.fullmatch(head.strip()))}
    short = {(match["path"].rpartition("/")[2], match["axis"]) for match in signals.values()}
    result = list(heads)
    for k, match in signals.items():
        path = match["path"].lstrip("+")
        signal = path.rpartition("/")[2] if len(short) == len(signals) else path
        result[k] = f"{signal} {match['axis']}{match['rest']}"
    return result


def _names_above_units(above: Sequence[str], header: Sequence[str]) -> tuple[list[str], tuple[str, ...]] | None:
    """Names and units where a row of names stands above a row of units; None where there are no such two rows."""
    names = [cell.strip() for cell in above[: len(header)]]
    if len(names) < len(header) or not any(names):
        return None
    cells = [cell.strip() for cell in header]
    if any(len(cell) > LONGEST_UNIT for cell in (*cells, *above)):
        return None
    below = [cell.strip("[]()").strip() for cell in cells]
    if not any(below) or any(name in UNITS_OF_TIME for name in below):
        return None
    bracketed = [cell[:1] + cell[-1:] in ("[]", "()") for cell in cells]
    known = [unit in ("", "-") or known_unit(unit) for unit in below]
    if not any(known) or not all(map(max, known, bracketed)):
        return None
    if any(unit and not name for name, unit in zip(names, below, strict=True)):
        return None
    if any(_is_value(name) or known_unit(name) for name in names if len(name) > 1):
        return None
    return names, tuple("" if unit == "-" else unit for unit in below)


def _separator(header: str, where: str) -> str:
    outside = re.sub(r'"[^"]*"|\[[^\[\]]*\]', "", header)
    for separator in _SEPARATORS:
        if separator in outside:
            return separator
    raise InputError(
        f"{where}: the header has one column only; at least two are needed, separated by "
        f"{', '.join(_SEPARATORS.values())}"
    )


# --- Cells of a CSV file by column, and numbers of them ---------------------------------------------------------------


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
    notes: tuple[Finding, ...] = ()

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
        raise InputError(f"{self.head}: no column {name!r}{suggest_name(name, self.names)}")

    def axis(self, given: str | None, usual: Sequence[str], unit: str) -> int:
        """The column over which the others run: `given`, else as of usual_column(). InputError: there is none."""
        if given is not None:
            return self.index(given)
        if (index := usual_column(self.names, self.units, usual, unit, self.head)) is not None:
            return index
        raise InputError(
            f"{self.head}: no {usual[0]} column; name one '{usual[0]} [{unit}]'{suggest_name(usual[0], self.names)}"
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
        if read is None and self.numbers is not None:
            return self.numbers[:, index].copy()
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
    return 0 if names and is_of_kind(spell_unit(header_units[0]), unit) else None


def read_table(path: Path, split: Header | None = None, *, as_numbers: bool = False) -> Table:
    """Cells of a file under its header. InputError with file and line.

    Lines of other kinds may stand ahead of the header, as logs of drives and simulators have them, and a row of units
    below the names. A column without a name is not used.

    split: takes the heads of the columns apart into names and units; default: name [unit], each name once.
    as_numbers: numbers alone where nothing else stands in the file, many times faster than cells.
    """
    text = _text(path)
    lines = io.StringIO(text[:HEADER_TEXT], newline="")
    try:
        layout = layout_of(lines, str(path))
    except csv.Error as error:
        raise InputError(f"{path}: the header: {error}") from None
    below = text[lines.tell() :]
    del text, lines
    read = _numbers(below, layout) if as_numbers else None
    if read is not None:
        body_lines: Sequence[int] = range(layout.lines + 1, layout.lines + 1 + len(read))
        body: Sequence[Sequence[str]] = ()
    else:
        body, body_lines = _rows(_lines_of(below), layout, path)
    del below
    if not len(body_lines):
        raise InputError(f"{path}:{layout.header_line}: no rows below the header")
    header = _complete(layout, body)
    where = f"{path}:{layout.header_line}"
    heads = [cell.replace("[", "(").replace("]", ")") for cell in header] if layout.units and not split else header
    if layout.units:
        heads = [f"{name} [{unit}]" if unit else name for name, unit in zip(heads, layout.units, strict=True)]
    if long := next((cell for cell in heads if len(cell) > MAX_HEAD), None):
        raise InputError(
            f"{where}: a column is headed {cell_text(long)}, {len(long)} characters; allowed: up to {MAX_HEAD}"
        )
    names, header_units = (split or _header)(titles(heads), where)
    _check_widths(body, body_lines, header, layout, path)
    columns = [tuple(cell.strip() for cell in column) for column in zip(*body, strict=True)]
    used = [i for i, name in enumerate(names) if name]
    if len(used) < 2:
        raise InputError(f"{where}: {len(used)} columns have a name; at least two are needed, the time among them")
    ahead = f"{path}: the header is taken to be line {layout.header_line}; the lines ahead of it are not read"
    notes = [Finding("header-below-remarks", "doubt", ahead, where)] if layout.remarks else []
    notes += [
        Finding("column-without-name", "doubt", f"{path}: column {i + 1} has no name; it is not used", where)
        for i, name in enumerate(names)
        if not name and (read is not None or any(columns[i]))
    ]
    columns = [columns[i] for i in used] if read is None else []
    table = Table(
        str(path), layout.header_line, tuple(names[i] for i in used), tuple(header_units[i] for i in used),
        tuple(columns), body_lines, layout.separator != "," and read is None,
        None if read is None else read[:, used], layout.remarks, {}, tuple(notes),
    )  # fmt: skip
    return _convert_dates(table)


def read_finite_table(path: Path) -> Table:
    """As read_table, with numbers where the file holds nothing but finite ones: cells take 20 times their memory."""
    table = read_table(path, as_numbers=True)
    if table.numbers is None or not recordable_values(table.numbers)[1].any():
        return table
    return read_table(path)


def _lines_of(text: str) -> TextIO:
    """A text as a file, in a quarter of the memory that StringIO takes."""
    return io.TextIOWrapper(io.BytesIO(text.encode()), "utf-8", newline="")


def _rows(lines: TextIO, layout: Layout, path: Path) -> tuple[list[list[str]], list[int]]:
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


def _convert_dates(table: Table) -> Table:
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
        if (
            (values := _millisecond_values(table, i)) is not None
            and not header_units[i]
            and (begin := epoch(name, values))
        ):
            note = f"{table.where}: column {name!r} is taken as milliseconds since 1970; time counts from {begin} UTC"
            dates[i] = Stamps(values - values[0], note, begin[:10])
            header_units[i] = "ms"
    if not dates:
        return table
    if table.numbers is not None:
        for i, read in dates.items():
            assert isinstance(read, Stamps)
            table.numbers[:, i] = read.seconds
    clocks = (read.note for read in dates.values() if isinstance(read, Stamps))
    notes = (*table.notes, *(Finding("time-by-stamps", "doubt", clock, table.where) for clock in clocks))
    return replace(table, units=tuple(header_units), dates=dates, notes=notes)


def _millisecond_values(table: Table, index: int) -> Array | None:
    """Values of a column of whole numbers of 12 or 13 digits; None of any other."""
    if table.numbers is not None:
        return table.numbers[:, index]
    column = table.columns[index]
    if not (column[0].isdecimal() and column[-1].isdecimal() and 12 <= len(column[0]) <= 13):
        return None
    return np.array(column, dtype=np.float64) if all(cell.isdecimal() for cell in column) else None


def _numbers(text: str, layout: Layout) -> Array | None:
    """Rows of nothing but numbers with decimal points, one line a row; None of any other."""
    rows = text.rstrip("\r\n").count("\n") + 1
    if not text.strip("\r\n"):
        return None
    try:
        values = np.loadtxt(_lines_of(text), delimiter=layout.separator, comments=None, ndmin=2)
    except ValueError:
        return None
    # Empty lines, or a header that is not that of the rows.
    return values if values.shape == (rows, len(layout.header)) else None


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
        raise InputError(f"{where}: column {index + 1} is headed {cell_text(cell)}; expected is name [unit]")
    if match[2] is None:  # no square brackets; "x (mm) []" says that there is no unit
        return round_unit(match[1]) or (match[1], "")
    return match[1], match[2].strip()


def check_unlike(names: Sequence[str], where: str) -> None:
    """InputError: names of columns that are there twice, or numbers in their place."""
    seen: dict[str, int] = {}
    for i, name in enumerate(names):
        if name and (first := seen.setdefault(name, i)) != i:
            raise InputError(f"{where}: duplicate column {cell_text(name)} (columns {first + 1} and {i + 1})")
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


def is_of_kind(unit: str, wanted: str) -> bool:
    """Whether a unit is of the kind of the wanted one."""
    try:
        units.factor(unit or "1", wanted)
    except InputError:
        return False
    return True


def cell_text(cell: str) -> str:
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
            if not recordable_values(values)[1].any():
                return values
    for line, cell, text in zip(lines, cells, plain, strict=True):
        if not cell:
            raise InputError(f"{where}:{line}: no value in column {name!r}")
        if cell.lower().lstrip("+-") in ("nan", "inf", "infinity", "#n/a", "n/a", "null", "none"):
            raise InputError(f"{where}:{line}: {cell!r} in column {name!r}; every value must be a finite number")
        if not plain_number(text):
            raise InputError(f"{where}:{line}: {cell_text(cell)} in column {name!r} is no number{instead_of(cell)}")
        if abs(float(text)) > MAX_MAGNITUDE:
            raise InputError(
                f"{where}:{line}: {shorten_list([cell], 1)} in column {name!r} is too large; allowed: up to "
                f"{MAX_MAGNITUDE:g}"
            )
    return np.array([float(text) for text in plain], dtype=np.float64)


# --- Cells as they are written ---------------------------------------------------------------------------------------


def header_line(trace: Trace) -> bytes:
    """The first line of a trace's file."""
    units = [(name, trace.unit(name)) for name in trace.columns]
    heads = ["time [s]", *(f"{name} [{unit}]" if unit or round_unit(name) else name for name, unit in units)]
    return f"{','.join(quote_cell(cell) for cell in heads)}\n".encode()


def lines_of(columns: Sequence[Array]) -> bytes:
    """Rows of a file, the time being the first of the columns."""
    text = zip(*(shortest_numbers(values) for values in columns), strict=True)
    return "".join(f"{','.join(cells)}\n" for cells in text).encode()


def shortest_numbers(values: Array) -> list[str]:
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


def quote_cell(cell: str) -> str:
    """A cell as it stands in a file."""
    return '"' + cell.replace('"', '""') + '"' if any(c in cell for c in ',;"') else cell
