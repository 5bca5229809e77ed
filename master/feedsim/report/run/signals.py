"""Recorded signals over time, a row of the picture for each unit."""

from __future__ import annotations

from feedsim.errors import InputError
from feedsim.report.chart import Axis, Chart, Curve, Panel
from feedsim.report.formatting import display_unit
from feedsim.report.picture import Picture
from feedsim.report.run.axis_plots import OF_AXES, TIME
from feedsim.trace import Trace

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
