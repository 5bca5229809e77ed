"""Units of two columns that are compared, and of their tolerance."""

from __future__ import annotations

from math import isfinite

from feedsim import units
from feedsim.compare.tolerance import OF_MAGNITUDE, OF_UNIT, Tolerance
from feedsim.errors import InputError
from feedsim.scenario.columns import spelled


def factor(result: str, reference: str) -> tuple[float, str]:
    """What result's values are multiplied with to be in the reference's unit, and what was taken for granted.

    A column without a unit is in SI where the other one has a unit: so are the variables of FMUs that tools write
    without. InputError: unknown unit, dimensions differ.
    """
    if result == reference or units_alike(result, reference):
        return 1.0, ""
    if result and reference:
        try:
            return float(units.factor(result, reference)), ""
        except InputError:
            return float(units.factor(spelled(result), spelled(reference))), ""
    if not result:
        scale = 1 / units.unit(spelled(reference)).factor
        return float(scale), f"the result tells no unit; taken as SI (the reference's is {reference})"
    to_si = float(units.unit(spelled(result)).factor)
    return to_si, f"the reference tells no unit; taken as SI (the result's is {result})"


def units_alike(one: str, other: str) -> bool:
    """A plain number may be written with and without "1"."""
    return {one, other} <= {"", "1"}


def allowed(tolerance: Tolerance, unit: str, span: float, magnitude: float) -> float:
    """Tolerance in value in `unit`; without a unit the values are taken to be in SI.

    span, magnitude: range of the reference, and largest magnitude of its kind. InputError: a unit of another kind, or
    what comes of it is too large for a number.
    """
    found = _allowed(tolerance, unit, span, magnitude)
    if not isfinite(found):
        raise InputError(f"{tolerance.text} of a range of {span:.6g} is no finite number")
    return found


def _allowed(tolerance: Tolerance, unit: str, span: float, magnitude: float) -> float:
    value, given = tolerance.value or 0.0, tolerance.unit or ""
    if tolerance.relative:
        return value * max(span, OF_MAGNITUDE * magnitude, OF_UNIT) if value else 0.0
    if not given or given == unit:
        return value
    if not unit:
        return value * float(units.unit(given).factor)
    try:
        return value * float(units.factor(given, unit))
    except InputError:
        return value * float(units.factor(given, spelled(unit)))
