"""Values of words: numbers, parameters, variables, functions and operators of SINUMERIK and of ISO programs.

One scanner goes through a block from left to right; values are computed as they are met.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from feedsim.motions.part_program.geometry import sine
from feedsim.motions.part_program.recorder import Fault

Value = float | bool | str

NUMBER = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:EX[-+]?\d+)?")
NAME = re.compile(r"[A-Z_$][A-Z_$][A-Z0-9_$]*|[A-Z]\d*")
SPACE = re.compile(r"[ \t]*")
TEXT = re.compile(r'"([^"]*)"')
CODED_NUMBER = re.compile(r"'(?:H([0-9A-F]{1,12})|B([01]{1,48}))'")  # 'H1F', 'B101'
OPERATOR = re.compile(r"==|<>|>=|<=|<<|[-+*/<>]|(?:DIV|MOD|AND|OR|XOR|B_AND|B_OR|B_XOR)(?![A-Z0-9_])")
ISO_OPERATOR = re.compile(r"\*\*|[-+*/]|MOD|AND|XOR|OR|EQ|NE|GT|GE|LT|LE")
MAX_DEPTH = 40  # of parentheses and functions
MAX_TEXT = 1000  # characters of a text that a program makes
MAX_NUMBER = 1e15  # of a whole number that operators on bits take
# Relative: numbers that differ by less are equal, as on a SINUMERIK.
EQUALITY_TOLERANCE = 1e-12

PRECEDENCE = {
    "OR": 1, "XOR": 2, "AND": 3,
    "==": 4, "<>": 4, ">": 4, "<": 4, ">=": 4, "<=": 4,
    "<<": 5, "B_OR": 6, "B_XOR": 7, "B_AND": 8, "+": 9, "-": 9, "*": 10, "/": 10, "DIV": 10, "MOD": 10,
}  # fmt: skip
# LinuxCNC: power, products, sums, comparisons, logic.
ISO_PRECEDENCE = {
    "AND": 1, "OR": 1, "XOR": 1, "EQ": 2, "NE": 2, "GT": 2, "GE": 2, "LT": 2, "LE": 2, "+": 3, "-": 3,
    "*": 4, "/": 4, "MOD": 4, "**": 5,
}  # fmt: skip
ISO_SPELLINGS = {"EQ": "==", "NE": "<>", "GT": ">", "GE": ">=", "LT": "<", "LE": "<="}
COMPARISONS = frozenset({"==", "<>", ">", "<", ">=", "<="})


def equal(a: float, b: float) -> bool:
    return abs(a - b) <= EQUALITY_TOLERANCE * max(abs(a), abs(b))


def compare(operator: str, a: Value, b: Value) -> bool:
    """Of numbers with the relative accuracy of the control; of texts exactly."""
    if isinstance(a, str) or isinstance(b, str):
        if operator not in ("==", "<>") or type(a) is not type(b):
            raise Fault(operator, "texts can be compared with == and <> only, and with texts")
        return (a == b) == (operator == "==")
    same = equal(a, b)
    return {"==": same, "<>": not same, ">": a > b and not same, "<": a < b and not same,
            ">=": a > b or same, "<=": a < b or same}[operator]  # fmt: skip


def whole_number(value: float, word: str) -> int:
    if value != math.floor(value) or abs(value) > MAX_NUMBER:
        raise Fault(word, f"{value:g} is no whole number")
    return int(value)


def round_half_away(value: float) -> float:
    """To the next whole number, halves away from 0."""
    return math.copysign(math.floor(abs(value) + 0.5), value) if abs(value) < MAX_NUMBER else value


def power(a: float, b: float, word: str) -> float:
    if (a == 0 and b < 0) or (a < 0 and b != math.floor(b)):
        raise Fault(word, f"{a:g} to the power of {b:g} is not defined")
    return float(a**b)


def calculate(operator: str, a: float, b: float, iso: bool) -> float:
    if operator == "+":
        return a + b
    if operator == "-":
        return a - b
    if operator == "*":
        return a * b
    if operator == "**":
        return power(a, b, operator)
    if operator in ("/", "DIV", "MOD"):
        if b == 0:
            raise Fault(operator, "division by zero")
        if operator == "MOD":
            return math.fmod(a, b) % b if iso else math.fmod(a, b)
        return a / b if operator == "/" else float(math.trunc(a / b))
    p, q = whole_number(a, operator), whole_number(b, operator)
    return float(p & q if operator == "B_AND" else p | q if operator == "B_OR" else p ^ q)


def _limit_argument(name: str, function: Callable[[float], float], least: float, most: float) -> Callable[..., float]:
    def checked(x: float) -> float:
        if not least <= x <= most:
            limits = f"{least:g} or more" if most == math.inf else f"{least:g} to {most:g}"
            raise Fault(name, f"{name} of {x:g}; its argument must be {limits}")
        return function(x)

    return checked


def _tangent(degrees: float) -> float:
    if sine(degrees + 90.0) == 0:
        raise Fault("TAN", f"TAN of {degrees:g} degrees is infinite")
    return sine(degrees) / sine(degrees + 90.0)


def _log(x: float) -> float:
    if x <= 0:
        raise Fault("LN", f"LN of {x:g}; its argument must be above 0")
    return math.log(x)


def _bound(least: float, most: float, x: float) -> float:
    return min(max(x, least), most)


# Name -> how many arguments, function. Angles in degrees.
FUNCTIONS: Mapping[str, tuple[int, Callable[..., float]]] = {
    "SIN": (1, sine),
    "COS": (1, lambda x: sine(x + 90.0) if x % 90 == 0 else math.cos(math.radians(math.remainder(x, 360.0)))),
    "TAN": (1, _tangent),
    "ASIN": (1, _limit_argument("ASIN", lambda x: math.degrees(math.asin(x)), -1.0, 1.0)),
    "ACOS": (1, _limit_argument("ACOS", lambda x: math.degrees(math.acos(x)), -1.0, 1.0)),
    "ATAN2": (2, lambda y, x: math.degrees(math.atan2(y, x))),
    "SQRT": (1, _limit_argument("SQRT", math.sqrt, 0.0, math.inf)),
    "ABS": (1, abs),
    "POT": (1, lambda x: x * x),
    "TRUNC": (1, math.trunc),
    "ROUND": (1, round_half_away),
    "ROUNDUP": (1, math.ceil),
    "LN": (1, _log),
    "EXP": (1, math.exp),
    "MINVAL": (2, min),
    "MAXVAL": (2, max),
    "BOUND": (3, _bound),
}
ISO_FUNCTIONS: Mapping[str, Callable[..., float]] = {
    **{name: FUNCTIONS[name][1] for name in ("SIN", "COS", "TAN", "ASIN", "ACOS", "SQRT", "ABS", "ROUND", "LN", "EXP")},
    "FIX": math.floor,
    "FUP": math.ceil,
}


@dataclass
class Variable:
    """Of DEF or PROC. kind: REAL, INT, BOOL, CHAR or STRING; shape: of an array."""

    kind: str
    value: Value = 0.0
    shape: tuple[int, ...] = ()
    elements: dict[tuple[int, ...], Value] = field(default_factory=dict)

    def converted(self, value: Value, word: str) -> Value:
        """InputError of the program where the kinds do not fit; a REAL becomes an INT by rounding."""
        if (self.kind == "STRING") != isinstance(value, str):
            raise Fault(word, f"a {self.kind} cannot be {value!r}")
        if isinstance(value, str):
            return value
        if self.kind == "BOOL":
            return bool(value)
        if self.kind in ("INT", "CHAR"):
            result = round_half_away(float(value))
            if not -(2.0**31) <= result < 2.0**31:
                raise Fault(word, f"{value:g} is beyond the range of {self.kind}")
            return result
        return float(value)


def zero(kind: str) -> Value:
    return "" if kind == "STRING" else False if kind == "BOOL" else 0.0


class Scanner:
    """A block, and how far it is read. values: R parameters and variables, by read(name, indices)."""

    def __init__(self, text: str, read: Callable[[Scanner, str], Value | None], iso: bool) -> None:
        self.text, self.at, self.read, self.iso = text, 0, read, iso
        self.depth = 0
        self._comparison = False  # whether the value read last is a comparison without parentheses
        self._operator = ISO_OPERATOR if iso else OPERATOR
        self._precedence = ISO_PRECEDENCE if iso else PRECEDENCE

    def skip_space(self) -> None:
        self.at = SPACE.match(self.text, self.at).end()  # type: ignore[union-attr]

    def take(self, pattern: re.Pattern[str]) -> re.Match[str] | None:
        """What matches next, after spaces."""
        self.skip_space()
        match = pattern.match(self.text, self.at)
        if match:
            self.at = match.end()
        return match

    def accept(self, text: str) -> bool:
        self.skip_space()
        if self.text.startswith(text, self.at):
            self.at += len(text)
            return True
        return False

    def expect(self, text: str, word: str) -> None:
        if not self.accept(text):
            raise Fault(word, f"{text} is missing before {self.rest() or 'the end of the block'}")

    def rest(self) -> str:
        """What comes next, short enough for a message."""
        self.skip_space()
        return self.text[self.at : self.at + 20].strip()

    def number(self, word: str) -> float:
        """A value that is a number."""
        value = self.value(word)
        if isinstance(value, str):
            raise Fault(word, f"a number is expected, not the text {value!r}")
        return float(value)

    def condition(self, word: str) -> bool:
        value = self.value(word)
        if isinstance(value, str):
            raise Fault(word, f"a condition is expected, not the text {value!r}")
        return bool(value)

    def value(self, word: str, least: int = 1) -> Value:
        """An expression whose operators bind at least as tightly as a precedence."""
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise Fault(word, f"an expression is nested more than {MAX_DEPTH} deep")
        try:
            return self._binary(word, least)
        except (OverflowError, ValueError):
            raise Fault(word, "a value is too large") from None
        finally:
            self.depth -= 1

    def _binary(self, word: str, least: int) -> Value:
        left = self._primary(word)
        while True:
            self.skip_space()
            match = self._operator.match(self.text, self.at)
            if not match or self._precedence[match[0]] < least:
                break
            operator = ISO_SPELLINGS.get(match[0], match[0])
            precedence, was_comparison = self._precedence[match[0]], self._comparison
            self.at = match.end()
            self._comparison = False
            right = self.value(word, precedence + 1)
            if precedence <= 3 and not self.iso:
                # The control gives AND a higher rank than comparisons: without parentheses it reads another condition.
                if was_comparison != self._comparison:
                    raise Fault(operator, f"{operator} binds tighter than comparisons: put each side in parentheses")
            elif operator in COMPARISONS and was_comparison:
                raise Fault(operator, "two comparisons in a row: put one in parentheses")
            left = self._combine_values(operator, left, right)
            self._comparison = operator in COMPARISONS
        return left

    def _combine_values(self, operator: str, left: Value, right: Value) -> Value:
        if operator == "<<":
            joined = "".join(v if isinstance(v, str) else f"{float(v):.10g}" for v in (left, right))
            if len(joined) > MAX_TEXT:
                raise Fault("<<", f"a text has more than {MAX_TEXT} characters")
            return joined
        if operator in COMPARISONS:
            result: Value = compare(operator, left, right)
            return float(result) if self.iso else result
        if isinstance(left, str) or isinstance(right, str):
            raise Fault(operator, "a text cannot be calculated with")
        if operator in ("AND", "OR", "XOR"):
            p, q = bool(left), bool(right)
            result = p and q if operator == "AND" else p or q if operator == "OR" else p != q
            return float(result) if self.iso else result
        return self.finite(calculate(operator, float(left), float(right), self.iso), operator)

    @staticmethod
    def finite(value: float, word: str) -> float:
        if not math.isfinite(value):
            raise Fault(word, "a value is too large")
        return float(value)

    def _primary(self, word: str) -> Value:
        """A number, a variable, a function, or an expression in parentheses, with its signs."""
        self._comparison = False
        sign, negated = 1.0, 0
        while True:
            if self.accept("-"):
                sign = -sign
            elif not self.accept("+"):
                break
        self.skip_space()
        match = NUMBER.match(self.text, self.at)
        if match:
            self.at = match.end()
            following = self.text[self.at : self.at + 2]
            if following[:1] == "." or (
                following[:1] == "E" and following[1:] in tuple("0123456789+-") and following[1:]
            ):
                raise Fault(
                    f"{word}{self.text[match.start() : self.at]}{self.rest()}".split()[0], badly_written(following)
                )
            return sign * self.finite(float(match[0].replace("EX", "E")), word)
        value = self._iso_primary(word) if self.iso else self._sinumerik_primary(word)
        if value is None:
            rest = self.rest()
            raise Fault(word, f"the value {rest!r} is not understood" if rest else "a value is missing")
        if isinstance(value, str):
            if sign < 0 or negated:
                raise Fault(word, "a text has no sign")
            return value
        return value if sign > 0 else -float(value)

    def _sinumerik_primary(self, word: str) -> Value | None:
        if self.accept("("):
            value = self.value(word)
            self.expect(")", word)
            self._comparison = False
            return value
        text = self.take(TEXT)
        if text:
            return text[1]
        coded = self.take(CODED_NUMBER)
        if coded:
            return float(int(coded[1], 16) if coded[1] else int(coded[2], 2))
        begun = self.at
        match = self.take(NAME)
        if not match:
            return None
        name = match[0]
        if name in ("TRUE", "FALSE"):
            return name == "TRUE"
        if name == "$PI":
            return math.pi
        if name in ("NOT", "B_NOT"):
            operand = self.value(name, 11)
            if isinstance(operand, str):
                raise Fault(name, "a text cannot be negated")
            return not operand if name == "NOT" else float(~whole_number(float(operand), name))
        if name in FUNCTIONS:
            return self._call_function(name, *FUNCTIONS[name])
        variable = self.read(self, name)
        if variable is None:
            self.at = begun
            raise Fault(name, "the variable is not defined")
        return variable

    def _call_function(self, name: str, count: int, function: Callable[..., float]) -> float:
        self.expect("(", name)
        arguments = [self.number(name)]
        while self.accept(","):
            arguments.append(self.number(name))
        self.expect(")", name)
        if len(arguments) != count:
            raise Fault(name, f"{name} has {count} arguments, not {len(arguments)}")
        self._comparison = False
        return self._result(name, function, *arguments)

    def _result(self, name: str, function: Callable[..., float], *arguments: float) -> float:
        try:
            return self.finite(function(*arguments), name)
        except OverflowError:
            raise Fault(name, "a value is too large") from None

    def _iso_primary(self, word: str) -> Value | None:
        """As LinuxCNC: [ ] for parentheses, #5 for parameters, FUNCTION[ ]."""
        if self.accept("["):
            value = self.value(word)
            self.expect("]", word)
            return value
        if self.accept("#"):
            return self.read(self, "#")
        self.skip_space()
        match = re.compile(r"[A-Z]{2,5}").match(self.text, self.at)
        name = match[0] if match else ""
        if name == "ATAN":
            self.at += 4
            self.expect("[", name)
            y = self.number(name)
            self.expect("]", name)
            self.expect("/", name)
            self.expect("[", name)
            x = self.number(name)
            self.expect("]", name)
            return math.degrees(math.atan2(y, x))
        if name in ISO_FUNCTIONS:
            self.at += len(name)
            self.expect("[", name)
            value = self._result(name, ISO_FUNCTIONS[name], self.number(name))
            self.expect("]", name)
            return value
        return None

    def index(self, word: str) -> int:
        return whole_number(round_half_away(self.number(word)), word)

    def indices(self, word: str) -> tuple[int, ...]:
        """[i] or [i, j] after a name; () where there is none."""
        if not self.accept("["):
            return ()
        result = [self.index(word)]
        while self.accept(","):
            result.append(self.index(word))
        self.expect("]", word)
        return tuple(result)


def badly_written(following: str) -> str:
    return "a number has two points" if following[:1] == "." else "an exponent is written EX, as in 1EX5"
