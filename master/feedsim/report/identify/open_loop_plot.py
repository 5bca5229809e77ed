"""Figure of the position in open loop: where the axis was, and where the model goes under the recorded torque."""

from __future__ import annotations

from feedsim.identify.result import Balance, Identification
from feedsim.report.formatting import counted
from feedsim.report.labels import heading, legend_above
from feedsim.report.style import BLUE, INK, MUTED, VERMILLION, Picture, drawing, finish, thinned

MOST = 3  # records side by side


def open_loop_picture(found: Identification, balance: Balance) -> Picture | None:
    """Position and its error over time, before and after, a column per record; None where nothing was tried."""
    drifts = balance.drifts[:MOST]
    if not drifts:
        return None
    mm = 1e3 * found.I_P
    after = "after" if balance.applied else "tried"
    with drawing({1: 9.0, 2: 10.0}.get(len(drifts), 11.0), 5.6) as figure:
        rooms = figure.subplots(2, len(drifts), sharex="col", squeeze=False)
        for k, drift in enumerate(drifts):
            position, error = rooms[:, k]
            time, angle, first, last = thinned(drift.time, drift.angle, drift.before, drift.after)
            position.plot(time, mm * angle, color=INK, linewidth=1.6, label="recorded")
            position.plot(time, mm * (angle - first), color=BLUE, linewidth=1.0, label="open loop, before")
            dashed = {"color": VERMILLION, "linewidth": 1.1, "linestyle": (0, (4, 2))}
            position.plot(time, mm * (angle - last), label=f"open loop, {after}", **dashed)
            error.plot(time, mm * first, color=BLUE, linewidth=1.0, label="before")
            error.plot(time, mm * last, color=VERMILLION, linewidth=1.1, label=after)
            error.axhline(0.0, color=MUTED, linewidth=0.8)
            heading(position, drift.record)
            legend_above(position)
            legend_above(error)
            error.set_xlabel("time [s]")
        rooms[0, 0].set_ylabel("position [mm]")
        rooms[1, 0].set_ylabel("recorded less open loop [mm]")
        before, end = (mm * rms for rms in balance.position)
        left = len(balance.drifts) - len(drifts)
        more = f" {counted(left, 'further record is', 'further records are')} not shown." if left else ""
        fate = "" if balance.applied else " What was tried was not taken."
        caption = (
            f"Axis {found.axis}: position from the start on, recorded and of a rigid axis that the recorded torque "
            f"drives against this friction: off by {before:.3g} mm rms before the step, {end:.3g} mm "
            f"{'after it' if balance.applied else 'with what it tried'}.{fate}{more}"
        )
        return finish(figure, "open-loop", "Position in open loop", caption)
