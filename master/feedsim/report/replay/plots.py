"""The pictures of a replay: an axis beside its record, and what is left."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from feedsim.replay.compare import TO_RPM, Channel, Comparison
from feedsim.report.chart import Axis, Chart, Curve, Level, Panel
from feedsim.report.labels import heading, legend_above
from feedsim.report.picture import Picture
from feedsim.report.style import BLUE, MUTED, ORANGE, VERMILLION, Array, Drawn, drawing, finish, thinned
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

    def draw() -> Drawn:
        with drawing(10.0, 2.4 + 2.1 * len(channels)) as figure:
            rooms = figure.subplots(1 + len(channels), 1, sharex=True)
            rooms[0].plot(*thinned(time, lag), color=MUTED, label="recorded")
            rooms[0].plot(*thinned(time, lag - 1e6 * channels["position"].error[rows]), color=BLUE, label="simulated")
            rooms[0].set_ylabel(f"{ordinate} [µm]")
            heading(rooms[0], what)
            legend_above(rooms[0])
            for room, (name, channel) in zip(rooms[1:], channels.items(), strict=True):
                factor, unit = SHOWN[channel.unit]
                if name == "torque":
                    room.plot(*thinned(time, factor * channel.recorded[rows]), color=MUTED, label="recorded")
                    room.plot(*thinned(time, factor * channel.simulated[rows]), color=BLUE, label="simulated")
                    room.plot(*thinned(time, factor * channel.error[rows]), color=VERMILLION, label="what is left")
                    legend_above(room)
                else:
                    room.plot(*thinned(time, factor * channel.error[rows]), color=VERMILLION)
                heading(room, name.capitalize() if name == "torque" else f"What is left of the {name}")
                room.set_ylabel(f"[{unit}]")
                room.axhline(0.0, color=MUTED, linewidth=0.8)
            for room in rooms:
                for mark in within:
                    room.axvline(mark.time, color=ORANGE, linewidth=0.6, linestyle=(0, (1, 3)))
            rooms[-1].set_xlabel("time of the record [s]")
            rooms[-1].margins(x=0.01)
            return finish(figure, f"replay-{found.axis}", title, caption)

    title = f"Axis {found.axis}: the record and its replay"
    caption = "The recorded setpoints through the simulated axis, in closed loop, beside what was recorded." + (
        " Dotted: begin of a block of the program." if within else ""
    )
    blocks = [Level(mark.time, upright=True, colour=ORANGE, dash="dotted") for mark in within]
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
    return Picture(f"replay-{found.axis}", title, caption, draw, chart)


LOOKS = {"recorded": MUTED, "simulated": BLUE, "what is left": VERMILLION}


def _panel(title: str, ordinate: str, unit: str, time: Array, **curves: Array) -> Panel:
    own = [Curve(name.replace("_", " "), time, y, LOOKS[name], width=1.2) for name, y in curves.items()]
    axis = Axis("time of the record", "s")
    return Panel(title, axis, Axis(ordinate, unit), own, [Level(0.0, dash="")], linked="t", height=0.9)


def _left(found: Comparison) -> Picture:
    names = [name for name in ("position", "torque") if name in found.channels]

    def draw() -> Drawn:
        with drawing(10.0, 3.0 * len(names)) as figure:
            rooms = figure.subplots(len(names), 2, squeeze=False)
            for (spectrum, over), name in zip(rooms, names, strict=True):
                channel: Channel = found.channels[name]
                factor, unit = SHOWN[channel.unit]
                frequency, amplitude = found.spectrum(name)
                spectrum.loglog(frequency[1:], factor * amplitude[1:], color=BLUE)
                spectrum.set(xlabel="frequency [Hz]", ylabel=f"amplitude [{unit}]")
                heading(spectrum, f"What is left of the {name}: spectrum")
                centre, forwards, backwards = found.over_position(name)
                over.plot(1e3 * centre, factor * forwards, color=BLUE, marker=".", label="forwards")
                over.plot(1e3 * centre, factor * backwards, color=VERMILLION, marker=".", label="backwards")
                over.axhline(0.0, color=MUTED, linewidth=0.8)
                over.set(xlabel="position [mm]", ylabel=f"[{unit}]")
                heading(over, "over the position, mean")
                legend_above(over)
            return finish(figure, f"replay-left-{found.axis}", title, caption)

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
                  Axis("amplitude", unit, log=True), [Curve("amplitude", frequency[1:], factor * amplitude[1:])])
        )  # fmt: skip
        over = [
            Curve(word, 1e3 * centre, factor * y, colour)
            for word, y, colour in (("forwards", forwards, BLUE), ("backwards", backwards, VERMILLION))
        ]
        panels.append(
            Panel(
                "over the position, mean",
                Axis("position", "mm"),
                Axis(f"{name} left", unit),
                over,
                [Level(0.0, dash="")],
            )
        )
    return Picture(f"replay-left-{found.axis}", title, caption, draw, Chart(panels, (1.0, 1.0)))
