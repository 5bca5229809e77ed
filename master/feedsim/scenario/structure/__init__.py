"""Structure files: what a machine's structure is made of, as geometry or as finite-element matrices. Here what every
kind gives.

May use files, fields and the scenario's base.
Start with checks.py: load_structure reads them.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, StrictStr

from feedsim.files.fields import Model, Quantity


class DampingStep(Model):
    """A damping ratio that counts for low frequencies."""

    below: Annotated[float, Quantity("rad/s", above=0, example="30 Hz")] = Field(
        description="Modes of lower frequency have this ratio"
    )
    ratio: Annotated[float, Quantity("1", minimum=0, maximum=1, example="6 %")] = Field(description="Damping ratio")


class Damping(Model):
    """Modal damping: one ratio, others for low frequencies."""

    ratio: Annotated[float, Quantity("1", minimum=0, maximum=1, example="2 %")] = Field(description="Damping ratio")
    steps: tuple[DampingStep, ...] = Field(
        default=(), description="Ratios of low modes; the step of the lowest frequency above a mode's counts"
    )


class Structure(Model):
    """What every kind of structure file gives. Frequencies are angular [rad/s]."""

    name: StrictStr = Field(default="", description="Name in reports")
    note: StrictStr = Field(default="", description="Remark shown wherever the structure's numbers are shown")
    damping: Damping = Field(description="Modal damping")
    cutoff: Annotated[float, Quantity("rad/s", above=0, example="1000 Hz")] = Field(
        default=6283.185307179586, description="Modes above this frequency are dropped"
    )
