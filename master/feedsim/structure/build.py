"""From a structure file and a pose to the machine's modes: assemble, check, solve."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from feedsim import units
from feedsim.errors import InputError
from feedsim.scenario.structure import Structure
from feedsim.scenario.structure.geometry import GeometryStructure
from feedsim.scenario.structure.matrices import FiniteElements
from feedsim.structure.assembly import SAME_POSITION, Assembly
from feedsim.structure.geometry.assemble import assemble as assemble_geometry
from feedsim.structure.matrices.build import import_model
from feedsim.structure.model_check import check, frequency_warnings
from feedsim.structure.solve import Solution, solve


@dataclass(frozen=True, eq=False)
class Built:
    """A machine's finite-element model at a pose, its modes, and what a person should know of both."""

    assembly: Assembly
    solution: Solution
    warnings: tuple[str, ...]


def assemble(structure: Structure, pose: Mapping[str, float]) -> tuple[Assembly, tuple[str, ...]]:
    """The finite-element model at a pose (axis -> position [m]), and notes on the import.

    Matrices were made at one pose: theirs, if they name it, counts for axes that `pose` leaves out.

    Raises:
        InputError: the structure is faulty, the pose is incomplete or out of travel, or not that of the matrices.
    """
    if isinstance(structure, GeometryStructure):
        return assemble_geometry(structure, pose), ()
    if not isinstance(structure, FiniteElements):
        raise TypeError(f"no kind of structure: {type(structure).__name__}")
    model = import_model(structure)
    own = model.assembly.pose
    for axis, position in pose.items():
        if axis not in structure.axes:
            known = ", ".join(structure.axes) or "none"
            raise InputError(f"{model.assembly.name}: the pose names {axis!r}, which is no axis; axes: {known}")
        if axis in own and abs(own[axis] - position) > SAME_POSITION:
            raise InputError(
                f"{model.assembly.name}: the matrices were made with {axis} at {units.show(own[axis], 'm')}; modes at "
                f"{units.show(position, 'm')} need matrices of that pose, or a structure of kind geometry"
            )
    return model.assembly, model.notes


def build(
    structure: Structure,
    pose: Mapping[str, float],
    *,
    cutoff: float | None = None,
    static_correction: bool = False,
    progress: Callable[[str], None] | None = None,
) -> Built:
    """Assemble a structure at a pose (axis -> position [m]), check it, and compute its modes.

    cutoff: [rad/s], in place of the structure's own. static_correction: see :func:`feedsim.structure.solve.solve`.

    Raises:
        InputError: from any of the three, each fault with its own message.
    """
    say = progress or (lambda _: None)
    say("assembling")
    assembly, notes = assemble(structure, pose)
    say(f"checking {assembly.mass.shape[0]} degrees of freedom")
    warnings = check(assembly)
    solution = solve(
        assembly,
        cutoff=structure.cutoff if cutoff is None else cutoff,
        damping=structure.damping,
        static_correction=static_correction,
        progress=progress,
    )
    elastic = solution.modes.frequency[solution.modes.frequency > 0]
    if len(elastic):
        warnings += frequency_warnings(2 * math.pi * float(elastic.min()))
    return Built(assembly, solution, (*notes, *warnings))
