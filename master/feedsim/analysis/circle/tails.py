"""What friction leaves of a reversal peak behind its window, as columns of a fit.

An exponential, where the window shows one; or, where the drives are known, the loops' own response to friction. Start
reading at fading_tails() and known_tails().
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feedsim.analysis.circle.geometry import CircleUnderTest, TurnedPath, Undone
from feedsim.analysis.figures import Array

NEXT = 4.0  # angle of the means [deg] between the windows
# What a peak leaves at the end of its window may be off by this multiple of what the window shows; less than the floor
# [m] is not looked at. Angles in which it may fall to 1/e [deg].
TAIL, TAIL_FLOOR = 2.0, 10e-9
DECAYS = (2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 12.0, 14.0, 16.0, 18.0, 21.0, 25.0, 30.0)
FALLEN = 2.0  # angle of the means [deg] that say where a peak has fallen to half its height
# Of known responses: the angle in which friction turns round [deg]; points of a turn.
TURNS, PERIOD = 10.0, 2048
# Friction rises with the logarithm of 1 + v/RISE_SPEED [m/s] of the slide, by this share of its size at rest for every
# factor of e, or less: usual values of v_log at a slide are 5 to 15 mm/s, of F_log/F_C 0.1 to 0.3.
RISE_SPEED, RISE_SPREAD = 0.012, 0.5


@dataclass(frozen=True, eq=False)
class Tails:
    """Columns of what peaks leave behind their windows, 1 m at the windows' end (N, T), and how large they may be (T,)
    [m]."""

    columns: Array
    spread: Array


def what_is_left(
    residual: Array, which: NDArray[np.int64], since: Array, window: float, usual: float
) -> list[tuple[float, float]]:
    """What the peak at each half axis leaves at the end of its window [m], and the angle in which that falls to 1/e
    [rad], one for both sides of an axis; 0, 0: nothing.

    An exponential over a constant, which lost motion that is not yet known is: of means of the axis' displacement, from
    where the peak has fallen to half on. usual: of means elsewhere, above which a peak must stand [m]. A
    tail is one that is more than what the exponential leaves of the means.
    """
    width = math.radians(FALLEN)
    decays = np.radians(DECAYS)[:, None]
    result = [(0.0, 0.0)] * 4
    for axis in (0, 1):
        sizes: dict[int, Array] = {}
        errors: dict[int, Array] = {}
        for k in (axis, axis + 2):
            own = (which == k) & (since > 0)
            part = np.floor(since[own] / width).astype(int)
            means = np.bincount(part, residual[own] / np.cos(since[own])) / np.maximum(np.bincount(part), 1)
            top = int(np.abs(means).argmax()) if len(means) else 0
            if len(means) == 0 or abs(means[top]) <= NEXT * usual:
                continue
            means *= np.sign(means[top])
            fallen = top + np.flatnonzero(means[top:] < 0.5 * means[top])
            if len(fallen) == 0 or len(means) - fallen[0] < 3:
                continue
            remaining = means[fallen[0] :]
            remaining = remaining - remaining.mean()
            tail = np.exp((window - (np.arange(fallen[0], len(means)) + 0.5) * width) / decays)
            tail -= tail.mean(axis=1, keepdims=True)
            sizes[k] = tail @ remaining / (tail**2).sum(axis=1)
            errors[k] = ((remaining - sizes[k][:, None] * tail) ** 2).mean(axis=1)
        best = int(np.sum(list(errors.values()), axis=0).argmin()) if errors else 0
        for k, size in sizes.items():
            if size[best] > math.sqrt(errors[k][best]):
                result[k] = (float(size[best]), float(decays[best, 0]))
    return result


def fading_tails(
    undone: Sequence[Undone], paths: Sequence[TurnedPath], remaining: Sequence[tuple[float, float]], window: float
) -> Tails:
    """Tails of the peaks at the half axes; both senses share one: the axis reverses there from the same way.

    remaining: what each peak leaves at the end of its window [m], and the angle in which that falls to 1/e [rad].
    """
    columns, spread = [], []
    for k, (size, decay) in enumerate(remaining):
        if size < TAIL_FLOOR:
            continue
        parts = []
        for value, path in zip(undone, paths, strict=True):
            at = value.turned[k % 2] + (math.pi if k > 1 else 0.0)
            since = path.sense * (value.angle - at) % (2 * math.pi)
            along = np.abs((np.cos if k % 2 == 0 else np.sin)(value.angle))
            parts.append(np.where(since < math.pi, along * np.exp((window - since) / decay), 0.0))
        columns.append(np.concatenate(parts))
        spread.append(TAIL * size)
    samples = sum(len(entry.angle) for entry in undone)
    return Tails(np.column_stack(columns) if columns else np.empty((samples, 0)), np.array(spread))


def known_tails(
    circle: CircleUnderTest,
    undone: Sequence[Undone],
    paths: Sequence[TurnedPath],
    residual: Array,
    which: NDArray[np.int64],
) -> Tails:
    """The same where the loops' response is known: of each axis the periodic response to its friction, and the slope.

    A torque that is -F sgn(v) moves the axis by F 4/pi sum over odd k of Im(T_k exp(i k theta))/k, theta its own angle
    from the half axis + on, T_k its response. The columns are 1 m at their largest; friction is as large as the
    windows' peaks, or less, and turns round within TURNS: so do the first two slopes of the response. Between reversals
    it rises with the speed, by sgn(v) ln(1 + |v|/RISE_SPEED): the fourth column.
    """
    columns, spread = [], []
    for i, axis in enumerate(circle.axes):
        peak = float(np.abs(residual[(which >= 0) & (which % 2 == i)]).max(initial=0.0))
        if peak < TAIL_FLOOR:
            continue
        k = 2 * np.arange(len(circle.drag[axis])) + 1
        waves = circle.drag[axis] / k
        theta = np.linspace(0, 2 * math.pi, PERIOD, endpoint=False)
        largest = float(np.abs(_of_harmonics(k, waves)).max())
        within = math.radians(TURNS)
        # sgn v ln(1 + |v|/RISE_SPEED), as a multiple of the harmonics 4/(pi k) of sgn v.
        way = np.sin(theta)
        course = np.fft.rfft(np.sign(way) * np.log1p(circle.speed / RISE_SPEED * np.abs(way)))
        rising = -math.pi / (2 * PERIOD) * course.imag[k]
        shapes = [(TAIL, waves), (within, 1j * k * waves), (within**2, -(k**2) * waves)]
        shapes.append((RISE_SPREAD, rising * circle.drag[axis]))
        for size, shape in shapes:
            own = _of_harmonics(k, shape) / largest
            parts = []
            for value, path in zip(undone, paths, strict=True):
                passed = path.sense * (value.angle - value.turned[i]) % (2 * math.pi)
                along = (np.cos, np.sin)[i](value.angle)
                parts.append(along * np.interp(passed, theta, own, period=2 * math.pi))
            columns.append(np.concatenate(parts))
            spread.append(size * peak)
    return Tails(np.column_stack(columns) if columns else np.empty((len(residual), 0)), np.array(spread))


def _of_harmonics(k: NDArray[np.int64], waves: NDArray[np.complex128]) -> Array:
    """Im sum of waves exp(i k theta) at PERIOD angles theta of a turn, k (K,) below PERIOD / 2."""
    spectrum = np.zeros(PERIOD // 2 + 1, complex)
    spectrum[k] = -0.5j * PERIOD * waves
    return np.asarray(np.fft.irfft(spectrum, PERIOD))
