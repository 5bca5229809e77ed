"""Scenario and machine files: YAML with units, checked, as objects in SI."""

from feedsim.scenario.checks import moved_axes
from feedsim.scenario.load import load, load_machine
from feedsim.scenario.machine import Axis, CurrentController, Cycles, Drive, Filter, Friction, Machine, PathLimits
from feedsim.scenario.model import CircleTest, Coupling, Evaluation, Positioning, Recording, Scenario
from feedsim.scenario.motion import Arc, Circle, Column, Dwell, MeasuredSetpoints, Motion, Move
from feedsim.scenario.schema import json_schema

__all__ = [
    "Arc",
    "Axis",
    "Circle",
    "CircleTest",
    "Column",
    "Coupling",
    "CurrentController",
    "Cycles",
    "Drive",
    "Dwell",
    "Evaluation",
    "Filter",
    "Friction",
    "Machine",
    "MeasuredSetpoints",
    "Motion",
    "Move",
    "PathLimits",
    "Positioning",
    "Recording",
    "Scenario",
    "json_schema",
    "load",
    "load_machine",
    "moved_axes",
]
