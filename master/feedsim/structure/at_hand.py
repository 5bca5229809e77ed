"""A structure file read and meshed once, for all who look at other poses of its machine."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from feedsim.scenario import Structure, load_structure
from feedsim.structure.geometry import Assembler
from feedsim.structure.poses import movable


@lru_cache(maxsize=8)
def structure_of(file: Path, stamp: int) -> Structure:
    """As load_structure; `stamp` is the file's time, so that a changed file is read anew."""
    return load_structure(file)


@lru_cache(maxsize=8)
def assembler_of(file: Path, stamp: int) -> Assembler:
    """As movable, of :func:`structure_of`."""
    return movable(structure_of(file, stamp))
