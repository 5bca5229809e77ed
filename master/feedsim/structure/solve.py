"""From a finite-element model to its modes up to a cut-off frequency."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.linalg import LinearOperator, cg, splu

from feedsim.foundation.errors import InputError
from feedsim.scenario.structure import Damping
from feedsim.structure.assembly import Assembly, Floats, Integers
from feedsim.structure.eigenpairs import MASSLESS, Eigenpairs, dense, lanczos, not_definite
from feedsim.structure.modes import TOOL_PORTS, Modes

# --- What moves in a mode: the share of its kinetic energy per body, and how the body moves, in words -----------------


AXIS_LETTERS = "XYZ"
# Bodies are named up to this number and down to this share.
MAX_NAMED_BODIES, WORTH_NAMING = 3, 0.1
# A body moves as one where a rigid motion explains this part of its kinetic energy. The half wave of a screw between
# its bearings, which is bending, comes to 8/pi^2 = 0.81.
AS_ONE = 0.85
# Of translation and rotation the lesser is named as well from this part of their energy on.
AS_WELL = 0.1
# A body turns about its own axis where its rotary inertia, not its width, holds this part of the rotation's energy.
OWN_INERTIA_SHARE = 0.5
# "bed B1[3] ux": the body is what stands before the index or the direction.
LABEL = re.compile(r"(\[[^]]*\])?(\s+[ur][xyz])?\s*$")


@dataclass(frozen=True)
class Share:
    """A body's part in a mode: share of the kinetic energy [1], and words such as "rocking about X" (or none)."""

    body: str
    energy: float
    words: str


@dataclass(frozen=True)
class Motion:
    """The bodies of a mode, the largest share first."""

    shares: tuple[Share, ...]

    def __str__(self) -> str:
        """Such as "bed 71 % (rocking about X), column 20 % (moving along Z)"."""
        named = [share for share in self.shares[:MAX_NAMED_BODIES] if share.energy >= WORTH_NAMING] or self.shares[:1]
        return ", ".join(
            f"{share.body} {100 * share.energy:.0f} %" + (f" ({share.words})" if share.words else "") for share in named
        )


@dataclass(frozen=True, eq=False)
class _Body:
    """Degrees of freedom of a body (n,), their directions 0..5 or -1, their node's position (n, 3) [m] where known."""

    name: str
    dofs: Integers
    directions: Integers
    positions: Floats | None


def what_moves(assembly: Assembly, shapes: Floats) -> tuple[Motion, ...]:
    """One motion per column of shapes (N, n).

    Bodies are those of the geometry; where none is known, groups of labels ("bed B1" of "bed B1[3] ux").
    """
    energy = shapes * (assembly.mass @ shapes)
    total = energy.sum(axis=0)
    energy = energy / np.where(total > 0, total, 1)
    weights = assembly.mass.diagonal()
    bodies = _bodies(assembly)
    shares = np.array([energy[body.dofs].sum(axis=0) for body in bodies])
    words = [_words(body, weights[body.dofs], shapes[body.dofs]) for body in bodies]
    motions = []
    for mode in range(shapes.shape[1]):
        order = np.argsort(-shares[:, mode], kind="stable")
        motions.append(
            Motion(tuple(Share(bodies[i].name, float(shares[i, mode]), words[i][mode]) for i in order.tolist()))
        )
    return tuple(motions)


def _bodies(assembly: Assembly) -> list[_Body]:
    size = len(assembly.labels)
    names: list[str] = [""] * size
    directions = np.full(size, -1, dtype=np.int64)
    positions = None
    geometry = assembly.geometry
    if geometry is not None:
        positions = np.full((size, 3), np.nan)
        node, direction = np.nonzero(geometry.dofs >= 0)
        dofs = geometry.dofs[node, direction]
        directions[dofs] = direction
        positions[dofs] = geometry.nodes[node]
        for dof, of in zip(dofs.tolist(), node.tolist(), strict=True):
            names[dof] = geometry.bodies[of]
    for dof, name in enumerate(names):
        names[dof] = name or LABEL.sub("", assembly.labels[dof]) or assembly.labels[dof]
    members: dict[str, list[int]] = {}
    for dof, name in enumerate(names):
        members.setdefault(name, []).append(dof)
    bodies = []
    for name, dofs_of in members.items():
        index = np.array(dofs_of, dtype=np.int64)
        where = None if positions is None or np.isnan(positions[index]).any() else positions[index]
        bodies.append(_Body(name, index, directions[index], where))
    return bodies


def _words(body: _Body, weights: Floats, shapes: Floats) -> list[str]:
    """How a body moves in each of the modes (n dofs of the body, modes)."""
    if body.positions is None or not np.any(weights > 0):
        return [""] * shapes.shape[1]
    arms, rigid = _rigid_motions(body, weights)
    weighted = rigid.T * weights
    gram = weighted @ rigid
    # A rotor has no translations, a mass point no rotations: the least motion that explains the shape.
    motion = np.linalg.pinv(gram, rcond=1e-10, hermitian=True) @ (weighted @ shapes)
    parts = motion * (gram @ motion)
    whole = np.einsum("i,ij->j", weights, shapes**2)
    by_direction = np.array([weights[body.directions == d] @ shapes[body.directions == d] ** 2 for d in range(6)])
    words = []
    for mode in range(shapes.shape[1]):
        energy = parts[:, mode]
        if energy.sum() < AS_ONE * whole[mode]:
            strongest = int(np.argmax(by_direction[:, mode]))
            how = "deforming along" if strongest < 3 else "twisting about"
            words.append(f"{how} {AXIS_LETTERS[strongest % 3]}")
            continue
        spin = float(weights[body.directions >= 3].sum() * (motion[3:, mode] @ motion[3:, mode]))
        turning = "turning" if spin > OWN_INERTIA_SHARE * energy[3:].sum() else "rocking"
        named = [
            f"moving along {_strongest_direction(energy[:3])}",
            f"{turning} about {_strongest_direction(energy[3:])}",
        ]
        shares = [energy[:3].sum() / energy.sum(), energy[3:].sum() / energy.sum()]
        if _turns(energy, motion[:3, mode], np.cross(motion[3:, mode], arms)):
            named, shares = named[::-1], shares[::-1]
        words.append(" and ".join(named if shares[1] >= AS_WELL else named[:1]))
    return words


def _strongest_direction(energy: Floats) -> str:
    return AXIS_LETTERS[int(np.argmax(energy))]


def _turns(parts: Floats, translation: Floats, by_rotation: Floats) -> bool:
    """Whether a body's rigid motion is a rotation: the axis it turns about passes within the body's reach.

    Then some of its points move further by the rotation than its centre of mass moves.
    """
    reach = float(np.max(np.linalg.norm(by_rotation, axis=1)))
    return reach > float(np.linalg.norm(translation)) or bool(parts[3:].sum() > parts[:3].sum())


def _rigid_motions(body: _Body, weights: Floats) -> tuple[Floats, Floats]:
    """Arms (n, 3) from the centre of mass to the nodes of the degrees of freedom; their rigid motions (n, 6)."""
    assert body.positions is not None
    along = np.where(body.directions < 3, weights, 0.0)
    if not along.any():
        along = np.ones_like(weights)
    arms = body.positions - along @ body.positions / along.sum()
    rigid = np.zeros((len(weights), 6))
    for d in range(3):
        moves, turns = body.directions == d, body.directions == 3 + d
        rigid[moves, d] = 1
        rigid[turns, 3 + d] = 1
        # u = t + w x r
        rigid[moves, 3 + (d + 1) % 3] = arms[moves, (d + 2) % 3]
        rigid[moves, 3 + (d + 2) % 3] = -arms[moves, (d + 1) % 3]
    return arms, rigid


# --- Rigid modes: separated from elastic ones, counted against the axes, made exact and given a definite basis --------


# A mode is rigid where the strain energies of its degrees of freedom cancel to this part of their sum. In exact
# matrices rounding leaves 1e-16, in matrices written as text with 13 digits 1e-13; a mode at 20 Hz of a machine of
# beams has 1e-5, the first bending of a free rod of 300 elements 1e-9.
RIGID_ENERGY_TOLERANCE = 1e-12
# Whatever is slower than this [rad/s], a turn of seventeen minutes, is held by nothing: rounding of large models.
AT_REST = 2 * math.pi * 1e-3
# More than the axes have, and the six of a machine that is not held, is not worth looking at one by one.
MAX_RIGID_MOTIONS = 30
# An axis is blocked where this part or less of its rotor's motion is rigid (an inertia that many times the rotor's).
BLOCKED_MOTION_SHARE = 1e-9
# Two axes that turn together to this part are one.
COUPLED_MOTION_SHARE = 1e-9
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
    if np.any(energy < -RIGID_ENERGY_TOLERANCE * parts):
        raise not_definite(assembly)
    return int(np.count_nonzero((energy <= RIGID_ENERGY_TOLERANCE * parts) | (energy <= AT_REST**2)))


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
    turns = np.array([_rigid_rotor_motion(rotor, rigid, elastic) for rotor in rotors])
    blocked = [axis for axis, row in zip(assembly.axes, turns, strict=True) if row @ row <= BLOCKED_MOTION_SHARE]
    for axis in blocked:
        problems.append(
            f"axis {axis} cannot move freely: "
            f"{_describe_lowest_mode(assembly, axis, elastic, values[rigid.shape[1] :])}"
        )
    free = [axis for axis in assembly.axes if axis not in blocked]
    rows = np.array([row / np.linalg.norm(row) for row in turns if row @ row > BLOCKED_MOTION_SHARE])
    rows = rows.reshape(len(free), rigid.shape[1])
    _, sizes, directions = np.linalg.svd(rows)
    rank = int(np.count_nonzero(sizes > math.sqrt(COUPLED_MOTION_SHARE)))
    if rank < len(free):
        problems.append(f"axes {', '.join(free)} do not move independently of one another: {rank} of {len(free)} do")
    surplus = rigid @ directions[rank:].T
    problems += [_surplus(assembly, surplus[:, [i]]) for i in range(min(MAX_NAMED_PARTS, surplus.shape[1]))]
    if problems:
        count, axes = rigid.shape[1], ", ".join(assembly.axes)
        headline = f"{assembly.name}: {count} rigid modes; one for each of the axes {axes} is needed"
        raise InputError("\n  ".join((headline, *problems)), problems)


def _rigid_rotor_motion(rotor: Floats, rigid: Floats, elastic: Floats) -> Floats:
    """(r,) motion of a rotor in the rigid modes, as parts of its motion in all modes."""
    all_of_it = np.linalg.norm(np.concatenate([rotor @ rigid, rotor @ elastic]))
    return np.asarray(rotor @ rigid / (all_of_it or 1.0))


def _surplus(assembly: Assembly, shape: Floats) -> str:
    value = (shape.T @ (assembly.stiffness @ shape)).item() / (shape.T @ (assembly.mass @ shape)).item()
    return (
        f"a surplus mode at {math.sqrt(abs(value)) / (2 * math.pi):.1g} Hz, in which no rotor turns; what moves: "
        f"{what_moves(assembly, shape)[0]}; nothing holds it"
    )


def _describe_lowest_mode(assembly: Assembly, axis: str, elastic: Floats, values: Floats) -> str:
    turns = abs(assembly.ports[f"n_{axis}"] @ elastic)
    if not turns.any():
        return "its rotor turns in no mode"
    mode = int(np.argmax(turns >= NOTABLE * turns.max()))
    frequency = math.sqrt(values[mode]) / (2 * math.pi)
    return (
        f"the lowest mode that turns its rotor is at {frequency:.6g} Hz; what moves: "
        f"{what_moves(assembly, elastic[:, [mode]])[0]}"
    )


def remove_strain(assembly: Assembly, pairs: Eigenpairs, rigid: Floats, elastic: Floats, values: Floats) -> Floats:
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


# Full matrices up to here: 800 degrees of freedom take a second. Beyond, the sparse way is faster by far.
DENSE = 800
# All modes of a model, without a cut-off, are full matrices in any case: 5000 degrees of freedom take minutes and 2 GB.
FULL = 5000
# The shift stands this far below zero: rigid modes do no harm, and the factorisation keeps its digits.
SHIFT = 0.1
# Without a finite cut-off [rad/s]: 1000 Hz, in whose range machine tools have their modes.
DEFAULT_CUTOFF = 2 * math.pi * 1000
# Eigenvalues closer than this, relative, are one multiple eigenvalue: rounding would choose the shapes.
EQUAL = 1e-9
CG_TOLERANCE = 1e-10
# The iteration for pseudo-modes shrinks its error by shift/(lambda + shift) < 1/101 a step for every dropped mode.
CORRECTION_STEPS = 8
# Directions that hold less than this part of the residual energy of a port are combinations of the others. They
# could change its static compliance by that part at most.
DEPENDENT = 1e-11


@dataclass(frozen=True, eq=False)
class Solution:
    """Modes of a model, and what was left out.

    Attributes:
        modes: the mode table: rigid modes first, elastic ones by frequency, pseudo-modes last.
        shapes: (N, n_modes) mass-normalised physical shapes, columns as in the table.
        moving: what moves, per mode; empty where it was not asked for.
        corrections: number of pseudo-modes of the static correction: the last columns; 0 without it.
        cutoff: [rad/s].
        above: (m,) known frequencies above the cut-off, ascending [Hz]; the next few of a large model.
        dropped: number of modes of the model above the cut-off.
        J_inf_full: axis -> 1 / sum of n^2 over all modes of the model [kg.m2]; modes.J_inf has it over the kept ones
            (and pseudo-modes). 0 where the rotor has no mass.
        method: "dense" or "Lanczos".
        verification: how it is known that no mode up to the cut-off is missing; begins with NOT where it is not.
        seconds: wall time.
    """

    modes: Modes
    shapes: Floats
    moving: tuple[Motion, ...]
    corrections: int
    cutoff: float
    above: Floats
    dropped: int
    J_inf_full: Mapping[str, float]
    method: str
    verification: str
    seconds: float


def solve(
    assembly: Assembly,
    *,
    cutoff: float,
    damping: Damping,
    static_correction: bool = False,
    progress: Callable[[str], None] | None = None,
    dense_limit: int = DENSE,
    described: bool = True,
) -> Solution:
    """Modes up to the cut-off [rad/s]; all of them with math.inf, which gives the full model (small models only).

    Models up to `dense_limit` degrees of freedom are solved with full matrices, larger ones by shift-invert Lanczos,
    with the number of modes up to the cut-off known and verified from a Sturm sequence.

    Rigid modes have frequency and damping exactly 0 and no strain but rounding; their basis is the one in which the
    first axis's rotor turns in the first mode only, the second's in the first two, and so on.

    Static correction appends pseudo-modes (:func:`pseudo_modes`) for the torques and tool forces: displacements
    under them are then exact at rest, and better towards the cut-off. They take part in J_inf like modes: it falls
    towards the full model's, and with it the coupling limit 2 J_inf/h.

    `described`: whether the solution is to say what moves in its modes.

    Raises:
        InputError: rigid modes that are not those of the axes; negative stiffness; a model too large without cut-off.
        FeedsimError: a large model's modes could not be computed completely.
    """
    began = time.monotonic()
    say = progress or (lambda _: None)
    _check_ports(assembly)
    size = assembly.mass.shape[0]
    shift = (SHIFT * (cutoff if math.isfinite(cutoff) else DEFAULT_CUTOFF)) ** 2
    if not math.isfinite(cutoff) and size > FULL:
        raise InputError(
            f"{assembly.name}: all modes of {size} degrees of freedom are wanted; without a cut-off frequency at most "
            f"{FULL} degrees of freedom are allowed"
        )
    if size <= dense_limit or not math.isfinite(cutoff):
        say(f"eigenproblem of {size} degrees of freedom, full matrices")
        pairs = dense(assembly, shift)
    else:
        pairs = lanczos(assembly, cutoff, shift, say)
    rigid = rigid_count(assembly, pairs)
    say(f"{rigid} rigid modes")
    values, shapes = _definite(assembly, pairs, rigid)
    kept = int(np.count_nonzero(values <= cutoff**2))
    above = np.sqrt(values[kept:]) / (2 * math.pi)
    values, shapes = values[:kept], shapes[:, :kept]
    corrections = 0
    if static_correction:
        loads = np.column_stack([assembly.ports[port] for port in _input_ports(assembly)])
        more, pseudo = pseudo_modes(assembly, pairs, shapes, loads)
        corrections = len(more)
        say(f"static correction: {corrections} pseudo-modes")
        pseudo = definite_signs(pseudo, assembly.mass.diagonal())
        values, shapes = np.concatenate([values, more]), np.hstack([shapes, pseudo])
    return Solution(
        modes=_table(assembly, damping, values, shapes),
        shapes=shapes,
        moving=what_moves(assembly, shapes) if described else (),
        corrections=corrections,
        cutoff=cutoff,
        above=above,
        dropped=pairs.finite - kept,
        J_inf_full={axis: _sudden_inertia(assembly, assembly.ports[f"n_{axis}"]) for axis in assembly.axes},
        method=pairs.method,
        verification=pairs.verification,
        seconds=time.monotonic() - began,
    )


def damping_ratio(damping: Damping, omega: float) -> float:
    """Damping ratio of an elastic mode of frequency omega [rad/s]."""
    steps = [step for step in damping.steps if omega < step.below]
    return min(steps, key=lambda step: step.below).ratio if steps else damping.ratio


def _input_ports(assembly: Assembly) -> list[str]:
    return [f"n_{axis}" for axis in assembly.axes] + list(TOOL_PORTS)


def _check_ports(assembly: Assembly) -> None:
    needed = [*_input_ports(assembly), *(f"x_{axis}" for axis in assembly.axes)]
    missing = [port for port in needed if port not in assembly.ports]
    if missing:
        raise InputError(f"{assembly.name}: no port vector for {', '.join(missing)}")


def _definite(assembly: Assembly, pairs: Eigenpairs, rigid: int) -> tuple[Floats, Floats]:
    """Eigenpairs with exact rigid modes, and shapes that rounding does not choose."""
    elastic, values = pairs.shapes[:, rigid:], pairs.values[rigid:]
    free = pairs.shapes[:, :rigid]
    check_count(assembly, free, elastic, pairs.values)
    free = remove_strain(assembly, pairs, free, elastic, values)
    free = definite_basis(free, rotor_rows(assembly.ports, assembly.axes))
    elastic = elastic - free @ ((assembly.mass @ free).T @ elastic)
    rows = np.array([assembly.ports[port] for port in sorted(assembly.ports)])
    elastic = definite_signs(elastic, assembly.mass.diagonal())
    for first, last in _multiple(values):
        elastic[:, first:last] = definite_basis(elastic[:, first:last], rows)
    return np.concatenate([np.zeros(rigid), values]), np.hstack([free, elastic])


def _multiple(values: Floats) -> list[tuple[int, int]]:
    """Ranges [first, last) of eigenvalues that are equal to rounding."""
    borders = np.flatnonzero(np.diff(values) > EQUAL * values[1:]) + 1
    edges = [0, *borders.tolist(), len(values)]
    return [(a, b) for a, b in pairwise(edges) if b - a > 1]


def _table(assembly: Assembly, damping: Damping, values: Floats, shapes: Floats) -> Modes:
    omega = np.sqrt(values)
    ratios = np.array([damping_ratio(damping, w) if w > 0 else 0.0 for w in omega.tolist()])
    ports = [f"{quantity}_{axis}" for quantity in ("n", "x") for axis in assembly.axes] + list(TOOL_PORTS)
    columns = {port: np.asarray(assembly.ports[port] @ shapes) for port in ports}
    return Modes(Path(assembly.name), omega / (2 * math.pi), ratios, columns)


def _sudden_inertia(assembly: Assembly, port: Floats) -> float:
    """1 / (b^T M^-1 b), which is 1 / sum of (phi^T b)^2 over all modes; 0 where the force acts on no mass."""
    diagonal = assembly.mass.diagonal()
    heavy = diagonal > 0
    if not heavy.all() and port[~heavy].any():
        # The parts without mass follow at once and hand the force on to those that have some.
        light = np.flatnonzero(~heavy)
        stiffness = sparse.csc_array(assembly.stiffness[:, light])
        port = port - stiffness @ splu(sparse.csc_array(stiffness[light, :])).solve(port[light])
        if not np.any(abs(port[heavy]) > 0):
            return 0.0
    index = np.flatnonzero(heavy)
    mass = sparse.csc_array(assembly.mass[:, index])[index, :]
    scale = 1 / np.sqrt(diagonal[heavy])
    scaled = LinearOperator(mass.shape, matvec=lambda v: scale * (mass @ (scale * np.ravel(v))), dtype=np.float64)
    force = scale * port[heavy]
    answer, failed = cg(scaled, force, rtol=CG_TOLERANCE, atol=0.0, maxiter=10 * len(force))
    mobility = float(force @ answer)
    return math.nan if failed or mobility <= 0 else 1 / mobility


def pseudo_modes(assembly: Assembly, pairs: Eigenpairs, kept: Floats, loads: Floats) -> tuple[Floats, Floats]:
    """Values (m,) [rad2/s2] and mass-normalised shapes (N, m) of pseudo-modes, m <= number of loads.

    For each load b the residual attachment mode is what the dropped modes do under it at rest,
    psi = sum over the dropped modes of phi (phi^T b)/lambda (R. R. Craig, A. J. Kurdila, Fundamentals of Structural
    Dynamics, 2006, sec. 17.3). It is orthogonal to all kept modes in M and K. The eigenproblem in the space of all
    psi gives pseudo-modes that join the table like modes: with them the static displacement under each of the loads
    is exact in every degree of freedom. Their frequencies lie above the first dropped mode's and are no frequencies
    of the machine.

    Args:
        kept: (N, n) mass-normalised shapes of all kept modes, the rigid ones included.
        loads: (N, p) port vectors that forces act along.
    """
    mass_kept = assembly.mass @ kept

    def dropped_part(shapes: Floats) -> Floats:
        return np.asarray(shapes - kept @ (mass_kept.T @ shapes))

    target = loads - mass_kept @ (kept.T @ loads)
    shapes = np.zeros_like(loads)
    # K alone is singular (rigid modes); K + shift M is factorised already and in the space of the dropped modes near K.
    for _ in range(CORRECTION_STEPS):
        shapes = dropped_part(shapes + pairs.factor.solve(target - assembly.stiffness @ shapes))
    energy = np.einsum("ij,ij->j", shapes, assembly.stiffness @ shapes)
    # A port that the kept modes describe in full, or to rounding, has nothing to correct.
    whole = np.einsum("ij,ij->j", loads, pairs.factor.solve(loads))
    shapes = shapes[:, energy > DEPENDENT * whole] / np.sqrt(energy[energy > DEPENDENT * whole])
    if not shapes.shape[1]:
        return np.empty(0), np.empty((len(loads), 0))
    part, rotation = linalg.eigh(shapes.T @ (assembly.stiffness @ shapes))
    independent = part > DEPENDENT * part[-1]
    shapes = dropped_part(shapes @ (rotation[:, independent] / np.sqrt(part[independent])))
    stiffness, mass = shapes.T @ (assembly.stiffness @ shapes), shapes.T @ (assembly.mass @ shapes)
    theta, rotation = linalg.eigh(mass, stiffness)
    heavy = theta > MASSLESS / pairs.shift  # without mass it could not be written as a mode
    values, shapes = 1 / theta[heavy][::-1], (shapes @ (rotation[:, heavy] / np.sqrt(theta[heavy])))[:, ::-1]
    return np.asarray(values), np.asarray(shapes)
