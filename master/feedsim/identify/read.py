"""Recorded drive traces -> records of one axis, motor side and SI."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import pi
from pathlib import Path

import numpy as np

from feedsim.errors import InputError
from feedsim.fields import no_axis
from feedsim.files.columns import Columns, Signal
from feedsim.files.regular import digest
from feedsim.identify.inertia import inertia
from feedsim.identify.magnitudes import check_slide, check_time
from feedsim.identify.record import Array, Record, even_pieces
from feedsim.identify.signals import Channel, Chosen, choose, column
from feedsim.scenario import Drive, Machine
from feedsim.trace import Recording, read_recording

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
    warnings: tuple[str, ...] = ()
    day: str = ""


@dataclass(frozen=True, eq=False)
class Recorded:
    """Records of a file, one per stretch without a gap, and where they come from."""

    records: tuple[Record, ...]
    provenance: Provenance


@dataclass(frozen=True)
class _Drive:
    """What turns lengths, forces and currents into the motor's angles and torques."""

    pitch: float | None
    torque_constant: float | None
    warnings: tuple[str, ...] = field(default=())


def read_records(
    file: str | Path | Recording,
    mapping: Columns | None = None,
    axis: str | None = None,
    machine: Machine | None = None,
    *,
    driven: bool = True,
) -> Recorded:
    """Read a CSV or MAT file, or take what :func:`feedsim.trace.read_recording` has read of one.

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
    signs: Iterable[str] = ()
    unread: Iterable[str] = ()
    if records[0].driven:
        signs = checked(path, records, chosen.axis)
        unread = _unread_load(recording, chosen, drive, records, [slice(piece.first, piece.last) for piece in pieces])
    warnings = (*recording.notes, *chosen.notes, *unread, *drive.warnings, *gaps, *signs)
    return Recorded(records, _provenance(path, mapping, chosen, columns, drive, warnings, recording.day))


def read_traces(
    paths: Sequence[Path],
    mapping: Columns | None = None,
    axis: str | None = None,
    machine: Machine | None = None,
    progress: Callable[[str, int, int], None] = lambda what, done, total: None,
) -> list[Recorded]:
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
    warnings: list[str] = []
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
            warnings.append(
                f"{mapping.where('torque_constant')}: {constant:.9g} N.m/A counts, not the {K_t:.9g} N.m/A of axis "
                f"{chosen.axis} of machine {machine.name}"
            )
        if chosen.pitch is not None and abs(chosen.pitch - own.pitch) > PITCH_MISMATCH * own.pitch:
            warnings.append(
                f"{recording.path}: the record gives a pitch of {1e3 * chosen.pitch:.4g} mm; axis {chosen.axis} of "
                f"machine {machine.name} has {1e3 * own.pitch:.9g} mm, which counts"
            )
        pitch, constant = own.pitch if pitch is None else pitch, K_t if constant is None else constant
    pitch = chosen.pitch if pitch is None else pitch
    for role, channel in chosen.channels.items():
        if pitch is None and channel.target in ("m", "m/s", "N"):
            raise InputError(
                f"{recording.header}: {role} {channel.column!r} counts on the slide; its pitch is needed: pitch: 20 mm "
                "in the mapping, or a machine with that axis" + _which(chosen, machine) + _why(chosen)
            )
        if role == "current" and constant is None:
            raise InputError(
                f"{recording.header}: {channel.column!r} is a current; its torque constant is needed: "
                "torque_constant: 2 N.m/A in the mapping, or a machine with that axis" + _which(chosen, machine)
            )
        if channel.rms and (mapping is None or mapping.torque_constant is None):
            warnings.append(
                f"{recording.header}: {channel.column!r} is an effective value; the machine's torque constant of "
                f"{constant:.9g} N.m/A must count for it (for a peak value it is smaller by the square root of 2)"
            )
    if mapping is not None and mapping.mass is not None and pitch is None:
        raise InputError(f"{mapping.where('mass')}: the pitch is needed with it; give pitch: 20 mm, or an inertia")
    return _Drive(pitch, constant, tuple(warnings))


def _why(chosen: Chosen) -> str:
    return f". The record itself does not give it: {chosen.why}" if chosen.why else ""


def _which(chosen: Chosen, machine: Machine | None) -> str:
    if machine is not None and not chosen.axis:
        return f"; which axis of {machine.name} is it: {', '.join(machine.axes)}?"
    return ""


def _unread_load(
    recording: Recording, chosen: Chosen, drive: _Drive, records: Sequence[Record], pieces: Sequence[slice]
) -> Iterator[str]:
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
        yield (
            f"{recording.header}: {name!r} may be a known load, and is not read. With it a rigid axis with simple "
            f"friction leaves {best:.3g} in place of {remaining[0]:.3g} N.m of the torque (rms); mapping: load: "
            f"{{column: {name}{given}}}"
        )


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
    warnings: tuple[str, ...],
    day: str,
) -> Provenance:
    inertia = mapping.inertia if mapping is not None else None
    if mapping is not None and mapping.mass is not None and drive.pitch is not None:
        inertia = mapping.mass * (drive.pitch / (2 * pi)) ** 2
    return Provenance(
        file=path,
        sha256=digest(path),
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


def named_apart(recorded: Sequence[Recorded]) -> tuple[Record, ...]:
    """The records of all files, under names that separate the files."""
    names = distinct([entry.provenance.file for entry in recorded])
    return tuple(
        replace(record, name=name + record.name.removeprefix(value.provenance.file.name))
        for value, name in zip(recorded, names, strict=True)
        for record in value.records
    )
