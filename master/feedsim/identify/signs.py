"""Signs and units of records: a speed that is not the slope of the position, a torque that does not drive."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import pi
from pathlib import Path

import numpy as np

from feedsim.errors import InputError
from feedsim.identify.record import Array, Record

# Share by which a recorded speed may differ from the slope of the position before it is worth a word: what the screw
# gives between motor and scale is about 1 % in small motions.
SLOPE = 0.05
# Factor, either way, beyond which a unit, the pitch, a gear or a sign is wrong and nothing good comes of the records.
WRONG_SLOPE = 1.5
# Correlation of both above which that factor is one of scale; noise of an encoder at rest lowers it.
SCALE_CORRELATION = 0.9
# Recorded speed over slope of the position, unit that the speed is in, and unit that it is read in.
UNIT_ERRORS = (
    (1000.0, "mm", "m"),
    (60.0, "per minute", "per second"),
    (60 / (2 * pi), "rpm", "rad/s"),
    (2 * pi, "radians", "turns"),
    (180 / pi, "degrees", "radians"),
)
LENGTHS = ("mm", "radians", "degrees")  # of these, those that a position may have, too
# Power of the torque over the product of the rms values below which the torque brakes. Friction makes it positive;
# noise and delays of channels at small motions spread it around 0.
AGAINST = 0.1
# The same in either direction, beyond doubt: a constant load drives in one direction only.
CLEARLY_AGAINST = 0.3
# Share of the kinetic energy that a record may lose from its first to its last row to be asked that question.
BRAKED = 0.1
# Of the highest speed: what counts as motion. Of the whole travel: what counts as a direction.
MOVING, DIRECTION = 0.05, 0.05
SPAN = 10e-3  # [s] that the speed is averaged over where only a position was recorded


def checked(path: Path, records: Sequence[Record], axis: str = "") -> Iterator[str]:
    """What is worth a warning. Raises InputError where a sign or a unit is wrong beyond doubt.

    axis: its name; empty where nothing determines it.
    """
    where = f"{path}, axis {axis}" if axis else f"{path}"
    yield from _speed(where, records)
    yield from _power(where, records)


def _speed(where: str, records: Sequence[Record]) -> Iterator[str]:
    a, b, c = np.sum([_slope(record) for record in records if len(record) > 2] or [(0.0, 0.0, 0.0)], axis=0)
    if not b > 0:
        return
    ratio = float(a / b)
    said = f"{where}: the recorded speed is {ratio:.4g} times the slope of the position"
    wrong = not 1 / WRONG_SLOPE <= ratio <= WRONG_SLOPE
    if wrong and abs(a) >= SCALE_CORRELATION * np.sqrt(b * c):
        raise InputError(f"{said} (allowed: {1 / WRONG_SLOPE:.2g} to {WRONG_SLOPE:g}); {_likely(ratio)}")
    if abs(ratio - 1) > SLOPE:
        yield f"{said}; the sign, unit, pitch or gear of one of the two is wrong"


def _likely(ratio: float) -> str:
    """The error of sign and unit that makes the speed `ratio` times too large."""
    turned = ["the sign of one of the two"] if ratio < 0 else []
    size = abs(ratio)
    if abs(size - 1) <= SLOPE:
        return f"likely {turned[0]} is wrong: sign: -1 in the mapping"
    for factor, one, other in UNIT_ERRORS:
        for value, given, taken in ((factor, one, other), (1 / factor, other, one)):
            if abs(size / value - 1) <= SLOPE:
                also = f" in the speed, or {taken} for {given} in the position" if one in LENGTHS else " in the speed"
                unit = f"a unit ({value:.4g}: {given} taken for {taken}{also})"
                return f"likely {' and '.join([*turned, unit])} is wrong"
    return f"check {' and '.join([*turned, 'units, pitch and gear of both'])}"


def _slope(record: Record) -> tuple[float, float, float]:
    """Sums of products (speed slope, slope slope, speed speed); 0 where a position or a speed lacks.

    Means over intervals are compared, in which an encoder's noise is least.
    """
    if record.angle is None or record.speed is None:
        return 0.0, 0.0, 0.0
    count = max(1, len(record) // 200)
    steps = (record.angle[count:] - record.angle[:-count]) / (count * record.interval)
    sums = np.concatenate([[0.0], np.cumsum((record.speed[1:] + record.speed[:-1]) / 2)])
    means = (sums[count:] - sums[:-count]) / count
    return float(np.dot(means, steps)), float(np.dot(steps, steps)), float(np.dot(means, means))


def _power(where: str, records: Sequence[Record]) -> Iterator[str]:
    """By the mean power torque * speed of what moves, in all and in either direction."""
    parts = [part for record in records if (part := _moving(record)) is not None]
    if not parts:
        return
    net, speed = (np.concatenate(values) for values in zip(*parts, strict=True))
    ways = [(net[rows], speed[rows]) for rows in (speed > 0, speed < 0)]
    travel = [float(np.sum(np.abs(n))) for _, n in ways]
    both = min(travel) > DIRECTION * sum(travel)
    if both and all(_share(M, n) < -CLEARLY_AGAINST for M, n in ways):
        forward, backward = (float(np.mean(M * n)) for M, n in ways)
        role = next((role for role in ("torque", "current", "force") if role in records[0].columns), "torque")
        column = records[0].columns.get(role, "NAME")
        raise InputError(
            f"{where}: the torque brakes the axis in both directions (mean power {forward:.3g} W in the positive, "
            f"{backward:.3g} W in the negative one), which friction cannot be; turn the sign: in the mapping, {role}: "
            f"{{column: {column}, sign: -1}}, or that of the motion"
        )
    if _share(net, speed) < -AGAINST:
        yield (
            f"{where}: the torque is against the motion on average (mean power {float(np.mean(net * speed)):.3g} W); "
            "its sign, or that of the motion, is not right, unless a constant load drives the axis"
        )


def _moving(record: Record) -> tuple[Array, Array] | None:
    """Torque less known load and speed at the rows that move; None for a motion that is cut off while it is braked."""
    net = record.torque if record.load is None else record.torque - record.load
    speed = record.speed
    if speed is None:
        assert record.angle is not None
        half = min(max(1, round(SPAN / 2 / record.interval)), (len(record) - 1) // 2)
        if half == 0:
            return None
        speed = (record.angle[2 * half :] - record.angle[: -2 * half]) / (2 * half * record.interval)
        net = net[half:-half]
    energy = speed**2
    if energy[-1] < energy[0] - BRAKED * np.max(energy):
        return None
    rows = np.abs(speed) > MOVING * np.max(np.abs(speed))
    return (net[rows], speed[rows]) if np.any(rows) else None


def _share(torque: Array, speed: Array) -> float:
    """Power over the product of the rms values [1]; 0 where there is none."""
    size = float(np.sqrt(np.dot(torque, torque) * np.dot(speed, speed)))
    return float(np.dot(torque, speed)) / size if size > 0 else 0.0
