"""Every unit of the descriptions against pint: base units, factors, and the way a value goes to its display unit."""

import math

import pint
import pytest

from fmu.unpacked import Archive
from pint_registry import Registry

BASE = {"kg": "kilogram", "m": "meter", "s": "second", "A": "ampere", "rad": "radian"}


def test_registry_keeps_angles_apart(registry: Registry) -> None:
    assert registry.quantity("Hz").to("rad/s").magnitude == pytest.approx(2 * math.pi, rel=1e-15)
    for angular in ("Hz", "rpm", "rad/s"):
        with pytest.raises(pint.DimensionalityError):
            registry.quantity(angular).to("1/s")


def test_base_units_are_those_of_pint(archive: Archive, registry: Registry) -> None:
    units = archive.description.findall("UnitDefinitions/Unit")
    assert units
    for unit in units:
        base = unit.find("BaseUnit")
        assert base is not None
        found = {BASE[name]: int(power) for name, power in base.attrib.items() if name not in ("factor", "offset")}
        expected = registry.quantity(unit.attrib["name"]).to_base_units()
        exponents = {str(name): int(power) for name, power in dict(expected.unit_items()).items() if power}
        assert found == exponents, unit.attrib["name"]
        # pint rounds at every step of a conversion.
        assert float(base.get("factor", "1")) == pytest.approx(expected.magnitude, rel=1e-14), unit.attrib["name"]
        assert float(base.get("offset", "0")) == 0.0


def test_display_units_are_those_of_pint(archive: Archive, registry: Registry) -> None:
    """FMI 2.0.5, 2.2.2: value in the display unit = factor * value in the unit + offset."""
    pairs = 0
    for unit in archive.description.iterfind("UnitDefinitions/Unit"):
        for display in unit.iterfind("DisplayUnit"):
            factor, offset = float(display.attrib["factor"]), float(display.get("offset", "0"))
            for value in (0.0, 0.7):
                expected = (
                    registry.quantity(unit.attrib["name"], value)
                    .to(registry.quantity(display.attrib["name"]).units)
                    .magnitude
                )
                assert factor * value + offset == pytest.approx(expected, rel=1e-14, abs=0), display.attrib["name"]
            pairs += 1
    assert (
        pairs
        >= {"plant": 4, "controller": 7, "friction": 3, "friction_gms": 2, "setpoint": 2, "machine": 8}[archive.unit]
    )


# What a person at a machine calls these quantities. SI units that are read as they are need no other.
PEOPLES = {
    "m": {"mm", "um", "nm"},
    "rad": {"deg", "mrad"},  # mrad: an encoder off its centre
    "rad/s": {"rpm", "rad/s"},
    "s": {"ms", "us", "s"},
    "1/s": {"(m/min)/mm"},
    "m/rad": {"mm/rad"},
    "m/s": {"m/min", "mm/min"},  # mm/min: what machine data of a friction pulse are in
    "N/m": {"N/um"},
    "J": {"uJ", "mJ", "J"},
    "H": {"mH"},
    "1": {"1", "%"},
}


def test_values_are_shown_in_units_that_people_use(archive: Archive) -> None:
    for name, element in archive.variables().items():
        if element[0].tag == "Real":
            unit = element[0].attrib["unit"]
            assert element[0].get("displayUnit", unit) in PEOPLES.get(unit, {unit}), name


def test_first_display_unit_is_the_one_that_most_variables_have(archive: Archive) -> None:
    """FMPy's plots show all values of a unit in its first display unit: axis positions are in mm then, not in um."""
    shown = [
        {**each[0].attrib, "signal": each.attrib["causality"] != "parameter"}
        for each in archive.variables().values()
        if each[0].tag == "Real"
    ]
    for unit in archive.description.iterfind("UnitDefinitions/Unit"):
        names = [display.attrib["name"] for display in unit.iterfind("DisplayUnit")]
        having = [[e for e in shown if e["unit"] == unit.attrib["name"] and e.get("displayUnit") == n] for n in names]
        used = [(sum(each["signal"] for each in those), len(those)) for those in having]
        assert used == sorted(used, reverse=True)  # signals first: they are what is plotted
        assert all(total for _, total in used)
        if names and unit.attrib["name"] in ("m", "s"):
            assert names[0] in ("mm", "ms"), names
