"""Sines that are faded in and out, one after another."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from feedsim.errors import InputError
from feedsim.nc.course import Course, check_length
from feedsim.nc.segment import Oscillation, Oscillations, whole_cycles
from feedsim.scenario import Sine, SineMove

Array = NDArray[np.float64]

# Points of the interpolator per period. With 10 of them the spline's amplitude is (2 pi/10)^4/384 = 4e-4 off.
FEWEST_POINTS = 10
# Instants per period at which the peaks while fading are looked for; the largest is met within 1e-4 of itself.
LOOKED_AT = 256


def sines(motion: Sine, cycle: float, begin: float, most: int) -> Course:
    """Sines about where the axis is.

    Every one starts on the grid of ``cycle`` [s], the interpolator's; ``begin`` [s] is the program time of the first,
    ``most`` the cycles that they may last.

    Raises InputError that lists every frequency too high for the interpolator; or where they last too long.
    """
    highest = 1 / (FEWEST_POINTS * cycle)
    problems = [
        f"moves.{i}: a frequency of {move.frequency:.6g} Hz; allowed at most {highest:.6g} Hz, {FEWEST_POINTS} points "
        f"of the interpolator per period (T_ipo {cycle * 1e3:.6g} ms)"
        for i, move in enumerate(motion.moves)
        if move.frequency > highest * (1 + 1e-9)
    ]
    if problems:
        raise InputError.of("the interpolator cannot follow", problems)
    pause = whole_cycles(motion.rest, cycle)
    lasting = [(2 * motion.fade + move.periods) / move.frequency for move in motion.moves]
    check_length(sum(whole_cycles(duration, cycle) + pause for duration in lasting), cycle, most)
    parts: list[Array] = []
    done: list[Oscillation] = []
    peaks: list[tuple[float, float, float, float]] = []
    cycles = 0
    for i, (move, duration) in enumerate(zip(motion.moves, lasting, strict=True)):
        start = begin + cycles * cycle
        fading = motion.fade / move.frequency
        count = whole_cycles(duration, cycle)
        rest = 0 if i == len(motion.moves) - 1 else pause
        parts += [faded_sine(move, motion.fade, np.arange(1, count + 1, dtype=np.float64) * cycle)[0], np.zeros(rest)]
        done.append(
            Oscillation(
                amplitude=move.amplitude,
                frequency=move.frequency,
                phase=math.remainder(2 * math.pi * motion.fade, 2 * math.pi),
                full=(start + fading, start + duration - fading),
                start=start,
                end=start + duration,
            )
        )
        peaks.append(_peaks(move, motion.fade))
        cycles += count + rest
    return Course(
        duration=done[-1].end - begin,
        points=np.concatenate(parts),
        low=min(low for low, _, _, _ in peaks),
        high=max(high for _, high, _, _ in peaks),
        speed=max(speed for _, _, speed, _ in peaks),
        acceleration=max(acceleration for _, _, _, acceleration in peaks),
        geometry=Oscillations(motion.axis, tuple(done)),
    )


def faded_sine(move: SineMove, fade: float, time: Array) -> tuple[Array, Array, Array]:
    """Position [m], speed [m/s] and acceleration [m/s2] at ``time`` (N,) [s] from the start; at rest outside.

    A sin(phi) times a window that rises over ``fade`` periods as 6 s^5 - 15 s^4 + 10 s^3 and falls alike: the product
    has a continuous acceleration everywhere, begins with t^4, and is the pure sine in between. Fading in one period
    takes 11 % more acceleration than the sine itself, in two 2 %.
    """
    omega = 2 * math.pi * move.frequency
    fading = fade / move.frequency
    total = 2 * fading + move.periods / move.frequency
    t = np.clip(time, 0.0, total)
    before_end = total - t
    w, slope, curvature = _window(np.minimum(t, before_end) / fading)
    slope = np.where(t <= before_end, slope, -slope) / fading
    curvature = curvature / fading**2
    sine, cosine = np.sin(omega * t), np.cos(omega * t)
    x = move.amplitude * w * sine
    v = move.amplitude * (slope * sine + w * omega * cosine)
    a = move.amplitude * (curvature * sine + 2 * slope * omega * cosine - w * omega**2 * sine)
    return x, v, a


def _window(s: Array) -> tuple[Array, Array, Array]:
    """The rise from 0 to 1 over s = 0 to 1, and its first and second derivative."""
    s = np.clip(s, 0.0, 1.0)
    return (
        s**3 * (10 + s * (6 * s - 15)),
        30 * s**2 * (1 - s) ** 2,
        60 * s * (1 - s) * (1 - 2 * s),
    )


def _peaks(move: SineMove, fade: float) -> tuple[float, float, float, float]:
    """Least and largest position [m], largest speed [m/s] and acceleration [m/s2] (magnitudes)."""
    periods = fade + 1
    t = np.linspace(0, periods / move.frequency, math.ceil(periods * LOOKED_AT) + 1)
    _, v, a = faded_sine(move, fade, t)
    omega = 2 * math.pi * move.frequency
    speed = max(move.amplitude * omega, float(np.abs(v).max()))
    acceleration = max(move.amplitude * omega**2, float(np.abs(a).max()))
    return -move.amplitude, move.amplitude, speed, acceleration
