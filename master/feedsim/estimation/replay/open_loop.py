"""A record's torque on the simulated axis, without its drive: where inertia, load and friction take the position.

The axis is rigid: it begins with the recorded position and speed, and nothing corrects it. The position is then the
second integral of what friction and load lack, and drifts away from an error of a percent. In closed loop the drive
hides such an error. Equation and start are those of the identification (estimation/identify/open_loop.py).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from feedsim.estimation.identify import Recorded
from feedsim.estimation.identify.open_loop import reached
from feedsim.estimation.identify.parameters import FRICTION_NAMES
from feedsim.estimation.replay.closed_loop import AxisRecord
from feedsim.estimation.replay.compare import Channel, Comparison
from feedsim.foundation.errors import InputError
from feedsim.scenario import Machine
from feedsim.simulation.cosim.friction_law import FrictionLaw
from feedsim.structure import checked_modes


def driven(
    machine: Machine, records: Mapping[str, AxisRecord], read: Mapping[str, Recorded], fmus: Path | None = None
) -> dict[str, Comparison]:
    """Each axis under its recorded torque, beside its recorded position.

    read: where the records come from, with the delay of the torque that a mapping gives.

    Raises InputError: a record without torque; an axis whose friction is not the shipped unit's; parameters that the
    friction law refuses.
    """
    comparisons = {}
    with FrictionLaw(fmus) as law:
        for axis, axis_record in records.items():
            if not axis_record.record.driven:
                raise InputError(
                    f"{axis_record.record.name}, axis {axis}: no torque, current or force is recorded; in open loop it "
                    "is what drives the axis"
                )
            friction = machine.shipped_friction(axis, "a replay in open loop")
            values = {name: float(getattr(friction, name)) for name in FRICTION_NAMES}
            values |= {"J": checked_modes(machine).J_tot(axis), "M_0": machine.axes[axis].M_0}
            values["delay"] = read[axis].provenance.torque_delay or 0.0
            rows = np.flatnonzero(axis_record.rows)
            part = axis_record.record.between(int(rows[0]), int(rows[-1]) + 1)
            # The rows ahead of the window are not compared; as many as there are keep their place.
            x = axis_record.position.copy()
            x[rows] = axis_record.I_P * reached(part, law, values)
            channel = Channel(axis_record.position, x, "m", "position in open loop")
            comparisons[axis] = Comparison(axis, axis_record, {"position": channel}, None, None, 0.0, open_loop=True)
    return comparisons
