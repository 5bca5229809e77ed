"""The pictures of a report on an identification; those of stage 1 are in stribeck_plots."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from feedsim.identify import Identified
from feedsim.identify.result import NORMAL_95, Balance, Correlation, Dynamic, Identification, Stretch
from feedsim.report import style
from feedsim.report.chart import Axis
from feedsim.report.formatting import counted
from feedsim.report.identify.charts import SPEED, correlation_chart, loops_chart, open_loop_chart, residuals_chart
from feedsim.report.identify.quantities import symbol
from feedsim.report.identify.stribeck_plots import plateaus_picture, stribeck_picture
from feedsim.report.labels import heading, legend_above
from feedsim.report.picture import Picture
from feedsim.report.style import Array, Drawn, drawing, finish, thinned

MOST_LOOPS = 6
COLUMNS = 3
LONG = 2e-3  # [m] of travel from which positions are shown in mm
COLOURS = (style.BLUE, style.VERMILLION, style.GREEN, style.PURPLE, style.ORANGE, style.MUTED)
MOST_RECORDS = 3  # in open loop, side by side
STRONG = 0.9  # correlation that is printed bold
Over = Literal["speed", "position"]


def pictures_of(identified: Identified) -> list[Picture]:
    """All pictures that the stages give."""
    found = identified.found
    pictures: list[Picture | None] = []
    if (stage := found.stationary) is not None:
        pictures += [stribeck_picture(found, stage), plateaus_picture(found, stage, identified.records)]
    if (dynamic := found.dynamic) is not None:
        pictures += [loops_picture(found, dynamic, "speed"), loops_picture(found, dynamic, "position")]
        pictures.append(residuals_picture(found, dynamic))
    if found.balance is not None:
        pictures.append(open_loop_picture(found, found.balance))
    pictures.append(correlation_picture(found.axis, found.correlation))
    return [picture for picture in pictures if picture is not None]


def loops_picture(found: Identification, stage: Dynamic, over: Over) -> Picture | None:
    """Measured and model torque of each move, over speed or over position; None where there is no stretch."""
    shown = _distinct(stage.stretches)
    if not shown:
        return None
    columns = 2 if len(shown) == 4 else min(COLUMNS, len(shown))
    rows = math.ceil(len(shown) / columns)

    def draw() -> Drawn:
        with drawing({1: 5.5, 2: 8.0, 3: 10.2}[columns], 0.8 + 3.1 * rows) as figure:
            rooms = figure.subplots(rows, columns, squeeze=False).ravel()
            for room in rooms[len(shown) :]:
                room.set_visible(False)
            for k, (room, stretch) in enumerate(zip(rooms, shown, strict=False)):
                scale, unit = _length([stretch], found.I_P)
                abscissa = stretch.speed if over == "speed" else _position(stretch, scale)
                room.plot(
                    abscissa, stretch.measured, ".", color=style.BLUE, markersize=2.2, label="measured", rasterized=True
                )
                room.plot(abscissa, stretch.model, color=style.VERMILLION, linewidth=1.0, label="model")
                room.axhline(0.0, color=style.MUTED, linewidth=0.8)
                room.axvline(0.0, color=style.MUTED, linewidth=0.8)
                heading(room, describe(stretch, found.I_P))
                room.set_xlabel("motor speed [rad/s]" if over == "speed" else f"position [{unit}]")
                if k % columns == 0:
                    room.set_ylabel("friction torque [N·m]")
                legend_above(room)
            return finish(figure, f"loops-{over}", f"Friction torque over {over}", caption)

    left = len(stage.stretches) - len(shown)
    more = f" {counted(left, 'further stretch is', 'further stretches are')} not shown." if left else ""
    about = ", about its middle" if over == "position" else ""
    caption = (
        f"Axis {found.axis}: motor torque less inertia and known load{about}, with the friction model driven by "
        f"the recorded motion.{more}"
    )
    chart = loops_chart(
        shown,
        [_abscissa(stretch, found.I_P, over) for stretch in shown],
        lambda each: describe(each, found.I_P),
        columns,
    )
    return Picture(f"loops-{over}", f"Friction torque over {over}", caption, draw, chart)


def _abscissa(stretch: Stretch, I_P: float, over: Over) -> tuple[Array, Axis]:
    if over == "speed":
        return stretch.speed, SPEED
    scale, unit = _length([stretch], I_P)
    return _position(stretch, scale), Axis("position", unit)


def residuals_picture(found: Identification, stage: Dynamic) -> Picture | None:
    """Measured less model: over time, over speed and over position."""
    stretches = [stretch for stretch in stage.stretches if len(stretch.time)]
    if not stretches:
        return None

    def draw() -> Drawn:
        with drawing(10.0, 5.6) as figure:
            grid = figure.add_gridspec(2, 2)
            time, speed, position = (figure.add_subplot(grid[0, :]), figure.add_subplot(grid[1, 0]),
                                     figure.add_subplot(grid[1, 1]))  # fmt: skip
            begin, borders = 0.0, []
            scale, unit = _length(stretches, found.I_P)
            for k, stretch in enumerate(stretches):
                colour = COLOURS[k % len(COLOURS)]
                left = stretch.measured - stretch.model
                t, e = thinned(stretch.time - stretch.time[0] + begin, left)
                label = describe(stretch, found.I_P) if len(stretches) <= len(COLOURS) else None
                time.plot(t, e, color=colour, linewidth=0.8, label=label)
                ends = [begin, begin + stretch.time[-1] - stretch.time[0]]
                for sign in (1, -1):
                    level = sign * NORMAL_95 * stretch.weight
                    time.plot(ends, [level, level], color=style.MUTED, linewidth=0.9, linestyle=(0, (4, 2)))
                dots: dict[str, Any] = {"color": colour, "markersize": 2.0, "rasterized": True}
                speed.plot(stretch.speed, left, ".", **dots)
                position.plot(_position(stretch, scale), left, ".", **dots)
                begin = ends[1]
                borders.append(begin)
            for border in borders[:-1]:
                time.axvline(border, color=style.MUTED, linewidth=0.6)
            for room in (time, speed, position):
                room.axhline(0.0, color=style.MUTED, linewidth=0.8)
                room.set_ylabel("residual [N·m]")
            time.margins(x=0.01)
            heading(time, f"Axis {found.axis}: measured less model, {stage.rms:.2g} N·m rms")
            if len(stretches) <= len(COLOURS):
                legend_above(time)
            time.set_xlabel("time, stretches one after another [s]")
            speed.set_xlabel("motor speed [rad/s]")
            position.set_xlabel(f"position about the middle of the move [{unit}]")
            speed.set_title("Over speed")
            position.set_title("Over position")
            return finish(figure, "residuals", "Residuals", caption)

    caption = (
        "What the friction model leaves over. Dashed: 95 % of the scatter that the fit reckoned with. Structure "
        "over speed or position is what the model does not know."
    )
    scale, unit = _length(stretches, found.I_P)
    few = len(stretches) <= len(COLOURS)
    names = [describe(each, found.I_P) if few else "stretches" for each in stretches]
    colours = [COLOURS[k % len(COLOURS)] for k in range(len(stretches))]
    chart = residuals_chart(stretches, [_position(each, scale) for each in stretches], unit, names, colours)
    return Picture("residuals", "Residuals", caption, draw, chart)


def open_loop_picture(found: Identification, balance: Balance) -> Picture | None:
    """Position and its error over time, before and after, a column per record; None where nothing was tried."""
    drifts = balance.drifts[:MOST_RECORDS]
    if not drifts:
        return None
    mm = 1e3 * found.I_P
    after = "after" if balance.applied else "tried"

    def draw() -> Drawn:
        with drawing({1: 9.0, 2: 10.0}.get(len(drifts), 11.0), 5.6) as figure:
            rooms = figure.subplots(2, len(drifts), sharex="col", squeeze=False)
            for k, drift in enumerate(drifts):
                position, error = rooms[:, k]
                time, angle, first, last = thinned(drift.time, drift.angle, drift.before, drift.after)
                position.plot(time, mm * angle, color=style.INK, linewidth=1.6, label="recorded")
                position.plot(time, mm * (angle - first), color=style.BLUE, linewidth=1.0, label="open loop, before")
                dashed = {"color": style.VERMILLION, "linewidth": 1.1, "linestyle": (0, (4, 2))}
                position.plot(time, mm * (angle - last), label=f"open loop, {after}", **dashed)
                error.plot(time, mm * first, color=style.BLUE, linewidth=1.0, label="before")
                error.plot(time, mm * last, color=style.VERMILLION, linewidth=1.1, label=after)
                error.axhline(0.0, color=style.MUTED, linewidth=0.8)
                heading(position, drift.record)
                legend_above(position)
                legend_above(error)
                error.set_xlabel("time [s]")
            rooms[0, 0].set_ylabel("position [mm]")
            rooms[1, 0].set_ylabel("recorded less open loop [mm]")
            return finish(figure, "open-loop", "Position in open loop", caption)

    before, end = (mm * rms for rms in balance.position)
    left = len(balance.drifts) - len(drifts)
    more = f" {counted(left, 'further record is', 'further records are')} not shown." if left else ""
    fate = "" if balance.applied else " What was tried was not taken."
    caption = (
        f"Axis {found.axis}: position from the start on, recorded and of a rigid axis that the recorded torque "
        f"drives against this friction: off by {before:.3g} mm rms before the step, {end:.3g} mm "
        f"{'after it' if balance.applied else 'with what it tried'}.{fate}{more}"
    )
    return Picture("open-loop", "Position in open loop", caption, draw, open_loop_chart(drifts, balance, mm))


def correlation_picture(axis: str, correlation: Correlation) -> Picture | None:
    """The matrix in colours and numbers; None where nothing was estimated."""
    names = correlation.names
    if len(names) < 2:
        return None
    size = len(names)
    side = max(4.5, 0.9 + 0.5 * size)

    def draw() -> Drawn:
        from matplotlib.patches import Rectangle

        with drawing(side + 0.9, side) as figure:
            room = figure.subplots()
            room.set_axisbelow(False)
            room.grid(visible=False)
            for i in range(size):
                for j in range(size):
                    value = float(correlation.matrix[i, j])
                    if not math.isfinite(value):
                        continue
                    colour, depth = (
                        (style.MUTED, 0.25)
                        if i == j
                        else (style.BLUE if value > 0 else style.VERMILLION, 0.75 * abs(value))
                    )
                    room.add_patch(Rectangle((j, i), 1, 1, facecolor=colour, alpha=depth, linewidth=0))
                    if i != j:
                        text = f"{value:.2f}".replace("-", "−").replace("0.", ".")
                        weight = "bold" if abs(value) >= STRONG else "normal"
                        room.text(j + 0.5, i + 0.5, text, ha="center", va="center", fontsize=8.5, fontweight=weight)
            for k in range(size + 1):
                room.axhline(k, color=style.GRID, linewidth=0.6)
                room.axvline(k, color=style.GRID, linewidth=0.6)
            ticks = [k + 0.5 for k in range(size)]
            labels = [symbol(name) for name in names]
            room.set_xticks(ticks, labels)
            room.set_yticks(ticks, labels)
            room.tick_params(length=0)
            room.set_xlim(0, size)
            room.set_ylim(size, 0)
            room.set_aspect("equal")
            for spine in room.spines.values():
                spine.set_visible(False)
            room.set_title(f"Axis {axis}: correlation of the parameters")
            return finish(figure, "correlation", "Correlation matrix", caption)

    caption = (
        "Blue: two parameters err in the same direction, vermillion: in opposite ones. Close to ±1 (bold from "
        f"{STRONG:g}) the data tell a combination of both rather than each; the curve can be sure all "
        "the same. Empty: not known."
    )
    return Picture("correlation", "Correlation matrix", caption, draw, correlation_chart(axis, correlation))


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
    return (1e6 * I_P, "µm") if longest < LONG else (1e3 * I_P, "mm")
