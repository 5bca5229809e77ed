"""Quantities written as text, "5000 mm/min", and their conversion to SI.

May use: errors, and the algebra of units that the packager has (sole user of it). Start reading at parse().

The list of symbols is short, so that it holds exactly what a machine-tool engineer writes and nothing that looks alike.
An angle is a dimension of its own (base unit rad): hertz is one revolution (cycle) per second, so 1 Hz is 2 pi rad/s
and never 1 rad/s, and a controller gain in 1/s is no frequency in Hz. Factors are exact fractions: "125 us" is the
double nearest to 125e-6, the same as the text 125e-6 itself.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from difflib import get_close_matches
from fractions import Fraction
from functools import cache, lru_cache
from math import inf, isfinite
from pathlib import Path
from typing import Any

from feedsim.foundation.errors import InputError, find_nearest_name
from feedsim.foundation.installation import repair_advice
from feedsim_packager import units as algebra

# What may be written, in the order of messages.
UNIT_SYMBOLS = (
    "m", "km", "dm", "cm", "mm", "um", "nm", "in", "s", "ms", "us", "ns", "min", "h", "kg", "g", "t", "A", "mA",
    "rad", "mrad", "urad", "rev", "deg", "arcsec", "rpm", "Hz", "kHz", "N", "mN", "kN", "Pa", "MPa", "GPa", "Nm",
    "V", "mV", "kV", "Ohm", "mOhm", "H", "mH", "uH", "Wb", "W", "percent",
)  # fmt: skip
# Other spellings of the same.
ALIASES = {
    "ohm": "Ohm",
    "mohm": "mOhm",
    "revolution": "rev",
    "micron": "um",
    "degree": "deg",
    "degrees": "deg",
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
QUANTITY_NAMES = {
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
    "W": ("power", "10 W"),
    "1/A": ("1/current", "1 1/A"),
}

DIMENSIONLESS = "1"
LONGEST_NUMBER = 1100  # characters; every double, written out, has less
MAX_UNIT_LENGTH = 60  # characters of a unit

# Names of the dimensions of algebra.BASE, as messages have them.
_DIMENSIONS = ("mass", "length", "time", "current", "temperature", "amount", "luminosity", "angle")

NUMBER = r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_QUANTITY = re.compile(rf"\s*({NUMBER})(.*)", re.DOTALL)
_SYMBOL = re.compile(r"[^\W\d_]+|[%°]")
_EXPRESSION = re.compile(r"(?:(?<![)^0-9])\^[+-]?[0-9](?![0-9^])|(?<![0-9^])1(?![0-9])|[^\W\d_]|[*/()])*")
# No repetition within a repetition: what does not match would be tried in exponentially many ways.
_LEGAL = re.compile(r"(?:[^\W\d_]|[%°]|[0-9]|[-+ ().*/^])*")
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
        super().__init__(f"unknown unit {symbol!r}{_suggest_unit(symbol)}")


def example(text: str) -> str:
    """A quantity that could stand where one in unit `text` is expected."""
    return QUANTITY_NAMES[text][1] if text in QUANTITY_NAMES else f"1 {text}"


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
    if len(plain) > MAX_UNIT_LENGTH:
        raise InputError(f"unit {text[:20]!r}... has more than {MAX_UNIT_LENGTH} characters")
    if not _LEGAL.fullmatch(plain):
        bad = next(c for c in plain if not _LEGAL.fullmatch(c))
        raise InputError(f"unit {text!r} holds {bad!r}")
    for symbol in _SYMBOL.findall(plain):
        if symbol not in UNIT_SYMBOLS and symbol not in ALIASES:
            raise UnknownSymbol(symbol)
    plain = _SYMBOL.sub(lambda match: ALIASES.get(match[0], match[0]), plain)
    plain = re.sub(r"(?<=[a-zA-Z])([0-9])", r"^\1", plain).replace("**", "^")
    plain = re.sub(r" ?([.*/^()]) ?", r"\1", plain)
    plain = re.sub(r"(?<=[\w)])[ .](?=[\w(])", "*", plain)
    plain = re.sub(r"(?<=[\w)])\((?!$)|(?<=[0-9])(?=[a-zA-Z])", r"*\g<0>", plain)
    if _has_product_after_division(plain):
        raise InputError(f"unit {text!r} is ambiguous; put what stands under the line in brackets, as in N.m/(rad.s)")
    # Beside the units: powers of one digit, 1 as in 1/s, and each bracket closed.
    if not _EXPRESSION.fullmatch(plain) or _has_unbalanced_brackets(plain):
        raise InputError(f"unit {text!r} cannot be read")
    try:
        result = algebra.parse(plain.replace("^+", "^") or DIMENSIONLESS)
    except (algebra.UnitError, RecursionError):
        raise InputError(f"unit {text!r} cannot be read") from None
    return Unit(text, result.exact, _dimension(result.exponents))


@cache
def _kinds() -> dict[str, str]:
    """Dimension -> what a quantity of it is called."""
    return {unit(known).dimension: name for known, (name, _) in reversed(QUANTITY_NAMES.items())}


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


def _dimension(exponents: tuple[int, ...]) -> str:
    """Canonical text of a dimension, e.g. "length/time^2"."""
    powers = sorted(zip(_DIMENSIONS, exponents, strict=True))
    over = [name if power == 1 else f"{name}^{power}" for name, power in powers if power > 0]
    under = [name if power == -1 else f"{name}^{-power}" for name, power in powers if power < 0]
    return "/".join(["*".join(over) or "1", *under])


def _has_unbalanced_brackets(plain: str) -> bool:
    depth = 0
    for c in plain:
        depth += (c == "(") - (c == ")")
        if depth < 0:
            return True
    return depth != 0


def _has_product_after_division(plain: str) -> bool:
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


def _suggest_unit(symbol: str) -> str:
    near = find_nearest_name(symbol, [*UNIT_SYMBOLS, *ALIASES])
    return f"; did you mean {near!r}?" if near else f"; known are {', '.join(UNIT_SYMBOLS)}"


def _suggest_for(symbol: str, text: str, target: Unit) -> str:
    """A symbol close to ``symbol`` with which ``text`` has the dimension of ``target``; else all known ones."""
    known = [*UNIT_SYMBOLS, *ALIASES]
    close = [name for name in known if name.lower() == symbol.lower()]
    close += get_close_matches(symbol, known, n=10, cutoff=0.5)
    for name in close:
        corrected = re.sub(rf"(?<![^\W\d_]){re.escape(symbol)}(?![^\W\d_])", name, text)
        with suppress(InputError):
            if unit(corrected).dimension == target.dimension:
                return f"; did you mean {name!r}?"
    return f"; known are {', '.join(UNIT_SYMBOLS)}"


# --- Units as drives and people spell them ----------------------------------------------------------------------------


# What drives write that is no unit of its own: a whole unit -> the unit, and what to know about it.
SPELLINGS: dict[str, str] = {
    "increment": "1", "increments": "1", "inc": "1", "incs": "1", "count": "1", "counts": "1", "digits": "1",
    "inch": "in", "inches": "in", "turn": "rev", "turns": "rev", "revs": "rev", "revolutions": "rev",
    "r/min": "rpm", "u/min": "rpm", "upm": "rpm", "1/min": "rpm", "min-1": "rpm", "min^-1": "rpm",
    "a rms": "A", "arms": "A", "a(rms)": "A", "a_rms": "A", "aeff": "A", "a eff": "A",
}  # fmt: skip
RMS = ("a rms", "arms", "a(rms)", "a_rms", "aeff", "a eff")


def spell_unit(text: str) -> str:
    """A unit as drives write it in the spelling of this module: "U/min" is rpm, "increments" a plain number."""
    return SPELLINGS.get(" ".join(text.split()).lower(), text)


def is_rms(text: str) -> bool:
    """Whether a unit says that a current is an effective value."""
    return " ".join(text.split()).lower() in RMS


def known_unit(text: str) -> bool:
    """Whether text is a unit at all."""
    try:
        unit(spell_unit(text))
    except InputError:
        return False
    return True


# --- Variables of the shipped units as the units' tables (src/*_fmu/variables.def) declare them: the source of
#     unit,
# range, start value and description of what people write in machine files.
#
# May use: units, errors. Start reading at table(). `make fmus` writes variables.json beside this file.


NAMES = ("Coulomb", "Stribeck")  # of persons: they stay as they are within a sentence
FILE = Path(__file__).with_name("variables.json")


@dataclass(frozen=True)
class Variable:
    """A row of a unit's table. kind: REAL, INTEGER, BOOLEAN or STRING; a REAL has a unit and one that people use."""

    kind: str
    causality: str
    start: float | str
    text: str
    unit: str = ""
    display_unit: str = ""
    minimum: float = -inf
    maximum: float = inf

    @property
    def short(self) -> str:
        """What the description is about, for a table's row: without what is in brackets and behind a semicolon."""
        about = re.split(r"[;:]", re.sub(r" \([^)]*\)", "", self.text))[0]
        return about if about.startswith(NAMES) else about[:1].lower() + about[1:]

    @property
    def example(self) -> str:
        """The start value with the unit in which it is shorter; "" where it is zero, which shows nobody anything."""
        if self.kind != "REAL" or not self.start:
            return ""
        if self.unit == DIMENSIONLESS:
            return f"{self.start:.4g}"
        value, own = float(self.start), (self.unit, self.display_unit)
        return min((f"{convert(value, self.unit, unit):.4g} {unit}" for unit in own), key=lambda text: text.index(" "))


@cache
def table(unit: str) -> Mapping[str, Variable]:
    """Name -> variable of a shipped unit, in the order of its table. InputError: the tables have not been made yet."""
    return {name: Variable(**entry) for name, entry in _read_tables()[unit].items()}


def parameters(unit: str) -> Mapping[str, Variable]:
    """The parameters alone."""
    return {name: variable for name, variable in table(unit).items() if variable.causality == "parameter"}


def cycle() -> Mapping[str, list[list[Any]]]:
    """Rows of the control cycle by their tables (src/machine_fmu/cycle.h, which says what they mean)."""
    rows: dict[str, list[list[Any]]] = _read_tables()["machine/cycle"]
    return rows


@cache
def _read_tables() -> dict[str, Any]:
    try:
        content: dict[str, Any] = json.loads(FILE.read_bytes())
    except FileNotFoundError:
        raise InputError(f"{FILE} is missing; {repair_advice('it from the tables of the units')}") from None
    return content
