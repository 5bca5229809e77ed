"""What the machine does: the kinds of motion a scenario lists. Every value is SI; angles are rad."""

from __future__ import annotations

from math import pi
from typing import Annotated, Any, Literal, Self

from pydantic import Field, StrictBool, StrictInt, StrictStr, ValidationInfo, field_validator, model_validator

from feedsim import units
from feedsim.errors import InputError
from feedsim.fields import AxisName, File, Model, Quantity, fault
from feedsim.scenario.experiment import ConstantSpeed, Sine

Position = Annotated[float, Quantity("m")]
Feed = Annotated[float, Quantity("m/s", above=0)]
Direction = Literal["counterclockwise", "clockwise"]


class PathMotion(Model):
    """A motion along a path that the NC plans from rest to rest."""

    feed: Feed = Field(description="Programmed speed along the path")
    acceleration: Annotated[float, Quantity("m/s^2", above=0)] | None = Field(
        default=None, description="Highest acceleration along the path in place of the machine's"
    )
    jerk: Annotated[float, Quantity("m/s^3", above=0)] | None = Field(
        default=None, description="Highest jerk along the path in place of the machine's"
    )


class Move(PathMotion):
    """A straight move of one or several axes."""

    kind: Literal["move"] = "move"
    by: dict[AxisName, Position] = Field(default={}, description="Distances, relative to where the axes are")
    to: dict[AxisName, Position] = Field(default={}, description="Target positions")

    @model_validator(mode="after")
    def _somewhere(self) -> Self:
        if not self.by and not self.to:
            raise fault("a move needs 'by' (distances) or 'to' (positions), for example by: {Z: 100 mm}")
        if both := sorted(set(self.by) & set(self.to)):
            raise fault(f"axis {both[0]} stands in 'by' and in 'to'; one of them is meant")
        return self


class PlaneMotion(PathMotion):
    """A motion in the plane of two axes. Counterclockwise turns from the first axis towards the second."""

    plane: tuple[AxisName, AxisName] = Field(description="First and second axis of the plane, for example [X, Z]")
    direction: Direction = Field(
        default="counterclockwise", description="Counterclockwise turns the first axis towards the second"
    )

    @field_validator("plane")
    @classmethod
    def _two_axes(cls, plane: tuple[str, str]) -> tuple[str, str]:
        if plane[0] == plane[1]:
            raise fault(f"a plane needs two different axes, not {plane[0]} twice")
        return plane


class Arc(PlaneMotion):
    """A circular arc from where the axes are, about a centre, to an end point or through an angle."""

    kind: Literal["arc"] = "arc"
    centre: dict[AxisName, Position] = Field(default={}, description="Centre, as positions of both axes of the plane")
    centre_by: dict[AxisName, Position] = Field(default={}, description="Centre, relative to the start of the arc")
    to: dict[AxisName, Position] = Field(default={}, description="End point, as positions of both axes of the plane")
    by: dict[AxisName, Position] = Field(default={}, description="End point, relative to the start of the arc")
    angle: Annotated[float, Quantity("rad", above=0, example="90 deg")] | None = Field(
        default=None, description="Angle through which the arc turns, in place of an end point"
    )

    @model_validator(mode="after")
    def _determined(self) -> Self:
        if bool(self.centre) == bool(self.centre_by):
            raise fault("an arc needs its centre once: 'centre' (positions) or 'centre_by' (from its start)")
        if [bool(self.to), bool(self.by), self.angle is not None].count(True) != 1:
            raise fault("an arc needs its end once: 'to' (positions), 'by' (from its start) or 'angle'")
        for name in ("centre", "centre_by", "to", "by"):
            point = getattr(self, name)
            if point and set(point) != set(self.plane):
                raise fault(f"{name!r} must give {self.plane[0]} and {self.plane[1]}, the axes of the plane")
        return self


class Circle(PlaneMotion):
    """Full circles that begin and end where the axes are."""

    kind: Literal["circle"] = "circle"
    radius: Annotated[float, Quantity("m", above=0, example="15 mm")] = Field(description="Radius")
    turns: Annotated[StrictInt, Field(ge=1, le=100_000)] = Field(default=1, description="Number of full turns")
    start_angle: Annotated[float, Quantity("rad", minimum=-2 * pi, maximum=2 * pi, example="0 deg")] = Field(
        default=0.0, description="Direction from the centre to the start, from the first axis towards the second"
    )


class Dwell(Model):
    """All axes are held."""

    kind: Literal["dwell"] = "dwell"
    duration: Annotated[float, Quantity("s", above=0, example="1.2 s")] = Field(description="Time at rest")


class Column(Model):
    """A column of a CSV file; in short just its name."""

    column: StrictStr = Field(min_length=1, description="Name in the header, without the unit")
    unit: StrictStr | None = Field(default=None, description="Unit of the values, where the header does not tell it")

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


class MeasuredSetpoints(Model):
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


Motion = Annotated[Move | Arc | Circle | Dwell | MeasuredSetpoints | ConstantSpeed | Sine, Field(discriminator="kind")]
