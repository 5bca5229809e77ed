"""The friction equations a second time, and their solution by scipy, for the tests of friction.fmu."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from fmi_helpers import Floats

# Synthetic default machine.
Z_AXIS = {
    "sigma_0": 300.0, "sigma_1": 0.8, "sigma_2": 0.006, "F_C": 1.6, "F_S": 2.1, "v_s": 0.6, "beta": 1.0,
    "F_log": 0.4, "v_log": 3.0, "asymmetry": 0.0, "W": 0.04, "gamma": 0.35,
}  # fmt: skip
X_AXIS = Z_AXIS | {"sigma_0": 450.0, "sigma_1": 1.2, "sigma_2": 0.010, "F_C": 2.4, "F_S": 3.1, "F_log": 0.6}


def level(p: Mapping[str, float], n: float) -> float:
    """g(n) [rad], Eq. 7 with the asymmetry factor."""
    s = abs(n)
    stribeck = (p["F_S"] - p["F_C"]) * math.exp(-((s / p["v_s"]) ** p["beta"]))
    rise = p["F_log"] * math.log(s / p["v_log"] + 1.0)
    side = 1.0 + p["asymmetry"] * float(np.sign(n))
    return side * (p["F_C"] + stribeck + rise) / p["sigma_0"]


def torque(p: Mapping[str, float], z: float, c: float, n: float) -> float:
    """M_fr [N.m], Eqs. 1 to 3 and 6."""
    k = 1.0
    if p["W"] > 0.0:
        engaged = (p["W"] / 2 + c if z >= 0.0 else p["W"] / 2 - c) / p["W"]
        k = p["gamma"] + engaged * (1.0 - p["gamma"])
    rate = n - abs(n) / level(p, n) * z
    return k * p["sigma_0"] * z + p["sigma_1"] * rate + p["sigma_2"] * n


@dataclass(frozen=True)
class Motion:
    """A speed [rad/s] over time, its angle [rad], and the instants at which it changes its sign."""

    speed: Callable[[float], float]
    angle: Callable[[float], float]
    reversals: tuple[float, ...]


def sine(amplitude: float, frequency: float, phase: float, stop: float) -> Motion:
    """n = amplitude sin(2 pi frequency t + phase)."""
    w = 2 * math.pi * frequency
    zeros = ((k * math.pi - phase) / w for k in range(-2, 2 + int(2 * frequency * stop) + 2))
    return Motion(
        lambda t: amplitude * math.sin(w * t + phase),
        lambda t: -amplitude / w * math.cos(w * t + phase),
        tuple(t for t in zeros if 0.0 < t < stop),
    )


def line(n_0: float, slope: float, stop: float) -> Motion:
    """n = n_0 + slope t."""
    zero = -n_0 / slope
    return Motion(
        lambda t: n_0 + slope * t, lambda t: n_0 * t + slope * t * t / 2, (zero,) if 0.0 < zero < stop else ()
    )


def solved(p: Mapping[str, float], motion: Motion, times: Floats) -> Floats:
    """M_fr at `times` from z = c = 0: z by DOP853 at 1e-12 from reversal to reversal, c in closed form."""
    torques = np.empty(len(times))
    z, c = 0.0, 0.0
    ends = [*motion.reversals, float(times[-1])]
    start = 0.0
    for end in ends:
        inside = (times > start) & (times <= end)

        def rate(t: float, state: Floats) -> list[float]:
            n = motion.speed(t)
            return [n - abs(n) / level(p, n) * state[0]]

        points = np.append(times[inside], end) if not inside.any() or times[inside][-1] < end else times[inside]
        solution = solve_ivp(rate, (start, end), [z], method="DOP853", rtol=1e-12, atol=1e-16, t_eval=points)
        assert solution.success
        origin = motion.angle(start) - c
        zone = p["W"] / 2
        clipped = [min(max(motion.angle(t) - origin, -zone), zone) for t in points]
        shown = zip(points, solution.y[0], clipped, strict=True)
        torques[inside] = [torque(p, z_t, c_t, motion.speed(t)) for t, z_t, c_t in shown][: int(inside.sum())]
        z, c, start = float(solution.y[0][-1]), clipped[-1], end
    return torques
