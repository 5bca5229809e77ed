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
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from feedsim.files import source
from feedsim.files.source import check_depth
from feedsim.files.trace.cells import duplicate_names
from feedsim.files.trace.trace import MAX_MAGNITUDE, Array, recordable_values
from feedsim.foundation.errors import InputError

# --- What a capture shows of its axes by its own figures: pitch, direction, units, and why where it shows none --------
#     POWER = TORQUE times the motor's speed,    motor's speed = 2 pi v / pitch
#
# v is the slope of the position. Where that does not fit, the cause is looked for: rows that stand at a limit or stand
# out, signals of another axis, signals that are zero. Where the pitch is none that screws have, or TORQUE none that
# goes with CURRENT, a unit is another one.


# Pitches of ball screws that manufacturers list; one of them is meant where the estimate holds it.
USUAL_PITCHES = (1, 2, 2.5, 3, 4, 5, 6, 8, 10, 12, 12.5, 15, 16, 20, 25, 30, 32, 40, 50)  # mm
LEAST_PITCH = 0.9  # mm: below it the positions are in another unit, where the figure is a usual pitch in it
OTHER_LENGTHS = {"in": 25.4, "m": 1000.0}  # unit -> mm
DEGREES_PER_TURN = 360.0  # deg: what a rotary axis travels with a turn
FIT_RESIDUAL = 0.1  # relative residual up to which POWER is TORQUE times a speed
PITCH_TOLERANCE = 0.01  # relative; a pitch is known to that at best, as the channels are sampled at different instants
NEAR_WITHOUT = 0.03  # the same where rows had to be left out, of which some beside are touched, too
# N.m of TORQUE for an A of CURRENT that motors of feed axes with a screw have.
TORQUE_CONSTANTS = (0.05, 5.0)
SAME_SIGNAL_CORRELATION = 0.9  # of a correlation, above which TORQUE and CURRENT are the same thing in two units
# Share of the rows that are one value to the last digit, at an end of the range: it is cut off there
CUT_OFF_SHARE = 0.005
FIT_ROWS = 20_000  # rows that a fit rests on
MAX_AXES_SEARCHED = 32  # axes among which a signal of another one is looked for
OUTLIER_SHARE = 0.02  # share of the rows that may stand out


@dataclass(frozen=True)
class CaptureAxis:
    """What a capture shows of an axis.

    Attributes:
        number: the control's, behind the bar of its signals. name: in the header, such as "Y1".
        pitch: travel per motor turn in mm (deg of a rotary axis), positive; None where its motion does not show.
        sign: of TORQUE and CURRENT in the direction of the position; 0 where its motion does not show.
        rotary: its positions are degrees, as far as its motion shows.
        length: unit of its positions. torque: unit of its TORQUE, "" where CURRENT contradicts N.m.
        doubts: what is the matter with its signals. why: the reason where there is no pitch.
    """

    number: str
    name: str
    pitch: float | None
    sign: int
    rotary: bool
    length: str = "mm"
    torque: str = "N.m"
    doubts: tuple[str, ...] = ()
    why: str = ""

    def called(self, axis: str) -> bool:
        """Whether a person means this one: "Y1", "Y" or "2"."""
        return axis.casefold() in {self.name.casefold(), re.sub(r"[0-9]+$", "", self.name).casefold(), self.number}


@dataclass(frozen=True)
class _Fit:
    """Signed travel per turn; below 0 where the motor's own direction is against the position's."""

    pitch: float
    residual: float

    @property
    def fits(self) -> bool:
        return self.residual < FIT_RESIDUAL and 1e-9 < abs(self.pitch) < 1e9  # beyond that it is no pitch in mm


Rows = NDArray[np.bool_]


def axes_of(names: Mapping[str, str], columns: Mapping[str, Array]) -> tuple[CaptureAxis, ...]:
    """names: number -> name. columns: "time" [s] and the signals, called NAME|number."""
    used = {f"{signal}|{number}" for signal in ("TORQUE", "POWER", "ENC_POS", "CURRENT") for number in names}
    columns = {name: np.ascontiguousarray(y) for name, y in columns.items() if name == "time" or name in used}
    return tuple(_axis(number, names, columns) for number in names)


def _axis(number: str, names: Mapping[str, str], columns: Mapping[str, Array]) -> CaptureAxis:
    blank = CaptureAxis(number, names[number], None, 0, False)
    signals = [columns.get(f"{signal}|{number}") for signal in ("TORQUE", "POWER", "ENC_POS")]
    torque, power, position = signals
    if torque is None or power is None or position is None:
        lacking = [name for name, values in zip(("TORQUE", "POWER", "ENC_POS"), signals, strict=True) if values is None]
        return replace(blank, why=f"the file has no {' and no '.join(lacking)} of it")
    for name, values in (("ENC_POS", position), ("TORQUE", torque), ("POWER", power)):
        if not np.ptp(values):
            what = "it does not move" if name == "ENC_POS" else f"{name} is {values[0]:.6g} throughout"
            return replace(blank, why=what)
    fit, doubts = _fit_sound_rows(columns["time"], torque, power, position)
    if fit is None:
        return replace(
            blank,
            why=_find_swapped_signal(number, names, columns) or "POWER is not TORQUE times the motor's speed",
            doubts=doubts,
        )
    return _with_units(replace(blank, doubts=doubts), fit, columns)


def _fit_sound_rows(time: Array, torque: Array, power: Array, position: Array) -> tuple[_Fit | None, tuple[str, ...]]:
    """The fit over rows that are sound, None where there is none; and which rows are not."""
    whole = np.ones(len(time), dtype=bool)
    # Rows beside a spike of the position have a wrong speed.
    torn = {name: _spikes(values) for name, values in (("ENC_POS", position), ("TORQUE", torque), ("POWER", power))}
    cut = {name: _cut_off(values) for name, values in (("TORQUE", torque), ("POWER", power))}
    faults = []
    for name, rows in torn.items():
        if rows.any():
            first = time[np.argmax(rows)]
            faults.append((f"{name} has spikes in {np.sum(rows)} rows, the first at {first:.6g} s", _widen_rows(rows)))
    if not torn["ENC_POS"].any() and (jumps := _jumps(position)).any():
        first = time[np.argmax(jumps)]
        faults.append((f"ENC_POS jumps in {np.sum(jumps)} rows, the first at {first:.6g} s", _widen_rows(jumps)))
    for name, (rows, text) in cut.items():
        if rows.any():
            faults.append((f"{name} is cut off at {text}", rows))
    sound = whole.copy()
    for _, rows in faults:
        sound &= ~rows
    best = _fit(time, torque, power, position, whole)
    if faults and sound.sum() > 0.3 * len(time):
        best = min(best, _fit(time, torque, power, position, sound), key=lambda fit: fit.residual)
    if best.fits:
        # A limit of the drive that power agrees with is none of the record.
        kept = [text for text, rows in faults if not _is_consistent(time, torque, power, position, rows, best)]
        return best, tuple(kept)
    return None, tuple(text for text, _ in faults)


def _is_consistent(time: Array, torque: Array, power: Array, position: Array, rows: Rows, best: _Fit) -> bool:
    """Whether POWER, TORQUE and speed fit in these rows as well as elsewhere."""
    product = 2 * np.pi / best.pitch * torque * np.gradient(position, time)
    off, size = np.abs(power - product)[rows], float(np.sqrt(np.mean(power**2)))
    return bool(np.sqrt(np.mean(off**2)) < 2 * FIT_RESIDUAL * size)


def _spikes(values: Array) -> Rows:
    """One or two rows that stand far off both their neighbours, and far off what the signal does elsewhere."""
    padded = np.pad(values, 3, mode="edge")
    off = np.abs(values - np.median(np.lib.stride_tricks.sliding_window_view(padded, 7), axis=1))
    usual = float(np.quantile(off, 1 - OUTLIER_SHARE))
    span = float(np.quantile(values, 0.99) - np.quantile(values, 0.01))
    result: Rows = off > max(10 * usual, 0.5 * span)
    return result if result.mean() < OUTLIER_SHARE else np.zeros(len(values), dtype=bool)


def _jumps(position: Array) -> Rows:
    """Rows before which a position goes on by far more than it does elsewhere."""
    steps = np.abs(np.diff(position, prepend=position[0]))
    usual = float(np.quantile(steps, 1 - OUTLIER_SHARE))
    values: Rows = steps > (20 * usual if usual else np.inf)
    return values


def _widen_rows(rows: Rows) -> Rows:
    return np.convolve(rows.astype(float), np.ones(9), "same") > 0.5


def _cut_off(values: Array) -> tuple[Rows, str]:
    """Rows that are the largest or the smallest value of all to the last digit, if they are many; and that value."""
    rows, reported = np.zeros(len(values), dtype=bool), []
    for end in (float(values.max()), float(values.min())):
        same = values == end
        if end and same.mean() > CUT_OFF_SHARE and same.sum() > 5:
            rows |= same
            reported.append(f"{end:.6g} in {100 * same.mean():.2g} % of the rows")
    return rows, " and ".join(reported)


def _fit(time: Array, torque: Array, power: Array, position: Array, rows: Rows) -> _Fit:
    """By least squares of POWER over TORQUE times speed.

    The channels are sampled at instants of their own: the speed is shifted by what fits best, up to three rows.
    """
    step = float(np.median(np.diff(time)))
    picked = np.flatnonzero(rows)
    picked = picked[:: max(1, len(picked) // FIT_ROWS)]
    at, power, torque = time[picked], power[picked], torque[picked]
    scatter = float(power @ power)
    best = _Fit(np.inf, np.inf)
    for lag in np.arange(-3.0, 3.1, 0.25) * step:
        speed = (np.interp(at - lag + step / 2, time, position) - np.interp(at - lag - step / 2, time, position)) / step
        product = torque * speed
        weight, fitted = float(product @ product), float(product @ power)
        if not weight or not scatter or not fitted:
            continue
        residual = float(np.sqrt(max(0.0, 1.0 - fitted * fitted / (weight * scatter))))
        if residual < best.residual:
            best = _Fit(2 * np.pi * weight / fitted, residual)
    return best


def _find_swapped_signal(number: str, names: Mapping[str, str], columns: Mapping[str, Array]) -> str:
    """The signal that fits if it is taken of another axis, in words; "" where there is none."""
    own = {signal: columns[f"{signal}|{number}"] for signal in ("TORQUE", "POWER", "ENC_POS")}
    if len(names) > MAX_AXES_SEARCHED:
        return ""
    whole = np.ones(len(columns["time"]), dtype=bool)
    best: tuple[float, str] = (FIT_RESIDUAL, "")
    for other, name in names.items():
        for signal in own:
            values = columns.get(f"{signal}|{other}")
            if other == number or values is None or not np.ptp(values):
                continue
            given = own | {signal: values}
            fit = _fit(columns["time"], given["TORQUE"], given["POWER"], given["ENC_POS"], whole)
            if fit.fits and fit.residual < best[0]:
                text = (
                    f"with {signal}|{other} of {name} POWER is TORQUE times the motor's speed, with {signal}|{number} "
                    "it is not: the signals of the two axes are likely swapped"
                )
                best = fit.residual, text
    return best[1]


def _with_units(axis: CaptureAxis, fit: _Fit, columns: Mapping[str, Array]) -> CaptureAxis:
    """With pitch and units. A figure that no screw has is another unit of length, or, if CURRENT says so, of torque."""
    size = abs(fit.pitch)
    rotary = abs(size - DEGREES_PER_TURN) < PITCH_TOLERANCE * DEGREES_PER_TURN
    capture_axis = replace(axis, sign=1 if fit.pitch > 0 else -1, rotary=rotary)
    if not rotary and (constant := _torque_constant(axis.number, columns)) is not None:
        low, high = TORQUE_CONSTANTS
        if not low <= constant <= high:
            why = (
                f"TORQUE is {constant:.3g} for an A of CURRENT; motors of feed axes have {low:g} to {high:g} N.m/A. "
                "It is likely in per cent of a torque, and the pitch that follows from it "
                f"({size:.4g} mm) is wrong; give the factor in a mapping, torque: {{column: TORQUE|{axis.number}, "
                "factor: 0.2 N.m}"
            )
            return replace(capture_axis, pitch=None, torque="", why=why)
    if size < LEAST_PITCH:
        for unit, factor in OTHER_LENGTHS.items():
            if (usual := _usual_pitch(size * factor)) is not None:
                doubt = (
                    f"in mm its pitch would be {size:.4g} mm, which no screw has; positions are taken as {unit}, which "
                    f"makes it {usual:g} mm"
                )
                return replace(capture_axis, pitch=usual, length=unit, doubts=(*axis.doubts, doubt))
    pitch = DEGREES_PER_TURN if rotary else _usual_pitch(size, NEAR_WITHOUT if axis.doubts else PITCH_TOLERANCE)
    return replace(capture_axis, pitch=float(pitch) if pitch is not None else size)


def _usual_pitch(size: float, near: float = PITCH_TOLERANCE) -> float | None:
    """The usual pitch that an estimate [mm] holds, `near` at the most (relative); None where it holds none."""
    usual = min(USUAL_PITCHES, key=lambda value: abs(np.log(value / size)))
    return float(usual) if abs(usual - size) < near * usual else None


def _torque_constant(number: str, columns: Mapping[str, Array]) -> float | None:
    """TORQUE for an A of CURRENT; None without a current, or where the two are not alike."""
    torque, current = columns[f"TORQUE|{number}"], columns.get(f"CURRENT|{number}")
    if current is None or not np.ptp(current):
        return None
    alike = float(np.corrcoef(torque, current)[0, 1])
    return abs(float(torque @ current) / float(current @ current)) if abs(alike) > SAME_SIGNAL_CORRELATION else None


# --- Captures of a SINUMERIK control: the JSON files of SINUMERIK Edge ("Capture4Analysis") ---------------------------


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

    def _take_character(self, allowed: str) -> str:
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
        self._take_character("{")
        if self.peek() == "}":
            self._at += 1
            return
        while True:
            if self.peek() != '"':
                raise self.wrong("a name")
            name = self.value()
            self._take_character(":")
            yield name
            if self._take_character(",}") == "}":
                return

    def items(self) -> Iterator[int]:
        """Numbers from 0 of the items of an array; behind each one it must be taken."""
        self._take_character("[")
        if self.peek() == "]":
            self._at += 1
            return
        number = 0
        while True:
            yield number
            number += 1
            if self._take_character(",]") == "]":
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
OTHER_SIGNALS = {"TORQUE": "N.m", "TORQUE_FFW": "N.m", "CURRENT": "A", "POWER": "W", "LOAD": "%"}
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
        column, wrong = recordable_values(values[:, k])
        if wrong.any():
            row = int(np.argmax(wrong))
            cell = values[row, k]
            allowed = f"; allowed: up to {MAX_MAGNITUDE:g}" if np.isfinite(cell) else ", no finite number"
            raise InputError(f"{path}, row {row + 1}: {name} is {_cell_text(float(cell))}{allowed}")
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
    with source.open_file(path) as file:
        wide = file.read(2) in (b"\xff\xfe", b"\xfe\xff")
    for encoding in ("utf-16",) if wide else ("utf-8-sig", WINDOWS):
        try:
            with source.open_file(path) as file, io.TextIOWrapper(file, encoding, newline="") as text:
                return _read_content(JsonStream(text, path), path)
        except UnicodeDecodeError as error:
            problem = error
    raise InputError(f"{path} is no JSON file that can be read: {problem}")


def _read_content(stream: JsonStream, path: Path) -> _Content:
    content = _Content(path)
    if stream.peek() != "{":
        stream.value()
        raise _missing_key_error(path, "Header")
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
        raise _missing_key_error(path, "Header")
    if not content.payload:
        raise _missing_key_error(path, "Payload")
    if content.rows < 2:
        raise InputError(f"{path}: {content.rows} rows of HFData; at least 2 are needed")
    if content.width != len(content.names):
        raise _of_length(content, 0, f"{content.width} values")
    return content


def _message(stream: JsonStream, content: _Content, number: int) -> None:
    no_list = f"{content.path}: Payload, message {number + 1}: no list of rows under HFData"
    if stream.peek() != "{":
        raise InputError(no_list)
    for key in stream.members():
        if key == "HFData":
            if stream.peek() != "[":
                raise InputError(no_list)
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
                raise InputError(f"{content.path}, row {content.rows}: {name} is {_cell_text(cell)}{fault}") from None


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


def _missing_key_error(path: Path, key: str) -> InputError:
    return InputError(
        f"{path} is no capture of a control: {key} is missing; expected is a SINUMERIK capture with Header "
        "(SignalListHFData, CycleTimeMs) and Payload (HFData)"
    )


def _cycle(path: Path, header: Mapping[str, Any]) -> float:
    cycle = header.get("CycleTimeMs")
    if not isinstance(cycle, (int, float)) or isinstance(cycle, bool) or not LEAST_CYCLE <= cycle <= 1000:
        allowed = f"a number of milliseconds, {LEAST_CYCLE:g} to 1000, is expected"
        raise InputError(f"{path}: Header.CycleTimeMs is {_cell_text(cycle)}; {allowed}")
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
            f"{path}: Header.SignalListHFData has a name of {len(long[0])} characters, {_cell_text(long[0])}; "
            f"allowed: up "
            f"to {MAX_NAME_LENGTH}"
        )
    if COUNTER not in names:
        raise InputError(f"{path}: Header.SignalListHFData has no {COUNTER}, the counter that is the clock")
    if doubled := duplicate_names(names):
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


def _cell_text(cell: object) -> str:
    """A cell for a message, which a number of a hundred digits would fill."""
    text = repr(cell)
    return text if len(text) <= MOST_SHOWN else f"{text[:MOST_SHOWN]}..."


def _unit(name: str, columns: Mapping[str, Array], axes: Mapping[str, CaptureAxis]) -> str:
    """Unit of a signal; "" where none is known, or the data contradict what is usual."""
    signal, _, number = name.partition("|")
    unit, axis = LENGTHS.get(signal), axes.get(number)
    if unit is None:
        unit = OTHER_SIGNALS.get(signal, "")
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
