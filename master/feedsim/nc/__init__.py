"""The NC: from a scenario's motions to setpoints at the position cycle."""

from feedsim.nc.program import plan
from feedsim.nc.segment import Circular, Program, Recorded, Segment, Straight

__all__ = ["Circular", "Program", "Recorded", "Segment", "Straight", "plan"]
