"""Tables of ports: which degrees of freedom a motor, a scale and the tool act on and see, with which weights."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from feedsim.errors import InputError
from feedsim.structure.assembly import Floats
from feedsim.structure.checks.words import few
from feedsim.structure.matrices import tables
from feedsim.structure.matrices.raw import DIRECTIONS, Raw
from feedsim.structure.modes import TOOL_PORTS

BY_DOF = ("port", "dof", "coefficient")
BY_NODE = ("port", "node", "direction", "coefficient")
# Spellings of the programs that tables come from.
SPELLINGS = {
    **{word: d for d, direction in enumerate(DIRECTIONS) for word in (direction, str(d + 1))},
    **{"x": 0, "y": 1, "z": 2, "rotx": 3, "roty": 4, "rotz": 5},
}


def read_ports(file: Path, raw: Raw, axes: Sequence[str]) -> dict[str, Floats]:
    """Vectors (N,) of the ports, in the file's units, constrained degrees of freedom included.

    Ports of the tool that the table does not name are zero: nothing acts there and nothing is seen.

    Raises:
        InputError: lists every fault with its line: unknown ports, nodes, directions or degrees of freedom, a port
            that names one twice, an axis without its ports, a port that acts on nothing but constraints.
    """
    rows = tables.read_table(file, "a table of ports", [BY_NODE, BY_DOF])
    wanted = [f"{quantity}_{axis}" for axis in axes for quantity in ("n", "x")]
    vectors = {port: np.zeros(raw.size) for port in (*wanted, *TOOL_PORTS)}
    problems = [
        f"{file}: no row of port {port!r} ({_meaning(port)})"
        for port in wanted
        if all(row["port"] != port for row in rows)
    ]
    find, given = _Finder(file, raw), set[tuple[str, int]]()
    for row in rows:
        try:
            port = row["port"]
            if port not in vectors:
                raise InputError(f"{file}:{row.line}: unknown port {port!r}{tables.suggestion(port, set(vectors))}")
            dof, weight = find(row), tables.number(file, row, "coefficient")
            if (port, dof) in given:
                raise InputError(f"{file}:{row.line}: port {port!r} names {find.labels[dof]} twice")
            given.add((port, dof))
            vectors[port][dof] = weight
        except InputError as error:
            problems += error.problems
    named = {row["port"] for row in rows}
    for port, vector in vectors.items() if not problems else ():
        if port in named and np.any(vector) and not np.any(vector[~raw.fixed]):
            on = few(find.labels, np.flatnonzero(vector))
            problems.append(f"{file}: port {port!r} acts on constrained degrees of freedom alone ({on}): nothing moves")
    if problems:
        raise InputError.of(f"{file}: not a usable table of ports", problems[: tables.MOST_PROBLEMS])
    return vectors


class _Finder:
    """The degree of freedom that a row of the table names."""

    def __init__(self, file: Path, raw: Raw) -> None:
        self.file, self.raw = file, raw
        self.labels = raw.labels()
        pairs = zip(raw.nodes, raw.directions.tolist(), strict=True) if raw.nodes else ()
        self.index = {pair: i for i, pair in enumerate(pairs) if pair[0]}
        self.nodes = {node for node, _ in self.index}

    def __call__(self, row: tables.Row) -> int:
        where = f"{self.file}:{row.line}"
        if "dof" in row.cells:
            return tables.index(self.file, row, "dof", self.raw.size)
        if not self.index:
            raise InputError(f"{where}: the table names nodes; without a table of nodes (nodes: ...) only dof counts")
        node, word = row["node"], row["direction"].lower()
        if word not in SPELLINGS:
            raise InputError(f"{where}: column 'direction': {row['direction']!r} is none of {', '.join(DIRECTIONS)}")
        direction = SPELLINGS[word]
        found = self.index.get((node, direction))
        if found is not None:
            return found
        known = [DIRECTIONS[d] for d in range(len(DIRECTIONS)) if (node, d) in self.index]
        has = f"it has {', '.join(known)}; " if known else ""
        in_mesh = self.raw.points is not None and node in self.raw.points.ids
        if node not in self.nodes and not in_mesh:
            raise InputError(f"{where}: there is no node {node!r} with degrees of freedom")
        raise InputError(
            f"{where}: node {node} has no degree of freedom {DIRECTIONS[direction]}; {has}{self.raw.absent}"
        )


def _meaning(port: str) -> str:
    kind = "rotor against stator: torque in, angle out" if port.startswith("n_") else "linear scale: travel out"
    return f"{kind}; axes: names {port[2:]}"
