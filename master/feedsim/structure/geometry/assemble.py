"""A machine written as geometry -> mass, stiffness and ports at a pose.

A structure file is read and meshed once for all who look at other poses of its machine.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feedsim.foundation.errors import InputError
from feedsim.scenario.structure import Drive, GeometryStructure, Hold, Mount, Structure
from feedsim.scenario.structure_checks import (
    contradictions,
    load_structure,
    node,
    nodes,
    pose_faults,
    rail,
    resolve_attachment,
)
from feedsim.structure.assembly import Assembly, Floats, Geometry, MountPort, State
from feedsim.structure.geometry.mesh import FRAME, Mesh, Row, rigid_grip, sum_weighted_rows, symmetric

# --- Springs of a machine at a pose, each a stiffness and the row of the elongation it resists; and the ports ---------
# Mounts hold the bed on the ground, carriages hold bodies on rails, bearings hold screws, nuts join bodies to screws,
# couplings join rotors to screws. Where a spring acts depends on the pose, and nothing else does.


Springs = Iterator[tuple[float, Row]]
FRAME_BY_LETTER = tuple(zip("XYZ", FRAME, strict=True))


def mount_rows(mesh: Mesh, name: str) -> Iterator[tuple[str, Mount, int, Row]]:
    """Mounts of a body, a direction of each at a time: name, what the file says, number of the direction, row."""
    for mount in mesh.structure.bodies[name].mounts:
        for item in (item for text in mount.nodes for item in nodes(mesh.structure, name, text)):
            number = mesh.number(item)
            grip = rigid_grip(np.array(mount.offset), np.zeros((1, 3)), [int(mesh.first_dof[number])])
            for d, (letter, direction) in enumerate(FRAME_BY_LETTER):
                yield f"{item} {letter}", mount, d, grip.displacement(direction)


def body_springs(mesh: Mesh, origins: Mapping[str, Floats], positions: Floats) -> Springs:
    """Mounts and carriages."""
    structure = mesh.structure
    for name, body in structure.bodies.items():
        for _, mount, d, row in mount_rows(mesh, name):
            yield mount.stiffness[d], row
        for carriage in body.carriages:
            point = origins[name] + carriage.at
            number = mesh.number(nodes(structure, name, carriage.node)[0])
            mine = rigid_grip(point, positions[[number]], [int(mesh.first_dof[number])])
            rails = mesh.rail_grip_at(point, mesh.rail(rail(structure, carriage.rail)), positions)
            for way in carriage.directions:
                direction = np.array(way)
                yield carriage.stiffness, mine.displacement(direction) - rails.displacement(direction)


def drive_springs(mesh: Mesh, axis: str, origins: Mapping[str, Floats], positions: Floats) -> Springs:
    """Bearings, nut and coupling of an axis. Displacement and angle count along and about the axis's direction."""
    structure = mesh.structure
    drive, along = structure.axes[axis].drive, np.array(structure.axes[axis].direction)
    screw = mesh.screw(axis)
    for bearing in drive.bearings:
        end = screw[0] if bearing.at == "start" else screw[-1]
        point = positions[end]
        carrier = mesh.grip(point, resolve_attachment(structure, bearing.held_by), positions)
        journal = rigid_grip(point, point[None], [int(mesh.first_dof[end])])
        for direction, stiffness in _along_and_across(along, bearing.axial, bearing.radial):
            yield stiffness, carrier.displacement(direction) - journal.displacement(direction)
    yield from _nut(mesh, drive, along, screw, origins, positions)
    rotor = Row(np.array([mesh.rotor(axis)]), np.ones(1))
    start = rigid_grip(positions[screw[0]], positions[[screw[0]]], [int(mesh.first_dof[screw[0]])])
    yield drive.rotor.coupling, rotor - start.rotation(along)


def _nut(
    mesh: Mesh, drive: Drive, along: Floats, screw: range, origins: Mapping[str, Floats], positions: Floats
) -> Springs:
    """Along the screw: u_nut - u_screw - I_P (phi_screw - phi_nut); across it: u_nut - u_screw."""
    nut = drive.nut
    point = origins[nut.body] + nut.at
    carrier = mesh.grip(point, resolve_attachment(mesh.structure, nut.held_by), positions)
    turning = (
        carrier
        if nut.rotation_of is None
        else mesh.grip(point, resolve_attachment(mesh.structure, nut.rotation_of), positions)
    )
    thread = mesh.rail_grip_at(point, screw, positions)
    for direction, stiffness in _along_and_across(along, nut.axial, nut.radial):
        elongation = carrier.displacement(direction) - thread.displacement(direction)
        if direction is along:
            elongation = elongation - drive.I_P * (thread.rotation(along) - turning.rotation(along))
        yield stiffness, elongation


def _along_and_across(along: Floats, axial: float, radial: float) -> Iterator[tuple[Floats, float]]:
    """The direction of a screw and two across it, with their stiffnesses, as far as there is any."""
    if axial > 0:
        yield along, axial
    if radial > 0:
        least = FRAME[np.argmin(np.abs(along))]
        across = np.cross(along, least)
        across /= np.linalg.norm(across)
        yield across, radial
        yield np.cross(along, across), radial


def ports(mesh: Mesh, origins: Mapping[str, Floats], positions: Floats) -> dict[str, Floats]:
    """Port -> (N,) vector b: n_A rotor against stator, x_A scale, tcp_X, tcp_Y, tcp_Z tool against workpiece."""
    structure, size = mesh.structure, mesh.size
    result: dict[str, Floats] = {}
    for name, axis in structure.axes.items():
        carrier = mesh.number(node(structure, axis.drive.stator.node))
        housing = rigid_grip(positions[carrier], positions[[carrier]], [int(mesh.first_dof[carrier])])
        rotor = Row(np.array([mesh.rotor(name)]), np.ones(1))
        result[f"n_{name}"] = (rotor - housing.rotation(np.array(axis.direction))).dense(size)
    for name, axis in structure.axes.items():
        point, along = origins[axis.scale.body] + axis.scale.at, np.array(axis.direction)
        moving, against = (
            mesh.grip(point, resolve_attachment(structure, texts), positions)
            for texts in (axis.scale.moving, axis.scale.against)
        )
        result[f"x_{name}"] = (moving.displacement(along) - against.displacement(along)).dense(size)
    mine, other = (_tool(mesh, texts, origins, positions) for texts in (structure.tool.held_by, structure.tool.against))
    for letter, own, against in zip("XYZ", mine, other, strict=True):
        result[f"tcp_{letter}"] = own - against
    return result


def _tool(mesh: Mesh, texts: Hold, origins: Mapping[str, Floats], positions: Floats) -> Floats:
    """(3, N) displacement in X, Y and Z of what is held at the tool centre point."""
    tool = mesh.structure.tool
    grip = mesh.grip(origins[tool.body] + tool.at, resolve_attachment(mesh.structure, texts), positions)
    return np.array([grip.displacement(direction).dense(mesh.size) for direction in FRAME])


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
            stiffness=symmetric(mesh.stiffness + sum_weighted_rows(springs, mesh.size)),
            ports=ports(mesh, origins, positions),
            axes=tuple(structure.axes),
            labels=mesh.labels,
            geometry=_geometry(mesh, positions),
            pose=pose,
            units=None,
            mounts=tuple(
                MountPort(name, mount.elements[d], row.dense(mesh.size))
                for body in structure.bodies
                for name, mount, d, row in mount_rows(mesh, body)
                if not mount.linear
            ),
            tool=_tool(mesh, structure.tool.held_by, origins, positions),
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
