"""Figures of a positioning move: position with a zoom on the target, and the torque that it took."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from feedsim.analysis import Approach, Figures, deviation
from feedsim.report.style import (
    BLUE,
    GREEN,
    INK,
    MUTED,
    ORANGE,
    SETPOINT,
    VERMILLION,
    Picture,
    drawing,
    finish,
    thinned,
)
from feedsim.trace import Trace

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ZOOM_BEFORE, ZOOM_AFTER = 0.030, 0.400  # s about the end of the NC motion


def positioning_picture(
    trace: Trace, approach: Approach, figures: Figures, stem: str, *, band: float = 1e-6, torque_sign: int = 1
) -> Picture:
    """Position over time, overshoot zoom about the target, torque over time, for one axis of one motion.

    figures: those of ``analysis.positioning`` without prefix; torque_sign: +-1, display sign of the torques.
    """
    axis = approach.axis
    has_torque = f"{axis}.M_a" in trace.columns
    with drawing(10.0, 7.2 if has_torque else 4.0) as figure:
        rooms = figure.subplot_mosaic(
            [["overview", "zoom"], ["torque", "torque"]] if has_torque else [["overview", "zoom"]],
            width_ratios=[1, 1.25],
        )
        _overview(rooms["overview"], trace, approach)
        _zoom(rooms["zoom"], trace, approach, figures, band)
        if has_torque:
            _torque(rooms["torque"], trace, approach, figures, torque_sign)
        title = f"Positioning of axis {axis}: position, overshoot and driving torque"
        caption = (
            f"Axis {axis} from {approach.origin * 1e3:.6g} to {approach.target * 1e3:.6g} mm. "
            "Top left: position over time. "
            "Top right: distance beyond the target around the end of the NC motion; the shaded band is "
            f"±{band * 1e6:g} µm, the marker shows the last instant outside it. "
        )
        if has_torque:
            caption += "Bottom: motor torque and friction torque over time" + (
                ", both drawn with reversed sign." if torque_sign < 0 else "."
            )
        return finish(figure, stem, title, caption)


def _overview(axes: Axes, trace: Trace, approach: Approach) -> None:
    axis = approach.axis
    part = trace.between(approach.start, approach.until)
    if f"{axis}.x_s" in part.columns:
        t, x = thinned(part.time, part[f"{axis}.x_s"] * 1e3)
        axes.plot(t, x, color=SETPOINT, linestyle=(0, (4, 2)), linewidth=1.6, label="setpoint $x_s$")
    t, x = thinned(part.time, part[f"{axis}.x_a"] * 1e3)
    axes.plot(t, x, color=BLUE, label="linear scale $x_a$")
    _end_of_motion(axes, approach.end, 0.06 if approach.sense > 0 else 0.9)
    axes.set(title=f"Position of axis {axis}", xlabel="time [s]", ylabel="position [mm]")
    axes.margins(x=0.01)
    axes.legend(loc="upper left" if approach.sense > 0 else "lower left")


def _zoom(axes: Axes, trace: Trace, approach: Approach, figures: Figures, band: float) -> None:
    after_end = 1e3
    series: list[tuple[str, str, Any, str]] = [(f"{approach.axis}.x_a", BLUE, "-", "linear scale $x_a$")]
    if f"tcp.x_{approach.axis}" in trace.columns:
        series.insert(0, (f"tcp.x_{approach.axis}", ORANGE, (0, (5, 1.5)), "tool point"))
    for name, colour, dashes, label in series:
        time, beyond = deviation(trace, approach, name)
        near = (time >= approach.end - ZOOM_BEFORE) & (time <= approach.end + ZOOM_AFTER)
        t, e = thinned((time[near] - approach.end) * after_end, beyond[near] * 1e6)
        axes.plot(t, e, color=colour, linestyle=dashes, label=label, zorder=3)
    axes.axhspan(-band * 1e6, band * 1e6, color=GREEN, alpha=0.16, linewidth=0)
    axes.axhline(0.0, color=MUTED, linewidth=0.9)
    axes.axvline(0.0, color=MUTED, linewidth=0.9, linestyle=(0, (1, 2)))

    overshoot, settled = figures["overshoot"].value, figures["settling_time"].value
    by_tool = figures["tool.overshoot"].value if "tool.overshoot" in figures else 0.0
    reach = max(1.45 * max(overshoot, by_tool), 3.2 * band * 1e6)
    axes.set_ylim(-reach, reach)
    axes.set_xlim(-ZOOM_BEFORE * 1e3, min(ZOOM_AFTER, max(approach.until - approach.end, 0.05)) * 1e3)
    time, beyond = deviation(trace, approach, f"{approach.axis}.x_a")
    if overshoot > 0:
        peak = (float(time[beyond.argmax()]) - approach.end) * 1e3
        axes.plot([peak], [overshoot], "o", color=BLUE, markersize=4.5, zorder=4)
        axes.annotate(
            f"overshoot {overshoot:.2f} µm", (peak, overshoot), xytext=(10, 5), textcoords="offset points", va="bottom"
        )
    if math.isfinite(settled) and settled > 0:
        side = -1.0 if beyond[min(int(time.searchsorted(approach.end + settled / 1e3)), len(beyond) - 1)] < 0 else 1.0
        axes.annotate(
            f"last outside ±{band * 1e6:g} µm:\n{settled:.1f} ms",
            (settled, side * band * 1e6),
            xytext=(settled + 14, -0.62 * reach),
            va="center",
            color=INK,
            arrowprops={"arrowstyle": "-|>", "color": VERMILLION, "linewidth": 1.1},
            zorder=5,
        )
        axes.plot([settled], [side * band * 1e6], "o", color=VERMILLION, markersize=5, zorder=5)
    ordinate = "beyond the target [µm]" if approach.sense > 0 else "beyond the target, to minus [µm]"
    axes.set(title="Distance beyond the target", xlabel="time after the end of the NC motion [ms]", ylabel=ordinate)
    axes.legend(loc="upper right")


def _torque(axes: Axes, trace: Trace, approach: Approach, figures: Figures, sign: int) -> None:
    axis = approach.axis
    part = trace.between(approach.start, approach.until)
    t, torque = thinned(part.time, sign * part[f"{axis}.M_a"])
    axes.plot(t, torque, color=BLUE, label="motor torque $M_a$")
    if f"{axis}.M_fr" in part.columns:
        t, friction = thinned(part.time, sign * part[f"{axis}.M_fr"])
        axes.plot(t, friction, color=VERMILLION, linewidth=1.2, label=r"friction torque $M_{fr}$")
    axes.axhline(0.0, color=MUTED, linewidth=0.8)
    _end_of_motion(axes, approach.end, 0.06)
    if approach.steady is not None and "plateau_torque" in figures and math.isfinite(figures["plateau_torque"].value):
        level = sign * figures["plateau_torque"].value
        axes.annotate(
            f"mean at constant speed {level:.2f} N·m".replace("-", "−"),
            ((approach.steady[0] + approach.steady[1]) / 2, level),
            xytext=(0, 16 if level >= 0 else -16),
            textcoords="offset points",
            ha="center",
            va="bottom" if level >= 0 else "top",
        )
    axes.set(
        title=f"Driving torque of axis {axis}" + (" (sign reversed for display)" if sign < 0 else ""),
        xlabel="time [s]",
        ylabel="torque [N·m]",
    )
    axes.margins(x=0.01)
    axes.legend(loc="upper right", ncols=2)


def _end_of_motion(axes: Axes, end: float, height: float) -> None:
    axes.axvline(end, color=MUTED, linewidth=0.9, linestyle=(0, (1, 2)))
    axes.annotate(
        "end of NC motion",
        (end, height),
        xycoords=("data", "axes fraction"),
        xytext=(5, 0),
        textcoords="offset points",
        color=MUTED,
        fontsize=9,
    )
