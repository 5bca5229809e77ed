"""Whose programs an archive holds: those that this installation ships, or another maker's, which only a run executes.

A program is known by its bytes, not by the name of its archive: a plant that is packed for a machine, or an SSP that
was exported here, holds the shipped libraries; whatever differs in one byte is another maker's.
"""

from __future__ import annotations

import hashlib
import zipfile
from collections.abc import Mapping
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

from feedsim.foundation.errors import InputError
from feedsim.foundation.installation import fmus_directory
from feedsim.scenario import Coupling, Machine
from feedsim.scenario.roles import DRIVE, FRICTION_ROLE
from feedsim.simulation.cosim import exchange
from feedsim.simulation.cosim.archive import Archive, folders
from feedsim.simulation.cosim.roles import archive_path

SHIPPED = ("plant.fmu", "controller.fmu", "friction.fmu", "friction_gms.fmu", "setpoint.fmu", "machine.fmu")
Programs = Mapping[str, str]  # path inside the archive -> SHA-256, of all files beside the library for this platform


def is_shipped(archive: Archive) -> bool:
    """Whether all that can be loaded from an archive is what this installation ships, to the last byte."""
    return _is_ours(archive.path) or programs(archive) in _shipped(*_states(fmus_directory()))


def programs(archive: Archive) -> dict[str, str]:
    """What of an archive can be loaded on this platform."""
    root = archive.directory
    paths = [file for folder in folders() for file in (root / "binaries" / folder).rglob("*") if file.is_file()]
    return {file.relative_to(root).as_posix(): _digest(file.read_bytes()) for file in sorted(paths)}


def _parts(machine: Machine, folder: Path, coupling: Coupling | None) -> dict[Path, list[str]]:
    """Archives that a run of the machine takes out of a folder or from elsewhere, and the parts that they play."""
    if coupling is not None and coupling.units == "one":
        return {folder / "machine.fmu": ["machine"]}
    parts: dict[Path, list[str]] = {machine.plant or folder / "plant.fmu": ["plant"]}
    for axis in machine.axes:
        for role in (DRIVE, FRICTION_ROLE):
            parts.setdefault(archive_path(machine, axis, role, folder), []).append(f"{role.name} of {axis}")
    return parts


def any_foreign(machine: Machine, fmus: Path, coupling: Coupling | None = None) -> bool:
    """Whether a run of the machine executes a program that is not shipped; what cannot be opened is none."""
    try:
        states = [(path, path.stat().st_mtime_ns, path.stat().st_size) for path in _parts(machine, fmus, coupling)]
    except OSError:
        return False  # the run says which archive is missing
    ours = fmus_directory()
    return any(_foreign(*state, ours) for state in states) or _loop(fmus, ours) is not None


def _loop(folder: Path, ours: Path) -> str | None:
    """SHA-256 of the cycle loop beside the archives of a folder, where it is another one than the shipped one."""
    with suppress(OSError):
        if folder != ours and (digest := _digest((folder / exchange.LIBRARY_NAME).read_bytes())) != _digest(
            (ours / exchange.LIBRARY_NAME).read_bytes()
        ):
            return digest
    return None


@lru_cache(maxsize=64)
def _foreign(path: Path, changed: int, size: int, ours: Path) -> bool:
    """Of an archive in that state, where the shipped ones are in the folder `ours`."""
    if _is_ours(path):
        return False
    with suppress(InputError), Archive(path) as archive:
        return not is_shipped(archive)
    return False


def executed(machine: Machine, fmus: Path | None, coupling: Coupling | None = None) -> list[str]:
    """What a run of the machine executes that is not shipped, a sentence for each archive: who, what, its SHA-256.

    What cannot be opened is left out: the run says why. fmus: folder of the archives, where one was named. coupling:
    of the run; None: of units of their own.
    """
    folder = fmus or fmus_directory()
    parts = _parts(machine, folder, coupling)
    sentences = [sentence for path, who in parts.items() for sentence in executing(path, ", ".join(who))]
    if (digest := _loop(folder, fmus_directory())) is not None:
        sentences.append(f"executes {folder / exchange.LIBRARY_NAME} as cycle loop, SHA-256 {digest}")
    return sentences


def executing(path: Path, who: str) -> list[str]:
    """The same of one archive, for the part that it plays; nothing of a shipped one."""
    if _is_ours(path):
        return []
    with suppress(InputError), Archive(path) as archive:
        if not is_shipped(archive):
            # Of the whole archive: what a wrapper's library executes may lie beside it, in resources/.
            return [f"executes {path} as {who}: {', '.join(programs(archive))}; SHA-256 {_digest(path.read_bytes())}"]
    return []


def _is_ours(path: Path) -> bool:
    return path in [fmus_directory() / name for name in SHIPPED]


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _states(folder: Path) -> list[tuple[Path, int, int]]:
    there = [path for name in SHIPPED if (path := folder / name).is_file()]
    return [(path, path.stat().st_mtime_ns, path.stat().st_size) for path in there]


@lru_cache(maxsize=4)
def _shipped(*states: tuple[Path, int, int]) -> list[Programs]:
    """Programs of the shipped archives, none of which is unpacked for it."""
    wanted = tuple(f"binaries/{folder}/" for folder in folders())
    result: list[Programs] = []
    for path, _, _ in states:
        with suppress(OSError, zipfile.BadZipFile), zipfile.ZipFile(path) as package:
            names = [zip_info.filename for zip_info in package.infolist() if not zip_info.is_dir()]
            result.append({name: _digest(package.read(name)) for name in names if name.startswith(wanted)})
    return result
