"""A file -> the model it is read as: the files that it names are fetched, every problem is reported with its line."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import PydanticCustomError

from feedsim.errors import InputError
from feedsim.fields import Reading, brief, is_multiple
from feedsim.files import shape
from feedsim.files.problems import describe, explain, in_order, quantity_of
from feedsim.files.references import referred
from feedsim.files.source import Place, Source, at, read

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
    annotation = shape.expected(model, source.data, place)
    if annotation is None:
        return
    if isinstance(data, str):
        is_file = shape.is_file(annotation) and bool(data)
        is_group = shape.is_model(annotation) and bool(annotation.IN_FOLDER or data.endswith((".yaml", ".yml")))
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
    quantity = quantity_of(shape.child(shape.expected(model, data, place[:-1]), place[-1]))
    with suppress(PydanticCustomError):
        return quantity.read(at(data, place[:-1]).get(place[-1])) if quantity else None
    return None
