"""Parameters of the components of an SSP: start values of the archives, overlaid by the parameter sets."""

from __future__ import annotations

from collections.abc import Mapping

from feedsim.cosim.unit import Archive
from feedsim.errors import InputError
from feedsim.scenario.fields import did_you_mean
from feedsim.ssp import parameter_set
from feedsim.ssp.parameter_set import ParameterSet, Value
from feedsim.ssp.system_structure import Binding, Structure
from feedsim.ssp.unit_definition import unit_definitions


def values(
    structure: Structure, files: Mapping[str, bytes], archives: Mapping[str, Archive], where: str
) -> dict[str, dict[str, Value]]:
    """Component -> parameter -> SI value, for all parameters of its archive.

    Sets of the system count over those of a component; a later set of either over an earlier one. Start values of
    inputs are not needed here and pass by unseen.

    Raises:
        InputError: lists every set that cannot be read and every parameter that is unknown, of another type or unit;
            the first of them where there are many.
    """
    problems: list[str] = []
    found: dict[str, dict[str, Value]] = {}
    for component in structure.components:
        archive = archives[component.name]
        found[component.name] = {
            name: start_value(archive, name)
            for name, each in archive.variables.items()
            if each.causality == "parameter"
        }
        for place, given, prefix in _sets(component.bindings, files, where, problems):
            for parameter in given.parameters:
                if len(problems) > parameter_set.MOST_PROBLEMS:
                    break
                _set(found, archives, component.name, prefix + parameter.name, parameter, given, structure, place,
                     problems)  # fmt: skip
    for place, given, prefix in _sets(structure.bindings, files, where, problems):
        for parameter in given.parameters:
            if len(problems) > parameter_set.MOST_PROBLEMS:
                break
            name = prefix + parameter.name
            owner = next((each for each in archives if name.startswith(f"{each}.")), None)
            if owner is None:
                problems.append(f"{place}: {name}: is no parameter of a component")
                continue
            _set(found, archives, owner, name.removeprefix(f"{owner}."), parameter, given, structure, place, problems)
    if len(problems) > parameter_set.MOST_PROBLEMS:
        problems[parameter_set.MOST_PROBLEMS :] = [f"{where}: and more like these; the first are listed"]
    if problems:
        raise InputError.of(where, problems)
    return found


def start_value(archive: Archive, name: str) -> Value:
    """The start value of a parameter as the archive declares it."""
    variable = archive.variables[name]
    kind = "Integer" if variable.type == "Enumeration" else variable.type
    declared = parameter_set.Parameter(name, kind, str(variable.start if variable.start is not None else ""))
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
    archives: Mapping[str, Archive],
    component: str,
    name: str,
    parameter: parameter_set.Parameter,
    given: ParameterSet,
    structure: Structure,
    place: str,
    problems: list[str],
) -> None:
    archive = archives[component]
    variable = archive.variables.get(name)
    if variable is not None and variable.causality == "input":
        return
    if variable is None or variable.causality != "parameter":
        known = [each for each, other in archive.variables.items() if other.causality == "parameter"]
        what = f"is {variable.causality}, no parameter," if variable else "is no parameter"
        hint = did_you_mean(name, known) if known else "; it has none"
        problems.append(f"{place}: {name}: {what} of {component}{hint}")
        return
    kind = "Integer" if variable.type == "Enumeration" else variable.type
    definitions = (given.units, structure.units, unit_definitions(archive))
    try:
        found[component][name] = parameter_set.value(parameter, kind, archive.unit_of(name), definitions)
    except InputError as error:
        problems.append(f"{place}: {name}: {error}")
