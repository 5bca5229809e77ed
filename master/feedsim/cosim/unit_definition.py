"""Units as modelDescription.xml defines them: exponents of the SI base units with rad, a factor and an offset."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from feedsim import units
from feedsim.cosim.archive import Archive
from feedsim.cosim.unit import Alias
from feedsim.errors import InputError

BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


@dataclass(frozen=True)
class UnitDefinition:
    """value in base units = factor * value + offset; exponents: base unit -> power, without zeros."""

    exponents: Mapping[str, int]
    factor: float = 1.0
    offset: float = 0.0

    @property
    def text(self) -> str:
        """The base units as an expression, e.g. "m^2.kg.s^-2"; "1" for none."""
        return ".".join(f"{name}^{power}" for name, power in self.exponents.items()) or "1"


def unit_definitions(archive: Archive) -> dict[str, UnitDefinition]:
    """Unit definitions of an archive."""
    found = {}
    for each in archive.description.unitDefinitions:
        if each.baseUnit is not None and float(each.baseUnit.factor):
            exponents = {key: int(getattr(each.baseUnit, key)) for key in BASE if int(getattr(each.baseUnit, key))}
            found[each.name] = UnitDefinition(exponents, float(each.baseUnit.factor), float(each.baseUnit.offset))
    return found


def alias(archive: Archive, name: str, unit: str) -> Alias:
    """The variable `name` for a signal in the SI unit `unit`; one without a unit is taken to be in SI.

    Raises:
        InputError: its unit is of another dimension, or neither the archive defines it nor feedsim knows it.
    """
    declared = archive.declared_unit(name)
    if declared is None:
        return Alias(name, unit)
    definition = unit_definitions(archive).get(declared)
    if definition is None:
        try:
            return Alias(name, unit, float(units.factor(declared, unit)))
        except InputError as error:
            raise InputError(f"is in {declared}, which modelDescription.xml does not define: {error}") from None
    wanted = units.unit(unit)
    try:
        given = units.unit(definition.text)
    except InputError:  # base units of which no quantity here is made
        given = None
    if given is None or given.dimension != wanted.dimension:
        what = "" if given is None else f", {units.article(given.kind)}"
        raise InputError(
            f"is in {declared} ({definition.text}){what}; {units.article(wanted.kind)} is expected, such as {unit}"
        )
    return Alias(name, unit, definition.factor, definition.offset)


def parse(text: str, archive: Archive, name: str) -> float:
    """A quantity such as "12 ms" in the unit that the variable `name` declares.

    Raises:
        InputError: no number with a unit, a unit unknown or of another dimension.
    """
    declared = archive.declared_unit(name)
    definition = unit_definitions(archive).get(declared or "")
    if definition is None:
        return units.parse(text, declared or units.DIMENSIONLESS)
    return (units.parse(text, definition.text) - definition.offset) / definition.factor
