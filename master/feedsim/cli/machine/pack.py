"""``feedsim machine pack``: a machine at a pose, or over a grid of poses, in a plant archive."""

from __future__ import annotations

import math
import sys
from argparse import Namespace
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from feedsim.cli.machine.figures import AT, positions
from feedsim.cli.options import Command, Option, by_name
from feedsim.cli.pack import PACKED
from feedsim.cli.terminal import announce_archive, progress_bar
from feedsim.errors import InputError
from feedsim.outputs import check_file, same
from feedsim.owned import TemporaryFolder

if TYPE_CHECKING:
    from feedsim.scenario import Machine
    from feedsim.structure.poses_file import GridAxis

# A cell takes a tenth of a second and, with two axes and a hundred modes, 0.2 MB in the archive and in the plant.
MOST_CELLS = 3000
# Positions that are typed twice are the same where they differ by less [m].
START = 1e-9
EXAMPLE = "Z=20mm or Z=0mm..400mm/20mm"


def pack(options: Namespace) -> None:
    """feedsim machine pack: the machine at its pose with its own modes, or at another pose with those there."""
    from feedsim import cosim, scenario
    from feedsim.scenario.described import load_described
    from feedsim.structure import checked_modes
    from feedsim.structure import pack as archive
    from feedsim.structure.table_check import table_mismatch

    described = load_described(options.machine)
    machine = scenario.load_machine(options.machine)
    # The archive that the machine file names as its plant, and one that is packed in place, are made anew here.
    made = [path for path in (machine.plant, options.base) if path is not None]
    read = [file for _, file in described.files if not any(same(file, each) for each in made)]
    check_file(options.out, [options.machine, machine.modes, *read], ours=PACKED, what="unit")
    announce_archive(options.base, "the packed plant's trial")
    base = options.base or cosim.fmus_directory() / "plant.fmu"
    pose = _pose_of(machine, options.at)
    with TemporaryFolder() as folder:
        modes = _modes_at(machine, pose, folder / "modes.csv") if options.at else machine.modes
        checked_modes(machine.model_copy(update={"modes": modes}))  # what a run would refuse should not be packed
        if not options.at and (doubt := table_mismatch(machine)) is not None:
            raise InputError(f"{doubt}, or let the modes be computed: --at")
        poses, follows = None, ""
        if options.poses:
            poses = folder / "poses.bin"
            follows = f"; {_write_grid(machine, pose, modes, options, poses)}"
        # Packed apart: the file takes its name when it is whole, and nothing of one that is killed stays beside it.
        packed = archive.pack(
            base,
            folder / "plant.fmu",
            modes=modes,
            pose=pose,
            poses=poses,
            name=machine.name if options.name is None else options.name,
            note=machine.note if options.note is None else options.note,
        )
        with suppress(OSError):  # what it is will be told
            options.out.absolute().parent.mkdir(parents=True, exist_ok=True)
        from feedsim.trace.files import written_whole

        with written_whole(options.out) as file:
            file.write(packed.path.read_bytes())
    where = ", ".join(f"{axis} at {position * 1e3:.9g} mm" for axis, position in pose.items())
    platforms = ", ".join(packed.platforms) or "no binaries"
    print(f"{options.out}: {where}{follows}; {packed.size / 1024:.0f} KiB, {platforms}, guid {packed.guid}")


def _pose_of(machine: Machine, texts: Sequence[str]) -> dict[str, float]:
    """The machine's pose [m], axes in its order, with the positions that `texts` (AXIS=POSITION) change.

    Raises:
        InputError: no such axis, no length, or outside of the axis' travel.
    """
    from feedsim import units

    pose = {axis: machine.pose[axis] for axis in machine.axes}
    for axis, position in positions(texts).items():
        if axis not in pose:
            raise InputError(f"--at: the machine has no axis {axis}; axes are {', '.join(pose)}")
        low, high = machine.axes[axis].travel
        if not low <= position <= high:
            raise InputError(
                f"--at {axis}: {units.show(position, 'm')} is outside of the travel, {units.show(low, 'm')} to "
                f"{units.show(high, 'm')}"
            )
        pose[axis] = position
    return pose


def _modes_at(machine: Machine, pose: Mapping[str, float], out: Path) -> Path:
    """Table of the machine's modes at `pose` [m], computed from its structure and written to `out`.

    Raises:
        InputError: the machine has no structure, its kind is known at one pose only, or it is faulty.
    """
    from feedsim.scenario.structure.load import load_structure
    from feedsim.structure.build import build
    from feedsim.structure.modes import write_modes

    if machine.structure is None:
        raise InputError(
            f"{machine.name}: has no structure to compute modes from at another pose; give it the key structure, or "
            "leave --at out"
        )
    write_modes(out, build(load_structure(machine.structure), pose).solution.modes)
    return out


def _write_grid(machine: Machine, pose: Mapping[str, float], modes: Path, options: Namespace, out: Path) -> str:
    """Compute the grid that --poses asks for, about `pose` [m], and write it to `out`; returns what was made, in words.

    modes: table at `pose`, which says how large the grid will be.

    Raises:
        InputError: no such axis, no such cells, or a machine whose structure is known at one pose only.
    """
    from feedsim.scenario.structure.load import load_structure
    from feedsim.structure.geometry.assemble import movable
    from feedsim.structure.modes import read_modes
    from feedsim.structure.poses import pose_grid
    from feedsim.structure.poses_file import write_poses

    if machine.structure is None:
        raise InputError(
            f"{machine.name}: has no structure to compute the modes of other poses from; give the machine file the key "
            "structure, or leave --poses out"
        )
    structure = load_structure(machine.structure)
    movable(structure)
    grid = grid_axes(machine, options.poses)
    _announce(machine, pose, grid, len(read_modes(modes, list(machine.axes)).frequency))
    with progress_bar(False, " poses") as progress:
        axes = list(machine.axes)
        poses = pose_grid(structure, pose, grid, axes=axes, progress=progress.of(machine.name))
    size = write_poses(out, poses)
    cells = " x ".join(f"{len(axis.centres)} in {axis.axis}" for axis in grid)
    return f"follows the pose, {len(poses.cells)} cells ({cells}), {size / 2**20:.1f} MiB of modes"


def _announce(machine: Machine, pose: Mapping[str, float], grid: Sequence[GridAxis], count: int) -> None:
    """Say how much is about to be computed, of `count` modes per cell.

    Raises:
        InputError: too much, or the plant would start outside of the grid.
    """
    for axis in grid:
        low, high = axis.reach
        if not low - START <= pose[axis.axis] <= high + START:
            raise InputError(
                f"--poses: the machine stands at {axis.axis} {pose[axis.axis] * 1e3:.6g} mm, outside of the grid, "
                f"{low * 1e3:.6g} mm to {high * 1e3:.6g} mm; choose a range that holds it, or another pose with --at"
            )
    cells = math.prod(len(axis.centres) for axis in grid)
    numbers = cells * (1 + count * (5 + 2 * len(machine.axes)) + len(grid) * count**2)
    size = f"{cells} cells of about {count} modes, about {8 * numbers / 2**20:.3g} MiB"
    if cells > MOST_CELLS:
        raise InputError(f"--poses: {size}; at most {MOST_CELLS} cells are allowed: larger cells, or fewer axes")
    print(f"  {size}", file=sys.stderr)


def grid_axes(machine: Machine, texts: Sequence[str]) -> list[GridAxis]:
    """Grid axes of texts AXIS=CELL or AXIS=LOW..HIGH/CELL.

    Raises:
        InputError: no such form, no such axis, an axis that is named twice, or a range outside of its travel.
    """
    from feedsim import units
    from feedsim.structure.poses import grid_axis

    def axis_of(name: str, rest: str) -> GridAxis:
        if name not in machine.axes:
            raise InputError(f"the machine has no axis {name!r}; axes are {', '.join(machine.axes)}")
        low, high = travel = machine.axes[name].travel
        limits, slash, cell = rest.rpartition("/") if ".." in rest else ("", "", rest)
        if ".." in rest and not slash:
            raise InputError(f"the size of the cells is missing; {EXAMPLE} is the form")
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

    return [*by_name("poses", texts, f"{EXAMPLE} is the form", axis_of).values()]


PACK = Command(
    "pack",
    "pack the machine into a plant archive; needs no compiler",
    pack,
    (
        Option("machine", "MACHINE", "machine file, or a folder with a machine.yaml", type=Path),
        AT,
        Option("--poses", "AXIS=CELL",
               "let the plant follow the pose: modes of a grid of poses, by the size of its cells, over the whole "
               "travel (Z=20mm) or a part of it (Z=0mm..400mm/20mm), along one axis or several "
               "(docs/position-dependence.md)", nargs="+", default=[]),
        Option("--out", "PLANT.fmu", "archive to write", type=Path, required=True),
        Option("--name", "NAME", "name of the machine in the archive (default: the machine's)"),
        Option("--note", "NOTE", "a remark that goes with the name (default: the machine's)"),
        Option("--base", "PLANT.fmu",
               "archive whose binaries are taken (default: plant.fmu in $FEEDSIM_FMUS, else in fmus/)", type=Path),
    ),
    "Pack the machine's axes, pose and table of modes into a plant archive. The binaries are those of the base "
    "archive, for all its platforms.",
)  # fmt: skip
