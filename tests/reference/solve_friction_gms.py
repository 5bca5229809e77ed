"""Reference of the unit friction_gms: every Maxwell element by itself, interval by interval between the knots of the
speed; where it begins to slip by bisection of the exact condition, slipping by extrapolation.

Steps and order are fixed: whatever processor computes it, the path is the same, and what differs is rounding.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from reference_files import Case, Table
from solve_friction import SHARED, extrapolated, level, over_knots

# start values of the unit
DEFAULTS = {**SHARED, "spread": 20.0, "skew": 0.0, "C": 200.0}
ELEMENTS = 10
LOOKS = 16  # at the condition within an interval, which it passes once or hardly ever twice
HALVINGS = 80
OWN_ERROR = 2e-12  # share of a column's range; where an element begins to slip hangs on a rounding of its torque


class Element:
    """Stiffness k [N.m/rad], share alpha of the torque, torque F [N.m], direction in which it slips or 0."""

    def __init__(self, k: float, alpha: float) -> None:
        self.k, self.alpha, self.F, self.slip = k, alpha, 0.0, 0


def elements(p: Mapping[str, float]) -> list[Element]:
    """The elements at rest and without torque."""
    deflections = [p["spread"] ** (i / (ELEMENTS - 1)) for i in range(ELEMENTS)]
    weights = [x ** p["skew"] for x in deflections]
    shares = [weight / math.fsum(weights) for weight in weights]
    soft = math.fsum(share / x for share, x in zip(shares, deflections, strict=True))
    return [Element(p["sigma_0"] * share / x / soft, share) for share, x in zip(shares, deflections, strict=True)]


def solve(case: Case, every: float, outputs: tuple[str, ...], finer: int = 1) -> Table:
    """The named outputs every `every` seconds, as solve_friction.solve() has them."""
    p = DEFAULTS | dict(case.parameters)
    parts = elements(p)
    return over_knots(
        case,
        every,
        ("M_fr", "z", "k"),
        outputs,
        lambda n: _shown(p, parts, n),
        lambda n0, n1, h: _interval(p, parts, n0, n1, h, finer),
    )


def _shown(p: Mapping[str, float], parts: list[Element], n: float) -> tuple[float, ...]:
    """M_fr [N.m], z and k at the speed n [rad/s]."""
    side = float(np.sign(n))
    force = math.fsum(each.F for each in parts)
    rate = math.fsum(each.k * (n - abs(n) * each.F / (each.alpha * level(p, n, side))) for each in parts)
    share = math.fsum(each.k for each in parts if not side or each.slip != side) / p["sigma_0"]
    return force + p["sigma_1"] / p["sigma_0"] * rate + p["sigma_2"] * n, force / p["sigma_0"], share


def _interval(p: Mapping[str, float], parts: list[Element], n0: float, n1: float, h: float, finer: int) -> None:
    """An interval of linear speed; split where the speed changes sign."""
    if n0 * n1 < 0:
        part = n0 / (n0 - n1)
        _interval(p, parts, n0, 0.0, part * h, finer)
        _interval(p, parts, 0.0, n1, (1 - part) * h, finer)
        return
    side = float(np.sign(n0 + n1))
    if n0 == 0:
        for each in parts:
            each.slip = 0
    if side:
        whole: tuple[float, float] | None = None
        for each in parts:
            begin = 0.0 if each.slip == side else _begin(p, each, n0, n1, h, side)
            if begin is None:
                each.F += each.k * (n0 + n1) / 2 * h
                each.slip = 0
                continue
            if begin > 0:
                each.F = side * each.alpha * level(p, n0 + (n1 - n0) * begin / h, side)
            each.slip = int(side)
            if begin == 0:
                whole = whole or _slipped(p, n0, n1, h, side, 0.0, finer)
                driven, kept = whole
            else:
                driven, kept = _slipped(p, n0, n1, h, side, begin, finer)
            each.F = side * each.alpha * driven + kept * each.F
    if n1 == 0:
        for each in parts:
            each.slip = 0


def _begin(p: Mapping[str, float], each: Element, n0: float, n1: float, h: float, side: float) -> float | None:
    """When a sticking element begins to slip [s]; None where it does not."""

    def over(t: float) -> float:
        force = each.F + each.k * (n0 + (n1 - n0) * t / h / 2) * t
        return side * force - each.alpha * level(p, n0 + (n1 - n0) * t / h, side)

    if over(0.0) >= 0:
        return 0.0
    for look in range(LOOKS):
        low, high = h * look / LOOKS, h * (look + 1) / LOOKS
        if over(high) >= 0:
            for _ in range(HALVINGS):
                middle = (low + high) / 2
                low, high = (low, middle) if over(middle) >= 0 else (middle, high)
            return high if high < h else None
    return None


def _slipped(
    p: Mapping[str, float], n0: float, n1: float, h: float, side: float, begin: float, finer: int
) -> tuple[float, float]:
    """Of an element that slips from `begin` on: its torque at the end is side alpha driven + kept F [N.m], [1]."""
    if n0 == n1:
        s = level(p, n0, side)
        kept = math.exp(-p["C"] * (h - begin) / s)
        return s * (1 - kept), kept

    def rate(t: float, x: float) -> float:
        return p["C"] * (1 - x / level(p, n0 + (n1 - n0) * t / h, side))

    ends = []
    for x in (0.0, 1.0):
        now, step = x, (h - begin) / finer
        for i in range(finer):
            now = extrapolated(rate, begin + i * step, now, step)
        ends.append(now)
    return ends[0], ends[1] - ends[0]
