"""The table of names: which parameter of a control is which of ours, in which unit.

A row is confirmed where a public source was opened that states meaning and unit. What is not confirmed is shown, and
marked as such; it is never taken as an input, because a wrong unit would give a wrong value without a word.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal

from feedsim.foundation.errors import InputError

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
        acts: conditions under which it acts, in words that `feedsim.files.control.names` reads.
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


def find_name(number: str) -> Name | None:
    """The parameter that is filed under a number, such as MD32200, p1460 or S-0-0100; None where there is none."""
    return next((name for name in table() if name.number == number), None)


# --- Conditions under which a parameter of a control acts, as the column `acts` of the table has them -----------------
# Clauses stand between semicolons:
#
#     FFW_MODE=1|3            it acts where FFW_MODE is 1 or 3
#     p1657=1 or p1660=p1658  one of the two is enough
#     BACKLASH_FACTOR=1?      as the first one, and where the file has no such parameter as well
#     !FFW_MODE=1|3           as the first one, but else it may act in a way that we have not: that is a doubt
#     FFW_MODE=0: 0           there our value is 0; "off": the group of parameters is switched off
#     ~p1461=100              else there is a doubt: what is taken holds for a part alone
#
# A name is one of the control; behind a dot stands a bit, in brackets an element. On the right stands a number or
# another name, which a minus may precede. May use nothing. Start reading at judge_conditions().


ValueLookup = Callable[
    [str], "float | bool | str | None"
]  # name -> value; None: the file has none, several, or no number
LackExplanation = Callable[[str], str]  # name -> why there is no value
_TERM = re.compile(r"^(?P<name>[\w.@-]+?)(?P<element>\[\d+\])?=(?P<right>[^:?]+)(?P<free>\?)?$")
VALUE_TOLERANCE = 1e-9


@dataclass(frozen=True)
class ConditionVerdict:
    """What conditions say.

    state: "acts", "inactive", "unknown" (a parameter is missing), "case" (our value is `value`). reason: in words.
    doubts: what limits a value that is taken.
    """

    state: Literal["acts", "inactive", "unknown", "case"]
    value: str = ""
    reason: str = ""
    doubts: tuple[str, ...] = ()


def explain_absence(name: str) -> str:
    """Why a parameter has no value, of one that no file has."""
    return f"the file has no {name} (--assume)"


def judge_conditions(acts: str, look: ValueLookup, lack: LackExplanation = explain_absence) -> ConditionVerdict:
    """What the conditions say of a file; look: a parameter's value there; lack: why it has none."""
    doubts = []
    clauses = [clause.strip() for clause in acts.split(";") if clause.strip()]
    for clause in clauses:
        term, colon, value = clause.partition(": ")
        if colon and _evaluate_term(term, look)[0]:
            return ConditionVerdict("case", value.strip(), f"{term}")
    for clause in clauses:
        if ": " in clause:
            continue
        if clause.startswith("~"):
            holds, name = _evaluate_term(f"{clause[1:]}?", look)
            if holds is False:
                doubts.append(f"{name} is {value_text(look(name))}, not {clause[1:].partition('=')[2]}")
            continue
        unfit, clause = clause.startswith("!"), clause.removeprefix("!")
        result = [_evaluate_term(term.strip(), look) for term in clause.split(" or ")]
        if any(holds for holds, _ in result):
            continue
        unknown = [name for holds, name in result if holds is None]
        if unknown:
            reason = f"it acts where {clause.removesuffix('?')}, and {lack(unknown[0])}"
            return ConditionVerdict("unknown", reason=reason)
        name = result[0][1]
        reason = f"it acts where {clause.removesuffix('?')}; {name} is {value_text(look(name))}"
        if unfit:
            reason = f"it can be taken where {clause.removesuffix('?')}; {name} is {value_text(look(name))}"
        return ConditionVerdict("unknown" if unfit else "inactive", reason=reason)
    return ConditionVerdict("acts", doubts=tuple(doubts))


def tied_parameters(acts: str) -> list[tuple[str, str, float]]:
    """Pairs of parameters that are to be equal: name, other, and the sign of the other."""
    result = []
    for clause in re.split(r";| or ", acts):
        term = _TERM.match(clause.strip().lstrip("~!"))
        if term and re.match(r"^-?[pA-Z]\w*$", term["right"].strip()) and not term["right"].strip().isupper():
            right = term["right"].strip()
            result.append((term["name"] + (term["element"] or ""), right.lstrip("-"), -1.0 if right[0] == "-" else 1.0))
    return result


def condition_names(acts: str) -> list[str]:
    """Names that the conditions look up."""
    result = []
    for clause in acts.split(";"):
        for part in clause.partition(": ")[0].split(" or "):
            if term := _TERM.match(part.strip().lstrip("~!")):
                result.append(term["name"] + (term["element"] or ""))
                rights = (right.strip().lstrip("-") for right in term["right"].split("|"))
                result += [right for right in rights if not re.match(r"^[+]?[\d.]", right)]
    return result


def value_text(value: float | bool | str | None) -> str:
    """A value as messages have it."""
    return f"{value:g}" if isinstance(value, float) else str(value)


def _evaluate_term(term: str, look: ValueLookup) -> tuple[bool | None, str]:
    """Whether a term holds, None where the file does not say; and the name that it is of."""
    result = _TERM.match(term)
    assert result is not None, term
    name = result["name"] + (result["element"] or "")
    value = look(name)
    if value is None:
        return (True if result["free"] else None), name
    for right in result["right"].split("|"):
        right = right.strip()
        if re.match(r"^[+-]?[\d.]", right):
            wanted: float | bool | str | None = float(right)
        else:
            other = look(right.lstrip("-"))
            if other is None:
                return (True if result["free"] else None), right.lstrip("-")
            wanted = -float(other) if right.startswith("-") and not isinstance(other, str) else other
        if isinstance(value, str) or isinstance(wanted, str):
            if value == wanted:
                return True, name
        elif wanted is not None and math.isclose(float(value), float(wanted), rel_tol=VALUE_TOLERANCE, abs_tol=1e-300):
            return True, name
    return False, name
