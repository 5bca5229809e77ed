"""Files of frequency responses: what feedsim writes, and what commissioning tools and analysers export.

Written: `frequency [Hz]`, then per response `NAME magnitude [unit]`, `NAME phase [deg]` and, where it was measured,
`NAME coherence [1]`. Read besides: `NAME re`, `NAME im` in place of magnitude and phase; magnitudes in dB (`[dB]`, or
`[dB re UNIT]`); phases in rad; frequencies in rad/s or kHz; the separators, decimal commas and encodings that a trace
may have. A column without a name of its own ("Gain [dB]", "Phase [deg]") belongs to a response called like the file.
Universal files are read by feedsim.trace.uff.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path

import numpy as np

from feedsim import units
from feedsim.errors import InputError
from feedsim.trace.cells import Table, read_table
from feedsim.trace.csv import quoted, shortest
from feedsim.trace.files import written_whole
from feedsim.trace.response import Complexes, FrequencyResponse, without_zero
from feedsim.trace.sinumerik_xml import SUFFIX, read_response_xml
from feedsim.trace.trace import Array
from feedsim.trace.uff import read_response_uff

UNIVERSAL = (".uff", ".unv", ".uf", ".bunv")
FREQUENCY_NAMES = ("frequency", "freq", "f")
# What a column holds, by the end of its name.
COLUMN_PARTS = {
    "magnitude": ("magnitude", "mag", "amplitude", "gain", "abs", "modulus"),
    "phase": ("phase", "angle", "arg"),
    "re": ("re", "real"),
    "im": ("im", "imag", "imaginary"),
    "coherence": ("coherence", "coh"),
}
_PART = {word: part for part, words in COLUMN_PARTS.items() for word in words}
_COLUMN_NAME = re.compile(rf"(?:(.*?)[\s_.:]+)?({'|'.join(sorted(_PART, key=len, reverse=True))})", re.IGNORECASE)
_DECIBELS = re.compile(r"dB(?:\s*re\s+(.+)|\s*\(re\s+(.+)\))?")
_REFERENCE = re.compile(rf"({units.NUMBER})\s*(?=[^\W\d_]|\()(.+)")  # "1 um/N", "1e-6 m/N"


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


def read_overlay(text: str) -> FrequencyResponse:
    """Measured responses to lay over calculated ones, as `text` asks for them.

    "FILE" reads all responses of a file under their own names, "FILE:NAME" the only one (or that called NAME) as NAME,
    "FILE:NAME=SOURCE" the response SOURCE of the file, "FILE:NAME=MAGNITUDE,PHASE" two columns of a CSV file, or three
    with the coherence.

    Raises:
        InputError: what the readers refuse; a name that the file does not have, or none where it has several.
    """
    # the colon of a Windows drive is none of ours
    at = text.find(":", 2)
    path, wanted = (Path(text), "") if at < 0 else (Path(text[:at]), text[at + 1 :])
    if at >= 0 and not wanted:
        raise InputError(f"{text!r}: behind the colon the name of a response is expected, such as Z.n_a/Z.M_a")
    name, _, source = (part.strip() for part in wanted.partition("="))
    if "," in source:
        if path.suffix.lower() in (*UNIVERSAL, SUFFIX):
            kind = "an XML file" if path.suffix.lower() == SUFFIX else "a universal file"
            raise InputError(f"{text!r}: {kind} has no columns; name the response, as in 12:+Z/7:+X")
        return read_response_csv(path, columns={name: [part.strip() for part in source.split(",")]})
    response = read_response(path)
    if not name:
        return response
    if not source:
        if name in response:
            source = name
        elif len(response.names) == 1:
            source = response.names[0]
        else:
            raise InputError(
                f"{path} holds {len(response.names)} responses and none is called {name!r}; say which one it is: "
                f"{path.name}:{name}=SOURCE; there is {', '.join(response.names)}"
            )
    return FrequencyResponse(
        response.frequency,
        {name: response[source]},
        {name: response.unit(source)},
        {name: response.coherence[source]} if source in response.coherence else {},
        response.notes,
    )


def read_response(path: str | Path) -> FrequencyResponse:
    """Responses of a file: a universal file by its ending (.uff, .unv, .uf, .bunv), a SINUMERIK's (.xml), else CSV.

    InputError."""
    path = Path(path)
    if path.suffix.lower() == SUFFIX:
        return read_response_xml(path)
    return read_response_uff(path) if path.suffix.lower() in UNIVERSAL else read_response_csv(path)


def read_response_csv(path: str | Path, *, columns: Mapping[str, Sequence[str]] | None = None) -> FrequencyResponse:
    """Read frequency responses.

    columns    response -> its columns of magnitude, phase and perhaps coherence, by name without unit; default: what
               the names of the columns show

    The frequency is called "frequency", "freq" or "f" in any case, else it is a first column whose unit is a frequency.
    Frequencies are converted to Hz (a first row of 0 Hz is left out), phases to rad, dB to values; the unit of
    magnitudes stays as written. Raises InputError with file and line: no frequency, a response without phase, a name
    that is no column, a unit that is none of a frequency or angle, a value that is no finite number.
    """
    path = Path(path)
    table = read_table(path)
    at = table.axis(None, FREQUENCY_NAMES, "Hz")
    indexes = _by_name(table, at, path.stem) if columns is None else _by_choice(table, columns)
    values = table.values(sorted({at, *(index for parts in indexes.values() for index in parts.values())}))
    hertz = values[at] * table.factor(at, "Hz", "frequency", "Hz")
    kept = hertz > 0 if hertz[0] == 0 else np.ones(hertz.size, dtype=np.bool_)
    if not kept.any():
        raise InputError(f"{path}: no row above 0 Hz")
    responses, unit_texts, coherence = {}, {}, {}
    for name, parts in indexes.items():
        response, unit_texts[name] = _values(table, parts, values)
        responses[name] = response[kept]
        if "coherence" in parts:
            coherence[name] = values[parts["coherence"]][kept]
    try:
        return FrequencyResponse(hertz[kept], responses, unit_texts, coherence, without_zero(path, hertz))
    except InputError as error:
        raise InputError(f"{table.head}: {error}") from None


def _by_name(table: Table, at: int, file: str) -> dict[str, dict[str, int]]:
    """Responses that the columns' names show; columns of other names are left alone."""
    indexes: dict[str, dict[str, int]] = {}
    for i, column in enumerate(table.names):
        match = _COLUMN_NAME.fullmatch(column)
        if i == at or not match:
            continue
        name, part = match[1] or file, _PART[match[2].lower()]
        parts = indexes.setdefault(name, {})
        if part in parts:
            raise InputError(
                f"{table.head}: {table.names[parts[part]]!r} and {column!r} are both the {part} of {name!r}; "
                "choose the columns"
            )
        parts[part] = i
    indexes = {name: value for name, value in indexes.items() if value.keys() != {"coherence"}}
    if not indexes:
        raise InputError(
            f"{table.head}: no frequency response; its columns are called 'NAME magnitude' and 'NAME phase', or "
            f"'NAME re' and 'NAME im'; there is {', '.join(table.names)}"
        )
    for name, entry in indexes.items():
        for one, other in (("magnitude", "phase"), ("phase", "magnitude"), ("re", "im"), ("im", "re")):
            if one in entry and other not in entry:
                raise InputError(f"{table.head}: response {name!r} has a column of {one}, but none of {other}")
        if entry.keys() >= {"magnitude", "re"}:
            raise InputError(
                f"{table.head}: response {name!r} has magnitude and phase, and re and im too; choose the columns"
            )
    return indexes


def _by_choice(table: Table, columns: Mapping[str, Sequence[str]]) -> dict[str, dict[str, int]]:
    indexes = {}
    for name, chosen in columns.items():
        if len(chosen) not in (2, 3) or not all(chosen):
            raise InputError(
                f"columns {', '.join(chosen)!r}: magnitude and phase are expected, and coherence if there is one"
            )
        parts = zip(("magnitude", "phase", "coherence"), chosen, strict=False)
        indexes[name] = {part: table.index(column) for part, column in parts}
    return indexes


def _values(table: Table, parts: Mapping[str, int], values: Mapping[int, Array]) -> tuple[Complexes, str]:
    """Complex values of a response, and its unit."""
    if "re" in parts:
        given = [table.units[parts[part]] for part in ("re", "im")]
        if given[0] != given[1]:
            names = [table.names[parts[part]] for part in ("re", "im")]
            raise InputError(f"{table.head}: {names[0]!r} is in {given[0]!r}, {names[1]!r} in {given[1]!r}")
        return values[parts["re"]] + 1j * values[parts["im"]], given[0]
    magnitude, unit = values[parts["magnitude"]], table.units[parts["magnitude"]]
    if decibels := _DECIBELS.fullmatch(unit):
        unit, size = decibels[1] or decibels[2] or "", 1.0
        if reference := _REFERENCE.fullmatch(unit):
            size, unit = units.finite(reference[1]), reference[2]
        magnitude = size * 10 ** (magnitude / 20)
    elif np.any(magnitude < 0):
        line = table.lines[int(np.argmax(magnitude < 0))]
        raise InputError(
            f"{table.where}:{line}: a magnitude of {magnitude.min():.6g}; if {table.names[parts['magnitude']]!r} is in "
            "decibels, its header must say [dB]"
        )
    angle = values[parts["phase"]] * table.factor(parts["phase"], "rad", "phase", "deg")
    return np.asarray(magnitude * np.exp(1j * angle)), unit
