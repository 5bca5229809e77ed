"""A machine's model made ready for pictures: bodies with colours, solids of its beams, at rest and in a motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from feedsim.errors import InputError
from feedsim.report.machine.projection import Faces, tube
from feedsim.report.style import BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILLION, Array
from feedsim.scenario.structure import Structure
from feedsim.scenario.structure.geometry import GeometryStructure
from feedsim.structure.assembly import Assembly, Geometry
from feedsim.structure.build import Built
from feedsim.structure.geometry.outline import Outline, deflection, node_motion, outline

COLOURS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY)
METAL = "#7b8794"  # screws, rotors, and bodies beyond the colours
SOFT = 0.18  # of white in a body's colour
CORNERS = 10  # of a round section
PIECE = 1 / 45  # longest straight piece of a bent beam, of the machine's size
MOST_PIECES = 8
MODE_DEFLECTION = 0.09  # deflection that is drawn for a mode that moves bodies, of the machine's size
ROTOR_TURN = 1.1  # rad, drawn for a rotor that has all of a mode's energy


@dataclass(frozen=True, eq=False)
class Model:
    """What pictures of a machine are drawn from.

    Attributes:
        geometry: its nodes and lines.
        looks: cross-sections and features; None where the model came as matrices.
        colours: body -> (3,) colour, 0..1, in the order in which bodies appear.
        size: largest extent of the machine [m].
        pieces: straight pieces that a line is drawn in.
    """

    assembly: Assembly
    geometry: Geometry
    looks: Outline | None
    colours: Mapping[str, Array]
    size: float
    pieces: int


def model(structure: Structure, assembly: Assembly) -> Model:
    """The model of an assembly.

    Raises:
        InputError: nothing is known of where its nodes are.
    """
    geometry = assembly.geometry
    if geometry is None or len(geometry.nodes) == 0:
        raise InputError(
            f"{assembly.name}: a picture needs to know where the nodes are: give the structure file a table of nodes "
            "(key nodes: node, x, y, z, and the degrees of freedom ux ... rz) and one of the lines between them (key "
            "lines: from, to); with CalculiX, the mesh (key mesh)"
        )
    looks = outline(structure, assembly) if isinstance(structure, GeometryStructure) else None
    size = float(np.max(np.ptp(geometry.nodes, axis=0))) or 1.0
    longest = 0.0
    if len(geometry.lines):
        ends = geometry.nodes[geometry.lines]
        longest = float(np.max(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)))
    bending = bool(np.any(geometry.dofs[:, 3:] >= 0)) and len(geometry.lines) < 5000
    pieces = min(MOST_PIECES, max(2, int(np.ceil(longest / (PIECE * size))))) if bending else 1
    return Model(assembly, geometry, looks, _colours(geometry), size, pieces)


def _colours(geometry: Geometry) -> dict[str, Array]:
    names = list(dict.fromkeys(geometry.bodies))
    large = [name for name in names if not name.startswith(("screw ", "rotor "))]
    result = {name: colour for name, colour in zip(large, COLOURS, strict=False)}
    return {name: rgb(result.get(name, METAL)) for name in names}


def rgb(text: str, white: float = SOFT) -> Array:
    """(3,) of a colour #rrggbb, mixed with white."""
    plain = np.array([int(text[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    return np.asarray(plain * (1 - white) + white)


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion to be drawn: the shape's vector (N,) scaled to metres, and how far rotors turn [rad]."""

    shape: Array
    rotors: Mapping[str, float]


def motion(built: Built, of: Model, k: int, scale: float = 1.0) -> Motion:
    """Mode k, exaggerated to MODE_DEFLECTION of the machine's size times `scale`.

    Where most of the energy is in parts that turn (a rotor, a screw), deflections are less: the root of the share of
    the energy that is in translations, so that a mode of torsion does not look like one of the bed.
    """
    shape = built.solution.shapes[:, k]
    energy = shape * (built.assembly.mass @ shape)
    whole = float(energy.sum()) or 1.0
    displacements, _ = node_motion(of.geometry, shape)
    largest = float(np.max(np.linalg.norm(displacements, axis=1)))
    dofs = of.geometry.dofs[:, :3]
    moving = max(0.0, min(1.0, float(energy[dofs[dofs >= 0]].sum()) / whole))
    factor = scale * MODE_DEFLECTION * of.size * np.sqrt(moving) / largest if largest > 0 else 0.0
    rotors = {}
    for i, body in enumerate(of.geometry.bodies):
        if body.startswith("rotor "):
            dof = int(of.geometry.dofs[i].max())
            rotors[body] = scale * ROTOR_TURN * float(np.sign(shape[dof]) * np.sqrt(max(0.0, energy[dof] / whole)))
    return Motion(shape * factor, rotors)


def solids(of: Model, moved: Motion | None, phase: float = 1.0) -> list[Faces]:
    """Faces of all beams, rotors and blocks, at rest or in a motion times `phase`."""
    looks, geometry = of.looks, of.geometry
    assert looks is not None
    shape = np.zeros(of.assembly.mass.shape[0]) if moved is None else moved.shape * phase
    bent = deflection(geometry, shape, of.pieces)
    faces: list[Faces] = []
    for i, (first, _) in enumerate(geometry.lines.tolist()):
        corners = _section(looks.sizes[i], bool(looks.is_round[i])) @ looks.frames[i][1:]
        rotations = bent.rotations[i]
        if looks.is_round[i]:  # twist is not to be seen on a round bar, and a screw's is many times its deflection
            rotations = rotations - np.outer(rotations @ looks.frames[i][0], looks.frames[i][0])
        stations = (bent.points[i] + bent.displacements[i])[:, None, :] + turned(corners, rotations)
        faces += tube(stations, of.colours[geometry.bodies[first]])
    u, phi = node_motion(geometry, shape)
    for body, (node, (low, high)) in looks.blocks.items():
        x, y, z = np.stack([low, high]).T
        base = np.array([[x[0], y[0]], [x[1], y[0]], [x[1], y[1]], [x[0], y[1]]])
        stations = np.array([np.column_stack([base, np.full(4, depth)]) for depth in z])
        levers = turned((stations - geometry.nodes[node]).reshape(-1, 3), phi[[node]]).reshape(2, 4, 3)
        faces += tube(geometry.nodes[node] + u[node] + levers, of.colours[body])
    for feature in looks.features:
        if feature.kind == "motor":
            faces += _rotor(of, feature.point + feature.moved(shape)[0], feature.name)
    return faces


def turned(vectors: Array, rotations: Array) -> Array:
    """(S, c, 3) vectors (c, 3) turned by each of the rotation vectors (S, 3); lengths stay (Rodrigues' formula)."""
    angle = np.linalg.norm(rotations, axis=1)[:, None, None]
    axis = rotations[:, None, :] / np.where(angle > 0, angle, 1)
    along = np.sum(axis * vectors, axis=2, keepdims=True) * axis
    return np.asarray(np.cos(angle) * (vectors - along) + np.sin(angle) * np.cross(axis, vectors[None]) + along)


def _section(size: Array, is_round: bool) -> Array:
    """(c, 2) corners of a section: local y, local z; counted so that its normal is local x."""
    height, width = size.tolist()
    if is_round:
        angle = 2 * np.pi * np.arange(CORNERS) / CORNERS
        return np.asarray(0.5 * height * np.column_stack([np.cos(angle), np.sin(angle)]))
    return 0.5 * np.array([[-height, -width], [height, -width], [height, width], [-height, width]])


def rotor_disc(of: Model, name: str) -> tuple[Array, float]:
    """(3, 3) direction of an axis's motor and two across it, and the radius that its rotor is drawn with [m]."""
    looks = of.looks
    assert looks is not None
    lines = [i for i, (a, _) in enumerate(of.geometry.lines.tolist()) if of.geometry.bodies[a] == f"screw {name}"]
    return looks.frames[lines[0]], max(0.03 * of.size, 1.6 * float(looks.sizes[lines[0], 0]))


def _rotor(of: Model, centre: Array, name: str) -> list[Faces]:
    """A disc with some thickness behind the start of the screw."""
    frame, radius = rotor_disc(of, name)
    corners = _section(np.array([2 * radius, 2 * radius]), True) @ frame[1:]
    stations = np.array([centre + corners - 1.6 * radius * frame[0], centre + corners - 0.1 * radius * frame[0]])
    return tube(stations, rgb(METAL, 0.0))


def extent(of: Model, moved: Motion | None = None) -> Array:
    """Points that a picture must hold: all that is drawn at rest and at both ends of a motion."""
    if of.looks is None:
        points = [of.geometry.nodes]
        if moved is not None:
            u, _ = node_motion(of.geometry, moved.shape)
            points += [of.geometry.nodes + u, of.geometry.nodes - u]
        return np.concatenate(points)
    phases = (None,) if moved is None else (0.0, 1.0, -1.0)
    faces = [group for phase in phases for group in solids(of, None if phase is None else moved, phase or 0.0)]
    points = [group.corners.reshape(-1, 3) for group in faces]
    points += [feature.point[None] for feature in of.looks.features if feature.kind in ("mount", "tool", "mass")]
    return np.concatenate(points)
