"""What groups of a record's rows say differently: the scatter of a fit that leaves out one group after the other.

Errors of a model are not drawn anew with every row, and a fit to other motion has others. Leaving out one stretch after
the other shows how far they move the values (grouped jackknife; R. G. Miller, Biometrika 61 (1974), 1-15).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from feedsim.estimation.interval import NORMAL_95, student

Array = NDArray[np.float64]
Rows = NDArray[np.int64]
RANK = 1e-12  # singular values below that share of the largest one are none


def between_groups(A: Array, b: Array, groups: Sequence[Rows], of: Array | None = None) -> Array:
    """(Q,) variance of `of` x, where x solves A x = b by least squares, by what the groups say differently.

    The scatter of the fits is compared with what errors of unit variance would make of it: groups that determine a
    value unequally scatter by more than the value does. So few groups know their own scatter roughly only: it counts by
    Student's distribution, as a variance that the normal distribution is used with. Of a value that few of them
    determine, as accelerations do an inertia, still fewer say something: what remains of two groups is one difference.
    The degrees of freedom are those of a quadratic form (F. E. Satterthwaite, Biometrics Bulletin 2 (1946), 110-114) in
    residuals (1 - H) e, H the projection on A.

    Args:
        A, b: (N, P) and (N,). groups: rows of each; rows of no group, as those of a prior, always stay.
        of: (Q, P) combinations that are asked for; None: every value.
    """
    scale = np.linalg.norm(A, axis=0)
    scale[scale == 0] = 1.0
    A = A / scale
    wanted = np.eye(A.shape[1]) / scale if of is None else of / scale

    def factors(rows: Rows) -> tuple[Array, Array]:
        """(N, R) and (P, R), of which V V^T is the inverse of the normal matrix of these rows, and V U^T b solves."""
        U, s, Vt = np.linalg.svd(A[rows], full_matrices=False)
        kept = s > RANK * s[0]
        return U[:, kept], Vt[kept].T / s[kept]

    every = np.arange(len(b))
    _, root = factors(every)
    count = len(groups)
    moved = np.empty((count, len(wanted)))
    own, shared = np.empty((count, len(wanted))), np.empty((count, len(wanted), root.shape[1]))
    for g, rows in enumerate(groups):
        others = np.delete(every, rows)
        U, V = factors(others)
        moved[g] = wanted @ (V @ (U.T @ b[others]))
        # Without the group a value moves by its slopes times the residuals of all rows.
        slopes = A[rows] @ (V @ (V.T @ wanted.T))
        own[g], shared[g] = np.sum(slopes**2, axis=0), (A[rows].T @ slopes).T @ root
    scatter = np.sum((moved - np.mean(moved, axis=0)) ** 2, axis=0)
    variance = np.sum((wanted @ root) ** 2, axis=1)
    result = np.empty(len(wanted))
    for q in range(len(wanted)):
        expected, free = scatter_of(np.diag(own[:, q]) - shared[:, q] @ shared[:, q].T)
        result[q] = scatter[q] / expected * variance[q] * (student(free) / NORMAL_95) ** 2 if expected > 0 else 0.0
    return result


def scatter_of(covariance: Array) -> tuple[float, float]:
    """Expected sum of squares of values about their mean, and its degrees of freedom (at least 1), by their covariance
    (G, G).

    >>> scatter_of(np.eye(8)), scatter_of(np.array([[1.0, -1.0], [-1.0, 1.0]]))
    ((7.0, 7.0), (2.0, 1.0))
    """
    form = covariance - np.mean(covariance, axis=0)
    expected, square = float(np.trace(form)), float(np.trace(form @ form))
    return expected, max(expected**2 / square, 1.0) if square > 0 else len(covariance) - 1.0
