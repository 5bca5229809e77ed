"""Models of CalculiX: matrices, and nodes, bodies and edges of the input file for names and pictures.

*FREQUENCY, SOLVER=MATRIXSTORAGE writes jobname.sti, .mas and .dof.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy import sparse

from feedsim.files import source
from feedsim.files.source import resolve_reference
from feedsim.foundation.errors import InputError
from feedsim.scenario.structure import CalculixStructure
from feedsim.structure.assembly import Integers
from feedsim.structure.matrices.tables import FREEDOM_NAMES, Points, RawModel, from_triangle, read_points

# Types of elements that CalculiX makes solids of: beams, shells, plane and axisymmetric ones, membranes, trusses.
_EXPANDED_ELEMENTS = re.compile(r"B2|B3|S[0-9]|CP[SE]|CAX|M3D|T[23]D")
ABSENT_FREEDOM_ADVICE = (
    "CalculiX has eliminated it: leave the row out if the node is held there (*BOUNDARY), name the node it depends on "
    "if it is tied (*EQUATION, *TIE, *RIGID BODY)"
)


def read_model(structure: CalculixStructure) -> RawModel:
    """The model; constrained degrees of freedom are in none of the files.

    Raises:
        InputError: a file is not readable, or the files are not of one model.
    """
    nodes, directions = _dofs(structure.dofs, structure.mesh)
    mass = _matrix(structure.mass, len(nodes), structure.dofs)
    stiffness = _matrix(structure.stiffness, len(nodes), structure.dofs)
    points = None
    if structure.mesh is not None:
        points = read_mesh(structure.mesh)
    elif structure.nodes is not None:
        points = read_points(structure.nodes, structure.lines)
    return RawModel(mass, stiffness, nodes, directions, np.zeros(len(nodes), dtype=bool), ABSENT_FREEDOM_ADVICE, points)


def _dofs(file: Path, mesh: Path | None) -> tuple[tuple[str, ...], Integers]:
    """Node and direction of each row: lines such as 12.3 for node 12, uz. mesh: for the message on a repeated row."""
    nodes, directions, seen = [], [], set[tuple[str, str]]()
    try:
        lines = source.content(file).decode("ascii").splitlines()
    except (InputError, UnicodeDecodeError) as error:
        raise InputError(f"{file}: cannot be read: {error}") from error
    for line, text in enumerate(lines, start=1):
        if not text.strip():
            continue
        node, point, direction = text.strip().partition(".")
        if not (node.isdecimal() and point and direction in ("1", "2", "3", "4", "5", "6")):
            raise InputError(f"{file}:{line}: {text.strip()!r}; node.direction is expected, such as 12.3")
        if (node, direction) in seen:
            raise InputError(
                f"{file}:{line}: node {node} {FREEDOM_NAMES[int(direction) - 1]} occurs twice. "
                f"{_explain_expansion(mesh)}"
            )
        seen.add((node, direction))
        nodes.append(node)
        directions.append(int(direction) - 1)
    if not nodes:
        raise InputError(f"{file}: empty; a line per degree of freedom is expected")
    return tuple(nodes), np.array(directions, dtype=np.int64)


def _explain_expansion(mesh: Path | None) -> str:
    """Why nodes occur several times, and what to do."""
    types = [] if mesh is None else [options.get("TYPE", "").upper() for _, options in _elements(mesh)]
    there = ", ".join(dict.fromkeys(name for name in types if _EXPANDED_ELEMENTS.match(name)))
    shown = f" ({mesh} has {there})" if there else ""
    return (
        f"CalculiX expands beams, shells and other flat elements into solids{shown}, whose nodes share a number. "
        "Use solid elements (C3D8, C3D20), or kind: matrices, where degrees of freedom are counted and not named"
    )


def _elements(mesh: Path) -> Iterator[tuple[str, dict[str, str]]]:
    """Keyword and options of the cards *ELEMENT."""
    for _, text in _cards(mesh):
        if text.startswith("*") and (card := _options(text))[0] == "ELEMENT":
            yield card


def _matrix(file: Path, size: int, dofs: Path) -> sparse.csc_array:
    """One triangle as lines of row, column (from 1), value."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of an empty file, which is reported below
            with source.open_file(file) as stream:
                table = np.loadtxt(stream, dtype=np.float64, ndmin=2, encoding="ascii")
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


_HEX = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
_WEDGE = ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5))
_TET = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
_QUAD = ((0, 1), (1, 2), (2, 3), (3, 0))
_TRIANGLE = ((0, 1), (1, 2), (2, 0))
_LINE = ((0, 1),)
# Element type (without letters behind the number of nodes) -> its nodes in all, and its edges between corners.
ELEMENTS = {
    "C3D4": (4, _TET), "C3D10": (10, _TET),
    "C3D6": (6, _WEDGE), "C3D15": (15, _WEDGE),
    "C3D8": (8, _HEX), "C3D20": (20, _HEX),
    "S3": (3, _TRIANGLE), "S6": (6, _TRIANGLE), "S4": (4, _QUAD), "S8": (8, _QUAD),
    "B31": (2, _LINE), "B32": (3, ((0, 2),)), "T3D2": (2, _LINE), "T3D3": (3, ((0, 2),)),
    "SPRINGA": (2, _LINE), "SPRING2": (2, _LINE), "DASHPOTA": (2, _LINE),
    "SPRING1": (1, ()), "MASS": (1, ()),
}  # fmt: skip
MAX_INCLUDE_DEPTH = 8  # files that include files


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
            self._open += [_whole_number(where, cell) for cell in text.split(",") if cell.strip()]
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
        self.nodes[_whole_number(where, cells[0])] = (position[0], position[1], position[2])

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
        content = source.content(file).decode("utf-8", "replace")
    except InputError as error:
        raise InputError(f"{file}: cannot be read: {error}") from None
    for number, line in enumerate(content.splitlines(), start=1):
        text = line.strip()
        if not text or text.startswith("**"):
            continue
        if text.startswith("*"):
            keyword, options = _options(text)
            if keyword == "INCLUDE":
                if depth == MAX_INCLUDE_DEPTH:
                    raise InputError(f"{file}:{number}: files include one another more than {MAX_INCLUDE_DEPTH} deep")
                yield from _cards(resolve_reference(file.parent, options.get("INPUT", "")), depth + 1)
                continue
        yield f"{file}:{number}", text


def _options(text: str) -> tuple[str, dict[str, str]]:
    """Keyword and its options: "*ELEMENT, TYPE=C3D8, ELSET=bed"."""
    first, *rest = [part.strip() for part in text.split(",")]
    pairs = [part.partition("=") for part in rest]
    return first[1:].strip().upper(), {key.strip().upper(): value.strip() for key, _, value in pairs}


def _whole_number(where: str, cell: str) -> int:
    if not cell.strip().isdecimal():
        raise InputError(f"{where}: {cell.strip()!r} is no number of a node or element")
    return int(cell)
