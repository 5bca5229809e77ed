"""Tables of nodes and of lines between them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from feedsim.errors import InputError
from feedsim.structure.assembly import Integers
from feedsim.structure.matrices import tables
from feedsim.structure.matrices.raw import DIRECTIONS, Points

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
    rows = tables.read_table(file, "a table of nodes", [NODE_COLUMNS], ("name", "body", *DIRECTIONS))
    if not any(row[direction] for row in rows for direction in DIRECTIONS):
        raise InputError(
            f"{file}:1: a table of nodes for Matrix Market files needs columns {', '.join(DIRECTIONS)} (those that "
            "there are) with the numbers of the degrees of freedom, from 0"
        )
    nodes, directions = [""] * size, np.full(size, -1, dtype=np.int64)
    for row in rows:
        for d, direction in enumerate(DIRECTIONS):
            if row[direction] in ("", "-1"):
                continue
            i = tables.index(file, row, direction, size)
            if nodes[i]:
                raise InputError(
                    f"{file}:{row.line}: degree of freedom {i} belongs to node {nodes[i]} {DIRECTIONS[directions[i]]} "
                    f"already"
                )
            nodes[i], directions[i] = row["node"], d
    return NodeTable(tuple(nodes), directions, _points(file, rows, lines))


def read_points(file: Path, lines: Path | None) -> Points:
    """Nodes alone, where the matrices bring their own numbering by nodes. InputError with file and line."""
    rows = tables.read_table(file, "a table of nodes", [NODE_COLUMNS], ("name", "body"))
    return _points(file, rows, lines)


def _points(file: Path, rows: list[tables.Row], lines: Path | None) -> Points:
    seen: dict[str, int] = {}
    for i, row in enumerate(rows):
        if not row["node"]:
            raise InputError(f"{file}:{row.line}: a node without a number or name")
        if row["node"] in seen:
            raise InputError(f"{file}:{row.line}: node {row['node']} is in line {rows[seen[row['node']]].line} already")
        seen[row["node"]] = i
    positions = [[tables.number(file, row, column) for column in ("x", "y", "z")] for row in rows]
    joined = []
    for row in tables.read_table(lines, "a table of lines", [("from", "to")]) if lines else []:
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
