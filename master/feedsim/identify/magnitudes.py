"""Magnitudes that no feed axis has: where a unit of time, length or torque is taken for another.

The limits lie beyond what machine tools, robots and precision stages have, and nearer to that than the factor of 1000
by which mm and m, or ms and s, are confused. What no magnitude determines (a factor of 2.5 in a length) stays
unnoticed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import pi
from pathlib import Path

import numpy as np

from feedsim.errors import InputError
from feedsim.identify.record import Array, Record
from feedsim.identify.result import Estimate

# Controls and drives log every 10 us to 0.1 s.
MIN_INTERVAL, MAX_INTERVAL = 10e-6, 0.1
# Steps of at most 0.5 ms that friction is calculated over: beyond them, memory and time are no longer those of a trace.
MAX_ROWS, MAX_FRICTION_STEPS, FRICTION_STEP = 2_000_000, 8_000_000, 0.5e-3
MAX_SLIDE_SPEED, MAX_SLIDE_ACCELERATION = 20.0, 200.0  # of the slide [m/s], [m/s2]
BRIEF = 0.01  # share of the rows that single wrong rows may be
SPAN = 0.01  # [s] over which an acceleration is taken
# At the slide: lowest and highest plausible value, and its unit.
PLAUSIBLE: Mapping[str, tuple[float, float, str]] = {
    "deflection": (0.1e-6, 0.5e-3, "m"),
    "v_s": (10e-6, 1.0, "m/s"),
    "mass": (0.01, 1e6, "kg"),
    "braking": (1e-3, 100.0, "m/s2"),
    "friction": (0.02, 1e5, "N"),
}
KNOWN = 0.3  # relative standard deviation up to which a value is a witness
INERTIA = 10.0  # factor between an inertia that is given and that of accelerating parts


def check_time(path: Path, records: Sequence[Record]) -> None:
    """Raises InputError: rows too far apart or too close, or too many of them."""
    for record in records:
        if not MIN_INTERVAL * (1 - 1e-6) <= record.interval <= MAX_INTERVAL * (1 + 1e-6):
            wrong = "ms or us for s" if record.interval > MAX_INTERVAL else "s for ms or us"
            raise InputError(
                f"{path}: the rows are {record.interval:.4g} s apart; allowed: {1e6 * MIN_INTERVAL:g} us to "
                f"{MAX_INTERVAL:g} s, "
                f"as controls log. The unit of the time is likely wrong ({wrong}), or it counts cycles (factor: 2 ms)"
            )
    check_size(records, str(path))


def check_slide(path: Path, records: Sequence[Record], pitch: float | None) -> None:
    """Raises InputError: nothing could move a slide like that. pitch: [m]; None: not known, nothing is checked."""
    motions = [motion for record in records if (motion := _motion(record)) is not None]
    if pitch is None or not motions:
        return
    speed, acceleration = (pitch / (2 * pi) * _largest([motion[k] for motion in motions]) for k in (0, 1))
    for what, value, limit, unit in (
        ("moves at", speed, MAX_SLIDE_SPEED, "m/s"),
        ("accelerates with", acceleration, MAX_SLIDE_ACCELERATION, "m/s2"),
    ):
        if value > limit:
            raise InputError(
                f"{path}: the slide {what} {value:.4g} {unit}; allowed: up to {limit:g} {unit}. The unit of the "
                "position, the speed or the time, or the pitch is likely wrong (mm taken for m, s for ms)"
            )


def check_size(records: Sequence[Record], where: str = "the traces") -> None:
    """Raises InputError: more rows, or a longer time, than an identification can work on."""
    rows = sum(len(record) for record in records)
    steps = sum(len(record) * max(record.interval / FRICTION_STEP, 1.0) for record in records)
    if rows > MAX_ROWS or steps > MAX_FRICTION_STEPS:
        lasting = sum(len(record) * record.interval for record in records)
        raise InputError(
            f"{where}: {rows} rows, {lasting / 60:.4g} min; allowed: up to {MAX_ROWS} rows and "
            f"{MAX_FRICTION_STEPS * FRICTION_STEP / 60:.3g} min "
            "in all. Take the moves that docs/identification.md asks for, which are some minutes, or log less often"
        )


def check_estimates(estimates: Mapping[str, Estimate], I_P: float) -> None:
    """Raises InputError: what was estimated, of the rigid axis or in all, is nothing that a feed axis has."""
    for name, value, words in _slide(estimates, I_P):
        low, high, unit = PLAUSIBLE[name]
        if not low <= value <= high:
            raise InputError(
                f"{words} {value:.3g} {unit} at the slide; plausible: {low:g} to {high:g} {unit}. A unit of the traces "
                "(position, speed, time, torque) or the pitch is likely wrong by a factor of 1000 or so; nothing is "
                "written"
            )


def check_inertia(given: Estimate, rigid: Estimate) -> None:
    """Raises InputError: the given inertia and that of the accelerating parts are of different magnitude."""
    if not _known(rigid):
        return
    factor = rigid.value / given.value
    if not 1 / INERTIA < factor < INERTIA:
        raise InputError(
            f"the inertia is given as {given.value:.4g} kg.m2, accelerating parts of the traces say {rigid.value:.4g}, "
            f"{factor:.3g} times as much; allowed: {1 / INERTIA:g} to {INERTIA:g} times. A unit of the traces (torque, "
            "position, speed, time), the pitch, the torque constant or the inertia is wrong"
        )


def _slide(estimates: Mapping[str, Estimate], I_P: float) -> Iterator[tuple[str, float, str]]:
    """Name of PLAUSIBLE, value at the slide in its unit, and words, of all that is known well."""
    known = {name: estimate for name, estimate in estimates.items() if _known(estimate)}
    reported = {name: f"{name} comes out as {estimate.value:.4g} {estimate.unit}:" for name, estimate in known.items()}
    if "F_C" in known:
        yield "friction", known["F_C"].value / I_P, reported["F_C"]
    level = known.get("F_C") or known.get("F_S")
    if "sigma_0" in known and level is not None:
        yield (
            "deflection",
            level.value / known["sigma_0"].value * I_P,
            f"{reported['sigma_0']} the bristles would give way after",
        )
    if "v_s" in known:
        yield "v_s", known["v_s"].value * I_P, reported["v_s"]
    if "J" in known:
        J = known["J"].value
        yield "mass", J / I_P**2, reported["J"]
        if "F_C" in known:
            yield "braking", known["F_C"].value / J * I_P, f"{reported['J']} friction alone would brake with"


def _known(estimate: Estimate) -> bool:
    return estimate.status == "estimated" and estimate.sigma < KNOWN * abs(estimate.value)


def _motion(record: Record) -> tuple[Array, Array] | None:
    """Sizes of speed [rad/s] and acceleration [rad/s2] over spans: noise and steps of an encoder are little there."""
    count = max(1, round(SPAN / record.interval))
    span = count * record.interval
    if len(record) <= 2 * count:
        return None
    speed = record.speed
    if speed is None:
        assert record.angle is not None
        speed = (record.angle[count:] - record.angle[:-count]) / span
    return np.abs(speed), np.abs(speed[count:] - speed[:-count]) / span


def _largest(values: Sequence[Array]) -> float:
    """But for rows that may be wrong."""
    return float(np.quantile(np.concatenate(values), 1 - BRIEF))
