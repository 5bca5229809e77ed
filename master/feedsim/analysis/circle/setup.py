"""What the set-up of an instrument adds to a recorded circle: a centre that moves, and angles that are off.

A guide that bends moves the other axis: by s (x/R)^2 in second order, which is s/4 (sin phi + sin 3 phi) in the radius,
the first part of it a shift of the centre. In third order, by t ((x/R)^3 - (x/R)/2), which is t/8 sin 4 phi; the same
of the other guide has the other sign, so one circle shows the difference of both alone. The sum is an angle between
the axes: it is part of the squareness, and another radius separates it from that.

Angles that are off by a constant turn every term, which nothing shows but the places where the axes reverse. There the
deviation has an edge, of lost motion or friction. Written angle minus place is a + s b, where s is the sense of the
motion and b how far behind a reversal friction shows: both directions together determine a. Start reading at
angle_offset().
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feedsim.analysis.circle.geometry import Moved, TurnedPath
from feedsim.analysis.figures import Array

# Angles [deg]: over which means are compared for an edge, how far it may be off its place, how far apart places are
# that are tried; an edge must exceed what lies between the reversals by this.
EDGE_ANGLE, MAX_ANGLE_OFFSET, ANGLE_STEP, EDGE_RATIO = 1.0, 7.0, 0.05, 5.0
# Where no edge is seen, the angles may be off by this (standard deviation) [deg]; no place is known better than
# ANGLE_ACCURACY. Of one direction, friction shows this far behind a reversal, or not at all.
UNKNOWN_ANGLE, ANGLE_ACCURACY, FRICTION_DELAY_ANGLE = 2.5, 0.1, 0.7
EDGE_FLOOR = 20e-9  # [m]


class Offset(NamedTuple):
    """By how much the written angles are larger than those of the machine, its standard deviation [rad], and whether
    it was seen."""

    angle: float
    deviation: float
    seen: bool


def centre_moves(paths: Sequence[TurnedPath]) -> list[Moved]:
    """Of every path: the centre's way in a turn, ("drift_0", "drift_1"), 0 in its middle, and of each path but the
    first how far its centre lies from that of the first, ("centre_1_0", "centre_1_1"), half of it on either side."""
    result: list[Moved] = []
    for k, path in enumerate(paths):
        turned = path.sense * np.unwrap(path.angle)
        passed = (turned - turned[0]) / (2 * math.pi) - 0.5
        own = {f"drift_{i}": (i, passed) for i in (0, 1)}
        for j in range(1, len(paths)):
            side = 0.5 if k == j else -0.5 if k == 0 else 0.0
            own |= {f"centre_{j}_{i}": (i, np.full(len(passed), side)) for i in (0, 1)}
        result.append(own)
    return result


def angle_offset(
    paths: Sequence[TurnedPath], angles: Sequence[Array], signals: Sequence[Array], free: Sequence[NDArray[np.bool_]]
) -> Offset:
    """By how much written angles are larger than those of the machine, from the edges where the axes reverse.

    angles: of every path, with its distortion undone (N,) [rad]. signals: what the form, fitted away from the
    reversals, leaves (N,) [m]. free: which samples are away from all reversals (N,).
    """
    places = np.radians(np.arange(-2 * MAX_ANGLE_OFFSET, 2 * MAX_ANGLE_OFFSET + ANGLE_STEP / 2, ANGLE_STEP))
    edges: dict[tuple[int, int], list[Array]] = {}
    calm = []
    for path, angle, signal, apart in zip(paths, angles, signals, free, strict=True):
        even, jumps, quiet = _jumps(angle, signal, apart)
        calm.append(jumps[quiet])
        for which in range(4):
            at = which * math.pi / 2 + path.sense * places
            edge = path.sense * np.interp(at, even, jumps, period=2 * math.pi)
            edges.setdefault((which, path.sense), []).append(edge)
    around = np.concatenate(calm)
    scatter = max(1.4826 * float(np.median(np.abs(around))) if len(around) else 0.0, EDGE_FLOOR / EDGE_RATIO)
    level = max(EDGE_RATIO * scatter, float(np.abs(around).max(initial=0.0)) if len(around) else 0.0)
    near = np.abs(places) <= math.radians(MAX_ANGLE_OFFSET + 2)
    result: list[tuple[float, float]] = []
    for which in range(4):
        own = {sense: np.mean(edges[which, sense], axis=0) for sense in (1, -1) if (which, sense) in edges}
        height = min(float(np.abs(edge[near]).max()) for edge in own.values())
        if height <= level:
            continue
        noise = math.radians(EDGE_ANGLE) * scatter / height
        if len(own) == 2:
            shift = _shift(own[1], own[-1])
            result.append((shift / 2, noise))
        else:
            ((sense, edge),) = own.items()
            at = float(places[near][np.abs(edge[near]).argmax()])
            result.append((sense * at, math.hypot(noise, math.radians(FRICTION_DELAY_ANGLE))))
    if not result:
        return Offset(0.0, math.radians(UNKNOWN_ANGLE), False)
    values, errors = (np.array(column) for column in zip(*result, strict=True))
    weights = 1 / (errors**2 + math.radians(ANGLE_ACCURACY) ** 2)
    mean = float(weights @ values / weights.sum())
    own_error = 1 / math.sqrt(float(weights.sum()))
    apart_error = math.sqrt(float(weights @ (values - mean) ** 2 / weights.sum()) / max(len(values) - 1, 1))
    error = max(own_error, apart_error, math.radians(ANGLE_ACCURACY))
    if abs(mean) < 3 * error:
        return Offset(0.0, math.hypot(error, mean), True)
    return Offset(mean, error, True)


def _jumps(angle: Array, signal: Array, free: NDArray[np.bool_]) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Even angles (M,) [rad]; there mean over EDGE_ANGLE towards larger angles minus that towards smaller ones [m]; and
    where both are away from all reversals."""
    count = round(360 / ANGLE_STEP)
    even = np.arange(count) * (2 * math.pi / count) - math.pi
    order = np.argsort(angle)
    values = np.interp(even, angle[order], signal[order], period=2 * math.pi)
    clear = np.interp(even, angle[order], free[order].astype(float), period=2 * math.pi)
    width = round(EDGE_ANGLE / ANGLE_STEP)
    total = np.concatenate([[0.0], np.cumsum(np.concatenate([values, values, values]))])
    at = np.arange(count) + count
    jumps = (total[at + width] - 2 * total[at] + total[at - width]) / width
    whole = np.concatenate([[0.0], np.cumsum(np.concatenate([clear, clear, clear]))])
    quiet: NDArray[np.bool_] = whole[at + width] - whole[at - width] > 2 * width - 0.5
    return np.asarray(even), np.asarray(jumps), quiet


def _shift(there: Array, back: Array) -> float:
    """How much later the edge of one direction comes than that of the other [rad], both by the way of the motion, in
    steps of ANGLE_STEP about 0 at the middle: where their product is largest."""
    most = round(2 * MAX_ANGLE_OFFSET / ANGLE_STEP)
    product = np.correlate(np.pad(there, most), back, "valid")
    at = int(product.argmax())
    fine = 0.0
    if 0 < at < len(product) - 1:
        below, top, above = product[at - 1 : at + 2]
        bend = below - 2 * top + above
        fine = float(0.5 * (below - above) / bend) if bend < 0 else 0.0
    return math.radians((at + fine - most) * ANGLE_STEP)
