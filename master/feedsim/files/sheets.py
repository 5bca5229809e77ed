"""CSV tables that people open in a spreadsheet: text of other people's files never becomes a formula there.

A spreadsheet takes a cell that begins with = + - or @, or with a tab or a carriage return ahead of them, for a
formula, which may start programs or fetch pages. Such a text gets an apostrophe ahead; numbers stay as they are. A
text that begins with apostrophes and goes on like that gets one more, so that original_text() gives every text back.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Iterator, Sequence

_FORMULA = re.compile(r"'*[=+\-@\t\r]")
_SPECIAL = re.compile(r'[,"\r\n]')
_EMPTY_ROW = '""'  # a row of one empty cell
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|[+-]?(?:inf|nan)")


def as_text(cell: str) -> str:
    """A cell as a sheet has it.

    >>> as_text("=1+1"), as_text("-1.5e-3"), as_text("-80 mm"), as_text("'=1")
    ("'=1+1", '-1.5e-3', "'-80 mm", "''=1")
    """
    return f"'{cell}" if _FORMULA.match(cell) and not _NUMBER.fullmatch(cell) else cell


def original_text(cell: str) -> str:
    """The text of a cell of a sheet.

    >>> original_text("'=1+1"), original_text("'H0003'")
    ('=1+1', "'H0003'")
    """
    return cell[1:] if cell.startswith("'") and _FORMULA.match(cell) else cell


def write_rows(file: io.TextIOBase, rows: Iterable[Sequence[object]]) -> None:
    """Write rows to a file that is open with newline=""."""
    for row in rows:
        cells = [_quote_cell(as_text(str(cell))) for cell in row]
        file.write(f"{','.join(cells) if cells != [''] else _EMPTY_ROW}\n")


def _quote_cell(cell: str) -> str:
    """The writer of Python's csv leaves a carriage return without quotes where rows end with a line feed."""
    return '"' + cell.replace('"', '""') + '"' if _SPECIAL.search(cell) else cell


def text_of(rows: Iterable[Sequence[object]]) -> str:
    """Rows as the text of a sheet."""
    file = io.StringIO()
    write_rows(file, rows)
    return file.getvalue()


def read_rows(file: Iterable[str]) -> Iterator[list[str]]:
    """Rows of a sheet as they were given; csv.Error: none."""
    for row in csv.reader(file):
        yield [original_text(cell) for cell in row]
