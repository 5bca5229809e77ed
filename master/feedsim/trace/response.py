"""A frequency response: complex functions of frequency with names, units and, where measured, coherence."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """Functions over a common frequency axis.

    Attributes:
        frequency: (N,) [Hz], increasing, above 0.
        columns: name -> (N,) complex values. Names are output/input, such as "Z.n_a/Z.M_a".
        units: name -> unit, such as "(rad/s)/(N.m)".
        coherence: name -> (N,) from 0 to 1; only for what was measured.
    """

    frequency: Floats
    columns: Mapping[str, Complexes]
    units: Mapping[str, str]
    coherence: Mapping[str, Floats] = field(default_factory=dict)
