"""Which parts of a record move, and which of them are sines: their amplitude and frequency."""

from __future__ import annotations

from dataclasses import dataclass
from math import nan, pi
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d
from scipy.optimize import least_squares

from feedsim.identify.motion import Motion
from feedsim.identify.record import Record
from feedsim.identify.runs import runs

Array = NDArray[np.float64]

PAUSE = 0.08  # [s] at rest that parts two stretches; a reversal of a sine down to 1 Hz is over before
SLOW = 1e-3  # of the highest speed: what counts as rest, if it is above the noise
NOISES = 6  # standard deviations of the speed's noise that count as motion
SHORTEST = 20  # rows that make a stretch
LEAST_PERIODS = 2.5  # that make a sine
SINE_SHARE = (
    0.03  # of the speed's mean square that may be something else: friction bends sines by up to 0.005, ramps are 0.1
)


@dataclass(frozen=True)
class Part:
    """Rows first <= i < last of a record that move.

    Attributes:
        amplitude: of a sine, that of its fundamental; else half the range of the angle [rad].
        frequency: [Hz], nan where it is no sine.
        reversals: number of changes of the direction.
    """

    first: int
    last: int
    kind: Literal["sine", "motion"]
    amplitude: float
    frequency: float
    reversals: int

    @property
    def rows(self) -> slice:
        """Of the record."""
        return slice(self.first, self.last)


def parts(record: Record, motion: Motion) -> tuple[Part, ...]:
    """Stretches of a record in the order of time.

    What rests is left out: a controller creeps there, and the noise of hours at rest must not drown the moves. Where
    the setpoint was recorded, it says when the axis is asked to move; else the speed does.
    """
    speed = motion.coarse()
    moving = _moving(record, motion, speed)
    angle = np.asarray(motion.speed.antiderivative()(motion.time), dtype=np.float64)
    found = [_part(motion, speed, angle, first, last) for first, last in runs(moving) if last - first >= SHORTEST]
    return tuple(found)


def _moving(record: Record, motion: Motion, speed: Array) -> NDArray[np.bool_]:
    """(N,) whether the axis moves within half a pause about each row."""
    asked = np.abs(speed) > max(SLOW * float(np.max(np.abs(speed))), NOISES * motion.noise)
    if record.setpoint is not None:
        steps = np.abs(np.diff(record.setpoint, prepend=record.setpoint[0]))
        if np.any(steps > 0):
            # A setpoint that changes makes the axis move; a creeping axis alone does not count.
            asked = steps > SLOW * float(np.max(steps)) * 1e-2
    width = 2 * round(PAUSE / 2 / motion.interval) + 1
    return np.asarray(maximum_filter1d(asked.astype(np.int8), width) > 0)


def _part(motion: Motion, speed: Array, angle: Array, first: int, last: int) -> Part:
    rows = slice(first, last)
    n = speed[rows]
    loud = n[np.abs(n) > max(NOISES * motion.noise, 0.05 * float(np.max(np.abs(n))))]
    reversals = int(np.count_nonzero(np.diff(np.sign(loud))))
    half_range = float(np.ptp(angle[rows])) / 2
    sine = _sine(motion.interval, n, reversals)
    if sine is not None:
        amplitude, frequency = sine
        return Part(first, last, "sine", amplitude, frequency, reversals)
    return Part(first, last, "motion", half_range, nan, reversals)


def _sine(interval: float, speed: Array, reversals: int) -> tuple[float, float] | None:
    """Amplitude of the angle [rad] and frequency [Hz] of the middle half of a stretch; None: it is no sine."""
    if reversals < 2 * LEAST_PERIODS:
        return None
    count = len(speed)
    middle = speed[count // 4 : count - count // 4]
    time = np.arange(len(middle)) * interval
    window = np.hanning(len(middle))
    size = 8 * len(middle)
    spectrum = np.abs(np.fft.rfft((middle - middle.mean()) * window, size))
    start = float(np.argmax(spectrum) / (size * interval))
    if start * time[-1] < 0.8:
        return None

    def columns(frequency: float) -> Array:
        turn = 2 * pi * frequency * time
        return np.column_stack([np.cos(turn), np.sin(turn), np.ones_like(time)])

    def rest(frequency: Array) -> Array:
        shape = columns(float(frequency[0]))
        return np.asarray(middle - shape @ np.linalg.lstsq(shape, middle, rcond=None)[0], dtype=np.float64)

    frequency = float(least_squares(rest, [start], x_scale=start, xtol=1e-8).x[0])
    shape = columns(frequency)
    weights = np.linalg.lstsq(shape, middle, rcond=None)[0]
    left = middle - shape @ weights
    if np.mean(left**2) > SINE_SHARE * np.mean(middle**2):
        return None
    return float(np.hypot(weights[0], weights[1])) / (2 * pi * frequency), frequency
