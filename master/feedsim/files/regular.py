"""Bytes of a file that a user names: of a regular one, up to a size. No pipe or device keeps a command waiting."""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path

from feedsim.errors import InputError, no_such_file

# What else a name may stand for, in words.
_OTHERS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (lambda _: True, "a device"),
)
_OPENING = os.O_RDONLY | sum(getattr(os, name, 0) for name in ("O_BINARY", "O_CLOEXEC", "O_NONBLOCK", "O_NOCTTY"))


@contextmanager
def opened(path: Path, *, pipes: bool = False) -> Iterator[BufferedReader]:
    """A file to be read piece by piece. pipes, errors: as of content(), without its limit."""
    try:
        number = os.open(path, _OPENING)
        with os.fdopen(number, "rb") as file:
            result = os.fstat(number)
            if not (stat.S_ISREG(result.st_mode) or (pipes and stat.S_ISFIFO(result.st_mode))):
                what = next(name for is_one, name in _OTHERS if is_one(result.st_mode))
                raise InputError(f"{path} is {what}, not a file")
            if hasattr(os, "O_NONBLOCK"):
                os.set_blocking(number, True)
            yield file
    except FileNotFoundError:
        raise InputError(no_such_file(path)) from None
    except IsADirectoryError:
        raise InputError(f"{path} is a folder, not a file") from None
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from None


def content(path: Path, largest: int | None = None, *, pipes: bool = False) -> bytes:
    """What is in a file.

    Args:
        largest: bytes that it may have; None: any number.
        pipes: one that somebody writes to, such as a shell's <(command), will do too; without a writer it is empty.

    Raises:
        InputError: no such file, one that cannot be read, is too large, or is no regular one.
    """
    with opened(path, pipes=pipes) as file:
        read = file.read() if largest is None else file.read(largest + 1)
        size = max(os.fstat(file.fileno()).st_size, len(read))
    if largest is not None and len(read) > largest:
        raise InputError(f"{path} has {size / 1e6:.4g} MB; a file of this kind may have {largest / 1e6:.4g} MB at most")
    return read


def digest(path: Path) -> str:
    """SHA-256 of what is in a file, which may be larger than the memory. InputError: as of content()."""
    with opened(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
