"""Quantities written as text, "5000 mm/min", and their conversion to SI.

The registry is small and built from nothing, so that it knows exactly what a machine-tool engineer writes and nothing
that looks alike. An angle is a dimension of its own (base unit rad): hertz is one revolution (cycle) per second, so
1 Hz is 2 pi rad/s and never 1 rad/s, and a controller gain in 1/s is no frequency in Hz. Factors are exact fractions:
"125 us" is the double nearest to 125e-6, the same as the text 125e-6 itself.
"""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import dataclass
from difflib import get_close_matches
from fractions import Fraction
from functools import cache, lru_cache
from math import inf, isfinite
from typing import TYPE_CHECKING

from feedsim.errors import InputError

if TYPE_CHECKING:
    import pint

# Spelling -> definition in spellings above it. "[...]" makes a base unit.
DEFINITIONS = {
    "m": "[length]",
    "km": "1000 m",
    "dm": "1/10 m",
    "cm": "1/100 m",
    "mm": "1/1000 m",
    "um": "1/1000 mm",
    "nm": "1/1000 um",
    "s": "[time]",
    "ms": "1/1000 s",
    "us": "1/1000 ms",
    "ns": "1/1000 us",
    "min": "60 s",
    "h": "60 min",
    "kg": "[mass]",
    "g": "1/1000 kg",
    "t": "1000 kg",
    "A": "[current]",
    "mA": "1/1000 A",
    "rad": "[angle]",
    "mrad": "1/1000 rad",
    "urad": "1/1000 mrad",
    # 2 pi to 40 digits
    "rev": "6283185307179586476925286766559005768394/1000000000000000000000000000000000000000 rad",
    "deg": "1/360 rev",
    "arcsec": "1/3600 deg",
    "rpm": "rev/min",
    "Hz": "rev/s",
    "kHz": "1000 Hz",
    "N": "kg*m/s^2",
    "mN": "1/1000 N",
    "kN": "1000 N",
    "Pa": "N/m^2",
    "MPa": "1000000 Pa",
    "GPa": "1000 MPa",
    "Nm": "N*m",
    "V": "kg*m^2/s^3/A",
    "mV": "1/1000 V",
    "kV": "1000 V",
    "Ohm": "V/A",
    "mOhm": "1/1000 Ohm",
    "H": "V*s/A",
    "mH": "1/1000 H",
    "uH": "1/1000 mH",
    "Wb": "V*s",
    "percent": "1/100",
}
# Other spellings of the same.
ALIASES = {
    "ohm": "Ohm",
    "mohm": "mOhm",
    "revolution": "rev",
    "degree": "deg",
    "radian": "rad",
    "hertz": "Hz",
    "sec": "s",
    "%": "percent",
    "°": "deg",
    "µm": "um",
    "µs": "us",
    "µrad": "urad",
    "µH": "uH",
    "Ω": "Ohm",
    "mΩ": "mOhm",
}
# What a quantity in a unit is called, and an example to show.
KINDS = {
    "m": ("length", "100 mm"),
    "s": ("time", "125 us"),
    "kg": ("mass", "435 kg"),
    "rad": ("angle", "0.04 rad"),
    "1": ("plain number", "0.35"),
    "m/s": ("speed", "5000 mm/min"),
    "m/s^2": ("acceleration", "14.4 m/s^2"),
    "m/s^3": ("jerk", "150 m/s^3"),
    "rad/s": ("angular speed or frequency", "915.3 rad/s"),
    "Hz": ("angular speed or frequency", "602 Hz"),
    "1/s": ("position controller gain", "4 (m/min)/mm"),
    "m/rad": ("lead", "20 mm/rev"),
    "N/m": ("stiffness", "1000 N/um"),
    "Pa": ("modulus of elasticity", "210 GPa"),
    "kg/m^3": ("density", "7850 kg/m^3"),
    "kg.m^2": ("moment of inertia", "0.015 kg.m^2"),
    "m^2": ("area", "52 cm^2"),
    "m^4": ("second moment of area", "1200 cm^4"),
    "N": ("force", "120 N"),
    "N.m": ("torque", "2.1 N.m"),
    "N.m/rad": ("torsional stiffness", "300 N.m/rad"),
    "N.m.s/rad": ("torque per angular speed", "6.18 N.m.s/rad"),
    "N.m/A": ("torque constant", "2.0 N.m/A"),
    "V": ("voltage", "350 V"),
    "A": ("current", "12 A"),
    "Ohm": ("resistance", "0.45 Ohm"),
    "V/A": ("voltage per current", "17.28 V/A"),
    "H": ("inductance", "5 mH"),
    "Wb": ("flux linkage", "0.27 Wb"),
    "1/A": ("1/current", "1 1/A"),
}

# What pint makes of usual expressions, so that files of usual units need not wait for it (a quarter of a second):
# factor to the base units, times 2 pi to this power, dimension. A test holds every row against pint.
READY = {
    "m": ("1", 0, "length"),
    "1/A": ("1", 0, "1/current"),
    "Wb": ("1", 0, "length^2*mass/current/time^2"),
    "H": ("1", 0, "length^2*mass/current^2/time^2"),
    "V/A": ("1", 0, "length^2*mass/current^2/time^3"),
    "Ohm": ("1", 0, "length^2*mass/current^2/time^3"),
    "A": ("1", 0, "current"),
    "V": ("1", 0, "length^2*mass/current/time^3"),
    "N*m/A": ("1", 0, "length^2*mass/current/time^2"),
    "N*m*s/rad": ("1", 0, "length^2*mass/angle/time"),
    "N*m/rad": ("1", 0, "length^2*mass/angle/time^2"),
    "N*m": ("1", 0, "length^2*mass/time^2"),
    "N": ("1", 0, "length*mass/time^2"),
    "m^4": ("1", 0, "length^4"),
    "m^2": ("1", 0, "length^2"),
    "kg*m^2": ("1", 0, "length^2*mass"),
    "kg/m^3": ("1", 0, "mass/length^3"),
    "Pa": ("1", 0, "mass/length/time^2"),
    "N/m": ("1", 0, "mass/time^2"),
    "m/rad": ("1", 0, "length/angle"),
    "1/s": ("1", 0, "1/time"),
    "Hz": ("1", 1, "angle/time"),
    "rad/s": ("1", 0, "angle/time"),
    "m/s^3": ("1", 0, "length/time^3"),
    "m/s^2": ("1", 0, "length/time^2"),
    "m/s": ("1", 0, "length/time"),
    "1": ("1", 0, "1"),
    "rad": ("1", 0, "angle"),
    "kg": ("1", 0, "mass"),
    "s": ("1", 0, "time"),
    "mm": ("1/1000", 0, "length"),
    "us": ("1/1000000", 0, "time"),
    "mm/min": ("1/60000", 0, "length/time"),
    "(m/min)/mm": ("50/3", 0, "1/time"),
    "mm/rev": ("1/1000", -1, "length/angle"),
    "N/um": ("1000000", 0, "mass/time^2"),
    "GPa": ("1000000000", 0, "mass/length/time^2"),
    "cm^2": ("1/10000", 0, "length^2"),
    "cm^4": ("1/100000000", 0, "length^4"),
    "mH": ("1/1000", 0, "length^2*mass/current^2/time^2"),
    "ms": ("1/1000", 0, "time"),
    "percent": ("1/100", 0, "1"),
    "m/min": ("1/60", 0, "length/time"),
    "um": ("1/1000000", 0, "length"),
    "cm": ("1/100", 0, "length"),
    "nm": ("1/1000000000", 0, "length"),
    "min": ("60", 0, "time"),
    "kN": ("1000", 0, "length*mass/time^2"),
    "mrad": ("1/1000", 0, "angle"),
    "urad": ("1/1000000", 0, "angle"),
    "rev": ("1", 1, "angle"),
    "deg": ("1/360", 1, "angle"),
    "arcsec": ("1/1296000", 1, "angle"),
    "rpm": ("1/60", 1, "angle/time"),
    "kHz": ("1000", 1, "angle/time"),
    "Nm": ("1", 0, "length^2*mass/time^2"),
    "mm/s": ("1/1000", 0, "length/time"),
    "deg/s": ("1/360", 1, "angle/time"),
    "rev/s": ("1", 1, "angle/time"),
    "rev/min": ("1/60", 1, "angle/time"),
    "N/mm": ("1000", 0, "mass/time^2"),
    "kg*cm^2": ("1/10000", 0, "length^2*mass"),
    "mm/s^2": ("1/1000", 0, "length/time^2"),
    "MPa": ("1000000", 0, "mass/length/time^2"),
    "mV": ("1/1000", 0, "length^2*mass/current/time^3"),
    "mA": ("1/1000", 0, "current"),
    "uH": ("1/1000000", 0, "length^2*mass/current^2/time^2"),
    "mOhm": ("1/1000", 0, "length^2*mass/current^2/time^3"),
    "mm^2": ("1/1000000", 0, "length^2"),
    "mm^4": ("1/1000000000000", 0, "length^4"),
    "N*m/(rad/s)": ("1", 0, "length^2*mass/angle/time"),
    "rad/s^2": ("1", 0, "angle/time^2"),
    "m/N": ("1", 0, "time^2/mass"),
    "m/(N*m)": ("1", 0, "time^2/length/mass"),
    "um/N": ("1/1000000", 0, "time^2/mass"),
    "g": ("1/1000", 0, "mass"),
}

DIMENSIONLESS = "1"
LONGEST_NUMBER = 1100  # characters; every double, written out, has less
LONGEST = 60  # characters of a unit

_TURN = Fraction(DEFINITIONS["rev"].removesuffix(" rad"))

NUMBER = r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_QUANTITY = re.compile(rf"\s*({NUMBER})(.*)", re.DOTALL)
_SYMBOL = re.compile(r"[^\W\d_]+|[%°]")
_EXPRESSION = re.compile(r"(?:(?<![)^0-9])\^[+-]?[0-9](?![0-9^])|(?<![0-9^])1(?![0-9])|[^\W\d_]+|[*/()])*")
_LEGAL = re.compile(r"(?:[^\W\d_]+|[%°]|[0-9]|[-+ ().*/^])*")
_SPELLINGS = str.maketrans({"μ": "µ", "Ω": "Ω", "·": ".", "⋅": ".", "×": "*", "²": "^2", "³": "^3"})


@dataclass(frozen=True)
class Unit:
    """A unit expression: as written, its factor to the SI base units (with rad), and its dimension."""

    text: str
    factor: Fraction
    dimension: str

    @property
    def kind(self) -> str:
        """What a quantity of this dimension is called, e.g. "speed"; the dimension itself where it has no name."""
        return _kinds().get(self.dimension, self.dimension)


class UnknownSymbol(InputError):
    """A unit expression holds a symbol that is none."""

    def __init__(self, symbol: str) -> None:
        self.symbol = symbol
        super().__init__(f"unknown unit {symbol!r}{_suggest(symbol)}")


def example(text: str) -> str:
    """A quantity that could stand where one in unit `text` is expected."""
    return KINDS[text][1] if text in KINDS else f"1 {text}"


def parse(text: str, expected: str, example_text: str = "") -> float:
    """Value of a quantity such as "5000 mm/min" in the SI unit `expected`, such as "m/s".

    Any unit of the same dimension is converted, correctly rounded. `example_text` is what messages show (a usual
    quantity by default). Raises InputError: not a number with a unit, an unknown or ambiguous unit, another dimension
    than expected; each message names what is expected and shows an example.
    """
    target = unit(expected)
    wanted = f"{article(target.kind)} is expected, for example {example_text or example(expected)}"
    match = _QUANTITY.fullmatch(text)
    if not match:
        raise InputError(f"{text!r} is not a number with a unit; {wanted}")
    number, rest = match[1], match[2].strip()
    if re.match(r",[0-9]", rest):
        raise InputError(f"{text!r}: write a decimal point, not a comma; {wanted}")
    if not rest:
        if target.dimension != unit(DIMENSIONLESS).dimension:
            raise InputError(f"{number} has no unit; {wanted}")
        return finite(number)
    try:
        given = unit(rest)
    except UnknownSymbol as error:
        hint = _suggest_for(error.symbol, rest, target)
        raise InputError(f"{text.strip()!r}: unknown unit {error.symbol!r}{hint}; {wanted}") from None
    except InputError as error:
        raise InputError(f"{text.strip()!r}: {error}; {wanted}") from None
    if given.dimension != target.dimension:
        raise InputError(f"{text.strip()!r} is {article(given.kind)}; {wanted}{_hint(given, target)}")
    if finite(number) == 0.0:
        return 0.0
    try:
        return float(Fraction(number) * given.factor / target.factor)
    except OverflowError:
        raise InputError(f"{text.strip()!r} is too large to calculate with; {wanted}") from None


def convert(value: float, given: str, expected: str) -> float:
    """`value` in unit `given` as a value in unit `expected`. InputError: unknown unit, dimensions differ."""
    return value * float(factor(given, expected))


def factor(given: str, expected: str) -> Fraction:
    """Exact factor from unit `given` to unit `expected`. InputError: unknown unit, dimensions differ."""
    source, target = unit(given), unit(expected)
    if source.dimension != target.dimension:
        raise InputError(
            f"unit {given!r} is that of {article(source.kind)}; one of {article(target.kind)} is expected, such as "
            f"{expected}{_hint(source, target)}"
        )
    return source.factor / target.factor


@lru_cache(maxsize=1024)
def unit(text: str) -> Unit:
    """Read a unit expression: symbols joined by . * / or a blank, powers ^2 or **2 (also m/s2), brackets, "1" for none.

    InputError: unknown symbol (with a suggestion), a product behind a division without brackets, bad syntax.
    """
    plain = " ".join(text.translate(_SPELLINGS).split())
    if len(plain) > LONGEST:
        raise InputError(f"unit {text[:20]!r}... has more than {LONGEST} characters")
    if not _LEGAL.fullmatch(plain):
        bad = next(c for c in plain if not _LEGAL.fullmatch(c))
        raise InputError(f"unit {text!r} holds {bad!r}")
    for symbol in _SYMBOL.findall(plain):
        if symbol not in DEFINITIONS and symbol not in ALIASES:
            raise UnknownSymbol(symbol)
    plain = _SYMBOL.sub(lambda match: ALIASES.get(match[0], match[0]), plain)
    plain = re.sub(r"(?<=[a-zA-Z])([0-9])", r"^\1", plain).replace("**", "^")
    plain = re.sub(r" ?([.*/^()]) ?", r"\1", plain)
    plain = re.sub(r"(?<=[\w)])[ .](?=[\w(])", "*", plain)
    plain = re.sub(r"(?<=[\w)])\((?!$)", "*(", plain)
    if _product_behind_division(plain):
        raise InputError(f"unit {text!r} is ambiguous; put what stands under the line in brackets, as in N.m/(rad.s)")
    # Beside the units: powers of one digit, 1 as in 1/s, and each bracket closed.
    if not _EXPRESSION.fullmatch(plain) or _unbalanced(plain):
        raise InputError(f"unit {text!r} cannot be read")
    return Unit(text, *_resolve(plain, text))


@cache
def _kinds() -> dict[str, str]:
    """Dimension -> what a quantity of it is called."""
    return {unit(known).dimension: name for known, (name, _) in reversed(KINDS.items())}


def article(kind: str) -> str:
    """ "a speed", "an angle"."""
    return f"an {kind}" if kind[0] in "aeiou" else f"a {kind}"


def finite(number: str) -> float:
    """The double nearest to `number`; InputError where it overflows, or has more digits than any double needs."""
    if len(number) > LONGEST_NUMBER:
        raise InputError(f"{number[:20]}... has {len(number)} characters; a number has at most {LONGEST_NUMBER}")
    value = float(number)
    if not isfinite(value):
        raise InputError(f"{number} is too large (largest is about 1.8e308)")
    return value


def show(value: float, text: str) -> str:
    """A value with its unit for a message: "0.08 m/s", "0.35"."""
    if value in (inf, -inf):
        return "unlimited"
    return f"{value:.9g}" if text in ("1", "") else f"{value:.9g} {text}"


def _resolve(plain: str, text: str) -> tuple[Fraction, str]:
    """Factor and dimension of an expression that is clean already."""
    if plain in READY:
        number, turns, dimension = READY[plain]
        return Fraction(number) * _TURN**turns, dimension
    return by_pint(plain, text)


def by_pint(plain: str, text: str) -> tuple[Fraction, str]:
    """The same, calculated. InputError: `text`, which it was, cannot be read."""
    from pint.errors import PintError

    registry = _registry()
    try:
        quantity = registry.Quantity(Fraction(1), registry.parse_units(plain)).to_root_units()
    except (PintError, ValueError, TypeError, SyntaxError, AttributeError, AssertionError, ZeroDivisionError) as error:
        # pint meets what it cannot read in many ways
        raise InputError(f"unit {text!r} cannot be read") from error
    powers = {str(name).strip("[]"): float(str(power)) for name, power in quantity.dimensionality.items()}
    return Fraction(quantity.magnitude), _dimension(powers)


def _dimension(powers: dict[str, float]) -> str:
    """Canonical text of a dimension, e.g. "length/time^2"."""

    def term(name: str, power: float) -> str:
        return name if power == 1 else f"{name}^{power:g}"

    over = [term(name, power) for name, power in sorted(powers.items()) if power > 0]
    under = [term(name, -power) for name, power in sorted(powers.items()) if power < 0]
    return "/".join(["*".join(over) or "1", *under])


def _unbalanced(plain: str) -> bool:
    depth = 0
    for c in plain:
        depth += (c == "(") - (c == ")")
        if depth < 0:
            return True
    return depth != 0


def _product_behind_division(plain: str) -> bool:
    """Whether a * follows a / on the same level of brackets: people differ on what N.m/rad.s means."""
    divided = [False]
    for c in plain:
        if c == "(":
            divided.append(False)
        elif c == ")" and len(divided) > 1:
            divided.pop()
        elif c == "/":
            divided[-1] = True
        elif c == "*" and divided[-1]:
            return True
    return False


def _hint(given: Unit, target: Unit) -> str:
    if given.dimension == unit("rad/s").dimension and target.dimension == unit("1/s").dimension:
        return "; Hz and rad/s hold an angle and are not the same as 1/s"
    return ""


def _suggest(symbol: str) -> str:
    known = [*DEFINITIONS, *ALIASES]
    same = [name for name in known if name.lower() == symbol.lower()]
    close = same or get_close_matches(symbol, known, n=1, cutoff=0.6)
    return f"; did you mean {close[0]!r}?" if close else f"; known are {', '.join(DEFINITIONS)}"


def _suggest_for(symbol: str, text: str, target: Unit) -> str:
    """A symbol close to ``symbol`` with which ``text`` has the dimension of ``target``; else all known ones."""
    known = [*DEFINITIONS, *ALIASES]
    close = [name for name in known if name.lower() == symbol.lower()]
    close += get_close_matches(symbol, known, n=10, cutoff=0.5)
    for name in close:
        corrected = re.sub(rf"(?<![^\W\d_]){re.escape(symbol)}(?![^\W\d_])", name, text)
        with suppress(InputError):
            if unit(corrected).dimension == target.dimension:
                return f"; did you mean {name!r}?"
    return f"; known are {', '.join(DEFINITIONS)}"


@cache
def _registry() -> pint.UnitRegistry[Fraction]:
    import pint

    registry: pint.UnitRegistry[Fraction] = pint.UnitRegistry(None, non_int_type=Fraction)
    registry.load_definitions([f"{name} = {definition.replace('^', '**')}" for name, definition in DEFINITIONS.items()])
    return registry
