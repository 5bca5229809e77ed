"""Units in the roles of drive and friction: which variable stands for which signal, checked against what the archive
says of itself before anything of it is executed. The contract of a role: :mod:`feedsim.scenario.roles`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from feedsim.files.fields import did_you_mean
from feedsim.foundation import units
from feedsim.foundation.errors import Finding, InputError, shorten_list
from feedsim.scenario import ForeignUnit, Machine
from feedsim.scenario.axis_units import Parameter
from feedsim.scenario.roles import BOOLEAN, DRIVE, Role, Signal
from feedsim.simulation.cosim.archive import Archive
from feedsim.simulation.cosim.unit import Alias

MOST_NAMES = 12  # of an archive's variables that a message lists
SAME_STEP = 1e-9  # relative; both come from decimal text


@dataclass(frozen=True, eq=False)
class RoleUnit:
    """An archive in a role on an axis.

    Attributes:
        signals: signal -> variable that stands for it, with its unit converted. Of the shipped unit every variable
            stands for itself.
        parameters: start values by the archive's names, in the archive's units.
        warnings: what a user should know of it.
    """

    role: Role
    axis: str
    archive: Archive
    signals: Mapping[str, Alias]
    parameters: Mapping[str, Parameter]
    foreign: bool = False
    warnings: tuple[Finding, ...] = ()

    @property
    def takes_slopes(self) -> bool:
        """Whether it can be given how fast its inputs change."""
        return bool(self.archive.description.coSimulation.canInterpolateInputs)

    @property
    def gives_slopes(self) -> bool:
        """Whether it shows how fast its outputs change."""
        return int(self.archive.description.coSimulation.maxOutputDerivativeOrder) > 0

    @property
    def keeps_state(self) -> bool:
        """Whether it can go back to where it was."""
        return bool(self.archive.description.coSimulation.canGetAndSetFMUstate)

    def __str__(self) -> str:
        return f"axis {self.axis}: {self.role.name} {self.archive.path.name}"


def archive_path(machine: Machine, axis: str, role: Role, fmus: Path) -> Path:
    """The archive in a role on an axis; shipped ones are in the folder `fmus`."""
    described = getattr(machine.axes[axis], role.name)
    return described.fmu if isinstance(described, ForeignUnit) else fmus / f"{role.archive_name(described)}.fmu"


def fill_role(machine: Machine, axis: str, role: Role, archive: Archive) -> RoleUnit:
    """The unit of `archive` in a role on an axis. InputError: as :func:`connect_foreign_unit`."""
    described = getattr(machine.axes[axis], role.name)
    if isinstance(described, ForeignUnit):
        return connect_foreign_unit(role, axis, described, archive)
    signals = {name: Alias(name) for name in archive.variables}
    return RoleUnit(role, axis, archive, signals, shipped_parameters(machine, axis, role))


def shipped_parameters(machine: Machine, axis: str, role: Role) -> Mapping[str, Parameter]:
    """Parameters of the shipped unit in a role on an axis."""
    return controller_parameters(machine, axis) if role is DRIVE else machine.axes[axis].friction_at_motor


def controller_parameters(machine: Machine, axis: str) -> dict[str, Parameter]:
    """Parameters of the shipped drive on an axis. InputError: it has another one."""
    cycles = {"T_c": machine.cycles.T_c, "T_pos": machine.cycles.T_pos, "I_P": machine.axes[axis].I_P}
    return {**machine.shipped_drive(axis, "controller.fmu").parameters(), **cycles}


def connect_foreign_unit(role: Role, axis: str, unit: ForeignUnit, archive: Archive) -> RoleUnit:
    """Another maker's unit in a role.

    Raises:
        InputError: lists every variable that is unknown, of the wrong causality, type or dimension, stands for two
            signals, and every parameter that is none, cannot be set or is out of range.
    """
    problems: list[str] = []
    warnings: list[Finding] = []
    where, key = f"axis {axis}: {role.name} {archive.path.name}", f"machine.axes.{axis}.{role.name}"
    signals: dict[str, Alias] = {}
    taken: dict[str, str] = {}
    for name, variable in unit.variables.items():
        signal = role.signals[name]
        try:
            if variable in taken:
                raise InputError(f"stands for {taken[variable]} already")
            signals[name] = _alias(signal, signal in role.inputs, variable, archive)
            taken[variable] = name
        except InputError as error:
            group = "inputs" if signal in role.inputs else "outputs"
            problems.append(f"{archive.path.name}: {key}.{group}.{name}: {variable!r} {error}")
    bare = [name for name, alias in signals.items() if role.signals[name].unit not in (BOOLEAN, "1")
            and archive.declared_unit(alias.name) is None]  # fmt: skip
    if bare:
        listed = ", ".join(
            f"{signals[name].name} ({role.signals[name].unit}"
            + (f", not {written!r}, which it does not define" if (written := archive.unknown_unit(signals[name].name))
               else "") + ")" for name in bare
        )  # fmt: skip
        text = f"{where}: modelDescription.xml gives no unit for {listed}: taken to be in SI units"
        warnings.append(Finding("variable-without-unit", "doubt", text, axis))
    parameters: dict[str, Parameter] = {}
    for name, given in unit.parameters.items():
        try:
            parameters[name] = start_value(archive, name, given, taken)
        except InputError as error:
            problems.append(f"{archive.path.name}: {key}.parameters: parameter {name!r} {error}")
    if problems:
        raise InputError.of(where, problems)
    remaining = [
        variable
        for variable in archive.variables.values()
        if variable.causality == "input" and variable.name not in taken and variable.name not in parameters
    ]
    if remaining:
        kept = ", ".join(
            f"{entry.name} ({entry.start if entry.start is not None else 'no start value'})" for entry in remaining
        )
        text = f"{where}: nothing drives {kept}: inputs that no signal is given to keep their start values"
        warnings.append(Finding("input-not-driven", "doubt", text, axis))
    flags = [signal.name for signal in role.outputs if signal.unit == BOOLEAN and signal.name not in signals]
    if flags:
        text = f"{where}: no variable stands for {' or '.join(flags)}: whether it is at such a limit is not known"
        warnings.append(Finding("limit-not-reported", "doubt", text, axis))
    return RoleUnit(role, axis, archive, signals, parameters, True, tuple(warnings))


def _alias(signal: Signal, is_input: bool, name: str, archive: Archive) -> Alias:
    variable = archive.variables.get(name)
    causalities = ("input",) if is_input else ("output",) if signal.needed else ("output", "local")
    if variable is None:
        fitting = [other.name for other in archive.variables.values() if other.causality in causalities]
        raise InputError(f"is no variable of the archive{_suggest_name(name, fitting, ' or '.join(causalities))}")
    if variable.causality not in causalities:
        fitting = [other.name for other in archive.variables.values() if other.causality in causalities]
        raise InputError(
            f"is {variable.causality}, {' or '.join(causalities)} is needed{_list_names(fitting, causalities[0])}"
        )
    wanted = "Boolean" if signal.unit == BOOLEAN else "Real"
    if variable.type != wanted:
        raise InputError(f"is {variable.type}, {wanted} is needed")
    return Alias(name, "1") if signal.unit == BOOLEAN else _converted_alias(archive, name, signal.unit)


def _converted_alias(archive: Archive, name: str, unit: str) -> Alias:
    """The variable `name` for a signal in the SI unit `unit`; one without a unit is taken to be in SI.

    Raises:
        InputError: its unit is of another dimension, or neither the archive defines it nor feedsim knows it.
    """
    declared = archive.declared_unit(name)
    if declared is None:
        return Alias(name, unit)
    definition = archive.unit_definitions.get(declared)
    if definition is None:
        try:
            return Alias(name, unit, float(units.factor(declared, unit)))
        except InputError as error:
            raise InputError(f"is in {declared}, which modelDescription.xml does not define: {error}") from None
    wanted = units.unit(unit)
    given = _unit(definition.text)
    if given is None or given.dimension != wanted.dimension:
        by_name = _unit(declared)
        if by_name is not None and by_name.dimension == wanted.dimension and any(
            (angle := _unit(f"{definition.text}{rad}")) is not None and angle.dimension == wanted.dimension
            for rad in (".rad", "/rad")
        ):  # exporters leave the radian out of what defines a unit  # fmt: skip
            return Alias(name, unit, float(units.factor(declared, unit)))
        what = "" if given is None else f", {units.article(given.kind)}"
        raise InputError(
            f"is in {declared} ({definition.text}){what}; {units.article(wanted.kind)} is expected, such as {unit}"
        )
    return Alias(name, unit, definition.factor, definition.offset)


def _unit(text: str) -> units.Unit | None:
    try:
        return units.unit(text)
    except InputError:  # base units of which no quantity here is made
        return None


def start_value(archive: Archive, name: str, given: Parameter, driven: Mapping[str, str]) -> Parameter:
    """What `given` is for the variable `name`, in the unit and type that it declares. `driven`: variables that stand
    for signals. InputError: it is no parameter, cannot be set, or not to that."""
    variable = archive.variables.get(name)
    known = [other.name for other in archive.variables.values() if other.causality == "parameter"]
    if variable is None:
        raise InputError(f"is no variable of the archive{_suggest_name(name, known, 'parameter')}")
    if name in driven:
        raise InputError(f"stands for {driven[name]}, which counts")
    if variable.causality not in ("parameter", "input") or variable.variability == "constant":
        raise InputError(f"cannot be set, it is {variable.causality} and {variable.variability}"
                         f"{_list_names(known, 'parameter')}")  # fmt: skip
    value = _check_type(archive, variable, given)
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        low, high = (_limit(variable, end) for end in ("min", "max"))
        if (low is not None and value < low) or (high is not None and value > high):
            unit = archive.declared_unit(name) or ""
            ends = [f"at least {low:.9g} {unit}" if low is not None else "",
                    f"at most {high:.9g} {unit}" if high is not None else ""]  # fmt: skip
            allowed = ", ".join(end.strip() for end in ends if end)
            raise InputError(f"is {f'{value:.9g} {unit}'.strip()}; allowed: {allowed}")
    return value


def _check_type(archive: Archive, variable: Any, given: Parameter) -> Parameter:
    kind = variable.type
    if kind == "Real" and not isinstance(given, bool):
        if isinstance(given, str):
            try:
                return _parse_quantity(given, archive, variable.name)
            except InputError as error:
                raise InputError(f"cannot be that: {error}") from None
        return float(given)
    if kind == "Enumeration" and isinstance(given, str):
        items = {item.name: int(item.value) for item in getattr(variable.declaredType, "items", ())}
        if given in items:
            return items[given]
        raise InputError(f"is no {given!r}{did_you_mean(given, list(items))}")
    whole = isinstance(given, (int, float)) and not isinstance(given, bool) and float(given).is_integer()
    if kind in ("Integer", "Enumeration") and whole:
        return int(given)
    if (kind == "Boolean" and isinstance(given, bool)) or (kind == "String" and isinstance(given, str)):
        return given
    shown = str(given).lower() if isinstance(given, bool) else repr(given)
    raise InputError(f"is {kind}, {shown} is no value of that type")


def _parse_quantity(text: str, archive: Archive, name: str) -> float:
    """A quantity such as "12 ms" in the unit that the variable `name` declares.

    Raises:
        InputError: no number with a unit, a unit unknown or of another dimension.
    """
    declared = archive.declared_unit(name)
    definition = archive.unit_definitions.get(declared or "")
    if definition is None:
        return units.parse(text, declared or units.DIMENSIONLESS)
    number, _, unit = text.strip().partition(" ")
    if unit.strip() == declared:  # the archive's own name for it, which need not be one of ours
        return units.parse(number, units.DIMENSIONLESS)
    try:
        return (units.parse(text, definition.text) - definition.offset) / definition.factor
    except InputError as error:
        raise InputError(f"{error}; the archive declares it in {declared}") from None


def _limit(variable: Any, end: str) -> float | None:
    declared = getattr(variable, end)
    if declared is None and variable.declaredType is not None:
        declared = getattr(variable.declaredType, end)
    return None if declared is None else float(declared)


def _suggest_name(name: str, known: list[str], kind: str) -> str:
    """The nearest name and what is there."""
    if not known:
        return f"; it has no {kind} at all"
    near = did_you_mean(name, known)
    return f"{near if 'mean' in near else ''}{_list_names(known, kind)}"


def _list_names(known: Sequence[str], kind: str) -> str:
    if not known:
        return f"; it has no {kind} at all"
    return f"; {kind}: {shorten_list(known, MOST_NAMES)}"


def check_instances(filled: Iterable[RoleUnit]) -> None:
    """InputError where an archive that allows one instance in a process stands on several axes."""
    axes: dict[Path, list[RoleUnit]] = {}
    for role_unit in filled:
        if role_unit.archive.description.coSimulation.canBeInstantiatedOnlyOncePerProcess:
            axes.setdefault(role_unit.archive.path.resolve(), []).append(role_unit)
    problems = [
        f"{crowd[0].archive.path.name} allows one instance in a process; it is named as "
        + ", ".join(f"{entry.role.name} of {entry.axis}" for entry in crowd)
        for crowd in axes.values()
        if len(crowd) > 1
    ]
    if problems:
        raise InputError.of("units that cannot stand twice", problems)


def check_step(filled: RoleUnit, h: float, setting: str) -> str | None:
    """Why a unit cannot be stepped by h [s], which is what `setting` says; None where nothing is known against it.

    An archive that cannot handle varying steps and names a step of its own wants whole multiples of it.
    """
    description = filled.archive.description
    experiment = description.defaultExperiment
    own = None if experiment is None or experiment.stepSize is None else float(experiment.stepSize)
    if description.coSimulation.canHandleVariableCommunicationStepSize or not own:
        return None
    ratio = h / own
    if round(ratio) >= 1 and abs(ratio - round(ratio)) <= SAME_STEP * ratio:
        return None
    return (
        f"{filled}: takes whole multiples of its own step of {own * 1e6:.9g} us; it would be stepped by "
        f"{h * 1e6:.9g} us ({setting})"
    )
