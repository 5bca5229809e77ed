"""Keys and values of a control in scenario and machine files: MD32200: 4 in place of K_v: 4 (m/min)/mm."""

from __future__ import annotations

from typing import Any

from feedsim.control import Name, known
from feedsim.errors import InputError
from feedsim.fields import brief
from feedsim.files.problems import describe
from feedsim.files.source import Place, Source


def translated(key: str, value: Source) -> tuple[str, Source]:
    """A change by a control's number as one by our name; any other as it is.

    "machine.axes.Z.drive.MD32200", "Z.MD32200" and "MD32200" (all axes) mean the same parameter. InputError: the
    number's unit is not confirmed, or the value is no number.
    """
    prefix, _, number = key.rpartition(".")
    name = known(number)
    if name is None:
        return key, value
    where = prefix.removesuffix(".drive")
    if name.parameter.startswith("cycles."):
        where = "machine"
    elif "axes" not in where.split("."):
        where = f"machine.axes.{where or '*'}"
    text = _text(name, value.data, f"{value.mark(()).where}: ")
    return f"{where}.{name.parameter}", Source(text, {(): value.mark(())})


def translate(source: Source, axes: Place, faults: list[str]) -> None:
    """Replace a control's numbers below the axes (a place of the tree) by our names, in axes and in their drives."""
    groups: Any = source.data
    for key in axes:
        groups = groups.get(key) if isinstance(groups, dict) else None
    for axis, group in groups.items() if isinstance(groups, dict) else ():
        for place in ((*axes, axis), (*axes, axis, "drive")):
            inner = group if place[-1] == axis else group.get("drive") if isinstance(group, dict) else None
            for key in [*inner] if isinstance(inner, dict) else ():
                if (name := known(key)) is not None:
                    _rename(source, (*axes, axis), (*place, key), name, faults)


def _rename(source: Source, axis: Place, place: Place, name: Name, faults: list[str]) -> None:
    mark = source.mark(place)
    parent: Any = source.data
    for key in place[:-1]:
        parent = parent[key]
    value = parent.pop(place[-1])
    source.forget(place)
    at = axis
    group: Any = source.data
    for key in axis:
        group = group[key]
    *way, last = name.parameter.split(".")
    for step in way:
        at = (*at, step)
        if not isinstance(group.get(step), dict):
            if step in group:
                faults.append(describe(source, at, f"has no {name.number} inside"))
                return
            group[step] = {}
            source.marks[at] = mark
        group = group[step]
    if last in group:
        faults.append(f"{mark.where}: {name.number} is {name.parameter}, which is given as well; give one of them")
        return
    try:
        group[last] = _text(name, value, f"{mark.where}: ")
    except InputError as error:
        faults += error.problems
        group[last] = value
    source.marks[(*at, last)] = mark


def _text(name: Name, value: Any, where: str) -> Any:
    """The value in SI as our files have it."""
    ours = name.parameter.rpartition(".")[2]
    if not name.confirmed:
        raise InputError(
            f"{where}{name.number} is {ours}, but its unit is not confirmed by a public source ({name.source}); "
            f"give {ours} with its unit"
        )
    if name.codes:
        known = {code: ours for code, ours in name.codes}
        if isinstance(value, bool) or value not in known:
            raise InputError(f"{where}{name.number} is {brief(value)}; of {', '.join(map(str, known))}")
        return known[value]
    if not name.si and name.unit != "1" and value in (0, 1, False, True):
        return bool(value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(
            f"{where}{name.number} is {brief(value)}; a number in the control's unit, {name.unit}, is expected"
        )
    return value if not name.si else f"{name.ours(value)!r} {name.si}"
