"""Which axis was the first to leave its setpoint, for the message of a run that has failed."""

from __future__ import annotations

import numpy as np

from feedsim.nc import Program
from feedsim.scenario import Machine
from feedsim.trace import Trace

# Of its travel: an axis that is off by more has left its setpoint; at rapid traverse without feedforward it is off by
# 1 %.
SETPOINT_LEFT_SHARE = 0.02


def first_departure(trace: Trace, program: Program, machine: Machine) -> str:
    """Which axis was the first to leave its setpoint, for the message of a run that has failed; "" where none has.

    trace: the rows so far. The unit that fails first is often that of another axis, which the structure has dragged
    along. An axis has left its setpoint where it is off by more than SETPOINT_LEFT_SHARE of its travel; of axes that
    leave in the same row it is the one that is off the furthest, each as a share of its travel.
    """
    result: list[tuple[float, float, str, float]] = []
    for name, axis in machine.axes.items():
        if (column := f"{name}.x_a") not in trace.columns:
            continue
        setpoint = np.interp(trace.time, program.time, program.x_s[name])
        with np.errstate(invalid="ignore"):
            off = np.nan_to_num(np.abs(np.asarray(trace[column]) - setpoint), nan=np.inf)
        share = off / (axis.travel[1] - axis.travel[0])
        if (rows := np.flatnonzero(share > SETPOINT_LEFT_SHARE)).size:
            row = int(rows[0])
            result.append((float(trace.time[row]), -float(share[row]), name, float(off[row])))
    if not result:
        return ""
    at, _, name, largest = min(result)
    return f"; axis {name} left its setpoint first: {largest * 1e3:.3g} mm off at {at:.9g} s"
