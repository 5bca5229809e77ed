"""Which columns of a recording are what: by a mapping, else by feedsim's own names, else by those of drive traces."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from feedsim.files.columns import DIMENSIONS, DRIVING_SIGNALS, Columns, Signal, resulting_unit, target_of
from feedsim.files.trace import Recording
from feedsim.foundation import units
from feedsim.foundation.errors import Finding, InputError
from feedsim.foundation.units import is_rms, known_unit

# --- Names that drive traces give their signals, and which signal of an axis each of them is --------------------------
# A name is compared without case, blanks, underscores and the like, and without the axis before or behind it. Only
# names
# with a source stand here, beside each where it comes from; a unit is never taken from a name.


@dataclass(frozen=True)
class Alias:
    """A name of a signal: its role in a mapping file, and who calls it so."""

    name: str
    role: str
    source: str


_S120 = "SINAMICS list manuals"
_NCK = "SINUMERIK trace, servo data"
_EDGE = "SINUMERIK high-frequency data"
_DE = "SINUMERIK and SINAMICS in German"
_TNC = "Heidenhain TNC oscilloscope"
_TWINCAT = "TwinCAT, NCTOPLC_AXIS_REF"
_SERCOS = "sercos IDN (Rexroth, Beckhoff AX5000)"
_CIA = "CiA 402 object"
_HAL = "LinuxCNC, pins of motion"
_SERVICE = "SINUMERIK, service display of axes"

# Role, whose names they are, the names.
_NAMES: tuple[tuple[str, str, str], ...] = (
    ("position", "plain words", "actual position"),
    ("position", _CIA, "position actual value | 6064h | 0x6064"),
    ("position", _SERVICE,
     "actual position value | actual position value measuring system 1 | actual position value measuring system 2"),
    ("position", _DE, "Lageistwert | Lageistwert Messsystem 1 | Lageistwert Messsystem 2"),
    ("position", _NCK, "nckServoDataActPos1stEnc | nckServoDataActPos2ndEnc"),
    ("position", _EDGE, "ENC_POS | ENC1_POS | ENC2_POS"),  # ENC_POS: the active encoder
    ("position", _TNC, "Actual pos"),  # TNC 430
    ("position", _TNC, "S ACTUAL"),  # TNC 407
    ("position", _TWINCAT, "ActPos"),
    ("position", _SERCOS, "S-0-0051 | position feedback value 1"),
    ("position", _HAL, "motor-pos-fb | pos-fb | joint-pos-fb"),
    ("speed", "plain words", "actual speed | actual velocity"),
    ("speed", _NCK, "actual speed motor"),
    ("speed", _DE, "Drehzahl-/Geschwindigkeitsistwert Motor"),
    ("speed", _CIA, "velocity actual value | 606Ch | 0x606C"),
    ("speed", _S120, "r0061 | actual speed unsmoothed | r0063 | actual speed smoothed"),
    ("speed", _DE, "Drehzahlistwert"),
    ("speed", _NCK, "nckServoDataActVelMot"),
    ("speed", _TNC, "Actl. speed"),  # TNC 430: from the position encoder
    ("speed", _TNC, "V (act rpm)"),  # iTNC 530, in mm/min from the speed encoder
    ("speed", _TWINCAT, "ActVelo"),
    ("speed", _SERCOS, "S-0-0040 | velocity feedback value"),
    ("torque", "plain words", "actual torque"),
    ("torque", f"{_S120}; {_CIA}", "torque actual value"),  # r0080; 6077h
    ("torque", _S120, "r0080"),
    ("torque", _DE, "Drehmomentistwert"),
    ("torque", _EDGE, "TORQUE"),
    ("torque", _TNC, "M actual"),  # iTNC 530
    ("torque", _TWINCAT, "ActTorque"),
    ("torque", _CIA, "6077h | 0x6077"),
    ("torque", _SERCOS, "S-0-0084 | torque/force feedback value"),
    ("current", _S120, "torque-generating current"),
    ("current", _S120,  # r0078
     "current actual value torque-generating | torque-generating current actual value | r0078"),
    ("current", _DE, "Momentenbildender Stromistwert | Stromistwert momentenbildend"),
    ("current", _NCK, "nckServoDataActCurr"),
    ("current", _EDGE, "CURRENT"),
    ("current", _TNC, "I nominal"),  # the nominal current that determines torque
    ("current", "Beckhoff AX5000 IDN", "P-0-0459 | actual torque generating current"),
    ("current", "ODrive", "Iq_measured"),
    ("setpoint", _EDGE, "DES_POS"),
    ("deviation", _EDGE, "CONT_DEV"),
    ("speed_setpoint", _EDGE, "CMD_SPEED"),
    ("feedforward", _EDGE, "VEL_FFW"),
    ("setpoint", _TWINCAT, "SetPos"),
    ("setpoint", _HAL, "motor-pos-cmd | pos-cmd | joint-pos-cmd"),
    ("setpoint", _TNC, "Noml. pos | S NOMINAL"),
    ("setpoint", _SERVICE, "position setpoint"),
    ("time", "plain words", "time | t | Zeit"),
)  # fmt: skip
ALIASES = tuple(Alias(name, role, source) for role, source, names in _NAMES for name in names.split(" | "))

# What may stand before the number or the letter of an axis, and letters that axes have.
_AXIS_WORDS = ("axis", "achse", "joint", "drive", "antrieb")
_AXIS_LETTERS = tuple("xyzabcuvw")


def _tokens(name: str) -> list[str]:
    return re.findall(r"[^\W_]+", name.casefold())


def _key(tokens: Iterable[str]) -> str:
    # Servo data come in two widths, ...32 and ...64.
    return re.sub(r"(?<=[a-z])(?:32|64)$", "", "".join(tokens))


_BY_KEY = {_key(_tokens(alias.name)): alias for alias in ALIASES}


def alias_of(name: str, axis: str = "", axes: Iterable[str] = ()) -> Alias | None:
    """The signal that a column is by its name; None: not known, or that of another axis.

    axis: of the trace, "" where it is not known; axes: all of the machine.
    """
    if alias := _BY_KEY.get(_key(_tokens(name))):
        return alias
    own = axis.casefold()
    others = {*_AXIS_LETTERS, *(axis.casefold() for axis in axes)} - {own}
    for tokens in _without_axis(name, own, others):
        if alias := _BY_KEY.get(_key(tokens)):
            return alias
    return None


def _without_axis(name: str, own: str, others: set[str]) -> Iterator[list[str]]:
    """The name's words without what names the axis; nothing where that is another one."""
    # Scopes put a path of names before the signal's: "Axis 1.ActPos", "joint.0.motor-pos-fb".
    for part in (name, re.split(r"[./:]", name)[-1]):
        words = _tokens(part)
        before = _tokens(name[: len(name) - len(part)])
        if own and not others.isdisjoint(before):
            continue
        while words:
            if words[0] in _AXIS_WORDS or words[0] == own or words[0].isdecimal():
                words = words[1:]
            elif words[-1] == own or words[-1].isdecimal():
                words = words[:-1]
            elif not own and words[0] in others:
                words = words[1:]
            elif not own and words[-1] in others:
                words = words[:-1]
            else:
                break
            yield words
        if words and part != name:
            yield words


# feedsim's own signals of an axis -> role. The torque is taken before the current: it needs no torque constant.
FEEDSIM_COLUMNS = {"x_a": "position", "n_a": "speed", "M_a": "torque", "i_q": "current", "x_s": "setpoint",
       "x_e": "deviation", "n_s": "speed_setpoint", "n_ffw": "feedforward"}  # fmt: skip
# What a control shows of its position loop: no identification of friction needs it.
OF_CONTROL = ("deviation", "speed_setpoint", "feedforward")
_FEEDSIM_COLUMN = re.compile(rf"([A-Za-z][A-Za-z0-9_]*)\.({'|'.join(FEEDSIM_COLUMNS)})")
_EXAMPLE = {"time": "ms", "position": "mm", "speed": "rpm", "torque": "N.m", "current": "A", "setpoint": "mm",
            "deviation": "mm", "speed_setpoint": "rpm", "feedforward": "rpm"}  # fmt: skip


@dataclass(frozen=True)
class Channel:
    """A column on its way to SI.

    Attributes:
        role: of DIMENSIONS.
        column: name in the file.
        target: SI unit that the values get.
        scale: what the column's numbers are multiplied with, sign included.
        rms: the unit says that it is an effective value.
    """

    role: str
    column: str
    target: str
    scale: float
    rms: bool = False


@dataclass(frozen=True)
class Chosen:
    """Columns to use; of the time either the column or the interval [s]. pitch: [m], as the recording determines it;
    why: it determines none, "" where nothing would determine it."""

    axis: str
    channels: Mapping[str, Channel]
    interval: float | None
    notes: tuple[Finding, ...]
    pitch: float | None = None
    why: str = ""


def choose(
    recording: Recording, mapping: Columns | None, axis: str, axes: Iterable[str], *, driven: bool = True
) -> Chosen:
    """Columns of an axis.

    axis: "" where it is not known; then feedsim's own names determine it if there is one only. axes: of the machine.
    driven: torque, current or force is needed.

    Raises InputError: a column that the mapping names is not there; names that do not determine which column is meant,
    or none that is known (with what there is, and the line of a mapping to write); a unit missing or of a wrong
    dimension.
    """
    if mapping is not None:
        return _choose_mapped(recording, mapping, axis, driven)
    return _by_name(recording, axis, tuple(axes), driven)


def _choose_mapped(recording: Recording, mapping: Columns, axis: str, driven: bool) -> Chosen:
    faults: list[str] = []
    if driven and all(mapping.signal(role) is None for role in DRIVING_SIGNALS):
        faults.append(
            f"{mapping.where()}missing: one of {', '.join(DRIVING_SIGNALS)}, for example current: "
            f"{{column: i_q, unit: A}}"
        )
    channels: dict[str, Channel] = {}
    for role in DIMENSIONS:
        signal = _time(recording, mapping) if role == "time" else mapping.signal(role)
        if signal is None:
            continue
        if (name := recording.called(signal.column)) is None:
            missing = f"{recording.header} has no column {signal.column!r}; there is {recording.there}"
            faults.append(f"{mapping.where(role)}: {missing}")
            continue
        try:
            channels[role] = column(recording, role, signal.model_copy(update={"column": name}))
        except InputError as error:
            faults.append(f"{mapping.where(role)}: {error}")
    if faults:
        raise InputError.of(f"{recording.path} by {mapping.file or 'its mapping'}", faults)
    return Chosen(axis, channels, mapping.time.interval, ())


def _time(recording: Recording, mapping: Columns) -> Signal | None:
    clock = mapping.time
    if clock.interval is not None:
        return None
    if clock.column is not None:
        # What has no unit is s, as everywhere in traces; but a counter is nothing before its factor.
        named = recording.called(clock.column) or clock.column
        unit = clock.unit or (None if clock.factor or recording.units.get(named) else "s")
        return Signal(column=named, unit=unit, factor=clock.factor)
    named_time = _named_time(recording, mapping.axis or "")
    return Signal(column=named_time, unit=clock.unit or (None if recording.units[named_time] else "s"))


def _by_name(recording: Recording, axis: str, axes: tuple[str, ...], driven: bool) -> Chosen:
    own: dict[str, dict[str, str]] = {}
    for name in recording.names:
        if match := _FEEDSIM_COLUMN.fullmatch(name):
            own.setdefault(match[1], {})[FEEDSIM_COLUMNS[match[2]]] = name
    if own and not axis:
        if len(own) > 1:
            raise InputError(f"{recording.header}: the axes {', '.join(own)} are in the file; which one is meant?")
        axis = next(iter(own))
    notes: list[Finding] = []
    if recording.axes:
        recording, axis_notes = _of_capture(recording, axis)
        notes += axis_notes
    if own:
        if axis not in own:
            raise InputError(f"{recording.header}: nothing of axis {axis!r}; there is {', '.join(own)}")
        names = dict(own[axis])
    else:
        names = _aliases(recording, axis, axes)
    driving = [role for role in DRIVING_SIGNALS if role in names]
    for role in driving[1:]:
        unused = names.pop(role)
        text = f"{recording.path}: {unused!r} is not used; the {driving[0]} {names[driving[0]]!r} is"
        notes.append(Finding("column-not-used", "note", text, str(recording.path)))
    missing = [] if driving or not driven else ["torque or current"]
    missing += [] if "position" in names or "speed" in names else ["position or speed"]
    if missing:
        known = f" known are {', '.join(names.values())};" if names else ""
        raise InputError(
            f"{recording.header}: no column is called like a {' nor a '.join(missing)} of "
            f"{f'axis {axis}' if axis else 'a drive trace'};{known} there is {recording.there}; name the "
            f"columns in a mapping file: {_lines(recording, [part.split()[0] for part in missing], names.values())}"
        )
    names["time"] = _named_time(recording, axis)
    faults: list[str] = []
    channels: dict[str, Channel] = {}
    for role, name in names.items():
        try:
            unit = "s" if role == "time" and not recording.units[name] else None
            against = role in DRIVING_SIGNALS and len(recording.axes) == 1 and recording.axes[0].sign < 0
            sign: Literal[1, -1] = -1 if against else 1
            channels[role] = column(recording, role, Signal(column=name, unit=unit, sign=sign))
        except InputError as error:
            problem = f"{recording.header}: {error}; mapping: {_line(role, recording, name)}"
            if role in DRIVING_SIGNALS and len(recording.axes) == 1 and recording.axes[0].why:
                problem = f"{recording.header}: {recording.axes[0].why}"
            if role in OF_CONTROL:
                notes.append(Finding("column-not-read", "doubt", f"{problem}; it is not read", recording.header))
            else:
                faults.append(problem)
    if faults:
        raise InputError.of(str(recording.path), faults)
    pitch, why = (recording.axes[0].pitch, recording.axes[0].why) if recording.axes else (None, "")
    return Chosen(axis, channels, None, tuple(notes), None if pitch is None else 1e-3 * pitch, why)


def _of_capture(recording: Recording, axis: str) -> tuple[Recording, list[Finding]]:
    """The signals of an axis of a capture, and what was found of it. InputError: which axis is meant is not clear."""
    there = ", ".join(f"{axis.name} (|{axis.number})" for axis in recording.axes)
    meant = (
        [capture_axis for capture_axis in recording.axes if capture_axis.called(axis)] if axis else list(recording.axes)
    )
    if len(meant) != 1:
        problem = f"nothing of axis {axis!r}" if axis and not meant else "which axis is meant?"
        raise InputError(f"{recording.header}: {problem}; there is {there}")
    result = meant[0]
    where = f"{recording.path}: axis {result.name} (|{result.number})"
    doubts = [Finding("capture-faulty", "doubt", f"{where}: {doubt}", where) for doubt in result.doubts]
    if result.pitch is None:
        text = (
            f"{where}: POWER does not give the pitch, nor whether TORQUE and CURRENT count in the position's "
            f"direction: they are taken to. {result.why[:1].upper()}{result.why[1:]}"
        )
        return recording.of_axis(result), [*doubts, Finding("pitch-not-recorded", "doubt", text, where)]
    if result.rotary:
        raise InputError(f"{where}: turns by 360 deg with its motor; rotary axes are not identified here")
    against = "against" if result.sign < 0 else "in"
    return recording.of_axis(result), [
        *doubts,
        Finding(
            "pitch-by-power", "note",
            f"{where}: by POWER = TORQUE times the motor's speed the pitch is {result.pitch:.6g} mm, and TORQUE and "
            f"CURRENT count {against} the position's direction; positions are taken as {result.length}, as the file "
            "has no units",
            where,
        ),
    ]  # fmt: skip


def _aliases(recording: Recording, axis: str, axes: tuple[str, ...]) -> dict[str, str]:
    """Role -> column, by the names of drive traces."""
    result: dict[str, list[str]] = {}
    for name in recording.names:
        if (alias := alias_of(name, axis, axes)) and alias.role != "time":
            result.setdefault(alias.role, []).append(name)
    faults = [
        f"{recording.header}: {len(names)} columns may be the {role}: {', '.join(names)}; say which in a mapping "
        f"file: {_line(role, recording, names[0])}"
        for role, names in result.items()
        if len(names) > 1
    ]
    if faults:
        raise InputError.of(str(recording.path), faults)
    return {role: names[0] for role, names in result.items()}


def _named_time(recording: Recording, axis: str) -> str:
    for usual in ("time", "t", "Zeit"):
        if usual in recording.names:
            return usual
    result = [name for name in recording.names if (alias := alias_of(name, axis)) and alias.role == "time"]
    if len(result) > 1:
        raise InputError(
            f"{recording.header}: {len(result)} columns may be the time: {', '.join(result)}; say which in a mapping "
            f"file: {_line('time', recording, result[0])}"
        )
    if result:
        return result[0]
    if (clock := recording.clock()) is not None:
        return clock[0]
    raise InputError(
        f"{recording.header}: no column of time; there is {recording.there}; name it in a mapping file: "
        "time: {column: ..., unit: s}, or give time: {interval: 2 ms} where there is none"
    )


def column(recording: Recording, role: str, signal: Signal) -> Channel:
    """Unit, factor and sign of a column. InputError: no unit, a wrong one, or one that contradicts the header."""
    column, header, factor = signal.column, recording.units[signal.column], signal.factor
    known = header if header and known_unit(header) else ""
    if signal.unit and known and resulting_unit(signal.unit, "1").factor != resulting_unit(known, "1").factor:
        raise InputError(f"column {column!r} is in {header} by its header, in {signal.unit} by the mapping")
    unit = signal.unit or known
    if not unit and factor is None:
        text = f"{header!r}, the unit of column {column!r}, is not known here" if header else ""
        raise InputError(f"{text or f'column {column!r} has no unit'}; give it: unit: {_EXAMPLE.get(role, 'N.m')}")
    scale = 1.0
    if factor is not None:
        assert factor.value is not None or factor.variable is not None
        scale = float(factor.value) if factor.value is not None else recording.scalar(str(factor.variable))
        if scale == 0:
            raise InputError(f"the factor {factor.variable!r} is 0")
    try:
        given = resulting_unit(unit or "1", factor.unit if factor else "1")
        target = target_of(role, given)
    except InputError as error:
        times = f" times a factor in {factor.unit}" if factor else ""
        raise InputError(f"column {column!r} in {unit or 'no unit'}{times}: {error}") from None
    scale *= signal.sign * float(given.factor / units.unit(target).factor)
    return Channel(role, column, target, scale, is_rms(unit))


def _line(role: str, recording: Recording, column: str = "...") -> str:
    """The line of a mapping file that names a column."""
    reported = column in recording.units and known_unit(recording.units[column]) and recording.units[column]
    name = column if re.fullmatch(r"[\w.]+", column) else f'"{column}"'
    return (
        f"{role}: {{column: {name}}}" if reported else f"{role}: {{column: {name}, unit: {_EXAMPLE.get(role, 'N.m')}}}"
    )


def _lines(recording: Recording, roles: Sequence[str], known: Collection[str]) -> str:
    """The lines of a mapping file for roles whose columns are not known by their names.

    Columns without names of their own, such as data(:,2), stand in them in the order that they mostly have.
    """
    nameless = [name for name in recording.names if "(" in name and name not in known]
    if nameless:
        timed = any(name.lower() in ("time", "t", "zeit") for name in recording.names)
        roles = [role for role in DIMENSIONS if role in roles or (role == "time" and not timed)]
    columns = [*nameless[: len(roles)], *["..."] * len(roles)]
    return "; ".join(_line(role, recording, column) for role, column in zip(roles, columns, strict=False))
