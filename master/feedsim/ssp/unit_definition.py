"""Unit definitions of FMI and SSP: a name, exponents of the SI base units with rad, a factor and an offset."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite

from feedsim.cosim.unit import Archive
from feedsim.errors import InputError
from feedsim.ssp import xml

BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


@dataclass(frozen=True)
class UnitDefinition:
    """value in base units = factor * value + offset; exponents: base unit -> power, without zeros."""

    exponents: Mapping[str, int]
    factor: float = 1.0
    offset: float = 0.0


def append_units(parent: xml.Element, name: str, definitions: Mapping[str, UnitDefinition]) -> None:
    """Append the definitions as an element `name`; none where there are none."""
    if not definitions:
        return
    group = xml.child(parent, name)
    for unit, definition in definitions.items():
        base = {key: str(definition.exponents[key]) for key in BASE if key in definition.exponents}
        if definition.factor != 1.0:
            base["factor"] = repr(definition.factor)
        if definition.offset != 0.0:
            base["offset"] = repr(definition.offset)
        xml.child(xml.child(group, "ssc:Unit", {"name": unit}), "ssc:BaseUnit", base)


def read_units(group: xml.Element | None, where: str) -> dict[str, UnitDefinition]:
    """Definitions of a Units element. InputError: a factor or an exponent that is no number."""
    found: dict[str, UnitDefinition] = {}
    for entry in () if group is None else group.findall(xml.tag("ssc:Unit")):
        base = entry.find(xml.tag("ssc:BaseUnit"))
        if base is None:
            continue
        try:
            exponents = {key: int(base.get(key, "0")) for key in BASE if int(base.get(key, "0"))}
            factor, offset = float(base.get("factor", "1")), float(base.get("offset", "0"))
        except ValueError:
            raise InputError(f"{where}: unit {entry.get('name')}: its definition holds no number") from None
        if not (isfinite(factor) and isfinite(offset) and factor):
            raise InputError(f"{where}: unit {entry.get('name')}: factor {factor!r}, offset {offset!r}; not allowed")
        found[entry.get("name", "")] = UnitDefinition(exponents, factor, offset)
    return found


def unit_definitions(archive: Archive) -> dict[str, UnitDefinition]:
    """Unit definitions of an archive."""
    found = {}
    for each in archive.description.unitDefinitions:
        if each.baseUnit is not None and float(each.baseUnit.factor):
            exponents = {key: int(getattr(each.baseUnit, key)) for key in BASE if int(getattr(each.baseUnit, key))}
            found[each.name] = UnitDefinition(exponents, float(each.baseUnit.factor), float(each.baseUnit.offset))
    return found
