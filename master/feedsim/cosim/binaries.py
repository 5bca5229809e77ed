"""Which of an archive's shared libraries belongs to this platform."""

from __future__ import annotations

import platform
import sys
from collections.abc import Collection
from pathlib import Path

from feedsim.errors import InputError

_SUFFIXES = {"windows": ".dll", "darwin": ".dylib"}  # elsewhere .so
_FMI_2 = {"windows": "win", "darwin": "darwin", "linux": "linux"}


def folders() -> tuple[str, ...]:
    """Folders under binaries/ that may hold a library for this platform, the likelier first.

    FMI 2.0 names folders for Intel's processors alone (linux64); for others archives use the names of FMI 3.0
    (aarch64-linux), and on a Mac darwin64 may hold a universal file.
    """
    system, machine = platform.system().lower(), platform.machine().lower()
    wide = sys.maxsize > 2**32
    old = f"{_FMI_2.get(system, system)}{64 if wide else 32}"
    if machine in ("aarch64", "arm64"):
        return (f"aarch64-{system}", old)
    return (old, f"{'x86_64' if wide else 'x86'}-{system}")


def library(directory: Path, identifier: str, present: Collection[str], where: str) -> Path:
    """The library `identifier` in the archive unpacked to `directory`.

    Args:
        present: folders under binaries/ that the archive has.

    Raises:
        InputError: there is none for this platform; tells which there are.
    """
    suffix = _SUFFIXES.get(platform.system().lower(), ".so")
    for folder in folders():
        path = directory.absolute() / "binaries" / folder / f"{identifier}{suffix}"
        if path.is_file():
            return path
    looked = " or ".join(f"binaries/{folder}/{identifier}{suffix}" for folder in folders())
    there = f"it has {', '.join(sorted(present))}" if present else "it has none at all"
    raise InputError(
        f"{where}: has no binary for this platform, {platform.system()} on {platform.machine()} ({looked}); {there}"
    )
