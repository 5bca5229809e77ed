"""Recorded drive traces -> records of one axis, motor side and SI."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import nan, pi
from pathlib import Path

import numpy as np

from feedsim.estimation.identify.inertia import inertia
from feedsim.estimation.identify.record import Array, Record, even_pieces
from feedsim.estimation.identify.result import Estimate
from feedsim.estimation.identify.signals import Channel, Chosen, choose, column
from feedsim.files.columns import Columns, Signal
from feedsim.files.fields import no_axis
from feedsim.files.source import content_digest
from feedsim.files.trace import Recording, read_recording
from feedsim.foundation.errors import Finding, InputError
from feedsim.scenario import Drive, Machine

# --- Magnitudes that no feed axis has: where a unit of time, length or torque is taken for another --------------------
# The limits lie beyond what machine tools, robots and precision stages have, and nearer to that than the factor of 1000
# by which mm and m, or ms and s, are confused. What no magnitude determines (a factor of 2.5 in a length) stays
# unnoticed.


# Controls and drives log every 10 us to 0.1 s.
MIN_INTERVAL, MAX_INTERVAL = 10e-6, 0.1
MAX_SLIDE_SPEED, MAX_SLIDE_ACCELERATION = 20.0, 200.0  # of the slide [m/s], [m/s2]
WRONG_ROWS_SHARE = 0.01  # share of the rows that single wrong rows may be
# [s] over which an acceleration is taken
# At the slide: lowest and highest plausible value, and its unit.
PLAUSIBLE_RANGES: Mapping[str, tuple[float, float, str]] = {
    "deflection": (0.1e-6, 0.5e-3, "m"),
    "v_s": (10e-6, 1.0, "m/s"),
    "mass": (0.01, 1e6, "kg"),
    "braking": (1e-3, 100.0, "m/s2"),
    "friction": (0.02, 1e5, "N"),
}
MAX_WITNESS_DEVIATION = 0.3  # relative standard deviation up to which a value is a witness
INERTIA = 10.0  # factor between an inertia that is given and that of accelerating parts


def check_time(path: Path, records: Sequence[Record]) -> None:
    """Raises InputError: rows too far apart or too close."""
    for record in records:
        if not MIN_INTERVAL * (1 - 1e-6) <= record.interval <= MAX_INTERVAL * (1 + 1e-6):
            wrong = "ms or us for s" if record.interval > MAX_INTERVAL else "s for ms or us"
            raise InputError(
                f"{path}: the rows are {record.interval:.4g} s apart; allowed: {1e6 * MIN_INTERVAL:g} us to "
                f"{MAX_INTERVAL:g} s, "
                f"as controls log. The unit of the time is likely wrong ({wrong}), or it counts cycles (factor: 2 ms)"
            )


def check_slide(path: Path, records: Sequence[Record], pitch: float | None) -> None:
    """Raises InputError: nothing could move a slide like that. pitch: [m]; None: not known, nothing is checked."""
    motions = [motion for record in records if (motion := _motion(record)) is not None]
    if pitch is None or not motions:
        return
    speed, acceleration = (pitch / (2 * pi) * _robust_maximum([motion[k] for motion in motions]) for k in (0, 1))
    for what, value, limit, unit in (
        ("moves at", speed, MAX_SLIDE_SPEED, "m/s"),
        ("accelerates with", acceleration, MAX_SLIDE_ACCELERATION, "m/s2"),
    ):
        if value > limit:
            raise InputError(
                f"{path}: the slide {what} {value:.4g} {unit}; allowed: up to {limit:g} {unit}. The unit of the "
                "position, the speed or the time, or the pitch is likely wrong (mm taken for m, s for ms)"
            )


def check_estimates(estimates: Mapping[str, Estimate], I_P: float) -> None:
    """Raises InputError: what was estimated, of the rigid axis or in all, is nothing that a feed axis has."""
    for name, value, words in _slide(estimates, I_P):
        low, high, unit = PLAUSIBLE_RANGES[name]
        if not low <= value <= high:
            raise InputError(
                f"{words} {value:.3g} {unit} at the slide; plausible: {low:g} to {high:g} {unit}. A unit of the traces "
                "(position, speed, time, torque) or the pitch is likely wrong by a factor of 1000 or so; nothing is "
                "written"
            )


def check_inertia(given: Estimate, rigid: Estimate) -> None:
    """Raises InputError: the given inertia and that of the accelerating parts are of different magnitude."""
    if not _is_witness(rigid):
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
    known = {name: estimate for name, estimate in estimates.items() if _is_witness(estimate)}
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


def _is_witness(estimate: Estimate) -> bool:
    return estimate.status == "estimated" and estimate.sigma < MAX_WITNESS_DEVIATION * abs(estimate.value)


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


def _robust_maximum(values: Sequence[Array]) -> float:
    """But for rows that may be wrong."""
    return float(np.quantile(np.concatenate(values), 1 - WRONG_ROWS_SHARE))


# --- Recorded drive traces -> records of one axis, motor side and SI --------------------------------------------------


# --- Signs and units of records: a speed that is not the slope of the position, a torque that does not drive ----------


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
OPPOSING_POWER_SHARE = 0.1
# The same in either direction, beyond doubt: a constant load drives in one direction only.
CLEARLY_AGAINST = 0.3
# Share of the kinetic energy that a record may lose from its first to its last row to be asked that question.
BRAKED_ENERGY_SHARE = 0.1
# Of the highest speed: what counts as motion. Of the whole travel: what counts as a direction.
MOVING, DIRECTION = 0.05, 0.05
SPAN = 10e-3  # [s] that the speed is averaged over where only a position was recorded


def check_records(path: Path, records: Sequence[Record], axis: str = "") -> Iterator[Finding]:
    """What is worth a warning. Raises InputError where a sign or a unit is wrong beyond doubt.

    axis: its name; empty where nothing determines it.
    """
    where = f"{path}, axis {axis}" if axis else f"{path}"
    yield from _check_speed(where, records)
    yield from _power(where, records)


def _check_speed(where: str, records: Sequence[Record]) -> Iterator[Finding]:
    a, b, c = np.sum([_slope(record) for record in records if len(record) > 2] or [(0.0, 0.0, 0.0)], axis=0)
    if not b > 0:
        return
    ratio = float(a / b)
    said = f"{where}: the recorded speed is {ratio:.4g} times the slope of the position"
    wrong = not 1 / WRONG_SLOPE <= ratio <= WRONG_SLOPE
    if wrong and abs(a) >= SCALE_CORRELATION * np.sqrt(b * c):
        raise InputError(f"{said} (allowed: {1 / WRONG_SLOPE:.2g} to {WRONG_SLOPE:g}); {_likely_error(ratio)}")
    if abs(ratio - 1) > SLOPE:
        text = f"{said}; the sign, unit, pitch or gear of one of the two is wrong"
        yield Finding("speed-contradicts-position", "doubt", text, where)


def _likely_error(ratio: float) -> str:
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


def _power(where: str, records: Sequence[Record]) -> Iterator[Finding]:
    """By the mean power torque * speed of what moves, in all and in either direction."""
    parts = [part for record in records if (part := _moving_torque(record)) is not None]
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
    if _share(net, speed) < -OPPOSING_POWER_SHARE:
        yield Finding(
            "torque-against-motion", "doubt",
            f"{where}: the torque is against the motion on average (mean power {float(np.mean(net * speed)):.3g} W); "
            "its sign, or that of the motion, is not right, unless a constant load drives the axis",
            where,
        )  # fmt: skip


def _moving_torque(record: Record) -> tuple[Array, Array] | None:
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
    if energy[-1] < energy[0] - BRAKED_ENERGY_SHARE * np.max(energy):
        return None
    rows = np.abs(speed) > MOVING * np.max(np.abs(speed))
    return (net[rows], speed[rows]) if np.any(rows) else None


def _share(torque: Array, speed: Array) -> float:
    """Power over the product of the rms values [1]; 0 where there is none."""
    size = float(np.sqrt(np.dot(torque, torque) * np.dot(speed, speed)))
    return float(np.dot(torque, speed)) / size if size > 0 else 0.0


ZERO_CELSIUS = {"degC": 0.0, "°C": 0.0, "K": 273.15}  # by unit of a temperature
# Values given twice are the same up to the rounding of what people write.
TYPED_TOLERANCE = 1e-9
# Share of the residual that may be left for a column to be advised as a load: less than that is chance.
SMALLER = 0.98
PITCH_MISMATCH = 0.02  # relative; what a pitch that a record determines may be off the machine's without a word
# Names of columns that hold a known load; "workload" or "payload" are not.
LOAD_NAME = re.compile(
    r"(?<![a-z])load|pulse|disturbance|(?<![a-z])external[ _.-]*force|(?<![a-z])ext[ _.-]+force", re.IGNORECASE
)


@dataclass(frozen=True)
class Provenance:
    """Where records come from, and what was taken for granted.

    Attributes:
        file, sha256: the trace.
        mapping: mapping file; None where columns were found by their names.
        axis: "" where nothing determines it.
        name, note: of the mapping.
        columns: role -> column used (position, speed, torque, current, force, load, setpoint, time).
        pitch: [m]; torque_constant: [N.m/A]; None where not needed and not given.
        inertia: [kg.m^2] on the motor's side, where the mapping gives it or a mass.
        torque_delay: by how much the torque is logged later than the position [s], as the mapping gives it. It is not
            taken out of the records.
        warnings: what a user should know.
        day: on which it was recorded, ISO 8601; "" where the file has no date.
        temperature: mean of its one column in degC or K [degC]; nan where there is none, or several.
    """

    file: Path
    sha256: str
    axis: str
    columns: Mapping[str, str]
    mapping: Path | None = None
    name: str = ""
    note: str = ""
    pitch: float | None = None
    torque_constant: float | None = None
    inertia: float | None = None
    torque_delay: float | None = None
    warnings: tuple[Finding, ...] = ()
    day: str = ""
    temperature: float = nan


@dataclass(frozen=True, eq=False)
class RecordedAxis:
    """Records of a file, one per stretch without a gap, and where they come from."""

    records: tuple[Record, ...]
    provenance: Provenance


@dataclass(frozen=True)
class _Drive:
    """What turns lengths, forces and currents into the motor's angles and torques."""

    pitch: float | None
    torque_constant: float | None
    warnings: tuple[Finding, ...] = field(default=())


def read_records(
    file: str | Path | Recording,
    mapping: Columns | None = None,
    axis: str | None = None,
    machine: Machine | None = None,
    *,
    driven: bool = True,
) -> RecordedAxis:
    """Read a CSV or MAT file, or take what :func:`feedsim.files.trace.read_recording` has read of one.

    mapping: which columns are what; None: by their names (feedsim's own, else those of docs/traces.md).
    axis: default that of the mapping, else the machine's only one, else the only one of feedsim's own names.
    machine: gives pitch and torque constant of the axis. A mapping may give them too; a torque constant of its own
        counts (with a warning), since currents are logged in different amplitudes; a pitch that differs is refused.
    driven: torque, current or force is needed; else it is nan where there is none.

    The motor's angle is position/I_P with I_P = pitch/(2 pi), the torque K_t i_q or F I_P. Records are pieces without
    gaps; nothing is resampled (see record.even_pieces).

    Raises InputError with file and line: what cannot be read, columns that are missing or not clear, units, time that
    is not even, pitch or torque constant that is needed and not given, a sign or unit wrong beyond doubt (signs.py,
    magnitudes.py).
    """
    recording = file if isinstance(file, Recording) else read_recording(file)
    path = recording.path
    named = _axis(mapping, axis, machine)
    chosen = choose(recording, mapping, named, machine.axes if machine else (), driven=driven)
    if machine is not None and chosen.axis and chosen.axis not in machine.axes:
        raise InputError(f"{path}: {no_axis(chosen.axis, machine.axes)}")
    drive = _drive(recording, chosen, mapping, machine)
    values = recording.read(channel.column for channel in chosen.channels.values())
    signals = {role: values[channel.column] * channel.scale for role, channel in chosen.channels.items()}
    columns = {role: channel.column for role, channel in chosen.channels.items()}
    if chosen.interval is None:
        time = signals.pop("time")
    else:
        time = np.asarray(np.arange(len(next(iter(values.values())))) * chosen.interval, dtype=np.float64)
    pieces, gaps = even_pieces(time, recording.row)
    motor = {"torque": np.full(len(time), np.nan)} | _motor_side(chosen.channels, signals, drive)
    records = tuple(
        Record(
            name=path.name if len(pieces) == 1 else f"{path.name}, {piece.time[0]:.6g} to {piece.time[-1]:.6g} s",
            time=piece.time,
            columns=columns,
            load_on_slide="load" in chosen.channels and chosen.channels["load"].target == "N",
            **{role: whole[piece.first : piece.last] for role, whole in motor.items()},
        )
        for piece in pieces
    )
    check_time(path, records)
    check_slide(path, records, drive.pitch)
    signs: Iterable[Finding] = ()
    unread: Iterable[Finding] = ()
    if records[0].driven:
        signs = check_records(path, records, chosen.axis)
        unread = _unread_load(recording, chosen, drive, records, [slice(piece.first, piece.last) for piece in pieces])
    warnings = (*recording.notes, *chosen.notes, *unread, *drive.warnings, *gaps, *signs)
    source = _provenance(path, mapping, chosen, columns, drive, warnings, recording.day)
    return RecordedAxis(records, replace(source, temperature=_temperature(recording)))


def read_traces(
    paths: Sequence[Path],
    mapping: Columns | None = None,
    axis: str | None = None,
    machine: Machine | None = None,
    progress: Callable[[str, int, int], None] = lambda what, done, total: None,
) -> list[RecordedAxis]:
    """Read several files, each as :func:`read_records` does. progress: what is being done, how much of it, of what."""
    recorded = []
    for k, path in enumerate(paths):
        progress("reading", k, len(paths))
        recorded.append(read_records(path, mapping, axis, machine))
    progress("reading", len(paths), len(paths))
    return recorded


def _axis(mapping: Columns | None, axis: str | None, machine: Machine | None) -> str:
    if axis and mapping is not None and mapping.axis and axis != mapping.axis:
        raise InputError(f"{mapping.where('axis')}: {mapping.axis}, but axis {axis} is asked for")
    named = axis or (mapping.axis if mapping is not None else None) or ""
    if machine is None:
        return named
    if named:
        if named not in machine.axes:
            raise InputError(no_axis(named, machine.axes))
        return named
    return next(iter(machine.axes)) if len(machine.axes) == 1 else ""


def _drive(recording: Recording, chosen: Chosen, mapping: Columns | None, machine: Machine | None) -> _Drive:
    """Pitch and torque constant; InputError where one is needed and not given, or the pitch is given twice."""
    own = machine.axes.get(chosen.axis) if machine is not None else None
    pitch = mapping.pitch if mapping is not None else None
    constant = mapping.torque_constant if mapping is not None else None
    warnings: list[Finding] = []
    if own is not None and machine is not None:
        if mapping is not None and pitch is not None and abs(pitch - own.pitch) > TYPED_TOLERANCE * own.pitch:
            raise InputError(
                f"{mapping.where('pitch')}: {1e3 * pitch:.9g} mm; axis {chosen.axis} of machine {machine.name} "
                f"({machine.directory}) has {1e3 * own.pitch:.9g} mm"
            )
        K_t = own.drive.K_t if isinstance(own.drive, Drive) else None
        if (
            mapping is not None
            and constant is not None
            and K_t is not None
            and abs(constant - K_t) > TYPED_TOLERANCE * K_t
        ):
            warnings.append(Finding(
                "torque-constant-differs", "doubt",
                f"{mapping.where('torque_constant')}: {constant:.9g} N.m/A counts, not the {K_t:.9g} N.m/A of axis "
                f"{chosen.axis} of machine {machine.name}",
                mapping.where("torque_constant"),
            ))  # fmt: skip
        if chosen.pitch is not None and abs(chosen.pitch - own.pitch) > PITCH_MISMATCH * own.pitch:
            warnings.append(Finding(
                "pitch-differs", "doubt",
                f"{recording.path}: the record gives a pitch of {1e3 * chosen.pitch:.4g} mm; axis {chosen.axis} of "
                f"machine {machine.name} has {1e3 * own.pitch:.9g} mm, which counts",
                chosen.axis,
            ))  # fmt: skip
        pitch, constant = own.pitch if pitch is None else pitch, K_t if constant is None else constant
    pitch = chosen.pitch if pitch is None else pitch
    for role, channel in chosen.channels.items():
        if pitch is None and channel.target in ("m", "m/s", "N"):
            raise InputError(
                f"{recording.header}: {role} {channel.column!r} counts on the slide; its pitch is needed: pitch: 20 mm "
                "in the mapping, or a machine with that axis" + _ask_for_axis(chosen, machine) + _explain_choice(chosen)
            )
        if role == "current" and constant is None:
            raise InputError(
                f"{recording.header}: {channel.column!r} is a current; its torque constant is needed: "
                "torque_constant: 2 N.m/A in the mapping, or a machine with that axis" + _ask_for_axis(chosen, machine)
            )
        if channel.rms and (mapping is None or mapping.torque_constant is None):
            warnings.append(Finding(
                "current-effective-value", "doubt",
                f"{recording.header}: {channel.column!r} is an effective value; the machine's torque constant of "
                f"{constant:.9g} N.m/A must count for it (for a peak value it is smaller by the square root of 2)",
                recording.header,
            ))  # fmt: skip
    if mapping is not None and mapping.mass is not None and pitch is None:
        raise InputError(f"{mapping.where('mass')}: the pitch is needed with it; give pitch: 20 mm, or an inertia")
    return _Drive(pitch, constant, tuple(warnings))


def _explain_choice(chosen: Chosen) -> str:
    return f". The record itself does not give it: {chosen.why}" if chosen.why else ""


def _ask_for_axis(chosen: Chosen, machine: Machine | None) -> str:
    if machine is not None and not chosen.axis:
        return f"; which axis of {machine.name} is it: {', '.join(machine.axes)}?"
    return ""


def _unread_load(
    recording: Recording, chosen: Chosen, drive: _Drive, records: Sequence[Record], pieces: Sequence[slice]
) -> Iterator[Finding]:
    """Columns whose names speak of a disturbance, while no load is read, and without which less is left of the torque.

    A torque may hold the disturbance already; to subtract it then makes things worse.
    """
    used = {channel.column for channel in chosen.channels.values()}
    if "load" in chosen.channels:
        return
    for name in recording.names:
        if name in used or not LOAD_NAME.search(name):
            continue
        unit = "" if recording.units[name] else "N" if re.search(r"(?:^|[^A-Za-z])N$", name) else "N.m"
        try:
            load = column(recording, "load", Signal(column=name, unit=unit or None))
            if load.target == "N" and drive.pitch is None:
                continue
            values = recording.read([*used, name])[name] * load.scale
            torque = _motor_side({"load": load}, {"load": values}, drive)["load"]
            remaining = [_residual(records, [side * torque[rows] for rows in pieces]) for side in (0.0, 1.0, -1.0)]
        except InputError:
            continue  # no signal of this trace, no force, or nothing moves that would determine
        best = min(remaining[1:])
        if best > SMALLER * remaining[0]:
            continue
        given = (f", unit: {unit}" if unit else "") + ("" if best == remaining[1] else ", sign: -1")
        remedy = f"load: {{column: {name}{given}}}"
        yield Finding(
            "load-not-read", "doubt",
            f"{recording.header}: {name!r} may be a known load, and is not read. With it a rigid axis with simple "
            f"friction leaves {best:.3g} in place of {remaining[0]:.3g} N.m of the torque (rms); mapping: {remedy}",
            recording.header, remedy,
        )  # fmt: skip


def _residual(records: Sequence[Record], loads: Sequence[Array]) -> float:
    return inertia([replace(record, load=load) for record, load in zip(records, loads, strict=True)]).rms


def _motor_side(channels: Mapping[str, Channel], signals: Mapping[str, Array], drive: _Drive) -> dict[str, Array]:
    """Fields of Record from values in SI."""

    def turned(role: str) -> Array:
        if channels[role].target in ("m", "m/s"):
            assert drive.pitch is not None
            return signals[role] * (2 * pi / drive.pitch)
        if channels[role].target == "N":
            assert drive.pitch is not None
            return signals[role] * (drive.pitch / (2 * pi))
        if channels[role].target == "A":
            assert drive.torque_constant is not None
            return signals[role] * drive.torque_constant
        return signals[role]

    names = {"position": "angle", "current": "torque", "force": "torque"}
    return {names.get(role, role): turned(role) for role in channels if role != "time"}


def _provenance(
    path: Path,
    mapping: Columns | None,
    chosen: Chosen,
    columns: Mapping[str, str],
    drive: _Drive,
    warnings: tuple[Finding, ...],
    day: str,
) -> Provenance:
    inertia = mapping.inertia if mapping is not None else None
    if mapping is not None and mapping.mass is not None and drive.pitch is not None:
        inertia = mapping.mass * (drive.pitch / (2 * pi)) ** 2
    return Provenance(
        file=path,
        sha256=content_digest(path),
        axis=chosen.axis,
        columns=columns,
        mapping=mapping.file if mapping is not None else None,
        name=mapping.name if mapping is not None else "",
        note=mapping.note if mapping is not None else "",
        pitch=drive.pitch,
        torque_constant=drive.torque_constant,
        inertia=inertia,
        torque_delay=mapping.delay.torque if mapping is not None else None,
        warnings=warnings,
        day=day,
    )


def _temperature(recording: Recording) -> float:
    names = [name for name in recording.names if recording.units[name] in ZERO_CELSIUS]
    if len(names) != 1:
        return nan
    try:
        values = recording.read(names)[names[0]]
    except InputError:  # no reason to refuse the record
        return nan
    return float(np.mean(values)) - ZERO_CELSIUS[recording.units[names[0]]]


def recording_temperature(sources: Sequence[Provenance]) -> float:
    """Mean temperature [degC] of the files; nan where one of them has none."""
    return float(np.mean([source.temperature for source in sources]))


def recording_day(sources: Sequence[Provenance]) -> str | None:
    """On which the first of the files was recorded, ISO 8601; None where none has a date."""
    return min((source.day for source in sources if source.day), default=None)


def distinct(files: Sequence[Path]) -> tuple[str, ...]:
    """The file names, with as many folders ahead as it takes to separate them. InputError: a file stands twice."""
    whole = [file.resolve().parts for file in files]
    names = []
    for parts in whole:
        if whole.count(parts) > 1:
            raise InputError(f"{Path(*parts).name} is given twice; every trace counts once")
        count = 1
        while sum(other[-count:] == parts[-count:] for other in whole) > 1:
            count += 1
        names.append("/".join(parts[-count:]))
    return tuple(names)


def named_apart(recorded: Sequence[RecordedAxis]) -> tuple[Record, ...]:
    """The records of all files, under names that separate the files."""
    names = distinct([entry.provenance.file for entry in recorded])
    return tuple(
        replace(record, name=name + record.name.removeprefix(value.provenance.file.name))
        for value, name in zip(recorded, names, strict=True)
        for record in value.records
    )
