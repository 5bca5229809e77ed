"""How a cost grows: a line a + b n where something stays and something grows, an exponent where all of it grows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Line:
    """y = constant + each * x.

    Attributes:
        off: largest deviation of a point from the line, a share of the point.
    """

    constant: float
    each: float
    off: float

    @classmethod
    def through(cls, x: Sequence[float], y: Sequence[float]) -> Line:
        """Least squares of the deviations' shares of y: what is large does not drown what is small.

        Noise is a share of the time measured, too. Two points give the line through them.
        """
        n, cost = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
        if len(n) < 2 or not (cost > 0).all():
            raise ValueError(f"a line needs two points at least, of costs above 0; given: {y}")
        each, constant = np.polyfit(n, cost, 1, w=1 / cost)
        return cls(float(constant), float(each), float(np.abs((constant + each * n) / cost - 1).max()))


def exponent(x: Sequence[float], y: Sequence[float]) -> float:
    """Exponent of y as a power of x, by least squares of the logarithms."""
    return float(np.polyfit(np.log(np.asarray(x)), np.log(np.asarray(y)), 1)[0])
