"""Which archive is the plant of a machine: its own, the general one, or the general one packed anew for its axes.

And the modes that it has where the machine stands: the table's, or those of a cell of its archive's grid.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from feedsim.files.fields import FileContent
from feedsim.foundation import units
from feedsim.foundation.errors import FeedsimError, Finding, InputError
from feedsim.foundation.outputs import TemporaryFolder
from feedsim.scenario import Machine
from feedsim.simulation.cosim.archive import Archive
from feedsim.simulation.cosim.unpacked import STORE
from feedsim.structure.assembly import SAME_POSITION
from feedsim.structure.modes import Modes, checked_modes, with_transmissions
from feedsim.structure.pack import AXES_IN_ARCHIVE, MODES_IN_ARCHIVE, MOUNTS_IN_ARCHIVE, POSES_IN_ARCHIVE, pack

_START = ".x_0"  # of every axis of a plant
MAX_PACKED_PLANTS = 4  # packed archives, of about 1 MB each: studies run the same machine again and again
# With the archive in it, by content of what it is packed from; those used last stand last.
_PACKED_ARCHIVES: dict[Any, TemporaryFolder] = {}
_PACKING_LOCK = threading.Lock()
_TABLES: dict[int, TemporaryFolder] = {}  # process -> its tables of modes, named by their content


def open_plant(machine: Machine, fmus: Path) -> tuple[Archive, bool]:
    """The machine's plant archive, unpacked; the caller closes it. And whether the unit is to read the machine's table
    of modes in place of the archive's (:func:`modes_file`).

    A machine that names an archive under `plant` has that. Otherwise plant.fmu in the folder `fmus` serves with the
    machine's table of modes; where it has other axes than the machine, or the machine has mounts that are not linear,
    the machine is packed into it first.

    Raises:
        InputError: no such archive, or it does not fit the machine.
    """
    if machine.plant is not None:
        return open_own(machine.plant, machine), False
    general = Archive(fmus / "plant.fmu")
    if machine.mounts_table is None and set(axes_of(general)) == set(machine.axes):
        return general, True
    general.close()

    def make(out: Path) -> None:
        pack(
            general.path, out, modes=machine.modes, pose={axis: machine.pose[axis] for axis in machine.axes},
            mounts=machine.mounts_table, name=machine.name, note=machine.note, trial=False, level=0,
        )  # fmt: skip

    return packed_for(machine, general.path, make), False


def modes_file(table: FileContent) -> Path:
    """A file of this process with a table of modes: the unit reads one, once for every name."""
    if (process := os.getpid()) not in _TABLES:
        _TABLES[process] = TemporaryFolder()
    path = _TABLES[process].path / f"{table.digest}.csv"
    if not path.is_file():
        fresh = path.with_suffix(f".{threading.get_ident()}")  # another thread may read it already
        fresh.parent.mkdir(exist_ok=True)  # cleaners take what has been idle for long
        fresh.write_bytes(table.content or b"")
        fresh.replace(path)
    return path


def open_own(plant: Path, machine: Machine) -> Archive:
    """The machine's own plant archive. InputError: it is not of this machine."""
    archive = Archive(plant)
    try:
        _check_own(archive, machine)
    except InputError:
        archive.close()
        raise
    return archive


def packed_for(machine: Machine, general: Path, make: Callable[[Path], None]) -> Archive:
    """The machine packed into the archive `general`, as `make` does; what it was packed to is kept for further runs.

    `make` need not try it, which is instantiated next anyway, nor compress it: it is unpacked at once.
    """
    files = (general, *(file for file in (machine.plant, machine.mounts_table) if file is not None))
    try:
        contents = (*map(STORE.digest, files), machine.modes.digest)
    except OSError as error:
        raise InputError(f"{error.filename}: cannot be read: {error.strerror}") from error
    key = *contents, *((axis, machine.pose[axis]) for axis in machine.axes), machine.name, machine.note
    with _PACKING_LOCK:
        folder = _PACKED_ARCHIVES.pop(key, None)
        # What cleans a folder for temporary files takes what has been idle for long.
        if folder is None or not (folder.path / general.name).is_file():
            folder = TemporaryFolder()
            make(folder.path / general.name)
        _PACKED_ARCHIVES[key] = folder
        while len(_PACKED_ARCHIVES) > MAX_PACKED_PLANTS:
            _PACKED_ARCHIVES.pop(next(iter(_PACKED_ARCHIVES))).close()
        return Archive(folder.path / general.name)


def axes_of(archive: Archive) -> tuple[str, ...]:
    """Axes of a plant archive, in its order."""
    return tuple(name.removesuffix(_START) for name in archive.variables if name.endswith(_START))


def _packed_pose(archive: Archive) -> dict[str, float]:
    """Axis -> position [m] that the archive was packed with; empty where that cannot be read: the unit will say."""
    try:
        rows = (archive.directory / AXES_IN_ARCHIVE).read_text(encoding="utf-8").splitlines()[1:]
        return {name: float(position) for name, _, position in (row.partition(",") for row in rows)}
    except (OSError, ValueError):
        return {}


def _check_own(archive: Archive, machine: Machine) -> None:
    folder = machine.directory if (machine.directory / "machine.yaml").is_file() else "MACHINE"
    pack_anew = f"pack it anew: feedsim export --plant {folder} --out {archive.path}"
    axes = axes_of(archive)
    if set(axes) != set(machine.axes):
        raise InputError(
            f"{archive.path}: a plant with the axes {', '.join(axes) or '(none)'}; the machine has "
            f"{', '.join(machine.axes)}; {pack_anew}"
        )
    try:
        inside = (archive.directory / MODES_IN_ARCHIVE).read_bytes()
    except OSError as error:
        raise InputError(f"{error.filename}: cannot be read: {error.strerror}") from error
    mounts = archive.directory / MOUNTS_IN_ARCHIVE
    if machine.mounts_table is None and mounts.is_file():
        raise InputError(
            f"{archive.path}: it holds mounts that are not linear; the machine file names no table of them (mounts)"
        )
    if machine.mounts_table is not None:
        try:
            same_mounts = mounts.is_file() and mounts.read_bytes() == machine.mounts_table.read_bytes()
        except OSError as error:
            raise InputError(f"{error.filename}: cannot be read: {error.strerror}") from error
        if not same_mounts:
            raise InputError(
                f"{archive.path}: its table of mounts is not the machine's, {machine.mounts_table}; {pack_anew}"
            )
    if inside != machine.modes.content:
        packed = _packed_pose(archive)
        if any(abs(packed.get(axis, position) - position) > SAME_POSITION for axis, position in machine.pose.items()):
            there, here = (
                ", ".join(f"{axis} {pose[axis] * 1e3:.9g} mm" for axis in machine.axes if axis in pose)
                for pose in (packed, machine.pose)
            )
            raise InputError(
                f"{archive.path}: its table of modes is not the machine's, {machine.modes}: it was packed at another "
                f"pose, {there}, with the modes there; the machine stands at {here}. Give the machine file that pose "
                f"and the table of modes that belongs to it (feedsim machine build {folder} --at ... --out DIR), or "
                f"{pack_anew}"
            )
        raise InputError(
            f"{archive.path}: its table of modes is not the machine's, {machine.modes}: one of them has changed since "
            f"it was packed; {pack_anew}"
        )


def plant_modes(machine: Machine, amplitude: float = 0.0) -> tuple[Modes, list[Finding]]:
    """Modes at the machine's pose, and what a user should know of them.

    A plant that follows its axes has at the start the modes of the cell in which the pose lies, which are those of the
    cell's centre. Any other plant has the machine's table. amplitude: of mounts that are not linear [m]; 0: at rest.

    Raises:
        InputError: the table is broken or contradicts the machine file.
    """
    table = checked_modes(machine, amplitude)
    if machine.plant is None:
        return table, []
    try:
        with_grid = _of_cell(machine)
    except FeedsimError as error:  # who simulates meets it again; the closed form can do without the archive
        text = f"the closed form has the modes of {machine.modes.file.name}, not those of the plant: {error}"
        return table, [Finding("modes-not-of-plant", "doubt", text, machine.modes.file.name)]
    return (with_transmissions(machine, with_grid[0]), with_grid[1]) if with_grid else (table, [])


def _of_cell(machine: Machine) -> tuple[Modes, list[Finding]] | None:
    from feedsim.structure.poses import read_cell  # whose room solves structures, which few runs do

    assert machine.plant is not None
    with Archive(machine.plant) as archive:
        file = archive.directory / POSES_IN_ARCHIVE
        if not file.is_file():
            return None
        modes, centre = read_cell(file, axes_of(archive), machine.pose)
    about = ", ".join(f"{axis} {units.show(position, 'm')}" for axis, position in centre.items())
    at = ", ".join(f"{axis} {units.show(machine.pose[axis], 'm')}" for axis in centre)
    return modes, [Finding(
        "modes-of-one-cell", "doubt",
        f"the plant follows the pose: the modes are those of the archive's cell about {about}; pose: {at}. Where "
        "an axis moves out of that cell, the closed form does not follow it",
    )]  # fmt: skip
