"""Does a machine's table of modes belong to its pose? What a run, a check and packing ask before they trust it."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

from feedsim import units
from feedsim.errors import FeedsimError
from feedsim.scenario import Machine
from feedsim.structure.at_hand import State, assembler_of, state_of, structure_of
from feedsim.structure.info import stale
from feedsim.structure.modes import Modes, read_modes
from feedsim.structure.poses import SAME_FREQUENCY, structure_axes
from feedsim.structure.solve import solve


def table_doubt(machine: Machine) -> str | None:
    """A sentence where the table of modes is not that of the machine's pose by its structure; None where it is.

    None as well where it cannot be told: no structure, matrices (of one pose, and costly to solve), or a structure that
    is faulty, which who needs it will say.
    """
    if machine.structure is None:
        return None
    try:
        built = _modes(machine.structure, state_of(machine.structure), tuple(machine.pose.items()))
        how = stale(read_modes(machine.modes, list(machine.axes)), built, SAME_FREQUENCY) if built else ""
    except (OSError, FeedsimError):
        return None
    if not how:
        return None
    return (
        f"the table of modes {machine.modes} is not that of the pose {_shown(machine.pose, ' ')}: {how}; build it "
        f"anew: feedsim machine build {machine.structure} --at {_shown(machine.pose, '=')} --out DIR"
    )


def _shown(pose: Mapping[str, float], between: str) -> str:
    if between == "=":
        return " ".join(f"{axis}={1e3 * position:.9g}mm" for axis, position in pose.items())
    return ", ".join(f"{axis}{between}{units.show(position, 'm')}" for axis, position in pose.items())


@lru_cache(maxsize=32)
def _modes(structure: Path, state: State, pose: tuple[tuple[str, float], ...]) -> Modes | None:
    """Modes at the pose; `state` is that of the file, so that a changed one is read anew."""
    description = structure_of(structure, state)
    axes = structure_axes(description)
    if not axes:
        return None
    assembly = assembler_of(structure, state).at({axis: position for axis, position in pose if axis in axes})
    # The sparse way: of a model of some hundred degrees of freedom, in less than half the time of full matrices.
    return solve(assembly, cutoff=description.cutoff, damping=description.damping, dense_limit=0, described=False).modes
