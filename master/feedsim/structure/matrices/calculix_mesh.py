"""Nodes, bodies and edges from a CalculiX input file: for names and pictures, no mechanics."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from feedsim.errors import InputError
from feedsim.structure.matrices.raw import Points

_HEX = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
_WEDGE = ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5))
_TET = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
_QUAD = ((0, 1), (1, 2), (2, 3), (3, 0))
_TRIANGLE = ((0, 1), (1, 2), (2, 0))
_LINE = ((0, 1),)
# Element type (without letters behind the number of nodes) -> its nodes in all, and its edges between corners.
ELEMENTS = {
    "C3D4": (4, _TET),
    "C3D6": (6, _WEDGE),
    "C3D8": (8, _HEX),
    "C3D10": (10, _TET),
    "C3D15": (15, _WEDGE),
    "C3D20": (20, _HEX),
    "S3": (3, _TRIANGLE),
    "S4": (4, _QUAD),
    "S6": (6, _TRIANGLE),
    "S8": (8, _QUAD),
    "B31": (2, _LINE),
    "B32": (3, ((0, 2),)),
    "T3D2": (2, _LINE),
    "T3D3": (3, ((0, 2),)),
    "SPRINGA": (2, _LINE),
    "SPRING2": (2, _LINE),
    "SPRING1": (1, ()),
    "DASHPOTA": (2, _LINE),
    "MASS": (1, ()),
}
DEEPEST = 8  # files that include files


def read_mesh(file: Path) -> Points:
    """Nodes with the element set (ELSET= of *ELEMENT) they belong to as body, edges of the elements as lines.

    Raises:
        InputError: with file and line: no number where one belongs, an element on an unknown node.
    """
    reader = _Reader()
    for where, text in _cards(file):
        reader.take(where, text)
    reader.close()
    if not reader.nodes:
        raise InputError(f"{file}: no nodes (*NODE) in it")
    ids = tuple(reader.nodes)
    bodies = {node: reader.bodies.get(node) or reader.ends.get(node, "") for node in ids}
    row = {node: k for k, node in enumerate(ids)}
    edges = {(min(row[a], row[b]), max(row[a], row[b])) for a, b in reader.edges}
    return Points(
        tuple(str(node) for node in ids),
        np.array([reader.nodes[node] for node in ids], dtype=np.float64),
        tuple(f"{bodies[node]} node {node}".lstrip() for node in ids),
        tuple(bodies[node] for node in ids),
        np.array(sorted(edges), dtype=np.int64).reshape(-1, 2),
    )


class _Reader:
    """Takes the lines of an input file one by one."""

    def __init__(self) -> None:
        self.nodes: dict[int, tuple[float, float, float]] = {}
        self.bodies: dict[int, str] = {}
        self.ends: dict[int, str] = {}  # sets of springs, which are the body of a node that has no other
        self.edges: set[tuple[int, int]] = set()
        self._keyword, self._type, self._set = "", "", ""
        self._open: list[int] = []
        self._where = ""

    def take(self, where: str, text: str) -> None:
        if text.startswith("*"):
            self.close()
            self._keyword, options = _options(text)
            self._type, self._set = options.get("TYPE", "").upper(), options.get("ELSET", "")
        elif self._keyword == "NODE":
            self._node(where, text)
        elif self._keyword == "ELEMENT":
            if not self._open:
                self._where = where
            self._open += [_whole(where, cell) for cell in text.split(",") if cell.strip()]
            self._element()

    def close(self) -> None:
        """An element that still waits for nodes has too few."""
        if self._open and self._type_known():
            raise InputError(f"{self._where}: an element of type {self._type} has {self._type_known()} nodes")
        self._open = []

    def _node(self, where: str, text: str) -> None:
        cells = [cell.strip() for cell in text.split(",")]
        try:
            position = [float(cell) if cell else 0.0 for cell in [*cells[1:4], "", "", ""][:3]]
        except ValueError:
            raise InputError(f"{where}: {text!r}; node, x, y, z are expected") from None
        self.nodes[_whole(where, cells[0])] = (position[0], position[1], position[2])

    def _element(self) -> None:
        count = self._type_known()
        if count is None:
            self._open = []
            return
        if len(self._open) <= count:
            return
        members, self._open = self._open[1 : count + 1], []
        unknown = [node for node in members if node not in self.nodes]
        if unknown:
            raise InputError(f"{self._where}: an element on node {unknown[0]}, which no *NODE line defines before")
        bodies = self.ends if self._base().startswith(("SPRING", "DASHPOT")) else self.bodies
        for node in members:
            bodies.setdefault(node, self._set)
        self.edges.update((members[a], members[b]) for a, b in ELEMENTS[self._base()][1])

    def _base(self) -> str:
        """The type without what stands behind its number of nodes: C3D20R is a C3D20."""
        known = [name for name in ELEMENTS if self._type.startswith(name)]
        return max(known, key=len, default="")

    def _type_known(self) -> int | None:
        return ELEMENTS[self._base()][0] if self._base() else None


def _cards(file: Path, depth: int = 0) -> Iterator[tuple[str, str]]:
    """Lines without comments, with file:line; included files where they are named."""
    try:
        content = file.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error}") from error
    for number, line in enumerate(content.splitlines(), start=1):
        text = line.strip()
        if not text or text.startswith("**"):
            continue
        if text.startswith("*"):
            keyword, options = _options(text)
            if keyword == "INCLUDE":
                if depth == DEEPEST:
                    raise InputError(f"{file}:{number}: files include one another more than {DEEPEST} deep")
                yield from _cards(file.parent / options.get("INPUT", ""), depth + 1)
                continue
        yield f"{file}:{number}", text


def _options(text: str) -> tuple[str, dict[str, str]]:
    """Keyword and its options: "*ELEMENT, TYPE=C3D8, ELSET=bed"."""
    first, *rest = [part.strip() for part in text.split(",")]
    pairs = [part.partition("=") for part in rest]
    return first[1:].strip().upper(), {key.strip().upper(): value.strip() for key, _, value in pairs}


def _whole(where: str, cell: str) -> int:
    if not cell.strip().isdecimal():
        raise InputError(f"{where}: {cell.strip()!r} is no number of a node or element")
    return int(cell)
