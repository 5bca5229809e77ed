"""Figures of the linear system (feedsim.linear), and its names at one place for who evaluates it.

May use linear, structure, scenario and trace.
Start with evaluate.py.
"""

from feedsim.analysis.linear.evaluate import AxisResult, LinearResult, PositionLoop, SpeedLoop, evaluate, figures
from feedsim.linear.loops import (
    compliance,
    names,
    position_gain,
    position_reference,
    response,
    scale_response,
    speed_controlled_system,
    speed_gain,
    speed_reference,
    structure,
    unstable_poles,
)
from feedsim.linear.margins import (
    Bandwidth,
    Extreme,
    GainCrossing,
    Margins,
    Pair,
    PhaseCrossing,
    bandwidth,
    crossings,
    delay,
    extremes,
    grid,
    margins,
    pairs,
    peak,
)
from feedsim.linear.plant import OperatingPoint
from feedsim.linear.system import ClosedLoop, LinearSystem

__all__ = [
    "AxisResult", "Bandwidth", "ClosedLoop", "Extreme", "GainCrossing", "LinearResult", "LinearSystem", "Margins",
    "OperatingPoint", "Pair", "PhaseCrossing", "PositionLoop", "SpeedLoop", "bandwidth", "compliance", "crossings",
    "delay", "evaluate", "extremes", "figures", "grid", "margins", "names", "pairs", "peak", "position_gain",
    "position_reference", "response", "scale_response", "speed_controlled_system", "speed_gain", "speed_reference",
    "structure", "unstable_poles",
]  # fmt: skip
