"""Files -> a zip archive that depends on nothing but their names and contents, written whole or not at all."""

import io
import os
import zipfile
from collections.abc import Mapping
from pathlib import Path

from packager.errors import OutputError

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


def write(path: Path, content: bytes) -> None:
    """Write `content` to `path` in one go: readers see the old file or the new one, never a part."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.write_bytes(content)
        temporary.replace(path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise OutputError(f"cannot write {path}: {error.strerror}") from error
