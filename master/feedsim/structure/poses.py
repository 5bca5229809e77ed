"""Modes of a grid of poses, and how one pose's basis goes over into the next.

A machine that is written as geometry is meshed body by body, each in its own coordinates. So the degrees of freedom and
the mass matrix M are the same in every pose, and only the springs between the bodies (and where ports read) depend on
it. The modes of all poses are therefore shapes of the same coordinates, orthonormal in the same M, and a state changes
from the basis Phi of one cell to that of its upper neighbour by

    q_upper = T q_lower,   q_lower = T^T q_upper,   T = Phi_upper^T M Phi_lower

exactly, but for what the kept modes of the new cell cannot hold. The plant does that while it runs
(src/plant_fmu/README.md, Poses); the file that it reads is written in feedsim.structure.poses.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np

from feedsim.files.trace.files import written_whole
from feedsim.foundation import units
from feedsim.foundation.errors import InputError
from feedsim.scenario.structure import Structure
from feedsim.structure.assembly import Assembly, Floats
from feedsim.structure.geometry.assemble import movable
from feedsim.structure.modes import TOOL_PORTS, Modes
from feedsim.structure.solve import solve

# --- Modes of a grid of poses, and poses.bin, their file as the plant reads it: src/plant_fmu/README.md, Tables -------


MARK = b"FSPOSES1"


@dataclass(frozen=True, eq=False)
class GridAxis:
    """Cells along an axis.

    Attributes:
        axis: its name.
        centres: (n,) positions that the modes belong to, ascending [m].
        boundaries: (n - 1,) where the cells meet [m]. The outermost cells have no end.
        hysteresis: how far beyond a boundary the axis must be for the cell to change [m].
    """

    axis: str
    centres: Floats
    boundaries: Floats
    hysteresis: float

    @property
    def limits(self) -> tuple[float, float]:
        """First and last centre [m]."""
        return float(self.centres[0]), float(self.centres[-1])

    @property
    def reach(self) -> tuple[float, float]:
        """Where the first and the last cell end, were they as wide as asked for; of a single cell unlimited [m]."""
        if len(self.centres) == 1:
            return -math.inf, math.inf
        first, last = self.limits
        return 2 * first - float(self.boundaries[0]), 2 * last - float(self.boundaries[-1])


@dataclass(frozen=True, eq=False)
class Cell:
    """A pose of the grid (axis -> position [m]) and its modes."""

    pose: Mapping[str, float]
    modes: Modes


@dataclass(frozen=True, eq=False)
class PoseGrid:
    """Modes of all cells of a grid of poses.

    Attributes:
        axes: of the machine, in the plant's order.
        grid: the axes that the grid extends along.
        cells: row-major, the last grid axis fastest.
        transfers: per grid axis, cell -> T (modes of its upper neighbour, own modes) for all cells that have one.
    """

    axes: tuple[str, ...]
    grid: tuple[GridAxis, ...]
    cells: tuple[Cell, ...]
    transfers: tuple[Mapping[int, Floats], ...]

    @property
    def size(self) -> int:
        """Numbers that poses.bin holds, 8 bytes each; the plant has as much in memory, and some more."""
        heads = 3 + sum(3 + 2 * len(axis.centres) - 1 for axis in self.grid)
        rows = sum(1 + len(cell.modes.frequency) * (2 + len(cell.modes.ports)) for cell in self.cells)
        return heads + rows + sum(t.size for along in self.transfers for t in along.values())


def write_poses(path: Path, poses: PoseGrid) -> int:
    """Write a grid of poses, whole or not at all; returns its size [byte].

    Raises:
        OutputError: it cannot be written; an old file of that name is then as it was.
    """
    size = len(MARK)
    with written_whole(path) as file:
        file.write(MARK)
        for numbers in _numbers(poses):
            content = np.ascontiguousarray(numbers, dtype="<f8").tobytes()
            file.write(content)
            size += len(content)
    return size


def read_grid(path: Path, axes: Sequence[str]) -> tuple[GridAxis, ...]:
    """The grid axes of a poses.bin, of a machine with `axes` in the plant's order. The plant checks the file; not here.

    Raises:
        InputError: it is no such file.
    """
    try:
        return _grid(_content(path), axes)[0]
    except (OSError, ValueError, IndexError, OverflowError) as error:
        raise InputError(f"{path}: cannot be read as a grid of poses: {error}") from error


def read_cell(path: Path, axes: Sequence[str], pose: Mapping[str, float]) -> tuple[Modes, dict[str, float]]:
    """Modes of the cell that a pose (axis -> position [m]) lies in, and the cell's centre (grid axis -> position [m]).

    It is the cell that the plant starts in: a boundary belongs to the cell below it, the outermost ones have no end.

    Raises:
        InputError: it is no such file.
    """
    try:
        numbers = _content(path)
        grid, at = _grid(numbers, axes)
        cell, centre = 0, {}
        for axis in grid:
            k = int(np.searchsorted(axis.boundaries, pose[axis.axis], side="left"))
            cell = cell * len(axis.centres) + k
            centre[axis.axis] = float(axis.centres[k])
        ports = _ports(axes)
        width = 2 + len(ports)
        for _ in range(cell):
            at += 1 + _modes_at(numbers, at) * width
        count = _modes_at(numbers, at)
        rows = numbers[at + 1 : at + 1 + count * width].reshape(count, width)
    except (OSError, ValueError, IndexError, OverflowError) as error:
        raise InputError(f"{path}: cannot be read as a grid of poses: {error}") from error
    shapes = {port: rows[:, 2 + i].copy() for i, port in enumerate(ports)}
    return Modes(path, rows[:, 0].copy(), rows[:, 1].copy(), shapes), centre


def _content(path: Path) -> Floats:
    """The numbers of a file."""
    content = path.read_bytes()
    if not content.startswith(MARK):
        raise ValueError(f"it does not begin with {MARK.decode()}")
    return np.frombuffer(content, "<f8", offset=len(MARK))


def _modes_at(numbers: Floats, at: int) -> int:
    """How many modes the cell at `at` has."""
    if (count := int(numbers[at])) < 0:
        raise ValueError(f"a cell has {count} modes")
    return count


def _grid(numbers: Floats, axes: Sequence[str]) -> tuple[tuple[GridAxis, ...], int]:
    """The grid axes, and where the first cell begins."""
    grid, at = [], 3
    for _ in range(int(numbers[1])):
        axis, count, hysteresis = int(numbers[at]), int(numbers[at + 1]), float(numbers[at + 2])
        if not (0 <= axis < len(axes) and 0 < count <= len(numbers)):
            raise ValueError(f"axis {axis} has {count} cells")
        centres, boundaries = np.split(numbers[at + 3 : at + 3 + 2 * count - 1], [count])
        grid.append(GridAxis(axes[axis], centres.copy(), boundaries.copy(), hysteresis))
        at += 3 + 2 * count - 1
    return tuple(grid), at


def _ports(axes: Sequence[str]) -> list[str]:
    return [f"n_{axis}" for axis in axes] + list(TOOL_PORTS) + [f"x_{axis}" for axis in axes]


def _numbers(poses: PoseGrid) -> Iterator[Floats]:
    """All numbers of the file, part by part."""
    most = max(len(cell.modes.frequency) for cell in poses.cells)
    yield np.array([len(poses.axes), len(poses.grid), most], dtype=np.float64)
    for axis in poses.grid:
        yield np.array([poses.axes.index(axis.axis), len(axis.centres), axis.hysteresis])
        yield axis.centres
        yield axis.boundaries
    for cell in poses.cells:
        yield np.array([len(cell.modes.frequency)], dtype=np.float64)
        yield _rows(poses, cell)
    for along in poses.transfers:
        for _, transfer in sorted(along.items()):
            yield transfer


def _rows(poses: PoseGrid, cell: Cell) -> Floats:
    """(modes, 2 + 2 A + 3): frequency [Hz], damping ratio, n of all axes, tcp_X, tcp_Y, tcp_Z, x of all axes."""
    modes = cell.modes
    return np.column_stack([modes.frequency, modes.damping, *(modes.ports[port] for port in _ports(poses.axes))])


# --- Modes of a grid of poses, and how one pose's basis goes over into the next ---------------------------------------


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
