"""What a command may write: inputs are never outputs, and what feedsim did not write itself stays unless forced.

May use: errors. Start reading at check_file(); folders of results ask the same questions (report/results.py).
"""

from __future__ import annotations

import csv
import io
import os
import re
import zipfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from feedsim.foundation.errors import OutputError

HEAD_BYTES = 4096  # bytes of a file that are read to see what it is
_REPLACEMENT_ALLOWED = ContextVar("forced", default=False)


@contextmanager
def allow_replacement(allowed: bool = True) -> Iterator[None]:
    """A block in which files may be replaced that feedsim did not write: what --force asks for. Inputs never are."""
    before = _REPLACEMENT_ALLOWED.set(allowed)
    try:
        yield
    finally:
        _REPLACEMENT_ALLOWED.reset(before)


def is_replacement_allowed() -> bool:
    """Whether files of others may be replaced."""
    return _REPLACEMENT_ALLOWED.get()


def is_same_file(one: Path, other: Path) -> bool:
    """Whether both are one file, by whatever names, links included."""
    try:
        return one.samefile(other)
    except OSError:
        return os.path.realpath(one) == os.path.realpath(other)


def check_file(
    path: Path, inputs: Iterable[Path] = (), *, ours: Callable[[Path], bool] = lambda path: False, what: str = "file"
) -> None:
    """Refuse to write ``path`` where that would lose a file of the user.

    Args:
        inputs: files and folders that the command reads; none of them is written, by --force neither.
        ours: whether the file that is there now is one that the command wrote.
        what: the command writes, for the message.

    Raises:
        OutputError: `path` is an input or a folder, or a file is there that feedsim did not write.
    """
    if any(is_same_file(path, given) for given in inputs):
        raise OutputError(f"{path}: is an input and would be replaced; take another name")
    if path.is_dir():
        raise OutputError(f"{path}: is a directory; the name of a file is needed")
    if path.is_file() and not is_replacement_allowed() and not ours(path):
        raise OutputError(
            f"{path}: exists already, and is no {what} that feedsim wrote; take another name, or replace it with "
            "--force"
        )


def begins_with(*marks: bytes) -> Callable[[Path], bool]:
    """What shows files that hold one of the marks near their beginning."""

    def one(path: Path) -> bool:
        try:
            with path.open("rb") as file:
                head = file.read(HEAD_BYTES)
        except OSError:
            return False
        return any(mark in head for mark in marks)

    return one


def archive_with(member: str, mark: bytes) -> Callable[[Path], bool]:
    """What shows archives whose `member` holds the mark."""

    def one(path: Path) -> bool:
        try:
            with zipfile.ZipFile(path) as opened, opened.open(member) as file:
                return mark in file.read(64 * HEAD_BYTES)
        except (OSError, KeyError, zipfile.BadZipFile, NotImplementedError, RuntimeError, ValueError):
            return False

    return one


def content_check(content: bytes) -> Callable[[Path], bool]:
    """What shows a file that holds these bytes already: writing them again loses nothing."""

    def one(path: Path) -> bool:
        try:
            return path.stat().st_size == len(content) and path.read_bytes() == content
        except OSError:
            return False

    return one


# --- CSV tables that people open in a spreadsheet: text of other people's files never becomes a formula there ---------
# A spreadsheet takes a cell that begins with = + - or @, or with a tab or a carriage return ahead of them, for a
# formula, which may start programs or fetch pages. Such a text gets an apostrophe ahead; numbers stay as they are. A
# text that begins with apostrophes and goes on like that gets one more, so that original_text() gives every text back.


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
