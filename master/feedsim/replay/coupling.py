"""Axes that move one another: a mode of one axis that is seen at the scale of another one, out of records.

An axis that stands still while another one moves shows it: what its position does there follows the mode, whose
frequency and damping the moving axis has determined. The units are run with a trial shape b of mode k at the scale of
the axis at rest, and without. The difference d_k is what that shape does, its own drive included, and is linear in b:

    x_recorded - x_simulated = sum_k b_k d_k                              rows in which B stands still and A moves

A shape is kept where the first half of these rows predicts the second one, the second the first, and where its interval
excludes 0. The mode itself is known to intervals only: a mode that turns its motor less is driven less, and needs a
larger shape. So the interval includes what the shape would be with every value of the mode off by its own deviation.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import hypot
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feedsim.estimation.covariance import Covariance, correlation_length, stretched
from feedsim.estimation.interval import half_width, shows
from feedsim.estimation.jackknife import between_groups
from feedsim.identify.position_loop import rms
from feedsim.replay.closed_loop import AxisRecord, Replay
from feedsim.replay.elastic import RINGS, Beside
from feedsim.replay.outside import DIES_AWAY, detrended
from feedsim.scenario import Machine
from feedsim.structure import checked_modes
from feedsim.structure.modes import modes_text
from feedsim.trace.trace import Array

Rows = NDArray[np.int64]

TRIAL = 0.05  # shape of the trial, of the rigid motion of the axis that the mode is of
FEWEST_ROWS = 50  # at rest while another axis moves
PREDICTED = 0.8  # share of the variance of one half that a fit to the other half may leave
STRETCHES = 8  # of these rows, each of which is left out once


def coupled(
    machine: Machine,
    records: Mapping[str, AxisRecord],
    fmus: Path | None = None,
    spread: Mapping[int, Sequence[float]] | None = None,
) -> dict[tuple[int, str], Beside]:
    """Shapes that modes of one axis have at the scale of another one.

    Args:
        machine: with the modes of its axes; each of them moves one axis. records: axis -> its record, all over the same
            time.
        spread: row of the table -> standard deviations of frequency [Hz], damping, and shapes at motor and scale over
            the rigid motion; None: modes are known.

    Returns: (row of the table of modes, axis at rest) -> the shape over the rigid motion of the axis that the mode is
        of, where the record shows one.
    """
    table = checked_modes(machine)
    modes = {axis: np.flatnonzero(~table.rigid & (table.ports[f"n_{axis}"] != 0)) for axis in records}
    result: dict[tuple[int, str], Beside] = {}
    plain = None
    with Replay(machine, records, fmus=fmus) as replay:
        for mover, own in modes.items():
            for still, axis_record in records.items():
                stretches = _at_rest(axis_record, records[mover]) if still != mover and len(own) else []
                if sum(map(len, stretches)) < FEWEST_ROWS:
                    continue
                if plain is None:
                    plain = replay.follow(machine, ("x_a",))
                plain_x = plain[still]["x_a"]
                remaining = axis_record.position - plain_x
                D, e = (
                    np.concatenate([detrended(signal, rows) for rows in stretches])
                    for signal in (
                        np.column_stack([_seen(replay, machine, int(k), mover, still, plain_x) for k in own]),
                        remaining,
                    )
                )
                for column, (k, shape) in enumerate(zip(own, _shapes(D, e), strict=True)):
                    if shape is None:
                        continue
                    moved = []
                    for changed in _off(machine, int(k), mover, (spread or {}).get(int(k), ())):
                        alone = _seen(replay, changed, int(k), mover, still, plain_x)[:, None]
                        other = np.concatenate([detrended(alone, rows) for rows in stretches])
                        anew = np.column_stack([D[:, :column], other, D[:, column + 1 :]])
                        moved.append(float(np.linalg.lstsq(anew, e, rcond=1e-9)[0][column]) - shape[0])
                    result[int(k), still] = Beside(still, shape[0], hypot(shape[1], *moved))
    return result


def _at_rest(axis_record: AxisRecord, mover: AxisRecord) -> list[Rows]:
    """Stretches of rows in which an axis stands still and has died away, while another one moves or swings."""
    h = axis_record.record.interval
    own, other = (replace(one, rows=np.ones_like(one.rows)).moving for one in (axis_record, mover))
    count = len(own)
    own = np.convolve(own, np.ones(round(DIES_AWAY / h) + 1))[:count] > 0.5
    other = np.convolve(other, np.ones(round(RINGS / h) + 1))[:count] > 0.5
    rows = np.flatnonzero(~own & other)
    parts = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
    return [part for part in parts if len(part) >= FEWEST_ROWS]


def _seen(replay: Replay, machine: Machine, k: int, mover: str, still: str, plain: Array) -> Array:
    """(N,) position of `still` [m] that a shape of 1 of the k-th mode of `mover` makes. plain: (N,) without one [m]."""
    tried = replay.follow(_with_trial(machine, k, mover, still), ("x_a",))[still]["x_a"]
    return np.asarray((tried - plain) / TRIAL)


def _with_trial(machine: Machine, k: int, mover: str, still: str) -> Machine:
    """The machine whose k-th mode moves the scale of `still` by TRIAL of the rigid motion of `mover`."""
    table = checked_modes(machine)
    size = TRIAL * float(np.max(np.abs(table.ports[f"x_{mover}"][table.rigid])))
    ports = {port: np.array(column) for port, column in table.ports.items()}
    ports[f"x_{still}"][k] += size
    path = machine.modes.with_name(f"{machine.modes.stem}_trial_{k}_{still}.csv")  # a plant is known by its file
    path.write_text(modes_text(replace(table, ports=ports)), encoding="utf-8")
    return machine.model_copy(update={"modes": path})


def _off(machine: Machine, k: int, mover: str, spread: Sequence[float]) -> Iterator[Machine]:
    """The machine with each value of its k-th mode off by a standard deviation, in the order of `spread`."""
    table = checked_modes(machine)
    for which, sigma in enumerate(spread):
        frequency, damping = np.array(table.frequency), np.array(table.damping)
        ports = {port: np.array(column) for port, column in table.ports.items()}
        if which == 0:
            frequency[k] += sigma
        elif which == 1:
            damping[k] += sigma
        else:
            port = ports[f"{'nx'[which - 2]}_{mover}"]
            port[k] += sigma * np.max(np.abs(port[table.rigid]))
        path = machine.modes.parent / f"modes_off_{k}_{which}.csv"
        off = replace(table, frequency=frequency, damping=damping, ports=ports)
        path.write_text(modes_text(off), encoding="utf-8")
        yield machine.model_copy(update={"modes": path})


def _shapes(D: Array, e: Array) -> list[tuple[float, float] | None]:
    """Shape and standard deviation of every column; None where the record does not show it.

    D: (N, K) what a shape of 1 does [m]. e: (N,) what is there [m].
    """
    nothing: list[tuple[float, float] | None] = [None] * D.shape[1]
    scale = np.linalg.norm(D, axis=0)
    if not np.all(scale > 0):
        return nothing
    half = len(e) // 2
    for own, other in ((slice(0, half), slice(half, None)), (slice(half, None), slice(0, half))):
        b = np.linalg.lstsq(D[own], e[own], rcond=1e-9)[0]
        if not rms(e[other] - D[other] @ b) ** 2 < PREDICTED * rms(e[other]) ** 2:
            return nothing
    b = np.linalg.lstsq(D, e, rcond=1e-9)[0]
    remaining = e - D @ b
    covariance = Covariance.of(D.T @ D).by(stretched(D, remaining, 0.0, correlation_length))
    stretches = np.array_split(np.arange(len(e)), STRETCHES)
    sigma = np.sqrt(np.maximum(np.diag(covariance), between_groups(D, e, stretches)))
    return [
        (float(value), float(own)) if shows(float(value), half_width(float(own))) else None
        for value, own in zip(b, sigma, strict=True)
    ]
