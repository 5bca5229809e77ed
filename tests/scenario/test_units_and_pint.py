"""Units that people write are what pint makes of them."""

import pytest

from feedsim.foundation import units
from pint_registry import Registry

# Dimensions in the base units of pint.
BASE = {"length": "meter", "time": "second", "mass": "kilogram", "current": "ampere", "angle": "radian"}
COMPOUND = [
    "mm/min", "(m/min)/mm", "mm/rev", "N/um", "cm^2", "cm^4", "m/min", "mm/s", "deg/s", "rev/min", "N/mm", "kg*cm^2",
    "mm/s^2", "mm^4", "N*m/(rad/s)", "rad/s^2", "m/(N*m)", "um/N", "1/um", "V*s/(A*rad)", "s^-2", "Hz^2*mrad",
]  # fmt: skip


@pytest.mark.parametrize("expression", [*units.UNIT_SYMBOLS, *units.QUANTITY_NAMES, *COMPOUND])
def test_units_are_those_of_pint(expression: str, registry: Registry) -> None:
    found = units.unit(expression)
    expected = registry.quantity(expression).to_base_units()
    over, _, under = found.dimension.partition("/")
    powers = {}
    for sign, part in ((1, over.split("*")), (-1, under.split("/") if under else [])):
        for term in part:
            name, _, power = term.partition("^")
            if name != "1":
                powers[BASE[name]] = sign * int(power or 1)
    assert powers == {str(name): int(power) for name, power in dict(expected.unit_items()).items() if power}
    # pint rounds at every step of a conversion.
    assert float(found.factor) == pytest.approx(expected.magnitude, rel=1e-14)
