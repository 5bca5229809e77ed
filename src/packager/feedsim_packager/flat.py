"""Sources as they lie in an archive's one folder: what a unit has of its parts (#include "../plant_fmu/...") is put in
the place of the line that includes it."""

import re
from pathlib import Path

_INCLUDE = re.compile(rb'^#include "([^"]+)"[^\n]*\n', re.MULTILINE)


def content(path: Path) -> bytes:
    """The file at `path`, with the files of other units that it includes."""
    return _put_in(path, path.read_bytes(), set(), path.parent)


def _put_in(path: Path, text: bytes, headers: set[Path], home: Path) -> bytes:
    """`text` of the file `path`; `headers` are those of other folders than `home` that were put in already."""

    def included(match: re.Match[bytes]) -> bytes:
        other = (path.parent / match[1].decode()).resolve()
        if other.parent == home.resolve() or not other.is_file() or (path.parent == home and b"/" not in match[1]):
            return match[0]
        if other.suffix == ".h" and other in headers:
            return b""
        headers.add(other)
        name = other.parent.name.encode() + b"/" + other.name.encode()
        return b"/* --- " + name + b" */\n" + _put_in(other, other.read_bytes(), headers, home)

    return _INCLUDE.sub(included, text)
