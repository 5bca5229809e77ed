"""Sines that are faded in and out, one after another."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, StrictInt

from feedsim.files.fields import AxisName, Model, Quantity
from feedsim.foundation.errors import InputError
from feedsim.motions.kind import Array, Course, Geometry, MotionKind, Peaks, Start, in_turn

# Points of the interpolator per period. With 10 of them the spline's amplitude is (2 pi/10)^4/384 = 4e-4 off.
FEWEST_POINTS = 10
# Instants per period at which the peaks while fading are looked for; the largest is met within 1e-4 of itself.
INSTANTS_PER_PERIOD = 256


class SineMove(Model):
    """A sine about where the axis is, faded in and out."""

    amplitude: Annotated[float, Quantity("m", above=0, example="20 um")] = Field(description="Amplitude")
    frequency: Annotated[float, Quantity("Hz", above=0, example="5 Hz")] = Field(description="Frequency")
    periods: Annotated[StrictInt, Field(ge=1, le=100_000)] = Field(
        description="Periods at full amplitude; those of fading come on top"
    )


class Sine(MotionKind):
    """Sines one after another: what pre-sliding friction and its damping are identified from."""

    returns: ClassVar[bool] = True
    kind: Literal["sine"] = "sine"
    axis: AxisName = Field(description="Axis that moves")
    moves: Annotated[tuple[SineMove, ...], Field(min_length=1)] = Field(description="Sines, in this order")
    rest: Annotated[float, Quantity("s", minimum=0, example="0.2 s")] = Field(
        default=0.2, description="Time at rest between sines"
    )
    fade: Annotated[float, Quantity("1", minimum=0.5, maximum=100)] = Field(
        default=1.0, description="Periods over which the amplitude rises at the start and falls at the end"
    )

    @property
    def axes(self) -> tuple[str, ...]:
        return (self.axis,)

    @property
    def description(self) -> str:
        sizes = ", ".join(f"{move.amplitude * 1e6:.6g} um at {move.frequency:.6g} Hz" for move in self.moves[:4])
        return f"sines of {self.axis}: {sizes}{' ...' if len(self.moves) > 4 else ''}"

    def plan(self, start: Start) -> Course:
        """Sines about where the axis is. Every one starts on the grid of the interpolator.

        Raises InputError that lists every frequency too high for the interpolator; or where they last too long.
        """
        here, cycle = start.position[self.axis], start.T_ipo
        self._check_frequencies(cycle)
        lasting = [(2 * self.fade + move.periods) / move.frequency for move in self.moves]
        turns = in_turn(lasting, self.rest, start)
        parts: list[Array] = []
        done: list[Oscillation] = []
        for move, duration, (begin, count, pause) in zip(self.moves, lasting, turns, strict=True):
            fading = self.fade / move.frequency
            time = np.arange(1, count + 1, dtype=np.float64) * cycle
            parts += [faded_sine(move, self.fade, time)[0], np.zeros(pause)]
            done.append(
                Oscillation(
                    amplitude=move.amplitude,
                    frequency=move.frequency,
                    phase=math.remainder(2 * math.pi * self.fade, 2 * math.pi),
                    full=(begin + fading, begin + duration - fading),
                    start=begin,
                    end=begin + duration,
                )
            )
        widest = max(move.amplitude for move in self.moves)
        fastest, hardest = np.max([_peaks(move, self.fade) for move in self.moves], axis=0).tolist()
        return Course(
            duration=done[-1].end - start.time,
            cycles=sum(map(len, parts)),
            points={self.axis: here + np.concatenate(parts)},
            peaks={self.axis: Peaks(here - widest, here + widest, fastest, hardest)},
            moving=(self.axis,),
            geometry=Oscillations(self.axis, tuple(done)),
        )

    def _check_frequencies(self, cycle: float) -> None:
        highest = 1 / (FEWEST_POINTS * cycle)
        problems = [
            f"moves.{i}: a frequency of {move.frequency:.6g} Hz; allowed at most {highest:.6g} Hz, {FEWEST_POINTS} "
            f"points of the interpolator per period (T_ipo {cycle * 1e3:.6g} ms)"
            for i, move in enumerate(self.moves)
            if move.frequency > highest * (1 + 1e-9)
        ]
        if problems:
            raise InputError.of("the interpolator cannot follow", problems)


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
    return s**3 * (10 + s * (6 * s - 15)), 30 * s**2 * (1 - s) ** 2, 60 * s * (1 - s) * (1 - 2 * s)


def _peaks(move: SineMove, fade: float) -> tuple[float, float]:
    """Largest speed [m/s] and acceleration [m/s2] (magnitudes)."""
    periods = fade + 1
    t = np.linspace(0, periods / move.frequency, math.ceil(periods * INSTANTS_PER_PERIOD) + 1)
    _, v, a = faded_sine(move, fade, t)
    omega = 2 * math.pi * move.frequency
    return max(move.amplitude * omega, float(np.abs(v).max())), max(move.amplitude * omega**2, float(np.abs(a).max()))


@dataclass(frozen=True)
class Oscillation:
    """A sine, amplitude sin(2 pi frequency (t - full[0]) + phase) about where the axis was while at full amplitude."""

    amplitude: float
    """Amplitude [m]."""
    frequency: float
    """Frequency [Hz]."""
    phase: float
    """Phase at the begin of the full amplitude [rad]."""
    full: tuple[float, float]
    """Begin and end of the full amplitude [s], program time."""
    start: float
    end: float
    """Exact begin and end with the fading [s], program time."""


@dataclass(frozen=True)
class Oscillations(Geometry):
    """Sines of an axis, in the order in which they are driven."""

    axis: str
    moves: tuple[Oscillation, ...]

    @property
    def text(self) -> str:
        return f"{len(self.moves)} sine{'s'[: len(self.moves) != 1]}"
