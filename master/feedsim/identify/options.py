"""What is known of an axis before its identification, and what is wanted of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import pi
from pathlib import Path

from feedsim import variables
from feedsim.errors import InputError
from feedsim.estimation.parameter import Prior
from feedsim.identify.parameters import CONSTANT_SPEED, PARAMETER_KINDS, Kind, check_fixed, estimate
from feedsim.identify.read import Provenance
from feedsim.identify.result import Estimate
from feedsim.scenario import Friction, FrictionParameters, Machine
from feedsim.scenario.roles import FRICTION_ROLE, FRICTION_UNITS
from feedsim.structure import Modes
from feedsim.structure.modes import checked_modes

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
        fallback: name -> SI value, for what the records do not determine: the friction of the machine so far.
        stages: 1 stationary friction, 2 pre-sliding.
        law: that is fitted.
        fleet: what machines of the same kind have; None: not known.
        seed: of the random starts.

    Raises InputError: a lead or an inertia that is not above 0, a delay or a value of `hold` outside its range
        (`parameters.PARAMETER_KINDS`), F_S held below F_C, a name that is no parameter, or one that is both held and
        free.
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
    law: str = Friction.law
    fleet: Prior | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        known = (*variables.parameters(FRICTION_UNITS.get(self.law, FRICTION_ROLE.shipped)), "M_0")
        for name in (*self.hold, *self.free):
            if name not in known:
                raise InputError(f"no parameter {name!r}; there are {', '.join(known)}")
            if name in self.hold and name in self.free:
                raise InputError(f"{name} cannot be held and free at once")
        LEAD.check("the lead I_P is given as", self.I_P)
        if self.J is not None:
            PARAMETER_KINDS["J"].check("the inertia is given as", self.J.value)
        if self.delay is not None:
            PARAMETER_KINDS["delay"].check("the delay of the torque is given as", self.delay)
        check_fixed(self.hold)


@dataclass(frozen=True)
class Asked:
    """What someone says of an axis, ahead of its traces.

    Attributes:
        axis: its name; None: the only one that the traces determine.
        inertia: seen at the motor [kg.m2]; mass: the same at the slide [kg], and in words; None: not said.
        delay: of the torque channel [s]; None: not said.
        estimated: "inertia", "delay", or both: to be estimated, whatever mapping and machine say.
        hold, free, stages, law: as in :class:`Options`.
        fleets: axis -> what machines of the same kind have, as in :class:`Options`.
    """

    axis: str | None = None
    inertia: float | None = None
    mass: float | None = None
    mass_reason: str = ""
    delay: float | None = None
    estimated: tuple[str, ...] = ()
    hold: Mapping[str, float] = field(default_factory=dict)
    free: tuple[str, ...] = ()
    stages: tuple[int, ...] = STAGES
    law: str = Friction.law
    fleets: Mapping[str, Prior] = field(default_factory=dict)

    def with_traces(self, sources: Sequence[Provenance], machine: Machine | None = None) -> Options:
        """What is known when the traces are read: this, else what their mapping says, else the machine.

        Raises InputError: the traces are of several axes or pitches, or determine none; else as :class:`Options`.
        """
        axis = self._axis(sources)
        pitches = {source.pitch: source.file for source in sources if source.pitch is not None}
        if len(pitches) > 1:
            which = ", ".join(f"{1e3 * pitch:.9g} mm ({file})" for pitch, file in pitches.items())
            raise InputError(f"the traces have different pitches: {which}")
        if not pitches:
            raise InputError(
                "the pitch of the axis is needed, for values at the slide: give --machine, or pitch: 20 mm in --columns"
            )
        I_P = next(iter(pitches)) / (2 * pi)
        own = machine.axes.get(axis) if machine is not None else None
        J, modes = self._given_inertia(I_P, sources), None
        if J is None and "inertia" not in self.estimated and machine is not None and own is not None:
            modes = checked_modes(machine)
            reason = f"J_tot of the modes of {machine.name}, whose flexibility is taken off the torque"
            J = estimate("J", modes.J_tot(axis), status="given", reason=reason)
        if self.fleets and axis not in self.fleets:
            raise InputError(f"the prior is of the axes {', '.join(self.fleets)}; the traces are of {axis}")
        friction = machine.shipped_frictions.get(axis) if machine is not None else None
        delays = {source.torque_delay for source in sources}
        of_mapping = delays.pop() if len(delays) == 1 and "delay" not in self.estimated else None
        return Options(
            axis=axis,
            I_P=I_P,
            J=J,
            modes=modes,
            delay=of_mapping if self.delay is None else self.delay,
            hold=self.hold,
            free=self.free,
            # The friction that the machine file has: for parameters that the traces do not determine.
            fallback=_of_law(friction, self.law) if friction is not None else {},
            stages=self.stages,
            law=self.law,
            fleet=self.fleets.get(axis),
        )

    def _axis(self, sources: Sequence[Provenance]) -> str:
        named = {source.axis: source.file for source in sources if source.axis}
        if self.axis:
            named.setdefault(self.axis, Path("--axes"))
        if len(named) > 1:
            which = ", ".join(f"{axis} ({file})" for axis, file in named.items())
            raise InputError(f"the traces are of several axes: {which}; --axes names one, and its traces are needed")
        if not named:
            raise InputError("the traces do not say which axis they are of; give --axes, for example --axes Z")
        return next(iter(named))

    def _given_inertia(self, I_P: float, sources: Sequence[Provenance]) -> Estimate | None:
        """What is said, else what the mapping says; None: neither, or it is to be estimated."""
        if self.mass is not None:
            return estimate("J", self.mass * I_P**2, status="given", reason=self.mass_reason)
        if self.inertia is not None:
            return estimate("J", self.inertia, status="given", reason="as given")
        of_mapping = [source.inertia for source in sources if source.inertia is not None]
        if not of_mapping or "inertia" in self.estimated:
            return None
        return estimate("J", of_mapping[0], status="given", reason="of the mapping")


def _of_law(friction: FrictionParameters, law: str) -> dict[str, float]:
    """The parameters of a friction that mean the same in a law: of another one the torque over speed."""
    same = friction.law == law
    return {name: float(value) for name, value in friction.parameters().items() if same or name in CONSTANT_SPEED}
