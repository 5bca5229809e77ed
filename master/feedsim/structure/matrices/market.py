"""Mass and stiffness from Matrix Market files."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from scipy import sparse

from feedsim.errors import InputError
from feedsim.files import regular
from feedsim.scenario.structure.matrices import MatrixMarketStructure
from feedsim.structure.assembly import DEGREES, Floats, counted
from feedsim.structure.matrices.raw import Raw, from_both, from_triangle
from feedsim.structure.matrices.tables import NodeTable, read_nodes

MAX_MATRIX_ROWS = 50_000_000  # rows


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
    try:
        rows, form, symmetry, numbers = _content(file, what)
    except ValueError as error:
        raise InputError(f"{file}: cannot be read as a Matrix Market file: {error}") from error
    symmetric = symmetry == "symmetric"
    if form == "array":
        # Column by column; of a symmetric matrix what stands on and below the diagonal.
        column, row = np.triu_indices(rows) if symmetric else np.divmod(np.arange(rows**2), rows)
        value = numbers
    else:
        entries = numbers.reshape(-1, 3)
        row, column = (entries[:, i].astype(np.int64) - 1 for i in (0, 1))
        value = entries[:, 2].copy()
    return (from_triangle if symmetric else from_both)(row, column, value, rows, file)


def _content(file: Path, what: str) -> tuple[int, str, str, Floats]:
    """Rows, format and symmetry, and all numbers behind the size. ValueError: it is no such file.

    Read here and not by SciPy, whose reader ends the interpreter on some files that are cut off.
    """
    content = regular.content(file)
    head, _, rest = content.partition(b"\n")
    words = head.decode("ascii", "replace").lower().split()
    if len(words) != 5 or words[:2] != ["%%matrixmarket", "matrix"] or words[2] not in ("coordinate", "array"):
        raise ValueError("its first line is none like %%MatrixMarket matrix coordinate real symmetric")
    _, _, form, field, symmetry = words
    while not (line := (parts := rest.partition(b"\n"))[0].strip()) or line.startswith(b"%"):
        rest = parts[2]
        if not rest:
            raise ValueError("it has no line with its size")
    sizes = [int(word) for word in line.split()]
    if len(sizes) != (3 if form == "coordinate" else 2) or min(sizes) < 0 or max(sizes[:2]) > MAX_MATRIX_ROWS:
        raise ValueError(
            f"its size is {line.decode('ascii', 'replace')[:60]!r}; at most {MAX_MATRIX_ROWS} rows are read"
        )
    rows, columns = sizes[:2]
    if rows != columns:
        raise InputError(f"{file}: {what} matrix has {rows} rows and {columns} columns; it must be square")
    if field not in ("real", "double", "integer") or symmetry not in ("general", "symmetric"):
        raise InputError(
            f"{file}: {what} matrix is {field} {symmetry} by its first line; 'real symmetric' or 'real general' "
            "is expected"
        )
    reported = 3 * sizes[2] if form == "coordinate" else rows * (rows + 1) // 2 if symmetry == "symmetric" else rows**2
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)  # text that is no number
        try:
            numbers = np.fromstring(parts[2].decode("ascii"), dtype=np.float64, sep=" ")
        except DeprecationWarning:
            raise ValueError("it holds text that is no number") from None
    if numbers.size != reported:
        raise ValueError(f"it holds {numbers.size} numbers behind its size, which declares {reported}")
    if form == "coordinate":
        places = numbers.reshape(-1, 3)[:, :2]
        if not np.all((places == np.floor(places)) & (places >= 1) & (places <= rows)):
            raise ValueError(f"an entry is in no row or column from 1 to {rows}")
    return rows, form, symmetry, numbers
