"""Points that nodes hold: rigidly, as the mean of several, or riding on a line of nodes.

The displacement at a point p is sum w_i (u_i + phi_i x (p - N_i)) over the nodes N_i that hold it, its rotation
sum w_i phi_i: each node holds the point rigidly, and takes the weight w_i in it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from feedsim.structure.assembly import Floats, Integers


@dataclass(frozen=True, eq=False)
class Row:
    """A sparse row vector: b^T u = sum of coefficients u[dofs]. A degree of freedom may occur twice."""

    dofs: Integers
    coefficients: Floats

    def __add__(self, other: Row) -> Row:
        return Row(np.concatenate([self.dofs, other.dofs]), np.concatenate([self.coefficients, other.coefficients]))

    def __sub__(self, other: Row) -> Row:
        return self + (-1.0) * other

    def __rmul__(self, factor: float) -> Row:
        return Row(self.dofs, factor * self.coefficients)

    def dense(self, size: int) -> Floats:
        """(size,) the row as a vector."""
        vector = np.zeros(size)
        np.add.at(vector, self.dofs, self.coefficients)
        return vector


@dataclass(frozen=True, eq=False)
class Grip:
    """A point and the nodes that hold it.

    Attributes:
        dofs: (n,) first degree of freedom of each node (ux, uy, uz, rx, ry, rz follow one another).
        weights: (n,) share of each node; their sum is 1.
        levers: (n, 3) from each node to the point [m].
    """

    dofs: Integers
    weights: Floats
    levers: Floats

    def displacement(self, direction: Floats) -> Row:
        """Displacement of the point along a direction."""
        coefficients = np.empty((len(self.dofs), 6))
        coefficients[:, :3] = direction
        coefficients[:, 3:] = _cross(self.levers, direction)  # d . (phi x r) = phi . (r x d)
        coefficients *= self.weights[:, None]
        return Row((self.dofs[:, None] + np.arange(6)).ravel(), coefficients.ravel())

    def rotation(self, direction: Floats) -> Row:
        """Rotation at the point about a direction."""
        dofs = self.dofs[:, None] + np.arange(3, 6)
        return Row(dofs.ravel(), (self.weights[:, None] * direction).ravel())


def rigid(point: Floats, nodes: Floats, dofs: Iterable[int]) -> Grip:
    """A point held by the mean of nodes at (n, 3) positions."""
    first = np.fromiter(dofs, dtype=np.int64)
    return Grip(first, np.full(len(first), 1 / len(first)), point - nodes)


def riding(point: Floats, line: Floats, first_dof: int) -> Grip:
    """A point that rides on a line of equally spaced nodes at (n, 3) positions, 6 degrees of freedom each.

    The two neighbours along the line hold it with the weights 1 - w and w = t^2 (3 - 2 t), t the fraction of the way
    between them: as the point travels on, the stiffness it meets changes smoothly. Beyond an end that end holds it.
    """
    whole = line[-1] - line[0]
    intervals = len(line) - 1
    along = float((point - line[0]) @ whole / (whole @ whole)) * intervals
    i = min(max(int(np.floor(along)), 0), intervals - 1)
    t = min(max(along - i, 0.0), 1.0)
    w = t * t * (3 - 2 * t)
    dofs = first_dof + 6 * np.array([i, i + 1], dtype=np.int64)
    return Grip(dofs, np.array([1 - w, w]), point - line[i : i + 2])


def _cross(a: Floats, b: Floats) -> Floats:
    """(n, 3) a x b for (n, 3) a and (3,) b; numpy's own is slow for few rows."""
    return np.column_stack(
        [a[:, 1] * b[2] - a[:, 2] * b[1], a[:, 2] * b[0] - a[:, 0] * b[2], a[:, 0] * b[1] - a[:, 1] * b[0]]
    )
