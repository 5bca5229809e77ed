"""How far a motion leaves the pose of its plant, or how the plant followed it."""

from __future__ import annotations

from dataclasses import dataclass

from feedsim.cosim import Crossings
from feedsim.nc import Program
from feedsim.scenario import Machine
from feedsim.structure.pose_change import MIN_POSE_DISTANCE, PoseChange, pose_change, warnings
from feedsim.structure.poses_file import GridAxis
from feedsim.structure.table_check import table_mismatch


@dataclass(frozen=True)
class PoseUse:
    """How the plant of a run stands to the positions that its axes reached.

    Attributes:
        change: the axes whose pose the plant does not follow.
        grid: the axes that it follows; none where it has one pose.
        crossings: None before a run, and where the plant has one pose.
    """

    change: PoseChange
    grid: tuple[GridAxis, ...] = ()
    crossings: Crossings | None = None
    warnings: tuple[str, ...] = ()


def pose_use(
    machine: Machine, program: Program, grid: tuple[GridAxis, ...], crossings: Crossings | None = None
) -> PoseUse:
    """How the plant of a machine stands to a motion. grid: the axes that the plant follows.

    Raises:
        InputError: the machine's structure cannot be read.
    """
    ranges = {axis: program.reached(axis) for axis in program.x_s}
    followed = {axis.axis for axis in grid}
    change = pose_change(machine, {axis: reached for axis, reached in ranges.items() if axis not in followed})
    outside = tuple(
        sentence for axis in grid if axis.axis in ranges for sentence in left_grid(axis, ranges[axis.axis], machine)
    )
    doubt = None if grid else table_mismatch(machine)  # a plant that follows has modes of its own
    doubts = () if doubt is None else (doubt,)
    return PoseUse(change, grid, crossings, (*doubts, *outside, *warnings(change)))


def left_grid(axis: GridAxis, reached: tuple[float, float], machine: Machine) -> list[str]:
    """The outermost cells reach on without end, but their modes are those of their centres."""
    travel = machine.axes[axis.axis].travel
    first, last = axis.reach
    beyond = max(first - max(reached[0], travel[0]), min(reached[1], travel[1]) - last)
    if beyond <= MIN_POSE_DISTANCE:
        return []
    return [
        f"axis {axis.axis} leaves the plant's grid of poses ({first * 1e3:.6g} mm to {last * 1e3:.6g} mm) by "
        f"{beyond * 1e3:.4g} mm: the modes there are those of the last cell; pack a wider grid"
    ]
