"""Frequency responses from time signals, without a model, each line with its standard deviation.

Periodic excitation: mean and scatter over periods (R. Pintelon, J. Schoukens, System Identification, 2nd ed., 2012,
ch. 2 and 3). Else the quotient of cross spectrum and spectrum over segments with a Hann window (Welch, H1), with the
standard deviation that the coherence stands for (J. Bendat, A. Piersol, Random Data, 4th ed., 2010, ch. 9).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy import signal

from feedsim.files.trace.response import Complexes
from feedsim.files.trace.trace import Array
from feedsim.foundation.errors import InputError

LEAST_PERIODS = 3
PERIOD_TOLERANCE = 0.1  # share of the input's variance by which one period may differ from the next
# Of the largest line of the input, and of the median of what is above that: less is no excitation, but what the input
# answers with (harmonics).
EXCITED, MEDIAN_SHARE = 0.1, 0.4
LINE_SIGMAS = 5.0  # standard deviations that an excited line has to stand out of its scatter
SEGMENTS = 8  # that a record without a period is cut into at least, with half overlap twice as many
COHERENT = 0.5  # least coherence of a line that is used


@dataclass(frozen=True, eq=False)
class EstimatedResponses:
    """Responses over common lines.

    Attributes:
        frequency: (N,) [Hz], increasing. values: name -> (N,) output over input.
        relative: name -> (N,) relative standard deviation of either part [1].
        method: in words.
    """

    frequency: Array
    values: Mapping[str, Complexes]
    relative: Mapping[str, Array]
    method: str
    notes: Sequence[str] = field(default_factory=tuple)


def estimate_responses(
    inputs: Sequence[Array],
    outputs: Mapping[str, Sequence[Array]],
    interval: float,
    *,
    period: int | None = None,
    orders: Mapping[str, int] | None = None,
) -> EstimatedResponses:
    """Responses of outputs to an input.

    Args:
        inputs: of every run (T,). outputs: name -> of every run (T,). interval: of the samples [s].
        period: of the excitation in samples; None: it is looked for.
        orders: name -> how often an output is differentiated to be an acceleration; None: not known.

    Raises InputError: too few samples; an input that does not vary; a period that the record does not hold.
    """
    length = len(inputs[0])
    if length < 64:
        raise InputError(f"{length} samples; a frequency response needs 64 at least")
    if not any(np.ptp(values) > 0 for values in inputs):
        raise InputError("the input does not vary: nothing is excited")
    if period is not None and not 16 <= period <= length:
        raise InputError(f"a period of {period} samples; allowed: 16 to the {length} samples of the record")
    count = period if period is not None else period_of(inputs[0])
    if count is None:
        return _by_segments(inputs, outputs, interval, orders or {})
    return _by_periods(inputs, outputs, interval, count)


def period_of(values: Array) -> int | None:
    """Samples after which a signal repeats; all of them for one period of a binary sequence of maximal length; None:
    it does not repeat."""
    length = len(values)
    if (length + 1) & length == 0 and len(np.unique(values)) == 2:  # 2^n - 1
        return length
    centred = values - np.mean(values)
    spectrum = np.abs(np.fft.rfft(centred, 2 * length)) ** 2
    overlap = length - np.arange(length)
    correlation = np.fft.irfft(spectrum)[:length] / overlap
    longest = length // LEAST_PERIODS
    if longest < 17 or not correlation[0] > 0:
        return None
    inner = correlation[16 : longest + 1] / correlation[0]
    high = np.flatnonzero(inner > (1 - PERIOD_TOLERANCE) * np.max(inner)) + 16
    for lag in map(int, high):
        window = correlation[max(lag - 1, 0) : lag + 2]
        if correlation[lag] < np.max(window):
            continue
        off = centred[lag:] - centred[:-lag]
        if float(np.mean(off**2)) <= 2 * PERIOD_TOLERANCE * correlation[0]:
            return lag
    return None


def _by_periods(
    inputs: Sequence[Array], outputs: Mapping[str, Sequence[Array]], interval: float, period: int
) -> EstimatedResponses:
    """The first period of a run is its transient, and left out where there are others; so is half of the second and of
    the last one, about which there is no period that shows a drift."""

    def periods(run: Array) -> Complexes:
        count = len(run) // period
        parts = run[: count * period] if count == 1 else _without_drift(run[: count * period], period)
        kept = parts[-max(count - 2, 1) * period :].reshape(-1, period)
        return np.asarray(np.fft.rfft(kept - np.mean(kept, axis=1, keepdims=True), axis=1)[:, 1:])

    # Runs may excite the other way round: each is weighed by its own input.
    U = np.concatenate([periods(run) for run in inputs])
    Y = {name: np.concatenate([periods(run) for run in runs]) for name, runs in outputs.items()}
    count = len(U)
    power = np.mean(np.abs(U) ** 2, axis=0)
    frequency = np.arange(1, U.shape[1] + 1) / (period * interval)
    size = np.sqrt(power)
    excited = size > EXCITED * np.max(size)
    excited &= size > MEDIAN_SHARE * np.median(size[excited])
    if len(inputs) == 1 and count > 2:
        mean = np.abs(np.mean(U, axis=0))
        excited &= mean > LINE_SIGMAS * np.std(U, axis=0) / np.sqrt(count)
    values, relative = {}, {}
    for name, lines in Y.items():
        cross = np.mean(lines * np.conj(U), axis=0)
        with np.errstate(divide="ignore", invalid="ignore"):
            G = cross / power
            remaining = np.sum(np.abs(lines - G * U) ** 2, axis=0) / max(count * (count - 1), 1)
            values[name] = G[excited]
            relative[name] = (
                (np.sqrt(remaining / 2) / (size * np.abs(G)))[excited] if count > 1 else np.zeros(len(G))[excited]
            )
    runs = f"{count} periods of {period} samples" if count > 1 else f"one period of {period} samples"
    return EstimatedResponses(frequency[excited], values, relative, f"mean and scatter over {runs}")


def _without_drift(run: Array, period: int) -> Array:
    """The run from half a period behind its begin to half a period ahead of its end, less its mean over the period
    about each sample: which has all of a slow drift and nothing of what is periodic.

    A drift within a period would have a part at every line, which grows with the frequency where an angle is
    differentiated.
    """
    total = np.concatenate([[0.0], np.cumsum(run - np.mean(run))])
    around = (total[period:] - total[:-period]) / period + np.mean(run)
    if period % 2 == 0:  # half of either end sample
        around = 0.5 * (around[1:] + around[:-1])
    first = period // 2
    return np.asarray(run[first : first + len(around)] - around)


def _by_segments(
    inputs: Sequence[Array], outputs: Mapping[str, Sequence[Array]], interval: float, orders: Mapping[str, int]
) -> EstimatedResponses:
    """Outputs are differenced ahead, and the response divided by that of the differences: an angle's spectrum is so
    steep that the lowest lines leak into the others."""
    total = sum(map(len, inputs))
    longest = min(map(len, inputs)) // (SEGMENTS if len(inputs) == 1 else 2)
    size = 2 ** int(np.log2(max(longest, 32)))
    rate = 1 / interval
    options = {"fs": rate, "window": "hann", "nperseg": size, "noverlap": size // 2, "detrend": "linear"}

    def mean(one: Sequence[Array], other: Sequence[Array]) -> tuple[Array, Complexes]:
        both = [signal.csd(a, b, **options) for a, b in zip(one, other, strict=True)]
        return both[0][0][1:], np.mean([entry[1][1:] for entry in both], axis=0)

    frequency, power = mean(inputs, inputs)
    segments = max(total // size * 2 - 1, 1)
    independent = max(segments * 9 / 11, 1.0)  # Hann windows that overlap by half
    values, relative, kept = {}, {}, np.real(power) > 1e-3 * float(np.max(np.real(power)))
    step = -np.expm1(-2j * np.pi * frequency * interval)  # of one difference
    for name, signals in outputs.items():
        order = orders.get(name, 0)
        runs = [np.diff(run, order, prepend=np.full(order, run[0])) if order else run for run in signals]
        _, cross = mean(inputs, runs)
        _, own = mean(runs, runs)
        coherence = np.clip(np.abs(cross) ** 2 / np.maximum(np.real(power) * np.real(own), 1e-300), 1e-12, 1 - 1e-12)
        values[name] = cross / power / step**order
        relative[name] = np.sqrt((1 - coherence) / (2 * coherence * independent))
        kept &= coherence > COHERENT
    kept[-1] = False  # half the sampling rate has no phase
    return EstimatedResponses(
        frequency[kept],
        {name: value[kept] for name, value in values.items()},
        {name: value[kept] for name, value in relative.items()},
        f"cross spectrum over spectrum (Welch), {segments} segments of {size} samples, coherence above {COHERENT:g}",
    )
