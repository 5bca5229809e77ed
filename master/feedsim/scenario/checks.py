"""What only shows when the parts of a scenario are seen together; none of it needs a simulation."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from feedsim.fields import is_multiple, no_axis
from feedsim.motions import Circle, MeasuredSetpoints

if TYPE_CHECKING:
    from feedsim.scenario.model import CircleTest, Scenario

Place = tuple[str | int, ...]


def interval_fault(interval: float, control_cycle: float) -> str | None:
    """Why a recording interval [s] does not fit the control cycle [s]; None if it does."""
    if is_multiple(interval, control_cycle):
        return None
    return f"{interval:.9g} s is no whole multiple of the control cycle, {control_cycle:.9g} s"


def _plane_fault(item: CircleTest, columns: tuple[str, ...]) -> str | None:
    """Why recorded setpoints of the axes ``columns`` cannot be evaluated as a circle; None if they can."""
    plane = item.plane or columns
    if len(set(plane)) != 2:
        return f"setpoints of {', '.join(columns)} as a circle: plane must name two axes, for example plane: [X, Z]"
    if missing := [axis for axis in plane if axis not in columns]:
        return f"the recorded setpoints have no column for {missing[0]}; they have {', '.join(columns)}"
    if item.centre is not None and set(item.centre) != set(plane):
        return f"centre must give {plane[0]} and {plane[1]}, the axes of the plane"
    return None


def _logging_faults(scenario: Scenario) -> Iterator[tuple[Place, str]]:
    """Place and message of what does not fit the log's own signals, the axes and the control cycle."""
    logging = scenario.logging
    if logging is None:
        return
    if message := interval_fault(logging.interval, scenario.machine.cycles.T_c):
        yield ("logging", "interval"), message
    for i, axis in enumerate(logging.axes or ()):
        if axis not in scenario.machine.axes:
            yield ("logging", "axes", i), no_axis(axis, scenario.machine.axes)
    if logging.axes is None and not any(motion.axes for motion in scenario.motions):
        yield ("logging",), "no motion moves an axis; name the axes to be logged, for example axes: [Z]"
    for group, signals in logging.disturbed().items():
        for signal in signals:
            if signal not in logging.signals:
                yield ("logging", group, signal), f"{signal} is not logged; signals: {', '.join(logging.signals)}"


def contradictions(scenario: Scenario) -> Iterator[tuple[Place, str]]:
    """Place and message of everything in a scenario that cannot go together."""
    machine = scenario.machine
    if message := interval_fault(scenario.recording.interval, machine.cycles.T_c):
        yield ("recording", "interval"), message
    yield from _logging_faults(scenario)
    for i, motion in enumerate(scenario.motions):
        for axis in motion.axes:
            if axis not in machine.axes:
                yield ("motions", i), no_axis(axis, machine.axes)
    for i, item in enumerate(scenario.evaluate):
        chosen, known = item.motion, len(scenario.motions)
        if chosen is not None and chosen >= known:
            there = f"0 to {known - 1}" if known > 1 else "0 only"
            yield ("evaluate", i, "motion"), f"{chosen} is no entry of motions (entries: {there}, counted from 0)"
            continue
        motions = scenario.motions if chosen is None else scenario.motions[chosen : chosen + 1]
        if item.kind == "positioning":
            if not any(item.axis in motion.axes for motion in motions):
                which = "no motion moves" if chosen is None else f"motions.{chosen} ({motions[0].kind}) does not move"
                yield ("evaluate", i), f"positioning of axis {item.axis}, which {which}"
            continue
        circles = [motion for motion in motions if isinstance(motion, Circle)]
        recordings = [motion for motion in motions if isinstance(motion, MeasuredSetpoints)]
        if not circles and recordings:
            if message := _plane_fault(item, tuple(recordings[-1].columns)):
                yield ("evaluate", i), message
        elif not circles:
            which = "no motion is" if chosen is None else f"motions.{chosen} ({motions[0].kind}) is not"
            yield ("evaluate", i), f"a circle is to be evaluated, but {which} of kind circle"
        elif given := [name for name in ("plane", "centre", "radius") if getattr(item, name) is not None]:
            yield ("evaluate", i, given[0]), "only for recorded setpoints; a motion of kind circle has its own"
        elif item.turn is not None and item.turn > circles[-1].turns:
            turns = circles[-1].turns
            yield ("evaluate", i, "turn"), f"turn {item.turn} of a circle of {turns} turn{'s'[: turns != 1]}"
