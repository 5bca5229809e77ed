"""Periodic excitation on the grid of the control cycle: multisine and maximum-length sequence.

A period is a whole number of position cycles, so that every loop of the drive sees a periodic signal and the discrete
Fourier transform over a period has no leakage. The position controller samples with T_pos: of what it is given at f, it
answers at the images abs(f + m/T_pos) as well. A response at f can only be separated from the image of another line
where no two excited lines are images of one another; the multisine here chooses its lines so (:func:`distinct_lines`).

Sources: R. Pintelon, J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed., Wiley 2012, chapters 4
and 5 (random-phase multisines, binary sequences); E. Van der Ouderaa, J. Schoukens, J. Renneboog, Peak factor
minimization using a time-frequency domain swapping algorithm, IEEE Trans. Instrum. Meas. 37 (1988) 145-147.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from feedsim.foundation.errors import InputError
from feedsim.scenario import Cycles

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Spacing = Literal["linear", "logarithmic"]

# Swaps between time and frequency domain, clipped at a share of the peak that rises from first to last: the crest
# factor of some hundred lines falls from about 3.5 to between 1.4 and 2.1.
SWAPS = 200
CLIPPED_AT = (0.5, 0.99)
MOST_SAMPLES = 8_000_000  # of a period: 1000 s at 125 us
FEWEST_STAGES, MOST_STAGES = 3, 20  # of the shift register
# Lines of a held sequence weaker than this share of its strongest say little: those about a zero of the hold.
WEAKEST_LINE = 0.1
MOST_DECIMATIONS = 256  # sequences of a length to choose from
LINE_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Excitation:
    """One period of a signal with mean 0.

    Attributes:
        kind: "multisine" or "binary".
        samples: (N,) values at the instants of the control cycle, in the unit of the input they go to.
        cycle: control cycle T_c [s].
        lines: (K,) excited harmonics of the period, ascending; harmonic k has the frequency k/(N T_c).
        seed: what the random choices came from.
    """

    kind: str
    samples: Floats
    cycle: float
    lines: Integers
    seed: int

    @property
    def period(self) -> float:
        """Period [s]."""
        return len(self.samples) * self.cycle

    @property
    def frequency(self) -> Floats:
        """(K,) frequencies of the excited lines [Hz]."""
        return self.lines / self.period

    @property
    def rms(self) -> float:
        """Root of the mean square."""
        return float(np.sqrt(np.mean(self.samples**2)))

    @property
    def peak(self) -> float:
        """Largest magnitude."""
        return float(np.max(np.abs(self.samples)))


def multisine(
    cycles: Cycles,
    rms: float,
    *,
    band: tuple[float, float] = (1.0, 1000.0),
    resolution: float = 1.0,
    spacing: Spacing = "linear",
    lines_per_decade: float = 100.0,
    seed: int = 0,
) -> Excitation:
    """Sum of cosines of equal amplitude and random phases, its crest factor reduced.

    Args:
        rms: of the signal, in the unit of the input.
        band: lowest and highest frequency [Hz], below half the sampling rate of the control cycle.
        resolution: distance of neighbouring lines [Hz] within a zone of half the position controller's sampling rate.
            Lines of different zones are interleaved, so that a period lasts as many times 1/resolution as the band
            touches zones: one up to 500 Hz, two up to 1000 Hz where T_pos is 1 ms.
        spacing: all lines, or `lines_per_decade` of them in equal ratios as far as the resolution allows.
        seed: of the phases; the same seed gives the same signal.

    Raises:
        InputError: a band without lines or beyond half the sampling rate, an RMS or resolution that is not positive.
    """
    low, high = _checked_band(band, cycles)
    _positive("RMS", rms, "")
    _positive("resolution", resolution, "Hz")
    _positive("lines per decade", lines_per_decade, "")
    if spacing not in ("linear", "logarithmic"):
        raise InputError(f"spacing {spacing!r} of a multisine: linear or logarithmic is expected")
    per_cycle = round(cycles.T_pos / cycles.T_c)
    zones = max(1, math.ceil(2 * high * cycles.T_pos - LINE_ROUNDING))
    position_cycles = max(1, round(zones / (resolution * cycles.T_pos)))
    if position_cycles * per_cycle > MOST_SAMPLES:
        raise InputError(
            f"a resolution of {resolution:.6g} Hz needs periods of {position_cycles * cycles.T_pos:.6g} s; "
            f"allowed are {MOST_SAMPLES * cycles.T_c:.6g} s"
        )
    period = position_cycles * cycles.T_pos
    first, last = math.ceil(low * period - LINE_ROUNDING), math.floor(high * period + LINE_ROUNDING)
    lines = distinct_lines(np.arange(max(first, 1), last + 1), position_cycles, zones)
    if spacing == "logarithmic" and lines.size:
        wanted = math.ceil(math.log10(last / max(first, 1)) * lines_per_decade) + 1
        ideal = np.geomspace(lines[0], lines[-1], wanted)
        after = np.clip(np.searchsorted(lines, ideal), 1, len(lines) - 1) if len(lines) > 1 else np.zeros(1, np.int64)
        before = np.maximum(after - 1, 0)
        lines = np.unique(np.where(ideal - lines[before] < lines[after] - ideal, lines[before], lines[after]))
    if not lines.size:
        raise InputError(
            f"no line between {low:.6g} and {high:.6g} Hz at a resolution of {resolution:.6g} Hz; "
            "take a wider band or a finer resolution"
        )
    samples = _compress_multisine(position_cycles * per_cycle, lines, np.random.default_rng(seed))
    samples *= rms / np.sqrt(np.mean(samples**2))
    return Excitation("multisine", _frozen(samples), cycles.T_c, lines, seed)


def distinct_lines(lines: Integers, position_cycles: int, zones: int) -> Integers:
    """Those of `lines` of which no two are images of one another to a controller that samples with T_pos.

    Sampled once per position cycle, harmonic k of a period of `position_cycles` appears at its folded place, the
    distance of k to the nearest multiple of `position_cycles`. Zone z = floor(2 k/position_cycles) gets the folded
    places that leave the remainder z when divided by `zones`: every place goes to one zone alone. Lines that are images
    of themselves, or of the mean, are left out.
    """
    remainder = lines % position_cycles
    folded = np.minimum(remainder, position_cycles - remainder)
    zone = 2 * lines // position_cycles
    chosen = (folded % zones == zone % zones) & (folded != 0) & (2 * folded != position_cycles)
    return np.asarray(lines[chosen], dtype=np.int64)


def binary_sequence(
    cycles: Cycles,
    rms: float,
    *,
    band: tuple[float, float] = (1.0, 1000.0),
    stages: int = 11,
    hold: int = 1,
    seed: int = 0,
) -> Excitation:
    """Maximum-length sequence of 2^stages - 1 chips of +-rms, each held for `hold` control cycles.

    The sequence is repeated until a whole number of position cycles is reached; that is the period. Repeated as often
    as a position cycle has control cycles, no line is the image of another. With a hold of a whole position cycle they
    all are, and what the position controller makes of images adds to the response as noise does.

    Args:
        rms: RMS and peak of the signal, in the unit of the input.
        band: lines within are reported as excited [Hz]; the signal itself has lines beyond.
        stages: of the shift register, 3 to 20.
        hold: chip length in control cycles; the spectrum has its first zero at 1/(hold T_c).
        seed: of the sequence and of its start. Seeds that follow one another, up to as many as there are sequences of
            that length (2 of 3 stages, 176 of 11; here at most MOST_DECIMATIONS), have different polynomials: none is
            another one shifted.

    Raises:
        InputError: an argument out of range, no line in the band.
    """
    low, high = _checked_band(band, cycles)
    _positive("RMS", rms, "")
    if not FEWEST_STAGES <= stages <= MOST_STAGES:
        raise InputError(f"{stages} stages of a binary sequence; allowed are {FEWEST_STAGES} to {MOST_STAGES}")
    if hold < 1:
        raise InputError(f"a hold of {hold} control cycles; at least 1 is needed")
    per_cycle = round(cycles.T_pos / cycles.T_c)
    length = (2**stages - 1) * hold
    repeats = math.lcm(length, per_cycle) // length
    if length * repeats > MOST_SAMPLES:
        raise InputError(
            f"{stages} stages held for {hold} control cycles need periods of {length * repeats * cycles.T_c:.6g} s; "
            f"allowed are {MOST_SAMPLES * cycles.T_c:.6g} s"
        )
    random = np.random.default_rng(seed)
    state = np.zeros(stages, dtype=np.int8)
    while not state.any():
        state = random.integers(0, 2, stages, dtype=np.int8)
    from scipy.signal import max_len_seq  # takes a third of a second, which a plain run should not wait for

    sequence = max_len_seq(stages, state=state)[0]
    # Shifts of one sequence are one signal to the machine, and what is not linear would look alike to all of them.
    every = _decimations(stages)
    sequence = sequence[np.arange(len(sequence)) * every[seed % len(every)] % len(sequence)]
    chips = sequence.astype(np.float64) * 2 - 1
    once = np.repeat(chips - chips.mean(), hold)
    once *= rms / np.sqrt(np.mean(once**2))
    strength = np.abs(np.fft.rfft(once))
    harmonics = np.arange(len(strength))
    frequency = harmonics / (length * cycles.T_c)
    inside = (frequency >= low * (1 - LINE_ROUNDING)) & (frequency <= high * (1 + LINE_ROUNDING)) & (harmonics > 0)
    lines = harmonics[inside & (strength > WEAKEST_LINE * strength.max())] * repeats
    if not lines.size:
        raise InputError(
            f"no line between {low:.6g} and {high:.6g} Hz: those of the sequence are "
            f"{1 / (length * cycles.T_c):.6g} Hz apart; take more stages"
        )
    return Excitation("binary", _frozen(np.tile(once, repeats)), cycles.T_c, lines.astype(np.int64), seed)


def _decimations(stages: int) -> list[int]:
    """Every how many chips of a maximum-length sequence to take so that other such sequences arise, the first 1.

    Taking every q-th chip, q without a common divisor with the length, gives the sequence of another primitive
    polynomial, and the same one shifted where q' = 2^i q modulo the length (S. W. Golomb, Shift Register Sequences,
    Holden-Day 1967): q is the smallest of its class here. At most MOST_DECIMATIONS.
    """
    length = 2**stages - 1
    indexes: list[int] = []
    for q in range(1, length, 2):
        if math.gcd(q, length) == 1 and q == min((q << i) % length for i in range(stages)):
            indexes.append(q)
            if len(indexes) == MOST_DECIMATIONS:
                break
    return indexes


def _compress_multisine(count: int, lines: Integers, random: np.random.Generator) -> Floats:
    """Cosines of amplitude 1 at `lines` of a period of `count`; random phases, then clipped and reset in turns."""
    spectrum = np.zeros(count // 2 + 1, dtype=np.complex128)
    phases = np.exp(1j * random.uniform(0, 2 * np.pi, len(lines)))
    best, least = np.zeros(count), np.inf
    for share in np.linspace(*CLIPPED_AT, SWAPS):
        spectrum[lines] = phases
        signal = np.fft.irfft(spectrum, count)
        peak = float(np.max(np.abs(signal)))
        if peak < least:
            best, least = signal, peak
        clipped = np.fft.rfft(np.clip(signal, -share * peak, share * peak))[lines]
        phases = np.exp(1j * np.angle(clipped))
    return best


def _checked_band(band: tuple[float, float], cycles: Cycles) -> tuple[float, float]:
    low, high = band
    limit = 0.5 / cycles.T_c
    if not 0 <= low < high < limit:
        raise InputError(
            f"excited band {low:.6g} to {high:.6g} Hz: both from 0 on, the first below the second, and below half the "
            f"sampling rate of the control cycle, {limit:.6g} Hz"
        )
    return low, high


def _positive(name: str, value: float, unit: str) -> None:
    if not 0 < value < math.inf:
        raise InputError(f"{name} {value:.6g}{' ' + unit if unit else ''} of an excitation: must be above 0 and finite")


def _frozen(samples: Floats) -> Floats:
    samples.setflags(write=False)
    return samples
