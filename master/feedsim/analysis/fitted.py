"""The circle that recorded setpoints run through: centre, radius and full turns."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from feedsim.analysis.figures import Array
from feedsim.errors import InputError
from feedsim.motions.circular import Circular
from feedsim.motions.setpoints import Recorded
from feedsim.nc import Program, Segment

# How far setpoints may leave the circle [m]: compensations that a control adds to them are some micrometres, while a
# lead-in or a wrong centre makes far more, and figures that have nothing to do with the machine.
OFF_CIRCLE = 20e-6
# A recording of full turns may lack this share of the last one: its positions are rounded, 1 um of some millimetres.
CLOSED = 1e-4


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
    assert isinstance(recording, Recorded)
    # Half a position cycle's rounding must not let a setpoint of the run-in in, which lies a whole cycle away.
    rounding = 1e-6 * (program.time[1] - program.time[0])
    rows = (program.time >= recording.begin - rounding) & (program.time <= recording.end + rounding)
    time, x, y = (program.time[rows], *(program.x_s[axis][rows] for axis in plane))
    c, r = _fit(x, y)
    if centre is not None:
        c = (centre[plane[0]], centre[plane[1]])
        r = float(np.hypot(x - c[0], y - c[1]).mean())
    r = r if radius is None else radius
    angle = np.unwrap(np.arctan2(y - c[1], x - c[0]))
    sense = 1 if angle[-1] >= angle[0] else -1
    turned = np.maximum.accumulate(sense * (angle - angle[0])) / (2 * math.pi)
    name = f"circularity: recorded setpoints of {plane[0]} and {plane[1]}"
    about = f"about {plane[0]} {c[0] * 1e3:.7g} mm, {plane[1]} {c[1] * 1e3:.7g} mm"
    turns = math.floor(float(turned[-1]) + CLOSED)
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
    )


def _fit(x: Array, y: Array) -> tuple[tuple[float, float], float]:
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
