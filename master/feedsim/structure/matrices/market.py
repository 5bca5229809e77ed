"""Mass and stiffness from Matrix Market files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy import sparse

from feedsim.errors import InputError
from feedsim.scenario.structure.matrices import MatrixMarketStructure
from feedsim.structure.assembly import DEGREES, counted
from feedsim.structure.matrices.raw import Raw, from_both, from_triangle
from feedsim.structure.matrices.tables import NodeTable, read_nodes


def read(structure: MatrixMarketStructure) -> Raw:
    """The model. Degrees of freedom with neither mass nor stiffness count as constrained.

    Raises:
        InputError: a file is not readable, or the two matrices are not of one model.
    """
    mass, stiffness = read_matrix(structure.mass, "the mass"), read_matrix(structure.stiffness, "the stiffness")
    if mass.shape != stiffness.shape:
        raise InputError(
            f"{structure.mass}: the mass matrix has {mass.shape[0]} degrees of freedom; the stiffness matrix in "
            f"{structure.stiffness} has {stiffness.shape[0]}"
        )
    size = mass.shape[0]
    table = read_nodes(structure.nodes, structure.lines, size) if structure.nodes else NodeTable.unknown(size)
    fixed = (np.diff(mass.indptr) == 0) & (np.diff(stiffness.indptr) == 0)
    notes = []
    if np.any(fixed):
        notes.append(f"{counted(int(fixed.sum()), *DEGREES)} without mass and stiffness: removed as constrained")
    absent = f"no column of {structure.nodes} gives it a degree of freedom" if structure.nodes else ""
    return Raw(mass, stiffness, table.nodes, table.directions, fixed, absent, table.points, tuple(notes))


def read_matrix(file: Path, what: str) -> sparse.csc_array:
    """A square matrix of real numbers; `what` begins messages.

    Raises:
        InputError: not a Matrix Market file of a square real matrix; an entry occurs twice.
    """
    from scipy import io  # readers of many formats, which a run need not wait for

    try:
        rows, columns, _, form, field, symmetry = io.mminfo(file)
        if rows != columns:
            raise InputError(f"{file}: {what} matrix has {rows} rows and {columns} columns; it must be square")
        if field not in ("real", "double", "integer") or symmetry not in ("general", "symmetric"):
            raise InputError(
                f"{file}: {what} matrix is {field} {symmetry} by its first line; 'real symmetric' or 'real general' "
                "is expected"
            )
        content = io.mmread(file, spmatrix=False)
    except InputError:
        raise
    except (OSError, ValueError, OverflowError, TypeError, EOFError) as error:
        raise InputError(f"{file}: cannot be read as a Matrix Market file: {error}") from error
    if form == "array":
        return from_both(*_entries(sparse.coo_array(np.asarray(content, dtype=np.float64))), rows, file)
    entries = content.tocoo()
    if symmetry == "general":
        return from_both(*_entries(entries), rows, file)
    # The reader has mirrored the triangle that the file holds; one half is the file again.
    row, column, value = _entries(entries)
    half = row >= column
    return from_triangle(row[half], column[half], value[half], rows, file)


def _entries(matrix: sparse.coo_array) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return matrix.row.astype(np.int64), matrix.col.astype(np.int64), matrix.data.astype(np.float64)
