"""Which component of an SSP plays which part in Fig. 2, whatever the names; anything else than Fig. 2 is refused."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from feedsim.cosim import wiring
from feedsim.cosim.plant import axes_of
from feedsim.cosim.unit import Archive
from feedsim.errors import InputError
from feedsim.ssp.system_structure import Component, Link, Structure

KINDS = ("setpoint", "controller", "plant", "friction")
End = tuple[str, str]  # component, variable


@dataclass(frozen=True)
class Roles:
    """Names of components by their part.

    controllers, frictions: axis of the plant -> component. setpoints: axis of the plant -> axis of the setpoint unit.
    """

    setpoint: str
    plant: str
    controllers: Mapping[str, str]
    frictions: Mapping[str, str]
    setpoints: Mapping[str, str]

    @property
    def axes(self) -> tuple[str, ...]:
        return tuple(self.controllers)


def roles(structure: Structure, archives: Mapping[str, Archive], where: str) -> Roles:
    """The roles of the components; `archives` by component.

    Raises:
        InputError: lists every component that is no unit of Fig. 2 or there too often or not at all, every connection
            that is missing, double, other than Fig. 2's or of two units of measure.
    """
    kinds = {name: str(archive.description.modelName) for name, archive in archives.items()}
    problems = [
        f"{where}: component {name} is a {kind!r}; only {', '.join(KINDS)} can be run here"
        for name, kind in kinds.items()
        if kind not in KINDS
    ]
    for kind in ("plant", "setpoint"):
        found = [name for name in kinds if kinds[name] == kind]
        if len(found) != 1:
            problems.append(
                f"{where}: one component made from {kind}.fmu is needed; there "
                f"{'is none' if not found else 'are ' + ', '.join(found)}"
            )
    for component in structure.components:
        problems += _connector_faults(component, archives[component.name], where)
    problems += [f"{where}: connection {link}: a transformation is not carried out here" for link in structure.links
                 if link.transformed]  # fmt: skip
    driven: dict[End, End] = {}
    for link in structure.links:
        _drive(driven, link, archives, where, problems)
    if problems:
        raise InputError.of(where, problems)
    return _assigned(driven, archives, kinds, where)


def _connector_faults(component: Component, archive: Archive, where: str) -> list[str]:
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
    units = [archives[end[0]].unit_of(end[1]) for end in (target, source)]
    if units[0] != units[1]:
        problems.append(f"{where}: {'.'.join(target)} is in {units[0]}, but {'.'.join(source)} is in {units[1]}")


def _assigned(
    driven: Mapping[End, End], archives: Mapping[str, Archive], kinds: Mapping[str, str], where: str
) -> Roles:
    """Roles by the torques that drive the plant; then every connection of Fig. 2 is looked for."""
    plant, setpoint = (next(name for name in kinds if kinds[name] == kind) for kind in ("plant", "setpoint"))
    problems: list[str] = []
    partners: dict[str, dict[str, str]] = {"controller": {}, "friction": {}}
    for axis in axes_of(archives[plant]):
        for kind, torque in (("controller", "M_a"), ("friction", "M_fr")):
            source = driven.get((plant, f"{axis}.{torque}"))
            if source is None:
                problems.append(f"{where}: {plant}.{axis}.{torque} is not connected; the output {torque} of a {kind} "
                                "belongs there")  # fmt: skip
            elif kinds[source[0]] != kind or source[1] != torque:
                problems.append(f"{where}: {plant}.{axis}.{torque} is connected to {'.'.join(source)}; the output "
                                f"{torque} of a {kind} belongs there")  # fmt: skip
            else:
                partners[kind][axis] = source[0]
    for kind, found in partners.items():
        names = list(found.values())
        problems += [f"{where}: {name} drives {names.count(name)} axes; one is allowed" for name in dict.fromkeys(names)
                     if names.count(name) > 1]  # fmt: skip
        problems += [f"{where}: component {name} drives no axis" for name in kinds
                     if kinds[name] == kind and name not in names and not problems]  # fmt: skip
    if problems:
        raise InputError.of(where, problems)
    setpoints = {}
    for axis, control in partners["controller"].items():
        source = driven.get((control, "x_s"), ("", ""))
        setpoints[axis] = source[1].removesuffix(".x_s") if source[0] == setpoint else axis
    assigned = Roles(setpoint, plant, partners["controller"], partners["friction"], setpoints)
    if problems := _other_wiring(driven, assigned, where):
        raise InputError.of(where, problems)
    return assigned


def _other_wiring(driven: Mapping[End, End], found: Roles, where: str) -> list[str]:
    """Every difference from Fig. 2."""

    def end(variable: wiring.Variable) -> End:
        if variable.instance == wiring.NC:
            axis, _, name = variable.name.rpartition(".")
            return found.setpoint, f"{found.setpoints[axis]}.{name}"
        names = {wiring.PLANT: found.plant}
        names |= {wiring.controller(axis): name for axis, name in found.controllers.items()}
        names |= {wiring.friction(axis): name for axis, name in found.frictions.items()}
        return names[variable.instance], variable.name

    problems = []
    for connection in wiring.figure_2(found.axes):
        target = end(connection.target)
        given = driven.get(target)
        if connection.source.instance == wiring.ZERO:
            if given is not None:
                problems.append(
                    f"{where}: {'.'.join(target)} is connected to {'.'.join(given)}; nothing drives it here"
                )
            continue
        wanted = end(connection.source)
        if given is None and connection.target.name == wiring.RELEASE:
            continue  # true then, as it is with a setpoint unit
        if given is None:
            problems.append(f"{where}: {'.'.join(target)} is not connected; {'.'.join(wanted)} belongs there")
        elif given != wanted:
            problems.append(
                f"{where}: {'.'.join(target)} is connected to {'.'.join(given)}; {'.'.join(wanted)} belongs there"
            )
    return problems
