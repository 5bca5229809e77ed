"""What a finite-element file holds, in its own units, before ports and conversion; matrices from its entries."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from feedsim.errors import InputError
from feedsim.structure.assembly import Floats, Integers

if TYPE_CHECKING:
    from scipy.sparse import csc_array

FREEDOM_NAMES = ("ux", "uy", "uz", "rx", "ry", "rz")


@dataclass(frozen=True, eq=False)
class Points:
    """Nodes of a mesh.

    Attributes:
        ids: (K,) node numbers or names, as a port table calls them.
        positions: (K, 3) in the file's unit of length.
        names: (K,) as shown in messages and tables.
        bodies: (K,) what a node belongs to; "" where that is not known.
        lines: (L, 2) indices of the nodes that a line joins.
    """

    ids: tuple[str, ...]
    positions: Floats
    names: tuple[str, ...]
    bodies: tuple[str, ...]
    lines: Integers


@dataclass(frozen=True, eq=False)
class Raw:
    """Matrices with their degrees of freedom as the file counts them.

    Attributes:
        mass, stiffness: (N, N) in the file's units.
        nodes: (N,) node of each degree of freedom; None where only matrices are known.
        directions: (N,) 0 ... 5 for ux ... rz, -1 where not known.
        fixed: (N,) degrees of freedom that are constrained and leave the model.
        absent: what it means when a node has no degree of freedom, to end a message with.
        points: the mesh, where known.
        notes: what a person should know of the import.
    """

    mass: csc_array
    stiffness: csc_array
    nodes: tuple[str, ...] | None
    directions: Integers
    fixed: NDArray[np.bool_]
    absent: str = ""
    points: Points | None = None
    notes: tuple[str, ...] = ()

    @property
    def size(self) -> int:
        """Degrees of freedom, constrained ones included."""
        return len(self.directions)

    def labels(self) -> tuple[str, ...]:
        """(N,) such as "node 12 ux"; "dof 17" (from 0) where no nodes are known."""
        if self.nodes is None:
            return tuple(f"dof {i}" for i in range(self.size))
        names = dict(zip(self.points.ids, self.points.names, strict=True)) if self.points else {}
        return tuple(
            f"{names.get(node) or f'node {node}'} {FREEDOM_NAMES[d]}" if node else f"dof {i}"
            for i, (node, d) in enumerate(zip(self.nodes, self.directions.tolist(), strict=True))
        )


# Programs that write both triangles add up in another order above the diagonal than below; the difference stays far
# under this share of an entry's scale, the geometric mean of its diagonal entries.
SYMMETRY_ROUNDING = 1e-9


def from_triangle(rows: Integers, columns: Integers, values: Floats, size: int, file: Path) -> sparse.csc_array:
    """The whole matrix from one triangle, diagonal included; which one may differ from entry to entry.

    Raises:
        InputError: an entry occurs twice, or on both sides of the diagonal.
    """
    upper, lower = np.minimum(rows, columns), np.maximum(rows, columns)
    half = sparse.coo_array((values, (upper, lower)), shape=(size, size))
    _refuse_twice(half, file)
    off = upper != lower
    matrix = sparse.coo_array(
        (
            np.concatenate([values, values[off]]),
            (np.concatenate([upper, lower[off]]), np.concatenate([lower, upper[off]])),
        ),
        shape=(size, size),
    ).tocsc()
    return without_zeros(matrix)


def from_both(rows: Integers, columns: Integers, values: Floats, size: int, file: Path) -> sparse.csc_array:
    """The matrix from both triangles; rounding differences between them are levelled, others stay for the checks.

    Raises:
        InputError: an entry occurs twice.
    """
    entries = sparse.coo_array((values, (rows, columns)), shape=(size, size))
    _refuse_twice(entries, file)
    matrix = entries.tocsc()
    difference = (matrix - matrix.T).tocoo()
    if difference.nnz and np.all(np.isfinite(difference.data)):
        scale = np.sqrt(np.abs(matrix.diagonal()))
        if np.all(np.abs(difference.data) <= SYMMETRY_ROUNDING * scale[difference.row] * scale[difference.col]):
            matrix = ((matrix + matrix.T) / 2).tocsc()
    return without_zeros(matrix)


def without_zeros(matrix: sparse.csc_array) -> sparse.csc_array:
    """Without stored zeros, indices in order."""
    matrix.eliminate_zeros()
    matrix.sort_indices()
    return matrix


def _refuse_twice(entries: sparse.coo_array, file: Path) -> None:
    key = entries.row.astype(np.int64) * entries.shape[1] + entries.col
    order = np.sort(key)
    again = order[1:][order[1:] == order[:-1]]
    if len(again):
        row, column = divmod(int(again[0]), entries.shape[1])
        raise InputError(
            f"{file}: the entry in row {row + 1}, column {column + 1} (from 1) occurs twice; where one triangle is "
            "stored, each entry must be in one of them alone"
        )
