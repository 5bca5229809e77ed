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

NAMES_FILE = Path(__file__).with_name("names.csv")
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
        key: what files of the control call it, without indices.
        acts: conditions under which it acts, in words that `feedsim.control.conditions` reads.
        codes: the control's number -> our value, of an enumeration. times: parameters of the control whose ratio our
        value is the control's value times.
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
    key: str = ""
    acts: str = ""
    codes: tuple[tuple[int, bool | str], ...] = ()
    times: tuple[str, ...] = ()

    def shown(self, value: float) -> float:
        """The control's value of an SI value."""
        return next((float(code) for code, ours in self.codes if ours == value), value / self.factor)

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
    with NAMES_FILE.open(encoding="utf-8", newline="") as file:
        return tuple(
            Name(
                row["control"], row["parameter"], row["number"], row["name"], row["unit"], float(row["factor"]),
                row["SI unit"], row["confirmed"] == "yes", row["source"], row["key"] or _key(row), row["acts"],
                _codes(row["codes"]), tuple(row["times"].split("/")) if row["times"] else (),
            )
            for row in csv.DictReader(file)
        )  # fmt: skip


def _key(row: Mapping[str, str]) -> str:
    """Machine data are filed by their names, all else by its number."""
    return row["name"] if row["number"].startswith("MD") else row["number"].partition(".")[0]


def _codes(text: str) -> tuple[tuple[int, bool | str], ...]:
    """Of "1: true; 3: false"."""
    pairs = [part.split(": ") for part in text.split("; ") if part]
    return tuple((int(code), {"true": True, "false": False}.get(ours, ours)) for code, ours in pairs)


def names_of(control: str) -> Mapping[str, Name]:
    """Our parameter -> its name in a control. InputError: no such control."""
    if control not in CONTROLS:
        raise InputError(f"control {control!r} is not known; known are {', '.join(CONTROLS)}")
    names: dict[str, Name] = {}
    for name in table():
        if name.control == control:
            names.setdefault(name.parameter, name)
    return names


def known(number: str) -> Name | None:
    """The parameter that is filed under a number, such as MD32200, p1460 or S-0-0100; None where there is none."""
    return next((name for name in table() if name.number == number), None)
