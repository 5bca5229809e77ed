"""Parameters that identification estimates: unit, meaning, and the range that is physically possible."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf


@dataclass(frozen=True)
class Kind:
    """A parameter's unit and meaning; lower, upper: physically possible (no negative damping, no negative friction)."""

    unit: str
    meaning: str
    lower: float = -inf
    upper: float = inf


KINDS = {
    "sigma_0": Kind("N.m/rad", "bristle stiffness", 0.0),
    "sigma_1": Kind("N.m.s/rad", "bristle damping", 0.0),
    "W": Kind("rad", "width of the engaging zone", 0.0),
    "gamma": Kind("1", "share of the bristle stiffness engaged at once after a reversal", 0.0, 1.0),
    "F_C": Kind("N.m", "Coulomb friction", 0.0),
    "F_S": Kind("N.m", "static friction", 0.0),
    "v_s": Kind("rad/s", "Stribeck speed", 0.0),
    "beta": Kind("1", "Stribeck exponent", 0.0),
    "F_log": Kind("N.m", "logarithmic rise of the friction", 0.0),
    "v_log": Kind("rad/s", "reference speed of the logarithmic rise", 0.0),
    "sigma_2": Kind("N.m.s/rad", "viscous friction", 0.0),
    "asymmetry": Kind("1", "direction dependence of the friction", -1.0, 1.0),
    "M_0": Kind("N.m", "constant load against the motor torque"),
    "J": Kind("kg.m2", "inertia", 0.0),
    "delay": Kind("s", "delay of the torque channel against the motion"),
}

FRICTION = ("sigma_0", "sigma_1", "sigma_2", "F_C", "F_S", "v_s", "beta", "F_log", "v_log", "asymmetry", "W", "gamma")
PRE_SLIDING = ("sigma_0", "sigma_1", "W", "gamma")
STATIONARY = ("F_C", "F_S", "v_s", "F_log", "sigma_2", "asymmetry", "M_0")
USUAL = {"beta": 1.0, "v_log": 3.0}  # held unless they are freed: no record of friction alone tells them well
