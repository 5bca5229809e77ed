"""Static correction: what the dropped modes yield under a slow force, as a few pseudo-modes."""

from __future__ import annotations

import numpy as np
from scipy import linalg

from feedsim.structure.assembly import Assembly, Floats
from feedsim.structure.eigenpairs import MASSLESS, Eigenpairs

# The iteration below shrinks its error by shift/(lambda + shift) < 1/101 a step for every dropped mode.
STEPS = 8
# Directions that hold less than this part of the residual energy of a port are combinations of the others. They
# could change its static compliance by that part at most.
DEPENDENT = 1e-11


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
    for _ in range(STEPS):
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
