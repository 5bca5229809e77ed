"""Which figures a scenario asks for: from its `evaluate` list and the planned program to approaches and turns."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from typing import Protocol

from feedsim.analysis.circularity import Turn, axis_letters, circularity
from feedsim.analysis.figures import Figure
from feedsim.analysis.positioning import Approach, positioning
from feedsim.errors import InputError
from feedsim.nc import Circular, Program, Straight
from feedsim.scenario import CircleTest, Positioning, Scenario
from feedsim.trace import Trace


class Result(Protocol):
    """What evaluation needs of a run."""

    @property
    def scenario(self) -> Scenario: ...
    @property
    def program(self) -> Program: ...
    @property
    def trace(self) -> Trace: ...


@dataclass(frozen=True)
class PositioningTask:
    """A stop to evaluate; ``band`` [m], ``prefix`` of its figures."""

    prefix: str
    approach: Approach
    band: float

    @property
    def needs(self) -> tuple[str, ...]:
        """Columns without which there is nothing to evaluate."""
        return (f"{self.approach.axis}.x_a",)

    def figures(self, trace: Trace) -> dict[str, Figure]:
        """Figures of the task, without prefix."""
        return positioning(trace, self.approach, band=self.band)


@dataclass(frozen=True)
class CircleTask:
    """A turn to evaluate; ``prefix`` of its figures."""

    prefix: str
    turn: Turn

    @property
    def needs(self) -> tuple[str, ...]:
        """Columns without which there is nothing to evaluate."""
        return (f"{self.turn.axes[0]}.x_a", f"{self.turn.axes[1]}.x_a")

    def figures(self, trace: Trace) -> dict[str, Figure]:
        """Figures of the task, without prefix."""
        return circularity(trace, self.turn)


Task = PositioningTask | CircleTask


def tasks(scenario: Scenario, program: Program) -> tuple[Task, ...]:
    """One task per entry of ``scenario.evaluate``. Raises InputError where the program has nothing to evaluate."""
    found: list[Task] = []
    for item in scenario.evaluate:
        task = _stop(item, program) if isinstance(item, Positioning) else _turn(item, program)
        same = sum(other.prefix.partition("#")[0] == task.prefix for other in found)
        if same:  # the same axis or plane once more: X, X#2, X#3
            task = _renamed(task, f"{task.prefix}#{same + 1}")
        found.append(task)
    return tuple(found)


def check(scenario: Scenario, program: Program) -> None:
    """Raise InputError where ``evaluate`` would after the simulation: nothing to evaluate, or too little recorded."""
    patterns = scenario.recording.variables
    problems = [
        f"{scenario.file}: evaluation of {task.prefix} needs {name}, which recording.variables leaves out"
        for task in tasks(scenario, program)
        for name in task.needs
        if patterns is not None and not any(fnmatchcase(name, pattern) for pattern in patterns)
    ]
    if problems:
        raise InputError.of(f"{scenario.file}: the evaluation is not possible", problems)


def evaluate(result: Result) -> dict[str, Figure]:
    """Every figure that the scenario of ``result`` asks for, e.g. "Z.overshoot", "XZ.G", "XZ.tool.glitch_X"."""
    return {
        f"{task.prefix}.{name}": figure
        for task in tasks(result.scenario, result.program)
        for name, figure in task.figures(result.trace).items()
    }


def _stop(item: Positioning, program: Program) -> PositioningTask:
    moved = [s for s in program.segments if s.origin[item.axis] != s.target[item.axis]]
    if not moved:
        raise InputError(f"positioning of axis {item.axis}: no motion takes it to another position")
    segment = moved[-1]
    approach = Approach(
        axis=item.axis,
        start=segment.start,
        end=segment.end,
        until=program.until(segment),
        origin=segment.origin[item.axis],
        target=segment.target[item.axis],
        steady=segment.geometry.steady if isinstance(segment.geometry, Straight) else None,
    )
    return PositioningTask(item.axis, approach, item.band)


def _turn(item: CircleTest, program: Program) -> CircleTask:
    circles = [s.geometry for s in program.segments if s.kind == "circle" and isinstance(s.geometry, Circular)]
    if not circles:
        raise InputError("circularity: the program has no circle")
    circle = circles[-1]
    number = item.turn or len(circle.turns) // 2 + 1
    if number > len(circle.turns):
        raise InputError(f"circularity: turn {number} of a circle of {len(circle.turns)} turns")
    begin, end = circle.turns[number - 1]
    turn = Turn(circle.axes, circle.centre, circle.radius, circle.sense, begin, end)
    return CircleTask(axis_letters(circle.axes), turn)


def _renamed(task: Task, prefix: str) -> Task:
    return replace(task, prefix=prefix)
