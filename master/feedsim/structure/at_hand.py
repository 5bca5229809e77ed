"""A structure file read and meshed once, for all who look at other poses of its machine."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from feedsim.scenario import Structure, load_structure
from feedsim.structure.geometry import Assembler
from feedsim.structure.poses import movable

# What tells a file from a later one of the same name.
State = tuple[int, int, int]


def state_of(file: Path) -> State:
    """Time of the last change [ns], length [byte] and number of a file. Raises OSError."""
    found = file.stat()
    return found.st_mtime_ns, found.st_size, found.st_ino


@lru_cache(maxsize=8)
def structure_of(file: Path, state: State) -> Structure:
    """As load_structure; `state` is that of the file, so that a changed one is read anew."""
    return load_structure(file)


@lru_cache(maxsize=8)
def assembler_of(file: Path, state: State) -> Assembler:
    """As movable, of :func:`structure_of`."""
    return movable(structure_of(file, state))
