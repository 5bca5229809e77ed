"""Pictures of several results over each other: contours of circles, and signals of the axes over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from feedsim.analysis.circularity import Turn, contour
from feedsim.analysis.side_by_side import Source
from feedsim.errors import InputError
from feedsim.report.chart import Axis, Chart, Curve, Dash, Level, Panel
from feedsim.report.formatting import plain
from feedsim.report.labels import heading
from feedsim.report.picture import Picture
from feedsim.report.run import circle_plots
from feedsim.report.run.charts import circle_chart, turned
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
DASHES = ("-", (0, (5, 1.5)), (0, (1.5, 1)), (0, (6, 1.5, 1.5, 1.5)))
# What a picture answers: stem, title, signal, factor from SI, ordinate.
QUESTIONS = (
    ("following-error", "How far do the axes lag?", "x_e", 1e6, "following error [µm]"),
    ("torque", "What do the motors need?", "M_a", 1.0, "motor torque [N·m]"),
    ("speed", "How fast are the motors?", "n_a", 1.0, "motor speed [rad/s]"),
    ("position", "Where are the axes?", "x_a", 1e3, "position [mm]"),
)
SI = {"x_e": "m", "M_a": "N.m", "n_a": "rad/s", "x_a": "m"}


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
    for question in QUESTIONS:
        if (picture := _over_time(sources, *question)) is not None:
            found.append(picture)
    return found


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


def _over_time(
    sources: Sequence[Source], stem: str, title: str, signal: str, factor: float, ordinate: str
) -> Picture | None:
    axes = list(dict.fromkeys(axis for source in sources for axis in source.axes))
    curves: dict[str, list[tuple[int, Array]]] = {}
    for axis in axes:
        found = ((k, source.curve(f"{axis}.{signal}", SI[signal])) for k, source in enumerate(sources))
        curves[axis] = [(k, y) for k, y in found if y is not None]
    # An axis that nothing moves says nothing.
    curves = {axis: ys for axis, ys in curves.items() if any(float(np.ptp(y)) > 0 for _, y in ys)}
    if not curves:
        return None

    def draw() -> Drawn:
        with drawing(10.0, 0.6 + 2.3 * len(curves)) as figure:
            rooms = figure.subplots(len(curves), 1, squeeze=False, sharex=True)[:, 0]
            for room, (axis, ys) in zip(rooms, curves.items(), strict=True):
                for k, y in ys:
                    t = sources[k].time - sources[k].time[0]
                    room.plot(*thinned(t, factor * y), **look(k), linewidth=1.1, label=plain(sources[k].name))
                room.axhline(0.0, color=MUTED, linewidth=0.8)
                room.margins(x=0.01)
                heading(room, f"Axis {axis}")
                room.set_ylabel(ordinate)
            handles = [line for room in rooms for line in room.get_lines() if not line.get_label().startswith("_")]
            once = {handle.get_label(): handle for handle in handles}
            figure.legend(handles=list(once.values()), loc="outside upper right", ncols=min(len(once), 4))
            rooms[-1].set_xlabel("time from the first row [s]")
            return finish(figure, stem, title, caption)

    label, _, unit = ordinate.removesuffix("]").rpartition(" [")
    panels = []
    for axis, ys in curves.items():
        own = [
            Curve(
                sources[k].name,
                sources[k].time - sources[k].time[0],
                factor * y,
                COLOURS[k % len(COLOURS)],
                _dash(k),
                1.2,
            )
            for k, y in ys
        ]
        panels.append(Panel(f"Axis {axis}", ABSCISSA, Axis(label, unit), own, [Level(0.0, dash="")], linked="t"))
    caption = "Each curve in its source's colour, from the first row of its file on."
    return Picture(stem, title, caption, draw, Chart(panels))
