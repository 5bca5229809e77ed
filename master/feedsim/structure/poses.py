"""Modes of a grid of poses, and how one pose's basis goes over into the next.

A machine that is written as geometry is meshed body by body, each in its own coordinates. So the degrees of freedom and
the mass matrix M are the same in every pose, and only the springs between the bodies (and where ports read) depend on
it. The modes of all poses are therefore shapes of the same coordinates, orthonormal in the same M, and a state changes
from the basis Phi of one cell to that of its upper neighbour by

    q_upper = T q_lower,   q_lower = T^T q_upper,   T = Phi_upper^T M Phi_lower

exactly, but for what the kept modes of the new cell cannot hold. The plant does that while it runs
(src/plant_fmu/README.md, Poses); the file that it reads is written in feedsim.structure.poses_file.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import product

import numpy as np

from feedsim import units
from feedsim.errors import InputError
from feedsim.scenario.structure import Structure
from feedsim.structure.assembly import Assembly, Floats
from feedsim.structure.geometry.assemble import movable
from feedsim.structure.poses_file import Cell, GridAxis, PoseGrid
from feedsim.structure.solve import solve

# An axis that rests on a boundary swings about it by micrometres (following error, ring-down) and must not change
# cells with every swing; a hundredth of a cell is 0.2 mm for cells of 20 mm. The modes hardly change over that.
HYSTERESIS = 0.01
# What a grid may hold at most: the plant has all of it in memory.
MOST_CELLS = 20000


def grid_axis(axis: str, low: float, high: float, cell: float) -> GridAxis:
    """Cells of equal width from `low` to `high` [m], as few as are no wider than `cell` [m].

    Raises:
        InputError: the range is empty, or the cell is out of range.
    """
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise InputError(
            f"grid of poses along {axis}: {units.show(low, 'm')} to {units.show(high, 'm')}; the first must be less"
        )
    if not cell > 0:
        raise InputError(f"grid of poses along {axis}: cells of {units.show(cell, 'm')}; more than 0 m is needed")
    wanted = (high - low) / cell
    if wanted > MOST_CELLS:
        raise InputError(f"grid of poses along {axis}: {wanted:.3g} cells; at most {MOST_CELLS} are allowed")
    count = max(1, math.ceil(wanted - 1e-9))
    width = (high - low) / count
    edges = np.linspace(low, high, count + 1)
    return GridAxis(axis, (edges[:-1] + edges[1:]) / 2, edges[1:-1], HYSTERESIS * width)


def pose_grid(
    structure: Structure,
    pose: Mapping[str, float],
    grid: Sequence[GridAxis],
    *,
    axes: Sequence[str] | None = None,
    cutoff: float | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> PoseGrid:
    """The modes of every cell, and the changes between neighbours.

    Args:
        pose: axis -> position [m] of the axes that the grid does not extend along (others are not looked at).
        axes: the machine's axes in the plant's order; by default the structure's.
        cutoff: [rad/s], in place of the structure's own.
        progress: called with (cells done, cells in all).

    Raises:
        InputError: the structure is known at one pose only; an axis is unknown, named twice or out of travel.
    """
    assembler = movable(structure)
    names = tuple(axes or assembler.structure.axes)
    _check_axes(names, grid)
    shape = tuple(len(axis.centres) for axis in grid)
    count = math.prod(shape)
    if count > MOST_CELLS:
        raise InputError(f"grid of poses: {count} cells; at most {MOST_CELLS} are allowed")
    strides = [math.prod(shape[g + 1 :]) for g in range(len(grid))]
    others = {axis: position for axis, position in pose.items() if axis in assembler.structure.axes}
    cells: list[Cell] = []
    transfers: tuple[dict[int, Floats], ...] = tuple({} for _ in grid)
    kept: dict[int, Floats] = {}  # shapes as far back as a neighbour needs them
    first: Assembly | None = None
    for index, centres in enumerate(product(*(axis.centres.tolist() for axis in grid))):
        here = {**others, **{axis.axis: centre for axis, centre in zip(grid, centres, strict=True)}}
        assembly = assembler.at(here)
        first = first or assembly
        check_common(first, assembly)
        solution = solve(assembly, cutoff=structure.cutoff if cutoff is None else cutoff, damping=structure.damping)
        cells.append(Cell(dict(assembly.pose), solution.modes))
        moved = assembly.mass @ solution.shapes
        for g, stride in enumerate(strides):
            if index // stride % shape[g] > 0:
                transfers[g][index - stride] = np.asarray(moved.T @ kept[index - stride])
        kept[index] = solution.shapes
        kept.pop(index - max(strides), None)
        if progress is not None:
            progress(index + 1, count)
    return PoseGrid(names, tuple(grid), tuple(cells), transfers)


def check_common(first: Assembly, other: Assembly) -> None:
    """Both poses have the same degrees of freedom and the same mass matrix: their modes can be compared at all.

    Raises:
        InputError: they have not.
    """
    if first.labels != other.labels:
        raise InputError(f"{first.name}: its degrees of freedom depend on the pose; no grid of poses can be made")
    if first.mass is other.mass:
        return
    difference = abs(first.mass - other.mass).max()
    if difference > 0:
        raise InputError(
            f"{first.name}: its mass matrix depends on the pose (entries differ by up to {difference:.3g}); states "
            "cannot be carried from pose to pose"
        )


def _check_axes(axes: Sequence[str], grid: Sequence[GridAxis]) -> None:
    if not grid:
        raise InputError(f"grid of poses: no axis given; axes are {', '.join(axes)}")
    named = [axis.axis for axis in grid]
    for axis in named:
        if axis not in axes:
            raise InputError(f"grid of poses: {axis!r} is no axis; axes are {', '.join(axes)}")
        if named.count(axis) > 1:
            raise InputError(f"grid of poses: axis {axis} is given {named.count(axis)} times; once is allowed")
