"""Files that a unit reads at its instantiation: what all kinds of them have in common (kinds.py lists the kinds).

The files go into the archive byte for byte; their hash is the second half of the GUID.
"""

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from .errors import InputError

AXIS_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,30}")  # the length is AXIS_NAME_SIZE, SETPOINT_NAME_SIZE of the units
AXIS_NAME_RULE = "is not a letter followed by at most 30 letters, digits or _"
MOST_AXES = 256  # AXES_MOST, SETPOINT_AXES_MOST of the units

LONGEST_NUMBER = 510  # characters, a decimal point not counted; as numbers.c has it where separators are one byte
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")


@dataclass(frozen=True)
class File:
    """Content of a file, with the name that messages call it by."""

    name: str
    content: bytes

    @classmethod
    def at(cls, path: Path) -> "File":
        """Read `path`; raises InputError."""
        try:
            return cls(str(path), path.read_bytes())
        except OSError as error:
            raise InputError(f"{path}: cannot be read: {error.strerror}") from error


@dataclass(frozen=True)
class Experiment:
    """DefaultExperiment: simulated from 0 to `stop` [s] in steps of `step` [s], those of the drives' control."""

    stop: float = 1.0
    step: float = 125e-6


class Resources(ABC):
    """Resource files of an archive, checked."""

    kind: ClassVar[str]  # as UNIT_RESOURCES of identity.h says it
    noun: ClassVar[str]  # what a name that is given to them is the name of
    columns: ClassVar[Mapping[str, str]]  # rows per axis whose start values they give: name -> unit
    default_note: ClassVar[str]  # a sentence on those that a unit is built with

    @property
    @abstractmethod
    def axis_names(self) -> tuple[str, ...]:
        """The axes that they describe, in their order."""

    @abstractmethod
    def files(self) -> dict[str, bytes]:
        """Archive path -> content, in the order in which they are hashed."""

    @abstractmethod
    def start(self, axis: str, row: str) -> str:
        """Start value of a row that `columns` names."""

    def given(self) -> Mapping[str, str]:
        """Start values of further parameters by the variables' names, as spelled."""
        return {}

    @abstractmethod
    def summary(self) -> str:
        """What they hold, in sentences."""

    @abstractmethod
    def embedded_source(self) -> bytes:
        """embedded_resources.c: what targets without files get, as the unit's embedded_resources.h declares it."""

    def experiment(self) -> Experiment:
        """What to simulate where nobody asks for anything else."""
        return Experiment()

    def hashed(self) -> bytes:
        """The bytes whose hash is the second half of the GUID."""
        return b"".join(self.files().values())


def constant(name: str, content: bytes) -> str:
    """C source of the bytes `content` with their size; of no bytes, one that is not counted: C has no empty array."""
    lines = (", ".join(map(str, content[i : i + 24])) for i in range(0, len(content), 24))
    body = ",\n    ".join(lines) or "0"
    size = f"sizeof {name}" if content else "0"
    return f"\nconst unsigned char {name}[] = {{\n    {body}}};\nconst size_t {name}_size = {size};\n"


def finite(text: str) -> float | None:
    """The finite number that `text` spells, by the rules of numbers.c; None where it does not."""
    if len(text.replace(".", "", 1)) > LONGEST_NUMBER or _NUMBER.fullmatch(text) is None:
        return None
    value = float(text)
    return value if math.isfinite(value) else None
