"""Files <-> a zip archive, which depends on nothing but their names and contents and is written whole or not at all."""

import errno
import io
import os
import re
import stat
import zipfile
import zlib
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from .errors import InputError, OutputError

LARGEST = 2**30  # bytes that are unpacked in memory; an hour of setpoints has a quarter of it

_EPOCH = (1980, 1, 1, 0, 0, 0)  # the earliest date a zip entry can have
_UNIX = 3  # create_system; fixed, as zipfile takes the host's


def pack(files: Mapping[str, bytes], *, level: int = 9) -> bytes:
    """Zip archive of `files` (path with forward slashes -> content), sorted by path.

    `level`: of compression; 0 where it is to be unpacked at once, which saves most of the time.
    """
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for path in sorted(files):
            entry = zipfile.ZipInfo(path, _EPOCH)
            entry.create_system = _UNIX
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = (0o100755 if path.startswith("binaries/") else 0o100644) << 16
            archive.writestr(entry, files[path], compresslevel=level)
    return buffer.getvalue()


def read(path: Path) -> dict[str, bytes]:
    """Path -> content of every file in the archive at `path`.

    Raises InputError where it is no readable archive, or where it has files that no unit has: outside of its folder,
    twice, or of more bytes than LARGEST altogether.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            entries = [entry for entry in archive.infolist() if not entry.is_dir()]
            if problems := _foreign(entries):
                raise InputError(f"{path}: not the archive of a unit", problems)
            return {entry.filename: archive.read(entry) for entry in entries}
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        raise InputError(f"{path}: not an archive, or damaged: {error}") from error


def _foreign(entries: Sequence[zipfile.ZipInfo]) -> list[str]:
    """What may not be in an archive that is to be trusted as far as to be packed anew."""
    problems: list[str] = []
    for name, count in Counter(entry.filename for entry in entries).items():
        if count > 1:
            problems.append(f"{name!r} is in it {count} times")
        if re.match(r"[A-Za-z]:|/", name) or "\\" in name or not {".", "..", ""}.isdisjoint(name.split("/")):
            problems.append(f"{name!r} is no path within an archive")
    if (size := sum(entry.file_size for entry in entries)) > LARGEST:
        problems.append(f"its files have {size} bytes; at most {LARGEST} are read")
    return problems


def write(path: Path, content: bytes) -> None:
    """Write `content` to `path` in one go: readers see the old file or the new one, never a part.

    A symbolic link stays, what it leads to is replaced. A pipe or a character device is written to, never replaced.
    Raises OutputError where that cannot be, and for a folder, a socket or a disk.
    """
    target = Path(os.path.realpath(path))
    temporary = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        try:
            mode = path.stat().st_mode
        except FileNotFoundError:
            mode = stat.S_IFREG
        if stat.S_ISFIFO(mode) or stat.S_ISCHR(mode):
            path.write_bytes(content)
            return
        if stat.S_ISDIR(mode):
            raise OSError(errno.EISDIR, "Is a directory")
        if not stat.S_ISREG(mode):
            raise OSError(errno.EINVAL, "Is no regular file")
        target.parent.mkdir(parents=True, exist_ok=True)
        temporary.write_bytes(content)
        temporary.replace(target)
    except OSError as error:
        with suppress(OSError):
            temporary.unlink()
        raise OutputError(f"cannot write {path}: {error.strerror}") from error
