"""Inertia from accelerating parts: inverse dynamics of a rigid axis, linear in its parameters.

    M = J dn/dt + sigma_2 n + F_C sgn n + M_0 (+ known load)

Both sides pass the same low-pass without phase, as is usual for robots (M. Gautier, ICRA 1997). It is a finite window
here, and only windows within which the axis moves in one direction are taken: nothing of rest or of a reversal, where
sgn n is no model of friction, leaks into them. Derivatives are taken of the window, never of the recorded signal.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil

import numpy as np

from feedsim.estimation.fit import correlation
from feedsim.estimation.identify.parameters import RIGID_AXIS_NAMES, estimate, torque
from feedsim.estimation.identify.plateaus import white
from feedsim.estimation.identify.record import Array, Record, runs
from feedsim.estimation.identify.result import Correlation, Estimate
from feedsim.foundation.errors import Finding, InputError

# Length of the Hann window of the low-pass [s]: -6 dB at 1/SHORT_WINDOW. It is doubled, up to LONG_WINDOW, as long as
# noise of the motion makes up more than the share NOISE_SHARE of the acceleration's variance (that share is what J
# comes out too small by).
SHORT_WINDOW, LONG_WINDOW, NOISE_SHARE = 0.04, 0.32, 1e-3
OVERLAP = 4  # rows that are kept per window length
REST_SPEED_SHARE = 0.003  # share of the highest speed of all records below which the axis counts as near rest
SMOOTH = 0.02  # [s] that the speed is averaged over for that


@dataclass(frozen=True, eq=False)
class Inertia:
    """Inverse-dynamics least squares.

    Attributes:
        estimates: J, sigma_2, F_C, M_0; the last three of the simple friction model, as they are good to start from.
        covariance: in the order of correlation.names, with the residuals' autocorrelation accounted for.
        speeds: (K,) that are usual in either direction [rad/s].
        rms: residual of the filtered torque [N.m]. rows: filtered rows. window: length of the low-pass [s].
    """

    estimates: Mapping[str, Estimate]
    correlation: Correlation
    covariance: Array
    rms: float
    rows: int
    window: float
    warnings: tuple[Finding, ...]
    speeds: Array

    @property
    def J(self) -> Estimate:
        """Inertia [kg.m2]."""
        return self.estimates["J"]


MIN_INERTIA_ROWS = 20
SPEED_QUANTILES = (0.05, 0.5, 0.95)  # quantiles of the speeds that count as usual
CONTRADICTS = 0.5  # of the friction, or of the inertia: by how much line and curve may differ, besides
SIGNIFICANT_SIGMAS = 4.0  # standard deviations of the line
SIMPLE = "a rigid axis with simple friction"
LEAST_SHARE = 0.05  # of the torque (rms) that accelerates, below which the friction model's faults may pass for J
J_WARNED = 0.1  # relative standard deviation of J that is worth a warning


def inertia(records: Sequence[Record]) -> Inertia:
    """J with sigma_2, F_C and M_0 from every part of the records where the axis moves.

    Raises InputError: nothing moves long enough; the axis does not accelerate.
    """
    length = SHORT_WINDOW
    # One threshold for all: what a record of small motions holds is pre-sliding, which is no F_C sgn n.
    slow = REST_SPEED_SHARE * max((float(np.max(np.abs(smooth_speed(r)))) for r in records), default=0.0)
    while True:
        stretches = [stretch for record in records for stretch in _stretches(record, length, slow)]
        rows = sum(len(stretch.torque) for stretch in stretches)
        if rows < MIN_INERTIA_ROWS:
            raise InputError(
                f"{', '.join(record.name for record in records)}: the axis does not move for {length:g} s in one "
                "direction often enough to determine its inertia; give the inertia, or record moves that accelerate"
            )
        acceleration = np.concatenate([stretch.columns[:, 0] for stretch in stretches])
        noise = max(stretch.noise for stretch in stretches)
        if noise**2 <= NOISE_SHARE * float(np.mean(acceleration**2)) or 2 * length > LONG_WINDOW:
            break
        length *= 2
    return _solve(stretches, length)


@dataclass(frozen=True, eq=False)
class _Stretch:
    """Filtered rows of one move in one direction: columns (N, 4) and torque (N,); noise of the acceleration."""

    columns: Array
    torque: Array
    noise: float


def _stretches(record: Record, length: float, slow: float) -> list[_Stretch]:
    """Filtered moves of a record."""
    h = record.interval
    kernel = np.sin(np.pi * np.arange(max(round(length / h), 4) + 1) / max(round(length / h), 4)) ** 2
    kernel /= np.sum(kernel)
    size = len(kernel)
    if len(record) <= size:
        return []
    padded = np.concatenate([[0.0], kernel, [0.0]])
    # By parts: the window's derivatives in place of the signal's. Both vanish beyond its ends.
    first, second = -(padded[2:] - padded[:-2]) / (2 * h), np.diff(padded, 2) / h**2
    torque = record.torque if record.load is None else record.torque - record.load
    ways = []
    if record.speed is not None:
        ways.append((white(record.speed) * float(np.linalg.norm(first)), record.speed, kernel, first))
    if record.angle is not None:
        ways.append((white(record.angle) * float(np.linalg.norm(second)), record.angle, first, second))
    # The one that determines the acceleration with less noise.
    noise, signal, to_speed, to_acceleration = min(ways, key=lambda way: way[0])
    speed = smooth_speed(record)
    moving = np.abs(speed) > slow
    moving[1:] &= np.sign(speed[1:]) == np.sign(speed[:-1])
    if record.clipped is not None:
        moving &= ~record.clipped
    stretches = []
    for begin, end in runs(moving):
        if end - begin < size:
            continue
        part = slice(begin, end)
        step = max(size // OVERLAP, 1)
        side = float(np.sign(speed[(begin + end) // 2]))
        count = len(range(0, end - begin - size + 1, step))
        columns = [
            _apply(to_acceleration, signal[part], step),
            _apply(to_speed, signal[part], step),
            np.full(count, side),
            np.ones(count),
        ]
        stretches.append(_Stretch(np.column_stack(columns), _apply(kernel, torque[part], step), noise))
    return stretches


def _apply(weights: Array, signal: Array, step: int) -> Array:
    """Weighted sums over windows that lie wholly within the signal, every `step` rows."""
    # About the first value: a position far from 0 would cost digits. What the weights sum up to brings it back.
    away = np.convolve(signal - signal[0], weights[::-1], "valid")[::step]
    return np.asarray(away + signal[0] * np.sum(weights), dtype=np.float64)


def smooth_speed(record: Record) -> Array:
    """(N,) speed, averaged over a short time, to determine rest and reversals."""
    half = max(ceil(SMOOTH / record.interval / 2), 1)
    if record.speed is not None:
        spread = np.pad(record.speed, half, mode="edge")
        return np.convolve(spread, np.full(2 * half + 1, 1 / (2 * half + 1)), "valid")
    assert record.angle is not None
    spread = np.pad(record.angle, half, mode="edge")
    return np.asarray((spread[2 * half :] - spread[: -2 * half]) / (2 * half * record.interval), dtype=np.float64)


def _solve(stretches: Sequence[_Stretch], length: float) -> Inertia:
    """Ordinary least squares with a covariance for correlated residuals."""
    names, fixed, said = list(RIGID_AXIS_NAMES), {}, list[Finding]()
    columns = np.vstack([stretch.columns for stretch in stretches])
    torque = np.concatenate([stretch.torque for stretch in stretches])
    if np.ptp(columns[:, 2]) == 0:
        names.remove("M_0")
        fixed["M_0"] = "motion in one direction only does not separate it from friction"
        text = "motion in one direction only: the constant load is taken for friction"
        said.append(Finding("one-direction-only", "doubt", text, "M_0"))
    chosen = [RIGID_AXIS_NAMES.index(name) for name in names]
    scale = np.linalg.norm(columns[:, chosen], axis=0)
    scaled = columns[:, chosen] / np.where(scale > 0, scale, 1.0)
    strength = np.linalg.svd(scaled, compute_uv=False)
    if scale[0] == 0 or strength[-1] < 1e-6 * strength[0]:
        raise InputError(
            "the records determine no inertia: the axis neither accelerates nor changes its speed in them; give the "
            "inertia, or record moves that accelerate"
        )
    values = np.linalg.solve(scaled.T @ scaled, scaled.T @ torque)
    residuals = torque - scaled @ values
    inverse = np.linalg.inv(scaled.T @ scaled)
    covariance = inverse @ _scatter(stretches, scaled, residuals) @ inverse
    covariance *= len(torque) / max(len(torque) - len(names), 1)
    values, covariance = values / scale, covariance / np.outer(scale, scale)
    sigma = np.sqrt(np.diag(covariance))
    estimates = {}
    for name in RIGID_AXIS_NAMES:
        if name in fixed:
            estimates[name] = estimate(name, 0.0, status="undetermined", reason=fixed[name])
            continue
        k = names.index(name)
        estimates[name] = estimate(name, float(values[k]), float(sigma[k]))
    if not values[0] > 0:
        raise InputError(
            f"the inertia comes out at {values[0]:.4g} kg.m2: the signs of torque and motion do not fit together, or "
            "the axis hardly accelerates; check the signs, or give the inertia"
        )
    share = float(values[0] * np.std(columns[:, 0]) / np.sqrt(np.mean(torque**2)))
    if share < LEAST_SHARE:
        said.append(Finding(
            "acceleration-small", "doubt",
            f"accelerating takes {100 * share:.1f} % of the torque only: the inertia may be what the simple friction "
            "model lacks; record moves that accelerate harder, or give it",
            "J", "record moves that accelerate harder, or give it",
        ))  # fmt: skip
    if sigma[0] > J_WARNED * values[0]:
        said.append(Finding(
            "parameter-uncertain", "doubt",
            f"the inertia is known to {100 * sigma[0] / values[0]:.0f} % only: record moves that accelerate harder, or "
            "give it",
            "J", "record moves that accelerate harder, or give it",
        ))  # fmt: skip
    return Inertia(
        estimates,
        Correlation(tuple(names), correlation(covariance)),
        covariance,
        float(np.sqrt(np.mean(residuals**2))),
        len(torque),
        length,
        tuple(said),
        np.concatenate(
            [np.quantile(columns[columns[:, 2] == side, 1], SPEED_QUANTILES) for side in np.unique(columns[:, 2])]
        ),
    )


def contradiction(result: Inertia, estimates: Mapping[str, Estimate]) -> str:
    """Where an axis with these parameters needs quite another torque than the rigid axis, or has another inertia.

    The simple friction of the rigid axis is no more than a straight line through a curve, but it is a linear least
    square: it cannot go astray. Empty where both agree as well as line and curve do.
    """
    line, values = result.estimates, {name: entry.value for name, entry in estimates.items()}
    if not line["F_C"].value > 0:
        return ""
    for n in map(float, result.speeds):
        side = np.sign(n)
        friction = line["F_C"].value + line["sigma_2"].value * abs(n)
        straight = line["M_0"].value + side * friction
        row = np.array([{"J": 0.0, "sigma_2": n, "F_C": side, "M_0": 1.0}[name] for name in result.correlation.names])
        margin = CONTRADICTS * friction + SIGNIFICANT_SIGMAS * float(np.sqrt(row @ result.covariance @ row))
        curved = float(torque(values, np.array([n]))[0])
        if abs(curved - straight) > margin:
            return f"{curved:.3g} N.m at {n:.3g} rad/s, where {SIMPLE} needs {straight:.3g} N.m"
    J = estimates.get("J")
    margin = CONTRADICTS * line["J"].value + SIGNIFICANT_SIGMAS * line["J"].sigma
    if J is not None and J.status == "estimated" and abs(J.value - line["J"].value) > margin:
        return f"an inertia of {J.value:.3g} kg.m2, where {SIMPLE} has {line['J'].value:.3g}"
    return ""


def _scatter(stretches: Sequence[_Stretch], columns: Array, residuals: Array) -> Array:
    """(P, P) covariance of columns^T residuals.

    Neighbours are correlated (windows overlap, and what the model lacks lasts): products up to a lag are summed with
    falling weights (W. Newey, K. West, Econometrica 55, 1987), never across two moves. The lag is the usual
    4 (N/100)^(2/9), and at least two windows. What the model lacks may last over whole moves, which no lag sees: the
    sum over moves is taken where it is larger.
    """
    scores = columns * residuals[:, None]
    bounds = np.cumsum([0, *(len(stretch.torque) for stretch in stretches)])
    lag = max(int(4 * (len(residuals) / 100) ** (2 / 9)), 8)
    near = np.zeros((columns.shape[1],) * 2)
    whole = np.zeros_like(near)
    for begin, end in pairwise(bounds):
        part = scores[begin:end]
        near += part.T @ part
        for k in range(1, min(lag, len(part) - 1) + 1):
            product = part[k:].T @ part[:-k]
            near += (1 - k / (lag + 1)) * (product + product.T)
        total = np.sum(part, axis=0)
        whole += np.outer(total, total)
    if len(stretches) < MIN_INERTIA_ROWS:
        return near
    widen = np.sqrt(np.maximum(np.diag(whole) / np.maximum(np.diag(near), 1e-300), 1.0))
    return np.asarray(near * np.outer(widen, widen), dtype=np.float64)
