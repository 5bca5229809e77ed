"""Frequency responses of structure and drives in closed form: exact for the sampled system, friction off."""

from feedsim.analysis.linear.drive import OperatingPoint
from feedsim.analysis.linear.evaluate import AxisResult, LinearResult, PositionLoop, SpeedLoop, evaluate
from feedsim.analysis.linear.figures import figures
from feedsim.analysis.linear.loops import (
    compliance,
    position_gain,
    position_reference,
    scale_response,
    speed_controlled_system,
    speed_gain,
    speed_reference,
    structure,
)
from feedsim.analysis.linear.margins import Bandwidth, GainCrossing, Margins, PhaseCrossing, bandwidth, delay, margins
from feedsim.analysis.linear.search import Extreme, Pair, crossings, extremes, grid, pairs, peak
from feedsim.analysis.linear.stability import unstable_poles
from feedsim.analysis.linear.system import Closed, LinearSystem

__all__ = [
    "AxisResult", "Bandwidth", "Closed", "Extreme", "GainCrossing", "LinearResult", "LinearSystem", "Margins",
    "OperatingPoint", "Pair", "PhaseCrossing", "PositionLoop", "SpeedLoop", "bandwidth", "compliance", "crossings",
    "delay", "evaluate", "extremes", "figures", "grid", "margins", "pairs", "peak", "position_gain",
    "position_reference", "scale_response", "speed_controlled_system", "speed_gain", "speed_reference", "structure",
    "unstable_poles",
]  # fmt: skip
