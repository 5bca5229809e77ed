"""A machine at a pose, or over a grid of poses, in a plant archive."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from feedsim import cosim, scenario, units
from feedsim.arguments import Pairs, Value, by_name, pairs, spelt
from feedsim.errors import InputError
from feedsim.jobs.machine import Positions, positions
from feedsim.jobs.made import Kind, Made
from feedsim.jobs.pack import PACKED
from feedsim.jobs.parameters import File
from feedsim.jobs.watch import NO_WATCH, Watch, announce_archive
from feedsim.outputs import same
from feedsim.owned import TemporaryFolder
from feedsim.scenario import Machine
from feedsim.scenario.described import load_described
from feedsim.scenario.structure.load import load_structure
from feedsim.structure import checked_modes
from feedsim.structure import pack as archive
from feedsim.structure.build import build
from feedsim.structure.geometry.assemble import movable
from feedsim.structure.modes import read_modes, write_modes
from feedsim.structure.poses import grid_axis, pose_grid
from feedsim.structure.poses_file import GridAxis, write_poses
from feedsim.structure.table_check import table_mismatch

KIND = Kind("machine pack", "unit", PACKED, makes_folder=True)
# A cell takes a tenth of a second and, with two axes and a hundred modes, 0.2 MB in the archive and in the plant.
MOST_CELLS = 3000
# Positions that are typed twice are the same where they differ by less [m].
START_TOLERANCE = 1e-9
POSITIONS_EXAMPLE = "Z=20mm or Z=0mm..400mm/20mm"


def machine_pack(
    machine: File,
    out: File | None = None,
    *,
    at: Positions = None,
    poses: Pairs[Value] = None,
    name: str | None = None,
    note: str | None = None,
    terminals: bool = True,
    base: File | None = None,
    force: bool = False,
    watch: Watch = NO_WATCH,
) -> Made:
    """Pack the machine's axes, pose and table of modes into a plant archive; needs no compiler.

    Args:
        machine: machine file, or a folder with a machine.yaml.
        out: archive to write; None: :meth:`Made.save` does it.
        at: axis -> position [m], or a text with a unit; other axes stay at the machine's pose.
        poses: axis -> size of the cells of a grid of poses [m], or a text "20mm" or "0mm..400mm/20mm".
        name, note: of the machine in the archive; None: the machine's own.
        terminals: with terminals and icons, which FMI Library 3 refuses in units of FMI 2.0.
        base: archive whose binaries are taken; None: plant.fmu of those that come along.
        force: `out` may be a file that feedsim did not write.
        watch: who hears how far the job is.

    Raises:
        InputError: a faulty file, no such axis or position, no structure to compute modes from.
        OutputError: `out` cannot be written.

    >>> import feedsim as fs
    >>> fs.export("machines/test_centre", at={"Z": "100 mm"}, plant=True).name
    'plant.fmu'
    """
    described = load_described(machine)
    loaded = scenario.load_machine(machine)
    own = None if base is None else Path(base)
    # The archive that the machine file names as its plant, and one that is packed in place, are made anew here.
    made = [path for path in (loaded.plant, own) if path is not None]
    files = [file for _, file in described.files if not any(same(file, path) for path in made)]
    read = [Path(machine), loaded.modes, *files]
    with KIND.checked(out, read, force=force) as path:
        announce_archive(watch, own, "the packed plant's trial")
        pose = _pose_of(loaded, at)
        with TemporaryFolder() as folder:
            modes = _modes_at(loaded, pose, folder / "modes.csv") if at else loaded.modes
            checked_modes(loaded.model_copy(update={"modes": modes}))  # what a run would refuse should not be packed
            if not at and (doubt := table_mismatch(loaded)) is not None:
                raise InputError(f"{doubt}, or let the modes be computed: {spelt('at')}")
            grid, follows = None, ""
            if poses:
                grid = folder / "poses.bin"
                follows = f"; {_write_grid(loaded, pose, modes, poses, watch, grid)}"
            packed = archive.pack(
                own or cosim.fmus_directory() / "plant.fmu",
                folder / "plant.fmu",
                modes=modes,
                pose=pose,
                poses=grid,
                name=loaded.name if name is None else name,
                note=loaded.note if note is None else note,
                terminals=terminals,
            )
            content = packed.path.read_bytes()
        where = ", ".join(f"{axis} at {position * 1e3:.9g} mm" for axis, position in pose.items())
        line = (
            f"{where}{follows}; {packed.size / 1024:.0f} KiB, {', '.join(packed.platforms) or 'no binaries'}, "
            f"guid {packed.guid}"
        )
        result = Made(KIND, "plant.fmu", content, [line], inputs=read)
        if path is not None:
            result.save(path, force=force)
    return result


def _pose_of(machine: Machine, at: Positions) -> dict[str, float]:
    """The machine's pose [m], axes in its order, with the positions `at` in place of its own.

    Raises:
        InputError: no such axis, no length, or outside of the axis' travel.
    """
    pose = {axis: machine.pose[axis] for axis in machine.axes}
    for axis, position in positions(at).items():
        if axis not in pose:
            raise InputError(f"{spelt('at')}: the machine has no axis {axis}; axes are {', '.join(pose)}")
        low, high = machine.axes[axis].travel
        if not low <= position <= high:
            raise InputError(
                f"{spelt('at')} {axis}: {units.show(position, 'm')} is outside of the travel, "
                f"{units.show(low, 'm')} to {units.show(high, 'm')}"
            )
        pose[axis] = position
    return pose


def _modes_at(machine: Machine, pose: Mapping[str, float], out: Path) -> Path:
    """Table of the machine's modes at `pose` [m], computed from its structure and written to `out`.

    Raises:
        InputError: the machine has no structure, its kind is known at one pose only, or it is faulty.
    """
    if machine.structure is None:
        raise InputError(
            f"{machine.name}: has no structure to compute modes from at another pose; give it the key structure, or "
            f"leave {spelt('at')} out"
        )
    write_modes(out, build(load_structure(machine.structure), pose).solution.modes)
    return out


def _write_grid(
    machine: Machine, pose: Mapping[str, float], modes: Path, asked: Pairs[Value], watch: Watch, out: Path
) -> str:
    """Compute the grid that is asked for, about `pose` [m], and write it to `out`; returns what was made, in words.

    modes: table at `pose`, which says how large the grid will be.

    Raises:
        InputError: no such axis, no such cells, or a machine whose structure is known at one pose only.
    """
    if machine.structure is None:
        raise InputError(
            f"{machine.name}: has no structure to compute the modes of other poses from; give the machine file the key "
            f"structure, or leave {spelt('poses')} out"
        )
    structure = load_structure(machine.structure)
    movable(structure)
    grid = grid_axes(machine, asked)
    axes = list(machine.axes)
    watch.say(_size(machine, pose, grid, len(read_modes(modes, axes).frequency)))
    poses = pose_grid(structure, pose, grid, axes=axes, progress=watch.of(machine.name))
    size = write_poses(out, poses)
    cells = " x ".join(f"{len(axis.centres)} in {axis.axis}" for axis in grid)
    return f"follows the pose, {len(poses.cells)} cells ({cells}), {size / 2**20:.1f} MiB of modes"


def _size(machine: Machine, pose: Mapping[str, float], grid: Sequence[GridAxis], count: int) -> str:
    """How much is about to be computed, of `count` modes per cell, in words.

    Raises:
        InputError: too much, or the plant would start outside of the grid.
    """
    for axis in grid:
        low, high = axis.reach
        if not low - START_TOLERANCE <= pose[axis.axis] <= high + START_TOLERANCE:
            raise InputError(
                f"{spelt('poses')}: the machine stands at {axis.axis} {pose[axis.axis] * 1e3:.6g} mm, outside of the "
                f"grid, {low * 1e3:.6g} mm to {high * 1e3:.6g} mm; choose a range that holds it, or another pose with "
                f"{spelt('at')}"
            )
    cells = math.prod(len(axis.centres) for axis in grid)
    numbers = cells * (1 + count * (5 + 2 * len(machine.axes)) + len(grid) * count**2)
    size = f"{cells} cells of about {count} modes, about {8 * numbers / 2**20:.3g} MiB"
    if cells > MOST_CELLS:
        raise InputError(
            f"{spelt('poses')}: {size}; at most {MOST_CELLS} cells are allowed: larger cells, or fewer axes"
        )
    return size


def grid_axes(machine: Machine, poses: Pairs[Value]) -> list[GridAxis]:
    """Grid axes of axis -> size of the cells [m], or a text CELL or LOW..HIGH/CELL.

    Raises:
        InputError: no such form, no such axis, or a range outside of its travel.
    """

    def axis_of(name: str, given: Value) -> GridAxis:
        if name not in machine.axes:
            raise InputError(f"the machine has no axis {name!r}; axes are {', '.join(machine.axes)}")
        low, high = travel = machine.axes[name].travel
        rest = given if isinstance(given, str) else f"{given} m"
        limits, slash, cell = rest.rpartition("/") if ".." in rest else ("", "", rest)
        if ".." in rest and not slash:
            raise InputError(f"the size of the cells is missing; {POSITIONS_EXAMPLE} is the form")
        width = units.parse(cell, "m", "20 mm")
        if slash:
            first, _, last = limits.partition("..")
            low, high = units.parse(first, "m", "0 mm"), units.parse(last, "m", "400 mm")
        if not travel[0] <= low <= travel[1] or not travel[0] <= high <= travel[1]:
            raise InputError(
                f"outside of the travel of {name}, {units.show(travel[0], 'm')} to {units.show(travel[1], 'm')}"
            )
        axis = grid_axis(name, low, high, width)
        if len(axis.centres) == 1:
            raise InputError(
                f"as wide as the {'range' if slash else 'travel'}, {units.show(high - low, 'm')}, or wider: 1 cell "
                "does not follow; leave the axis out, or give smaller cells"
            )
        return axis

    given = pairs("poses", poses, f"{POSITIONS_EXAMPLE} is the form")
    return [*by_name("poses", given, axis_of).values()]
