"""Names of files within texts -> the files: relative to the file that names them, and never out of an archive."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from feedsim.errors import InputError
from feedsim.fields import brief

MAX_NAME_BYTES, MAX_PART_BYTES = 4096, 255  # bytes of a name that Linux takes, and of each part of it
_CLOSED: list[str] = []  # folders that hold what archives were unpacked to


@contextmanager
def closed(folder: Path) -> Iterator[None]:
    """For as long as the block lasts, what is written in files of `folder` names no file outside of it."""
    root = _absolute(folder)
    _CLOSED.append(root)
    try:
        yield
    finally:
        _CLOSED.remove(root)


def referred(folder: Path, name: str) -> Path:
    """The file that a text in a file of `folder` names. No file is looked at.

    Raises:
        InputError: it is none that a system can have; `folder` is closed and the name leads out.
    """
    if not _possible(name):
        raise InputError(f"{brief(name)} is no file name")
    path = folder / name
    root = next((name for name in reversed(_CLOSED) if _inside(_absolute(folder), name)), None)
    if root is not None and not _inside(_absolute(path), root):
        raise InputError(f"{brief(name)} leads out of the archive; what is written in one names files in it alone")
    return path


def _absolute(path: Path) -> str:
    """Without looking at it: resolve() follows links."""
    return os.path.abspath(path)  # noqa: PTH100


def _possible(name: str) -> bool:
    """Whether a system can be asked for such a name: what it answers otherwise is an error of the caller's."""
    try:
        return (
            "\0" not in name
            and len(os.fsencode(name)) < MAX_NAME_BYTES
            and all(len(os.fsencode(part)) <= MAX_PART_BYTES for part in Path(name).parts)
        )
    except UnicodeEncodeError:
        return False


def _inside(path: str, root: str) -> bool:
    return path == root or path.startswith(root + os.sep)
