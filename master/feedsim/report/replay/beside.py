"""Identified values beside those of the machine file that was given, in the control's words too."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from feedsim.control import names_of
from feedsim.identify.friction_file import interval_text, value_text
from feedsim.identify.result import Estimate
from feedsim.report.content import Section, Table, Text, code
from feedsim.report.control import asked
from feedsim.report.formatting import display_unit, minus, powers
from feedsim.scenario import Drive, Friction, Machine
from feedsim.scenario.parameter_group import ParameterGroup

NOTE = (
    "A value differs where the 95 % interval leaves out that of the machine file, and where both are more than 1 % "
    "apart. Then one of the two is not that of the machine: look at the control before you change it."
)
MIN_DIFFERENCE_SHARE = 0.01  # share by which a value differs
OF_THE_AXIS = {"M_0": "constant_load"}


@dataclass(frozen=True)
class Beside:
    """A parameter. present: of the machine file, SI. found: identified."""

    axis: str
    parameter: str
    present: float
    found: Estimate

    @property
    def differs(self) -> bool:
        """Whether the record speaks against the machine file."""
        low, high = self.found.interval
        apart = abs(self.found.value - self.present) > MIN_DIFFERENCE_SHARE * abs(self.present)
        return self.found.status == "estimated" and apart and not low <= self.present <= high


def beside(machine: Machine, estimates: Mapping[str, Mapping[str, Estimate]]) -> list[Beside]:
    """Parameters that the machine file has; estimates: axis -> name -> value."""
    found = []
    for axis, own in estimates.items():
        known = machine.axes[axis]
        for name, each in own.items():
            drive = known.drive if isinstance(known.drive, Drive) else None
            friction = known.friction if isinstance(known.friction, Friction) else None
            parameter, value = f"drive.{name}", getattr(drive, name, None)
            if value is None or isinstance(value, ParameterGroup):
                parameter, value = f"friction.{name}", getattr(friction, name, None)
            if name in OF_THE_AXIS:
                parameter, value = OF_THE_AXIS[name], getattr(known, OF_THE_AXIS[name])
            if isinstance(value, int | float) and not isinstance(value, bool):
                found.append(Beside(axis, parameter, float(value), each))
    return found


def beside_section(machine: Machine, found: list[Beside]) -> Section | None:
    """All of them, in SI and in the control's words."""
    if not found:
        return None
    control = asked(machine)
    names = names_of(control) if control else {}
    rows: list[tuple[Text, ...]] = []
    for each in found:
        name = names.get(each.parameter)
        shown = "–"
        if name is not None:
            old, new = (minus(f"{name.shown(value):.5g}") for value in (each.present, each.found.value))
            doubt = "" if name.confirmed else " (unit not confirmed)"
            shown = f"{name.number} {name.name}: {old} | {new} {name.unit}{doubt}".rstrip()
        rows.append((
            each.axis, code(each.parameter.rpartition(".")[2]), minus(f"{each.present:.5g}"),
            minus(powers(value_text(each.found))), display_unit(each.found.unit),
            minus(powers(interval_text(each.found))), shown, "differs" if each.differs else "",
        ))  # fmt: skip
    heads = ("Axis", "Parameter", "Machine file", "Identified", "SI unit", "95 % interval", "In the control", "")
    return Section("Beside the machine file", [Table("llrrlrtl", heads, rows, NOTE)], "beside")


def beside_part(found: list[Beside]) -> list[dict[str, Any]]:
    """The same in summary.json, in SI."""
    return [
        {"axis": each.axis, "parameter": each.parameter, "machine_file": each.present, "identified": each.found.value,
         "unit": each.found.unit, "status": each.found.status, "differs": each.differs}
        for each in found
    ]  # fmt: skip


def beside_lines(machine: Machine, found: list[Beside]) -> list[str]:
    """Values that differ, a line each for the terminal."""
    control = asked(machine)
    names = names_of(control) if control else {}
    said = []
    for each in found:
        if each.differs:
            name = names.get(each.parameter)
            words = f": {name.number} {name.shown(each.present):.5g} -> {name.text(each.found.value)}" if name else ""
            said.append(
                f"  differs: {each.axis}.{each.parameter} is {each.present:.5g} {each.found.unit} in the machine file, "
                f"{value_text(each.found)} in the record{words}"
            )
    return said
