"""Derived figures from traces: positioning, circularity. Definitions: docs/figures.md."""

from feedsim.analysis.circularity import Contour, Glitch, Turn, circularity, contour
from feedsim.analysis.evaluate import CircleTask, PositioningTask, Result, Task, check, evaluate, tasks
from feedsim.analysis.figures import Figure, Figures
from feedsim.analysis.positioning import Approach, deviation, positioning

__all__ = [
    "Approach",
    "CircleTask",
    "Contour",
    "Figure",
    "Figures",
    "Glitch",
    "PositioningTask",
    "Result",
    "Task",
    "Turn",
    "check",
    "circularity",
    "contour",
    "deviation",
    "evaluate",
    "positioning",
    "tasks",
]
