"""The pictures of a report on friction compensation."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from feedsim.analysis import Contour, Turn, contour
from feedsim.analysis.circularity import quadrant
from feedsim.analysis.compensation import Compensation
from feedsim.analysis.compensation_errors import Variation
from feedsim.report.chart import Axis, Chart, Curve, Level, Panel, spans
from feedsim.report.formatting import minus
from feedsim.report.picture import Picture
from feedsim.report.run.axis_plots import TIME, reversed_note, torque_axis
from feedsim.report.run.circle_plots import circle, circle_chart, turned
from feedsim.report.style import AFTER, BEFORE, FRICTION, OTHERWISE, Array

TIME_AROUND_REVERSAL = 0.03  # s to either side of a reversal


def pictures_of(compensation: Compensation) -> list[Picture]:
    """Contour, reversals, torques and, where there is a table, what errors cost."""
    turn = compensation.turn
    before, after = (contour(run.trace, turn) for run in (compensation.before, compensation.after))
    plane = f"{turn.axes[0]}-{turn.axes[1]}"
    pictures: list[Picture | None] = [
        _contour_picture(turn, before, after, plane),
        _reversals_picture(turn, before, after, plane),
        _torque_picture(compensation),
    ]
    pictures += [_errors_picture(compensation)] if compensation.table else []
    return [picture for picture in pictures if picture is not None]


def _contour_picture(turn: Turn, before: Contour, after: Contour, plane: str) -> Picture:
    on = circle(turn, float(np.abs(before.deviation).max()))
    title = f"Circular test in the plane {plane}, without and with friction compensation"
    caption = (
        f"Radius {turn.radius * 1e3:.6g} mm, turn from {turn.begin:.4f} to {turn.end:.4f} s, by the linear scales. "
        f"Radius deviation magnified {on.magnification:,.0f} times; rings "
        f"at ±{on.ring:g} µm about the programmed circle."
    )
    curves = [turned(name, colour, value.angle, value.deviation) for name, colour, value in _both(before, after)]
    return Picture("compensation-contour", title, caption, circle_chart(on, curves, sense=turn.sense))


def _both(before: Contour, after: Contour) -> list[tuple[str, str, Contour]]:
    return [("without", BEFORE, before), ("with compensation", AFTER, after)]


def _reversals_picture(turn: Turn, before: Contour, after: Contour, plane: str) -> Picture:
    title = f"Circular test in the plane {plane}: the contour around the reversals"
    caption = (
        "Radius deviation by the linear scales within ±45° of every crossing. Below: the compensated contour "
        "alone, on a scale of its own."
    )
    panels = []
    across = Axis("angle from the crossing", "°", span=(-45.0, 45.0))
    for both in (_both(before, after), _both(before, after)[1:]):
        row = [
            [Curve(name, *_about(value, glitch.crossing), colour) for name, colour, value in both]
            for glitch in before.glitches
        ]
        low, high = spans([curve.y for curves in row for curve in curves]) or (0.0, 1.0)
        more = 0.07 * (high - low) or 1.0
        up = Axis("radius deviation", "µm", span=(low - more, high + more))
        for glitch, curves in zip(before.glitches, row, strict=True):
            heads = f"{minus(glitch.name)}: {f'{glitch.axis} reverses' if len(both) > 1 else 'compensated alone'}"
            panels.append(Panel(heads, across, up, curves, [Level(0.0, dash="")]))
    return Picture("compensation-reversals", title, caption, Chart(panels, (1.0,) * 4))


def _about(measured: Contour, crossing: float) -> tuple[Array, Array]:
    """Angle [deg] and deviation [um] within a quadrant about a crossing."""
    near = quadrant(measured.angle, crossing)
    angle = np.rad2deg((measured.angle[near] - crossing + math.pi) % (2 * math.pi) - math.pi)
    order = np.argsort(angle)
    return angle[order], measured.deviation[near][order] * 1e6


def _torque_picture(compensation: Compensation) -> Picture | None:
    turn, feedforward = compensation.turn, compensation.feedforward
    axes_of = [axis for axis in turn.axes if f"{axis}.M_ff" in feedforward.columns]
    signs = {axis: compensation.scenario.machine.axes[axis].display_sign for axis in axes_of}
    torque = feedforward.between(turn.begin, turn.end)
    if not axes_of:
        return None
    real = compensation.after.trace.between(turn.begin, turn.end)
    title = "Torque feedforward of the friction compensation"
    caption = (
        "Feedforward as it is added to the torque setpoint, and the friction torque of the compensated run. The "
        "feedforward is ahead by the lag of the torque behind its setpoint." + reversed_note(axes_of, signs)
    )
    panels = []
    for axis in axes_of:
        curves = [
            Curve("feedforward M_ff", torque.time, signs[axis] * torque[f"{axis}.M_ff"], OTHERWISE),
            Curve("friction M_fr", real.time, signs[axis] * real[f"{axis}.M_fr"], FRICTION, "dashed"),
        ]
        reversal = _reversal(real.time, real[f"{axis}.n_a"])
        near = Axis("time", "s", span=(reversal - TIME_AROUND_REVERSAL, reversal + TIME_AROUND_REVERSAL))
        ordinate = torque_axis(signs[axis])
        zero = [Level(0.0, dash="")]
        panels += [
            Panel(f"Axis {axis}: torque over the turn", TIME, ordinate, curves, zero, linked="t"),
            Panel("Around a reversal", near, ordinate, curves, zero),
        ]
    return Picture("compensation-torque", title, caption, Chart(panels, (1.5, 1.0)))


def _reversal(time: Array, n: Array) -> float:
    """First instant at which the speed changes its sign within the inner nine tenths of the time, else the middle."""
    begin, end = time[0] + 0.05 * np.ptp(time), time[-1] - 0.05 * np.ptp(time)
    at = time[1:][(np.sign(n[1:]) != np.sign(n[:-1])) & (time[1:] > begin) & (time[1:] < end)]
    return float(at[0]) if at.size else float(time[len(time) // 2])


def _errors_picture(compensation: Compensation) -> Picture:
    by_delay = [variation for variation in compensation.table if variation.what == "delay"]
    others = [variation for variation in compensation.table if variation.what != "delay"]
    names = list(dict.fromkeys(other.what for other in others))

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
    for offset, low, colour in ((0.19, True, OTHERWISE), (-0.19, False, AFTER)):
        chosen = [other for other in others if (other.change < 0) == low]
        x = np.array([value for variation in chosen for value in (0.0, variation.quality.G * 1e6, math.nan)])
        y = np.array([value for variation in chosen for value in (*(2 * [rows[variation.what] + offset]), math.nan)])
        share = next((variation.change for variation in chosen), 0.0)
        curves.append(Curve(minus(f"{share:+.3g} %"), x, y, colour, width=8.0))
    axis = Axis("", names=list(rows), span=(-0.6, len(rows) - 0.4))
    points = [Curve("", np.array(error), np.array(G), AFTER, width=width, dots=width > 2) for width in (1.4, 2.4)]
    G_axis = Axis("circular deviation G", "µm")
    panels = [Panel("Delay", Axis("error of the delay", "ms"), G_axis, points)]
    if others:
        panels.append(Panel("Parameters", G_axis, axis, curves, [without]))
    return Picture("compensation-errors", title, caption, Chart(panels, (1.0,) * len(panels)))


def _by_change(variations: Sequence[Variation], without_error: float) -> tuple[list[float], list[float]]:
    points = sorted(
        [(0.0, without_error), *((variation.change, variation.quality.G * 1e6) for variation in variations)]
    )
    return [change for change, _ in points], [G for _, G in points]
