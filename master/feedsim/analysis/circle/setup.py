"""What the set-up of an instrument adds to a recorded circle: a centre that moves, and angles that are off.

A guide that bends moves the other axis: by s (x/R)^2 in second order, which is s/4 (sin phi + sin 3 phi) in the radius,
the first part of it a shift of the centre. In third order, by t ((x/R)^3 - (x/R)/2), which is t/8 sin 4 phi; the same
of the other guide has the other sign, so one circle shows the difference of both alone. The sum is an angle between
the axes: it is part of the squareness, and another radius separates it from that.

Angles that are off by a constant turn every term, which nothing shows but the places where the axes reverse. There the
deviation has an edge, of lost motion or friction. Written angle minus place is a + s b, where s is the sense of the
motion and b how far behind a reversal friction shows: both directions together determine a. An axle of the instrument
that lies off its centre adds e cos(phi + psi) to a; where there is time, it shows as well, as the motion turns evenly.

What the instrument and the guides do besides, in orders that no term has, is no noise: neighbours share it. Waves of
the orders FORM_ORDERS are fitted beside the terms, as large as what the terms leave shows them. Start reading at
angle_offset().
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feedsim.analysis.circle.doubts import Tails
from feedsim.analysis.circle.geometry import AxisDisplacements, TurnedPath
from feedsim.analysis.figures import Array

# Angles [deg]: over which means are compared for an edge, how far it may be off its place, how far apart places are
# that are tried; an edge must exceed what lies between the reversals by this.
EDGE_ANGLE, MAX_ANGLE_OFFSET, ANGLE_STEP, EDGE_RATIO = 1.0, 7.0, 0.05, 5.0
# Where no edge is seen, the angles may be off by this (standard deviation) [deg]; no place is known better than
# ANGLE_ACCURACY. Of one direction, friction shows this far behind a reversal, or not at all.
UNKNOWN_ANGLE, ANGLE_ACCURACY, FRICTION_DELAY_ANGLE = 2.5, 0.1, 0.7
EDGE_FLOOR = 20e-9  # [m]
# Where nothing shows them, what an axle off its centre adds to the angles (standard deviation of each part) [deg], and
# how even a motion turns [deg]: feeds swing by a thousandth in a turn, at most.
UNKNOWN_AXLE, EVEN_TURN = 0.3, 0.03
# Orders of waves of the radius that may be there beside the terms, of how many of them the largest says their size, and
# from how many times that of noise on they are looked at.
FORM_ORDERS, FORM_NEIGHBOURS, FORM_SEEN = range(3, 17), 7, 3.0


class Offset(NamedTuple):
    """By how much the written angles are larger than those of the machine, its standard deviation [rad], whether it was
    seen; what an axle off its centre adds to that, as multiples of the angle's cosine and sine, and their standard
    deviations [rad]; the standard deviation of all of it at each half axis, from + of the first axis on [rad]."""

    angle: float
    deviation: float
    seen: bool
    axle: tuple[float, float]
    axle_deviation: tuple[float, float]
    at_reversals: tuple[float, float, float, float]


def set_up_moves(paths: Sequence[TurnedPath]) -> list[AxisDisplacements]:
    """Of every path: the centre's way in a turn, ("drift_0", "drift_1"), 0 in its middle, and of each path but the
    first how far its centre lies from that of the first, ("centre_1_0", "centre_1_1"), and how much larger its radius
    is ("radius_1"), about the mean of all paths."""
    result: list[AxisDisplacements] = []
    for k, path in enumerate(paths):
        passed = (path.turned - path.covered / 2) / (2 * math.pi)
        own: dict[str, tuple[int | None, Array]] = {f"drift_{i}": (i, passed) for i in (0, 1)}
        for j in range(1, len(paths)):
            side = np.full(len(passed), (k == j) - 1 / len(paths))
            own |= {f"centre_{j}_0": (0, side), f"centre_{j}_1": (1, side), f"radius_{j}": (None, side)}
        result.append(own)
    return result


def axle_by_clock(paths: Sequence[TurnedPath], centre: Array, radius: float) -> tuple[Array, Array]:
    """What an axle off its centre adds to the angles (2,), and its standard deviation (2,) [rad]: of full turns with
    time, the part of the angle that comes once in a turn. centre: (2,) [m], about which the angle is even."""
    parts = []
    for path in paths:
        if path.clock is not None and path.phase is None and path.whole:
            waves = np.cos(path.angle), np.sin(path.angle)
            even = np.column_stack([np.ones(len(path.angle)), path.clock, *waves])
            parts.append(path.sense * np.linalg.lstsq(even, path.turned, rcond=None)[0][2:])
    if not parts:
        return np.zeros(2), np.full(2, math.radians(UNKNOWN_AXLE))
    apart = np.std(parts, axis=0) / math.sqrt(max(len(parts) - 1, 1))
    mean = np.mean(parts, axis=0) - np.array([centre[1], -centre[0]]) / radius
    return np.asarray(mean), np.asarray(np.hypot(apart, math.radians(EVEN_TURN)))


def angle_offset(
    paths: Sequence[TurnedPath],
    angles: Sequence[Array],
    signals: Sequence[Array],
    free: Sequence[NDArray[np.bool_]],
    axle: tuple[Array, Array] | None = None,
) -> Offset:
    """By how much written angles are larger than those of the machine, from the edges where the axes reverse.

    angles: of every path, with its distortion undone (N,) [rad]. signals: what the form, fitted away from the
    reversals, leaves (N,) [m]. free: which samples are away from all reversals (N,). axle: what is known of it
    beforehand, and its standard deviation [rad].
    """
    places = np.radians(np.arange(-2 * MAX_ANGLE_OFFSET, 2 * MAX_ANGLE_OFFSET + ANGLE_STEP / 2, ANGLE_STEP))
    near = np.abs(places) <= math.radians(MAX_ANGLE_OFFSET + 2)
    edges: dict[tuple[int, int], list[Array]] = {}
    calm = []
    for path, angle, signal, apart in zip(paths, angles, signals, free, strict=True):
        even, jumps, quiet = _jumps(path, angle, signal, apart)
        calm.append(jumps[quiet])
        for which in range(4):
            at = which * math.pi / 2 + path.sense * places
            if not _covered_angles(path, angle, at[near]).all():
                continue
            edge = path.sense * np.interp(at, even, jumps, period=2 * math.pi)
            edges.setdefault((which, path.sense), []).append(edge)
    around = np.concatenate(calm)
    scatter = max(1.4826 * float(np.median(np.abs(around))) if len(around) else 0.0, EDGE_FLOOR / EDGE_RATIO)
    level = max(EDGE_RATIO * scatter, float(np.abs(around).max(initial=0.0)) if len(around) else 0.0)
    result: list[tuple[int, float, float]] = []
    for which in range(4):
        own = {sense: np.mean(edges[which, sense], axis=0) for sense in (1, -1) if (which, sense) in edges}
        height = min((float(np.abs(edge[near]).max()) for edge in own.values()), default=0.0)
        if height <= level:
            continue
        noise = math.radians(EDGE_ANGLE) * scatter / height
        if len(own) == 2:
            shift = _shift(own[1], own[-1])
            result.append((which, shift / 2, noise))
        else:
            ((sense, edge),) = own.items()
            at = float(places[near][np.abs(edge[near]).argmax()])
            result.append((which, sense * at, math.hypot(noise, math.radians(FRICTION_DELAY_ANGLE))))
    return _offset(result, axle or (np.zeros(2), np.full(2, math.radians(UNKNOWN_AXLE))))


def _offset(edges: Sequence[tuple[int, float, float]], axle: tuple[Array, Array]) -> Offset:
    """The offset that explains edges: which half axis, by how much its angle is larger, and the standard deviation of
    that [rad]; beside what is known of the axle."""
    mean = np.array([0.0, *axle[0]])
    known = np.diag(1 / np.array([math.radians(UNKNOWN_ANGLE), *axle[1]]) ** 2)
    accuracy = math.radians(ANGLE_ACCURACY)
    which, values, errors = (np.array(column) for column in zip(*edges, strict=True)) if edges else np.empty((3, 0))
    at = which * math.pi / 2
    matrix = np.column_stack([np.ones(len(at)), np.cos(at), np.sin(at)])
    weights = 1 / (errors**2 + accuracy**2)
    covariance = np.linalg.inv(matrix.T @ (weights[:, None] * matrix) + known)
    change = covariance @ (matrix.T @ (weights * (values - matrix @ mean)))
    off = values - matrix @ (mean + change)
    unlike = (float(weights @ off**2) + float(change @ known @ change)) / max(len(edges), 1)
    deviations = np.sqrt(np.diag(covariance) * max(unlike, 1.0))
    (angle, *parts), (error, *part_errors) = mean + change, deviations.tolist()
    seen = len(edges) > 0
    error = max(float(error), accuracy)
    if abs(angle) < 3 * error:
        angle, error = 0.0, math.hypot(error, angle)
    # Close to an edge all of it is known better than its parts.
    half_axes = np.arange(4) * math.pi / 2
    shape = np.column_stack([np.ones(4), np.cos(half_axes), np.sin(half_axes)])
    at_each = np.sqrt(np.einsum("ij,jk,ik->i", shape, covariance, shape) * max(unlike, 1.0))
    off = float(mean[0] + change[0] - angle)
    return Offset(
        float(angle),
        error,
        seen,
        (float(parts[0]), float(parts[1])),
        (part_errors[0], part_errors[1]),
        tuple(np.hypot(at_each, off).tolist()),
    )


def _covered_angles(path: TurnedPath, angle: Array, at: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Which of ``at`` (M,) [rad] a path of angles (N,) reaches (M,)."""
    return np.asarray(path.whole | (path.sense * (at - angle[0]) % (2 * math.pi) <= path.covered))


def _jumps(
    path: TurnedPath, angle: Array, signal: Array, free: NDArray[np.bool_]
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Even angles (M,) [rad]; there mean over EDGE_ANGLE towards larger angles minus that towards smaller ones [m]; and
    where both are on the path, away from all reversals."""
    count = round(360 / ANGLE_STEP)
    even = np.arange(count) * (2 * math.pi / count) - math.pi
    order = np.argsort(angle)
    values = np.interp(even, angle[order], signal[order], period=2 * math.pi)
    clear = np.interp(even, angle[order], free[order].astype(float), period=2 * math.pi)
    clear *= _covered_angles(path, angle, even)
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


def form_waves(
    angles: Sequence[Array], senses: Sequence[int], remaining: Sequence[Array], free: Sequence[NDArray[np.bool_]]
) -> Tails:
    """Waves of the radius in FORM_ORDERS, alike in both directions and opposite in them, and how large they may be.

    remaining: what the terms leave (N,) [m], of which ``free`` counts. What a term has in common with a wave hides in
    it: the orders about one say how large it may be, which is nothing where they show no more than noise.
    """
    sides = 2 if len(set(senses)) == 2 else 1
    waves = [
        np.column_stack([
            float(sense) ** side * wave(order * angle)
            for side in range(sides)
            for order in FORM_ORDERS
            for wave in (np.cos, np.sin)
        ])
        for angle, sense in zip(angles, senses, strict=True)
    ]  # fmt: skip
    matrix, rows = np.concatenate(waves), np.concatenate(free)
    off = np.concatenate(remaining)[rows]
    sizes = np.linalg.lstsq(matrix[rows], off, rcond=None)[0]
    noise = float(np.median(np.abs(off - matrix[rows] @ sizes))) / 0.6745 * math.sqrt(2 / max(int(rows.sum()), 1))
    power = (sizes.reshape(sides, len(FORM_ORDERS), 2) ** 2).mean(axis=2)
    around = np.pad(power, ((0, 0), (FORM_NEIGHBOURS // 2,) * 2))
    spread = np.sqrt(np.lib.stride_tricks.sliding_window_view(around, FORM_NEIGHBOURS, axis=1).max(axis=2)).repeat(2)
    seen = spread > FORM_SEEN * noise
    return Tails(matrix[:, seen], spread[seen])
