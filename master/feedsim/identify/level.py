"""Friction at constant speed: the static level of Eq. 7, its viscous part, and the constant load."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def level(values: Mapping[str, float], speed: Array) -> Array:
    """(K,) static level at |speed| without asymmetry [N.m]: sigma_0 g of Eq. 7 (Wiesauer, Bleicher, CIRP CMMO 2021)."""
    size = np.abs(speed)
    stribeck = np.exp(-((size / values["v_s"]) ** values["beta"]))
    rise = values["F_log"] * np.log1p(size / values["v_log"])
    return np.asarray(values["F_C"] + (values["F_S"] - values["F_C"]) * stribeck + rise, dtype=np.float64)


def curve(values: Mapping[str, float], speed: Array) -> Array:
    """(K,) friction torque |M_fr| at |speed| [rad/s] without asymmetry [N.m]: level plus viscous part."""
    return level(values, speed) + values["sigma_2"] * np.abs(speed)


def torque(values: Mapping[str, float], speed: Array) -> Array:
    """(K,) motor torque that keeps a speed [N.m]: friction with its asymmetry, and the constant load M_0."""
    side = np.sign(speed)
    lean = 1.0 + values["asymmetry"] * side
    return np.asarray(values["M_0"] + side * lean * level(values, speed) + values["sigma_2"] * speed, dtype=np.float64)
