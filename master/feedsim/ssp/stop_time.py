"""Another stop time than that of the motions: which rows must agree, and what is left of motions and evaluation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from feedsim.motions.circular import Circular
from feedsim.motions.setpoints import Recorded
from feedsim.nc import Program, Segment
from feedsim.scenario import CircleTest, Positioning, Scenario

LEAST_REST = 0.050  # s, behind a motion whose positioning is evaluated (feedsim.analysis)

Array = NDArray[np.float64]


def agree(planned: Mapping[str, Array], table: Mapping[str, Array]) -> bool:
    """Whether setpoints (N,) and (M,) are the same as long as both last, and the axes of a longer table then rest."""
    if set(planned) != set(table):
        return False
    for axis, x in planned.items():
        common = min(len(x), len(table[axis]))
        if not np.array_equal(x[:common], table[axis][:common]) or np.any(table[axis][common:] != x[-1]):
            return False
    return True


def segments(planned: Program, program: Program) -> tuple[Segment, ...]:
    """The segments of `planned` up to the end of `program`, the last one cut where it lasts longer."""
    if len(program.time) >= len(planned.time):
        return planned.segments
    end = program.duration
    slack = 1e-6 * (program.time[1] - program.time[0])  # exact ends carry rounding errors
    kept = [segment for segment in planned.segments if segment.start < end - slack]
    return _cut(kept, program) if kept and kept[-1].end > end + slack else tuple(kept)


def _cut(kept: list[Segment], program: Program) -> tuple[Segment, ...]:
    last = kept[-1]
    reached = {axis: float(x_s[-1]) for axis, x_s in program.x_s.items()}
    cut = replace(
        last, end=program.duration, description=f"{last.description}, cut at the stop time", target=reached,
        geometry=None,
    )  # fmt: skip
    return (*kept[:-1], cut)


def evaluation(scenario: Scenario, planned: Program, program: Program) -> tuple[Scenario, list[str]]:
    """The scenario without what can no longer be evaluated, and what that is."""
    kept, lost = [], []
    for i, item in enumerate(scenario.evaluate):
        needed = _needed(item, planned)
        if needed is None or needed <= program.duration + 1e-9:
            kept.append(item)  # where nothing is found the evaluation itself says why
        else:
            what = f"positioning of {item.axis}" if isinstance(item, Positioning) else "circularity"
            lost.append(f"evaluate.{i} ({what}, to {needed:.6g} s)")
    return (scenario.model_copy(update={"evaluate": tuple(kept)}), lost) if lost else (scenario, [])


def _needed(item: Positioning | CircleTest, planned: Program) -> float | None:
    """Until when the motions must run for an evaluation [s]; None where they have nothing for it."""
    chosen = planned.segments if item.motion is None else planned.segments[item.motion : item.motion + 1]
    if isinstance(item, Positioning):
        moved = [each.end for each in chosen if each.origin[item.axis] != each.target[item.axis]]
        return min(moved[-1] + LEAST_REST, planned.duration) if moved else None
    circles = [each.end for each in chosen if isinstance(each.geometry, Circular | Recorded)]
    return min(circles[-1], planned.duration) if circles else None
