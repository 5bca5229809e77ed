"""The charts of a run as data: a positioning move, a circular test, and all axes over the whole run."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from feedsim.analysis import Approach, Contour, Figures, deviation
from feedsim.analysis.positioning import PLATEAU
from feedsim.report.chart import Axis, Band, Chart, Curve, Dash, Level, Mark, Panel, Polar, column_of
from feedsim.report.formatting import minus
from feedsim.report.style import BLUE, GREEN, INK, ORANGE, PURPLE, SETPOINT, SKY, VERMILLION, Array
from feedsim.trace import Trace, release

TIME = Axis("time", "s")
TOOL, SCALE = "tool point", "linear scale x_a"
ZOOM_BEFORE, ZOOM_AFTER = 0.030, 0.400  # s about the end of the NC motion
OF_AXES = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY)
# What the whole run is shown by: signal, title, quantity, unit, factor from SI, whether a display sign turns it over.
SIGNALS = (
    ("x_a", "Position, from where the run begins", "position", "mm", 1e3, False),
    ("x_e", "Following error", "following error", "µm", 1e6, False),
    ("n_a", "Motor speed", "speed", "rad/s", 1.0, False),
    ("M_a", "Motor torque", "torque", "N·m", 1.0, True),
    ("i_q", "Torque-producing current", "current i_q", "A", 1.0, True),
)


def positioning_chart(trace: Trace, approach: Approach, figures: Figures, band: float, sign: int) -> Chart:
    """Position over time, distance beyond the target about the end of the motion, torque over time."""
    axis = approach.axis
    part = trace.between(approach.start, approach.until)
    end = Level(approach.end, "end of NC motion", upright=True, dash="dotted")
    position = []
    if f"{axis}.x_s" in part.columns:
        position.append(Curve("setpoint x_s", part.time, part[f"{axis}.x_s"] * 1e3, SETPOINT, "dashed", 1.6))
    position.append(Curve(SCALE, part.time, part[f"{axis}.x_a"] * 1e3))
    panels = [
        Panel(f"Position of axis {axis}", TIME, Axis("position", "mm"), position, [end], linked="t"),
        _beyond(trace, approach, figures, band),
    ]
    if f"{axis}.M_a" in trace.columns:
        curves = [Curve("motor torque M_a", part.time, sign * part[f"{axis}.M_a"])]
        if f"{axis}.M_fr" in part.columns:
            curves.append(Curve("friction torque M_fr", part.time, sign * part[f"{axis}.M_fr"], VERMILLION, width=1.2))
        levels = [end, Level(0.0, dash="")]
        if approach.steady is not None and math.isfinite(level := _value(figures, "plateau_torque")):
            ends = tuple(approach.steady[0] + share * (approach.steady[1] - approach.steady[0]) for share in PLATEAU)
            text = minus(f"mean at constant speed {sign * level:.2f} N·m")
            levels.append(Level(sign * level, text, colour=INK, dash="dotted", ends=(ends[0], ends[1])))
        note = ", sign reversed" if sign < 0 else ""
        torque = Panel(f"Driving torque of axis {axis}{note}", TIME, Axis("torque", "N·m"), curves, levels, linked="t")
        panels.append(torque)
    return Chart(panels)


def _beyond(trace: Trace, approach: Approach, figures: Figures, band: float) -> Panel:
    curves = []
    reach = [2.2 * band * 1e6]
    for name, signal, colour, dash in (
        (TOOL, f"tcp.x_{approach.axis}", ORANGE, "dashed"),
        (SCALE, f"{approach.axis}.x_a", BLUE, ""),
    ):
        if signal in trace.columns:
            time, beyond = deviation(trace, approach, signal)
            curves.append(Curve(name, (time - approach.end) * 1e3, beyond * 1e6, colour, dash))  # type: ignore[arg-type]
    overshoot, settled = _value(figures, "overshoot"), _value(figures, "settling_time")
    reach += [each for each in (overshoot, _value(figures, "tool.overshoot")) if math.isfinite(each)]
    marks = []
    x, y = curves[-1].x, curves[-1].y
    if overshoot > 0:
        marks.append(Mark(float(x[y.argmax()]), overshoot, f"overshoot {overshoot:.2f} µm"))
    last = min(ZOOM_AFTER, max(approach.until - approach.end, 0.05)) * 1e3
    note = "settling time not determined" if math.isnan(settled) else ""
    if settled > 0:
        after = min(int(x.searchsorted(settled)), len(y) - 1)
        side = math.copysign(band * 1e6, y[after] or 1.0)
        if settled <= last:
            marks.append(Mark(settled, side, f"last outside ±{band * 1e6:g} µm: {settled:.1f} ms", VERMILLION))
        else:
            note = f"still outside ±{band * 1e6:g} µm until {settled:.1f} ms"
    return Panel(
        "Distance beyond the target",
        Axis("time after the end of the NC motion", "ms", span=(-ZOOM_BEFORE * 1e3, last)),
        Axis("beyond the target" if approach.sense > 0 else "beyond the target, to minus", "µm",
             span=(-1.45 * max(reach), 1.45 * max(reach))),
        curves,
        [Level(0.0, dash=""), Level(0.0, upright=True, dash="dotted")],
        [Band("", -band * 1e6, band * 1e6, colour=GREEN)],
        marks,
        note=note,
        height=1.15,
    )  # fmt: skip


def contour_chart(by_scale: Contour, by_tool: Contour | None, on: Polar, sense: int) -> Chart:
    """Contour error of a turn about the programmed circle and over the angle. on: the circle, without curves."""
    curves: list[tuple[str, Contour, str, Dash, float]] = [("linear scales", by_scale, BLUE, "", 1.6)]
    if by_tool is not None:
        curves.insert(0, (TOOL, by_tool, ORANGE, "dashed", 1.2))
    marks = [
        Mark(glitch.angle, glitch.deviation * 1e6, f"{minus(glitch.name)}: {glitch.height * 1e6:.2f} µm", VERMILLION)
        for glitch in by_scale.glitches
    ]
    drawn = [
        turned(name, colour, each.angle, each.deviation, dash, width) for name, each, colour, dash, width in curves
    ]
    median = Level(by_scale.median * 1e6, "median (scales)", dash="dotted")
    return circle_chart(on, drawn, marks, (median,), sense, "quadrant glitches\n(less the median)")


def turned(name: str, colour: str, angle: Array, off: Array, dash: Dash = "", width: float = 1.4) -> Curve:
    """A turn [rad, m] as a curve of a polar panel."""
    return Curve(name, angle, off * 1e6, colour, dash, width)


def circle_chart(
    on: Polar, curves: Sequence[Curve], marks: Sequence[Mark] = (), levels: Sequence[Level] = (), sense: int = 0,
    note: str = "",
) -> Chart:  # fmt: skip
    """Turns about the circle and, beside it, over the angle. on: the circle, without curves."""
    polar = Polar(on.title, on.axes, on.radius, on.ring, on.rings, curves, marks, sense, note)
    return Chart([polar, unrolled(on.axes, curves, marks, levels)], (1.2, 1.0))


def unrolled(axes: tuple[str, str], curves: Sequence[Curve], marks: Sequence[Mark], levels: Sequence[Level]) -> Panel:
    """Turns over the angle [deg]."""
    over = []
    for each in curves:
        angle = np.rad2deg(each.x % (2 * math.pi))
        order = np.argsort(angle, kind="stable")
        over.append(Curve(each.name, angle[order], each.y[order], each.colour, each.dash, each.width))
    return Panel(
        "Over the angle",
        Axis(f"angle from {axes[0]}+", "°", span=(0.0, 360.0)),
        Axis("radius deviation", "µm"),
        over,
        [Level(0.0, dash=""), *levels],
        marks=[Mark(math.degrees(each.x % (2 * math.pi)), each.y, "", each.colour) for each in marks],
        linked="angle",
    )


def torque_chart(part: Trace, axes: Sequence[str], signs: Mapping[str, int]) -> Chart:
    """Torques of a turn over time and over the motor speed, a row per axis."""
    panels = []
    for axis in axes:
        sign, speed = signs.get(axis, 1), part[f"{axis}.n_a"]
        torques = [("motor M_a", sign * part[f"{axis}.M_a"], BLUE)]
        if f"{axis}.M_fr" in part.columns:
            torques.append(("friction M_fr", sign * part[f"{axis}.M_fr"], VERMILLION))
        ordinate = Axis("torque" if sign > 0 else "torque, sign reversed", "N·m")
        n_a = Axis("motor speed n_a", "rad/s")
        near = Axis(n_a.label, n_a.unit, span=_about_zero(0.12 * float(np.abs(speed).max() or 1.0)))
        zero = [Level(0.0, dash=""), Level(0.0, upright=True, dash="")]
        over = [Curve(name, part.time, torque, colour, width=1.2) for name, torque, colour in torques]
        loops = [Curve(name, speed, torque, colour, width=1.2) for name, torque, colour in torques]
        panels += [
            Panel(f"Axis {axis}: torque over time", TIME, ordinate, over, zero[:1], linked="t"),
            Panel("Torque over speed", n_a, ordinate, loops, zero),
            Panel("Friction around the reversal", near, ordinate, loops[1:] or loops, zero),
        ]
    return Chart(panels, (1.25, 1.0, 1.0))


def whole_run_chart(trace: Trace, axes: Iterable[str], signs: Mapping[str, int]) -> Chart | None:
    """Position, following error, speed, torque and current of every axis over the whole run; None without any."""
    axes = list(axes)
    panels = []
    for signal, title, label, unit, factor, turns in SIGNALS:
        curves = []
        for k, axis in enumerate(axes):
            if f"{axis}.{signal}" in trace.columns:
                scale = factor * (signs.get(axis, 1) if turns else 1)
                y = trace[f"{axis}.{signal}"] - (trace[f"{axis}.x_a"][0] if signal == "x_a" else 0.0)
                curves.append(
                    Curve(f"axis {axis}", trace.time, scale * y, OF_AXES[k % len(OF_AXES)],
                          width=1.2).thinned()
                )  # fmt: skip
                release(trace.time, trace[f"{axis}.{signal}"])
        if curves:
            panels.append(
                Panel(title, TIME, Axis(label, unit), curves, [Level(0.0, dash="")] * (signal != "x_a"), linked="t",
                      height=0.8)
            )  # fmt: skip
    return column_of(panels)


def _about_zero(reach: float) -> tuple[float, float]:
    return -reach, reach


def _value(figures: Figures, name: str) -> float:
    return figures[name].value if name in figures else math.nan
