"""What a command may write: inputs are never outputs, and what feedsim did not write itself stays unless forced.

May use: errors. Start reading at check_file(); folders of results ask the same questions (report/results.py).
"""

from __future__ import annotations

import os
import zipfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from feedsim.errors import OutputError

HEAD_BYTES = 4096  # bytes of a file that are read to see what it is
_FORCED = ContextVar("forced", default=False)


@contextmanager
def replacing(allowed: bool = True) -> Iterator[None]:
    """A block in which files may be replaced that feedsim did not write: what --force asks for. Inputs never are."""
    before = _FORCED.set(allowed)
    try:
        yield
    finally:
        _FORCED.reset(before)


def forced() -> bool:
    """Whether files of others may be replaced."""
    return _FORCED.get()


def same(one: Path, other: Path) -> bool:
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
    if any(same(path, given) for given in inputs):
        raise OutputError(f"{path}: is an input and would be replaced; take another name")
    if path.is_dir():
        raise OutputError(f"{path}: is a directory; the name of a file is needed")
    if path.is_file() and not forced() and not ours(path):
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


def unchanged(content: bytes) -> Callable[[Path], bool]:
    """What shows a file that holds these bytes already: writing them again loses nothing."""

    def one(path: Path) -> bool:
        try:
            return path.stat().st_size == len(content) and path.read_bytes() == content
        except OSError:
            return False

    return one
