"""What an experiment asks of its axis: points for the interpolator, the largest values met, and its geometry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feedsim.errors import InputError
from feedsim.nc.segment import Oscillations, Strokes

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Course:
    """A motion of one axis that ends where it began.

    Attributes:
        duration: exact [s].
        points: (N,) positions relative to the start [m] at the instants T_ipo, 2 T_ipo ..., the last at or after the
            end.
        low, high: least and largest position relative to the start [m].
        speed, acceleration: largest magnitudes [m/s, m/s2].
        geometry: in program time.
    """

    duration: float
    points: Array
    low: float
    high: float
    speed: float
    acceleration: float
    geometry: Strokes | Oscillations


def check_length(cycles: int, cycle: float, most: int) -> None:
    """Raise InputError where ``cycles`` of ``cycle`` [s] are more than the ``most`` that a program has room for."""
    if cycles > most:
        raise InputError(f"lasts {cycles * cycle:.6g} s; allowed in this program: {max(most, 0) * cycle:.6g} s")
