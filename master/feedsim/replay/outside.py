"""Vibration from outside: lines in a record of an axis at rest, which go on while it moves.

A spindle or a pump shakes an axis whether it moves or not. No drive and no mode of the axis explains such a line, and
a fit takes it for elasticity of its own if one is near. It is found where the axis stands still, ahead of a motion and
behind it: a sine of one frequency, amplitude and phase over both, so that either side predicts the other. Between them
it is taken to go on as it was.

A line that the record's known load has, or by which its torque moves the axis, is the axis' own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from feedsim.replay.closed_loop import AxisRecord
from feedsim.trace.trace import Array

Rows = NDArray[np.int64]

BESIDE = 0.5  # [s] at rest on either side of a motion that are looked at
MIN_REST_TIME_BESIDE = 0.1  # [s] at rest that are needed there
DIES_AWAY = 0.12  # [s] behind a motion in which the axis itself still swings
PERIODS = 2  # of a line on the shorter side
BELOW_RATE = 0.4  # of the rows' rate: above it nothing is separated
FINER = 8  # frequencies per line width
PREDICTED_SHARE = 0.5  # share of the variance at rest that either side has to predict of the other
MOST_LINES = 3
MAX_NAMED_LINES = 4  # in a note
SAME_LINE = 1.0  # by how many line widths frequencies of one line differ at most
MIN_AMPLITUDE = 1e-8  # [m] amplitude: less is the digits of a record
# Of a known load: frequencies beside a line, in line widths, and the share of their power that the line has to have.
BAND_WIDTHS, LOAD_SHARE = 3, 0.5
MOVED_BY_TORQUE = 0.3  # of the amplitude: how near the axis comes to what its torque does to its inertia


@dataclass(frozen=True)
class Line:
    """A line from outside. frequency [Hz], position [m] and torque [N.m] amplitudes; begin, end: between which rows of
    the record's time [s] it was taken out."""

    frequency: float
    position: float
    torque: float
    begin: float
    end: float

    @property
    def duration(self) -> float:
        """[s]"""
        return self.end - self.begin

    def at(self, frequency: float) -> Line:
        """The same of another frequency [Hz]."""
        return replace(self, frequency=frequency)

    @property
    def text(self) -> str:
        """In words, without the name of the axis."""
        torque = f" and {self.torque:.2g} N.m" if self.torque else ""
        return (
            f"{self.frequency:.4g} Hz with {1e6 * self.position:.2g} um{torque} (amplitudes), {self.begin:.3g} to "
            f"{self.end:.3g} s"
        )


def without_outside(axis_record: AxisRecord, J: float | None = None) -> tuple[AxisRecord, tuple[Line, ...]]:
    """The record without lines from outside, and those lines; the record itself where there are none.

    J: inertia of the axis [kg.m2], where it is known.
    """
    position, torque = axis_record.position.copy(), axis_record.record.torque.copy()
    time, clean = axis_record.record.time, 0  # clean: rows ahead of it have lost their lines
    lines: list[Line] = []
    for before, after in _rests(axis_record):
        # A short rest is behind one motion and ahead of the next one: either side is looked at as it was recorded.
        own, beside = axis_record.position.copy(), axis_record.record.torque.copy()
        whole = np.arange(before[0], after[-1] + 1)
        rows, count = whole[whole >= clean], len(lines)
        for _ in range(MOST_LINES):
            frequency = _line(time, own, before, after)
            if frequency is None:
                break
            sine = _sine(time, own, frequency, before, after)
            if np.hypot(*sine) < MIN_AMPLITUDE:
                break
            wave = waves(time[whole], frequency)
            own[whole] -= wave @ sine
            force = _sine(time, beside, frequency, before, after) if axis_record.record.driven else np.zeros(2)
            beside[whole] -= wave @ force
            if driven_by_record(axis_record, frequency, (before, after), sine, force, J):
                continue
            sizes = float(np.hypot(*sine)), float(np.hypot(*force))
            lines.append(Line(frequency, *sizes, float(time[rows[0]]), float(time[rows[-1]])))
        if len(lines) > count:
            position[rows], torque[rows], clean = own[rows], beside[rows], int(rows[-1]) + 1
    if not lines:
        return axis_record, ()
    record = replace(axis_record.record, angle=position / axis_record.I_P, torque=torque)
    return replace(axis_record, record=record), tuple(lines)


def _rests(axis_record: AxisRecord) -> Iterator[tuple[Rows, Rows]]:
    """Rows at rest ahead of every motion and behind it, where there are enough of both."""
    h = axis_record.record.interval
    moving = replace(axis_record, rows=np.ones_like(axis_record.rows)).moving
    behind = np.ones(round(DIES_AWAY / h) + 1)
    moving = np.convolve(moving, behind)[: len(moving)] > 0.5
    edges = np.flatnonzero(np.diff(moving.astype(int)))
    stretches = np.split(np.arange(len(moving)), edges + 1)  # at rest and in motion in turns
    beside, shortest = round(BESIDE / h), round(MIN_REST_TIME_BESIDE / h)
    for k in range(1, len(stretches) - 1):
        before, after = stretches[k - 1][-beside:], stretches[k + 1][:beside]
        if moving[stretches[k][0]] and min(len(before), len(after)) >= shortest:
            yield before, after


def _line(time: Array, position: Array, before: Rows, after: Rows) -> float | None:
    """Frequency [Hz] of the line that explains most of the position at rest; None: neither side predicts the other."""
    h = float(time[1] - time[0])
    width = h * (after[-1] - before[0])
    quiet = np.zeros(after[-1] - before[0] + 1)
    for rows in (before, after):
        quiet[rows - before[0]] = detrended(position, rows)
    size = FINER * len(quiet)
    power, grid = np.abs(np.fft.rfft(quiet, size)), np.fft.rfftfreq(size, h)
    power[(grid < PERIODS / (h * min(len(before), len(after)))) | (grid > BELOW_RATE / h)] = 0.0
    best, step = float(grid[int(np.argmax(power))]), 0.5 / (FINER * width)
    for _ in range(3):  # the sine that leaves least is near the highest line
        near = best + step * np.arange(-3, 4)
        best = float(near[int(np.argmin([_remaining_squares(time, position, f, before, after) for f in near]))])
        step /= 3
    sides = [(before, detrended(position, before)), (after, detrended(position, after))]
    for (own, y), (other, z) in (sides, sides[::-1]):
        W, V = (detrended(waves(time, best), rows) for rows in (own, other))
        sine = np.linalg.lstsq(W, y, rcond=None)[0]
        if not np.sum((z - V @ sine) ** 2) < (1 - PREDICTED_SHARE) * np.sum(z**2):
            return None
    return best


def _remaining_squares(time: Array, signal: Array, frequency: float, before: Rows, after: Rows) -> float:
    """Sum of squares that one sine over both sides leaves."""
    W, y = _both(time, signal, frequency, before, after)
    return float(np.sum((y - W @ np.linalg.lstsq(W, y, rcond=None)[0]) ** 2))


def _sine(time: Array, signal: Array, frequency: float, before: Rows, after: Rows) -> Array:
    """(2,) cosine and sine of one line over both sides."""
    return np.asarray(np.linalg.lstsq(*_both(time, signal, frequency, before, after), rcond=None)[0])


def _both(time: Array, signal: Array, frequency: float, before: Rows, after: Rows) -> tuple[Array, Array]:
    wave, sides = waves(time, frequency), (before, after)
    return tuple(np.concatenate([detrended(of, rows) for rows in sides]) for of in (wave, signal))  # type: ignore[return-value]


def driven_by_record(
    axis_record: AxisRecord, frequency: float, stretches: Sequence[Rows], sine: Array, force: Array, J: float | None
) -> bool:
    """Whether a line is the axis' own: the known load has it, or the torque moves the inertia so.

    The torque of a drive that answers to a line from outside has another size and phase.

    Args:
        stretches: rows over which the line is. sine, force: (2,) cosine and sine of position [m] and torque [N.m].
    """
    record = axis_record.record
    if record.load is not None:
        time, width = record.time, 1 / (record.time[stretches[-1][-1]] - record.time[stretches[0][0]])
        band = [frequency, *(frequency + side * k * width for k in range(1, BAND_WIDTHS + 1) for side in (-1, 1))]
        every = np.column_stack([waves(time, one) for one in band if one > 0])
        columns, load = (np.concatenate([detrended(of, rows) for rows in stretches]) for of in (every, record.load))
        line, whole = (part @ np.linalg.lstsq(part, load, rcond=None)[0] for part in (columns[:, :2], columns))
        if line @ line > LOAD_SHARE * (whole @ whole):
            return True
    if J is None:
        return False
    angle = sine / axis_record.I_P
    off = angle + force / (J * (2 * np.pi * frequency) ** 2)
    return bool(np.hypot(*off) < MOVED_BY_TORQUE * np.hypot(*angle))


def waves(time: Array, frequency: float) -> Array:
    """(N, 2) cosine and sine of 2 pi `frequency` `time`."""
    phase = 2 * np.pi * frequency * time
    return np.column_stack([np.cos(phase), np.sin(phase)])


def detrended(signal: Array, rows: Rows) -> Array:
    """Rows of a signal (N,) or (N, K) less their parabola: creep at rest is no vibration."""
    t = np.linspace(-1.0, 1.0, len(rows))
    trend = np.linalg.qr(np.column_stack([np.ones_like(t), t, t**2]))[0]
    return np.asarray(signal[rows] - trend @ (trend.T @ signal[rows]))


def in_words(axis: str, lines: Sequence[Line], moving: bool = False) -> str:
    """A note on them: each frequency once, the first ones, and how many there are beyond."""
    named = _by_frequency(lines)
    more = f" and {len(named) - MAX_NAMED_LINES} more" if len(named) > MAX_NAMED_LINES else ""
    when, what = ("while it moves", "no setpoint drives") if moving else ("at rest", "no drive and no mode explains")
    return (
        f"axis {axis}: {when} the record has {'; '.join(line.text for line in named[:MAX_NAMED_LINES])}{more}: "
        f"vibration from outside the axis, which {what}"
    )


def same_line(one: Line, other: Line) -> bool:
    """Whether two lines have the same frequency, as far as the shorter one determines it."""
    return abs(one.frequency - other.frequency) * min(one.duration, other.duration) < SAME_LINE


def _by_frequency(lines: Sequence[Line]) -> list[Line]:
    """Lines of one frequency as one, with the largest amplitudes."""
    result: list[Line] = []
    for line in sorted(lines, key=lambda line: (line.begin, line.frequency)):
        k = next((k for k, other in enumerate(result) if same_line(line, other)), None)
        if k is None:
            result.append(line)
            continue
        both = line, result[k]
        longer = max(both, key=lambda one: one.duration)
        begin, end = min(one.begin for one in both), max(one.end for one in both)
        result[k] = Line(
            longer.frequency, max(one.position for one in both), max(one.torque for one in both), begin, end
        )
    return result
