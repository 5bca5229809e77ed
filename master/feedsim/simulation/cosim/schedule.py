"""One control cycle of the coupled system as a list of operations, which feedsim.simulation.cosim.operations executes.

What is done in which order are the rows of src/machine_fmu/cycle.h. The unit `machine` works the same rows on its
parts. Here they become calls of units, with the ports and slopes that those have.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np

from feedsim.foundation import variables
from feedsim.foundation.errors import InputError
from feedsim.scenario.model import SCHEMES, Scheme
from feedsim.simulation.cosim import operations as op
from feedsim.simulation.cosim.operations import Bond, Operation
from feedsim.simulation.cosim.roles import RoleUnit, check_step
from feedsim.simulation.cosim.system import Contact, Control, System
from feedsim.simulation.cosim.unit import Floats, Unit
from feedsim.simulation.cosim.worker import watched

ARITHMETIC: dict[str, Callable[..., Operation]] = {"copy": op.copy, "line": op.line, "rate": op.rate}


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

        self._warnings = self._check()
        self._without_slope: dict[str, Floats] = {}  # unit -> how often its slopes were not finite

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a user should know of it, a sentence each."""
        missing = [
            f"{unit}: gave a slope that is not finite at {count[1]:.0f} of its steps; there the exchange took its "
            "output as constant over the next step"
            for unit, count in self._without_slope.items()
            if count[1]
        ]
        return (*self._warnings, *missing)

    def _check(self) -> tuple[str, ...]:
        """What a user should know of how other makers' units are exchanged, a sentence each.

        Raises:
            InputError: lists the units that the scheme or the step does not suit.
        """
        scheme, problems, warnings = self.scheme, [], []
        contacts = [contact.role for contact in self.system.contacts]
        for role in contacts:
            if missing := lacking(role, scheme):
                serving = [scheme.name for scheme in SCHEMES.values() if not lacking(role, scheme)]
                problems.append(
                    f"{role}: coupling scheme {scheme.name} does not work with it, which has {missing}; those that do: "
                    f"{', '.join(serving)}"
                )
            elif scheme.speed_ramp and not (role.takes_slopes and role.gives_slopes):
                known = {"speed": role.takes_slopes, "torque": role.gives_slopes}
                without = " nor of its ".join(name for name, there in known.items() if not there)
                warnings.append(
                    f"{role}: knows no slope of its {without}: on this axis the exchange holds what has none, as "
                    f"gauss_seidel does, and is of first order; coupling.substeps above {self.substeps} make it finer"
                )
        steps = [(control.role, self.cycle, "cycles.control") for control in self.system.controllers]
        steps += [(role, self.step, "cycles.control over coupling.substeps") for role in contacts]
        problems += filter(None, (check_step(*step) for step in steps))
        if problems:
            raise InputError.of("the units cannot be exchanged so", problems)
        return tuple(warnings)

    def operations(self) -> Iterator[Operation]:
        """The whole system from k T_c to (k + 1) T_c."""
        yield from self._rows("CYCLE_BEGINS")
        for j in range(self.substeps):
            yield from self._rows("EXCHANGE_BEGINS", j * self.step)
            for index in range(self.scheme.passes):
                yield from self._rows("EXCHANGE_PASS", j * self.step, second_pass=index > 0)
            yield op.exchange_energy(self.bond, self.step)

    def measured(self, axis: str) -> Iterable[Operation]:
        """Ahead of reading what the drive of an axis measures: at the start of the cycle, as it is sent behind that."""
        return op.set_real(self.system.controllers[self.system.axes.index(axis)].measured)

    def _rows(self, table: str, since: float = 0.0, second_pass: bool = False) -> Iterator[Operation]:
        """Operations of a table's rows; since: the start of the exchange step after that of the cycle [s]."""
        scheme = self.scheme
        due = {
            "always",
            "torque_ramps" if scheme.torque_ramp else "torque_constant",
            "two_passes" if scheme.passes > 1 else "one_pass",
            "second_pass" if second_pass else "first_pass",
            "friction_first" if scheme.friction_first else "plant_first",
            f"speed_{scheme.speed}",
        }
        numbers = {"back_a_cycle": -self.cycle, "since": since, "h": self.step}
        for when, what, *words in variables.cycle()[table]:
            if when not in due:
                continue
            if what == "call":
                yield from getattr(self, f"_{words[0]}")(since)
            else:
                yield ARITHMETIC[what](*(numbers[word] if word in numbers else self._vector(word) for word in words))

    def _vector(self, name: str) -> Floats:
        vector: Floats = getattr(self if name in ("M_fr_start", "M_a_before") else self.system, name)
        return vector

    def _drives(self, _: float) -> Iterator[Operation]:
        for control in self.system.controllers:
            yield from op.set_real(control.measured)
            yield op.do_step(control.unit, 0.0, self.cycle)
            yield from op.get_real(control.torque)
            if self.scheme.torque_ramp and control.role.gives_slopes:  # of another drive, M_a is constant
                yield from self._slopes(control, "torque_ramp")

    def _coupled(self) -> list[Unit]:
        return [self.system.plant, *(contact.unit for contact in self.system.contacts)]

    def _keep(self, _: float) -> Iterator[Operation]:
        return map(op.get_state, self._coupled())

    def _restore(self, _: float) -> Iterator[Operation]:
        return map(op.set_state, self._coupled())

    def _plant(self, start: float) -> Iterator[Operation]:
        """With the friction torque of the last step's end, or that of the friction's step just before."""
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

    def _speed(self, _: float = 0.0) -> Iterator[Operation]:
        return self._rows("SPEED_GIVEN")

    def _friction(self, start: float) -> Iterator[Operation]:
        """A unit that takes no slope gets the speed of the step's end. Without slopes of it the torque is constant."""
        scheme = self.scheme
        for contact in self.system.contacts:
            takes, gives = contact.role.takes_slopes, contact.role.gives_slopes
            yield from op.set_real(contact.speed if takes or scheme.speed != "within" else contact.speed_end)
            if scheme.speed_ramp and takes:
                yield from op.set_slopes(contact.speed)
            yield op.do_step(contact.unit, start, self.step)
            yield from op.get_real(contact.torque)
            if scheme.friction_ramp and gives:
                yield from self._slopes(contact, "friction_ramp")

    def _slopes(self, part: Control | Contact, ramp: str) -> list[Operation]:
        """Of the torque that a part gives, by a scheme with such a ramp."""
        without = [scheme.name for scheme in SCHEMES.values() if not getattr(scheme, ramp) and scheme.passes == 1]
        hint = f"coupling.scheme {' or '.join(without)} needs no slope of it"
        if not part.role.foreign and watched() is None:  # of those that come along all are finite
            return op.get_slopes(part.torque, hint)
        counts = self._without_slope.setdefault(part.unit.known_as, np.zeros(2))
        return op.get_slopes(part.torque, hint, counts)
