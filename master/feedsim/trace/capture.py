"""Captures of a SINUMERIK control: the JSON files of SINUMERIK Edge ("Capture4Analysis").

A file holds a header with the list of signals, and a payload of messages: rows of all signals ("HFData"), and events
such as NC blocks ("HFBlockEvent"). A counter of cycles is the clock of both. Signals are called NAME|n,
n being the control's number of the axis. The header gives neither units nor directions nor pitches. Units are those
that the signals have on such controls, held against the data; pitch and direction: capture_axes.py. Rows are read one
by one (json_stream.py), so that a file takes the memory of its numbers, and no more than MOST_NUMBERS of them.
"""

from __future__ import annotations

import io
import json
import re
from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from feedsim.errors import InputError
from feedsim.files import regular
from feedsim.files.regular import check_depth
from feedsim.trace.capture_axes import CaptureAxis, axes_of
from feedsim.trace.layout import twice
from feedsim.trace.trace import MAX_MAGNITUDE, Array, recorded

# --- JSON read piece by piece, for files that would fill the memory as Python's objects -------------------------------


CHUNK = 1 << 20  # characters
MAX_VALUE_LENGTH = 1 << 26  # characters of a value that is taken whole
_BLANK = re.compile(r"[ \t\n\r]*")


class JsonStream:
    """A JSON text from a file. Whatever is wrong with it is an InputError that names the file."""

    def __init__(self, text: TextIO, path: Path) -> None:
        self._text, self._path = text, path
        self._decode = json.JSONDecoder().raw_decode
        self._buffer, self._at, self._before = "", 0, 0
        self._chunk = CHUNK

    def _fill(self) -> bool:
        more = self._text.read(self._chunk)
        self._before += self._at
        self._buffer, self._at = self._buffer[self._at :] + more, 0
        return bool(more)

    def peek(self) -> str:
        """The next character that is no blank; "" at the end."""
        while True:
            result = _BLANK.match(self._buffer, self._at)
            assert result is not None
            self._at = result.end()
            if self._at < len(self._buffer):
                return self._buffer[self._at]
            if not self._fill():
                return ""

    def wrong(self, expected: str) -> InputError:
        """That something else is expected where the reader is."""
        where = f"at character {self._before + self._at}"
        return InputError(f"{self._path} is no JSON file that can be read: {expected} is expected {where}")

    def _take(self, allowed: str) -> str:
        text = self.peek()
        if not text or text not in allowed:
            raise self.wrong(" or ".join(allowed))
        self._at += 1
        return text

    def value(self) -> Any:
        """The next value, whole."""
        self.peek()
        while True:
            try:
                value, end = self._decode(self._buffer, self._at)
            except json.JSONDecodeError:
                if len(self._buffer) - self._at > MAX_VALUE_LENGTH:
                    raise InputError(
                        f"{self._path} is no JSON file that can be read: the value at character "
                        f"{self._before + self._at} does not end within {MAX_VALUE_LENGTH:,} characters"
                    ) from None
                if self._fill():
                    self._chunk *= 2  # a long value, which is scanned again
                    continue
                raise self.wrong("a value") from None
            except RecursionError:
                raise InputError(f"{self._path}: its values are nested too deep") from None
            except ValueError as error:  # a whole number of thousands of digits
                raise InputError(f"{self._path} is no JSON file that can be read: {error}") from None
            if end == len(self._buffer) and self._fill():
                continue  # a number may go on
            check_depth(value, self._buffer[self._at : end], str(self._path))
            self._at, self._chunk = end, CHUNK
            return value

    def members(self) -> Iterator[str]:
        """Names of an object; behind each one its value must be taken."""
        self._take("{")
        if self.peek() == "}":
            self._at += 1
            return
        while True:
            if self.peek() != '"':
                raise self.wrong("a name")
            name = self.value()
            self._take(":")
            yield name
            if self._take(",}") == "}":
                return

    def items(self) -> Iterator[int]:
        """Numbers from 0 of the items of an array; behind each one it must be taken."""
        self._take("[")
        if self.peek() == "]":
            self._at += 1
            return
        number = 0
        while True:
            yield number
            number += 1
            if self._take(",]") == "]":
                return

    def end(self) -> None:
        """InputError: something follows."""
        if self.peek():
            raise self.wrong("the end")


SUFFIX = ".json"
COUNTER = "CYCLE"
LEAST_CYCLE = 1e-3  # ms
MAX_SIGNALS = 1000
MAX_NAME_LENGTH, MOST_SHOWN = 200, 60  # characters: of a name; of a cell in a message
# 1.1 GB as numbers, in memory twice while they are sorted into columns; a file of some 1.3 GB.
MOST_NUMBERS, MOST_BLOCKS = 1 << 27, 1_000_000
LENGTHS = {"DES_POS": "mm", "ENC_POS": "mm", "ENC1_POS": "mm", "ENC2_POS": "mm", "CONT_DEV": "mm",
           "VEL_FFW": "mm/s", "CMD_SPEED": "mm/s"}  # fmt: skip
OTHERS = {"TORQUE": "N.m", "TORQUE_FFW": "N.m", "CURRENT": "A", "POWER": "W", "LOAD": "%"}
# Of programs that know no UTF-8; characters outside ASCII are in names alone.
WINDOWS = "cp1252"


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


@dataclass
class _Content:
    """What has been read of a file."""

    path: Path
    header: Mapping[str, Any] | None = None
    names: Sequence[str] = ()
    cycle: float = 0.0
    payload: bool = False
    width: int | None = None
    rows: int = 0
    cells: array[float] = field(default_factory=lambda: array("d"))
    blocks: list[tuple[float, str]] = field(default_factory=list)  # counter and text of NC blocks


def read_capture(path: Path) -> Capture:
    """Read a capture.

    Raises:
        InputError: not such a file (what is missing), rows of another length than the list of signals, a counter that
            stands still or runs back, values that are no numbers.
    """
    content = _content(path)
    names = content.names
    values = np.frombuffer(content.cells, dtype=np.float64).reshape(-1, len(names))
    for k, name in enumerate(names):
        column, wrong = recorded(values[:, k])
        if wrong.any():
            row = int(np.argmax(wrong))
            cell = values[row, k]
            allowed = f"; allowed: up to {MAX_MAGNITUDE:g}" if np.isfinite(cell) else ", no finite number"
            raise InputError(f"{path}, row {row + 1}: {name} is {_shown(float(cell))}{allowed}")
        values[:, k] = column
    counter = values[:, names.index(COUNTER)]
    if (backwards := np.flatnonzero(np.diff(counter) <= 0)).size:
        row = int(backwards[0]) + 1
        raise InputError(
            f"{path}, row {row + 1}: {COUNTER} is {counter[row]:.0f} behind {counter[row - 1]:.0f}; it must grow"
        )
    interval = 1e-3 * content.cycle
    columns = {"time": (counter - counter[0]) * interval}
    columns |= {name: values[:, k] for k, name in enumerate(names) if name != COUNTER}
    axes = axes_of(_axes(content.header or {}), columns)
    by_number = {axis.number: axis for axis in axes}
    marks = tuple(Mark((at - float(counter[0])) * interval, text) for at, text in content.blocks)
    units = {name: _unit(name, columns, by_number) for name in columns if name != "time"}
    return Capture(columns, {"time": "s"} | units, axes, marks)


def _content(path: Path) -> _Content:
    """All that is read of a file, in UTF-8, or, where it is none, in UTF-16 or Windows-1252."""
    with regular.opened(path) as file:
        wide = file.read(2) in (b"\xff\xfe", b"\xfe\xff")
    for encoding in ("utf-16",) if wide else ("utf-8-sig", WINDOWS):
        try:
            with regular.opened(path) as file, io.TextIOWrapper(file, encoding, newline="") as text:
                return _walked(JsonStream(text, path), path)
        except UnicodeDecodeError as error:
            problem = error
    raise InputError(f"{path} is no JSON file that can be read: {problem}")


def _walked(stream: JsonStream, path: Path) -> _Content:
    content = _Content(path)
    if stream.peek() != "{":
        stream.value()
        raise _missing(path, "Header")
    for key in stream.members():
        if key == "Header":
            header = stream.value()
            if isinstance(header, dict):
                content.header, content.names = header, _names(path, header)
                content.cycle = _cycle(path, header)
        elif key == "Payload" and stream.peek() == "[":
            content.payload = True
            for k in stream.items():
                _message(stream, content, k)
        else:
            stream.value()
    stream.end()
    if content.header is None:
        raise _missing(path, "Header")
    if not content.payload:
        raise _missing(path, "Payload")
    if content.rows < 2:
        raise InputError(f"{path}: {content.rows} rows of HFData; at least 2 are needed")
    if content.width != len(content.names):
        raise _of_length(content, 0, f"{content.width} values")
    return content


def _message(stream: JsonStream, content: _Content, number: int) -> None:
    no_list = InputError(f"{content.path}: Payload, message {number + 1}: no list of rows under HFData")
    if stream.peek() != "{":
        raise no_list
    for key in stream.members():
        if key == "HFData":
            if stream.peek() != "[":
                raise no_list
            for _ in stream.items():
                _row(content, stream.value())
        else:
            value = stream.value()
            if key == "HFBlockEvent" and isinstance(value, dict):
                _event(content, value)


def _row(content: _Content, row: object) -> None:
    wanted = len(content.names) or content.width  # a header may stand behind its rows
    if not isinstance(row, list) or (wanted is not None and len(row) != wanted):
        raise _of_length(content, content.rows, f"{len(row)} values" if isinstance(row, list) else "no list")
    content.width = len(row)
    content.rows += 1
    if len(content.cells) + len(row) > MOST_NUMBERS:
        raise InputError(
            f"{content.path}, row {content.rows}: more than {MOST_NUMBERS:,} numbers, rows of {content.width} signals; "
            f"allowed: up to that ({8e-9 * MOST_NUMBERS:.1f} GB in memory). Record fewer signals or less time"
        )
    try:
        content.cells.extend(row)
    except (TypeError, OverflowError):
        for k, cell in enumerate(row):
            if not isinstance(cell, (int, float)) or abs(cell) > MAX_MAGNITUDE:
                name = content.names[k] if content.names else f"value {k + 1}"
                fault = ", no finite number"
                if isinstance(cell, int) and not isinstance(cell, bool):
                    fault = f"; allowed: up to {MAX_MAGNITUDE:g}"
                raise InputError(f"{content.path}, row {content.rows}: {name} is {_shown(cell)}{fault}") from None


def _event(content: _Content, event: Mapping[str, Any]) -> None:
    at, block = event.get("HFProbeCounter"), event.get("GCode")
    if isinstance(at, (int, float)) and abs(at) <= MAX_MAGNITUDE and isinstance(block, str):
        if len(content.blocks) == MOST_BLOCKS:
            raise InputError(f"{content.path}: more than {MOST_BLOCKS:,} NC blocks; allowed: up to that")
        content.blocks.append((float(at), block.strip()))


def _of_length(content: _Content, row: int, there: str) -> InputError:
    wanted = (
        f"Header.SignalListHFData has {len(content.names)} signals" if content.names else f"others have {content.width}"
    )
    return InputError(f"{content.path}, row {row + 1}: {there}; {wanted}")


def _missing(path: Path, key: str) -> InputError:
    return InputError(
        f"{path} is no capture of a control: {key} is missing; expected is a SINUMERIK capture with Header "
        "(SignalListHFData, CycleTimeMs) and Payload (HFData)"
    )


def _cycle(path: Path, header: Mapping[str, Any]) -> float:
    cycle = header.get("CycleTimeMs")
    if not isinstance(cycle, (int, float)) or isinstance(cycle, bool) or not LEAST_CYCLE <= cycle <= 1000:
        allowed = f"a number of milliseconds, {LEAST_CYCLE:g} to 1000, is expected"
        raise InputError(f"{path}: Header.CycleTimeMs is {_shown(cycle)}; {allowed}")
    return float(cycle)


def _signals(header: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    listed = header.get("SignalListHFData")
    return [entry for entry in listed if isinstance(entry, dict)] if isinstance(listed, list) else []


def _names(path: Path, header: Mapping[str, Any]) -> list[str]:
    names = [str(signal.get("Address") or signal.get("Name")) for signal in _signals(header)]
    if len(names) > MAX_SIGNALS:
        raise InputError(f"{path}: Header.SignalListHFData has {len(names)} signals; allowed: up to {MAX_SIGNALS}")
    texts = [*names, *(str(signal.get("Axis", "")) for signal in _signals(header))]
    if long := [text for text in texts if len(text) > MAX_NAME_LENGTH]:
        raise InputError(
            f"{path}: Header.SignalListHFData has a name of {len(long[0])} characters, {_shown(long[0])}; allowed: up "
            f"to {MAX_NAME_LENGTH}"
        )
    if COUNTER not in names:
        raise InputError(f"{path}: Header.SignalListHFData has no {COUNTER}, the counter that is the clock")
    if doubled := twice(names):
        raise InputError(f"{path}: Header.SignalListHFData has {doubled[0]!r} twice")
    return names


def _axes(header: Mapping[str, Any]) -> dict[str, str]:
    """Number -> name of the axes that signals are of."""
    result: dict[str, str] = {}
    for signal in _signals(header):
        _, bar, number = str(signal.get("Address") or signal.get("Name")).partition("|")
        if bar and number.isdecimal():
            result.setdefault(number, str(signal.get("Axis") or number))
    return dict(sorted(result.items(), key=lambda item: (len(item[0]), item[0])))


def _shown(cell: object) -> str:
    """A cell for a message, which a number of a hundred digits would fill."""
    text = repr(cell)
    return text if len(text) <= MOST_SHOWN else f"{text[:MOST_SHOWN]}..."


def _unit(name: str, columns: Mapping[str, Array], axes: Mapping[str, CaptureAxis]) -> str:
    """Unit of a signal; "" where none is known, or the data contradict what is usual."""
    signal, _, number = name.partition("|")
    unit, axis = LENGTHS.get(signal), axes.get(number)
    if unit is None:
        unit = OTHERS.get(signal, "")
        return axis.torque if unit == "N.m" and axis is not None else unit
    if unit == "mm/s" and not _per_second(columns, signal, number):
        return ""
    return unit.replace("mm", "deg" if axis is not None and axis.rotary else axis.length if axis is not None else "mm")


def _per_second(columns: Mapping[str, Array], signal: str, number: str) -> bool:
    """Whether a speed is the slope of the position; true where the axis stands."""
    position = columns.get(f"DES_POS|{number}", columns.get(f"ENC_POS|{number}"))
    if position is None:
        return True
    slope = np.gradient(position, columns["time"])
    speed = columns[f"{signal}|{number}"]
    moved = float(slope @ slope)
    return not moved or 0.5 < float(speed @ slope) / moved < 2.0
