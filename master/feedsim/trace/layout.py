"""Where the table of a text file begins: lines ahead of its header, what separates its columns, and their heads.

The header is the first line with a row of as many cells below it, most of them numbers. Of two rows, names above units,
the names are the header.
"""

from __future__ import annotations

import csv
import io
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from feedsim.errors import InputError
from feedsim.files.spellings import known_unit
from feedsim.trace.stamps import is_stamp
from feedsim.units import NUMBER

_SEPARATORS = {"\t": "tab", ";": "semicolon", ",": "comma"}
_NO_NUMBERS = ("nan", "inf", "infinity")  # which stand in place of one
# A signal of a SINUMERIK by its path: "+/Nck/!SD/nckServoDataActPos1stEnc64 [u1, 2]", of unit 1, axis 2.
_SIGNAL = re.compile(r"(?P<path>.*?)\s*\[u\d+\s*[,;]\s*(?P<axis>\d+)\](?P<rest>.*)")
LONGEST_UNIT = 60  # characters of a name or a unit in two rows of header
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
    ahead, separator = _ahead(lines)
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


def _ahead(lines: io.StringIO) -> tuple[int, str]:
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


def twice(names: Iterable[str]) -> list[str]:
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
