"""The plant's pose in a run: how far the motion leaves it, or how the plant followed it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from feedsim.cosim.system import System
from feedsim.nc import Program
from feedsim.scenario import Machine
from feedsim.structure.pack import POSES_IN_ARCHIVE
from feedsim.structure.pose_change import NEAR, PoseChange, pose_change, warnings
from feedsim.structure.poses_file import GridAxis, read_grid
from feedsim.structure.table_check import table_mismatch


@dataclass(frozen=True)
class Crossings:
    """What happened where the plant changed cells, over a whole run.

    Attributes:
        count: crossings.
        kinetic_lost, elastic_lost: energy before less energy after, summed up [J].
        held: largest jump of an axis position that was taken back [m].
        jump_x_a, jump_tool: largest jump of an axis position, of the tool [m].
        jump_n_a: of a motor speed [rad/s].
    """

    count: int
    kinetic_lost: float
    elastic_lost: float
    held: float
    jump_x_a: float
    jump_n_a: float
    jump_tool: float


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


def pose_use(machine: Machine, program: Program, system: System) -> PoseUse:
    """Of a system that is built; with the crossings so far, where the plant follows its axes."""
    ranges = {axis: program.reached(axis) for axis in program.x_s}
    grid = _grid(system)
    followed = {axis.axis for axis in grid}
    change = pose_change(machine, {axis: reached for axis, reached in ranges.items() if axis not in followed})
    left = tuple(
        sentence for axis in grid if axis.axis in ranges for sentence in _left(axis, ranges[axis.axis], machine)
    )
    doubt = None if grid else table_mismatch(machine)  # a plant that follows has modes of its own
    doubts = () if doubt is None else (doubt,)
    return PoseUse(change, grid, _crossings(system) if grid else None, (*doubts, *left, *warnings(change)))


def _grid(system: System) -> tuple[GridAxis, ...]:
    if system.plant_modes_file is not None:
        return ()
    file = system.plant.archive.directory / POSES_IN_ARCHIVE
    return read_grid(file, system.plant_axes) if file.is_file() else ()


def _left(axis: GridAxis, reached: tuple[float, float], machine: Machine) -> list[str]:
    """The outermost cells reach on without end, but their modes are those of their centres."""
    travel = machine.axes[axis.axis].travel
    first, last = axis.reach
    beyond = max(first - max(reached[0], travel[0]), min(reached[1], travel[1]) - last)
    if beyond <= NEAR:
        return []
    return [
        f"axis {axis.axis} leaves the plant's grid of poses ({first * 1e3:.6g} mm to {last * 1e3:.6g} mm) by "
        f"{beyond * 1e3:.4g} mm: the modes there are those of the last cell; pack a wider grid"
    ]


def _crossings(system: System) -> Crossings:
    values: Mapping[str, float] = {
        name: system.plant.value(f"pose.{name}")
        for name in ("crossings", "E_kin_lost", "E_el_lost", "held", "jump_x_a", "jump_n_a", "jump_tool")
    }
    return Crossings(
        count=round(values["crossings"]),
        kinetic_lost=values["E_kin_lost"],
        elastic_lost=values["E_el_lost"],
        held=values["held"],
        jump_x_a=values["jump_x_a"],
        jump_n_a=values["jump_n_a"],
        jump_tool=values["jump_tool"],
    )
