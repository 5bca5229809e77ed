"""Whether the mass is positive and the stiffness not negative, as far as that shows without factorising them.

Necessary conditions with the degrees of freedom that break them: diagonal entries, then each pair's 2 by 2 minor, then
the lowest eigenvalue that a few Lanczos steps find of the matrix scaled to a diagonal of ones. A negative Ritz value
proves a negative direction, and its vector says where; none found is no proof, for the solver's inertia count is that.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse
from scipy.linalg import eigh_tridiagonal

from feedsim.structure.assembly import Assembly, Floats, counted, few
from feedsim.structure.factor import symmetric_factors

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Of the scaled matrix, whose diagonal is 1. Assembly and text of 13 digits leave 1e-12.
NEGATIVE = 1e-9
# Round-off of a minor: |a_ij| may exceed sqrt(a_ii a_jj) by this share where two degrees of freedom move as one.
MINOR = 1e-9
LANCZOS_STEPS = 60


def mass_faults(assembly: Assembly) -> tuple[list[str], list[str]]:
    """Faults and warnings of the mass matrix. Degrees of freedom without mass are fine where stiffness holds them."""
    faults = _indefinite(assembly, assembly.mass, "mass")
    if faults:
        return faults, []
    massless = np.flatnonzero(assembly.mass.diagonal() == 0)
    if not len(massless):
        return [], []
    if len(massless) == len(assembly.labels):
        return ["the mass matrix is zero"], []
    loose = _loose(assembly.stiffness, massless)
    if loose is not None:
        return [
            f"{few(assembly.labels, massless[loose])}: no mass, and no stiffness against moving on their own; give "
            "them a mass, hold them, or leave them out"
        ], []
    return [], [
        f"{counted(len(massless), 'degree of freedom follows', 'degrees of freedom follow')} statically, without mass: "
        f"{few(assembly.labels, massless)}"
    ]


def stiffness_faults(assembly: Assembly) -> tuple[list[str], list[str]]:
    """Faults and warnings of the stiffness matrix."""
    return _indefinite(assembly, assembly.stiffness, "stiffness"), []


def _indefinite(assembly: Assembly, matrix: sparse.csc_array, what: str) -> list[str]:
    diagonal = matrix.diagonal()
    negative = np.flatnonzero(diagonal < 0)
    if len(negative):
        worst = negative[np.argsort(diagonal[negative])]
        return [
            f"{counted(len(worst), 'degree of freedom has', 'degrees of freedom have')} negative {what} on the "
            f"diagonal, down to {diagonal[worst[0]]:.6g} at {few(assembly.labels, worst)}"
        ]
    pair = _worst_pair(matrix, diagonal)
    if pair is not None:
        i, j = pair
        return [
            f"the {what} matrix is not positive semidefinite: {assembly.labels[i]} and {assembly.labels[j]} are "
            f"coupled by {matrix[i, j]:.6g}, more than the root of their diagonal entries {diagonal[i]:.6g} and "
            f"{diagonal[j]:.6g} multiplied"
        ]
    value, vector = _lowest(matrix, diagonal)
    if value < -NEGATIVE:
        most = np.argsort(-np.abs(vector))
        most = most[np.abs(vector[most]) > 0.3 * np.abs(vector[most[0]])]
        return [
            f"the {what} matrix is not positive semidefinite: a motion mainly of {few(assembly.labels, most)} has "
            f"negative {what} ({value:.3g} of that of its degrees of freedom alone)"
        ]
    return []


def _worst_pair(matrix: sparse.csc_array, diagonal: Floats) -> tuple[int, int] | None:
    """The pair that breaks |a_ij| <= sqrt(a_ii a_jj) most; None where none does."""
    entries = matrix.tocoo()
    off = entries.row < entries.col
    rows, columns, values = entries.row[off], entries.col[off], np.abs(entries.data[off])
    root = np.sqrt(diagonal)
    limit = root[rows] * root[columns]
    broken = np.flatnonzero((values > limit * (1 + MINOR)) & (values > 0))
    if not len(broken):
        return None
    with np.errstate(divide="ignore"):
        worst = broken[np.argmax(values[broken] / limit[broken])]
    return int(rows[worst]), int(columns[worst])


def _lowest(matrix: sparse.csc_array, diagonal: Floats) -> tuple[float, Floats]:
    """Lowest Ritz value of D^-1/2 A D^-1/2 after some Lanczos steps with full reorthogonalisation, and its vector (N,)
    in the coordinates of A; 0 where the diagonal is 0."""
    positive = diagonal > 0
    root = np.zeros_like(diagonal)
    root[positive] = 1 / np.sqrt(diagonal[positive])
    steps = min(LANCZOS_STEPS, int(positive.sum()))
    if steps == 0:
        return 0.0, np.zeros_like(diagonal)
    start = np.random.default_rng(1).standard_normal(len(diagonal)) * positive
    basis = np.zeros((steps, len(diagonal)))
    basis[0] = start / np.linalg.norm(start)
    alpha, beta = np.zeros(steps), np.zeros(steps)
    done = steps
    for k in range(steps):
        following = root * (matrix @ (root * basis[k]))
        alpha[k] = following @ basis[k]
        for _ in range(2):  # twice is enough
            following -= basis[: k + 1].T @ (basis[: k + 1] @ following)
        beta[k] = np.linalg.norm(following)
        if beta[k] < 1e-12 or k + 1 == steps:
            done = k + 1
            break
        basis[k + 1] = following / beta[k]
    values, vectors = eigh_tridiagonal(alpha[:done], beta[: done - 1], select="i", select_range=(0, 0))
    return float(values[0]), root * (basis[:done].T @ vectors[:, 0])


def _loose(stiffness: sparse.csc_array, massless: NDArray[np.int64]) -> NDArray[np.int64] | None:
    """Positions within `massless` that no stiffness holds (their own block of K is singular); None where all are held.

    The factorisation is of that block alone, which falls into small parts: rotations of single nodes, say.
    """
    block = stiffness[massless][:, massless].tocsc()
    diagonal = block.diagonal()
    if np.any(diagonal <= 0):
        return np.flatnonzero(diagonal <= 0)
    root = sparse.diags_array(1 / np.sqrt(diagonal))
    scaled = (root @ block @ root).tocsc()
    try:
        factors = symmetric_factors(scaled)
    except RuntimeError:  # exactly singular
        shifted = scaled + 1e-12 * sparse.eye_array(len(massless))
        factors = symmetric_factors(shifted.tocsc())
    pivots = factors.U.diagonal()
    if np.min(np.abs(pivots)) > 1e-10:
        return None
    # Inverse iteration: what moves against least stiffness.
    vector = np.random.default_rng(1).standard_normal(len(massless))
    for _ in range(3):
        vector = factors.solve(vector)
        vector /= np.linalg.norm(vector)
    moving = np.abs(vector)
    return np.flatnonzero(moving > 0.1 * moving.max())
