"""Overview of a run: position, following error and torque of every axis that moves."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from feedsim.report.labels import heading, legend_above
from feedsim.report.style import BLUE, MUTED, SETPOINT, VERMILLION, Picture, drawing, finish, thinned
from feedsim.trace import Trace, release

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def overview_picture(trace: Trace, axes: Iterable[str], signs: Mapping[str, int], stem: str) -> Picture | None:
    """Position, following error and torque over the whole run, one row per axis; None where nothing is recorded.

    signs: axis -> +-1, display sign of its torques.
    """
    shown = [axis for axis in axes if any(f"{axis}.{name}" in trace.columns for name in ("x_a", "x_s", "M_a"))]
    if not shown:
        return None
    with drawing(10.0, 0.5 + 2.7 * len(shown)) as figure:
        rooms = figure.subplots(len(shown), 3, squeeze=False, sharex=True)
        for (position, error, torque), axis in zip(rooms, shown, strict=True):
            for name, scale, style, label in (
                ("x_s", 1e3, {"color": SETPOINT, "linestyle": (0, (4, 2))}, "setpoint $x_s$"),
                ("x_a", 1e3, {"color": BLUE}, "linear scale $x_a$"),
            ):
                _curve(position, trace, f"{axis}.{name}", scale, label, style)
            _curve(error, trace, f"{axis}.x_e", 1e6, "", {"color": BLUE})
            sign = signs.get(axis, 1)
            _curve(torque, trace, f"{axis}.M_a", sign, "motor $M_a$", {"color": BLUE})
            _curve(torque, trace, f"{axis}.M_fr", sign, r"friction $M_{fr}$", {"color": VERMILLION, "linewidth": 1.1})
            note = " (sign reversed)" if sign < 0 else ""
            heading(position, f"Axis {axis}: position")
            heading(error, "Following error")
            heading(torque, f"Torque{note}")
            position.set_ylabel("position [mm]")
            error.set_ylabel("following error [µm]")
            torque.set_ylabel("torque [N·m]")
            for room in (position, error, torque):
                room.margins(x=0.01)
                if not room.lines:
                    room.set_visible(False)
            for room in (error, torque):
                room.axhline(0.0, color=MUTED, linewidth=0.8)
            for room in (position, torque):
                if room.get_visible():
                    legend_above(room)
        for room in rooms[-1]:
            room.set_xlabel("time [s]")
        return finish(
            figure,
            stem,
            "Overview of the axes that move",
            "Position, following error (delayed setpoint less measured position) and torque over the whole run.",
        )


def _curve(axes: Axes, trace: Trace, name: str, scale: float, label: str, style: Mapping[str, Any]) -> None:
    if name in trace.columns:
        t, y = thinned(trace.time, trace[name])
        release(trace.time, trace[name])
        axes.plot(t, scale * y, label=label, **style)
