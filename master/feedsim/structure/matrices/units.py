"""From a program's unit system to SI.

A program that calculates in lengths of L [m], masses of m [kg] and times of T [s] has translations u_SI = L u and the
same rotations. Energies are m L2 / T2 times the program's, hence M_SI = m L2 D M D and K_SI = m L2 / T2 D K D with
D = 1/L for translations and 1 for rotations.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from feedsim import units
from feedsim.scenario.structure.matrices import UnitSystem
from feedsim.structure.assembly import Floats
from feedsim.structure.matrices.sparse import without_zeros


def factors(system: UnitSystem) -> tuple[float, float, float]:
    """L [m], m [kg], T [s]."""
    return (
        units.convert(1.0, system.length, "m"),
        units.convert(1.0, system.mass, "kg"),
        units.convert(1.0, system.time, "s"),
    )


def scaled(matrix: sparse.csc_array, rotation: np.ndarray, length: float, factor: float) -> sparse.csc_array:
    """factor L2 D A D; `rotation` (N,) says which degrees of freedom are rotations."""
    if length == 1 and factor == 1:
        return matrix
    d = np.where(rotation, length, 1.0)
    entries = matrix.tocoo()
    values = entries.data * (factor * d[entries.row] * d[entries.col])
    return without_zeros(sparse.coo_array((values, (entries.row, entries.col)), shape=matrix.shape).tocsc())


def port_vector(vector: Floats, rotation: np.ndarray, length: float, *, angle: bool) -> Floats:
    """Coefficients in SI: of an angle (n_A) or of a displacement; (N,)."""
    d = np.where(rotation, length, 1.0)
    return vector * d / length if angle else vector * d
