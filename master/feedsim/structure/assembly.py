"""A finite-element model of a machine at one pose: matrices, ports, and what is where."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scipy.sparse import csc_array

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Geometry:
    """Where the degrees of freedom are: for pictures, and to say what moves in a mode.

    Attributes:
        nodes: (K, 3) positions at the pose, machine frame [m].
        names: (K,) names such as "bed B1[3]".
        bodies: (K,) body that a node belongs to, such as "bed", "column", "screw X", "rotor X".
        dofs: (K, 6) degree of freedom of ux, uy, uz, rx, ry, rz of each node; -1 where it has none.
        lines: (L, 2) nodes that a line joins (beam, edge of an element, spring).
    """

    nodes: Floats
    names: tuple[str, ...]
    bodies: tuple[str, ...]
    dofs: Integers
    lines: Integers


@dataclass(frozen=True, eq=False)
class Assembly:
    """M u'' + K u = sum over the ports of b F;  the displacement at a port is b^T u.

    Ports of an axis A: n_A (rotor against stator: torque in, angle out), x_A (linear scale: travel out). Ports of the
    tool: tcp_X, tcp_Y, tcp_Z (tool against workpiece: force in, displacement out). SI units.

    Attributes:
        name: of the file it was made from, for messages.
        mass, stiffness: (N, N) sparse, symmetric [kg, kg.m, kg.m2; N/m, N, N.m].
        ports: port -> (N,) vector b.
        axes: names of the axes, in order.
        labels: (N,) what a degree of freedom is, such as "bed B1[3] ux".
        geometry: None where only matrices are known.
        pose: axis -> position [m]; empty where it is not known.
    """

    name: str
    mass: csc_array
    stiffness: csc_array
    ports: Mapping[str, Floats]
    axes: tuple[str, ...]
    labels: tuple[str, ...]
    geometry: Geometry | None
    pose: Mapping[str, float]
