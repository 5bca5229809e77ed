"""Which numbers a distribution, a range or a grid needs, and what is wrong with those that are given."""

from __future__ import annotations

from collections.abc import Mapping
from math import erfc, inf, log, log1p, sqrt

from feedsim.files.source import Place
from feedsim.scenario.study.file import Kind, ParameterEntry
from feedsim.scenario.study.study import Distribution

# Kind -> what it needs, what it may have.
NEEDS: dict[Kind, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "uniform": (("from", "to"), ()),
    "loguniform": (("from", "to"), ()),
    "triangular": (("from", "to"), ("mode",)),
    "normal": (("mean", "deviation"), ("from", "to")),
    "lognormal": (("mean", "deviation"), ("from", "to")),
}
# Deviations from the mean beyond which nothing is left: doubles cannot represent the tail's probability any more.
FARTHEST = 8.0

Problem = tuple[Place, str]


def numbers(
    entry: ParameterEntry, values: Mapping[str, float], grid: bool, whole: bool
) -> tuple[Distribution | None, list[Problem]]:
    """The distribution, or what is wrong: the key of the entry and a message.

    values: SI values of the entry's numbers, by key. grid, whole: the kind of study and of key that they are for.
    """
    if entry.distribution is None and not values:
        what = "values, or from, to and count" if grid else "values, or a distribution, or from and to"
        return None, [((), f"nothing is said of its values: {what}")]
    kind: Kind = entry.distribution or ("uniform" if not {"mean", "deviation"} & set(values) else "normal")
    needed, optional = NEEDS[kind]
    problems: list[Problem] = [((), f"{kind}: missing key {key!r}") for key in needed if key not in values]
    problems += [
        ((key,), f"not of a {kind} distribution: it has {', '.join((*needed, *optional))}")
        for key in values
        if key not in needed and key not in optional
    ]
    problems += [*_for_the_study(kind, entry.count, grid, whole)]
    if problems:
        return None, problems
    count = entry.count
    if grid and whole and count is None:
        count = max(2, round(values["to"] - values["from"]) + 1)
    result = Distribution(
        kind, values.get("from"), values.get("to"), values.get("mean"), values.get("deviation"), values.get("mode"),
        count,
    )  # fmt: skip
    problems = _contradictions(result)
    if whole and not problems:
        problems = _not_whole(result)
    return (None, problems) if problems else (result, [])


def _for_the_study(kind: Kind, count: int | None, grid: bool, whole: bool) -> list[Problem]:
    if whole and kind != "uniform":
        return [(("distribution",), "of whole numbers only uniform")]
    if not grid:
        return [(("count",), "only in a grid; elsewhere sampling.runs says how many")] if count else []
    if kind not in ("uniform", "loguniform"):
        return [(("distribution",), "in a grid: uniform (even steps) or loguniform (even ratios), or values: [...]")]
    if count is None and not whole:
        return [((), "missing key 'count': how many values a grid takes from from to to")]
    if count == 1:
        return [(("count",), "1 value between two limits; at least 2, or values: [...]")]
    return []


def _contradictions(distribution: Distribution) -> list[Problem]:
    low, high, mean, deviation = distribution.low, distribution.high, distribution.mean, distribution.deviation
    problems: list[Problem] = []
    if low is not None and high is not None and not low < high:
        problems.append((("to",), f"{high:.9g} is not more than from, {low:.9g} (in SI)"))
    elif (
        low is not None
        and low <= 0
        and (distribution.kind == "loguniform" or (distribution.kind == "lognormal" and low < 0))
    ):
        least = "more than" if distribution.kind == "loguniform" else "at least"
        problems.append((("from",), f"{low:.9g}; of a {distribution.kind} distribution {least} 0"))
    elif (
        distribution.mode is not None and low is not None and high is not None and not low <= distribution.mode <= high
    ):
        problems.append((("mode",), f"{distribution.mode:.9g} is not between from and to (in SI)"))
    if mean is None or deviation is None:
        return problems
    if deviation <= 0:
        problems.append((("deviation",), f"{deviation:.9g} is outside the allowed range: more than 0"))
    elif distribution.kind == "lognormal" and mean <= 0:
        problems.append((("mean",), f"{mean:.9g}; that of a lognormal distribution is more than 0"))
    elif low is not None and low > mean + FARTHEST * deviation:
        problems.append((("from",), "more than 8 deviations above the mean: nothing is left of the distribution"))
    elif high is not None and high < mean - FARTHEST * deviation:
        problems.append((("to",), "more than 8 deviations below the mean: nothing is left of the distribution"))
    elif distribution.kind == "lognormal" and high is not None and high <= 0:
        problems.append((("to",), "nothing is left of the distribution: a lognormal one is above 0"))
    return problems


def _not_whole(distribution: Distribution) -> list[Problem]:
    assert distribution.low is not None
    assert distribution.high is not None
    for key, value in (("from", distribution.low), ("to", distribution.high)):
        if not value.is_integer():
            return [((key,), f"{value:.9g} is no whole number")]
    if distribution.count is not None and (distribution.high - distribution.low) % (distribution.count - 1):
        between = f"{distribution.low:.0f} to {distribution.high:.0f}"
        return [(("count",), f"{distribution.count} even steps from {between} are no whole numbers")]
    return []


def outside(distribution: Distribution, low: float, high: float) -> float:
    """Probability that a normal or lognormal distribution, as it is cut, is below `low` or above `high`.

    0 for distributions of other kinds: their limits themselves are checked.
    """
    if distribution.mean is None or distribution.deviation is None:
        return 0.0
    lognormal = distribution.kind == "lognormal"
    deviation = sqrt(log1p((distribution.deviation / distribution.mean) ** 2)) if lognormal else distribution.deviation
    mean = log(distribution.mean) - deviation**2 / 2 if lognormal else distribution.mean

    def distance(value: float) -> float:
        """From the mean, in deviations times the root of two."""
        if lognormal:
            value = log(value) if value > 0 else -inf
        return (value - mean) / (deviation * sqrt(2))

    def below(value: float) -> float:
        return erfc(-distance(value)) / 2

    def above(value: float) -> float:
        return erfc(distance(value)) / 2

    least, most = distribution.support
    all_of_it = 1 - below(least) - above(most)
    out = max(0.0, below(low) - below(least)) + max(0.0, above(high) - above(most))
    return min(1.0, out / all_of_it) if all_of_it > 0 else 0.0
