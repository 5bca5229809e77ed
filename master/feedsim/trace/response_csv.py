"""CSV files of frequency responses: what feedsim writes, and what commissioning tools and analysers export.

Written: `frequency [Hz]`, then per response `NAME magnitude [unit]`, `NAME phase [deg]` and, where it was measured,
`NAME coherence [1]`. Read besides: `NAME re`, `NAME im` in place of magnitude and phase; magnitudes in dB (`[dB]`, or
`[dB re UNIT]`); phases in rad; frequencies in rad/s or kHz; the separators, decimal commas and encodings that a trace
may have. A column without a name of its own ("Gain [dB]", "Phase [deg]") belongs to a response called like the file.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feedsim import units
from feedsim.errors import InputError
from feedsim.trace.csv import Table, quoted, read_table, shortest
from feedsim.trace.files import written_whole
from feedsim.trace.numbers import Decimal, decimal_mark, numbers
from feedsim.trace.response import FrequencyResponse
from feedsim.trace.trace import suggest

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

FREQUENCY_NAMES = ("frequency", "freq", "f")
# What a column holds, by the end of its name.
PARTS = {
    "magnitude": ("magnitude", "mag", "amplitude", "gain", "abs", "modulus"),
    "phase": ("phase", "angle", "arg"),
    "re": ("re", "real"),
    "im": ("im", "imag", "imaginary"),
    "coherence": ("coherence", "coh"),
}
_PART = {word: part for part, words in PARTS.items() for word in words}
_NAME = re.compile(rf"(?:(.*?)[\s_.:]+)?({'|'.join(sorted(_PART, key=len, reverse=True))})", re.IGNORECASE)
_DECIBELS = re.compile(r"dB(?:\s+re\s+(.+))?")


@dataclass(frozen=True)
class Columns:
    """Columns of a file that make a response, by name without unit: magnitude and phase.

    unit: of the response, where the header does not tell it, as with magnitudes in dB.
    """

    magnitude: str
    phase: str
    coherence: str | None = None
    unit: str = ""


@dataclass
class _Found:
    """Columns of one response: part -> index in the table."""

    parts: dict[str, int] = field(default_factory=dict)
    unit: str = ""


def write_response(path: str | Path, response: FrequencyResponse) -> None:
    """Write a frequency response, whole or not at all. OutputError: the file cannot be written."""
    path = Path(path)
    header = ["frequency [Hz]"]
    text = [shortest(response.frequency)]
    for name, values in response.columns.items():
        unit = response.unit(name)
        header.append(f"{name} magnitude [{unit}]" if unit else f"{name} magnitude")
        header.append(f"{name} phase [deg]")
        text += [shortest(np.abs(values)), shortest(response.phase(name))]
        if name in response.coherence:
            header.append(f"{name} coherence [1]")
            text.append(shortest(response.coherence[name]))
    lines = chain([",".join(quoted(cell) for cell in header)], map(",".join, zip(*text, strict=True)))
    with written_whole(path) as file:
        file.write("\n".join(lines).encode("utf-8"))
        file.write(b"\n")


def read_response_csv(
    path: str | Path, *, columns: Mapping[str, Columns] | None = None, frequency: str | None = None
) -> FrequencyResponse:
    """Read frequency responses.

    columns    response -> its columns; default: what the names of the columns tell
    frequency  name of the frequency column; default "frequency", "freq" or "f" in any case, else a first column whose
               unit is a frequency

    Frequencies are converted to Hz (a first row of 0 Hz is left out), phases to rad, dB to values; the unit of
    magnitudes stays as written. Raises InputError with file and line: no frequency, a response without phase, a name
    that is no column, a unit that is none of a frequency or angle, a value that is no finite number.
    """
    path = Path(path)
    table = read_table(path)
    where = f"{path}:{table.header_line}"
    at = _frequency_index(table, frequency)
    found = _by_name(table, at, path.stem) if columns is None else _by_choice(table, columns)
    used = sorted({at, *(index for each in found.values() for index in each.parts.values())})
    mark: Decimal = "."
    if table.decimal_comma:
        mark = decimal_mark([table.columns[i] for i in used], table.lines, table.where)
    values = {i: numbers(table.columns[i], mark, table.lines, table.where, table.names[i]) for i in used}
    hertz = values[at] * _factor(table, at, "Hz", "frequency")
    kept = hertz > 0 if hertz[0] == 0 else np.ones(hertz.size, dtype=np.bool_)
    if not kept.any():
        raise InputError(f"{path}: no row above 0 Hz")
    responses, found_units, coherence = {}, {}, {}
    for name, each in found.items():
        responses[name], found_units[name] = _values(table, each, values)
        if "coherence" in each.parts:
            coherence[name] = values[each.parts["coherence"]][kept]
        responses[name] = responses[name][kept]
    try:
        return FrequencyResponse(hertz[kept], responses, found_units, coherence)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def _frequency_index(table: Table, name: str | None) -> int:
    if name is not None:
        return table.index(name)
    for usual in FREQUENCY_NAMES:
        for i, known in enumerate(table.names):
            if known.lower() == usual:
                return i
    if _is(table.units[0], "Hz"):
        return 0
    raise InputError(
        f"{table.where}:{table.header_line}: no frequency column; name one 'frequency [Hz]'"
        f"{suggest('frequency', table.names)}"
    )


def _by_name(table: Table, at: int, file: str) -> dict[str, _Found]:
    """Responses that the columns' names tell; columns of other names are left alone."""
    where = f"{table.where}:{table.header_line}"
    found: dict[str, _Found] = {}
    for i, column in enumerate(table.names):
        match = _NAME.fullmatch(column)
        if i == at or not match:
            continue
        name, part = match[1] or file, _PART[match[2].lower()]
        parts = found.setdefault(name, _Found()).parts
        if part in parts:
            raise InputError(
                f"{where}: {table.names[parts[part]]!r} and {column!r} are both the {part} of {name!r}; "
                "choose the columns"
            )
        parts[part] = i
    found = {name: each for name, each in found.items() if set(each.parts) != {"coherence"}}
    if not found:
        raise InputError(
            f"{where}: no frequency response; its columns are called 'NAME magnitude' and 'NAME phase', or 'NAME re' "
            f"and 'NAME im'; there is {', '.join(table.names)}"
        )
    for name, each in found.items():
        for one, other in (("magnitude", "phase"), ("phase", "magnitude"), ("re", "im"), ("im", "re")):
            if one in each.parts and other not in each.parts:
                raise InputError(f"{where}: response {name!r} has a column of {one}, but none of {other}")
        if {"magnitude", "re"} <= set(each.parts):
            raise InputError(
                f"{where}: response {name!r} has magnitude and phase, and re and im too; choose the columns"
            )
    return found


def _by_choice(table: Table, columns: Mapping[str, Columns]) -> dict[str, _Found]:
    found = {}
    for name, chosen in columns.items():
        parts = {"magnitude": table.index(chosen.magnitude), "phase": table.index(chosen.phase)}
        if chosen.coherence is not None:
            parts["coherence"] = table.index(chosen.coherence)
        found[name] = _Found(parts, chosen.unit)
    return found


def _values(table: Table, found: _Found, values: Mapping[int, Floats]) -> tuple[Complexes, str]:
    """Complex values of a response, and its unit."""
    where = f"{table.where}:{table.header_line}"
    parts = found.parts
    if "re" in parts:
        given = [table.units[parts[part]] for part in ("re", "im")]
        if given[0] != given[1]:
            names = [table.names[parts[part]] for part in ("re", "im")]
            raise InputError(f"{where}: {names[0]!r} is in {given[0]!r}, {names[1]!r} in {given[1]!r}")
        return values[parts["re"]] + 1j * values[parts["im"]], _agreed(where, given[0], found.unit)
    magnitude, unit = values[parts["magnitude"]], table.units[parts["magnitude"]]
    if decibels := _DECIBELS.fullmatch(unit):
        magnitude, unit = 10 ** (magnitude / 20), decibels[1] or ""
    elif np.any(magnitude < 0):
        line = table.lines[int(np.argmax(magnitude < 0))]
        raise InputError(
            f"{table.where}:{line}: a magnitude of {magnitude.min():.6g}; if {table.names[parts['magnitude']]!r} is in "
            "decibels, its header must say [dB]"
        )
    angle = values[parts["phase"]] * _factor(table, parts["phase"], "rad", "phase", "deg")
    return np.asarray(magnitude * np.exp(1j * angle)), _agreed(where, unit, found.unit)


def _agreed(where: str, written: str, given: str) -> str:
    if written and given and written != given:
        raise InputError(f"{where}: the response is in {written!r} by its header, in {given!r} by what was asked for")
    return written or given


def _factor(table: Table, i: int, wanted: str, what: str, usual: str = "") -> float:
    """Factor of column i to the unit wanted; a column without unit is in the usual one."""
    try:
        return float(units.factor(table.units[i] or usual or wanted, wanted))
    except InputError as error:
        raise InputError(f"{table.where}:{table.header_line}: {what} {table.names[i]!r}: {error}") from None


def _is(unit: str, wanted: str) -> bool:
    try:
        units.factor(unit or "1", wanted)
    except InputError:
        return False
    return True


def columns_named(names: Sequence[str], unit: str = "") -> Columns:
    """Magnitude, phase and perhaps coherence from a list of names. InputError: neither two nor three."""
    if len(names) not in (2, 3) or not all(names):
        raise InputError(
            f"columns {', '.join(names)!r}: magnitude and phase are expected, and coherence if there is one"
        )
    return Columns(names[0], names[1], names[2] if len(names) == 3 else None, unit)
