"""The units of the paper's Fig. 2, instantiated, parameterised, wired through shared buffers and initialised."""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from feedsim.foundation.errors import Finding, InputError
from feedsim.foundation.outputs import BlockResource
from feedsim.scenario import Machine
from feedsim.scenario.roles import DRIVE, FRICTION_ROLE, Role
from feedsim.simulation.cosim.archive import Archive
from feedsim.simulation.cosim.exchange import is_shipped
from feedsim.simulation.cosim.plant import axes_of, modes_file, open_plant
from feedsim.simulation.cosim.roles import RoleUnit, archive_path, check_instances, fill_role, shipped_parameters
from feedsim.simulation.cosim.unit import Floats, Port, Unit, UnloadedUnit
from feedsim.simulation.nc import Program

# --- Which output drives which input: the paper's Fig. 2 as a mapping, checked before the first step ------------------


NC = "nc"  # source of setpoints: x_s, n_ffw and release per axis
ZERO = "zero"  # an input that nothing drives, held at 0 on purpose; a measurement may excite it


@dataclass(frozen=True)
class Variable:
    """A variable of an instance: `instance` is a unit's name, or NC or ZERO for sources outside the units."""

    instance: str
    name: str

    def __str__(self) -> str:
        return f"{self.instance}/{self.name}"


@dataclass(frozen=True)
class Connection:
    """`target` (an input) is driven by `source` (an output, a setpoint, or zero)."""

    target: Variable
    source: Variable


SETPOINT_UNITS = {"x_s": "m", "n_ffw": "rad/s"}
RELEASE = "release"  # controller enable, Boolean; true where nothing gives it
TOOL_FORCES = ("tool.F_X", "tool.F_Y", "tool.F_Z")


def controller(axis: str) -> str:
    return f"controller_{axis}"


def friction(axis: str) -> str:
    return f"friction_{axis}"


PLANT = "plant"


def figure_2(
    axes: Sequence[str], *, with_friction: bool = True, given: Mapping[str, Container[str]] | None = None
) -> list[Connection]:
    """Connections of the paper's Fig. 2: NC -> control -> structure <-> friction, structure -> control.

    given: instance -> the signals that it has, where those are not all of its role.
    """
    given = given or {}
    connections = [Connection(Variable(PLANT, name), Variable(ZERO, name)) for name in TOOL_FORCES]
    for axis in axes:
        control, contact = controller(axis), friction(axis)
        drives = {
            Variable(control, "x_s"): Variable(NC, f"{axis}.x_s"),
            Variable(control, "n_ffw"): Variable(NC, f"{axis}.n_ffw"),
            Variable(control, RELEASE): Variable(NC, f"{axis}.{RELEASE}"),
            Variable(control, "x_a"): Variable(PLANT, f"{axis}.x_a"),
            Variable(control, "n_a"): Variable(PLANT, f"{axis}.n_a"),
            Variable(control, "n_add"): Variable(ZERO, "n_add"),
            Variable(control, "M_add"): Variable(ZERO, "M_add"),
            Variable(PLANT, f"{axis}.M_a"): Variable(control, "M_a"),
            Variable(PLANT, f"{axis}.F_a"): Variable(ZERO, "F_a"),
        }
        if with_friction:
            drives[Variable(PLANT, f"{axis}.M_fr")] = Variable(contact, "M_fr")
            drives[Variable(contact, "n_fr")] = Variable(PLANT, f"{axis}.n_fr")
        else:
            drives[Variable(PLANT, f"{axis}.M_fr")] = Variable(ZERO, "M_fr")
        connections += [
            Connection(target, source)
            for target, source in drives.items()
            if all(end.instance not in given or end.name in given[end.instance] for end in (target, source))
        ]
    return connections


def check(connections: Iterable[Connection], instances: Mapping[str, Archive], foreign: Container[str] = ()) -> None:
    """Every input of every instance is driven exactly once, by something that exists and has the same unit.

    foreign: instances of other makers' archives, whose signals are checked where they are mapped.

    Raises:
        InputError: lists every fault found.
    """
    connections = list(connections)
    problems: list[str] = []
    for target, count in Counter(connection.target for connection in connections).items():
        if count > 1:
            problems.append(f"{target} is connected {count} times; once is allowed")
    driven = {connection.target for connection in connections}
    for instance, archive in instances.items():
        if instance in foreign:
            continue
        for variable in archive.variables.values():
            if variable.causality == "input" and Variable(instance, variable.name) not in driven:
                problems.append(f"{instance}/{variable.name} is an input without a connection")
    for connection in connections:
        if not any(end.instance in foreign for end in (connection.target, connection.source)):
            problems += _faults(connection, instances)
    if problems:
        files = ", ".join(dict.fromkeys(str(archive.path) for archive in instances.values()))
        raise InputError(f"{files}: the units cannot be wired:\n  " + "\n  ".join(problems))


def _faults(connection: Connection, instances: Mapping[str, Archive]) -> list[str]:
    target, source = connection.target, connection.source
    faults = [
        f"{end} does not exist or is no {causality}"
        for end, causality in ((target, "input"), (source, "output"))
        if end.instance not in (NC, ZERO) and not _has_causality(end, causality, instances)
    ]
    if faults or source.instance == ZERO:
        return faults
    wanted = instances[target.instance].unit_of(target.name)
    given = (
        SETPOINT_UNITS.get(source.name.rpartition(".")[2], "1")
        if source.instance == NC
        else instances[source.instance].unit_of(source.name)
    )
    return [] if wanted == given else [f"{target} is in {wanted}, but {source} is in {given}"]


def _has_causality(end: Variable, causality: str, instances: Mapping[str, Archive]) -> bool:
    archive = instances.get(end.instance)
    return archive is not None and end.name in archive.variables and archive.variables[end.name].causality == causality


# --- The units of the paper's Fig. 2, instantiated, parameterised, wired through shared buffers and initialised -------


SETPOINT_INPUTS, MEASURED_INPUTS = ("x_s", "n_ffw"), ("x_a", "n_a")


@dataclass(frozen=True)
class Control:
    """The drive of an axis with its ports, which hold those signals that it has."""

    role: RoleUnit
    unit: Unit
    setpoint: Port  # x_s, n_ffw
    measured: Port  # x_a, n_a
    torque: Port  # M_a


@dataclass(frozen=True)
class Contact:
    """The friction of an axis with its ports.

    speed_end: n_fr at the end of the exchange step, for a unit that cannot be given how fast it changes within.
    """

    role: RoleUnit
    unit: Unit
    speed: Port  # n_fr
    speed_end: Port
    torque: Port  # M_fr


class System(BlockResource):
    """All units of a machine (a context manager that frees them).

    Without friction there are no friction units, and M_fr stays 0: a LuGre model cannot be parameterised away.

    Shared buffers, one entry per axis in the machine's order; an exchange step runs from its start to its end:

    ======================= ==============================================================================
    M_a_start, M_a_end      motor torque at the ends of the control cycle, M_a_slope in between
    M_a                     motor torque at the start of the exchange step
    M_fr, M_fr_slope        friction torque at the start of the exchange step and the slope of the last one
    n_start, n_end          speed at the friction contact at the ends of the exchange step
    n, n_slope              what the friction units are given of it
    measured                x_a and n_a of every axis at the end of the exchange step
    ======================= ==============================================================================
    """

    def __init__(self, machine: Machine, fmus: Path, *, friction: bool = True, only_shipped: bool = False) -> None:
        """only_shipped: no program but those that this installation ships is executed: to judge, not to run."""
        self.machine, self.axes = machine, tuple(machine.axes)
        self.friction, self.only_shipped = friction, only_shipped
        self._open: list[Archive | Unit] = []
        try:
            self._build(machine, fmus)
        except BaseException:
            self.close()
            raise

    def _build(self, machine: Machine, fmus: Path) -> None:
        plant, self.takes_modes = open_plant(machine, fmus)
        self._open.append(plant)
        self.roles = self._fill(machine, fmus)
        instances = {PLANT: plant} | {name: role.archive for name, role in self.roles.items()}
        given = {name: role.signals for name, role in self.roles.items()}
        connections = figure_2(self.axes, with_friction=self.friction, given=given)
        check(connections, instances, [name for name, role in self.roles.items() if role.foreign])
        self.units = {name: self._instantiate(archive, name) for name, archive in instances.items()}
        self.plant = self.units[PLANT]
        self.plant_axes = axes_of(plant)
        self._share_buffers()
        self._wire()
        self._parameterise(machine)

    def serves(self, machine: Machine, fmus: Path) -> bool:
        """Whether the units of a machine are the same, whatever values they have."""
        own = self.machine
        return (
            type(self) is System
            and tuple(machine.axes) == self.axes
            and not any(role.foreign for role in self.roles.values())
            and machine.plant == own.plant
            and machine.mounts_table == own.mounts_table
            and (machine.plant is machine.mounts_table is None or machine.modes.content == own.modes.content)
            and all(archive_path(machine, r.axis, r.role, fmus) == r.archive.path for r in self.roles.values())
        )

    def renew(self, machine: Machine) -> None:
        """Have the values of another machine that this system serves, as if just opened for it.

        InputError: a unit refuses a value.
        """
        self.machine = machine
        if machine.plant is machine.mounts_table is None:  # packed for its axes, the archive's own modes are others
            self.takes_modes = True
        self.roles = {
            name: replace(r, parameters=shipped_parameters(machine, r.axis, r.role)) for name, r in self.roles.items()
        }
        for buffer in self._buffers:
            buffer[:] = 0.0
        for unit in self.instances.values():
            unit.reset()
        self._parameterise(machine)

    def _parameterise(self, machine: Machine) -> None:
        self.plant.set_parameters(plant_parameters(machine, self.takes_modes))
        for name, role in self.roles.items():
            self.units[name].set_parameters(role.parameters)
            if RELEASE in role.signals:
                self.units[name].set_parameters({role.signals[RELEASE].name: True})

    def _fill(self, machine: Machine, fmus: Path) -> dict[str, RoleUnit]:
        """Instance -> what fills its role; nothing of it is executed yet."""
        wanted: list[tuple[str, str, Role]] = [
            (instance(axis), axis, role)
            for axis in self.axes
            for instance, role in ((controller, DRIVE), (friction, FRICTION_ROLE))
            if role is DRIVE or self.friction
        ]
        archives: dict[Path, Archive] = {}
        role_units: dict[str, RoleUnit] = {}
        problems: list[str] = []
        for name, axis, role in wanted:
            path = archive_path(machine, axis, role, fmus)
            try:
                if path not in archives:
                    archives[path] = Archive(path)
                    self._open.append(archives[path])
                role_units[name] = fill_role(machine, axis, role, archives[path])
            except InputError as error:
                problems += error.problems
        if problems:
            problems = list(dict.fromkeys(problems))
            raise InputError.of("the units cannot be used", problems)
        check_instances(role_units.values())
        return role_units

    def _instantiate(self, archive: Archive, name: str) -> Unit:
        role = self.roles.get(name)
        kind = UnloadedUnit if self.only_shipped and not is_shipped(archive) else Unit
        unit = kind(archive, name, role.signals if role is not None and role.foreign else None)
        unit.role = "" if role is None else f"{role.role.name} of {role.axis}"
        self._open.append(unit)
        return unit

    def _share_buffers(self) -> None:
        axes, count = self.axes, len(self.axes)

        def buffer() -> Floats:
            return np.zeros(count)

        self.M_a_start, self.M_a_end = buffer(), buffer()
        self.n_start, self.n, self.n_slope, self.n_slope_last = (buffer() for _ in range(4))
        # What the plant takes and gives lies together, for one call each.
        inputs, slopes, outputs = np.zeros(2 * count), np.zeros(2 * count), np.zeros(3 * count)
        own = self.M_a_start, self.M_a_end, self.n_start, self.n, self.n_slope, self.n_slope_last
        self._buffers = (*own, inputs, slopes, outputs)
        self.M_a, self.M_a_slope = inputs[:count], slopes[:count]
        self.M_fr, self.M_fr_slope = inputs[count:], slopes[count:]
        self.n_end, self.measured = outputs[:count], outputs[count:]
        contacts = [f"{axis}.n_fr" for axis in axes]
        measured = [f"{axis}.{y}" for axis in axes for y in ("x_a", "n_a")]
        self.plant_outputs = Port(self.plant, [*contacts, *measured], outputs)
        self._plant_inputs = inputs, slopes
        self.controllers: list[Control] = []
        for i, axis in enumerate(axes):
            name = controller(axis)
            role, control = self.roles[name], self.units[name]
            setpoint, both = (
                [name for name in group if name in role.signals] for group in (SETPOINT_INPUTS, MEASURED_INPUTS)
            )
            self.controllers.append(
                Control(
                    role=role,
                    unit=control,
                    setpoint=Port(control, setpoint),
                    measured=Port(control, both, self.measured[2 * i : 2 * i + len(both)]),
                    torque=Port(control, ["M_a"], self.M_a_end[i : i + 1], self.M_a_slope[i : i + 1]),
                )
            )

    def _wire(self) -> None:
        """What the units hand over to one another."""
        torques, frictions = ([f"{axis}.{torque}" for axis in self.axes] for torque in ("M_a", "M_fr"))
        self.plant_torque = Port(self.plant, torques, self.M_a, self.M_a_slope)
        self.plant_inputs = Port(self.plant, [*torques, *frictions], *self._plant_inputs)
        self.contacts: list[Contact] = []
        for i, axis in enumerate(self.axes if self.friction else ()):
            own = slice(i, i + 1)
            name = friction(axis)
            role, contact = self.roles[name], self.units[name]
            self.contacts.append(
                Contact(
                    role=role,
                    unit=contact,
                    speed=Port(contact, ["n_fr"], self.n[own], self.n_slope[own]),
                    speed_end=Port(contact, ["n_fr"], self.n_end[own]),
                    torque=Port(contact, ["M_fr"], self.M_fr[own], self.M_fr_slope[own]),
                )
            )

    def initialise(self, program: Program, stop: float) -> None:
        """Initialise every unit at t = 0 and bring the buffers to the initial outputs. The run ends at `stop` [s]."""
        self._enter_initialisation(stop)
        self.plant_outputs.get()
        self.n_start[:] = self.n[:] = self.n_end
        for contact in self.contacts:
            contact.speed.set()
            contact.torque.get()
        self.set_setpoints(program)
        for control in self.controllers:
            control.measured.set()
            control.torque.get()
        self.M_a[:] = self.M_a_end
        self.plant_inputs.set()
        self._exit_initialisation()

    def _enter_initialisation(self, stop: float) -> None:
        # Later than the last step's end by half a cycle, whatever the rounding of that is: units may compare to the
        # last bit, with a time that they sum up themselves.
        later = stop + 0.5 * self.machine.cycles.T_c
        for unit in self.instances.values():
            unit.enter_initialisation(0.0, later)
            unit.check_parameters()

    def _exit_initialisation(self) -> None:
        for unit in self.instances.values():
            unit.exit_initialisation()

    def set_setpoints(self, program: Program) -> None:
        """Hand over the first setpoints."""
        for axis, control in zip(self.axes, self.controllers, strict=True):
            columns = {"x_s": program.x_s[axis], "n_ffw": program.n_ffw[axis]}
            control.setpoint.values[:] = [columns[name][0] for name in control.setpoint.names]
            control.setpoint.set()

    @property
    def instances(self) -> Mapping[str, Unit]:
        """What there is to be initialised and to be given of, by its name."""
        return self.units

    @property
    def archives(self) -> dict[str, dict[str, str]]:
        """Instance -> GUID and version of its archive, and the name of one that is another maker's."""
        return {
            name: {"guid": unit.archive.guid, "version": unit.archive.version}
            | ({"name": unit.archive.path.stem} if name in self.roles and self.roles[name].foreign else {})
            for name, unit in self.instances.items()
        }

    @property
    def warnings(self) -> list[Finding]:
        archives = dict.fromkeys(unit.archive for unit in self.instances.values())
        ahead = [warning for archive in archives for warning in archive.warnings]
        ahead += (warning for role in self.roles.values() for warning in role.warnings)
        return [*ahead, *(warning for unit in self.instances.values() for warning in unit.warnings)]

    def close(self) -> None:
        for part in self._open:
            if isinstance(part, Unit):
                part.terminate()
        for part in reversed(self._open):
            part.close()
        self._open.clear()


def plant_parameters(machine: Machine, takes_modes: bool) -> dict[str, float | int | bool | str]:
    """Parameters of the plant unit by FMU name. `takes_modes`: in place of those of the archive."""
    parameters: dict[str, float | int | bool | str] = {}
    if takes_modes:
        parameters["modes_file"] = str(modes_file(machine.modes))
    for name, axis in machine.axes.items():
        parameters[f"{name}.x_0"] = machine.pose[name]
        parameters[f"{name}.M_0"] = axis.M_0
    return parameters | machine.errors
