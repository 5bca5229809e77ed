"""Which columns are compared with which, in which units and over which time."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from feedsim.files.trace import Series, matches
from feedsim.files.trace.trace import suggest_name
from feedsim.foundation import units
from feedsim.foundation.errors import InputError, shorten_list
from feedsim.foundation.units import spell_unit

MAX_LISTED_COLUMNS = 4  # columns that a note names


@dataclass(frozen=True)
class Options:
    """How a result and a reference are laid over each other.

    columns          (result's name, reference's name); `*` in both: ("plant.*", "*")
    only, ignore     patterns of reference's names that are compared, and that are not
    units            pattern -> unit of result's columns whose header does not give it; reference_units likewise
    hold             patterns of columns that hold their values between rows
    start, end       [s] of the reference's time; None: all of it
    shift            added to the result's time [s]
    common           columns that the result lacks are left out, not missing
    max_gap          longest step between rows of the result [s]; None: any
    at               whose instants are looked at: "result", "reference" (the result is interpolated there), or "auto":
                     the result's unless the reference has clearly fewer rows and no bounds between them
    cover            least share of the result's rows that must be compared
    """

    columns: Sequence[tuple[str, str]] = ()
    only: Sequence[str] = ()
    ignore: Sequence[str] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    reference_units: Mapping[str, str] = field(default_factory=dict)
    hold: Sequence[str] = ()
    start: float | None = None
    end: float | None = None
    shift: float = 0.0
    common: bool = False
    max_gap: float | None = None
    at: Literal["auto", "result", "reference"] = "auto"
    cover: float = 0.0


def chosen(names: Sequence[str], options: Options) -> list[str]:
    """Reference's names that are asked for. InputError: a pattern that matches nothing."""
    for pattern in unmatched_patterns((*options.only, *options.ignore), names):
        raise InputError(f"the reference has no column {pattern!r}{suggest_name(pattern, names)}")
    return [
        name
        for name in names
        if (not options.only or _matches_any(name, options.only)) and not _matches_any(name, options.ignore)
    ]


def sources(result: Sequence[str], reference: Sequence[str], options: Options) -> dict[str, str]:
    """Reference's name -> the result's column that is compared with it.

    InputError: a renaming that matches nothing, or gives two columns one name.
    """
    results: dict[str, str] = {}
    for theirs, ours in options.columns:
        pattern, target = _renaming_rule(theirs, ours)
        renamed = {match.expand(target): name for name in result if (match := pattern.fullmatch(name))}
        if not renamed:
            raise InputError(
                f"--column {theirs}={ours}: the result has no column {theirs!r}{suggest_name(theirs, result)}"
            )
        if "*" not in ours and ours not in reference:
            raise InputError(
                f"--column {theirs}={ours}: the reference has no column {ours!r}{suggest_name(ours, reference)}"
            )
        for name, source in renamed.items():
            if results.get(name, source) != source:
                raise InputError(f"--column: both {results[name]!r} and {source!r} of the result would be {name!r}")
            results[name] = source
    there = {*results, *result}
    return {name: results.get(name, name) for name in reference if name in there}


def describe_missing_column(name: str, result: Sequence[str]) -> str:
    """That a reference's column is not in the result, and what could be meant."""
    alike = [entry for entry in result if entry.endswith(name) and entry[: -len(name)].endswith((".", ":", "/", "|"))]
    if len(alike) == 1:
        prefix = alike[0].removesuffix(name)
        return f"the result has no column {name!r}; is it {alike[0]!r}? Then --column '{prefix}*=*'"
    return f"the result has no column {name!r}{suggest_name(name, result)}"


def with_units(series: Series, given: Mapping[str, str]) -> Series:
    """With the units that are given for columns whose header gives none. given: pattern -> unit."""
    if not given:
        return series
    return replace(series, units={name: unit or _unit_of_column(name, given) for name, unit in series.units.items()})


def _unit_of_column(name: str, given: Mapping[str, str]) -> str:
    """Unit that is given for a column; "" without."""
    return next((unit for pattern, unit in reversed(list(given.items())) if matches(name, pattern)), "")


def repeated_units(headers: Mapping[str, str], names: Iterable[str], given: Mapping[str, str], whose: str) -> list[str]:
    """Which compared columns are given the unit that their header gives already; one that it does not: InputError.

    headers: name -> unit as the file has it. given: pattern -> unit.
    """
    twice: dict[str, list[str]] = {}
    for name in names:
        header, unit = headers.get(name, ""), _unit_of_column(name, given)
        if not header or not unit:
            continue
        try:
            scale, _ = factor(unit, header)
        except InputError:
            scale = 0.0
        if scale != 1.0:
            raise InputError(
                f"{whose}'s unit given for {name!r}: {unit}, but its header gives {header}; a unit is given to columns "
                "without one, and a header that is wrong must be put right"
            )
        twice.setdefault(unit, []).append(name)
    return [
        f"{shorten_list(those, MAX_LISTED_COLUMNS)}: the {whose}'s header gives {unit} already"
        for unit, those in twice.items()
    ]


def factor(result: str, reference: str) -> tuple[float, str]:
    """What result's values are multiplied with to be in the reference's unit, and what was taken for granted.

    A column without a unit is in SI where the other one has a unit: so are the variables of FMUs that tools write
    without. InputError: unknown unit, dimensions differ.
    """
    if result == reference or {result, reference} <= {"", "1"}:  # a plain number is written with and without "1"
        return 1.0, ""
    if result and reference:
        return conversion(result, reference), ""
    if not result:
        scale = 1 / units.unit(spell_unit(reference)).factor
        return float(scale), f"the result gives no unit; taken as SI (the reference's is {reference})"
    to_si = float(units.unit(spell_unit(result)).factor)
    return to_si, f"the reference gives no unit; taken as SI (the result's is {result})"


def conversion(given: str, wanted: str) -> float:
    """Factor between two units, in the spelling of drives where feedsim does not know them. InputError."""
    try:
        return float(units.factor(given, wanted))
    except InputError:
        return float(units.factor(spell_unit(given), spell_unit(wanted)))


def unmatched_patterns(patterns: Iterable[str], names: Sequence[str]) -> list[str]:
    """Patterns that match no name."""
    return [pattern for pattern in patterns if not any(matches(name, pattern) for name in names)]


def check_used(what: str, patterns: Iterable[str], names: Sequence[str]) -> None:
    """InputError where what is given for a pattern is given for no name."""
    for pattern in unmatched_patterns(patterns, names):
        raise InputError(f"{what} given for {no_match(pattern, names)}")


def no_match(pattern: str, names: Sequence[str]) -> str:
    """That a pattern matches no name, and which there are."""
    more = ", ..." if len(names) > 12 else ""
    return f"{pattern!r}, which matches no column; there is {', '.join(names[:12])}{more}"


def _matches_any(name: str, patterns: Iterable[str]) -> bool:
    return any(matches(name, pattern) for pattern in patterns)


def _renaming_rule(theirs: str, ours: str) -> tuple[re.Pattern[str], str]:
    """Pattern of the result's names and what the reference calls them."""
    if theirs.count("*") != ours.count("*"):
        raise InputError(f"--column {theirs}={ours}: as many * on either side are needed")
    if not theirs or not ours:
        raise InputError(f"--column {theirs}={ours}: RESULT=REFERENCE is needed, for example plant.*=*")
    pattern = "(.*)".join(re.escape(part) for part in theirs.split("*"))
    parts = ours.split("*")
    target = parts[0].replace("\\", r"\\") + "".join(
        rf"\g<{i}>" + part.replace("\\", r"\\") for i, part in enumerate(parts[1:], 1)
    )
    return re.compile(pattern), target
