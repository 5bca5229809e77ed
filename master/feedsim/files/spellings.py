"""Units as drives and people spell them."""

from __future__ import annotations

from feedsim import units
from feedsim.errors import InputError

# What drives write that is no unit of its own: a whole unit -> the unit, and what to know about it.
SPELLINGS: dict[str, str] = {
    "increment": "1", "increments": "1", "inc": "1", "incs": "1", "count": "1", "counts": "1", "digits": "1",
    "inch": "in", "inches": "in", "turn": "rev", "turns": "rev", "revs": "rev", "revolutions": "rev",
    "r/min": "rpm", "u/min": "rpm", "upm": "rpm", "1/min": "rpm", "min-1": "rpm", "min^-1": "rpm",
    "a rms": "A", "arms": "A", "a(rms)": "A", "a_rms": "A", "aeff": "A", "a eff": "A",
}  # fmt: skip
RMS = ("a rms", "arms", "a(rms)", "a_rms", "aeff", "a eff")


def spelled(unit: str) -> str:
    """A unit as drives write it in the spelling of feedsim.units: "U/min" is rpm, "increments" a plain number."""
    return SPELLINGS.get(" ".join(unit.split()).lower(), unit)


def is_rms(unit: str) -> bool:
    """Whether a unit says that a current is an effective value."""
    return " ".join(unit.split()).lower() in RMS


def known_unit(unit: str) -> bool:
    """Whether text is a unit at all."""
    try:
        units.unit(spelled(unit))
    except InputError:
        return False
    return True
