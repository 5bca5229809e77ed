"""Figures of a circular test: the magnified contour error, and the torques of the plane's axes over time and speed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from feedsim.analysis import Contour, Figures, Glitch, Turn, contour
from feedsim.report import style
from feedsim.report.chart import Polar
from feedsim.report.formatting import minus
from feedsim.report.labels import heading, legend_above, plain_box, reversed_note, torque_label
from feedsim.report.picture import Picture
from feedsim.report.run.charts import contour_chart, torque_chart
from feedsim.report.style import Array, Drawn, drawing, finish, thinned
from feedsim.trace import Trace

if TYPE_CHECKING:
    from matplotlib.axes import Axes

RING = 10.0  # um; kept as long as the contour error is neither much smaller nor larger
NOMINAL = 1.0  # radius of the nominal circle in the drawing
TOOL: dict[str, Any] = {"color": style.ORANGE, "linestyle": (0, (5, 1.5))}
RING_GAPS = {1: 0.36, 2: 0.24}  # rings to either side -> their distance in the drawing


class Curve(Protocol):
    """A turn to draw: angle (N,) [rad] and deviation of the radius (N,) [m]."""

    @property
    def angle(self) -> Array: ...
    @property
    def deviation(self) -> Array: ...


class OnCircle(Protocol):
    """The circle to draw it on: axes of the plane, radius [m]."""

    @property
    def axes(self) -> tuple[str, str]: ...
    @property
    def radius(self) -> float: ...


def contour_picture(trace: Trace, turn: Turn, figures: Figures, stem: str) -> Picture:
    """Contour error of one turn in polar form, magnified, with scale rings and the quadrant glitches.

    figures: those of ``analysis.circularity`` without prefix.
    """
    by_scale = contour(trace, turn)
    tool = (f"tcp.x_{turn.axes[0]}", f"tcp.x_{turn.axes[1]}")
    by_tool = contour(trace, turn, tool) if all(name in trace.columns for name in tool) else None
    on = circle(turn, float(np.abs(by_scale.deviation).max()))
    ring, rings = on.ring, on.rings

    def draw() -> Drawn:
        with drawing(10.0, 7.0) as figure:
            rooms = figure.subplot_mosaic(
                [["polar", "angle"], ["polar", "table"]], width_ratios=[1.85, 1], height_ratios=[1, 0.8]
            )
            _polar(rooms["polar"], turn, by_scale, by_tool, ring, rings)
            _unrolled(rooms["angle"], turn, by_scale, by_tool)
            _table(rooms["table"], turn, figures)
            return finish(figure, stem, title, caption)

    title = f"Circular test in the plane {turn.axes[0]}-{turn.axes[1]}: contour error"
    caption = (
        f"Radius {turn.radius * 1e3:.6g} mm, {'counterclockwise' if turn.sense > 0 else 'clockwise'} from "
        f"{turn.axes[0]} to {turn.axes[1]}, turn from {turn.begin:.4f} to {turn.end:.4f} s. "
        f"Radius deviation magnified {magnification(on):,.0f} times; rings at ±{ring:g} µm about the programmed "
        "circle. The markers show the quadrant glitches: the largest deviation within ±45° of an axis crossing, "
        "less the median of the turn."
    )
    return Picture(stem, title, caption, draw, contour_chart(by_scale, by_tool, on, turn.sense))


def torque_picture(trace: Trace, turn: Turn, signs: Mapping[str, int], stem: str) -> Picture | None:
    """Torques of the plane's axes over time and over speed, during the evaluated turn; None where none is recorded.

    signs: axis -> +-1, display sign of its torques.
    """
    axes = [axis for axis in turn.axes if f"{axis}.M_a" in trace.columns and f"{axis}.n_a" in trace.columns]
    if not axes:
        return None
    part = trace.between(turn.begin, turn.end)

    def draw() -> Drawn:
        with drawing(10.0, 3.8 * len(axes)) as figure:
            rooms = figure.subplots(len(axes), 3, squeeze=False, width_ratios=[1.25, 1, 1])
            for row, axis in zip(rooms, axes, strict=True):
                _torque_row(row, part, axis, signs.get(axis, 1))
            return finish(figure, stem, title, caption)

    title = f"Circular test in the plane {turn.axes[0]}-{turn.axes[1]}: driving torque and friction torque"
    caption = (
        f"Turn from {turn.begin:.4f} to {turn.end:.4f} s: over time, over the motor speed, and the friction torque "
        "around the reversal of the motion, where its slope is that of the engaging transmission."
        + reversed_note(axes, signs)
    )
    return Picture(stem, title, caption, draw, torque_chart(part, axes, signs))


def circle(on: OnCircle, largest: float) -> Polar:
    """The programmed circle with rings that suit a deviation of up to ``largest`` [m]; no curves."""
    ring = ring_step(largest * 1e6)
    title = f"Contour error, {on.axes[0]}-{on.axes[1]}, R {on.radius * 1e3:g} mm"
    return Polar(title, on.axes, on.radius * 1e3, ring, 1 if largest * 1e6 < 1.1 * ring else 2, ())


def magnification(on: Polar) -> float:
    """How many times larger than the circle its deviations are drawn."""
    return RING_GAPS[on.rings] / on.ring * 1e3 * on.radius / NOMINAL


def ring_step(largest: float) -> float:
    """Distance of the scale rings [um] for an error of up to ``largest`` [um]: 10 um as long as that is readable."""
    if RING / 5 <= largest <= 2 * RING:
        return RING
    decade = 10.0 ** math.floor(math.log10(max(largest, 0.1)))
    return next(step for step in (decade, 2 * decade, 5 * decade, 10 * decade) if max(largest, 0.1) <= 1.5 * step)


def polar_ground(axes: Axes, turn: OnCircle, ring: float, rings: int) -> None:
    """Rings every ``ring`` [um], ``rings`` to either side of the programmed circle, and the directions of the plane."""
    gap = RING_GAPS[rings]
    axes.set_aspect("equal", anchor="N")
    axes.set_axis_off()
    for value in (*range(-rings, 0), *range(1, rings + 1)):
        _circle(axes, NOMINAL + value * gap, color=style.GRID, linewidth=0.9)
        _ring_label(axes, NOMINAL + value * gap, minus(f"{value * ring:+g} µm"))
    outer = NOMINAL + 1.16 * gap * rings
    first, second = turn.axes
    for text, x, y in ((f"{first}+", 1, 0), (f"{second}+", 0, 1), (f"{first}−", -1, 0), (f"{second}−", 0, -1)):
        axes.plot([0, outer * x], [0, outer * y], color=style.GRID, linewidth=0.9)
        at = outer + 0.055
        axes.text(x * at, y * at, text, ha="center", va="center", fontweight="bold", fontsize=11)
    _circle(axes, NOMINAL, color=style.MUTED, linewidth=1.1, linestyle=(0, (6, 3)), label="programmed circle")
    axes.set_xlim(-1.12 * outer, 1.12 * outer)
    axes.set_ylim(-1.12 * outer, 1.12 * outer)
    heading(axes, f"Contour error, {first}-{second}, R {turn.radius * 1e3:g} mm")


def polar_curve(axes: Axes, measured: Curve, ring: float, rings: int, **look: Any) -> None:
    """The contour over such a ground, closed where the turn is."""
    gap = RING_GAPS[rings]
    r = NOMINAL + measured.deviation * 1e6 * gap / ring
    rows = thinned(np.arange(len(r), dtype=float), r)[0].astype(int)
    closes = abs(r[-1] - r[0]) < 0.02 * gap  # a turn with the machine's start or stop in it does not
    closed = np.append(rows, rows[0]) if closes else rows
    axes.plot(r[closed] * np.cos(measured.angle[closed]), r[closed] * np.sin(measured.angle[closed]), **look)


def unrolled_curve(axes: Axes, measured: Curve, **look: Any) -> None:
    """The contour over the angle."""
    angle = np.rad2deg(measured.angle % (2 * math.pi))
    order = np.argsort(angle)
    axes.plot(*thinned(angle[order], measured.deviation[order] * 1e6), **look)


def unrolled_ground(axes: Axes, turn: OnCircle) -> None:
    """What such axes need; call when the curves are there."""
    axes.axhline(0.0, color=style.MUTED, linewidth=0.8)
    heading(axes, "Over the angle")
    legend_above(axes)
    axes.set(xlabel=f"angle from {turn.axes[0]}+ [°]", ylabel="radius deviation [µm]", xlim=(0, 360))
    axes.set_xticks(range(0, 361, 90))


def _polar(axes: Axes, turn: Turn, by_scale: Contour, by_tool: Contour | None, ring: float, rings: int) -> None:
    gap = RING_GAPS[rings]
    per_um = gap / ring
    polar_ground(axes, turn, ring, rings)
    _ring_label(axes, _beside_the_curves(per_um, gap, by_scale, by_tool), "0")
    if by_tool is not None:
        polar_curve(axes, by_tool, ring, rings, **TOOL, linewidth=1.2, label="tool point")
    polar_curve(axes, by_scale, ring, rings, color=style.BLUE, linewidth=1.6, label="linear scales")
    for glitch in by_scale.glitches:
        _mark(axes, glitch, gap, per_um)
    axes.text(
        0, 0.22, "quadrant glitches\n(less the median)", color=style.MUTED, ha="center", va="center", fontsize=8.5
    )
    _sense(axes, turn)
    axes.legend(loc="lower left", bbox_to_anchor=(-0.02, -0.02))


def _circle(axes: Axes, radius: float, **look: Any) -> None:
    around = np.linspace(0, 2 * math.pi, 361)
    axes.plot(radius * np.cos(around), radius * np.sin(around), **look)


def _ring_label(axes: Axes, radius: float, text: str) -> None:
    at = radius * math.cos(math.pi / 4)
    axes.text(at, at, text, color=style.MUTED, fontsize=8.5, ha="center", va="center", rotation=-45, bbox=plain_box())


def _beside_the_curves(per_um: float, gap: float, *curves: Contour | None) -> float:
    """Radius for the label of the programmed circle: beside the circle, on the side where no curve is at 45 degrees."""
    near = [
        per_um * 1e6 * curve.deviation[np.abs((curve.angle - math.pi / 4 + math.pi) % (2 * math.pi) - math.pi) < 0.06]
        for curve in curves
        if curve is not None
    ]
    taken = np.concatenate([*near, [0.0]])
    return NOMINAL + max((-0.3 * gap, 0.3 * gap), key=lambda offset: float(np.abs(taken - offset).min()))


def _mark(axes: Axes, glitch: Glitch, gap: float, per_um: float) -> None:
    r = NOMINAL + glitch.deviation * 1e6 * per_um
    x, y = r * math.cos(glitch.angle), r * math.sin(glitch.angle)
    across, up = round(math.cos(glitch.crossing)), round(math.sin(glitch.crossing))
    inside = NOMINAL - 1.16 * gap
    axes.annotate(
        f"{minus(glitch.name)}: {glitch.height * 1e6:.2f} µm", (x, y), xytext=(inside * across, inside * up),
        ha={1: "right", 0: "center", -1: "left"}[across], va={1: "top", 0: "center", -1: "bottom"}[up],
        color=style.INK, bbox=plain_box(), zorder=6,
        arrowprops={"arrowstyle": "-", "color": style.VERMILLION, "linewidth": 0.9, "shrinkA": 2, "shrinkB": 2},
    )  # fmt: skip
    axes.plot([x], [y], "o", color=style.VERMILLION, markersize=5, zorder=7)


def _sense(axes: Axes, turn: Turn) -> None:
    """Arrow in the centre that shows which way the circle is driven."""
    span = np.deg2rad(np.linspace(50, 130, 41))[:: turn.sense]
    radius = 0.16
    x, y = radius * np.cos(span), radius * np.sin(span) - 0.36
    axes.plot(x[:-1], y[:-1], color=style.MUTED, linewidth=1.2)
    axes.annotate(
        "",
        (x[-1], y[-1]),
        xytext=(x[-4], y[-4]),
        arrowprops={"arrowstyle": "-|>", "color": style.MUTED, "linewidth": 1.2},
    )


def _unrolled(axes: Axes, turn: Turn, by_scale: Contour, by_tool: Contour | None) -> None:
    if by_tool is not None:
        unrolled_curve(axes, by_tool, **TOOL, linewidth=1.1, label="tool point")
    unrolled_curve(axes, by_scale, color=style.BLUE, label="scales")
    for glitch in by_scale.glitches:
        at = np.rad2deg(glitch.angle % (2 * math.pi))
        axes.plot([at], [glitch.deviation * 1e6], "o", color=style.VERMILLION, markersize=4)
    axes.axhline(
        by_scale.median * 1e6, color=style.MUTED, linewidth=1.1, linestyle=(0, (1, 2)), label="median (scales)"
    )
    unrolled_ground(axes, turn)


def _table(axes: Axes, turn: Turn, figures: Figures) -> None:
    axes.set_axis_off()
    rows = [
        ("circular deviation G", "G"),
        ("radial deviation F max", "F_max"),
        ("radial deviation F min", "F_min"),
        ("mean radius deviation", "mean"),
        ("median radius deviation", "median"),
        *((f"glitch, {axis} reverses", f"glitch_{axis}") for axis in turn.axes),
    ]
    has_tool = "tool.G" in figures
    heads = [(0.70, "scales")] + ([(0.98, "tool")] if has_tool else [])
    axes.text(0.0, 0.98, "µm", color=style.MUTED, va="top", fontsize=9)
    for x, head in heads:
        axes.text(x, 0.98, head, color=style.MUTED, ha="right", va="top", fontsize=9)
    for k, (label, key) in enumerate(rows):
        y = 0.87 - 0.125 * k
        axes.text(0.0, y, label, va="top", fontsize=9)
        for (x, _), prefix in zip(heads, ("", "tool."), strict=False):
            value = figures[prefix + key].value
            axes.text(x, y, minus(f"{value:.2f}"), ha="right", va="top", fontsize=9)
    axes.set_xlim(0, 1)
    axes.set_ylim(0, 1)


def _torque_row(row: Sequence[Axes], part: Trace, axis: str, sign: int) -> None:
    time_room, speed_room, friction_room = row
    torque, speed = sign * part[f"{axis}.M_a"], part[f"{axis}.n_a"]
    friction: Array | None = sign * part[f"{axis}.M_fr"] if f"{axis}.M_fr" in part.columns else None
    t, m = thinned(part.time, torque)
    time_room.plot(t, m, color=style.BLUE, label="motor $M_a$")
    _loop(speed_room, speed, torque, color=style.BLUE, linewidth=1.1)
    if friction is not None:
        t, f = thinned(part.time, friction)
        time_room.plot(t, f, color=style.VERMILLION, linewidth=1.1, label=r"friction $M_{fr}$")
        _loop(speed_room, speed, friction, color=style.VERMILLION, linewidth=1.1)
        _loop(friction_room, speed, friction, color=style.VERMILLION)
        friction_room.set_ylim(*_symmetric(friction))
        friction_room.set_xlim(*(0.12 * np.array([-1, 1]) * float(np.abs(speed).max() or 1.0)))
    else:
        friction_room.set_visible(False)
    ordinate = torque_label(sign)
    heading(time_room, f"Axis {axis}: torque over time")
    heading(speed_room, "Torque over speed")
    heading(friction_room, "Friction around the reversal")
    time_room.set(xlabel="time [s]", ylabel=ordinate)
    for room in (speed_room, friction_room):
        room.set(xlabel="motor speed $n_a$ [rad/s]", ylabel=ordinate)
    for room in (time_room, speed_room, friction_room):
        room.axhline(0.0, color=style.MUTED, linewidth=0.8)
    for room in (speed_room, friction_room):
        room.axvline(0.0, color=style.MUTED, linewidth=0.8)
    time_room.margins(x=0.01)
    time_room.set_ylim(*_symmetric(torque, friction))
    speed_room.set_ylim(*_symmetric(torque, friction))
    legend_above(time_room)


def _symmetric(*curves: Array | None) -> tuple[float, float]:
    largest = 1.12 * max(float(np.abs(curve).max()) for curve in curves if curve is not None) or 1.0
    return -largest, largest


def _loop(axes: Axes, speed: Array, torque: Array, **look: Any) -> None:
    rows = np.arange(0, len(speed), max(1, len(speed) // style.MOST_POINTS))
    closes = abs(torque[-1] - torque[0]) < 0.02 * float(np.ptp(torque)) and abs(speed[-1] - speed[0]) < 0.02 * float(
        np.ptp(speed)
    )
    rows = np.append(rows, 0) if closes else rows
    axes.plot(speed[rows], torque[rows], **look)
