"""Recorded signals over time, a row of the picture for each unit."""

from __future__ import annotations

from feedsim.errors import InputError
from feedsim.report.chart import Axis, Chart, Curve, Panel
from feedsim.report.formatting import display_unit
from feedsim.report.picture import Picture
from feedsim.report.run.charts import OF_AXES as COLOURS
from feedsim.report.style import Drawn, drawing, finish, thinned
from feedsim.trace import Trace

MOST = 12  # signals in a picture


def signals_picture(trace: Trace, title: str) -> Picture:
    """All columns of a trace, those of one unit together. Raises InputError for more than can be told apart."""
    if not 0 < len(trace.names) <= MOST:
        raise InputError(f"{len(trace.names)} signals in one picture; from 1 to {MOST} can be told apart")
    kinds = list(dict.fromkeys(trace.unit(name) for name in trace.names))

    def draw() -> Drawn:
        with drawing(10.0, 1.6 + 2.2 * len(kinds)) as figure:
            rooms = figure.subplots(len(kinds), 1, sharex=True, squeeze=False)[:, 0]
            for unit, room in zip(kinds, rooms, strict=True):
                for name in trace.names:
                    if trace.unit(name) == unit:
                        room.plot(*thinned(trace.time, trace[name]), label=name)
                room.set_ylabel(unit)
                room.legend(loc="upper right")
            rooms[-1].set_xlabel("time [s]")
            return finish(figure, "signals", title, ", ".join(trace.names))

    panels = [
        Panel(", ".join(own), Axis("time", "s"), Axis("value", display_unit(unit)),
              [Curve(name, trace.time, trace[name], COLOURS[k % len(COLOURS)]) for k, name in enumerate(own)],
              linked="t")
        for unit in kinds
        if (own := [name for name in trace.names if trace.unit(name) == unit])
    ]  # fmt: skip
    return Picture("signals", title, ", ".join(trace.names), draw, Chart(panels))
