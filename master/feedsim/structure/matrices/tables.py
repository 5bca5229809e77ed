"""CSV tables of a finite-element model: a header, then rows; every fault with its line."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

from feedsim.errors import InputError

MOST_PROBLEMS = 20


@dataclass(frozen=True)
class Row:
    """Cells of a line, by column; an optional column that is not there is empty."""

    line: int
    cells: dict[str, str]

    def __getitem__(self, column: str) -> str:
        return self.cells.get(column, "")


def read_table(file: Path, what: str, headers: Sequence[Sequence[str]], optional: Sequence[str] = ()) -> list[Row]:
    """Rows of a table that has the columns of one of `headers`, and `optional` ones.

    Raises:
        InputError: not readable, other columns, a row of another length.
    """
    try:
        with file.open(encoding="utf-8-sig", newline="") as stream:
            lines = [(number, [cell.strip() for cell in row]) for number, row in enumerate(csv.reader(stream), 1)]
    except FileNotFoundError:
        raise InputError(f"{file}: no such file ({what})") from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{file}: cannot be read as {what}: {error}") from error
    lines = [(number, row) for number, row in lines if any(row)]
    columns = [name.lower() for name in lines[0][1]] if lines else []
    forms = " or ".join(", ".join(header) for header in headers)
    if not any(set(header) <= set(columns) for header in headers):
        there = f"; there is {', '.join(columns)}" if columns else "; the file is empty"
        raise InputError(f"{file}:1: {what} begins with a header: {forms}{there}")
    known = {*optional, *(name for header in headers for name in header)}
    problems = [f"{file}:1: unknown column {name!r}{suggestion(name, known)}" for name in columns if name not in known]
    twice = [name for name in dict.fromkeys(columns) if columns.count(name) > 1]
    problems += [f"{file}:1: column {name!r} occurs twice" for name in twice]
    problems += [
        f"{file}:{number}: {len(row)} cells; the header has {len(columns)}"
        for number, row in lines[1:]
        if len(row) != len(columns)
    ]
    if problems:
        raise InputError.of(f"{file}: not {what}", problems[:MOST_PROBLEMS])
    return [Row(number, dict(zip(columns, row, strict=True))) for number, row in lines[1:]]


def number(file: Path, row: Row, column: str) -> float:
    """A finite number. InputError with the line."""
    try:
        value = float(row[column])
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{file}:{row.line}: column {column!r}: {row[column]!r} is no finite number")
    return value


def index(file: Path, row: Row, column: str, below: int) -> int:
    """A whole number 0 ... below - 1. InputError with the line."""
    text = row[column]
    if not text.isdecimal():
        raise InputError(f"{file}:{row.line}: column {column!r}: {text!r} is no whole number from 0 to {below - 1}")
    if int(text) >= below:
        raise InputError(
            f"{file}:{row.line}: column {column!r}: there is no degree of freedom {text}; they count from 0 to "
            f"{below - 1} (in the Matrix Market files from 1 to {below})"
        )
    return int(text)


def suggestion(word: str, known: set[str]) -> str:
    """'; did you mean ...?', else '; allowed: ...'."""
    close = get_close_matches(word, sorted(known), n=1, cutoff=0.6)
    return f"; did you mean {close[0]!r}?" if close else f"; allowed: {', '.join(sorted(known))}"
