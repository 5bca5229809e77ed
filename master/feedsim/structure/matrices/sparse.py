"""Symmetric sparse matrices from entries as programs write them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy import sparse

from feedsim.errors import InputError
from feedsim.structure.assembly import Floats, Integers

# Programs that write both triangles add up in another order above the diagonal than below; the difference stays far
# under this share of an entry's scale, the geometric mean of its diagonal entries.
ROUNDING = 1e-9


def from_triangle(rows: Integers, columns: Integers, values: Floats, size: int, file: Path) -> sparse.csc_array:
    """The whole matrix from one triangle, diagonal included; which one may differ from entry to entry.

    Raises:
        InputError: an entry occurs twice, or on both sides of the diagonal.
    """
    upper, lower = np.minimum(rows, columns), np.maximum(rows, columns)
    half = sparse.coo_array((values, (upper, lower)), shape=(size, size))
    _refuse_twice(half, file)
    off = upper != lower
    matrix = sparse.coo_array(
        (
            np.concatenate([values, values[off]]),
            (np.concatenate([upper, lower[off]]), np.concatenate([lower, upper[off]])),
        ),
        shape=(size, size),
    ).tocsc()
    return without_zeros(matrix)


def from_both(rows: Integers, columns: Integers, values: Floats, size: int, file: Path) -> sparse.csc_array:
    """The matrix from both triangles; rounding differences between them are levelled, others stay for the checks.

    Raises:
        InputError: an entry occurs twice.
    """
    entries = sparse.coo_array((values, (rows, columns)), shape=(size, size))
    _refuse_twice(entries, file)
    matrix = entries.tocsc()
    difference = (matrix - matrix.T).tocoo()
    if difference.nnz and np.all(np.isfinite(difference.data)):
        scale = np.sqrt(np.abs(matrix.diagonal()))
        if np.all(np.abs(difference.data) <= ROUNDING * scale[difference.row] * scale[difference.col]):
            matrix = ((matrix + matrix.T) / 2).tocsc()
    return without_zeros(matrix)


def without_zeros(matrix: sparse.csc_array) -> sparse.csc_array:
    """Without stored zeros, indices in order."""
    matrix.eliminate_zeros()
    matrix.sort_indices()
    return matrix


def _refuse_twice(entries: sparse.coo_array, file: Path) -> None:
    key = entries.row.astype(np.int64) * entries.shape[1] + entries.col
    order = np.sort(key)
    again = order[1:][order[1:] == order[:-1]]
    if len(again):
        row, column = divmod(int(again[0]), entries.shape[1])
        raise InputError(
            f"{file}: the entry in row {row + 1}, column {column + 1} (from 1) occurs twice; where one triangle is "
            "stored, each entry must be in one of them alone"
        )
