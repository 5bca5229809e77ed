"""What the report on a study shows: parameters and figures in people's units, failures by message, sensitivities.

The measure of sensitivity is the one that the runs allow: Sobol indices, shares of a grid, or rank correlations.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from feedsim.design.sweep.sensitivity import CONFIDENCE, Indices, Sensitivities, Trends, sensitivities
from feedsim.design.sweep.table import Failure, SeparatingParameter, failures, in_one_line, kinds, levels
from feedsim.foundation.errors import Finding
from feedsim.report.formatting import Array, Scale, number, scale
from feedsim.report.provenance import InputFile, finite, hash_files, inputs_part

if TYPE_CHECKING:
    from feedsim.design.sweep.design import Design
    from feedsim.design.sweep.table import Table
    from feedsim.scenario.study import Parameter, Study


QUANTILES = (5, 50, 95)
TOTAL = "total Sobol index"
SHARE_HEADING = "share of the scatter"
RANK = "rank correlation"
CAPTIONS = {
    TOTAL: "Total Sobol index: the share of a figure's scatter that stays when everything but this parameter is known. "
    "Bold: its 95 % interval keeps clear of 0.02. Empty: below 0.005.",
    SHARE_HEADING: "Share of a figure's scatter over the grid that lies between the values of this parameter, the "
    "others taken together; what is missing to 1 are joint effects.",
    RANK: "Spearman's rank correlation: +1 where a figure always rises with the parameter (blue), −1 where it always "
    "falls (vermillion). Bold: more than chance gives in one case of twenty. A figure with its minimum in the middle "
    "of a parameter's range shows 0; words cannot be ranked and stay empty.",
}
MIN_INDEX_RUNS = 4
ZERO_SHARE = 0.005  # share below which two digits say 0.00
NEGLIGIBLE_INDEX = 0.02  # a total index below which a parameter may be held where it is


@dataclass(frozen=True, eq=False, kw_only=True)
class Column:
    """A column of the table (rows,) in people's units; drawn: rows that statistics and pictures are of."""

    name: str
    scale: Scale
    values: Array
    drawn: NDArray[np.int64]

    @property
    def sample(self) -> Array:
        """The values that are drawn."""
        return self.values[self.drawn]

    @property
    def label(self) -> str:
        """Name with unit."""
        unit = self.scale.shown_unit
        return f"{self.name} [{unit}]" if unit else self.name


@dataclass(frozen=True, eq=False, kw_only=True)
class Input(Column):
    """A parameter; where it is a choice of words, its values are their numbers."""

    parameter: Parameter
    words: tuple[str, ...]  # empty for numbers

    @cached_property
    def levels(self) -> Array:
        """Its distinct values where they are few and come back, else none."""
        return levels(self.values, worded=bool(self.words))

    @property
    def logarithmic(self) -> bool:
        """Whether its values spread over orders of magnitude."""
        law = self.parameter.distribution
        spread = self.values.min() > 0 and self.values.max() > 5 * self.values.min()
        return bool(not self.words and spread and law is not None and law.kind in ("loguniform", "lognormal"))

    def text(self, value: float) -> str:
        """A value as it is shown, without unit."""
        return self.words[int(value)] if self.words else number(value)


@dataclass(frozen=True, eq=False, kw_only=True)
class Output(Column):
    """A figure, NaN where a run has none, and what it comes to.

    nominal: value of the scenario without changes, NaN where it is not known.
    """

    nominal: float = np.nan

    @cached_property
    def known(self) -> Array:
        """Those of the sample that there are."""
        return self.sample[np.isfinite(self.sample)]

    @cached_property
    def statistics(self) -> Mapping[str, float]:
        """mean, standard deviation (n - 1), quantiles, smallest and largest; NaN without values."""
        known = self.known
        if not len(known):
            return dict.fromkeys(("mean", "std", "q5", "q50", "q95", "min", "max"), np.nan)
        quantiles = np.percentile(known, QUANTILES)
        return {
            "mean": float(known.mean()),
            "std": float(known.std(ddof=1)) if len(known) > 1 else np.nan,
            **{f"q{share}": float(value) for share, value in zip(QUANTILES, quantiles, strict=True)},
            "min": float(known.min()),
            "max": float(known.max()),
        }

    @cached_property
    def quantile_intervals(self) -> Mapping[str, tuple[float, float]]:
        """95 % intervals of the quantiles, whatever the distribution: between two of the sorted values. NaN where the
        runs are too few for one.
        """
        known = np.sort(self.known)
        return {f"q{share}": quantile_interval(known, share / 100) for share in QUANTILES}


class Account:
    """A study with its table, ready to be shown. record: how the runs were made, as study.json holds it."""

    def __init__(self, table: Table, study: Study, design: Design, record: Mapping[str, Any] | None = None) -> None:
        self.table, self.study, self.design = table, study, design
        self.record: Mapping[str, Any] = {**table.provenance, **(record or {})}
        self.runs: NDArray[np.int64] = np.asarray(table["run"], dtype=np.int64)
        self.ok: NDArray[np.bool_] = np.asarray(table.ok, dtype=bool)

    @cached_property
    def drawn(self) -> NDArray[np.int64]:
        """Rows of runs that are independent."""
        return np.flatnonzero(np.isin(self.runs, self.design.independent))

    @cached_property
    def inputs(self) -> tuple[Input, ...]:
        """The parameters, with a value for every row of the table."""
        result = []
        for column, parameter in zip(self.design.values.T, self.study.parameters, strict=True):
            values = column[self.runs]
            words = tuple(choice.label for choice in parameter.choices) if parameter.worded else ()
            unit = Scale(1.0, "") if words else scale(parameter.unit, values)
            column = values * unit.factor
            result.append(
                Input(
                    name=parameter.name, scale=unit, values=column, drawn=self.drawn, parameter=parameter, words=words
                )
            )
        return tuple(result)

    @cached_property
    def outputs(self) -> tuple[Output, ...]:
        """The figures, in the order of the table."""
        result = []
        for name in self.table.figures:
            values = np.asarray(self.table[name], dtype=np.float64)
            unit = scale(self.table.unit(name), values)
            nominal = self._nominal(name) * unit.factor
            result.append(Output(name=name, scale=unit, values=values * unit.factor, drawn=self.drawn, nominal=nominal))
        return tuple(result)

    def _nominal(self, name: str) -> float:
        known = self.record.get("nominal")
        value = known.get(name) if isinstance(known, Mapping) else None
        return float(value) if isinstance(value, int | float) else np.nan

    @cached_property
    def sensitivities(self) -> Sensitivities:
        """What moves the figures."""
        return sensitivities(self.table, self.design, self.study.sampling.seed or 0)

    @property
    def failed(self) -> int:
        """Number of rows without figures."""
        return int((~self.ok).sum())

    @property
    def busy(self) -> float:
        """Time that the runs took, one after the other [s]."""
        return float(np.nansum(np.asarray(self.table["seconds"], dtype=np.float64)))

    @property
    def wall_time(self) -> float | None:
        """Time from the beginning to the end of all runs [s]; None where they were made in several goes."""
        begun, ended = self.record.get("began"), self.record.get("ended")
        if self.record.get("resumed", 0) != 0 or not isinstance(begun, str) or not isinstance(ended, str):
            return None
        seconds = (datetime.fromisoformat(ended) - datetime.fromisoformat(begun)).total_seconds()
        return seconds if seconds > 0 else None

    @property
    def processes(self) -> int | None:
        """Number of processes that made the runs; None where it is not known."""
        reported = self.record.get("processes")
        return reported if isinstance(reported, int) and reported > 0 else None

    @property
    def efficiency(self) -> float | None:
        """Share of the processes' time that went into runs, where it is known."""
        known = self.wall_time is not None and self.processes is not None
        return self.busy / (self.processes * self.wall_time) if known else None  # type: ignore[operator]

    @cached_property
    def warnings(self) -> tuple[Finding, ...]:
        """Of the study, of the runs (with their number), and of what the statistics leave out."""
        result = [*self.study.warnings, *(Finding(**entry) for entry in self.record.get("findings", ()))]
        if self.table.partial:
            text = f"The study is not finished: {len(self.table)} of {self.design.runs} runs are done."
            result.append(Finding("study-not-finished", "doubt", text))
        if self.failed:
            text = f"{self.failed} of {len(self.table)} runs failed and have no figures; statistics are of the others."
            result.append(Finding("runs-failed", "doubt", text))
        for output in self.outputs:
            missing = int((self.ok & ~np.isfinite(output.values)).sum())
            if missing:
                text = f"{output.name} could not be determined in {missing} of {int(self.ok.sum())} runs."
                result.append(Finding("figure-not-determined", "doubt", text, output.name))
        for findings, count in kinds(self.table):
            gravest, *others = findings
            wrong = gravest.severity == "wrong"
            example = in_one_line([gravest.text, *(finding.marked for finding in others)])
            text = f"{count} of {len(self.table)} runs{'' if wrong else ' warn'}: {example}"
            result.append(replace(gravest, severity="wrong" if wrong else "doubt", text=text))
        return tuple(dict.fromkeys([*result, *self.sensitivities.warnings]))

    @cached_property
    def best(self) -> tuple[Output, int] | None:
        """The figure that the study's goal names, and the row with its best value; None where no run has one."""
        if self.study.goal is None:
            return None
        way, name = self.study.goal
        output = next((output for output in self.outputs if output.name == name), None)
        if output is None or not np.isfinite(output.values).any():
            return None
        return output, int((np.nanargmin if way == "smallest" else np.nanargmax)(output.values))

    @cached_property
    def failures(self) -> tuple[Failure, ...]:
        """Failed runs by message, the most frequent first."""
        return failures(self.table, self.design)

    def where(self, failure: Failure) -> str:
        """Where runs that failed alike lie; empty where no parameter shows."""
        return "; ".join(map(self._place, failure.where))

    def _place(self, where: SeparatingParameter) -> str:
        entry = self.inputs[where.parameter]
        shown = (", " if where.by_level else " to ").join(entry.text(entry.scale.factor * v) for v in where.values)
        text = f"{entry.name} {shown} {entry.scale.shown_unit}".rstrip()
        text += f" ({where.failed} of {where.there} runs there)"
        if where.medians is not None:
            failed, done = (number(entry.scale.factor * value) for value in where.medians)
            text += f", median {failed}, where runs are done {done}"
        return text


def quantile_interval(ordered: Array, share: float) -> tuple[float, float]:
    """95 % interval of the quantile at `share` from sorted independent values; NaN where there are too few.

    The number of values below the quantile is binomial, so two of the values enclose it with a known probability
    (H. A. David, H. N. Nagaraja, Order Statistics, 2003, section 7.1).
    """
    from scipy.stats import binom

    n = len(ordered)
    if not n:
        return np.nan, np.nan
    low = int(binom.ppf(0.025, n, share))  # P(fewer than `low` values below) <= 2.5 %
    high = int(binom.ppf(0.975, n, share)) + 1
    if low < 1 or high > n:
        return np.nan, np.nan
    return float(ordered[low - 1]), float(ordered[high - 1])


@dataclass(frozen=True, eq=False)
class Measure:
    """One figure's sensitivities: the kind, (d,) values, (d, 2) intervals where there are any.

    first, first_interval: of Sobol indices. noise: of rank correlations.
    """

    figure: str
    kind: str
    values: Array
    interval: Array | None = None
    first: Array | None = None
    first_interval: Array | None = None
    noise: float = 0.0

    @property
    def known(self) -> bool:
        """Whether there is anything to show."""
        return bool(np.isfinite(self.values).any())

    @property
    def caption(self) -> str:
        """What the numbers mean."""
        return CAPTIONS[self.kind]

    def size(self, k: int) -> float:
        """Magnitude for parameter k, 0 where there is none."""
        return float(np.nan_to_num(abs(self.values[k])))

    def significant(self, k: int) -> bool:
        """Whether the value of parameter k is beyond chance."""
        if self.interval is not None:
            return bool(self.interval[k, 0] > NEGLIGIBLE_INDEX)
        return bool(abs(self.values[k]) > self.noise) if self.kind == RANK else False

    def ranked(self) -> list[int]:
        """Parameters, the strongest first."""
        return sorted(range(len(self.values)), key=lambda k: (-self.size(k), k))

    def notable_parameters(self) -> list[int]:
        """The same without those that do nothing, but MIN_INDEX_RUNS of them at least; none where nothing is known."""
        if not self.known:
            return []
        ranked = self.ranked()
        if self.kind == RANK:  # 0 may hide a minimum in the middle
            return ranked
        return [k for place, k in enumerate(ranked) if place < MIN_INDEX_RUNS or self.size(k) >= ZERO_SHARE]


def measures(account: Account) -> Mapping[str, Measure]:
    """Measure of every figure; where too many runs failed for Sobol indices, rank correlations stand in."""
    results = account.sensitivities
    grid = account.study.sampling.method == "grid"
    result: dict[str, Measure] = {}
    for name, trend in results.trends.items():
        sobol = results.sobol.get(name)
        if sobol is not None and not sobol.reason:
            result[name] = Measure(name, TOTAL, sobol.total, sobol.total_interval, sobol.first, sobol.first_interval)
        elif grid:
            result[name] = Measure(name, SHARE_HEADING, trend.share)
        else:
            result[name] = Measure(name, RANK, trend.rank_correlation, noise=trend.noise)
    return result


# --- summary.json of a study: statistics of every figure, sensitivities, failures -------------------------------------


FORMAT = 1


def study_files(account: Account) -> list[InputFile]:
    """Study file, scenario and machine files, data files."""
    study, scenario = account.study, account.study.base.scenario
    named = [("study", study.file)]
    named += [(place or "scenario", path) for place, path in scenario.files]
    named += [("data", path) for path in study.files]
    return hash_files(named)


def details(account: Account) -> dict[str, Any]:
    """What summary.json has besides the figures; null: not determined. Values are SI, as in the table."""
    study, scenario, result = account.study, account.study.base.scenario, account.sensitivities
    return {
        "format": FORMAT,
        "study": {
            "name": study.name,
            "file": study.file.name,
            "note": study.note,
            "method": study.sampling.method,
            "seed": study.sampling.seed,
            "overrides": list(study.overrides),
        },
        "scenario": {"name": scenario.name, "file": scenario.file.name, "note": scenario.note},
        "machine": {"name": scenario.machine.name, "note": scenario.machine.note},
        "runs": {"asked": account.design.runs, "done": len(account.table), "failed": account.failed},
        "parameters": {
            entry.name: {"keys": list(entry.parameter.keys), "unit": entry.parameter.unit, "words": list(entry.words)}
            for entry in account.inputs
        },
        "figures": {
            output.name: {
                "unit": account.table.unit(output.name),
                "runs": len(output.known),
                "missing": int((account.ok & ~np.isfinite(output.values)).sum()),
                "nominal": finite(output.nominal / output.scale.factor),
                **{key: finite(value / output.scale.factor) for key, value in output.statistics.items()},
                **{
                    f"{key}_interval": _interval(np.asarray(ends) / output.scale.factor)
                    for key, ends in output.quantile_intervals.items()
                },
            }
            for output in account.outputs
        },
        "sobol_indices": {name: _indices(result.parameters, indices) for name, indices in result.sobol.items()},
        "trends": {name: _trends(result.parameters, trend) for name, trend in result.trends.items()},
        "failures": [
            {
                "message": failure.message,
                "count": len(failure.runs),
                "runs": list(failure.runs),
                "where": account.where(failure),
            }
            for failure in account.failures
        ],
        "inputs": inputs_part(study_files(account)),
        "performance": {
            "busy": {"value": account.busy, "unit": "s"},
            "wall_time": {"value": account.wall_time, "unit": "s"},
            "processes": account.processes,
            "efficiency": account.efficiency,
        },
    }


def _indices(names: Sequence[str], indices: Indices) -> dict[str, Any]:
    return {
        "reason": indices.reason,
        "points": indices.used,
        "left_out": indices.left_out,
        "confidence": CONFIDENCE,
        "parameters": {
            name: {
                "first": finite(indices.first[k]),
                "first_interval": _interval(indices.first_interval[k]),
                "total": finite(indices.total[k]),
                "total_interval": _interval(indices.total_interval[k]),
            }
            for k, name in enumerate(names)
        },
    }


def _trends(names: Sequence[str], trends: Trends) -> dict[str, Any]:
    return {
        "reason": trends.reason,
        "runs": trends.used,
        "left_out": trends.left_out,
        "explained": finite(trends.explained),
        "noise": finite(trends.noise),
        "parameters": {
            name: {
                "rank_correlation": finite(trends.rank_correlation[k]),
                "regression": finite(trends.regression[k]),
                "share": finite(trends.share[k]),
            }
            for k, name in enumerate(names)
        },
    }


def _interval(ends: Array) -> list[float] | None:
    return [float(end) for end in ends] if all(map(math.isfinite, ends)) else None
