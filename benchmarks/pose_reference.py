"""A machine whose springs change as an axis travels, with all its modes: the measure of a plant that follows the pose.

    M u'' + D(p) u' + K(p) u = sum over the axes of n_A (M_a - M_fr),   x_a = x_0 + x_A(p)^T u

p is a given function of time. K is renewed where p passes one of many given positions, each time with all modes of the
new pose and exact steps in between, so that nothing is truncated and the number of positions is the only approximation.
Eigenproblem and steps are written here, not taken from feedsim: the matrices alone are.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, eigh, solve_triangular

from feedsim.scenario.structure import GeometryStructure
from feedsim.structure.geometry.assemble import Assembler

Floats = NDArray[np.float64]
DIRECTIONS = ("X", "Y", "Z")


class Modes:
    """All modes of one pose."""

    def __init__(self, assembly, root_inverse: Floats, damping) -> None:  # type: ignore[no-untyped-def]
        squared, vectors = eigh(root_inverse @ assembly.stiffness.toarray() @ root_inverse.T)
        rigid = len(assembly.axes)
        self.phi = root_inverse.T @ vectors
        self.omega = np.sqrt(np.maximum(squared, 0.0))
        self.omega[:rigid] = 0.0
        self.zeta = np.array([ratio(damping, omega) if omega > 0 else 0.0 for omega in self.omega])

    def steps(self, h: float) -> tuple[Floats, ...]:
        """Coefficients of an exact step, inputs linear over h: (q q, q v, q f, q df, v q, v v, v f, v df)."""
        omega, zeta = self.omega, self.zeta
        one = np.ones_like(omega)
        rigid = omega == 0
        x = np.where(rigid, 1.0, omega * h)
        y = x * np.sqrt(1 - zeta**2)
        decay = np.exp(-zeta * x)
        once = np.where(rigid, 1.0, decay * np.sin(y) / y)
        rate = np.where(rigid, 1.0, decay * np.cos(y) - zeta * x * once)
        hold = np.where(rigid, 1.0, decay * np.cos(y) + zeta * x * once)
        twice = np.where(rigid, 0.5, (1 - hold) / x**2)
        thrice = np.where(rigid, 1 / 6, (1 - once - 2 * zeta * x * twice) / x**2)
        return (
            hold * one, h * once, h * h * twice, h * h * thrice,
            np.where(rigid, 0.0, -omega * x * once), rate, h * once, h * twice,
        )  # fmt: skip


def ratio(damping, omega: float) -> float:  # type: ignore[no-untyped-def]
    """Damping ratio at a frequency [rad/s], by the structure file's rule."""
    steps = [step for step in damping.steps if omega < step.below]
    return min(steps, key=lambda step: step.below).ratio if steps else damping.ratio


def run(
    structure: GeometryStructure,
    pose: dict[str, float],
    axis: str,
    position: Floats,
    torque: Floats,
    h: float,
    edges: Floats,
) -> dict[str, Floats]:
    """Response to torques (axes, K) [N.m], linear between the K instants, with `axis` at position (K,) [m].

    edges: (n + 1,) positions [m] between which K(p) is that of the middle; position must not go back over any.
    Ports are linear between the edges. Returns x_A less its start, tool_X, tool_Y, tool_Z [m], n_A [rad/s], each (K,).
    """
    assembler = Assembler(structure)
    low, high = structure.axes[axis].travel

    def at(p: float):  # type: ignore[no-untyped-def]
        return assembler.at({**pose, axis: float(min(max(p, low), high))})

    mass = at(position[0]).mass.toarray()
    root = cholesky(mass, lower=True)
    root_inverse = solve_triangular(root, np.eye(len(mass)), lower=True)
    names = list(structure.axes)
    moving = [f"x_{name}" for name in names] + [f"tcp_{d}" for d in DIRECTIONS]
    cell = np.searchsorted(edges[1:-1], np.maximum.accumulate(position))
    found = np.zeros((len(moving) + len(names), len(position)))
    q = v = before = None
    for i in range(int(cell[0]), int(cell[-1]) + 1):
        assembly = at((edges[i] + edges[i + 1]) / 2)
        modes = Modes(assembly, root_inverse, structure.damping)
        if before is None:
            q, v = np.zeros(len(mass)), np.zeros(len(mass))
        else:
            transfer = modes.phi.T @ mass @ before
            q, v = transfer @ q, transfer @ v
        before = modes.phi
        qq, qv, qf, qd, vq, vv, vf, vd = modes.steps(h)
        rotors = np.array([assembly.ports[f"n_{name}"] for name in names]) @ modes.phi
        ends = [np.array([at(edge).ports[port] for port in moving]) @ modes.phi for edge in edges[i : i + 2]]
        inside = np.flatnonzero(cell == i)
        for k in inside[inside > 0]:
            f, end = torque[:, k - 1] @ rotors, torque[:, k] @ rotors
            q, v = qq * q + qv * v + qf * f + qd * (end - f), vq * q + vv * v + vf * f + vd * (end - f)
            w = (position[k] - edges[i]) / (edges[i + 1] - edges[i])
            found[: len(moving), k] = (1 - w) * (ends[0] @ q) + w * (ends[1] @ q)
            found[len(moving) :, k] = rotors @ v
    keys = [*(f"x_{name}" for name in names), *(f"tool_{d}" for d in DIRECTIONS), *(f"n_{name}" for name in names)]
    return dict(zip(keys, found, strict=True))
