"""Failed runs by message, and the parameters whose values show where they lie."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from math import comb, exp, lgamma

import numpy as np
from numpy.typing import NDArray

from feedsim.sweep.design import Array, Design
from feedsim.sweep.table import Table

# Chance that any parameter at all is named though the runs failed wherever they did.
LEVEL = 0.05
NUMBERS = 4  # tests of a numeric parameter: span, lower end, upper end, tendency
FEW_LEVELS = 12  # distinct values up to which a parameter is looked at level by level

Rows = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Where:
    """A parameter whose values separate failed runs from those that are done.

    Attributes:
        parameter: its place in the design.
        values: of the failed runs: those that occur, where `by_level`; else the least and the greatest.
        failed, there: how many of the runs with these values, or between them, failed so, and how many there are.
        medians: of the failed and of the done runs, where the range does not show the tendency; else None.
    """

    parameter: int
    by_level: bool
    values: Array
    failed: int
    there: int
    medians: tuple[float, float] | None = None


@dataclass(frozen=True)
class Failure:
    """Runs that failed alike: an example of their message, their numbers, and where they lie, the surest first."""

    message: str
    runs: tuple[int, ...]
    where: tuple[Where, ...]


def failures(table: Table, design: Design) -> tuple[Failure, ...]:
    """Failed runs by message, numbers in it aside; the most frequent first."""
    runs = np.asarray(table["run"], dtype=np.int64)
    messages = [str(text) for text in table["message"]]
    groups: dict[str, list[int]] = {}
    for row in np.flatnonzero(~table.ok):
        groups.setdefault(shape(messages[row]), []).append(int(row))
    result = []
    for rows in sorted(groups.values(), key=lambda rows: (-len(rows), rows[0])):
        here = np.zeros(len(runs), dtype=bool)
        here[rows] = True
        numbers = tuple(int(run) for run in runs[rows])
        result.append(Failure(messages[rows[0]], numbers, _where(design, runs, here, table.ok)))
    return tuple(result)


def shape(message: str) -> str:
    """A message without its numbers: what is the same for runs that fail alike."""
    return re.sub(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?", "#", message)


def kinds(messages: Iterable[str]) -> dict[str, tuple[str, int]]:
    """Messages that differ in numbers only as one: its first example and how often it comes."""
    result: dict[str, tuple[str, int]] = {}
    for text in messages:
        first, count = result.get(shape(text), (text, 0))
        result[shape(text)] = first, count + 1
    return result


def levels(values: Array, *, worded: bool = False) -> Array:
    """Distinct values of a parameter where they are few and come back, or where they are words; else none."""
    result = np.unique(values)
    few = len(result) <= FEW_LEVELS and 2 * len(result) <= len(values)
    return result if worded or few else result[:0]


def _where(design: Design, runs: NDArray[np.int64], here: Rows, ok: Rows) -> tuple[Where, ...]:
    """The parameters whose values separate the rows `here` from those that are `ok` by more than chance.

    Other failures stay out: what they differ in would be laid at the door of these. Bonferroni's correction for the
    number of parameters and tests.
    """
    drawn = np.isin(runs, design.independent)
    reported: list[tuple[float, str, Where]] = []
    for place, parameter in enumerate(design.parameters):
        values = design.values[runs, place]
        if parameter.worded or len(levels(values)):
            chance = _level_chance(values[drawn], here[drawn], ok[drawn])
            where = _at_levels(place, values, here)
        else:
            chance = _chance(values, here, ok)
            where = _in_range(place, values, here, ok)
        if chance <= LEVEL / len(design.parameters):
            reported.append((chance, parameter.name, where))
    return tuple(value for *_, value in sorted(reported, key=lambda entry: entry[:2]))


def _at_levels(place: int, values: Array, here: Rows) -> Where:
    met = np.unique(values[here])
    return Where(place, True, met, int(here.sum()), int(np.isin(values, met).sum()))


def _in_range(place: int, values: Array, here: Rows, ok: Rows) -> Where:
    low, high = values[here].min(), values[here].max()
    failed, there = int(here.sum()), int(((values >= low) & (values <= high)).sum())
    tendency = 2 * failed < there and ok.any()
    medians = (float(np.median(values[here])), float(np.median(values[ok]))) if tendency else None
    return Where(place, False, np.array([low, high]), failed, there, medians)


def _chance(values: Array, here: Rows, ok: Rows) -> float:
    """Chance that values drawn alike lie as close together, as far to one side, or as much to one side."""
    from scipy.stats import mannwhitneyu

    # Rows of a Sobol design repeat values, which would count as so many independent ones.
    failed = np.unique(values[here])
    passed = np.setdiff1d(values[ok], failed)
    m, n = len(failed), len(failed) + len(passed)
    if m < 2 or m == n:
        return 1.0
    low, high = int((passed < failed[0]).sum()), int((passed > failed[-1]).sum())
    result = (
        span_chance(m, n, n - low - high),
        end_chance(m, n, low),
        end_chance(m, n, high),
        float(mannwhitneyu(failed, passed).pvalue),
    )
    return NUMBERS * min(result)


def span_chance(m: int, n: int, span: int) -> float:
    """Chance that m of n ranks, drawn without replacement, lie within `span` neighbouring ones."""
    # The smallest can stand in n - s + 1 places where they span s; the m - 2 between them are any of s - 2.
    from scipy.special import gammaln

    s = np.arange(m, span + 1)
    ways = gammaln(s - 1) - gammaln(m - 1) - gammaln(s - m + 1)
    return float(np.sum((n - s + 1) * np.exp(ways - _log_choose(n, m))))


def end_chance(m: int, n: int, beyond: int) -> float:
    """Chance that m of n ranks, drawn without replacement, leave the first `beyond` free."""
    return exp(_log_choose(n - beyond, m) - _log_choose(n, m))


def _log_choose(n: int, k: int) -> float:
    return lgamma(n + 1) - lgamma(k + 1) - lgamma(n - k + 1)


def _level_chance(values: Array, here: Rows, ok: Rows) -> float:
    """Chance that all failures meet as few of the values as they do, whichever these are."""
    failed, passed = values[here], values[ok]
    m, n = len(failed), len(failed) + len(passed)
    if not m or m == n:
        return 1.0
    met = np.unique(failed)
    everywhere = np.unique(np.concatenate([failed, passed]))
    inside = m + int(np.isin(passed, met).sum())
    return comb(len(everywhere), len(met)) * exp(_log_choose(inside, m) - _log_choose(n, m))
