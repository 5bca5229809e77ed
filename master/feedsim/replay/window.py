"""The part of a record that counts: from one instant or block of its program to another."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from feedsim import units
from feedsim.errors import InputError
from feedsim.trace import Mark

_TIME = re.compile(r"[-+.\d]")  # what a time begins with; a block of a program does not
_COUNTED = re.compile(r"(.*?)\s*#(\d+)")
MAX_MARKS_NAMED = 12


def window(text: str, marks: Sequence[Mark]) -> tuple[float, float]:
    """Begin and end [s] of "BEGIN..END", each a time or a block of the program; of "BLOCK" alone that block.

    A block is named by what its line begins with, "N130" or "G0 AX", and where several begin so by its number among
    them, "N130 #2". It lasts until the next one; the last one has no end: inf.

    Raises InputError: not of this form; a time that is none; a block that is not there, or there several times.
    """
    begin, dots, end = (part.strip() for part in text.partition(".."))
    if not begin or (dots and not end) or (not dots and _TIME.match(begin)):
        raise InputError("BEGIN..END is needed, such as '0.5 s..2 s', or the name of a block of the record")
    first, last = _span(begin, marks)[0], _span(end or begin, marks)[1]
    if not first < last:
        raise InputError("the begin is not ahead of the end")
    return first, last


def _span(part: str, marks: Sequence[Mark]) -> tuple[float, float]:
    """Begin and end [s] of a part of what was typed."""
    if _TIME.match(part):
        at = units.parse(part, "s", "0.5 s")
        return at, at
    counted = _COUNTED.fullmatch(part)
    name, number = (counted[1], int(counted[2])) if counted else (part, None)
    indexes = [i for i, mark in enumerate(marks) if _begins(mark.text, name)]
    if not indexes or (number is not None and not 1 <= number <= len(indexes)):
        there = "; ".join(dict.fromkeys(_short(mark.text) for mark in marks)) if len(marks) <= MAX_MARKS_NAMED else ""
        known = f"there is {there}" if there else _known(marks)
        how_often = f"{name!r} begins {len(indexes)} of them" if indexes else f"none begins with {name!r}"
        raise InputError(f"of the {len(marks)} blocks of the record {how_often}; {known}")
    if number is None and len(indexes) > 1:
        times = ", ".join(f"{marks[i].time:.6g} s" for i in indexes[:MAX_MARKS_NAMED])
        raise InputError(
            f"{len(indexes)} blocks of the record begin with {name!r}, at {times}; say which, for example {name} #2"
        )
    i = indexes[(number or 1) - 1]
    return marks[i].time, marks[i + 1].time if i + 1 < len(marks) else math.inf


def _begins(text: str, name: str) -> bool:
    """Whether a block begins with a name, which ends where a word of it does: N1 is not N10."""
    own, asked = " ".join(text.split()).lower(), " ".join(name.split()).lower()
    rest = own[len(asked) :]
    return own.startswith(asked) and not (asked[-1].isalnum() and rest[:1].isalnum())


def _short(text: str) -> str:
    return text if len(text) <= 24 else f"{text[:20]} ..."


def _known(marks: Sequence[Mark]) -> str:
    first = dict.fromkeys(text.split()[0] for mark in marks if (text := mark.text.strip()))
    shown = [_short(name) for name in first][:MAX_MARKS_NAMED]
    return f"they begin with {', '.join(shown)}{' ...' if len(first) > len(shown) else ''}" if shown else "it has none"
