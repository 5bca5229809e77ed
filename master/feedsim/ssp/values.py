"""Parameters of the components of an SSP: start values of the archives, overlaid by the parameter sets."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass

from feedsim.cosim.archive import Archive
from feedsim.errors import InputError
from feedsim.fields import did_you_mean
from feedsim.ssp import parameter_set
from feedsim.ssp.archive import inside
from feedsim.ssp.parameter_set import Parameter, ParameterSet, Value
from feedsim.ssp.system_structure import Binding, Structure


@dataclass(frozen=True)
class _Said:
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
    inputs: dict[tuple[str, str], _Said] = {}  # the set that counts
    for said in _all_said(structure, files, archives, where, problems):
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


def _all_said(
    structure: Structure, files: Mapping[str, bytes], archives: Mapping[str, Archive], where: str, problems: list[str]
) -> Iterator[_Said]:
    """Of the components' own sets, then of the system's, in the order in which they count."""
    for component in structure.components:
        for place, given, prefix in _sets(component.bindings, files, where, problems):
            for parameter in given.parameters:
                yield _Said(component.name, prefix + parameter.name, parameter, place, given)
    for place, given, prefix in _sets(structure.bindings, files, where, problems):
        for parameter in given.parameters:
            name = prefix + parameter.name
            owner = next((archive for archive in archives if name.startswith(f"{archive}.")), None)
            if owner is None:
                problems.append(f"{place}: {name}: is no parameter of a component")
            else:
                yield _Said(owner, name.removeprefix(f"{owner}."), parameter, place, given)


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
            source = inside(str(binding.source), files)
        except InputError as error:
            problems.append(f"{place}: is named by a parameter binding, but {str(error).removeprefix('is ')}")
            continue
        try:
            result.append((place, parameter_set.read(files[source], place), binding.prefix))
        except InputError as error:
            problems += error.problems
    return result


def _constant_inputs(
    inputs: Mapping[tuple[str, str], _Said],
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
