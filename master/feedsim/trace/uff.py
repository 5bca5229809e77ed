"""Frequency responses from universal files, dataset 58 (the only room that knows pyuff).

Functions are called as their header has it, response over reference: "12:+Z/7:+X" for node and direction. Coherences
(function type 6) join the response of the same name.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feedsim import units
from feedsim.errors import InputError, no_such_file
from feedsim.extras import need
from feedsim.trace.response import FrequencyResponse, quotient_unit

Floats = NDArray[np.float64]

DATASET = 58
RESPONSE, COHERENCE = 4, 6  # function types
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


def read_response_uff(path: str | Path) -> FrequencyResponse:
    """All frequency response functions of a universal file that share their frequencies.

    A first line at 0 Hz is left out. Units are those of the axis labels (numerator/denominator), "" where there are
    none.

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
    columns, units, coherence = {}, {}, {}
    for name, entry in functions.items():
        _check_same(path, name, _frequencies(path, name, entry), frequency)
        columns[name] = np.asarray(entry["data"], dtype=np.complex128)[kept]
        units[name] = quotient_unit(_label(entry, "ordinate"), _label(entry, "orddenom"))
        if other := coherences.get(name):
            _check_same(path, f"coherence of {name}", _frequencies(path, name, other), frequency)
            coherence[name] = np.clip(np.real(other["data"])[kept], 0, 1)
    try:
        return FrequencyResponse(frequency[kept], columns, units, coherence)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _sets(path: Path) -> list[Mapping[str, Any]]:
    """Functions of the file; other datasets are left alone."""
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
    result = []
    for i, kind in enumerate(kinds):
        if kind != DATASET:
            continue
        try:
            result.append(file.read_sets(i))
        except Exception as error:
            raise InputError(f"{path}: dataset {i + 1} (of type 58) cannot be read: {error}") from None
    return result


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
