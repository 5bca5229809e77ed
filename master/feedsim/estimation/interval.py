"""Intervals of 95 %, and the one rule that says whether a value is determined.

A value is determined where half of its interval is at most half of the value: the interval is no wider than the value.
Something shows where its interval does not hold 0. Values that may be 0 in the middle of their range (``ANY_VALUE``)
are not judged: their interval says all.
"""

from __future__ import annotations

import math

NORMAL_95 = 1.959964  # standard deviations on either side that hold 95 % of a normal distribution
MAX_RELATIVE_HALF = 0.5  # half of the interval of a value that is determined, over the value
# Loads, delays and differences of both directions have no scale of their own to which an interval could be compared.
ANY_VALUE = frozenset({"M_0", "asymmetry", "skew", "delay", "k_ffw", "T_sym", "T_dyn"})


def half_width(sigma: float) -> float:
    """Half of the interval of 95 % of a value with that standard deviation, in its unit."""
    return NORMAL_95 * sigma


def determined(value: float, half: float) -> bool:
    """Whether half of the interval is at most that share of the value; a value without an interval (NaN) is.

    >>> determined(2.0, 0.9), determined(-2.0, 1.1), determined(2.0, math.nan)
    (True, False, True)
    """
    return not half > MAX_RELATIVE_HALF * abs(value)


def shows(value: float, half: float) -> bool:
    """Whether the interval does not hold 0: what the value stands for is there. Without an interval (NaN) it is.

    >>> shows(-2.0, 1.9), shows(2.0, 2.1), shows(2.0, math.nan)
    (True, False, True)
    """
    return not half >= abs(value)


def reason(value: float, half: float, of: str = "") -> str:
    """The sentence that says so of a value that is not determined; of: whose interval, where the value is a part.

    >>> reason(2.0, 2.7)
    'its 95 % interval is +-135 % of the value'
    >>> reason(0.1, 0.28, "F_S - F_C")
    'the 95 % interval of F_S - F_C is +-280 % of the value'
    """
    whose = f"the 95 % interval of {of}" if of else "its 95 % interval"
    return f"{whose} is +-{100 * half / max(abs(value), 1e-300):.0f} % of the value"


def student(free: float) -> float:
    """Quantile 0.975 of Student's distribution of so many degrees of freedom, to 2e-7 of its value.

    Many: M. Abramowitz, I. A. Stegun, Handbook of Mathematical Functions, 1964, 26.7.5. Few: SciPy, whose special
    functions take a fiftieth of a run to load.
    """
    if free < 20:
        from scipy.special import stdtrit

        return float(stdtrit(free, 0.975))
    z = 1.959963984540054  # of the normal distribution
    series = (
        z,
        (z**3 + z) / 4,
        (5 * z**5 + 16 * z**3 + 3 * z) / 96,
        (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384,
        (79 * z**9 + 776 * z**7 + 1482 * z**5 - 1920 * z**3 - 945 * z) / 92160,
    )
    return math.fsum(term / free**k for k, term in enumerate(series))


def pair_quantile(free: float) -> float:
    """Radius, in standard deviations, of the circle that holds 95 % of two values of one accuracy with so many degrees
    of freedom: sqrt(2 F), F the quantile 0.95 of Fisher's distribution of 2 and ``free``, which has a closed form.

    >>> round(pair_quantile(10), 4), round(pair_quantile(1e9), 4)
    (2.8645, 2.4477)
    """
    return math.sqrt(free * math.expm1(math.log(20) * 2 / free))
