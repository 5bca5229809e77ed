"""Scenario and machine files as objects in SI. structure, study and described read what lies beside a scenario.

May use files, fields, motions, variables and trace.
Start with load.py: ``load``.
"""

from feedsim.scenario.axis_units import CurrentController, Drive, Filter, Friction, FrictionParameters, GmsFriction
from feedsim.scenario.base import Base, Change
from feedsim.scenario.load import Subject, load, load_machine, load_subject
from feedsim.scenario.machine import Axis, Cycles, Machine
from feedsim.scenario.model import (
    CircleTest,
    ContourTest,
    Coupling,
    Delay,
    Level,
    Logging,
    Noise,
    Positioning,
    PositioningAccuracy,
    Quantisation,
    Recording,
    Scenario,
)
from feedsim.scenario.roles import ForeignUnit

__all__ = [
    "Axis", "Base", "Change", "CircleTest", "ContourTest", "Coupling", "CurrentController", "Cycles", "Delay",
    "Drive", "Filter", "ForeignUnit", "Friction", "FrictionParameters", "GmsFriction", "Level", "Logging", "Machine",
    "Noise", "Positioning", "PositioningAccuracy", "Quantisation", "Recording", "Scenario", "Subject", "load",
    "load_machine", "load_subject",
]  # fmt: skip
