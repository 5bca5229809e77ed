"""The straight beam element of Euler and Bernoulli in space, with its consistent mass; its section.

Degrees of freedom: ux, uy, uz, rx, ry, rz of the first node, then of the second. Source: J. S. Przemieniecki, Theory
of Matrix Structural Analysis, McGraw-Hill 1968: stiffness in ch. 5, consistent mass in ch. 11 (without the rotary
inertia of bending).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from feedsim.scenario.structure.parts import Material, Section


@dataclass(frozen=True)
class BeamProperties:
    """What a beam element is made from.

    EA [N], EIy, EIz [N.m2] bending about local y and z, GJ [N.m2] torsion; m mass per length [kg/m], j polar moment of
    inertia per length [kg.m].
    """

    EA: float
    EIy: float
    EIz: float
    GJ: float
    m: float
    j: float


def beam_properties(section: Section, material: Material) -> BeamProperties:
    """Properties of a beam of a section.

    The torsion constant of a box is Bredt's for thin walls, along their centre line; that of a solid rectangle is the
    usual approximation (W. C. Young, Roark's Formulas for Stress and Strain; within 0.4 %). The section's mass factor
    scales all inertia.
    """
    A, Iy, Iz, J = area_moments(section)
    rho = material.rho * section.mass_factor
    return BeamProperties(material.E * A, material.E * Iy, material.E * Iz, material.G * J, rho * A, rho * (Iy + Iz))


def area_moments(section: Section) -> tuple[float, float, float, float]:
    """A [m2], Iy, Iz, J [m4] of a section."""
    if section.kind == "box":
        b, h, t = section.width, section.height, section.wall
        bi, hi = b - 2 * t, h - 2 * t
        J = 2 * t * (b - t) ** 2 * (h - t) ** 2 / (b + h - 2 * t)
        return b * h - bi * hi, (h * b**3 - hi * bi**3) / 12, (b * h**3 - bi * hi**3) / 12, J
    if section.kind == "rectangle":
        b, h = section.width, section.height
        a, c = max(b, h), min(b, h)
        J = a * c**3 * (1 / 3 - 0.21 * c / a * (1 - c**4 / (12 * a**4)))
        return b * h, h * b**3 / 12, b * h**3 / 12, J
    if section.kind == "properties":
        return section.A, section.Iy, section.Iz, section.J
    outer = section.diameter
    inner = outer - 2 * section.wall if section.kind == "tube" else 0.0
    I = pi / 64 * (outer**4 - inner**4)  # noqa: E741  (the symbol that everybody knows)
    return pi / 4 * (outer**2 - inner**2), I, I, 2 * I


def rod(diameter: float, material: Material) -> BeamProperties:
    """Properties of a solid round bar of diameter [m]."""
    A, I = pi / 4 * diameter**2, pi / 64 * diameter**4  # noqa: E741
    return BeamProperties(
        material.E * A, material.E * I, material.E * I, material.G * 2 * I, material.rho * A, material.rho * 2 * I
    )


Floats = NDArray[np.float64]

# A beam within acos 0.9 = 26 degrees of the vertical counts as upright: its local y turns towards Z.
UPRIGHT = 0.9
Y, Z = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])


def local_matrices(beam: BeamProperties, L: float) -> tuple[Floats, Floats]:
    """(12, 12) stiffness and mass of a beam of length L [m] in its own axes: x along it, y and z across."""
    K, M = np.zeros((12, 12)), np.zeros((12, 12))
    for i, stiffness, inertia in ((0, beam.EA, beam.m), (3, beam.GJ, beam.j)):  # axial, torsion
        dofs = np.ix_([i, i + 6], [i, i + 6])
        K[dofs] = stiffness / L * np.array([[1, -1], [-1, 1]])
        M[dofs] = inertia * L / 6 * np.array([[2, 1], [1, 2]])
    bend = np.array([[12, 6 * L, -12, 6 * L], [0, 4 * L**2, -6 * L, 2 * L**2], [0, 0, 12, -6 * L], [0, 0, 0, 4 * L**2]])
    mass = np.array(
        [[156, 22 * L, 54, -13 * L], [0, 4 * L**2, 13 * L, -3 * L**2], [0, 0, 156, -22 * L], [0, 0, 0, 4 * L**2]]
    )
    bend, mass = bend + np.triu(bend, 1).T, mass + np.triu(mass, 1).T
    # In the x-z plane a positive rotation about y lowers uz along x: slopes change sign.
    for deflection, slope, sign, EI in ((1, 5, 1, beam.EIz), (2, 4, -1, beam.EIy)):
        plane = [deflection, slope, deflection + 6, slope + 6]
        dofs = np.ix_(plane, plane)
        signs = np.outer([1, sign, 1, sign], [1, sign, 1, sign])
        K[dofs] = EI / L**3 * bend * signs
        M[dofs] = beam.m * L / 420 * mass * signs
    return K, M


def beam_axes(along: ArrayLike, up: ArrayLike | None = None) -> Floats:
    """(3, 3) local x, y, z (rows) of a beam that runs in direction `along`.

    Local y is as near to `up` as it can be; without `up` that is Y of the frame, or Z where the beam is upright.
    """
    ex = np.asarray(along, dtype=np.float64)
    ex = ex / np.linalg.norm(ex)
    if up is None:
        up = Z if abs(ex @ Y) >= UPRIGHT else Y
    ez = np.cross(ex, np.asarray(up, dtype=np.float64))
    ez /= np.linalg.norm(ez)
    return np.array([ex, np.cross(ez, ex), ez])


def beam_matrices(
    beam: BeamProperties, first: ArrayLike, second: ArrayLike, up: ArrayLike | None = None
) -> tuple[Floats, Floats]:
    """(12, 12) stiffness and mass of a beam from point `first` to `second` [m], in the frame of those points."""
    along = np.asarray(second, dtype=np.float64) - np.asarray(first, dtype=np.float64)
    K, M = local_matrices(beam, float(np.linalg.norm(along)))
    T = np.kron(np.eye(4), beam_axes(along, up))
    return T.T @ K @ T, T.T @ M @ T
