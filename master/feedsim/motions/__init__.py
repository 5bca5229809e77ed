"""The kinds of motion: what a file says of each, and the way that it takes, in positions of the axes.

May use fields, trace, units and errors. The planner, nc, lays what they answer end to end; it knows none by name.
Start with kind.py, and dwell.py for the smallest one. A new kind is a file here and its name in ``Motion`` below.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from feedsim.motions.circular import Arc, Circle
from feedsim.motions.constant_speed import ConstantSpeed, SpeedRange
from feedsim.motions.dwell import Dwell
from feedsim.motions.move import Move
from feedsim.motions.positioning_cycle import PositioningCycle
from feedsim.motions.program import PartProgram
from feedsim.motions.setpoints import Column, MeasuredSetpoints
from feedsim.motions.sine import Sine, SineMove

__all__ = [
    "Arc", "Circle", "Column", "ConstantSpeed", "Dwell", "MeasuredSetpoints", "Motion", "Move", "PartProgram",
    "PositioningCycle", "Sine", "SineMove", "SpeedRange",
]  # fmt: skip

Motion = Annotated[
    Move | Arc | Circle | Dwell | MeasuredSetpoints | ConstantSpeed | Sine | PositioningCycle | PartProgram,
    Field(discriminator="kind"),
]
