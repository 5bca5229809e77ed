"""Tolerance files: how far a result may be from a reference, per variable in value and in time."""

from __future__ import annotations

import re
from math import inf, isfinite
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, PlainValidator, StrictBool, StrictStr, WithJsonSchema
from pydantic import model_validator as whole

from feedsim import units
from feedsim.errors import InputError
from feedsim.fields import Model, Quantity, brief, fault
from feedsim.files.checked import read_checked

Time = Annotated[float, Quantity("s", minimum=0, example="1 ms")]
EXAMPLE = "2 nm, or 1e-3 for a thousandth of the reference's range"


def _amount(value: Any) -> tuple[float, str]:
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise fault(f"{brief(value)} is no tolerance; write for example {EXAMPLE}")
    if not isinstance(value, str):
        number, unit = float(value) if abs(value) < 1e308 else inf, ""
    else:
        match = re.fullmatch(rf"\s*({units.NUMBER})\s*(.*)", value, re.DOTALL)
        if not match:
            raise fault(f"{value!r} is no tolerance; write for example {EXAMPLE}")
        number, unit = float(match[1]), match[2].strip()
        if unit == "%":
            number, unit = number / 100, ""
        try:
            units.unit(unit or "1")
        except InputError as error:
            raise fault(f"{value!r}: {error}") from None
    if not (isfinite(number) and number >= 0):
        raise fault(f"{value} is outside the allowed range: 0 or more")
    return number, unit


# A number (share of the range), or a number with any unit; becomes (value, unit), unit "" for a share.
_TEXT = {"type": "string", "pattern": rf"^\s*{units.NUMBER}", "examples": ["2 nm", "0.1 %"]}
_NUMBER = {"type": "number", "minimum": 0}
Amount = Annotated[tuple[float, str], PlainValidator(_amount), WithJsonSchema({"anyOf": [_NUMBER, _TEXT]})]


class VariableTolerance(Model):
    """Tolerance of the variables of a pattern; what is left out is that of an earlier pattern, else of the file."""

    value: Amount | None = Field(
        default=None, description="In value: 2 nm; a bare number is a share of the reference's range"
    )
    time: Time | None = Field(default=None, description="In time: 1 ms")
    hold: StrictBool | None = Field(
        default=None,
        description="Whether values hold between rows instead of running straight to the next; left out: where the "
        "reference is 0 and 1 alone",
    )
    ignore: Literal[True] | None = Field(default=None, description="Not compared at all")

    @whole(mode="before")
    @classmethod
    def _in_short(cls, value: Any) -> Any:
        if value == "ignore":
            return {"ignore": True}
        if isinstance(value, (str, int, float)) and not isinstance(value, bool):
            return {"value": value}
        return value


class ToleranceFile(Model):
    """A tolerance file."""

    name: StrictStr = Field(default="", description="Name in reports")
    note: StrictStr = Field(default="", description="Why the tolerances are what they are")
    value: Amount | None = Field(
        default=None, description="In value, of all variables: a share of the reference's range"
    )
    time: Time | None = Field(default=None, description="In time, of all variables")
    variables: dict[StrictStr, VariableTolerance] = Field(
        default={}, description="Pattern of names (*.x_a) -> tolerance; later ones count more"
    )


def load_tolerances(path: str | Path) -> ToleranceFile:
    """Read and check a tolerance file. InputError lists every problem with file and line."""
    return read_checked(path, ToleranceFile)
