"""What is known of an axis before its identification, and what is wanted of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from feedsim.errors import InputError
from feedsim.identify.parameters import FRICTION, KINDS, Kind, check_held
from feedsim.identify.result import Estimate
from feedsim.structure import Modes

STAGES = (1, 2)
LEAD = Kind("m/rad", "lead", above=0.0)


@dataclass(frozen=True)
class Options:
    """What is known and what is wanted.

    Attributes:
        axis: its name. I_P: lead [m/rad].
        J: inertia seen at the motor [kg.m2], `given`; None: estimated from accelerating parts.
        modes: of the machine whose J_tot is given: what its structure takes beyond J dn/dt is known then.
        delay: of the torque channel [s]; None: estimated.
        hold: name -> SI value that a parameter keeps. free: names that are estimated although they are usually held.
        fallback: name -> SI value, for what the records do not tell: the friction of the machine so far.
        stages: 1 stationary friction, 2 pre-sliding.
        seed: of the random starts.

    Raises InputError: a lead or an inertia that is not above 0, a delay or a value of `hold` outside its range
        (`parameters.KINDS`), F_S held below F_C, a name that is no parameter, or one that is both held and free.
    """

    axis: str
    I_P: float
    J: Estimate | None = None
    modes: Modes | None = None
    delay: float | None = None
    hold: Mapping[str, float] = field(default_factory=dict)
    free: tuple[str, ...] = ()
    fallback: Mapping[str, float] = field(default_factory=dict)
    stages: tuple[int, ...] = STAGES
    seed: int = 0

    def __post_init__(self) -> None:
        known = (*FRICTION, "M_0")
        for name in (*self.hold, *self.free):
            if name not in known:
                raise InputError(f"no parameter {name!r}; there are {', '.join(known)}")
            if name in self.hold and name in self.free:
                raise InputError(f"{name} cannot be held and free at once")
        LEAD.check("the lead I_P is given as", self.I_P)
        if self.J is not None:
            KINDS["J"].check("the inertia is given as", self.J.value)
        if self.delay is not None:
            KINDS["delay"].check("the delay of the torque is given as", self.delay)
        check_held(self.hold)
