"""Recorded position setpoints in place of the interpolator's: a cubic spline through the rows of a CSV file.

A recording that was cut while an axis was moving begins or ends at a speed. The axis then gets a run-in from rest to
that speed ahead of the first row, and a run-out behind the last one, as fast as the limits of the path allow.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, StrictBool, StrictStr, ValidationInfo, field_validator, model_validator

from feedsim.files.fields import AxisName, File, Model, Quantity, fault
from feedsim.foundation import units
from feedsim.foundation.errors import InputError
from feedsim.motions.kind import Array, Course, Geometry, MotionKind, Start, whole_cycles
from feedsim.motions.profile import SpeedChange, speed_change

FEWEST_ROWS = 4  # a cubic needs them


class Column(Model):
    """A column of a CSV file; in short just its name."""

    column: StrictStr = Field(min_length=1, description="Name in the header, without the unit")
    unit: StrictStr | None = Field(default=None, description="Unit of the values, where the header does not give it")

    @model_validator(mode="before")
    @classmethod
    def _name_alone(cls, value: Any) -> Any:
        return {"column": value} if isinstance(value, str) else value

    @field_validator("unit")
    @classmethod
    def _known(cls, unit: str | None) -> str | None:
        if unit is not None:
            try:
                units.unit(unit)
            except InputError as error:
                raise fault(str(error)) from None
        return unit


class MeasuredSetpoints(MotionKind):
    """Recorded position setpoints in place of the NC; axes without a column are held."""

    kind: Literal["setpoints"] = "setpoints"
    file: File = Field(description="CSV file, relative to this file")
    time: Column = Field(default=Column(column="time"), description="Column of the time")
    columns: Annotated[dict[AxisName, Column], Field(min_length=1)] = Field(description="Column of each axis")
    relative: StrictBool = Field(
        default=False,
        description="Shift the recording so that it begins where the axes are; false: positions as recorded",
    )
    between: (
        tuple[Annotated[float, Quantity("s", example="0 s")], Annotated[float, Quantity("s", example="5 s")]] | None
    ) = Field(default=None, description="Part of the recording to use, as first and last time")

    @field_validator("between")
    @classmethod
    def _forwards(cls, between: tuple[float, float] | None, info: ValidationInfo) -> tuple[float, float] | None:
        if between is not None and between[0] >= between[1]:
            raise fault(f"the first time {between[0]:.9g} s is not before the last, {between[1]:.9g} s")
        return between

    @property
    def axes(self) -> tuple[str, ...]:
        return tuple(self.columns)

    @property
    def needs(self) -> tuple[str, ...]:
        return self.axes if self.relative else ()

    @property
    def description(self) -> str:
        return f"recorded setpoints of {', '.join(self.columns)} from {self.file.name}"

    def plan(self, start: Start) -> Course:
        """The recording with run-in and run-out.

        Raises InputError where the file cannot be read, lacks a column or a unit, or has too few rows.
        """
        # Loaded where a recording is read: splines take longer to load than all of the fields.
        from scipy.interpolate import CubicSpline

        from feedsim.files.trace import read_signals

        rows = read_signals(
            self.file,
            {axis: (column.column, column.unit) for axis, column in self.columns.items()},
            "m",
            time=(self.time.column, self.time.unit),
            between=self.between,
            fewest=FEWEST_ROWS,
        )
        since = rows.time - rows.time[0]
        length, cycle = float(since[-1]), start.T_pos
        splines = {axis: CubicSpline(since, rows[axis] - rows[axis][0]) for axis in self.columns}
        into = {axis: _change(float(spline(0.0, 1)), start) for axis, spline in splines.items()}
        out = {axis: _change(float(spline(length, 1)), start) for axis, spline in splines.items()}
        # Whole cycles, so that rows recorded at the position cycle stay on it.
        before = whole_cycles(max(change.duration for change in into.values()), cycle)
        duration = before * cycle + length + max(change.duration for change in out.values())
        time: Array = (np.arange(whole_cycles(duration, cycle) + 1, dtype=np.float64) - before) * cycle
        ahead, behind = time < 0, time > length
        setpoints = {}
        for axis, spline in splines.items():
            origin = start.position[axis] + into[axis].distance if self.relative else float(rows[axis][0])
            within = np.clip(time, 0.0, length)
            x, v = spline(within), spline(within, 1)
            covered, v[ahead] = into[axis].at(time[ahead] + into[axis].duration)
            x[ahead] = covered - into[axis].distance
            # A run-out is a run-in backwards in time.
            remaining, v[behind] = out[axis].at(out[axis].duration - (time[behind] - length))
            x[behind] += out[axis].distance - remaining
            setpoints[axis] = (origin + x, v)
        begin = start.time + before * cycle
        return Course(
            duration=duration,
            cycles=whole_cycles(duration, start.T_ipo),
            setpoints=setpoints,
            target={axis: float(x[-1]) for axis, (x, _) in setpoints.items()},
            absolute=not self.relative,
            moving=tuple(axis for axis, (x, _) in setpoints.items() if np.any(x != start.position[axis])),
            geometry=RecordedGeometry(begin, begin + length, float(rows.time[0]), self.file, self.axes),
        )


def _change(speed: float, start: Start) -> SpeedChange:
    # A speed that the jerk limit could undo within a position cycle is none to speak of.
    at_rest = abs(speed) <= start.jerk * start.T_pos**2
    return speed_change(0.0 if at_rest else speed, start.acceleration, start.jerk)


@dataclass(frozen=True)
class RecordedGeometry(Geometry):
    """Recorded setpoints.

    begin, end: instants [s] of the recording's first and last row; a run-in lies ahead, a run-out behind.
    first: time [s] of its first row by its own clock.
    """

    begin: float
    end: float
    first: float
    file: Path
    axes: tuple[str, ...]
    """Axes with a column of their own."""

    @property
    def text(self) -> str:
        return f"recording of {', '.join(self.axes)}"
