"""Pictures of several results over each other: contours of circles, stops, signals over time and by frequency."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from feedsim.analysis import Approach, deviation
from feedsim.analysis.alignment import stops
from feedsim.analysis.circularity import Turn, contour
from feedsim.analysis.side_by_side import SIGNALS, Source
from feedsim.analysis.spectrum import amplitude_spectrum
from feedsim.errors import InputError
from feedsim.report.chart import Axis, Chart, Curve, Dash, Level, Panel
from feedsim.report.formatting import plain
from feedsim.report.labels import heading
from feedsim.report.picture import Picture
from feedsim.report.run import circle_plots
from feedsim.report.run.charts import ZOOM_AFTER, ZOOM_BEFORE, circle_chart, turned
from feedsim.report.style import (
    BLUE,
    GREEN,
    MUTED,
    ORANGE,
    PURPLE,
    SKY,
    VERMILLION,
    Array,
    Drawn,
    drawing,
    finish,
    thinned,
)
from feedsim.trace import Trace

COLOURS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY)
ABSCISSA = Axis("time from the first row", "s")
AFTER = Axis("time after the end of the motion", "ms", span=(-1e3 * ZOOM_BEFORE, 1e3 * ZOOM_AFTER))
FREQUENCY = Axis("frequency", "Hz", log=True)
DASHES = ("-", (0, (5, 1.5)), (0, (1.5, 1)), (0, (6, 1.5, 1.5, 1.5)))
SHAKEN = 0.02
LEFT_OUT = f"Axes with less than {100 * SHAKEN:g} % of the largest range are left out."
# What a picture answers: stem, title, signal, factor from SI, ordinate.
QUESTIONS = (
    ("following-error", "How far do the axes lag?", "x_e", 1e6, "following error [µm]"),
    ("torque", "What do the motors need?", "M_a", 1.0, "motor torque [N·m]"),
    ("speed", "How fast are the motors?", "n_a", 1.0, "motor speed [rad/s]"),
    ("position", "Where are the axes?", "x_a", 1e3, "position [mm]"),
)
# Stops of an axis that are drawn, and the distance beyond the target that is shown at least [um].
MOST_STOPS, LEAST_REACH = 6, 2.2
# Spectra: signal, title, factor from SI, ordinate; stretch [s], rows of it at least, and how far down they are drawn.
SPECTRA = (("x_e", "following error", 1e6, "amplitude [µm]"), ("M_a", "motor torque", 1.0, "amplitude [N·m]"))
STRETCH, LEAST_ROWS, DOWN = 1.0, 64, 1e-4


@dataclass(frozen=True, eq=False)
class _Curve:
    angle: Array
    deviation: Array


def look(k: int) -> dict[str, object]:
    """Colour and dashes of the k-th source."""
    return {"color": COLOURS[k % len(COLOURS)], "linestyle": DASHES[k // len(COLOURS) % len(DASHES)]}


def _dash(k: int) -> Dash:
    kinds: tuple[Dash, ...] = ("", "dashed", "dotted")
    return kinds[k // len(COLOURS) % len(kinds)]


def pictures_of(sources: Sequence[Source]) -> list[Picture]:
    """A picture per question that at least one source answers."""
    found = [picture for prefix in _prefixes(sources) if (picture := contour_picture(sources, prefix)) is not None]
    more = [
        stop_picture(sources, stops(sources)),
        *(_over_time(sources, *question) for question in QUESTIONS),
        spectrum_picture(sources),
    ]
    return found + [picture for picture in more if picture is not None]


def _prefixes(sources: Sequence[Source]) -> list[str]:
    return list(dict.fromkeys(prefix for source in sources for prefix in source.circles))


def contours(source: Source, turns: Sequence[Turn]) -> list[_Curve]:
    """Measured turns of a result, by the scales."""
    names = [f"{axis}.x_a" for axis in turns[0].axes]
    columns = {name: curve for name in names if (curve := source.curve(name, "m")) is not None}
    trace = Trace(source.time, columns)
    try:
        found = [contour(trace, turn) for turn in turns]
    except InputError as error:
        raise InputError(f"{source.path}: {error}") from None
    return [_Curve(each.angle, each.deviation) for each in found]


def contour_picture(sources: Sequence[Source], prefix: str) -> Picture | None:
    """Contour errors of one circle over each other, each turn in its source's colour."""
    own = [(k, source, source.circles[prefix]) for k, source in enumerate(sources) if prefix in source.circles]
    if not own:
        return None
    curves = [(k, source, turns, contours(source, turns)) for k, source, turns in own]
    on = circle_plots.circle(own[0][2][0], max(float(np.abs(c.deviation).max()) for *_, drawn in curves for c in drawn))
    ring, rings = on.ring, on.rings

    def draw() -> Drawn:
        with drawing(10.0, 6.0) as figure:
            polar, unrolled = figure.subplots(1, 2, width_ratios=[1.35, 1])
            circle_plots.polar_ground(polar, own[0][2][0], ring, rings)
            for k, source, turns, drawn in curves:
                for i, (turn, curve) in enumerate(zip(turns, drawn, strict=True)):
                    thin = {"linewidth": 1.4 if turn.sense > 0 else 0.8, "label": "" if i else plain(source.name)}
                    circle_plots.polar_curve(polar, curve, ring, rings, **look(k), **thin)
                    circle_plots.unrolled_curve(unrolled, curve, **look(k), **thin)
            circle_plots.unrolled_ground(unrolled, own[0][2][0])
            return finish(figure, stem, title, caption)

    axes = "-".join(own[0][2][0].axes)
    caption = (
        f"Rings at ±{ring:g} µm about the programmed circle; clockwise turns are drawn thin. Where the radii are "
        "not the same, the deviation is what is compared."
    )
    shown = [
        turned(source.name, COLOURS[k % len(COLOURS)], curve.angle, curve.deviation, _dash(k),
               1.4 if turn.sense > 0 else 0.8)
        for k, source, turns, drawn in curves
        for turn, curve in zip(turns, drawn, strict=True)
    ]  # fmt: skip
    stem, title = f"contour-{prefix.replace('#', '-')}", f"Is the circle round? Plane {axes}"
    return Picture(stem, title, caption, draw, circle_chart(on, shown))


@dataclass(frozen=True, eq=False)
class Stop:
    """A stop of a source: the motion that it ends, and the source's position over its own ``t``."""

    approach: Approach
    trace: Trace


@dataclass(frozen=True, eq=False)
class _Room:
    """A room of a drawing and panel of its chart: a curve each for some of the sources, by their numbers."""

    title: str
    x: Axis
    y: Axis
    curves: Sequence[tuple[int, Array, Array]]
    levels: Sequence[Level] = ()
    linked: str = "t"


def _over_time(
    sources: Sequence[Source], stem: str, title: str, signal: str, factor: float, ordinate: str
) -> Picture | None:
    found: dict[str, list[tuple[int, Array, Array]]] = {}
    for axis in dict.fromkeys(axis for source in sources for axis in source.axes):
        curves = ((k, source, source.curve(f"{axis}.{signal}", SIGNALS[signal])) for k, source in enumerate(sources))
        found[axis] = [(k, source.t, factor * y) for k, source, y in curves if y is not None]
    rooms = [
        _Room(f"Axis {axis}", ABSCISSA, _axis(ordinate), found[axis], [Level(0.0, dash="")])
        for axis in _moved({axis: max((float(np.ptp(y)) for *_, y in curves), default=0.0)
                            for axis, curves in found.items()})
    ]  # fmt: skip
    caption = f"Over the time of the first source, from its first row on. {LEFT_OUT}"
    return _rooms(sources, stem, title, caption, rooms)


def stop_picture(sources: Sequence[Source], stops: Sequence[Sequence[Approach]]) -> Picture | None:
    """Distance beyond the target about the ends of motions, a room for every stop of an axis."""
    rooms = []
    for axis, number in stops_of(stops):
        curves, most, said = [], LEAST_REACH, []
        for k, (source, found) in enumerate(zip(sources, stops, strict=True)):
            if (seen := stop_seen(source, found, axis, number)) is None:
                continue
            approach = seen.approach
            time, beyond = deviation(seen.trace, approach, f"{axis}.x_a")
            after = 1e3 * (time - approach.end)
            near = (after >= -1e3 * ZOOM_BEFORE) & (after <= 1e3 * ZOOM_AFTER)
            curves.append((k, after[near], 1e6 * beyond[near]))
            most = max(most, 1e6 * float(beyond.max()))
            said.append(f"{approach.target * 1e3:.6g}")
        title = f"Axis {axis}, stop {number + 1} at {' and '.join(dict.fromkeys(said))} mm"
        ordinate = Axis("beyond the target", "µm", span=(-1.45 * most, 1.45 * most))
        levels = [Level(0.0, dash=""), Level(0.0, upright=True, dash="dotted")]
        if curves and number < MOST_STOPS:
            rooms.append(_Room(title, AFTER, ordinate, curves, levels, "stop"))
    caption = (
        "Actual position less end position in the sense of the motion, positive past it, over the time after the "
        "setpoint has come to rest."
    )
    if any(number >= MOST_STOPS for _, number in stops_of(stops)):
        caption += f" The first {MOST_STOPS} stops of each axis are drawn; the table has all."
    return _rooms(sources, "stop", "How do the axes come to rest?", caption, rooms)


def stops_of(stops: Sequence[Sequence[Approach]]) -> list[tuple[str, int]]:
    """Axis and number of every stop that any source has."""
    names = dict.fromkeys(approach.axis for found in stops for approach in found)
    most = {axis: max(sum(each.axis == axis for each in found) for found in stops) for axis in names}
    return [(axis, number) for axis in names for number in range(most[axis])]


def stop_seen(source: Source, found: Sequence[Approach], axis: str, number: int) -> Stop | None:
    """A stop of a source; None where it has not recorded it whole."""
    own = [each for each in found if each.axis == axis]
    position = source.curve(f"{axis}.x_a", "m")
    if number >= len(own) or position is None or not source.t[0] <= own[number].start < own[number].end < source.t[-1]:
        return None
    return Stop(own[number], Trace(source.t, {f"{axis}.x_a": position}))


def spectrum_picture(sources: Sequence[Source]) -> Picture | None:
    """Amplitude spectra of following error and torque of every axis, over the whole of each source."""
    rooms = []
    for signal, words, factor, ordinate in SPECTRA:
        found: dict[str, list[tuple[int, Array, Array]]] = {}
        for axis in dict.fromkeys(axis for source in sources for axis in source.axes):
            curves = [(k, _spectrum(source, f"{axis}.{signal}", factor)) for k, source in enumerate(sources)]
            found[axis] = [(k, *curve) for k, curve in curves if curve is not None]
        tops = {axis: max((float(a.max()) for *_, a in curves), default=0.0) for axis, curves in found.items()}
        for axis in _moved(tops):
            y = Axis(*_labelled(ordinate), log=True, span=(DOWN * tops[axis], 2 * tops[axis]))
            rooms.append(_Room(f"Axis {axis}: {words}", FREQUENCY, y, found[axis], (), "f"))
    caption = (
        f"Amplitude spectra over the whole of each source: Hann windows of {STRETCH:g} s, half over each other, "
        "averaged by power. A steady vibration stands there with its amplitude; what only rings now and then stands "
        f"lower. {LEFT_OUT}"
    )
    return _rooms(sources, "spectrum", "Which frequencies are in it?", caption, rooms, 2)


def _spectrum(source: Source, name: str, factor: float) -> tuple[Array, Array] | None:
    values = source.curve(name, SIGNALS[name.partition(".")[2]])
    if values is None or len(values) < LEAST_ROWS or not np.ptp(values):
        return None
    interval = float(np.median(np.diff(source.time)))
    even = np.arange(source.time[0], source.time[-1], interval)
    rows = max(LEAST_ROWS, round(STRETCH / interval))
    f, a = amplitude_spectrum(factor * np.interp(even, source.time, values), interval, rows)
    return f[2:], a[2:]  # what is below holds the mean


def _moved(sizes: Mapping[str, float]) -> list[str]:
    """Axes that are worth a room, by how large what they do is."""
    return [axis for axis, size in sizes.items() if size > SHAKEN * max(sizes.values())]


def _rooms(
    sources: Sequence[Source], stem: str, title: str, caption: str, rooms: Sequence[_Room], columns: int = 1
) -> Picture | None:
    """A picture of rooms below one another, in columns; None without any."""
    if not rooms:
        return None

    def draw() -> Drawn:
        lines = -(-len(rooms) // columns)
        with drawing(10.0, 0.6 + 2.3 * lines) as figure:
            places = figure.subplots(lines, columns, squeeze=False, sharex=True).ravel()
            for place in places[len(rooms) :]:
                place.set_visible(False)
            for place, room in zip(places, rooms, strict=False):
                for k, x, y in room.curves:
                    place.plot(*thinned(x, y), **look(k), linewidth=1.1, label=plain(sources[k].name))
                for level in room.levels:
                    (place.axvline if level.upright else place.axhline)(level.at, color=MUTED, linewidth=0.8)
                place.margins(x=0.01)
                if room.x.log:
                    place.set(xscale="log", yscale="log")
                place.set(xlim=room.x.span, ylim=room.y.span, ylabel=room.y.title)
                heading(place, room.title)
            once = {line.get_label(): line for place in places for line in place.get_lines()}
            handles = [line for label, line in once.items() if not str(label).startswith("_")]
            figure.legend(handles=handles, loc="outside upper right", ncols=min(len(handles), 4))
            for place in places[-columns:]:
                place.set_xlabel(rooms[0].x.title)
            return finish(figure, stem, title, caption)

    panels = [
        Panel(
            room.title, room.x, room.y,
            [Curve(sources[k].name, x, y, COLOURS[k % len(COLOURS)], _dash(k), 1.2) for k, x, y in room.curves],
            room.levels, linked=room.linked,
        )
        for room in rooms
    ]  # fmt: skip
    return Picture(stem, title, caption, draw, Chart(panels, (1.0,) * columns))


def _axis(ordinate: str) -> Axis:
    return Axis(*_labelled(ordinate))


def _labelled(ordinate: str) -> tuple[str, str]:
    label, _, unit = ordinate.removesuffix("]").rpartition(" [")
    return label, unit
