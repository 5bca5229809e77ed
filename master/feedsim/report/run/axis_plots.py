"""Figures of axes over time: a positioning move with a zoom on its target, and an overview of all."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from feedsim.analysis import Approach, Figures, deviation
from feedsim.analysis.positioning import PLATEAU
from feedsim.report import style
from feedsim.report.labels import (
    beside,
    heading,
    keep_inside,
    legend_above,
    mark_instant,
    place_beside_level,
    reversed_note,
)
from feedsim.report.picture import Picture
from feedsim.report.run.charts import ZOOM_AFTER, ZOOM_BEFORE, positioning_chart, whole_run_chart
from feedsim.report.style import Drawn, drawing, finish, thinned
from feedsim.trace import Trace, release

if TYPE_CHECKING:
    from matplotlib.axes import Axes

END = "end of NC motion"


def positioning_picture(
    trace: Trace, approach: Approach, figures: Figures, stem: str, *, band: float = 1e-6, torque_sign: int = 1
) -> Picture:
    """Position over time, overshoot zoom about the target, torque over time, for one axis of one motion.

    figures: those of ``analysis.positioning`` without prefix; torque_sign: +-1, display sign of the torques.
    """
    axis = approach.axis
    has_torque = f"{axis}.M_a" in trace.columns

    def draw() -> Drawn:
        with drawing(10.0, 7.2 if has_torque else 4.0) as figure:
            rooms = figure.subplot_mosaic(
                [["overview", "zoom"], ["torque", "torque"]] if has_torque else [["overview", "zoom"]],
                width_ratios=[1, 1.25],
            )
            _overview(rooms["overview"], trace, approach)
            _zoom(rooms["zoom"], trace, approach, figures, band)
            if has_torque:
                _torque(rooms["torque"], trace, approach, figures, torque_sign)
            return finish(figure, stem, title, caption)

    title = f"Positioning of axis {axis}: position, overshoot and driving torque"
    caption = (
        f"Axis {axis} from {approach.origin * 1e3:.6g} to {approach.target * 1e3:.6g} mm. "
        "Position over time; distance beyond the target around the end of the NC motion, where the shaded band is "
        f"±{band * 1e6:g} µm and the marker shows the last instant outside it"
    )
    caption += "; motor torque and friction torque over time" if has_torque else ""
    caption += ", both drawn with reversed sign." if has_torque and torque_sign < 0 else "."
    return Picture(stem, title, caption, draw, positioning_chart(trace, approach, figures, band, torque_sign))


def overview_picture(trace: Trace, axes: Iterable[str], signs: Mapping[str, int], stem: str) -> Picture | None:
    """All axes over the whole run; the drawing has a row per axis. None where nothing is recorded.

    signs: axis -> +-1, display sign of its torques.
    """
    shown = [axis for axis in axes if any(f"{axis}.{name}" in trace.columns for name in ("x_a", "x_s", "M_a"))]
    if not shown:
        return None

    def draw() -> Drawn:
        with drawing(10.0, 0.5 + 2.7 * len(shown)) as figure:
            rooms = figure.subplots(len(shown), 3, squeeze=False, sharex=True)
            for (position, error, torque), axis in zip(rooms, shown, strict=True):
                for name, scale, look, label in (
                    ("x_s", 1e3, {"color": style.SETPOINT, "linestyle": (0, (4, 2))}, "setpoint $x_s$"),
                    ("x_a", 1e3, {"color": style.BLUE}, "linear scale $x_a$"),
                ):
                    _curve(position, trace, f"{axis}.{name}", scale, label, look)
                _curve(error, trace, f"{axis}.x_e", 1e6, "", {"color": style.BLUE})
                sign = signs.get(axis, 1)
                _curve(torque, trace, f"{axis}.M_a", sign, "motor $M_a$", {"color": style.BLUE})
                _curve(
                    torque,
                    trace,
                    f"{axis}.M_fr",
                    sign,
                    r"friction $M_{fr}$",
                    {"color": style.VERMILLION, "linewidth": 1.1},
                )
                note = " (sign reversed)" if sign < 0 else ""
                heading(position, f"Axis {axis}: position")
                heading(error, "Following error")
                heading(torque, f"Torque{note}")
                position.set_ylabel("position [mm]")
                error.set_ylabel("following error [µm]")
                torque.set_ylabel("torque [N·m]")
                for room in (position, error, torque):
                    room.margins(x=0.01)
                    if not room.lines:
                        room.set_visible(False)
                for room in (error, torque):
                    room.axhline(0.0, color=style.MUTED, linewidth=0.8)
                for room in (position, torque):
                    if room.get_visible():
                        legend_above(room)
            for room in rooms[-1]:
                room.set_xlabel("time [s]")
            return finish(figure, stem, title, caption)

    title = "All axes over the whole run"
    caption = (
        "Position, following error (delayed setpoint less measured position), speed, torque and current. Longer curves "
        "are thinned to the extremes of every stretch; result.csv has all rows." + reversed_note(shown, signs)
    )
    return Picture(stem, title, caption, draw, whole_run_chart(trace, shown, signs))


def _overview(axes: Axes, trace: Trace, approach: Approach) -> None:
    axis = approach.axis
    part = trace.between(approach.start, approach.until)
    if f"{axis}.x_s" in part.columns:
        t, x = thinned(part.time, part[f"{axis}.x_s"] * 1e3)
        axes.plot(t, x, color=style.SETPOINT, linestyle=(0, (4, 2)), linewidth=1.6, label="setpoint $x_s$")
    t, x = thinned(part.time, part[f"{axis}.x_a"] * 1e3)
    axes.plot(t, x, color=style.BLUE, label="linear scale $x_a$")
    heading(axes, f"Position of axis {axis}")
    axes.set(xlabel="time [s]", ylabel="position [mm]")
    axes.margins(x=0.01)
    mark_instant(axes, approach.end, END)
    legend_above(axes)


def _zoom(axes: Axes, trace: Trace, approach: Approach, figures: Figures, band: float) -> None:
    after_end = 1e3
    series: list[tuple[str, str, Any, str]] = [(f"{approach.axis}.x_a", style.BLUE, "-", "linear scale $x_a$")]
    if f"tcp.x_{approach.axis}" in trace.columns:
        series.insert(0, (f"tcp.x_{approach.axis}", style.ORANGE, (0, (5, 1.5)), "tool point"))
    for name, colour, dashes, label in series:
        time, beyond = deviation(trace, approach, name)
        near = (time >= approach.end - ZOOM_BEFORE) & (time <= approach.end + ZOOM_AFTER)
        t, e = thinned((time[near] - approach.end) * after_end, beyond[near] * 1e6)
        axes.plot(t, e, color=colour, linestyle=dashes, label=label, zorder=3)
    axes.axhspan(-band * 1e6, band * 1e6, color=style.GREEN, alpha=0.16, linewidth=0)
    axes.axhline(0.0, color=style.MUTED, linewidth=0.9)
    axes.axvline(0.0, color=style.MUTED, linewidth=0.9, linestyle=(0, (1, 2)))

    overshoot, settled = figures["overshoot"].value, figures["settling_time"].value
    by_tool = figures["tool.overshoot"].value if "tool.overshoot" in figures else 0.0
    determined = [each for each in (overshoot, by_tool) if math.isfinite(each)]  # neither, where the window is short
    reach = 1.45 * max([*determined, 2.2 * band * 1e6])
    axes.set_ylim(-reach, reach)
    axes.set_xlim(-ZOOM_BEFORE * 1e3, min(ZOOM_AFTER, max(approach.until - approach.end, 0.05)) * 1e3)
    time, beyond = deviation(trace, approach, f"{approach.axis}.x_a")
    if overshoot > 0:
        peak = (float(time[beyond.argmax()]) - approach.end) * 1e3
        axes.plot([peak], [overshoot], "o", color=style.BLUE, markersize=4.5, zorder=4)
        note = axes.annotate(
            f"overshoot {overshoot:.2f} µm", (peak, overshoot), xytext=(10, 5), textcoords="offset points", va="bottom"
        )
        if beside(axes, note, peak, 10) == "right":
            note.set(ha="right", x=-10)
        keep_inside(note)
    after = int(time.searchsorted(approach.end + settled / 1e3)) if math.isfinite(settled) else 0
    _settling(axes, settled, band * 1e6, -1.0 if beyond[min(after, len(beyond) - 1)] < 0 else 1.0)
    ordinate = "beyond the target [µm]" if approach.sense > 0 else "beyond the target, to minus [µm]"
    heading(axes, "Distance beyond the target")
    axes.set(xlabel="time after the end of the NC motion [ms]", ylabel=ordinate)
    legend_above(axes)


def _settling(axes: Axes, settled: float, band: float, side: float) -> None:
    """Mark the last instant ``settled`` [ms] outside ``band`` [um], which is left on ``side`` (+-1)."""
    (begin, end), (low, _) = axes.get_xlim(), axes.get_ylim()
    within = f"±{band:g} µm"
    if 0 < settled <= end:
        right = settled > begin + 0.6 * (end - begin)
        label = axes.annotate(
            f"last outside {within}:\n{settled:.1f} ms", (settled, side * band),
            xytext=(settled + (-0.03 if right else 0.03) * (end - begin), 0.62 * low),
            ha="right" if right else "left", va="center", color=style.INK, zorder=5,
            arrowprops={"arrowstyle": "-|>", "color": style.VERMILLION, "linewidth": 1.1},
        )  # fmt: skip
        keep_inside(label)
        axes.plot([settled], [side * band], "o", color=style.VERMILLION, markersize=5, zorder=5)
    elif settled > end or math.isnan(settled):
        undetermined = "settling time\nnot determined"
        text = undetermined if math.isnan(settled) else f"still outside {within}\nuntil {settled:.1f} ms"
        keep_inside(axes.text(0.98, 0.06, text, transform=axes.transAxes, ha="right", va="bottom", color=style.INK))


def _torque(axes: Axes, trace: Trace, approach: Approach, figures: Figures, sign: int) -> None:
    axis = approach.axis
    part = trace.between(approach.start, approach.until)
    t, torque = thinned(part.time, sign * part[f"{axis}.M_a"])
    axes.plot(t, torque, color=style.BLUE, label="motor torque $M_a$")
    if f"{axis}.M_fr" in part.columns:
        t, friction = thinned(part.time, sign * part[f"{axis}.M_fr"])
        axes.plot(t, friction, color=style.VERMILLION, linewidth=1.2, label=r"friction torque $M_{fr}$")
    axes.axhline(0.0, color=style.MUTED, linewidth=0.8)
    heading(axes, f"Driving torque of axis {axis}" + (" (sign reversed for display)" if sign < 0 else ""))
    axes.set(xlabel="time [s]", ylabel="torque [N·m]")
    axes.margins(x=0.01)
    axes.autoscale_view()
    mark_instant(axes, approach.end, END)
    if approach.steady is not None and "plateau_torque" in figures and math.isfinite(figures["plateau_torque"].value):
        _plateau(axes, approach.steady, sign * figures["plateau_torque"].value)
    legend_above(axes)


def _plateau(axes: Axes, steady: tuple[float, float], level: float) -> None:
    """Mean torque [N.m] at constant speed, with a label close to its line where no curve is."""
    averaged = [steady[0] + share * (steady[1] - steady[0]) for share in PLATEAU]
    axes.plot(averaged, [level, level], color=style.INK, linewidth=1.0, linestyle=(0, (1, 1.5)), zorder=4)
    text = f"mean at constant speed {level:.2f} N·m".replace("-", "−")
    label = axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center")
    place_beside_level(axes, label, sum(averaged) / 2, level)


def _curve(axes: Axes, trace: Trace, name: str, scale: float, label: str, look: Mapping[str, Any]) -> None:
    if name in trace.columns:
        t, y = thinned(trace.time, trace[name])
        release(trace.time, trace[name])
        axes.plot(t, scale * y, label=label, **look)
