"""The parameters of a fit of a drive: what each may be, how it is scaled, and what is known of it beforehand.

They are those of the drive and the friction, but for three: K_i = K_p/T_n, `excess` = F_S - F_C, and `delay`, by how
much the torque is logged later than the motion. Every parameter has a prior: its start, and a standard deviation about
it, of the logarithm where it is known by its order of magnitude.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import exp, inf

from feedsim.estimation.parameter import Parameter
from feedsim.identify.parameters import EXCESS

SPAN = 4.0  # standard deviations of the prior that a logarithm may be off its start
LEAST_SHAPE = 1e-3  # of a mode at the scale, over the rigid motion's
DIFFERENCE = 1e-3  # step of differences: of the logarithm, or of a tenth of the prior's standard deviation


@dataclass(frozen=True)
class Row:
    """A row of the table.

    Attributes:
        deviation: standard deviation of the prior about the start, of the logarithm where log, else of the value.
        log: scaled by the logarithm, and bounded by SPAN deviations.
        lower, upper: bounds, where not log.
        no_effect: values at which a part of the friction law has no effect, or runs away.
        of_friction: deviation, bounds and no_effect are shares of F_C at the start.
    """

    deviation: float
    log: bool = False
    lower: float = -inf
    upper: float = inf
    no_effect: tuple[float, ...] = ()
    of_friction: bool = False


# The inertia begins with the rigid line's, which accelerations determine well; where they do not, its deviation is
# that line's (J_sigma of the start). A mode's place is known by regression ahead of the fit.
TABLE: Mapping[str, Row] = {
    "J": Row(0.05, log=True),
    "K_p": Row(1.0, log=True),
    "K_i": Row(1.5, log=True),
    "K_v": Row(1.0, log=True),
    "omega_0": Row(0.7, log=True),
    "D": Row(0.5, log=True),
    "filter_1.f": Row(0.7, log=True),  # of the low-pass that stands for a current loop
    "k_ffw": Row(0.5, lower=0.0, upper=1.5),
    "T_sym": Row(3e-3, lower=0.0, upper=0.02),
    "T_dyn": Row(10e-3, lower=0.0, upper=0.1),
    "delay": Row(1e-3, lower=-5e-3, upper=5e-3),
    "M_0": Row(5.0, of_friction=True),
    "F_C": Row(0.7, log=True),
    EXCESS: Row(0.5, lower=0.0, upper=3.0, no_effect=(0.0, 3.0), of_friction=True),
    "v_s": Row(1.5, log=True),
    "F_log": Row(2.0, lower=0.0, no_effect=(0.0,), of_friction=True),
    "sigma_0": Row(1.5, log=True),
    "sigma_1": Row(2.0, log=True),
    "sigma_2": Row(1.5, log=True),
    "W": Row(1.5, log=True),
    "gamma": Row(0.5, lower=1e-3, upper=1.0, no_effect=(1.0,)),
    "asymmetry": Row(0.2, lower=-0.6, upper=0.6, no_effect=(-0.6, 0.6)),
    # Of the elastic modes, numbered from 1: mode_f_1.
    "mode_f": Row(0.1, log=True),
    "mode_D": Row(0.7, log=True),
    "mode_u": Row(0.7, log=True),
    "mode_v": Row(1.0),  # of the start
}


def row(name: str) -> Row:
    """Of a parameter, those of modes included."""
    return TABLE[name] if name in TABLE else TABLE[name.rpartition("_")[0]]


def parameter(name: str, start: Mapping[str, float]) -> Parameter:
    """With its bounds and the prior's deviation as scale; position 0 is the start.

    start: all values to begin with; J_sigma: deviation of the logarithm of the inertia, where it is known.
    """
    own, value = row(name), start[name]
    unit = start["F_C"] if own.of_friction else 1.0
    deviation = own.deviation * unit
    if name == "J":
        deviation = max(deviation, start.get("J_sigma", 0.0))
    elif name.startswith("mode_v"):
        deviation = max(abs(value), LEAST_SHAPE)
    lower, upper = own.lower * unit, own.upper * unit
    if own.log:
        lower, upper = value * exp(-SPAN * deviation), value * exp(SPAN * deviation)
    return Parameter(name, value, lower, upper, scale=deviation, log=own.log, origin=value)


def difference(of: Parameter) -> float:
    """Step of the differences in a parameter's position."""
    return DIFFERENCE / of.step if of.log else 0.1 * DIFFERENCE


def no_effect(name: str, value: float, start: Mapping[str, float]) -> bool:
    """Whether a fit has moved a value to where it has no effect, or to the end of its range."""
    own, moved = row(name), parameter(name, start)
    if own.log:
        return abs(moved.inward(value)) > 0.95 * SPAN
    unit = start["F_C"] if own.of_friction else 1.0
    return any(abs(value - end * unit) < 0.01 * moved.step for end in own.no_effect)
