"""Scenario and machine files: YAML with units, checked, as objects in SI."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from feedsim.scenario.base import Base, Change
from feedsim.scenario.columns import Columns, load_columns
from feedsim.scenario.file_kind import is_ssp, is_study
from feedsim.scenario.load import load, load_machine, load_structure
from feedsim.scenario.logging import Delay, Level, Logging, Noise, Quantisation
from feedsim.scenario.machine import Axis, CurrentController, Cycles, Drive, Filter, Friction, Machine, PathLimits
from feedsim.scenario.model import CircleTest, Coupling, Evaluation, Positioning, Recording, Scenario
from feedsim.scenario.roles import ForeignUnit
from feedsim.scenario.structure import Damping, DampingStep, Structure
from feedsim.scenario.subject import Subject, load_subject

if TYPE_CHECKING:
    from feedsim.scenario.described import Described, load_described
    from feedsim.scenario.schema import json_schema
    from feedsim.scenario.study import Choice, Distribution, Parameter, Sampling, Study, load_study
    from feedsim.scenario.tolerances import ToleranceFile, load_tolerances

__all__ = [
    "Axis",
    "Base",
    "Change",
    "Choice",
    "CircleTest",
    "Columns",
    "Coupling",
    "CurrentController",
    "Cycles",
    "Damping",
    "DampingStep",
    "Delay",
    "Described",
    "Distribution",
    "Drive",
    "Evaluation",
    "Filter",
    "ForeignUnit",
    "Friction",
    "Level",
    "Logging",
    "Machine",
    "Noise",
    "Parameter",
    "PathLimits",
    "Positioning",
    "Quantisation",
    "Recording",
    "Sampling",
    "Scenario",
    "Structure",
    "Study",
    "Subject",
    "ToleranceFile",
    "is_ssp",
    "is_study",
    "json_schema",
    "load",
    "load_columns",
    "load_described",
    "load_machine",
    "load_structure",
    "load_study",
    "load_subject",
    "load_tolerances",
]

# Loaded on first use: a run should not wait for the models of files that it does not read.
_HOMES = {
    "Choice": "study",
    "Described": "described",
    "Distribution": "study",
    "Parameter": "study",
    "Sampling": "study",
    "Study": "study",
    "ToleranceFile": "tolerances",
    "json_schema": "schema",
    "load_described": "described",
    "load_study": "study",
    "load_tolerances": "tolerances",
}


def __getattr__(public: str) -> Any:
    if public not in _HOMES:
        raise AttributeError(f"module 'feedsim.scenario' has no attribute '{public}'")
    return getattr(import_module(f"feedsim.scenario.{_HOMES[public]}"), public)
