"""What a capture shows of its axes by its own figures: pitch, direction, units, and why where it shows none.

    POWER = TORQUE times the motor's speed,    motor's speed = 2 pi v / pitch

v is the slope of the position. Where that does not fit, the cause is looked for: rows that stand at a limit or stand
out, signals of another axis, signals that are zero. Where the pitch is none that screws have, or TORQUE none that goes
with CURRENT, a unit is another one.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from feedsim.trace.trace import Array

# Pitches of ball screws that manufacturers list; one of them is meant where the estimate holds it.
USUAL_PITCHES = (1, 2, 2.5, 3, 4, 5, 6, 8, 10, 12, 12.5, 15, 16, 20, 25, 30, 32, 40, 50)  # mm
LEAST_PITCH = 0.9  # mm: below it the positions are in another unit, where the figure is a usual pitch in it
OTHER_LENGTHS = {"in": 25.4, "m": 1000.0}  # unit -> mm
DEGREES_PER_TURN = 360.0  # deg: what a rotary axis travels with a turn
FITS = 0.1  # relative residual up to which POWER is TORQUE times a speed
PITCH_TOLERANCE = 0.01  # relative; a pitch is known to that at best, as the channels are sampled at different instants
NEAR_WITHOUT = 0.03  # the same where rows had to be left out, of which some beside are touched, too
# N.m of TORQUE for an A of CURRENT that motors of feed axes with a screw have.
TORQUE_CONSTANTS = (0.05, 5.0)
TOGETHER = 0.9  # of a correlation, above which TORQUE and CURRENT are the same thing in two units
HEAP = 0.005  # share of the rows that are one value to the last digit, at an end of the range: it is cut off there
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
        return self.residual < FITS and 1e-9 < abs(self.pitch) < 1e9  # beyond that it is no pitch in mm


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
    fit, doubts = _fitted(columns["time"], torque, power, position)
    if fit is None:
        return replace(blank, why=_swapped(number, names, columns) or "POWER is not TORQUE times the motor's speed",
                       doubts=doubts)  # fmt: skip
    return _with_units(replace(blank, doubts=doubts), fit, columns)


def _fitted(time: Array, torque: Array, power: Array, position: Array) -> tuple[_Fit | None, tuple[str, ...]]:
    """The fit over rows that are sound, None where there is none; and which rows are not."""
    whole = np.ones(len(time), dtype=bool)
    # Rows beside a spike of the position have a wrong speed.
    torn = {name: _spikes(values) for name, values in (("ENC_POS", position), ("TORQUE", torque), ("POWER", power))}
    cut = {name: _cut_off(values) for name, values in (("TORQUE", torque), ("POWER", power))}
    faults = []
    for name, rows in torn.items():
        if rows.any():
            first = time[np.argmax(rows)]
            faults.append((f"{name} has spikes in {np.sum(rows)} rows, the first at {first:.6g} s", _widened(rows)))
    if not torn["ENC_POS"].any() and (jumps := _jumps(position)).any():
        first = time[np.argmax(jumps)]
        faults.append((f"ENC_POS jumps in {np.sum(jumps)} rows, the first at {first:.6g} s", _widened(jumps)))
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
        kept = [text for text, rows in faults if not _agrees(time, torque, power, position, rows, best)]
        return best, tuple(kept)
    return None, tuple(text for text, _ in faults)


def _agrees(time: Array, torque: Array, power: Array, position: Array, rows: Rows, best: _Fit) -> bool:
    """Whether POWER, TORQUE and speed fit in these rows as well as elsewhere."""
    product = 2 * np.pi / best.pitch * torque * np.gradient(position, time)
    off, size = np.abs(power - product)[rows], float(np.sqrt(np.mean(power**2)))
    return bool(np.sqrt(np.mean(off**2)) < 2 * FITS * size)


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


def _widened(rows: Rows) -> Rows:
    return np.convolve(rows.astype(float), np.ones(9), "same") > 0.5


def _cut_off(values: Array) -> tuple[Rows, str]:
    """Rows that are the largest or the smallest value of all to the last digit, if they are many; and that value."""
    rows, reported = np.zeros(len(values), dtype=bool), []
    for end in (float(values.max()), float(values.min())):
        same = values == end
        if end and same.mean() > HEAP and same.sum() > 5:
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


def _swapped(number: str, names: Mapping[str, str], columns: Mapping[str, Array]) -> str:
    """The signal that fits if it is taken of another axis, in words; "" where there is none."""
    own = {signal: columns[f"{signal}|{number}"] for signal in ("TORQUE", "POWER", "ENC_POS")}
    if len(names) > MAX_AXES_SEARCHED:
        return ""
    whole = np.ones(len(columns["time"]), dtype=bool)
    best: tuple[float, str] = (FITS, "")
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
            if (usual := _usual(size * factor)) is not None:
                doubt = (
                    f"in mm its pitch would be {size:.4g} mm, which no screw has; positions are taken as {unit}, which "
                    f"makes it {usual:g} mm"
                )
                return replace(capture_axis, pitch=usual, length=unit, doubts=(*axis.doubts, doubt))
    pitch = DEGREES_PER_TURN if rotary else _usual(size, NEAR_WITHOUT if axis.doubts else PITCH_TOLERANCE)
    return replace(capture_axis, pitch=float(pitch) if pitch is not None else size)


def _usual(size: float, near: float = PITCH_TOLERANCE) -> float | None:
    """The usual pitch that an estimate [mm] holds, `near` at the most (relative); None where it holds none."""
    usual = min(USUAL_PITCHES, key=lambda value: abs(np.log(value / size)))
    return float(usual) if abs(usual - size) < near * usual else None


def _torque_constant(number: str, columns: Mapping[str, Array]) -> float | None:
    """TORQUE for an A of CURRENT; None without a current, or where the two are not alike."""
    torque, current = columns[f"TORQUE|{number}"], columns.get(f"CURRENT|{number}")
    if current is None or not np.ptp(current):
        return None
    alike = float(np.corrcoef(torque, current)[0, 1])
    return abs(float(torque @ current) / float(current @ current)) if abs(alike) > TOGETHER else None
