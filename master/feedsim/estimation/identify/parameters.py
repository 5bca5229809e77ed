"""The friction law as identification knows it: parameters, who determines them, ranges of the search, curve over speed.

Unit, range, meaning and start value are those of the friction unit's table. A parameter of it that no stage names here
is held at its start value, and nothing else in this room needs to know it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite, nan
from typing import TYPE_CHECKING, Any

import numpy as np

from feedsim.estimation.identify.record import Array
from feedsim.estimation.identify.result import Estimate, Status
from feedsim.files.fields import Quantity
from feedsim.foundation import units
from feedsim.foundation.errors import InputError
from feedsim.scenario import Friction, GmsFriction
from feedsim.scenario.roles import FRICTION_UNITS

if TYPE_CHECKING:
    from feedsim.simulation.cosim.friction_law import FrictionLaw

FRICTION_NAMES = tuple(units.parameters("friction"))
# Of all laws; which of them a law has, it says itself (FrictionLaw.names).
_TABLE = {**units.parameters("friction"), **{name: row for unit in FRICTION_UNITS.values()
          for name, row in units.parameters(unit).items() if name not in FRICTION_NAMES}}  # fmt: skip
# What reversals determine (stage 2), and what plateaus of constant speed determine (stage 1), in the order in which it
# is shown.
PRE_SLIDING = ("sigma_0", "sigma_1", "W", "gamma", "spread", "skew", "C")
CONSTANT_SPEED = ("F_C", "F_S", "v_s", "beta", "F_log", "v_log", "sigma_2", "asymmetry", "M_0")
RIGID_AXIS_NAMES = ("J", "sigma_2", "F_C", "M_0")  # of a rigid axis with Coulomb and viscous friction
# Held at the unit's start values unless they are freed: no record of friction alone determines them well.
DEFAULT_SHAPES: Mapping[str, float] = {name: float(_TABLE[name].start) for name in ("beta", "v_log")}
STATIONARY = tuple(
    name for name in CONSTANT_SPEED if name not in DEFAULT_SHAPES
)  # all of stage 1 that stage 2 takes over
# no stage determines them
FIXED_PARAMETERS = tuple(name for name in _TABLE if name not in (*PRE_SLIDING, *CONSTANT_SPEED))
# Where a parameter has no effect: what machine files mean that do not give it; v_s where F_S is F_C.
NO_EFFECT: Mapping[str, float] = {
    **{"sigma_1": 0.0, "sigma_2": 0.0, "M_0": 0.0, "v_s": float(_TABLE["v_s"].start)},
    **{
        name: field.default
        for model in (GmsFriction, Friction)
        for name, field in model.model_fields.items()
        if name in _TABLE and not field.is_required()
    },
}
# F_S moves as its excess over F_C: F_S >= F_C then is a bound like any other.
EXCESS = "excess"


@dataclass(frozen=True)
class Kind:
    """A parameter's unit and meaning.

    lower, upper: physically possible (no negative damping, no negative friction), the ends included. above: the end
    that is not.
    """

    unit: str
    meaning: str
    lower: float = -inf
    upper: float = inf
    above: float = -inf

    @property
    def range(self) -> str:
        """In words."""
        if (self.lower, self.upper, self.above) == (-inf, inf, -inf):
            return "any finite value"
        return Quantity(self.unit, self.lower, self.upper, self.above).range

    def check(self, what: str, value: float) -> None:
        """Raises InputError, which begins with `what`: the value is not finite or not possible."""
        if not (isfinite(value) and self.lower <= value <= self.upper and value > self.above):
            raise InputError(f"{what} {units.show(value, self.unit)}; allowed: {self.range}")


def _kind(name: str) -> Kind:
    """Of a parameter of the unit: what is estimated can be written into a machine file."""
    row = _TABLE[name]
    return Kind(row.unit, row.short, row.minimum, row.maximum)


PARAMETER_KINDS = {
    **{name: _kind(name) for name in (*PRE_SLIDING, *CONSTANT_SPEED) if name in _TABLE},
    "M_0": Kind("N.m", "constant load against the motor torque"),
    **{name: _kind(name) for name in FIXED_PARAMETERS},
    "J": Kind("kg.m2", "inertia", above=0.0),
    # Wide against the offsets between the channels of one log; what is beyond is a wrong unit, or two logs.
    "delay": Kind("s", "delay of the torque channel against the motion", -20e-3, 20e-3),
}


def names_of(law: FrictionLaw) -> tuple[str, ...]:
    """What can be estimated with a law, in the order in which it is shown: its parameters, M_0, J and the delay."""
    return tuple(name for name in PARAMETER_KINDS if name in law.names or name not in _TABLE)


def estimate(name: str, value: float, sigma: float = nan, status: Status = "estimated", reason: str = "") -> Estimate:
    """With unit and meaning of the parameter."""
    return Estimate(name, value, PARAMETER_KINDS[name].unit, PARAMETER_KINDS[name].meaning, sigma, status, reason)


def check_fixed(hold: Mapping[str, float]) -> None:
    """Raises InputError: a value outside its physical range, or F_S below F_C."""
    for name, value in hold.items():
        PARAMETER_KINDS[name].check(f"{name} is held at", value)
    if "F_S" in hold and "F_C" in hold and hold["F_S"] < hold["F_C"]:
        raise InputError(f"F_S is held at {hold['F_S']:g} N.m, below F_C at {hold['F_C']:g} N.m; allowed: at least F_C")


# --- the search ------------------------------------------------------------------------------------------------------


def solver_name(name: str) -> str:
    """Name under which the solver moves a parameter."""
    return EXCESS if name == "F_S" else name


def parameter_name(name: str) -> str:
    """The parameter's own name."""
    return "F_S" if name == EXCESS else name


def inner_to_outer(moved: Sequence[str], wanted: Sequence[str]) -> Array:
    """(wanted, moved) matrix that turns what the solver moves into parameters: F_S = F_C + excess."""
    turn = np.zeros((len(wanted), len(moved)))
    for row, name in enumerate(wanted):
        turn[row, moved.index(solver_name(name))] = 1.0
        if name == "F_S" and "F_C" in moved:
            turn[row, moved.index("F_C")] = 1.0
    return turn


Range = Mapping[str, Any]  # lower, upper, scale, scatter, log of a fit.Parameter

# Stage 1, within what is physical: beyond these bounds plateaus determine nothing, and the solver goes astray.
V_S = 20.0, 2.0  # below the lowest speed, above the highest: a Stribeck effect that is over before, or no end of it
V_LOG = 1e-2, 1e2  # likewise: a logarithm all along, or a straight line
BETA = 0.2, 4.0  # flatter, the peak has no end within decades of speed; steeper, it is a step
ASYMMETRY = -0.5, 0.5  # beyond, it plays the constant load's part
MOST_TORQUE = 2.0  # of the largest measured: no part of the friction, and no load, is more
LEAST_F_C = 1e-3  # of the largest torque: what is reported is relative to it
# What may be there though no plateau determines it, of the friction: standard deviations of values that pass for usual.
# A Stribeck effect that no plateau shows is over by the lowest speed, which is UNSEEN_SPEED_RATIO times v_s at least.
PRIOR_DEVIATIONS: Mapping[str, float] = {EXCESS: 0.3, "F_log": 0.3, "sigma_2": 0.3, "asymmetry": 0.05, "M_0": 2.0}
UNSEEN_SPEED_RATIO = 2.0


def hidden_deviation(name: str, friction: float, fast: float) -> float:
    """Standard deviation that a parameter may have which no plateau determines: friction [N.m], highest speed
    [rad/s]."""
    return PRIOR_DEVIATIONS[name] * (1.0 if name == "asymmetry" else friction / fast if name == "sigma_2" else friction)


def plateau_ranges(slow: float, fast: float, top: float) -> dict[str, Range]:
    """Of what stage 1 moves, from the lowest and highest speed [rad/s] and the largest torque [N.m] of the plateaus."""
    most, part, rise = MOST_TORQUE * top, 0.1 * top, (0.0, 0.5 * top)
    stribeck = slow, max(fast / 3, 2 * slow)
    return {
        "F_C": {"lower": LEAST_F_C * top, "upper": most, "scale": 0.3 * top, "scatter": (0.2 * top, top)},
        EXCESS: {"lower": 0.0, "upper": most, "scale": part, "scatter": rise},
        "v_s": {"lower": slow / V_S[0], "upper": V_S[1] * fast, "scatter": stribeck, "log": True},
        "beta": {"lower": BETA[0], "upper": BETA[1], "scatter": (0.5, 2.0), "log": True},
        "F_log": {"lower": 0.0, "upper": most, "scale": part, "scatter": rise},
        "v_log": {"lower": V_LOG[0] * slow, "upper": V_LOG[1] * fast, "scatter": (slow, fast * 1.01), "log": True},
        "sigma_2": {"lower": 0.0, "upper": most / fast, "scale": part / fast, "scatter": (0.0, 0.5 * top / fast)},
        "asymmetry": {"lower": ASYMMETRY[0], "upper": ASYMMETRY[1], "scale": 0.1, "scatter": (-0.05, 0.05)},
        "M_0": {"lower": -most, "upper": most, "scale": part, "scatter": (-0.05 * top, 0.05 * top)},
    }


# Stage 2, likewise.
# either way from their start, which is of the right order
DECADES = {"sigma_0": 2.0, "W": 1.5, "v_s": 1.5, "spread": 1.5, "C": 1.5}
DELAYS = (-5e-3, 20e-3)  # [s]: filters and buses make the torque late; what makes it early is less
MOST_EXCESS = 2.0  # of the friction: static friction beyond three times Coulomb's is none
MOST_ASYMMETRY = 0.6  # beyond, it plays the constant load's part
LEAST_SHARE = 1e-3  # of the start: the law and the scales divide by F_C, beta, v_log and J
LEAST_GAMMA = 1e-3  # at 0 nothing is engaged at a reversal, and sigma_0 acts on nothing


def reversal_ranges(start: Mapping[str, float]) -> dict[str, Range]:
    """Of what stage 2 moves, from the start values; no wider than what is physical."""
    F_C = start["F_C"]
    result: dict[str, dict[str, Any]] = {name: {} for name in PARAMETER_KINDS}
    for name, decades in DECADES.items():  # known by their order of magnitude at first, and above 0
        span = 10**decades
        value = start.get(name, NO_EFFECT.get(name, 0.0))
        result[name] = {"lower": value / span, "upper": value * span, "log": True}
    for name in ("F_C", "beta", "v_log", "J"):
        result[name] = {"lower": LEAST_SHARE * start[name]}
    result["sigma_1"] = {"scale": max(abs(start["sigma_1"]), 1e-4 * start["sigma_0"])}
    result["sigma_2"] = {"scale": max(abs(start["sigma_2"]), 1e-4 * F_C)}
    result["gamma"] = {"lower": LEAST_GAMMA, "scale": 1.0}
    result["skew"] = {"scale": 1.0}
    result["F_log"] = result["M_0"] = {"scale": F_C}
    result["asymmetry"] = {"lower": -MOST_ASYMMETRY, "upper": MOST_ASYMMETRY, "scale": 0.1}
    result["delay"] = {"lower": DELAYS[0], "upper": DELAYS[1], "scale": 1e-4}
    for name, kind in PARAMETER_KINDS.items():
        lower, upper = result[name].get("lower", -inf), result[name].get("upper", inf)
        result[name] = {**result[name], "lower": max(lower, kind.lower), "upper": min(upper, kind.upper)}
    return {**result, EXCESS: {"lower": 0.0, "upper": MOST_EXCESS * max(F_C, start["F_S"]), "scale": F_C}}


# --- friction at constant speed: the static level of Eq. 7, its viscous part, and the constant load -------------------


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
