"""Results and records laid over each other: in time, about their stops, and by the angle of circles.

What axes were given, x_s, has the same course in all that made the same motion, whatever the axes did with it. By it
sources are shifted; positions serve where a file has no setpoints, which takes out a lag that all axes share.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from feedsim.analysis.circle.records import read_circle
from feedsim.analysis.circularity import Turn, fitted_circle
from feedsim.analysis.figures import Array
from feedsim.analysis.positioning import MIN_REST_TIME, Approach
from feedsim.analysis.side_by_side import Source
from feedsim.compare.shift import estimated_shift
from feedsim.errors import InputError
from feedsim.trace import Trace, as_series

# Shifted, positions of one motion differ by less than this share of their range (rms).
SAME_MOTION = 0.02
# A record of a circle is about the programmed centre where that of its positions lies closer than this [m].
SAME_CENTRE = 1e-3
# An axis counts as moving faster than this [m/s], and further [m]: splines through setpoints ring by less.
MOVING_SPEED, MOVING_DISTANCE = 10e-6, 1e-6
MAX_SIGNALS_NAMED = 4  # signals in a message
WORDS = {"x_s": "position setpoints x_s", "x_a": "positions x_a, which takes out what all axes lag"}


def aligned(sources: Sequence[Source]) -> list[Source]:
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
    shifted = [sources[0], *(_shifted(source, sources[0]) for source in sources[1:])]
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


def _shifted(source: Source, onto: Source) -> Source:
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
