"""What identification works on: recorded motion and torque of one axis, motor side, even in time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from feedsim.errors import InputError

Array = NDArray[np.float64]

EVEN = 1e-3  # of the step: how far an instant may lie off the grid


@dataclass(frozen=True, eq=False)
class Record:
    """A stretch of a trace of one axis without gaps.

    Attributes:
        name: file, with the piece where the trace has gaps.
        time: (N,) [s], even.
        torque: (N,) motor torque [N.m], positive where it accelerates in the positive direction.
        angle: (N,) motor angle [rad], or the scale's position over the lead I_P; None where there is only a speed.
        speed: (N,) motor speed [rad/s]; None where there is only a position.
        load: (N,) known torque against the motor torque [N.m], for example a measured disturbance; None: none.
        setpoint: (N,) commanded angle [rad]; None where it was not recorded.
        columns: role -> name of the trace's column.

    Raises InputError: fewer than two rows, lengths that differ, uneven time, neither angle nor speed.
    """

    name: str
    time: Array
    torque: Array
    angle: Array | None = None
    speed: Array | None = None
    load: Array | None = None
    setpoint: Array | None = None
    columns: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if len(self.time) < 2:
            raise InputError(f"{self.name}: {len(self.time)} row(s); at least 2 are needed")
        if self.angle is None and self.speed is None:
            raise InputError(f"{self.name}: neither a position nor a speed; one of them is needed")
        for role in ("torque", "angle", "speed", "load", "setpoint"):
            values = getattr(self, role)
            if values is not None and len(values) != len(self.time):
                raise InputError(f"{self.name}: {role} has {len(values)} values, the time has {len(self.time)}")
        if np.max(np.abs(np.diff(self.time) - self.interval)) > EVEN * self.interval:
            raise InputError(f"{self.name}: the time is not even")

    @property
    def interval(self) -> float:
        """Time between rows [s]."""
        return float((self.time[-1] - self.time[0]) / (len(self.time) - 1))

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.time)

    def between(self, first: int, last: int) -> Record:
        """Rows first <= i < last."""

        def cut(values: Array | None) -> Array | None:
            return None if values is None else values[first:last]

        return Record(
            self.name,
            self.time[first:last],
            self.torque[first:last],
            cut(self.angle),
            cut(self.speed),
            cut(self.load),
            cut(self.setpoint),
            self.columns,
        )
