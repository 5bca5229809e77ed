"""Captures of a SINUMERIK control: the JSON files of SINUMERIK Edge ("Capture4Analysis").

A file holds a header with the list of signals, and a payload of messages: rows of all signals ("HFData"), and events
such as NC blocks ("HFBlockEvent"). A counter of cycles is the clock of both. Signals are called NAME|n,
n being the control's number of the axis. The header tells neither units nor directions nor pitches. Units are those
that the signals have on such controls, held against the data; pitch and direction follow from POWER = TORQUE times the
motor's speed.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from feedsim.errors import InputError
from feedsim.files import regular
from feedsim.trace.trace import LARGEST, Array, recorded

SUFFIX = ".json"
COUNTER = "CYCLE"
LONGEST_NAME, MOST_SHOWN = 200, 60  # characters: of a name; of a cell in a message
LENGTHS = {"DES_POS": "mm", "ENC_POS": "mm", "ENC1_POS": "mm", "ENC2_POS": "mm", "CONT_DEV": "mm",
           "VEL_FFW": "mm/s", "CMD_SPEED": "mm/s"}  # fmt: skip
OTHERS = {"TORQUE": "N.m", "TORQUE_FFW": "N.m", "CURRENT": "A", "POWER": "W", "LOAD": "%"}
# Pitches of ball screws that manufacturers list; one of them is meant where the estimate holds it.
USUAL_PITCHES = (1, 2, 2.5, 3, 4, 5, 6, 8, 10, 12, 12.5, 15, 16, 20, 25, 30, 32, 40, 50)  # mm
TURN = 360.0  # deg: what a rotary axis travels with a turn
FITS = 0.1  # relative residual up to which POWER is TORQUE times a speed
NEAR = 0.01  # relative; a pitch is told to that at best, as the channels are sampled at different instants


@dataclass(frozen=True)
class CaptureAxis:
    """What a capture tells of an axis.

    Attributes:
        number: the control's, behind the bar of its signals. name: in the header, such as "Y1".
        pitch: travel per motor turn in mm (deg of a rotary axis), positive; None where its motion does not tell.
        sign: of TORQUE and CURRENT in the direction of the position; 0 where its motion does not tell.
        rotary: its positions are degrees, as far as its motion tells.
    """

    number: str
    name: str
    pitch: float | None
    sign: int
    rotary: bool

    def called(self, axis: str) -> bool:
        """Whether a person means this one: "Y1", "Y" or "2"."""
        return axis.casefold() in {self.name.casefold(), re.sub(r"[0-9]+$", "", self.name).casefold(), self.number}


@dataclass(frozen=True)
class Mark:
    """An event: time [s] and what was done, such as the NC block."""

    time: float
    text: str


@dataclass(frozen=True, eq=False)
class Capture:
    """A capture: columns by name, "time" [s] from the first row among them, their units, axes by number, NC blocks."""

    columns: Mapping[str, Array]
    units: Mapping[str, str]
    axes: tuple[CaptureAxis, ...]
    marks: tuple[Mark, ...]


def read_capture(path: Path) -> Capture:
    """Read a capture.

    Raises:
        InputError: not such a file (what is missing), rows of another length than the list of signals, a counter that
            stands still or runs back, values that are no numbers.
    """
    try:
        content = json.loads(regular.content(path))
    except ValueError as error:
        raise InputError(f"{path} is no JSON file that can be read: {error}") from None
    except RecursionError:
        raise InputError(f"{path} is no capture of a control: its values are nested too deep") from None
    header = _part(path, content, "Header", dict)
    names = _names(path, header)
    cycle = header.get("CycleTimeMs")
    if not isinstance(cycle, (int, float)) or isinstance(cycle, bool) or not 0 < cycle <= 1000:
        raise InputError(f"{path}: Header.CycleTimeMs is {cycle!r}; a number of milliseconds up to 1000 is expected")
    messages = _part(path, content, "Payload", list)
    values = _rows(path, messages, names)
    counter = values[:, names.index(COUNTER)]
    if (wrong := np.flatnonzero(np.diff(counter) <= 0)).size:
        row = int(wrong[0]) + 1
        raise InputError(
            f"{path}, row {row + 1}: {COUNTER} is {counter[row]:.0f} behind {counter[row - 1]:.0f}; it must grow"
        )
    interval = 1e-3 * cycle
    columns = {"time": (counter - counter[0]) * interval}
    columns |= {name: np.ascontiguousarray(values[:, k]) for k, name in enumerate(names) if name != COUNTER}
    axes = tuple(_axis(number, name, columns) for number, name in _axes(header).items())
    rotary = {axis.number for axis in axes if axis.rotary}
    marks = tuple(_marks(messages, counter[0], interval))
    return Capture(columns, {"time": "s"} | {name: _unit(name, columns, rotary) for name in columns if name != "time"},
                   axes, marks)  # fmt: skip


def _part(path: Path, content: object, key: str, kind: type) -> Any:
    found = content.get(key) if isinstance(content, dict) else None
    if not isinstance(found, kind):
        raise InputError(
            f"{path} is no capture of a control: {key} is missing; expected is a SINUMERIK capture with Header "
            "(SignalListHFData, CycleTimeMs) and Payload (HFData)"
        )
    return found


def _signals(header: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    listed = header.get("SignalListHFData")
    return [each for each in listed if isinstance(each, dict)] if isinstance(listed, list) else []


def _names(path: Path, header: Mapping[str, Any]) -> list[str]:
    names = [str(signal.get("Address") or signal.get("Name")) for signal in _signals(header)]
    texts = [*names, *(str(signal.get("Axis", "")) for signal in _signals(header))]
    if long := [text for text in texts if len(text) > LONGEST_NAME]:
        raise InputError(
            f"{path}: Header.SignalListHFData has a name of {len(long[0])} characters, {_shown(long[0])}; allowed: up "
            f"to {LONGEST_NAME}"
        )
    if COUNTER not in names:
        raise InputError(f"{path}: Header.SignalListHFData has no {COUNTER}, the counter that is the clock")
    if doubled := [name for name in names if names.count(name) > 1]:
        raise InputError(f"{path}: Header.SignalListHFData has {doubled[0]!r} twice")
    return names


def _axes(header: Mapping[str, Any]) -> dict[str, str]:
    """Number -> name of the axes that signals are of."""
    found: dict[str, str] = {}
    for signal in _signals(header):
        _, bar, number = str(signal.get("Address") or signal.get("Name")).partition("|")
        if bar and number.isdecimal():
            found.setdefault(number, str(signal.get("Axis") or number))
    return dict(sorted(found.items(), key=lambda item: (len(item[0]), item[0])))


def _rows(path: Path, messages: Sequence[Any], names: Sequence[str]) -> Array:
    rows: list[Any] = []
    for k, message in enumerate(messages):
        part = message.get("HFData", []) if isinstance(message, dict) else None
        if not isinstance(part, list):
            raise InputError(f"{path}: Payload, message {k + 1}: no list of rows under HFData")
        rows += part
    for k, row in enumerate(rows):
        if not isinstance(row, list) or len(row) != len(names):
            there = f"{len(row)} values" if isinstance(row, list) else "no list"
            raise InputError(f"{path}, row {k + 1}: {there}; Header.SignalListHFData has {len(names)} signals")
    if len(rows) < 2:
        raise InputError(f"{path}: {len(rows)} rows of HFData; at least 2 are needed")
    try:
        values = np.array(rows, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        values = np.array([[_number(cell) for cell in row] for row in rows])
    if (wrong := np.argwhere(~np.isfinite(values))).size:
        row, column = (int(index) for index in wrong[0])
        raise InputError(f"{path}, row {row + 1}: {names[column]} is {_shown(rows[row][column])}, no finite number")
    values, too_large = recorded(values)
    if (found := np.argwhere(too_large)).size:
        row, column = (int(index) for index in found[0])
        raise InputError(
            f"{path}, row {row + 1}: {names[column]} is {_shown(rows[row][column])}; allowed: up to {LARGEST:g}"
        )
    return values


def _shown(cell: object) -> str:
    """A cell for a message, which a number of a hundred digits would fill."""
    text = repr(cell)
    return text if len(text) <= MOST_SHOWN else f"{text[:MOST_SHOWN]}..."


def _number(cell: object) -> float:
    try:
        return float(cell) if isinstance(cell, (int, float)) else np.nan
    except OverflowError:
        return np.inf


def _unit(name: str, columns: Mapping[str, Array], rotary: set[str]) -> str:
    """Unit of a signal; "" where none is known, or the data contradict what is usual."""
    signal, _, number = name.partition("|")
    unit = LENGTHS.get(signal)
    if unit is None:
        return OTHERS.get(signal, "")
    if unit == "mm/s" and not _per_second(columns, signal, number):
        return ""
    return unit.replace("mm", "deg") if number in rotary else unit


def _per_second(columns: Mapping[str, Array], signal: str, number: str) -> bool:
    """Whether a speed is the slope of the position; true where the axis stands."""
    position = columns.get(f"DES_POS|{number}", columns.get(f"ENC_POS|{number}"))
    if position is None:
        return True
    slope = np.gradient(position, columns["time"])
    speed = columns[f"{signal}|{number}"]
    moved = float(slope @ slope)
    return not moved or 0.5 < float(speed @ slope) / moved < 2.0


def _axis(number: str, name: str, columns: Mapping[str, Array]) -> CaptureAxis:
    pitch = _signed_pitch(number, columns)
    if pitch is None:
        return CaptureAxis(number, name, None, 0, False)
    rotary = abs(abs(pitch) - TURN) < NEAR * TURN
    usual = TURN if rotary else min(USUAL_PITCHES, key=lambda each: abs(np.log(each / abs(pitch))))
    fits = abs(usual - abs(pitch)) < NEAR * usual
    return CaptureAxis(number, name, float(usual) if fits else abs(pitch), 1 if pitch > 0 else -1, rotary)


def _signed_pitch(number: str, columns: Mapping[str, Array]) -> float | None:
    """Travel per motor turn, below 0 where the motor's own direction is against the position's, by least squares of
    POWER over TORQUE times speed; None where it does not fit or the axis stands.

    The channels are sampled at instants of their own: the speed is shifted by what fits best, up to three rows.
    """
    try:
        torque, power, position = (columns[f"{signal}|{number}"] for signal in ("TORQUE", "POWER", "ENC_POS"))
    except KeyError:
        return None
    time = columns["time"]
    step = float(np.median(np.diff(time)))
    scatter = float(power @ power)
    best, found = FITS, None
    for lag in np.arange(-3.0, 3.1, 0.25) * step:
        speed = (
            np.interp(time - lag + step / 2, time, position) - np.interp(time - lag - step / 2, time, position)
        ) / step
        product = torque * speed
        weight, fitted = float(product @ product), float(product @ power)
        if not weight or not scatter or not fitted:
            continue
        residual = float(np.sqrt(max(0.0, 1.0 - fitted * fitted / (weight * scatter))))
        if residual < best:
            best, found = residual, 2 * np.pi * weight / fitted
    return found if found is not None and 1e-9 < abs(found) < 1e9 else None  # beyond that it is no pitch in mm


def _marks(messages: Sequence[Any], first: float, interval: float) -> list[Mark]:
    marks = []
    for message in messages:
        event = message.get("HFBlockEvent") if isinstance(message, dict) else None
        if not isinstance(event, dict):
            continue
        at, block = event.get("HFProbeCounter"), event.get("GCode")
        if isinstance(at, (int, float)) and isinstance(block, str):
            marks.append(Mark(float((at - first) * interval), block.strip()))
    return marks
