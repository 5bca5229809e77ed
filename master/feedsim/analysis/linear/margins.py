"""Margins of an open-loop gain and bandwidths of a closed loop."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feedsim.analysis.linear.search import crossings

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Gain = Callable[[Floats], Complexes]

THREE_DB = 10 ** (-3 / 20)


@dataclass(frozen=True)
class GainCrossing:
    """The open-loop gain is real and negative: the factor on the gain that leads to the limit of stability."""

    frequency: float  # [Hz]
    factor: float  # [1]


@dataclass(frozen=True)
class PhaseCrossing:
    """The open-loop gain has magnitude 1: the phase that is left to -180 degrees, from -180 to 180."""

    frequency: float  # [Hz]
    margin: float  # [deg]


@dataclass(frozen=True)
class Margins:
    """All crossings of an open-loop gain, ascending in frequency, and those that count.

    The margins mean what they say where the closed loop is stable, which they do not decide: `stability` does.
    """

    gain: tuple[GainCrossing, ...]
    phase: tuple[PhaseCrossing, ...]

    @property
    def gain_margin(self) -> GainCrossing:
        """Smallest factor above 1 that the gain must not reach; infinite where there is none."""
        return min((c for c in self.gain if c.factor > 1), key=_factor, default=GainCrossing(math.nan, math.inf))

    @property
    def gain_reduction(self) -> GainCrossing:
        """Largest factor below 1 that the gain must not fall to; 0 where there is none (not conditionally stable)."""
        return max((c for c in self.gain if c.factor <= 1), key=_factor, default=GainCrossing(math.nan, 0.0))

    @property
    def phase_margin(self) -> PhaseCrossing:
        """The crossing of magnitude 1 nearest to -180 degrees."""
        return min(self.phase, key=lambda c: abs(c.margin), default=PhaseCrossing(math.nan, math.nan))

    @property
    def crossover(self) -> float:
        """Lowest frequency [Hz] at which the gain's magnitude passes 1; NaN where it does not."""
        return self.phase[0].frequency if self.phase else math.nan

    @property
    def last_crossover(self) -> float:
        """Highest frequency [Hz] at which the gain's magnitude passes 1; NaN where it does not."""
        return self.phase[-1].frequency if self.phase else math.nan


def _factor(crossing: GainCrossing) -> float:
    return crossing.factor


def margins(gain: Gain, frequency: Floats) -> Margins:
    """Margins of the open-loop gain, a function of frequency [Hz], within the grid `frequency` (F,)."""
    values = gain(frequency)
    real = crossings(lambda f: gain(f).imag, frequency, values.imag)
    at_real = gain(real) if real.size else np.empty(0, dtype=np.complex128)
    negative = at_real.real < 0
    unit = crossings(lambda f: np.log(np.abs(gain(f))), frequency, np.log(np.abs(values)))
    at_unit = gain(unit) if unit.size else np.empty(0, dtype=np.complex128)
    left = np.degrees(np.angle(-at_unit))  # 0 where the phase is -180 degrees
    return Margins(
        gain=tuple(
            GainCrossing(float(f), float(1 / abs(L))) for f, L in zip(real[negative], at_real[negative], strict=True)
        ),
        phase=tuple(PhaseCrossing(float(f), float(margin)) for f, margin in zip(unit, left, strict=True)),
    )


@dataclass(frozen=True)
class Bandwidth:
    """Where a closed loop's magnitude passes -3 dB [Hz]; NaN where it never does within the range looked at.

    Attributes:
        first: it falls below for the first time, possibly into an anti-resonance.
        last: it falls below for good.
    """

    first: float
    last: float


def bandwidth(response: Gain, frequency: Floats) -> Bandwidth:
    """-3 dB bandwidth of a closed loop, a function of frequency [Hz], within the grid `frequency` (F,)."""

    def above(f: Floats) -> Floats:
        return np.asarray(np.abs(response(f)) - THREE_DB)

    found = crossings(above, frequency)
    falling = [float(f) for f in found if above(np.array([f * (1 + 1e-6)]))[0] < 0]
    if not falling:
        return Bandwidth(math.nan, math.nan)
    return Bandwidth(falling[0], falling[-1])


def delay(response: Gain, frequency: float) -> float:
    """Delay [s] of a response towards zero frequency: its negative phase over the angular frequency.

    Read at `frequency` and at half of it; what is left of the phase's curvature is removed (the phase is odd).
    """
    f = np.array([frequency, frequency / 2])
    at, half = -np.angle(response(f)) / (2 * np.pi * f)
    return float((4 * half - at) / 3)
