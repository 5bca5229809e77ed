"""The log of a run as a control records it: sampled, delayed, disturbed by noise, rounded.

Sampling is at instants, without a filter ahead of it. What a signal is between two control cycles is known exactly, or
to far below a log's resolution: currents and motor torque run linearly over a cycle (so is the drive computed),
setpoints are held, position and speed are smooth and interpolated by a cubic through four cycles.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feedsim.cosim.unit import Floats
from feedsim.errors import InputError
from feedsim.scenario import Drive, Level, Logging, Scenario
from feedsim.trace import Table, Trace, least_and_largest, release, stretches

LINEAR = ("i_d", "i_q", "M_a", "M_fr", "z", "c")
SMOOTH = ("x_a", "n_a")
# Signals of the drive that jump where the current loop is ideal: what a cycle ends with holds over all of it.
IDEAL = ("i_d", "i_q", "M_a")
ON_THE_GRID = 1e-6  # of a control cycle: instants come from decimal text
# Below this share of the largest speed setpoint an axis stands: the spline of the setpoints rings down exponentially.
STANDS = 1e-9
# Rows that are worked on at a time.
ROWS_AT_ONCE = 1 << 19


def log(fine: Trace, logging: Logging, ideal: Sequence[str] = (), scratch: Path | None = None) -> Trace:
    """The log of signals at the control cycle: columns "A.signal", a row per logging interval, the first at 0.

    fine: columns "A.signal" at k T_c from 0; with A.n_ffw where noise is given as a share. Before the start every
    signal has been as it is at 0. Noise of every signal is a random stream of its own, made of the seed and
    the column's name. scratch: folder for the file that holds a long log.
    """
    cycle = float(fine.time[-1] - fine.time[0]) / max(len(fine) - 1, 1)
    every = round(logging.interval / cycle)
    if every < 1 or abs(logging.interval / cycle - every) > ON_THE_GRID * every:
        raise InputError(
            f"logging.interval: {logging.interval:.9g} s is no whole multiple of the signals' cycle, {cycle:.9g} s"
        )
    rows = -(-len(fine) // every)
    noise, steps, delays = logging.noise.given(), logging.quantisation.given(), logging.delay.given()
    axes = logging.axes or dict.fromkeys(name.partition(".")[0] for name in fine)
    names = [(axis, signal) for axis in axes for signal in logging.signals]
    logs = []
    for axis, signal in names:
        name = f"{axis}.{signal}"
        course, delay = _course(signal, axis in ideal), delays.get(signal, 0.0) / cycle
        deviation = _deviation(noise[signal], fine, axis, name) if signal in noise else None
        logs.append(_Column(fine[name], course, delay, deviation, _stream(logging.seed, name), steps.get(signal)))
    table = Table(1 + len(logs), rows, scratch)
    for first in range(0, rows, ROWS_AT_ONCE):
        at = np.arange(first, min(first + ROWS_AT_ONCE, rows)) * every
        table.append(np.array([at * cycle, *(column.at(at) for column in logs)]))
        release(*(column.values for column in logs))
    time, *columns = table.columns()
    result = {f"{axis}.{signal}": column for (axis, signal), column in zip(names, columns, strict=True)}
    return Trace(time, result, {name: fine.unit(name) for name in result})


@dataclass(frozen=True, eq=False)
class _Column:
    """A signal at the control cycle, and what becomes of it on its way into a log."""

    values: Floats
    course: str
    delay: float  # cycles
    deviation: float | None  # of the noise
    stream: np.random.Generator
    quantum: float | None

    def at(self, rows: NDArray[np.int64]) -> Floats:
        """The log at the next of its rows."""
        values = sampled(self.values, rows, self.delay, self.course)
        if self.deviation is not None:
            values = values + self.deviation * self.stream.standard_normal(len(values))
        if self.quantum is not None:
            values = np.round(values / self.quantum) * self.quantum
        return values


def sampled(values: Floats, rows: NDArray[np.int64], delay: float, course: str) -> Floats:
    """Values (N,) at the cycles ``rows`` less ``delay`` [cycles, any fraction].

    course: "linear" between cycles, "cubic" (Lagrange through four of them), "held" from a cycle on, "ahead": held from
    the cycle before.
    """
    at = np.maximum(rows - delay, 0.0)
    nearest = np.rint(at)
    at = np.where(np.abs(at - nearest) <= ON_THE_GRID, nearest, at)
    before = np.floor(at).astype(np.int64)
    share = at - before
    last = len(values) - 1
    after = np.minimum(before + 1, last)
    if course == "held" or not share.any():
        return np.asarray(values[before])
    if course == "ahead":
        return np.asarray(np.where(share > 0, values[after], values[before]))
    if course == "linear" or len(values) < 4:
        return np.asarray(values[before] + share * (values[after] - values[before]))
    first = np.clip(before - 1, 0, last - 3)
    u = at - first
    # Differences from the first point keep the digits of a small motion far from the origin.
    origin = values[first]
    d1, d2, d3 = (values[first + i] - origin for i in (1, 2, 3))
    cubic = d1 * u * (u - 2) * (u - 3) / 2 - d2 * u * (u - 1) * (u - 3) / 2 + d3 * u * (u - 1) * (u - 2) / 6
    return np.asarray(np.where(share > 0, origin + cubic, values[before]))


def logged_axes(scenario: Scenario) -> tuple[str, ...]:
    """Axes of a scenario's log, in the machine's order unless named."""
    if scenario.logging is None:
        return ()
    moved = {axis for motion in scenario.motions for axis in motion.axes}
    return scenario.logging.axes or tuple(axis for axis in scenario.machine.axes if axis in moved)


def ideal_axes(scenario: Scenario) -> tuple[str, ...]:
    """Axes with an ideal current loop. Of another maker's drive that is not known; its torque counts as linear."""
    drives = {name: axis.drive for name, axis in scenario.machine.axes.items()}
    return tuple(name for name, drive in drives.items() if isinstance(drive, Drive) and drive.ideal_current_loop)


def full_rate_columns(scenario: Scenario) -> tuple[str, ...]:
    """What must be recorded at the control cycle for a scenario's log; none without one.

    The setpoints show when an axis moves.
    """
    if scenario.logging is None:
        return ()
    return tuple(
        f"{axis}.{signal}"
        for axis in logged_axes(scenario)
        for signal in dict.fromkeys(("x_s", "n_ffw", *scenario.logging.signals))
    )


def _course(signal: str, ideal: bool) -> str:
    if ideal and signal in IDEAL:
        return "ahead"
    return "linear" if signal in LINEAR else "cubic" if signal in SMOOTH else "held"


def _deviation(level: Level, fine: Trace, axis: str, name: str) -> float:
    if not level.relative:
        return level.value
    speed = fine[f"{axis}.n_ffw"]
    stands = STANDS * max(abs(end) for end in least_and_largest(speed))
    means: list[float] = []
    counts: list[int] = []
    for n, values in stretches(speed, fine[name], rows=ROWS_AT_ONCE):
        if (moving := np.abs(n) > stands).any():
            means.append(float(np.mean(values[moving] ** 2)))
            counts.append(int(np.count_nonzero(moving)))
    # A single stretch keeps the digits of its mean.
    mean = means[0] if len(means) == 1 else float(np.dot(means, counts)) / max(sum(counts), 1)
    return level.value * math.sqrt(mean)


def _stream(seed: int, name: str) -> np.random.Generator:
    """A random stream that depends on the seed and the name alone."""
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=tuple(name.encode()))))
