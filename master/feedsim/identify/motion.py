"""Smooth motion between the samples of a record: motor speed and its derivative at any instant."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, comb, pi, sqrt
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PPoly
from scipy.signal import butter, sosfiltfilt

from feedsim.errors import InputError
from feedsim.identify.record import Record

Array = NDArray[np.float64]
Source = Literal["speed", "angle"]

# Longest step of the friction law between samples.
LAW_STEP = 0.5e-3
QUIET = 0.01  # noise of the acceleration over its RMS, from which on a motion is smoothed
ROUGH = 20.0  # [Hz] up to which the acceleration's RMS is read
LOWEST = 20.0  # [Hz] cut-off below which no motion is smoothed: friction would be gone with the noise
DIFFERENCES = 4  # order of the differences that noise is read from: what is left of a 10 Hz sine at 500 Hz is 2e-4


@dataclass(frozen=True, eq=False)
class Motion:
    """Speed of one axis as a piecewise polynomial, and instants to look at it.

    What shifts the motion by half a sampling interval is taken for bristle damping: differences of two positions at
    500 Hz put it 15 to 30 % high. A spline through the samples shifts nothing.

    Attributes:
        time: (N,) [s] of the record.
        interval: between its rows [s].
        speed: n over time [rad/s].
        source: what it was made of.
        noise: standard deviation of that speed [rad/s], from differences of the samples.
        parts: steps of the friction law per row.
    """

    time: Array
    interval: float
    speed: PPoly
    source: Source
    noise: float
    parts: int

    @property
    def step(self) -> float:
        """Of the friction law [s]."""
        return self.interval / self.parts

    def fine(self, delay: float) -> Array:
        """((N - 1) parts + 1,) speed [rad/s] at the law's instants, `delay` [s] before those of the record.

        What lies before the first sample has the first sample's speed, what lies after the last the last one's.
        """
        count = (len(self.time) - 1) * self.parts + 1
        return self._at(self.time[0] - delay + np.arange(count) * self.step)

    def acceleration(self, delay: float) -> Array:
        """(N,) dn/dt [rad/s2], `delay` [s] before the record's instants; 0 outside of the record."""
        instants = self.time - delay
        inside = (instants >= self.time[0]) & (instants <= self.time[-1])
        return np.where(inside, self.speed(np.clip(instants, self.time[0], self.time[-1]), 1), 0.0)

    def coarse(self, delay: float = 0.0) -> Array:
        """(N,) speed [rad/s], `delay` [s] before the record's instants."""
        return self._at(self.time - delay)

    def _at(self, instants: Array) -> Array:
        return np.asarray(self.speed(np.clip(instants, self.time[0], self.time[-1])), dtype=np.float64)


def noise_of(values: Array) -> float:
    """Standard deviation of white noise on smooth samples (N,), from the median of their fourth differences.

    The median, because the corners that friction makes at reversals are few. Rest, where a quantised signal does not
    change at all, is left out.
    """
    away = np.abs(np.diff(values, DIFFERENCES))
    away = away[away > 0]
    if len(away) == 0:
        return 0.0
    return float(np.median(away)) / 0.6745 / sqrt(comb(2 * DIFFERENCES, DIFFERENCES))


def quiet(values: Array, interval: float, order: int) -> Array:
    """Samples (N,) with so much of their noise taken away that their derivative of `order` is usable.

    A low-pass run forwards and backwards (no lag), with the highest cut-off at which the acceleration's noise is a
    hundredth of the acceleration. Samples that are that quiet already stay untouched: reversals are sharp, and every
    low-pass rounds them.
    """
    noise, rate = noise_of(values), 1 / interval
    rough = sosfiltfilt(butter(2, ROUGH, fs=rate, output="sos"), values) if rate > 4 * ROUGH else values
    slope = rough
    for _ in range(order):
        slope = np.gradient(slope, interval)
    allowed = QUIET * float(np.sqrt(np.mean(slope**2)))

    def acceleration_noise(cutoff: float) -> float:
        # White noise up to the cut-off, weighted with omega^order.
        return float(noise * (2 * pi * cutoff) ** order * sqrt(2 * cutoff / rate / (2 * order + 1)))

    highest = rate / 2
    if allowed == 0 or acceleration_noise(highest) <= allowed:
        return values
    cutoff = highest * (allowed / acceleration_noise(highest)) ** (1 / (order + 0.5))
    cutoff = min(max(cutoff, LOWEST), 0.45 * rate)
    return np.asarray(sosfiltfilt(butter(2, cutoff, fs=rate, output="sos"), values), dtype=np.float64)


def motion(record: Record, source: Source | None = None) -> Motion:
    """Motion of a record.

    From samples of the speed: the cubic spline through them. From positions: the derivative of the cubic spline
    through them (of fourth order in the interval, like the other). From both, the one that leaves less noise on the
    speed; friction asks for the motor's own speed where they are equally good, as a scale at the slide sees the
    elasticity between. Drift between both matters to nothing here: the friction law forgets.

    Args:
        source: what to make it from; default: as said.

    Raises InputError: too few rows, or the record lacks what `source` names.
    """
    if len(record) < 2 * DIFFERENCES:
        raise InputError(f"{record.name}: {len(record)} rows are too few for a motion; at least {2 * DIFFERENCES}")
    if source is not None and getattr(record, source) is None:
        raise InputError(f"{record.name}: the record has no {source}")
    interval = record.interval
    time = record.time[0] + interval * np.arange(len(record))
    found: dict[Source, tuple[PPoly, float]] = {}
    if record.speed is not None and source != "angle":
        found["speed"] = CubicSpline(time, quiet(record.speed, interval, 1)), noise_of(record.speed)
    if record.angle is not None and source != "speed":
        # sqrt(3)/interval: what the derivative of a cubic spline at its knots makes of white noise, within some per
        # cent (sum over its weights 3 (sqrt(3) - 2)^k / interval).
        noise = noise_of(record.angle) * sqrt(3) / interval
        path = quiet(record.angle - record.angle[0], interval, 2)
        found["angle"] = CubicSpline(time, path).derivative(), noise
    # 3: the motor's own speed is preferred unless the scale is clearly quieter.
    best = min(found, key=lambda name: (found[name][1] * (1 if name == "speed" else 3), name))
    speed, noise = found[best]
    return Motion(time, interval, speed, best, noise, max(1, ceil(interval / LAW_STEP - 1e-9)))
