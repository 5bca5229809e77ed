"""What a tuned drive leaves beside its page: settings, drive files, and the values to type."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from feedsim import sheets
from feedsim.control import Name, names_of
from feedsim.replay.machine_files import drive_file, drive_text
from feedsim.report.control import asked
from feedsim.tune.changed import Changed
from feedsim.tune.drive_result import Tuned
from feedsim.units import convert
from feedsim.variables import parameters

SETTINGS, SHEET = "settings.yaml", "sheet.csv"


def names_for(tuned: Tuned, control: str) -> Mapping[str, Name]:
    """Our parameter -> its name in the control that is asked for, or that the machine has; empty without one."""
    known = control or asked(tuned.scenario.machine)
    return names_of(known) if known else {}


def settings(tuned: Tuned) -> str:
    """The `set` group of a scenario with the values."""
    head = "# Values of feedsim tune drive, for the group `set` of a scenario.\n"
    lines = [f"  {change.key}: {change.text}" for change in tuned.changes]
    return head + ("set:\n" + "\n".join(lines) + "\n" if lines else "set: {}\n")


def drives(tuned: Tuned) -> dict[str, str]:
    """Name -> text of a drive file for the tuned axis, changed or not, and for every other that has changed.

    A machine file or --set takes them.
    """
    same = "; its values stay as they were" if tuned.kept else ""
    head = f"Drive of axis {{}} of {tuned.scenario.machine.name}, written by feedsim tune drive{same}."
    return {
        drive_file(axis): drive_text(
            tuned.machine.shipped_drive(axis, "a file"), {}, "", [head.format(axis)], exact=True
        )
        for axis in dict.fromkeys([tuned.axis, *(change.axis for change in tuned.changes)])
    }


def sheet(tuned: Tuned, control: str = "") -> str:
    """Values to type: old and new, in the control's unit where its name is known."""
    heads = ("axis", "number", "name", "old", "new", "unit", "unit confirmed", "parameter")
    return sheets.text_of((heads, *rows(tuned, control)))


def rows(tuned: Tuned, control: str = "") -> Iterator[tuple[str, ...]]:
    """Axis, number, name, old, new, unit, whether the unit is confirmed, and our parameter."""
    names = names_for(tuned, control)
    for change in tuned.changes:
        name = names.get(change.parameter)
        if name is not None:
            shown = (_in_control(name, change.old), _in_control(name, change.new))
            cells = (name.number, name.name, *shown, name.unit, "yes" if name.confirmed else "no")
        else:
            cells = ("", "", *_shown(change), "")
        yield (change.axis, *cells, change.parameter.removeprefix("drive."))


def _in_control(name: Name, value: Any) -> str:
    return value if isinstance(value, str) else "" if value is None else f"{name.shown(float(value)):.6g}"


def _shown(change: Changed) -> tuple[str, str, str]:
    """Old and new value in the unit that is shown, and the unit."""
    row = parameters("controller").get(change.parameter.removeprefix("drive."))
    unit = row.display_unit if row is not None and change.unit else ""

    def text(value: Any) -> str:
        if value is None:
            return "none"
        if isinstance(value, str | bool) or not unit:
            return str(value)
        return f"{convert(float(value), change.unit, unit):.6g}"

    return text(change.old), text(change.new), unit


def lines_of(rows: Iterable[Sequence[str]]) -> list[str]:
    """A line for every value to type, as the terminal shows it. rows: as of :func:`rows` and of sheets."""
    result = []
    for axis, number, name, old, new, unit, confirmed, parameter in rows:
        what = f"{number} {name} ({parameter})" if number else parameter
        doubt = " (unit not confirmed)" if confirmed == "no" else ""
        result.append(f"  {axis}: {what} {old} -> {new}{'' if unit in ('', '1') else f' {unit}'}{doubt}")
    return result
