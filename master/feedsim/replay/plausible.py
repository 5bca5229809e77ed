"""Whether the position of a record can be that of an axis that follows its setpoint, by the record alone.

    position = gain (setpoint - delay * speed of the setpoint) + offset

Gain, delay and offset are least squares over the rows that count. A wrong sign or unit shows in the gain, another zero
in the offset, and a column of something else in what remains. Rows at which the position jumps are looked for ahead.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import pi

import numpy as np

from feedsim.arguments import spelt
from feedsim.identify.position_loop import rms
from feedsim.replay.closed_loop import AxisRecord
from feedsim.trace.trace import Array

SETPOINT_ROUNDING = 1e-7  # of the way: a setpoint and a position that differ by rounding alone
# Of a jump, which gain and delay do not explain: over the usual large steps, over the encoder's step, over the way per
# row at top speed, and over what the setpoint's speed changes by from row to row. The usual large ones are what a share
# of the rows exceeds, but some rows at least.
JUMP_RATIO, JUMP_STEPS, JUMP_WAY, JUMP_ASKED = 10.0, 10.0, 0.1, 1.5
LARGE_SHARE, LARGE_ROWS = 0.01, 8
MAX_LAG = 0.25  # of the way: an axis that lags by more has a gain of its own, as a fast oscillation has
MAX_REMAINING = 0.05  # share of the position's way that setpoint and delay may leave
GAIN_TOLERANCE = 0.05
MAX_OFFSET, MIN_OFFSET = 0.05, 20e-6  # of the way; [m], thermal growth and compensation are no other zero
UNIT_FACTORS = (
    (25.4, "inch and mm"),
    (1000.0, "m and mm"),
    (1000 / 25.4, "inch and m"),
    (10.0, "cm and mm"),
    (2.0, "diameter and radius"),
    (2 * pi, "turns and radians"),
    (180 / pi, "degrees and radians"),
    (360.0, "degrees and turns"),
)


def implausible(axis_record: AxisRecord) -> list[str]:
    """Why the position, or the torque, of a record cannot be that of its axis: a sentence for each reason."""
    where = f"{axis_record.record.name}, axis {axis_record.axis}"
    return [f"{where}: {text}" for text in (*_of_position(axis_record), *_of_torque(axis_record))]


def _of_position(axis_record: AxisRecord) -> Iterator[str]:
    x_s, x_a = axis_record.setpoint[axis_record.rows], axis_record.position[axis_record.rows]
    way = float(np.ptp(x_s))
    if not way > 0:
        return
    largest = float(np.max(np.abs(x_s - x_a)))
    if largest <= SETPOINT_ROUNDING * way:
        yield (
            f"the position setpoint is the recorded position (largest difference {1e9 * largest:.3g} nm of a way of "
            f"{1e3 * way:.4g} mm). The distance between them shows the drive; name the column of the setpoint"
        )
        return
    speed = np.gradient(axis_record.setpoint, axis_record.record.interval)[axis_record.rows]
    middle = float(np.mean(x_s))
    columns = np.column_stack([x_s - middle, speed, np.ones_like(x_s)])
    gain, lag, mean = (float(value) for value in np.linalg.lstsq(columns, x_a, rcond=None)[0])
    off = x_a - columns @ np.array([gain, lag, mean])
    yield from _jumps(x_s, x_a, off, axis_record.record.time[axis_record.rows])
    remaining, own_way = rms(off), float(np.ptp(x_a))
    if remaining >= MAX_REMAINING * own_way:
        yield (
            f"the recorded position does not follow its setpoint: it moves by {1e3 * own_way:.4g} mm, the setpoint by "
            f"{1e3 * way:.4g} mm, and gain, delay and offset leave {1e3 * remaining:.3g} mm rms; check that both "
            "columns are of this axis"
        )
    elif abs(lag) * float(np.max(np.abs(speed))) > MAX_LAG * abs(gain) * way:
        return
    elif abs(gain - 1) > GAIN_TOLERANCE:
        yield f"the recorded position moves {gain:.4g} times as far as its setpoint: {_cause(gain)}"
    elif abs(mean - middle) > max(MAX_OFFSET * way, MIN_OFFSET):
        yield (
            f"the recorded position is {1e3 * (mean - middle):+.4g} mm off its setpoint throughout, on a way of "
            f"{1e3 * way:.4g} mm; both columns must count from the same zero"
        )


def _jumps(x_s: Array, x_a: Array, off: Array, time: Array) -> Iterator[str]:
    """Steps of the position from row to row. off: what gain and delay leave of it."""
    steps, unexplained = np.diff(x_a), np.abs(np.diff(off))
    if not np.any(steps):
        return
    usual = np.sort(unexplained)[-min(max(LARGE_ROWS, round(LARGE_SHARE * len(off))), len(steps))]
    least = max(
        JUMP_RATIO * float(usual),
        JUMP_STEPS * float(np.min(np.abs(steps[steps != 0]))),
        JUMP_WAY * float(np.max(np.abs(np.diff(x_s)))),
        JUMP_ASKED * float(np.max(np.abs(np.diff(x_s, 2)))),
    )
    rows = np.flatnonzero(unexplained > least)
    if len(rows):
        k = int(rows[0])
        more = f" and {len(rows) - 1} more time{'s'[: len(rows) > 2]}" if len(rows) > 1 else ""
        yield (
            f"the recorded position jumps by {1e3 * steps[k]:+.4g} mm from {time[k]:.6g} s to the next row{more}, "
            f"which no axis does and its setpoint does not ask for; give a window without that ({spelt('window')})"
        )


def _cause(gain: float) -> str:
    """The likely error of sign and unit."""
    size, causes = abs(gain), ["one of the two lacks sign: -1"] if gain < 0 else []
    if abs(size - 1) > GAIN_TOLERANCE:
        pairs = [
            f"a factor of {factor:.4g} lies between {pair}"
            for factor, pair in UNIT_FACTORS
            if min(abs(size / factor - 1), abs(size * factor - 1)) <= GAIN_TOLERANCE
        ]
        causes += pairs or ["check units, pitch and gear of both"]
    return "; ".join(causes)


def _of_torque(axis_record: AxisRecord) -> Iterator[str]:
    torque = axis_record.record.torque[axis_record.rows]
    if axis_record.record.driven and np.any(axis_record.moving) and not np.ptp(torque):
        yield (
            f"the recorded torque is {torque[0]:.4g} N.m in all rows, also while the axis moves: it was not measured; "
            "name the column of the torque or current"
        )
