"""A machine whose units are one, in a run: ``coupling.units: one``. The results are those of units of their own.

The unit exchanges its parts inside, at the control cycle; from outside it is one step. What is recorded, fed and judged
knows the parts by the names that they have as units. See :mod:`feedsim.cosim.one_unit` for what the unit is given.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from feedsim.cosim import operations as op
from feedsim.cosim import wiring
from feedsim.cosim.archive import Archive
from feedsim.cosim.one_unit import UNIT, pack_tables, parameters
from feedsim.cosim.operations import Operation
from feedsim.cosim.plant import axes_of, open_own, packed_for
from feedsim.cosim.roles import RoleUnit
from feedsim.cosim.schedule import Cycle
from feedsim.cosim.system import System, plant_parameters
from feedsim.cosim.unit import Alias, Port, Unit
from feedsim.errors import InputError
from feedsim.nc import Program
from feedsim.scenario import Coupling, Machine
from feedsim.scenario.coupling import SCHEMES
from feedsim.scenario.roles import BOOLEAN, DRIVE, FRICTION_ROLE, Role


def system_of(machine: Machine, coupling: Coupling, fmus: Path, *, only_shipped: bool = False) -> System:
    """The units of a machine, as `coupling` wants them; the rest as :class:`~feedsim.cosim.system.System`."""
    if coupling.units == "one":
        return Whole(machine, fmus, coupling, only_shipped=only_shipped)
    return System(machine, fmus, only_shipped=only_shipped)


def cycle_of(system: System, coupling: Coupling) -> Cycle:
    """A control cycle of such a system."""
    kind = WholeCycle if isinstance(system, Whole) else Cycle
    return kind(system, SCHEMES[coupling.scheme], system.machine.cycles.T_c, coupling.substeps)


class Whole(System):
    """One unit, and its parts under the names that they have as units of their own."""

    def __init__(self, machine: Machine, fmus: Path, coupling: Coupling, *, only_shipped: bool = False) -> None:
        self._coupling = coupling
        super().__init__(machine, fmus, only_shipped=only_shipped)

    def _build(self, machine: Machine, fmus: Path) -> None:
        given = parameters(machine, self._coupling, built_in=False)
        archive, self.plant_modes_file = open_whole(machine, fmus), None
        self._open.append(archive)
        self.roles = {}
        self.plant = self._instantiate(archive, UNIT)
        self.plant.set_parameters({**plant_parameters(machine, None), **given})
        self.plant_axes = axes_of(archive)
        for axis in self.axes:
            self.roles[wiring.controller(axis)] = _part(archive, axis, DRIVE)
            self.roles[wiring.friction(axis)] = _part(archive, axis, FRICTION_ROLE)
        self.units = {wiring.PLANT: self.plant}
        self.units |= {name: self.plant.part(role.signals) for name, role in self.roles.items()}
        self._share_buffers()
        self._wire()

    def _wire(self) -> None:
        torques, frictions = ([f"{axis}.{torque}" for axis in self.axes] for torque in ("M_a", "M_fr"))
        self.motor_torque = Port(self.plant, torques, self.M_a_end)
        self.friction_torque = Port(self.plant, frictions, self.M_fr, self.M_fr_slope)
        self.contacts = []  # inside

    @property
    def instances(self) -> Mapping[str, Unit]:
        return {UNIT: self.plant}

    def initialise(self, program: Program, stop: float) -> None:
        self._enter_initialisation(stop)
        self.set_setpoints(program)
        for port in (self.plant_outputs, self.motor_torque, self.friction_torque):
            port.get()
        self.n_start[:] = self.n[:] = self.n_end
        self._exit_initialisation()


def _part(archive: Archive, axis: str, role: Role) -> RoleUnit:
    """Signals of a role on an axis: outputs and what comes from outside are the axis's, the rest is the part's."""
    aliases = {}
    for name, signal in role.signals.items():
        text = next(entry for entry in (f"{axis}.{name}", f"{axis}.{role.name}.{name}") if entry in archive.variables)
        aliases[name] = Alias(text, "1" if signal.unit == BOOLEAN else signal.unit)
    return RoleUnit(role, axis, archive, aliases, {})


def open_whole(machine: Machine, fmus: Path) -> Archive:
    """The unit's archive with the machine's modes and poses; the caller closes it."""
    general = fmus / f"{UNIT}.fmu"
    if machine.plant is not None:
        open_own(machine.plant, machine).close()
    return packed_for(machine, general, lambda out: pack_tables(general, out, machine))


class WholeCycle(Cycle):
    """A step of the one unit; and, from what it shows, what plant and friction have exchanged inside."""

    system: Whole

    def _check(self) -> tuple[str, ...]:
        if self.scheme.passes > 1 or self.substeps > 1:
            followed = ", ".join(name for name, scheme in SCHEMES.items() if scheme.passes == 1)
            raise InputError(
                "coupling.units: one: the energies that plant and friction exchange are followed from outside, once in "
                f"a control cycle; scheme is {self.scheme.name}, allowed: {followed}; substeps are {self.substeps}, "
                "allowed: 1; or units: separate"
            )
        return ()

    def measured(self, axis: str) -> Iterable[Operation]:
        """The unit knows."""
        return ()

    def operations(self) -> Iterator[Operation]:
        system = self.system
        yield op.do_step(system.plant, 0.0, self.cycle)
        yield op.copy(system.n_start, system.n_end)
        yield from op.get_real(system.plant_outputs)
        yield from self._speed()
        if not self.scheme.friction_first:
            yield self._assume_torque()
        yield from op.get_real(system.friction_torque)
        if self.scheme.friction_ramp:
            yield from op.get_slopes(system.friction_torque)
        if self.scheme.friction_first:
            yield self._assume_torque()
        yield from op.get_real(system.motor_torque)
        yield op.exchange_energy(self.bond, self.step)
