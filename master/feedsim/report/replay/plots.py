"""The pictures of a replay: an axis beside its record, and what is left."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from feedsim.replay.compare import TO_RPM, Comparison
from feedsim.report.chart import Axis, Chart, Curve, Level, Panel
from feedsim.report.picture import Picture
from feedsim.report.style import BLUE, MUTED, PURPLE, VERMILLION, Array
from feedsim.trace import Mark

SHOWN = {"m": (1e6, "µm"), "rad/s": (TO_RPM, "rpm"), "N.m": (1.0, "N·m")}
MOST_MARKS = 25  # lines in a picture that can still be told apart


def pictures_of(comparison: Comparison, marks: Sequence[Mark]) -> list[Picture]:
    """Over time, and what is left as a spectrum and over the position."""
    return [_over_time(comparison, marks), _left(comparison)]


def _over_time(found: Comparison, marks: Sequence[Mark]) -> Picture:
    each = found.each
    rows = each.rows
    time = each.record.time[rows]
    channels = found.channels
    contour = each.record.deviation is not None
    what, ordinate = ("Contour deviation", "deviation") if contour else ("Following error", "setpoint less position")
    lag = 1e6 * (each.setpoint - each.position)[rows]
    if each.record.deviation is not None:
        lag = 1e6 * each.I_P * each.record.deviation[rows]
    within = [mark for mark in marks if time[0] <= mark.time <= time[-1]][:MOST_MARKS]
    title = f"Axis {found.axis}: the record and its replay"
    caption = "The recorded setpoints through the simulated axis, in closed loop, beside what was recorded." + (
        " Dotted: begin of a block of the program." if within else ""
    )
    blocks = [Level(mark.time, upright=True, dash="dotted") for mark in within]
    panels = [_panel(what, ordinate, "µm", time, recorded=lag,
                     simulated=lag - 1e6 * channels["position"].error[rows])]  # fmt: skip
    for name, channel in channels.items():
        factor, unit = SHOWN[channel.unit]
        curves = {"what is left": factor * channel.error[rows]}
        if name == "torque":
            both = {"recorded": factor * channel.recorded[rows], "simulated": factor * channel.simulated[rows]}
            curves = {**both, **curves}
        panels.append(
            _panel(f"What is left of the {name}" if name != "torque" else "Torque", name, unit, time, **curves)
        )
    chart = Chart([replace(panel, levels=[*panel.levels, *blocks]) for panel in panels])
    return Picture(f"replay-{found.axis}", title, caption, chart)


LOOKS = {"recorded": MUTED, "simulated": BLUE, "what is left": VERMILLION}


def _panel(title: str, ordinate: str, unit: str, time: Array, **curves: Array) -> Panel:
    own = [Curve(name.replace("_", " "), time, y, LOOKS[name], width=1.2) for name, y in curves.items()]
    axis = Axis("time of the record", "s")
    return Panel(title, axis, Axis(ordinate, unit), own, [Level(0.0, dash="")], linked="t", height=0.9)


def _left(found: Comparison) -> Picture:
    names = [name for name in ("position", "torque") if name in found.channels]
    title = f"Axis {found.axis}: what the replay leaves"
    caption = (
        "Simulated less recorded: amplitude spectrum over the window (Hann), and the mean over bins of position "
        "while the axis moves, by direction."
    )
    panels = []
    for name in names:
        factor, unit = SHOWN[found.channels[name].unit]
        frequency, amplitude = found.spectrum(name)
        centre, forwards, backwards = found.over_position(name)
        panels.append(
            Panel(f"What is left of the {name}: spectrum", Axis("frequency", "Hz", log=True),
                  Axis("amplitude", unit, log=True),
                  [Curve("amplitude", frequency[1:], factor * amplitude[1:], PURPLE)])
        )  # fmt: skip
        seen = np.isfinite(forwards) | np.isfinite(backwards)
        over = [
            Curve(word, 1e3 * centre[seen], factor * y[seen], colour, width=width, dots=width > 2)
            for word, y, colour in (("forwards", forwards, BLUE), ("backwards", backwards, VERMILLION))
            for width in (1.4, 2.2)
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
    return Picture(f"replay-left-{found.axis}", title, caption, Chart(panels, (1.0, 1.0)))
