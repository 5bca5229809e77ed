"""Torque that was recorded as no more than a limit, where the axis needed more: rows that determine nothing of
friction.

A range of the recording, or of what the drive hands out, cuts the torque off. Its rows then heap at one value. So they
do where an axis accelerates evenly, or where the drive itself has no more to give: such rows are right. The difference
is the motion: where inertia and friction (inertia.py, of the other rows) need clearly more than the value at which the
rows heap, the record is cut off there.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from feedsim.errors import InputError
from feedsim.identify.averages import resolution, white
from feedsim.identify.inertia import Inertia, inertia, smooth_speed
from feedsim.identify.record import Array, Record, runs

MEAN = 5  # rows of the mean that takes noise, added behind the limit, off the heap
CLIPPING_SIGMAS = 4.0  # standard deviations that pass for noise
MIN_HEAP_ROWS = 5  # rows of a heap that determine whether it is one
CLIPPED_EXCESS = 0.05  # of the limit: what inertia and friction must need beyond it; the simple friction is not better
MOST_SHOWN = 3  # stretches of time that the message names


@dataclass(frozen=True)
class _Heap:
    """Where the torque is largest on a side (1 or -1): that times the side, what it scatters by [N.m]; rows (N,)."""

    side: float
    limit: float
    reach: float
    rows: NDArray[np.bool_]

    def like(self, other: _Heap) -> bool:
        """Whether both end at the same limit: a range is as wide to either side."""
        return abs(self.limit - other.limit) <= self.reach + other.reach


def without_clipped(
    records: Sequence[Record],
    J: float | None = None,
    left_out: str = "these rows and the plateaus with them are left out",
    simulated: Sequence[Array] | None = None,
) -> tuple[tuple[Record, ...], tuple[str, ...]]:
    """The records with the rows marked at which their torque is cut off, and a sentence for each such record.

    J: inertia [kg.m2] for records whose other rows determine none. left_out: what the caller does with such rows.
    simulated: (N,) of each record: torque [N.m] of a machine on this motion, in place of inertia and simple friction.
    """
    heaps = [tuple(_heap(record, side) for side in (1.0, -1.0)) for record in records]
    trial = [
        replace(record, clipped=np.any([heap.rows for heap in both], axis=0))
        for record, both in zip(records, heaps, strict=True)
    ]
    rigid: Inertia | None = None
    if simulated is None:
        with suppress(InputError):
            rigid = inertia(trial)
    if rigid is None and J is None and simulated is None:
        return tuple(records), ()
    needed = simulated or [_needed(record, rigid, J or 0.0) for record in records]
    left = rigid.rms if rigid is not None else 0.0
    if simulated is not None:  # another machine than that of the record needs another torque everywhere
        off = [(torque - each.torque)[~each.clipped] for each, torque in zip(trial, simulated, strict=True)]  # type: ignore[operator]
        left = float(np.sqrt(np.mean(np.concatenate(off) ** 2)))
    shortest = 1 if simulated is not None else MIN_HEAP_ROWS
    proven = [
        heap
        for both, torque in zip(heaps, needed, strict=True)
        for heap in both
        if _beyond(heap, torque, CLIPPING_SIGMAS * left, shortest)
    ]
    result, said = [], []
    for record, both, torque in zip(records, heaps, needed, strict=True):
        # What one record shows of a limit holds for all that end at it.
        kept = [heap for heap in both if any(heap.like(other) for other in proven)]
        if not kept:
            result.append(record)
            continue
        result.append(replace(record, clipped=np.any([heap.rows for heap in kept], axis=0)))
        said.append(_words(result[-1], kept, torque, left_out))
    return tuple(result), tuple(said)


def _smooth(record: Record) -> Array:
    """(N,) torque, averaged over MEAN rows."""
    spread = np.pad(record.torque, MEAN // 2, mode="edge")
    return np.convolve(spread, np.full(MEAN, 1 / MEAN), "valid")


def _reach(record: Record) -> float:
    """By how much the mean of rows at a limit may lie off it [N.m]."""
    return float(max(CLIPPING_SIGMAS * white(record.torque) / np.sqrt(MEAN), resolution(record.torque)))


def _heap(record: Record, side: float) -> _Heap:
    """Rows about the largest torque on a side: those within a mean's length of one whose mean lies there."""
    mean, torque, reach = side * _smooth(record), side * record.torque, _reach(record)
    # Of a peak the rows beside it may lie below every mean.
    limit = min(float(np.median(torque[mean >= np.max(mean) - 2 * reach])), float(np.max(mean)))
    wide = np.convolve((mean >= limit - reach).astype(np.float64), np.ones(MEAN), "same") > 0.5
    return _Heap(side, limit, reach, wide)


def _needed(record: Record, rigid: Inertia | None, J: float) -> Array:
    """(N,) torque that inertia, simple friction and known load need [N.m]."""
    speed = smooth_speed(record)
    torque = J * np.gradient(speed, record.interval)
    if rigid is not None:
        J, viscous, friction, constant = (rigid.estimates[name].value for name in ("J", "sigma_2", "F_C", "M_0"))
        torque = J * np.gradient(speed, record.interval) + viscous * speed + friction * np.sign(speed) + constant
    return torque if record.load is None else torque + record.load


def _beyond(heap: _Heap, needed: Array, margin: float, shortest: int) -> bool:
    """Whether the motion needs clearly more than the limit over some run of the heap, of so many means at least."""
    limit, side = heap.limit, heap.side
    inner = [(first, last) for first, last in runs(heap.rows) if last - first >= shortest + MEAN - 1]
    most = max((float(np.median(side * needed[first:last])) for first, last in inner), default=-np.inf)
    return most > limit + max(CLIPPED_EXCESS * abs(limit), margin)


def _words(record: Record, heaps: Sequence[_Heap], needed: Array, left_out: str) -> str:
    assert record.clipped is not None
    limits = " and ".join(f"{heap.side * heap.limit:+.4g} N.m" for heap in heaps)
    parts = runs(record.clipped)
    times = [f"{record.time[first]:.4g} to {record.time[last - 1]:.4g} s" for first, last in parts[:MOST_SHOWN]]
    rest = f" and {len(parts) - MOST_SHOWN} times more" if len(parts) > MOST_SHOWN else ""
    share = 100 * float(np.mean(record.clipped))
    most = max(float(np.max(heap.side * needed[heap.rows])) for heap in heaps)
    return (
        f"{record.name}: the torque is cut off at {limits}, where inertia and friction need up to {most:.3g} N.m: "
        f"{share:.2g} % of the rows, at {', '.join(times)}{rest}; {left_out}; record with a "
        "wider range, or drive more gently"
    )
