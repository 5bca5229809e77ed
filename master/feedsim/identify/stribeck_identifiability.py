"""What plateaus cannot determine: parameters that are held for it, and warnings with their reason."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from feedsim.estimation.fit import Fit
from feedsim.identify.parameters import EXCESS, level
from feedsim.identify.record import Array
from feedsim.identify.result import Plateau

SAME_SPEED = 0.05  # relative difference up to which plateaus count as one speed
FEW_SPEEDS = 8
SLOW_ENOUGH = 50e-3 / 60  # m/s: a lowest speed above leaves the Stribeck range open at its lower end
# Relative standard deviation of v_s that asks whether there is a Stribeck effect at all, and for a warning.
V_S_WARNED = 0.3
FALL_SIGMAS = 2.0  # standard deviations that a fall of torque over speed must have
LIKE = 0.99  # correlation above which two parameters are one
VARIED = 0.05  # range of the level over its mean that separates an asymmetry from a constant load


@dataclass(frozen=True, eq=False)
class Points:
    """Plateaus as arrays (K,): speed [rad/s], torque [N.m], sigma [N.m], age [1] from the first one at 0 to the last
    one at 1; and their distinct speeds (S,) [rad/s]."""

    speed: Array
    torque: Array
    sigma: Array
    age: Array
    speeds: Array

    @classmethod
    def of(cls, plateaus: Sequence[Plateau]) -> Points:
        """No plateau's torque counts as known better than 2e-5 of it: rounding of the trace lies there."""
        torque = np.array([plateau.torque for plateau in plateaus])
        sigma = np.hypot([plateau.sigma for plateau in plateaus], 2e-5 * np.max(np.abs(torque)))
        speed = np.array([plateau.speed for plateau in plateaus])
        ordered = np.sort(np.abs(speed))
        starts = np.concatenate([[True], np.diff(ordered) > SAME_SPEED * ordered[1:]])
        groups = np.cumsum(starts) - 1
        elapsed = np.array([plateau.elapsed for plateau in plateaus])
        age = (elapsed - np.min(elapsed)) / (float(np.ptp(elapsed)) or 1.0)
        return cls(speed, torque, sigma, age, np.bincount(groups, weights=ordered) / np.bincount(groups))

    @property
    def both(self) -> bool:
        """Whether there are plateaus in both directions."""
        return bool(np.any(self.speed > 0) and np.any(self.speed < 0))

    def friction(self) -> tuple[Array, Array]:
        """(S,) mean |torque| per speed, and its standard deviation: free of M_0 where both directions are there."""
        nearest = np.argmin(np.abs(np.abs(self.speed)[:, None] - self.speeds[None, :]), axis=1)
        means, sigmas = [], []
        for k in range(len(self.speeds)):
            sides = [(nearest == k) & (np.sign(self.speed) == side) for side in (1.0, -1.0)]
            result = [np.mean(np.abs(self.torque[side])) for side in sides if np.any(side)]
            means.append(float(np.mean(result)))
            sigmas.append(float(np.sqrt(np.mean(self.sigma[nearest == k] ** 2) / np.sum(nearest == k))))
        return np.array(means), np.array(sigmas)


def falls(points: Points) -> bool:
    """Whether the torque falls with speed somewhere: the Stribeck effect shows."""
    torque, sigma = points.friction()
    for slow in range(len(torque)):
        drop = torque[slow] - torque[slow + 1 :]
        if np.any(drop > FALL_SIGMAS * np.hypot(sigma[slow], sigma[slow + 1 :])):
            return True
    return False


def too_few(points: Points, free: Sequence[str]) -> dict[str, str]:
    """Curve parameters among `free` that so few speeds do not determine, name -> reason: more than there are speeds."""
    count = len(points.speeds)
    result: dict[str, str] = {}
    ranks = ["F_C", EXCESS, "sigma_2", "F_log", "v_s", "v_log", "beta"]
    if not falls(points) and count < 6:
        reason = f"the torque does not fall with speed at any of {count} speed(s): no Stribeck effect shows"
        result |= {name: reason for name in (EXCESS, "v_s", "beta") if name in free}
    wanted = [name for name in ranks if name in free and name not in result]
    few = f"{count} speed(s) do not determine {len(wanted)} parameters of the curve"
    result |= {name: few for name in wanted[count:]}
    wanted = wanted[:count]
    load = [name for name in ("M_0", "asymmetry") if name in free and points.both]
    if "asymmetry" in load and (count < 2 or len(wanted) + len(load) > len(points.speed)):
        load.remove("asymmetry")
        result["asymmetry"] = (
            f"{len(points.speed)} plateau(s) at {count} speed(s) do not separate it from the constant load M_0"
        )
    room = max(len(points.speed) - len(load), 1)
    return result | {name: f"{len(points.speed)} plateaus do not determine more" for name in wanted[room:]}


def unseparated(points: Points) -> dict[str, str]:
    """M_0 and asymmetry where one direction is missing."""
    if points.both:
        return {}
    return {name: "plateaus in one direction only do not separate it from friction" for name in ("M_0", "asymmetry")}


def unanswered(points: Points, fit: Fit, values: dict[str, float]) -> dict[str, str]:
    """Free parameters that the fit shows to be untold: they are held then, name -> reason."""
    reported: dict[str, str] = {}
    free = set(fit.names)
    if "v_s" in free and points.speeds[0] > 3 * values["v_s"]:
        reason = (
            f"no plateau lies within the Stribeck range: the lowest speed is {points.speeds[0]:.3g} rad/s, "
            f"v_s is about {values['v_s']:.2g} rad/s or less"
        )
        reported |= {name: reason for name in ("v_s", EXCESS, "beta") if name in free}
    if "v_s" in free and values[EXCESS] <= 0:
        reported |= {name: "no Stribeck effect: F_S is F_C" for name in ("v_s", "beta") if name in free}
    if reported:
        return reported
    reach = level(values, points.speeds)
    if "F_log" in free and fit.sigma["F_log"] > float(np.mean(reach)):
        return {
            "F_log": f"speeds from {points.speeds[0]:.3g} to {points.speeds[-1]:.3g} rad/s do not separate it from "
            "sigma_2"
        }
    if "asymmetry" in free:
        if np.ptp(reach) < VARIED * np.mean(reach):
            return {
                "asymmetry": f"the level of friction varies by {100 * np.ptp(reach) / np.mean(reach):.1f} % over the "
                "speeds only: that does not separate it from the constant load M_0"
            }
        if fit.sigma["asymmetry"] > 0.1:
            return {
                "asymmetry": f"it would be known to {fit.sigma['asymmetry']:.2g} only: the level of friction varies "
                "too little over the speeds to separate it from the constant load M_0"
            }
    return {name: "the torque at these speeds does not depend on it" for name in fit.silent}


def warnings(points: Points, fit: Fit, matrix: Array, names: Sequence[str], I_P: float | None) -> list[str]:
    """About plateaus and the fit that stands. matrix: correlation of `names` (the parameters as they are reported)."""
    said: list[str] = []
    slowest = float(points.speeds[0])
    if I_P is not None and slowest * I_P > SLOW_ENOUGH:
        said.append(
            f"the lowest speed is {slowest * I_P * 60e3:.3g} mm/min, above 50 mm/min: F_S and v_s rest on what lies "
            "below; drive plateaus from 10 mm/min on"
        )
    if len(points.speeds) < FEW_SPEEDS:
        said.append(
            f"{len(points.speeds)} speed(s), fewer than {FEW_SPEEDS}: the shape of the curve between them is not "
            "checked; drive 12 speeds in equal ratios"
        )
    if not points.both:
        said.append(
            "plateaus in one direction only: the constant load M_0 and an asymmetry are taken for friction; drive "
            "both directions"
        )
    sigma = fit.sigma
    if "v_s" in sigma and sigma["v_s"] > V_S_WARNED * fit["v_s"]:
        said.append(
            f"v_s is known to {100 * sigma['v_s'] / fit['v_s']:.0f} % only: add plateaus about "
            f"{_speed(fit['v_s'], I_P)}, or make them longer"
        )
    if "F_log" in sigma and sigma["F_log"] > max(0.3 * fit["F_log"], 0.02 * float(np.max(np.abs(points.torque)))):
        said.append(
            f"F_log ({fit['F_log']:.3g} -+ {sigma['F_log']:.2g} N.m) is hardly separated from sigma_2 and F_C: add "
            "speeds from well below to well above v_log; the curve itself may be good"
        )
    for name in fit.at_bound:
        shown = "F_S - F_C" if name == EXCESS else name
        said.append(f"{shown} sits at its bound {fit[name]:.4g}: the model's shape does not fit, or it is not there")
    for row, first in enumerate(names):
        for column in range(row):
            pair = {first, names[column]}
            # M_0 and asymmetry go together by their definition; whether they are separated is looked at on its own.
            if abs(matrix[row, column]) > LIKE and pair != {"M_0", "asymmetry"}:
                said.append(
                    f"{names[column]} and {first} are correlated by {matrix[row, column]:+.3f}: the data determine "
                    "their combination, not each of them; the curve is not worse for it. Add speeds, or "
                    "hold one of them"
                )
    return said


def _speed(value: float, I_P: float | None) -> str:
    return f"{value:.3g} rad/s" if I_P is None else f"{value:.3g} rad/s ({value * I_P * 60e3:.3g} mm/min)"
