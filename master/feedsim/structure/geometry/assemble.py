"""A machine written as geometry -> mass, stiffness and ports at a pose."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from feedsim.errors import InputError
from feedsim.scenario.structure.checks import contradictions, pose_faults
from feedsim.structure.assembly import Assembly, Geometry
from feedsim.structure.geometry.mesh import Mesh, symmetric, weighted
from feedsim.structure.geometry.springs import body_springs, drive_springs, ports

if TYPE_CHECKING:
    from feedsim.scenario.structure.geometry import GeometryStructure


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

    @property
    def total_mass(self) -> float:
        """Mass of everything [kg]."""
        return self._mass_of(np.ones(len(self.mesh.names), dtype=np.bool_))

    def moving_mass(self, axis: str) -> float:
        """Mass of all that moves with an axis [kg]: its bodies with their screws and motors."""
        bodies = self.structure.bodies
        return self._mass_of(np.array([axis in bodies[carrier].moves_with for carrier in self.mesh.carriers]))

    def _mass_of(self, nodes: NDArray[np.bool_]) -> float:
        """Mass that nodes carry [kg]: what a translation of them moves."""
        translation = np.zeros(self.mesh.size)
        six = np.diff(self.mesh.first_dof, append=self.mesh.size) == 6
        translation[self.mesh.first_dof[nodes & six]] = 1.0
        return float(translation @ (self.mesh.mass @ translation))

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
        )


def assemble(structure: GeometryStructure, pose: Mapping[str, float]) -> Assembly:
    """The machine with its axes at `pose` [m]; for many poses of one machine an Assembler saves time.

    Raises:
        InputError: the structure contradicts itself; the pose lacks an axis, names another one, or is out of travel.
    """
    return Assembler(structure).at(pose)


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
