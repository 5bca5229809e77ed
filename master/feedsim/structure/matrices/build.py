"""From matrices with ports in a program's units to an Assembly in SI.

A program that calculates in lengths of L [m], masses of m [kg] and times of T [s] has translations u_SI = L u and the
same rotations. Energies are m L2 / T2 times the program's, hence M_SI = m L2 D M D and K_SI = m L2 / T2 D K D with
D = 1/L for translations and 1 for rotations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from feedsim import units
from feedsim.errors import InputError
from feedsim.scenario.structure.matrices import (
    AnsysStructure,
    CalculixStructure,
    FiniteElements,
    MatrixMarketStructure,
    UnitSystem,
)
from feedsim.structure.assembly import Assembly, Floats, Geometry, Integers, few
from feedsim.structure.matrices import ansys, calculix, market
from feedsim.structure.matrices.raw import FREEDOM_NAMES, Points, Raw, without_zeros
from feedsim.structure.matrices.tables import read_ports
from feedsim.structure.modes import TOOL_PORTS


@dataclass(frozen=True, eq=False)
class Imported:
    """An imported model, and what a person should know of the import."""

    assembly: Assembly
    notes: tuple[str, ...]


def import_model(structure: FiniteElements) -> Imported:
    """The model of a structure file of kind matrices, ansys or calculix, and notes on the import.

    Raises:
        InputError: a file is not readable or the files contradict one another.
    """
    if isinstance(structure, MatrixMarketStructure):
        raw, file = market.read(structure), structure.stiffness
    elif isinstance(structure, AnsysStructure):
        raw, file = ansys.read(structure), structure.full
    elif isinstance(structure, CalculixStructure):
        raw, file = calculix.read(structure), structure.stiffness
    else:
        raise TypeError(f"no kind of finite-element model: {type(structure).__name__}")
    return build(structure, structure.units, raw, structure.name or str(file))


def build(structure: FiniteElements, system: UnitSystem, raw: Raw, name: str) -> Imported:
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
    notes = [*raw.notes, *_dropped(vectors, raw, labels)]
    assembly = Assembly(
        name=name,
        mass=scaled(raw.mass[kept][:, kept], rotation, length, mass),
        stiffness=scaled(raw.stiffness[kept][:, kept], rotation, length, mass / time**2),
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
    return Imported(assembly, tuple(notes))


def _dropped(vectors: dict[str, Floats], raw: Raw, labels: tuple[str, ...]) -> list[str]:
    """A stator on the ground moves nothing: right, but worth a word."""
    notes = []
    for port, vector in vectors.items():
        on = np.flatnonzero((vector != 0) & raw.fixed)
        if len(on):
            notes.append(f"port {port}: constrained degrees of freedom add nothing ({few(labels, on)})")
    return notes


def _geometry(points: Points, raw: Raw, kept: Integers, length: float) -> Geometry:
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


def scaled(matrix: sparse.csc_array, rotation: np.ndarray, length: float, factor: float) -> sparse.csc_array:
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
