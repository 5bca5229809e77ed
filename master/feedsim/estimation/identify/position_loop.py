"""The position loop of a control out of a record, by regression: what it delays, what it compares, what it asks for.

A control forms its following error x_e and its speed setpoint n_s from samples of its own:

    x_e[k] = sum_i a_i x_s[k - i] - x[k]                       sum of the a_i = 1: a dead time, with interpolation
    n_s[k] = k_ffw n_ffw[k] + K_v (sum_i b_i x_s[k - i] - x[k]) + n_0

Where a record holds both sides, the weights are least squares to the last digit of the record. The delay is what slow
motions see, sum_i i a_i rows. Lags are taken as long as they earn their place: the smallest window of neighbouring
samples that explains the record as well as the widest does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import log, nan

import numpy as np

from feedsim.estimation.identify.record import Array, Record
from feedsim.estimation.least_squares import between_groups, correlation_length
from feedsim.foundation.errors import InputError

MAX_SETPOINT_DELAY = 0.1  # [s]: no control delays its setpoint by more
SIGNAL_ROUNDING = 1e-13  # of the range of a signal: no residual is worth more
MAX_TAPS = 6  # samples that an interpolation runs over
# Weights that are none take off chi^2 of 1 each from the residual: a window is narrowed as long as its residual grows
# by no more than that, 95 %. Where what is left is a matter of digits (of the setpoint's way from row to row), it is no
# noise, and may grow by a share.
BY_CHANCE = 3.84
DIGITS, GROWS = 1e-5, 0.05
LEAST_TRAVEL = 1e-3  # rad: a motor that turns less does not determine a delay
STRETCHES = 8  # of a record, each of which is left out once
BETWEEN_ROWS = 5e-4  # of K_v: a drive interpolates its feedforward, which weights of rows follow roughly
DELAY_BETWEEN_ROWS = 1e-4  # of a row: likewise for the delay of the setpoint
FURTHER_ROWS = 4  # of the feedforward, beyond the delay of the setpoint
MAX_FORWARD_ROWS = 60


@dataclass(frozen=True, eq=False)
class Taps:
    """Weights of past samples.

    Attributes:
        first: age of the youngest one, in rows. weights: (W,), their sum is 1.
        interval: of the rows [s]. sigma: standard deviation of the delay [s].
        rms, largest: what is left [rad] of the following error, or [rad/s] of the speed setpoint.
    """

    first: int
    weights: Array
    interval: float
    sigma: float
    rms: float
    largest: float

    @property
    def delay(self) -> float:
        """As slow motions see it [s]."""
        return float(self.weights @ (self.first + np.arange(len(self.weights)))) * self.interval

    @property
    def reach(self) -> int:
        """Rows at the begin of a record that it has no past for."""
        return self.first + len(self.weights) - 1

    def of(self, values: Array) -> Array:
        """(N,) weighted past of values (N,); what lies ahead of them is as the first one."""
        padded = np.concatenate([np.full(self.reach, values[0]), values])
        ages = self.first + np.arange(len(self.weights))
        rows = self.reach - ages[:, None] + np.arange(len(values))
        return np.asarray(self.weights @ padded[rows], dtype=np.float64)


@dataclass(frozen=True)
class Constant:
    """A constant of the position loop by regression, and its standard deviation, in SI units."""

    value: float
    sigma: float


@dataclass(frozen=True, eq=False)
class SpeedSetpoint:
    """How the speed setpoint comes about.

    K_v: gain [1/s]. k_ffw: weight of the feedforward; 0 where the record has none. offset: n_0 [rad/s]. taps: of the
    position setpoint. sigma: of K_v and k_ffw. rms, largest: what is left [rad/s].
    """

    K_v: float
    k_ffw: float
    offset: float
    taps: Taps
    sigma: tuple[float, float]
    rms: float
    largest: float

    def of(self, setpoint: Array, angle: Array, feedforward: Array | None) -> Array:
        """(N,) [rad/s] from the setpoint (N,) and the measured angle (N,) [rad], and the feedforward [rad/s]."""
        forward = 0.0 if feedforward is None else self.k_ffw * feedforward
        return np.asarray(forward + self.K_v * (self.taps.of(setpoint) - angle) + self.offset, dtype=np.float64)


def setpoint_delay(records: Sequence[Record]) -> Taps:
    """The delay of the position setpoint, from records of one axis with setpoint, angle and deviation.

    Raises InputError: a signal is missing, or nothing moves.
    """
    moved = _usable(records, ("setpoint", "angle", "deviation"))
    targets = [record.deviation + record.angle for record in moved]  # type: ignore[operator]
    return _window(moved, targets, [[] for _ in moved])[0]


def noisy_delay(records: Sequence[Record], taps: Taps) -> Constant:
    """The delay of the position setpoint [s], of a record whose position has noise, with what its stretches differ by.

    The noise is in the target alone: x_e + x. So the weights of x_s have no bias.

    taps: by setpoint_delay(). Raises InputError: as there.
    """
    moved = _usable(records, ("setpoint", "angle", "deviation"))
    ages = taps.first + np.arange(max(len(taps.weights), 2))
    columns, right = [], []
    for record in moved:
        setpoint = np.asarray(record.setpoint)
        rows = np.arange(ages[-1], len(record))
        lagged = np.column_stack([setpoint[rows - age] for age in ages])
        columns.append(lagged[:, 1:] - lagged[:, :1])  # the first weight follows from the sum, which is 1
        right.append(np.asarray(record.deviation)[rows] + np.asarray(record.angle)[rows] - lagged[:, 0])
    further, sigma = _of_stretches(np.vstack(columns), np.concatenate(right), (ages[1:] - ages[0]) * taps.interval)
    sigma = float(np.hypot(sigma, DELAY_BETWEEN_ROWS * taps.interval))
    return Constant(float(ages[0]) * taps.interval + further, sigma)


def gain_by_deviation(records: Sequence[Record], delay: float) -> Constant:
    """K_v [1/s] by the control's own following error, from records with setpoint, deviation and speed setpoint:

        n_s[k] = K_v x_e[k] + sum_i c_i n_ffw[k - i] + n_0

    The weights c_i are the feedforward's, and what n_s takes of younger samples of the setpoint than x_e does. Where
    x_e has a noise of its own, K_v comes out too small; by no more than if all that is left were that noise, which is
    a part of the standard deviation.

    delay: of the setpoint [s]. Raises InputError: a signal is missing, or nothing moves.
    """
    moved = _usable(records, ("setpoint", "deviation", "speed_setpoint"))
    ages = range(round(delay / moved[0].interval) + FURTHER_ROWS)
    if len(ages) > MAX_FORWARD_ROWS:
        raise InputError(f"{moved[0].name}: a delay of {len(ages)} rows, at most {MAX_FORWARD_ROWS} are looked at")
    with_forward = all(record.feedforward is not None for record in moved)
    columns, right = [], []
    for record in moved:
        setpoint = np.asarray(record.setpoint)
        forward = np.asarray(record.feedforward) if with_forward else np.diff(setpoint, prepend=setpoint[0])
        rows = np.arange(len(ages), len(record))
        own = [np.asarray(record.deviation)[rows], *(forward[rows - age] for age in ages), np.ones(len(rows))]
        columns.append(np.column_stack(own))
        right.append(np.asarray(record.speed_setpoint)[rows])
    A, b = np.vstack(columns), np.concatenate(right)
    K_v, sigma = _of_stretches(A, b, np.eye(A.shape[1])[0])
    x_e, others = A[:, 0], A[:, 1:]
    alone = float(np.sum((x_e - others @ _least_squares(others, x_e)[0]) ** 2))
    remaining = float(np.sum((b - A @ _least_squares(A, b)[0]) ** 2))
    small = remaining / (K_v * alone) if K_v and alone > 0 else np.inf
    return Constant(K_v, float(np.linalg.norm([sigma, small, BETWEEN_ROWS * K_v])))


def _of_stretches(A: Array, b: Array, weights: Array) -> tuple[float, float]:
    """weights . x of least squares A x = b (N rows), and its standard deviation: the larger one of correlated residuals
    and of what the STRETCHES say differently."""
    x, covariance = _least_squares(A, b)
    variance = float(weights @ covariance @ weights) * correlation_length(b - A @ x)
    (scatter,) = between_groups(A, b, np.array_split(np.arange(len(b)), STRETCHES), weights[None])
    return float(weights @ x), float(np.sqrt(max(variance, float(scatter))))


def speed_setpoint(records: Sequence[Record]) -> SpeedSetpoint:
    """K_v, k_ffw and the age of the setpoint, from records with setpoint, angle and speed setpoint.

    Raises InputError: a signal is missing, or nothing moves.
    """
    moved = _usable(records, ("setpoint", "angle", "speed_setpoint"))
    with_forward = all(record.feedforward is not None for record in moved)
    targets = [np.asarray(record.speed_setpoint, dtype=np.float64) for record in moved]
    # K_v x_s and K_v x are columns of their own, so that K_v is determined by the measured position alone.
    others = [
        [-np.asarray(record.angle), np.ones(len(record)), *([np.asarray(record.feedforward)] if with_forward else [])]
        for record in moved
    ]
    taps, further, covariance = _window(moved, targets, others, gain=0)
    K_v, offset = float(further[0]), float(further[1])
    spread = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    count = len(further)
    k_ffw = float(further[2]) if with_forward else 0.0
    return SpeedSetpoint(
        K_v, k_ffw, offset, taps,
        (float(spread[-count]), float(spread[-1]) if with_forward else np.nan), taps.rms, taps.largest,
    )  # fmt: skip


def _usable(records: Sequence[Record], roles: Sequence[str]) -> list[Record]:
    for record in records:
        if missing := [role for role in roles if getattr(record, role) is None]:
            raise InputError(f"{record.name}: no {' and no '.join(missing)}; the position loop needs it")
    moved = [record for record in records if np.ptp(np.asarray(record.setpoint)) > LEAST_TRAVEL]
    if not moved:
        raise InputError(f"{records[0].name}: the setpoint does not move; the position loop cannot be identified")
    return moved


def _window(
    records: Sequence[Record], targets: Sequence[Array], others: Sequence[Sequence[Array]], gain: int | None = None
) -> tuple[Taps, Array, Array]:
    """The narrowest window of samples of the setpoint that explains the targets, and what goes with it.

    others: further columns of each record. gain: which of them determines the sum of the weights (negative of the
    measured angle's); None: it is 1.

    Returns the taps, the coefficients of `others`, and the covariance of taps and others together.
    """
    longest = min(round(MAX_SETPOINT_DELAY / records[0].interval), min(len(record) for record in records) // 4)
    best: tuple[float, int, int] | None = None
    # Widest windows first: where one of them holds the whole interpolation, the residual falls to the rounding.
    width = min(MAX_TAPS, longest + 1)
    for first in range(longest - width + 2):
        remaining = _solve_window(records, targets, others, first, width, longest, gain)[1]
        if best is None or remaining < best[0]:
            best = remaining, first, width
    assert best is not None
    floor, begin, _ = best
    rows = sum(len(record) - longest for record in records)
    steps = np.concatenate([np.diff(np.asarray(record.setpoint)) for record in records])
    digits = DIGITS * rms(steps) * (1.0 if gain is None else 1.0 / records[0].interval)
    rounding = (SIGNAL_ROUNDING * max(float(np.ptp(target)) for target in targets)) ** 2
    chosen = begin, width
    for narrow in range(1, width):
        result = min(
            (_solve_window(records, targets, others, first, narrow, longest, gain)[1], first)
            for first in range(begin, begin + width - narrow + 1)
        )
        grown = log((result[0] ** 2 + rounding) / (floor**2 + rounding))
        if grown <= max(BY_CHANCE * (width - narrow) / rows, 2 * GROWS if floor < digits else 0.0):
            chosen = result[1], narrow
            break
    coefficients, remaining, largest, covariance = _solve_window(records, targets, others, *chosen, longest, gain)
    first, width = chosen
    weights, further = coefficients[:width], coefficients[width:]
    total = 1.0 if gain is None else float(further[gain])
    ages = (first + np.arange(width)) * records[0].interval
    lean = (ages - float(weights @ ages) / float(np.sum(weights))) / total
    variance = float(lean @ covariance[:width, :width] @ lean)
    taps = Taps(first, weights / np.sum(weights), records[0].interval, np.sqrt(max(variance, 0.0)), remaining, largest)
    return taps, further, covariance


def _solve_window(
    records: Sequence[Record],
    targets: Sequence[Array],
    others: Sequence[Sequence[Array]],
    first: int,
    width: int,
    longest: int,
    gain: int | None,
) -> tuple[Array, float, float, Array]:
    """Coefficients, residual (rms and largest) and covariance for one window. The first `longest` rows are the past."""
    columns, right = [], []
    for record, target, further in zip(records, targets, others, strict=True):
        setpoint = np.asarray(record.setpoint)
        rows = np.arange(longest, len(record))
        origin = setpoint[rows]  # positions are far from 0, and weights differences: counted from where the axis is
        lagged = [setpoint[rows - first - i] - origin for i in range(width)]
        own = [column[rows] for column in further]
        if gain is None:
            right.append(target[rows] - origin)
        else:
            own[gain] = own[gain] + origin  # K_v (sum b x_s - x): with sum b = 1 the origin falls out
            right.append(target[rows])
        columns.append(np.column_stack([*lagged, *own]))
    A, b = np.vstack(columns), np.concatenate(right)
    # The last weight follows from the sum: with others it is K_v, without it is 1.
    if gain is None:
        base = A[:, width - 1]
        reduced = A[:, : width - 1] - base[:, None]
        x, cov = _least_squares(reduced, b - base)
        weights = np.append(x, 1.0 - np.sum(x))
        turn = np.vstack([np.eye(width - 1), -np.ones(width - 1)]) if width > 1 else np.zeros((1, 0))
        residual = b - A @ weights
        return weights, rms(residual), float(np.max(np.abs(residual))), turn @ cov @ turn.T
    at = width + gain
    keep = [i for i in range(A.shape[1]) if i != width - 1]
    reduced = A.copy()
    reduced[:, :width] -= A[:, [width - 1]]
    reduced[:, at] += A[:, width - 1]
    x, cov = _least_squares(reduced[:, keep], b)
    full = np.zeros((A.shape[1], len(keep)))
    full[keep, range(len(keep))] = 1.0
    full[width - 1, : width - 1] = -1.0
    full[width - 1, keep.index(at)] = 1.0
    solution = full @ x
    residual = b - A @ solution
    return solution, rms(residual), float(np.max(np.abs(residual))), full @ cov @ full.T


def _least_squares(A: Array, b: Array) -> tuple[Array, Array]:
    """Solution and covariance, by the residual's variance."""
    scale = np.linalg.norm(A, axis=0)
    scale[scale == 0] = 1.0
    U, s, Vt = np.linalg.svd(A / scale, full_matrices=False)
    kept = s > 1e-12 * (s[0] if len(s) else 1.0)
    inverse = np.where(kept, 1.0 / np.where(kept, s, 1.0), 0.0)
    x = (Vt.T * inverse) @ (U.T @ b) / scale
    variance = float(np.sum((b - A @ x) ** 2)) / max(len(b) - len(x), 1)
    return x, variance * ((Vt.T * inverse**2) @ Vt) / np.outer(scale, scale)


def rms(values: Array) -> float:
    """Root mean square; nan of nothing."""
    return float(np.sqrt(np.mean(values**2))) if len(values) else nan
