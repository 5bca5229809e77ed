"""Unit expressions -> exponents of the FMI base units and conversion factors: for the tables of the units, and for what
people write in the master's files (feedsim.foundation.units).

Grammar (as in Modelica): factors joined by "." (or "*") and "/", parentheses, integer powers ("m/s2", "m/s^2", "s-1").
"/" takes the one factor behind it: N.m.s/rad, (m/min)/mm. The angle is a dimension of its own, as FMI has it, hence
rpm and Hz are angular velocities (1 Hz = 2 pi rad/s) and 1/s is not.

Factors are held as an exact fraction times a power of pi and rounded once, so that mm is 1000 to the last bit.
"""

import re
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from operator import add

BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")  # order of FMI 2.0's BaseUnit
PI = Fraction("3.141592653589793238462643383279502884197")  # 40 digits


class UnitError(ValueError):
    """A unit expression that is not understood, or two units of different dimension."""


@dataclass(frozen=True)
class Unit:
    """A unit: one of it is `ratio * pi**pi_power` times the product of the base units to their exponents."""

    exponents: tuple[int, ...]
    ratio: Fraction
    pi_power: int = 0

    @property
    def exact(self) -> Fraction:
        """Base-unit value of one of this unit."""
        return self.ratio * PI**self.pi_power

    @property
    def factor(self) -> float:
        """The same, correctly rounded."""
        return float(self.exact)

    def __mul__(self, other: "Unit") -> "Unit":
        exponents = tuple(map(add, self.exponents, other.exponents))
        return Unit(exponents, self.ratio * other.ratio, self.pi_power + other.pi_power)

    def __pow__(self, power: int) -> "Unit":
        if power == 1:
            return self
        return Unit(tuple(a * power for a in self.exponents), self.ratio**power, self.pi_power * power)


ONE = Unit((0,) * len(BASE), Fraction(1))

_PREFIXES = {"p": -12, "n": -9, "u": -6, "m": -3, "c": -2, "d": -1, "k": 3, "M": 6, "G": 9}

# symbol -> definition; those in the first table take prefixes. "g" rather than "kg" is the prefixable mass.
_PREFIXABLE = {
    "g": (Fraction(1, 1000), 0, "kg"),
    "N": (Fraction(1), 0, "kg.m/s^2"),
    "J": (Fraction(1), 0, "N.m"),
    "W": (Fraction(1), 0, "J/s"),
    "Pa": (Fraction(1), 0, "N/m^2"),
    "C": (Fraction(1), 0, "A.s"),
    "V": (Fraction(1), 0, "W/A"),
    "Ohm": (Fraction(1), 0, "V/A"),
    "F": (Fraction(1), 0, "C/V"),
    "H": (Fraction(1), 0, "V.s/A"),
    "Wb": (Fraction(1), 0, "V.s"),
    "Hz": (Fraction(2), 1, "rad/s"),
}
_PLAIN = {
    "1": (Fraction(1), 0, ""),
    "%": (Fraction(1, 100), 0, ""),
    "percent": (Fraction(1, 100), 0, ""),
    "t": (Fraction(1000), 0, "kg"),
    "in": (Fraction(254, 10000), 0, "m"),
    "Nm": (Fraction(1), 0, "N.m"),
    "deg": (Fraction(1, 180), 1, "rad"),
    "arcsec": (Fraction(1, 180 * 3600), 1, "rad"),
    "rev": (Fraction(2), 1, "rad"),
    "rpm": (Fraction(2, 60), 1, "rad/s"),
    "min": (Fraction(60), 0, "s"),
    "h": (Fraction(3600), 0, "s"),
}

_TOKEN = re.compile(r"(?P<symbol>[A-Za-z]+|%|1(?!\d))(?:\^?(?P<power>-?\d+))?|(?P<mark>[().*/])")


def _symbol(name: str) -> Unit | None:
    if name in BASE:
        return Unit(tuple(int(name == base) for base in BASE), Fraction(1))
    definition = _PLAIN.get(name) or _PREFIXABLE.get(name)
    if definition is None:
        return None
    ratio, pi_power, rest = definition
    return Unit(ONE.exponents, ratio, pi_power) * (parse(rest) if rest else ONE)


@cache
def _prefixed_symbol(name: str) -> Unit | None:
    unit = _symbol(name)
    if unit is not None:
        return unit
    prefix, rest = name[:1], name[1:]
    if prefix in _PREFIXES and (rest in _PREFIXABLE or rest in BASE[1:]):
        return Unit(ONE.exponents, Fraction(10) ** _PREFIXES[prefix]) * parse(rest)
    return None


@cache
def parse(text: str) -> Unit:
    """Parse a unit expression; raises UnitError that says what is not understood, and where."""
    tokens: list[tuple[str, int, int]] = []  # symbol or mark, power, position
    position = 0
    while position < len(text):
        match = _TOKEN.match(text, position)
        if match is None:
            raise UnitError(f"unit '{text}': '{text[position:]}' is not understood")
        tokens.append((match["symbol"] or match["mark"], int(match["power"] or 1), position))
        position = match.end()

    def product(start: int, nested: bool) -> tuple[Unit, int]:
        unit, index, sign = ONE, start, 1
        while True:
            factor, index = operand(index)
            unit = unit * factor**sign if unit is not ONE else factor**sign
            mark = tokens[index][0] if index < len(tokens) else ""
            if mark == ")" and nested:
                return unit, index + 1
            if not mark and not nested:
                return unit, index
            if mark not in (".", "*", "/"):
                raise UnitError(f"unit '{text}': " + (f"unexpected '{mark}'" if mark else "a closing ')' is missing"))
            sign = -1 if mark == "/" else 1
            index += 1

    def operand(index: int) -> tuple[Unit, int]:
        if index == len(tokens):
            raise UnitError(f"unit '{text}': a unit is missing at the end" if text else "the unit is empty")
        symbol, power, where = tokens[index]
        if symbol == "(":
            return product(index + 1, nested=True)
        unit = _prefixed_symbol(symbol)
        if unit is None:
            raise UnitError(f"unit '{text}': '{symbol}' at position {where + 1} is not a known unit")
        return unit**power, index + 1

    return product(0, nested=False)[0]


def conversion(unit: str, display_unit: str) -> float:
    """Factor f of "value in display_unit = f * value in unit"; raises UnitError where the dimensions differ."""
    a, b = parse(unit), parse(display_unit)
    if a.exponents != b.exponents:
        raise UnitError(f"display unit '{display_unit}' [{dimension(b)}] does not fit unit '{unit}' [{dimension(a)}]")
    return float(a.exact / b.exact)


def dimension(unit: Unit) -> str:
    """Readable product of base units, e.g. "kg.m2.s-2"; "1" without dimension."""
    parts = [
        base + (str(power) if power != 1 else "") for base, power in zip(BASE, unit.exponents, strict=True) if power
    ]
    return ".".join(parts) or "1"
