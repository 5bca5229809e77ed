"""A scenario -> an SSP file: the units of Fig. 2 packed with machine and motion, their wiring and their parameters."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from feedsim.cosim import check, fmus_directory, wiring
from feedsim.cosim.system import controller_parameters, plant_parameters
from feedsim.cosim.unit import Archive
from feedsim.errors import InputError
from feedsim.nc import Program, plan
from feedsim.scenario import Scenario
from feedsim.ssp import archive, described, parameter_set, system_structure
from feedsim.ssp.pack import pack_setpoints
from feedsim.ssp.parameter_set import ParameterSet, Value
from feedsim.ssp.system_structure import Binding, Component, Connector, Link, Structure
from feedsim.ssp.unit_definition import UnitDefinition, unit_definitions
from feedsim.structure.pack import pack

SETPOINT = "setpoint"  # the instance that plays the setpoints
RESOURCES = "resources"
WIDTH, HEIGHT, GAP = 40.0, 30.0, 20.0  # of a component and between them, in a picture [mm]


@dataclass(frozen=True)
class Exported:
    """An SSP file. `instances`: components in it; `platforms`: folders of binaries/ that all its
    archives have; `warnings`: what a user should know before running it."""

    path: Path
    size: int  # bytes
    instances: tuple[str, ...]
    duration: float  # s
    platforms: tuple[str, ...]
    warnings: tuple[str, ...]


def export(scenario: Scenario, out: Path, *, program: Program | None = None, fmus: Path | None = None) -> Exported:
    """Write `scenario` to the SSP file `out`, whole or not at all; the same bytes for the same scenario and archives.

    Args:
        program: the scenario's planned motions, where they are at hand already.
        fmus: folder with the archives of the four units; default :func:`feedsim.cosim.fmus_directory`.

    Raises:
        InputError: the motion violates a limit, an archive is missing, or a unit refuses its parameters.
        OutputError: `out` cannot be written.
    """
    program = program or plan(scenario)
    fmus = fmus or fmus_directory()
    warnings = check(scenario, program, fmus=fmus)
    with tempfile.TemporaryDirectory(prefix="feedsim-") as folder, ExitStack() as stack:
        content = _archives(scenario, program, fmus, Path(folder))
        archives = {kind: stack.enter_context(Archive(Path(folder) / f"{kind}.fmu")) for kind in content}
        files = _files(scenario, program, archives)
        platforms = sorted(set.intersection(*(set(each.platforms) for each in archives.values())))
    files |= {f"{RESOURCES}/{kind}.fmu": data for kind, data in content.items()}
    files |= {name: path.read_bytes() for name, path in described.recordings(scenario).items()}
    if (structure := described.structure(scenario)) is not None:
        files[described.STRUCTURE] = structure
    size = archive.write(out, files)
    instances = tuple(name for name, _ in _instances(tuple(scenario.machine.axes)))
    return Exported(out, size, instances, program.duration, tuple(platforms), warnings)


def _archives(scenario: Scenario, program: Program, fmus: Path, folder: Path) -> dict[str, bytes]:
    """Bytes of the four archives, which are left in `folder` too."""
    machine = scenario.machine
    missing = [fmus / f"{kind}.fmu" for kind in ("plant", "controller", "friction", "setpoint")]
    if machine.plant is not None:
        missing[0] = machine.plant
    if missing := [path for path in missing if not path.is_file()]:
        raise InputError(
            f"{missing[0]}: no such file; `make fmus` builds the archives, FEEDSIM_FMUS names their folder"
        )
    if machine.plant is not None:
        (folder / "plant.fmu").write_bytes(machine.plant.read_bytes())
    else:
        pose = {axis: machine.pose[axis] for axis in machine.axes}
        pack(
            fmus / "plant.fmu", folder / "plant.fmu", modes=machine.modes, pose=pose, name=machine.name,
            note=machine.note, trial=False,
        )  # fmt: skip
    pack_setpoints(fmus / "setpoint.fmu", folder / "setpoint.fmu", program, name=scenario.name, note=scenario.note)
    for kind in ("controller", "friction"):
        (folder / f"{kind}.fmu").write_bytes((fmus / f"{kind}.fmu").read_bytes())
    return {kind: (folder / f"{kind}.fmu").read_bytes() for kind in ("setpoint", "controller", "plant", "friction")}


def _instances(axes: tuple[str, ...]) -> list[tuple[str, str]]:
    """Instance and kind of its archive, in the order of the signal flow."""
    return [
        (SETPOINT, "setpoint"),
        *((wiring.controller(axis), "controller") for axis in axes),
        (wiring.PLANT, "plant"),
        *((wiring.friction(axis), "friction") for axis in axes),
    ]


def _files(scenario: Scenario, program: Program, archives: Mapping[str, Archive]) -> dict[str, bytes]:
    """The system structure and the parameter sets."""
    machine = scenario.machine
    axes = tuple(machine.axes)
    parameters = {wiring.PLANT: plant_parameters(machine, None)}
    for name, axis in machine.axes.items():
        parameters[wiring.controller(name)] = controller_parameters(machine, axis)
        parameters[wiring.friction(name)] = axis.friction.parameters()
    links = tuple(
        Link(_end(connection.source), _end(connection.target))
        for connection in wiring.figure_2(axes)
        if connection.source.instance != wiring.ZERO  # an input that nothing drives keeps its start value, 0
    )
    components, files = [], {}
    for instance, kind in _instances(axes):
        bindings: tuple[Binding, ...] = ()
        if instance in parameters:
            source = f"{RESOURCES}/{instance}.ssv"
            files[source] = _parameters(archives[kind], parameters[instance], machine.note)
            bindings = (Binding(source=source),)
        connected = {end[1] for link in links for end in (link.start, link.end) if end[0] == instance}
        connectors = _connectors(archives[kind], connected)
        box = _box(instance, kind, axes)
        components.append(Component(instance, f"{RESOURCES}/{kind}.fmu", connectors, bindings, box))
    structure = Structure(
        name=scenario.name,
        components=tuple(components),
        links=links,
        units=_definitions(
            archives.values(), [c.unit for component in components for c in component.connectors if c.unit]
        ),
        stop=program.duration,
        step=machine.cycles.T_c,
        scenario=described.text(scenario),
        description=" ".join(filter(None, (scenario.note, machine.note))),
        tool="feedsim",
    )
    return {archive.STRUCTURE: system_structure.to_bytes(structure), **files}


def _box(instance: str, kind: str, axes: tuple[str, ...]) -> tuple[float, float, float, float]:
    """Place in a picture: the signal flow from the left to the right, the axes from the top to the bottom."""
    left = (WIDTH + GAP) * ("setpoint", "controller", "plant", "friction").index(kind)
    row = {name(axis): i for i, axis in enumerate(axes) for name in (wiring.controller, wiring.friction)}.get(instance)
    first, last = (0, len(axes) - 1) if row is None else (row, row)
    return left, -(HEIGHT + GAP) * last - HEIGHT, left + WIDTH, -(HEIGHT + GAP) * first


def _end(variable: wiring.Variable) -> tuple[str, str]:
    return (SETPOINT if variable.instance == wiring.NC else variable.instance, variable.name)


def _connectors(unit: Archive, connected: set[str]) -> tuple[Connector, ...]:
    """Connectors of a unit: every Real output, and whatever is connected; FMPy fails at inputs that are not."""
    return tuple(
        Connector(name, variable.causality, variable.type, unit.unit_of(name) if variable.type == "Real" else None)
        for name, variable in unit.variables.items()
        if name in connected or (variable.type == "Real" and variable.causality == "output")
    )


def _parameters(unit: Archive, values: Mapping[str, Value], note: str) -> bytes:
    """A parameter set in the order of the unit's variables, with the machine's note: where the numbers come from."""
    found = tuple(
        parameter_set.parameter(
            name, variable.type, values[name], unit.unit_of(name) if variable.type == "Real" else None
        )
        for name, variable in unit.variables.items()
        if name in values
    )
    used = [parameter.unit for parameter in found if parameter.unit]
    return parameter_set.to_bytes(ParameterSet(found, _definitions([unit], used), note))


def _definitions(archives: Iterable[Archive], used: Iterable[str]) -> dict[str, UnitDefinition]:
    """Definitions of the units that are used, as the archives have them."""
    known = {name: each for unit in archives for name, each in unit_definitions(unit).items()}
    return {name: known.get(name, UnitDefinition({})) for name in dict.fromkeys(used)}
