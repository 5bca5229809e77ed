"""Parameter sets (SSV): start values of a component with their units."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from math import inf, isfinite

from feedsim.foundation import units
from feedsim.foundation.errors import InputError
from feedsim.simulation.cosim.archive import UnitDefinition
from feedsim.simulation.ssp import archive
from feedsim.simulation.ssp.archive import append_units, read_units

# The same name in every set of a file: ecos asks for the sets of one name, in whichever component they are.
SET_NAME = "parameters"
MOST_PROBLEMS = 20  # reported at once
_XML_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|[+-]?INF|NaN")  # of XML Schema
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
    """Parameters in the file's order, the units that the file defines, and a note for whoever opens it."""

    parameters: tuple[Parameter, ...]
    units: Mapping[str, UnitDefinition] = field(default_factory=dict)
    description: str = ""


def to_bytes(parameter_set: ParameterSet) -> bytes:
    """The SSV document."""
    described = {"description": parameter_set.description} if parameter_set.description else {}
    root = archive.element("ssv:ParameterSet", {"version": "1.0", "name": SET_NAME, **described})
    group = archive.child(root, "ssv:Parameters")
    for parameter in parameter_set.parameters:
        entry = archive.child(group, "ssv:Parameter", {"name": parameter.name})
        unit = {} if parameter.unit is None else {"unit": parameter.unit}
        archive.child(entry, f"ssv:{parameter.kind}", {"value": parameter.text, **unit})
    append_units(root, "ssv:Units", parameter_set.units)
    return archive.to_bytes(root)


def parameter(name: str, kind: str, value: Value, unit: str | None) -> Parameter:
    """A parameter of an FMU: `kind` as its modelDescription.xml says, `value` in `unit`."""
    if kind == "Real":
        return Parameter(name, kind, repr(float(value)), unit)
    if kind == "Boolean":
        return Parameter(name, kind, "true" if value else "false")
    return Parameter(name, kind, str(value))


def read_parameter_set(content: bytes, where: str) -> ParameterSet:
    """Read an SSV document. InputError lists every problem."""
    return from_element(archive.parse(content, where, "ssv:ParameterSet"), where)


def from_element(root: archive.Element, where: str) -> ParameterSet:
    """A set that stands inside another document."""
    problems: list[str] = []
    parameters: dict[str, Parameter] = {}
    kinds = {archive.tag(f"ssv:{kind}") for kind in TYPES}
    for entry in root.findall(f"{archive.tag('ssv:Parameters')}/{archive.tag('ssv:Parameter')}"):
        name = entry.get("name", "")
        values = [value for value in entry if value.tag in kinds]
        if not name or len(values) != 1 or values[0].get("value") is None:
            problems.append(
                f"{where}: parameter {name or '(without a name)'}: one value of {', '.join(TYPES)} is needed"
            )
            continue
        if name in parameters:
            problems.append(f"{where}: parameter {name} is there twice")
        kind = archive.prefixed_tag(values[0].tag).partition(":")[2]
        parameters[name] = Parameter(name, kind, values[0].get("value", ""), values[0].get("unit"))
    if problems:
        more = len(problems) - MOST_PROBLEMS
        raise InputError.of(
            where, problems if more <= 0 else [*problems[:MOST_PROBLEMS], f"{where}: {more} more problems"]
        )
    return ParameterSet(
        tuple(parameters.values()), read_units(root.find(archive.tag("ssv:Units")), where), root.get("description", "")
    )


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
        result = number(text)
        if parameter.unit in (None, "", unit):
            return result
        return _convert_value(text, result, str(parameter.unit), unit, definitions)
    if kind == "Integer" and parameter.kind in ("Integer", "Enumeration", "Real"):
        result = number(text)
        if result != int(result):
            raise InputError(f"{text} is no whole number")
        return int(result)
    if kind == "Boolean" and text in ("true", "false", "1", "0") and parameter.kind in ("Boolean", "Integer"):
        return text in ("true", "1")
    if kind == "String" and parameter.kind == "String":
        return parameter.text
    raise InputError(f"{parameter.kind} {parameter.text!r} is no value of a {kind} variable")


def number(text: str) -> float:
    """The number that a text of XML Schema's type double stands for. InputError: none, or not finite."""
    shown = text if len(text) <= 40 else f"{text[:40]}..."
    if len(text) > units.LONGEST_NUMBER:
        raise InputError(f"{shown} has {len(text)} characters; a number has at most {units.LONGEST_NUMBER}")
    if not _XML_NUMBER.fullmatch(text):
        raise InputError(f"{shown!r} is no number")
    result = float(text)
    if not isfinite(result):
        raise InputError(f"{shown} is no number to calculate with")
    return result


def _convert_value(
    text: str, value: float, given: str, wanted: str, definitions: Iterable[Mapping[str, UnitDefinition]]
) -> float:
    try:
        factor = units.factor(given, wanted)
        # As a scenario's text "1600 mN.m": exact, then rounded once. What rounds to 0 can have a huge exponent.
        converted = float(Fraction(text) * factor) if value else 0.0
    except OverflowError:
        converted = inf
    except InputError as error:
        target = next((known[wanted] for known in definitions if wanted in known), None)
        source = next((known[given] for known in definitions if given in known), None)
        if source is None or target is None or source.exponents != target.exponents:
            raise InputError(str(error)) from None
        converted = (value * source.factor + source.offset - target.offset) / target.factor
    if not isfinite(converted):
        raise InputError(f"{text} {given} is too large to calculate with")
    return converted
