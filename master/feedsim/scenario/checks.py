"""What only shows when the parts of a scenario are seen together; none of it needs a simulation."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from feedsim.scenario.fields import is_multiple
from feedsim.scenario.motion import Arc, Circle, MeasuredSetpoints, Motion, Move

if TYPE_CHECKING:
    from feedsim.scenario.model import Scenario

Place = tuple[str | int, ...]


def moved_axes(motion: Motion) -> tuple[str, ...]:
    """Axes that a motion names, in its order."""
    if isinstance(motion, Move):
        return (*motion.by, *motion.to)
    if isinstance(motion, (Arc, Circle)):
        return motion.plane
    if isinstance(motion, MeasuredSetpoints):
        return tuple(motion.columns)
    return ()


def interval_fault(interval: float, control_cycle: float) -> str | None:
    """Why a recording interval [s] does not fit the control cycle [s]; None if it does."""
    if is_multiple(interval, control_cycle):
        return None
    return f"{interval:.9g} s is no whole multiple of the control cycle, {control_cycle:.9g} s"


def contradictions(scenario: Scenario) -> Iterator[tuple[Place, str]]:
    """Place and message of everything in a scenario that cannot go together."""
    machine = scenario.machine
    if message := interval_fault(scenario.recording.interval, machine.cycles.T_c):
        yield ("recording", "interval"), message
    for i, motion in enumerate(scenario.motions):
        for axis in moved_axes(motion):
            if axis not in machine.axes:
                yield ("motions", i), f"the machine has no axis {axis!r}; it has {', '.join(machine.axes)}"
    moved = {axis for motion in scenario.motions for axis in moved_axes(motion)}
    circles = [motion for motion in scenario.motions if isinstance(motion, Circle)]
    for i, item in enumerate(scenario.evaluate):
        if item.kind == "positioning" and item.axis not in moved:
            yield ("evaluate", i), f"positioning of axis {item.axis}, which no motion moves"
        if item.kind == "circle" and not circles:
            yield ("evaluate", i), "a circle is to be evaluated, but no motion is of kind circle"
        elif item.kind == "circle" and item.turn is not None and item.turn > circles[-1].turns:
            yield ("evaluate", i, "turn"), f"turn {item.turn} of a circle of {circles[-1].turns} turn(s)"
