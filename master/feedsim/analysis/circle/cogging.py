"""Torque that repeats with the turn of a motor, cogging above all, in what a fitted circle leaves.

A torque A sin(k phi + psi), phi the angle of the motor, is along a circle a torque over the time of a turn, as phi
follows the position of the axis. Its harmonics move the axis by the response of the loops to a torque at the motor.
Speed and resonances are in that response, so the amplitude comes out in N.m. Looked for between the reversals, beside
all terms of the model. Start reading at fit_with_waves().
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from feedsim.analysis.circle.geometry import CircleUnderTest, TurnedPath
from feedsim.analysis.circle.model import Fit, blocks_of, fit
from feedsim.analysis.figures import Array
from feedsim.estimation.least_squares import Covariance, student

# Orders that are tried: one wave a turn is an error of the pitch; of a torque at more than this frequency [Hz] at the
# path speed an axis shows little.
MOTOR_ORDERS, MAX_TORQUE_FREQUENCY = (2, 48), 150.0
# What a circle leaves is looked into from this standard deviation on [m]. A wave is one if it explains so much of the
# variance, and so much of that share beside any of the next ones: cogging of 0.2 to 0.4 N.m explains
# 70 to 99 %, what circles of machines without leave is explained to 9 % at most.
MIN_REMAINDER, MIN_EXPLAINED_SHARE, MIN_KEPT_SHARE, RIVAL_COUNT = 30e-9, 0.3, 0.5, 4
# All waves together explain so much of the variance, or none is one: on small fast circles a wave of order 2 has few
# periods from reversal to reversal, and what friction leaves there is explained to 35 % by one, to 54 % by two.
MIN_EXPLAINED_BY_ALL = 0.6
MAX_WAVES = 4  # waves of a circle
# Waves across the circle, below which one is not known from the circle's own shape, friction's included.
MIN_PERIODS = 6.0
WAVE_POINTS = 8192  # of a turn; the finest wave has some 1500 periods
SCREENED_SAMPLES = 2000  # samples of all paths for the search among the orders
# The axis follows a small torque by the linear response to this share of it: friction changes with the speed.
RESPONSE_UNCERTAINTY = 0.03
FINE_GRID_FREQUENCY = 30.0  # up to this frequency [Hz] the response is taken at more points
FINE_GRID_POINTS, GRID_POINTS = 100, 160


@dataclass(frozen=True, eq=False)
class Wave:
    """A torque of ``order`` waves in a turn of the motor of ``axis``.

    Attributes:
        parts: of the cosine and the sine of the angle that follows from the position [N.m].
        half: half of the interval of the amplitude [N.m].
        moved: what 1 N.m of each part moves the axis by over the time of a turn towards the second axis
            (2, WAVE_POINTS) [m].
    """

    axis: str
    order: int
    parts: tuple[float, float]
    half: float
    moved: Array

    @property
    def amplitude(self) -> float:
        """[N.m]"""
        return math.hypot(*self.parts)

    def displacements(self, circle: CircleUnderTest, angle: Array, sense: int) -> Array:
        """Of the axis for 1 N.m of each part, at angles (N,) [rad] of a turn of ``sense``: (N, 2) [m]."""
        # The first axis goes the same way in both senses; the second one goes back, and so does the sine.
        back = float(sense) if self.axis == circle.axes[1] else 1.0
        at = sense * angle % (2 * math.pi) * (WAVE_POINTS / (2 * math.pi))
        low = at.astype(np.int64)
        part = at - low
        values = self.moved[:, low % WAVE_POINTS] * (1 - part) + self.moved[:, (low + 1) % WAVE_POINTS] * part
        return np.column_stack([values[0], back * values[1]])

    def columns(self, circle: CircleUnderTest, angle: Array, sense: int) -> Array:
        """Radial deviation for 1 N.m of each part (N, 2) [m]."""
        along = (np.cos, np.sin)[circle.axes.index(self.axis)](angle)
        return np.asarray(along[:, None] * self.displacements(circle, angle, sense))

    def curve(self, circle: CircleUnderTest, angle: Array, sense: int) -> Array:
        """Radial deviation (N,) [m]."""
        return np.asarray(self.columns(circle, angle, sense) @ np.array(self.parts))


def fit_with_waves(circle: CircleUnderTest, paths: Sequence[TurnedPath]) -> tuple[Fit, list[Wave]]:
    """The model fitted to the paths without waves of the motors' torque, and these waves."""
    result, waves = fit(circle, paths), list[Wave]()
    plain = result
    while len(waves) < MAX_WAVES and (wave := find_strongest_wave(circle, result)) is not None:
        waves.append(wave)
        result = fit(circle, remove_waves(circle, paths, waves))
        waves = settle_waves(circle, result, waves)
    if len(certain := [wave for wave in waves if wave.amplitude > wave.half]) < len(waves):
        waves = certain  # what may be nothing must not change the other terms
        result = fit(circle, remove_waves(circle, paths, waves))
    return (result, waves) if stand_out(plain, result) else (plain, [])


def remove_waves(circle: CircleUnderTest, paths: Sequence[TurnedPath], waves: Sequence[Wave]) -> list[TurnedPath]:
    """Paths with the waves taken off the positions of their axes."""
    turned_paths = []
    for path in paths:
        p = (circle.radius + path.deviation) * np.array([np.cos(path.angle), np.sin(path.angle)])
        for wave in waves:
            own = wave.displacements(circle, path.angle, path.sense) @ np.array(wave.parts)
            p[circle.axes.index(wave.axis)] -= own
        angle, deviation = np.arctan2(p[1], p[0]), np.hypot(p[0], p[1]) - circle.radius
        turned_paths.append(replace(path, angle=angle, deviation=deviation) if waves else path)
    return turned_paths


def find_strongest_wave(circle: CircleUnderTest, result: Fit) -> Wave | None:
    """The wave that explains most of what the model leaves between the reversals; None where none stands out."""
    rest = _Remainder(result, few=True)
    if circle.response is None or rest.deviation < MIN_REMAINDER:
        return None
    tried = sorted(
        ((rest.explained(wave, circle), wave) for axis in circle.axes for wave in _waves(circle, axis)),
        key=lambda pair: -pair[0],
    )
    if not tried or tried[0][0] < MIN_EXPLAINED_SHARE:
        return None
    best = tried[0][1]
    if any(
        rest.explained(best, circle, beside=other) < MIN_KEPT_SHARE * tried[0][0] for _, other in tried[1:RIVAL_COUNT]
    ):
        return None
    return settle_waves(circle, result, [best])[0]


def stand_out(before: Fit, after: Fit) -> bool:
    """Whether waves that are no part of ``before`` and are taken off in ``after`` explain what was left."""
    return _Remainder(after).deviation ** 2 <= (1 - MIN_EXPLAINED_BY_ALL) * _Remainder(before).deviation ** 2


def settle_waves(circle: CircleUnderTest, results: Fit, waves: Sequence[Wave]) -> list[Wave]:
    """Waves with what the model leaves of them, and their intervals."""
    rest = _Remainder(results)
    matrix = np.hstack([rest.outside(rest.columns(wave, circle)) for wave in waves])
    change = np.linalg.lstsq(matrix, rest.left, rcond=None)[0]
    off = rest.left - matrix @ change
    covariance = Covariance.of(matrix.T @ matrix)
    free = max(int(rest.block.max()) + 1 - len(results.names) - len(change), 2)
    blockwise = covariance.of_blocks(matrix, off, rest.block, free)
    single = covariance.of_samples(matrix, off)
    scale = np.sqrt(np.maximum(np.diag(single) / np.maximum(np.diag(blockwise), 1e-300), 1.0))
    spread = scale[:, None] * blockwise * scale
    result = []
    for k, wave in enumerate(waves):
        own = slice(2 * k, 2 * k + 2)
        parts = np.array(wave.parts) + change[own]
        along = parts / max(float(np.hypot(*parts)), 1e-300)
        known = student(free) * math.sqrt(max(float(along @ spread[own, own] @ along), 0.0))
        half = math.hypot(known, RESPONSE_UNCERTAINTY * float(np.hypot(*parts)))
        result.append(replace(wave, parts=(float(parts[0]), float(parts[1])), half=half))
    return result


def _waves(circle: CircleUnderTest, axis: str) -> Iterator[Wave]:
    """All orders that are tried of an axis, without size."""
    assert circle.response is not None
    i, pitch = circle.axes.index(axis), circle.pitch.get(axis, 0.0)
    if pitch <= 0:
        return
    first = circle.speed / circle.radius / (2 * math.pi)
    top = min(MOTOR_ORDERS[1], int(MAX_TORQUE_FREQUENCY * pitch / circle.speed))
    # A wave that is fastest at the path speed has no harmonics far above that.
    highest = min(int(1.15 * top * 2 * math.pi * circle.radius / pitch) + 20, WAVE_POINTS // 2 - 1)
    fine, coarse = max(FINE_GRID_FREQUENCY, 2 * first), max(highest * first, FINE_GRID_FREQUENCY + 1)
    grid = np.unique(
        np.r_[np.geomspace(first, fine, FINE_GRID_POINTS), np.linspace(FINE_GRID_FREQUENCY, coarse, GRID_POINTS)]
    )
    grid = grid[grid >= first]
    response, at = circle.response(axis, grid), first * np.arange(1, highest + 1)
    T = np.zeros(WAVE_POINTS, dtype=np.complex128)  # what stands still the integrators take
    T[1 : highest + 1] = np.interp(at, grid, response.real) + 1j * np.interp(at, grid, response.imag)
    T[-highest:] = T[highest:0:-1].conj()
    time = np.linspace(0, 2 * math.pi, WAVE_POINTS, endpoint=False)
    turn = np.exp(2j * math.pi / pitch * circle.radius * (np.cos, np.sin)[i](time))
    lowest = max(MOTOR_ORDERS[0], math.ceil(MIN_PERIODS * pitch / (2 * circle.radius)))
    torque = turn ** (lowest - 1)
    for order in range(lowest, top + 1):
        torque *= turn  # cosine and sine of the motor's angle at once, as the response is that of a real system
        moved = np.fft.ifft(np.fft.fft(torque) * T)
        yield Wave(axis, order, (0.0, 0.0), math.inf, np.array([moved.real, moved.imag]))


class _Remainder:
    """What a fit leaves between the reversals, of all samples or of a few, and what is no term of it, nor a tail."""

    def __init__(self, result: Fit, *, few: bool = False) -> None:
        step = max(1, sum(len(values) for values in result.angle) // SCREENED_SAMPLES) if few else 1
        rows = [np.flatnonzero(which < 0)[::step] for which in result.reversal]
        self._angle = [angle[own] for angle, own in zip(result.angle, rows, strict=True)]
        self._senses = result.senses
        terms = np.concatenate([
            np.column_stack([*(part[name][own] for name in result.names), tails[own]])
            for part, tails, own in zip(result.columns, result.tails, rows, strict=True)
        ])  # fmt: skip
        self._terms = np.linalg.qr(terms / np.maximum(np.linalg.norm(terms, axis=0), 1e-300))[0]
        remaining = np.concatenate([
            (residual - tail)[own]
            for residual, tail, own in zip(result.residual, result.tail, rows, strict=True)
        ])  # fmt: skip
        self.deviation = float(np.std(remaining))
        self.left = self.outside(remaining)
        self.block = np.unique(blocks_of(self._angle), return_inverse=True)[1]

    def outside(self, values: Array) -> Array:
        """(N, ...) without what terms of the model explain of it."""
        return np.asarray(values - self._terms @ (self._terms.T @ values))

    def columns(self, wave: Wave, circle: CircleUnderTest) -> Array:
        """(N, 2) of the samples [m/(N.m)]."""
        parts = zip(self._angle, self._senses, strict=True)
        return np.concatenate([wave.columns(circle, angle, sense) for angle, sense in parts])

    def explained(self, wave: Wave, circle: CircleUnderTest, beside: Wave | None = None) -> float:
        """Share of the variance [1]; beside another wave, what it explains of it that the other does not."""
        others = [] if beside is None else [self.outside(self.columns(beside, circle))]
        columns = np.hstack([*others, self.outside(self.columns(wave, circle))])
        return (self._unexplained_share(others[0]) if others else 1.0) - self._unexplained_share(columns)

    def _unexplained_share(self, columns: Array) -> float:
        # by the normal equations: a share that a threshold judges needs no more digits
        off = self.left - columns @ np.linalg.lstsq(columns.T @ columns, columns.T @ self.left, rcond=None)[0]
        return float(off @ off) / max(float(self.left @ self.left), 1e-300)
