"""What the models expect at a place of a file's tree: which keys, a group or a file name."""

from __future__ import annotations

from types import NoneType, UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from feedsim.fields import ExistingFile, did_you_mean
from feedsim.files.source import Place


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


def is_file(annotation: Any) -> bool:
    """Whether a file name is expected."""
    return get_origin(annotation) is Annotated and any(
        isinstance(note, ExistingFile) for note in get_args(annotation)[1:]
    )


def _holds(data: Any, key: str | int) -> bool:
    return (isinstance(data, dict) and key in data) or (
        isinstance(data, list) and isinstance(key, int) and 0 <= key < len(data)
    )
