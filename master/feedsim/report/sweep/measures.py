"""The measure of sensitivity that a study's runs allow: Sobol indices, shares of a grid, or rank correlations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from feedsim.report.style import Array
from feedsim.report.sweep.account import Account

TOTAL = "total Sobol index"
SHARE = "share of the scatter"
RANK = "rank correlation"
CAPTIONS = {
    TOTAL: "Total Sobol index: the share of a figure's scatter that stays when everything but this parameter is known. "
    "Bold: its 95 % interval keeps clear of 0.02. Empty: below 0.005.",
    SHARE: "Share of a figure's scatter over the grid that lies between the values of this parameter, the others taken "
    "together; what is missing to 1 are joint effects.",
    RANK: "Spearman's rank correlation: +1 where a figure always rises with the parameter (blue), −1 where it always "
    "falls (vermillion). Bold: more than chance gives in one case of twenty. A figure with its minimum in the middle "
    "of a parameter's range shows 0; words cannot be ranked and stay empty.",
}
LEAST = 4
NOTHING = 0.005  # share below which two digits say 0.00
CLEAR = 0.02  # a total index below which a parameter may be held where it is


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

    def told(self, k: int) -> bool:
        """Whether the value of parameter k is beyond chance."""
        if self.interval is not None:
            return bool(self.interval[k, 0] > CLEAR)
        return bool(abs(self.values[k]) > self.noise) if self.kind == RANK else False

    def ranked(self) -> list[int]:
        """Parameters, the strongest first."""
        return sorted(range(len(self.values)), key=lambda k: (-self.size(k), k))

    def telling(self) -> list[int]:
        """The same without those that do nothing, but LEAST of them at the least; none where nothing is known."""
        if not self.known:
            return []
        ranked = self.ranked()
        if self.kind == RANK:  # 0 may hide a minimum in the middle
            return ranked
        return [k for place, k in enumerate(ranked) if place < LEAST or self.size(k) >= NOTHING]


def measures(account: Account) -> Mapping[str, Measure]:
    """Measure of every figure; where too many runs failed for Sobol indices, rank correlations stand in."""
    found = account.sensitivities
    grid = account.study.sampling.method == "grid"
    result: dict[str, Measure] = {}
    for name, trend in found.trends.items():
        sobol = found.sobol.get(name)
        if sobol is not None and not sobol.reason:
            result[name] = Measure(name, TOTAL, sobol.total, sobol.total_interval, sobol.first, sobol.first_interval)
        elif grid:
            result[name] = Measure(name, SHARE, trend.share)
        else:
            result[name] = Measure(name, RANK, trend.rank_correlation, noise=trend.noise)
    return result
