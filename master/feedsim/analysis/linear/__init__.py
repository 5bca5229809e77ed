"""Frequency responses of structure and drives in closed form: exact for the sampled system, friction off.

May use structure, scenario and trace.
Start with system.py, which couples drive.py and plant.py; loops.py has the responses by their names.
"""

from feedsim.analysis.linear.drive import OperatingPoint
from feedsim.analysis.linear.evaluate import AxisResult, LinearResult, PositionLoop, SpeedLoop, evaluate, figures
from feedsim.analysis.linear.loops import (
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
)
from feedsim.analysis.linear.margins import (
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
from feedsim.analysis.linear.stability import unstable_poles
from feedsim.analysis.linear.system import Closed, LinearSystem

__all__ = [
    "AxisResult", "Bandwidth", "Closed", "Extreme", "GainCrossing", "LinearResult", "LinearSystem", "Margins",
    "OperatingPoint", "Pair", "PhaseCrossing", "PositionLoop", "SpeedLoop", "bandwidth", "compliance", "crossings",
    "delay", "evaluate", "extremes", "figures", "grid", "margins", "names", "pairs", "peak", "position_gain",
    "position_reference", "response", "scale_response", "speed_controlled_system", "speed_gain", "speed_reference",
    "structure", "unstable_poles",
]  # fmt: skip
