"""What a file is of those that commands are given, without loading what reads it."""

from __future__ import annotations

from pathlib import Path

from feedsim.errors import InputError
from feedsim.files.source import read

SSP = ".ssp"


def is_ssp(path: Path) -> bool:
    """Whether a file is meant as an SSP, by its name."""
    return path.suffix.lower() == SSP


def is_study(path: Path) -> bool:
    """Whether a file that can be read is a study, by its keys."""
    try:
        data = read(path).data
    except InputError:
        return False
    return isinstance(data, dict) and "sampling" in data and "parameters" in data and "machine" not in data
