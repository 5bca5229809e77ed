"""Figures of a circular test, named as in ISO 230-4. Definitions: docs/figures.md.

The radius deviation is hypot of the two positions about the programmed centre, less the programmed radius; it is
evaluated over one full turn. Angles run from the plane's first axis towards its second. Where the circle crosses the
half axis of one axis, that axis reverses: at 0 and 180 deg the first, at 90 and 270 deg the second.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from feedsim.analysis.figures import Array, Figure
from feedsim.files.trace import Trace
from feedsim.files.trace.trace import find_rows, require_column
from feedsim.foundation.errors import InputError
from feedsim.motions.circular import Circular
from feedsim.motions.setpoints import RecordedGeometry
from feedsim.simulation.nc import Program, Segment

QUARTER = math.pi / 2


@dataclass(frozen=True)
class Turn:
    """One programmed full turn: axes of the plane (first, second), centre (2,) [m], radius [m], sense of the motion
    (+1 from the first axis towards the second: counterclockwise, -1 clockwise), begin and end [s]."""

    axes: tuple[str, str]
    centre: tuple[float, float]
    radius: float
    sense: int
    begin: float
    end: float


@dataclass(frozen=True)
class Glitch:
    """Quadrant glitch: name of the crossed half axis ("X+"), the axis that reverses there, the angle of the crossing
    [rad], and the contour's largest radius deviation within +-45 deg of it: angle [rad], deviation [m], and height [m]
    above the turn's median."""

    name: str
    axis: str
    crossing: float
    angle: float
    deviation: float
    height: float


@dataclass(frozen=True, eq=False)
class Contour:
    """Measured turn: time (N,) [s], angle (N,) [rad] in [-pi, pi), deviation of the radius (N,) [m], four glitches."""

    time: Array
    angle: Array
    deviation: Array
    median: float
    glitches: tuple[Glitch, Glitch, Glitch, Glitch]


def contour(trace: Trace, turn: Turn, columns: tuple[str, str] | None = None) -> Contour:
    """Radius deviation over ``turn``, by the linear scales or by the two position ``columns`` [m].

    Raises InputError where the columns are not recorded, or where the turn is not recorded whole.
    """
    first, second = turn.axes
    names = columns or (f"{first}.x_a", f"{second}.x_a")
    purpose = f"circularity in the plane {first}{second}"
    rows = find_rows(trace, turn.begin, turn.end, purpose, least=16)
    if trace.time[rows][-1] >= turn.end:  # the same point of the circle as the first one
        rows = slice(rows.start, rows.stop - 1)
    x, y = (require_column(trace, name, purpose)[rows] - c for name, c in zip(names, turn.centre, strict=True))
    angle = np.arctan2(y, x)
    deviation = np.hypot(x, y) - turn.radius
    if np.unique(np.floor(angle / (math.pi / 4))).size < 8:
        covered = np.rad2deg(np.ptp(np.unwrap(angle)))
        raise InputError(
            f"{purpose}: the path from {turn.begin:.6g} to {turn.end:.6g} s covers {covered:.0f} deg, no full turn"
        )
    median = float(np.median(deviation))
    glitches = [_glitch(turn, k, angle, deviation, median) for k in range(4)]
    return Contour(trace.time[rows], angle, deviation, median, (glitches[0], glitches[1], glitches[2], glitches[3]))


def circularity(trace: Trace, turn: Turn) -> dict[str, Figure]:
    """Figures of ``turn`` by the linear scales and, with prefix ``tool.``, by the tool point where it is recorded."""
    figures = _figures(turn, trace, (f"{turn.axes[0]}.x_a", f"{turn.axes[1]}.x_a"), "by the linear scales")
    at_tool = (f"tcp.x_{turn.axes[0]}", f"tcp.x_{turn.axes[1]}")
    if all(name in trace.columns for name in at_tool):
        by_tool = _figures(turn, trace, at_tool, "by the tool point")
        figures |= {f"tool.{name}": figure for name, figure in by_tool.items()}
    return figures


def least_squares_deviation(angle: Array, deviation: Array, radius: float) -> float:
    """Circular deviation G about the least-squares circle [m]: range of the distance from its centre."""
    centre = fitted_centre(angle, deviation, radius)
    x, y = (radius + deviation) * np.cos(angle), (radius + deviation) * np.sin(angle)
    return float(np.ptp(np.hypot(x - centre[0], y - centre[1])))


def fitted_centre(angle: Array, deviation: Array, radius: float) -> Array:
    """Centre (2,) of the least-squares circle [m]."""
    x, y = (radius + deviation) * np.cos(angle), (radius + deviation) * np.sin(angle)
    centre = np.zeros(2)
    for _ in range(4):  # Gauss-Newton; an offset of d leaves d^2/R after one pass, nothing after three
        distance = np.hypot(x - centre[0], y - centre[1])
        normal = np.column_stack([(x - centre[0]) / distance, (y - centre[1]) / distance, np.ones(len(x))])
        centre += np.linalg.lstsq(normal, distance - radius, rcond=None)[0][:2]
    return centre


def quadrant(angle: Array, crossing: float) -> NDArray[np.bool_]:
    """Which of ``angle`` (N,) lie within +-45 deg of the crossing [rad]."""
    return np.asarray(np.abs((angle - crossing + math.pi) % (2 * math.pi) - math.pi) <= QUARTER / 2)


def _glitch(turn: Turn, quarter: int, angle: Array, deviation: Array, median: float) -> Glitch:
    near = quadrant(angle, quarter * QUARTER)
    peak = int(np.flatnonzero(near)[np.argmax(deviation[near])])
    axis = turn.axes[quarter % 2]
    return Glitch(
        name=f"{axis}{'+' if quarter < 2 else '-'}",
        axis=axis,
        crossing=quarter * QUARTER,
        angle=float(angle[peak]),
        deviation=float(deviation[peak]),
        height=float(deviation[peak]) - median,
    )


def _figures(turn: Turn, trace: Trace, columns: tuple[str, str], how: str) -> dict[str, Figure]:
    measured = contour(trace, turn, columns)
    e = measured.deviation
    # ISO 230-4 orders the axis letters by the sense of contouring: XZ from X+ to Z+, ZX from Z+ to X+.
    letters = axis_letters(turn.axes if turn.sense > 0 else turn.axes[::-1])

    def um(value: float, meaning: str) -> Figure:
        return Figure(value * 1e6, "um", f"{meaning}, {how}")

    figures = {
        "G": um(
            float(np.ptp(e)),
            f"ISO 230-4 circular deviation G_{letters}, range of the deviation about the programmed centre",
        ),
        "G_ls": um(
            least_squares_deviation(measured.angle, e, turn.radius),
            f"ISO 230-4 circular deviation G_{letters} about the centre of the least-squares circle",
        ),
        "F_max": um(float(e.max()), f"ISO 230-4 radial deviation F_{letters},max about the programmed circle"),
        "F_min": um(float(e.min()), f"ISO 230-4 radial deviation F_{letters},min about the programmed circle"),
        "mean": um(float(e.mean()), "mean radius deviation over the turn"),
        "median": um(measured.median, "median radius deviation over the turn"),
    }
    for axis in turn.axes:
        height = max(glitch.height for glitch in measured.glitches if glitch.axis == axis)
        figures[f"glitch_{axis}"] = um(height, f"quadrant glitch where {axis} reverses, the larger of the two")
    for glitch in measured.glitches:
        figures[f"glitch_{glitch.name}"] = um(
            glitch.height, f"quadrant glitch at {glitch.name}, largest within +-45 deg less the median of the turn"
        )
    return figures


def axis_letters(axes: Sequence[str]) -> str:
    """Name of a plane or of several axes: letters in a row, longer names joined by a hyphen."""
    return ("" if all(len(axis) == 1 for axis in axes) else "-").join(axes)


# How far setpoints may leave the circle [m]: compensations that a control adds to them are some micrometres, while a
# lead-in or a wrong centre makes far more, and figures that have nothing to do with the machine.
OFF_CIRCLE = 20e-6
# A recording of full turns may lack this share of the last one: its positions are rounded, 1 um of some millimetres.
FULL_TURN_TOLERANCE = 1e-4
# The speed of a turn is constant where each of its parts takes as long as the others, to this share.
TURN_PARTS, EVEN_SPEED_SHARE = 16, 0.05


def recorded_circle(
    program: Program,
    segment: Segment,
    plane: tuple[str, str],
    centre: Mapping[str, float] | None = None,
    radius: float | None = None,
) -> Circular:
    """Circle of the recorded setpoints of ``segment`` in ``plane`` (first and second axis).

    centre: axis -> position [m]; radius [m]; what is not given is fitted to all setpoints of the recording by least
    squares, without its run-in and run-out. Full turns count from the first setpoint of the recording. Raises
    InputError: less than a full turn, or setpoints that leave the circle by more than OFF_CIRCLE within the turns.
    """
    recording = segment.geometry
    assert isinstance(recording, RecordedGeometry)
    # Half a position cycle's rounding must not let a setpoint of the run-in in, which lies a whole cycle away.
    rounding = 1e-6 * (program.time[1] - program.time[0])
    rows = (program.time >= recording.begin - rounding) & (program.time <= recording.end + rounding)
    time, x, y = (program.time[rows], *(program.x_s[axis][rows] for axis in plane))
    c, r = fitted_circle(x, y)
    if centre is not None:
        c = (centre[plane[0]], centre[plane[1]])
        r = float(np.hypot(x - c[0], y - c[1]).mean())
    r = r if radius is None else radius
    angle = np.unwrap(np.arctan2(y - c[1], x - c[0]))
    sense = 1 if angle[-1] >= angle[0] else -1
    turned = np.maximum.accumulate(sense * (angle - angle[0])) / (2 * math.pi)
    name = f"circularity: recorded setpoints of {plane[0]} and {plane[1]}"
    about = f"about {plane[0]} {c[0] * 1e3:.7g} mm, {plane[1]} {c[1] * 1e3:.7g} mm"
    turns = math.floor(float(turned[-1]) + FULL_TURN_TOLERANCE)
    if turns < 1:
        raise InputError(f"{name} cover {turned[-1] * 360:.4g} deg {about}; at least one full turn, 360 deg, is needed")
    within = turned <= turns
    off = float(np.abs(np.hypot(x[within] - c[0], y[within] - c[1]) - r).max())
    if off > OFF_CIRCLE:
        raise InputError(
            f"{name} leave the circle of R {r * 1e3:.7g} mm {about} by up to {off * 1e6:.4g} um; "
            f"allowed: {OFF_CIRCLE * 1e6:g} um. Take the circle alone with 'between', or give its centre and radius"
        )
    instants = [float(time[min(int(np.searchsorted(turned, k)), len(time) - 1)]) for k in range(turns + 1)]
    return Circular(
        axes=plane,
        centre=c,
        radius=r,
        sense=sense,
        start_angle=float(angle[0]),
        sweep=2 * math.pi * float(turned[-1]),
        turns=tuple(pairwise(instants)),
        steady=None,
        turn_time=None,
    )


def speed_change(program: Program, circle: Circular, begin: float, end: float) -> float:
    """Largest deviation of the setpoints' speed within a turn from its mean [1], by the time per 1/TURN_PARTS of it."""
    rows = (program.time >= begin) & (program.time <= end)
    time, x, y = program.time[rows], *(program.x_s[axis][rows] for axis in circle.axes)
    angle = np.unwrap(np.arctan2(y - circle.centre[1], x - circle.centre[0]))
    turned = np.maximum.accumulate(circle.sense * (angle - angle[0]))
    passed = np.interp(np.linspace(0, turned[-1], TURN_PARTS + 1), turned, time)
    parts = np.diff(passed)
    return float(np.abs(parts / parts.mean() - 1).max())


def fitted_circle(x: Array, y: Array) -> tuple[tuple[float, float], float]:
    """Centre and radius [m] of the circle with the least sum of squared distances: algebraic fit, then Gauss-Newton."""
    origin = (float(x.mean()), float(y.mean()))
    u, w = x - origin[0], y - origin[1]
    (p, q, s), *_ = np.linalg.lstsq(np.column_stack([2 * u, 2 * w, np.ones(len(u))]), u**2 + w**2, rcond=None)
    radius = math.sqrt(max(float(s + p**2 + q**2), 0.0))
    for _ in range(8):
        distance = np.maximum(np.hypot(u - p, w - q), 1e-12)
        normal = np.column_stack([(u - p) / distance, (w - q) / distance, np.ones(len(u))])
        step = np.linalg.lstsq(normal, distance - radius, rcond=None)[0]
        p, q, radius = p + step[0], q + step[1], radius + float(step[2])
    return (origin[0] + float(p), origin[1] + float(q)), radius


# --- What a signal is made of, by frequency ---------------------------------------------------------------------------


def amplitude_spectrum(values: Array, interval: float, rows: int | None = None) -> tuple[Array, Array]:
    """Frequency [Hz] and amplitude spectrum of ``values`` (N,), sampled every ``interval`` [s], by Hann's window.

    A sine of amplitude A on a line stands there as A. rows: of the stretches, half over each other, whose spectra are
    averaged by power; None: one, of all rows. Stretches lose their mean.
    """
    size = min(rows or len(values), len(values))
    window = np.hanning(size)
    power = []
    for first in range(0, len(values) - size + 1, max(size // 2, 1)):
        part = values[first : first + size]
        power.append((2 * np.abs(np.fft.rfft((part - np.mean(part)) * window)) / np.sum(window)) ** 2)
    frequency = np.fft.rfftfreq(size, interval)
    return np.asarray(frequency, dtype=np.float64), np.asarray(np.sqrt(np.mean(power, axis=0)), dtype=np.float64)
