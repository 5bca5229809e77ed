"""All axes are held."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from feedsim.files.fields import Quantity
from feedsim.motions.kind import Course, MotionKind, Start, whole_cycles


class Dwell(MotionKind):
    """All axes are held."""

    kind: Literal["dwell"] = "dwell"
    duration: Annotated[float, Quantity("s", above=0, example="1.2 s")] = Field(description="Time at rest")

    @property
    def held(self) -> float:
        return self.duration

    @property
    def description(self) -> str:
        return f"dwell {self.duration:g} s"

    def plan(self, start: Start) -> Course:
        return Course(self.duration, whole_cycles(self.duration, start.T_ipo))
