"""The pictures of a report on an identification; those of stage 1 are in stribeck_plots."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from feedsim.estimation.interval import NORMAL_95
from feedsim.identify import Identified
from feedsim.identify.result import Balance, Correlation, Dynamic, Identification, Stretch
from feedsim.report.chart import Axis, Chart, Curve, Grid, Level, Panel
from feedsim.report.formatting import counted
from feedsim.report.identify.stribeck_plots import (
    SPEED_AXIS,
    TIME_AXIS,
    TORQUE_AXIS,
    ZERO,
    plateaus_picture,
    stribeck_picture,
)
from feedsim.report.picture import Picture
from feedsim.report.style import (
    BLUE,
    GREEN,
    MUTED,
    ORANGE,
    OTHERWISE,
    PURPLE,
    RECORDED,
    SIMULATED,
    VERMILLION,
    Array,
)

MOST_LOOPS = 6
COLUMNS = 3
LONG_TRAVEL = 2e-3  # [m] of travel from which positions are shown in mm
COLOURS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, MUTED)
ZEROS = (ZERO, Level(0.0, upright=True, dash=""))
MOST_RECORDS = 3  # in open loop, side by side
STRONG = 0.9  # correlation that is printed bold
Over = Literal["speed", "position"]


def pictures_of(identified: Identified) -> list[Picture]:
    """All pictures that the stages give."""
    identification = identified.found
    pictures: list[Picture | None] = []
    if (stage := identification.stationary) is not None:
        pictures += [
            stribeck_picture(identification, stage),
            plateaus_picture(identification, stage, identified.records),
        ]
    if (dynamic := identification.dynamic) is not None:
        pictures += [
            loops_picture(identification, dynamic, "speed"),
            loops_picture(identification, dynamic, "position"),
        ]
        pictures.append(residuals_picture(identification, dynamic))
    if identification.balance is not None:
        pictures.append(open_loop_picture(identification, identification.balance))
    pictures.append(correlation_picture(identification.axis, identification.correlation))
    return [picture for picture in pictures if picture is not None]


def loops_picture(identification: Identification, stage: Dynamic, over: Over) -> Picture | None:
    """Measured and model torque of each move, over speed or over position; None where there is no stretch."""
    shown = _distinct(stage.stretches)
    if not shown:
        return None
    columns = 2 if len(shown) == 4 else min(COLUMNS, len(shown))
    remaining = len(stage.stretches) - len(shown)
    more = f" {counted(remaining, 'further stretch is', 'further stretches are')} not shown." if remaining else ""
    about = ", about its middle" if over == "position" else ""
    caption = (
        f"Axis {identification.axis}: motor torque less inertia and known load{about}, with the friction model driven "
        f"by the recorded motion.{more}"
    )
    panels = []
    for stretch in shown:
        x, axis = _abscissa(stretch, identification.I_P, over)
        curves = [
            Curve("measured", x, stretch.measured, RECORDED, width=1.9, dots=True, most=2000),
            Curve("model", x, stretch.model, SIMULATED, width=1.2, most=2000),
        ]
        panels.append(Panel(describe(stretch, identification.I_P), axis, TORQUE_AXIS, curves, ZEROS))
    chart = Chart(panels, (1.0,) * columns)
    return Picture(f"loops-{over}", f"Friction torque over {over}", caption, chart)


def _abscissa(stretch: Stretch, I_P: float, over: Over) -> tuple[Array, Axis]:
    if over == "speed":
        return stretch.speed, SPEED_AXIS
    scale, unit = _length([stretch], I_P)
    return _position(stretch, scale), Axis("position", unit)


def residuals_picture(identification: Identification, stage: Dynamic) -> Picture | None:
    """Measured less model: over time, over speed and over position."""
    stretches = [stretch for stretch in stage.stretches if len(stretch.time)]
    if not stretches:
        return None
    caption = (
        "What the friction model leaves over. Dashed: 95 % of the scatter that the fit reckoned with. Structure "
        "over speed or position is what the model does not know."
    )
    scale, unit = _length(stretches, identification.I_P)
    few = len(stretches) <= len(COLOURS)
    names = [describe(stretch, identification.I_P) if few else "stretches" for stretch in stretches]
    colours = [COLOURS[k % len(COLOURS)] for k in range(len(stretches))]
    begin, over_time, levels, over_speed, over_position = 0.0, [], [ZERO], [], []
    residual = Axis("residual", "N·m")
    for stretch, name, colour in zip(stretches, names, colours, strict=True):
        remaining = stretch.measured - stretch.model
        time = stretch.time - stretch.time[0] + begin
        over_time.append(Curve(name, time, remaining, colour, width=0.9))
        for sign in (1, -1):
            level = sign * NORMAL_95 * stretch.weight
            levels.append(Level(level, ends=(float(time[0]), float(time[-1]))))
        over_speed.append(Curve(name, stretch.speed, remaining, colour, width=1.0, dots=True, most=1500))
        over_position.append(Curve(name, _position(stretch, scale), remaining, colour, width=1.0, dots=True, most=1500))
        begin = float(time[-1])
    time_axis = Axis("time, stretches one after another", "s")
    chart = Chart([
        Panel(f"Measured less model, {stage.rms:.2g} N·m rms", time_axis, residual, over_time, levels),
        Panel("Over speed", SPEED_AXIS, residual, over_speed, [ZERO]),
        Panel("Over position", Axis("position about the middle of the move", unit), residual, over_position, [ZERO]),
    ])  # fmt: skip
    return Picture("residuals", "Residuals", caption, chart)


def open_loop_picture(identification: Identification, balance: Balance) -> Picture | None:
    """Position and its error over time, before and after, a column per record; None where nothing was tried."""
    drifts = balance.drifts[:MOST_RECORDS]
    if not drifts:
        return None
    mm = 1e3 * identification.I_P
    before, end = (mm * rms for rms in balance.position)
    remaining = len(balance.drifts) - len(drifts)
    more = f" {counted(remaining, 'further record is', 'further records are')} not shown." if remaining else ""
    fate = "" if balance.applied else " What was tried was not taken."
    caption = (
        f"Axis {identification.axis}: position from the start on, recorded and of a rigid axis that the recorded "
        f"torque drives against this friction: off by {before:.3g} mm rms before the step, {end:.3g} mm "
        f"{'after it' if balance.applied else 'with what it tried'}.{fate}{more}"
    )
    after = "open loop, after" if balance.applied else "open loop, tried"
    above, below = [], []
    for k, drift in enumerate(drifts):
        position = [
            Curve("recorded", drift.time, mm * drift.angle, RECORDED, width=1.6),
            Curve("open loop, before", drift.time, mm * (drift.angle - drift.before), OTHERWISE, "dashed", 1.1),
            Curve(after, drift.time, mm * (drift.angle - drift.after), SIMULATED, width=1.1),
        ]
        error = [
            Curve("open loop, before", drift.time, mm * drift.before, OTHERWISE, "dashed", 1.1),
            Curve(after, drift.time, mm * drift.after, SIMULATED, width=1.1),
        ]
        above.append(Panel(drift.record, TIME_AXIS, Axis("position", "mm"), position, linked=f"t{k}"))
        below.append(
            Panel("", TIME_AXIS, Axis("recorded less open loop", "mm"), error, [ZERO], linked=f"t{k}", height=0.8)
        )
    return Picture("open-loop", "Position in open loop", caption, Chart([*above, *below], (1.0,) * len(drifts)))


def correlation_picture(axis: str, correlation: Correlation) -> Picture | None:
    """The matrix, without its diagonal, which says nothing; None where nothing was estimated."""
    names = correlation.names
    if len(names) < 2:
        return None
    caption = (
        "Blue: two parameters err in the same direction, vermillion: in opposite ones. Close to ±1 (bold from "
        f"{STRONG:g}) the data determine a combination of both rather than each; the curve can be sure all "
        "the same. Empty: not known."
    )
    matrix = np.array(correlation.matrix, dtype=float)
    np.fill_diagonal(matrix, np.nan)
    title = f"Axis {axis}: correlation of the parameters"
    grid = Grid(title, names, names, matrix, (-1.0, 1.0), 2, np.abs(matrix) >= STRONG)
    return Picture("correlation", "Correlation matrix", caption, Chart([grid]))


def describe(stretch: Stretch, I_P: float) -> str:
    """ "20 µm, 5 Hz", or the range of a motion that is no sine."""
    amplitude = stretch.amplitude * I_P
    length = f"{amplitude * 1e6:.3g} µm" if amplitude < 1e-3 else f"{amplitude * 1e3:.3g} mm"
    if stretch.kind == "sine" and math.isfinite(stretch.frequency):
        return f"{length}, {stretch.frequency:.3g} Hz"
    return f"motion of ±{length}"


def _distinct(stretches: Sequence[Stretch]) -> list[Stretch]:
    """The first of each amplitude and frequency, sines first; MOST_LOOPS at most."""
    once: dict[tuple[str, float, float], Stretch] = {}
    for stretch in sorted(stretches, key=lambda s: s.kind != "sine"):
        frequency = round(stretch.frequency, 1) if math.isfinite(stretch.frequency) else 0.0
        once.setdefault((stretch.kind, float(f"{stretch.amplitude:.1g}"), frequency), stretch)
    return list(once.values())[:MOST_LOOPS]


def _position(stretch: Stretch, scale: float) -> Array:
    """About the middle of the move; scale: display unit per radian."""
    middle = (stretch.angle.max() + stretch.angle.min()) / 2
    return np.asarray((stretch.angle - middle) * scale)


def _length(stretches: Sequence[Stretch], I_P: float) -> tuple[float, str]:
    """Display unit of positions per radian, and its name: um, or mm for long moves."""
    longest = max(float(np.ptp(stretch.angle)) for stretch in stretches) * I_P
    return (1e6 * I_P, "µm") if longest < LONG_TRAVEL else (1e3 * I_P, "mm")
