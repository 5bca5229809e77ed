"""The coupled machine in SciPy alone: plant and frictions by ``solve_ivp`` from control instant to control instant.

A second implementation of everything in ``monolithic`` but the setpoints, with the controllers of ``solve_controller``.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from monolithic.machine import Axis, Machine
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from solve_controller import Cascade
from solve_friction import engagement, steady_deflection


@dataclass(frozen=True)
class Solver:
    """Method of ``solve_ivp``, its tolerances, and its first step as a share of the control cycle."""

    method: str = "DOP853"
    rtol: float = 1e-11
    atol: float = 1e-15
    first: float = 1 / 8


class Integrated:
    """Modes, bristles and contacts of all axes as one state, the controllers beside it.

    Attributes:
        seconds: time spent in ``solve_ivp`` so far [s], the controllers' not among it.
        evaluations: of the right-hand side so far.
    """

    def __init__(self, m: Machine, x_start: Mapping[str, float], solver: Solver | None = None) -> None:
        self.m = m
        self.solver = solver or Solver()
        self.names = list(m.axes)
        self.omega = 2 * np.pi * m.frequency
        self.stiffness, self.damping = self.omega**2, 2 * m.damping * self.omega
        self.state = np.zeros(2 * len(self.omega) + 2 * len(self.names))
        self.M_a = np.zeros(len(self.names))
        self.controllers = [Cascade(_parameters(m, axis), x_start[name]) for name, axis in m.axes.items()]
        self.seconds, self.evaluations = 0.0, 0

    def positions(self) -> NDArray[np.float64]:
        """x_a [m] (axes,)."""
        start = np.array([axis.x_0 for axis in self.m.axes.values()])
        return np.asarray(start + self.state[: len(self.omega)] @ self.m.x)

    def speeds(self) -> NDArray[np.float64]:
        """n_a [rad/s] (axes,)."""
        modes = len(self.omega)
        return np.asarray(self.state[modes : 2 * modes] @ self.m.n)

    def cycle(self, x_s: Sequence[float], n_ffw: Sequence[float]) -> None:
        """A control cycle: the controllers sample, and hand over torques that then run linearly to their next ones."""
        given = zip(self.controllers, x_s, n_ffw, self.positions(), self.speeds(), strict=True)
        M_next = np.array([controller.sample(x, n, x_a, n_a) for controller, x, n, x_a, n_a in given])
        modes, axes, T_c = len(self.omega), len(self.names), self.m.T_c
        frictions = [axis.friction for axis in self.m.axes.values()]
        n_of_modes, torque, slope = self.m.n, self.M_a, (M_next - self.M_a) / T_c

        def rate(t: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
            v = y[modes : 2 * modes]
            dy = np.empty_like(y)
            n = (v @ n_of_modes).tolist()
            bristles, contacts = y[2 * modes : -axes].tolist(), y[-axes:].tolist()
            M_fr = [0.0] * axes
            for i, (p, n_i, z, c) in enumerate(zip(frictions, n, bristles, contacts, strict=True)):
                dz = n_i - abs(n_i) / steady_deflection(p, n_i, math.copysign(1, n_i)) * z
                M_fr[i] = engagement(p, z, c)[1] * p["sigma_0"] * z + p["sigma_1"] * dz + p["sigma_2"] * n_i
                dy[2 * modes + i] = dz
                dy[2 * modes + axes + i] = 0.0 if abs(c) >= p["W"] / 2 and c * n_i > 0 else n_i
            dy[:modes] = v
            dy[modes : 2 * modes] = n_of_modes @ (torque + slope * t - M_fr) - self.stiffness * y[:modes]
            dy[modes : 2 * modes] -= self.damping * v
            return dy

        begun = time.perf_counter()
        solution = solve_ivp(
            rate,
            (0, T_c),
            self.state,
            method=self.solver.method,
            rtol=self.solver.rtol,
            atol=self.solver.atol,
            first_step=T_c * self.solver.first,
        )
        self.seconds += time.perf_counter() - begun
        self.evaluations += solution.nfev
        self.state = solution.y[:, -1]
        half = np.array([p["W"] / 2 for p in frictions])
        self.state[-axes:] = np.clip(self.state[-axes:], -half, half)
        self.M_a = M_next


def _parameters(m: Machine, axis: Axis) -> dict[str, float]:
    """The reference's parameters of an axis under the names of the controller unit."""
    renamed = {"ramp": "ramp_speed_setpoint", "K_p_current": "current.K_p", "T_n_current": "current.T_n"}
    renamed |= {name: f"filter_1.{name}" for name in ("f", "D_num", "D_den")}
    values = {renamed.get(name, name): value for name, value in axis.drive.items()}
    return values | {"T_c": m.T_c, "T_pos": m.T_pos, "filter_1.type": 1.0}
