"""Files that are written whole or not at all, and what is no regular file."""

from __future__ import annotations

import os
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from io import BytesIO
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import IO

from feedsim.errors import OutputError
from feedsim.owned import locked
from feedsim.signals import held


@contextmanager
def written_whole(path: Path) -> Iterator[IO[bytes]]:
    """A file to write to that takes its name when the block ends well; otherwise nothing is left and an old file stays.

    A symbolic link stays: what it leads to is replaced. A pipe or a character device (/dev/stdout, /dev/null) is never
    replaced: what was written goes into it when the block ends well.

    The folder must exist. OutputError: it does not, the file cannot be written, or `path` is a folder, a socket or a
    disk.
    """
    try:
        if is_stream(path):
            buffer = BytesIO()
            yield buffer
            _poured(path, buffer.getvalue())
            return
        target = Path(os.path.realpath(path))
        file = None
        try:
            with held():  # what is made is known, and removed
                file = _begun(target)
            yield file
            file.flush()
            os.fsync(file.fileno())
            if os.name == "nt":  # it does not move what is open; elsewhere the lock goes with the name
                file.close()
            Path(file.name).chmod(0o666 & ~_umask())
            Path(file.name).replace(target)
            file.close()
        except BaseException:
            if file is not None:
                with suppress(OSError):  # on a full disk what is still to be written fails once more
                    file.close()
                with suppress(OSError):
                    Path(file.name).unlink()
            raise
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror or error}") from error


def _begun(target: Path) -> IO[bytes]:
    """A file beside `target`, locked as long as it is open; what processes that have gone have left there is removed.

    OSError: it cannot be made.
    """
    prefix, suffix = f".{target.name}.", ".feedsim"
    with suppress(OSError):  # of folders that cannot be listed
        for other in target.parent.iterdir():
            if other.name.startswith(prefix) and other.name.endswith(suffix):
                _remove_orphan(other)
    while True:
        file: IO[bytes] = NamedTemporaryFile(dir=target.parent, prefix=prefix, suffix=suffix, delete=False)  # noqa: SIM115
        if locked(file.fileno()) is not False and Path(file.name).exists():
            return file
        file.close()  # taken for one that has been left


def _remove_orphan(path: Path) -> None:
    """Remove a file that nobody has locked."""
    with suppress(OSError), path.open("r+b") as file:
        if locked(file.fileno()):
            if os.name == "nt":  # it does not remove what is open
                file.close()
            path.unlink()


def is_stream(path: Path) -> bool:
    """Whether `path` takes what is written but holds no file. OSError: it is neither a stream nor a file."""
    if _descriptor(path) is not None:
        return True
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        return False
    for what, is_one in (("a folder", stat.S_ISDIR), ("a socket", stat.S_ISSOCK), ("a disk", stat.S_ISBLK)):
        if is_one(mode):
            raise OSError(22, f"it is {what}")
    return not stat.S_ISREG(mode)


def _descriptor(path: Path) -> int | None:
    """Number of the open file of this process that `path` stands for: 1 for /dev/stdout."""
    for _ in range(40):  # as many links as Linux follows
        if path.name.isdigit() and os.path.realpath(path.parent) in ("/dev/fd", f"/proc/{os.getpid()}/fd"):
            return int(path.name)
        if not path.is_symlink():
            return None
        path = path.parent / path.readlink()
    return None


def _poured(path: Path, content: bytes) -> None:
    number = _descriptor(path)
    # An open file is shared, not opened again: into one behind a shell's ">" both would write from its start.
    if number is None:
        stream: IO[bytes] = path.open("wb")
    else:
        if sys.stdout is not None:
            sys.stdout.flush()
        stream = os.fdopen(os.dup(number), "wb")
    with stream:
        stream.write(content)


def _umask() -> int:
    """The process's umask; it can only be read by setting it."""
    mask = os.umask(0o022)
    os.umask(mask)
    return mask
