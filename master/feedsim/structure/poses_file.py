"""poses.bin, the grid of poses as the plant reads it: src/plant_fmu/README.md, Tables."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feedsim.errors import InputError
from feedsim.structure.modes import TOOL_PORTS
from feedsim.structure.poses import Cell, GridAxis, PoseGrid
from feedsim.trace.files import written_whole

MARK = b"FSPOSES1"

Floats = NDArray[np.float64]


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
        content = path.read_bytes()
        if not content.startswith(MARK):
            raise ValueError(f"it does not begin with {MARK.decode()}")
        numbers = np.frombuffer(content, "<f8", offset=len(MARK))
        grid, at = [], 3
        for _ in range(int(numbers[1])):
            axis, count, hysteresis = int(numbers[at]), int(numbers[at + 1]), float(numbers[at + 2])
            centres, boundaries = np.split(numbers[at + 3 : at + 3 + 2 * count - 1], [count])
            grid.append(GridAxis(axes[axis], centres.copy(), boundaries.copy(), hysteresis))
            at += 3 + 2 * count - 1
    except (OSError, ValueError, IndexError) as error:
        raise InputError(f"{path}: cannot be read as a grid of poses: {error}") from error
    return tuple(grid)


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
    ports = [f"n_{axis}" for axis in poses.axes] + list(TOOL_PORTS) + [f"x_{axis}" for axis in poses.axes]
    return np.column_stack([modes.frequency, modes.damping, *(modes.ports[port] for port in ports)])
