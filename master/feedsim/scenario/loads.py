"""Loads: torques and forces over time that act on the axes and at the tool, from a recording, a table, or at random.

Each acts at one input of the plant; which, in which unit and with which sign, is said here alone.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, StrictBool, StrictInt, field_validator, model_validator

from feedsim.files.fields import AxisName, File, Model, Quantity, fault
from feedsim.motions import Column

MotionIndex = Annotated[StrictInt, Field(ge=0)]
Direction = Literal["X", "Y", "Z"]


class Table(Model):
    """A load over time in the scenario file itself."""

    time: Annotated[tuple[Annotated[float, Quantity("s", example="0 s")], ...], Field(min_length=2)] = Field(
        description="Instants, increasing"
    )
    values: tuple[float, ...] = Field(description="The load at each instant")

    @field_validator("time")
    @classmethod
    def _check_increasing(cls, time: tuple[float, ...]) -> tuple[float, ...]:
        for before, after in pairwise(time):
            if after <= before:
                raise fault(f"{after:.9g} s follows {before:.9g} s; the time must increase")
        return time

    @model_validator(mode="after")
    def _as_many_values(self) -> Self:
        if len(self.time) != len(self.values):
            raise fault(f"{len(self.time)} instants and {len(self.values)} values; each instant needs a value")
        return self


class TorqueTable(Table):
    """A torque over time."""

    values: tuple[Annotated[float, Quantity("N.m", example="2 N.m")], ...] = Field(description="Torque at each instant")


class ForceTable(Table):
    """A force over time."""

    values: tuple[Annotated[float, Quantity("N", example="100 N")], ...] = Field(description="Force at each instant")


class Noise(Model):
    """A load at random: white noise through a first-order low-pass, from the begin of the run to its end."""

    bandwidth: Annotated[float, Quantity("Hz", above=0, example="10 Hz")] = Field(
        default=10.0, description="Corner frequency of the low-pass"
    )
    seed: Annotated[StrictInt, Field(ge=0)] = Field(default=0, description="Of the random numbers: the same ones again")
    rms: float = Field(description="Standard deviation of the load")


class TorqueNoise(Noise):
    """A torque at random."""

    rms: Annotated[float, Quantity("N.m", above=0, example="0.1 N.m")] = Field(
        description="Standard deviation of the torque"
    )


class ForceNoise(Noise):
    """A force at random."""

    rms: Annotated[float, Quantity("N", above=0, example="10 N")] = Field(description="Standard deviation of the force")


class LoadCourse(Model):
    """What all loads have in common: where their course over time is from."""

    UNIT: ClassVar[str]
    INPUT: ClassVar[str]
    WORDS: ClassVar[str]

    file: File | None = Field(default=None, description="CSV file with the load over time, relative to this file")
    column: Column | None = Field(default=None, description="Column of the load in the file")
    time: Column = Field(default=Column(column="time"), description="Column of the time in the file")
    motor_torque: Column | None = Field(
        default=None,
        description="Column of the motor torque that was recorded with it: the drive's work in the run is held against "
        "that, and shows a load of wrong sign or size",
    )
    table: Table | None = None
    noise: Noise | None = None
    held: StrictBool = Field(
        default=False, description="Each value holds until the next instant; false: linear in between"
    )
    factor: Annotated[float, Quantity("1")] = Field(
        default=1.0, description="By which all values are multiplied; -1 turns the sign"
    )
    motion: MotionIndex | None = Field(
        default=None,
        description="Place of the motion in motions, from 0, with which the load's time runs: the recorded time of "
        "recorded setpoints, else the time since the motion began (default: the time of the run)",
    )

    @field_validator("factor")
    @classmethod
    def _not_zero(cls, factor: float) -> float:
        if factor == 0:
            raise fault("0 leaves nothing of the load")
        return factor

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        given = [name for name in ("file", "table", "noise") if getattr(self, name) is not None]
        if len(given) != 1:
            text = f"{' and '.join(given)} are given" if given else "none is given"
            raise fault(
                "a load is in a 'file' with its 'column', in a 'table' of 'time' and 'values', or at random by "
                f"'noise'; {text}"
            )
        if (self.file is None) != (self.column is None):
            raise fault("a 'file' needs the 'column' of the load, and only a file has one")
        if self.motor_torque is not None and self.file is None:
            raise fault("'motor_torque' is a column of the file with the load; a table has none")
        return self

    @property
    def axis_name(self) -> str:
        """The axis whose motor mostly carries it, if there is one of that name."""
        raise NotImplementedError

    @property
    def input(self) -> str:
        """The plant's variable at which it acts."""
        return self.INPUT.format(self.axis_name)

    @property
    def words(self) -> str:
        """Where it acts, for people."""
        return self.WORDS.format(self.axis_name)


class MotorLoad(LoadCourse):
    """A torque at the motor of an axis, counted against the motor torque like constant_load, to which it adds."""

    UNIT, INPUT, WORDS = "N.m", "{}.M_0", "at the motor of {}"

    kind: Literal["motor"] = "motor"
    axis: AxisName
    table: TorqueTable | None = Field(default=None, description="The load over time, in place of a file")
    noise: TorqueNoise | None = Field(default=None, description="The load at random, in place of a file")

    @property
    def axis_name(self) -> str:
        return self.axis


class SlideLoad(LoadCourse):
    """A force on the slide of an axis where its scale is, positive in its direction, with its reaction on the rail."""

    UNIT, INPUT, WORDS = "N", "{}.F_a", "on the slide of {}"

    kind: Literal["slide"] = "slide"
    axis: AxisName
    table: ForceTable | None = Field(default=None, description="The load over time, in place of a file")
    noise: ForceNoise | None = Field(default=None, description="The load at random, in place of a file")

    @property
    def axis_name(self) -> str:
        return self.axis


class ToolLoad(LoadCourse):
    """A force on the tool in a direction of the machine's frame, with its reaction on the workpiece."""

    UNIT, INPUT, WORDS = "N", "tool.F_{}", "on the tool in {}"

    kind: Literal["tool"] = "tool"
    direction: Direction = Field(description="X, Y or Z, positive as in the machine's frame")
    table: ForceTable | None = Field(default=None, description="The load over time, in place of a file")
    noise: ForceNoise | None = Field(default=None, description="The load at random, in place of a file")

    @property
    def axis_name(self) -> str:
        return self.direction


Load = Annotated[MotorLoad | SlideLoad | ToolLoad, Field(discriminator="kind")]
