"""Frequency responses from universal files, dataset 58 (the only room that knows pyuff).

Functions are called as their header has it, response over reference: "12:+Z/7:+X" for node and direction. Coherences
(function type 6) join the response of the same name.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feedsim import units
from feedsim.errors import InputError, no_such_file
from feedsim.extras import need
from feedsim.findings import Note
from feedsim.trace.response import FrequencyResponse, quotient_unit, without_zero

Floats = NDArray[np.float64]

DATASET = 58
RESPONSE, COHERENCE = 4, 6  # function types
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
NONE = ("", "NONE")
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
        notes += [Note(f"{path}: function {name!r}: {words}") for axis in (over, under) for words in axis.notes]
        if other := coherences.get(name):
            _check_same(path, f"coherence of {name}", _frequencies(path, name, other), frequency)
            coherence[name] = np.clip(np.real(other["data"])[kept], 0, 1)
    try:
        return FrequencyResponse(frequency[kept], columns, unit_texts, coherence, tuple(notes))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


@dataclass(frozen=True)
class _Axis:
    """Unit of the ordinate or of its denominator, what its values are multiplied with, and notes."""

    unit: str
    factor: float = 1.0
    notes: tuple[str, ...] = ()

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
        return cls(unit, 1 / scale, (f"no label of its unit; {unit} by its type, {TYPE_NAMES[kind]}",))


def _contradiction(label: str, kind: int, unit: str) -> tuple[str, ...]:
    """The note on a label whose unit is not of the axis' type; g is that of an acceleration."""
    try:
        same = units.unit(label).dimension == units.unit(unit).dimension
    except InputError:
        return ()
    if same or (kind == ACCELERATION and label in ("g", "G")):
        return ()
    return (f"its label says {label}, its type {TYPE_NAMES[kind]}; the label counts",)


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
    pyuff = need("pyuff", "a universal file")
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
    if label.upper() in NONE:
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
    named = node if entity.upper() in NONE else f"{entity}.{node}"
    where = DIRECTION_CODES.get(direction, str(direction))
    return f"{named}:{where}" if where else str(named)


def _label(function: Mapping[str, Any], axis: str) -> str:
    label = str(function.get(f"{axis}_axis_units_lab") or "").strip()
    return "" if label.upper() in NONE else label.replace("[", "(").replace("]", ")")
