"""A file -> the model it is read as: the files that it names are fetched, every problem is reported with its line."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError

from feedsim.files.fields import ExistingFile, Quantity, ReadingContext, brief, did_you_mean, is_multiple
from feedsim.files.source import Mark, Place, Source, copy_tree, parse, read_yaml, resolve_reference, value_at
from feedsim.foundation import units
from feedsim.foundation.errors import InputError

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails


# --- Changes from outside: KEY=VALUE of the command line and the `set` group of a scenario ----------------------------


# --- What the models expect at a place of a file's tree: which keys, a group or a file name ---------------------------


def expected_annotation(model: Any, data: Any, place: Place) -> Any:
    """Annotation at `place` of a tree `data` that is read as `model`; None where no key of that name belongs."""
    annotation = resolve(model, data)
    for key in place:
        annotation = child(annotation, key)
        data = data[key] if _has_key(data, key) else None
        annotation = resolve(annotation, data)
        if annotation is None:
            return None
    return annotation


def child(annotation: Any, key: str | int) -> Any:
    """Annotation of what `key` names inside a value of `annotation` (resolved); None where there is no such key."""
    if is_model(annotation):
        return _annotation_of_field(annotation, key)
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is dict:
        return arguments[1]
    if origin is tuple and isinstance(key, int):
        return arguments[0] if arguments[-1] is Ellipsis else arguments[key] if key < len(arguments) else None
    return None


def resolve(annotation: Any, data: Any) -> Any:
    """Strip Annotated and Optional; of several models choose the one that the data's `kind` names."""
    while True:
        origin, arguments = get_origin(annotation), get_args(annotation)
        if origin is Annotated:
            if any(isinstance(note, ExistingFile) for note in arguments[1:]):
                return annotation
            annotation = arguments[0]
        elif _is_union(annotation):
            options = [option for option in arguments if option is not NoneType]
            if len(options) > 1:
                if all(map(kind_of, options)):
                    kind = data.get("kind") if isinstance(data, dict) else None
                    options = [option for option in options if kind_of(option) == kind]
                elif all(is_group(resolve(part, None)) for part in options):  # a key separates them
                    given = data if isinstance(data, dict) else {}
                    options = [part for part in options if _chooses_model(resolve(part, None), given)] or options
                else:  # a group or something else, as the data is
                    options = [part for part in options if is_group(resolve(part, None)) == isinstance(data, dict)]
                if not options:
                    return None
            annotation = options[0]
        else:
            return annotation


def kind_of(model: Any) -> str | None:
    """The `kind` that a model of a motion or an evaluation stands for."""
    info = model.model_fields.get("kind") if is_model(model) else None
    return info.default if info is not None else None


def separating_keys(model: Any, data: Any, place: Place) -> list[str]:
    """Keys that decide which of several models stands at `place` of a tree `data` that is read as `model`."""
    annotation = child(expected_annotation(model, data, place[:-1]), place[-1]) if place else None
    while get_origin(annotation) is Annotated:
        annotation = get_args(annotation)[0]
    parts = [resolve(part, None) for part in get_args(annotation)] if _is_union(annotation) else []
    return [part.TOLD_BY for part in parts if is_model(part) and getattr(part, "TOLD_BY", None)]


def keys(annotation: Any) -> list[str] | None:
    """Keys that a group may hold; None where keys are free (axis names) or it is no group."""
    return [info.alias or name for name, info in annotation.model_fields.items()] if is_model(annotation) else None


def suggest_key(annotation: Any, key: str, known: list[str]) -> str:
    """Tail of a message about a `key` that a group of `annotation` lacks: where it belongs, else what is `known`."""
    place = getattr(annotation, "ELSEWHERE", {}).get(key)
    return f"; it belongs to the {place}" if place else did_you_mean(key, known)


@lru_cache(maxsize=4096)  # a study asks thousands of times
def _annotation_of_field(model: Any, key: str | int) -> Any:
    """Annotation of what `key` names in a model; None where there is no such key."""
    info = field(model, key)
    return info and (Annotated[(info.annotation, *info.metadata)] if info.metadata else info.annotation)


def field(model: Any, key: str | int) -> FieldInfo | None:
    """The field of a model that a file's `key` fills; None where there is none."""
    return next((info for name, info in model.model_fields.items() if (info.alias or name) == key), None)


def _is_union(annotation: Any) -> bool:
    return get_origin(annotation) in (Union, UnionType)


def _chooses_model(model: Any, given: dict[str, Any]) -> bool:
    """Whether the keys of a group choose this one of several models."""
    return is_model(model) and model.TOLD_BY in given and given[model.TOLD_BY] not in model.BUT_FOR


def is_model(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def is_group(annotation: Any) -> bool:
    """Whether a mapping is expected."""
    return is_model(annotation) or get_origin(annotation) is dict


def names_file(annotation: Any) -> bool:
    """Whether a file name is expected."""
    return get_origin(annotation) is Annotated and any(
        isinstance(note, ExistingFile) for note in get_args(annotation)[1:]
    )


def _has_key(data: Any, key: str | int) -> bool:
    return (isinstance(data, dict) and key in data) or (
        isinstance(data, list) and isinstance(key, int) and 0 <= key < len(data)
    )


# --- Changes from outside: KEY=VALUE of the command line and the `set` group of a scenario ----------------------------


def options(text: str, folder: Path) -> list[tuple[str, Source]]:
    """Split "KEY=VALUE" and read VALUE as YAML; the name of a YAML file stands for the entries of its `set` group.

    Such files are what tuning leaves. InputError: no '=', no key, bad YAML; a file without such a group or with more.
    """
    key, equals, value = text.partition("=")
    where = f"--set {text}"
    if equals and key.strip():
        return [(key.strip(), parse(value, where, folder, lines=False))]
    if equals or not text.endswith((".yaml", ".yml")):
        example = "machine.axes.Z.friction.W='0 rad'"
        raise InputError(f"{where}: KEY=VALUE is needed, for example {example}, or a YAML file with a group `set`")
    source = read_yaml(folder / text)
    if not isinstance(source.data, dict) or [*source.data] != ["set"] or not isinstance(source.data["set"], dict):
        raise InputError(f"{where}: the file has to hold the group `set` with KEY: VALUE, and nothing else")
    return [*entries(source, "set")]


def spread(texts: Iterable[str]) -> list[str]:
    """KEY=VALUE each: entries in place of the files that `options` takes. InputError as there."""
    result = []
    for text in texts:
        many = [] if "=" in text else options(text, Path())
        result += [f"{key}={as_text(value.data)}" for key, value in many] or [text]
    return result


def entries(source: Source, group: str) -> Iterator[tuple[str, Source]]:
    """Keys and values of a group of settings, each with its place in the file."""
    for key, value in source.data[group].items():
        inner = {at[2:]: mark for at, mark in source.marks.items() if at[:2] == (group, key)}
        yield key, Source(value, inner)


def as_text(value: Any) -> str:
    """A value of the `set` group as it stands behind KEY= on the command line."""
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


def apply(source: Source, model: Any, key: str, value: Source) -> Iterator[Place]:
    """Set `value` at the dotted `key` in the tree; yields the places that were set.

    A number counts from 0 in a list; * stands for every key or entry there is, in a list of several kinds for every one
    that knows the next key. Groups that the model knows are made where they are missing. InputError: a key that does
    not belong there, an index out of range.
    """
    for place in list(places(source, model, key, value.marks[()])):
        source.put(place, Source(copy_tree(value.data), value.marks))
        yield place


def places(source: Source, model: Any, key: str, mark: Mark) -> Iterator[Place]:
    """The places that a dotted `key` stands for, as apply() has it; `mark` is named by what is raised."""
    yield from _places(source, model, (), key.split("."), key, mark)


def _places(source: Source, model: Any, place: Place, parts: list[str], key: str, mark: Mark) -> Iterator[Place]:
    if not parts:
        yield place
        return
    part, rest = parts[0], parts[1:]
    data = value_at(source.data, place)
    here = ".".join(str(item) for item in place) or f"the {model.__name__.lower()}"
    if part == "*" and isinstance(data, (dict, list)):
        names = (
            list(data)
            if isinstance(data, dict)
            else _entries_with_key(source, model, place, rest, f"{mark.where}: ", here)
        )
        for name in names:
            yield from _places(source, model, (*place, name), rest, key, mark)
        return
    if isinstance(data, list):
        if not part.isdecimal() or int(part) >= len(data):
            there = f"0 to {len(data) - 1}" if data else "none"
            raise InputError(f"{mark.where}: {here} is a list; {part!r} is no entry of it (entries: {there})")
        yield from _places(source, model, (*place, int(part)), rest, key, mark)
        return
    if not isinstance(data, dict):
        raise InputError(f"{mark.where}: {here} is {brief(data)}, which has no {part!r} inside")
    annotation = expected_annotation(model, source.data, place)
    known = keys(annotation)
    if known is not None and part not in (*known, *separating_keys(model, source.data, place)):
        raise InputError(f"{mark.where}: unknown key {part!r} in {here}{suggest_key(annotation, part, known)}")
    if rest and not isinstance(data.get(part), (dict, list)):
        inner = child(annotation, part)
        if part in data and data[part] is not None:
            raise InputError(f"{mark.where}: {here}.{part} is {brief(data[part])}, which has no {rest[0]!r} inside")
        if known is None or not is_group(resolve(inner, None)):
            raise InputError(f"{mark.where}: {here} has no {part!r}{did_you_mean(part, list(data))}")
        data[part] = {}
        source.marks[(*place, part)] = mark
    yield from _places(source, model, (*place, part), rest, key, mark)


def _entries_with_key(source: Source, model: Any, place: Place, rest: list[str], where: str, here: str) -> list[int]:
    """Entries of the list at `place` that know the next key: of several kinds, * means those that have it.

    InputError: none does.
    """
    entries = range(len(value_at(source.data, place)))
    if not rest or rest[0] == "*":
        return [*entries]
    known = [keys(expected_annotation(model, source.data, (*place, i))) for i in entries]
    indexes = [i for i in entries if known[i] is None or rest[0] in known[i]]  # type: ignore[operator]
    if entries and not indexes:
        words = [*dict.fromkeys(word for keys in known for word in keys or ())]
        raise InputError(f"{where}unknown key {rest[0]!r} in all entries of {here}{did_you_mean(rest[0], words)}")
    return indexes


# --- A file -> the model it is read as: the files that it names are fetched, every problem is reported with its
#     line


# --- Validation errors in words: where (file:line), which key, what is wrong, what is allowed -------------------------


def describe(source: Source, place: Place, message: str) -> str:
    """One problem as a line of text."""
    where = source.mark(place).where
    return f"{where}: {dotted_key(place)}: {message}" if place else f"{where}: {message}"


def dotted_key(place: Place) -> str:
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
        group = expected_annotation(model, source.data, place[:-1])
        known = keys(group) or []
        known += [] if place[:-1] or "motions" not in known else ["set"]
        return describe(source, place, f"unknown key{suggest_key(group, str(place[-1]), known)}")
    return describe(source, place, _message(source, model, detail, place))


def _message(source: Source, model: Any, detail: ErrorDetails, place: Place) -> str:
    kind, value, context = detail["type"], brief(detail["input"]), detail.get("ctx", {})
    if kind == "missing":
        return (
            f"missing; {_describe_expected(source, model, place)}"
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
    entries = get_args(expected_annotation(model, source.data, place[:-1]))
    return {2: "two", 3: "three"}.get(len(entries), str(len(entries)))


def _entries(count: int) -> str:
    return f"{count} entr{'y' if count == 1 else 'ies'}"


def _describe_expected(source: Source, model: Any, place: Place) -> str:
    """What belongs at a place, e.g. "a speed, for example 5000 mm/min"."""
    parent = expected_annotation(model, source.data, place[:-1])
    annotation = child(parent, place[-1])
    info = field(parent, place[-1]) if is_model(parent) else None
    description = info.description if info is not None else None
    if quantity := quantity_of(annotation):
        example = quantity.example or units.example(quantity.unit)
        text = f"{units.article(quantity.kind)}, for example {dotted_key(place[-1:])}: {example}"
    elif is_group(resolve(annotation, None)):
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
    parent = expected_annotation(model, source.data, place[:-1])
    union = child(parent, place[-1])
    while get_origin(union) not in (None,) and not all(is_model(part) for part in get_args(union)):
        union = get_args(union)[0]
    return [kind for part in get_args(union) if (kind := kind_of(part))]


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
    source = read_yaml(path)
    if not isinstance(source.data, dict):
        raise InputError(f"{source.mark(()).where}: a file of 'key: value' lines is expected, not {brief(source.data)}")
    return source


def read_checked(path: str | Path, model: type[M]) -> M:
    """A file as a model that needs no more than its own checks. InputError lists every problem with file and line."""
    return check_tree(read_group(Path(path)), model, path)


def check_tree(
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
    expected = child(expected_annotation(model, source.data, place[:-1]), place[-1]) if place else model
    _fetch_as(expected, source, place, faults)


def _fetch_as(expected: Any, source: Source, place: Place, faults: list[str]) -> None:
    """:func:`fetch` what is read as the annotation `expected`, None where no key of that name belongs."""
    data: Any = source.data
    for key in place:
        data = data[key]
    annotation = resolve(expected, data)
    if annotation is None:
        return
    if isinstance(data, str):
        is_file = names_file(annotation) and bool(data)
        is_group = is_model(annotation) and bool(annotation.IN_FOLDER or data.endswith((".yaml", ".yml")))
        if not (is_file or is_group):
            return
        try:
            named = resolve_reference(source.mark(place).folder, data)
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
            _fetch_as(expected, source, place, faults)
    elif isinstance(data, (dict, list)):
        for key, value in list(data.items() if isinstance(data, dict) else enumerate(data)):
            if isinstance(value, (str, dict, list)):  # numbers name no files
                _fetch_as(child(annotation, key), source, (*place, key), faults)


MAX_EXPLAINED = 200  # problems of a file that are listed
UNREAD = "(not read)"  # stands for the content of a file whose problem is reported already


def check(source: Source, model: type[M], faults: list[str]) -> M | None:
    try:
        return model.model_validate(source.data, context=reading_context(model, source.data))
    except ValidationError as error:
        details = error.errors()
        faults += [text for detail in details[:MAX_EXPLAINED] if (text := explain(source, model, detail, UNREAD))]
        if (more := len(details) - MAX_EXPLAINED) > 0:
            faults.append(describe(source, (), f"{more} more problems are not listed"))
        return None


def reading_context(model: Any, data: dict[str, Any]) -> ReadingContext:
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
    return ReadingContext(tuple(axes) if isinstance(axes, dict) and axes else None, control, position)


def _cycle(model: Any, data: dict[str, Any], place: Place) -> float | None:
    """A cycle [s]; None where it cannot be read, which is reported where it stands."""
    quantity = quantity_of(child(expected_annotation(model, data, place[:-1]), place[-1]))
    with suppress(PydanticCustomError):
        return quantity.read(value_at(data, place[:-1]).get(place[-1])) if quantity else None
    return None
