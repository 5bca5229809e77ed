"""The NC: from a scenario's motions to setpoints at the position cycle."""

from feedsim.nc.program import plan
from feedsim.nc.segment import (
    Circular,
    Oscillation,
    Oscillations,
    Program,
    Recorded,
    Segment,
    Straight,
    Stroke,
    Strokes,
)

__all__ = [
    "Circular",
    "Oscillation",
    "Oscillations",
    "Program",
    "Recorded",
    "Segment",
    "Straight",
    "Stroke",
    "Strokes",
    "plan",
]
