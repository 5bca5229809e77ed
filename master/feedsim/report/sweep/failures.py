"""Failed runs by message, and the parameters that tell where they lie."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import comb, exp, lgamma
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from feedsim.report.formatting import number
from feedsim.report.style import Array

if TYPE_CHECKING:
    from feedsim.report.sweep.account import Account, Input

# Chance that any parameter at all is named though the runs failed wherever they did.
LEVEL = 0.05
NUMBERS = 4  # tests of a numeric parameter: span, lower end, upper end, tendency


@dataclass(frozen=True)
class Failure:
    """Runs that failed alike: an example of their message, their numbers, and where they lie."""

    message: str
    runs: tuple[int, ...]
    where: str


def failures(account: Account) -> tuple[Failure, ...]:
    """Failed runs by message, numbers in it aside; the most frequent first."""
    groups: dict[str, list[int]] = {}
    for row in np.flatnonzero(~account.ok):
        groups.setdefault(shape(str(account.table["message"][row])), []).append(int(row))
    ordered = sorted(groups.values(), key=lambda rows: (-len(rows), rows[0]))
    messages = account.table["message"]
    return tuple(
        Failure(str(messages[rows[0]]), tuple(int(run) for run in account.runs[rows]), _where(account, rows))
        for rows in ordered
    )


def shape(message: str) -> str:
    """A message without its numbers: what is the same for runs that fail alike."""
    return re.sub(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?", "#", message)


def _where(account: Account, rows: Sequence[int]) -> str:
    """The parameters whose values tell these rows from those that are done by more than chance.

    Other failures stay out: what they differ in would be laid at the door of these. Bonferroni's correction for the
    number of parameters and tests.
    """
    here = np.zeros(len(account.runs), dtype=bool)
    here[rows] = True
    told = []
    for each in account.inputs:
        by_level = bool(each.words or len(each.levels))
        chance = (_level_chance if by_level else _chance)(each, here, account.ok)
        if chance <= LEVEL / len(account.inputs):
            told.append((chance, _levels(each, here) if by_level else _range(each, here, account.ok)))
    return "; ".join(text for _, text in sorted(told))


def _chance(each: Input, here: NDArray[np.bool_], ok: NDArray[np.bool_]) -> float:
    """Chance that values drawn alike lie as close together, as far to one side, or as much to one side."""
    from scipy.stats import mannwhitneyu

    # Rows of a Sobol design repeat values, which would count as so many independent ones.
    failed = np.unique(each.values[here])
    passed = np.setdiff1d(each.values[ok], failed)
    m, n = len(failed), len(failed) + len(passed)
    if m < 2 or m == n:
        return 1.0
    low, high = int((passed < failed[0]).sum()), int((passed > failed[-1]).sum())
    found = (
        span_chance(m, n, n - low - high),
        end_chance(m, n, low),
        end_chance(m, n, high),
        float(mannwhitneyu(failed, passed).pvalue),
    )
    return NUMBERS * min(found)


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


def _level_chance(each: Input, here: NDArray[np.bool_], ok: NDArray[np.bool_]) -> float:
    """Chance that all failures meet as few of the values as they do, whichever these are."""
    rows = np.zeros(len(here), dtype=bool)
    rows[each.drawn] = True
    failed, passed = each.values[here & rows], each.values[ok & rows]
    m, n = len(failed), len(failed) + len(passed)
    if not m or m == n:
        return 1.0
    levels = np.unique(failed)
    all_levels = np.unique(np.concatenate([failed, passed]))
    inside = m + int(np.isin(passed, levels).sum())
    return comb(len(all_levels), len(levels)) * exp(_log_choose(inside, m) - _log_choose(n, m))


def _levels(each: Input, here: NDArray[np.bool_]) -> str:
    levels = np.unique(each.values[here])
    text = f"{each.name} {', '.join(each.text(value) for value in levels)} {each.scale.shown_unit}".rstrip()
    return text + _purity(int(here.sum()), int(np.isin(each.values, levels).sum()))


def _range(each: Input, here: NDArray[np.bool_], ok: NDArray[np.bool_]) -> str:
    values = each.values[here]
    low, high = values.min(), values.max()
    text = f"{each.name} {each.text(low)} to {each.text(high)} {each.scale.shown_unit}".rstrip()
    inside = (each.values >= low) & (each.values <= high)
    text += _purity(int(here.sum()), int(inside.sum()))
    if 2 * here.sum() < inside.sum() and ok.any():  # a tendency: the range does not tell it
        text += f", median {_median(values)}, where runs are done {_median(each.values[ok])}"
    return text


def _purity(failed: int, there: int) -> str:
    return f" ({failed} of {there} runs there)"


def _median(values: Array) -> str:
    return number(float(np.median(values)))


def kinds(messages: Iterable[str]) -> dict[str, tuple[str, int]]:
    """Messages that differ in numbers only as one: its first example and how often it comes."""
    found: dict[str, tuple[str, int]] = {}
    for text in messages:
        first, count = found.get(shape(text), (text, 0))
        found[shape(text)] = first, count + 1
    return found
