"""One control cycle of the coupled system as a list of operations, which feedsim.simulation.cosim.operations executes.

What is done in which order are the rows of src/machine_fmu/cycle.h. The unit `machine` works the same rows on its
parts. Here they become calls of units, with the ports and slopes that those have.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Protocol

import numpy as np

from feedsim.files.trace import release
from feedsim.foundation import units
from feedsim.foundation.errors import Finding, InputError
from feedsim.scenario.model import SCHEMES, Scheme
from feedsim.simulation.cosim import operations as op
from feedsim.simulation.cosim.exchange import Exchange, Native
from feedsim.simulation.cosim.operations import Bond, DueCycles, Interpreter, Operation, set_real
from feedsim.simulation.cosim.roles import RoleUnit, check_step
from feedsim.simulation.cosim.system import Contact, Control, System
from feedsim.simulation.cosim.unit import Floats, Unit
from feedsim.simulation.cosim.worker import watched_process
from feedsim.simulation.nc import Program

ARITHMETIC: dict[str, Callable[..., Operation]] = {"copy": op.copy, "line": op.line, "rate": op.rate}


def describe_missing_slopes(role: RoleUnit, scheme: Scheme) -> str:
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

    def restart(self) -> None:
        """Begin anew with the first cycle, of a system of shipped units."""
        bond = self.bond
        for buffer in (self.M_fr_start, self.M_a_before, self.assumed_torque,
                       bond.residual, bond.residual_peak, bond.dissipated):  # fmt: skip
            buffer[:] = 0.0

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """What a user should know of it."""
        missing = [
            Finding(
                "slope-not-finite", "doubt",
                f"{unit}: gave a slope that is not finite at {count[1]:.0f} of its steps; there the exchange took its "
                "output as constant over the next step",
                unit,
            )
            for unit, count in self._without_slope.items()
            if count[1]
        ]  # fmt: skip
        return (*self._warnings, *missing)

    def _check(self) -> tuple[Finding, ...]:
        """What a user should know of how other makers' units are exchanged.

        Raises:
            InputError: lists the units that the scheme or the step does not suit.
        """
        scheme, problems, warnings = self.scheme, [], []
        contacts = [contact.role for contact in self.system.contacts]
        for role in contacts:
            if missing := describe_missing_slopes(role, scheme):
                serving = [scheme.name for scheme in SCHEMES.values() if not describe_missing_slopes(role, scheme)]
                problems.append(
                    f"{role}: coupling scheme {scheme.name} does not work with it, which has {missing}; those that do: "
                    f"{', '.join(serving)}"
                )
            elif scheme.speed_ramp and not (role.takes_slopes and role.gives_slopes):
                known = {"speed": role.takes_slopes, "torque": role.gives_slopes}
                without = " nor of its ".join(name for name, there in known.items() if not there)
                warnings.append(Finding(
                    "slope-missing", "doubt",
                    f"{role}: knows no slope of its {without}: on this axis the exchange holds what has none, as "
                    f"gauss_seidel does, and is of first order; coupling.substeps above {self.substeps} make it finer",
                    str(role), f"coupling.substeps={2 * self.substeps}",
                ))  # fmt: skip
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
        for when, what, *words in units.cycle()[table]:
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

    def _coupled_units(self) -> list[Unit]:
        return [self.system.plant, *(contact.unit for contact in self.system.contacts)]

    def _keep(self, _: float) -> Iterator[Operation]:
        return map(op.get_state, self._coupled_units())

    def _restore(self, _: float) -> Iterator[Operation]:
        return map(op.set_state, self._coupled_units())

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
        if not part.role.foreign and watched_process() is None:  # of those that come along all are finite
            return op.get_slopes(part.torque, hint)
        counts = self._without_slope.setdefault(part.unit.known_as, np.zeros(2))
        return op.get_slopes(part.torque, hint, counts)


# --- The cycle loop of a run: control cycles, what the units are given ahead of each, and what is written down --------
# Executed natively where the library is at hand (:mod:`~feedsim.simulation.cosim.exchange`), else in Python, with the
# same result.


Progress = Callable[[int, int], None]

# Cycles between two reports of progress, some 60 ms in Python, 3 ms in the native loop, which is interrupted here only.
REPORTED_EVERY = 2048
# The same in a process that is watched: at first, and in the end; an eighth of what has been done between.
WATCHED_CYCLES = 16, 512
# Rows that are held at the least of what is long.
RING = 4096


class BufferedPart(Protocol):
    """What holds a stretch of a run only: it is refilled, or emptied, between the cycles."""

    def ahead(self, begin: int, end: int) -> None:
        """Be ready for the cycles `begin` to `end` - 1; those before are done."""


class Loop:
    """Control cycles with what happens `before` and `after` each, in that order."""

    def __init__(
        self,
        cycle: Cycle,
        before: Iterable[Operation],
        after: Iterable[Operation],
        native: Native | None,
        buffered: tuple[BufferedPart, ...] = (),
    ) -> None:
        """
        Args:
            native: the library that executes it; None: Python does.
            buffered: what is given of every stretch of cycles ahead of it.
        """
        operations = [*before, *cycle.operations(), *after]
        T_c = cycle.cycle
        self._executor = Interpreter(operations, T_c) if native is None else Exchange(native, operations, T_c)
        self._buffered = buffered
        self._is_watched = self._executor.mark is not None

    @property
    def done(self) -> int:
        """Cycles so far."""
        return self._executor.done

    def restart(self) -> None:
        """Begin anew with the first cycle; so must cycle and buffered parts."""
        self._executor.restart()

    def run(self, total: int, progress: Progress | None = None) -> None:
        """Work `total` cycles from the first one on.

        Raises:
            SimulationError: a unit failed; the message names the unit, the time and the unit's reason.
        """
        with np.errstate(over="ignore", invalid="ignore"):  # the unit that meets an overflow reports it
            for begin, end in self._stretches(total):
                for part in self._buffered:
                    part.ahead(begin, end)
                self._executor.run(begin, end)
                if progress is not None and (end - begin == REPORTED_EVERY or self._is_watched):
                    progress(end, total)
        if progress is not None:
            progress(total, total)

    def _stretches(self, total: int) -> Iterator[tuple[int, int]]:
        """Between which cycles rows are taken over. Where a unit may crash, little of a run is then in its process."""
        end = 0
        while end < total:
            length = min(max(end // 8, WATCHED_CYCLES[0]), WATCHED_CYCLES[1]) if self._is_watched else REPORTED_EVERY
            begin, end = end, min(end + length, total)
            yield begin, end


class Setpoints:
    """The setpoints of each position cycle, `ratio` control cycles long, for the drives; of a long program a stretch.

    Attributes:
        operations: they send it, one per axis.
    """

    def __init__(self, system: System, program: Program, ratio: int) -> None:
        ports = [control.setpoint for control in system.controllers]
        self._ports = list(zip(system.axes, ports, strict=True))
        self._ratio, self._length = ratio, len(program.time)
        self._rows = min(len(program.time), max(RING, 2 * (REPORTED_EVERY // ratio + 1)))
        self.restart(program)
        when = DueCycles(every=ratio)
        self._tables = [np.zeros((self._rows, len(port.names))) for port in ports]
        self.operations = [
            operation
            for port, table in zip(ports, self._tables, strict=True)
            for operation in set_real(port, table, when)
        ]

    def restart(self, program: Program) -> None:
        """Begin anew with the first cycle, on setpoints at as many instants."""
        planned = {"x_s": program.x_s, "n_ffw": program.n_ffw}
        self._columns = [
            [(alias, planned[name][axis]) for alias, name in zip(port.aliases, port.names, strict=True)]
            for axis, port in self._ports
        ]
        self._filled_rows = 0

    def ahead(self, begin: int, end: int) -> None:
        done, needed = -(-begin // self._ratio), -(-end // self._ratio)
        if needed <= self._filled_rows:
            return
        last = min(done + self._rows, self._length)
        at = np.arange(self._filled_rows, last) % self._rows
        for table, columns in zip(self._tables, self._columns, strict=True):
            for i, (alias, column) in enumerate(columns):
                table[at, i] = alias.to_own(column[self._filled_rows : last])
        release(*(column for columns in self._columns for _, column in columns))
        self._filled_rows = last
