"""Figures of axes over time: a positioning move with a zoom on its target, and an overview of all."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Protocol

import numpy as np

from feedsim.analysis import Accuracy, Approach, Contour, Diagnosis, Figures, Turn, contour, deviation
from feedsim.analysis.positioning import PLATEAU
from feedsim.files.trace import Trace, release
from feedsim.foundation.errors import InputError
from feedsim.motions.circular import SENSE_WORDS
from feedsim.report.chart import Axis, Band, Chart, Curve, Dash, Level, Mark, Panel, Polar, column_of
from feedsim.report.content import Picture, Section, Table
from feedsim.report.formatting import (
    ALLOWED_COLOUR,
    ALTERNATIVE_COLOUR,
    AT_TOOL,
    BLUE,
    CLOCKWISE,
    FRICTION_COLOUR,
    GREEN,
    INK,
    ORANGE,
    PURPLE,
    RESIDUAL_COLOUR,
    SETPOINT_COLOUR,
    SIMULATED_COLOUR,
    SKY,
    VERMILLION,
    Array,
    display_unit,
    minus,
    number,
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
    return Picture(stem, title, caption, _positioning_chart(trace, approach, figures, band, torque_sign))


def _positioning_chart(trace: Trace, approach: Approach, figures: Figures, band: float, sign: int) -> Chart:
    """Position over time, distance beyond the target about the end of the motion, torque over time."""
    axis = approach.axis
    part = trace.between(approach.start, approach.until)
    end = Level(approach.end, "end of NC motion", upright=True, dash="dotted")
    position = []
    if f"{axis}.x_s" in part.columns:
        position.append(Curve("setpoint x_s", part.time, part[f"{axis}.x_s"] * 1e3, SETPOINT_COLOUR, "dashed", 1.6))
    position.append(Curve(SCALE, part.time, part[f"{axis}.x_a"] * 1e3))
    panels = [
        Panel(f"Position of axis {axis}", TIME, Axis("position", "mm"), position, [end], linked="t"),
        _overshoot_panel(trace, approach, figures, band),
    ]
    if f"{axis}.M_a" in trace.columns:
        curves = [Curve("motor torque M_a", part.time, sign * part[f"{axis}.M_a"])]
        if f"{axis}.M_fr" in part.columns:
            curves.append(
                Curve("friction torque M_fr", part.time, sign * part[f"{axis}.M_fr"], FRICTION_COLOUR, width=1.2)
            )
        levels = [end, Level(0.0, dash="")]
        if approach.steady is not None and math.isfinite(level := _value(figures, "plateau_torque")):
            ends = tuple(approach.steady[0] + share * (approach.steady[1] - approach.steady[0]) for share in PLATEAU)
            text = minus(f"mean at constant speed {sign * level:.2f} N·m")
            levels.append(Level(sign * level, text, colour=INK, dash="dotted", ends=(ends[0], ends[1])))
        note = ", sign reversed" if sign < 0 else ""
        torque = Panel(f"Driving torque of axis {axis}{note}", TIME, Axis("torque", "N·m"), curves, levels, linked="t")
        panels.append(torque)
    return Chart(panels)


def _overshoot_panel(trace: Trace, approach: Approach, figures: Figures, band: float) -> Panel:
    curves = []
    reach = [2.2 * band * 1e6]
    looks: tuple[tuple[str, str, str, Dash], ...] = (
        (TOOL_TITLE, f"tcp.x_{approach.axis}", AT_TOOL, "dashed"),
        (SCALE, f"{approach.axis}.x_a", SIMULATED_COLOUR, ""),
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
        [Band("", -band * 1e6, band * 1e6, colour=ALLOWED_COLOUR)],
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


# --- Figures of a circular test: the magnified contour error, and the torques of the plane's axes over time and
#     speed


RING_SCALE = 10.0  # um; kept as long as the contour error is neither much smaller nor larger
GAP = 5.0  # deg of a turn that is not recorded; curves break there
COLOURS = {1: SIMULATED_COLOUR, -1: CLOCKWISE}  # by the sense of the turn, where there are two
HIGHER = 10e-9  # m; a peak that is higher by less has the same height for a reader


class OnCircle(Protocol):
    """A circle: axes of its plane, radius [m]."""

    @property
    def axes(self) -> tuple[str, str]: ...
    @property
    def radius(self) -> float: ...


def contour_picture(
    trace: Trace, turn: Turn, stem: str, back: Turn | None = None, diagnosis: Diagnosis | None = None
) -> Picture:
    """Contour error of a turn in polar form, magnified, with scale rings and the peaks of the reversals.

    back: the turn in the other sense, which is drawn over it. diagnosis: which has the heights of the peaks over the
    fitted rest of the circle; without it the quadrant glitches are shown.
    """
    by_scale = contour(trace, turn)
    on = circle(turn, float(np.abs(by_scale.deviation).max()))
    curves = []
    tool = (f"tcp.x_{turn.axes[0]}", f"tcp.x_{turn.axes[1]}")
    if all(name in trace.columns for name in tool):
        by_tool = contour(trace, turn, tool)
        curves.append(turn_curve(TOOL_TITLE, AT_TOOL, by_tool.angle, by_tool.deviation, "dashed", 1.2))
    dash: Dash
    over, seen = "", {turn.sense: by_scale}
    if back is None:
        curves.append(turn_curve("linear scales", SIMULATED_COLOUR, by_scale.angle, by_scale.deviation, width=1.6))
    else:
        seen[back.sense] = other = contour(trace, back)
        for sense, own, dash, width in ((turn.sense, by_scale, "", 1.6), (back.sense, other, "dashed", 1.2)):
            name = f"linear scales, {SENSE_WORDS[sense]}"
            curves.append(turn_curve(name, COLOURS[sense], own.angle, own.deviation, dash, width))
        over = f" Dashed: {SENSE_WORDS[back.sense]}, from {back.begin:.4f} to {back.end:.4f} s."
    title = f"Circular test in the plane {turn.axes[0]}-{turn.axes[1]}: contour error"
    caption = (
        f"Radius {turn.radius * 1e3:.6g} mm, {SENSE_WORDS[turn.sense]} from {turn.axes[0]} to {turn.axes[1]}, turn "
        "from "
        f"{turn.begin:.4f} to {turn.end:.4f} s.{over} Radius deviation magnified {on.magnification:,.0f} times; rings "
        f"at ±{on.ring:g} µm about the programmed circle. "
    )
    caption += (
        "The markers show the reversal peaks, over the fitted rest of the circle"
        f"{', in the direction that has the larger peak' if back is not None else ''}."
        if diagnosis is not None
        else "The markers show the quadrant glitches: the largest deviation within ±45° of an axis crossing, less the "
        "median of the turn."
    )
    if diagnosis is not None:
        places = _peaks(diagnosis, seen)
    else:
        places = [(glitch.name, glitch.angle, glitch.deviation, glitch.height) for glitch in by_scale.glitches]
    marks = [
        Mark(angle, deviation * 1e6, f"{minus(name)}: {height * 1e6:.2f} µm", RESIDUAL_COLOUR)
        for name, angle, deviation, height in places
        if height
    ]
    medians = [] if diagnosis is not None else [Level(by_scale.median * 1e6, "median (scales)", dash="dotted")]
    sense = turn.sense if back is None else 0
    note = "quadrant glitches\n(less the median)" if diagnosis is None else ""
    chart = circle_chart(on, curves, marks, medians, sense, note)
    return Picture(stem, title, caption, chart)


def _peaks(diagnosis: Diagnosis, seen: Mapping[int, Contour]) -> list[tuple[str, float, float, float]]:
    """Name of the half axis, angle [rad], deviation [m] and height [m] of the largest peak where each half axis
    reverses, 0 where none stands out; the place is in the first turn, unless the peak of the other one is higher."""
    first = next(iter(seen))
    result = []
    for name in dict.fromkeys(peak.name for peak in diagnosis.peaks):
        own = [peak for peak in diagnosis.peaks if peak.name == name and peak.sense in seen]
        if own:
            place = max(own, key=lambda peak: abs(peak.height) - (0.0 if peak.sense == first else HIGHER))
            turn = seen[place.sense]
            k = int(np.argmin(np.abs((turn.angle - place.angle + math.pi) % (2 * math.pi) - math.pi)))
            height = max((peak.height for peak in own), key=abs)
            result.append((name, float(turn.angle[k]), float(turn.deviation[k]), height))
    return result


def torque_picture(trace: Trace, turn: Turn, signs: Mapping[str, int], stem: str) -> Picture | None:
    """Torques of the plane's axes over time and over speed, during the evaluated turn; None where none is recorded.

    signs: axis -> +-1, display sign of its torques.
    """
    axes = [axis for axis in turn.axes if f"{axis}.M_a" in trace.columns and f"{axis}.n_a" in trace.columns]
    if not axes:
        return None
    row = (trace.time[-1] - trace.time[0]) / (len(trace) - 1)
    part = trace.between(turn.begin, turn.end + row)  # the next row closes the loops
    title = f"Circular test in the plane {turn.axes[0]}-{turn.axes[1]}: driving torque and friction torque"
    caption = (
        f"Turn from {turn.begin:.4f} to {turn.end:.4f} s: over time, over the motor speed, and the friction torque "
        "around the reversal of the motion, where its slope is that of the engaging transmission."
        + reversed_note(axes, signs)
    )
    return Picture(stem, title, caption, _torques(part, axes, signs))


def _torques(part: Trace, axes: Sequence[str], signs: Mapping[str, int]) -> Chart:
    """Torques of a turn over time and over the motor speed, a row per axis."""
    panels = []
    for axis in axes:
        sign, speed = signs.get(axis, 1), part[f"{axis}.n_a"]
        torques = [("motor M_a", sign * part[f"{axis}.M_a"], SIMULATED_COLOUR)]
        if f"{axis}.M_fr" in part.columns:
            torques.append(("friction M_fr", sign * part[f"{axis}.M_fr"], FRICTION_COLOUR))
        ordinate = torque_axis(sign)
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


def circle(on: OnCircle, largest: float) -> Polar:
    """The programmed circle with rings that suit a deviation of up to ``largest`` [m]; no curves."""
    ring = ring_step(largest * 1e6)
    title = f"Contour error, {on.axes[0]}-{on.axes[1]}, R {on.radius * 1e3:g} mm"
    return Polar(title, on.axes, on.radius * 1e3, ring, 1 if largest * 1e6 < 1.1 * ring else 2, ())


def ring_step(largest: float) -> float:
    """Distance of the scale rings [um] for an error of up to ``largest`` [um]: 10 um as long as that is readable."""
    if RING_SCALE / 5 <= largest <= 2 * RING_SCALE:
        return RING_SCALE
    decade = 10.0 ** math.floor(math.log10(max(largest, 0.1)))
    return next(step for step in (decade, 2 * decade, 5 * decade, 10 * decade) if max(largest, 0.1) <= 1.5 * step)


def turn_curve(name: str, colour: str, angle: Array, off: Array, dash: Dash = "", width: float = 1.4) -> Curve:
    """A turn [rad, m] as a curve of a polar panel."""
    return Curve(name, angle, off * 1e6, colour, dash, width)


def circle_chart(
    on: Polar, curves: Sequence[Curve], marks: Sequence[Mark] = (), levels: Sequence[Level] = (), sense: int = 0,
    note: str = "",
) -> Chart:  # fmt: skip
    """Turns about the circle and, beside it, over the angle. on: the circle, without curves."""
    polar = Polar(on.title, on.axes, on.radius, on.ring, on.rings, curves, marks, sense, note)
    return Chart([polar, unrolled_panel(on.axes, curves, marks, levels)], (1.2, 1.0))


def unrolled_panel(
    axes: tuple[str, str], curves: Sequence[Curve], marks: Sequence[Mark], levels: Sequence[Level]
) -> Panel:
    """Turns over the angle [deg]."""
    over = []
    for curve in curves:
        angle = np.rad2deg(curve.x % (2 * math.pi))
        order = np.argsort(angle, kind="stable")
        angle, off = angle[order], curve.y[order]
        gap = int(np.diff(angle, append=angle[-1]).argmax())
        if angle[gap + 1 : gap + 2].size and angle[gap + 1] - angle[gap] > GAP:  # an arc: nothing is drawn across
            angle, off = np.insert(angle, gap + 1, angle[gap]), np.insert(off, gap + 1, math.nan)
        over.append(Curve(curve.name, angle, off, curve.colour, curve.dash, curve.width))
    return Panel(
        "Over the angle",
        Axis(f"angle from {axes[0]}+", "°", span=(0.0, 360.0)),
        Axis("radius deviation", "µm"),
        over,
        [Level(0.0, dash=""), *levels],
        marks=[Mark(math.degrees(mark.x % (2 * math.pi)), mark.y, "", mark.colour) for mark in marks],
        linked="angle",
    )


def _about_zero(reach: float) -> tuple[float, float]:
    return -reach, reach


# --- Positioning accuracy in a report: target by target, as on acceptance sheets, as a picture and as a table ---------


HEADS = (
    "Target [mm]", "Mean upwards [µm]", "s upwards [µm]", "Mean downwards [µm]", "s downwards [µm]", "B [µm]", "R [µm]"
)  # fmt: skip
NOTE = (
    "Deviation of the measured position from the target at the end of each rest: mean and standard deviation s of the "
    "approaches from below (upwards) and from above (downwards), reversal value B and bidirectional repeatability R. "
    "Letters after ISO 230-2."
)
SIDES = (("approached upwards", SIMULATED_COLOUR), ("approached downwards", ALTERNATIVE_COLOUR))


def accuracy_picture(prefix: str, accuracy: Accuracy, stem: str) -> Picture:
    """Deviations over the targets: every reading, means, and two standard deviations to either side of them."""
    x = 1e3 * np.asarray(accuracy.targets)
    readings, mean, s = 1e6 * accuracy.deviations, 1e6 * accuracy.mean, 1e6 * accuracy.s
    runs = readings.shape[2]
    title = f"Positioning accuracy of {prefix}"
    caption = (
        "Deviation of the measured position from its target at the end of each rest, by the linear scale: every "
        "reading, the mean of each side, and the band of two standard deviations about it. "
        f"A {number(accuracy.figures['A'].value, 3)} µm is from the top of the bands to their bottom."
    )
    bands = [
        Band("", middle - 2 * spread, middle + 2 * spread, x, colour)
        for (_, colour), middle, spread in zip(SIDES, mean, s, strict=True)
    ]
    curves = [
        Curve(name, x, middle, colour, dash="dashed" if k else "")
        for k, ((name, colour), middle) in enumerate(zip(SIDES, mean, strict=True))
    ]
    curves += [
        Curve(name, np.repeat(x, runs), own.ravel(), colour, width=2.4, dots=True)
        for (name, colour), own in zip(SIDES, readings, strict=True)
    ]
    reach = 0.03 * float(np.ptp(x))
    low = min(float(np.min(mean - 2 * s)), float(np.min(readings)))
    high = max(float(np.max(mean + 2 * s)), float(np.max(readings)))
    across = Axis("target", "mm", span=(float(x[0]) - reach, float(x[-1]) + reach))
    up = Axis("deviation", "µm", span=(low - 0.05 * (high - low), high + 0.05 * (high - low)))
    panel = Panel("Deviation at the targets", across, up, curves, [Level(0.0, dash="")], bands, height=1.6)
    return Picture(stem, title, caption, Chart([panel]))


def accuracy_section(prefix: str, accuracy: Accuracy, place: str = "") -> Section:
    """Means, standard deviations, reversal value and repeatability of every target. place: "tool" by the tool point."""
    columns = (*np.transpose([accuracy.mean, accuracy.s], (1, 0, 2)).reshape(4, -1), accuracy.B, accuracy.R)
    rows = [
        (f"{1e3 * target:.6g}", *(minus(f"{1e6 * float(column[i]):.3f}") for column in columns))
        for i, target in enumerate(accuracy.targets)
    ]
    by = " by the tool point" if place else ""
    anchor = f"accuracy-{prefix}" + (f"-{place}" if place else "")
    return Section(f"Positioning accuracy of {prefix}{by}", [Table("rrrrrrr", HEADS, rows, NOTE)], anchor)
