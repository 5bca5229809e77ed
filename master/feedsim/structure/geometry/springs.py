"""Springs of a machine at a pose, each a stiffness and the row of the elongation it resists; and the ports.

Mounts hold the bed on the ground, carriages hold bodies on rails, bearings hold screws, nuts join bodies to screws,
couplings join rotors to screws. Where a spring acts depends on the pose, and nothing else does.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from feedsim.scenario.structure.names import held, node, nodes, rail
from feedsim.scenario.structure.parts import Drive
from feedsim.structure.assembly import Floats
from feedsim.structure.geometry.mesh import FRAME, Mesh
from feedsim.structure.geometry.points import Row, rigid

Springs = Iterator[tuple[float, Row]]


def body_springs(mesh: Mesh, origins: Mapping[str, Floats], positions: Floats) -> Springs:
    """Mounts and carriages."""
    structure = mesh.structure
    for name, body in structure.bodies.items():
        for mount in body.mounts:
            for item in (item for text in mount.nodes for item in nodes(structure, name, text)):
                number = mesh.number(item)
                grip = rigid(np.array(mount.offset), np.zeros((1, 3)), [int(mesh.first_dof[number])])
                for direction, stiffness in zip(FRAME, mount.stiffness, strict=True):
                    yield stiffness, grip.displacement(direction)
        for carriage in body.carriages:
            point = origins[name] + carriage.at
            number = mesh.number(nodes(structure, name, carriage.node)[0])
            mine = rigid(point, positions[[number]], [int(mesh.first_dof[number])])
            rails = mesh.riding(point, mesh.rail(rail(structure, carriage.rail)), positions)
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
        carrier = mesh.grip(point, held(structure, bearing.held_by), positions)
        journal = rigid(point, point[None], [int(mesh.first_dof[end])])
        for direction, stiffness in _along_and_across(along, bearing.axial, bearing.radial):
            yield stiffness, carrier.displacement(direction) - journal.displacement(direction)
    yield from _nut(mesh, drive, along, screw, origins, positions)
    rotor = Row(np.array([mesh.rotor(axis)]), np.ones(1))
    start = rigid(positions[screw[0]], positions[[screw[0]]], [int(mesh.first_dof[screw[0]])])
    yield drive.rotor.coupling, rotor - start.rotation(along)


def _nut(
    mesh: Mesh, drive: Drive, along: Floats, screw: range, origins: Mapping[str, Floats], positions: Floats
) -> Springs:
    """Along the screw: u_nut - u_screw - I_P (phi_screw - phi_nut); across it: u_nut - u_screw."""
    nut = drive.nut
    point = origins[nut.body] + nut.at
    carrier = mesh.grip(point, held(mesh.structure, nut.held_by), positions)
    turning = carrier if nut.rotation_of is None else mesh.grip(point, held(mesh.structure, nut.rotation_of), positions)
    thread = mesh.riding(point, screw, positions)
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
        housing = rigid(positions[carrier], positions[[carrier]], [int(mesh.first_dof[carrier])])
        rotor = Row(np.array([mesh.rotor(name)]), np.ones(1))
        result[f"n_{name}"] = (rotor - housing.rotation(np.array(axis.direction))).dense(size)
    for name, axis in structure.axes.items():
        point, along = origins[axis.scale.body] + axis.scale.at, np.array(axis.direction)
        moving, against = (
            mesh.grip(point, held(structure, texts), positions) for texts in (axis.scale.moving, axis.scale.against)
        )
        result[f"x_{name}"] = (moving.displacement(along) - against.displacement(along)).dense(size)
    tool = structure.tool
    point = origins[tool.body] + tool.at
    mine, other = (mesh.grip(point, held(structure, texts), positions) for texts in (tool.held_by, tool.against))
    for letter, direction in zip("XYZ", FRAME, strict=True):
        result[f"tcp_{letter}"] = (mine.displacement(direction) - other.displacement(direction)).dense(size)
    return result
