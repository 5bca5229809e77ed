"""``feedsim machine pack --poses``: the modes of a grid of poses, for a plant that follows its axes."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from feedsim.errors import InputError

if TYPE_CHECKING:
    from feedsim.scenario import Machine
    from feedsim.structure.poses import GridAxis

# A cell takes a tenth of a second and, with two axes and a hundred modes, 0.2 MB in the archive and in the plant.
MOST_CELLS = 3000
# Positions that are typed twice are the same where they differ by less [m].
START = 1e-9
EXAMPLE = "Z=20mm or Z=0mm..400mm/20mm"


def add_poses(pack: argparse.ArgumentParser) -> None:
    """Add --poses to the command `pack`."""
    pack.add_argument(
        "--poses",
        nargs="+",
        default=[],
        metavar="AXIS=CELL",
        help="let the plant follow the pose: modes of a grid of poses, by the size of its cells, over the whole travel "
        "(Z=20mm) or a part of it (Z=0mm..400mm/20mm), along one axis or several (docs/position-dependence.md)",
    )


def write_grid(machine: Machine, pose: Mapping[str, float], modes: Path, options: argparse.Namespace, out: Path) -> str:
    """Compute the grid that --poses asks for, about `pose` [m], and write it to `out`; returns what was made, in words.

    modes: table at `pose`, which says how large the grid will be.

    Raises:
        InputError: no such axis, no such cells, or a machine whose structure is known at one pose only.
    """
    from tqdm import tqdm

    from feedsim.scenario import load_structure
    from feedsim.structure.modes import read_modes
    from feedsim.structure.poses import check_same_machine, movable, pose_grid
    from feedsim.structure.poses_file import write_poses

    if machine.structure is None:
        raise InputError(
            f"{machine.name}: has no structure to compute the modes of other poses from; give the machine file the key "
            "structure, or leave --poses out"
        )
    structure = load_structure(machine.structure)
    movable(structure)
    grid = grid_axes(machine, options.poses)
    if not options.at:  # else its modes were computed from the structure just now
        check_same_machine(read_modes(machine.modes, list(machine.axes)), structure, machine.pose)
    _announce(machine, pose, grid, len(read_modes(modes, list(machine.axes)).frequency))
    with tqdm(unit="pose", leave=False, file=sys.stderr, disable=None) as bar:

        def progress(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        poses = pose_grid(structure, pose, grid, axes=list(machine.axes), progress=progress)
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

    found: list[GridAxis] = []
    for text in texts:
        name, equals, rest = text.partition("=")
        if not equals or not rest:
            raise InputError(f"--poses {text}: {EXAMPLE} is the form")
        if name not in machine.axes:
            raise InputError(f"--poses {text}: the machine has no axis {name!r}; axes are {', '.join(machine.axes)}")
        if any(axis.axis == name for axis in found):
            raise InputError(f"--poses {text}: axis {name} is given twice")
        low, high = travel = machine.axes[name].travel
        limits, slash, cell = rest.rpartition("/") if ".." in rest else ("", "", rest)
        if ".." in rest and not slash:
            raise InputError(f"--poses {text}: the size of the cells is missing; {EXAMPLE} is the form")
        try:
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
            found.append(axis)
        except InputError as error:
            raise InputError(f"--poses {text}: {error}") from None
    return found
