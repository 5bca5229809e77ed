"""The drive control as a sampled model in plain Python: the oracle for controller.fmu.

Written from the equations alone (Wiesauer, Bleicher, 18th CIRP CMMO (2021), section 2.2, with the sampling instants and
the order of operations of the unit's documentation), with other mathematics than the unit wherever there is a choice:
Lagrange interpolation by a polynomial fit, the lag by an augmented matrix exponential, sampled filters by scipy's
bilinear transform in direct form I, the motor by scipy's matrix exponential. Slow on purpose.

Symbols and units are those of the unit's variables; parameters come as a mapping from FMI name to value.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.signal import bilinear

Parameters = Mapping[str, float]

# Start values of the unit: Z axis of the synthetic default machine.
DEFAULTS: dict[str, float] = {
    "T_c": 125e-6, "T_pos": 1e-3, "I_P": 0.02 / (2 * math.pi),
    "K_v": 4 * 1000 / 60, "k_ffw": 1, "T_dyn": 1.326e-3, "T_sym": 3.528e-3, "symmetry_lag": 0, "ramp_speed_setpoint": 1,
    "K_p": 6.18, "T_n": 0.012, "speed_integrator": 1, "speed_window": 0,
    "reference_model": 1, "omega_0": 915.3, "D": 1.214, "T_ref": 0, "M_max": 80,
    "filter_1.type": 1, "filter_1.f": 602, "filter_1.D_num": 0.08, "filter_1.D_den": 0.8,
    "filter_2.type": 0, "filter_2.f": 1000, "filter_2.D_num": 0.1, "filter_2.D_den": 1,
    "filter_3.type": 0, "filter_3.f": 1000, "filter_3.D_num": 0.1, "filter_3.D_den": 1,
    "filter_4.type": 0, "filter_4.f": 1000, "filter_4.D_num": 0.1, "filter_4.D_den": 1,
    "ideal_current_loop": 0, "current.K_p": 0.005 * 2 * math.pi * 550, "current.T_n": 0.005 / 0.45, "u_max": 350,
    "R": 0.45, "L_d": 0.005, "L_q": 0.005, "p": 5, "K_t": 2,
}  # fmt: skip


@dataclass(frozen=True)
class Inputs:
    """What the drive reads at one sample instant."""

    x_s: float = 0.0
    n_ffw: float = 0.0
    x_a: float = 0.0
    n_a: float = 0.0
    n_add: float = 0.0
    M_add: float = 0.0
    release: bool = True


@dataclass(frozen=True)
class Cycle:
    """The control cycle [t_k, t_k+1] that an instant opens. Pairs are values at its two ends."""

    M_a: tuple[float, float] = (0.0, 0.0)
    i_d: tuple[float, float] = (0.0, 0.0)
    i_q: tuple[float, float] = (0.0, 0.0)
    x_e: float = 0.0
    n_s: float = 0.0
    n_ref: float = 0.0
    M_s: float = 0.0
    u_d: float = 0.0
    u_q: float = 0.0
    torque_limited: bool = False
    voltage_limited: bool = False


def past(history: list[float], age: int, before: float) -> float:
    """Sample of the given age; `before` where it lies before the first one."""
    return history[-1 - age] if age < len(history) else before


def cubic(history: list[float], samples: float, before: float) -> float:
    """4-point Lagrange: ages m-1 ... m+2 about the interval m ... m+1, or 0 ... 3 where the delay is below a sample."""
    nearest = round(samples)
    if abs(samples - nearest) < 1e-9:
        return past(history, nearest, before)
    oldest = max(math.floor(samples) - 1, 0)
    ages = np.arange(oldest, oldest + 4)
    values = np.array([past(history, int(age), before) for age in ages])
    weights = np.linalg.solve(np.vander(ages - samples, 4, increasing=True).T, [1.0, 0.0, 0.0, 0.0])
    return float(weights @ values)


def linear(history: list[float], samples: float) -> float:
    """Linear interpolation between the samples about the instant; at rest before the first one."""
    whole = math.floor(samples + 1e-9)
    rest = max(samples - whole, 0.0)
    if rest < 1e-9:
        return past(history, whole, 0.0)
    return (1 - rest) * past(history, whole, 0.0) + rest * past(history, whole + 1, 0.0)


def lag(T: float, h: float) -> tuple[float, float, float]:
    """(a, b_old, b_new) of y <- a y + b_old u_old + b_new u_new: T y' + y = u solved for u linear over h."""
    if T == 0:
        return 0.0, 0.0, 1.0
    # state (y, u, du/dt), over h
    a, by_value, by_slope = expm(np.array([[-1 / T, 1 / T, 0], [0, 0, 1], [0, 0, 0]]) * h)[0]
    return float(a), float(by_value - by_slope / h), float(by_slope / h)


def section(numerator: list[float], denominator: list[float], rate: float) -> Generator[float, float, None]:
    """Sampled second-order section in direct form I; bilinear transform s = 2 rate (z-1)/(z+1), `rate` in 1/s."""
    b, a = bilinear(numerator, denominator, rate)
    u, y = [0.0] * 3, [0.0] * 3
    while True:
        u = [(yield y[0]), *u[:2]]
        y = [0.0, *y[:2]]
        y[0] = float((np.dot(b, u) - a[1] * y[1] - a[2] * y[2]) / a[0])


def started(block: Generator[float, float, None]) -> Generator[float, float, None]:
    next(block)
    return block


def current_filters(p: Parameters) -> list[Generator[float, float, None]]:
    """The current setpoint filters in use, Tustin prewarped at their frequencies."""
    blocks = []
    for name in ("filter_1", "filter_2", "filter_3", "filter_4"):
        kind, w = p[f"{name}.type"], 2 * math.pi * p[f"{name}.f"]
        if kind == 0:
            continue
        numerator = [1, 2 * p[f"{name}.D_num"] * w, w * w] if kind == 1 else [0, 0, w * w]
        prewarped = w / (2 * math.tan(w * p["T_c"] / 2))
        blocks.append(started(section(numerator, [1, 2 * p[f"{name}.D_den"] * w, w * w], prewarped)))
    return blocks


def motor(p: Parameters, i: NDArray[np.float64], u: NDArray[np.float64], n: float) -> NDArray[np.float64]:
    """dq currents [A] after T_c at held voltages u [V] and speed n [rad/s]."""
    psi, omega = p["K_t"] / (1.5 * p["p"]), p["p"] * n
    L_d, L_q = p["L_d"], p["L_q"]
    A = np.array([[-p["R"] / L_d, omega * L_q / L_d], [-omega * L_d / L_q, -p["R"] / L_q]])
    b = np.array([u[0] / L_d, (u[1] - omega * psi) / L_q])
    augmented = np.zeros((3, 3))
    augmented[:2, :2], augmented[:2, 2] = A * p["T_c"], b * p["T_c"]
    return np.asarray(expm(augmented)[:2] @ np.append(i, 1.0))


def torque(p: Parameters, i: NDArray[np.float64]) -> float:
    return float(p["K_t"] * i[1] + 1.5 * p["p"] * (p["L_d"] - p["L_q"]) * i[0] * i[1])


def drive(p: Parameters) -> Generator[Cycle, Inputs, None]:
    """Send the inputs of t_0, t_1, ... and receive the cycles they open. The first `next` starts it."""
    ticks = round(p["T_pos"] / p["T_c"])
    x_history: list[float] = []
    n_history: list[float] = []
    lag_a, lag_old, lag_new = lag(p["T_sym"], p["T_pos"])
    lag_u = lag_y = 0.0
    n_new = n_old = x_e = 0.0
    n_s_history: list[float] = []
    places: list[float] = []  # x_a at every instant since the first release
    released = False
    w, D = p["omega_0"], p["D"]
    model = started(section([0, 0, w * w], [1, 2 * D * w, w * w], 1 / p["T_c"]))
    filters = current_filters(p)
    integral = 0.0
    psi = p["K_t"] / (1.5 * p["p"])
    i, M_a = np.zeros(2), 0.0
    current_integral, u_next = np.zeros(2), np.zeros(2)
    cycle = Cycle()
    k = 0
    while True:
        now = yield cycle

        # 0. without release: no torque, and everything but the measurement is as at the start
        if not now.release:
            if places:
                places.append(now.x_a)
            x_history, n_history, n_s_history, released = [], [], [], False
            model = started(section([0, 0, w * w], [1, 2 * D * w, w * w], 1 / p["T_c"]))
            filters = current_filters(p)
            ideal, induced = bool(p["ideal_current_loop"]), psi * p["p"] * now.n_a
            u_next = np.array([0.0, 0.0 if ideal else induced])
            cycle = Cycle(
                M_a=(0.0 if ideal else M_a, 0.0), i_d=(0.0 if ideal else float(i[0]), 0.0),
                i_q=(0.0 if ideal else float(i[1]), 0.0), x_e=now.x_s - now.x_a, u_q=float(u_next[1]),
            )  # fmt: skip
            integral = n_new = n_old = M_a = 0.0
            i, current_integral = np.zeros(2), np.zeros(2)
            k += 1
            continue

        # 1. position loop; at a release, too, in place of its last instant
        if k % ticks == 0 or not released:
            released = True
            x_history.append(now.x_s)
            n_history.append(now.n_ffw)
            if p["symmetry_lag"]:
                u = cubic(x_history, p["T_dyn"] / p["T_pos"], x_history[0])
                if len(x_history) == 1:
                    lag_u = lag_y = u
                else:
                    lag_y = lag_a * lag_y + lag_old * lag_u + lag_new * u
                lag_u = u
                x_delayed = lag_y
            else:
                x_delayed = cubic(x_history, (p["T_dyn"] + p["T_sym"]) / p["T_pos"], x_history[0])
            x_e = x_delayed - now.x_a
            n_ffw = cubic(n_history, p["T_dyn"] / p["T_pos"], 0.0)
            n_old, n_new = n_new, (p["K_v"] * x_e + p["k_ffw"] * p["I_P"] * n_ffw) / p["I_P"]

        # 2. speed setpoint
        n_s = n_new
        if p["ramp_speed_setpoint"]:
            n_s = n_old + (n_new - n_old) * (k % ticks + 1) / ticks
        n_s += now.n_add

        # 3. reference model
        n_ref = n_s
        if p["reference_model"]:
            n_s_history.append(n_s)
            n_ref = model.send(linear(n_s_history, p["T_ref"] / p["T_c"]))

        # 4. PI: compute, saturate, then tell the integrator what was realised
        places.append(now.x_a)
        n, window = now.n_a, int(p["speed_window"])
        if window:
            n = (now.x_a - places[max(len(places) - 1 - window, 0)]) / (window * p["T_c"] * p["I_P"])
        step = p["T_c"] / p["T_n"] if p["speed_integrator"] else 0.0
        integral += p["K_p"] * step * (n_ref - n)
        wanted = p["K_p"] * (n_s - n) + integral + now.M_add
        M_s = min(max(wanted, -p["M_max"]), p["M_max"])
        integral += min(1.0, step) * (M_s - wanted)

        # 5. current setpoint filters
        filtered = M_s
        for block in filters:
            filtered = block.send(filtered)

        # 6. and 7. current loop and motor
        i_old, M_old, limited = i, M_a, False
        if p["ideal_current_loop"]:
            u_now = np.zeros(2)
            i, M_a = np.array([0.0, filtered / p["K_t"]]), filtered
            i_old, M_old = i, M_a  # jumps at t_k and is held
        else:
            u_now = u_next  # computed one cycle ago
            omega = p["p"] * now.n_a
            error = np.array([0.0, filtered / p["K_t"]]) - i
            gain, step = p["current.K_p"], p["T_c"] / p["current.T_n"]
            current_integral = current_integral + gain * step * error
            decoupling = omega * np.array([-p["L_q"] * i[1], p["L_d"] * i[0] + psi])
            u_wanted = gain * error + current_integral + decoupling
            amplitude = float(np.linalg.norm(u_wanted))
            limited = amplitude > p["u_max"]
            u_next = u_wanted * (p["u_max"] / amplitude) if limited else u_wanted
            current_integral = current_integral + min(1.0, step) * (u_next - u_wanted)
            i = motor(p, i, u_now, now.n_a)
            M_a = torque(p, i)

        cycle = Cycle(
            M_a=(M_old, M_a), i_d=(float(i_old[0]), float(i[0])), i_q=(float(i_old[1]), float(i[1])),
            x_e=x_e, n_s=n_s, n_ref=n_ref, M_s=M_s, u_d=float(u_now[0]), u_q=float(u_now[1]),
            torque_limited=M_s != wanted, voltage_limited=limited,
        )  # fmt: skip
        k += 1
