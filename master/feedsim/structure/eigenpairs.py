"""The lowest eigenpairs of K phi = lambda M phi: all of a small model, those up to the cut-off of a large one."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, sparse
from scipy.sparse.linalg import ArpackError, ArpackNoConvergence, LinearOperator, SuperLU, eigsh, splu

from feedsim.foundation.errors import FeedsimError, InputError
from feedsim.structure.assembly import Assembly, shorten_labels

if TYPE_CHECKING:
    from scipy.sparse import csc_array


# --- The matrix K - sigma M, factorised once and solved with many times; with the signs of its eigenvalues ------------


# A factorisation without pivoting is trusted where it solves a random system to this backward error: an eigenvalue
# that near to the shift, relative to the largest one, may be counted on the wrong side of it, and no other.
SHIFT_DISTANCE = 1e-9


class Factor(Protocol):
    """B = K + shift M, positive definite, ready to be solved with."""

    def solve(self, right: Floats) -> Floats:
        """B^-1 right, for a vector (N,) or columns (N, m)."""
        ...


def shift_stiffness(assembly: Assembly, sigma: float) -> tuple[csc_array, Floats]:
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
            f"{shorten_labels(assembly.labels, wrong)}"
        )
    scale = 1 / np.sqrt(size)
    diagonal = sparse.diags_array(scale)
    return sparse.csc_array(diagonal @ matrix @ diagonal), scale


class DenseFactor:
    """Cholesky factorisation of K + shift M as a full matrix."""

    def __init__(self, assembly: Assembly, shift: float) -> None:
        """InputError: the matrix is not positive definite; names the degree of freedom at which that shows."""
        matrix, self._scale = shift_stiffness(assembly, -shift)
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
        self._matrix, self._scale = shift_stiffness(assembly, sigma)
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
        if not np.array_equal(self._lu.perm_r, self._lu.perm_c) or self._backward_error() > SHIFT_DISTANCE:
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


# --- The lowest eigenpairs of K phi = lambda M phi: all of a small model, those up to the cut-off of a large one ------


Floats = NDArray[np.float64]
StepReporter = Callable[[str], None]

# Of a large model that many modes above the cut-off are computed as well: they are reported, and the ones below
# converge the faster for them.
EXTRA_MODES = 6
# 1/(lambda + shift) below this part of the largest one is rounding: a mode without mass.
MASSLESS = 1e-12
# A matrix shifted onto an eigenvalue cannot be factorised: the shift is then moved by this part, more each time.
SHIFT_STEP = 1e-6
ATTEMPTS = 4
SECONDS_BETWEEN_MESSAGES = 5.0


@dataclass(frozen=True, eq=False)
class Eigenpairs:
    """Eigenpairs in ascending order, complete up to the cut-off.

    Attributes:
        values: (n,) lambda [rad2/s2]; of rigid modes zero but for rounding, of either sign.
        shapes: (N, n) mass-normalised.
        finite: number of modes that the model has (degrees of freedom less those without mass).
        factor: K + shift M.
        shift: [rad2/s2].
        method: "dense" or "Lanczos".
        verification: how it is known that no mode up to the cut-off is missing; says so where it is not.
    """

    values: Floats
    shapes: Floats
    finite: int
    factor: Factor
    shift: float
    method: str
    verification: str


def dense(assembly: Assembly, shift: float) -> Eigenpairs:
    """All finite modes, from M phi = theta (K + shift M) phi with theta = 1/(lambda + shift).

    In this form low eigenvalues are the accurate ones, and degrees of freedom without mass are eigenvectors of
    theta = 0: leaving those out condenses them exactly.
    """
    factor = DenseFactor(assembly, shift)
    mass = assembly.mass.toarray()
    try:
        theta, shapes = linalg.eigh(mass, (assembly.stiffness + shift * assembly.mass).toarray(), driver="gvd")
    except linalg.LinAlgError as error:
        raise not_definite(assembly) from error
    kept = theta > MASSLESS * theta[-1]
    theta, shapes = theta[kept][::-1], shapes[:, kept][:, ::-1] / np.sqrt(theta[kept][::-1])
    # The highest modes are orthogonal to rounding of the lowest ones only. Made orthogonal from the low end upwards.
    gram = linalg.cholesky(shapes.T @ mass @ shapes, lower=True)
    shapes = linalg.solve_triangular(gram, shapes.T, lower=True).T
    verification = "all modes of the model were computed"
    return Eigenpairs(1 / theta - shift, shapes, len(theta), factor, shift, "dense", verification)


def lanczos(assembly: Assembly, cutoff: float, shift: float, say: StepReporter) -> Eigenpairs:
    """The modes up to the cut-off [rad/s] and a few above, by shift-invert Lanczos about -shift.

    The number of modes to look for comes from a factorisation at the cut-off (Sturm sequence), and so does the
    certainty that all were found: a single-vector Lanczos method may miss copies of a multiple eigenvalue.

    Raises:
        FeedsimError: modes are missing although they were looked for again, or the iteration did not converge.
    """
    border, below = _count(assembly, cutoff, say)
    massless = int(np.count_nonzero(assembly.mass.diagonal() == 0))
    finite = assembly.mass.shape[0] - massless
    if below is not None and below + EXTRA_MODES >= finite // 2:
        return dense(assembly, shift)  # nearly all modes: no case for Lanczos, and larger than usual at worst
    say(f"factorising K + shift M, {assembly.mass.shape[0]} equations")
    factor = SparseFactor(assembly, -shift)
    if below is None:
        verification = (
            "NOT verified: the matrix could not be factorised at the cut-off without pivoting, so that the modes "
            "below it could not be counted; copies of multiple modes may be missing"
        )
        values, shapes = _up_to(assembly, factor, shift, border, finite, say)
    else:
        values, shapes = _complete_pairs(assembly, factor, shift, (border, below), finite, say)
        verification = f"{below} modes below {math.sqrt(border) / (2 * math.pi):.6g} Hz, counted by a Sturm sequence"
    return Eigenpairs(values, shapes, finite, factor, shift, "Lanczos", verification)


def _count(assembly: Assembly, cutoff: float, say: StepReporter) -> tuple[float, int | None]:
    """A shift at the cut-off or next to it [rad2/s2], and the number of modes below it where it can be had."""
    border = cutoff**2
    for attempt in range(ATTEMPTS):
        say(f"counting modes below {math.sqrt(border) / (2 * math.pi):.6g} Hz")
        try:
            factor = SparseFactor(assembly, border)
        except RuntimeError:  # exactly singular
            below = None
        else:
            say(f"factorised: {factor.entries / 1e6:.3g} million entries")
            below = factor.eigenvalues_below()
        if below is not None:
            say(f"{below} modes")
            return border, below
        border *= 1 + SHIFT_STEP * 10**attempt
    return cutoff**2, None


def _complete_pairs(
    assembly: Assembly, factor: Factor, shift: float, expected: tuple[float, int], finite: int, say: StepReporter
) -> tuple[Floats, Floats]:
    """The modes below a border whose number is known; looked for again, beside those found, until they are complete."""
    border, below = expected
    values, shapes = np.empty(0), np.empty((assembly.mass.shape[0], 0))
    for _ in range(ATTEMPTS):
        missing = below - int(np.count_nonzero(values < border))
        if len(values) and missing <= 0:
            break
        if len(values):
            say(f"{missing} of {below} modes are missing: looking for them beside those found")
        wanted = min(missing + EXTRA_MODES, finite - 1 - len(values))
        if wanted <= 0:
            break
        more = _run(assembly, factor, shift, wanted, shapes, say)
        values, shapes = _ritz(assembly, factor, np.hstack([shapes, more]))
    count = int(np.count_nonzero(values < border))
    if count != below:
        raise FeedsimError(
            f"{assembly.name}: {count} modes found below {math.sqrt(border) / (2 * math.pi):.6g} Hz, where a Sturm "
            f"sequence counts {below}; a cut-off further from the next mode may help"
        )
    return values, shapes


def _up_to(
    assembly: Assembly, factor: Factor, shift: float, border: float, finite: int, say: StepReporter
) -> tuple[Floats, Floats]:
    """The modes below a border whose number is not known: more and more, until some lie above it."""
    wanted = 20
    while True:
        wanted = min(wanted, finite - 1)
        nothing = np.empty((assembly.mass.shape[0], 0))
        values, shapes = _ritz(assembly, factor, _run(assembly, factor, shift, wanted, nothing, say))
        if values[-1] > border or wanted == finite - 1:
            return values, shapes
        wanted *= 2


def _run(assembly: Assembly, factor: Factor, shift: float, wanted: int, known: Floats, say: StepReporter) -> Floats:
    """(N, wanted) approximate shapes of the lowest modes beside the known ones (mass-normalised columns)."""
    size = assembly.mass.shape[0]
    mass_known = assembly.mass @ known
    solves, began, reported = 0, time.monotonic(), time.monotonic()

    def solve(right: Floats) -> Floats:
        nonlocal solves, reported
        solves += 1
        if time.monotonic() - reported > SECONDS_BETWEEN_MESSAGES:
            reported = time.monotonic()
            say(f"Lanczos: {solves} solutions in {reported - began:.0f} s, for {wanted} modes")
        solution = factor.solve(np.ravel(right))
        return np.asarray(solution - known @ (mass_known.T @ solution))

    # A start vector of its own, so that the same model gives the same figures on every run.
    start = solve(assembly.mass @ np.random.default_rng(0).standard_normal(size))
    inverse = LinearOperator((size, size), matvec=solve, dtype=np.float64)
    vectors = min(size - 1, max(2 * wanted + 1, wanted + 20))
    try:
        _, shapes = eigsh(assembly.stiffness, wanted, assembly.mass, -shift, OPinv=inverse, v0=start, ncv=vectors)
    except ArpackNoConvergence as error:
        # What has converged is of use; what is missing is looked for again by whoever counts.
        if not error.eigenvectors.shape[1]:
            raise FeedsimError(f"{assembly.name}: the Lanczos iteration for {wanted} modes did not converge") from error
        shapes = error.eigenvectors
    except ArpackError as error:
        raise FeedsimError(f"{assembly.name}: the Lanczos iteration for {wanted} modes failed: {error}") from error
    say(f"Lanczos: {solves} solutions in {time.monotonic() - began:.1f} s for {wanted} modes")
    return np.asarray(shapes)


def _ritz(assembly: Assembly, factor: Factor, shapes: Floats) -> tuple[Floats, Floats]:
    """Eigenpairs of the space spanned by (K + shift M)^-1 M shapes.

    That step sharpens the shapes and gives degrees of freedom without mass the displacement that stiffness demands.
    """
    shapes = factor.solve(assembly.mass @ shapes)
    shapes /= np.sqrt(np.einsum("ij,ij->j", shapes, assembly.mass @ shapes))
    values, rotation = linalg.eigh(shapes.T @ (assembly.stiffness @ shapes), shapes.T @ (assembly.mass @ shapes))
    return values, shapes @ rotation
