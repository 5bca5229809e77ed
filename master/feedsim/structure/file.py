"""A structure file as solutions know it: in the state that it has, and the code that solves it."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from feedsim.cache import digest

# What separates a file from a later one of the same name.
State = tuple[int, int, int]
# What solutions of a structure follow from besides its file: the rooms of structures, solved and described.
CODE = (Path(__file__).parent, Path(__file__).parents[1] / "scenario" / "structure")


def state_of(file: Path) -> State:
    """Time of the last change [ns], length [byte] and number of a file. Raises OSError."""
    result = file.stat()
    return result.st_mtime_ns, result.st_size, result.st_ino


@lru_cache(maxsize=8)
def digest_of(file: Path, state: State) -> str:
    """SHA-256 of the file, which is read anew where its state is another one. Raises OSError."""
    return digest(file)
