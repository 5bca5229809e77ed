"""Pictures of several results over each other: contours of circles, stops, signals over time and by frequency."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from feedsim.analysis import Approach, deviation
from feedsim.analysis.alignment import stops
from feedsim.analysis.circularity import Turn, contour
from feedsim.analysis.side_by_side import COMPARED_SIGNALS, Source
from feedsim.analysis.spectrum import amplitude_spectrum
from feedsim.errors import InputError
from feedsim.report.chart import Axis, Chart, Curve, Dash, Level, Panel
from feedsim.report.picture import Picture
from feedsim.report.run.axis_plots import ZOOM_AFTER, ZOOM_BEFORE
from feedsim.report.run.circle_plots import circle, circle_chart, turned
from feedsim.report.style import (
    BEFORE,
    GREEN,
    ORANGE,
    PURPLE,
    RECORDED,
    SIMULATED,
    SKY,
    VERMILLION,
    Array,
)
from feedsim.trace import Trace

FURTHER_COLOURS = (SKY, GREEN, PURPLE, ORANGE, VERMILLION)  # of further results
ABSCISSA = Axis("time from the first row", "s")
AFTER = Axis("time after the end of the motion", "ms", span=(-1e3 * ZOOM_BEFORE, 1e3 * ZOOM_AFTER))
FREQUENCY = Axis("frequency", "Hz", log=True)
SHAKEN = 0.02
LEFT_OUT = f"Axes with less than {100 * SHAKEN:g} % of the largest range are left out."
# What a picture answers: stem, title, signal, factor from SI, ordinate.
QUESTIONS = (
    ("following-error", "How far do the axes lag?", "x_e", 1e6, Axis("following error", "µm")),
    ("torque", "What do the motors need?", "M_a", 1.0, Axis("motor torque", "N·m")),
    ("speed", "How fast are the motors?", "n_a", 1.0, Axis("motor speed", "rad/s")),
    ("position", "Where are the axes?", "x_a", 1e3, Axis("position", "mm")),
)
# Stops of an axis that are drawn, and the distance beyond the target that is shown at least [um].
MOST_STOPS, LEAST_REACH = 6, 2.2
# Spectra: signal, title, factor from SI, unit; stretch [s], rows of it at least, and how far down they are drawn.
SPECTRA = (("x_e", "following error", 1e6, "µm"), ("M_a", "motor torque", 1.0, "N·m"))
STRETCH, MIN_SPECTRUM_ROWS, DOWN = 1.0, 64, 1e-4


@dataclass(frozen=True, eq=False)
class _Curve:
    angle: Array
    deviation: Array


def looks_of(sources: Sequence[Source]) -> list[tuple[str, Dash]]:
    """Colour and dash of every source: records as records; of results alone the first is what was before."""
    kinds: tuple[Dash, ...] = ("", "dashed", "dotted")
    records = [not source.figures and not source.parameters for source in sources]
    names = [SIMULATED, *FURTHER_COLOURS] if any(records) else [BEFORE, SIMULATED, *FURTHER_COLOURS]
    result: list[tuple[str, Dash]] = []
    for k, recorded in enumerate(records):
        number = sum(record == recorded for record in records[:k])
        own = [RECORDED] if recorded else names
        result.append((own[number % len(own)], kinds[number // len(own) % len(kinds)]))
    return result


def pictures_of(sources: Sequence[Source]) -> list[Picture]:
    """A picture per question that at least one source answers."""
    pictures = [picture for prefix in _prefixes(sources) if (picture := contour_picture(sources, prefix)) is not None]
    more = [
        stop_picture(sources, stops(sources)),
        *(_over_time(sources, *question) for question in QUESTIONS),
        spectrum_picture(sources),
    ]
    return pictures + [picture for picture in more if picture is not None]


def _prefixes(sources: Sequence[Source]) -> list[str]:
    return list(dict.fromkeys(prefix for source in sources for prefix in source.circles))


def contours(source: Source, turns: Sequence[Turn]) -> list[_Curve]:
    """Measured turns of a result, by the scales."""
    names = [f"{axis}.x_a" for axis in turns[0].axes]
    columns = {name: curve for name in names if (curve := source.curve(name, "m")) is not None}
    trace = Trace(source.time, columns)
    try:
        result = [contour(trace, turn) for turn in turns]
    except InputError as error:
        raise InputError(f"{source.path}: {error}") from None
    return [_Curve(entry.angle, entry.deviation) for entry in result]


def contour_picture(sources: Sequence[Source], prefix: str) -> Picture | None:
    """Contour errors of one circle over each other, each turn in its source's colour."""
    own = [(k, source, source.circles[prefix]) for k, source in enumerate(sources) if prefix in source.circles]
    if not own:
        return None
    curves = [(k, source, turns, contours(source, turns)) for k, source, turns in own]
    on = circle(own[0][2][0], max(float(np.abs(c.deviation).max()) for *_, drawn in curves for c in drawn))
    axes = "-".join(own[0][2][0].axes)
    caption = (
        f"Rings at ±{on.ring:g} µm about the programmed circle; clockwise turns are drawn thin. Where the radii are "
        "not the same, the deviation is what is compared."
    )
    looks = looks_of(sources)
    shown = [
        turned(source.name, looks[k][0], curve.angle, curve.deviation, looks[k][1],
               1.4 if turn.sense > 0 else 0.8)
        for k, source, turns, drawn in curves
        for turn, curve in zip(turns, drawn, strict=True)
    ]  # fmt: skip
    stem, title = f"contour-{prefix.replace('#', '-')}", f"Is the circle round? Plane {axes}"
    return Picture(stem, title, caption, circle_chart(on, shown))


@dataclass(frozen=True, eq=False)
class Stop:
    """A stop of a source: the motion that it ends, and the source's position over its own ``t``."""

    approach: Approach
    trace: Trace


# A curve of a source, by its number: abscissae and ordinates.
_Own = tuple[int, Array, Array]


def _curves(sources: Sequence[Source], own: Sequence[_Own]) -> list[Curve]:
    looks = looks_of(sources)
    return [Curve(sources[k].name, x, y, *looks[k], 1.2) for k, x, y in own]


def _over_time(
    sources: Sequence[Source], stem: str, title: str, signal: str, factor: float, ordinate: Axis
) -> Picture | None:
    result: dict[str, list[_Own]] = {}
    for axis in dict.fromkeys(axis for source in sources for axis in source.axes):
        curves = (
            (k, source, source.curve(f"{axis}.{signal}", COMPARED_SIGNALS[signal])) for k, source in enumerate(sources)
        )
        result[axis] = [(k, source.t, factor * y) for k, source, y in curves if y is not None]
    sizes = {axis: max((float(np.ptp(y)) for *_, y in curves), default=0.0) for axis, curves in result.items()}
    panels = [
        Panel(f"Axis {axis}", ABSCISSA, ordinate, _curves(sources, result[axis]), [Level(0.0, dash="")], linked="t")
        for axis in _moved(sizes)
    ]
    caption = f"Over the time of the first source, from its first row on. {LEFT_OUT}"
    return Picture(stem, title, caption, Chart(panels)) if panels else None


def stop_picture(sources: Sequence[Source], stops: Sequence[Sequence[Approach]]) -> Picture | None:
    """Distance beyond the target about the ends of motions, a panel for every stop of an axis."""
    panels = []
    for axis, number in stops_of(stops):
        own: list[_Own] = []
        most, said = LEAST_REACH, []
        for k, (source, approaches) in enumerate(zip(sources, stops, strict=True)):
            if (seen := stop_seen(source, approaches, axis, number)) is None:
                continue
            approach = seen.approach
            time, beyond = deviation(seen.trace, approach, f"{axis}.x_a")
            after = 1e3 * (time - approach.end)
            near = (after >= -1e3 * ZOOM_BEFORE) & (after <= 1e3 * ZOOM_AFTER)
            own.append((k, after[near], 1e6 * beyond[near]))
            most = max(most, 1e6 * float(beyond.max()))
            said.append(f"{approach.target * 1e3:.6g}")
        title = f"Axis {axis}, stop {number + 1} at {' and '.join(dict.fromkeys(said))} mm"
        ordinate = Axis("beyond the target", "µm", span=(-1.45 * most, 1.45 * most))
        levels = [Level(0.0, dash=""), Level(0.0, upright=True, dash="dotted")]
        if own and number < MOST_STOPS:
            panels.append(Panel(title, AFTER, ordinate, _curves(sources, own), levels, linked="stop"))
    caption = (
        "Actual position less end position in the sense of the motion, positive past it, over the time after the "
        "setpoint has come to rest."
    )
    if any(number >= MOST_STOPS for _, number in stops_of(stops)):
        caption += f" The first {MOST_STOPS} stops of each axis are drawn; the table has all."
    return Picture("stop", "How do the axes come to rest?", caption, Chart(panels)) if panels else None


def stops_of(stops: Sequence[Sequence[Approach]]) -> list[tuple[str, int]]:
    """Axis and number of every stop that any source has."""
    names = dict.fromkeys(approach.axis for stop in stops for approach in stop)
    most = {axis: max(sum(approach.axis == axis for approach in stop) for stop in stops) for axis in names}
    return [(axis, number) for axis in names for number in range(most[axis])]


def stop_seen(source: Source, approaches: Sequence[Approach], axis: str, number: int) -> Stop | None:
    """A stop of a source; None where it has not recorded it whole."""
    own = [approach for approach in approaches if approach.axis == axis]
    position = source.curve(f"{axis}.x_a", "m")
    if number >= len(own) or position is None or not source.t[0] <= own[number].start < own[number].end < source.t[-1]:
        return None
    return Stop(own[number], Trace(source.t, {f"{axis}.x_a": position}))


def spectrum_picture(sources: Sequence[Source]) -> Picture | None:
    """Amplitude spectra of following error and torque of every axis, over the whole of each source."""
    panels = []
    for signal, words, factor, unit in SPECTRA:
        result: dict[str, list[_Own]] = {}
        for axis in dict.fromkeys(axis for source in sources for axis in source.axes):
            curves = [(k, _spectrum(source, f"{axis}.{signal}", factor)) for k, source in enumerate(sources)]
            result[axis] = [(k, *curve) for k, curve in curves if curve is not None]
        tops = {axis: max((float(a.max()) for *_, a in curves), default=0.0) for axis, curves in result.items()}
        for axis in _moved(tops):
            y = Axis("amplitude", unit, log=True, span=(DOWN * tops[axis], 2 * tops[axis]))
            panels.append(Panel(f"Axis {axis}: {words}", FREQUENCY, y, _curves(sources, result[axis]), linked="f"))
    caption = (
        f"Amplitude spectra over the whole of each source: Hann windows of {STRETCH:g} s, half over each other, "
        "averaged by power. A steady vibration stands there with its amplitude; what only rings now and then stands "
        f"lower. {LEFT_OUT}"
    )
    chart = Chart(panels, (1.0, 1.0))
    return Picture("spectrum", "Which frequencies are in it?", caption, chart) if panels else None


def _spectrum(source: Source, name: str, factor: float) -> tuple[Array, Array] | None:
    values = source.curve(name, COMPARED_SIGNALS[name.partition(".")[2]])
    if values is None or len(values) < MIN_SPECTRUM_ROWS or not np.ptp(values):
        return None
    interval = float(np.median(np.diff(source.time)))
    even = np.arange(source.time[0], source.time[-1], interval)
    rows = max(MIN_SPECTRUM_ROWS, round(STRETCH / interval))
    f, a = amplitude_spectrum(factor * np.interp(even, source.time, values), interval, rows)
    return f[2:], a[2:]  # what is below holds the mean


def _moved(sizes: Mapping[str, float]) -> list[str]:
    """Axes that are worth a panel, by how large what they do is."""
    return [axis for axis, size in sizes.items() if size > SHAKEN * max(sizes.values())]
