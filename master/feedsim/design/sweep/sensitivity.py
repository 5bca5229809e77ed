"""Which parameter moves a figure: Sobol indices with bootstrap intervals, and cheap measures for other designs.

Sobol indices: with the variance V of a figure y over the distributions of all (independent) parameters,

    first order  S_i  = V(E(y | x_i)) / V          what is gone of the scatter when x_i is known
    total        S_Ti = 1 - V(E(y | x_~i)) / V     what is left of it when all but x_i are known

from two independent samples A and B of N base points, and the d samples AB_i that are A with column i of B:

    S_i = mean(f_B (f_AB_i - f_A)) / V,    S_Ti = mean((f_A - f_AB_i)^2) / (2 V)

(A. Saltelli et al., Computer Physics Communications 181, 2010, Table 2 b and f; what scipy.stats.sobol_indices
computes, which refuses any N but powers of two and so what failed runs leave of one.) The f are taken about their mean.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from feedsim.design.sweep.design import Array
from feedsim.foundation.errors import Finding

if TYPE_CHECKING:
    from feedsim.design.sweep.design import Design
    from feedsim.design.sweep.table import Table


RESAMPLES = 1000
CONFIDENCE = 0.95
# Failed runs are hardly ever spread evenly: they sit where the parameters are extreme, and what is left is another
# distribution than was asked for. Beyond this share of the base points that is no longer a detail.
MOST_LEFT_OUT = 0.1
LEAST_POINTS = 8  # base points below which there are no indices
# With 16, 95 % intervals of even a linear figure's largest index held in less than one of ten studies.
USEFUL_POINTS = 64
INDEX_TOLERANCE = 0.02  # that indices and their intervals may lie beyond 0 and 1: too little to mislead
# Scatter below this share of a figure's size is what rounding leaves, not an effect.
CONSTANT = 1e-12
_BLOCK = 4_000_000  # numbers of a block of resampling weights, 32 MB


@dataclass(frozen=True, eq=False, kw_only=True)
class Measures:
    """What moves one figure: measures of its d parameters, and what they are from.

    Attributes:
        used: base points or rows with a value; left_out: those without, because a run has no value.
        reason: why there are no measures; empty where there are.
    """

    used: int
    left_out: int
    reason: str = ""


@dataclass(frozen=True, eq=False, kw_only=True)
class Indices(Measures):
    """Sobol indices of one figure, from base points.

    Attributes:
        first, total: (d,) [1]; NaN where there are none.
        first_interval, total_interval: (d, 2) lower and upper end at the confidence CONFIDENCE, by bootstrap over the
            base points (percentiles). They suppose random points: those of a Sobol sequence are more even, which makes
            intervals of additive figures too wide, but which points of A meet which of B is not random, which makes
            those of others too narrow; BCa and studentised intervals hold no more often (docs/sweeps.md).
    """

    first: Array
    total: Array
    first_interval: Array
    total_interval: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class Trends(Measures):
    """Cheap measures of one figure from the rows of any sample: how it rises with each parameter.

    Attributes:
        rank_correlation: (d,) Spearman's, -1 to 1: how well "larger here, larger there" holds; 0 also where a figure
            has its minimum in the middle. NaN for words and for a parameter that is the same in all rows.
        regression: (d,) coefficients of the linear regression on all numeric parameters, in standard deviations of the
            figure per standard deviation of the parameter.
        share: (d,) share of the scatter that lies between the groups of rows with the same value; NaN for a parameter
            that hardly any two rows share. On a whole grid, the first-order Sobol index of evenly weighted values.
        explained: share of the scatter that this regression explains [1], R^2: below some 0.7 it says little.
        noise: magnitude that a rank correlation reaches by chance in one case of twenty.
    """

    rank_correlation: Array
    regression: Array
    share: Array
    explained: float = np.nan
    noise: float = np.nan


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """What moves the figures of a study.

    Attributes:
        parameters: their names, in the order of the arrays.
        sobol: figure -> indices; empty unless the runs were drawn for them.
        trends: figure -> cheap measures. Of runs drawn for indices: from the samples A and B, which are independent.
        warnings: what was left out, for people.
    """

    parameters: tuple[str, ...]
    sobol: Mapping[str, Indices]
    trends: Mapping[str, Trends]
    warnings: tuple[Finding, ...]


def sensitivities(table: Table, design: Design, seed: int = 0) -> Sensitivities:
    """Of every figure of a table, whose rows may be a part of the design's. seed: of the bootstrap."""
    row = np.full(design.runs, -1)  # of the table, -1 for a run that is not there
    row[np.asarray(table["run"], dtype=np.int64)] = np.arange(len(table))
    matrices = design.matrices
    drawn = row[design.independent][row[design.independent] >= 0]
    entries = design.values[np.asarray(table["run"], dtype=np.int64)][drawn].T
    columns = [None if parameter.worded else entry for parameter, entry in zip(design.parameters, entries, strict=True)]
    groups = [np.unique(entry, return_inverse=True)[1].astype(np.int64) for entry in entries]
    sobol: dict[str, Indices] = {}
    result: dict[str, Trends] = {}
    for name in table.figures:
        values = np.asarray(table[name], dtype=np.float64)
        result[name] = trends(columns, groups, values[drawn])
        if matrices is not None:
            done = (row[matrices.a] >= 0) & (row[matrices.b] >= 0) & np.all(row[matrices.ab] >= 0, axis=0)
            f_A, f_B = values[row[matrices.a[done]]], values[row[matrices.b[done]]]
            sobol[name] = sobol_indices(f_A, f_B, values[row[matrices.ab[:, done]]], seed=seed)
    names = tuple(parameter.name for parameter in design.parameters)
    return Sensitivities(names, sobol, result, _warnings(sobol, names))


def _warnings(sobol: Mapping[str, Indices], parameters: Sequence[str]) -> tuple[Finding, ...]:
    reported: dict[Finding, list[str]] = {}
    for name, indices in sobol.items():
        if indices.reason:
            finding = Finding("sobol-missing", "doubt", f"no Sobol indices: {indices.reason}")
            reported.setdefault(finding, []).append(name)
        elif indices.left_out:
            points = indices.used + indices.left_out
            text = f"Sobol indices without {indices.left_out} of {points} base points, of which a run has no value"
            reported.setdefault(Finding("sobol-of-a-part", "doubt", text), []).append(name)
        if not indices.reason and indices.used < USEFUL_POINTS:
            text = f"Sobol indices from {indices.used} base points: they and their intervals can be far off"
            text += f"; at least {USEFUL_POINTS} make a ranking"
            finding = Finding("sobol-uncertain", "doubt", text, "", f"--runs {USEFUL_POINTS}")
            reported.setdefault(finding, []).append(name)
        if impossible := [parameters[k] for k in find_impossible_indices(indices)]:
            text = f"Sobol indices of {', '.join(impossible)} lie beyond what is possible by more than their intervals"
            remedy = "take more base points"
            finding = Finding("sobol-impossible", "doubt", f"{text}; {remedy}", "", remedy)
            reported.setdefault(finding, []).append(name)
    return tuple(
        replace(finding, text=f"{', '.join(names)}: {finding}.", place=", ".join(names))
        for finding, names in reported.items()
    )


def sobol_indices(f_A: Array, f_B: Array, f_AB: Array, *, seed: int = 0) -> Indices:
    """Indices from a figure's values (N,), (N,) and (d, N); NaN where a run has none.

    A base point of which one run has no value is left out of all samples. seed: of the bootstrap.
    """
    f_A, f_B, f_AB = (np.asarray(values, dtype=np.float64) for values in (f_A, f_B, f_AB))
    if f_A.ndim != 1 or f_B.shape != f_A.shape or f_AB.ndim != 2 or f_AB.shape[1:] != f_A.shape:
        raise ValueError(f"f_A and f_B of shape (N,) and f_AB of shape (d, N), not {f_A.shape, f_B.shape, f_AB.shape}")
    whole = np.isfinite(f_A) & np.isfinite(f_B) & np.all(np.isfinite(f_AB), axis=0)
    points, left_out = int(whole.sum()), int((~whole).sum())
    if reason := _why_no_indices(points, left_out):
        return _no_indices(len(f_AB), points, left_out, reason)
    f_A, f_B, f_AB = f_A[whole], f_B[whole], f_AB[:, whole]
    both = np.concatenate([f_A, f_B])
    if is_constant(np.concatenate([both, f_AB.ravel()])):
        return _no_indices(len(f_AB), points, left_out, "the figure is the same in all runs")
    mean, scale = both.mean(), float(np.ptp(np.concatenate([both, f_AB.ravel()])))
    f_A, f_B, f_AB = (f_A - mean) / scale, (f_B - mean) / scale, (f_AB - mean) / scale
    # One row per term whose mean an estimate needs, so that a resample of the points is a product with its weights.
    terms = np.concatenate([f_B * (f_AB - f_A), 0.5 * (f_A - f_AB) ** 2, [f_A + f_B], [f_A**2 + f_B**2]]).T
    first, total = _estimates(terms.mean(axis=0)[np.newaxis])
    firsts, totals = _estimates(np.concatenate([weights @ terms for weights in _resamples(points, seed)]))
    ends = [50 * (1 - CONFIDENCE), 50 * (1 + CONFIDENCE)]
    return Indices(
        first=first[0],
        total=total[0],
        first_interval=np.asarray(np.nanpercentile(firsts, ends, axis=0).T),
        total_interval=np.asarray(np.nanpercentile(totals, ends, axis=0).T),
        used=points,
        left_out=left_out,
    )


def find_impossible_indices(indices: Indices) -> list[int]:
    """Parameters of which an interval lies wholly beyond 0 to 1, or the first order wholly above the total."""
    if indices.reason:
        return []
    wrong = (indices.total_interval[:, 0] > 1 + INDEX_TOLERANCE) | (indices.first_interval[:, 0] > 1 + INDEX_TOLERANCE)
    wrong |= (indices.first_interval[:, 1] < -INDEX_TOLERANCE) | (
        indices.first_interval[:, 0] > indices.total_interval[:, 1] + INDEX_TOLERANCE
    )
    return [int(k) for k in np.flatnonzero(wrong)]


def trends(columns: list[Array | None], groups: list[NDArray[np.int64]], values: Array) -> Trends:
    """Measures of a figure's values (N,), NaN where a run has none, against d parameters.

    columns: (N,) of each parameter, None for one of words. groups: (N,) of each parameter, the number of its value.
    """
    known = np.isfinite(values)
    rows, d = int(known.sum()), len(columns)
    nan = np.full(d, np.nan)
    y = np.asarray(values[known], dtype=np.float64)
    left_out = len(values) - rows
    if rows < 3 or is_constant(y):
        reason = "fewer than three runs have a value" if rows < 3 else "the figure is the same in all runs"
        return Trends(rank_correlation=nan, regression=nan, share=nan, used=rows, left_out=left_out, reason=reason)
    inside = [None if column is None else np.asarray(column[known], dtype=np.float64) for column in columns]
    varied = [k for k, column in enumerate(inside) if column is not None and not is_constant(column)]
    ranked = nan.copy()
    for k in varied:
        column = inside[k]
        assert column is not None
        ranked[k] = _correlation(_ranks(column), _ranks(y))
    regression, explained = _regression([inside[k] for k in varied], y)
    coefficients = nan.copy()
    coefficients[varied] = regression
    shares = np.array([_share_between(group[known], y) for group in groups])
    return Trends(
        rank_correlation=ranked, regression=coefficients, share=shares, explained=explained,
        noise=1.96 / np.sqrt(rows - 1), used=rows, left_out=left_out,
    )  # fmt: skip


def is_constant(values: Array) -> bool:
    """Whether values scatter by no more than rounding does."""
    return bool(np.ptp(values) <= CONSTANT * np.max(np.abs(values)))


def _why_no_indices(points: int, left_out: int) -> str:
    if left_out > MOST_LEFT_OUT * (points + left_out):
        return (
            f"{left_out} of {points + left_out} base points have a run without a value; "
            f"at most {100 * MOST_LEFT_OUT:g} % may be left out"
        )
    return f"{points} base points; at least {LEAST_POINTS} are needed" if points < LEAST_POINTS else ""


def _no_indices(d: int, points: int, left_out: int, reason: str) -> Indices:
    nan, none = np.full(d, np.nan), np.full((d, 2), np.nan)
    return Indices(
        first=nan, total=nan, first_interval=none, total_interval=none, used=points, left_out=left_out, reason=reason
    )


def _estimates(means: Array) -> tuple[Array, Array]:
    """First and total indices, (R, d) each, from the means (R, 2 d + 2) of the terms."""
    d = (means.shape[1] - 2) // 2
    variance = means[:, -1:] / 2 - (means[:, -2:-1] / 2) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):  # a resample of equal points
        ratios = np.where(variance > 0, means[:, : 2 * d] / variance, np.nan)
    return ratios[:, :d], ratios[:, d:]


def _resamples(points: int, seed: int) -> Iterator[Array]:
    """Weights (some, points) of the points in RESAMPLES draws with replacement, in blocks that stay small."""
    generator = np.random.default_rng([seed, points])
    even = np.full(points, 1 / points)
    remaining = RESAMPLES
    while remaining > 0:
        some = min(remaining, max(1, _BLOCK // points))
        yield generator.multinomial(points, even, size=some) / points
        remaining -= some


def _ranks(values: Array) -> Array:
    from scipy.stats import rankdata

    return np.asarray(rankdata(values), dtype=np.float64)


def _correlation(x: Array, y: Array) -> float:
    return float(np.corrcoef(x, y)[0, 1])


def _regression(columns: list[Array | None], y: Array) -> tuple[Array, float]:
    """Standardised coefficients and R^2; NaN where there are too few rows for them."""
    x = np.array([column for column in columns if column is not None]).reshape(len(columns), -1).T
    if not columns or len(y) < len(columns) + 3:
        return np.full(len(columns), np.nan), np.nan
    x = (x - x.mean(axis=0)) / x.std(axis=0)
    z = (y - y.mean()) / y.std()
    coefficients, _, rank, _ = np.linalg.lstsq(x, z, rcond=None)
    if rank < len(columns):
        return np.full(len(columns), np.nan), np.nan
    return np.asarray(coefficients), float(1 - np.mean((z - x @ coefficients) ** 2))


def _share_between(group: NDArray[np.int64], y: Array) -> float:
    """Variance of the groups' means over that of all; NaN where the groups are hardly larger than one row."""
    _, number, sizes = np.unique(group, return_inverse=True, return_counts=True)
    if len(sizes) < 2 or len(y) < 2 * len(sizes):
        return float("nan")
    means = np.bincount(number, weights=y) / sizes
    return float(np.sum(sizes * (means - y.mean()) ** 2) / np.sum((y - y.mean()) ** 2))
