"""A file with the friction of one axis, as identification leaves it and machine files name it.

It holds the keys of `scenario.Friction` with their units, and in `identified` where they come from.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from feedsim import units
from feedsim.errors import OutputError
from feedsim.fields import Quantity
from feedsim.files.checked import read_checked
from feedsim.scenario.machine import Friction

# Relative 5e-8 at most: what is calculated from the file is that of the fit to 1e-6, and a person can still read it.
DIGITS = 8
WIDTH = 118


@dataclass(frozen=True)
class Line:
    """A parameter as it stands in the file: SI value, and a remark behind it."""

    value: float
    remark: str = ""


def friction_text(
    parameters: Mapping[str, Line], identified: Mapping[str, Any], head: Sequence[str] = (), *, name: str
) -> str:
    """Content of a friction file.

    parameters: keys of Friction, SI values. identified: plain values (text, numbers, lists, groups), kept by readers
    and not calculated with. head: lines of the comment at the top. name: of the file, for messages. Raises OutputError:
    a value is outside its allowed range or not finite, a key is unknown or missing.
    """
    known = _units()
    if unknown := [key for key in parameters if key not in known]:
        raise OutputError(
            f"{name} is not written: {unknown[0]!r} is no friction parameter; there are {', '.join(known)}"
        )
    rounded = {key: float(f"{line.value:.{DIGITS}g}") for key, line in parameters.items()}
    try:
        Friction.model_validate({**rounded, "identified": dict(identified)})
    except ValueError as error:  # pydantic's
        raise OutputError(f"{name} is not written: {_first_fault(error)}") from None
    lines = [f"# {line}".rstrip() for text in head for line in text.splitlines() or [""]]
    entries = [
        (f"{key}: {_number(rounded[key])} {known[key]}".removesuffix(" 1"), key) for key in known if key in rounded
    ]
    column = max(len(entry) for entry, _ in entries) + 3
    for entry, key in entries:
        remark = " ".join(parameters[key].remark.split())
        lines.append(f"{entry:<{column}}# {remark}" if remark else entry)
    if identified:
        content = {"identified": _plain(identified)}
        group: str = yaml.dump(content, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=WIDTH)
        lines += ["", "# Where the values come from: kept and shown, not calculated with.", group.rstrip("\n")]
    return "\n".join(lines) + "\n"


def read_friction(path: str | Path) -> Friction:
    """Read a friction file. Raises InputError that lists every problem with file and line."""
    return read_checked(path, Friction)


class _Dumper(yaml.SafeDumper):
    """Lists of plain values in one line; text that YAML 1.2 takes for a number in quotes, as PyYAML knows 1.1 only."""


def _text(dumper: _Dumper, value: str) -> yaml.ScalarNode:
    style = "'" if re.fullmatch(units.NUMBER, value) else None
    return dumper.represent_scalar("tag:yaml.org,2002:str", value, style=style)


def _list(dumper: _Dumper, values: list[Any]) -> yaml.SequenceNode:
    plain = not any(isinstance(value, (list, dict)) for value in values)
    return dumper.represent_sequence("tag:yaml.org,2002:seq", values, flow_style=plain)


_Dumper.add_representer(str, _text)
_Dumper.add_representer(list, _list)


def _units() -> dict[str, str]:
    """Name -> SI unit of every friction parameter, in the order of the file."""
    found = {name: Quantity.of(info) for name, info in Friction.model_fields.items()}
    return {name: quantity.unit for name, quantity in found.items() if quantity is not None}


def _number(value: float) -> str:
    """Shortest text of a number, without an exponent where that reads better."""
    if value == 0 or 1e-6 <= abs(value) < 1e9:
        places = 0 if value == 0 else max(0, DIGITS - 1 - math.floor(math.log10(abs(value))))
        text = f"{value:.{places}f}"
        return text.rstrip("0").rstrip(".") if "." in text else text
    return repr(value)


def _plain(value: Any) -> Any:
    """Values as YAML has them: numbers of Python, no tuples; what is not finite is left open."""
    if isinstance(value, Mapping):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(inner) for inner in value]
    if isinstance(value, bool) or value is None or isinstance(value, (str, int)):
        return value
    number = float(value)
    return number if math.isfinite(number) else None


def _first_fault(error: ValueError) -> str:
    details: list[Any] = getattr(error, "errors", list)()
    if not details:
        return str(error)
    place = ".".join(str(key) for key in details[0]["loc"])
    return f"{place}: {details[0]['msg']}"
