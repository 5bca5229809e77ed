"""Friction that changes while plateaus are driven: what speeds that come back show, and what they do not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from feedsim.estimation.interval import NORMAL_95
from feedsim.identify.parameters import curve, torque
from feedsim.identify.record import Array
from feedsim.identify.result import Plateau
from feedsim.identify.stribeck_identifiability import SAME_SPEED

SAME_SPEED_SHARE = 0.02  # relative difference up to which a speed counts as repeated
DRIFT_SIGMAS, LEAST_DRIFT = 4.0, 2e-3  # standard deviations, and share of the friction, that a drift must have
# Standard deviation of the relative change of viscous friction from the first plateau to the last one: grease and oil
# lose a third and more of it while a cold axis warms up.
WARMS = 0.25
WORTH_A_WORD = 0.05  # of sigma_2: standard deviation by warming that is worth a warning


def warming(age: Array) -> Array:
    """(K, K) covariance of the relative change of viscous friction since the first plateau, in WARMS^2.

    age: (K,) time of the plateaus, from the first one at 0 to the last one at 1. Nobody knows the course: a change at
    once, an even one and one at random (Brownian motion) have equal shares in it.
    """
    later = np.asarray(age > 0, dtype=np.float64)
    return np.asarray((np.outer(later, later) + np.outer(age, age) + np.minimum(age[:, None], age[None, :])) / 3)


def hides(drifts: float, sigma_2: float) -> tuple[str, ...]:
    """A warning where warming that the speeds do not show leaves sigma_2 open.

    drifts: the part of its standard deviation [N.m.s/rad] by warming. The interval itself is that of all records
    together, which is printed with the value.
    """
    if not drifts > WORTH_A_WORD * sigma_2:
        return ()
    return (
        "no fast speed is driven both early and late: viscous friction that falls as the axis warms up is not "
        f"separated from the shape of the curve; the plateaus alone leave +-{100 * NORMAL_95 * drifts / sigma_2:.2g} "
        "% of sigma_2 open by that; drive the fastest speed first and last, or warm the axis up before",
    )


def repeats(plateaus: Sequence[Plateau]) -> list[tuple[int, int]]:
    """The first and the last plateau of each direction and speed that came back after another speed."""
    result = []
    for k, first in enumerate(plateaus):
        like = [
            m
            for m, other in enumerate(plateaus)
            if abs(other.speed - first.speed) <= SAME_SPEED_SHARE * abs(first.speed)
        ]
        between = (abs(abs(other.speed) - abs(first.speed)) for other in plateaus[k : like[-1]])
        if like[0] == k and any(away > SAME_SPEED * abs(first.speed) for away in between):
            result.append((k, like[-1]))
    return result


def repeated(
    plateaus: Sequence[Plateau], values: Mapping[str, float], names: Sequence[str]
) -> tuple[Array, tuple[str, ...]]:
    """(P,) variance of `names` by friction that was another when a speed came back, and a sentence about it."""
    variance, worst = np.zeros(len(names)), 0.0
    said: tuple[str, ...] = ()
    for k, m in repeats(plateaus):
        first, last = plateaus[k], plateaus[m]
        n = np.array([first.speed, last.speed])
        before, after = np.array([first.torque, last.torque]) - torque(values, n)
        change, friction, size = float(after - before), float(curve(values, n[:1])[0]), abs(first.speed)
        if abs(change) < max(DRIFT_SIGMAS * float(np.hypot(first.sigma, last.sigma)), LEAST_DRIFT * friction):
            continue
        # What each would have to change by to make the difference alone, from the first plateau to the last one of all.
        reach = {"sigma_2": size, "F_log": float(np.log1p(size / values["v_log"])), "F_C": 1.0, "F_S": 1.0}
        whole = change * (len(plateaus) - 1) / (m - k)
        moved = np.array([whole / reach[name] if name in reach else 0.0 for name in names])
        variance = np.maximum(variance, (moved / NORMAL_95) ** 2)
        if abs(change) / friction > worst:
            worst = abs(change) / friction
            way = "fell" if change * first.speed < 0 else "rose"
            said = (
                f"friction at {size:.3g} rad/s {way} by {100 * worst:.2g} % between {first.begin:.4g} s "
                f"({first.record}) and {last.begin:.4g} s ({last.record}): it drifts, as with temperature; the "
                "parameters are a mean, and their intervals hold the drift; warm the axis up and record again",
            )
    return variance, said
