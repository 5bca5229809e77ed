"""Generalised Maxwell slip a second time, and its solution by scipy."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from friction_reference import Motion
from scipy.integrate import solve_ivp

from fmi_helpers import Floats

Z_AXIS = {
    "sigma_0": 300.0, "sigma_1": 0.8, "sigma_2": 0.006, "F_C": 1.6, "F_S": 2.1, "v_s": 0.6, "beta": 1.0,
    "F_log": 0.4, "v_log": 3.0, "asymmetry": 0.0, "spread": 20.0, "skew": 0.0, "C": 200.0,
}  # fmt: skip


def elements(p: Mapping[str, float]) -> tuple[Floats, Floats]:
    """Stiffness [N.m/rad] and share [1] of ten elements, (10,) each."""
    x = p["spread"] ** (np.arange(10) / 9)
    shares = x ** p["skew"] / np.sum(x ** p["skew"])
    return p["sigma_0"] * shares / x / np.sum(shares / x), shares


def level(p: Mapping[str, float], n: float, side: float) -> float:
    """s(n) [N.m] in the direction `side`."""
    s = abs(n)
    stribeck = (p["F_S"] - p["F_C"]) * np.exp(-((s / p["v_s"]) ** p["beta"]))
    return float((1 + p["asymmetry"] * side) * (p["F_C"] + stribeck + p["F_log"] * np.log(s / p["v_log"] + 1)))


def solved(p: Mapping[str, float], motion: Motion, times: Floats) -> Floats:
    """M_fr at `times` from rest without torque: DOP853 at 1e-12 from beginning to beginning of slip."""
    k, alpha = elements(p)
    force, torques = np.zeros(10), np.empty(len(times))
    start = 0.0
    for end in [*motion.reversals, float(times[-1])]:
        side, slips = float(np.sign(motion.speed((start + end) / 2))), np.zeros(10, dtype=bool)
        while start < end:
            slips |= side * force >= alpha * level(p, motion.speed(start), side) * (1 - 1e-14)

            def rates(t: float, F: Floats, slips: Floats = slips, side: float = side) -> Floats:
                n = motion.speed(t)
                return np.where(slips, p["C"] * (side * alpha - F / level(p, n, side)), k * n)

            def begins(t: float, F: Floats, slips: Floats = slips, side: float = side) -> float:
                over = side * F - alpha * level(p, motion.speed(t), side)
                return float(np.max(over[~slips])) if not slips.all() else -1.0

            begins.terminal, begins.direction = True, 1.0  # type: ignore[attr-defined]
            found = solve_ivp(
                rates, (start, end), force, method="DOP853", rtol=1e-12, atol=1e-14, events=begins, dense_output=True
            )
            assert found.success
            inside = (times > start) & (times <= found.t[-1])
            for i in np.flatnonzero(inside):
                t, F = times[i], found.sol(times[i])
                n = motion.speed(t)
                damped = np.sum(k * (n - abs(n) * F / (alpha * level(p, n, side)))) / p["sigma_0"]
                torques[i] = F.sum() + p["sigma_1"] * damped + p["sigma_2"] * n
            force, start = found.y[:, -1], float(found.t[-1])
            if found.status == 1:
                over = side * force - alpha * level(p, motion.speed(start), side)
                slips[np.flatnonzero(~slips)[np.argmax(over[~slips])]] = True
    return torques
