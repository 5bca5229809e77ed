"""A scenario -> an SSP file: the units of Fig. 2 packed with machine and motion, their wiring and their parameters."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from feedsim.foundation.errors import Finding, InputError
from feedsim.foundation.outputs import TemporaryFolder
from feedsim.scenario import Machine, Scenario
from feedsim.scenario.model import SCHEMES
from feedsim.scenario.roles import DRIVE, FRICTION_ROLE, Role
from feedsim.simulation import judge
from feedsim.simulation.cosim import fmus_directory, system
from feedsim.simulation.cosim.archive import Archive, UnitDefinition
from feedsim.simulation.cosim.plant import axes_of
from feedsim.simulation.cosim.roles import RoleUnit, archive_path, fill_role
from feedsim.simulation.cosim.system import plant_parameters
from feedsim.simulation.cosim.unpacked import check_there
from feedsim.simulation.cosim.whole import UNIT, pack_whole
from feedsim.simulation.nc import Program, plan
from feedsim.simulation.ssp import archive, parameter_set, system_structure
from feedsim.simulation.ssp import rebuilt as described
from feedsim.simulation.ssp.parameter_set import ParameterSet, Value
from feedsim.simulation.ssp.roles import Roles, connector_faults
from feedsim.simulation.ssp.setpoints import pack_setpoints
from feedsim.simulation.ssp.system_structure import Binding, Component, Connector, Link, Structure
from feedsim.structure.pack import pack

# --- An SSP file of one component, the machine as one unit: written, and its parts separated where it is read ---------


# Parameters of the unit that decide what a run of it is, and what feedsim can run.
REQUIRED_PARAMETERS = {"motion.built_in": "its setpoints are those inside", "coupling.friction": "friction is on"}


def pack_one(scenario: Scenario, program: Program, fmus: Path, out: Path) -> None:
    """The unit with machine, motion and all parameters inside; errors as
    :func:`feedsim.simulation.cosim.whole.pack_whole`."""
    machine = scenario.machine
    pack_whole(
        fmus / f"{UNIT}.fmu", out, machine, coupling=scenario.coupling, program=program, trial=False,
        name=f"{machine.name}; motion: {scenario.name}", note=" ".join(filter(None, (scenario.note, machine.note))),
        model=scenario.name,
    )  # fmt: skip


def roles_of_one(structure: Structure, archives: Mapping[str, Archive], where: str) -> Roles | None:
    """Parts of the unit in their roles, as if they were components; None where no component is such a unit.

    Raises:
        InputError: it does not stand alone, or is connected.
    """
    names = [name for name, archive in archives.items() if archive.description.coSimulation.modelIdentifier == UNIT]
    if not names:
        return None
    name, archive = names[0], archives[names[0]]
    problems = [fault for component in structure.components
                for fault in connector_faults(component, archives[component.name], where)]  # fmt: skip
    problems += [f"{where}: {name} is a whole machine and stands alone here; there is {other}, too"
                 for other in archives if other != name]  # fmt: skip
    problems += [f"{where}: connection {link}: nothing is connected to a whole machine here; its motion is inside"
                 for link in structure.links]  # fmt: skip
    if problems:
        raise InputError.of(where, problems)
    axes = axes_of(archive)
    return Roles(
        setpoint=name,
        plant=name,
        drives={axis: f"{name}.{axis}.drive" for axis in axes},
        frictions={axis: f"{name}.{axis}.friction" for axis in axes},
        setpoints={axis: axis for axis in axes},
        foreign={},
    )


def coupling_of_one(result: Roles, values: Mapping[str, Mapping[str, Value]], where: str) -> dict[str, Any] | None:
    """How the unit's parts are exchanged, as a scenario has it; None where the parts are components of their own.

    Raises:
        InputError: a parameter of the unit is at what feedsim cannot run.
    """
    if result.setpoint != result.plant:
        return None
    given = values[result.plant]
    problems = [f"{where}: {result.plant}.{name} is {str(given.get(name)).lower()}; true is needed: {why}"
                for name, why in REQUIRED_PARAMETERS.items() if given.get(name) is not True]  # fmt: skip
    if problems:
        raise InputError.of(where, problems)
    scheme = int(given["coupling.scheme"])
    return {"scheme": list(SCHEMES)[scheme], "substeps": int(given["coupling.substeps"]), "units": "one"}


def split_one(
    result: Roles, archives: Mapping[str, Archive], values: Mapping[str, Mapping[str, Value]]
) -> tuple[dict[str, Archive], dict[str, dict[str, Value]]]:
    """Archives and values by part, with the names that units of their own have."""
    archive, given = archives[result.plant], values[result.plant]
    parts, by_part = {result.plant: archive}, {result.plant: dict(given)}
    for name in (*result.drives.values(), *result.frictions.values()):
        prefix = f"{name.removeprefix(f'{result.plant}.')}."
        parts[name] = archive.part(prefix)
        by_part[name] = {key.removeprefix(prefix): value for key, value in given.items() if key.startswith(prefix)}
    return parts, by_part


# --- A scenario -> an SSP file: the units of Fig. 2 packed with machine and motion, their wiring and their
#     parameters


SETPOINT_INSTANCE = "setpoint"  # the instance that plays the setpoints
RESOURCES = "resources"
# of a component and between them, in a picture [mm]
COMPONENT_WIDTH, COMPONENT_HEIGHT, COMPONENT_GAP = 40.0, 30.0, 20.0


@dataclass(frozen=True)
class ExportedSystem:
    """An SSP file. `instances`: components in it; `platforms`: folders of binaries/ that all its
    archives have; `warnings`: what a user should know before running it."""

    path: Path
    size: int  # bytes
    instances: tuple[str, ...]
    duration: float  # s
    platforms: tuple[str, ...]
    warnings: tuple[Finding, ...]


def export(scenario: Scenario, out: Path, *, fmus: Path | None = None) -> ExportedSystem:
    """Write `scenario` to the SSP file `out`, whole or not at all; the same bytes for the same scenario and archives.

    fmus: folder with the archives of the units; default :func:`feedsim.simulation.cosim.fmus_directory`.

    Raises:
        InputError: the motion violates a limit, an archive is missing, a unit refuses its parameters, or there are
            loads, which no unit of an SSP plays.
        OutputError: `out` cannot be written.
    """
    if scenario.loads:
        raise InputError(
            f"{scenario.at('loads')}: an SSP file holds no loads; leave them out with --set loads=[], and connect the "
            "plant's inputs there"
        )
    program = plan(scenario)
    fmus = fmus or fmus_directory()
    warnings = judge.check(scenario, program, fmus=fmus)
    with TemporaryFolder() as folder, ExitStack() as stack:
        if scenario.coupling.units == "one":
            pack_one(scenario, program, fmus, folder / f"{UNIT}.fmu")
            content, instances = {UNIT: (folder / f"{UNIT}.fmu").read_bytes()}, {UNIT: UNIT}
        else:
            sources = _sources(scenario.machine, fmus)
            content = _archives(scenario, program, fmus, sources, folder)
            instances = _instances(scenario.machine, fmus, sources)
        archives = {name: stack.enter_context(Archive(folder / f"{name}.fmu")) for name in content}
        files = _files(scenario, program, archives, instances)
        platforms = sorted(set.intersection(*(set(entry.platforms) for entry in archives.values())))
    files |= {f"{RESOURCES}/{name}.fmu": data for name, data in content.items()}
    files |= {name: path.read_bytes() for name, path in described.recordings(scenario).items()}
    if (structure := described.structure(scenario)) is not None:
        files[described.STRUCTURE] = structure
    size = archive.write(out, files)
    return ExportedSystem(out, size, tuple(instances), program.duration, tuple(platforms), warnings)


def _sources(machine: Machine, fmus: Path) -> dict[Path, str]:
    """Archives of drives and frictions -> their names inside the SSP, each archive once."""
    names: dict[Path, str] = {}
    for role in (DRIVE, FRICTION_ROLE):
        for axis in machine.axes:
            path = archive_path(machine, axis, role, fmus)
            stem = role.shipped if path == fmus / f"{role.shipped}.fmu" else path.stem
            taken = {SETPOINT_INSTANCE, "plant", *(other for at, other in names.items() if at != path)}
            taken |= {"controller", "friction"} if path.parent != fmus else set()
            free = (name for name in (stem, *(f"{stem}_{i}" for i in range(2, 100))) if name not in taken)
            names.setdefault(path, next(free))
    return names


def _archives(
    scenario: Scenario, program: Program, fmus: Path, sources: Mapping[Path, str], folder: Path
) -> dict[str, bytes]:
    """Bytes of the archives by name, in the order of the signal flow; they are left in `folder` too."""
    machine = scenario.machine
    plant, setpoint = machine.plant or fmus / "plant.fmu", fmus / f"{SETPOINT_INSTANCE}.fmu"
    for path in (plant, *sources, setpoint):
        check_there(path)
    if machine.plant is not None:
        (folder / "plant.fmu").write_bytes(machine.plant.read_bytes())
    else:
        pose = {axis: machine.pose[axis] for axis in machine.axes}
        pack(
            plant, folder / "plant.fmu", modes=machine.modes, pose=pose, mounts=machine.mounts_table,
            name=machine.name, note=machine.note, trial=False,
        )  # fmt: skip
    pack_setpoints(setpoint, folder / "setpoint.fmu", program, name=scenario.name, note=scenario.note)
    for path, name in sources.items():
        (folder / f"{name}.fmu").write_bytes(path.read_bytes())
    drives = dict.fromkeys(sources[archive_path(machine, axis, DRIVE, fmus)] for axis in machine.axes)
    others = [name for name in sources.values() if name not in drives]
    return {name: (folder / f"{name}.fmu").read_bytes() for name in (SETPOINT_INSTANCE, *drives, "plant", *others)}


def _instances(machine: Machine, fmus: Path, sources: Mapping[Path, str]) -> dict[str, str]:
    """Instance -> name of its archive, in the order of the signal flow."""

    def name(axis: str, role: Role) -> str:
        return sources[archive_path(machine, axis, role, fmus)]

    return {
        SETPOINT_INSTANCE: SETPOINT_INSTANCE,
        **{system.controller(axis): name(axis, DRIVE) for axis in machine.axes},
        system.PLANT: "plant",
        **{system.friction(axis): name(axis, FRICTION_ROLE) for axis in machine.axes},
    }


def _files(
    scenario: Scenario, program: Program, archives: Mapping[str, Archive], instances: Mapping[str, str]
) -> dict[str, bytes]:
    """The system structure and the parameter sets."""
    machine = scenario.machine
    axes = tuple(machine.axes)
    units: dict[str, RoleUnit] = {}
    whole = UNIT in instances  # which has its parameters inside, and nothing to be connected
    for axis in () if whole else axes:
        for role, instance in ((DRIVE, system.controller(axis)), (FRICTION_ROLE, system.friction(axis))):
            units[instance] = fill_role(machine, axis, role, archives[instances[instance]])
    parameters: dict[str, Mapping[str, Value]] = {} if whole else {system.PLANT: plant_parameters(machine, False)}
    parameters |= {instance: unit.parameters for instance, unit in units.items()}

    def end(variable: system.Variable) -> tuple[str, str]:
        if variable.instance == system.NC:
            return SETPOINT_INSTANCE, variable.name
        unit = units.get(variable.instance)
        return variable.instance, variable.name if unit is None else unit.signals[variable.name].name

    links = tuple(
        Link(end(connection.source), end(connection.target))
        for connection in system.figure_2(() if whole else axes, given={n: unit.signals for n, unit in units.items()})
        if connection.source.instance != system.ZERO  # an input that nothing drives keeps its start value, 0
    )
    components, files = [], {}
    for instance, name in instances.items():
        bindings: tuple[Binding, ...] = ()
        if instance in parameters:
            source = f"{RESOURCES}/{instance}.ssv"
            files[source] = _parameters(archives[name], parameters[instance], machine.note)
            bindings = (Binding(source=source),)
        connected = {end[1] for link in links for end in (link.start, link.end) if end[0] == instance}
        connectors = _connectors(archives[name], connected)
        box = _box(instance, axes)
        components.append(Component(instance, f"{RESOURCES}/{name}.fmu", connectors, bindings, box))
    structure = Structure(
        name=_identifier(scenario.name),
        components=tuple(components),
        links=links,
        units=_definitions(
            archives.values(), [c.unit for component in components for c in component.connectors if c.unit]
        ),
        stop=program.duration,
        step=float(archives[UNIT].description.defaultExperiment.stepSize) if whole else machine.cycles.T_c,
        scenario=described.text(scenario),
        description=" ".join(filter(None, (f"{scenario.name}.", scenario.note, machine.note))),
        tool="feedsim",
    )
    return {archive.STRUCTURE: system_structure.to_bytes(structure), **files}


def _box(instance: str, axes: tuple[str, ...]) -> tuple[float, float, float, float]:
    """Place in a picture: the signal flow from the left to the right, the axes from the top to the bottom."""
    if instance == UNIT:
        return 0.0, -COMPONENT_HEIGHT, COMPONENT_WIDTH, 0.0
    rows = {name(axis): i for i, axis in enumerate(axes) for name in (system.controller, system.friction)}
    kind = instance if instance not in rows else "friction" if instance.startswith("friction") else "controller"
    left = (COMPONENT_WIDTH + COMPONENT_GAP) * (SETPOINT_INSTANCE, "controller", system.PLANT, "friction").index(kind)
    first, last = (rows[instance],) * 2 if instance in rows else (0, len(axes) - 1)
    return (
        left,
        -(COMPONENT_HEIGHT + COMPONENT_GAP) * last - COMPONENT_HEIGHT,
        left + COMPONENT_WIDTH,
        -(COMPONENT_HEIGHT + COMPONENT_GAP) * first,
    )


def _identifier(name: str) -> str:
    """A name as OMSimulator takes one: a letter, then letters, digits and _; the readable one is in the description."""
    return re.sub(r"[^A-Za-z0-9]+", "_", re.sub(r"^[^A-Za-z]+", "", name)).strip("_") or "system"


def _connectors(unit: Archive, connected: set[str]) -> tuple[Connector, ...]:
    """Connectors of a unit: every Real output, and whatever is connected; FMPy fails at inputs that are not."""
    return tuple(
        Connector(name, variable.causality, variable.type, _unit_of(unit, name))
        for name, variable in unit.variables.items()
        if name in connected or (variable.type == "Real" and variable.causality == "output")
    )


def _unit_of(unit: Archive, name: str) -> str | None:
    """The unit of a Real variable; None where it declares none: simulators refuse "1" against m."""
    return unit.declared_unit(name) if unit.variables[name].type == "Real" else None


def _parameters(unit: Archive, values: Mapping[str, Value], note: str) -> bytes:
    """A parameter set in the order of the unit's variables, with the machine's note: where the numbers come from."""
    parameters = tuple(
        parameter_set.parameter(name, variable.type, values[name], _unit_of(unit, name))
        for name, variable in unit.variables.items()
        if name in values
    )
    used = [parameter.unit for parameter in parameters if parameter.unit]
    return parameter_set.to_bytes(ParameterSet(parameters, _definitions([unit], used), note))


def _definitions(archives: Iterable[Archive], used: Iterable[str]) -> dict[str, UnitDefinition]:
    """Definitions of the units that are used, as the archives have them."""
    known = {name: unit_definition for unit in archives for name, unit_definition in unit.unit_definitions.items()}
    return {name: known.get(name, UnitDefinition({})) for name in dict.fromkeys(used)}
