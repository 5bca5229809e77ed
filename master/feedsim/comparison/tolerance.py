"""Tolerances per variable, in value and in time: rules with patterns, of which later ones win."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from math import isfinite

from feedsim.comparison.options import conversion
from feedsim.files.columns import ToleranceFile
from feedsim.files.trace import matches
from feedsim.foundation import units
from feedsim.foundation.errors import InputError

DEFAULT_TOLERANCE = 1e-3  # of the range of the reference
# A reference that hardly moves: its range counts as this share of the largest magnitude of all columns in its unit (of
# its own where it has none) at least, and as this much in its unit, so that rounding noise of an axis at rest is none.
OF_MAGNITUDE, OF_UNIT = 1e-6, 1e-9
TOLERANCE_EXAMPLE = "1e-6, '1e-3 N.m', '2 nm,1 ms' or 'Z.x_a=2 nm'"


@dataclass(frozen=True)
class Tolerance:
    """What a rule says; None where it says nothing.

    value     in `unit`; without unit (relative) a share of the range of the reference
    time      [s]
    hold      whether the values hold between rows; None: where the reference is 0 and 1 alone
    ignore    the variable is not compared
    """

    value: float | None = None
    unit: str | None = None
    relative: bool = False
    time: float | None = None
    hold: bool | None = None
    ignore: bool | None = None

    def __post_init__(self) -> None:
        for what, number in (("value", self.value), ("time", self.time)):
            if number is not None and not 0 <= number < float("inf"):
                raise InputError(f"a tolerance in {what} of {number:.9g}; it must be 0 or more")

    def over(self, other: Tolerance) -> Tolerance:
        """This one where it says something, else the other."""
        merged = replace(
            other,
            time=other.time if self.time is None else self.time,
            hold=other.hold if self.hold is None else self.hold,
            ignore=other.ignore if self.ignore is None else self.ignore,
        )
        if self.value is not None:
            merged = replace(merged, value=self.value, unit=self.unit, relative=self.relative)
        return merged

    @property
    def text(self) -> str:
        """As it may be written behind --tol."""
        value = f"{self.value:.6g}" if self.value is not None else ""
        parts = [value if self.relative or not self.unit else f"{value} {self.unit}"]
        parts += [f"{self.time:.6g} s"] if self.time else []
        return ", ".join(part for part in parts if part)


@dataclass(frozen=True)
class Tolerances:
    """Rules (pattern, tolerance) in rising order of precedence.

    A pattern must match a column, unless it is among the `shared` ones: they may be for other references.
    """

    rules: tuple[tuple[str, Tolerance], ...] = ()
    shared: frozenset[str] = frozenset()

    @classmethod
    def parse(cls, texts: Iterable[str]) -> Tolerances:
        """Of texts as behind --tol. InputError."""
        return cls(tuple(rule(text) for text in texts))

    @classmethod
    def of_file(cls, file: ToleranceFile) -> Tolerances:
        """Of a tolerance file: what holds for all, then its patterns in their order."""
        rules = [("*", _amount(file.value, Tolerance(time=file.time)))]
        for pattern, given in file.variables.items():
            rest = Tolerance(time=given.time, hold=given.hold, ignore=given.ignore)
            rules.append((pattern, _amount(given.value, rest)))
        return cls(tuple(rules)).for_several()

    def __add__(self, other: Tolerances) -> Tolerances:
        """The other's rules count more."""
        return Tolerances(self.rules + other.rules, self.shared | other.shared)

    def for_several(self) -> Tolerances:
        """With patterns that need not match in every reference."""
        return Tolerances(self.rules, frozenset(pattern for pattern, _ in self.rules))

    def of(self, name: str) -> Tolerance:
        """All that holds for a variable."""
        result = Tolerance(value=DEFAULT_TOLERANCE, relative=True, time=0.0)
        for pattern, tolerance in self.rules:
            if matches(name, pattern):
                result = tolerance.over(result)
        return result

    def given(self, name: str) -> bool:
        """Whether a rule says a tolerance in value, so that the default does not count."""
        return any(tolerance.value is not None and matches(name, pattern) for pattern, tolerance in self.rules)

    def unused(self, names: Sequence[str]) -> list[str]:
        """Patterns that no name matches, each once."""
        return [p for p in dict(self.rules) if not any(matches(name, p) for name in names)]


def _amount(value: tuple[float, str] | None, rest: Tolerance) -> Tolerance:
    if value is None:
        return rest
    number, unit = value
    return replace(rest, value=number, unit=unit or None, relative=not unit)


def rule(text: str) -> tuple[str, Tolerance]:
    """Pattern and tolerance of "PATTERN=SPEC", or of "SPEC" for all. InputError."""
    pattern, equals, spec = text.rpartition("=")
    pattern = pattern.strip()
    if equals and not pattern:
        raise InputError(f"tolerance {text!r}: nothing before '='; write for example {TOLERANCE_EXAMPLE}")
    try:
        return pattern or "*", specification(spec)
    except InputError as error:
        raise InputError(f"tolerance {text!r}: {error}") from None


def specification(spec: str) -> Tolerance:
    """Tolerance of "1e-6", "0.1 %", "2 nm", "1 ms", "1e-3 N.m,1 ms". InputError."""
    if spec.strip() == "ignore":
        return Tolerance(ignore=True)
    tolerance = Tolerance()
    for part in spec.split(","):
        given = _part(part.strip())
        twice = tolerance.value if given.time is None else tolerance.time
        if twice is not None:
            hint = "; write a decimal point, not a comma" if re.match(r"\s*[-+]?[0-9]+,[0-9]", spec) else ""
            raise InputError(f"two tolerances in {'value' if given.time is None else 'time'}{hint}")
        tolerance = given.over(tolerance)
    return tolerance


def _part(text: str) -> Tolerance:
    match = re.fullmatch(rf"({units.NUMBER})\s*(.*)", text, re.DOTALL)
    if not match:
        raise InputError(f"{text!r} is no tolerance; write for example {TOLERANCE_EXAMPLE}")
    value, unit = units.finite(match[1]), match[2].strip()
    if unit in ("", "%"):
        return Tolerance(value=value / 100 if unit else value, relative=True)
    if units.unit(unit).dimension == units.unit("s").dimension:
        return Tolerance(time=units.convert(value, unit, "s"))
    return Tolerance(value=value, unit=unit)


def allowed_deviation(tolerance: Tolerance, unit: str, span: float, magnitude: float) -> float:
    """Tolerance in value in `unit`; without a unit the values are taken to be in SI.

    span, magnitude: range of the reference, and largest magnitude of its kind. InputError: a unit of another kind, or
    what comes of it is too large for a number.
    """
    value = _allowed_value(tolerance, unit, span, magnitude)
    if not isfinite(value):
        raise InputError(f"{tolerance.text} of a range of {span:.6g} is no finite number")
    return value


def _allowed_value(tolerance: Tolerance, unit: str, span: float, magnitude: float) -> float:
    value, given = tolerance.value or 0.0, tolerance.unit or ""
    if tolerance.relative:
        return value * max(span, OF_MAGNITUDE * magnitude, OF_UNIT) if value else 0.0
    if not given or given == unit:
        return value
    if not unit:
        return value * float(units.unit(given).factor)
    return value * conversion(given, unit)
