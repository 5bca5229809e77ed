"""Controller unit's reference: the sampled cascade in Python, every block by scipy's own discretisation.

One object is one axis. It is also the controller of the coupled check by DOP853 (test_monolithic.py).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import controller_effects as effects
import numpy as np
from numpy.typing import NDArray
from reference_files import Case, Table, booleans
from scipy.linalg import expm
from scipy.signal import bilinear, cont2discrete

# Z axis of the synthetic default machine: the unit's start values
DEFAULTS: dict[str, float] = {
    "T_c": 125e-6,
    "T_pos": 1e-3,
    "I_P": 0.02 / (2 * math.pi),
    "K_v": 200 / 3,
    "k_ffw": 1,
    "T_dyn": 1.326e-3,
    "T_sym": 3.528e-3,
    "symmetry_lag": 0,
    "ramp_speed_setpoint": 1,
    "K_p": 6.18,
    "T_n": 12e-3,
    "speed_integrator": 1,
    "reference_model": 1,
    "omega_0": 915.3,
    "D": 1.214,
    "T_ref": 0,
    "speed_window": 0,
    "M_max": 80,
    "filter_1.type": 1,
    "filter_1.f": 602,
    "filter_1.D_num": 0.08,
    "filter_1.D_den": 0.8,
    "ideal_current_loop": 0,
    "current.K_p": 5e-3 * 2 * math.pi * 550,
    "current.T_n": 5e-3 / 0.45,
    "u_max": 350,
    "R": 0.45,
    "L_d": 5e-3,
    "L_q": 5e-3,
    "p": 5,
    "K_t": 2,
}

OBSERVABLES = ("x_e", "n_s", "n_ref", "M_s", "u_d", "u_q")


class _Filter:
    """Transfer function of order 2 in z, one sample at a time, as a difference equation on past values."""

    def __init__(self, numerator: list[float], denominator: list[float], rate: float) -> None:
        b, a = bilinear(numerator, denominator, fs=rate)
        self.b = np.asarray(b) / a[0]
        self.a = np.asarray(a) / a[0]
        self.u = np.zeros(3)
        self.y = np.zeros(3)

    def __call__(self, u: float) -> float:
        self.u = np.array([u, self.u[0], self.u[1]])
        y = float(self.b @ self.u - self.a[1:] @ self.y[:2])
        self.y = np.array([y, self.y[0], self.y[1]])
        return y


class Cascade:
    """Position, speed and current control of one axis with its motor; `p`: parameters by the unit's names (SI)."""

    def __init__(self, p: Mapping[str, float], x_s_start: float) -> None:
        self.p = DEFAULTS | dict(p)
        p = self.p
        self.ratio = round(p["T_pos"] / p["T_c"])
        self.psi = p["K_t"] / (1.5 * p["p"])
        lag = cont2discrete(([1.0], [max(p["T_sym"], 1e-12), 1.0]), p["T_pos"], method="foh")
        self.lag_b, self.lag_a = np.ravel(lag[0]), np.ravel(lag[1])
        self.measured: list[float] = []  # x_a of the last `speed_window` cycles, oldest first
        self.k = 0
        self.released = True
        # Positions are counted from the start, a difference without rounding: their last bit around 0.1 m would be
        # 1e-12 rad/s by K_v / I_P, and 1e-10 N.m by K_p and the integrator over a run.
        self.origin = x_s_start
        self.pulses: NDArray[np.float64] | None = None  # additions to the speed setpoint, every T_pos
        self._begin(0.0)

    def _begin(self, x_s: float) -> None:
        """At rest, all that came before forgotten: the setpoint stood at x_s."""
        p = self.p
        w = p["omega_0"]
        self.reference = _Filter([w * w], [1, 2 * p["D"] * w, w * w], 1 / p["T_c"])
        self.filters = [self._setpoint_filter(f"filter_{i}") for i in range(1, 5) if p.get(f"filter_{i}.type", 0)]
        self.dead = [0.0] * (math.ceil(p["T_ref"] / p["T_c"]) + 2)  # n_s of the last cycles, oldest first
        self._stood_at(x_s)
        self.n_old = self.n_new = self.integral = 0.0
        self.i = np.zeros(2)
        self.u_next = np.zeros(2)
        self.u = np.zeros(2)
        self.current_integral = np.zeros(2)
        self.seen = dict.fromkeys(OBSERVABLES, 0.0)

    def _stood_at(self, x_s: float) -> None:
        """The past of the setpoints."""
        self.x_history = [x_s] * 64
        self.n_history = [0.0] * 64
        self.lag_input = self.lag_output = x_s

    def _setpoint_filter(self, name: str) -> _Filter:
        p, rate = self.p, 1 / self.p["T_c"]
        # prewarping: the bilinear transform of the filter moved to this frequency has it back at f
        w = 2 * rate * math.tan(math.pi * p[f"{name}.f"] / rate)
        numerator = [1, 2 * p[f"{name}.D_num"] * w, w * w] if p[f"{name}.type"] == 1 else [w * w]
        return _Filter(numerator, [1, 2 * p[f"{name}.D_den"] * w, w * w], rate)

    def _delayed(self, history: list[float], delay: float) -> float:
        """`history`: newest last, one sample per T_pos; the cubic through four of them, by Lagrange."""
        d = delay / self.p["T_pos"]
        first = max(math.floor(d) - 1, 0)
        back = range(first, first + 4)
        return sum(history[-1 - j] * math.prod((d - k) / (j - k) for k in back if k != j) for j in back)

    def _position(self, x_s: float, n_ffw: float, x_a: float) -> None:
        p = self.p
        self.x_history.append(x_s)
        self.n_history.append(n_ffw)
        if p["symmetry_lag"]:
            u = self._delayed(self.x_history, p["T_dyn"])
            y = self.lag_b[0] * u + self.lag_b[1] * self.lag_input - self.lag_a[1] * self.lag_output
            self.lag_input, self.lag_output = u, y
            delayed = y
        else:
            delayed = self._delayed(self.x_history, p["T_dyn"] + p["T_sym"])
        self.seen["x_e"] = delayed - x_a
        feedforward = p["k_ffw"] * p["I_P"] * self._delayed(self.n_history, p["T_dyn"])
        self.n_old, self.n_new = self.n_new, (p["K_v"] * (delayed - x_a) + feedforward) / p["I_P"]
        if self.pulses is not None:
            self.n_new += float(self.pulses[self.k // self.ratio])

    def _late(self, n_s: float) -> float:
        """n_s behind the reference model's dead time: linear between the cycles."""
        self.dead = [*self.dead[1:], n_s]
        age = np.arange(len(self.dead))[::-1] * self.p["T_c"]
        return float(np.interp(self.p["T_ref"], age[::-1], self.dead[::-1]))

    def _measured_speed(self, x_a: float, n_a: float) -> float:
        """The motor's speed, or the mean speed of the scale over `speed_window` cycles."""
        window = round(self.p["speed_window"])
        if window == 0:
            return n_a
        self.measured = [*(self.measured or [x_a] * window), x_a][-window - 1 :]
        return (x_a - self.measured[0]) / (window * self.p["T_c"] * self.p["I_P"])

    def _speed(self, n_a: float, n_add: float, M_add: float) -> float:
        p = self.p
        j = self.k % self.ratio
        n_s = self.n_old + (self.n_new - self.n_old) * (j + 1) / self.ratio if p["ramp_speed_setpoint"] else self.n_new
        n_s += n_add
        n_ref = self.reference(self._late(n_s)) if p["reference_model"] else n_s
        share = p["T_c"] / p["T_n"] if p["speed_integrator"] else 0.0
        self.integral += p["K_p"] * share * (n_ref - n_a)
        wanted = p["K_p"] * (n_s - n_a) + self.integral + M_add
        M_s = min(max(wanted, -p["M_max"]), p["M_max"])
        self.integral += share * (M_s - wanted)
        self.seen |= {"n_s": n_s, "n_ref": n_ref, "M_s": M_s}
        return M_s

    def _voltage(self, M: float, n_a: float) -> NDArray[np.float64]:
        p = self.p
        w = p["p"] * n_a
        error = np.array([0.0, M / p["K_t"]]) - self.i
        self.current_integral = self.current_integral + p["current.K_p"] * p["T_c"] / p["current.T_n"] * error
        decoupling = np.array([-w * p["L_q"] * self.i[1], w * p["L_d"] * self.i[0] + w * self.psi])
        wanted = np.asarray(p["current.K_p"] * error + self.current_integral + decoupling)
        realised = wanted * min(1.0, p["u_max"] / max(float(np.linalg.norm(wanted)), 1e-300))
        self.current_integral = self.current_integral + p["T_c"] / p["current.T_n"] * (realised - wanted)
        return np.asarray(realised)

    def _motor(self, n_a: float) -> None:
        p = self.p
        w = p["p"] * n_a
        A = np.zeros((3, 3))
        A[0] = [-p["R"] / p["L_d"], w * p["L_q"] / p["L_d"], self.u[0] / p["L_d"]]
        A[1] = [-w * p["L_d"] / p["L_q"], -p["R"] / p["L_q"], (self.u[1] - w * self.psi) / p["L_q"]]
        self.i = np.asarray(expm(A * p["T_c"]) @ np.array([self.i[0], self.i[1], 1.0]))[:2]

    def _rest(self, x_s: float, x_a: float, n_a: float) -> float:
        """An instant without release: no torque, at the motor's terminals what it induces; the encoder measures on."""
        p = self.p
        self._begin(x_s)
        self.released = False
        if self.measured:
            self._measured_speed(x_a, n_a)
        self.k += 1
        self.seen = dict.fromkeys(OBSERVABLES, 0.0) | {"x_e": x_s - x_a}
        if not p["ideal_current_loop"]:
            self.u_next = np.array([0.0, p["p"] * n_a * self.psi])
            self.seen["u_q"] = float(self.u_next[1])
        return 0.0

    def sample(
        self,
        x_s: float,
        n_ffw: float,
        x_a: float,
        n_a: float,
        n_add: float = 0.0,
        M_add: float = 0.0,
        release: float = 1.0,
        turns: float | None = None,
    ) -> float:
        """Work at the next sample instant t_k; return M_a(t_k+1) [N.m]. `turns`: speed of the motor itself, where
        another one is measured."""
        p = self.p
        x_s, x_a = x_s - self.origin, x_a - self.origin
        if not release:
            return self._rest(x_s, x_a, n_a)
        if not self.released:
            self._stood_at(x_s)
        if self.k % self.ratio == 0 or not self.released:
            self._position(x_s, n_ffw, x_a)
        self.released = True
        M = self._speed(self._measured_speed(x_a, n_a), n_add, M_add)
        for setpoint_filter in self.filters:
            M = setpoint_filter(M)
        self.k += 1
        if p["ideal_current_loop"]:
            return M
        u = self._voltage(M, n_a)
        self.u = self.u_next
        self.u_next = u
        self.seen |= {"u_d": float(self.u[0]), "u_q": float(self.u[1])}
        self._motor(n_a if turns is None else turns)
        return float(1.5 * p["p"] * (self.psi + (p["L_d"] - p["L_q"]) * self.i[0]) * self.i[1])


def solve(case: Case, every: float, outputs: tuple[str, ...]) -> Table:
    """The named outputs every `every` seconds.

    M_a runs linearly between the sample instants. i_d and i_q are given at whole cycles only; the observables are those
    of the last sample instant ahead of the time given, as a unit shows them at the end of a step.
    """
    p = DEFAULTS | dict(case.parameters)
    T_c = p["T_c"]
    cycles = math.ceil(case.stop / T_c - 1e-9)
    t = np.arange(cycles + 1) * T_c
    names = ("x_s", "n_ffw", "x_a", "n_a", "n_add", "M_add")
    # a sample within a step finds what was set at the step's start, where inputs are held
    seen_at = np.floor(t / case.step + 1e-9) * case.step if case.held else t
    given = {n: np.interp(seen_at, case.inputs["time"], case.inputs[n]) for n in names if n in case.inputs}
    given.setdefault("n_ffw", np.zeros_like(t))
    if "release" in case.inputs:
        given["release"] = booleans(case.inputs, "release", seen_at)
    given["turns"] = given["n_a"]
    # read at the end of a step, x_m follows the inputs that were set at its start
    shown = effects.measured(p, given["x_a"], given["n_a"], following=True)[0]
    given["x_a"], given["n_a"] = effects.measured(p, given["x_a"], given["n_a"])
    ticks = round(p["T_pos"] / T_c)
    given["x_s"] = effects.corrected(p, given["x_s"], ticks)
    added = np.repeat(effects.friction_table(p, given["n_ffw"], ticks), ticks)[: len(t)]
    given["M_add"] = given.get("M_add", 0.0) + added
    cascade = Cascade(case.parameters, float(given["x_s"][0]))
    cascade.pulses = effects.friction_pulse(p, given["n_ffw"], ticks)
    torque, seen = [0.0], [dict.fromkeys((*OBSERVABLES, "i_d", "i_q"), 0.0)]
    seen[0]["x_m"] = float(given["x_a"][0])
    for k in range(cycles):
        torque.append(cascade.sample(**{name: float(values[k]) for name, values in given.items()}))
        seen.append(cascade.seen | {"i_d": float(cascade.i[0]), "i_q": float(cascade.i[1])})
        seen[-1]["x_m"] = float(shown[k])
    times = np.arange(round(case.stop / every) + 1) * every
    last = np.ceil(times / T_c - 1e-9).astype(int)
    table = {"time": times, "M_a": np.interp(times, t, effects.torque(p, given["turns"][:-1], np.asarray(torque)))}
    table |= {name: np.array([seen[i][name] for i in last]) for name in seen[0]}
    return {"time": times} | {name: table[name] for name in outputs}
