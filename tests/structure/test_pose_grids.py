"""Grids of poses: cells, modes and transfers against a dense eigensolver, and poses.bin against its description."""

from __future__ import annotations

import math
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import sparse

from feedsim.foundation.errors import InputError, OutputError
from feedsim.scenario.structure_checks import load_structure
from feedsim.structure.geometry.assemble import Assembler
from feedsim.structure.modes import read_modes
from feedsim.structure.poses import GridAxis, check_common, grid_axis, pose_grid, read_grid, write_poses
from structure_helpers import GIVEN_POSE, MACHINES, default_structure, dense_modes

STRUCTURE = default_structure()
AXES = tuple(STRUCTURE.axes)
MODES = MACHINES / "test_centre" / "modes.csv"


@pytest.mark.parametrize(
    ("low", "high", "cell", "count"),
    [(0.0, 0.685, 0.02, 35), (0.0, 0.6, 0.2, 3), (0.1, 0.7, 0.2, 3), (0.0, 0.6, 0.1999, 4), (0.0, 0.3, 1.0, 1)],
)
def test_cells_are_equal_and_no_wider_than_asked(low: float, high: float, cell: float, count: int) -> None:
    axis = grid_axis("Z", low, high, cell)
    width = (high - low) / count
    assert len(axis.centres) == count
    assert axis.centres == pytest.approx(low + width * (np.arange(count) + 0.5), abs=1e-15)
    assert axis.boundaries == pytest.approx(low + width * np.arange(1, count), abs=1e-15)
    assert axis.hysteresis == pytest.approx(width / 100)
    assert axis.limits == (axis.centres[0], axis.centres[-1])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0.2, 0.2, 0.1), "0.2 m to 0.2 m; the first must be less"),
        ((0.0, math.nan, 0.1), "the first must be less"),
        ((0.0, 0.2, 0.0), "cells of 0 m; more than 0 m is needed"),
        ((0.0, 0.2, -1.0), "more than 0 m is needed"),
        ((0.0, 0.2, 1e-7), "2e+06 cells; at most 20000 are allowed"),
    ],
)
def test_cells_that_are_refused(arguments: tuple[float, ...], message: str) -> None:
    with pytest.raises(InputError) as caught:
        grid_axis("Z", *arguments)
    assert message in str(caught.value)
    assert "along Z" in str(caught.value)


def test_cells_are_the_modes_of_their_poses_and_transfers_carry_displacements() -> None:
    """Two axes, against shapes of a dense solver: signs and the rigid modes' basis are arbitrary, products are not."""
    grid = (grid_axis("Z", 0.1, 0.3, 0.1), grid_axis("X", 0.6, 1.2, 0.2))
    done: list[tuple[int, int]] = []
    poses = pose_grid(STRUCTURE, GIVEN_POSE, grid, progress=lambda i, n: done.append((i, n)))
    assert done == [(i, 6) for i in range(1, 7)]
    assert [(cell.pose["Z"], cell.pose["X"]) for cell in poses.cells] == [
        (pytest.approx(z), pytest.approx(x)) for z in (0.15, 0.25) for x in (0.7, 0.9, 1.1)
    ]
    assert all(cell.pose["Y"] == GIVEN_POSE["Y"] for cell in poses.cells)
    assert [sorted(along) for along in poses.transfers] == [[0, 1, 2], [0, 1, 3, 4]]
    assembler = Assembler(STRUCTURE)
    assemblies = [assembler.at(cell.pose) for cell in poses.cells]
    shapes = []
    for cell, assembly in zip(poses.cells, assemblies, strict=True):
        frequency, phi = dense_modes(assembly)
        count = len(cell.modes.frequency)
        assert cell.modes.frequency[3:] == pytest.approx(frequency[3:count], rel=1e-6)
        shapes.append(phi[:, :count])
    mass = assemblies[0].mass
    for along, step in zip(poses.transfers, (3, 1), strict=True):
        for lower, transfer in along.items():
            upper = lower + step
            # A force at a port of the lower cell, carried over, against ports of the upper one: c_upper Phi T Phi^T b.
            found = _ports(poses.cells[upper].modes.ports) @ transfer @ _ports(poses.cells[lower].modes.ports).T
            between = shapes[upper].T @ (mass @ shapes[lower])
            b, c = _ports(assemblies[lower].ports), _ports(assemblies[upper].ports)
            expected = (c @ shapes[upper]) @ between @ (b @ shapes[lower]).T
            # Two eigensolvers, shapes good to 1e-8 or so.
            assert np.abs(found - expected).max() < 1e-6 * np.abs(expected).max()
            assert np.linalg.norm(transfer, 2) < 1 + 1e-9


def _ports(ports: object) -> np.ndarray:
    assert hasattr(ports, "__getitem__")
    return np.array([ports[f"{of}_{axis}"] for of in ("n", "x", "tcp") for axis in AXES])


def test_nothing_is_lost_where_no_mode_is_dropped(tmp_path: Path) -> None:
    structure = load_structure(MACHINES / "one_axis" / "structure.yaml")
    poses = pose_grid(structure, {}, [grid_axis("X", 0.1, 0.5, 0.2)], cutoff=math.inf)
    transfer = poses.transfers[0][0]
    assert transfer.shape[0] == transfer.shape[1]
    assert np.abs(transfer.T @ transfer - np.eye(len(transfer))).max() < 1e-9  # of the eigensolver
    # Rigid motion is the same in every pose: a state of it goes over as it is.
    assert np.abs(transfer[0, 1:]).max() < 1e-11
    assert abs(transfer[0, 0]) == pytest.approx(1, abs=1e-11)
    assert write_poses(tmp_path / "poses.bin", poses) == 8 + 8 * poses.size


def test_the_cell_of_the_given_pose_has_the_given_modes() -> None:
    poses = pose_grid(STRUCTURE, GIVEN_POSE, [grid_axis("Z", 0.09, 0.11, 0.02)])
    table = read_modes(MODES, list(AXES))
    assert len(poses.cells) == 1
    assert poses.transfers == ({},)
    assert poses.cells[0].modes.frequency == pytest.approx(table.frequency, rel=1e-6)


# --- poses.bin --------------------------------------------------------------------------------------------------------


def test_the_file_is_what_its_description_says(tmp_path: Path) -> None:
    grid = (grid_axis("Z", 0.1, 0.3, 0.1), replace(grid_axis("X", 0.6, 1.2, 0.2), hysteresis=1e-3))
    poses = pose_grid(STRUCTURE, GIVEN_POSE, grid, axes=("Y", "Z", "X"), cutoff=2 * math.pi * 120)
    file = tmp_path / "poses.bin"
    size = write_poses(file, poses)
    content = file.read_bytes()
    assert len(content) == size == 8 + 8 * poses.size
    assert content[:8] == b"FSPOSES1"
    numbers = list(struct.unpack(f"<{(size - 8) // 8}d", content[8:]))

    def take(count: int) -> list[float]:
        taken = numbers[:count]
        del numbers[:count]
        return taken

    counts = [len(cell.modes.frequency) for cell in poses.cells]
    assert take(3) == [3, 2, max(counts)]
    assert take(3 + 2 + 1) == [1, 2, grid[0].hysteresis, *grid[0].centres, *grid[0].boundaries]
    assert take(3 + 3 + 2) == [2, 3, 1e-3, *grid[1].centres, *grid[1].boundaries]
    for cell, count in zip(poses.cells, counts, strict=True):
        assert take(1) == [count]
        for mode in range(count):
            ports = ["n_Y", "n_Z", "n_X", "tcp_X", "tcp_Y", "tcp_Z", "x_Y", "x_Z", "x_X"]
            expected = [cell.modes.frequency[mode], cell.modes.damping[mode]]
            assert take(11) == [*expected, *(cell.modes.ports[port][mode] for port in ports)]
    for along, step, lowers in ((0, 3, (0, 1, 2)), (1, 1, (0, 1, 3, 4))):
        for lower in lowers:
            transfer = poses.transfers[along][lower]
            assert transfer.shape == (counts[lower + step], counts[lower])
            assert take(transfer.size) == transfer.ravel().tolist()
    assert not numbers
    read = read_grid(file, ("Y", "Z", "X"))
    assert [axis.axis for axis in read] == ["Z", "X"]
    assert all((a.centres == b.centres).all() for a, b in zip(read, grid, strict=True))
    assert all((a.boundaries == b.boundaries).all() for a, b in zip(read, grid, strict=True))


def test_a_file_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    poses = pose_grid(STRUCTURE, GIVEN_POSE, [grid_axis("Z", 0.1, 0.2, 0.1)], cutoff=2 * math.pi * 60)
    file = tmp_path / "poses.bin"
    file.write_bytes(b"before")
    broken = replace(poses, transfers=({0: "no matrix"},))
    with pytest.raises((TypeError, ValueError)):
        write_poses(file, broken)
    assert file.read_bytes() == b"before"
    assert list(tmp_path.iterdir()) == [file]
    with pytest.raises(OutputError):
        write_poses(tmp_path / "nowhere" / "poses.bin", poses)


@pytest.mark.parametrize(
    "content", [b"", b"FSPOSES2", b"FSPOSES1" + bytes(7), b"FSPOSES1" + struct.pack("<3d", 3, 1, 9)]
)
def test_other_files_are_no_grid(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "poses.bin"
    file.write_bytes(content)
    with pytest.raises(InputError, match="cannot be read as a grid of poses"):
        read_grid(file, AXES)


# --- what is refused --------------------------------------------------------------------------------------------------


def test_matrices_know_one_pose_only() -> None:
    found = sorted((MACHINES.parent / "structures").rglob("*.yaml"))
    structures = [load_structure(path) for path in found]
    others = [structure for structure in structures if structure.kind != "geometry"]
    assert others
    with pytest.raises(InputError, match=r"belong to one pose; .* need a structure of kind geometry"):
        pose_grid(others[0], GIVEN_POSE, [grid_axis("Z", 0.1, 0.3, 0.1)])


@pytest.mark.parametrize(
    ("grid", "message"),
    [
        ([], "no axis given; axes are X, Y, Z"),
        ([grid_axis("A", 0.1, 0.3, 0.1)], "'A' is no axis; axes are X, Y, Z"),
        ([grid_axis("Z", 0.1, 0.3, 0.1)] * 2, "axis Z is given 2 times"),
        ([grid_axis("Z", 0.1, 0.9, 0.1)], "outside its travel"),
        ([grid_axis("Z", 0.0, 0.6, 0.001), grid_axis("X", 0.0, 1.7, 0.01)], "102000 cells; at most 20000"),
    ],
)
def test_grids_that_are_refused(grid: list[GridAxis], message: str) -> None:
    with pytest.raises(InputError) as caught:
        pose_grid(STRUCTURE, GIVEN_POSE, grid, cutoff=2 * math.pi * 60)
    assert message in str(caught.value)


def test_a_mass_matrix_that_depends_on_the_pose_is_refused() -> None:
    assembly = Assembler(STRUCTURE).at(GIVEN_POSE)
    check_common(assembly, replace(assembly, mass=assembly.mass.copy()))
    heavier = assembly.mass + sparse.csc_array(([1.0], ([5], [5])), shape=assembly.mass.shape)
    with pytest.raises(InputError, match="mass matrix depends on the pose"):
        check_common(assembly, replace(assembly, mass=heavier))
    with pytest.raises(InputError, match="degrees of freedom depend on the pose"):
        check_common(assembly, replace(assembly, labels=("another", *assembly.labels[1:])))


def test_reach_of_a_grid_is_the_range_asked_for() -> None:
    assert grid_axis("Z", 0.06, 0.24, 0.06).reach == (pytest.approx(0.06), pytest.approx(0.24))
    assert grid_axis("Z", 0.06, 0.24, 1.0).reach == (-math.inf, math.inf)
