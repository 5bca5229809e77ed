"""The matrix K - sigma M, factorised once and solved with many times; with the signs of its eigenvalues."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.linalg import SuperLU, splu

from feedsim.errors import InputError
from feedsim.structure.assembly import Assembly, Floats, few

if TYPE_CHECKING:
    from scipy.sparse import csc_array


# A factorisation without pivoting is trusted where it solves a random system to this backward error: an eigenvalue
# that near to the shift, relative to the largest one, may be counted on the wrong side of it, and no other.
TRUSTED = 1e-9


class Factor(Protocol):
    """B = K + shift M, positive definite, ready to be solved with."""

    def solve(self, right: Floats) -> Floats:
        """B^-1 right, for a vector (N,) or columns (N, m)."""
        ...


def shifted(assembly: Assembly, sigma: float) -> tuple[csc_array, Floats]:
    """D (K - sigma M) D and the diagonal of D, which makes translations and rotations comparable.

    Raises:
        InputError: a degree of freedom has neither stiffness nor mass.
    """
    matrix = sparse.csc_array(assembly.stiffness - sigma * assembly.mass)
    size = assembly.stiffness.diagonal() + abs(sigma) * assembly.mass.diagonal()
    if not np.all(size > 0):
        wrong = np.flatnonzero(~(size > 0))
        raise InputError(
            f"{assembly.name}: {len(wrong)} degrees of freedom have neither mass nor stiffness (or negative ones): "
            f"{few(assembly.labels, wrong)}"
        )
    scale = 1 / np.sqrt(size)
    diagonal = sparse.diags_array(scale)
    return sparse.csc_array(diagonal @ matrix @ diagonal), scale


class DenseFactor:
    """Cholesky factorisation of K + shift M as a full matrix."""

    def __init__(self, assembly: Assembly, shift: float) -> None:
        """InputError: the matrix is not positive definite; names the degree of freedom at which that shows."""
        matrix, self._scale = shifted(assembly, -shift)
        self.matrix: Floats = matrix.toarray()
        try:
            self._factor = linalg.cho_factor(self.matrix, lower=True)
        except linalg.LinAlgError as error:
            raise not_definite(assembly) from error

    def solve(self, right: Floats) -> Floats:
        scale = self._scale if right.ndim == 1 else self._scale[:, None]
        return np.asarray(scale * linalg.cho_solve(self._factor, scale * right))


class SparseFactor:
    """L U factorisation of K - sigma M by SuperLU, symmetric ordering and all pivots on the diagonal.

    With pivots on the diagonal U is the transpose of L with its rows scaled, so that the signs of U's diagonal are
    those of the eigenvalues (Sylvester): the number of negative ones is the number of eigenvalues of (K, M) below
    sigma (Sturm sequence; K.-J. Bathe, Finite Element Procedures, 2014, sec. 11.2.2).
    """

    def __init__(self, assembly: Assembly, sigma: float) -> None:
        """RuntimeError: the matrix is singular to rounding (sigma is an eigenvalue)."""
        self._matrix, self._scale = shifted(assembly, sigma)
        self._lu = symmetric_factors(self._matrix, Equil=False)

    @property
    def entries(self) -> int:
        """Entries of L and U."""
        return int(self._lu.nnz)

    def solve(self, right: Floats) -> Floats:
        scale = self._scale if right.ndim == 1 else self._scale[:, None]
        return np.asarray(scale * self._lu.solve(scale * right))

    def eigenvalues_below(self) -> int | None:
        """How many eigenvalues of (K, M) lie below sigma; None where the factorisation does not show.

        It does not where a pivot had to be taken off the diagonal, or where the pivots on it lost too many digits.
        """
        if not np.array_equal(self._lu.perm_r, self._lu.perm_c) or self._backward_error() > TRUSTED:
            return None
        return int(np.count_nonzero(self._lu.U.diagonal() < 0))

    def _backward_error(self) -> float:
        right = np.random.default_rng(0).standard_normal(self._matrix.shape[0])
        solution = self._lu.solve(right)
        if not np.all(np.isfinite(solution)):
            return np.inf
        magnitude = abs(self._matrix) @ abs(solution) + abs(right)
        return float(np.max(abs(self._matrix @ solution - right)) / np.max(magnitude))


def symmetric_factors(matrix: csc_array, **options: bool) -> SuperLU:
    """L and U of a symmetric matrix, symmetric ordering, pivots on the diagonal. RuntimeError: exactly singular."""
    options = {"SymmetricMode": True, **options}
    return splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)


def not_definite(assembly: Assembly) -> InputError:
    """The error of a stiffness matrix with a negative eigenvalue."""
    return InputError(
        f"{assembly.name}: the stiffness matrix has negative eigenvalues: the structure is unstable at rest, or the "
        "matrices are not those of one model (units, order of the degrees of freedom, missing half)"
    )
