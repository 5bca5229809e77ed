"""Validation errors in words: where (file:line), which key, what is wrong, what is allowed."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, get_args, get_origin

from feedsim import units
from feedsim.fields import Quantity, brief, did_you_mean
from feedsim.files import shape
from feedsim.files.source import Place, Source

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails


def describe(source: Source, place: Place, message: str) -> str:
    """One problem as a line of text."""
    where = source.mark(place).where
    return f"{where}: {dotted(place)}: {message}" if place else f"{where}: {message}"


def dotted(place: Place) -> str:
    """A place as the dotted key of --set."""
    return ".".join(str(key) for key in place)


def in_order(problems: Iterable[str]) -> list[str]:
    """Problems by file and line, each once; those without a line first."""

    def position(problem: str) -> tuple[str, int]:
        match = re.match(r"(.*?):([0-9]+): ", problem)
        return (match[1], int(match[2])) if match else ("", 0)

    return sorted(dict.fromkeys(problems), key=position)


def explain(source: Source, model: Any, detail: ErrorDetails, unread: str) -> str | None:
    """A pydantic error as one line; None where its value is `unread`, a file whose problem is reported already."""
    if detail["input"] == unread:
        return None
    if detail["type"] == "too_short" and len(detail["input"]) >= detail["ctx"]["min_length"]:
        return None  # pydantic does not count entries that are wrong themselves; those are reported
    place = _place(source.data, detail["loc"])
    if beside := detail.get("ctx", {}).get("beside"):
        place = (*place[:-1], *beside)
    if detail["type"] == "extra_forbidden":
        group = shape.expected(model, source.data, place[:-1])
        known = shape.keys(group) or []
        known += [] if place[:-1] or "motions" not in known else ["set"]
        return describe(source, place, f"unknown key{shape.instead(group, str(place[-1]), known)}")
    return describe(source, place, _message(source, model, detail, place))


def _message(source: Source, model: Any, detail: ErrorDetails, place: Place) -> str:
    kind, value, context = detail["type"], brief(detail["input"]), detail.get("ctx", {})
    if kind == "missing":
        return (
            f"missing; {_wanted(source, model, place)}"
            if isinstance(place[-1], str)
            else f"the list is too short; {_length(model, source, place)} entries are needed"
        )
    if kind == "union_tag_not_found":
        return f"missing key 'kind'; allowed: {', '.join(_words(model, source, place))}"
    if kind == "union_tag_invalid":
        return f"unknown kind {context['tag']!r}{did_you_mean(str(context['tag']), _words(model, source, place))}"
    if kind == "literal_error":
        allowed = re.findall(r"'([^']*)'", context["expected"]) or context["expected"].split(" or ")
        return f"{value} is not allowed here{did_you_mean(str(detail['input']), allowed)}"
    if kind in ("bool_type", "bool_parsing"):
        word = isinstance(detail["input"], str) and detail["input"].lower() in ("on", "off", "yes", "no", "y", "n")
        return f"{value} is neither true nor false" + ("; write true or false" if word else "")
    if kind in ("greater_than_equal", "less_than_equal"):
        limit = f"at least {context['ge']}" if "ge" in context else f"at most {context['le']}"
        return f"{value} is outside the allowed range: {limit}"
    if kind in ("too_short", "too_long"):
        limit = f"at least {context['min_length']}" if kind == "too_short" else f"at most {context['max_length']}"
        return (
            f"{_entries(context['actual_length'])}; {limit} needed"
            if kind == "too_short"
            else f"{_entries(context['actual_length'])}; {limit}"
        )
    simple = {
        "int_type": f"{value} is no whole number",
        "string_type": f"{value} is no text; put it in quotes if it is meant as text",
        "string_too_short": "the text is empty",
        "dict_type": f"{value}; a group of keys is expected, for example {{Z: 100 mm}}",
        "model_type": f"{value}; a group of keys is expected",
        "model_attributes_type": f"{value}; a group of keys is expected",
        "tuple_type": f"{value}; a list is expected",
        "list_type": f"{value}; a list is expected",
    }
    return simple.get(kind, detail["msg"])


def _length(model: Any, source: Source, place: Place) -> str:
    """How many entries the list has that lacks the one at `place`."""
    entries = get_args(shape.expected(model, source.data, place[:-1]))
    return {2: "two", 3: "three"}.get(len(entries), str(len(entries)))


def _entries(count: int) -> str:
    return f"{count} entr{'y' if count == 1 else 'ies'}"


def _wanted(source: Source, model: Any, place: Place) -> str:
    """What belongs at a place, e.g. "a speed, for example 5000 mm/min"."""
    parent = shape.expected(model, source.data, place[:-1])
    annotation = shape.child(parent, place[-1])
    info = shape.field(parent, place[-1]) if shape.is_model(parent) else None
    description = info.description if info is not None else None
    if quantity := quantity_of(annotation):
        example = quantity.example or units.example(quantity.unit)
        text = f"{units.article(quantity.kind)}, for example {dotted(place[-1:])}: {example}"
    elif shape.is_group(shape.resolve(annotation, None)):
        text = "a group of keys"
    else:
        text = ""
    return f"{text} ({description})" if text and description else text or description or "it is needed"


def quantity_of(annotation: Any) -> Quantity | None:
    """What quantity is expected where a field has `annotation` (not resolved); None where none is."""
    if isinstance(annotation, Quantity):
        return annotation
    for part in get_args(annotation) if get_origin(annotation) not in (dict, tuple) else ():
        if quantity := quantity_of(part):
            return quantity
    return None


def _words(model: Any, source: Source, place: Place) -> list[str]:
    """The kinds that may stand at a place in a list of motions or evaluations."""
    parent = shape.expected(model, source.data, place[:-1])
    union = shape.child(parent, place[-1])
    while get_origin(union) not in (None,) and not all(shape.is_model(part) for part in get_args(union)):
        union = get_args(union)[0]
    return [kind for part in get_args(union) if (kind := shape.kind_of(part))]


def _place(data: Any, loc: tuple[int | str, ...]) -> Place:
    """pydantic's location without what is no key of the data (names of union members, "[key]", "[list]")."""
    place: list[str | int] = []
    for i, key in enumerate(loc):
        last = i == len(loc) - 1
        if (isinstance(data, dict) and key in data) or (
            isinstance(data, (list, tuple)) and isinstance(key, int) and key < len(data)
        ):
            data = data[key]  # type: ignore[index]
            place.append(key)
        elif last and not str(key).startswith("[") and not (isinstance(data, dict) and key == data.get("kind")):
            place.append(key)
    return tuple(place)
