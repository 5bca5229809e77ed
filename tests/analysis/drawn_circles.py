"""Circles made of known causes, as motions of two axes: nothing here knows how a circle is taken apart.

Axis by axis: what it is told, later by its delay; longer by its scale; the second axis leans; lost motion, an error
that repeats with the pitch, and a peak of friction where it reverses. Only then is the radius measured, with noise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from feedsim.analysis.circle import CircleUnderTest, TurnedPath

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Causes:
    """Of axes X and Z: offset [m], scale [1], delay [s], lost motion [m], pitch error [m], friction's peak [m] and its
    time of decay [s]; squareness [rad], positive where the angle between X+ and Z+ is below 90 deg; vibration's
    amplitude [m] and frequency [Hz]; time constant of a lag of first order [s]."""

    offset: tuple[float, float] = (0.0, 0.0)
    scale: tuple[float, float] = (0.0, 0.0)
    delay: tuple[float, float] = (0.0, 0.0)
    lost: tuple[float, float] = (0.0, 0.0)
    pitch_error: tuple[float, float] = (0.0, 0.0)
    peak: tuple[float, float] = (0.0, 0.0)
    decay: float = 0.03
    squareness: float = 0.0
    noise: float = 0.0
    phase: tuple[float, float] = field(default=(0.0, 0.0))
    swing: tuple[float, float] = (0.0, 0.0)
    frequency: float = 0.0
    lag: tuple[float, float] = (0.0, 0.0)


def driven(circle: CircleUnderTest, causes: Causes, sense: int, rng: np.random.Generator, samples: int) -> TurnedPath:
    """A turn of ``samples`` at constant speed, begun a quarter of a quarter before a half axis."""
    omega = circle.speed / circle.radius
    t = np.arange(samples) * (2 * math.pi / omega / samples)
    begin = -math.pi / 8
    measured = []
    for i, wave in enumerate((np.cos, lambda a: sense * np.sin(a))):
        phase = begin + omega * (t - causes.delay[i]) - math.atan(omega * causes.lag[i])
        x = circle.radius / math.sqrt(1 + (omega * causes.lag[i]) ** 2) * wave(phase)
        # sin and cos of this axis' own way: 0 and pi are where it turns round
        own = phase if i == 0 else phase - math.pi / 2
        forward = np.where(np.sin(own) < 0, 1.0, -1.0) * (1 if i == 0 else sense)
        shift = -0.5 * causes.lost[i] * forward
        if causes.pitch_error[i]:
            shift += causes.pitch_error[i] * np.cos(2 * math.pi * x / circle.pitch[circle.axes[i]] + causes.phase[i])
        since = (own % math.pi) / omega  # since it last turned round; it stays where it was, towards the outside
        rise = 1 - np.exp(-since / 0.004)
        shift += -forward * causes.peak[i] * rise * np.exp(-since / causes.decay)
        shift += causes.swing[i] * np.sin(2 * math.pi * causes.frequency * t + 1.0)
        measured.append(causes.offset[i] + (1 + causes.scale[i]) * x + shift)
    x = measured[0] + causes.squareness * measured[1]
    z = measured[1]
    radius = np.hypot(x, z) + causes.noise * rng.standard_normal(samples)
    return TurnedPath(np.arctan2(z, x), radius - circle.radius, sense, omega * t)
