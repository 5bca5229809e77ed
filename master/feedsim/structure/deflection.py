"""How the lines of a model bend in a motion: between the nodes by the beam's own shape functions.

A straight beam without load between its nodes takes the cubic polynomials that its element is made from (Hermite's), in
both directions across, and runs linearly along and in twist; so a picture of it is what was calculated, not a guess.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feedsim.structure.assembly import Geometry

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Deflection:
    """Points on all lines of a geometry, n + 1 on each, and their motion.

    Attributes:
        points: (L, n + 1, 3) at rest [m].
        displacements: (L, n + 1, 3), in the unit of the shape's displacements.
        rotations: (L, n + 1, 3), of the cross-section.
    """

    points: Floats
    displacements: Floats
    rotations: Floats


def node_motion(geometry: Geometry, shape: Floats) -> tuple[Floats, Floats]:
    """(K, 3) displacements and (K, 3) rotations of the nodes in a shape (N,); 0 where a node has no such freedom."""
    motion = np.where(geometry.dofs >= 0, shape[np.maximum(geometry.dofs, 0)], 0.0)
    return motion[:, :3], motion[:, 3:]


def deflection(geometry: Geometry, shape: Floats, n: int) -> Deflection:
    """Every line in `n` pieces in a shape (N,). Lines whose nodes do not turn (edges of solids) stay straight."""
    u, phi = node_motion(geometry, shape)
    first, second = geometry.lines[:, 0], geometry.lines[:, 1]
    along = geometry.nodes[second] - geometry.nodes[first]
    length = np.linalg.norm(along, axis=1)
    e = along / np.where(length > 0, length, 1)[:, None]
    turns = np.any(geometry.dofs[:, 3:] >= 0, axis=1)
    bends = (turns[first] & turns[second])[:, None, None]
    t = np.linspace(0.0, 1.0, n + 1)[None, :, None]
    h = np.array([1 - 3 * t**2 + 2 * t**3, t - 2 * t**2 + t**3, 3 * t**2 - 2 * t**3, t**3 - t**2])
    dh = np.array([6 * t**2 - 6 * t, 1 - 4 * t + 3 * t**2, 6 * t - 6 * t**2, 3 * t**2 - 2 * t])

    u1, u2, phi1, phi2 = (values[:, None, :] for values in (u[first], u[second], phi[first], phi[second]))
    axis, L = e[:, None, :], length[:, None, None]
    straight = (1 - t) * u1 + t * u2
    along_it = np.sum(straight * axis, axis=2, keepdims=True) * axis
    # Slopes across the beam: d(u)/ds = phi x e.
    slope1, slope2 = L * np.cross(phi1, axis), L * np.cross(phi2, axis)
    across1, across2 = (v - np.sum(v * axis, axis=2, keepdims=True) * axis for v in (u1, u2))
    bent = along_it + h[0] * across1 + h[1] * slope1 + h[2] * across2 + h[3] * slope2
    slope = (dh[0] * across1 + dh[1] * slope1 + dh[2] * across2 + dh[3] * slope2) / np.where(L > 0, L, 1)
    twist = (1 - t) * np.sum(phi1 * axis, axis=2, keepdims=True) + t * np.sum(phi2 * axis, axis=2, keepdims=True)
    # phi across the beam from the slope: phi = e x (phi x e).
    turned = np.broadcast_to(twist * axis + np.cross(axis, slope), bent.shape)
    return Deflection(
        points=geometry.nodes[first][:, None, :] + t * along[:, None, :],
        displacements=np.where(bends, bent, np.broadcast_to(straight, bent.shape)),
        rotations=np.where(bends, turned, 0.0),
    )
