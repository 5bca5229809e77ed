"""From matrices with ports in a program's units to an Assembly in SI."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from feedsim.errors import InputError
from feedsim.scenario.structure.matrices import FiniteElements, UnitSystem
from feedsim.structure.assembly import Assembly, Floats, Geometry, Integers
from feedsim.structure.checks.words import few
from feedsim.structure.matrices import units
from feedsim.structure.matrices.ports import read_ports
from feedsim.structure.matrices.raw import DIRECTIONS, Points, Raw
from feedsim.structure.modes import TOOL_PORTS


@dataclass(frozen=True, eq=False)
class Imported:
    """An imported model, and what a person should know of the import."""

    assembly: Assembly
    notes: tuple[str, ...]


def build(structure: FiniteElements, system: UnitSystem, raw: Raw, name: str) -> Imported:
    """The model without its constrained degrees of freedom, in SI.

    Raises:
        InputError: faulty ports; lengths in another unit than metres where nothing says which
            degrees of freedom are rotations; a model that is constrained altogether.
    """
    length, mass, time = units.factors(system)
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
        mass=units.scaled(raw.mass[kept][:, kept], rotation, length, mass),
        stiffness=units.scaled(raw.stiffness[kept][:, kept], rotation, length, mass / time**2),
        ports={
            port: units.port_vector(vector[kept], rotation, length, angle=port.startswith("n_"))
            for port, vector in vectors.items()
        },
        axes=structure.axes,
        labels=tuple(labels[i] for i in kept),
        geometry=_geometry(raw.points, raw, kept, length) if raw.points else None,
        pose=dict(structure.pose),
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
    dofs = np.full((len(points.ids), len(DIRECTIONS)), -1, dtype=np.int64)
    row = {node: k for k, node in enumerate(points.ids)}
    for i, node in enumerate(raw.nodes or ()):
        k = row.get(node)
        if k is not None and raw.directions[i] >= 0:
            dofs[k, raw.directions[i]] = new[i]
    return Geometry(points.positions * length, points.names, points.bodies, dofs, points.lines)
