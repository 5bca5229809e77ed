"""The table of names: which parameter of a control is which of ours, in which unit.

A row is confirmed where a public source was opened that states meaning and unit. What is not confirmed is shown, and
marked as such; it is never taken as an input, because a wrong unit would give a wrong value without a word.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from feedsim.errors import InputError

FILE = Path(__file__).with_name("names.csv")
CONTROLS = ("sinumerik", "twincat", "heidenhain", "linuxcnc")


@dataclass(frozen=True)
class Name:
    """A parameter of a control.

    Attributes:
        control: one of CONTROLS.
        parameter: ours, below the axis of a machine file, such as "drive.K_v".
        number: how the control files it, such as "MD32200"; the key that scenarios accept.
        name: what the control calls it.
        unit: of the control's value. factor: our value in SI over the control's value.
        si: unit of our value; "" of a switch.
        confirmed: whether a public source with meaning and unit was opened. source: which.
    """

    control: str
    parameter: str
    number: str
    name: str
    unit: str
    factor: float
    si: str
    confirmed: bool
    source: str

    def shown(self, value: float) -> float:
        """The control's value of an SI value."""
        return value / self.factor

    def ours(self, value: float) -> float:
        """The SI value of a value of the control."""
        return value * self.factor

    def text(self, value: float) -> str:
        """Number, name and value in the control's unit, for a sentence: "MD32200 POSCTRL_GAIN 4 1000/min"."""
        unit = f" {self.unit}" if self.unit not in ("", "1") else ""
        doubt = "" if self.confirmed else " (unit not confirmed)"
        return f"{self.number} {self.name} {self.shown(value):.6g}{unit}{doubt}"


@cache
def table() -> tuple[Name, ...]:
    """All rows, in the order of the file."""
    with FILE.open(encoding="utf-8", newline="") as file:
        return tuple(
            Name(
                row["control"], row["parameter"], row["number"], row["name"], row["unit"], float(row["factor"]),
                row["SI unit"], row["confirmed"] == "yes", row["source"],
            )
            for row in csv.DictReader(file)
        )  # fmt: skip


def names_of(control: str) -> Mapping[str, Name]:
    """Our parameter -> its name in a control. InputError: no such control."""
    if control not in CONTROLS:
        raise InputError(f"control {control!r} is not known; known are {', '.join(CONTROLS)}")
    return {each.parameter: each for each in table() if each.control == control}


def known(number: str) -> Name | None:
    """The parameter that is filed under a number, such as MD32200, p1460 or S-0-0100; None where there is none."""
    return next((each for each in table() if each.number == number), None)
