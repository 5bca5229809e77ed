"""Motions for the identification of friction: strokes at constant speeds, and sines. Every value is SI."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Discriminator, Field, StrictInt, Tag, model_validator

from feedsim.fields import AxisName, Model, Quantity, fault

Speed = Annotated[float, Quantity("m/s", above=0)]


class SpeedRange(Model):
    """Speeds in equal ratios, both ends included."""

    first: Speed = Field(alias="from", description="First speed")
    last: Speed = Field(alias="to", description="Last speed")
    count: Annotated[StrictInt, Field(ge=2, le=1000)] = Field(default=12, description="Number of speeds")

    @model_validator(mode="after")
    def _a_range(self) -> Self:
        if self.first == self.last:
            raise fault(f"'from' and 'to' are both {self.first:.9g} m/s; give a list for a single speed")
        return self


def _list_or_range(value: Any) -> str:
    return "[range]" if isinstance(value, (dict, SpeedRange)) else "[list]"


Speeds = Annotated[
    Annotated[Annotated[tuple[Speed, ...], Field(min_length=1)], Tag("[list]")] | Annotated[SpeedRange, Tag("[range]")],
    Discriminator(_list_or_range),
]


class ConstantSpeed(Model):
    """Strokes at constant speeds, there and back: what the stationary friction torque is identified from."""

    kind: Literal["constant_speed"] = "constant_speed"
    axis: AxisName = Field(description="Axis that moves")
    speeds: Speeds = Field(description="List of speeds, or {from: ..., to: ..., count: ...} in equal ratios")
    duration: Annotated[float, Quantity("s", above=0, example="1 s")] = Field(
        default=1.0, description="Least time at constant speed, as far as the travel allows"
    )
    distance: Annotated[float, Quantity("m", above=0, example="1 mm")] = Field(
        default=1e-3, description="Least travel at constant speed: slow strokes last longer"
    )
    stroke: Annotated[float, Quantity("m", above=0, example="200 mm")] | None = Field(
        default=None, description="Longest stroke (default: from where the axis is to the farther end of its travel)"
    )
    rest: Annotated[float, Quantity("s", minimum=0, example="0.2 s")] = Field(
        default=0.2, description="Time at rest between strokes"
    )
    acceleration: Annotated[float, Quantity("m/s^2", above=0)] | None = Field(
        default=None, description="Highest acceleration in place of the machine's"
    )
    jerk: Annotated[float, Quantity("m/s^3", above=0)] | None = Field(
        default=None, description="Highest jerk in place of the machine's"
    )

    @property
    def feeds(self) -> tuple[float, ...]:
        """Speeds [m/s] in the order in which they are driven."""
        if isinstance(self.speeds, SpeedRange):
            spaced = np.geomspace(self.speeds.first, self.speeds.last, self.speeds.count)
            return (self.speeds.first, *map(float, spaced[1:-1]), self.speeds.last)
        return self.speeds


class SineMove(Model):
    """A sine about where the axis is, faded in and out."""

    amplitude: Annotated[float, Quantity("m", above=0, example="20 um")] = Field(description="Amplitude")
    frequency: Annotated[float, Quantity("Hz", above=0, example="5 Hz")] = Field(description="Frequency")
    periods: Annotated[StrictInt, Field(ge=1, le=100_000)] = Field(
        description="Periods at full amplitude; those of fading come on top"
    )


class Sine(Model):
    """Sines one after another: what pre-sliding friction and its damping are identified from."""

    kind: Literal["sine"] = "sine"
    axis: AxisName = Field(description="Axis that moves")
    moves: Annotated[tuple[SineMove, ...], Field(min_length=1)] = Field(description="Sines, in this order")
    rest: Annotated[float, Quantity("s", minimum=0, example="0.2 s")] = Field(
        default=0.2, description="Time at rest between sines"
    )
    fade: Annotated[float, Quantity("1", minimum=0.5, maximum=100)] = Field(
        default=1.0, description="Periods over which the amplitude rises at the start and falls at the end"
    )
