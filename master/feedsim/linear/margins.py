"""What curves over frequency show, independent of a grid: crossings, extremes, margins, bandwidths.

A grid finds brackets, which are narrowed together to the resolution of floating-point numbers. The grid's step is a
share of the least damping ratio: a resonance is some 2 zeta wide on a logarithmic axis, an anti-resonance no less.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from feedsim.linear.plant import Complexes, Floats
from feedsim.structure import Modes

Curve = Callable[[Floats], Floats]

STEP_PER_DAMPING = 1 / 3
GRID_STEPS = (5e-4, 1e-2)  # finest, coarsest relative step of the grid
# Points looked at within every bracket in one call of the curve, which costs little more than a single one
BRACKET_POINTS = 15
CROSSING_ROUNDS = 24  # at most: every other one narrows a bracket to 1/16, the others to what the chord is off
CHORD_OFFSETS = np.r_[-(8.0 ** np.arange(-1, -8, -1)), 0.0, 8.0 ** np.arange(-7, 0)]  # shares of a bracket, INSIDE
EXTREME_ROUNDS = 6  # each narrows a bracket to 1/8: two steps to 1e-7; an extreme's place shows to the rounding's root


@dataclass(frozen=True)
class Extreme:
    """A local extreme of a curve: frequency [Hz] and value there."""

    frequency: float
    value: float


@dataclass(frozen=True)
class Pair:
    """An anti-resonance and the resonance that follows it."""

    antiresonance: Extreme
    resonance: Extreme


def grid(modes: Modes, low: float, high: float) -> Floats:
    """Frequencies [Hz] from low to high, close enough together that no feature of the structure falls between."""
    damping = modes.damping[~modes.rigid]
    least = float(damping.min()) if damping.size else 1.0
    step = min(max(STEP_PER_DAMPING * least, GRID_STEPS[0]), GRID_STEPS[1])
    return np.asarray(np.geomspace(low, high, math.ceil(math.log(high / low) / step) + 1))


def crossings(curve: Curve, frequency: Floats, values: Floats | None = None) -> Floats:
    """Frequencies [Hz], ascending, at which a real curve passes through 0; `frequency` (F,) is the grid."""
    values = curve(frequency) if values is None else values
    where = np.flatnonzero(np.isfinite(values[:-1]) & np.isfinite(values[1:]) & ((values[:-1] < 0) != (values[1:] < 0)))
    if not where.size:
        return np.empty(0)
    entry = np.arange(len(where))
    ends, at_ends = frequency[[where, where + 1]], values[[where, where + 1]]
    for number in range(CROSSING_ROUNDS):
        low, high = ends
        if (high - low <= 2 * np.spacing(high)).all():
            break
        places = _around_chord(ends, at_ends) if number % 3 else _places(low, high)
        heights = np.vstack([at_ends[:1], curve(places[1:-1].ravel()).reshape(BRACKET_POINTS, -1), at_ends[1:]])
        first = ((heights < 0) != (at_ends[0] < 0)).argmax(axis=0)
        ends, at_ends = (np.stack([one[first - 1, entry], one[first, entry]]) for one in (places, heights))
    return np.asarray(0.5 * (ends[0] + ends[1]))


def _around_chord(ends: Floats, values: Floats) -> Floats:
    """(INSIDE + 2, n) places in n brackets, densest where the chord between the curve's values (2, n) passes 0."""
    low, high = ends
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.nan_to_num(values[0] / (values[0] - values[1]), nan=0.5)
    inside = np.clip(low + (high - low) * (share + CHORD_OFFSETS[:, None]), low, high)
    return np.vstack([low, inside, high])


def _places(low: Floats, high: Floats) -> Floats:
    """(INSIDE + 2, n) evenly from the lower to the upper ends of n brackets."""
    return np.asarray(np.linspace(low, high, BRACKET_POINTS + 2))


def extremes(curve: Curve, frequency: Floats, values: Floats | None = None) -> tuple[list[Extreme], list[Extreme]]:
    """Local minima and local maxima of a real curve inside the grid `frequency` (F,)."""
    values = curve(frequency) if values is None else values
    rise = np.diff(values)
    result: list[list[Extreme]] = []
    for sign in (-1.0, 1.0):
        where = np.flatnonzero((sign * rise[:-1] > 0) & (sign * rise[1:] <= 0)) + 1
        places = _find_maximum(curve, sign, frequency[where - 1], frequency[where + 1])
        heights = curve(places) if places.size else places
        result.append([Extreme(float(f), float(v)) for f, v in zip(places, heights, strict=True)])
    return result[0], result[1]


def peak(curve: Curve, frequency: Floats) -> Extreme | None:
    """The highest local maximum of a real curve inside the grid `frequency` (F,); None where there is none."""
    values = curve(frequency)
    rise = np.diff(values)
    maxima = np.flatnonzero((rise[:-1] > 0) & (rise[1:] <= 0)) + 1
    if not maxima.size:
        return None
    where = maxima[[values[maxima].argmax()]]
    place = _find_maximum(curve, 1.0, frequency[where - 1], frequency[where + 1])
    return Extreme(float(place[0]), float(curve(place)[0]))


def _find_maximum(curve: Curve, sign: float, low: Floats, high: Floats) -> Floats:
    """The maximum of sign * curve in every bracket."""
    values = np.arange(len(low))
    for _ in range(EXTREME_ROUNDS if low.size else 0):
        places = _places(low, high)
        best = (sign * curve(places[1:-1].ravel())).reshape(BRACKET_POINTS, -1).argmax(axis=0) + 1
        low, high = places[best - 1, values], places[best + 1, values]
    return np.asarray(0.5 * (low + high))


def pairs(curve: Curve, frequency: Floats, rise: float) -> list[Pair]:
    """Every local minimum with the local maximum that follows it at least `rise` higher."""
    minima, maxima = extremes(curve, frequency)
    result = []
    for low in minima:
        high = next((high for high in maxima if high.frequency > low.frequency), None)
        if high is not None and high.value - low.value >= rise:
            result.append(Pair(low, high))
    return result


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
    phases = np.degrees(np.angle(-at_unit))  # 0 where the phase is -180 degrees
    return Margins(
        gain=tuple(
            GainCrossing(float(f), float(1 / abs(L))) for f, L in zip(real[negative], at_real[negative], strict=True)
        ),
        phase=tuple(PhaseCrossing(float(f), float(margin)) for f, margin in zip(unit, phases, strict=True)),
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

    values = crossings(above, frequency)
    if not values.size:
        return Bandwidth(math.nan, math.nan)
    falling = values[above(values * (1 + 1e-6)) < 0]
    return Bandwidth(float(falling[0]), float(falling[-1])) if falling.size else Bandwidth(math.nan, math.nan)


def delay(response: Gain, frequency: float) -> float:
    """Delay [s] of a response towards zero frequency: its negative phase over the angular frequency.

    Read at `frequency` and at half of it; what is left of the phase's curvature is removed (the phase is odd).
    """
    f = np.array([frequency, frequency / 2])
    at, half = -np.angle(response(f)) / (2 * np.pi * f)
    return float((4 * half - at) / 3)
