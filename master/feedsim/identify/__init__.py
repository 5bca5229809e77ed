"""Friction of an axis from recorded traces: records, both stages of identification, and what they find."""

from feedsim.identify.friction_file import Identified
from feedsim.identify.identify import Progress, identify
from feedsim.identify.options import STAGES, Options
from feedsim.identify.read import Provenance, Recorded, read_records
from feedsim.identify.record import Record
from feedsim.identify.result import Estimate, Identification

__all__ = [
    "STAGES",
    "Estimate",
    "Identification",
    "Identified",
    "Options",
    "Progress",
    "Provenance",
    "Record",
    "Recorded",
    "identify",
    "read_records",
]
