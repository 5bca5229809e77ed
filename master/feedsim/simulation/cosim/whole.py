"""A machine whose units are one, in a run: ``coupling.units: one``. The results are those of units of their own.

The unit exchanges its parts inside, at the control cycle; from outside it is one step. What is recorded, fed and judged
knows the parts by the names that they have as units. See :mod:`feedsim.simulation.cosim.whole` for what the unit is
given.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from feedsim.foundation.errors import Finding, InputError
from feedsim.scenario import Coupling, Friction, Machine
from feedsim.scenario.axis_units import Parameter
from feedsim.scenario.model import SCHEMES
from feedsim.scenario.roles import BOOLEAN, DRIVE, FRICTION_ROLE, Role
from feedsim.simulation.cosim import operations as op
from feedsim.simulation.cosim import system as wiring
from feedsim.simulation.cosim.archive import Archive
from feedsim.simulation.cosim.operations import Operation
from feedsim.simulation.cosim.plant import axes_of, open_own, packed_for
from feedsim.simulation.cosim.roles import RoleUnit, controller_parameters
from feedsim.simulation.cosim.schedule import Cycle
from feedsim.simulation.cosim.system import System, plant_parameters
from feedsim.simulation.cosim.unit import Alias, Port, Unit
from feedsim.simulation.nc import Program
from feedsim.structure.pack import (
    POSES_IN_ARCHIVE,
    PackedArchive,
    pack_unit,
    plant_tables,
    setpoint_table,
    translate_packager_errors,
)

# --- The whole machine as one unit: structure, drives and friction of all axes, packed with the scenario's motion
#     into the
# archive machine.fmu. No compiler is needed: which machine it is, is data to the unit.


UNIT = "machine"  # its archive is machine.fmu


def pack_whole(
    base: Path,
    out: Path,
    machine: Machine,
    *,
    coupling: Coupling | None = None,
    program: Program | None = None,
    name: str = "",
    note: str = "",
    model: str = "",
    trial: bool = True,
    terminals: bool = True,
) -> PackedArchive:
    """Pack a machine into the archive `base` of the unit `machine`; write it to `out`, whole or not at all.

    Args:
        coupling: how plant and friction are exchanged inside; default: as a scenario has it that does not say.
        program: motion that the unit holds; without, its setpoints are inputs.
        name, note: what the archive's description and documentation say of the machine.
        model: what importers show as the model's name; default: that of the unit.
        trial: instantiate the packed unit once, where the base has a binary for this platform.
        terminals: with terminals and icons.

    Raises:
        InputError: a role is filled by another maker's unit, a file is not what it should be, or the unit refuses.
        OutputError: `out` cannot be written.
    """
    from feedsim_packager import whole_machine

    settings = parameters(machine, coupling or Coupling(), built_in=program is not None)
    pose = {axis: machine.pose[axis] for axis in machine.axes}
    with translate_packager_errors(), _poses(machine) as poses:
        given = whole_machine.WholeMachine(
            plant_tables(machine.modes, pose, poses, machine.mounts_table),
            setpoint_table(program) if program is not None else None,
            {name: whole_machine.spelled(value) for name, value in settings.items()},
        )
        return pack_unit(base, out, given, name=name, note=note, model=model, trial=trial, terminals=terminals)


def pack_tables(base: Path, out: Path, machine: Machine) -> None:
    """Pack the machine's axes and modes alone, for a run that gives the unit all else; errors as `pack_whole`."""
    from feedsim_packager import whole_machine

    pose = {axis: machine.pose[axis] for axis in machine.axes}
    with translate_packager_errors(), _poses(machine) as poses:
        given = whole_machine.WholeMachine(plant_tables(machine.modes, pose, poses, machine.mounts_table), None, {})
        pack_unit(base, out, given, name=machine.name, note=machine.note, trial=False, level=0)


@contextmanager
def _poses(machine: Machine) -> Iterator[Path | None]:
    """The grid of poses of the machine's own plant archive, where it has one."""
    if machine.plant is None:
        yield None
        return
    with Archive(machine.plant) as archive:
        file = archive.directory / POSES_IN_ARCHIVE
        yield file if file.is_file() else None


def parameters(machine: Machine, coupling: Coupling, *, built_in: bool) -> Mapping[str, Parameter]:
    """Parameters of the unit by their names.

    Raises:
        InputError: lists the roles that another unit or law fills than this one holds.
    """
    others = [
        (axis, f"its {unit.role.name} is {unit.fmu.name}, another maker's unit; one unit holds the shipped ones alone")
        for axis, unit in machine.foreign_units
    ]
    others += [
        (axis, f"its friction has the law {friction.law}; one unit holds LuGre alone")
        for axis, friction in machine.shipped_frictions.items()
        if not isinstance(friction, Friction)
    ]
    if others:
        raise InputError.of(
            "the machine cannot be one unit",
            [
                f"axis {axis}: {other}: coupling.units: separate runs it, feedsim export without --one wires it"
                for axis, other in others
            ],
        )
    values: dict[str, Parameter] = {
        "coupling.scheme": SCHEMES[coupling.scheme].number,
        "coupling.substeps": coupling.steps(machine),
        "motion.built_in": built_in,
    }
    for name, axis in machine.axes.items():
        at_motor = axis.friction_at_motor
        values |= {f"{name}.drive.{key}": value for key, value in controller_parameters(machine, name).items()}
        values |= {f"{name}.friction.{key}": value for key, value in at_motor.items()}
        values[f"{name}.M_0"] = axis.M_0
    return values | dict(machine.errors)


# --- A machine whose units are one, in a run: ``coupling.units: one``. The results are those of units of their own ----


def system_of(machine: Machine, coupling: Coupling, fmus: Path, *, only_shipped: bool = False) -> System:
    """The units of a machine, as `coupling` wants them; the rest as
    :class:`~feedsim.simulation.cosim.system.System`."""
    if coupling.units == "one":
        return WholeMachine(machine, fmus, coupling, only_shipped=only_shipped)
    return System(machine, fmus, only_shipped=only_shipped)


def cycle_of(system: System, coupling: Coupling) -> Cycle:
    """A control cycle of such a system."""
    kind = WholeCycle if isinstance(system, WholeMachine) else Cycle
    return kind(system, SCHEMES[coupling.scheme], system.machine.cycles.T_c, coupling.steps(system.machine))


class WholeMachine(System):
    """One unit, and its parts under the names that they have as units of their own."""

    def __init__(self, machine: Machine, fmus: Path, coupling: Coupling, *, only_shipped: bool = False) -> None:
        self._coupling = coupling
        super().__init__(machine, fmus, only_shipped=only_shipped)

    def _build(self, machine: Machine, fmus: Path) -> None:
        given = parameters(machine, self._coupling, built_in=False)
        archive, self.takes_modes = open_whole(machine, fmus), False
        self._open.append(archive)
        self.roles = {}
        self.plant = self._instantiate(archive, UNIT)
        self.plant.set_parameters({**plant_parameters(machine, False), **given})
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

    system: WholeMachine

    def _check(self) -> tuple[Finding, ...]:
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
