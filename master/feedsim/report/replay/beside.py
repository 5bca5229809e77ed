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
    result = []
    for axis, own in estimates.items():
        known = machine.axes[axis]
        for name, estimate in own.items():
            drive = known.drive if isinstance(known.drive, Drive) else None
            friction = known.friction if isinstance(known.friction, Friction) else None
            parameter, value = f"drive.{name}", getattr(drive, name, None)
            if value is None or isinstance(value, ParameterGroup):
                parameter, value = f"friction.{name}", getattr(friction, name, None)
            if name in OF_THE_AXIS:
                parameter, value = OF_THE_AXIS[name], getattr(known, OF_THE_AXIS[name])
            if isinstance(value, int | float) and not isinstance(value, bool):
                result.append(Beside(axis, parameter, float(value), estimate))
    return result


def beside_section(machine: Machine, result: list[Beside]) -> Section | None:
    """All of them, in SI and in the control's words."""
    if not result:
        return None
    control = asked(machine)
    names = names_of(control) if control else {}
    rows: list[tuple[Text, ...]] = []
    for entry in result:
        name = names.get(entry.parameter)
        shown = "–"
        if name is not None:
            old, new = (minus(f"{name.shown(value):.5g}") for value in (entry.present, entry.found.value))
            doubt = "" if name.confirmed else " (unit not confirmed)"
            shown = f"{name.number} {name.name}: {old} | {new} {name.unit}{doubt}".rstrip()
        rows.append((
            entry.axis, code(entry.parameter.rpartition(".")[2]), minus(f"{entry.present:.5g}"),
            minus(powers(value_text(entry.found))), display_unit(entry.found.unit),
            minus(powers(interval_text(entry.found))), shown, "differs" if entry.differs else "",
        ))  # fmt: skip
    heads = ("Axis", "Parameter", "Machine file", "Identified", "SI unit", "95 % interval", "In the control", "")
    return Section("Beside the machine file", [Table("llrrlrtl", heads, rows, NOTE)], "beside")


def beside_part(result: list[Beside]) -> list[dict[str, Any]]:
    """The same in summary.json, in SI."""
    return [
        {
            "axis": entry.axis,
            "parameter": entry.parameter,
            "machine_file": entry.present,
            "identified": entry.found.value,
            "unit": entry.found.unit,
            "status": entry.found.status,
            "differs": entry.differs,
        }
        for entry in result
    ]


def beside_lines(machine: Machine, result: list[Beside]) -> list[str]:
    """Values that differ, a line each for the terminal."""
    control = asked(machine)
    names = names_of(control) if control else {}
    said = []
    for entry in result:
        if entry.differs:
            name = names.get(entry.parameter)
            words = f": {name.number} {name.shown(entry.present):.5g} -> {name.text(entry.found.value)}" if name else ""
            said.append(
                f"  differs: {entry.axis}.{entry.parameter} is {entry.present:.5g} {entry.found.unit} in the machine "
                f"file, {value_text(entry.found)} in the record{words}"
            )
    return said
