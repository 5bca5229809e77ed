"""Plant unit's reference: the whole modal state space in one matrix exponential, inputs linear between their knots."""

from __future__ import annotations

import numpy as np
from monolithic.machine import machine
from numpy.typing import NDArray
from reference_files import Case, Table
from scipy.linalg import expm

AXES = ("X", "Y", "Z")


def _transition(A: NDArray[np.float64], B: NDArray[np.float64], h: float) -> tuple[NDArray[np.float64], ...]:
    """State transition, and what the input's value and its slope at the start of the interval add to the state."""
    n, m = B.shape
    block = np.zeros((n + 2 * m, n + 2 * m))
    block[:n, :n], block[:n, n : n + m], block[n : n + m, n + m :] = A, B, np.eye(m)
    whole = expm(block * h)
    return whole[:n, :n], whole[:n, n : n + m], whole[:n, n + m :]


def solve(case: Case, every: float, outputs: tuple[str, ...]) -> Table:
    """The named outputs every `every` seconds; the knots of the inputs must be evenly spaced.

    Where the case's inputs are held, the value of a row holds until the next one.
    """
    default = machine(case.modes) if case.modes else machine()
    omega = 2 * np.pi * default.frequency
    modes = len(omega)
    # omega q instead of q for the elastic modes: entries of like size, and the exponential keeps its digits
    scale = np.where(omega > 0, omega, 1.0)
    A = np.zeros((2 * modes, 2 * modes))
    A[:modes, modes:] = np.diag(scale)
    A[modes:, :modes] = -np.diag(omega**2 / scale)
    A[modes:, modes:] = -np.diag(2 * default.damping * omega)
    ports = np.hstack([default.n, default.tcp])  # torques of the axes, forces on the tool
    B = np.vstack([np.zeros_like(ports), ports])
    time = case.inputs["time"]
    zero = np.zeros_like(time)

    def given(name: str) -> NDArray[np.float64]:
        return case.inputs.get(name, zero)

    torques = [given(f"{a}.M_a") - given(f"{a}.M_fr") - case.parameters.get(f"{a}.M_0", 0.0) for a in AXES]
    u = np.array(torques + [given(f"tool.F_{d}") for d in AXES]).T
    h = time[-1] / (len(time) - 1)
    step, by_value, by_slope = _transition(A, B, h)
    states = np.zeros((len(time), 2 * modes))
    for i in range(len(time) - 1):
        slope = np.zeros_like(u[i]) if case.held else (u[i + 1] - u[i]) / h
        states[i + 1] = step @ states[i] + by_value @ u[i] + by_slope @ slope

    q, v = states[:, :modes] / scale, states[:, modes:]
    available: Table = {}
    for i, a in enumerate(AXES):
        start = default.axes[a].x_0
        available |= {f"{a}.n_a": v @ default.n[:, i], f"{a}.n_fr": v @ default.n[:, i]}
        available |= {f"{a}.x_a": start + q @ default.x[:, i]}
        available |= {f"tool.x_{a}": q @ default.tcp[:, i], f"tcp.x_{a}": start + q @ default.tcp[:, i]}
    kept = slice(None, None, round(every / h))
    return {"time": time[kept]} | {name: available[name][kept] for name in outputs}
