"""Intervals of what draws give: without a distribution, by their order.

A further draw lies with a probability of (N + 1 - 2 k)/(N + 1) between the k-th smallest and the k-th largest of N
draws, whatever the distribution (S. S. Wilks, Ann. Math. Stat. 12 (1941) 91-96). N = 39 hold 95 % between the least and
the largest; more draws hold the same share more evenly.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from feedsim.arguments import spelt
from feedsim.errors import InputError

Array = NDArray[np.float64]
BAND_PROBABILITY = 0.95
MIN_DRAWS = 19  # draws: they hold 90 %


def check_count(count: int) -> None:
    """InputError: too few draws for an interval."""
    if count < MIN_DRAWS:
        raise InputError(
            f"{spelt('uncertain')} {count}: at least {MIN_DRAWS} draws are needed; {MIN_DRAWS} hold 90 % of what may "
            "be, 39 and more hold 95 %"
        )


def share_of(count: int) -> float:
    """Share of further draws that an interval of `count` draws holds, on average.

    >>> share_of(19), share_of(200)
    (0.9, 0.95)
    """
    return min(BAND_PROBABILITY, (count - 1) / (count + 1))


def interval(values: Array) -> tuple[Array, Array]:
    """(...,) ends of the interval of draws (N, ...)."""
    tail = (1 - share_of(len(values))) / 2
    low, high = np.quantile(values, [tail, 1 - tail], axis=0, method="weibull")
    return np.asarray(low), np.asarray(high)
