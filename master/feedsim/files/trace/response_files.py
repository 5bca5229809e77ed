"""Files of frequency responses: what feedsim writes, and what commissioning tools and analysers export.

Written: `frequency [Hz]`, then per response `NAME magnitude [unit]`, `NAME phase [deg]` and, where it was measured,
`NAME coherence [1]`. Read besides: `NAME re`, `NAME im` in place of magnitude and phase; magnitudes in dB (`[dB]`, or
`[dB re UNIT]`); phases in rad; frequencies in rad/s or kHz; the separators, decimal commas and encodings that a trace
may have. A column without a name of its own ("Gain [dB]", "Phase [deg]") belongs to a response called like the file.
Universal files are read by feedsim.files.trace.response_files.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feedsim.files.trace.cells import Table, quote_cell, read_table, shortest_numbers
from feedsim.files.trace.files import written_whole
from feedsim.files.trace.response import Complexes, FrequencyResponse, quotient_unit, without_zero
from feedsim.files.trace.sinumerik_xml import SUFFIX, read_response_xml
from feedsim.files.trace.trace import Array
from feedsim.foundation import units
from feedsim.foundation.errors import Finding, InputError, no_such_file
from feedsim.foundation.installation import require_module

# --- Frequency responses from universal files, dataset 58 (the only room that knows pyuff) ----------------------------
# Functions are called as their header has it, response over reference: "12:+Z/7:+X" for node and direction.
# Coherences
# (function type 6) join the response of the same name.


Floats = NDArray[np.float64]

DATASET = 58
TIME_RESPONSE, RESPONSE, COHERENCE = 1, 4, 6  # function types
ACCELERATION = 12  # specific data type
FUNCTIONS = {
    0: "general function", 1: "time response", 2: "auto spectrum", 3: "cross spectrum", 5: "transmissibility",
    9: "power spectral density", 12: "spectrum",
}  # fmt: skip
FREQUENCY_TYPES, UNKNOWN_TYPE = (18, 0, 1), 0  # specific data types that an axis of frequencies may have
DIRECTION_CODES = {0: "", 1: "+X", 2: "+Y", 3: "+Z", 4: "+RX", 5: "+RY", 6: "+RZ"}
DIRECTION_CODES |= {-code: text.replace("+", "-") for code, text in DIRECTION_CODES.items() if code}
# Frequencies of functions that go together agree up to the digits of the file, 13.5E.
FREQUENCY_TOLERANCE = 1e-4
EMPTY_NAMES = ("", "NONE")
UNIT_SYSTEM = 164  # dataset of units: factors from SI to those of the file
# Specific data type of an axis -> its unit along a direction, and about one, in SI.
TYPE_UNITS = {
    8: ("m", "rad"), 11: ("m/s", "rad/s"), 12: ("m/s^2", "rad/s^2"), 9: ("N", "N.m"), 13: ("N", "N.m"),
}  # fmt: skip
TYPE_NAMES = {8: "displacement", 11: "velocity", 12: "acceleration", 9: "reaction force", 13: "excitation force"}
ROTATIONS = (4, 5, 6)  # codes of directions


def read_response_uff(path: str | Path) -> FrequencyResponse:
    """All frequency response functions of a universal file that share their frequencies.

    A first line at 0 Hz is left out. Units are those of the axis labels (numerator/denominator); where one is missing,
    that of the axis' type in SI, by the file's dataset 164 where it has one; else "".

    Raises:
        InputError: no universal file, no frequency response in it, a function that cannot be read, two of one name,
            functions over different frequencies.
    """
    path = Path(path)
    sets = _sets(path)
    functions: dict[str, Mapping[str, Any]] = {}
    coherences: dict[str, Mapping[str, Any]] = {}
    others: list[str] = []
    for entry in sets:
        kind = int(entry["func_type"])
        if kind not in (RESPONSE, COHERENCE):
            others.append(FUNCTIONS.get(kind, f"function type {kind}"))
            continue
        into = functions if kind == RESPONSE else coherences
        name = _name(entry)
        if name in into:
            raise InputError(f"{path}: two functions of type {kind} are called {name!r}")
        into[name] = entry
    if not functions:
        there = f"; there is {', '.join(dict.fromkeys(others))}" if others else ""
        raise InputError(f"{path}: no frequency response function (dataset 58, function type 4){there}")
    first = next(iter(functions))
    frequency = _frequencies(path, first, functions[first])
    kept = slice(1 if frequency[0] == 0 else 0, None)
    columns, unit_texts, coherence, notes = {}, {}, {}, list(without_zero(path, frequency))
    for name, entry in functions.items():
        _check_same(path, name, _frequencies(path, name, entry), frequency)
        over, under = (_Axis.of(entry, axis, end) for axis, end in (("ordinate", "rsp"), ("orddenom", "ref")))
        columns[name] = np.asarray(entry["data"], dtype=np.complex128)[kept] * (over.factor / under.factor)
        unit_texts[name] = quotient_unit(over.unit, under.unit)
        notes += [_of_function(path, name, note) for axis in (over, under) for note in axis.notes]
        if other := coherences.get(name):
            _check_same(path, f"coherence of {name}", _frequencies(path, name, other), frequency)
            coherence[name] = np.clip(np.real(other["data"])[kept], 0, 1)
    try:
        return FrequencyResponse(frequency[kept], columns, unit_texts, coherence, tuple(notes))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def read_signals_uff(path: Path) -> tuple[dict[str, Floats], dict[str, str], tuple[Finding, ...]]:
    """Time responses of a universal file: name -> (N,), with the time as "time"; name -> unit; notes.

    Functions are called by node and direction, "12:+Z". Units are those of frequency responses.

    Raises InputError: no universal file, no time response in it, several over different times, a value that is not
    finite.
    """
    responses = [entry for entry in _sets(path) if int(entry["func_type"]) == TIME_RESPONSE]
    if not responses:
        raise InputError(f"{path}: no time response (dataset 58, function type 1)")
    time = np.asarray(responses[0]["x"], dtype=np.float64)
    columns, unit_texts, notes = {"time": time}, {"time": "s"}, list[Finding]()
    for entry in responses:
        name, axis, x = _point(entry, "rsp"), _Axis.of(entry, "ordinate", "rsp"), np.asarray(entry["x"])
        if x.shape != time.shape or not np.allclose(x, time, rtol=FREQUENCY_TOLERANCE, atol=0):
            raise InputError(f"{path}: {name!r} is over another time than the first one; a file each is needed")
        if name in columns:
            raise InputError(f"{path}: two time responses are called {name!r}")
        columns[name] = np.real(np.asarray(entry["data"])).astype(np.float64) * axis.factor
        unit_texts[name] = axis.unit
        notes += [_of_function(path, name, note) for note in axis.notes]
    if not all(np.all(np.isfinite(values)) for values in columns.values()):
        raise InputError(f"{path}: a value is not finite")
    return columns, unit_texts, tuple(notes)


@dataclass(frozen=True)
class _Axis:
    """Unit of the ordinate or of its denominator, what its values are multiplied with, and notes."""

    unit: str
    factor: float = 1.0
    notes: tuple[Finding, ...] = ()

    @classmethod
    def of(cls, function: Mapping[str, Any], axis: str, end: str) -> _Axis:
        label, kind = _label(function, axis), int(function.get(f"{axis}_spec_data_type") or UNKNOWN_TYPE)
        if kind not in TYPE_UNITS:
            return cls(label)
        turns = abs(int(function[f"{end}_dir"])) in ROTATIONS
        unit = TYPE_UNITS[kind][turns]
        if label:
            return cls(label, notes=_contradiction(label, kind, unit))
        length, force = function["unit_factors"]
        scale = {"N": force, "N.m": force * length}.get(unit, 1.0 if turns else length)
        text = f"no label of its unit; {unit} by its type, {TYPE_NAMES[kind]}"
        return cls(unit, 1 / scale, (Finding("unit-assumed", "note", text),))


def _of_function(path: Path, name: str, note: Finding) -> Finding:
    """A note on an axis, said of its function in the file."""
    return replace(note, text=f"{path}: function {name!r}: {note}", place=str(path))


def _contradiction(label: str, kind: int, unit: str) -> tuple[Finding, ...]:
    """The note on a label whose unit is not of the axis' type; g is that of an acceleration."""
    try:
        same = units.unit(label).dimension == units.unit(unit).dimension
    except InputError:
        return ()
    if same or (kind == ACCELERATION and label in ("g", "G")):
        return ()
    text = f"its label says {label}, its type {TYPE_NAMES[kind]}; the label counts"
    return (Finding("unit-contradicted", "note", text),)


def _unit_factors(path: Path, sets: Sequence[Mapping[str, Any]]) -> tuple[float, float]:
    """Length and force of 1 m and 1 N in the file's units; 1 without a dataset 164."""
    factors = [(float(entry["length"]), float(entry["force"])) for entry in sets]
    if any(not (math.isfinite(value) and value > 0) for pair in factors for value in pair):
        raise InputError(f"{path}: dataset 164 has factors of units that are no numbers above 0")
    if len(set(factors)) > 1:
        raise InputError(f"{path}: {len(factors)} datasets 164 give different units; give a file with one")
    return factors[0] if factors else (1.0, 1.0)


def _sets(path: Path) -> list[Mapping[str, Any]]:
    """Functions of the file, with the "unit_factors" of the file; other datasets are left alone."""
    pyuff = require_module("pyuff", "a universal file")
    if not path.is_file():
        raise InputError(no_such_file(path))
    try:
        file = pyuff.UFF(str(path))
        kinds = [int(kind) for kind in file.get_set_types()]
    except Exception as error:  # the reader raises plain exceptions
        raise InputError(f"{path} is no universal file that can be read: {error}") from None
    if DATASET not in kinds:
        there = f"; there is {', '.join(str(kind) for kind in dict.fromkeys(kinds))}" if kinds else ""
        raise InputError(f"{path}: no dataset 58 (function at nodal degrees of freedom){there}")
    read: dict[int, list[Mapping[str, Any]]] = {DATASET: [], UNIT_SYSTEM: []}
    for i, kind in enumerate(kinds):
        if kind not in read:
            continue
        try:
            read[kind].append(file.read_sets(i))
        except Exception as error:
            raise InputError(f"{path}: dataset {i + 1} (of type {kind}) cannot be read: {error}") from None
    factors = _unit_factors(path, read[UNIT_SYSTEM])
    return [{**function, "unit_factors": factors} for function in read[DATASET]]


def _frequencies(path: Path, name: str, function: Mapping[str, Any]) -> Floats:
    kind = int(function["abscissa_spec_data_type"])
    if kind not in FREQUENCY_TYPES:
        raise InputError(
            f"{path}: function {name!r} is not over frequency (abscissa of data type {kind}; 18 is expected)"
        )
    x = np.asarray(function["x"], dtype=np.float64)
    data, count = np.asarray(function["data"]), int(function["num_pts"])
    if not len(x) == len(data) == count or not count:
        raise InputError(f"{path}: function {name!r} has {len(data)} values; its header gives {count}")
    if not (np.all(np.isfinite(x)) and np.all(np.isfinite(data))):
        raise InputError(f"{path}: function {name!r} holds a value that is not finite")
    return x * _hertz(path, name, str(function.get("abscissa_axis_units_lab") or "").strip())


def _hertz(path: Path, name: str, label: str) -> float:
    """Factor from the unit that the label of the abscissa names to Hz; without a label it is Hz."""
    if label.upper() in EMPTY_NAMES:
        return 1.0
    try:
        return units.parse(f"1 {label}", "rad/s", "1 Hz") / (2 * math.pi)
    except InputError:
        raise InputError(
            f"{path}: function {name!r} is over a frequency in {label!r}, which is no unit known here; Hz is expected"
        ) from None


def _check_same(path: Path, name: str, frequency: Floats, first: Floats) -> None:
    if frequency.shape != first.shape or not np.allclose(frequency, first, rtol=FREQUENCY_TOLERANCE, atol=0):
        raise InputError(
            f"{path}: function {name!r} has {frequency.size} lines from {frequency[0]:.6g} to {frequency[-1]:.6g} Hz, "
            f"the first one {first.size} from {first[0]:.6g} to {first[-1]:.6g} Hz; functions over different "
            "frequencies need files of their own"
        )


def _name(function: Mapping[str, Any]) -> str:
    return f"{_point(function, 'rsp')}/{_point(function, 'ref')}"


def _point(function: Mapping[str, Any], end: str) -> str:
    entity = str(function.get(f"{end}_ent_name") or "").strip()
    node, direction = int(function[f"{end}_node"]), int(function[f"{end}_dir"])
    named = node if entity.upper() in EMPTY_NAMES else f"{entity}.{node}"
    where = DIRECTION_CODES.get(direction, str(direction))
    return f"{named}:{where}" if where else str(named)


def _label(function: Mapping[str, Any], axis: str) -> str:
    label = str(function.get(f"{axis}_axis_units_lab") or "").strip()
    return "" if label.upper() in EMPTY_NAMES else label.replace("[", "(").replace("]", ")")


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
    text = [shortest_numbers(response.frequency)]
    for name, values in response.columns.items():
        unit = response.unit(name)
        header.append(f"{name} magnitude [{unit}]" if unit else f"{name} magnitude")
        header.append(f"{name} phase [deg]")
        text += [shortest_numbers(np.abs(values)), shortest_numbers(response.phase(name))]
        if name in response.coherence:
            header.append(f"{name} coherence [1]")
            text.append(shortest_numbers(response.coherence[name]))
    lines = chain([",".join(quote_cell(cell) for cell in header)], map(",".join, zip(*text, strict=True)))
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
