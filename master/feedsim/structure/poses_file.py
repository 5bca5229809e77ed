"""Modes of a grid of poses, and poses.bin, their file as the plant reads it: src/plant_fmu/README.md, Tables."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from feedsim.errors import InputError
from feedsim.structure.assembly import Floats
from feedsim.structure.modes import TOOL_PORTS, Modes
from feedsim.trace.files import written_whole

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
