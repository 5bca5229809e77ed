"""The modes that a machine's plant has where it stands: the table's, or those of a cell of its archive's grid."""

from __future__ import annotations

from feedsim import units
from feedsim.cosim.plant import axes_of
from feedsim.cosim.unit import Archive
from feedsim.errors import FeedsimError
from feedsim.scenario import Machine
from feedsim.structure.modes import Modes, checked_modes
from feedsim.structure.pack import POSES_IN_ARCHIVE
from feedsim.structure.poses_file import read_cell


def plant_modes(machine: Machine) -> tuple[Modes, list[str]]:
    """Modes at the machine's pose, and what a user should know of them, a sentence each.

    A plant that follows its axes has at the start the modes of the cell in which the pose lies, which are those of the
    cell's centre. Any other plant has the machine's table.

    Raises:
        InputError: the table is broken or contradicts the machine file.
    """
    table = checked_modes(machine)
    if machine.plant is None:
        return table, []
    try:
        with_grid = _of_cell(machine)
    except FeedsimError as error:  # who simulates meets it again; the closed form can do without the archive
        return table, [f"the closed form has the modes of {machine.modes.name}, not those of the plant: {error}"]
    return with_grid or (table, [])


def _of_cell(machine: Machine) -> tuple[Modes, list[str]] | None:
    assert machine.plant is not None
    archive = Archive(machine.plant)
    try:
        file = archive.directory / POSES_IN_ARCHIVE
        if not file.is_file():
            return None
        modes, centre = read_cell(file, axes_of(archive), machine.pose)
    finally:
        archive.close()
    about = ", ".join(f"{axis} {units.show(position, 'm')}" for axis, position in centre.items())
    at = ", ".join(f"{axis} {units.show(machine.pose[axis], 'm')}" for axis in centre)
    return modes, [
        f"the plant follows the pose: the modes are those of the archive's cell about {about}; pose: {at}. Where "
        "an axis moves out of that cell, the closed form does not follow it"
    ]
