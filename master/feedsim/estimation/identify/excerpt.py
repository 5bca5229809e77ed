"""Which parts of a long record an identification takes: those that determine the axis best, up to a time.

Most of an hour repeats what the rest of it shows. So records are cut into slices, and those are taken with which the
determinant of the information matrix is largest (D-optimal design; V. V. Fedorov, Theory of Optimal Experiments, 1972).
The information is that of a linear model of the torque. Its columns are what inertia, friction over speed, constant
load and pre-sliding act by, where the axis moves:

    dn/dt    n    sgn n    sgn n ln|n|    1    sgn n exp(-angle since the reversal/PRESLIDING)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from math import ceil

import numpy as np

from feedsim.estimation.identify.plateaus import white
from feedsim.estimation.identify.record import Array, Record, runs
from feedsim.foundation.errors import Finding

# Of the records that friction is identified from: [s] and rows at most.
MAX_EXCERPT_TIME, MAX_EXCERPT_ROWS = 600.0, 1_200_000
SLICE_TIME = 60.0  # [s] of a slice of an excerpt: long enough for strokes at slow speeds
WINDOW_SLICES = 6  # slices of a window
SAMPLING_TIME = 0.01  # [s] between the instants that are looked at
PRESLIDING_ANGLE = 0.02  # [rad] of the motor, over which pre-sliding has mostly passed
NOISES = 6.0  # standard deviations of the position's noise that count as motion between two instants
LEAST_INFORMATION = 1e-6  # of what all slices have of a column: a column that no slice has decides nothing
COLUMNS = 6


def total_time(records: Sequence[Record]) -> float:
    """Of all records together [s]."""
    return sum(len(record) * record.interval for record in records)


def excerpt(records: Sequence[Record], length: float = SLICE_TIME) -> tuple[tuple[Record, ...], tuple[Finding, ...]]:
    """The slices of records of one axis that determine it best, in the order of time, and a note on them.

    Neighbouring slices are one record. Records that are short are returned as they are. length: of a slice [s].
    """
    most = min(MAX_EXCERPT_TIME, MAX_EXCERPT_ROWS * min(record.interval for record in records))
    whole = total_time(records)
    if whole <= most:
        return tuple(records), ()
    cuts = [_cut(record, length) for record in records]
    information = _scaled(
        np.concatenate([_information(record, cut) for record, cut in zip(records, cuts, strict=True)])
    )
    durations = [(b - a) * record.interval for record, cut in zip(records, cuts, strict=True) for a, b in pairwise(cut)]
    chosen = np.zeros(len(information), dtype=bool)
    total = LEAST_INFORMATION * np.eye(COLUMNS)
    while True:
        gain = np.where(chosen, -np.inf, np.linalg.slogdet(total + information)[1])
        best = int(np.argmax(gain))
        if float(np.dot(chosen, durations)) + durations[best] > most:
            break
        chosen[best] = True
        total = total + information[best]
    result, k = [], 0
    for record, cut in zip(records, cuts, strict=True):
        for a, b in runs(chosen[k : k + len(cut) - 1]):
            part = record.between(cut[a], cut[b])
            result.append(replace(part, name=f"{record.name}, {part.time[0]:.6g} to {part.time[-1]:.6g} s"))
        k += len(cut) - 1
    text = (
        f"of {whole / 60:.4g} min of records {total_time(result) / 60:.3g} min are used, those that determine the axis "
        f"best: {'; '.join(part.name for part in result)}"
    )
    return tuple(result), (Finding("record-excerpt", "note", text),)


def best_window(record: Record, most: float) -> tuple[float, float]:
    """Begin and end [s] of the stretch of at most that time [s] that determines the axis best."""
    if total_time([record]) <= most:
        return float(record.time[0]), float(record.time[-1])
    rows = _cut(record, most / WINDOW_SLICES)
    information = _scaled(_information(record, rows))
    windows = np.lib.stride_tricks.sliding_window_view(information, WINDOW_SLICES, axis=0).sum(axis=-1)
    first = int(np.argmax(np.linalg.slogdet(LEAST_INFORMATION * np.eye(COLUMNS) + windows)[1]))
    return float(record.time[rows[first]]), float(record.time[rows[first + WINDOW_SLICES] - 1])


def _cut(record: Record, length: float) -> list[int]:
    """Rows at which a record is cut into equal slices of at most that time [s], both ends included."""
    count = ceil(len(record) * record.interval / length)
    return [round(row) for row in np.linspace(0, len(record), count + 1)]


def _scaled(information: Array) -> Array:
    """(S, C, C) of slices, so that all of them together have 1 of every column."""
    scale = np.sqrt(np.maximum(np.diagonal(information.sum(axis=0)), 1e-300))
    return np.asarray(information / np.outer(scale, scale))


def _information(record: Record, cut: Sequence[int]) -> Array:
    """(S, C, C) of the slices of a record."""
    step = max(round(SAMPLING_TIME / record.interval), 1)
    columns = _columns(record, step)
    result = np.zeros((len(cut) - 1, COLUMNS, COLUMNS))
    for k, (first, last) in enumerate(pairwise(-(-row // step) for row in cut)):
        result[k] = step * record.interval * columns[first:last].T @ columns[first:last]
    return result


def _columns(record: Record, step: int) -> Array:
    """(N, C) of every `step`-th row; 0 where the axis rests."""
    if record.angle is not None:
        every = record.angle
    else:
        assert record.speed is not None
        every = record.interval * np.cumsum(record.speed)
    angle, h = every[::step], step * record.interval
    if len(angle) < 2:
        return np.zeros((len(angle), COLUMNS))
    speed = np.gradient(angle, h)
    top = max(float(np.max(np.abs(speed))), 1e-300)
    moving = np.abs(speed) > NOISES * white(every) / h
    way = np.where(moving, np.sign(speed), 0.0)
    last = way[np.maximum.accumulate(np.where(moving, np.arange(len(way)), 0))]  # at rest that of the motion before
    travel = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(angle)))])
    reverses = np.concatenate([[False], last[1:] * last[:-1] < 0])
    since = travel - np.maximum.accumulate(np.where(reverses, travel, 0.0))
    logarithm = np.log(np.maximum(np.abs(speed) / top, 1e-12))
    presliding = np.exp(-since / PRESLIDING_ANGLE)
    shapes = [np.gradient(speed, h), speed, way, way * logarithm, np.ones(len(way)), way * presliding]
    return np.asarray(np.column_stack(shapes) * moving[:, None], dtype=np.float64)
