"""Parameters of the components of an SSP: start values of the archives, overlaid by the parameter sets."""

from __future__ import annotations

from collections.abc import Container, Mapping

from feedsim.cosim.archive import Archive
from feedsim.cosim.unit_definition import unit_definitions
from feedsim.errors import InputError
from feedsim.fields import did_you_mean
from feedsim.ssp import parameter_set
from feedsim.ssp.parameter_set import Parameter, ParameterSet, Value
from feedsim.ssp.system_structure import Binding, Structure

# Inputs that sets give a start value: component and name -> place of the set that counts, what it says, its set.
Inputs = dict[tuple[str, str], tuple[str, Parameter, ParameterSet]]


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
            every input that nothing drives but a set, with another value than the archive's (:func:`_held_inputs`);
            the first of them where there are many.
    """
    problems: list[str] = []
    found: dict[str, dict[str, Value]] = {}
    inputs: Inputs = {}
    for component in structure.components:
        archive = archives[component.name]
        found[component.name] = {
            name: start_value(archive, name)
            for name, each in archive.variables.items()
            if each.causality == "parameter" and component.name not in foreign
        }
        for place, given, prefix in _sets(component.bindings, files, where, problems):
            for parameter in given.parameters:
                if len(problems) > parameter_set.MOST_PROBLEMS:
                    break
                _set(found, inputs, archives, component.name, prefix + parameter.name, parameter, given, structure,
                     place, problems)  # fmt: skip
    for place, given, prefix in _sets(structure.bindings, files, where, problems):
        for parameter in given.parameters:
            if len(problems) > parameter_set.MOST_PROBLEMS:
                break
            name = prefix + parameter.name
            owner = next((each for each in archives if name.startswith(f"{each}.")), None)
            if owner is None:
                problems.append(f"{place}: {name}: is no parameter of a component")
                continue
            _set(found, inputs, archives, owner, name.removeprefix(f"{owner}."), parameter, given, structure, place,
                 problems)  # fmt: skip
    problems += _held_inputs(inputs, structure, archives, found, foreign)
    if len(problems) > parameter_set.MOST_PROBLEMS:
        problems[parameter_set.MOST_PROBLEMS :] = [f"{where}: and more like these; the first are listed"]
    if problems:
        raise InputError.of(where, problems)
    return found


def start_value(archive: Archive, name: str) -> Value:
    """The start value of a parameter or an input as the archive declares it."""
    variable = archive.variables[name]
    kind = "Integer" if variable.type == "Enumeration" else variable.type
    declared = Parameter(name, kind, str(variable.start if variable.start is not None else ""))
    return parameter_set.value(declared, kind, "")


def _sets(
    bindings: tuple[Binding, ...], files: Mapping[str, bytes], where: str, problems: list[str]
) -> list[tuple[str, ParameterSet, str]]:
    found = []
    for binding in bindings:
        if binding.inline is not None:
            found.append((where, binding.inline, binding.prefix))
            continue
        place = f"{where}: {binding.source}"
        try:
            found.append((place, parameter_set.read(files[str(binding.source)], place), binding.prefix))
        except KeyError:
            problems.append(f"{place}: is named by a parameter binding, but not in the file")
        except InputError as error:
            problems += error.problems
    return found


def _set(
    found: dict[str, dict[str, Value]],
    inputs: Inputs,
    archives: Mapping[str, Archive],
    component: str,
    name: str,
    parameter: Parameter,
    given: ParameterSet,
    structure: Structure,
    place: str,
    problems: list[str],
) -> None:
    archive = archives[component]
    variable = archive.variables.get(name)
    if variable is not None and variable.causality == "input":
        inputs[component, name] = place, parameter, given
        return
    if variable is None or variable.causality != "parameter":
        known = [each for each, other in archive.variables.items() if other.causality == "parameter"]
        what = f"is {variable.causality}, no parameter," if variable else "is no parameter"
        hint = did_you_mean(name, known) if known else "; it has none"
        problems.append(f"{place}: {name}: {what} of {component}{hint}")
        return
    try:
        found[component][name] = _value(parameter, archive, name, given, structure)
    except InputError as error:
        problems.append(f"{place}: {name}: {error}")


def _value(parameter: Parameter, archive: Archive, name: str, given: ParameterSet, structure: Structure) -> Value:
    """What a set says of the variable `name`, in the variable's unit."""
    variable = archive.variables[name]
    kind = "Integer" if variable.type == "Enumeration" else variable.type
    definitions = (given.units, structure.units, unit_definitions(archive))
    return parameter_set.value(parameter, kind, archive.unit_of(name), definitions)


def _held_inputs(
    inputs: Inputs,
    structure: Structure,
    archives: Mapping[str, Archive],
    found: dict[str, dict[str, Value]],
    foreign: Container[str],
) -> list[str]:
    """Inputs without a connection that a set wants at another value than the archive's start value.

    Other tools hold an input there for the whole run, and so does the master where the unit is foreign. Of the shipped
    units it drives these inputs itself, at the archive's start values, and would give another result without a word.
    """
    connected = {end for link in structure.links for end in (link.start, link.end)}
    faults = []
    for (component, name), (place, parameter, given) in inputs.items():
        if (component, name) in connected:
            continue
        archive = archives[component]
        try:
            asked_for = _value(parameter, archive, name, given, structure)
            if component in foreign:
                found[component][name] = asked_for
                continue
            start = start_value(archive, name)
            if asked_for == start:
                continue
        except InputError as error:
            faults.append(f"{place}: {component}.{name}: {error}")
            continue
        kept = str(start).lower() if isinstance(start, bool) else f"{start:g} {archive.unit_of(name)}"
        asked = " ".join(filter(None, (parameter.text, parameter.unit)))
        faults.append(
            f"{place}: {component}.{name}: {asked} is asked of an input that is not connected; feedsim cannot hold it "
            f"there, it keeps such an input at {kept}: leave the value out, or run the file in another simulator"
        )
    return faults
