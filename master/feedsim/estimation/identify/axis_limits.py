"""Acceleration, jerk and speed of a control's axis, from the setpoints of its moves from rest to rest.

A move of one axis from rest to rest, limited in speed, acceleration and jerk, has at most seven phases of constant
jerk. Least squares of that profile give the limits that it reaches; what a move does not reach is not determined by it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

from feedsim.foundation.errors import InputError

Floats = NDArray[np.float64]

_MIN_MOVING_ROWS = 12  # of a move
_MIN_RESTING_ROWS = 3
_MAX_RESIDUAL = 1e-4  # residual (rms) of a move that follows the profile, over its length
_MAX_DIFFERENCE = 0.1  # moves whose values differ by less, relatively, have the same limit


@dataclass(frozen=True)
class Move:
    """A move from rest to rest at instants begin to end [s], over length [m], positive. acceleration [m/s^2], jerk
    [m/s^3], speed [m/s]: as fitted; acceleration and speed are None where the move does not reach them. rms, largest:
    of the residual [m]."""

    begin: float
    end: float
    length: float
    acceleration: float | None
    jerk: float
    speed: float | None
    rms: float
    largest: float


@dataclass(frozen=True)
class AxisLimits:
    """Largest acceleration [m/s^2], jerk [m/s^3] and speed [m/s] of the moves; None where none reaches it. The speed is
    a limit of the axis only where no lower one was programmed. moves: those that follow the profile."""

    acceleration: float | None
    jerk: float
    speed: float | None
    moves: tuple[Move, ...]

    @property
    def words(self) -> str:
        """What it rests on, such as "1 move, met to 0.53 um"."""
        count = f"{len(self.moves)} move{'s' if len(self.moves) > 1 else ''}"
        return f"{count}, met to {1e6 * max(move.largest for move in self.moves):.2g} um"


def profile_of_rest_to_rest(t: Floats, length: float, v: float, a: float, j: float) -> tuple[Floats, Floats]:
    """Positions (N,) [m] at instants t (N,) [s] from the begin of the fastest move over `length` [m]; then (4,) the
    speed and the acceleration that it reaches, and how long it keeps each [s].

    Times of the phases: L. Biagiotti, C. Melchiorri, Trajectory Planning for Automatic Machines and Robots, 3.4.
    """
    T = min(a / j, np.sqrt(v / j), np.cbrt(length / (2 * j)))
    reached = j * T
    if v * (v / reached + T) > length:
        v = (np.sqrt(T**2 + 4 * length / reached) - T) * reached / 2
    steady, cruise = max(v / reached - T, 0.0), max(length / v - v / reached - T, 0.0)
    durations = np.array([T, steady, T, cruise, T, steady, T])
    jerks = j * np.array([1, 0, -1, 0, -1, 0, 1])
    begins = np.concatenate([[0], np.cumsum(durations)])
    state = np.zeros((8, 3))  # position, speed, acceleration at the begin of each phase
    for phase, (d, j_phase) in enumerate(zip(durations, jerks, strict=True)):
        x, s, r = state[phase]
        state[phase + 1] = x + d * (s + d * (r / 2 + d * j_phase / 6)), s + d * (r + d * j_phase / 2), r + d * j_phase
    k = np.clip(np.searchsorted(begins, t, side="right") - 1, 0, 6)
    within = np.clip(t, 0, begins[-1]) - begins[k]
    positions = state[k, 0] + within * (state[k, 1] + within * (state[k, 2] / 2 + within * jerks[k] / 6))
    return positions, np.array([v, reached, cruise, steady])


def identify_axis_limits(t: ArrayLike, position: ArrayLike) -> AxisLimits:
    """Limits of an axis from its position setpoints.

    t: instants (N,) [s], evenly spaced. position: setpoints (N,) [m].

    Raises:
        InputError: no move from rest to rest follows the profile.
    """
    at, x = np.asarray(t, dtype=np.float64), np.asarray(position, dtype=np.float64)
    if at.ndim != 1 or at.shape != x.shape or not np.all(np.isfinite(x)) or not np.all(np.diff(at) > 0):
        raise InputError("limits of an axis need ascending instants and a finite position at each of them")
    fitted_moves = [move for begin, end in _find_moves(x) if (move := _fit(at[begin:end], x[begin:end])) is not None]
    if not fitted_moves:
        raise InputError(
            "no move from rest to rest with phases of constant jerk is in the record: acceleration and jerk of the "
            "axis stay unknown"
        )
    jerk = _mean_of_largest([move.jerk for move in fitted_moves])
    assert jerk is not None
    return AxisLimits(
        _mean_of_largest([move.acceleration for move in fitted_moves]),
        jerk,
        _mean_of_largest([move.speed for move in fitted_moves]),
        tuple(fitted_moves),
    )


def _find_moves(x: Floats) -> list[tuple[int, int]]:
    """First and last row (+1) of what runs one way from rest to rest, some rows of rest on either side."""
    steps = np.diff(x)
    rounding = 1e-7 * np.abs(steps).max(initial=0)  # of what was converted to and fro
    least = np.abs(steps[np.abs(steps) > rounding]).min(initial=np.inf)
    # The last digit of a record may flicker at rest.
    moving = np.abs(steps) > (1.5 * least if least < 2e-9 else rounding)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], moving, [False]]).astype(np.int8)))
    stretches: list[list[int]] = []
    for begin, end in edges.reshape(-1, 2):
        if stretches and begin - stretches[-1][1] < _MIN_RESTING_ROWS:
            stretches[-1][1] = int(end)
        else:
            stretches.append([int(begin), int(end)])
    return [
        (begin - _MIN_RESTING_ROWS, end + _MIN_RESTING_ROWS + 1) for begin, end in stretches
        if begin >= _MIN_RESTING_ROWS and end + _MIN_RESTING_ROWS < len(x) and end - begin >= _MIN_MOVING_ROWS
        and (np.all(steps[begin:end] >= -1.5 * least) or np.all(steps[begin:end] <= 1.5 * least))
    ]  # fmt: skip


def _fit(t: Floats, x: Floats) -> Move | None:
    """The profile through a move; None where it follows none."""
    length, cycle = abs(x[-1] - x[0]), (t[-1] - t[0]) / (len(t) - 1)
    if length == 0:
        return None
    along = np.abs(x - x[0])
    speed = np.diff(along) / cycle
    acceleration = float(np.abs(np.diff(speed)).max() / cycle)
    jerk = float(np.abs(np.diff(speed, 2)).max() / cycle**2)
    start = t[np.flatnonzero(along > 1e-7 * length)[0] - 1]

    def residual(p: Floats) -> Floats:
        return np.asarray(profile_of_rest_to_rest(t - start - p[3] * cycle, length, *np.exp(p[:3]))[0] - along)

    best = None
    for factor in (1.0, 0.7, 0.4, 0.2):
        first = np.array([*np.log([float(speed.max()), acceleration, factor * jerk]), 0.0])
        fitted = least_squares(residual, first, x_scale=[0.01, 0.01, 0.1, 1], xtol=1e-15, ftol=1e-15, gtol=1e-15)
        if best is None or fitted.cost < best.cost:
            best = fitted
    assert best is not None
    rms = float(np.sqrt(np.mean(best.fun**2)))
    if rms > _MAX_RESIDUAL * length:
        return None
    v, a, j = np.exp(best.x[:3])
    _, (reached_v, reached_a, cruise, steady) = profile_of_rest_to_rest(t, length, v, a, j)
    return Move(
        float(t[0]), float(t[-1]), float(length), float(reached_a) if steady > cycle else None, float(j),
        float(reached_v) if cruise > cycle else None, rms, float(np.abs(best.fun).max()),
    )  # fmt: skip


def _mean_of_largest(values: list[float | None]) -> float | None:
    """Mean of the values that are alike with the largest one."""
    known = np.array([value for value in values if value is not None])
    return float(known[known >= known.max() * (1 - _MAX_DIFFERENCE)].mean()) if len(known) else None
