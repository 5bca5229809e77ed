"""Parameters of drives that differ between two machines of the same axes: what is to be typed."""

from __future__ import annotations

from dataclasses import dataclass

from feedsim.scenario import Drive, Machine
from feedsim.scenario.parameter_group import Parameter
from feedsim.variables import parameters


@dataclass(frozen=True)
class Changed:
    """A parameter of an axis that has another value.

    machine: name of the machine. parameter: below the axis in a machine file, such as "drive.K_v". old, new: SI, a
    switch, or the name of a filter's type; old None: it had none. unit: SI, "1" of a plain number, "" of a switch.
    """

    machine: str
    axis: str
    parameter: str
    old: Parameter | str | None
    new: Parameter | str
    unit: str

    @property
    def key(self) -> str:
        """Of a scenario."""
        return f"machine.axes.{self.axis}.{self.parameter}"

    @property
    def text(self) -> str:
        """The new value as files have it."""
        if isinstance(self.new, bool):
            return str(self.new).lower()
        if isinstance(self.new, str):
            return self.new
        return f"{self.new!r} {self.unit}".removesuffix(" 1").strip()

    @property
    def setting(self) -> str:
        """KEY=VALUE, as behind --set."""
        return f"{self.key}={self.text}"


def changed_values(before: Machine, after: Machine) -> tuple[Changed, ...]:
    """Parameters of shipped drives whose values differ, by axis, in the order of the unit's table."""
    table = parameters("controller")
    result = []
    for axis in before.axes:
        old, new = before.axes[axis].drive, after.axes[axis].drive
        if not isinstance(old, Drive) or not isinstance(new, Drive):
            continue
        was, now = old.parameters(), new.parameters()
        for name, value in now.items():
            if was.get(name) == value or name not in table:
                continue
            row = table[name]
            if name.endswith(".type"):
                group = name.partition(".")[0]
                types = (getattr(old, group).type, getattr(new, group).type)
                result.append(Changed(before.name, axis, f"drive.{name}", *types, ""))
            else:
                result.append(Changed(before.name, axis, f"drive.{name}", was.get(name), value, row.unit))
    return tuple(result)
