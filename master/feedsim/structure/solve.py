"""From a finite-element model to its modes up to a cut-off frequency."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.linalg import LinearOperator, cg, splu

from feedsim.errors import InputError
from feedsim.scenario.structure import Damping
from feedsim.structure.assembly import Assembly, Floats
from feedsim.structure.eigenpairs import MASSLESS, Eigenpairs, dense, lanczos
from feedsim.structure.modes import TOOL_PORTS, Modes
from feedsim.structure.moving import Motion, what_moves
from feedsim.structure.rigid import check_count, cleaned, definite_basis, definite_signs, rigid_count, rotor_rows

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
    free = cleaned(assembly, pairs, free, elastic, values)
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
