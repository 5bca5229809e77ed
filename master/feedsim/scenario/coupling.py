"""How plant and friction are exchanged within a control cycle: the schemes, and what a scenario says of it.

The schemes are rows of src/machine_fmu/cycle.h, which says what their columns mean; feedsim.cosim.schedule makes
operations of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field, StrictInt

from feedsim import variables
from feedsim.fields import Model, Quantity


@dataclass(frozen=True)
class Scheme:
    """How the units see each other within a step."""

    number: int
    name: str
    stable_share: float
    speed: str
    torque_ramp: bool
    friction_ramp: bool
    passes: int
    friction_first: bool

    @property
    def speed_ramp(self) -> bool:
        """Whether friction is given the slope of its speed."""
        return self.speed in ("within", "extrapolated")


SCHEMES = {scheme.name: scheme for scheme in (Scheme(*row) for row in variables.cycle()["SCHEMES"])}


class Coupling(Model):
    """How plant and friction are exchanged."""

    scheme: Literal[tuple(SCHEMES)] = Field(  # type: ignore[valid-type]
        default="extrapolated", description="Order of the units and use of input slopes within an exchange step"
    )
    substeps: Annotated[StrictInt, Field(ge=1, le=1000)] = Field(
        default=1, description="Exchange steps of plant and friction per control cycle"
    )
    call_limit: Annotated[float, Quantity("s", above=0, example="60 s")] = Field(
        default=60.0, description="Time after which a call of another maker's unit is ended"
    )
    units: Literal["separate", "one"] = Field(
        default="separate",
        description="Structure, drives and friction as units of their own, or as one unit (machine.fmu), same results",
    )
