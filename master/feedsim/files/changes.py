"""Changes from outside: KEY=VALUE of the command line and the `set` group of a scenario."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from feedsim.errors import InputError
from feedsim.fields import brief, did_you_mean
from feedsim.files import shape
from feedsim.files.source import Mark, Place, Source, at, copied, parse, read


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
    annotation = shape.expected(model, source.data, place)
    known = shape.keys(annotation)
    if known is not None and part not in (*known, *shape.separating(model, source.data, place)):
        raise InputError(f"{mark.where}: unknown key {part!r} in {here}{shape.instead(annotation, part, known)}")
    if rest and not isinstance(data.get(part), (dict, list)):
        inner = shape.child(annotation, part)
        if part in data and data[part] is not None:
            raise InputError(f"{mark.where}: {here}.{part} is {brief(data[part])}, which has no {rest[0]!r} inside")
        if known is None or not shape.is_group(shape.resolve(inner, None)):
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
    known = [shape.keys(shape.expected(model, source.data, (*place, i))) for i in entries]
    indexes = [i for i in entries if known[i] is None or rest[0] in known[i]]  # type: ignore[operator]
    if entries and not indexes:
        words = [*dict.fromkeys(word for keys in known for word in keys or ())]
        raise InputError(f"{where}unknown key {rest[0]!r} in all entries of {here}{did_you_mean(rest[0], words)}")
    return indexes
