"""A file -> the model it is read as: the files that it names are fetched, every problem is reported with its line."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import PydanticCustomError

from feedsim.files import changes
from feedsim.files.fields import Quantity, Reading, brief, did_you_mean, is_multiple
from feedsim.files.regular import referred
from feedsim.files.source import Place, Source, at, read
from feedsim.foundation import units
from feedsim.foundation.errors import InputError

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails


# --- Validation errors in words: where (file:line), which key, what is wrong, what is allowed -------------------------


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
        group = changes.expected(model, source.data, place[:-1])
        known = changes.keys(group) or []
        known += [] if place[:-1] or "motions" not in known else ["set"]
        return describe(source, place, f"unknown key{changes.instead(group, str(place[-1]), known)}")
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
    entries = get_args(changes.expected(model, source.data, place[:-1]))
    return {2: "two", 3: "three"}.get(len(entries), str(len(entries)))


def _entries(count: int) -> str:
    return f"{count} entr{'y' if count == 1 else 'ies'}"


def _wanted(source: Source, model: Any, place: Place) -> str:
    """What belongs at a place, e.g. "a speed, for example 5000 mm/min"."""
    parent = changes.expected(model, source.data, place[:-1])
    annotation = changes.child(parent, place[-1])
    info = changes.field(parent, place[-1]) if changes.is_model(parent) else None
    description = info.description if info is not None else None
    if quantity := quantity_of(annotation):
        example = quantity.example or units.example(quantity.unit)
        text = f"{units.article(quantity.kind)}, for example {dotted(place[-1:])}: {example}"
    elif changes.is_group(changes.resolve(annotation, None)):
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
    parent = changes.expected(model, source.data, place[:-1])
    union = changes.child(parent, place[-1])
    while get_origin(union) not in (None,) and not all(changes.is_model(part) for part in get_args(union)):
        union = get_args(union)[0]
    return [kind for part in get_args(union) if (kind := changes.kind_of(part))]


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


# --- A file -> the model it is read as: the files that it names are fetched, every problem is reported with its
#     line


M = TypeVar("M", bound=BaseModel)
Faults = Iterable[tuple[Place, str]]


def read_group(path: Path) -> Source:
    source = read(path)
    if not isinstance(source.data, dict):
        raise InputError(f"{source.mark(()).where}: a file of 'key: value' lines is expected, not {brief(source.data)}")
    return source


def read_checked(path: str | Path, model: type[M]) -> M:
    """A file as a model that needs no more than its own checks. InputError lists every problem with file and line."""
    return checked(read_group(Path(path)), model, path)


def checked(
    source: Source, model: type[M], path: str | Path, contradictions: Callable[[M], Faults] = lambda _: ()
) -> M:
    """The tree of the file `path` as a model; `contradictions`: place and message of what cannot go together in it.

    InputError lists every problem with file and line.
    """
    faults: list[str] = []
    fetch(source, model, (), faults)
    result = check(source, model, faults)
    if result is not None:
        faults += [describe(source, place, message) for place, message in contradictions(result)]
    if faults or result is None:
        raise InputError.of(str(path), in_order(faults))
    return result


def fetch(source: Source, model: Any, place: Place, faults: list[str]) -> None:
    """Replace names of YAML files, where a group of keys is expected, by what the files hold; make other file names
    relative to the file that names them."""
    data: Any = source.data
    for key in place:
        data = data[key]
    annotation = changes.expected(model, source.data, place)
    if annotation is None:
        return
    if isinstance(data, str):
        is_file = changes.names_file(annotation) and bool(data)
        is_group = changes.is_model(annotation) and bool(annotation.IN_FOLDER or data.endswith((".yaml", ".yml")))
        if not (is_file or is_group):
            return
        try:
            named = referred(source.mark(place).folder, data)
        except InputError as error:
            faults.append(describe(source, place, str(error)))
            source.put(place, Source(UNREAD, {(): source.mark(place)}))
            return
        if is_file:
            parent: Any = source.data
            for key in place[:-1]:
                parent = parent[key]
            parent[place[-1]] = str(named)
        else:
            file = named / annotation.IN_FOLDER if annotation.IN_FOLDER and named.is_dir() else named
            try:
                source.put(place, read_group(file))
            except InputError as error:
                inside = f"{file}:" in error.problems[0]
                faults += error.problems if inside else [describe(source, place, str(error))]
                source.put(place, Source(UNREAD, {(): source.mark(place)}))
                return
            fetch(source, model, place, faults)
    elif isinstance(data, dict):
        for key in data:
            fetch(source, model, (*place, key), faults)
    elif isinstance(data, list):
        for i in range(len(data)):
            fetch(source, model, (*place, i), faults)


MAX_EXPLAINED = 200  # problems of a file that are listed
UNREAD = "(not read)"  # stands for the content of a file whose problem is reported already


def check(source: Source, model: type[M], faults: list[str]) -> M | None:
    try:
        return model.model_validate(source.data, context=reading(model, source.data))
    except ValidationError as error:
        details = error.errors()
        faults += [text for detail in details[:MAX_EXPLAINED] if (text := explain(source, model, detail, UNREAD))]
        if (more := len(details) - MAX_EXPLAINED) > 0:
            faults.append(describe(source, (), f"{more} more problems are not listed"))
        return None


def reading(model: Any, data: dict[str, Any]) -> Reading:
    """What single values of a file read as `model` can be checked against, as far as its machine can be read."""
    place: Place = ("machine",) if "machine" in data else ()
    machine = data.get("machine", data)
    machine = machine if isinstance(machine, dict) else {}
    axes, cycles = machine.get("axes"), machine.get("cycles")
    control, position = (
        _cycle(model, data, (*place, "cycles", name)) if isinstance(cycles, dict) else None
        for name in ("control", "position")
    )
    if control and position and not is_multiple(position, control):
        position = None
    return Reading(tuple(axes) if isinstance(axes, dict) and axes else None, control, position)


def _cycle(model: Any, data: dict[str, Any], place: Place) -> float | None:
    """A cycle [s]; None where it cannot be read, which is reported where it stands."""
    quantity = quantity_of(changes.child(changes.expected(model, data, place[:-1]), place[-1]))
    with suppress(PydanticCustomError):
        return quantity.read(at(data, place[:-1]).get(place[-1])) if quantity else None
    return None
