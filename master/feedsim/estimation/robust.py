"""Values of a linear model from samples that do not all fit, and how well they are known.

Samples count less the worse they fit (Tukey's biweight). Intervals hold what neighbouring samples share, what rounding
of a record may have added, and what is not known of values that are only known to within a spread.
Start reading at robust_fit().
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feedsim.estimation.covariance import Covariance
from feedsim.estimation.parameter import Array

BIWEIGHT = 4.685  # 95 % as efficient as least squares where the noise is normal
MAX_REWEIGHTINGS = 6
# Harmonics of what rounding adds to a value, over where the value lies between two steps.
HARMONICS = 3
# Of normal noise the costs bend by 0.87 of what the weights say.
LEAST_CURVATURE = 0.5
MAX_SCALE = 1e6  # of a variance by samples over one by blocks, of which each has fewer samples by far
CHANGE_FLOOR = 1e-13  # changes of a term below this [m] are rounding


class Robust(NamedTuple):
    """Values (K,); of every sample its weight and how fast its influence grows with its deviation (N,); noise of a
    sample [m], and what it is worth where neighbours share it [m]."""

    values: Array
    weights: Array
    slopes: Array
    noise: float
    shared: float


def robust_fit(matrix: Array, deviation: Array, spread: Array, blocks: Array, floor: float = 0.0) -> Robust:
    """Values by least squares, each sample weighted by how well it fits.

    spread: how large the last values may be (T,) [m], what is known of them beforehand; the others are free. floor:
    what a sample is worth at best beside that [m], as no model is exact.
    """
    weights = slopes = np.ones(len(deviation))
    known = _known(matrix, spread)
    _, block = np.unique(blocks, return_inverse=True) if len(spread) else (0, np.empty(0, dtype=np.int64))
    shared = floor
    for _ in range(MAX_REWEIGHTINGS):
        normal = matrix.T @ (weights[:, None] * matrix) + shared**2 * known
        values = np.linalg.lstsq(normal, matrix.T @ (weights * deviation), rcond=None)[0]
        off = deviation - matrix @ values
        noise = float(np.median(np.abs(off))) / 0.6745
        if noise < CHANGE_FLOOR:
            break
        if len(spread):
            sums = np.bincount(block, np.clip(off, -BIWEIGHT * noise, BIWEIGHT * noise))
            shared = max(noise, math.sqrt(float(sums @ sums) / len(off)), floor)
        inner = np.clip(1 - (off / (BIWEIGHT * noise)) ** 2, 0.0, None)
        settled = float(np.abs(inner**2 - weights).max()) < 0.01
        weights, slopes = inner**2, inner * (5 * inner - 4)
        if settled:
            break
    return Robust(np.asarray(values), np.asarray(weights), np.asarray(slopes), noise, shared)


def _bounded(curved: Array, weighted: Array) -> Array:
    """The matrix of second derivatives (K, K), in every direction at least LEAST_CURVATURE of the weighted normal
    matrix (K, K).

    Samples that fit badly bend the sum of costs the other way. A few of them that matter much for one direction leave
    it flat, as if nothing were known of it.
    """
    values, vectors = np.linalg.eigh(weighted)
    usable = values > 1e-14 * values[-1]
    root = vectors[:, usable] * np.sqrt(values[usable])
    inverse = vectors[:, usable] / np.sqrt(values[usable])
    shares, directions = np.linalg.eigh(inverse.T @ curved @ inverse)
    if shares[0] >= LEAST_CURVATURE:
        return curved
    along = root @ directions
    return np.asarray((along * np.maximum(shares, LEAST_CURVATURE)) @ along.T)


def _known(matrix: Array, spread: Array) -> Array:
    """What is known of the values beforehand, as an inverse covariance (K, K) [1/m2]."""
    return np.diag(np.concatenate([np.zeros(matrix.shape[1] - len(spread)), 1 / spread**2]))


def _resolution(values: Array) -> float:
    """The step to whose multiples values are rounded, in their unit; 0 where they are not."""
    apart = np.diff(np.unique(values))
    if len(apart) == 0:
        return 0.0
    steps = apart / apart.min()
    return float(apart.min()) if float(np.abs(steps - np.round(steps)).max()) < 0.01 else 0.0


def rounding(paths: Sequence[Array], off: Sequence[Array], noise: float) -> NDArray[np.complex128]:
    """What rounding may have added to the samples of all paths, a column for each path and harmonic (N, J) [m].

    paths: recorded values of each [m]. off: what the model leaves of them [m]. noise: of a sample [m].

    Between two steps a value that noise does not move errs by up to half a step, for as long as it stays there; noise
    of more than half a step takes nearly all of it away. Where between two steps a path lies is taken to be unknown:
    the effect of a column on a value is a variance of the value.
    """
    columns = []
    for k, path in enumerate(paths):
        if (step := _resolution(path)) == 0.0:
            continue
        turns = (path - off[k]) / step
        own = math.sqrt(max(noise**2 - step**2 / 12, 0.0)) / step
        for n in range(1, HARMONICS + 1):
            amplitude = step / (math.pi * n) * math.exp(-2 * (math.pi * n * own) ** 2) / math.sqrt(2)
            column = [np.zeros(len(path), dtype=np.complex128) for path in paths]
            column[k] = amplitude * np.exp(2j * math.pi * n * turns)
            columns.append(np.concatenate(column))
    samples = sum(len(path) for path in paths)
    return np.column_stack(columns) if columns else np.empty((samples, 0), dtype=np.complex128)


def covariance_of(
    matrix: Array,
    residual: Array,
    robust: Robust,
    spread: Array,
    blocks: Array,
    rounded: NDArray[np.complex128],
) -> tuple[Array, int]:
    """Covariance of the values and its degrees of freedom.

    The larger of two: as if every sample had noise of its own, and as if only blocks of samples had. Besides, what
    rounding adds, and what is not known of the tails.
    """
    known = robust.shared**2 * _known(matrix, spread)
    weighted = matrix.T @ (robust.weights[:, None] * matrix) + known
    covariance = Covariance.of(_bounded(matrix.T @ (robust.slopes[:, None] * matrix) + known, weighted))
    influence = robust.weights * residual
    _, block = np.unique(blocks, return_inverse=True)
    free = max(int(block.max()) + 1 - matrix.shape[1] + len(spread), 2)
    single = covariance.of_samples(matrix, influence)
    blockwise = covariance.of_blocks(matrix, influence, block, free)
    # Of what is known beforehand alone, both are rounding.
    scale = np.sqrt(np.clip(np.diag(single) / np.maximum(np.diag(blockwise), 1e-300), 1.0, MAX_SCALE))
    besides = robust.shared**2 * covariance.inverse @ known @ covariance.inverse
    if rounded.shape[1]:
        moved = covariance.inverse @ (matrix.T @ (robust.weights[:, None] * rounded))
        besides += (moved @ moved.conj().T).real
    return scale[:, None] * blockwise * scale + besides, free
