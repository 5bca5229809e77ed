"""The pictures of a report on friction compensation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from feedsim.analysis import Contour, Turn, contour
from feedsim.analysis.circularity import quadrant
from feedsim.analysis.compensation import Compensation, Variation
from feedsim.report.chart import Axis, Chart, Curve, Level, Panel
from feedsim.report.formatting import minus
from feedsim.report.labels import heading, legend_above, reversed_note, torque_label
from feedsim.report.picture import Picture
from feedsim.report.run import circle_plots
from feedsim.report.run.charts import circle_chart, turned
from feedsim.report.style import BLUE, GREEN, MUTED, ORANGE, VERMILLION, Array, Drawn, drawing, finish, thinned

BEFORE: dict[str, Any] = {"color": VERMILLION, "linewidth": 1.3, "label": "without"}
AFTER: dict[str, Any] = {"color": BLUE, "linewidth": 1.6, "label": "with compensation"}
AROUND = 0.03  # s to either side of a reversal


def pictures_of(compensation: Compensation) -> list[Picture]:
    """Contour, reversals, torques and, where there is a table, what errors cost."""
    turn = compensation.turn
    before, after = (contour(run.trace, turn) for run in (compensation.before, compensation.after))
    plane = f"{turn.axes[0]}-{turn.axes[1]}"
    pictures = [
        _contour_picture(turn, before, after, plane),
        _reversals_picture(turn, before, after, plane),
        _torque_picture(compensation),
    ]
    return [*pictures, _errors_picture(compensation)] if compensation.table else pictures


def _contour_picture(turn: Turn, before: Contour, after: Contour, plane: str) -> Picture:
    on = circle_plots.circle(turn, float(np.abs(before.deviation).max()))
    ring, rings = on.ring, on.rings

    def draw() -> Drawn:
        with drawing(10.0, 6.0) as figure:
            polar, unrolled = figure.subplots(1, 2, width_ratios=[1.35, 1])
            circle_plots.polar_ground(polar, turn, ring, rings)
            for measured, style in ((before, BEFORE), (after, AFTER)):
                circle_plots.polar_curve(polar, measured, ring, rings, **style)
                circle_plots.unrolled_curve(unrolled, measured, **style)
            circle_plots.unrolled_ground(unrolled, turn)
            return finish(figure, "compensation-contour", title, caption)

    title = f"Circular test in the plane {plane}, without and with friction compensation"
    caption = (
        f"Radius {turn.radius * 1e3:.6g} mm, turn from {turn.begin:.4f} to {turn.end:.4f} s, by the linear scales. "
        f"Radius deviation magnified {circle_plots.magnification(on):,.0f} times; rings "
        f"at ±{ring:g} µm about the programmed circle."
    )
    curves = [turned(name, colour, each.angle, each.deviation) for name, colour, each in _both(before, after)]
    return Picture("compensation-contour", title, caption, draw, circle_chart(on, curves, sense=turn.sense))


def _both(before: Contour, after: Contour) -> list[tuple[str, str, Contour]]:
    return [("without", VERMILLION, before), ("with compensation", BLUE, after)]


def _reversals_picture(turn: Turn, before: Contour, after: Contour, plane: str) -> Picture:
    def draw() -> Drawn:
        with drawing(10.0, 6.4) as figure:
            rooms = figure.subplots(2, 4, sharex=True, sharey="row")
            for room, glitch in zip(rooms.T, before.glitches, strict=True):
                for axes, curves in zip(room, (((before, BEFORE), (after, AFTER)), ((after, AFTER),)), strict=True):
                    for measured, style in curves:
                        axes.plot(*_about(measured, glitch.crossing), **style)
                    axes.axhline(0.0, color=MUTED, linewidth=0.8)
                heading(room[0], f"{minus(glitch.name)}: {glitch.axis} reverses")
                room[1].set(xlabel="angle from the crossing [°]")
                room[1].set_xticks((-45, 0, 45))
            legend_above(rooms[0, 0])
            rooms[0, 0].set_ylabel("radius deviation [µm]")
            rooms[1, 0].set_ylabel("with compensation [µm]")
            return finish(figure, "compensation-reversals", title, caption)

    title = f"Circular test in the plane {plane}: the contour around the reversals"
    caption = (
        "Radius deviation by the linear scales within ±45° of every crossing. Below: the compensated contour "
        "alone, on a scale of its own."
    )
    panels = []
    for both in (_both(before, after), _both(before, after)[1:]):
        for glitch in before.glitches:
            curves = []
            for name, colour, each in both:
                angle, deviation = _about(each, glitch.crossing)
                curves.append(Curve(name, angle, deviation, colour))
            heads = f"{minus(glitch.name)}: {glitch.axis} reverses" if len(both) > 1 else "compensated alone"
            axis = Axis("angle from the crossing", "°", span=(-45.0, 45.0))
            panels.append(Panel(heads, axis, Axis("radius deviation", "µm"), curves, [Level(0.0, dash="")]))
    return Picture("compensation-reversals", title, caption, draw, Chart(panels, (1.0,) * 4))


def _about(measured: Contour, crossing: float) -> tuple[Array, Array]:
    """Angle [deg] and deviation [um] within a quadrant about a crossing."""
    near = quadrant(measured.angle, crossing)
    angle = np.rad2deg((measured.angle[near] - crossing + math.pi) % (2 * math.pi) - math.pi)
    order = np.argsort(angle)
    return angle[order], measured.deviation[near][order] * 1e6


def _torque_picture(compensation: Compensation) -> Picture:
    turn, feedforward = compensation.turn, compensation.feedforward
    axes_of = [axis for axis in turn.axes if f"{axis}.M_ff" in feedforward.columns]
    signs = {axis: compensation.scenario.machine.axes[axis].display_sign for axis in axes_of}
    torque = feedforward.between(turn.begin, turn.end)
    real = compensation.after.trace.between(turn.begin, turn.end)

    def draw() -> Drawn:
        with drawing(10.0, 3.4 * max(1, len(axes_of))) as figure:
            rooms = figure.subplots(max(1, len(axes_of)), 2, squeeze=False, width_ratios=[1.5, 1])
            for (whole, near), axis in zip(rooms, axes_of, strict=True):
                sign = signs[axis]
                reversal = _reversal(real.time, real[f"{axis}.n_a"])
                for room in (whole, near):
                    room.plot(
                        *thinned(torque.time, sign * torque[f"{axis}.M_ff"]), color=GREEN, label="feedforward $M_{ff}$"
                    )
                    room.plot(
                        *thinned(real.time, sign * real[f"{axis}.M_fr"]), color=ORANGE, linestyle=(0, (4, 2)),
                        label=r"friction $M_{fr}$",
                    )  # fmt: skip
                    room.axhline(0.0, color=MUTED, linewidth=0.8)
                    room.set(xlabel="time [s]")
                near.set_xlim(reversal - AROUND, reversal + AROUND)
                heading(whole, f"Axis {axis}: torque over the turn")
                heading(near, "Around a reversal")
                legend_above(whole)
                whole.set_ylabel(torque_label(sign))
                whole.margins(x=0.01)
            return finish(figure, "compensation-torque", title, caption)

    title = "Torque feedforward of the friction compensation"
    caption = (
        "Feedforward as it is added to the torque setpoint, and the friction torque of the compensated run. The "
        "feedforward is ahead by the lag of the torque behind its setpoint." + reversed_note(axes_of, signs)
    )
    panels = []
    for axis in axes_of:
        curves = [
            Curve("feedforward M_ff", torque.time, signs[axis] * torque[f"{axis}.M_ff"], GREEN),
            Curve("friction M_fr", real.time, signs[axis] * real[f"{axis}.M_fr"], ORANGE, "dashed"),
        ]
        reversal = _reversal(real.time, real[f"{axis}.n_a"])
        near = Axis("time", "s", span=(reversal - AROUND, reversal + AROUND))
        ordinate = Axis("torque" if signs[axis] > 0 else "torque, sign reversed", "N·m")
        zero = [Level(0.0, dash="")]
        panels += [
            Panel(f"Axis {axis}: torque over the turn", Axis("time", "s"), ordinate, curves, zero, linked="t"),
            Panel("Around a reversal", near, ordinate, curves, zero),
        ]
    return Picture("compensation-torque", title, caption, draw, Chart(panels, (1.5, 1.0)) if panels else None)


def _reversal(time: Array, n: Array) -> float:
    """First instant at which the speed changes its sign within the inner nine tenths of the time, else the middle."""
    begin, end = time[0] + 0.05 * np.ptp(time), time[-1] - 0.05 * np.ptp(time)
    at = time[1:][(np.sign(n[1:]) != np.sign(n[:-1])) & (time[1:] > begin) & (time[1:] < end)]
    return float(at[0]) if at.size else float(time[len(time) // 2])


def _errors_picture(compensation: Compensation) -> Picture:
    by_delay = [each for each in compensation.table if each.what == "delay"]
    others = [each for each in compensation.table if each.what != "delay"]
    names = list(dict.fromkeys(each.what for each in others))

    def draw() -> Drawn:
        with drawing(10.0, 4.6) as figure:
            left, right = figure.subplots(1, 2, width_ratios=[1, 1.1])
            error, G = _by_change(by_delay, compensation.figures["after.G"].value)
            left.plot(error, G, color=BLUE, marker="o", markersize=4)
            left.set(xlabel="error of the delay [ms]", ylabel="circular deviation G [µm]")
            left.set_ylim(bottom=0.0)
            heading(left, "Delay")
            for offset, low, colour in ((0.19, True, VERMILLION), (-0.19, False, BLUE)):
                chosen = {each.what: each for each in others if (each.change < 0) == low}
                widths = [chosen[name].quality.G * 1e6 if name in chosen else 0.0 for name in names]
                share = next((each.change for each in chosen.values()), 0.0)
                right.barh(
                    [-i + offset for i in range(len(names))], widths, height=0.36, color=colour,
                    label=minus(f"{share:+.3g} %"),
                )  # fmt: skip
            right.axvline(compensation.figures["after.G"].value, color=MUTED, linewidth=1.1, linestyle=(0, (1, 2)))
            right.set_yticks([-i for i in range(len(names))], names)
            right.set(xlabel="circular deviation G [µm]")
            heading(right, "Parameters")
            legend_above(right)
            return finish(figure, "compensation-errors", title, caption)

    title = "What errors of the compensation cost"
    caption = (
        "Circular deviation G of the compensated circle when the delay or a parameter of all axes is wrong. "
        "Dotted: without the error. Without compensation G is "
        f"{compensation.figures['before.G'].value:.3g} µm."
    )
    error, G = _by_change(by_delay, compensation.figures["after.G"].value)
    without = Level(compensation.figures["after.G"].value, upright=True, dash="dotted")
    rows = {name: float(i) for i, name in enumerate(reversed(names))}
    curves = []
    for offset, low, colour in ((0.19, True, VERMILLION), (-0.19, False, BLUE)):
        chosen = [each for each in others if (each.change < 0) == low]
        x = np.array([value for each in chosen for value in (0.0, each.quality.G * 1e6, math.nan)])
        y = np.array([value for each in chosen for value in (*(2 * [rows[each.what] + offset]), math.nan)])
        share = next((each.change for each in chosen), 0.0)
        curves.append(Curve(minus(f"{share:+.3g} %"), x, y, colour, width=8.0))
    axis = Axis("", names=list(rows), span=(-0.6, len(rows) - 0.4))
    G_axis = Axis("circular deviation G", "µm")
    panels = [Panel("Delay", Axis("error of the delay", "ms"), G_axis, [Curve("", np.array(error), np.array(G), BLUE)])]
    if others:
        panels.append(Panel("Parameters", G_axis, axis, curves, [without]))
    return Picture("compensation-errors", title, caption, draw, Chart(panels, (1.0,) * len(panels)))


def _by_change(variations: Sequence[Variation], without_error: float) -> tuple[list[float], list[float]]:
    points = sorted([(0.0, without_error), *((each.change, each.quality.G * 1e6) for each in variations)])
    return [change for change, _ in points], [G for _, G in points]
