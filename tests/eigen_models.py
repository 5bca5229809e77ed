"""Models whose modes are known in closed form, and the default machine's matrices, for the tests of the eigensolver."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.io import mmread
from scipy.sparse import block_diag, csc_array, diags_array, eye_array, kron

from feedsim.scenario.structure import Damping
from feedsim.structure.assembly import Assembly
from feedsim.structure.eigenpairs import SparseFactor
from feedsim.structure.solve import Solution

Floats = NDArray[np.float64]
DATA = Path(__file__).resolve().parent / "structure" / "data" / "test_centre"
MATRICES = Path(__file__).resolve().parents[1] / "scenarios" / "structures" / "matrix_market"
TWO_PERCENT = Damping(ratio=0.02)
# As in the default machine's structure file.
DEFAULT_DAMPING = Damping.model_validate({"ratio": 0.02, "steps": [{"below": "30 Hz", "ratio": "6 %"}]})
TOOL = ("tcp_X", "tcp_Y", "tcp_Z")


@cache
def given() -> Assembly:
    """The default machine's matrices as another program made them, without geometry."""
    mass, stiffness = (csc_array(mmread(MATRICES / f"{name}.mtx")) for name in ("mass", "stiffness"))
    size = mass.shape[0]
    ports: dict[str, Floats] = {}
    with (DATA / "port_vectors.csv").open(encoding="utf-8", newline="") as stream:
        for row in csv.DictReader(stream):
            ports.setdefault(row["port"], np.zeros(size))[int(row["dof"])] = float(row["coefficient"])
    labels = tuple(f"dof {i}" for i in range(size))
    return Assembly("given", mass, stiffness, ports, ("X", "Y", "Z"), labels, None, {})


def chain(
    masses: Floats, springs: Floats, *, first: str = "rotor ux", consistent: float = 0.0, name: str = "chain"
) -> Assembly:
    """Free masses in a row (N,), springs (N-1,) between them: one axis, moved as a whole.

    consistent: mass of each element that is spread over its two ends as by linear shape functions.
    """
    size = len(masses)
    pull = diags_array([-np.ones(size - 1), np.ones(size - 1)], offsets=[0, 1], shape=(size - 1, size))
    mean = abs(pull)
    # m/6 [[2, 1], [1, 2]] = m/6 (I + [[1, 1], [1, 1]])
    spread = consistent / 6 * (diags_array(mean.sum(axis=0)) + mean.T @ mean)
    ends = np.eye(size)[[0, -1]]
    ports = {"n_X": ends[0], "x_X": ends[1]} | {port: ends[1] for port in TOOL}
    labels = (first, *(f"slide[{i}] ux" for i in range(1, size)))
    mass = csc_array(diags_array(masses) + spread)
    return Assembly(name, mass, csc_array(pull.T @ diags_array(springs) @ pull), ports, ("X",), labels, None, {})


LEAD = 0.02 / (2 * np.pi)


def drives(*, nut: Mapping[str, float], held: float) -> Assembly:
    """Three axes of a rotor and a slide each, joined by the spring of the nut [N/m]; `held`: a mass on a spring."""
    axes = tuple(nut)
    stiffness = np.zeros((2 * len(axes) + 1,) * 2)
    ports: dict[str, Floats] = {}
    unit = np.eye(len(stiffness))
    for i, (axis, k) in enumerate(nut.items()):
        stretch = unit[2 * i + 1] - LEAD * unit[2 * i]
        stiffness += k * np.outer(stretch, stretch)
        ports[f"n_{axis}"], ports[f"x_{axis}"] = unit[2 * i], unit[2 * i + 1] - unit[-1]
    ports |= {port: unit[1] - unit[-1] for port in TOOL}
    stiffness[-1, -1] = held
    mass = np.array([0.01, 300.0] * len(axes) + [2000.0])
    labels = (*(f"{what} {axis}" for axis in axes for what in ("rotor", "slide")), "bed")
    return Assembly("drives", csc_array(np.diag(mass)), csc_array(stiffness), ports, axes, labels, None, {})


def lattice(side: int, spring: float, ground: float, mass: float) -> tuple[Assembly, Floats]:
    """A cube of masses joined by springs, each held by one to the ground, beside the three drives; its eigenvalues.

    A scalar unknown per mass, so that the eigenvalues are sums of those of three rows, each 4 k/m sin^2(i pi/2n):
    most of them three- and sixfold.
    """
    row = diags_array([1.0, *[2.0] * (side - 2), 1.0]) - diags_array([np.ones(side - 1)] * 2, offsets=[-1, 1])
    one = eye_array(side)
    cube = kron(kron(row, one), one) + kron(kron(one, row), one) + kron(kron(one, one), row)
    base = drives(nut={"X": 1e8, "Y": 1.3e8, "Z": 1.7e8}, held=1e7)
    size = side**3
    single = 4 * np.sin(np.arange(side) * np.pi / (2 * side)) ** 2
    sums = single[:, None, None] + single[:, None] + single
    values = (spring * sums.ravel() + ground) / mass
    k = csc_array(block_diag([base.stiffness, spring * cube + ground * eye_array(size)]))
    m = csc_array(block_diag([base.mass, mass * eye_array(size)]))
    ports = {port: np.concatenate([vector, np.zeros(size)]) for port, vector in base.ports.items()}
    corner = len(base.labels)
    ports["tcp_X"][corner] = -1.0
    ports["tcp_Y"][corner + 1] = -1.0
    labels = (*base.labels, *(f"cube[{i}]" for i in range(size)))
    assembly = Assembly("lattice", m, k, ports, base.axes, labels, None, {})
    drive_values = np.linalg.eigvals(np.linalg.solve(base.mass.toarray(), base.stiffness.toarray())).real
    return assembly, np.sort(np.concatenate([drive_values, values]))


def stiffened(assembly: Assembly, spring: float, along: Floats) -> Assembly:
    """The model with one more spring, stretched by along^T u."""
    vector = csc_array(along[:, None])
    return replace(assembly, stiffness=csc_array(assembly.stiffness + spring * (vector @ vector.T)))


def error_bounds(assembly: Assembly, found: Solution) -> Floats:
    """(n,) bound on the relative error of lambda + shift of each mode, pseudo-modes aside.

    With B = K + shift M and r = K phi - lambda M phi an exact eigenvalue lambda* has
    |1 - (lambda + shift)/(lambda* + shift)| <= |r|_B^-1 / |phi|_B (B. N. Parlett, The Symmetric Eigenvalue Problem,
    1998, sec. 15.9).
    """
    kept, shift = len(found.modes.frequency) - found.corrections, (200 * math.pi) ** 2
    values, shapes = (2 * math.pi * found.modes.frequency[:kept]) ** 2, found.shapes[:, :kept]
    residual = assembly.stiffness @ shapes - (assembly.mass @ shapes) * values
    square = np.einsum("ij,ij->j", residual, SparseFactor(assembly, -shift).solve(residual))
    return np.asarray(np.sqrt(np.maximum(square, 0) / (values + shift)))
