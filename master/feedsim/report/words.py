"""Numbers, units and durations as a person reads them."""

from __future__ import annotations

import math
import re
from decimal import Decimal

from feedsim.analysis import Figure

SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
SMALL = Decimal("1e-4")  # below which a number is written with a power of ten
DISPLAY_UNITS = {"um": "µm", "1": ""}
NOT_DETERMINED = "not determined"


def shown(figure: Figure) -> tuple[str, str]:
    """Value and unit for display; "not determined" and no unit where there is no value."""
    if not math.isfinite(figure.value):
        return NOT_DETERMINED, ""
    digits = {"um": 2, "ms": 1, "Hz": 2, "N.m": 3, "s": 4}.get(figure.unit)
    text = f"{figure.value:.{digits}f}" if digits is not None else f"{figure.value:.5g}"
    return minus(text), display_unit(figure.unit)


def display_unit(unit: str) -> str:
    """A unit as it is printed: µm, N·m; nothing for a plain number."""
    return DISPLAY_UNITS.get(unit, unit.replace(".", "·"))


def minus(text: str) -> str:
    """A number with a minus sign in place of the hyphen."""
    return text.replace("-", "−")


def powers(text: str) -> str:
    """Numbers of a text that are smaller than SMALL, digit by digit, with a power of ten: 1.47×10⁻⁵."""

    def written(match: re.Match[str]) -> str:
        number = Decimal(match[0])
        if not 0 < abs(number) < SMALL:
            return match[0]
        mantissa, _, exponent = f"{number:e}".partition("e")
        return f"{mantissa}×10{str(int(exponent)).translate(SUPERSCRIPTS)}"

    return re.sub(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?", written, text)


def counted(number: int, one: str, many: str = "") -> str:
    """ "1 stretch", "2 stretches"; many: plural where an s alone does not make it."""
    return f"{number} {one if number == 1 else many or f'{one}s'}"


def typeset(text: str) -> str:
    """A meaning as the analyses word it (ASCII), with µ and ±."""
    return re.sub(r"\bum\b", "µm", text.replace("+-", "±"))


def duration(seconds: float) -> str:
    """A time in the unit that reads best: 125 µs, 1 ms, 2 s."""
    for unit, scale in (("s", 1.0), ("ms", 1e3), ("µs", 1e6)):
        if seconds * scale >= 1 - 1e-9:
            return f"{seconds * scale:.6g} {unit}"
    return f"{seconds * 1e6:.6g} µs"
