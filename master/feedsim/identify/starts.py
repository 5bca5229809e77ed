"""First values for the output-error fit, read off the data."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from feedsim.identify.torque import RecordTorque

Array = NDArray[np.float64]

SLIDING = 0.1  # of the highest speed: above, the friction is taken as Coulomb plus viscous
AFTER_REVERSAL = 3  # rows: what the stiffest bristle that a record can show deflects in
PER_DECADE = 3  # starts of the stiffness
MOST_STIFFNESSES = 10
ZONES = (3.0, 7.0, 14.0)  # width of the engaging zone over the largest deflection F_C/sigma_0
SHARES = (0.25, 0.6)  # gamma
PURE = (0.0, 1.0)  # W and gamma of pure LuGre


def sliding(models: Sequence[RecordTorque], values: Mapping[str, float], unknown: Collection[str]) -> dict[str, float]:
    """J, sigma_2, F_C and M_0, as far as they are `unknown`, by linear least squares where the axis slides.

    Moves that hardly slide leave F_C: the largest friction torques (95 % of them lie below) stand for it.
    """
    rows = [model.moved(values["delay"]) for model in models]
    speed = np.concatenate([row[1] for row in rows])
    acceleration = np.concatenate([row[2] for row in rows])
    torque = np.concatenate([model.measured - row[3] for model, row in zip(models, rows, strict=True)])
    fast = np.abs(speed) > SLIDING * np.max(np.abs(speed))
    shapes = {"J": acceleration, "sigma_2": speed, "F_C": np.sign(speed), "M_0": np.ones_like(speed)}
    names = [name for name in shapes if name in unknown]
    if not names:
        return {}
    known = sum((values[name] * shapes[name] for name in shapes if name not in unknown), np.zeros_like(speed))
    matrix = np.column_stack([shapes[name] for name in names])[fast]
    scale = np.linalg.norm(matrix, axis=0)
    weights = np.linalg.lstsq(matrix / scale, (torque - known)[fast], rcond=None)[0] / scale
    found = dict(zip(names, map(float, weights), strict=True))
    if "J" in found and found["J"] <= 0:
        found["J"] = 1e-3 * float(np.std(torque) / max(np.std(acceleration), 1e-300))
    if "sigma_2" in found:
        found["sigma_2"] = max(found["sigma_2"], 0.0)
    if "F_C" in found and not found["F_C"] > 0:
        inertia = found.get("J", values["J"]) * acceleration
        found["F_C"] = float(np.quantile(np.abs(torque - inertia - found.get("M_0", values["M_0"])), 0.95))
    return found


def stiffnesses(models: Sequence[RecordTorque], values: Mapping[str, float]) -> Array:
    """Starts of sigma_0 [N.m/rad], in equal ratios.

    The least: the range of the friction torque over that of the angle, where that is largest (no spring of a bristle is
    softer than what the smallest move shows). The most: the friction turns round within a few rows of a reversal.
    """
    least, steps = 0.0, []
    for model in models:
        friction = model.friction_measured(values)
        speed = model.moved(values["delay"])[1]
        interval = model.motion.interval
        for k in range(len(model.parts)):
            own = np.flatnonzero(model.stretch == k)
            angle = np.cumsum(speed[own]) * interval
            reach = float(np.quantile(friction[own], 0.98) - np.quantile(friction[own], 0.02))
            least = max(least, reach / max(float(np.ptp(angle)), 1e-300))
            turns = np.flatnonzero(speed[own][1:] * speed[own][:-1] < 0) + 1
            turns = turns[turns + AFTER_REVERSAL < len(own)]
            steps.append(np.abs(angle[turns + AFTER_REVERSAL] - angle[turns]))
    travelled = np.concatenate(steps) if steps else np.zeros(0)
    most = 4 * least
    if len(travelled) and np.median(travelled) > 0:
        most = max(most, 2 * values["F_C"] / float(np.median(travelled)))
    count = int(np.clip(round(PER_DECADE * np.log10(most / least)) + 1, 4, MOST_STIFFNESSES))
    return np.geomspace(least, most, count)


def grid(
    models: Sequence[RecordTorque], values: Mapping[str, float], free: Collection[str], count: int
) -> list[dict[str, float]]:
    """The `count` best sets of sigma_0, sigma_1, W, gamma of a grid, each of another W and gamma; the best one first.

    The law is linear in sigma_1: its best value comes with every point of the grid. Parameters that are not free keep
    their values.
    """
    zones = [PURE, *((zone, share) for zone in ZONES for share in SHARES)]
    shapes: Sequence[tuple[float, float] | None] = zones if {"W", "gamma"} <= set(free) else [None]
    levels = stiffnesses(models, values) if "sigma_0" in free else np.array([values["sigma_0"]])
    found: list[tuple[float, dict[str, float]]] = []
    for shape in shapes:
        best: tuple[float, dict[str, float]] | None = None
        for sigma_0 in levels:
            trial = {**values, "sigma_0": float(sigma_0)}
            if shape is not None:
                trial |= {"W": shape[0] * values["F_C"] / float(sigma_0), "gamma": shape[1]}
            cost = _damped(models, trial, "sigma_1" in free)
            if best is None or cost < best[0]:
                best = cost, trial
        assert best is not None
        found.append(best)
    found.sort(key=lambda pair: pair[0])
    return [trial for _, trial in found[:count]]


def _damped(models: Sequence[RecordTorque], trial: dict[str, float], free: bool) -> float:
    """Sum of squares over the stretches' torque power, with the best sigma_1 put into the trial."""
    ends = []
    for sigma_1 in (0.0, 1.0) if free else (trial["sigma_1"],):
        trial["sigma_1"] = sigma_1
        ends.append(
            np.concatenate([model.residual(trial, 0.0, 0.0) / model.recorded_rms()[model.stretch] for model in models])
        )
    if not free:
        return float(np.sum(ends[0] ** 2))
    slope = ends[1] - ends[0]
    trial["sigma_1"] = max(0.0, -float(slope @ ends[0]) / max(float(slope @ slope), 1e-300))
    return float(np.sum((ends[0] + trial["sigma_1"] * slope) ** 2))
