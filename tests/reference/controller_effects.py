"""What real drives have besides, on whole records: measured values, corrected setpoints, torques over the motor's turn.

Written from the documentation of the unit (docs/effects.md), in closed form where the unit goes from cycle to cycle.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
POINTS = 11
PERIODS = (20e-6, 10e-6, 20e-3)  # of the periodic errors, where nothing else is said [m]
ORDERS = (6.0, 12.0, 1.0)  # of cogging and ripple, likewise


def _turned(n_a: Array, T_c: float) -> Array:
    """Angle since the first instant [rad]: speed linear between the instants."""
    return np.concatenate([[0.0], np.cumsum(T_c * (n_a[1:] + n_a[:-1]) / 2)])


def _table(p: Mapping[str, float], name: str, x: Array) -> Array:
    """Value over position; 0 without a table."""
    spacing = p.get(f"{name}.spacing", 0.0)
    if not spacing:
        return np.zeros_like(x)
    at = p.get(f"{name}.first", 0.0) + spacing * np.arange(POINTS)
    return np.interp(x, at, [p.get(f"{name}.e_{i}", 0.0) for i in range(POINTS)])


def measured(p: Mapping[str, float], x_a: Array, n_a: Array) -> tuple[Array, Array]:
    """x_m and n_m at the instants; noise and resolution are no part of it."""
    phi = _turned(n_a, p["T_c"])
    e, psi = p.get("encoder.eccentricity", 0.0), p.get("encoder.phase", 0.0)
    x = x_a
    if p.get("measuring.indirect", 0):
        x = x_a[0] + p["I_P"] * (phi + e * (np.sin(phi + psi) - np.sin(psi)))
    error = p.get("measuring.linear", 0.0) * x + _table(p, "measuring_table", x)
    for i, usual in enumerate(PERIODS, start=1):
        amplitude = p.get(f"periodic_error_{i}.amplitude", 0.0)
        period = p.get(f"periodic_error_{i}.period", usual)
        error = error + amplitude * np.sin(2 * np.pi * x / period + p.get(f"periodic_error_{i}.phase", 0.0))
    return x + error - error[0], n_a * (1 + e * np.cos(phi + psi))


def corrected(p: Mapping[str, float], x_s: Array, ticks: int) -> Array:
    """Setpoints of all instants, those of the position controller (every `ticks`) with what the control adds."""
    taken = x_s[::ticks]
    moves = np.concatenate([[0.0], np.diff(taken)])
    direction, s, side = np.zeros_like(taken), np.zeros_like(taken), 0.0
    ramp, T_pos = p.get("backlash_compensation.ramp", 0.0), ticks * p["T_c"]
    most = 2 * T_pos / ramp if ramp else 2.0
    for k, move in enumerate(moves):
        if abs(move) > 1e-12:
            side = np.sign(move)
        direction[k] = side
        before = s[k - 1] if k else 0.0
        s[k] = before + np.clip(side - before, -most, most)
    plus = _table(p, "leadscrew_compensation", taken)
    back = "leadscrew_compensation_minus"
    minus = _table(p, back, taken) if p.get(f"{back}.spacing", 0.0) else plus
    result = x_s.copy()
    result[::ticks] += s * p.get("backlash_compensation.value", 0.0) / 2 + (plus * (1 + s) + minus * (1 - s)) / 2
    return result


def torque(p: Mapping[str, float], n_a: Array, M: Array) -> Array:
    """Torque at all instants and at the end of the last cycle, M the motor's own there; n_a at the instants."""
    before = np.concatenate([n_a[:1], n_a[:-1]])
    phi = _turned(n_a, p["T_c"]) + p["T_c"] * (n_a + (n_a - before) / 2)  # at the ends of the cycles
    ripple, cogging = np.zeros_like(phi), np.zeros_like(phi)
    for i, usual in enumerate(ORDERS, start=1):
        for total, name in ((cogging, "cogging"), (ripple, "ripple")):
            angle = p.get(f"{name}_{i}.order", usual) * phi + p.get(f"{name}_{i}.phase", 0.0)
            total += p.get(f"{name}_{i}.amplitude", 0.0) * np.sin(angle)
    return np.concatenate([M[:1], M[1:] * (1 + ripple) + cogging])
