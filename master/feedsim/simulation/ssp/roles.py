"""Which component of an SSP plays which role in Fig. 2: found from the wiring around the plant, whatever the names of
components and, in the roles of drive and friction, of their variables. Anything else than Fig. 2 is refused."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass

from feedsim.foundation import units
from feedsim.foundation.errors import InputError
from feedsim.scenario.roles import DRIVE, FRICTION_ROLE, Role
from feedsim.simulation.cosim import system
from feedsim.simulation.cosim.archive import Archive
from feedsim.simulation.cosim.plant import axes_of
from feedsim.simulation.ssp.system_structure import Component, Link, Structure

End = tuple[str, str]  # component, variable
TORQUES = {"M_a": DRIVE, "M_fr": FRICTION_ROLE}  # inputs of the plant on an axis -> role of what drives them


@dataclass(frozen=True)
class Roles:
    """Names of components by their part.

    drives, frictions: axis of the plant -> component. setpoints: axis of the plant -> axis of the setpoint unit.
    foreign: component -> signal of its role -> variable, of components that are not the shipped units.
    """

    setpoint: str
    plant: str
    drives: Mapping[str, str]
    frictions: Mapping[str, str]
    setpoints: Mapping[str, str]
    foreign: Mapping[str, Mapping[str, str]]

    @property
    def axes(self) -> tuple[str, ...]:
        return tuple(self.drives)

    @property
    def shipped_drives(self) -> tuple[str, ...]:
        return tuple(name for name in self.drives.values() if name not in self.foreign)

    @property
    def shipped_frictions(self) -> tuple[str, ...]:
        return tuple(name for name in self.frictions.values() if name not in self.foreign)


def roles(structure: Structure, archives: Mapping[str, Archive], where: str) -> Roles:
    """The roles of the components; `archives` by component.

    Raises:
        InputError: lists every component that plays no role or is there too often or not at all, every connection that
            is missing, double, other than Fig. 2's or of two units of measure.
    """
    problems: list[str] = []
    for kind in ("plant", "setpoint"):
        result = [name for name, archive in archives.items() if _kind(archive) == kind]
        if len(result) != 1:
            problems.append(
                f"{where}: one component made from {kind}.fmu is needed; there "
                f"{'is none' if not result else 'are ' + ', '.join(result)}"
            )
    for component in structure.components:
        problems += connector_faults(component, archives[component.name], where)
    problems += [f"{where}: connection {link}: a transformation is not carried out here" for link in structure.links
                 if link.transformed]  # fmt: skip
    driven: dict[End, End] = {}
    for link in structure.links:
        _drive(driven, link, archives, where, problems)
    if problems:
        raise InputError.of(where, problems)
    return _assign_roles(driven, archives, where)


def _kind(archive: Archive) -> str:
    return str(archive.description.modelName)


def _is_shipped(archive: Archive, role: Role) -> bool:
    """By its name and its variables: a unit that calls itself alike, and is another one, is foreign."""
    if _kind(archive) in dict(role.others).values():
        return all(name in archive.variables for name, signal in role.signals.items() if signal.needed)
    return _kind(archive) == role.shipped and all(signal in archive.variables for signal in role.signals)


def connector_faults(component: Component, archive: Archive, where: str) -> list[str]:
    """What the SSP says of a component's variables and its archive does not."""
    faults = []
    for connector in component.connectors:
        place = f"{where}: {component.name}.{connector.name}"
        variable = archive.variables.get(connector.name)
        if variable is None:
            faults.append(f"{place}: {archive.path.name} has no such variable")
        elif connector.kind in ("input", "output") and variable.causality != connector.kind:
            faults.append(f"{place}: is no {connector.kind} of {archive.path.name} but {variable.causality}")
        elif connector.unit is not None and connector.unit != archive.unit_of(connector.name):
            faults.append(
                f"{place}: is in {connector.unit} according to the SSP, and in {archive.unit_of(connector.name)} "
                f"according to {archive.path.name}"
            )
    return faults


def _drive(
    driven: dict[End, End], link: Link, archives: Mapping[str, Archive], where: str, problems: list[str]
) -> None:
    """Enter a connection as input <- output."""
    ends = [link.start, link.end]
    unknown = []
    for element, connector in ends:
        if element == "":
            continue
        if element not in archives:
            unknown.append(f"there is no component {element!r}")
        elif connector not in archives[element].variables:
            unknown.append(f"{element} has no variable {connector!r}")
    if unknown:
        problems.append(f"{where}: connection {link}: {'; '.join(unknown)}")
        return
    sides = {end: archives[end[0]].variables[end[1]].causality for end in ends if end[0]}
    if len(sides) < 2 and "input" not in sides.values():
        return  # an output handed on to the outside, where nobody is
    inputs = [end for end, side in sides.items() if side == "input"]
    outputs = [end for end, side in sides.items() if side == "output"]
    if len(inputs) != 1 or len(outputs) != 1:
        said = "; ".join(f"{'.'.join(end)} is {side}" for end, side in sides.items())
        outside = " and the other end is outside the system" if len(sides) < 2 else ""
        problems.append(f"{where}: connection {link}: an output and an input are needed; {said}{outside}")
        return
    target, source = inputs[0], outputs[0]
    if target in driven:
        problems.append(f"{where}: {'.'.join(target)} is connected twice: to {'.'.join(driven[target])} and to "
                        f"{'.'.join(source)}")  # fmt: skip
        return
    driven[target] = source
    (unit, dimensions), (given, others) = (_unit(archives[name], variable) for name, variable in (target, source))
    if None in (unit, given):
        return  # an end that declares none is in SI units, as the shipped units are
    if unit != given and (not dimensions & others or link.unconverted):
        kept = ", and the connection forbids to convert" if dimensions & others else ""
        problems.append(f"{where}: {'.'.join(target)} is in {unit}, but {'.'.join(source)} is in {given}{kept}")


def _unit(archive: Archive, variable: str) -> tuple[str | None, set[str]]:
    """The unit of a variable, None where it declares none that is known, and its dimension as the archive defines it
    and as its name has it: exporters leave out definitions, or radians in them."""
    unit = archive.declared_unit(variable)
    definition = archive.unit_definitions.get(unit or "")
    dimensions = set()
    for text in (unit, None if definition is None else definition.text):
        with suppress(InputError):
            dimensions |= {units.unit(text).dimension} if text is not None else set()
    return unit, dimensions


def _assign_roles(driven: Mapping[End, End], archives: Mapping[str, Archive], where: str) -> Roles:
    """Roles by the torques that drive the plant, then signals by what the roles' inputs are connected to."""
    plant, setpoint = (
        next(name for name, archive in archives.items() if _kind(archive) == kind) for kind in ("plant", "setpoint")
    )
    problems: list[str] = []
    outputs: dict[str, End] = {}  # input of the plant -> what drives it
    partners: dict[Role, dict[str, str]] = {DRIVE: {}, FRICTION_ROLE: {}}
    for axis in axes_of(archives[plant]):
        for torque, role in TORQUES.items():
            source = driven.get((plant, f"{axis}.{torque}"))
            belongs = f"the output {torque} of a {role.shipped} belongs there"
            if source is None:
                problems.append(f"{where}: {plant}.{axis}.{torque} is not connected; {belongs}")
            elif source[0] in (plant, setpoint) or (_kind(archives[source[0]]) == role.shipped and source[1] != torque
                                                    and _is_shipped(archives[source[0]], role)):  # fmt: skip
                problems.append(f"{where}: {plant}.{axis}.{torque} is connected to {'.'.join(source)}; {belongs}")
            else:
                outputs[f"{axis}.{torque}"] = source
                partners[role][axis] = source[0]
    names = [name for partner in partners.values() for name in partner.values()]
    for axes in (list(partner.values()) for partner in partners.values()):
        problems += [f"{where}: {name} drives {axes.count(name)} axes; one is allowed" for name in dict.fromkeys(axes)
                     if axes.count(name) > 1]  # fmt: skip
    problems += [f"{where}: {name} is connected as drive and as friction; one is allowed"
                 for name in partners[DRIVE].values() if name in partners[FRICTION_ROLE].values()]  # fmt: skip
    problems += [f"{where}: component {name} drives no axis" for name in archives
                 if name not in (plant, setpoint, *names) and not problems]  # fmt: skip
    if problems:
        raise InputError.of(where, problems)
    setpoints = {axis: _setpoint_axis(driven, name, setpoint) or axis for axis, name in partners[DRIVE].items()}
    foreign: dict[str, dict[str, str]] = {}
    for role, value in partners.items():
        torque = next(name for name, entry in TORQUES.items() if entry is role)
        for axis, name in value.items():
            if not _is_shipped(archives[name], role):
                offered = _offered_signals(axis, role, plant, setpoint, setpoints[axis])
                foreign[name] = {torque: outputs[f"{axis}.{torque}"][1]}
                foreign[name] |= _signals(driven, name, role, offered, where, problems)
    assigned = Roles(setpoint, plant, partners[DRIVE], partners[FRICTION_ROLE], setpoints, foreign)
    problems += _other_wiring(driven, assigned, where)
    if problems:
        raise InputError.of(where, problems)
    return assigned


def _setpoint_axis(driven: Mapping[End, End], drive: str, setpoint: str) -> str | None:
    """The axis of the setpoint unit whose x_s the drive gets."""
    sources = [source for target, source in driven.items() if target[0] == drive and source[0] == setpoint]
    return next((variable.removesuffix(".x_s") for _, variable in sources if variable.endswith(".x_s")), None)


def _offered_signals(axis: str, role: Role, plant: str, setpoint: str, setpoint_axis: str) -> dict[End, str]:
    """What the system has for the inputs of a role: where it comes from -> signal."""
    places = {system.PLANT: (plant, axis), system.NC: (setpoint, setpoint_axis)}
    instance = system.controller(axis) if role is DRIVE else system.friction(axis)
    result: dict[End, str] = {}
    for connection in system.figure_2((axis,)):
        if connection.target.instance == instance and connection.source.instance in places:
            component, prefix = places[connection.source.instance]
            result[component, f"{prefix}.{connection.target.name}"] = connection.target.name
    return result


def _signals(
    driven: Mapping[End, End], name: str, role: Role, offered: Mapping[End, str], where: str, problems: list[str]
) -> dict[str, str]:
    """Signal -> variable of the component, by what its inputs are connected to."""
    result: dict[str, str] = {}
    for (component, variable), source in driven.items():
        if component != name:
            continue
        signal = offered.get(source)
        if signal is None:
            listed = ", ".join(".".join(end) for end in offered)
            problems.append(f"{where}: {name}.{variable} is connected to {'.'.join(source)}; a {role.name} of its axis "
                            f"can be given {listed}")  # fmt: skip
        elif signal in result:
            problems.append(f"{where}: {'.'.join(source)} drives {name}.{result[signal]} and {name}.{variable}; "
                            "one is allowed")  # fmt: skip
        else:
            result[signal] = variable
    ends = {signal: end for end, signal in offered.items()}
    problems += [
        f"{where}: nothing of {name} is connected to {'.'.join(ends[signal.name])}; the {role.name} of an axis needs it"
        for signal in role.inputs
        if signal.needed and signal.name not in result
    ]
    return result


def _other_wiring(driven: Mapping[End, End], result: Roles, where: str) -> list[str]:
    """Every difference from Fig. 2."""
    names = {system.PLANT: result.plant}
    names |= {system.controller(axis): name for axis, name in result.drives.items()}
    names |= {system.friction(axis): name for axis, name in result.frictions.items()}

    def end(variable: system.Variable) -> End:
        if variable.instance == system.NC:
            axis, _, name = variable.name.rpartition(".")
            return result.setpoint, f"{result.setpoints[axis]}.{name}"
        return names[variable.instance], variable.name

    problems = []
    for connection in system.figure_2(result.axes):
        target = end(connection.target)
        if target[0] in result.foreign or names.get(connection.source.instance) in result.foreign:
            continue
        given = driven.get(target)
        if connection.source.instance == system.ZERO:
            if given is not None:
                problems.append(
                    f"{where}: {'.'.join(target)} is connected to {'.'.join(given)}; nothing drives it here"
                )
            continue
        wanted = end(connection.source)
        if given is None and connection.target.name == system.RELEASE:
            continue  # true then, as it is with a setpoint unit
        if given is None:
            problems.append(f"{where}: {'.'.join(target)} is not connected; {'.'.join(wanted)} belongs there")
        elif given != wanted:
            problems.append(
                f"{where}: {'.'.join(target)} is connected to {'.'.join(given)}; {'.'.join(wanted)} belongs there"
            )
    return problems
