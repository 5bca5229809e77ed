"""Mass and stiffness as CalculiX stores them: *FREQUENCY, SOLVER=MATRIXSTORAGE writes jobname.sti, .mas and .dof."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from scipy import sparse

from feedsim.errors import InputError
from feedsim.scenario.structure.matrices import CalculixStructure
from feedsim.structure.assembly import Integers
from feedsim.structure.matrices.calculix_mesh import read_mesh
from feedsim.structure.matrices.nodes import read_points
from feedsim.structure.matrices.raw import DIRECTIONS, Raw
from feedsim.structure.matrices.sparse import from_triangle

ABSENT = (
    "CalculiX has eliminated it: leave the row out if the node is held there (*BOUNDARY), name the node it depends on "
    "if it is tied (*EQUATION, *TIE, *RIGID BODY)"
)


def read(structure: CalculixStructure) -> Raw:
    """The model; constrained degrees of freedom are in none of the files.

    Raises:
        InputError: a file is not readable, or the files are not of one model.
    """
    nodes, directions = _dofs(structure.dofs)
    mass = _matrix(structure.mass, len(nodes), structure.dofs)
    stiffness = _matrix(structure.stiffness, len(nodes), structure.dofs)
    points = None
    if structure.mesh is not None:
        points = read_mesh(structure.mesh)
    elif structure.nodes is not None:
        points = read_points(structure.nodes, structure.lines)
    return Raw(mass, stiffness, nodes, directions, np.zeros(len(nodes), dtype=bool), ABSENT, points)


def _dofs(file: Path) -> tuple[tuple[str, ...], Integers]:
    """Node and direction of each row: lines such as 12.3 for node 12, uz."""
    nodes, directions, seen = [], [], set[tuple[str, str]]()
    try:
        lines = file.read_text(encoding="ascii").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{file}: cannot be read: {error}") from error
    for line, text in enumerate(lines, start=1):
        if not text.strip():
            continue
        node, point, direction = text.strip().partition(".")
        if not (node.isdecimal() and point and direction in ("1", "2", "3", "4", "5", "6")):
            raise InputError(f"{file}:{line}: {text.strip()!r}; node.direction is expected, such as 12.3")
        if (node, direction) in seen:
            raise InputError(f"{file}:{line}: node {node} {DIRECTIONS[int(direction) - 1]} occurs twice")
        seen.add((node, direction))
        nodes.append(node)
        directions.append(int(direction) - 1)
    if not nodes:
        raise InputError(f"{file}: empty; a line per degree of freedom is expected")
    return tuple(nodes), np.array(directions, dtype=np.int64)


def _matrix(file: Path, size: int, dofs: Path) -> sparse.csc_array:
    """One triangle as lines of row, column (from 1), value."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of an empty file, which is reported below
            table = np.loadtxt(file, dtype=np.float64, ndmin=2, encoding="ascii")
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error}") from error
    except ValueError as error:
        raise InputError(f"{file}: lines of row, column and value are expected: {error}") from error
    if table.size == 0 or table.shape[1] != 3:
        raise InputError(f"{file}: lines of row, column and value are expected")
    index = table[:, :2]
    if np.any(index != np.round(index)) or index.min() < 1:
        raise InputError(f"{file}: rows and columns are whole numbers from 1")
    if index.max() > size:
        raise InputError(
            f"{file}: row or column {int(index.max())}, but {dofs} has {size} degrees of freedom; the files are not of "
            "one job"
        )
    rows, columns = index.astype(np.int64).T - 1
    return from_triangle(rows, columns, table[:, 2], size, file)
