"""Parameters in the words of a control: its numbers, names and units beside ours, as a section of any report."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import reduce
from typing import Any

from feedsim.control import Name, names_of
from feedsim.report.content import Section, Table, Text, code
from feedsim.report.formatting import minus
from feedsim.scenario import Machine

# What the causes of a circle are set by, where no machine shows values.
OF_CIRCLES = (
    "drive.K_v", "drive.k_ffw", "drive.T_sym", "drive.T_dyn", "drive.backlash_compensation.value",
    "drive.friction_pulse.amplitude", "drive.friction_pulse.time",
)  # fmt: skip
NOTE = (
    "Confirmed: a public source with meaning and unit was opened. Of all others the unit is an assumption: check it at "
    "the control before you type a value. Names, units and sources: docs/controls.md."
)


_ASKED = ContextVar("control", default="")


@contextmanager
def control_names(control: str) -> Iterator[None]:
    """A block in which reports show parameters in the names of a control, too: what --control asks for."""
    before = _ASKED.set(control)
    try:
        yield
    finally:
        _ASKED.reset(before)


def control_section(
    machine: Machine | None = None, changes: Mapping[str, Sequence[str]] | None = None
) -> Section | None:
    """The section, where a control is asked for or the machine file names one; else None.

    changes: parameter of a machine file -> value of every source, where the report is about those.
    """
    control = asked(machine)
    return section(control, machine, changes) if control else None


def asked(machine: Machine | None = None) -> str:
    """The control whose names are asked for, or that the machine file names; "" without one."""
    return _ASKED.get() or (machine.control or "" if machine is not None else "")


def section(control: str, machine: Machine | None, changes: Mapping[str, Sequence[str]] | None = None) -> Section:
    """The control's names: with the values of a machine's axes, with values that differ, or by themselves."""
    names = names_of(control)
    if changes is not None:
        return _section(control, _changed(names, changes), ("Axis", "Values"), "ll")
    if machine is None:
        rows = [(*_head(names[key]), names[key].unit, _doubt(names[key])) for key in OF_CIRCLES if key in names]
        return _section(control, rows, (), "")
    values = {axis: axis_values(control, machine, axis) for axis in machine.axes}
    rows = [
        (*_head(name), *(minus(f"{own[key]:.6g}") if key in own else "–" for own in values.values()), name.unit,
         _doubt(name))
        for key, name in names.items()
        if any(key in own for own in values.values())
    ]  # fmt: skip
    return _section(control, rows, tuple(values), "r" * len(values))


def axis_values(control: str, machine: Machine, axis: str) -> dict[str, float]:
    """Our parameter -> value in the control's unit, of an axis, as far as it has them."""
    values = {}
    for key, name in names_of(control).items():
        value = reduce(lambda entry, step: getattr(entry, step, None), key.split("."), _start(machine, axis))
        if isinstance(value, bool | int | float):
            values[key] = name.shown(float(value))
    return values


def _start(machine: Machine, axis: str) -> Any:
    return machine.axes[axis]


def _changed(names: Mapping[str, Name], changes: Mapping[str, Sequence[str]]) -> list[tuple[Text, ...]]:
    rows: list[tuple[Text, ...]] = []
    for key, values in changes.items():
        axis, _, parameter = key.removeprefix("machine.").removeprefix("axes.").partition(".")
        if (name := names.get(parameter)) is None:
            continue
        shown = []
        for value in values:
            with suppress(ValueError):
                shown.append(f"{name.shown(float(value.partition(' ')[0])):.6g}")
        rows.append((*_head(name), axis, minus(" | ".join(shown)), name.unit, _doubt(name)))
    return rows


def _head(name: Name) -> tuple[Text, ...]:
    return code(name.number), name.name, code(name.parameter.removeprefix("drive."))


def _doubt(name: Name) -> str:
    return "confirmed" if name.confirmed else "not confirmed"


def _section(control: str, rows: Sequence[Sequence[Text]], heads: tuple[str, ...], columns: str) -> Section:
    table = Table(
        f"lll{columns}ll", ("Number", "Name in the control", "Ours", *heads, "Unit", "Unit and meaning"), rows, NOTE
    )
    return Section(f"Names in the control {control}", [table], "control")
