"""A machine written as geometry -> mass, stiffness and ports at a pose.

A structure file is read and meshed once for all who look at other poses of its machine.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feedsim.errors import InputError
from feedsim.scenario.structure import Structure
from feedsim.scenario.structure.checks import contradictions, pose_faults
from feedsim.scenario.structure.geometry import GeometryStructure
from feedsim.scenario.structure.load import load_structure
from feedsim.structure.assembly import Assembly, Geometry
from feedsim.structure.file import State
from feedsim.structure.geometry.mesh import Mesh, symmetric, weighted
from feedsim.structure.geometry.springs import body_springs, drive_springs, ports


class Assembler:
    """Assembles one structure at any number of poses; what does not depend on the pose is made once.

    Raises:
        InputError: the structure contradicts itself (one that load_structure() accepted does not).
    """

    def __init__(self, structure: GeometryStructure) -> None:
        faults = [f"{'.'.join(str(key) for key in place)}: {message}" for place, message in contradictions(structure)]
        if faults:
            raise InputError.of(structure.name or "structure", faults)
        self.structure = structure
        self.mesh = Mesh(structure)

    def at(self, pose: Mapping[str, float]) -> Assembly:
        """The machine with its axes at `pose` [m].

        Raises:
            InputError: the pose lacks an axis, names another one, or is out of travel.
        """
        structure, mesh = self.structure, self.mesh
        if faults := list(pose_faults(structure, pose)):
            raise InputError.of("pose", faults)
        pose = {axis: float(pose[axis]) for axis in structure.axes}
        origins = mesh.origins(pose)
        positions = mesh.positions(origins)
        springs = list(body_springs(mesh, origins, positions))
        for axis in structure.axes:
            springs += drive_springs(mesh, axis, origins, positions)
        return Assembly(
            name=structure.name or "structure",
            mass=mesh.mass,
            stiffness=symmetric(mesh.stiffness + weighted(springs, mesh.size)),
            ports=ports(mesh, origins, positions),
            axes=tuple(structure.axes),
            labels=mesh.labels,
            geometry=_geometry(mesh, positions),
            pose=pose,
            units=None,
        )


def assemble(structure: GeometryStructure, pose: Mapping[str, float]) -> Assembly:
    """The machine with its axes at `pose` [m]; for many poses of one machine an Assembler saves time.

    Raises:
        InputError: the structure contradicts itself; the pose lacks an axis, names another one, or is out of travel.
    """
    return Assembler(structure).at(pose)


def movable(structure: Structure) -> Assembler:
    """The structure, to be assembled in any pose.

    Raises:
        InputError: its kind is known at one pose only.
    """
    if not isinstance(structure, GeometryStructure):
        raise InputError(
            f"{structure.name or 'the structure'}: finite-element matrices belong to one pose; modes that follow the "
            "axes need a structure of kind geometry, which can be assembled at any pose (docs/structure.md)"
        )
    return Assembler(structure)


def structure_axes(structure: Structure) -> tuple[str, ...]:
    """Axes of a structure of kind geometry; none of others."""
    return tuple(structure.axes) if isinstance(structure, GeometryStructure) else ()


@lru_cache(maxsize=8)
def structure_of(file: Path, state: State) -> Structure:
    """As load_structure; `state` is that of the file, so that a changed one is read anew."""
    return load_structure(file)


@lru_cache(maxsize=8)
def assembler_of(file: Path, state: State) -> Assembler:
    """As movable, of :func:`structure_of`."""
    return movable(structure_of(file, state))


def _geometry(mesh: Mesh, positions: NDArray[np.float64]) -> Geometry:
    dofs = mesh.first_dof[:, None] + np.arange(6)
    for axis, content in mesh.structure.axes.items():
        rotor = mesh.screw(axis).stop
        dofs[rotor] = -1
        # A rotor turns about its axis: of the frame's directions the nearest.
        dofs[rotor, 3 + int(np.argmax(np.abs(content.direction)))] = mesh.rotor(axis)
    return Geometry(
        nodes=positions,
        names=tuple(mesh.names),
        bodies=tuple(mesh.bodies),
        dofs=dofs,
        lines=np.array([[beam.first, beam.second] for beam in mesh.beams], dtype=np.int64).reshape(-1, 2),
    )
