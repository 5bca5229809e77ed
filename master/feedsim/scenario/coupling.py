"""How plant and friction are exchanged within a control cycle: the schemes, and what a scenario says of it.

What a scheme means as operations: feedsim.cosim.schedule. The unit `machine` has the same ones in the same order.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field, StrictInt

from feedsim.fields import Model, Quantity


@dataclass(frozen=True)
class Scheme:
    """How the units see each other within a step."""

    name: str
    stable_share: float  # of 2 J_inf/h that the friction's slope sigma_1 + sigma_2 may reach; docs/theory.md derives it
    speed: str  # friction: n_fr linear "within" the step, held at its "end" or its "start", or "extrapolated"
    torque_ramp: bool = True  # plant: M_a runs linearly from M_a(t_k) to M_a(t_k+1); else M_a(t_k) is held
    friction_ramp: bool = False  # plant: M_fr is extrapolated with the slope of its last step; else held
    passes: int = 1  # plant and friction go back and take the step again, with the slope of M_fr that they have found
    friction_first: bool = False  # friction steps ahead of the plant, which holds the torque found; else the plant does

    @property
    def speed_ramp(self) -> bool:
        """Whether friction is given the slope of its speed."""
        return self.speed in ("within", "extrapolated")


SCHEMES = {
    scheme.name: scheme
    for scheme in (
        Scheme("extrapolated", friction_ramp=True, stable_share=0.25, speed="within"),
        Scheme("iterated", friction_ramp=True, stable_share=0.5, speed="within", passes=2),
        Scheme("gauss_seidel", stable_share=0.5, speed="end"),
        Scheme("gauss_seidel_friction_first", stable_share=0.5, speed="start", friction_first=True),
        Scheme("jacobi", stable_share=0.25, speed="start"),
        Scheme("jacobi_extrapolated", friction_ramp=True, stable_share=0.1, speed="extrapolated"),
        Scheme("parallel", stable_share=0.25, speed="start", torque_ramp=False),
    )
}


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
