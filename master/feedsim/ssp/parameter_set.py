"""Parameter sets (SSV): start values of a component with their units."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from math import isfinite

from feedsim import units
from feedsim.errors import InputError
from feedsim.ssp import xml
from feedsim.ssp.unit_definition import UnitDefinition, append_units, read_units

# The same name in every set of a file: ecos asks for the sets of one name, in whichever component they are.
NAME = "parameters"
TYPES = ("Real", "Integer", "Boolean", "String", "Enumeration")

Value = float | int | bool | str


@dataclass(frozen=True)
class Parameter:
    """A parameter as the file has it: `kind` is one of TYPES, `text` the value, `unit` None where none is given."""

    name: str
    kind: str
    text: str
    unit: str | None = None


@dataclass(frozen=True)
class ParameterSet:
    """Parameters in the file's order, and the units that the file defines."""

    parameters: tuple[Parameter, ...]
    units: Mapping[str, UnitDefinition] = field(default_factory=dict)


def to_bytes(parameter_set: ParameterSet) -> bytes:
    """The SSV document."""
    root = xml.element("ssv:ParameterSet", {"version": "1.0", "name": NAME})
    group = xml.child(root, "ssv:Parameters")
    for parameter in parameter_set.parameters:
        entry = xml.child(group, "ssv:Parameter", {"name": parameter.name})
        unit = {} if parameter.unit is None else {"unit": parameter.unit}
        xml.child(entry, f"ssv:{parameter.kind}", {"value": parameter.text, **unit})
    append_units(root, "ssv:Units", parameter_set.units)
    return xml.to_bytes(root)


def parameter(name: str, kind: str, value: Value, unit: str | None) -> Parameter:
    """A parameter of an FMU: `kind` as its modelDescription.xml says, `value` in `unit`."""
    if kind == "Real":
        return Parameter(name, kind, repr(float(value)), unit)
    if kind == "Boolean":
        return Parameter(name, kind, "true" if value else "false")
    return Parameter(name, kind, str(value))


def read(content: bytes, where: str) -> ParameterSet:
    """Read an SSV document. InputError lists every problem."""
    return from_element(xml.parse(content, where, "ssv:ParameterSet"), where)


def from_element(root: xml.Element, where: str) -> ParameterSet:
    """A set that stands inside another document."""
    problems: list[str] = []
    found: list[Parameter] = []
    for entry in root.findall(f"{xml.tag('ssv:Parameters')}/{xml.tag('ssv:Parameter')}"):
        name = entry.get("name", "")
        values = [value for value in entry if value.tag in {xml.tag(f"ssv:{kind}") for kind in TYPES}]
        if not name or len(values) != 1 or values[0].get("value") is None:
            problems.append(
                f"{where}: parameter {name or '(without a name)'}: one value of {', '.join(TYPES)} is needed"
            )
            continue
        if any(other.name == name for other in found):
            problems.append(f"{where}: parameter {name} is there twice")
        kind = xml.shown(values[0].tag).partition(":")[2]
        found.append(Parameter(name, kind, values[0].get("value", ""), values[0].get("unit")))
    if problems:
        raise InputError.of(where, problems)
    return ParameterSet(tuple(found), read_units(root.find(xml.tag("ssv:Units")), where))


def value(
    parameter: Parameter, kind: str, unit: str, definitions: Iterable[Mapping[str, UnitDefinition]] = ()
) -> Value:
    """The value for a variable of type `kind` in `unit`.

    A unit of the parameter's own is converted: one that feedsim knows, or else one that `definitions` hold. Without
    one the value is in the variable's.

    Raises:
        InputError: no number, another type, not finite, a unit of another dimension or unknown.
    """
    text = parameter.text.strip()
    if kind == "Real" and parameter.kind in ("Real", "Integer"):
        number = _number(text)
        if parameter.unit in (None, "", unit) or not isinstance(number, float):
            return number
        return _converted(text, number, str(parameter.unit), unit, definitions)
    if kind == "Integer" and parameter.kind in ("Integer", "Enumeration", "Real"):
        number = _number(text)
        if number != int(number):
            raise InputError(f"{text} is no whole number")
        return int(number)
    if kind == "Boolean" and text in ("true", "false", "1", "0") and parameter.kind in ("Boolean", "Integer"):
        return text in ("true", "1")
    if kind == "String" and parameter.kind == "String":
        return parameter.text
    raise InputError(f"{parameter.kind} {parameter.text!r} is no value of a {kind} variable")


def _number(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        raise InputError(f"{text!r} is no number") from None
    if not isfinite(number):
        raise InputError(f"{text} is no number to calculate with")
    return number


def _converted(
    text: str, number: float, given: str, wanted: str, definitions: Iterable[Mapping[str, UnitDefinition]]
) -> float:
    try:
        # As a scenario's text "1600 mN.m": exact, then rounded once.
        converted = float(Fraction(text) * units.factor(given, wanted))
    except InputError as error:
        target = next((known[wanted] for known in definitions if wanted in known), None)
        source = next((known[given] for known in definitions if given in known), None)
        if source is None or target is None or source.exponents != target.exponents:
            raise InputError(f"unit {given!r}: {error}") from None
        converted = (number * source.factor + source.offset - target.offset) / target.factor
    if not isfinite(converted):
        raise InputError(f"{text} {given} is too large to calculate with")
    return converted
