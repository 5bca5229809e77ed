"""Variables of the shipped units as the units' tables (src/*_fmu/variables.def) declare them: the source of unit,
range, start value and description of what people write in machine files.

May use: units, errors. Start reading at table(). `make fmus` writes variables.json beside this file.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from math import inf
from pathlib import Path
from typing import Any

from feedsim.foundation import units
from feedsim.foundation.errors import InputError
from feedsim.foundation.installation import mend

NAMES = ("Coulomb", "Stribeck")  # of persons: they stay as they are within a sentence
FILE = Path(__file__).with_name("variables.json")


@dataclass(frozen=True)
class Variable:
    """A row of a unit's table. kind: REAL, INTEGER, BOOLEAN or STRING; a REAL has a unit and one that people use."""

    kind: str
    causality: str
    start: float | str
    text: str
    unit: str = ""
    display_unit: str = ""
    minimum: float = -inf
    maximum: float = inf

    @property
    def short(self) -> str:
        """What the description is about, for a table's row: without what is in brackets and behind a semicolon."""
        about = re.split(r"[;:]", re.sub(r" \([^)]*\)", "", self.text))[0]
        return about if about.startswith(NAMES) else about[:1].lower() + about[1:]

    @property
    def example(self) -> str:
        """The start value with the unit in which it is shorter; "" where it is zero, which shows nobody anything."""
        if self.kind != "REAL" or not self.start:
            return ""
        if self.unit == units.DIMENSIONLESS:
            return f"{self.start:.4g}"
        value, own = float(self.start), (self.unit, self.display_unit)
        return min(
            (f"{units.convert(value, self.unit, unit):.4g} {unit}" for unit in own), key=lambda text: text.index(" ")
        )


@cache
def table(unit: str) -> Mapping[str, Variable]:
    """Name -> variable of a shipped unit, in the order of its table. InputError: the tables have not been made yet."""
    return {name: Variable(**entry) for name, entry in _read()[unit].items()}


def parameters(unit: str) -> Mapping[str, Variable]:
    """The parameters alone."""
    return {name: variable for name, variable in table(unit).items() if variable.causality == "parameter"}


def cycle() -> Mapping[str, list[list[Any]]]:
    """Rows of the control cycle by their tables (src/machine_fmu/cycle.h, which says what they mean)."""
    rows: dict[str, list[list[Any]]] = _read()["machine/cycle"]
    return rows


@cache
def _read() -> dict[str, Any]:
    try:
        content: dict[str, Any] = json.loads(FILE.read_bytes())
    except FileNotFoundError:
        raise InputError(f"{FILE} is missing; {mend('it from the tables of the units')}") from None
    return content
