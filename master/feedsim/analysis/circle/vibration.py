"""Vibrations on a circle, between the reversals: of every axis whose position is known, else of the radius."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from feedsim.analysis.circle.geometry import CircleUnderTest, TurnedPath, enough_pitches
from feedsim.analysis.circle.model import Fit
from feedsim.analysis.figures import Array, averaged

AMPLITUDE_FLOOR = 10e-9  # an amplitude of less [m] is not reported: it may be a residual of the model
# Lines of the spectrum that belong to one vibration, and how far their mean stands out of what is around them, and of
# that on either side of them: a spectrum that falls steeply is form. Noise of the radius alone is modulated by the turn
# in the axes, so that its lines are not independent: five times is then reached now and then among some thousand lines.
VIBRATION_LINES, BACKGROUND_LINES, STANDS_OUT = 7, 101, 10.0
FIRST_ORDER = 13  # below it is form
FINE = 0.05  # of a line: the step in which the frequency is looked for
# about an axis' reversal its friction swings, not the machine
SECTOR_AHEAD, SECTOR_BEHIND = math.radians(5), math.radians(60)


@dataclass(frozen=True)
class Vibration:
    """Frequency at this path speed [Hz] and amplitude [m] of a vibration, with half of its interval [m]; the axis that
    carries it, "" where only the radius is known."""

    frequency: float
    amplitude: float
    half: float
    axis: str = ""


def vibrations(circle: CircleUnderTest, fit: Fit, paths: Sequence[TurnedPath]) -> tuple[Vibration, ...]:
    """The strongest vibration of each axis (of the radius, where the axes' positions are not known) that stands out.

    paths: all their samples, of whose turns ``fit`` is the model. The largest amplitude first.
    """
    best: dict[str, Vibration] = {}
    for k, path in enumerate(paths):
        part = path.covered / (2 * math.pi)  # an arc is taken for a turn: its waves are counted over what it covers
        for axis, angle, off, free in _signals(circle, fit, k, path):
            vibration = _strongest(
                replace(circle, radius=part * circle.radius), axis, angle / part, off, free, fit.quantile
            )
            if vibration is not None and (axis not in best or vibration.amplitude > best[axis].amplitude):
                best[axis] = vibration
    return tuple(sorted(best.values(), key=lambda entry: -entry.amplitude))


Signal = tuple[str, Array, Array, NDArray[np.bool_]]


def _signals(circle: CircleUnderTest, fit: Fit, k: int, path: TurnedPath) -> list[Signal]:
    """Axis, angle by which the motion has turned (N,) [rad], deviation (N,) [m], and what counts of it (N,)."""
    if path.phase is None or not path.whole:
        turned = path.sense * (np.unwrap(fit.angle[k]) - fit.angle[k][0])
        order = np.argsort(turned)
        return [("", turned[order], fit.residual[k][order], (fit.reversal[k] < 0)[order])]
    phase = path.phase[path.phase < 2 * math.pi]
    first = np.column_stack([np.cos(phase), np.sin(phase)])
    signals = []
    for axis, wave in zip(circle.axes, (np.cos, np.sin), strict=True):
        position = ((circle.radius + path.deviation) * wave(path.angle))[: len(phase)]
        a, b = np.linalg.lstsq(first, position - position.mean(), rcond=None)[0]
        # The axis turns round where it is farthest out, at atan2(b, a), and half a turn on.
        free = (phase - math.atan2(b, a) + SECTOR_AHEAD) % math.pi > SECTOR_AHEAD + SECTOR_BEHIND
        matrix = [np.ones(len(phase)), *first.T, np.sign(first @ (b, -a))]
        if enough_pitches(circle, axis):
            along = 2 * math.pi / circle.pitch[axis] * position
            matrix += [np.cos(along), np.sin(along)]
        columns = np.column_stack(matrix)
        values = np.linalg.lstsq(columns[free], position[free], rcond=None)[0]
        signals.append((axis, phase, position - columns @ values, free))
    return signals


def _strongest(
    circle: CircleUnderTest, axis: str, angle: Array, off: Array, free: NDArray[np.bool_], quantile: float
) -> Vibration | None:
    even = np.arange(len(angle)) * (2 * math.pi / len(angle))
    still = np.interp(even, angle, np.where(free, off, 0.0), period=2 * math.pi)
    usable = np.abs(np.fft.rfft(still))[FIRST_ORDER:] ** 2
    if len(usable) < 2 * BACKGROUND_LINES:
        return None
    mean = averaged(usable, VIBRATION_LINES)
    beside = np.pad(mean, 2 * VIBRATION_LINES, mode="edge")
    sides = np.maximum(beside[: -4 * VIBRATION_LINES], beside[4 * VIBRATION_LINES :])
    sides[: 2 * VIBRATION_LINES] = np.maximum(
        sides[: 2 * VIBRATION_LINES], mean[2 * VIBRATION_LINES : 4 * VIBRATION_LINES]
    )
    out = (mean > STANDS_OUT * np.maximum(_floor(usable), 1e-300)) & (mean > STANDS_OUT * sides)
    at = int(np.argmax(np.where(out, mean, 0.0)))
    if not out[at]:
        return None
    lines = np.arange(max(at - VIBRATION_LINES // 2, 0), min(at + VIBRATION_LINES // 2 + 1, len(usable)))
    orders = np.arange(lines[0], lines[-1] + FINE, FINE) + FIRST_ORDER
    power = [abs(np.exp(-1j * order * angle[free]) @ off[free]) for order in orders]
    order = float(orders[int(np.argmax(power))])
    amplitude, noise = _amplitude(angle[free], off[free], order)
    half = quantile * noise * math.sqrt(2 / max(int(free.sum()), 1))
    frequency = order * circle.speed / (2 * math.pi * circle.radius)
    return Vibration(frequency, amplitude, half, axis) if amplitude > AMPLITUDE_FLOOR else None


def _floor(power: Array) -> Array:
    """Mean power of the lines around each, if they are noise: their median is ln 2 of it."""
    edges = np.arange(0, len(power), BACKGROUND_LINES // 2)
    middle = [
        float(np.median(power[max(edge - BACKGROUND_LINES // 2, 0) : edge + BACKGROUND_LINES // 2 + 1]))
        for edge in edges
    ]
    return np.asarray(np.interp(np.arange(len(power)), edges, middle)) / math.log(2)


def _amplitude(angle: Array, off: Array, order: float) -> tuple[float, float]:
    """Amplitude of the orders about one, which holds what comes and goes: of the mean power; and what else there is."""
    beside = order + np.arange(-(VIBRATION_LINES // 2), VIBRATION_LINES // 2 + 1)
    matrix = np.column_stack([wave(n * angle) for n in beside for wave in (np.cos, np.sin)])
    swings = matrix @ np.linalg.lstsq(matrix, off, rcond=None)[0]
    return math.sqrt(2 * float(np.mean(swings**2))), float(np.std(off - swings))
