"""One control cycle of the coupled system: who steps when, and what each unit is given of its inputs within the step.

It is written down here, once, as a list of operations, and executed elsewhere (feedsim.cosim.operations).

The controllers sample at t_k and run first; they add no error. The stiff bond is plant <-> friction; a :class:`Scheme`
(feedsim.scenario.coupling) says how the two see each other within a step.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from feedsim.cosim import operations as op
from feedsim.cosim.operations import Bond, Operation
from feedsim.cosim.roles import RoleUnit, check_step
from feedsim.cosim.system import System
from feedsim.cosim.unit import Floats
from feedsim.errors import InputError
from feedsim.scenario.coupling import SCHEMES, Scheme


def lacking(role: RoleUnit, scheme: Scheme) -> str:
    """What the friction in a role would need for a scheme and has not, in words; empty where it serves."""
    needed = {
        "no slope of its input": (role.takes_slopes, scheme.passes > 1 or scheme.speed == "extrapolated"),
        "no slope of its output": (role.gives_slopes, scheme.passes > 1 or scheme.speed == "extrapolated"),
        "no state to go back to": (role.keeps_state, scheme.passes > 1),
    }
    return ", ".join(what for what, (there, wanted) in needed.items() if wanted and not there)


class Cycle:
    """What happens in a control cycle of a :class:`System`, as a list of operations.

    Attributes:
        warnings: what a user should know of it, a sentence each.
        bond: plant and friction: the energies that they exchange.
    """

    def __init__(self, system: System, scheme: Scheme, cycle: float, substeps: int) -> None:
        self.system = system
        self.scheme = scheme
        self.cycle = cycle
        self.substeps = substeps
        self.step = cycle / substeps

        def buffer() -> Floats:
            return np.zeros(len(system.axes))

        self.M_fr_start = buffer()  # of the exchange step, where it is taken again
        self.M_a_before = buffer()  # what an importer without slopes knows of the torque
        self.assumed_torque = buffer()  # at the end of the exchange step, by the plant
        self.bond = Bond(
            M_fr=system.M_fr, n=system.n, n_slope=system.n_slope, assumed_torque=self.assumed_torque,
            n_end=system.n_end, residual=buffer(), residual_peak=buffer(), dissipated=buffer(),
        )  # fmt: skip

        self.warnings = self._check()

    def _check(self) -> tuple[str, ...]:
        """What a user should know of how other makers' units are exchanged, a sentence each.

        Raises:
            InputError: lists the units that the scheme or the step does not suit.
        """
        scheme, problems, warnings = self.scheme, [], []
        contacts = [contact.role for contact in self.system.contacts]
        for role in contacts:
            if missing := lacking(role, scheme):
                serving = [each.name for each in SCHEMES.values() if not lacking(role, each)]
                problems.append(
                    f"{role}: coupling scheme {scheme.name} does not work with it, which has {missing}; those that do: "
                    f"{', '.join(serving)}"
                )
            elif scheme.speed_ramp and not (role.takes_slopes and role.gives_slopes):
                known = {"speed": role.takes_slopes, "torque": role.gives_slopes}
                held = " nor of its ".join(name for name, there in known.items() if not there)
                warnings.append(
                    f"{role}: knows no slope of its {held}: on this axis the exchange holds what has none, as "
                    f"gauss_seidel does, and is of first order; coupling.substeps above {self.substeps} make it finer"
                )
        steps = [(control.role, self.cycle, "cycles.control") for control in self.system.controllers]
        steps += [(role, self.step, "cycles.control over coupling.substeps") for role in contacts]
        problems += filter(None, (check_step(*each) for each in steps))
        if problems:
            raise InputError.of("the units cannot be exchanged so", problems)
        return tuple(warnings)

    def operations(self) -> Iterator[Operation]:
        """The whole system from k T_c to (k + 1) T_c."""
        system = self.system
        for control in system.controllers:
            yield from op.set_real(control.measured)
            yield op.do_step(control.unit, 0.0, self.cycle)
            yield from op.get_real(control.torque)
            if self.scheme.torque_ramp and control.role.gives_slopes:  # of another drive, M_a is held as it is found
                yield from op.get_slopes(control.torque)
        if self.scheme.torque_ramp:
            # From the end backwards: a drive whose torque jumps at t_k then acts as it does, without a cycle's delay.
            yield op.line(system.M_a_start, system.M_a_end, -self.cycle, system.M_a_slope)
        else:
            yield op.copy(system.M_a_start, self.M_a_before)
            yield op.copy(self.M_a_before, system.M_a_end)
        for j in range(self.substeps):
            yield op.line(system.M_a, system.M_a_start, j * self.step, system.M_a_slope)
            yield from self._exchange_step(j * self.step)

    def _exchange_step(self, start: float) -> Iterator[Operation]:
        """Plant and friction over the step that begins `start` [s] after the cycle; the scheme says who goes first."""
        system, scheme = self.system, self.scheme
        units = [system.plant, *(contact.unit for contact in system.contacts)]
        yield op.copy(system.n_start, system.n_end)
        if scheme.passes > 1:
            yield op.copy(self.M_fr_start, system.M_fr)
            yield from map(op.get_state, units)
        for again in range(scheme.passes):
            if again:
                yield from map(op.set_state, units)
                yield op.copy(system.M_fr, self.M_fr_start)
            if scheme.friction_first:
                yield from self._tell_speed()
                yield from self._step_friction(start)
                yield from self._step_plant(start)
            else:
                yield from self._step_plant(start)
                yield from self._tell_speed()
                yield from self._step_friction(start)
        yield op.exchange_energy(self.bond, self.step)

    def _step_plant(self, start: float) -> Iterator[Operation]:
        """With the friction torque that is at hand: that of the last step's end, or what friction has just found."""
        system, scheme, h = self.system, self.scheme, self.step
        yield from op.set_real(system.plant_inputs)
        if scheme.friction_ramp:
            yield from op.set_slopes(system.plant_inputs)
        elif scheme.torque_ramp:
            yield from op.set_slopes(system.plant_torque)
        yield op.do_step(system.plant, start, h)
        yield from op.get_real(system.plant_outputs)
        yield self._assume_torque()

    def _assume_torque(self) -> Operation:
        """What the plant takes the friction torque to be at the end of the step, from what is at hand before it."""
        if self.scheme.friction_ramp:
            return op.line(self.assumed_torque, self.system.M_fr, self.step, self.system.M_fr_slope)
        return op.copy(self.assumed_torque, self.system.M_fr)

    def _tell_speed(self) -> Iterator[Operation]:
        """What friction learns of the speed at its contact."""
        system, speed = self.system, self.scheme.speed
        yield op.copy(system.n, system.n_end if speed == "end" else system.n_start)
        if speed == "within":
            yield op.rate(system.n_slope, system.n_end, system.n_start, self.step)
        elif speed == "extrapolated":
            yield op.copy(system.n_slope, system.n_slope_last)
            yield op.rate(system.n_slope_last, system.n_end, system.n_start, self.step)

    def _step_friction(self, start: float) -> Iterator[Operation]:
        """A unit that takes no slope gets the speed of the step's end; of one that gives none the torque is held."""
        scheme = self.scheme
        for contact in self.system.contacts:
            takes, gives = contact.role.takes_slopes, contact.role.gives_slopes
            yield from op.set_real(contact.speed if takes or scheme.speed != "within" else contact.speed_end)
            if scheme.speed_ramp and takes:
                yield from op.set_slopes(contact.speed)
            yield op.do_step(contact.unit, start, self.step)
            yield from op.get_real(contact.torque)
            if scheme.friction_ramp and gives:
                yield from op.get_slopes(contact.torque)
