"""Which output drives which input: the paper's Fig. 2 as a mapping, checked before the first step."""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass

from feedsim.cosim.archive import Archive
from feedsim.errors import InputError

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
        if end.instance not in (NC, ZERO) and not _is(end, causality, instances)
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


def _is(end: Variable, causality: str, instances: Mapping[str, Archive]) -> bool:
    archive = instances.get(end.instance)
    return archive is not None and end.name in archive.variables and archive.variables[end.name].causality == causality
