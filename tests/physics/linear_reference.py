"""The coupled drives and structure as a linear simulation, cycle by cycle: the oracle for the closed forms.

Written as the units work, in time: instants, states, samples. Every quantity may be complex, so that a steady response
is found by solving for the state that repeats itself over a position cycle. Modes are advanced by scipy's matrix
exponential, filters by scipy's bilinear transform.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, expm
from scipy.signal import bilinear, tf2ss

from feedsim.scenario import Axis, Machine
from feedsim.structure import Modes

Array = NDArray[np.complex128]
TOOL = ("tcp_X", "tcp_Y", "tcp_Z")


class Block:
    """A single-input, single-output sampled system x+ = A x + B u, y = C x + D u."""

    def __init__(self, numerator: NDArray[np.float64], denominator: NDArray[np.float64]) -> None:
        self.A, self.B, self.C, self.D = tf2ss(numerator, denominator)
        self.x = np.zeros(len(self.A), dtype=complex)

    def __call__(self, u: complex) -> complex:
        y = (self.C @ self.x)[0] + self.D[0, 0] * u
        self.x = self.A @ self.x + self.B[:, 0] * u
        return complex(y)


def lagrange(age: float, ages: list[int]) -> list[float]:
    return [math.prod((age - b) / (a - b) for b in ages if b != a) for a in ages]


class Line:
    """A delay as taps on past samples."""

    def __init__(self, samples: float, cubic: bool) -> None:
        whole = math.floor(samples + 1e-9)
        rest = max(samples - whole, 0.0)
        if rest < 1e-9:
            ages = [whole]
        elif cubic:
            ages = [max(whole - 1, 0) + i for i in range(4)]
        else:
            ages = [whole, whole + 1]
        self.taps = dict(zip(ages, lagrange(samples, ages) if len(ages) > 1 else [1.0], strict=True))
        self.x = np.zeros(ages[-1] + 1, dtype=complex)

    def __call__(self, u: complex) -> complex:
        self.x = np.concatenate([[u], self.x[:-1]])
        return complex(sum(weight * self.x[age] for age, weight in self.taps.items()))


class Numbers:
    """Named single states."""

    def __init__(self, count: int) -> None:
        self.x = np.zeros(count, dtype=complex)


N_OLD, N_NEW, INTEGRAL, CURRENT, CURRENT_INTEGRAL, VOLTAGE, LAG_IN, LAG_OUT = range(8)


class DriveSimulation:
    """One axis; `closed` as in the linear system."""

    def __init__(self, axis: Axis, machine: Machine, closed: str) -> None:
        d, T_c, T_pos = axis.drive, machine.cycles.T_c, machine.cycles.T_pos
        self.d, self.I_P, self.T_c, self.T_pos, self.closed = d, axis.I_P, T_c, T_pos, closed
        self.ticks = round(T_pos / T_c)
        self.own = Numbers(8)
        dead = d.T_dyn + (0.0 if d.symmetry_lag else d.T_sym)
        self.x_line, self.n_line = Line(dead / T_pos, True), Line(d.T_dyn / T_pos, True)
        self.blocks = [self.x_line, self.n_line, self.own]
        self.reference: list[Line | Block] = []
        if d.reference_model:
            w, D = d.omega_0, d.D
            assert w is not None
            assert D is not None
            pt2 = Block(*bilinear([w * w], [1, 2 * D * w, w * w], 1 / T_c))
            self.reference = [Line(d.T_ref / T_c, False), pt2]
        self.filters: list[Block] = []
        for each in (d.filter_1, d.filter_2, d.filter_3, d.filter_4):
            if each.type == "off":
                continue
            assert each.f is not None
            w = 2 * math.pi * each.f
            below = [1, 2 * float(each.D_den or 0) * w, w * w]
            above = [w * w] if each.type == "low_pass" else [1, 2 * float(each.D_num or 0) * w, w * w]
            # prewarping: the bilinear transform at the rate that makes w exact
            self.filters.append(Block(*bilinear(above, below, w / math.tan(w * T_c / 2) / 2)))
        self.places = Line(d.speed_window, False)
        self.blocks += [self.places, *self.reference, *self.filters]  # type: ignore[arg-type]

    def instant(
        self, j: int, x_s: complex, n_ffw: complex, x_a: complex, n_a: complex, n_add: complex, M_add: complex
    ) -> tuple[complex, complex]:
        """Work an instant; return n_s, the torque at its end and, of the ideal loop, the torque that begins."""
        d, own, T_c = self.d, self.own.x, self.T_c
        if j == 0:
            x, n = self.x_line(x_s), self.n_line(n_ffw)
            if d.symmetry_lag:
                # exact for linear inputs: augmented matrix exponential of y' = (u - y)/T, u' = slope
                A = np.array([[-1 / d.T_sym, 1 / d.T_sym, 0], [0, 0, 1], [0, 0, 0]])
                y = expm(A * self.T_pos)[0] @ [own[LAG_OUT], own[LAG_IN], (x - own[LAG_IN]) / self.T_pos]
                own[LAG_IN], own[LAG_OUT] = x, y
                x = y
            own[N_OLD] = own[N_NEW]
            own[N_NEW] = (d.K_v * (x - x_a) + d.k_ffw * self.I_P * n) / self.I_P if self.closed == "position" else 0.0
        share = (j + 1) / self.ticks if d.ramp_speed_setpoint else 1.0
        n_s = own[N_OLD] + (own[N_NEW] - own[N_OLD]) * share + n_add
        n_m = n_a
        if d.speed_window:
            n_m = (x_a - self.places(x_a)) / (d.speed_window * T_c * self.I_P)
        n_ref = n_s
        for block in self.reference:
            n_ref = block(n_ref)
        if d.speed_integrator:
            own[INTEGRAL] += d.K_p * T_c / float(d.T_n or 1) * (n_ref - n_m)
        M = d.K_p * (n_s - n_m) + own[INTEGRAL] + M_add
        for block in self.filters:
            M = block(M)
        if d.ideal_current_loop:
            return n_s, M
        assert d.current is not None
        assert d.R is not None
        assert d.L_q is not None
        psi_p = d.K_t / 1.5  # flux linkage times pole pairs
        error = M / d.K_t - own[CURRENT]
        own[CURRENT_INTEGRAL] += d.current.K_p * T_c / d.current.T_n * error
        u = own[VOLTAGE]
        own[VOLTAGE] = d.current.K_p * error + own[CURRENT_INTEGRAL] + psi_p * n_a
        a = math.exp(-d.R / d.L_q * T_c)
        own[CURRENT] = a * own[CURRENT] + (1 - a) / d.R * (u - psi_p * n_a)
        return n_s, d.K_t * own[CURRENT]


class Simulation:
    """All axes and modes; closed: axis -> "position", "speed" or "none"."""

    def __init__(self, machine: Machine, modes: Modes, closed: dict[str, str]) -> None:
        self.machine, self.axes, self.closed = machine, list(machine.axes), closed
        self.T_c = machine.cycles.T_c
        self.ticks = round(machine.cycles.T_pos / machine.cycles.T_c)
        self.drives = [DriveSimulation(axis, machine, closed[name]) for name, axis in machine.axes.items()]
        ports = [f"n_{axis}" for axis in self.axes] + list(TOOL)
        modal = []
        for f, zeta in zip(modes.frequency, modes.damping, strict=True):
            w = 2 * math.pi * f
            # q, v, input, input slope
            A = np.array([[0, 1, 0, 0], [-w * w, -2 * zeta * w, 1, 0], [0, 0, 0, 1], [0, 0, 0, 0.0]])
            modal.append(expm(A * self.T_c)[:2])
        self.A = block_diag(*[step[:, :2] for step in modal])
        shapes = np.column_stack([modes.ports[port] for port in ports])
        self.B = np.vstack([step[:, 2:3] * row for step, row in zip(modal, shapes, strict=True)])
        self.B_slope = np.vstack([step[:, 3:4] * row for step, row in zip(modal, shapes, strict=True)])
        self.modal = np.zeros(len(self.A), dtype=complex)
        self.M_a = np.zeros(len(self.axes), dtype=complex)
        self.speeds = np.zeros((len(self.axes), len(self.A)))
        self.speeds[:, 1::2] = np.array([modes.ports[f"n_{axis}"] for axis in self.axes])
        self.places = np.zeros((len(self.axes) + 3, len(self.A)))
        self.places[:, ::2] = np.array([modes.ports[port] for port in [f"x_{axis}" for axis in self.axes] + list(TOOL)])

    @property
    def state(self) -> Array:
        parts = [block.x for drive in self.drives for block in drive.blocks]
        return np.concatenate([self.modal, self.M_a, *parts])

    @state.setter
    def state(self, value: Array) -> None:
        parts = [block for drive in self.drives for block in drive.blocks]
        sizes = np.cumsum([len(self.modal), len(self.M_a), *[len(part.x) for part in parts]])[:-1]
        self.modal, self.M_a, *rest = (part.copy() for part in np.split(value, sizes))
        for part, x in zip(parts, rest, strict=True):
            part.x = x

    def cycle(self, name: str | None, s: complex) -> list[dict[str, complex]]:
        """A position cycle with the input `name` at exp(s t), t from the cycle's start; outputs at its instants."""
        rows = []
        for j in range(self.ticks):
            now = np.exp(s * j * self.T_c)
            n_a, x = self.speeds @ self.modal, self.places @ self.modal
            row = {f"tool.x_{d}": x[len(self.axes) + i] for i, d in enumerate("XYZ")}
            ends, starts = self.M_a.copy(), self.M_a.copy()
            for i, (axis, drive) in enumerate(zip(self.axes, self.drives, strict=True)):
                given = {
                    signal: now if name == f"{axis}.{signal}" else 0.0
                    for signal in ("x_s", "n_ffw", "n_add", "M_add", "M_a")
                }
                if self.closed[axis] == "none":
                    n_s = given["n_add"]
                    starts[i], ends[i] = given["M_a"], given["M_a"] * np.exp(s * self.T_c)
                else:
                    n_s, ends[i] = drive.instant(
                        j, given["x_s"], given["n_ffw"], x[i], n_a[i], given["n_add"], given["M_add"]
                    )
                if drive.d.ideal_current_loop:
                    ends[i] = starts[i] = given["M_a"] if self.closed[axis] == "none" else ends[i]
                row |= {f"{axis}.n_a": n_a[i], f"{axis}.x_a": x[i], f"{axis}.M_a": starts[i], f"{axis}.n_s": n_s}
            force = np.array([now if name == f"tool.F_{d}" else 0.0 for d in "XYZ"])
            inputs = np.concatenate([starts, force])
            slopes = np.concatenate([ends - starts, force * np.expm1(s * self.T_c)]) / self.T_c
            self.modal = self.A @ self.modal + self.B @ inputs + self.B_slope @ slopes
            self.M_a = ends
            rows.append(row)
        return rows

    def transition(self) -> Array:
        """State after a position cycle per state before it."""
        columns = []
        for unit in np.eye(len(self.state)):
            self.state = unit.astype(complex)
            self.cycle(None, 0.0)
            columns.append(self.state)
        return np.column_stack(columns)

    def steady(self, frequency: float, name: str, transition: Array) -> list[dict[str, complex]]:
        """A position cycle of the steady response to exp(2 pi i frequency t) on the input alone, a row per instant."""
        s = 2j * math.pi * frequency
        self.state = np.zeros(len(transition), dtype=complex)
        self.cycle(name, s)
        z = np.exp(s * self.ticks * self.T_c)
        self.state = np.linalg.solve(z * np.eye(len(transition)) - transition, self.state)
        return self.cycle(name, s)

    def component(self, frequency: float, rows: list[dict[str, complex]], output: str) -> complex:
        """Component at `frequency` [Hz] of an output, from the rows of a steady position cycle."""
        back = np.exp(-2j * math.pi * frequency * self.T_c * np.arange(self.ticks)) / self.ticks
        return complex(sum(row[output] * b for row, b in zip(rows, back, strict=True)))
