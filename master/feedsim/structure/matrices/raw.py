"""What a finite-element file holds, in its own units, before ports and conversion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from feedsim.structure.assembly import Floats, Integers

if TYPE_CHECKING:
    from scipy.sparse import csc_array

DIRECTIONS = ("ux", "uy", "uz", "rx", "ry", "rz")


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
            f"{names.get(node) or f'node {node}'} {DIRECTIONS[d]}" if node else f"dof {i}"
            for i, (node, d) in enumerate(zip(self.nodes, self.directions.tolist(), strict=True))
        )
