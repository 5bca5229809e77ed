"""An SSP file of one component, the machine as one unit: written, and its parts separated where it is read."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from feedsim.foundation.errors import InputError
from feedsim.scenario import Scenario
from feedsim.scenario.model import SCHEMES
from feedsim.simulation.cosim.archive import Archive
from feedsim.simulation.cosim.plant import axes_of
from feedsim.simulation.cosim.whole import UNIT, pack_whole
from feedsim.simulation.nc import Program
from feedsim.simulation.ssp.parameter_set import Value
from feedsim.simulation.ssp.roles import Roles, connector_faults
from feedsim.simulation.ssp.system_structure import Structure

# Parameters of the unit that decide what a run of it is, and what feedsim can run.
NEEDED = {"motion.built_in": "its setpoints are those inside", "coupling.friction": "friction is on"}


def pack(scenario: Scenario, program: Program, fmus: Path, out: Path) -> None:
    """The unit with machine, motion and all parameters inside; errors as
    :func:`feedsim.simulation.cosim.whole.pack_whole`."""
    machine = scenario.machine
    pack_whole(
        fmus / f"{UNIT}.fmu", out, machine, coupling=scenario.coupling, program=program, trial=False,
        name=f"{machine.name}; motion: {scenario.name}", note=" ".join(filter(None, (scenario.note, machine.note))),
        model=scenario.name,
    )  # fmt: skip


def roles(structure: Structure, archives: Mapping[str, Archive], where: str) -> Roles | None:
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


def coupling(result: Roles, values: Mapping[str, Mapping[str, Value]], where: str) -> dict[str, Any] | None:
    """How the unit's parts are exchanged, as a scenario has it; None where the parts are components of their own.

    Raises:
        InputError: a parameter of the unit is at what feedsim cannot run.
    """
    if result.setpoint != result.plant:
        return None
    given = values[result.plant]
    problems = [f"{where}: {result.plant}.{name} is {str(given.get(name)).lower()}; true is needed: {why}"
                for name, why in NEEDED.items() if given.get(name) is not True]  # fmt: skip
    if problems:
        raise InputError.of(where, problems)
    scheme = int(given["coupling.scheme"])
    return {"scheme": list(SCHEMES)[scheme], "substeps": int(given["coupling.substeps"]), "units": "one"}


def split(
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
