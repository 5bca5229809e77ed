"""Torque that was recorded as no more than a limit, where the axis needed more: rows that determine nothing of
friction.

A range of the recording, or of what the drive hands out, cuts the torque off. Its rows then heap at one value. So they
do where an axis accelerates evenly, or where the drive itself has no more to give: such rows are right. The difference
is the motion: where inertia and friction (inertia.py, of the other rows) need clearly more than the value at which the
rows heap, the record is cut off there. What they need is known while the axis moves, in a direction in which other rows
have shown its friction and load.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from feedsim.estimation.identify.inertia import REST_SPEED_SHARE, Inertia, inertia, smooth_speed
from feedsim.estimation.identify.parameters import RIGID_AXIS_NAMES
from feedsim.estimation.identify.plateaus import resolution, white
from feedsim.estimation.identify.record import Array, Record, runs
from feedsim.estimation.least_squares import NORMAL_95
from feedsim.foundation.errors import Finding, InputError

MEAN = 5  # rows of the mean that takes noise, added behind the limit, off the heap
CLIPPING_SIGMAS = 4.0  # standard deviations that pass for noise
MIN_HEAP_ROWS = 5  # rows of a heap that determine whether it is one
CLIPPED_EXCESS = 0.05  # of the limit: what inertia and friction must need beyond it; the simple friction is not better
# Rows in motion that lie at one value to the last digit, and how many more they are than at any other value.
MIN_TIED_ROWS, TIED_RATIO = 10, 5.0
LIMIT_ROWS_SHARE = 0.02  # share of the rows that lie at a limit of the drive, at least
MOST_SHOWN = 3  # stretches of time that the message names


@dataclass(frozen=True)
class _TorqueLimit:
    """Where the torque is largest on a side (1 or -1): that times the side, what it scatters by [N.m]; rows (N,)."""

    side: float
    limit: float
    reach: float
    rows: NDArray[np.bool_]

    def equals_limit(self, other: _TorqueLimit) -> bool:
        """Whether both end at the same limit: a range is as wide to either side."""
        return abs(self.limit - other.limit) <= self.reach + other.reach


@dataclass(frozen=True)
class _NeededTorque:
    """Torque that the motion of a record needs, and its standard deviation (N,) [N.m]; nan where it is not known."""

    torque: Array
    sigma: Array


def without_clipped(
    records: Sequence[Record],
    J: float | None = None,
    left_out: str = "these rows and the plateaus with them are left out",
    simulated: Sequence[Array] | None = None,
) -> tuple[tuple[Record, ...], tuple[Finding, ...]]:
    """The records with the rows marked at which their torque is cut off, and a finding for each such record.

    J: inertia [kg.m2] for records whose other rows determine none, or roughly only; at most the true one.
    left_out: what the caller does with such rows.
    simulated: (N,) of each record: torque [N.m] of a machine on this motion, in place of inertia and simple friction.
    """
    heaps = [tuple(_find_torque_limit(record, side) for side in (1.0, -1.0)) for record in records]
    trial = [
        replace(record, clipped=np.any([heap.rows for heap in both], axis=0))
        for record, both in zip(records, heaps, strict=True)
    ]
    left = 0.0
    models: list[list[_NeededTorque]] = []
    if simulated is not None:  # another machine than that of the record needs another torque everywhere
        off = [(torque - each.torque)[~each.clipped] for each, torque in zip(trial, simulated, strict=True)]  # type: ignore[operator]
        # Where no row is beside the limits, nothing says how well the machine's torque is that of the record.
        left = float(np.sqrt(np.mean(rest**2))) if len(rest := np.concatenate(off)) else np.inf
        models.append([_NeededTorque(torque, np.zeros(len(torque))) for torque in simulated])
    else:
        slow = REST_SPEED_SHARE * max((float(np.max(np.abs(smooth_speed(record)))) for record in records), default=0.0)
        with suppress(InputError):
            rigid = inertia(trial)
            left = rigid.rms
            models.append([_of_line(record, rigid, slow) for record in records])
        if J is not None:
            models.append([_of_inertia(record, J, slow) for record in trial])
    shortest = 1 if simulated is not None else MIN_HEAP_ROWS
    proven = [
        heap
        for needed in models
        for record, both, one in zip(records, heaps, needed, strict=True)
        for heap in _proven(record, both, one, CLIPPING_SIGMAS * left, shortest)
    ]
    result, said = [], list[Finding]()
    for k, (record, both) in enumerate(zip(records, heaps, strict=True)):
        # What one record shows of a limit holds for all that end at it.
        kept = [heap for heap in both if any(heap.equals_limit(other) for other in proven)]
        if not kept:
            result.append(record)
            continue
        result.append(replace(record, clipped=np.any([heap.rows for heap in kept], axis=0)))
        said.append(_words(result[-1], kept, [needed[k] for needed in models], left_out))
    return tuple(result), tuple(said)


def tied_at_limit(record: Record) -> tuple[Record, float]:
    """The record with rows marked as cut off whose torque is the largest one to the last digit, and that share [1].

    No torque of a motion repeats itself so. Whether the range of the record or the drive ends there is open.
    """
    speed = np.abs(smooth_speed(record))
    moving = speed > REST_SPEED_SHARE * np.max(speed)
    tied = np.zeros(len(record), dtype=bool)
    for value in (np.max(record.torque), np.min(record.torque)):
        rows = record.torque == value
        counts = np.unique(record.torque[moving & ~rows], return_counts=True)[1]
        most = max(MIN_TIED_ROWS, TIED_RATIO * float(np.max(counts, initial=0)))
        tied |= rows & (np.count_nonzero(rows & moving) >= most)
    if not np.any(tied):
        return record, 0.0
    marked = tied if record.clipped is None else record.clipped | tied
    return replace(record, clipped=marked), float(np.mean(tied))


def limit_shown(record: Record) -> float | None:
    """Largest torque [N.m], where so many rows lie at it that a drive may have its limit there; None: it is a peak."""
    if not record.driven:
        return None
    side = 1.0 if np.max(record.torque) >= -np.min(record.torque) else -1.0
    heap = _find_torque_limit(record, side)
    return heap.limit if np.count_nonzero(heap.rows) > LIMIT_ROWS_SHARE * len(record) else None


def _smooth(record: Record) -> Array:
    """(N,) torque, averaged over MEAN rows."""
    spread = np.pad(record.torque, MEAN // 2, mode="edge")
    return np.convolve(spread, np.full(MEAN, 1 / MEAN), "valid")


def _reach(record: Record) -> float:
    """By how much the mean of rows at a limit may lie off it [N.m]."""
    return float(max(CLIPPING_SIGMAS * white(record.torque) / np.sqrt(MEAN), resolution(record.torque)))


def _find_torque_limit(record: Record, side: float) -> _TorqueLimit:
    """Rows about the largest torque on a side: those within a mean's length of one whose mean lies there."""
    mean, torque, reach = side * _smooth(record), side * record.torque, _reach(record)
    # Of a peak the rows beside it may lie below every mean.
    limit = min(float(np.median(torque[mean >= np.max(mean) - 2 * reach])), float(np.max(mean)))
    wide = np.convolve((mean >= limit - reach).astype(np.float64), np.ones(MEAN), "same") > 0.5
    wide &= not np.all(wide)  # a torque that never changes ends at no limit
    return _TorqueLimit(side, limit, reach, wide)


def _ways(record: Record, slow: float) -> dict[float, NDArray[np.bool_]]:
    """Direction (1 or -1) -> (N,) rows that move in it: near rest friction may be anything up to F_C."""
    speed = smooth_speed(record)
    return {way: way * speed > slow for way in (1.0, -1.0)}


def _of_line(record: Record, rigid: Inertia, slow: float) -> _NeededTorque:
    """By a rigid axis with simple friction.

    Rows in one direction determine constant load and friction as one sum, which is no torque of the other direction.
    """
    speed = smooth_speed(record)
    columns = np.gradient(speed, record.interval), speed, np.sign(speed), np.ones(len(record))
    names = rigid.correlation.names
    X = np.column_stack([column for name, column in zip(RIGID_AXIS_NAMES, columns, strict=True) if name in names])
    torque = X @ np.array([rigid.estimates[name].value for name in names])
    seen = np.unique(np.sign(rigid.speeds))
    known = np.any([rows for way, rows in _ways(record, slow).items() if way in seen], axis=0)
    return _NeededTorque(
        np.where(known, torque if record.load is None else torque + record.load, np.nan),
        np.sqrt(np.einsum("ij,jk,ik->i", X, rigid.covariance, X)),
    )


def _of_inertia(record: Record, J: float, slow: float) -> _NeededTorque:
    """By an inertia that is known, with the friction and load of either direction as its rows beside the heaps have
    them. record: with its heaps marked."""
    assert record.clipped is not None
    accelerating = J * np.gradient(smooth_speed(record), record.interval)
    if record.load is not None:
        accelerating = accelerating + record.load
    torque, sigma = np.full(len(record), np.nan), np.zeros(len(record))
    for way in _ways(record, slow).values():
        free = way & ~record.clipped
        if np.count_nonzero(free) >= MIN_HEAP_ROWS:
            off = (_smooth(record) - accelerating)[free]
            torque[way] = accelerating[way] + float(np.median(off))
            sigma[way] = float(np.std(off)) * np.sqrt(MEAN / len(off))  # neighbours share their means
    return _NeededTorque(torque, sigma)


def _proven(
    record: Record, both: Sequence[_TorqueLimit], needed: _NeededTorque, margin: float, shortest: int
) -> Sequence[_TorqueLimit]:
    """The heaps of a record at which its torque is cut off.

    A range is as wide to either side: where both were cut off, at unlike limits, what is needed is wrong.
    """
    proven = [heap for heap in both if _needs_more_torque(heap, record, needed, margin, shortest)]
    return proven if len(proven) < 2 or proven[0].equals_limit(proven[1]) else []


def _needs_more_torque(heap: _TorqueLimit, record: Record, needed: _NeededTorque, margin: float, shortest: int) -> bool:
    """Whether the motion needs clearly more than the limit, and than the torque there, over some run of the heap, of so
    many means at least."""
    limit, side = heap.limit, heap.side
    least = side * needed.torque - NORMAL_95 * needed.sigma

    def beyond() -> Iterator[float]:
        for first, last in runs(heap.rows):
            rows = first + np.flatnonzero(np.isfinite(least[first:last]))
            if last - first >= shortest + MEAN - 1 and len(rows) >= shortest:
                yield float(np.median(least[rows])) - max(limit, float(np.median(side * record.torque[rows])))

    return max(beyond(), default=-np.inf) > max(CLIPPED_EXCESS * abs(limit), margin)


def _words(record: Record, heaps: Sequence[_TorqueLimit], models: Sequence[_NeededTorque], left_out: str) -> Finding:
    assert record.clipped is not None
    limits = " and ".join(f"{heap.side * heap.limit:+.4g} N.m" for heap in heaps)
    parts = runs(record.clipped)
    times = [f"{record.time[first]:.4g} to {record.time[last - 1]:.4g} s" for first, last in parts[:MOST_SHOWN]]
    rest = f" and {len(parts) - MOST_SHOWN} times more" if len(parts) > MOST_SHOWN else ""
    share = 100 * float(np.mean(record.clipped))
    beyond = [
        (float(np.max(heap.side * each)), heap.side)
        for heap in heaps
        for needed in models
        if len(each := needed.torque[heap.rows & np.isfinite(needed.torque)])
    ]
    # A heap at the limit of another record need not show any such row itself.
    most = f", where inertia and friction need {np.prod(max(beyond)):+.3g} N.m" if beyond else ""
    remedy = "record with a wider range, or drive more gently"
    return Finding(
        "record-clipped", "doubt",
        f"{record.name}: the torque is cut off at {limits}{most}: "
        f"{share:.2g} % of the rows, at {', '.join(times)}{rest}; {left_out}; {remedy}",
        record.name, remedy,
    )  # fmt: skip
