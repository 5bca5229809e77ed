"""The WebAssembly module of the unit `machine` (src/page): where it is, and whether it fits the archives."""

from __future__ import annotations

import json
from pathlib import Path

from feedsim.errors import InputError
from feedsim.installation import checkout

MODULE_FILE = "machine.wasm"
SECTION = b"feedsim"
MAGIC = b"\0asm\1\0\0\0"


def read(fmus: Path, guid: str) -> bytes:
    """The module beside the archives in the folder `fmus`, for the unit with this GUID.

    Raises:
        InputError: it is missing, no module, or built from another table of variables.
    """
    path = fmus / MODULE_FILE
    mend = "`make page-module` builds it" if checkout() else "a wheel of feedsim brings it along: install it anew"
    if not path.is_file():
        raise InputError(f"{path}: there is no module of the machine for pages; {mend}")
    content = path.read_bytes()
    table = _section(content).get("table")
    if table is None:
        raise InputError(f"{path}: is no WebAssembly module that feedsim made; {mend}")
    if table != guid.partition("-")[0]:
        raise InputError(
            f"{path}: was built for a machine.fmu whose table of variables has the hash {table}, the archive's is "
            f"{guid.partition('-')[0]}: one of them is of other sources; {mend}"
        )
    return content


def _section(content: bytes) -> dict[str, str]:
    """What the custom section `feedsim` says; empty where there is none."""
    if not content.startswith(MAGIC):
        return {}
    at = len(MAGIC)
    while at < len(content):
        kind, at = content[at], at + 1
        size, at = _length(content, at)
        if kind == 0:
            length, begin = _length(content, at)
            if content[begin : begin + length] == SECTION:
                result: dict[str, str] = json.loads(content[begin + length : at + size])
                return result
        at += size
    return {}


def _length(content: bytes, at: int) -> tuple[int, int]:
    """An unsigned LEB128 number, and where the next byte is."""
    value = shift = 0
    while at < len(content):
        byte, at = content[at], at + 1
        value |= (byte & 0x7F) << shift
        shift += 7
        if byte < 0x80:
            break
    return value, at
