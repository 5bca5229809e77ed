"""A scenario's data from what an SSP holds: parameters of the units, and the annotation for what they cannot know."""

from __future__ import annotations

import json
from collections.abc import Collection, Container, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from math import inf, nextafter, pi
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, get_args, get_origin

import numpy as np
from pydantic import BaseModel

from feedsim.files.fields import Quantity, did_you_mean
from feedsim.files.source import is_program, json_value
from feedsim.foundation import units
from feedsim.foundation.errors import InputError
from feedsim.scenario import Drive, Scenario
from feedsim.scenario.axis_units import EFFECTS, FILTER_TYPES
from feedsim.scenario.roles import DRIVE, FRICTION_ROLE, Role
from feedsim.scenario.structure import GeometryStructure
from feedsim.scenario.structure_checks import load_structure
from feedsim.simulation.cosim.archive import Archive
from feedsim.simulation.cosim.whole import UNIT
from feedsim.simulation.ssp import parameter_set
from feedsim.simulation.ssp.archive import resolve_source
from feedsim.simulation.ssp.parameter_set import Parameter, ParameterSet, Value, number
from feedsim.simulation.ssp.roles import Roles
from feedsim.simulation.ssp.setpoints import Table
from feedsim.simulation.ssp.system_structure import Binding, Structure
from feedsim.structure.pack import MOUNTS_IN_ARCHIVE

# --- Parameters of the components of an SSP: start values of the archives, overlaid by the parameter sets -------------


@dataclass(frozen=True)
class _GivenValue:
    """What a parameter set (`place`, `given`) says of a variable of a component."""

    component: str
    name: str
    parameter: Parameter
    place: str
    given: ParameterSet

    def value(self, archive: Archive, structure: Structure) -> Value:
        """In the variable's unit."""
        variable = archive.variables[self.name]
        kind = "Integer" if variable.type == "Enumeration" else variable.type
        definitions = (self.given.units, structure.units, archive.unit_definitions)
        return parameter_set.value(self.parameter, kind, archive.unit_of(self.name), definitions)


def values(
    structure: Structure,
    files: Mapping[str, bytes],
    archives: Mapping[str, Archive],
    foreign: Container[str],
    where: str,
) -> dict[str, dict[str, Value]]:
    """Component -> parameter -> value in the archive's unit, for all parameters of its archive; of the components that
    are `foreign` those that a set gives, with the inputs that nothing else drives.

    Sets of the system count over those of a component; a later set of either over an earlier one. Start values of
    connected inputs are not needed here and pass by unseen.

    Raises:
        InputError: lists every set that cannot be read, every parameter that is unknown, of another type or unit, and
            every input that nothing drives but a set, with another value than the archive's (:func:`_constant_inputs`);
            the first of them where there are many.
    """
    problems: list[str] = []
    parameters = {
        component: [name for name, variable in archive.variables.items() if variable.causality == "parameter"]
        for component, archive in archives.items()
    }
    result: dict[str, dict[str, Value]] = {
        component: {} if component in foreign else {name: start_value(archives[component], name) for name in names}
        for component, names in parameters.items()
    }
    inputs: dict[tuple[str, str], _GivenValue] = {}  # the set that counts
    for said in _values_in_order(structure, files, archives, where, problems):
        if len(problems) > parameter_set.MOST_PROBLEMS:
            break
        component, name, archive = said.component, said.name, archives[said.component]
        variable = archive.variables.get(name)
        if variable is not None and variable.causality == "input":
            inputs[component, name] = said
        elif variable is None or variable.causality != "parameter":
            known = parameters[component]
            what = f"is {variable.causality}, no parameter," if variable else "is no parameter"
            hint = did_you_mean(name, known) if known else "; it has none"
            problems.append(f"{said.place}: {name}: {what} of {component}{hint}")
        else:
            try:
                result[component][name] = said.value(archive, structure)
            except InputError as error:
                problems.append(f"{said.place}: {name}: {error}")
    problems += _constant_inputs(inputs, structure, archives, result, foreign)
    if len(problems) > parameter_set.MOST_PROBLEMS:
        problems[parameter_set.MOST_PROBLEMS :] = [f"{where}: and more like these; the first are listed"]
    if problems:
        raise InputError.of(where, problems)
    return result


def start_value(archive: Archive, name: str) -> Value:
    """The start value of a parameter or an input as the archive declares it."""
    variable = archive.variables[name]
    kind = "Integer" if variable.type == "Enumeration" else variable.type
    declared = Parameter(name, kind, str(variable.start if variable.start is not None else ""))
    return parameter_set.value(declared, kind, "")


def _values_in_order(
    structure: Structure, files: Mapping[str, bytes], archives: Mapping[str, Archive], where: str, problems: list[str]
) -> Iterator[_GivenValue]:
    """Of the components' own sets, then of the system's, in the order in which they count."""
    for component in structure.components:
        for place, given, prefix in _sets(component.bindings, files, where, problems):
            for parameter in given.parameters:
                yield _GivenValue(component.name, prefix + parameter.name, parameter, place, given)
    for place, given, prefix in _sets(structure.bindings, files, where, problems):
        for parameter in given.parameters:
            name = prefix + parameter.name
            owner = next((archive for archive in archives if name.startswith(f"{archive}.")), None)
            if owner is None:
                problems.append(f"{place}: {name}: is no parameter of a component")
            else:
                yield _GivenValue(owner, name.removeprefix(f"{owner}."), parameter, place, given)


def _sets(
    bindings: tuple[Binding, ...], files: Mapping[str, bytes], where: str, problems: list[str]
) -> list[tuple[str, ParameterSet, str]]:
    result = []
    for binding in bindings:
        if binding.inline is not None:
            result.append((where, binding.inline, binding.prefix))
            continue
        place = f"{where}: {binding.source}"
        try:
            source = resolve_source(str(binding.source), files)
        except InputError as error:
            problems.append(f"{place}: is named by a parameter binding, but {str(error).removeprefix('is ')}")
            continue
        try:
            result.append((place, parameter_set.read_parameter_set(files[source], place), binding.prefix))
        except InputError as error:
            problems += error.problems
    return result


def _constant_inputs(
    inputs: Mapping[tuple[str, str], _GivenValue],
    structure: Structure,
    archives: Mapping[str, Archive],
    result: dict[str, dict[str, Value]],
    foreign: Container[str],
) -> list[str]:
    """Inputs without a connection that a set wants at another value than the archive's start value.

    Other tools hold an input there for the whole run, and so does the master where the unit is foreign. Of the shipped
    units it drives these inputs itself, at the archive's start values, and would give another result without a word.
    """
    connected = {end for link in structure.links for end in (link.start, link.end)}
    faults = []
    for (component, name), said in inputs.items():
        if (component, name) in connected:
            continue
        archive, place = archives[component], f"{said.place}: {component}.{name}"
        try:
            asked_for = said.value(archive, structure)
            if component in foreign:
                result[component][name] = asked_for
                continue
            start = start_value(archive, name)
        except InputError as error:
            faults.append(f"{place}: {error}")
            continue
        if asked_for == start:
            continue
        kept = str(start).lower() if isinstance(start, bool) else f"{start:g} {archive.unit_of(name)}"
        asked = " ".join(filter(None, (said.parameter.text, said.parameter.unit)))
        faults.append(
            f"{place}: {asked} is asked of an input that is not connected; feedsim cannot hold it there, it keeps such "
            f"an input at {kept}: leave the value out, or run the file in another simulator"
        )
    return faults


# --- A scenario's data from what an SSP holds: parameters of the units, and the annotation for what they cannot
#     know


# --- What the units cannot know of a scenario: motions, evaluation, limits, names; as the text that travels in an SSP -
# It has the keys of a scenario file, every quantity with its unit. What a unit has a parameter for is left out: there
# is
# one place for it, the parameter sets.


RECORDINGS = "resources/recordings"
STRUCTURE = "resources/structure.yaml"


def text(scenario: Scenario) -> str:
    """The JSON text for `scenario`; recordings it names are where :func:`recordings` puts them."""
    whole = plain_value(scenario)
    del whole["loads"]  # there are none
    machine = whole["machine"]
    places = {path: name for name, path in recordings(scenario).items()}
    for motion, data in zip(scenario.motions, whole["motions"], strict=True):
        data |= {key: places[path] for key, path in motion.files.items()}
    own = ("pitch", "travel", "max_speed", "max_acceleration", "display_sign")
    axes = {}
    for name, axis in machine["axes"].items():
        axes[name] = {key: axis[key] for key in own}
        for role in ("drive", "friction"):  # of another maker's unit what is recorded, which no connection shows
            kept = {key: axis[role][key] for key in ("identified", "outputs") if axis[role].get(key)}
            axes[name] |= {role: kept} if kept else {}
    # The parameters of a shipped drive show the others.
    shipped = any(isinstance(axis.drive, Drive) for axis in scenario.machine.axes.values())
    reported = ("interpolation",) if shipped else ("control", "position", "interpolation")
    whole["machine"] = {
        "name": machine["name"],
        "note": machine["note"],
        "cycles": {key: machine["cycles"][key] for key in reported},
        "path": machine["path"],
        "axes": axes,
    }
    if structure(scenario) is not None:
        whole["machine"]["structure"] = STRUCTURE
    return json.dumps(whole, indent=1, ensure_ascii=False)


def structure(scenario: Scenario) -> bytes | None:
    """The machine's structure file, where it stands for itself: as geometry. Matrices are too large to travel along."""
    if scenario.machine.structure is None:
        return None
    loaded = load_structure(scenario.machine.structure)
    if not isinstance(loaded, GeometryStructure):
        return None
    return (json.dumps(plain_value(loaded), indent=1, ensure_ascii=False) + "\n").encode("utf-8")


def recordings(scenario: Scenario) -> dict[str, Path]:
    """Place inside the SSP -> file, of the recorded setpoints and NC programs that the motions name."""
    files = dict.fromkeys(path for motion in scenario.motions for path in motion.files.values())
    return {
        f"{RECORDINGS}/{i}/{path.name}" if is_program(path) else f"{RECORDINGS}/{i}.csv": path
        for i, path in enumerate(files)
    }


def plain_value(value: Any, annotation: Any = None) -> Any:
    """A value of a scenario as its file has it: quantities as text with their SI unit, exact; nothing that is None."""
    if isinstance(value, BaseModel):
        fields = type(value).model_fields
        return {
            info.alias or name: plain_value(inner, Annotated[(info.annotation, *info.metadata, None)])
            for name, info in fields.items()
            if (inner := getattr(value, name)) is not None
        }
    options = list(_options(annotation))
    if isinstance(value, Mapping):
        inner = next((get_args(option)[1] for option in options if get_origin(option) is dict), None)
        return {key: plain_value(entry, inner) for key, entry in value.items()}
    if isinstance(value, (tuple, list)):
        inner = next((get_args(option)[0] for option in options if get_origin(option) is tuple), None)
        return [plain_value(entry, inner) for entry in value]
    if isinstance(value, float):
        quantity = next((note for option in options for note in _notes(option)), None)
        return f"{value!r} {quantity.unit}" if quantity is not None and quantity.unit != "1" else value
    return str(value) if isinstance(value, Path) else value


def _options(annotation: Any) -> Any:
    """The alternatives of an annotation; those that are Annotated come as they are and as what they annotate."""
    yield annotation
    arguments = get_args(annotation)
    if get_origin(annotation) is Annotated:
        yield from _options(arguments[0])
    elif arguments and get_origin(annotation) not in (dict, tuple):
        for option in arguments:
            if option is not NoneType:
                yield from _options(option)


def _notes(annotation: Any) -> list[Quantity]:
    arguments = get_args(annotation) if get_origin(annotation) is Annotated else ()
    return [note for note in arguments[1:] if isinstance(note, Quantity)]


FILTER_NAMES = {number: name for name, number in reversed(FILTER_TYPES.items())}
MODES_RESOURCE, SETPOINTS_RESOURCE, MOUNTS_RESOURCE = "modes.csv", "setpoints.csv", "mounts.csv"  # beside the data
# What the annotation may show at its top.
OWN_KEYS = ("name", "note", "machine", "motions", "coupling", "recording", "logging", "evaluate")
MAX_ANNOTATION_DEPTH = 50  # levels of the annotation; a scenario has some 10
MARGIN = 1e-3  # m, that an axis may travel beyond its setpoints where no file gives limits


@dataclass(frozen=True)
class Parts:
    """The components' archives and parameters, by role, and the cycles of the control [s]."""

    roles: Roles
    archives: Mapping[str, Archive]
    values: Mapping[str, Mapping[str, Value]]
    table: Table
    T_c: float
    T_pos: float
    coupling: Mapping[str, Any] | None = None  # as the archive has it, where one unit holds all parts

    @property
    def places(self) -> dict[str, str]:
        """Component, the first that is made from it -> file name of a shipped archive, as runs know it."""
        if self.coupling is not None:
            return {self.roles.plant: f"{UNIT}.fmu"}
        first = {value[0]: f"{kind}.fmu" for kind, value in self.shipped.items()}
        return {self.roles.plant: "plant.fmu", **first}

    @property
    def shipped(self) -> dict[str, list[str]]:
        """Name of a shipped archive -> components of drives and frictions that are made from it."""
        result: dict[str, list[str]] = {}
        for name in (*self.roles.shipped_drives, *self.roles.shipped_frictions):
            result.setdefault(str(self.archives[name].description.modelName), []).append(name)
        return result


def cycles(
    roles: Roles,
    archives: Mapping[str, Archive],
    values: Mapping[str, Mapping[str, Value]],
    table: Table,
    own: Mapping[str, Any] | None,
    step: float | None,
    where: str,
) -> tuple[float, float, str]:
    """T_c and T_pos [s], and where T_c comes from if no shipped drive shows it, else nothing.

    Other drives have parameters of their own. The annotation knows then, or else the table is played once in a position
    cycle, and T_c is the step that the file advises, or a drive's archive.
    """
    if roles.shipped_drives:
        known = values[roles.shipped_drives[0]]
        return float(known["T_c"]), float(known["T_pos"]), ""
    reported = ((own or {}).get("machine") or {}).get("cycles", {})
    if "control" in reported and "position" in reported:
        try:
            return units.parse(str(reported["control"]), "s"), units.parse(str(reported["position"]), "s"), ""
        except InputError as error:
            raise InputError(f"{where}: the annotation feedsim.scenario: machine.cycles: {error}") from None
    if step is not None:
        return step, table.cycle, "the step size that the file advises"
    for name in roles.drives.values():
        experiment = archives[name].description.defaultExperiment
        if experiment is not None and experiment.stepSize is not None:
            return float(experiment.stepSize), table.cycle, f"the default step of {name}"
    return table.cycle, table.cycle, "the interval of the setpoints"


def missing_parameters(roles: Roles, values: Mapping[str, Mapping[str, Value]], where: str) -> list[str]:
    """Parameters that a scenario cannot do without, and an archive that calls itself shipped does not have."""
    needed = [(control, name) for control in roles.shipped_drives for name in ("T_c", "T_pos", "I_P")]
    needed += [(roles.plant, f"{axis}.{name}") for axis in roles.axes for name in ("x_0", "M_0")]
    return [f"{where}: {component}: its archive has no Real parameter {name}"
            for component, name in needed if not isinstance(values[component].get(name), float)]  # fmt: skip


def faults(parts: Parts, where: str) -> list[str]:
    """What does not fit together although each part is right."""
    roles, values = parts.roles, parts.values
    lengths = {"control": parts.T_c, "position": parts.T_pos}
    result = [f"{where}: the {name} cycle is {cycle!r} s; it must be greater than 0"
             for name, cycle in lengths.items() if not cycle > 0]  # fmt: skip
    for name in ("T_c", "T_pos"):
        given = {control: values[control][name] for control in roles.shipped_drives}
        if len(set(given.values())) > 1:
            said = ", ".join(f"{control} {value!r} s" for control, value in given.items())
            result.append(f"{where}: the controllers differ in {name}: {said}; all axes have one cycle here")
    plant = values[roles.plant]
    if plant.get("modes_file"):
        result.append(f"{where}: {roles.plant}.modes_file: the modes are those inside "
                     f"{parts.archives[roles.plant].path.name}; name no other file")  # fmt: skip
    for axis, name in roles.setpoints.items():
        if name not in parts.table.x_s:
            result.append(f"{where}: axis {axis}: {roles.setpoint} has no setpoints of an axis {name!r}")
    for shipped in parts.shipped.values() if parts.coupling is None else ():
        guids = {parts.archives[name].guid for name in shipped}
        if len(guids) > 1:
            result.append(f"{where}: {', '.join(shipped)} are made from different archives ({', '.join(guids)})")
    return result


def annotation(text: str | None, files: Collection[str], where: str) -> dict[str, Any] | None:
    """Data of the annotation; None where there is none. `files`: names of what the SSP holds.

    Raises:
        InputError: it is not what feedsim writes, or names a recording that the SSP does not hold.
    """
    if text is None:
        return None
    what = f"{where}: the annotation feedsim.scenario"
    data = json_value(text, what)
    _check_types(data, what)
    unknown = [key for key in data if key not in OWN_KEYS]
    missing = [name for name in named_files(data) if name not in files or not name.startswith(f"{RECORDINGS}/")]
    if data["machine"].get("structure") == STRUCTURE and STRUCTURE not in files:
        missing.append(STRUCTURE)
    if unknown or missing:
        reported = [f"{what} has the unknown key {key!r}" for key in unknown]
        raise InputError.of(
            what, reported + [f"{what} names the recording {name!r}, which is not in it" for name in missing]
        )
    result: dict[str, Any] = data
    return result


def named_files(own: Mapping[str, Any] | None) -> list[str]:
    """Files that the annotation's motions name, each once."""
    motions = (own or {}).get("motions", [])
    return list(dict.fromkeys(motion["file"] for motion in motions if "file" in motion))


def _check_types(data: Any, what: str) -> None:
    """What is read here has the types that :func:`feedsim.simulation.ssp.rebuilt.text` writes; the rest is the
    loader's."""
    if _depth(data) > MAX_ANNOTATION_DEPTH:
        raise InputError(f"{what} is nested too deeply")
    try:
        json.dumps(data, ensure_ascii=False).encode("utf-8")
    except UnicodeEncodeError:
        raise InputError(f"{what} holds characters that no text can hold") from None
    machine: Any = data.get("machine") if isinstance(data, dict) else None
    axes: Any = machine.get("axes") if isinstance(machine, dict) else None
    groups = [axes, machine.get("cycles"), machine.get("path")] if isinstance(machine, dict) else [None]
    if not all(isinstance(group, dict) for group in (*groups, *(axes.values() if isinstance(axes, dict) else ()))):
        raise InputError(f"{what} has no machine with cycles, path and axes")
    motions = data.get("motions", [])
    if not isinstance(motions, list) or not all(isinstance(motion, dict) for motion in motions):
        raise InputError(f"{what}: its motions are no list of groups")
    if not all(isinstance(motion.get("file", ""), str) for motion in motions):
        raise InputError(f"{what}: a motion's file is no text")
    for role in (DRIVE, FRICTION_ROLE):
        groups = [axis.get(role.name, {}) for axis in axes.values()]
        if not all(isinstance(group, dict) and isinstance(group.get("outputs", {}), dict) for group in groups):
            raise InputError(f"{what}: an axis's {role.name} is no group")
    if not all(isinstance(place.get("name", ""), str) for place in (data, machine)):
        raise InputError(f"{what}: a name is no text")


def _depth(data: Any) -> int:
    """Levels of groups and lists."""
    level, depth = [data], 0
    while level := [entry for entry in level if isinstance(entry, (dict, list))]:
        level = [inner for entry in level for inner in (entry.values() if isinstance(entry, dict) else entry)]
        depth += 1
    return depth


def scenario_data(
    parts: Parts, own: Mapping[str, Any] | None, name: str, folder: Path, *, motions: bool
) -> dict[str, Any]:
    """Data of a scenario file in `folder`. `own`: of the annotation. `motions`: whether its motions and evaluation are
    taken over, or else the setpoints stand as recorded ones."""
    roles = parts.roles
    own = dict(own or {})
    reported = own.get("machine", {})
    if not motions or "motions" not in own:
        columns = {axis: {"column": f"{setpoint}.x_s"} for axis, setpoint in roles.setpoints.items()}
        own["motions"] = [{"kind": "setpoints", "file": SETPOINTS_RESOURCE, "columns": columns}]
        own["evaluate"] = []
    plant = parts.values[roles.plant]
    axes = {}
    for axis in roles.axes:
        axes[axis] = _axis(parts, axis, reported.get("axes", {}).get(axis, {}), folder)
    machine = {
        "name": reported.get("name", name),
        "note": reported.get("note", ""),
        "modes": MODES_RESOURCE,
        "plant": parts.places[roles.plant],
        "pose": {axis: f"{plant[f'{axis}.x_0']!r} m" for axis in roles.axes},
        "cycles": {"interpolation": f"{parts.T_pos!r} s"}
        | reported.get("cycles", {})
        | {"control": f"{parts.T_c!r} s", "position": f"{parts.T_pos!r} s"},
        "path": reported.get("path", {"jerk": "1000 m/s^3", "acceleration": "100 m/s^2"}),
        "axes": axes,
    }
    geometry = _group(parts, roles.plant).get("geometry", {}) if roles.plant in parts.archives else {}
    if any(plant[f"geometry.{name}"] for name in geometry):
        machine["geometry"] = {name: value for name, value in geometry.items() if plant[f"geometry.{name}"]}
    if (parts.archives[roles.plant].directory / MOUNTS_IN_ARCHIVE).is_file():
        machine["mounts"] = {"table": MOUNTS_RESOURCE, **_group(parts, roles.plant).get("mounts", {})}
    if reported.get("structure") == STRUCTURE:
        machine["structure"] = STRUCTURE
    if parts.coupling is not None:
        own["coupling"] = parts.coupling
    return {**own, "name": own.get("name", name), "machine": machine}


def _axis(parts: Parts, axis: str, reported: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    roles = parts.roles
    plant = parts.values[roles.plant]
    control, contact = roles.drives[axis], roles.frictions[axis]
    limits = _limits(parts.table, roles.setpoints[axis], float(plant[f"{axis}.x_0"]))
    if control in roles.foreign:
        drive = _describe_foreign_unit(parts, control, DRIVE, reported, folder)
        pitch = reported.get("pitch") or f"{_seen_pitch(parts.table, roles.setpoints[axis])!r} m"
    else:
        drive, pitch = (
            _shipped_drive(parts, control),
            _pitch(float(parts.values[control]["I_P"]), reported.get("pitch")),
        )
    if contact in roles.foreign:
        friction = _describe_foreign_unit(parts, contact, FRICTION_ROLE, reported, folder)
    else:
        identified = {key: value for key, value in reported.get("friction", {}).items() if key == "identified"}
        laws = {unit: law for law, unit in FRICTION_ROLE.others} if parts.coupling is None else {}
        law = laws.get(str(parts.archives[contact].description.modelName))
        friction = {**({"law": law} if law else {}), **_group(parts, contact), **identified}
    return {
        **limits,
        **{key: value for key, value in reported.items() if key in (*limits, "display_sign")},
        "pitch": pitch,
        "constant_load": f"{plant[f'{axis}.M_0']!r} N.m",
        **({"play": f"{play!r} m"} if (play := plant.get(f"{axis}.play")) else {}),
        **_effects(parts, axis),
        "drive": drive,
        "friction": friction,
    }


def _effects(parts: Parts, axis: str) -> dict[str, Any]:
    """Hysteresis, transmission and friction at the guide of an axis, where there is any."""
    if parts.roles.plant not in parts.archives:
        return {}
    given = parts.values[parts.roles.plant]
    switches = {"hysteresis": "value", "transmission": "stiffness", "guide": "F_S"}
    on = [name for name, value in switches.items() if given.get(f"{axis}.{name}.{value}")]
    return {name: _group(parts, parts.roles.plant)[axis][name] for name in on}


def _shipped_drive(parts: Parts, control: str) -> dict[str, Any]:
    drive = _group(parts, control, leave=("T_c", "T_pos", "I_P"))
    for key in [key for key in drive if key in EFFECTS]:  # what is off is no part of the machine
        names = [f"{key}.{name}" for name in drive[key]]
        if all(parts.values[control][name] == start_value(parts.archives[control], name) for name in names):
            del drive[key]
    for key, inner in drive.items():
        if key.startswith("filter_") and isinstance(inner, dict) and "type" in inner:
            inner["type"] = FILTER_NAMES.get(inner["type"], inner["type"])
            if inner["type"] == "off":  # what it would be is no part of the machine, unless somebody said so
                started = {
                    name: start_value(parts.archives[control], f"{key}.{name}") for name in inner if name != "type"
                }
                for name, value in started.items():
                    if parts.values[control][f"{key}.{name}"] == value:
                        del inner[name]
    return drive


def _describe_foreign_unit(
    parts: Parts, component: str, role: Role, reported: Mapping[str, Any], folder: Path
) -> dict[str, Any]:
    """A component that is no shipped unit. The wiring shows what is exchanged, the annotation what else is recorded."""
    archive, signals = parts.archives[component], parts.roles.foreign[component]
    recorded = {
        signal: name
        for signal, name in reported.get(role.name, {}).get("outputs", {}).items()
        if signal not in signals and isinstance(name, str) and name in archive.variables
    }
    return {
        "fmu": str(archive.path.relative_to(folder)),
        "inputs": {signal.name: signals[signal.name] for signal in role.inputs if signal.name in signals},
        "outputs": {signal.name: signals[signal.name] for signal in role.outputs if signal.name in signals} | recorded,
        "parameters": dict(parts.values[component]),
    }


def _group(parts: Parts, component: str, leave: tuple[str, ...] = ()) -> dict[str, Any]:
    """Parameters of a component as a machine file has them: nested, with their units."""
    archive, group = parts.archives[component], dict[str, Any]()
    for name, value in parts.values[component].items():
        if name in leave:
            continue
        unit = archive.unit_of(name)
        place = group
        *above, last = name.split(".")
        for key in above:
            place = place.setdefault(key, {})
        place[last] = f"{value!r} {unit}" if isinstance(value, float) and unit != "1" else value
    return group


def _pitch(I_P: float, reported: Any) -> str:
    """A pitch whose lead is I_P [m/rad] to the last bit, if there is one; the annotated one, where it still is."""
    near = 2 * pi * I_P
    candidates = [near, nextafter(near, inf), nextafter(near, -inf)]
    if isinstance(reported, str):
        with suppress(InputError):
            candidates.insert(0, number(reported.removesuffix(" m")))
    best = min(candidates, key=lambda pitch: abs(pitch / (2 * pi) - I_P))
    return f"{best!r} m"


def _seen_pitch(table: Table, setpoint: str) -> float:
    """Travel per turn [m] as the setpoints have it: the steps of position over those that the speeds make. 10 mm where
    nothing moves; it is shown, and nothing is calculated with it."""
    turned = float(np.abs(table.n_ffw[setpoint]).sum()) * table.cycle / (2 * pi)
    return float(np.abs(np.diff(table.x_s[setpoint])).sum()) / turned if turned else 0.010


def _limits(table: Table, setpoint: str, x_0: float) -> dict[str, Any]:
    """Limits of an axis of which no file gives any: those that its setpoints reach."""
    x_s = np.append(table.x_s[setpoint], x_0)
    speed = np.abs(np.diff(x_s[:-1])) / table.cycle
    acceleration = np.abs(np.diff(x_s[:-1], 2)) / table.cycle**2
    return {
        "travel": [f"{float(x_s.min()) - MARGIN!r} m", f"{float(x_s.max()) + MARGIN!r} m"],
        "max_speed": f"{max(float(speed.max(initial=0.0)), 1e-3)!r} m/s",
        "max_acceleration": f"{max(float(acceleration.max(initial=0.0)), 1e-3)!r} m/s^2",
    }
