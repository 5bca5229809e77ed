"""A machine whose springs depend on where its axes stand, modes of a grid of its poses, and archives of them.

Everything here is written for the tests alone: poses.bin by its description, bases by scipy.
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from plant_unit import AXES, write_modes
from scipy.linalg import eigh

from fmi_helpers import Archive, Floats

LEAD = 0.02 / (2 * math.pi)  # [m/rad]
DOFS = 12  # per direction: bed, rotor [rad], slide and tool against where the rotor's lead takes them
BED, ROTOR, SLIDE, TOOL = (np.arange(3) + 3 * i for i in range(4))
BETA = 4e-5  # damping [s]: C = BETA K, so that rigid modes have none; 2 % at 160 Hz


def _row(*entries: tuple[int, float]) -> Floats:
    row = np.zeros(DOFS)
    for dof, factor in entries:
        row[dof] = factor
    return row


# inputs: torques on the rotors, forces on the tool; outputs: rotors' angles, tool, scales (slide against bed)
N = np.array([_row((ROTOR[i], 1.0)) for i in range(3)])
X = np.array([_row((SLIDE[i], 1.0), (ROTOR[i], LEAD), (BED[i], -1.0)) for i in range(3)])
TCP = np.array([_row((TOOL[i], 1.0), (ROTOR[i], LEAD)) for i in range(3)])


def mass() -> Floats:
    """Mass matrix, the same in every pose (DOFS, DOFS) [kg, kg.m2 at the rotors]; not diagonal."""
    m = np.diag([4000.0] * 3 + [0.005, 0.004, 0.006] + [900.0, 400.0, 300.0] + [150.0, 80.0, 60.0])
    coupling = np.random.default_rng(1).uniform(-0.1, 0.1, (DOFS, DOFS))
    root = np.sqrt(np.diag(m))
    absolute = np.eye(DOFS)
    absolute[SLIDE, ROTOR] = absolute[TOOL, ROTOR] = LEAD
    return absolute.T @ (m + (coupling + coupling.T) / 2 * root * root[:, None]) @ absolute


def stiffness(position: Sequence[float] | Floats) -> Floats:
    """Stiffness matrix with the axes at `position` (3,) [m]: screws soften with length, the bed rocks with the load."""
    k = np.zeros((DOFS, DOFS))
    for i, x in enumerate(position):
        screw = _row((SLIDE[i], -1.0), (BED[i], 1.0))
        neck = _row((TOOL[i], 1.0), (SLIDE[i], -1.0))
        neighbour = _row((BED[i], 1.0), (BED[(i + 1) % 3], -x))
        k += (1.5e8 / (1 + x)) * np.outer(screw, screw) + 6e7 * (1 + 0.5 * x) * np.outer(neck, neck)
        k += 9e7 * np.outer(neighbour, neighbour)
        drag = _row((TOOL[i], 1.0), (SLIDE[i], -1.0), (BED[(i + 2) % 3], 0.3 * x))
        k += 2e7 * np.outer(drag, drag)
    return k


def rigid_modes() -> Floats:
    """Motion that bends no spring (DOFS, 3), the same in every pose: to the last bit, or a reference would drift."""
    return np.eye(DOFS)[:, ROTOR]


@dataclass(frozen=True)
class Cell:
    """Modes of one pose, mass-normalised: omega (K,), shapes in the physical coordinates phi (DOFS, K)."""

    omega: Floats
    phi: Floats

    def rows(self) -> Floats:
        """Rows of a mode table as poses.bin has them (K, 2 + 9): frequency, damping ratio, n, tcp, x."""
        head = [self.omega / (2 * math.pi), BETA * self.omega / 2]
        return np.vstack([*head, N @ self.phi, TCP @ self.phi, X @ self.phi]).T


def cell(position: Sequence[float] | Floats, seed: int, modes: int = DOFS) -> Cell:
    """The `modes` lowest modes at a pose. Rigid modes and signs are those of a basis that `seed` picks."""
    m, k = mass(), stiffness(position)
    random = np.random.default_rng(seed)
    rigid = rigid_modes()
    rigid = rigid @ np.linalg.inv(np.linalg.cholesky(rigid.T @ m @ rigid)).T
    rotation, _ = np.linalg.qr(random.normal(size=(3, 3)))
    values, vectors = eigh(k, m)
    elastic = vectors[:, 3:modes] - rigid @ (rigid.T @ m @ vectors[:, 3:modes])
    elastic /= np.sqrt(np.sum(elastic * (m @ elastic), axis=0))
    signs = random.choice([-1.0, 1.0], elastic.shape[1])
    omega = np.concatenate([np.zeros(3), np.sqrt(values[3:modes])])
    return Cell(omega, np.hstack([rigid @ rotation, elastic * signs]))


@dataclass(frozen=True)
class GridAxis:
    """Cells along an axis: centres, boundaries between them, hysteresis [m]."""

    axis: int
    centres: Floats
    hysteresis: float = 1e-5

    @property
    def boundaries(self) -> Floats:
        return (self.centres[:-1] + self.centres[1:]) / 2


@dataclass(frozen=True)
class Grid:
    """Poses on a grid; `positions` (cells, 3) and `cells` row-major, last grid axis fastest."""

    axes: tuple[GridAxis, ...]
    positions: Floats
    cells: tuple[Cell, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(len(axis.centres) for axis in self.axes)

    def transfer(self, before: int, after: int) -> Floats:
        """Modal coordinates of cell `before` to those of cell `after`."""
        return self.cells[after].phi.T @ mass() @ self.cells[before].phi

    def upper(self, index: int, g: int) -> int | None:
        """Neighbour with index + 1 along grid axis g."""
        place = list(np.unravel_index(index, self.shape))
        place[g] += 1
        return int(np.ravel_multi_index(place, self.shape)) if place[g] < self.shape[g] else None

    def content(self) -> bytes:
        """poses.bin."""
        numbers: list[float] = [len(AXES), len(self.axes), max(len(cell.omega) for cell in self.cells)]
        for axis in self.axes:
            numbers += [axis.axis, len(axis.centres), axis.hysteresis, *axis.centres, *axis.boundaries]
        for each in self.cells:
            numbers += [len(each.omega), *each.rows().ravel()]
        for g in range(len(self.axes)):
            for index in range(len(self.cells)):
                if (upper := self.upper(index, g)) is not None:
                    numbers += list(self.transfer(index, upper).ravel())
        return b"FSPOSES1" + struct.pack(f"<{len(numbers)}d", *numbers)


def grid(*axes: GridAxis, modes: Sequence[int] = (DOFS,), same_springs: bool = False) -> Grid:
    """Cells with modes[i % len(modes)] modes; with same_springs their bases differ, but not their springs."""
    positions = np.zeros((math.prod(len(axis.centres) for axis in axes), 3))
    for index, place in enumerate(product(*(axis.centres for axis in axes))):
        positions[index, [axis.axis for axis in axes]] = place
    return Grid(
        axes,
        positions,
        tuple(
            cell(positions[0] if same_springs else position, seed=index, modes=modes[index % len(modes)])
            for index, position in enumerate(positions)
        ),
    )


def fnv(*contents: bytes) -> str:
    """FNV-1a, 64 bit."""
    value = 0xCBF29CE484222325
    for byte in b"".join(contents):
        value = (value ^ byte) * 0x100000001B3 % 2**64
    return f"{value:016x}"


def archive(plant: Path, folder: Path, poses: Grid | bytes | None, modes: Cell) -> Archive:
    """plant.fmu unpacked, with the machine of this room in place of its own: modes.csv from `modes`, poses.bin."""
    unpacked = Archive.unpack(plant, folder)
    resources = folder / "resources"
    rows = modes.rows()
    order = [0, 1, *range(2, 5), *range(8, 11), *range(5, 8)]  # frequency, damping, n, x, tcp
    write_modes(resources / "modes.csv", [[k, *row[order]] for k, row in enumerate(rows)])
    content = poses.content() if isinstance(poses, Grid) else poses
    if content is not None:
        (resources / "poses.bin").write_bytes(content)
    names = ["axes.csv", "modes.csv", *(["poses.bin"] if content is not None else [])]
    resource_hash = fnv(*((resources / name).read_bytes() for name in names))
    description = folder / "modelDescription.xml"
    text, found = re.subn(r'(guid="[0-9a-f]{16}-)[0-9a-f]{16}"', rf'\g<1>{resource_hash}"', description.read_text())
    assert found == 1
    description.write_text(text)
    unpacked.description.guid = unpacked.description.guid[:17] + resource_hash
    return unpacked
