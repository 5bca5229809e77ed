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


def measured(p: Mapping[str, float], x_a: Array, n_a: Array, *, following: bool = False) -> tuple[Array, Array]:
    """x_m and n_m at the instants; noise and resolution are no part of it.

    following: what the values of each instant would give if they were still there at the next one.
    """
    phi = _turned(n_a, p["T_c"]) + (p["T_c"] * n_a if following else 0.0)
    e, psi = p.get("encoder.eccentricity", 0.0), p.get("encoder.phase", 0.0)
    x = x_a
    if p.get("measuring.indirect", 0):
        x = x_a[0] + p["I_P"] * (phi + e * (np.sin(phi + psi) - np.sin(psi)))
    return x + _error(p, x) - _error(p, x_a[:1]), n_a * (1 + e * np.cos(phi + psi))


def _error(p: Mapping[str, float], x: Array) -> Array:
    error = p.get("measuring.linear", 0.0) * x + _table(p, "measuring_table", x)
    for i, usual in enumerate(PERIODS, start=1):
        amplitude = p.get(f"periodic_error_{i}.amplitude", 0.0)
        period = p.get(f"periodic_error_{i}.period", usual)
        error = error + amplitude * np.sin(2 * np.pi * x / period + p.get(f"periodic_error_{i}.phase", 0.0))
    return error


def corrected(p: Mapping[str, float], x_s: Array, ticks: int) -> Array:
    """Setpoints of all instants, those of the position controller (every `ticks`) with what the control adds."""
    taken = x_s[::ticks]
    side, s = _directions(p, taken)[0], np.zeros_like(taken)
    ramp, T_pos = p.get("backlash_compensation.ramp", 0.0), ticks * p["T_c"]
    most = 2 * T_pos / ramp if ramp else 2.0
    for k in range(1, len(taken)):
        s[k] = s[k - 1] + np.clip(side[k] - s[k - 1], -most, most)
    plus = _table(p, "leadscrew_compensation", taken)
    back = "leadscrew_compensation_minus"
    minus = _table(p, back, taken) if p.get(f"{back}.spacing", 0.0) else plus
    result = x_s.copy()
    result[::ticks] += s * p.get("backlash_compensation.value", 0.0) / 2 + (plus * (1 + s) + minus * (1 - s)) / 2
    return result


def _directions(p: Mapping[str, float], x: Array) -> tuple[Array, Array]:
    """Direction of a setpoint at its samples, 0 ahead of the first motion, and at reversals the way back from the
    furthest point, else 0. A way back up to the control's resolution is no reversal."""
    resolution = p.get("setpoint_resolution", 1e-7)
    side, back = np.zeros(len(x)), np.zeros(len(x))
    extremes, now = [x[0], x[0]], 0.0  # since the last reversal: least, largest
    for k, value in enumerate(x):
        extremes = [min(extremes[0], value), max(extremes[1], value)]
        fallen, risen = extremes[1] - value, value - extremes[0]
        way, turned = (risen, 1.0) if now < 0 or (now == 0 and risen > fallen) else (fallen, -1.0)
        if way > resolution:
            back[k] = way if now else 0.0
            extremes, now = [value, value], turned
        side[k] = now
    return side, back


def friction_pulse(p: Mapping[str, float], n_ffw: Array, ticks: int) -> Array:
    """Additions to the speed setpoint at the position instants (every `ticks`): one exponential per reversal."""
    T_pos, n = ticks * p["T_c"], n_ffw[::ticks]
    side = _directions(p, np.cumsum(n) * p["I_P"] * T_pos)[0]
    time, result = np.arange(len(n)) * T_pos, np.zeros(len(n))
    top, low = p.get("friction_pulse.amplitude", 0.0), p.get("friction_pulse.amplitude_min", 0.0)
    wait = max(0.0, p["T_dyn"] + p.get("friction_pulse.delay", 0.0))
    edges = [p.get(f"friction_pulse.acceleration_{i}", 0.0) for i in (1, 2, 3)]
    for k in range(1, len(n)):
        if side[k] * side[k - 1] < 0:
            first = k  # sample of the other sign
            while n[first - 1] * side[k] * p["I_P"] * T_pos > 1e-12:
                first -= 1
            a = abs(n[first] - n[first - 1]) * p["I_P"] / T_pos
            size = top
            if p.get("friction_pulse.adaptation", 0):
                size = top * a / edges[0] if a < edges[0] else float(np.interp(a, edges[1:], [top, low]))
            since = time - time[first] - wait
            begun = (since > -1e-9 * T_pos) & (time >= time[k])
            result[begun] = side[k] * size / p["I_P"] * np.exp(-since[begun] / p.get("friction_pulse.time", 0.05))
    return result


def friction_table(p: Mapping[str, float], n_ffw: Array, ticks: int) -> Array:
    """Torques at the position instants, over the speed of a while ago."""
    points = round(p.get("friction_table.points", 0))
    T_pos, n = ticks * p["T_c"], n_ffw[::ticks]
    if not points:
        return np.zeros(len(n))
    late = max(0.0, p["T_dyn"] + p["T_sym"] + p.get("friction_table.delay", 0.0))
    time = np.arange(len(n)) * T_pos
    n = np.interp(time - late, time, n, left=0.0)
    speed = np.abs(n) * p["I_P"]
    side, back = _directions(p, np.cumsum(n) * p["I_P"] * T_pos)
    way = np.zeros(len(n))
    for k in range(len(n)):
        way[k] = back[k] or (way[k - 1] if k else 0.0) + speed[k] * T_pos
    built = np.minimum(1.0, way / p["friction_table.distance"]) if p.get("friction_table.distance", 0.0) else 1.0
    speeds, torques = (
        [p.get(f"friction_table.{name}_{i}", 0.0) for i in range(points)] for name in ("speed", "torque")
    )
    return np.asarray(side * np.interp(speed, speeds, torques) * built)


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
