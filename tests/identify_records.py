"""Records of an axis at constant speeds for tests of identification, from a friction law of their own.

The bristles (Eq. 6) are stepped in plain Python with the exact solution at the mean speed of a step, the engaging zone
(Eqs. 2-4) beside them, at eight steps per row. What is identified knows nothing of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import copysign, exp, log1p

import numpy as np
from numpy.typing import NDArray

from feedsim.estimation.identify.record import Record

Array = NDArray[np.float64]

I_P = 0.02 / (2 * np.pi)  # m/rad
J = 0.01639  # kg.m2
# Synthetic, like the default machine's Z axis.
TRUE = {
    "F_C": 1.6, "F_S": 2.1, "v_s": 0.6, "beta": 1.0, "F_log": 0.4, "v_log": 3.0, "sigma_2": 0.006,
    "asymmetry": 0.0, "M_0": 0.0, "sigma_0": 300.0, "sigma_1": 0.8, "W": 0.04, "gamma": 0.35,
}  # fmt: skip
SPEEDS = np.geomspace(10.0, 20000.0, 12) / 60e3 / I_P  # rad/s
FINE = 8  # steps per row


def level(p: Mapping[str, float], n: float) -> float:
    """Static level with its sign's asymmetry [N.m]."""
    size = abs(n)
    stribeck = (p["F_S"] - p["F_C"]) * exp(-((size / p["v_s"]) ** p["beta"]))
    return (1 + p["asymmetry"] * copysign(1.0, n)) * (p["F_C"] + stribeck + p["F_log"] * log1p(size / p["v_log"]))


def stationary(p: Mapping[str, float], n: float) -> float:
    """Motor torque at constant speed [N.m]."""
    return copysign(level(p, n), n) + p["sigma_2"] * n + p["M_0"]


def strokes(
    speeds: Sequence[float], durations: Sequence[float], interval: float, *, acceleration: float, both: bool = True
) -> tuple[Array, Array, Array]:
    """Time, speed and acceleration of strokes there and back, on the fine grid: raised-cosine changes of speed."""
    h = interval / FINE
    parts = [(np.zeros(round(0.2 / h)), np.zeros(round(0.2 / h)))]
    for speed, duration in zip(speeds, durations, strict=True):
        for side in (1.0, -1.0) if both else (1.0,):
            # A multiple of whole rows, at least 60 ms: the jerk is limited.
            rise = max(round(np.pi / 2 * speed / acceleration / interval), round(0.06 / interval)) * FINE
            phase = np.pi * np.arange(rise) / rise
            up, rate = 0.5 - 0.5 * np.cos(phase), 0.5 * np.sin(phase) * np.pi / (rise * h)
            hold, rest = round(duration / interval) * FINE, round(0.2 / interval) * FINE
            shape = np.concatenate([up, np.ones(hold), 1 - up, np.zeros(rest)])
            slope = np.concatenate([rate, np.zeros(hold), -rate, np.zeros(rest)])
            parts.append((side * speed * shape, side * speed * slope))
    speed, rate = (np.concatenate(column) for column in zip(*parts, strict=True))
    return np.arange(len(speed)) * h, speed, rate


def friction(p: Mapping[str, float], n: Array, h: float) -> Array:
    """M_fr [N.m] at every fine row."""
    z = c = 0.0
    found = np.empty(len(n))
    for i, now in enumerate(n.tolist()):
        depth = level(p, now) / p["sigma_0"]
        share = (0.5 + copysign(1.0, z) * c / p["W"]) if p["W"] else 1.0
        k = p["gamma"] + share * (1 - p["gamma"])
        found[i] = k * p["sigma_0"] * z + p["sigma_1"] * (now - abs(now) / depth * z) + p["sigma_2"] * now
        if now and i + 1 < len(n):
            middle = 0.5 * (now + float(n[i + 1]))
            depth = level(p, middle or now) / p["sigma_0"]
            goal = copysign(depth, middle)
            z = goal + (z - goal) * exp(-abs(middle) * h / depth)
            c = min(max(c + middle * h, -p["W"] / 2), p["W"] / 2)
    return found


def constant_speeds(
    p: Mapping[str, float] = TRUE,
    speeds: Sequence[float] = tuple(SPEEDS),
    durations: Sequence[float] | None = None,
    *,
    interval: float = 2e-3,
    inertia: float = J,
    acceleration: float = 3000.0,
    ringing: float = 0.3,
    both: bool = True,
) -> Record:
    """Undisturbed record with angle and speed. ringing: amplitude [N.m] of a 21 Hz ring-down, damping 6 %, that begins
    with every stroke. durations default: 1 s, and as long as 1 mm takes."""
    if durations is None:
        durations = [max(1.0, 1e-3 / I_P / speed) for speed in speeds]
    time, n, rate = strokes(speeds, durations, interval, acceleration=acceleration, both=both)
    h = interval / FINE
    torque = friction(p, n, h) + p["M_0"] + inertia * rate
    starts = np.flatnonzero((n[1:] != 0) & (n[:-1] == 0))
    for start in starts:
        after = time[start:] - time[start]
        omega = 2 * np.pi * 21.0
        torque[start:] += ringing * np.exp(-0.06 * omega * after) * np.sin(omega * after)
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (n[1:] + n[:-1]) * h)])
    rows = slice(None, None, FINE)
    return Record("strokes", time[rows], torque[rows], angle[rows], n[rows])


def noisy(record: Record, share: float, seed: int, p: Mapping[str, float] = TRUE) -> Record:
    """White noise on the torque, a share of the stationary torque at that speed (at rest: of the lowest)."""
    assert record.speed is not None
    at = np.array([abs(stationary({**p, "M_0": 0.0}, n)) if n else p["F_C"] for n in record.speed.tolist()])
    noise = share * at * np.random.default_rng(seed).standard_normal(len(at))
    return Record(record.name, record.time, record.torque + noise, record.angle, record.speed, record.load)
