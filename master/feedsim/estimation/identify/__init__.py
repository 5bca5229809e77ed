"""Friction of an axis from recorded traces: records, both stages of identification, what they find, and friction.yaml.

May use analysis, structure, scenario and trace, and the friction law of cosim.
Start with stages.py: records -> motion -> stage 1 (stribeck.py) -> stage 2 (output_error.py) -> result.py.
"""

from feedsim.estimation.identify.axis_limits import AxisLimits, identify_axis_limits
from feedsim.estimation.identify.excerpt import best_window, excerpt, total_time
from feedsim.estimation.identify.friction_file import IdentifiedFriction
from feedsim.estimation.identify.read import Provenance, RecordedAxis, named_apart, read_records, read_traces
from feedsim.estimation.identify.record import Record
from feedsim.estimation.identify.result import Estimate, Identification
from feedsim.estimation.identify.stages import STAGES, AxisRequest, Options, Progress, identify

__all__ = [
    "STAGES",
    "AxisLimits",
    "AxisRequest",
    "Estimate",
    "Identification",
    "IdentifiedFriction",
    "Options",
    "Progress",
    "Provenance",
    "Record",
    "RecordedAxis",
    "best_window",
    "excerpt",
    "identify",
    "identify_axis_limits",
    "named_apart",
    "read_records",
    "read_traces",
    "total_time",
]  # fmt: skip
