"""Lines of a measured response beside their neighbours, without a model of the axis.

A parabola through a line and its neighbours, complex and over the frequency, by least squares (local polynomial method:
R. Pintelon, J. Schoukens, System Identification, 2nd ed., 2012, ch. 7). What it leaves is noise, and distortion that
repeats with the excitation, which no scatter over periods shows. Its least magnitude is an antiresonance; that of the
reciprocal response a resonance.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize_scalar

from feedsim.trace.response import Complexes
from feedsim.trace.trace import Array

LINES = 9  # of a parabola: a line and four neighbours to either side
COLUMNS = 3  # of a parabola
EXTREME_DISTANCE = 0.07  # share of a frequency within which lines show a dip or a peak there
INNER_SHARE = 0.8  # of the lines' range in which it has to be


def scatter(frequency: Array, values: Complexes) -> Complexes:
    """(N,) what lines differ by from their neighbours, over their magnitude: the real part is along the response, the
    imaginary part across it. Scaled so that its variance is that of one line.

    frequency: (N,) [Hz], increasing, 9 or more. values: (N,) not 0.
    """
    count, half = len(frequency), LINES // 2
    result = np.zeros(count, dtype=np.complex128)
    for k in range(count):
        first = min(max(k - half, 0), count - LINES)
        rows = slice(first, first + LINES)
        V = _powers(frequency[rows], frequency[k])
        basis = np.linalg.qr(V)[0]
        own = values[rows] - basis @ (basis.T @ values[rows])
        result[k] = own[k - first] / values[k]
    return np.asarray(result * np.sqrt(LINES / (LINES - COLUMNS)), dtype=np.complex128)


def least(frequency: Array, values: Complexes, at: float) -> tuple[float, float]:
    """The frequency near `at` at which a response is least, and its standard deviation [Hz]; nan where the lines do not
    show one. Of a resonance, `values` are those of the reciprocal response."""
    nothing = float("nan"), float("nan")
    rows = np.flatnonzero(np.abs(frequency / at - 1) < EXTREME_DISTANCE)
    if len(rows) < LINES:
        first = int(np.clip(np.searchsorted(frequency, at) - LINES // 2, 0, max(len(frequency) - LINES, 0)))
        rows = np.arange(first, min(first + LINES, len(frequency)))
    if len(rows) < LINES:
        return nothing
    V = _powers(frequency[rows], at)
    c = np.linalg.lstsq(V, values[rows], rcond=None)[0]
    remaining = values[rows] - V @ c
    variance = float(np.sum(np.abs(remaining) ** 2)) / (2 * (len(rows) - COLUMNS))
    low, high = INNER_SHARE * (frequency[rows[[0, -1]]] - at)
    d = float(minimize_scalar(lambda d: abs(np.polyval(c, d)), bounds=(low, high), method="bounded").x)
    if min(d - low, high - d) < 1e-3 * (high - low):
        return nothing
    row = np.vander([d], COLUMNS)[0]
    sigma = np.sqrt(row @ np.linalg.inv(V.T @ V) @ row * variance) / abs(np.polyval(np.polyder(c), d))
    return at + d, float(sigma)


def _powers(frequency: Array, at: float) -> Array:
    """(K, 3)"""
    return np.vander(frequency - at, COLUMNS)
