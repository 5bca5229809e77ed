"""Results and records side by side: what they hold in common, and in what their figures and parameters differ."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from feedsim.analysis.circle.records import read_circle
from feedsim.analysis.circularity import Turn, fitted_circle
from feedsim.analysis.figures import Array
from feedsim.analysis.positioning import MIN_REST_TIME, Approach
from feedsim.comparison.shift import estimated_shift
from feedsim.files.columns import Columns
from feedsim.files.sheets import read_rows
from feedsim.files.source import json_file
from feedsim.files.trace import Recording, Trace, as_series, read_recording
from feedsim.files.trace.recording import map_columns
from feedsim.foundation import units
from feedsim.foundation.errors import InputError
from feedsim.motions.circular import SENSE_WORDS

DIGEST_DIGITS = 12  # digits of a digest
RESULT, SUMMARY, BLOCKS_FILE = "result.csv", "summary.json", "blocks.csv"
# Of each block of an NC program what is laid side by side, as columns of blocks.csv.
OF_BLOCKS = ("largest [um]", "rms [um]", "begin [s]", "end [s]")
# Columns that are laid over each other, of every axis: name -> SI unit.
COMPARED_SIGNALS = {"x_s": "m", "x_e": "m", "x_a": "m", "n_a": "rad/s", "M_a": "N.m", "M_fr": "N.m", "i_q": "A"}


@dataclass(frozen=True, eq=False)
class Source:
    """A result's folder, or a file of curves.

    Attributes:
        name: short, and of no other one. recording: its curves. time: (N,) [s], as recorded.
        figures: name -> value and unit. parameters: dotted name -> value as text. circles: prefix -> turns.
        answer: what it says of itself. blocks: of an NC program, line and text of a block -> the largest distance from
        the path and its rms [um], the time [s]; of a block that is worked several times the worst.
        notes: what its numbers are worth.
        shift: of its first row on the first source's time [s], None where none fits. aligned: how that was found.
    """

    name: str
    path: Path
    recording: Recording
    time: Array
    figures: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    parameters: Mapping[str, str] = field(default_factory=dict)
    circles: Mapping[str, tuple[Turn, ...]] = field(default_factory=dict)
    answer: tuple[str, ...] = ()
    blocks: Mapping[tuple[str, str], tuple[float, float, float]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    shift: float | None = 0.0
    aligned: str = ""

    @property
    def t(self) -> Array:
        """(N,) [s] from the first row of the first source on; from its own first row on where no shift fits."""
        return np.asarray(self.time - self.time[0] + (self.shift or 0.0))

    def curve(self, name: str, unit: str) -> Array | None:
        """A column in an SI unit; None where there is none of that name and kind."""
        if name not in self.recording.names:
            return None
        try:
            factor = float(units.factor(self.recording.units[name] or "1", unit))
        except InputError:
            return None
        return np.asarray(self.recording.read([name])[name], dtype=np.float64) * factor

    @property
    def signals(self) -> list[str]:
        """Columns that can be laid over those of others."""
        return [name for name in self.recording.names if "." in name and name.partition(".")[2] in COMPARED_SIGNALS]

    @property
    def axes(self) -> list[str]:
        """Axes of which there is a signal."""
        return list(dict.fromkeys(name.partition(".")[0] for name in self.signals))


def read_sources(paths: Sequence[Path], mappings: Sequence[Columns] = ()) -> list[Source]:
    """Folders of `feedsim run`, or CSV files with a column of time. InputError lists all that is no such.

    mappings: which columns of the files, those of feedsim aside, are what.
    """
    sources, problems = [], []
    for path, name in zip(paths, named_apart(paths), strict=True):
        try:
            sources.append(_read_source(path, name, mappings))
        except InputError as error:
            problems += list(error.problems)
    if problems:
        raise InputError.of("nothing can be shown", problems)
    return sources


def named_apart(paths: Sequence[Path]) -> list[str]:
    """The shortest ends of the paths that differ."""
    parts = [path.absolute().parts for path in paths]
    for count in range(1, max(map(len, parts), default=0) + 1):
        names = ["/".join(part[-count:]) for part in parts]
        if len(set(names)) == len(names):
            return names
    return [f"{path} ({k})" for k, path in enumerate(paths, 1)]


def _read_source(path: Path, name: str, mappings: Sequence[Columns]) -> Source:
    curves = path / RESULT if path.is_dir() else path
    if path.is_dir() and not curves.is_file():
        raise InputError(
            f"{path}: has no {RESULT}; a folder of `feedsim run`, a CSV file, or a run of a study "
            "(FOLDER:17, FOLDER:max=FIGURE) is needed"
        )
    recording = read_recording(curves)
    if curves.name != RESULT:
        recording = map_columns(recording, mappings)
    if (clock := recording.clock()) is None:
        raise InputError(f"{recording.header}: has no column of time; it is called time [s] or t [s]")
    column, factor = clock
    time = np.asarray(recording.read([column])[column], dtype=np.float64) * factor
    if len(time) < 2 or not np.all(np.diff(time) > 0):
        raise InputError(f"{curves}: its time does not rise from row to row; two rows or more are needed")
    summary = curves.with_name(SUMMARY)
    if curves.name != RESULT or not summary.is_file():
        return Source(name, path, recording, time)
    content = json_file(summary)
    try:
        return Source(
            name, path, recording, time,
            figures=_figures(content),
            parameters=_parameters(content),
            circles={prefix: tuple(map(_turn, turns)) for prefix, turns in content.get("circles", {}).items()},
            answer=tuple(map(str, content.get("answer", ()))),
            blocks=_blocks(summary.with_name(BLOCKS_FILE)) if content.get("contours") else {},
            notes=tuple(str(content.get(part, {}).get("note") or "") for part in ("machine", "scenario")),
        )  # fmt: skip
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{summary}: is no summary of `feedsim run`: {type(error).__name__}: {error}") from None


def _figures(summary: Mapping[str, Any]) -> dict[str, tuple[float, str]]:
    """Name -> value and unit; of a compensation those of its compensated turn, by the names that a run gives them."""
    result = {
        key: (math.nan if value["value"] is None else float(value["value"]), str(value["unit"]))
        for key, value in summary["figures"].items()
    }
    if summary.get("kind") != "compensate":
        return result
    label = "".join(map(str, summary["compensation"]["turn"]["plane"]))
    kept = {key: value for key, value in result.items() if not key.startswith("before.")}
    return {f"{label}.{key.removeprefix('after.')}" if key.startswith("after.") else key: e for key, e in kept.items()}


def _blocks(path: Path) -> dict[tuple[str, str], tuple[float, float, float]]:
    """Blocks of a table that a run of an NC program has left; none where it is not there any more."""
    if not path.is_file():
        return {}
    result: dict[tuple[str, str], tuple[float, float, float]] = {}
    with path.open(encoding="utf-8", newline="") as file:
        rows = read_rows(file)
        heads = next(rows)
        for row in rows:
            cells = dict(zip(heads, row, strict=True))
            largest, rms, begin, end = (float(cells[name] or math.nan) for name in OF_BLOCKS)
            key = f"{cells['file']}:{cells['line']}", cells["text"]
            if key not in result or largest > result[key][0]:
                result[key] = (largest, rms, end - begin)
    return result


def _turn(turn: Mapping[str, Any]) -> Turn:
    first, second = map(str, turn["axes"])
    x, y = map(float, turn["centre"]["value"])
    span = float(turn["begin"]["value"]), float(turn["end"]["value"])
    sense = {word: sense for sense, word in SENSE_WORDS.items()}[turn["direction"]]
    return Turn((first, second), (x, y), float(turn["radius"]["value"]), sense, *span)


def _parameters(summary: Mapping[str, Any]) -> dict[str, str]:
    """Everything that a person sets, dotted: of the machine, and of the scenario."""
    result = {"scenario.motions": "; ".join(entry["description"] for entry in summary["scenario"]["motions"])}
    for group in ("coupling", "recording_interval"):
        result |= _flatten_parameters(f"scenario.{group}", summary["scenario"][group])
    # Results of earlier versions lack some.
    known = ("name", "pose", "cycles", "path", "modes", "structure", "plant", "errors", "axes")
    return result | _flatten_parameters(
        "machine", {key: summary["machine"][key] for key in known if key in summary["machine"]}
    )


def _flatten_parameters(name: str, value: Any) -> dict[str, str]:
    if isinstance(value, Mapping):
        if set(value) == {"value", "unit"}:
            return {name: f"{value['value']:.9g} {value['unit']}" if value["value"] is not None else "none"}
        return {
            key: text
            for part, entry in value.items()
            for key, text in _flatten_parameters(f"{name}.{part}", entry).items()
        }
    return {name: str(value)[:DIGEST_DIGITS] if name.endswith(".sha256") else str(value)}


def differing_parameters(sources: Sequence[Source]) -> list[tuple[str, list[str]]]:
    """Parameters in which the results among the sources differ: name, and the value of every source, "" of records."""
    parameters = [source.parameters for source in sources]
    names = dict.fromkeys(name for entry in parameters for name in entry)
    rows = [(name, [entry.get(name, "") for entry in parameters]) for name in names]
    return [
        (name, values)
        for name, values in rows
        if len({v for v, value in zip(values, parameters, strict=True) if value}) > 1
    ]


# --- Results and records laid over each other: in time, about their stops, and by the angle of circles ----------------
# What axes were given, x_s, has the same course in all that made the same motion, whatever the axes did with it. By it
# sources are shifted; positions serve where a file has no setpoints, which takes out a lag that all axes share.


# Shifted, positions of one motion differ by less than this share of their range (rms).
SAME_MOTION = 0.02
# A record of a circle is about the programmed centre where that of its positions lies closer than this [m].
SAME_CENTRE = 1e-3
# An axis counts as moving faster than this [m/s], and further [m]: splines through setpoints ring by less.
MOVING_SPEED, MOVING_DISTANCE = 10e-6, 1e-6
MAX_SIGNALS_NAMED = 4  # signals in a message
WORDS = {"x_s": "position setpoints x_s", "x_a": "positions x_a, which takes out what all axes lag"}


def align_sources(sources: Sequence[Source]) -> list[Source]:
    """The sources, shifted in time onto the first one, and with the turns of circles that another one has.

    InputError lists the sources that share no signal and no figure with any other one.
    """
    alone = [
        f"{source.name}: has nothing that can be laid over another one; it has {_signals(source)}; the others have "
        f"{'; '.join(_signals(other) for other in sources if other is not source)}"
        for source in sources
        if len(sources) > 1 and not any(_shares(source, other) for other in sources if other is not source)
    ]
    if alone:
        raise InputError.of("nothing can be shown", alone)
    shifted = [sources[0], *(_shift_source(source, sources[0]) for source in sources[1:])]
    circles = {prefix: turns for source in reversed(sources) for prefix, turns in source.circles.items()}
    return [_with_circles(source, circles) for source in shifted]


def _signals(source: Source) -> str:
    more = len(source.signals) - MAX_SIGNALS_NAMED
    return (
        ", ".join(source.signals[:MAX_SIGNALS_NAMED]) + (f" and {more} more" if more > 0 else "")
        or "no signal of an axis"
    )


def _shares(one: Source, other: Source) -> bool:
    return bool(set(one.signals) & set(other.signals) or set(one.figures) & set(other.figures))


def _shift_source(source: Source, onto: Source) -> Source:
    if source.parameters and source.parameters.get("scenario.motions") == onto.parameters.get("scenario.motions"):
        return replace(source, aligned="by the program, which is the same")
    for signal, words in WORDS.items():
        columns, reference = (
            {name: curve for axis in entry.axes if (curve := entry.curve(name := f"{axis}.{signal}", "m")) is not None}
            for entry in (source, onto)
        )
        shared = [name for name in columns if name in reference and np.ptp(columns[name]) and np.ptp(reference[name])]
        if not shared:
            continue
        here = Trace(source.t, {name: columns[name] for name in shared}, dict.fromkeys(shared, "m"))
        there = Trace(onto.t, {name: reference[name] for name in shared}, dict.fromkeys(shared, "m"))
        try:
            seconds = estimated_shift(
                as_series(here), as_series(there), float(max(here.time[-1], there.time[-1]))
            ).seconds
        except InputError:
            continue
        if _misfit(here, there, seconds) <= SAME_MOTION:
            return replace(source, shift=seconds, aligned=f"{seconds:+.6g} s, found by the {words}")
    return replace(
        source,
        shift=None,
        aligned="not: no position has the course of the first source's, each begins at its first row",
    )


def _misfit(here: Trace, there: Trace, seconds: float) -> float:
    """Largest rms difference of a position in shares of its range."""
    t = here.time + seconds
    inside = (t >= there.time[0]) & (t <= there.time[-1])
    off = [
        float(np.sqrt(np.mean((here[name][inside] - np.interp(t[inside], there.time, there[name])) ** 2)))
        / float(np.ptp(there[name]))
        for name in here
    ]
    return max(off)


def _with_circles(source: Source, circles: Mapping[str, Sequence[Turn]]) -> Source:
    """The source with the circles that others have and it has driven, too; found by the angle alone."""
    result, notes = dict(source.circles), []
    for prefix, turns in circles.items():
        axes = turns[0].axes
        if prefix in result or any(source.curve(f"{axis}.x_a", "m") is None for axis in axes):
            continue
        try:
            result[prefix], centred = _turns(source, turns[0])
        except InputError as error:
            notes.append(f"circle {prefix}: not, {error}")
            continue
        where = "the centre that fits them" if centred else "the programmed centre"
        notes.append(f"circle {prefix}: turns found in the positions, by the angle about {where}")
    return replace(source, circles=result, aligned="; ".join([source.aligned, *notes]).removeprefix("; "))


def _turns(source: Source, turn: Turn) -> tuple[tuple[Turn, ...], bool]:
    """Recorded turns of a circle, and whether they are about a centre of their own."""
    x, y = (np.asarray(source.curve(f"{axis}.x_a", "m")) for axis in turn.axes)
    turns = read_circle([source.recording.path], turn.axes, radius=turn.radius).turns
    if not all(recorded_turn.path.whole for recorded_turn in turns):
        raise InputError(f"{source.recording.path}: holds {turns[0].name}; a full turn, 360 deg, is needed")
    spans = [
        (recorded_turn.path.sense, recorded_turn.begin, recorded_turn.begin + recorded_turn.duration)
        for recorded_turn in turns
        if recorded_turn.begin is not None and recorded_turn.duration is not None
    ]
    inside = np.any([(source.time >= begin) & (source.time <= end) for _, begin, end in spans], axis=0)
    own, _ = fitted_circle(x[inside], y[inside])
    centred = math.dist(own, turn.centre) > SAME_CENTRE
    centre = own if centred else turn.centre
    return tuple(Turn(turn.axes, centre, turn.radius, *span) for span in spans), centred


def stops(sources: Sequence[Source]) -> list[tuple[Approach, ...]]:
    """Of every source where its axes come to rest, by its setpoints; without any, those of the first source that has.

    Times are those of ``Source.t``.
    """
    own = [_stops(source) for source in sources]
    first = next((entry for entry in own if entry), ())
    return [value or (first if source.shift is not None else ()) for value, source in zip(own, sources, strict=True)]


def _stops(source: Source) -> tuple[Approach, ...]:
    result: list[Approach] = []
    for axis in source.axes:
        setpoint = source.curve(f"{axis}.x_s", "m")
        if setpoint is not None:
            result += approaches(axis, source.t, setpoint)
    return tuple(result)


def approaches(axis: str, time: Array, setpoint: Array) -> list[Approach]:
    """Motions of an axis that end at rest elsewhere than they began, found in its setpoint (N,) [m]."""
    changes = np.flatnonzero(np.abs(np.diff(setpoint)) > MOVING_SPEED * np.diff(time)) + 1
    if len(changes) == 0:
        return []
    # Behind a rest of MIN_REST_TIME and more a new motion begins.
    rests = np.flatnonzero(np.diff(time[changes]) >= MIN_REST_TIME)
    begins = [int(changes[0]) - 1, *(int(changes[k + 1]) - 1 for k in rests)]
    ends = [*(int(changes[k]) for k in rests), int(changes[-1])]
    nexts = [*begins[1:], len(time) - 1]
    # Amid a rest the setpoint stands; at its ends it moves too slowly to be seen.
    level = [float(setpoint[0]), *(float(setpoint[(e + n) // 2]) for e, n in zip(ends, nexts, strict=True))]
    return [
        Approach(axis, float(time[b]), float(time[e]), float(time[n]), origin, target, None)
        for b, e, n, (origin, target) in zip(begins, ends, nexts, pairwise(level), strict=True)
        if abs(target - origin) > MOVING_DISTANCE and time[n] - time[e] >= MIN_REST_TIME
    ]
