"""The grid of poses in a plant's archive, and what happened where the plant changed from one to the next."""

from __future__ import annotations

from dataclasses import dataclass

from feedsim.cosim.system import System
from feedsim.structure.pack import POSES_IN_ARCHIVE
from feedsim.structure.poses_file import GridAxis, read_grid


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


def grid_of(system: System) -> tuple[GridAxis, ...]:
    """The axes whose pose the plant of a system follows; none where it has one pose."""
    if system.plant_modes_file is not None:
        return ()
    file = system.plant.archive.directory / POSES_IN_ARCHIVE
    return read_grid(file, system.plant_axes) if file.is_file() else ()


def crossings_of(system: System) -> Crossings:
    """The crossings so far, of a plant that follows its axes."""
    names = ("crossings", "E_kin_lost", "E_el_lost", "held", "jump_x_a", "jump_n_a", "jump_tool")
    count, *values = (system.plant.value(f"pose.{name}") for name in names)
    return Crossings(round(count), *values)
