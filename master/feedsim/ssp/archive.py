"""An SSP file as bytes by name: read with distrust, written the same each time, whole or not at all."""

from __future__ import annotations

import stat
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path, PurePosixPath

from feedsim.errors import InputError
from feedsim.trace.files import written_whole

STRUCTURE = "SystemStructure.ssd"
LARGEST = 4 << 30  # bytes of all files together, unpacked; the setpoints of the longest program take less
_EPOCH = (1980, 1, 1, 0, 0, 0)  # the first date that a zip file can hold


def write(path: Path, files: Mapping[str, bytes]) -> int:
    """Write `files` in their order and return the size [bytes]. Stored, not deflated: what weighs is archives already,
    and the bytes then depend on no version of zlib. OutputError: the file cannot be written; nothing is left then."""
    with written_whole(path) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as package:
        for name, content in files.items():
            entry = zipfile.ZipInfo(name, _EPOCH)
            entry.create_system = 3
            entry.external_attr = 0o644 << 16
            package.writestr(entry, content)
    return path.stat().st_size


def read(path: Path) -> dict[str, bytes]:
    """All files of an SSP by name.

    Raises:
        InputError: no such file, no zip file, damaged, encrypted, or with entries that do not belong into one: names
            that lead out of it or occur twice, links, more than 4 GiB.
    """
    if path.is_dir():
        raise InputError(f"{path} is a folder, not an SSP file")
    try:
        with zipfile.ZipFile(path) as package:
            entries = [entry for entry in package.infolist() if not entry.is_dir()]
            if faults := _faults(entries):
                raise InputError.of(f"{path}: cannot be trusted", [f"{path}: {fault}" for fault in faults])
            files = {entry.filename: package.read(entry) for entry in entries}
    except FileNotFoundError:
        raise InputError(f"no such file: {path}") from None
    except (zipfile.BadZipFile, EOFError, NotImplementedError, RuntimeError, ValueError, zlib.error) as error:
        raise InputError(f"{path}: not a readable SSP, which is a zip file: {error}") from error
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from error
    if STRUCTURE not in files:
        raise InputError(f"{path}: has no {STRUCTURE} at its top; it is no SSP file, or damaged")
    return files


def _faults(entries: list[zipfile.ZipInfo]) -> list[str]:
    faults: list[str] = []
    seen: set[str] = set()
    for entry in entries:
        name = entry.filename
        if leads_out(name):
            faults.append(f"the entry {name!r} leads out of the archive")
        elif stat.S_ISLNK(entry.external_attr >> 16):
            faults.append(f"the entry {name!r} is a link")
        elif entry.flag_bits & 1:
            faults.append(f"the entry {name!r} is encrypted")
        elif name in seen:
            faults.append(f"the entry {name!r} is there twice")
        seen.add(name)
    if (size := sum(entry.file_size for entry in entries)) > LARGEST:
        faults.append(f"it unpacks to {size} bytes; at most {LARGEST} are read")
    return faults


def leads_out(name: str) -> bool:
    """Whether a name inside an archive is absolute, climbs, or is none that every system reads alike."""
    return (
        not name
        or name.startswith("/")
        or ".." in PurePosixPath(name).parts
        or any(c in name for c in "\\:\0")
        or any(ord(c) < 32 for c in name)
    )
