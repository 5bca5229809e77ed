"""What a picture of a machine shows beside nodes and lines: cross-sections, where things act, and how lines bend.

A straight beam without load between its nodes takes the cubic polynomials that its element is made from (Hermite's), in
both directions across, and runs linearly along and in twist; so a picture of it is what was calculated, not a guess.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from feedsim.scenario.structure import GeometryStructure, Section
from feedsim.scenario.structure_checks import nodes, rail, resolve_attachment
from feedsim.structure.assembly import Assembly, Floats, Geometry, Integers
from feedsim.structure.geometry.mesh import Grip, Mesh, area_moments, beam_axes, rigid_grip


@dataclass(frozen=True, eq=False)
class Feature:
    """A point where something acts, and the nodes that hold it.

    Attributes:
        kind: mass, mount, carriage, rail (where a carriage meets it), bearing, nut, motor, scale, tool or workpiece.
        name: axis of a bearing, nut, motor or scale; else "".
        body: that it belongs to.
        point: (3,) [m].
        anchors: (n, 3) the nodes that hold it [m].
        size: of a mass [kg]; else 0.
    """

    kind: str
    name: str
    body: str
    point: Floats
    grip: Grip
    size: float = 0.0

    @property
    def anchors(self) -> Floats:
        return np.asarray(self.point - self.grip.levers)

    def moved(self, shape: Floats) -> tuple[Floats, Floats]:
        """(3,) displacement of the point and (n, 3) of its anchors in a shape (N,)."""
        motion = shape[self.grip.dofs[:, None] + np.arange(6)]
        u = motion[:, :3] + np.cross(motion[:, 3:], self.grip.levers)
        return np.asarray(self.grip.weights @ u), motion[:, :3]


@dataclass(frozen=True, eq=False)
class Outline:
    """Cross-sections of an assembly's lines, and its features.

    Attributes:
        sizes: (L, 2) height and width of each line's section [m].
        frames: (L, 3, 3) local x, y (height), z (width) of each line, rows.
        is_round: (L,) rods and tubes.
        features: all points where something acts.
        blocks: body -> (number of its node, (2, 3) least and largest corner), of bodies that have no beams.
    """

    sizes: Floats
    frames: Floats
    is_round: NDArray[np.bool_]
    features: tuple[Feature, ...]
    blocks: dict[str, tuple[int, Floats]]


def outline(structure: GeometryStructure, assembly: Assembly) -> Outline:
    """What the structure of an assembly says of its looks, at the assembly's pose."""
    mesh = Mesh(structure)
    origins = mesh.origins(assembly.pose)
    positions = mesh.positions(origins)
    sections = list(_sections(structure))
    lines = np.array([[beam.first, beam.second] for beam in mesh.beams], dtype=np.int64).reshape(-1, 2)
    frames = [beam_axes(positions[b.second] - positions[b.first], b.up) for b in mesh.beams]
    features = tuple(_features(mesh, origins, positions))
    return Outline(
        sizes=np.array([size for size, _ in sections]).reshape(-1, 2),
        frames=np.array(frames).reshape(-1, 3, 3),
        is_round=np.array([is_round for _, is_round in sections], dtype=np.bool_),
        features=features,
        blocks=dict(_blocks(mesh, lines, positions, features)),
    )


def _sections(structure: GeometryStructure) -> Iterator[tuple[tuple[float, float], bool]]:
    """Height and width of each beam's section and whether it is round, in the order of the mesh's beams."""
    looks = {name: _drawn_section(section) for name, section in structure.sections.items()}
    for name, body in structure.bodies.items():
        for group in body.nodes.values():
            if group.section is not None and group.count is not None:
                yield from [looks[group.section]] * (group.count - 1)
        for beams in body.beams:
            entry = len(nodes(structure, name, beams.through[0]))
            yield from [looks[beams.section]] * (entry * (len(beams.through) - 1))
    for axis in structure.axes.values():
        screw = axis.drive.screw
        yield from [((screw.diameter, screw.diameter), True)] * (screw.nodes - 1)


def _drawn_section(section: Section) -> tuple[tuple[float, float], bool]:
    if section.kind in ("box", "rectangle"):
        return (section.height, section.width), False
    if section.kind in ("rod", "tube"):
        return (section.diameter, section.diameter), True
    area, Iy, Iz, _ = area_moments(section)
    return (sqrt(12 * Iz / area), sqrt(12 * Iy / area)), False  # the solid rectangle of these moments


def _features(mesh: Mesh, origins: dict[str, Floats], positions: Floats) -> Iterator[Feature]:
    structure = mesh.structure

    def at(number: int, point: Floats) -> Grip:
        return rigid_grip(point, positions[[number]], [int(mesh.first_dof[number])])

    for name, body in structure.bodies.items():
        for mass in body.masses:
            for item in (item for text in mass.nodes for item in nodes(structure, name, text)):
                point = positions[mesh.number(item)] + mass.offset
                yield Feature("mass", "", name, point, at(mesh.number(item), point), mass.mass)
        for mount in body.mounts:
            for item in (item for text in mount.nodes for item in nodes(structure, name, text)):
                point = positions[mesh.number(item)] + mount.offset
                yield Feature("mount", "", name, point, at(mesh.number(item), point))
        for carriage in body.carriages:
            point = origins[name] + carriage.at
            number = mesh.number(nodes(structure, name, carriage.node)[0])
            yield Feature("carriage", "", name, point, at(number, point))
            rails = mesh.rail_grip_at(point, mesh.rail(rail(structure, carriage.rail)), positions)
            yield Feature("rail", "", rail(structure, carriage.rail).body, point, rails)
    for name, axis in structure.axes.items():
        drive, screw = axis.drive, mesh.screw(name)
        for bearing in drive.bearings:
            point = positions[screw[0] if bearing.at == "start" else screw[-1]]
            grip = mesh.grip(point, resolve_attachment(structure, bearing.held_by), positions)
            yield Feature("bearing", name, drive.screw.body, point, grip)
        point = origins[drive.nut.body] + drive.nut.at
        grip = mesh.grip(point, resolve_attachment(structure, drive.nut.held_by), positions)
        yield Feature("nut", name, drive.nut.body, point, grip)
        yield Feature("motor", name, f"rotor {name}", positions[screw[0]], at(screw[0], positions[screw[0]]))
        point = origins[axis.scale.body] + axis.scale.at
        yield Feature(
            "scale",
            name,
            axis.scale.body,
            point,
            mesh.grip(point, resolve_attachment(structure, axis.scale.moving), positions),
        )
    tool = structure.tool
    point = origins[tool.body] + tool.at
    for kind, who in (("tool", tool.held_by), ("workpiece", tool.against)):
        yield Feature(kind, "", tool.body, point, mesh.grip(point, resolve_attachment(structure, who), positions))


def _blocks(
    mesh: Mesh, lines: Integers, positions: Floats, features: tuple[Feature, ...]
) -> Iterator[tuple[str, tuple[int, Floats]]]:
    """Bodies of a single node, as the box that their points span."""
    for body, content in mesh.structure.bodies.items():
        own = [i for i, name in enumerate(mesh.bodies) if name == body]
        if len(own) > 1 or np.isin(own, lines).any() or not content.nodes:
            continue
        ends = [f.point for f in features if f.body == body and f.kind in ("carriage", "nut", "tool", "scale", "mount")]
        corners = np.array([positions[own[0]], *ends])
        yield body, (own[0], np.array([corners.min(axis=0), corners.max(axis=0)]))


@dataclass(frozen=True, eq=False)
class Deflection:
    """Points on all lines of a geometry, n + 1 on each, and their motion.

    Attributes:
        points: (L, n + 1, 3) at rest [m].
        displacements: (L, n + 1, 3), in the unit of the shape's displacements.
        rotations: (L, n + 1, 3), of the cross-section.
    """

    points: Floats
    displacements: Floats
    rotations: Floats


def node_motion(geometry: Geometry, shape: Floats) -> tuple[Floats, Floats]:
    """(K, 3) displacements and (K, 3) rotations of the nodes in a shape (N,); 0 where a node has no such freedom."""
    motion = np.where(geometry.dofs >= 0, shape[np.maximum(geometry.dofs, 0)], 0.0)
    return motion[:, :3], motion[:, 3:]


def deflection(geometry: Geometry, shape: Floats, n: int) -> Deflection:
    """Every line in `n` pieces in a shape (N,). Lines whose nodes do not turn (edges of solids) stay straight."""
    u, phi = node_motion(geometry, shape)
    first, second = geometry.lines[:, 0], geometry.lines[:, 1]
    along = geometry.nodes[second] - geometry.nodes[first]
    length = np.linalg.norm(along, axis=1)
    e = along / np.where(length > 0, length, 1)[:, None]
    turns = np.any(geometry.dofs[:, 3:] >= 0, axis=1)
    bends = (turns[first] & turns[second])[:, None, None]
    t = np.linspace(0.0, 1.0, n + 1)[None, :, None]
    h = np.array([1 - 3 * t**2 + 2 * t**3, t - 2 * t**2 + t**3, 3 * t**2 - 2 * t**3, t**3 - t**2])
    dh = np.array([6 * t**2 - 6 * t, 1 - 4 * t + 3 * t**2, 6 * t - 6 * t**2, 3 * t**2 - 2 * t])

    u1, u2, phi1, phi2 = (values[:, None, :] for values in (u[first], u[second], phi[first], phi[second]))
    axis, L = e[:, None, :], length[:, None, None]
    straight = (1 - t) * u1 + t * u2
    along_it = np.sum(straight * axis, axis=2, keepdims=True) * axis
    # Slopes across the beam: d(u)/ds = phi x e.
    slope1, slope2 = L * np.cross(phi1, axis), L * np.cross(phi2, axis)
    across1, across2 = (v - np.sum(v * axis, axis=2, keepdims=True) * axis for v in (u1, u2))
    bent = along_it + h[0] * across1 + h[1] * slope1 + h[2] * across2 + h[3] * slope2
    slope = (dh[0] * across1 + dh[1] * slope1 + dh[2] * across2 + dh[3] * slope2) / np.where(L > 0, L, 1)
    twist = (1 - t) * np.sum(phi1 * axis, axis=2, keepdims=True) + t * np.sum(phi2 * axis, axis=2, keepdims=True)
    # phi across the beam from the slope: phi = e x (phi x e).
    turned = np.broadcast_to(twist * axis + np.cross(axis, slope), bent.shape)
    return Deflection(
        points=geometry.nodes[first][:, None, :] + t * along[:, None, :],
        displacements=np.where(bends, bent, np.broadcast_to(straight, bent.shape)),
        rotations=np.where(bends, turned, 0.0),
    )
