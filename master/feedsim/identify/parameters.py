"""Parameters that identification estimates: unit, meaning, and the range that is physically possible."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf, isfinite

from feedsim import units, variables
from feedsim.errors import InputError
from feedsim.scenario import Friction


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
        low, high = units.show(self.lower, self.unit), units.show(self.upper, self.unit)
        if self.above > -inf:
            return f"more than {units.show(self.above, self.unit)}"
        if self.lower == -inf:
            return "any finite value"
        return f"at least {low}" if self.upper == inf else f"from {low} to {high}"

    def check(self, what: str, value: float) -> None:
        """Raises InputError, which begins with `what`: the value is not finite or not possible."""
        if not (isfinite(value) and self.lower <= value <= self.upper and value > self.above):
            raise InputError(f"{what} {units.show(value, self.unit)}; allowed: {self.range}")


PRE_SLIDING = ("sigma_0", "sigma_1", "W", "gamma")
# What plateaus tell, in the order in which it is shown; and all of it that stage 2 takes over.
CONSTANT_SPEED = ("F_C", "F_S", "v_s", "beta", "F_log", "v_log", "sigma_2", "asymmetry", "M_0")
STATIONARY = ("F_C", "F_S", "v_s", "F_log", "sigma_2", "asymmetry", "M_0")
RIGID = ("J", "sigma_2", "F_C", "M_0")  # of a rigid axis with Coulomb and viscous friction

_TABLE = variables.parameters("friction")
FRICTION = tuple(_TABLE)
# Held at the unit's start values unless they are freed: no record of friction alone tells them well.
USUAL: Mapping[str, float] = {
    name: float(each.start) for name, each in _TABLE.items() if name not in (*PRE_SLIDING, *STATIONARY)
}
# What leaves no trace in the friction: what machine files mean that do not give it.
NO_EFFECT: Mapping[str, float] = {"sigma_2": 0.0} | {
    name: field.default for name in FRICTION if not (field := Friction.model_fields[name]).is_required()
}


def _kind(name: str) -> Kind:
    """Of a parameter of the unit: what is estimated can be written into a machine file."""
    row = _TABLE[name]
    return Kind(row.unit, row.short, row.minimum, row.maximum)


KINDS = {
    **{name: _kind(name) for name in (*PRE_SLIDING, *CONSTANT_SPEED[:-1])},
    "M_0": Kind("N.m", "constant load against the motor torque"),
    **{name: _kind(name) for name in USUAL if name not in CONSTANT_SPEED},
    "J": Kind("kg.m2", "inertia", above=0.0),
    # Wide against the offsets between the channels of one log; what is beyond is a wrong unit, or two logs.
    "delay": Kind("s", "delay of the torque channel against the motion", -20e-3, 20e-3),
}


def check_held(hold: Mapping[str, float]) -> None:
    """Raises InputError: a value outside its physical range, or F_S below F_C."""
    for name, value in hold.items():
        KINDS[name].check(f"{name} is held at", value)
    if "F_S" in hold and "F_C" in hold and hold["F_S"] < hold["F_C"]:
        raise InputError(f"F_S is held at {hold['F_S']:g} N.m, below F_C at {hold['F_C']:g} N.m; allowed: at least F_C")
