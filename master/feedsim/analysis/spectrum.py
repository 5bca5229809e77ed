"""What a signal is made of, by frequency."""

from __future__ import annotations

import numpy as np

from feedsim.analysis.figures import Array


def amplitude_spectrum(values: Array, interval: float, rows: int | None = None) -> tuple[Array, Array]:
    """Frequency [Hz] and amplitude spectrum of ``values`` (N,), sampled every ``interval`` [s], by Hann's window.

    A sine of amplitude A on a line stands there as A. rows: of the stretches, half over each other, whose spectra are
    averaged by power; None: one, of all rows. Stretches lose their mean.
    """
    size = min(rows or len(values), len(values))
    window = np.hanning(size)
    power = []
    for first in range(0, len(values) - size + 1, max(size // 2, 1)):
        part = values[first : first + size]
        power.append((2 * np.abs(np.fft.rfft((part - np.mean(part)) * window)) / np.sum(window)) ** 2)
    frequency = np.fft.rfftfreq(size, interval)
    return np.asarray(frequency, dtype=np.float64), np.asarray(np.sqrt(np.mean(power, axis=0)), dtype=np.float64)
