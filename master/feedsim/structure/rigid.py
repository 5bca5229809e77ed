"""Rigid modes: separated from elastic ones, counted against the axes, made exact and given a definite basis."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from scipy import linalg

from feedsim.errors import InputError
from feedsim.structure.assembly import Assembly, Floats
from feedsim.structure.eigenpairs import Eigenpairs
from feedsim.structure.factor import not_definite
from feedsim.structure.moving import what_moves

# A mode is rigid where the strain energies of its degrees of freedom cancel to this part of their sum. In exact
# matrices rounding leaves 1e-16, in matrices written as text with 13 digits 1e-13; a mode at 20 Hz of a machine of
# beams has 1e-5, the first bending of a free rod of 300 elements 1e-9.
CANCELLED = 1e-12
# Whatever is slower than this [rad/s], a turn of seventeen minutes, is held by nothing: rounding of large models.
AT_REST = 2 * math.pi * 1e-3
# More than the axes have, and the six of a machine that is not held, is not worth looking at one by one.
MAX_RIGID_MOTIONS = 30
# An axis is blocked where this part or less of its rotor's motion is rigid (an inertia that many times the rotor's).
BLOCKED = 1e-9
# Two axes that turn together to this part are one.
TOGETHER = 1e-9
# The lowest mode worth naming for a blocked axis turns its rotor by this part of what the strongest one does.
NOTABLE = 0.1
SWEEPS = 3
MAX_NAMED_PARTS = 6


def rigid_count(assembly: Assembly, pairs: Eigenpairs) -> int:
    """How many of the lowest modes are rigid.

    Raises:
        InputError: a mode has negative stiffness.
    """
    shapes = pairs.shapes[:, : len(assembly.axes) + MAX_RIGID_MOTIONS]
    energy = np.einsum("ij,ij->j", shapes, assembly.stiffness @ shapes)
    parts = np.einsum("ij,ij->j", abs(shapes), abs(assembly.stiffness) @ abs(shapes))
    if np.any(energy < -CANCELLED * parts):
        raise not_definite(assembly)
    return int(np.count_nonzero((energy <= CANCELLED * parts) | (energy <= AT_REST**2)))


def check_count(assembly: Assembly, rigid: Floats, elastic: Floats, values: Floats) -> None:
    """Each axis moves freely, and nothing else does.

    Args:
        rigid, elastic: mass-normalised shapes (N, r), (N, e).
        values: (r + e,) eigenvalues of all of them as computed [rad2/s2].

    Raises:
        InputError: names what moves in each surplus mode, which axis is blocked, and the frequencies.
    """
    rotors = rotor_rows(assembly.ports, assembly.axes)
    problems = []
    turns = np.array([_turning(rotor, rigid, elastic) for rotor in rotors])
    blocked = [axis for axis, row in zip(assembly.axes, turns, strict=True) if row @ row <= BLOCKED]
    for axis in blocked:
        problems.append(f"axis {axis} cannot move freely: {_lowest(assembly, axis, elastic, values[rigid.shape[1] :])}")
    free = [axis for axis in assembly.axes if axis not in blocked]
    rows = np.array([row / np.linalg.norm(row) for row in turns if row @ row > BLOCKED])
    rows = rows.reshape(len(free), rigid.shape[1])
    _, sizes, directions = np.linalg.svd(rows)
    rank = int(np.count_nonzero(sizes > math.sqrt(TOGETHER)))
    if rank < len(free):
        problems.append(f"axes {', '.join(free)} do not move independently of one another: {rank} of {len(free)} do")
    surplus = rigid @ directions[rank:].T
    problems += [_surplus(assembly, surplus[:, [i]]) for i in range(min(MAX_NAMED_PARTS, surplus.shape[1]))]
    if problems:
        count, axes = rigid.shape[1], ", ".join(assembly.axes)
        headline = f"{assembly.name}: {count} rigid modes; one for each of the axes {axes} is needed"
        raise InputError("\n  ".join((headline, *problems)), problems)


def _turning(rotor: Floats, rigid: Floats, elastic: Floats) -> Floats:
    """(r,) motion of a rotor in the rigid modes, as parts of its motion in all modes."""
    all_of_it = np.linalg.norm(np.concatenate([rotor @ rigid, rotor @ elastic]))
    return np.asarray(rotor @ rigid / (all_of_it or 1.0))


def _surplus(assembly: Assembly, shape: Floats) -> str:
    value = (shape.T @ (assembly.stiffness @ shape)).item() / (shape.T @ (assembly.mass @ shape)).item()
    return (
        f"a surplus mode at {math.sqrt(abs(value)) / (2 * math.pi):.1g} Hz, in which no rotor turns; what moves: "
        f"{what_moves(assembly, shape)[0]}; nothing holds it"
    )


def _lowest(assembly: Assembly, axis: str, elastic: Floats, values: Floats) -> str:
    turns = abs(assembly.ports[f"n_{axis}"] @ elastic)
    if not turns.any():
        return "its rotor turns in no mode"
    mode = int(np.argmax(turns >= NOTABLE * turns.max()))
    frequency = math.sqrt(values[mode]) / (2 * math.pi)
    return (
        f"the lowest mode that turns its rotor is at {frequency:.6g} Hz; what moves: "
        f"{what_moves(assembly, elastic[:, [mode]])[0]}"
    )


def cleaned(assembly: Assembly, pairs: Eigenpairs, rigid: Floats, elastic: Floats, values: Floats) -> Floats:
    """The rigid shapes with their rest of strain removed: K phi is rounding, M-orthonormal.

    The strain that the computed elastic modes carry is removed in their coordinates, the strain of all higher modes
    by K + shift M, which for them is nearly K.
    """
    for _ in range(SWEEPS):
        forces = assembly.stiffness @ rigid
        coarse = elastic @ ((elastic.T @ forces) / values[:, None])
        rigid = rigid - coarse - pairs.factor.solve(forces - assembly.stiffness @ coarse)
    gram = linalg.cholesky(rigid.T @ (assembly.mass @ rigid), lower=True)
    return np.asarray(linalg.solve_triangular(gram, rigid.T, lower=True).T)


def definite_basis(shapes: Floats, rows: Floats) -> Floats:
    """The same space in a basis that depends on nothing but the space: motion of the rows is lower triangular.

    The first row moves in the first shape only (and there in positive direction), the second in the first two, ...
    Rows that add nothing are passed over; shapes that no row sees stay as they are.

    Args:
        shapes: (N, n) of equal eigenvalue, mass-normalised.
        rows: (p, N) such as port vectors.
    """
    rest = rows @ shapes
    sizes = np.linalg.norm(rest, axis=1)
    basis = np.empty((shapes.shape[1], 0))
    for row, size in zip(rest, sizes, strict=True):
        if basis.shape[1] == shapes.shape[1]:
            break
        new = row - basis @ (basis.T @ row)
        new -= basis @ (basis.T @ new)
        if np.linalg.norm(new) > 1e-6 * size:
            basis = np.column_stack([basis, new / np.linalg.norm(new)])
    if basis.shape[1] < shapes.shape[1]:
        basis = np.column_stack([basis, linalg.null_space(basis.T)]) if basis.shape[1] else np.eye(shapes.shape[1])
    return np.asarray(shapes @ basis)


def definite_signs(shapes: Floats, mass_diagonal: Floats) -> Floats:
    """Every shape turned so that its degree of freedom of largest kinetic energy moves in positive direction.

    Of several about as large the first counts, so that rounding cannot decide between symmetric ones.
    """
    moving = abs(shapes) * np.sqrt(np.maximum(mass_diagonal, 0))[:, None]
    first = np.argmax(moving >= (1 - 1e-3) * moving.max(axis=0), axis=0)
    return np.asarray(shapes * np.where(shapes[first, np.arange(shapes.shape[1])] < 0, -1.0, 1.0))


def rotor_rows(ports: Mapping[str, Floats], axes: tuple[str, ...]) -> Floats:
    """(A, N) port vectors of the rotors, in the order of the axes."""
    size = len(next(iter(ports.values())))
    return np.array([ports[f"n_{axis}"] for axis in axes]).reshape(len(axes), size)
