"""Changes from outside: KEY=VALUE of the command line and the `set` group of a scenario."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from feedsim.errors import InputError
from feedsim.scenario import shape
from feedsim.scenario.fields import brief, did_you_mean
from feedsim.scenario.source import Mark, Place, Source, at, copied, parse


def option(text: str, folder: Path) -> tuple[str, Source]:
    """Split "KEY=VALUE" and read VALUE as YAML. InputError: no '=', no key, bad YAML."""
    key, equals, value = text.partition("=")
    where = f"--set {text}"
    if not equals or not key.strip():
        raise InputError(f"{where}: KEY=VALUE is needed, for example machine.axes.Z.friction.W='0 rad'")
    return key.strip(), parse(value, where, folder, lines=False)


def apply(source: Source, model: Any, key: str, value: Source) -> Iterator[Place]:
    """Set `value` at the dotted `key` in the tree; yields the places that were set.

    A number counts from 0 in a list; * stands for every key or entry there is. Groups that the model knows are made
    where they are missing. InputError: a key that does not belong there, an index out of range.
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
        for name in list(data) if isinstance(data, dict) else range(len(data)):
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
    if known is not None and part not in known:
        raise InputError(f"{mark.where}: unknown key {part!r} in {here}{did_you_mean(part, known)}")
    if rest and not isinstance(data.get(part), (dict, list)):
        inner = shape.child(annotation, part)
        if part in data and data[part] is not None:
            raise InputError(f"{mark.where}: {here}.{part} is {brief(data[part])}, which has no {rest[0]!r} inside")
        if known is None or not shape.is_group(shape.resolve(inner, None)):
            raise InputError(f"{mark.where}: {here} has no {part!r}{did_you_mean(part, list(data))}")
        data[part] = {}
        source.marks[(*place, part)] = mark
    yield from _places(source, model, (*place, part), rest, key, mark)
