"""The pictures of a replay: an axis beside its record, and what is left."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from feedsim.replay.compare import TO_RPM, Comparison
from feedsim.report.chart import Axis, Chart, Curve, Dash, Level, Panel
from feedsim.report.picture import Picture
from feedsim.report.style import RECORDED, RESIDUAL_COLOUR, SIMULATED, Array
from feedsim.trace import Mark

SHOWN_UNITS = {"m": (1e6, "µm"), "rad/s": (TO_RPM, "rpm"), "N.m": (1.0, "N·m")}
MOST_MARKS = 25  # lines in a picture that can still be separated
MOST_NAMES, MAX_NAME_CHARACTERS = 9, 16  # names of them side by side in a panel, and their characters


def pictures_of(comparison: Comparison, marks: Sequence[Mark]) -> list[Picture]:
    """Over time, and what is left as a spectrum and over the position."""
    return [_over_time(comparison, marks), _residuals(comparison)]


def _over_time(comparison: Comparison, marks: Sequence[Mark]) -> Picture:
    axis_record = comparison.each
    rows = axis_record.rows
    time = axis_record.record.time[rows]
    channels = comparison.channels
    contour = axis_record.record.deviation is not None
    what, ordinate = ("Contour deviation", "deviation") if contour else ("Following error", "setpoint less position")
    lag = 1e6 * (axis_record.setpoint - axis_record.position)[rows]
    if axis_record.record.deviation is not None:
        lag = 1e6 * axis_record.I_P * axis_record.record.deviation[rows]
    within = [mark for mark in marks if time[0] <= mark.time <= time[-1]][:MOST_MARKS]
    title = f"Axis {comparison.axis}: the record and its replay"
    what_drives = (
        "The recorded torque on the simulated axis, in open loop, from the recorded position and speed on."
        if comparison.open_loop
        else "The recorded setpoints through the simulated axis, in closed loop, beside what was recorded."
    )
    dotted = " Dotted: begin of a block of the program, with its name where there is room." if within else ""
    caption = what_drives + dotted
    blocks = [Level(mark.time, upright=True, dash="dotted") for mark in within]
    titled = [replace(level, text=name) for level, name in zip(blocks, names_of(within, time), strict=True)]
    panels = []
    if not comparison.open_loop:
        simulated = lag - 1e6 * channels["position"].error[rows]
        panels.append(_panel(what, ordinate, "µm", time, simulated=simulated, recorded=lag))
    for name, channel in channels.items():
        factor, unit = SHOWN_UNITS[channel.unit]
        curves = {"what is left": factor * channel.error[rows]}
        if name == "torque":
            both = {"simulated": factor * channel.simulated[rows], "recorded": factor * channel.recorded[rows]}
            curves = {**both, **curves}
        panels.append(
            _panel(f"What is left of the {name}" if name != "torque" else "Torque", name, unit, time, **curves)
        )
    upper = replace(panels[0], levels=[*panels[0].levels, *titled])
    chart = Chart([upper, *(replace(panel, levels=[*panel.levels, *blocks]) for panel in panels[1:])])
    return Picture(f"replay-{comparison.axis}", title, caption, chart)


def names_of(marks: Sequence[Mark], time: Array) -> list[str]:
    """What stands at the line of each block; "" where the name before it takes the room."""
    result: list[str] = []
    free = -np.inf
    for mark in marks:
        text = (
            mark.text if len(mark.text) <= MAX_NAME_CHARACTERS else mark.text[: MAX_NAME_CHARACTERS - 1].rstrip() + "…"
        )
        result.append(text if mark.time >= free else "")
        free = mark.time + np.ptp(time) / MOST_NAMES if result[-1] else free
    return result


# Colour and width: the record lies on the simulation, which is wider.
LOOKS = {"recorded": (RECORDED, 1.0), "simulated": (SIMULATED, 2.2), "what is left": (RESIDUAL_COLOUR, 1.2)}


def _panel(title: str, ordinate: str, unit: str, time: Array, **curves: Array) -> Panel:
    looks = [(name.replace("_", " "), y, *LOOKS[name]) for name, y in curves.items()]
    own = [Curve(name, time, y, colour, width=width) for name, y, colour, width in looks]
    axis = Axis("time of the record", "s")
    return Panel(title, axis, Axis(ordinate, unit), own, [Level(0.0, dash="")], linked="t", height=0.9)


def _residuals(comparison: Comparison) -> Picture:
    names = [name for name in ("position", "torque") if name in comparison.channels]
    title = f"Axis {comparison.axis}: what the replay leaves"
    caption = (
        "Simulated less recorded: amplitude spectrum over the window (Hann), and the mean over bins of position "
        "while the axis moves, by direction."
    )
    panels = []
    for name in names:
        factor, unit = SHOWN_UNITS[comparison.channels[name].unit]
        frequency, amplitude = comparison.spectrum(name)
        centre, forwards, backwards = comparison.over_position(name)
        panels.append(
            Panel(f"What is left of the {name}: spectrum", Axis("frequency", "Hz", log=True),
                  Axis("amplitude", unit, log=True),
                  [Curve("amplitude", frequency[1:], factor * amplitude[1:], RESIDUAL_COLOUR)])
        )  # fmt: skip
        over_both: tuple[tuple[str, Array, Dash], ...] = (
            ("forwards", forwards, ""),
            ("backwards", backwards, "dashed"),
        )
        seen = np.isfinite(forwards) | np.isfinite(backwards)
        over = [
            Curve(word, 1e3 * centre[seen], factor * y[seen], RESIDUAL_COLOUR, dash, 1.4) for word, y, dash in over_both
        ]
        panels.append(
            Panel(
                f"What is left of the {name}: mean over the position",
                Axis("position", "mm"),
                Axis(f"{name} left", unit),
                over,
                [Level(0.0, dash="")],
            )
        )
    return Picture(f"replay-left-{comparison.axis}", title, caption, Chart(panels, (1.0, 1.0)))
