"""Field types of a machine written as geometry: points, directions, names of nodes."""

from __future__ import annotations

import re
from functools import partial
from math import hypot, isfinite
from typing import Annotated, Any

from pydantic import PlainValidator, WithJsonSchema

from feedsim.fields import Quantity, brief, fault

NAME_PATTERN = r"[A-Za-z][A-Za-z0-9_]*"
NODE = rf"{NAME_PATTERN}(?:\.[0-9]+)?"
NODES = rf"{NAME_PATTERN}(?:\.[0-9]+(?:\.\.[0-9]+)?)?"
FRAME = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}

Length = Annotated[float, Quantity("m")]
Point = tuple[Length, Length, Length]
Stiffness = Annotated[float, Quantity("N/m", above=0)]
StiffnessOrNone = Annotated[float, Quantity("N/m", minimum=0)]
Mass = Annotated[float, Quantity("kg", above=0)]
Inertia = Annotated[float, Quantity("kg.m^2", minimum=0)]


def _text(pattern: str, what: str) -> tuple[PlainValidator, WithJsonSchema]:
    """Text of a pattern; `what` says what it is in messages."""
    return PlainValidator(partial(_read, pattern, what)), WithJsonSchema(_schema(pattern))


def _texts(pattern: str, what: str) -> tuple[PlainValidator, WithJsonSchema]:
    """One text of the pattern or a list of them; kept as a tuple."""

    def read(value: Any) -> tuple[str, ...]:
        if isinstance(value, (list, tuple)):
            if not value:
                raise fault(f"an empty list; a {what} is needed")
            return tuple(_read(pattern, what, item) for item in value)
        return (_read(pattern, what, value),)

    one = _schema(pattern)
    return PlainValidator(read), WithJsonSchema({"anyOf": [one, {"type": "array", "items": one, "minItems": 1}]})


def _read(pattern: str, what: str, value: Any) -> str:
    if not isinstance(value, str) or not re.fullmatch(pattern, value):
        raise fault(f"{brief(value)} is no {what}")
    return value


def _schema(pattern: str) -> dict[str, Any]:
    return {"type": "string", "pattern": f"^(?:{pattern})$"}


def _direction(value: Any) -> tuple[float, float, float]:
    shown = "a direction is expected: X, Y or Z of the frame, -X, -Y, -Z, or a list of three numbers"
    if isinstance(value, str):
        sign, letter = (-1.0, value[1:]) if value.startswith("-") else (1.0, value.removeprefix("+"))
        if letter not in FRAME:
            raise fault(f"{brief(value)}; {shown}")
        x, y, z = (sign * part + 0.0 for part in FRAME[letter])
        return x, y, z
    if not isinstance(value, (list, tuple)) or len(value) != 3:
        raise fault(f"{brief(value)}; {shown}")
    if any(isinstance(part, bool) or not isinstance(part, (int, float)) for part in value):
        raise fault(f"a direction takes plain numbers, for example [0, 0.6, 0.8]; {shown}")
    length = hypot(*value)
    if not isfinite(length) or length < 1e-12:
        raise fault(f"[{', '.join(str(part) for part in value)}] points nowhere; {shown}")
    x, y, z = (float(part) / length for part in value)
    return x, y, z


# A direction in the machine's frame: X, -X, ... or a list of three numbers; kept as a unit vector.
_DIRECTION_LETTERS = {"type": "string", "enum": [sign + letter for sign in ("", "-", "+") for letter in FRAME]}
_VECTOR = {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}
Direction = Annotated[
    tuple[float, float, float], PlainValidator(_direction), WithJsonSchema({"anyOf": [_DIRECTION_LETTERS, _VECTOR]})
]
Name = Annotated[str, *_text(NAME_PATTERN, "name: a letter, then letters, digits and _")]
# Inside a body: one node; a node, a node of a line, some of its nodes, all of them.
OwnNode = Annotated[str, *_text(NODE, "node of this body, such as top or post.3")]
Nodes = Annotated[tuple[str, ...], *_texts(NODES, "node of this body, such as top, post.3, post.2..6 or post (all)")]
NodeList = tuple[Annotated[str, *_text(NODES, "node of this body, such as top, post.3, post.2..6 or post (all)")], ...]
# Anywhere: the body first.
BodyNode = Annotated[str, *_text(rf"{NAME_PATTERN}\.{NODE}", "node, such as column.top or bed.rail.3")]
Rail = Annotated[str, *_text(rf"{NAME_PATTERN}\.{NAME_PATTERN}", "line of nodes, such as bed.rail")]
Hold = Annotated[
    tuple[str, ...],
    *_texts(
        rf"{NAME_PATTERN}\.{NODE}|rail {NAME_PATTERN}\.{NAME_PATTERN}",
        "place to hold on to: a node such as column.top or bed.rail.3, a list of nodes, or 'rail bed.rail'",
    ),
]
