"""Circles that were recorded: turns found in files of linear scales, of a ballbar, or of a control's log.

A file has either positions of two axes, or angle and radius (or its deviation), of one turn after the other or of both
directions beside each other. Full turns are found in it by the angle itself: where it turns round, a new direction
begins; of each stretch the middle turn is taken, so that run-in and run-out stay outside. Where no stretch is a full
turn, as where a ballbar cannot swing round, arcs are taken, as far as they are driven evenly.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feedsim.analysis.circle.doubts import (
    OFF_FEED,
    check_feed,
    check_radius,
    check_turn,
    longest_run,
    unusual_feed,
    unusual_radius,
)
from feedsim.analysis.circle.geometry import CLOSED_TURN_TOLERANCE, CircleUnderTest, TurnedPath
from feedsim.analysis.circularity import EVEN_SPEED_SHARE, TURN_PARTS, fitted_circle
from feedsim.analysis.figures import Array
from feedsim.files.columns import Columns
from feedsim.files.trace import Recording, read_recording
from feedsim.files.trace.recording import map_columns
from feedsim.foundation import units
from feedsim.foundation.errors import Finding, InputError, shorten_list
from feedsim.foundation.units import spell_unit
from feedsim.motions.circular import SENSE_WORDS

# --- Radius and feed that an instrument writes ahead of the columns of a circle, such as "Radius: 150 mm" -------------
# Instruments of several makers, and controls, export circles as text; how their own files are built is not public.
# What
# is common to the texts are lines of a label and a value with its unit, before or behind it.


# Label, as it may stand in a line, and the unit of its kind.
LABELS = {
    "radius": ("m", ("radius", "nominal radius", "programmed radius", "test radius", "circle radius", "ballbar length",
                     "nominal length", "path radius", "measuring radius", "sollradius", "nennradius", "kreisradius",
                     "programmierter radius", "bahnradius", "prüfradius", "messradius", "rayon", "rayon nominal")),
    "diameter": ("m", ("diameter", "nominal diameter", "programmed diameter", "test diameter", "circle diameter",
                       "durchmesser", "solldurchmesser", "nenndurchmesser", "kreisdurchmesser", "diamètre",
                       "diamètre nominal")),
    "feed": ("m/s", ("feed", "feed rate", "feedrate", "path feed", "path speed", "programmed feed", "feed speed",
                     "vorschub", "bahnvorschub", "bahngeschwindigkeit", "vorschubgeschwindigkeit", "avance",
                     "vitesse d'avance")),
}  # fmt: skip
_LINE = re.compile(
    r"""^["'\s#;,%*]*(?P<label>[^\W\d][^:=;,\t\[(\d"]*?)\s*       # a label,
        (?:[\[(](?P<before>[^\])]*)[\])])?["'\s]*[:=;,\t\s]\s*["']?  # its unit in brackets, a separator,
        (?P<value>[+]?\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?)\s*["']?[;,\t]?\s*["']?   # a number,
        (?:[\[(]?(?P<behind>[^\s;,"\])]+)[\])]?)?                 # and its unit behind it
    """,
    re.VERBOSE,
)


def header_values(lines: Sequence[str]) -> tuple[dict[str, float], list[str]]:
    """Of "radius" [m] and "feed" [m/s] those that lines give, and words of those that they do not give clearly."""
    values: dict[str, float] = {}
    notes: list[str] = []
    for line in lines:
        match = _LINE.match(line)
        if match is None:
            continue
        label = " ".join(re.split(r"[\s_-]+", match["label"].strip().lower()))
        for what, (kind, labels) in LABELS.items():
            if label not in labels:
                continue
            unit = (match["before"] or match["behind"] or "").strip()
            value = float(match["value"].replace(",", "."))
            try:
                size = value * float(units.factor(spell_unit(unit), kind)) if unit else None
            except InputError:
                size = None
            if what == "diameter":
                what, size = "radius", None if size is None else size / 2
            if size is None or not size > 0:
                notes.append(f"{line.strip()!r} may be the {what}, and is not read: its unit is not known")
            elif what in values and abs(values[what] / size - 1) > 1e-9:
                notes.append(f"{line.strip()!r} is another {what} than the one ahead of it, and is not read")
            else:
                values[what] = size
    return values, notes


class HeaderValues:
    """What the headers of several files give of one circle. given: what is known without them; notes, doubts: words."""

    def __init__(self, radius: float | None, feed: float | None) -> None:
        self._given = {"radius": radius, "feed": feed}
        self._ahead: dict[str, tuple[Path, float]] = {}
        self.notes: list[str] = []
        self.doubts: list[Finding] = []

    def add(self, file: Path, lines: Sequence[str]) -> None:
        """InputError: the file is of another circle than those ahead of it."""
        values, unclear = header_values(lines)
        self.doubts += [Finding("header-unclear", "doubt", f"{file}: {name}", str(file)) for name in unclear]
        for what, value in values.items():
            if self._given[what] is not None:
                continue
            self.notes.append(f"{file}: the {what} is {_value_text(what, value)}, as its header says")
            first, other = self._ahead.setdefault(what, (file, value))
            if abs(other / value - 1) > 1e-9:
                raise InputError(
                    f"{file}: its header gives a {what} of {_value_text(what, value)}, that of {first} one of "
                    f"{_value_text(what, other)}; give files of one circle"
                )

    @property
    def radius(self) -> float | None:
        """[m]"""
        return self._known("radius")

    @property
    def feed(self) -> float | None:
        """[m/s]"""
        return self._known("feed")

    def _known(self, what: str) -> float | None:
        return self._ahead[what][1] if what in self._ahead else self._given[what]


def _value_text(what: str, value: float) -> str:
    return f"{value * 1e3:.6g} mm" if what == "radius" else f"{value * 6e4:.6g} mm/min"


ANGLES = ("angle", "phi", "theta", "winkel", "angular position")
DEVIATIONS = (
    "deviation", "radial deviation", "radius deviation", "error", "radial error", "e", "dr", "delta r", "abweichung",
    "radialabweichung", "radiale abweichung", "écart", "écart radial",
)  # fmt: skip
# Columns of the two directions over one angle, by the sense of the turn.
WAYS = {
    1: ("ccw", "counterclockwise", "counter clockwise", "anticlockwise", "gegenuhrzeigersinn", "antihoraire"),
    -1: ("cw", "clockwise", "uhrzeigersinn", "horaire"),
}
RADII = ("radius", "r", "length", "ballbar length", "radius length", "rayon")
LEAST_RADIUS = 1e-3  # [m]; where a name does not say, what is never less is a radius and no deviation
# The angle has turned round where it goes back by this [rad]: less is noise at rest.
TURNED_ROUND = math.radians(10)
# An axis that moves by less than this share of what the others do rests.
RESTING_AXIS_SHARE = 0.05
# Turns whose feeds differ by more than this share are of different circles: path lag and peaks grow with the feed.
SAME_FEED = 0.02
# A turn needs so many samples for its parts to be separated, an arc its share of them.
MIN_TURN_SAMPLES = 180
# An arc below which a centre, a radius and an ellipse look alike [rad]; samples of one are compared with others over
# this share of it, where it is to be seen whether it is driven evenly, and on the circle.
MIN_ARC, ARC_PART = math.radians(60), 1 / 64
# Positions are on an arc where they are off its circle by less than so many times the median of all that are, or by
# less than this share of its radius; how often that is asked again.
OFF_ARC, ON_ARC, MAX_ARC_FITS = 5.0, 2e-4, 20


@dataclass(frozen=True, eq=False)
class RecordedTurn:
    """A turn of a file: what it is called, the path, when it began and how long it took [s], None where the file has no
    time. doubts: what is the matter with its samples."""

    name: str
    path: TurnedPath
    begin: float | None
    duration: float | None
    doubts: tuple[Finding, ...] = ()


@dataclass(frozen=True, eq=False)
class RecordedCircle:
    """Turns of one circle. centred: its centre was not known and is fitted. notes: how the files were read. doubts:
    what is the matter with them. day: on which the first of the files was recorded, ISO 8601; "" where none has a date.
    """

    circle: CircleUnderTest
    turns: tuple[RecordedTurn, ...]
    centred: bool
    notes: tuple[str, ...]
    doubts: tuple[Finding, ...] = ()
    day: str = ""


def read_circle(
    files: Sequence[Path],
    axes: tuple[str, str],
    *,
    radius: float | None = None,
    feed: float | None = None,
    centre: tuple[float, float] | None = None,
    pitch: dict[str, float] | None = None,
    mappings: Sequence[Columns] = (),
) -> RecordedCircle:
    """Turns of one circle in one file or several.

    axes: first and second of its plane. radius [m], feed [m/s], centre [m]: as programmed; where they are not given
    they are those of the files. mappings: which columns are what. Raises InputError: what a file lacks, and what it
    has.
    """
    notes: list[str] = []
    doubts: list[Finding] = []
    turns: list[RecordedTurn] = []
    timed: list[tuple[Path, RecordedTurn, float]] = []
    radii: list[float] = []
    days: list[str] = []
    headers = HeaderValues(radius, feed)
    for file in files:
        recording = map_columns(read_recording(file), mappings)
        days += filter(None, [recording.day])
        headers.add(file, recording.remarks)
        radius = headers.radius
        both = _columns_of_both_directions(recording)
        polar = None if both else _polar(recording, axes)
        if both:
            recorded_turns, mean = _of_both(recording, *both, radius)
        elif polar is None:
            x, y = _positions(recording, axes)
            recorded_turns, mean = _of_positions(recording, (x, y), axes, centre, radius)
        else:
            recorded_turns, mean = _of_angles(recording, *polar, radius)
        notes += [str(note) for note in recording.notes]
        notes.append(f"{file}: {', '.join(turn.name for turn in recorded_turns)}")
        doubts += [
            replace(doubt, text=f"{file}, {turn.name}: {doubt}", place=f"{file}, {turn.name}")
            for turn in recorded_turns
            for doubt in turn.doubts
        ]
        turns += recorded_turns
        timed += [(file, turn, turn.duration) for turn in recorded_turns if turn.duration is not None]
        radii.append(mean)
    nominal = radius if radius is not None else radii[0]
    _one_feed(timed, nominal)
    durations = [duration for _, _, duration in timed]
    own = 2 * math.pi * nominal / float(np.mean(durations)) if durations else None
    check_feed(str(files[0]), feed, own)
    speed = feed if feed is not None else own or headers.feed
    if speed is None:
        raise InputError(
            f"{files[0]}: has no column of time, and the feed is not known: give it, for example --feed '1000 mm/min'"
        )
    if own is not None and headers.feed is not None and abs(own / headers.feed - 1) > OFF_FEED:
        text = f"{files[0]}: its header gives another feed than its time, {own * 6e4:.5g} mm/min, which counts"
        doubts.append(Finding("feed-contradicted", "doubt", text, str(files[0])))
    notes, doubts = [*headers.notes, *notes], [*headers.doubts, *doubts]
    if radius is None:
        doubts += unusual_radius(nominal) or (unusual_feed(own) if own is not None and feed is None else [])
        notes.append(f"the programmed radius is taken to be {nominal * 1e3:.6g} mm, that of the recorded turns")
    circle = CircleUnderTest(axes, nominal, speed, pitch or {}, recorded=True)
    return RecordedCircle(circle, tuple(turns), centre is None, tuple(notes), tuple(doubts), min(days, default=""))


def _one_feed(timed: Sequence[tuple[Path, RecordedTurn, float]], radius: float) -> None:
    """Refuse turns of different feed. timed: file, turn and how long it took [s]."""
    if not timed:
        return
    slowest, fastest = max(timed, key=lambda entry: entry[2]), min(timed, key=lambda entry: entry[2])
    if (apart := slowest[2] / fastest[2] - 1) > SAME_FEED:
        one, other = (
            f"{file}: {turn.name}, from {turn.begin:.6g} s on, has a feed of "
            f"{2 * math.pi * radius / duration * 6e4:.5g} mm/min"
            for file, turn, duration in (fastest, slowest)
        )
        raise InputError(
            f"{one}; {other}: {100 * apart:.3g} % apart; allowed: {100 * SAME_FEED:g} %. Give turns of one feed, each "
            "feed by itself"
        )


def _plain_name(name: str) -> str:
    return " ".join(re.split(r"[\s_-]+", name.strip().lower()))


def _column(recording: Recording, names: Sequence[str], unit: str) -> str | None:
    """The column that has one of these names and a unit of this kind; None where there is none."""
    for name in recording.names:
        if _plain_name(name) in names:
            if not _has_unit(recording, name, unit):
                raise InputError(
                    f"{recording.header}: column {name!r} is in {recording.units[name] or 'no unit'}; one such as "
                    f"{name} [{unit}] is needed"
                )
            return name
    return None


def _only(recording: Recording, unit: str) -> str | None:
    """The one column that has a unit of this kind, whatever its name is; None where there is none or a choice."""
    result = [name for name in recording.names if _has_unit(recording, name, unit)]
    return result[0] if len(result) == 1 else None


def _has_unit(recording: Recording, name: str, unit: str) -> bool:
    try:
        units.factor(spell_unit(recording.units[name]) or "1", unit)
    except InputError:
        return False
    return bool(recording.units[name])


def _values(recording: Recording, name: str, unit: str) -> Array:
    factor = float(units.factor(spell_unit(recording.units[name]), unit))
    return np.asarray(recording.read([name])[name], dtype=np.float64) * factor


def _time(recording: Recording) -> Array | None:
    if (clock := recording.clock()) is None:
        return None
    name, factor = clock
    time = recording.read([name])[name] * factor
    if (back := np.flatnonzero(np.diff(time) < 0)).size:
        row = int(back[0]) + 1
        raise InputError(
            f"{recording.row(row)}: the time runs back, {time[row]:.6g} s follow {time[row - 1]:.6g} s; give rows in "
            "their order, each measurement in a file of its own"
        )
    return time


def _polar(recording: Recording, axes: tuple[str, str]) -> tuple[str, str, bool] | None:
    """Columns of angle and of deviation (or radius: True); None where the file has positions of both axes instead."""
    if all(_position(recording, axis) for axis in axes):
        return None
    angle = _column(recording, ANGLES, "rad") or _only(recording, "rad")
    deviation, radius = _column(recording, DEVIATIONS, "m"), _column(recording, RADII, "m")
    if angle is not None and (length := deviation or radius or _only(recording, "m")) is not None:
        if deviation is None and radius is None:
            return angle, length, float(np.abs(_values(recording, length, "m")).min()) > LEAST_RADIUS
        return angle, length, deviation is None
    has = shorten_list([f"{name} [{unit}]" if unit else name for name, unit in recording.units.items()], 20)
    if all(_plain_name(name) in (*units.UNIT_SYMBOLS, *units.ALIASES) for name in recording.names):
        raise InputError(
            f"{recording.header}: is a row of units, {has}; needed is one row of names with their units, such as "
            "Angle [deg] and Deviation [um], and no other row between it and the values"
        )
    lengths = [name for name in recording.names if _has_unit(recording, name, "m")]
    one, other = lengths[:2] if len(lengths) > 1 else ("...", "...")
    raise InputError(
        f"{recording.header}: holds {has}; needed are positions of both axes ({axes[0]} [mm], {axes[1]} [mm]; --axes "
        "says which two), or angle [deg] with deviation [um] or radius [mm]. Or a mapping file for each axis says "
        f'which columns are what: write "axis: {axes[0]}" and "position: {{column: {one}, unit: mm}}" to '
        f"{axes[0]}.yaml, the same of {axes[1]} with {other} to {axes[1]}.yaml, and give --columns {axes[0]}.yaml "
        f"--columns {axes[1]}.yaml"
    )


def _position(recording: Recording, axis: str) -> str | None:
    """The column of an axis' position: one that is called so, else the only length that has the axis as a word."""
    letter = axis.lower()
    names = (letter, f"{letter}.x a", f"{letter} position", f"position {letter}")
    lengths = [name for name in recording.names if _has_unit(recording, name, "m")]
    called = [name for name in lengths if _plain_name(name) in names]
    of_axis = [name for name in lengths if letter in re.findall(r"\w+", _plain_name(name))]
    return called[0] if called else of_axis[0] if len(of_axis) == 1 else None


def _positions(recording: Recording, axes: tuple[str, str]) -> tuple[Array, Array]:
    x, y = (_values(recording, str(_position(recording, axis)), "m") for axis in axes)
    return x, y


def _of_positions(
    recording: Recording,
    positions: tuple[Array, Array],
    axes: tuple[str, str],
    centre: tuple[float, float] | None,
    radius: float | None,
) -> tuple[list[RecordedTurn], float]:
    x, y = positions
    _refuse_resting(recording, positions, axes)
    about, mean = fitted_circle(x, y)
    on = None
    if not _is_full_turn(np.unwrap(np.arctan2(y - about[1], x - about[0]))):
        about, on = _arc(x, y)
    for _ in range(2):  # the first fit may hold a way to the circle; the second one holds turns alone
        u, w = x - about[0], y - about[1]
        stretches = _turns(np.unwrap(np.arctan2(w, u)), _time(recording), str(recording.path), on)
        rows = np.concatenate([np.arange(part.start, part.stop) for part, _ in stretches])
        about, mean = fitted_circle(x[rows], y[rows])
    check_radius(str(recording.path), radius, mean)
    if centre is not None:
        about = centre
    nominal = radius if radius is not None else mean
    u, w = x - about[0], y - about[1]
    angle, deviation = np.arctan2(w, u), np.hypot(u, w) - nominal
    return _record_circle(recording, angle, deviation, _time(recording), nominal, axes, on), mean


def _arc(x: Array, y: Array) -> tuple[tuple[float, float], NDArray[np.bool_]]:
    """Centre of the circle that most positions are on, and which are (N,): the ways to an arc and from it are not."""
    on = np.full(len(x), True)
    for _ in range(MAX_ARC_FITS):
        about, radius = fitted_circle(x[on], y[on])
        off = np.abs(np.hypot(x - about[0], y - about[1]) - radius)
        before, on = on, off < max(OFF_ARC * float(np.median(off[on])), ON_ARC * radius)
        if (before == on).all():
            break
    return about, on


def _refuse_resting(recording: Recording, positions: tuple[Array, Array], axes: tuple[str, str]) -> None:
    """InputError where an axis of the plane rests while two others move; it names those."""
    spans = {axis: float(np.ptp(values)) for axis, values in zip(axes, positions, strict=True)}
    for name in recording.names:
        letter = re.fullmatch(r"([A-Za-z][A-Za-z0-9]?)(\.x_a)?", name)
        if letter and letter[1] not in spans and _has_unit(recording, name, "m"):
            spans[letter[1]] = float(np.ptp(_values(recording, name, "m")))
    moving = [axis for axis, span in spans.items() if span > RESTING_AXIS_SHARE * max(spans.values())]
    if (rests := [axis for axis in axes if axis not in moving]) and len(moving) == 2:
        raise InputError(
            f"{recording.path}: axis {rests[0]} rests; {moving[0]} and {moving[1]} move: --axes {','.join(moving)}"
        )


def _of_angles(
    recording: Recording, angle: str, column: str, is_radius: bool, radius: float | None
) -> tuple[list[RecordedTurn], float]:
    phi = _values(recording, angle, "rad")
    deviation, mean = _deviation(recording, column, is_radius, radius)
    return _record_circle(recording, phi, deviation, _time(recording), mean if radius is None else radius), mean


def _columns_of_both_directions(recording: Recording) -> tuple[str, Mapping[int, str]] | None:
    """The column of the angle, and those of the two directions by their sense; None where the file is another."""
    result = {sense: _column(recording, names, "m") for sense, names in WAYS.items()}
    angle = _column(recording, ANGLES, "rad") or _only(recording, "rad")
    columns = {sense: name for sense, name in result.items() if name is not None}
    return (angle, columns) if angle is not None and len(columns) == len(WAYS) else None


def _of_both(
    recording: Recording, angle: str, columns: Mapping[int, str], radius: float | None
) -> tuple[list[RecordedTurn], float]:
    """Turns of both senses over one angle, whose rows are in the order of one of them at most: no time is theirs."""
    phi = np.unwrap(_values(recording, angle, "rad"))
    turns: list[RecordedTurn] = []
    for sense, name in columns.items():
        is_radius = float(np.abs(_values(recording, name, "m")).min()) > LEAST_RADIUS
        deviation, mean = _deviation(recording, name, is_radius, radius)
        order = slice(None, None, 1 if sense * (phi[-1] - phi[0]) > 0 else -1)
        turns += _record_circle(recording, phi[order], deviation[order], None, mean if radius is None else radius)
    return turns, mean


def _deviation(recording: Recording, column: str, is_radius: bool, radius: float | None) -> tuple[Array, float]:
    """Deviation of the radius (N,) and the mean radius [m]."""
    length = _values(recording, column, "m")
    if not is_radius and radius is None:
        raise InputError(
            f"{recording.header}: {column!r} is a deviation; give the radius, for example --radius '100 mm'"
        )
    mean = float(np.median(length)) if is_radius else float(radius or 0.0)
    nominal = radius if radius is not None else mean
    deviation = length - nominal if is_radius else length
    if is_radius:
        check_radius(str(recording.path), radius, mean)
    if float(np.abs(deviation).max()) > 0.2 * nominal:
        raise InputError(
            f"{recording.header}: {column!r} leaves the radius of {nominal * 1e3:.6g} mm by up to "
            f"{float(np.abs(deviation).max()) * 1e3:.4g} mm; allowed: 20 % of it"
        )
    return deviation, mean


def _record_circle(
    recording: Recording,
    angle: Array,
    deviation: Array,
    time: Array | None,
    radius: float,
    axes: tuple[str, str] | None = None,
    on: NDArray[np.bool_] | None = None,
) -> list[RecordedTurn]:
    """axes: whose positions were measured; None: the radius alone was. radius: that the deviation is from [m]. on:
    which rows are on the circle (N,), where it is an arc; None: all."""
    recorded_turns = []
    for rows, sense in _turns(np.unwrap(angle), time, str(recording.path), on):
        begin = duration = clock = None
        if time is not None:
            turned = np.abs(np.unwrap(angle[rows]) - angle[rows][0])
            passed = np.interp(np.linspace(0, turned[-1], TURN_PARTS + 1), turned, time[rows])
            parts = np.diff(passed)
            if (uneven := float(np.abs(parts / parts.mean() - 1).max())) > EVEN_SPEED_SHARE:
                raise InputError(
                    f"{recording.path}: a turn from {time[rows][0]:.6g} s on is not driven at constant speed: parts of "
                    f"it take {100 * uneven:.2g} % more or less time than the mean; allowed: "
                    f"{100 * EVEN_SPEED_SHARE:g} %"
                )
            begin = float(time[rows][0])
            duration = float(time[rows][-1] - begin) * 2 * math.pi / float(turned[-1])
            clock = (time[rows] - begin) * (2 * math.pi / duration)
        reported = check_turn(angle[rows], deviation[rows], radius, axes is not None, axes or ("", ""))
        kept = reported.keep
        clock = None if clock is None else clock[kept]
        path = TurnedPath(
            (angle[rows][kept] + math.pi) % (2 * math.pi) - math.pi,
            deviation[rows][kept],
            sense,
            clock if axes else None,
            None if axes else clock,
        )
        what = "a turn" if path.whole else f"an arc of {math.degrees(path.covered):.0f} deg"
        name = f"{what} {SENSE_WORDS[sense]}, {rows.stop - rows.start} samples"
        recorded_turns.append(RecordedTurn(name, path, begin, duration, reported.doubts))
    return recorded_turns


def _is_full_turn(angle: Array) -> bool:
    """Whether a stretch in one direction is a full turn. angle: unwrapped (N,) [rad]."""
    most = max((abs(float(angle[last - 1] - angle[first])) for first, last in _stretches(angle)), default=0.0)
    return most >= 2 * math.pi * (1 - CLOSED_TURN_TOLERANCE)


def _turns(
    angle: Array, time: Array | None, where: str, on: NDArray[np.bool_] | None = None
) -> list[tuple[slice, int]]:
    """The middle full turn of every stretch in one direction, or, where there is none, every stretch that is an arc;
    and its sense. angle: unwrapped (N,) [rad]; time: (N,) [s]. on: which rows are on the circle (N,); None: all."""
    whole = _is_full_turn(angle)
    least_angle, most = 2 * math.pi * (1 - CLOSED_TURN_TOLERANCE) if whole else MIN_ARC, 0.0
    result = []
    for first, last in _stretches(angle):
        if on is not None and not whole:
            begun, length = longest_run(on[first:last])
            first, last = first + begun, first + begun + length
        if last - first < 2:
            continue
        sense = 1 if angle[last - 1] > angle[first] else -1
        turned = np.maximum.accumulate(sense * (angle[first:last] - angle[first]))
        begin, end = 0.0, float(turned[-1])
        if whole:
            begin = max((end - 2 * math.pi) / 2, 0.0)
            end = min(end, begin + 2 * math.pi)
        elif time is not None and end >= MIN_ARC:
            begin, end = _steady_arc(turned, time[first:last])
        most = max(most, end - begin)
        if end - begin < least_angle:
            continue
        inside = turned < end if end == begin + 2 * math.pi else turned <= end
        rows = np.flatnonzero((turned >= begin) & inside)
        least = math.ceil(MIN_TURN_SAMPLES * (1.0 if whole else (end - begin) / (2 * math.pi)))
        if len(rows) < least:
            what = "a turn" if whole else f"an arc of {math.degrees(end - begin):.0f} deg"
            raise InputError(f"{where}: {what} has {len(rows)} samples; {least} or more are needed")
        result.append((slice(first + int(rows[0]), first + int(rows[-1]) + 1), sense))
    if not result:
        raise InputError(
            f"{where}: covers {math.degrees(most):.0f} deg in one direction at constant speed; a full turn, 360 deg, "
            f"or an arc of {math.degrees(MIN_ARC):.0f} deg or more is needed"
        )
    return result


def _steady_arc(turned: Array, time: Array) -> tuple[float, float]:
    """Where an arc begins and ends [rad] that is driven at its usual speed: without the ways from rest and to rest.

    turned: the angle that rises along the arc (N,) [rad].
    """
    at = np.linspace(0.0, float(turned[-1]), round(1 / ARC_PART) + 1)
    passed = np.diff(np.interp(at, turned, time))
    even = np.flatnonzero(np.abs(passed / np.median(passed) - 1) < EVEN_SPEED_SHARE)
    return float(at[even[0]]), float(at[even[-1] + 1])


def _stretches(angle: Array) -> list[tuple[int, int]]:
    """Rows between which the angle goes one way; going back by less than TURNED_ROUND does not count."""
    cuts, extreme, way = [0], 0, 0
    for i in range(1, len(angle)):
        off = angle[i] - angle[extreme]
        if way == 0:
            if abs(off) > TURNED_ROUND:
                way, extreme = (1 if off > 0 else -1), i
        elif way * off > 0:
            extreme = i
        elif way * off < -TURNED_ROUND:
            cuts.append(extreme + 1)
            way, extreme = -way, i
    ends = [*cuts[1:], len(angle)]
    return [(first, last) for first, last in zip(cuts, ends, strict=True) if last - first > 1]
