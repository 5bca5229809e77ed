"""What identification works on: recorded motion and torque of one axis, motor side, on even time.

Nothing is resampled: rows stay rows, pieces without gaps, or are refused.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feedsim.foundation.errors import Finding, InputError

Array = NDArray[np.float64]

GRID_TOLERANCE = 1e-3  # of the step: how far an instant may lie off the grid
# Of a record, over its time.
RECORD_SIGNALS = (
    "torque",
    "angle",
    "speed",
    "load",
    "setpoint",
    "deviation",
    "speed_setpoint",
    "feedforward",
    "clipped",
)


@dataclass(frozen=True, eq=False)
class Record:
    """A stretch of a trace of one axis without gaps.

    Attributes:
        name: file, with the piece where the trace has gaps.
        time: (N,) [s], even.
        torque: (N,) motor torque [N.m], positive where it accelerates in the positive direction; nan all through
            where none was recorded (`driven`).
        angle: (N,) motor angle [rad], or the scale's position over the lead I_P; None where there is only a speed.
        speed: (N,) motor speed [rad/s]; None where there is only a position.
        load: (N,) known torque against the motor torque [N.m], for example a measured disturbance; None: none.
        load_on_slide: it is a force on the slide, as seen by the motor; else it acts at the motor.
        setpoint: (N,) commanded angle [rad]; None where it was not recorded, likewise those below.
        deviation: (N,) following error as the control forms it, of the delayed setpoint [rad].
        speed_setpoint, feedforward: (N,) speed that the position controller asks for, the feedforward in it [rad/s].
        columns: role -> name of the trace's column.
        clipped: (N,) bool, where the torque was cut off at a limit (clipping.py); None: nowhere.

    Raises InputError: fewer than two rows, lengths that differ, uneven time, neither angle nor speed.
    """

    name: str
    time: Array
    torque: Array
    angle: Array | None = None
    speed: Array | None = None
    load: Array | None = None
    load_on_slide: bool = False
    setpoint: Array | None = None
    deviation: Array | None = None
    speed_setpoint: Array | None = None
    feedforward: Array | None = None
    columns: Mapping[str, str] = field(default_factory=dict)
    clipped: NDArray[Any] | None = None

    def __post_init__(self) -> None:
        if len(self.time) < 2:
            raise InputError(f"{self.name}: {len(self.time)} row(s); at least 2 are needed")
        if self.angle is None and self.speed is None:
            raise InputError(f"{self.name}: neither a position nor a speed; one of them is needed")
        for role in RECORD_SIGNALS:
            values = getattr(self, role)
            if values is not None and len(values) != len(self.time):
                raise InputError(f"{self.name}: {role} has {len(values)} values, the time has {len(self.time)}")
        if np.max(np.abs(np.diff(self.time) - self.interval)) > GRID_TOLERANCE * self.interval:
            raise InputError(f"{self.name}: the time is not even")

    @property
    def interval(self) -> float:
        """Time between rows [s]."""
        return float((self.time[-1] - self.time[0]) / (len(self.time) - 1))

    @property
    def driven(self) -> bool:
        """Whether the torque was recorded."""
        return bool(np.isfinite(self.torque[0]))

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.time)

    def between(self, first: int, last: int) -> Record:
        """Rows first <= i < last."""
        signals = {role: values for role in ("time", *RECORD_SIGNALS) if (values := getattr(self, role)) is not None}
        return replace(self, **{role: values[first:last] for role, values in signals.items()})


# A step of more than that many usual ones is a gap, where rows are missing; the least gap has 2.
GAP_RATIO = 1.75
# More gaps than that, and than that share of all steps, are no gaps but uneven time: a clock of too few digits.
MOST_GAPS, SHARE_OF_GAPS = 10, 0.05
# Rows between gaps that make a stretch: fewer determine neither a motion nor whether they are even.
MIN_ROWS_BETWEEN_GAPS = 8


@dataclass(frozen=True, eq=False)
class Piece:
    """Rows first <= i < last without a gap, and their even time [s]."""

    first: int
    last: int
    time: Array


def even_pieces(time: Array, row: Callable[[int], str]) -> tuple[tuple[Piece, ...], tuple[Finding, ...]]:
    """Split at gaps and even out jitter.

    time: (N,) [s]; row: where a row of that index stands, for messages.

    The usual step is the median. A step of more than GAP_RATIO of it is a gap. Between gaps every instant must lie
    within GRID_TOLERANCE of a step of the even grid through the first and the last one, which then takes its place.
    Where there are gaps, fragments of fewer than MIN_ROWS_BETWEEN_GAPS rows are left out.

    Returns the pieces and what there is to say about gaps.

    Raises:
        InputError: fewer than 2 rows; time that does not increase; steps that are neither even nor gaps, or too many
            gaps to be some.
    """
    if len(time) < 2:
        raise InputError(f"{row(0)}: a single row; at least 2 are needed" if len(time) else "no rows")
    steps = np.diff(time)
    if (wrong := np.flatnonzero(steps <= 0)).size:
        at = int(wrong[0]) + 1
        raise InputError(f"{row(at)}: time {time[at]:.9g} s follows {time[at - 1]:.9g} s; it must increase")
    usual = float(np.median(steps))
    breaks = [int(i) for i in np.flatnonzero(steps > GAP_RATIO * usual)]
    if len(breaks) > max(MOST_GAPS, SHARE_OF_GAPS * len(steps)):
        raise _explain_uneven_time(time, breaks[0] + 1, usual, float(time[-1] - time[0]) / len(steps), row)
    edges = [0, *(i + 1 for i in breaks), len(time)]
    pieces, dropped = [], []
    for first, last in pairwise(edges):
        if breaks and last - first < MIN_ROWS_BETWEEN_GAPS:
            dropped.append(last - first)
            continue
        pieces.append(_even_piece(time, first, last, row))
    if not pieces:
        raise InputError(f"{row(0)}: no {MIN_ROWS_BETWEEN_GAPS} rows follow one another without a gap")
    return tuple(pieces), tuple(_gaps(time, breaks, usual, dropped, row))


def _even_piece(time: Array, first: int, last: int, row: Callable[[int], str]) -> Piece:
    own = time[first:last]
    grid = np.linspace(own[0], own[-1], len(own))
    step = float(grid[-1] - grid[0]) / (len(own) - 1)
    off = np.abs(own - grid)
    if np.max(off) > GRID_TOLERANCE * step:
        steps = np.diff(own)
        at = int(np.argmax(np.abs(steps - np.median(steps)))) + 1
        raise _explain_uneven_time(time, first + at, float(np.median(steps)), step, row)
    return Piece(first, last, grid)


def _explain_uneven_time(time: Array, at: int, usual: float, mean: float, row: Callable[[int], str]) -> InputError:
    step = float(time[at] - time[at - 1])
    return InputError(
        f"{row(at)}: the time is not even: {time[at]:.9g} s comes {1e3 * step:.6g} ms after the row before, the usual "
        f"step is {1e3 * usual:.6g} ms ({100 * GRID_TOLERANCE:g} % off the grid is tolerated). If only the digits of "
        "the time "
        f"are too few, give its interval in place of its column in a mapping file, where the mean step is "
        f"{1e3 * mean:.6g} ms: time: {{interval: {1e3 * mean:.3g} ms}}; what was sampled unevenly is to be resampled"
    )


def _gaps(time: Array, breaks: list[int], usual: float, dropped: list[int], row: Callable[[int], str]) -> list[Finding]:
    if not breaks:
        return []
    first = breaks[0]
    missing = sum(max(round(float(time[i + 1] - time[i]) / usual) - 1, 1) for i in breaks)
    text = (
        f"{row(first + 1)}: rows are missing between {time[first]:.6g} and {time[first + 1]:.6g} s"
        + (f", and at {len(breaks) - 1} more place{'s'[: len(breaks) > 2]}" if len(breaks) > 1 else "")
        + f" (about {missing} in all); the pieces are taken as records of their own"
    )
    result = [Finding("rows-missing", "doubt", text, row(first + 1))]
    if not dropped:
        return result
    left_out = (
        f"{len(dropped)} fragment{'s'[: len(dropped) > 1]} of fewer than {MIN_ROWS_BETWEEN_GAPS} rows beside gaps "
        "left out "
        f"({sum(dropped)} row{'s'[: sum(dropped) > 1]})"
    )
    return [*result, Finding("rows-left-out", "doubt", left_out, row(first + 1))]


def runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Rows (first, behind the last) of the runs of a mask (N,) that are true, in their order."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return [(int(first), int(last)) for first, last in zip(edges[::2], edges[1::2], strict=True)]
