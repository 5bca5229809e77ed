"""Averages of disturbed signals with an honest standard deviation: correlated noise, drift, quantised values."""

from __future__ import annotations

from math import hypot

import numpy as np

from feedsim.estimation.covariance import correlation_length
from feedsim.identify.record import Array


def window(rows: int, taper: int) -> Array:
    """(rows,) weights of sum 1 that rise and fall as a raised cosine over `taper` rows, 0 at both ends.

    A ring-down that a plain mean would take in by its phase at the ends is averaged away.
    """
    taper = max(min(taper, (rows - 1) // 2), 1)
    weights = np.ones(rows)
    rise = 0.5 - 0.5 * np.cos(np.pi * np.arange(taper) / taper)
    weights[:taper] = rise
    weights[rows - taper :] = rise[::-1]
    return np.asarray(weights / np.sum(weights), dtype=np.float64)


def derivative(weights: Array, signal: Array, interval: float, order: int) -> float:
    """Weighted mean of the first or second derivative of a signal, whose derivative is not taken: the weights are, by
    summation by parts. They must be 0 at both ends."""
    padded = np.concatenate([[0.0], weights, [0.0]])
    centred = signal - signal[0]
    if order == 1:
        return float(-np.sum((padded[2:] - padded[:-2]) * centred) / (2 * interval))
    return float(np.sum((padded[2:] - 2 * padded[1:-1] + padded[:-2]) * centred) / interval**2)


def resolution(signal: Array) -> float:
    """Smallest step between values that occur; 0 for a constant. Of a signal that is not quantised: next to nothing."""
    steps = np.diff(np.unique(signal))
    # Decimal values differ by rounding of their binary form: that is no step.
    steps = steps[steps > 1e-9 * max(float(np.max(np.abs(signal))), 1e-300)]
    return float(np.min(steps)) if len(steps) else 0.0


def white(signal: Array) -> float:
    """Standard deviation of the white noise on a smooth signal, quantisation included.

    From third differences (variance 20 times the noise's), which leave little of the motion; their median, which the
    jerky parts do not move. A signal that stands still most of the time shows no noise but has a resolution.
    """
    if len(signal) < 4:
        return 0.0
    third = np.diff(signal, 3)
    moving = third[third != 0]
    noise = float(np.median(np.abs(moving))) / 0.6745 / np.sqrt(20) if len(moving) else 0.0
    return hypot(noise, resolution(signal) / np.sqrt(12))


def mean(signal: Array, weights: Array, step: float, *, trend: bool = False) -> tuple[float, float]:
    """Weighted mean and its standard deviation.

    step: of the quantisation. Noise well above a step averages the rounding away; below, the mean stays wrong by up to
    half of it (the fundamental of the rounding error falls with exp(-2 pi^2 scatter^2 / step^2) where the scatter is
    white; ring-down rounds in step with itself, of which a tenth of the variance is kept).
    trend: a linear trend does not count as scatter.
    """
    middle = float(np.sum(weights * signal))
    residuals = signal - middle
    if trend:
        along = np.arange(len(signal)) - 0.5 * (len(signal) - 1)
        residuals = residuals - np.mean(residuals) - along * np.sum(along * residuals) / np.sum(along**2)
    scatter = float(np.std(residuals))
    variance = scatter**2 * correlation_length(residuals - np.mean(residuals), of_mean=True) * float(np.sum(weights**2))
    if step > 0:
        variance += step**2 / 12 * max(float(np.exp(-4 * np.pi**2 * (scatter / step) ** 2)), 0.1)
    return middle, float(np.sqrt(variance))
