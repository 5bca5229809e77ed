"""Friction unit's reference: Eqs. 1-7 by extrapolation, interval by interval between the knots of the speed.

Steps and order are fixed: whatever processor computes it, the path is the same, and what differs is rounding.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from reference_files import Case, Table

# Z axis of the synthetic default machine, the units' start values: what laws share, and what this one has besides
SHARED = {
    "sigma_0": 300.0,
    "sigma_1": 0.8,
    "sigma_2": 0.006,
    "F_C": 1.6,
    "F_S": 2.1,
    "v_s": 0.6,
    "beta": 1.0,
    "F_log": 0.4,
    "v_log": 3.0,
    "asymmetry": 0.0,
}
DEFAULTS = {**SHARED, "W": 0.04, "gamma": 0.35}

# Gragg's modified midpoint rule with 2 to 12 substeps, extrapolated to order 12 in steps of half a relaxation of the
# bristles (g/|n|), one per interval at least, a control cycle: |n|^beta has no third derivative at n = 0. Twice as
# many change nothing above `OWN_ERROR` (test_reference.py).
SUBSTEPS = (2, 4, 6, 8, 10, 12)
RELAXATION = 0.5
LEAST = 1
OWN_ERROR = 2e-13  # share of a column's range


def level(p: Mapping[str, float], n: float, side: float) -> float:
    """s(n) [N.m] at the speed n [rad/s]; `side`: sign of the direction of travel."""
    speed = abs(n)
    stribeck = math.exp(-((speed / p["v_s"]) ** p["beta"]))
    rise = p["F_log"] * math.log(speed / p["v_log"] + 1)
    return (p["F_C"] + (p["F_S"] - p["F_C"]) * stribeck + rise) * (1 + p["asymmetry"] * side)


def steady_deflection(p: Mapping[str, float], n: float, side: float) -> float:
    """g(n) of Eq. 7 [rad], likewise."""
    return level(p, n, side) / p["sigma_0"]


def engagement(p: Mapping[str, float], z: float, c: float) -> tuple[float, float]:
    """lambda (Eq. 3) and k (Eq. 2); pure LuGre is fully engaged."""
    if p["W"] == 0:
        return 1.0, 1.0
    engaged = (p["W"] / 2 + (c if z >= 0 else -c)) / p["W"]
    return engaged, p["gamma"] + engaged * (1 - p["gamma"])


def solve(case: Case, every: float, outputs: tuple[str, ...], finer: int = 1) -> Table:
    """The named outputs every `every` seconds; every sampling instant must be a knot of the input.

    Where the case's inputs are held, they must have a row at every step: the speed of a row holds until the next one,
    for which Eq. 6 has a closed form, and the outputs at a row still belong to the speed ahead of it. `finer`: times as
    many steps of the integration.
    """
    p = DEFAULTS | dict(case.parameters)
    state = 0.0, 0.0

    def step(n0: float, n1: float, h: float) -> None:
        nonlocal state
        state = _held(p, *state, n0, h) if case.held else _interval(p, *state, n0, n1, h, finer)

    columns = ("M_fr", "z", "c", "k", "lambda")
    return over_knots(case, every, columns, outputs, lambda n: _shown(p, n, *state), step)


def over_knots(
    case: Case,
    every: float,
    columns: tuple[str, ...],
    outputs: tuple[str, ...],
    shown: Callable[[float], tuple[float, ...]],
    step: Callable[[float, float, float], None],
) -> Table:
    """The outputs of a friction law, of the columns that `shown` has at a speed, from knot to knot of the speed.

    step: of a law from one speed to the next within h seconds.
    """
    time, speed = case.inputs["time"], case.inputs["n_fr"]
    rows: list[tuple[float, ...]] = []
    for i, (t, n) in enumerate(zip(time, speed, strict=True)):
        if abs(t / every - round(t / every)) < 1e-6:
            rows.append((t, *shown(speed[max(i - 1, 0)] if case.held else n)))
        if i + 1 < len(time):
            step(n, n if case.held else speed[i + 1], time[i + 1] - t)
    table = dict(zip(("time", *columns), np.array(rows).T, strict=True))
    return {name: table[name] for name in ("time", *outputs)}


def _shown(p: Mapping[str, float], n: float, z: float, c: float) -> tuple[float, ...]:
    """M_fr [N.m], z, c, k and lambda at the speed n [rad/s]."""
    rate = n - abs(n) / steady_deflection(p, n, math.copysign(1, n)) * z
    engaged, k = engagement(p, z, c)
    return k * p["sigma_0"] * z + p["sigma_1"] * rate + p["sigma_2"] * n, z, c, k, engaged


def _held(p: Mapping[str, float], z: float, c: float, n: float, h: float) -> tuple[float, float]:
    """z and c after h seconds at the constant speed n: Eq. 6 is linear then."""
    half = p["W"] / 2
    c = min(max(c + n * h, -half), half)
    if n == 0:
        return z, c
    g, side = steady_deflection(p, n, math.copysign(1, n)), math.copysign(1, n)
    return side * g + (z - side * g) * math.exp(-abs(n) * h / g), c


def _interval(
    p: Mapping[str, float], z: float, c: float, n0: float, n1: float, h: float, finer: int
) -> tuple[float, float]:
    """z and c after an interval of linear speed; split where the speed changes sign, a kink of the equation."""
    if n0 * n1 < 0:
        part = n0 / (n0 - n1)
        z, c = _interval(p, z, c, n0, 0.0, part * h, finer)
        return _interval(p, z, c, 0.0, n1, (1 - part) * h, finer)
    if n0 == 0 and n1 == 0:
        return z, c
    side = math.copysign(1, n0 + n1)

    def rate(t: float, z: float) -> float:
        n = n0 + (n1 - n0) * t / h
        return n - abs(n) / steady_deflection(p, n, side) * z

    fastest = max(abs(n) / steady_deflection(p, n, side) for n in (n0, n1))
    steps = max(LEAST, math.ceil(fastest * h / RELAXATION)) * finer
    for i in range(steps):
        z = extrapolated(rate, i * h / steps, z, h / steps)
    half = p["W"] / 2
    return z, min(max(c + (n0 + n1) / 2 * h, -half), half)


def extrapolated(rate: Callable[[float, float], float], t: float, z: float, h: float) -> float:
    """z after a step of h seconds: midpoint rules, the even powers of their substeps extrapolated away (Neville)."""
    found: list[float] = []
    for row, count in enumerate(SUBSTEPS):
        part = h / count
        before, now = z, z + part * rate(t, z)
        for i in range(1, count):
            before, now = now, before + 2 * part * rate(t + i * part, now)
        better = (before + now + part * rate(t + h, now)) / 2
        for back in range(row):
            found[back], better = (
                better,
                better + (better - found[back]) / ((count / SUBSTEPS[row - 1 - back]) ** 2 - 1),
            )
        found.append(better)
    return found[-1]
