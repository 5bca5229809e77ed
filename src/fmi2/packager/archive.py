"""Files <-> a zip archive, which depends on nothing but their names and contents and is written whole or not at all."""

import io
import os
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path

from .errors import InputError, OutputError

_EPOCH = (1980, 1, 1, 0, 0, 0)  # the earliest date a zip entry can have
_UNIX = 3  # create_system; fixed, as zipfile takes the host's


def pack(files: Mapping[str, bytes]) -> bytes:
    """Zip archive of `files` (path with forward slashes -> content), sorted by path."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for path in sorted(files):
            entry = zipfile.ZipInfo(path, _EPOCH)
            entry.create_system = _UNIX
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = (0o100755 if path.startswith("binaries/") else 0o100644) << 16
            archive.writestr(entry, files[path], compresslevel=9)
    return buffer.getvalue()


def read(path: Path) -> dict[str, bytes]:
    """Path -> content of every file in the archive at `path`; raises InputError where it is no readable archive."""
    try:
        with zipfile.ZipFile(path) as archive:
            return {entry.filename: archive.read(entry) for entry in archive.infolist() if not entry.is_dir()}
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        raise InputError(f"{path}: not an archive, or damaged: {error}") from error


def write(path: Path, content: bytes) -> None:
    """Write `content` to `path` in one go: readers see the old file or the new one, never a part."""
    if path.is_dir():
        raise OutputError(f"cannot write {path}: Is a directory")
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.write_bytes(content)
        temporary.replace(path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise OutputError(f"cannot write {path}: {error.strerror}") from error
