"""CSV tables of a finite-element model: nodes and lines between them, ports; every fault with its line.

A table of ports says which degrees of freedom a motor, a scale and the tool act on and see, with which weights.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from feedsim.files.fields import did_you_mean
from feedsim.files.trace.cells import duplicate_names, named_columns
from feedsim.foundation.errors import Finding, InputError
from feedsim.structure.assembly import Floats, Integers, shorten_labels
from feedsim.structure.modes import TOOL_PORTS

if TYPE_CHECKING:
    from scipy.sparse import csc_array


# --- What a finite-element file holds, in its own units, before ports and conversion; matrices from its entries -------


FREEDOM_NAMES = ("ux", "uy", "uz", "rx", "ry", "rz")


@dataclass(frozen=True, eq=False)
class Points:
    """Nodes of a mesh.

    Attributes:
        ids: (K,) node numbers or names, as a port table calls them.
        positions: (K, 3) in the file's unit of length.
        names: (K,) as shown in messages and tables.
        bodies: (K,) what a node belongs to; "" where that is not known.
        lines: (L, 2) indices of the nodes that a line joins.
    """

    ids: tuple[str, ...]
    positions: Floats
    names: tuple[str, ...]
    bodies: tuple[str, ...]
    lines: Integers


@dataclass(frozen=True, eq=False)
class RawModel:
    """Matrices with their degrees of freedom as the file counts them.

    Attributes:
        mass, stiffness: (N, N) in the file's units.
        nodes: (N,) node of each degree of freedom; None where only matrices are known.
        directions: (N,) 0 ... 5 for ux ... rz, -1 where not known.
        fixed: (N,) degrees of freedom that are constrained and leave the model.
        absent: what it means when a node has no degree of freedom, to end a message with.
        points: the mesh, where known.
        notes: what a person should know of the import.
    """

    mass: csc_array
    stiffness: csc_array
    nodes: tuple[str, ...] | None
    directions: Integers
    fixed: NDArray[np.bool_]
    absent: str = ""
    points: Points | None = None
    notes: tuple[Finding, ...] = ()

    @property
    def size(self) -> int:
        """Degrees of freedom, constrained ones included."""
        return len(self.directions)

    def labels(self) -> tuple[str, ...]:
        """(N,) such as "node 12 ux"; "dof 17" (from 0) where no nodes are known."""
        if self.nodes is None:
            return tuple(f"dof {i}" for i in range(self.size))
        names = dict(zip(self.points.ids, self.points.names, strict=True)) if self.points else {}
        return tuple(
            f"{names.get(node) or f'node {node}'} {FREEDOM_NAMES[d]}" if node else f"dof {i}"
            for i, (node, d) in enumerate(zip(self.nodes, self.directions.tolist(), strict=True))
        )


# Programs that write both triangles add up in another order above the diagonal than below; the difference stays far
# under this share of an entry's scale, the geometric mean of its diagonal entries.
SYMMETRY_ROUNDING = 1e-9


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
        if np.all(np.abs(difference.data) <= SYMMETRY_ROUNDING * scale[difference.row] * scale[difference.col]):
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


# --- CSV tables of a finite-element model: nodes and lines between them, ports; every fault with its line -------------


MOST_PROBLEMS = 20


@dataclass(frozen=True)
class Row:
    """Cells of a line, by column; an optional column that is not there is empty."""

    line: int
    cells: dict[str, str]

    def __getitem__(self, column: str) -> str:
        return self.cells.get(column, "")


def read_table(file: Path, what: str, headers: Sequence[Sequence[str]], optional: Sequence[str] = ()) -> list[Row]:
    """Rows of a table that has the columns of one of `headers`, and `optional` ones.

    Raises:
        InputError: not readable, other columns, a row of another length.
    """
    try:
        with file.open(encoding="utf-8-sig", newline="") as stream:
            rows = named_columns([[cell.strip() for cell in row] for row in csv.reader(stream)])
            lines = list(enumerate(rows, 1))
    except FileNotFoundError:
        raise InputError(f"{file}: no such file ({what})") from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{file}: cannot be read as {what}: {error}") from error
    lines = [(number, row) for number, row in lines if any(row)]
    columns = [name.lower() for name in lines[0][1]] if lines else []
    forms = " or ".join(", ".join(header) for header in headers)
    if not any(set(header) <= set(columns) for header in headers):
        there = f"; there is {', '.join(columns)}" if columns else "; the file is empty"
        raise InputError(f"{file}:1: {what} begins with a header: {forms}{there}")
    known = sorted({*optional, *(name for header in headers for name in header)})
    problems = [
        f"{file}:1: unknown column {name!r}{did_you_mean(name, known)}" for name in columns if name not in known
    ]
    problems += [f"{file}:1: column {name!r} occurs twice" for name in duplicate_names(columns)]
    problems += [
        f"{file}:{number}: {len(row)} cells; the header has {len(columns)}"
        for number, row in lines[1:]
        if len(row) != len(columns)
    ]
    if problems:
        raise InputError.of(f"{file}: not {what}", problems[:MOST_PROBLEMS])
    return [Row(number, dict(zip(columns, row, strict=True))) for number, row in lines[1:]]


def number(file: Path, row: Row, column: str) -> float:
    """A finite number. InputError with the line."""
    try:
        value = float(row[column])
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{file}:{row.line}: column {column!r}: {row[column]!r} is no finite number")
    return value


def index(file: Path, row: Row, column: str, below: int) -> int:
    """A whole number 0 ... below - 1. InputError with the line."""
    text = row[column]
    if not text.isdecimal():
        raise InputError(f"{file}:{row.line}: column {column!r}: {text!r} is no whole number from 0 to {below - 1}")
    if int(text) >= below:
        raise InputError(
            f"{file}:{row.line}: column {column!r}: there is no degree of freedom {text}; they count from 0 to "
            f"{below - 1} (in the Matrix Market files from 1 to {below})"
        )
    return int(text)


NODE_COLUMNS = ("node", "x", "y", "z")


@dataclass(frozen=True, eq=False)
class NodeTable:
    """What a table of nodes says of the degrees of freedom. See Raw."""

    nodes: tuple[str, ...] | None
    directions: Integers
    points: Points | None

    @classmethod
    def unknown(cls, size: int) -> NodeTable:
        """Nothing is known."""
        return cls(None, np.full(size, -1, dtype=np.int64), None)


def read_nodes(file: Path, lines: Path | None, size: int) -> NodeTable:
    """Nodes with the degrees of freedom of a model of `size`: columns ux ... rz number them from 0, empty for none.

    Raises:
        InputError: with file and line; a degree of freedom that is not there or is given twice.
    """
    rows = read_table(file, "a table of nodes", [NODE_COLUMNS], ("name", "body", *FREEDOM_NAMES))
    if not any(row[direction] for row in rows for direction in FREEDOM_NAMES):
        raise InputError(
            f"{file}:1: a table of nodes for Matrix Market files needs columns {', '.join(FREEDOM_NAMES)} (those that "
            "there are) with the numbers of the degrees of freedom, from 0"
        )
    nodes, directions = [""] * size, np.full(size, -1, dtype=np.int64)
    for row in rows:
        for d, direction in enumerate(FREEDOM_NAMES):
            if row[direction] in ("", "-1"):
                continue
            i = index(file, row, direction, size)
            if nodes[i]:
                raise InputError(
                    f"{file}:{row.line}: degree of freedom {i} belongs to node {nodes[i]} "
                    f"{FREEDOM_NAMES[directions[i]]} "
                    f"already"
                )
            nodes[i], directions[i] = row["node"], d
    return NodeTable(tuple(nodes), directions, _points(file, rows, lines))


def read_points(file: Path, lines: Path | None) -> Points:
    """Nodes alone, where the matrices bring their own numbering by nodes. InputError with file and line."""
    rows = read_table(file, "a table of nodes", [NODE_COLUMNS], ("name", "body"))
    return _points(file, rows, lines)


def _points(file: Path, rows: list[Row], lines: Path | None) -> Points:
    seen: dict[str, int] = {}
    for i, row in enumerate(rows):
        if not row["node"]:
            raise InputError(f"{file}:{row.line}: a node without a number or name")
        if row["node"] in seen:
            raise InputError(f"{file}:{row.line}: node {row['node']} is in line {rows[seen[row['node']]].line} already")
        seen[row["node"]] = i
    positions = [[number(file, row, column) for column in ("x", "y", "z")] for row in rows]
    joined = []
    for row in read_table(lines, "a table of lines", [("from", "to")]) if lines else []:
        for end in ("from", "to"):
            if row[end] not in seen:
                raise InputError(f"{lines}:{row.line}: there is no node {row[end]} in {file}")
        joined.append([seen[row["from"]], seen[row["to"]]])
    return Points(
        tuple(seen),
        np.array(positions, dtype=np.float64).reshape(-1, 3),
        tuple(row["name"] or f"node {row['node']}" for row in rows),
        tuple(row["body"] for row in rows),
        np.array(joined, dtype=np.int64).reshape(-1, 2),
    )


BY_DOF = ("port", "dof", "coefficient")
BY_NODE = ("port", "node", "direction", "coefficient")
# Spellings of the programs that tables come from.
SPELLINGS = {
    **{word: d for d, direction in enumerate(FREEDOM_NAMES) for word in (direction, str(d + 1))},
    **{"x": 0, "y": 1, "z": 2, "rotx": 3, "roty": 4, "rotz": 5},
}


def read_ports(file: Path, raw: RawModel, axes: Sequence[str]) -> dict[str, Floats]:
    """Vectors (N,) of the ports, in the file's units, constrained degrees of freedom included.

    Ports of the tool that the table does not name are zero: nothing acts there and nothing is seen.

    Raises:
        InputError: lists every fault with its line: unknown ports, nodes, directions or degrees of freedom, a port
            that names one twice, an axis without its ports, a port that acts on nothing but constraints.
    """
    rows = read_table(file, "a table of ports", [BY_NODE, BY_DOF])
    wanted = [f"{quantity}_{axis}" for axis in axes for quantity in ("n", "x")]
    vectors = {port: np.zeros(raw.size) for port in (*wanted, *TOOL_PORTS)}
    problems = [
        f"{file}: no row of port {port!r} ({_port_meaning(port)})"
        for port in wanted
        if all(row["port"] != port for row in rows)
    ]
    find, given = _Finder(file, raw), set[tuple[str, int]]()
    for row in rows:
        try:
            port = row["port"]
            if port not in vectors:
                raise InputError(f"{file}:{row.line}: unknown port {port!r}{did_you_mean(port, sorted(vectors))}")
            dof, weight = find(row), number(file, row, "coefficient")
            if (port, dof) in given:
                raise InputError(f"{file}:{row.line}: port {port!r} names {find.labels[dof]} twice")
            given.add((port, dof))
            vectors[port][dof] = weight
        except InputError as error:
            problems += error.problems
    named = {row["port"] for row in rows}
    for port, vector in vectors.items() if not problems else ():
        if port in named and np.any(vector) and not np.any(vector[~raw.fixed]):
            on = shorten_labels(find.labels, np.flatnonzero(vector))
            problems.append(f"{file}: port {port!r} acts on constrained degrees of freedom alone ({on}): nothing moves")
    if problems:
        raise InputError.of(f"{file}: not a usable table of ports", problems[:MOST_PROBLEMS])
    return vectors


class _Finder:
    """The degree of freedom that a row of the table names."""

    def __init__(self, file: Path, raw: RawModel) -> None:
        self.file, self.raw = file, raw
        self.labels = raw.labels()
        pairs = zip(raw.nodes, raw.directions.tolist(), strict=True) if raw.nodes else ()
        self.index = {pair: i for i, pair in enumerate(pairs) if pair[0]}
        self.nodes = {node for node, _ in self.index}

    def __call__(self, row: Row) -> int:
        where = f"{self.file}:{row.line}"
        if "dof" in row.cells:
            return index(self.file, row, "dof", self.raw.size)
        if not self.index:
            raise InputError(f"{where}: the table names nodes; without a table of nodes (nodes: ...) only dof counts")
        node, word = row["node"], row["direction"].lower()
        if word not in SPELLINGS:
            raise InputError(f"{where}: column 'direction': {row['direction']!r} is none of {', '.join(FREEDOM_NAMES)}")
        direction = SPELLINGS[word]
        count = self.index.get((node, direction))
        if count is not None:
            return count
        known = [FREEDOM_NAMES[d] for d in range(len(FREEDOM_NAMES)) if (node, d) in self.index]
        has = f"it has {', '.join(known)}; " if known else ""
        in_mesh = self.raw.points is not None and node in self.raw.points.ids
        if node not in self.nodes and not in_mesh:
            raise InputError(f"{where}: there is no node {node!r} with degrees of freedom")
        raise InputError(
            f"{where}: node {node} has no degree of freedom {FREEDOM_NAMES[direction]}; {has}{self.raw.absent}"
        )


def _port_meaning(port: str) -> str:
    kind = "rotor against stator: torque in, angle out" if port.startswith("n_") else "linear scale: travel out"
    return f"{kind}; axes: names {port[2:]}"
