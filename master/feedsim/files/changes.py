"""Changes from outside: KEY=VALUE of the command line and the `set` group of a scenario."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from feedsim.files.fields import ExistingFile, brief, did_you_mean
from feedsim.files.source import Mark, Place, Source, at, copied, parse, read
from feedsim.foundation.errors import InputError

# --- What the models expect at a place of a file's tree: which keys, a group or a file name ---------------------------


def expected(model: Any, data: Any, place: Place) -> Any:
    """Annotation at `place` of a tree `data` that is read as `model`; None where no key of that name belongs."""
    annotation = resolve(model, data)
    for key in place:
        annotation = child(annotation, key)
        data = data[key] if _holds(data, key) else None
        annotation = resolve(annotation, data)
        if annotation is None:
            return None
    return annotation


def child(annotation: Any, key: str | int) -> Any:
    """Annotation of what `key` names inside a value of `annotation` (resolved); None where there is no such key."""
    if is_model(annotation):
        info = field(annotation, key)
        if info is None:
            return None
        return Annotated[(info.annotation, *info.metadata)] if info.metadata else info.annotation
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
                    options = [part for part in options if _fits(resolve(part, None), given)] or options
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


def separating(model: Any, data: Any, place: Place) -> list[str]:
    """Keys that decide which of several models stands at `place` of a tree `data` that is read as `model`."""
    annotation = child(expected(model, data, place[:-1]), place[-1]) if place else None
    while get_origin(annotation) is Annotated:
        annotation = get_args(annotation)[0]
    parts = [resolve(part, None) for part in get_args(annotation)] if _is_union(annotation) else []
    return [part.TOLD_BY for part in parts if is_model(part) and getattr(part, "TOLD_BY", None)]


def keys(annotation: Any) -> list[str] | None:
    """Keys that a group may hold; None where keys are free (axis names) or it is no group."""
    return [info.alias or name for name, info in annotation.model_fields.items()] if is_model(annotation) else None


def instead(annotation: Any, key: str, known: list[str]) -> str:
    """Tail of a message about a `key` that a group of `annotation` lacks: where it belongs, else what is `known`."""
    place = getattr(annotation, "ELSEWHERE", {}).get(key)
    return f"; it belongs to the {place}" if place else did_you_mean(key, known)


def field(model: Any, key: str | int) -> FieldInfo | None:
    """The field of a model that a file's `key` fills; None where there is none."""
    return next((info for name, info in model.model_fields.items() if (info.alias or name) == key), None)


def _is_union(annotation: Any) -> bool:
    return get_origin(annotation) in (Union, UnionType)


def _fits(model: Any, given: dict[str, Any]) -> bool:
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


def _holds(data: Any, key: str | int) -> bool:
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
    source = read(folder / text)
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
        source.put(place, Source(copied(value.data), value.marks))
        yield place


def places(source: Source, model: Any, key: str, mark: Mark) -> Iterator[Place]:
    """The places that a dotted `key` stands for, as apply() has it; `mark` is named by what is raised."""
    yield from _places(source, model, (), key.split("."), key, mark)


def _places(source: Source, model: Any, place: Place, parts: list[str], key: str, mark: Mark) -> Iterator[Place]:
    if not parts:
        yield place
        return
    part, rest = parts[0], parts[1:]
    data = at(source.data, place)
    here = ".".join(str(item) for item in place) or f"the {model.__name__.lower()}"
    if part == "*" and isinstance(data, (dict, list)):
        names = list(data) if isinstance(data, dict) else _having(source, model, place, rest, f"{mark.where}: ", here)
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
    annotation = expected(model, source.data, place)
    known = keys(annotation)
    if known is not None and part not in (*known, *separating(model, source.data, place)):
        raise InputError(f"{mark.where}: unknown key {part!r} in {here}{instead(annotation, part, known)}")
    if rest and not isinstance(data.get(part), (dict, list)):
        inner = child(annotation, part)
        if part in data and data[part] is not None:
            raise InputError(f"{mark.where}: {here}.{part} is {brief(data[part])}, which has no {rest[0]!r} inside")
        if known is None or not is_group(resolve(inner, None)):
            raise InputError(f"{mark.where}: {here} has no {part!r}{did_you_mean(part, list(data))}")
        data[part] = {}
        source.marks[(*place, part)] = mark
    yield from _places(source, model, (*place, part), rest, key, mark)


def _having(source: Source, model: Any, place: Place, rest: list[str], where: str, here: str) -> list[int]:
    """Entries of the list at `place` that know the next key: of several kinds, * means those that have it.

    InputError: none does.
    """
    entries = range(len(at(source.data, place)))
    if not rest or rest[0] == "*":
        return [*entries]
    known = [keys(expected(model, source.data, (*place, i))) for i in entries]
    indexes = [i for i in entries if known[i] is None or rest[0] in known[i]]  # type: ignore[operator]
    if entries and not indexes:
        words = [*dict.fromkeys(word for keys in known for word in keys or ())]
        raise InputError(f"{where}unknown key {rest[0]!r} in all entries of {here}{did_you_mean(rest[0], words)}")
    return indexes
