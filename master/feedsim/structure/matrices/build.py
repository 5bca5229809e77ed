"""From matrices with ports in a program's units to an Assembly in SI.

A program that calculates in lengths of L [m], masses of m [kg] and times of T [s] has translations u_SI = L u and the
same rotations. Energies are m L2 / T2 times the program's, hence M_SI = m L2 D M D and K_SI = m L2 / T2 D K D with
D = 1/L for translations and 1 for rotations.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import sparse

from feedsim.files import source
from feedsim.foundation import units
from feedsim.foundation.errors import Finding, InputError
from feedsim.scenario.structure import (
    AnsysStructure,
    CalculixStructure,
    FiniteElements,
    MatrixMarketStructure,
    UnitSystem,
)
from feedsim.structure.assembly import DEGREES, Assembly, Floats, Geometry, Integers, count_text, shorten_labels
from feedsim.structure.matrices import ansys, calculix
from feedsim.structure.matrices.tables import (
    FREEDOM_NAMES,
    NodeTable,
    Points,
    RawModel,
    from_both,
    from_triangle,
    read_nodes,
    read_ports,
    without_zeros,
)
from feedsim.structure.modes import TOOL_PORTS

# --- Mass and stiffness from Matrix Market files ----------------------------------------------------------------------


MAX_MATRIX_ROWS = 50_000_000  # rows


def read_matrix_market(structure: MatrixMarketStructure) -> RawModel:
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
        text = f"{count_text(int(fixed.sum()), *DEGREES)} without mass and stiffness: removed as constrained"
        notes.append(Finding("freedom-constrained", "doubt", text))
    absent = f"no column of {structure.nodes} gives it a degree of freedom" if structure.nodes else ""
    return RawModel(mass, stiffness, table.nodes, table.directions, fixed, absent, table.points, tuple(notes))


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
    content = source.content(file)
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


@dataclass(frozen=True, eq=False)
class ImportedModel:
    """An imported model, and what a person should know of the import."""

    assembly: Assembly
    notes: tuple[Finding, ...]


def import_model(structure: FiniteElements) -> ImportedModel:
    """The model of a structure file of kind matrices, ansys or calculix, and notes on the import.

    Raises:
        InputError: a file is not readable or the files contradict one another.
    """
    if isinstance(structure, MatrixMarketStructure):
        raw, file = read_matrix_market(structure), structure.stiffness
    elif isinstance(structure, AnsysStructure):
        raw, file = ansys.read_model(structure), structure.full
    elif isinstance(structure, CalculixStructure):
        raw, file = calculix.read_model(structure), structure.stiffness
    else:
        raise TypeError(f"no kind of finite-element model: {type(structure).__name__}")
    return build(structure, structure.units, raw, structure.name or str(file))


def build(structure: FiniteElements, system: UnitSystem, raw: RawModel, name: str) -> ImportedModel:
    """The model without its constrained degrees of freedom, in SI.

    Raises:
        InputError: faulty ports; lengths in another unit than metres where nothing says which
            degrees of freedom are rotations; a model that is constrained altogether.
    """
    length, mass, time = factors(system)
    if length != 1 and np.any(raw.directions < 0):
        first = raw.labels()[int(np.flatnonzero(raw.directions < 0)[0])]
        raise InputError(
            f"{name}: units.length is {system.length}, and whether {first} is a displacement or a rotation is not "
            "known; give a table of nodes (nodes: ...) with all degrees of freedom, or matrices in metres"
        )
    if structure.ports is not None:
        vectors = read_ports(structure.ports, raw, structure.axes)
    else:
        vectors = {port: np.zeros(raw.size) for port in TOOL_PORTS}
    kept = np.flatnonzero(~raw.fixed)
    if not len(kept):
        raise InputError(f"{name}: all {raw.size} degrees of freedom are constrained; nothing can move")
    rotation = raw.directions[kept] >= 3
    labels = raw.labels()
    notes = [*raw.notes, *_note_ineffective_ports(vectors, raw, labels)]
    assembly = Assembly(
        name=name,
        mass=scale_matrix(raw.mass[kept][:, kept], rotation, length, mass),
        stiffness=scale_matrix(raw.stiffness[kept][:, kept], rotation, length, mass / time**2),
        ports={
            port: port_vector(vector[kept], rotation, length, angle=port.startswith("n_"))
            for port, vector in vectors.items()
        },
        axes=structure.axes,
        labels=tuple(labels[i] for i in kept),
        geometry=_geometry(raw.points, raw, kept, length) if raw.points else None,
        pose=dict(structure.pose),
        units=system,
    )
    return ImportedModel(assembly, tuple(notes))


def _note_ineffective_ports(vectors: dict[str, Floats], raw: RawModel, labels: tuple[str, ...]) -> list[Finding]:
    """A stator on the ground moves nothing: right, but worth a word."""
    notes = []
    for port, vector in vectors.items():
        on = np.flatnonzero((vector != 0) & raw.fixed)
        if len(on):
            text = f"port {port}: constrained degrees of freedom add nothing ({shorten_labels(labels, on)})"
            notes.append(Finding("port-on-constrained", "doubt", text, port))
    return notes


def _geometry(points: Points, raw: RawModel, kept: Integers, length: float) -> Geometry:
    new = np.full(raw.size, -1, dtype=np.int64)
    new[kept] = np.arange(len(kept))
    dofs = np.full((len(points.ids), len(FREEDOM_NAMES)), -1, dtype=np.int64)
    row = {node: k for k, node in enumerate(points.ids)}
    for i, node in enumerate(raw.nodes or ()):
        k = row.get(node)
        if k is not None and raw.directions[i] >= 0:
            dofs[k, raw.directions[i]] = new[i]
    return Geometry(points.positions * length, points.names, points.bodies, dofs, points.lines)


def factors(system: UnitSystem) -> tuple[float, float, float]:
    """L [m], m [kg], T [s]."""
    return (
        units.convert(1.0, system.length, "m"),
        units.convert(1.0, system.mass, "kg"),
        units.convert(1.0, system.time, "s"),
    )


def scale_matrix(matrix: sparse.csc_array, rotation: np.ndarray, length: float, factor: float) -> sparse.csc_array:
    """factor L2 D A D; `rotation` (N,) says which degrees of freedom are rotations."""
    if length == 1 and factor == 1:
        return matrix
    d = np.where(rotation, length, 1.0)
    entries = matrix.tocoo()
    values = entries.data * (factor * d[entries.row] * d[entries.col])
    return without_zeros(sparse.coo_array((values, (entries.row, entries.col)), shape=matrix.shape).tocsc())


def port_vector(vector: Floats, rotation: np.ndarray, length: float, *, angle: bool) -> Floats:
    """Coefficients in SI: of an angle (n_A) or of a displacement; (N,)."""
    d = np.where(rotation, length, 1.0)
    return vector * d / length if angle else vector * d
