"""Small finite-element models as files, and their modes by a dense solver that shares nothing with the product."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import eigh

from feedsim.structure.assembly import Assembly, Geometry

ROOT = Path(__file__).resolve().parents[2]
STRUCTURES = ROOT / "scenarios" / "structures"
Floats = NDArray[np.float64]


def dense_modes(assembly: Assembly) -> tuple[Floats, Floats]:
    """Frequencies [Hz] ascending and mass-normalised shapes (N, M) of the M modes that have mass.

    M v = mu (K + s M) v with mu = 1 / (omega2 + s), scaled by the diagonal so that small rotors and heavy beds are
    solved alike. The mass may be singular: reduced integration leaves it so.
    """
    shift = (2 * np.pi * 20) ** 2
    mass = assembly.mass.toarray()
    shifted = assembly.stiffness.toarray() + shift * mass
    root = 1 / np.sqrt(np.diag(shifted))
    mu, vectors = eigh(mass * root[:, None] * root, shifted * root[:, None] * root)
    heavy = np.flatnonzero(mu > 1e-12 * mu[-1])[::-1]
    omega2 = 1 / mu[heavy] - shift
    return np.sqrt(np.abs(omega2)) / (2 * np.pi), root[:, None] * vectors[:, heavy] / np.sqrt(mu[heavy])


def write_market(file: Path, matrix: Floats, symmetry: str = "symmetric") -> None:
    """Matrix Market text, entry by entry, written here and not by the library that reads it."""
    size = len(matrix)
    entries = [
        (i, j) for j in range(size) for i in range(size) if matrix[i, j] != 0 and (symmetry == "general" or i >= j)
    ]
    lines = [f"%%MatrixMarket matrix coordinate real {symmetry}", f"{size} {size} {len(entries)}"]
    lines += [f"{i + 1} {j + 1} {matrix[i, j]:.17g}" for i, j in entries]
    file.write_text("\n".join(lines) + "\n")


def chain(masses: Sequence[float], springs: Sequence[float]) -> tuple[Floats, Floats]:
    """Masses in a row and the springs between neighbours: mass and stiffness matrix."""
    mass = np.diag(np.asarray(masses, dtype=np.float64))
    stiffness = np.zeros_like(mass)
    for i, k in enumerate(springs):
        stiffness[i : i + 2, i : i + 2] += k * np.array([[1, -1], [-1, 1]])
    return mass, stiffness


def assembly(mass: Floats, stiffness: Floats, **changes: Any) -> Assembly:
    """A model of one axis X, rotor first and slide last; ``changes`` replace fields."""
    size = len(mass)
    rotor, slide = np.zeros(size), np.zeros(size)
    rotor[0], slide[-1] = 1.0, 1.0
    fields: dict[str, Any] = {
        "name": "model",
        "mass": sparse.csc_array(mass),
        "stiffness": sparse.csc_array(stiffness),
        "ports": {"n_X": rotor, "x_X": slide, "tcp_X": slide, "tcp_Y": slide, "tcp_Z": slide},
        "axes": ("X",),
        "labels": tuple(f"body[{i}] ux" for i in range(size)),
        "geometry": None,
        "pose": {},
    }
    return Assembly(**(fields | changes))


def geometry(size: int, spacing: float) -> Geometry:
    """Nodes along X, each with ux alone."""
    dofs = np.full((size, 6), -1, dtype=np.int64)
    dofs[:, 0] = np.arange(size)
    return Geometry(
        nodes=np.column_stack([spacing * np.arange(size), np.zeros(size), np.zeros(size)]),
        names=tuple(f"body[{i}]" for i in range(size)),
        bodies=("body",) * size,
        dofs=dofs,
        lines=np.zeros((0, 2), dtype=np.int64),
    )
