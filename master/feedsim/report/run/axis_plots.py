"""Figures of axes over time: a positioning move with a zoom on its target, and an overview of all."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from feedsim.analysis import Approach, Figures, deviation
from feedsim.analysis.positioning import PLATEAU
from feedsim.files.trace import Trace, release
from feedsim.foundation.errors import InputError
from feedsim.report.chart import Axis, Band, Chart, Curve, Dash, Level, Mark, Panel, column_of
from feedsim.report.content import Picture
from feedsim.report.formatting import (
    ALLOWED,
    AT_TOOL,
    BLUE,
    FRICTION,
    GREEN,
    INK,
    ORANGE,
    PURPLE,
    RESIDUAL_COLOUR,
    SETPOINT,
    SIMULATED,
    SKY,
    VERMILLION,
    display_unit,
    minus,
)

TIME = Axis("time", "s")
TOOL_TITLE, SCALE = "tool point", "linear scale x_a"
OVERSHOOT_TITLE = "Distance beyond the target"
ZOOM_BEFORE, ZOOM_AFTER = 0.030, 0.400  # s about the end of the NC motion
OF_AXES = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY)
# What the whole run is shown by: signal, title, quantity, unit, factor from SI, whether a display sign turns it over.
RUN_SIGNALS = (
    ("x_a", "Position, from where the run begins", "position", "mm", 1e3, False),
    ("x_e", "Following error", "following error", "µm", 1e6, False),
    ("n_a", "Motor speed", "speed", "rad/s", 1.0, False),
    ("M_a", "Motor torque", "torque", "N·m", 1.0, True),
    ("i_q", "Torque-producing current", "current i_q", "A", 1.0, True),
)


def positioning_picture(
    trace: Trace, approach: Approach, figures: Figures, stem: str, *, band: float = 1e-6, torque_sign: int = 1
) -> Picture:
    """Position over time, overshoot zoom about the target, torque over time, for one axis of one motion.

    figures: those of ``analysis.positioning`` without prefix; torque_sign: +-1, display sign of the torques.
    """
    axis = approach.axis
    has_torque = f"{axis}.M_a" in trace.columns
    title = f"Positioning of axis {axis}: position, overshoot and driving torque"
    caption = (
        f"Axis {axis} from {approach.origin * 1e3:.6g} to {approach.target * 1e3:.6g} mm. "
        "Position over time; distance beyond the target around the end of the NC motion, where the shaded band is "
        f"±{band * 1e6:g} µm and the marker shows the last instant outside it"
    )
    caption += "; motor torque and friction torque over time" if has_torque else ""
    caption += ", both drawn with reversed sign." if has_torque and torque_sign < 0 else "."
    return Picture(stem, title, caption, _positioning(trace, approach, figures, band, torque_sign))


def _positioning(trace: Trace, approach: Approach, figures: Figures, band: float, sign: int) -> Chart:
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
            curves.append(Curve("friction torque M_fr", part.time, sign * part[f"{axis}.M_fr"], FRICTION, width=1.2))
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
    looks: tuple[tuple[str, str, str, Dash], ...] = (
        (TOOL_TITLE, f"tcp.x_{approach.axis}", AT_TOOL, "dashed"),
        (SCALE, f"{approach.axis}.x_a", SIMULATED, ""),
    )
    for name, signal, colour, dash in looks:
        if signal in trace.columns:
            time, beyond = deviation(trace, approach, signal)
            curves.append(Curve(name, (time - approach.end) * 1e3, beyond * 1e6, colour, dash))
    overshoot, settled = _value(figures, "overshoot"), _value(figures, "settling_time")
    reach += [value for value in (overshoot, _value(figures, "tool.overshoot")) if math.isfinite(value)]
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
            marks.append(Mark(settled, side, f"last outside ±{band * 1e6:g} µm: {settled:.1f} ms", RESIDUAL_COLOUR))
        else:
            note = f"still outside ±{band * 1e6:g} µm until {settled:.1f} ms"
    return Panel(
        OVERSHOOT_TITLE,
        Axis("time after the end of the NC motion", "ms", span=(-ZOOM_BEFORE * 1e3, last)),
        Axis("beyond the target" if approach.sense > 0 else "beyond the target, to minus", "µm",
             span=(-1.45 * max(reach), 1.45 * max(reach))),
        curves,
        [Level(0.0, dash=""), Level(0.0, upright=True, dash="dotted")],
        [Band("", -band * 1e6, band * 1e6, colour=ALLOWED)],
        marks,
        note=note,
        height=1.15,
    )  # fmt: skip


def overview_picture(trace: Trace, axes: Iterable[str], signs: Mapping[str, int], stem: str) -> Picture | None:
    """All axes over the whole run; None where nothing of them is recorded.

    signs: axis -> +-1, display sign of its torques.
    """
    shown = [axis for axis in axes if any(f"{axis}.{name}" in trace.columns for name, *_ in RUN_SIGNALS)]
    chart = _whole_run(trace, shown, signs)
    if chart is None:
        return None
    title = "All axes over the whole run"
    caption = (
        "Position, following error (delayed setpoint less measured position), speed, torque and current. Longer curves "
        "are thinned to the extremes of every stretch; result.csv has all rows." + reversed_note(shown, signs)
    )
    return Picture(stem, title, caption, chart)


def _whole_run(trace: Trace, axes: Sequence[str], signs: Mapping[str, int]) -> Chart | None:
    """Position, following error, speed, torque and current of every axis over the whole run; None without any."""
    panels = []
    for signal, title, label, unit, factor, turns in RUN_SIGNALS:
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


def torque_axis(sign: int) -> Axis:
    """Ordinate of torques that are drawn with a display sign, +-1."""
    return Axis("torque" if sign > 0 else "torque, sign reversed", "N·m")


def reversed_note(axes: Iterable[str], signs: Mapping[str, int]) -> str:
    """The end of a caption: axes whose torques are drawn with the display sign -1; empty without any."""
    reversed_ones = [axis for axis in axes if signs.get(axis, 1) < 0]
    return f" Torques of {', '.join(reversed_ones)} are drawn with reversed sign." if reversed_ones else ""


def _value(figures: Figures, name: str) -> float:
    return figures[name].value if name in figures else math.nan


# --- Recorded signals over time, a row of the picture for each unit ---------------------------------------------------


# SI unit -> what signals in it are.
QUANTITIES = {
    "m": "position", "rad/s": "speed", "N.m": "torque", "A": "current", "V": "voltage", "N": "force", "rad": "angle",
    "m/s": "speed", "m/s^2": "acceleration",
}  # fmt: skip
MAX_SIGNALS = 12  # signals in a picture


def signals_picture(trace: Trace, title: str) -> Picture:
    """All columns of a trace, those of one unit together. Raises InputError for more than can be distinguished."""
    if not 0 < len(trace.names) <= MAX_SIGNALS:
        raise InputError(f"{len(trace.names)} signals in one picture; from 1 to {MAX_SIGNALS} can be distinguished")
    curves = {
        name: Curve(name, trace.time, trace[name], OF_AXES[k % len(OF_AXES)], "" if k < len(OF_AXES) else "dashed")
        for k, name in enumerate(trace.names)
    }
    panels = []
    for unit in dict.fromkeys(trace.unit(name) for name in trace.names):
        own = [name for name in trace.names if trace.unit(name) == unit]
        panels.append(
            Panel(
                ", ".join(own),
                TIME,
                Axis(QUANTITIES.get(unit, "value"), display_unit(unit)),
                [curves[name] for name in own],
                linked="t",
            )
        )
    return Picture("signals", title, ", ".join(trace.names), Chart(panels))
