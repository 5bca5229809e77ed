"""Scenario and machine files: YAML with units, checked, as objects in SI."""

from feedsim.scenario.checks import moved_axes
from feedsim.scenario.columns import Columns, load_columns
from feedsim.scenario.described import Described, load_described
from feedsim.scenario.experiment import ConstantSpeed, Sine, SineMove, SpeedRange
from feedsim.scenario.load import load, load_machine, load_structure
from feedsim.scenario.logging import Delay, Level, Logging, Noise, Quantisation
from feedsim.scenario.machine import Axis, CurrentController, Cycles, Drive, Filter, Friction, Machine, PathLimits
from feedsim.scenario.model import CircleTest, Coupling, Evaluation, Positioning, Recording, Scenario
from feedsim.scenario.motion import Arc, Circle, Column, Dwell, MeasuredSetpoints, Motion, Move
from feedsim.scenario.schema import json_schema
from feedsim.scenario.structure import Damping, DampingStep, Structure
from feedsim.scenario.subject import Subject, load_subject
from feedsim.scenario.tolerances import ToleranceFile, load_tolerances

__all__ = [
    "Arc",
    "Axis",
    "Circle",
    "CircleTest",
    "Column",
    "Columns",
    "ConstantSpeed",
    "Coupling",
    "CurrentController",
    "Cycles",
    "Damping",
    "DampingStep",
    "Delay",
    "Described",
    "Drive",
    "Dwell",
    "Evaluation",
    "Filter",
    "Friction",
    "Level",
    "Logging",
    "Machine",
    "MeasuredSetpoints",
    "Motion",
    "Move",
    "Noise",
    "PathLimits",
    "Positioning",
    "Quantisation",
    "Recording",
    "Scenario",
    "Sine",
    "SineMove",
    "SpeedRange",
    "Structure",
    "Subject",
    "ToleranceFile",
    "json_schema",
    "load",
    "load_columns",
    "load_described",
    "load_machine",
    "load_structure",
    "load_subject",
    "load_tolerances",
    "moved_axes",
]
