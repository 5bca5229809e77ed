"""The runs of a study: which value every parameter has in every run, which the study alone decides.

Also a run as it is given to a worker, and what comes back.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from math import log1p, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feedsim.foundation.errors import Finding
from feedsim.scenario import Change
from feedsim.scenario.study import Distribution, Parameter, Study
from feedsim.scenario.study.study import changes_of

Array = NDArray[np.float64]

# Shares of a distribution are kept off 0 and 1, where unbounded ones have no value.
LEAST_SHARE = 2.0**-53


@dataclass(frozen=True)
class Task:
    """A run to be made.

    Attributes:
        run: its number in the study, from 0.
        changes: what is set in the study's scenario.
    """

    run: int
    changes: tuple[Change, ...] = ()


@dataclass(frozen=True)
class Outcome:
    """What came of a run.

    Attributes:
        run: number of its :class:`Task`.
        figures: name -> (SI value, unit); NaN where a figure could not be determined. None where the run failed.
        error: why it failed; None where it did not.
        seconds: time that it took the worker [s].
        warnings: what a user should know before believing the figures.
    """

    run: int
    figures: Mapping[str, tuple[float, str]] | None
    error: str | None = None
    seconds: float = 0.0
    warnings: tuple[Finding, ...] = ()


@dataclass(frozen=True, eq=False)
class Matrices:
    """Runs of a sensitivity study as the estimators of Sobol indices want them.

    Attributes:
        a, b: (N,) runs of the two independent samples.
        ab: (parameters, N) runs of A with the column of one parameter taken from B.
    """

    a: NDArray[np.int64]
    b: NDArray[np.int64]
    ab: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Design:
    """Attributes:

    parameters: that are varied, one per column.
    values: (runs, parameters), SI values; where a parameter's values are words, the number of the choice.
    matrices: of a sensitivity study; else None.
    """

    parameters: tuple[Parameter, ...]
    values: Array
    matrices: Matrices | None = None

    @property
    def runs(self) -> int:
        """Number of runs."""
        return len(self.values)

    @property
    def independent(self) -> NDArray[np.int64]:
        """Runs that are independent: all, of samples for Sobol indices A and B.

        The other samples repeat their values time and again, and would make clusters.
        """
        if self.matrices is None:
            return np.arange(self.runs)
        return np.concatenate([self.matrices.a, self.matrices.b])

    def changes(self, run: int) -> tuple[Change, ...]:
        """What a run sets in the study's scenario."""
        return changes_of(self.parameters, self.values[run].tolist())

    def task(self, run: int) -> Task:
        """The run for a worker."""
        return Task(run, self.changes(run))

    def tasks(self, runs: Iterable[int]) -> Iterator[Task]:
        """Tasks of `runs`, made one after the other."""
        return map(self.task, runs)

    def options(self, run: int) -> list[str]:
        """What a run sets, as KEY=VALUE for --set."""
        return [change.option for change in self.changes(run)]

    def shown(self, run: int) -> list[float | str]:
        """The values of a run as the table shows them."""
        pairs = zip(self.parameters, self.values[run].tolist(), strict=True)
        return [parameter.choices[int(value)].label if parameter.worded else value for parameter, value in pairs]


def design(study: Study) -> Design:
    """The runs of `study`."""
    from scipy.stats import qmc  # half a second, which workers need not wait for

    sampling, parameters = study.sampling, study.parameters
    if sampling.method == "grid":
        return Design(parameters, _grid(parameters))
    d = len(parameters)
    if sampling.method == "sensitivity":
        shares = _sobol(2 * d, sampling.runs, sampling.seed)
        return _cross_samples(parameters, _values(parameters, shares[:, :d]), _values(parameters, shares[:, d:]))
    if sampling.method == "sobol":
        shares = _sobol(d, sampling.runs, sampling.seed)
    else:
        shares = qmc.LatinHypercube(d=d, seed=np.random.default_rng(sampling.seed)).random(sampling.runs)
    return Design(parameters, _values(parameters, shares))


def _sobol(d: int, runs: int, seed: int) -> Array:
    """(runs, d) points of a scrambled Sobol sequence."""
    from scipy.stats import qmc

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # runs that are no power of two: the study warns of that
        points = qmc.Sobol(d=d, scramble=True, seed=np.random.default_rng(seed)).random(runs)
    return np.asarray(points, dtype=np.float64)


def _cross_samples(parameters: tuple[Parameter, ...], a: Array, b: Array) -> Design:
    """A, B and the AB_i, sample by sample, so that what an unfinished study has are whole samples."""
    n, d = a.shape
    values = np.repeat(a[:, np.newaxis], d + 2, axis=1)  # (N, 2 + d, d)
    values[:, 1] = b
    for i in range(d):
        values[:, 2 + i, i] = b[:, i]
    runs = np.arange(n * (d + 2)).reshape(n, d + 2)
    matrices = Matrices(runs[:, 0].copy(), runs[:, 1].copy(), runs[:, 2:].T.copy())
    return Design(parameters, values.reshape(-1, d), matrices)


def _grid(parameters: tuple[Parameter, ...]) -> Array:
    """Every combination; the last parameter changes fastest."""
    axes = [_steps(parameter) for parameter in parameters]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))


def _steps(parameter: Parameter) -> Array:
    result = parameter.distribution
    if result is None:
        return _numbers(parameter, np.arange(len(parameter.choices)))
    low, high = result.support
    assert result.count is not None
    even = np.geomspace if result.kind == "loguniform" else np.linspace
    return np.asarray(even(low, high, result.count), dtype=np.float64)


def _values(parameters: tuple[Parameter, ...], shares: Array) -> Array:
    """Inverse distribution functions of (runs, parameters) shares, column by column."""
    columns = [_column(parameter, shares[:, i]) for i, parameter in enumerate(parameters)]
    return np.stack(columns, axis=1)


def _column(parameter: Parameter, shares: Array) -> Array:
    result = parameter.distribution
    if result is None:
        entries = len(parameter.choices)
        return _numbers(parameter, np.minimum((shares * entries).astype(np.int64), entries - 1))
    if parameter.whole:
        low, high = result.support
        return np.minimum(low + np.floor(shares * (high - low + 1)), high)
    return quantile(result, shares)


def quantile(distribution: Distribution, shares: Array) -> Array:
    """The values below which the given shares of a distribution lie."""
    shares = np.clip(shares, LEAST_SHARE, 1 - LEAST_SHARE)
    values = np.asarray(frozen(distribution).ppf(shares), dtype=np.float64)
    low, high = distribution.support
    return np.clip(values, low, high)  # rounding must not lead over a limit


def frozen(distribution: Distribution) -> Any:
    """The distribution as scipy has it, cut where it is cut."""
    from scipy import stats

    low, high = distribution.support
    if distribution.kind == "uniform":
        return stats.uniform(low, high - low)
    if distribution.kind == "loguniform":
        return stats.loguniform(low, high)
    if distribution.kind == "triangular":
        mode = (low + high) / 2 if distribution.mode is None else distribution.mode
        return stats.triang((mode - low) / (high - low), low, high - low)
    assert distribution.mean is not None
    assert distribution.deviation is not None
    if distribution.kind == "normal":
        mean, deviation = distribution.mean, distribution.deviation
        return stats.truncnorm((low - mean) / deviation, (high - mean) / deviation, mean, deviation)
    return _Lognormal(distribution.mean, distribution.deviation, low, high)


class _Lognormal:
    """Lognormal distribution of which mean and deviation are given, cut to low..high."""

    def __init__(self, mean: float, deviation: float, low: float, high: float) -> None:
        from scipy import stats

        variance = log1p((deviation / mean) ** 2)
        middle, spread = np.log(mean) - variance / 2, sqrt(variance)
        with np.errstate(divide="ignore"):
            limits = (np.log([low, high]) - middle) / spread
        self._logarithm = stats.truncnorm(*limits, middle, spread)

    def ppf(self, shares: Array) -> Array:
        return np.asarray(np.exp(self._logarithm.ppf(shares)), dtype=np.float64)


def _numbers(parameter: Parameter, chosen: NDArray[np.int64]) -> Array:
    """Values of the chosen entries: their numbers, or which they are."""
    if parameter.worded:
        return chosen.astype(np.float64)
    return np.array([choice.number for choice in parameter.choices], dtype=np.float64)[chosen]
