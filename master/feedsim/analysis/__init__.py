"""Derived figures from traces, responses of the linear system, and what takes several runs: docs/figures.md.

May use linear, cosim, structure, nc, scenario and trace.
Start with evaluate.py, which finds the figures that a scenario asks for; circularity.py is one of them, whole;
proposals.py says which parameter to change.
"""

from feedsim.analysis.circle import Diagnosis, explain_circle
from feedsim.analysis.circularity import Contour, Glitch, Turn, circularity, contour
from feedsim.analysis.contour_error import ContourError, with_frictionless
from feedsim.analysis.evaluate import (
    AccuracyTask,
    CircleTask,
    ContourTask,
    PositioningTask,
    Result,
    Task,
    check,
    contours,
    diagnoses,
    doubt_figures,
    evaluate,
    evaluates_contours,
    evaluates_stops,
    program_notes,
    tasks,
)
from feedsim.analysis.figures import Figure, Figures, FigureTable
from feedsim.analysis.positioning import Accuracy, Approach, deviation, positioning_figures, with_clamped

__all__ = [
    "Accuracy",
    "AccuracyTask",
    "Approach",
    "CircleTask",
    "Contour",
    "ContourError",
    "ContourTask",
    "Diagnosis",
    "Figure",
    "FigureTable",
    "Figures",
    "Glitch",
    "PositioningTask",
    "Result",
    "Task",
    "Turn",
    "check",
    "circularity",
    "contour",
    "contours",
    "deviation",
    "diagnoses",
    "doubt_figures",
    "evaluate",
    "evaluates_contours",
    "evaluates_stops",
    "explain_circle",
    "positioning_figures",
    "program_notes",
    "tasks",
    "with_clamped",
    "with_frictionless",
]  # fmt: skip
