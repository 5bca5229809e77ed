"""Nodes, degrees of freedom and all that does not depend on the pose: beams and masses of the bodies, screws, rotors.

Bodies travel, they do not turn, and each is meshed in its own frame: the mass matrix and the stiffness of the beams are
the same wherever the axes are. Order of the nodes: those of the bodies as the file lists them, then for each axis the
nodes of its screw and its rotor (one degree of freedom: the angle about the axis's direction).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import pi
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feedsim.scenario.structure import GeometryStructure, NodeGroup
from feedsim.scenario.structure_checks import Attachment, Line, Node, nodes

if TYPE_CHECKING:
    from scipy.sparse import csc_array

    from feedsim.scenario.structure import Material, Section


# --- Points that nodes hold: rigidly, as the mean of several, or riding on a line of nodes ----------------------------
# The displacement at a point p is sum w_i (u_i + phi_i x (p - N_i)) over the nodes N_i that hold it, its rotation
# sum w_i phi_i: each node holds the point rigidly, and takes the weight w_i in it.


@dataclass(frozen=True, eq=False)
class Row:
    """A sparse row vector: b^T u = sum of coefficients u[dofs]. A degree of freedom may occur twice."""

    dofs: Integers
    coefficients: Floats

    def __add__(self, other: Row) -> Row:
        return Row(np.concatenate([self.dofs, other.dofs]), np.concatenate([self.coefficients, other.coefficients]))

    def __sub__(self, other: Row) -> Row:
        return self + (-1.0) * other

    def __rmul__(self, factor: float) -> Row:
        return Row(self.dofs, factor * self.coefficients)

    def dense(self, size: int) -> Floats:
        """(size,) the row as a vector."""
        vector = np.zeros(size)
        np.add.at(vector, self.dofs, self.coefficients)
        return vector


@dataclass(frozen=True, eq=False)
class Grip:
    """A point and the nodes that hold it.

    Attributes:
        dofs: (n,) first degree of freedom of each node (ux, uy, uz, rx, ry, rz follow one another).
        weights: (n,) share of each node; their sum is 1.
        levers: (n, 3) from each node to the point [m].
    """

    dofs: Integers
    weights: Floats
    levers: Floats

    def displacement(self, direction: Floats) -> Row:
        """Displacement of the point along a direction."""
        coefficients = np.empty((len(self.dofs), 6))
        coefficients[:, :3] = direction
        coefficients[:, 3:] = _cross(self.levers, direction)  # d . (phi x r) = phi . (r x d)
        coefficients *= self.weights[:, None]
        return Row((self.dofs[:, None] + np.arange(6)).ravel(), coefficients.ravel())

    def rotation(self, direction: Floats) -> Row:
        """Rotation at the point about a direction."""
        dofs = self.dofs[:, None] + np.arange(3, 6)
        return Row(dofs.ravel(), (self.weights[:, None] * direction).ravel())


def rigid_grip(point: Floats, nodes: Floats, dofs: Iterable[int]) -> Grip:
    """A point held by the mean of nodes at (n, 3) positions."""
    first = np.fromiter(dofs, dtype=np.int64)
    return Grip(first, np.full(len(first), 1 / len(first)), point - nodes)


def rail_grip(point: Floats, line: Floats, first_dof: int) -> Grip:
    """A point that rides on a line of equally spaced nodes at (n, 3) positions, 6 degrees of freedom each.

    The two neighbours along the line hold it with the weights 1 - w and w = t^2 (3 - 2 t), t the fraction of the way
    between them: as the point travels on, the stiffness it meets changes smoothly. Beyond an end that end holds it.
    """
    whole = line[-1] - line[0]
    intervals = len(line) - 1
    along = float((point - line[0]) @ whole / (whole @ whole)) * intervals
    i = min(max(int(np.floor(along)), 0), intervals - 1)
    t = min(max(along - i, 0.0), 1.0)
    w = t * t * (3 - 2 * t)
    dofs = first_dof + 6 * np.array([i, i + 1], dtype=np.int64)
    return Grip(dofs, np.array([1 - w, w]), point - line[i : i + 2])


def _cross(a: Floats, b: Floats) -> Floats:
    """(n, 3) a x b for (n, 3) a and (3,) b; numpy's own is slow for few rows."""
    return np.column_stack(
        [a[:, 1] * b[2] - a[:, 2] * b[1], a[:, 2] * b[0] - a[:, 0] * b[2], a[:, 0] * b[1] - a[:, 1] * b[0]]
    )


# --- Nodes, degrees of freedom and all that does not depend on the pose: beams and masses of the bodies, screws,
#     rotors


# --- The straight beam element of Euler and Bernoulli in space, with its consistent mass; its section -----------------
# Degrees of freedom: ux, uy, uz, rx, ry, rz of the first node, then of the second. Source: J. S. Przemieniecki,
# Theory
# of Matrix Structural Analysis, McGraw-Hill 1968: stiffness in ch. 5, consistent mass in ch. 11 (without the rotary
# inertia of bending).


@dataclass(frozen=True)
class BeamProperties:
    """What a beam element is made from.

    EA [N], EIy, EIz [N.m2] bending about local y and z, GJ [N.m2] torsion; m mass per length [kg/m], j polar moment of
    inertia per length [kg.m].
    """

    EA: float
    EIy: float
    EIz: float
    GJ: float
    m: float
    j: float


def beam_properties(section: Section, material: Material) -> BeamProperties:
    """Properties of a beam of a section.

    The torsion constant of a box is Bredt's for thin walls, along their centre line; that of a solid rectangle is the
    usual approximation (W. C. Young, Roark's Formulas for Stress and Strain; within 0.4 %). The section's mass factor
    scales all inertia.
    """
    A, Iy, Iz, J = area_moments(section)
    rho = material.rho * section.mass_factor
    return BeamProperties(material.E * A, material.E * Iy, material.E * Iz, material.G * J, rho * A, rho * (Iy + Iz))


def area_moments(section: Section) -> tuple[float, float, float, float]:
    """A [m2], Iy, Iz, J [m4] of a section."""
    if section.kind == "box":
        b, h, t = section.width, section.height, section.wall
        bi, hi = b - 2 * t, h - 2 * t
        J = 2 * t * (b - t) ** 2 * (h - t) ** 2 / (b + h - 2 * t)
        return b * h - bi * hi, (h * b**3 - hi * bi**3) / 12, (b * h**3 - bi * hi**3) / 12, J
    if section.kind == "rectangle":
        b, h = section.width, section.height
        a, c = max(b, h), min(b, h)
        J = a * c**3 * (1 / 3 - 0.21 * c / a * (1 - c**4 / (12 * a**4)))
        return b * h, h * b**3 / 12, b * h**3 / 12, J
    if section.kind == "properties":
        return section.A, section.Iy, section.Iz, section.J
    outer = section.diameter
    inner = outer - 2 * section.wall if section.kind == "tube" else 0.0
    I = pi / 64 * (outer**4 - inner**4)  # noqa: E741  (the symbol that everybody knows)
    return pi / 4 * (outer**2 - inner**2), I, I, 2 * I


def rod(diameter: float, material: Material) -> BeamProperties:
    """Properties of a solid round bar of diameter [m]."""
    A, I = pi / 4 * diameter**2, pi / 64 * diameter**4  # noqa: E741
    return BeamProperties(
        material.E * A, material.E * I, material.E * I, material.G * 2 * I, material.rho * A, material.rho * 2 * I
    )


# A beam within acos 0.9 = 26 degrees of the vertical counts as upright: its local y turns towards Z.
UPRIGHT_COSINE = 0.9
Y, Z = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])


def local_matrices(beam: BeamProperties, L: float) -> tuple[Floats, Floats]:
    """(12, 12) stiffness and mass of a beam of length L [m] in its own axes: x along it, y and z across."""
    K, M = np.zeros((12, 12)), np.zeros((12, 12))
    for i, stiffness, inertia in ((0, beam.EA, beam.m), (3, beam.GJ, beam.j)):  # axial, torsion
        dofs = np.ix_([i, i + 6], [i, i + 6])
        K[dofs] = stiffness / L * np.array([[1, -1], [-1, 1]])
        M[dofs] = inertia * L / 6 * np.array([[2, 1], [1, 2]])
    bend = np.array([[12, 6 * L, -12, 6 * L], [0, 4 * L**2, -6 * L, 2 * L**2], [0, 0, 12, -6 * L], [0, 0, 0, 4 * L**2]])
    mass = np.array(
        [[156, 22 * L, 54, -13 * L], [0, 4 * L**2, 13 * L, -3 * L**2], [0, 0, 156, -22 * L], [0, 0, 0, 4 * L**2]]
    )
    bend, mass = bend + np.triu(bend, 1).T, mass + np.triu(mass, 1).T
    # In the x-z plane a positive rotation about y lowers uz along x: slopes change sign.
    for deflection, slope, sign, EI in ((1, 5, 1, beam.EIz), (2, 4, -1, beam.EIy)):
        plane = [deflection, slope, deflection + 6, slope + 6]
        dofs = np.ix_(plane, plane)
        signs = np.outer([1, sign, 1, sign], [1, sign, 1, sign])
        K[dofs] = EI / L**3 * bend * signs
        M[dofs] = beam.m * L / 420 * mass * signs
    return K, M


def beam_axes(along: ArrayLike, up: ArrayLike | None = None) -> Floats:
    """(3, 3) local x, y, z (rows) of a beam that runs in direction `along`.

    Local y is as near to `up` as it can be; without `up` that is Y of the frame, or Z where the beam is upright.
    """
    ex = np.asarray(along, dtype=np.float64)
    ex = ex / np.linalg.norm(ex)
    if up is None:
        up = Z if abs(ex @ Y) >= UPRIGHT_COSINE else Y
    ez = np.cross(ex, np.asarray(up, dtype=np.float64))
    ez /= np.linalg.norm(ez)
    return np.array([ex, np.cross(ez, ex), ez])


def beam_matrices(
    beam: BeamProperties, first: ArrayLike, second: ArrayLike, up: ArrayLike | None = None
) -> tuple[Floats, Floats]:
    """(12, 12) stiffness and mass of a beam from point `first` to `second` [m], in the frame of those points."""
    along = np.asarray(second, dtype=np.float64) - np.asarray(first, dtype=np.float64)
    K, M = local_matrices(beam, float(np.linalg.norm(along)))
    T = np.kron(np.eye(4), beam_axes(along, up))
    return T.T @ K @ T, T.T @ M @ T


Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
FRAME = np.eye(3)


@dataclass(frozen=True, eq=False)
class Beam:
    """A beam element between two nodes, by their numbers."""

    first: int
    second: int
    properties: BeamProperties
    up: tuple[float, float, float] | None


class Mesh:
    """A structure as nodes and elements.

    Attributes:
        names: (K,) such as "bed.B1.3", "screw X.0", "rotor X".
        bodies: (K,) such as "bed", "screw X", "rotor X".
        carriers: (K,) body in whose frame a node rests, such as "bed" for a screw of the bed.
        local: (K, 3) positions in the frame of the body that carries the node [m].
        first_dof: (K,) its first degree of freedom; a rotor has one, all others six.
        size: number of degrees of freedom.
        labels: (size,) such as "bed.B1.3 ux".
        beams: all beam elements.
    """

    def __init__(self, structure: GeometryStructure) -> None:
        self.structure = structure
        self.names: list[str] = []
        self.bodies: list[str] = []
        self.carriers: list[str] = []
        # (body, node or line), ("screw X", ""), ("rotor X", ""): number of the first node
        self._start: dict[tuple[str, str], int] = {}
        positions: list[Floats] = []
        for body, content in structure.bodies.items():
            for name, group in content.nodes.items():
                self._start[body, name] = len(self.names)
                points = group_points(group)
                positions.append(points)
                labels = [name] if group.count is None else [f"{name}.{i}" for i in range(group.count)]
                self._add(body, body, [f"{body}.{label}" for label in labels])
        for axis, feed in structure.axes.items():
            screw = feed.drive.screw
            self._start[f"screw {axis}", ""] = len(self.names)
            positions.append(np.linspace(screw.start, screw.end, screw.nodes))
            self._add(f"screw {axis}", screw.body, [f"screw {axis}.{i}" for i in range(screw.nodes)])
            self._start[f"rotor {axis}", ""] = len(self.names)
            positions.append(np.array([screw.start]))
            self._add(f"rotor {axis}", screw.body, [f"rotor {axis}"])
        self.local = np.concatenate(positions)
        rotors = {self._start[f"rotor {axis}", ""] for axis in structure.axes}
        counts = np.array([1 if i in rotors else 6 for i in range(len(self.names))])
        self.first_dof: Integers = np.concatenate([[0], np.cumsum(counts)[:-1]])
        self.size = int(counts.sum())
        self.labels = tuple(
            f"{name}{part}"
            for i, name in enumerate(self.names)
            for part in ([" angle"] if i in rotors else (" ux", " uy", " uz", " rx", " ry", " rz"))
        )
        self.beams = tuple(self._beams())

    def number(self, node: Node) -> int:
        """Number of a node."""
        return self._start[node.body, node.name] + (node.number or 0)

    def screw(self, axis: str) -> range:
        """Numbers of the nodes of an axis's screw."""
        start = self._start[f"screw {axis}", ""]
        return range(start, start + self.structure.axes[axis].drive.screw.nodes)

    def rotor(self, axis: str) -> int:
        """Degree of freedom of an axis's rotor."""
        return int(self.first_dof[self._start[f"rotor {axis}", ""]])

    def origins(self, pose: Mapping[str, float]) -> dict[str, Floats]:
        """Body -> (3,) origin of its frame in the machine's [m] at axis positions [m]."""
        axes = self.structure.axes
        return {
            name: np.array(body.origin) + sum(pose[axis] * np.array(axes[axis].direction) for axis in body.moves_with)
            for name, body in self.structure.bodies.items()
        }

    def positions(self, origins: Mapping[str, Floats]) -> Floats:
        """(K, 3) positions of the nodes in the machine's frame [m]."""
        shifts: Floats = np.array([origins[carrier] for carrier in self.carriers])
        return self.local + shifts

    def grip(self, point: Floats, fixed: Attachment, positions: Floats) -> Grip:
        """How nodes hold a point of the machine's frame, nodes being at `positions`."""
        if fixed.rail is not None:
            return self.rail_grip_at(point, self.rail(fixed.rail), positions)
        numbers = [self.number(node) for node in fixed.nodes]
        return rigid_grip(point, positions[numbers], self.first_dof[numbers])

    def rail_grip_at(self, point: Floats, numbers: range, positions: Floats) -> Grip:
        """How a line of nodes holds a point that rides on it."""
        line = positions[numbers.start : numbers.stop]
        return rail_grip(point, line, int(self.first_dof[numbers.start]))

    def rail(self, line: Line) -> range:
        """Numbers of the nodes of a line."""
        start = self._start[line]
        return range(start, start + (self.structure.bodies[line.body].nodes[line.name].count or 1))

    @cached_property
    def stiffness(self) -> csc_array:
        """(size, size) stiffness of the beams."""
        return self._matrices[0]

    @cached_property
    def mass(self) -> csc_array:
        """(size, size) mass of beams, point masses, screws, stators and rotors."""
        return self._matrices[1]

    @cached_property
    def _matrices(self) -> tuple[csc_array, csc_array]:
        from scipy.sparse import coo_array

        numbers = np.array([[beam.first, beam.second] for beam in self.beams]).reshape(-1, 2)
        elements = [
            beam_matrices(beam.properties, self.local[beam.first], self.local[beam.second], beam.up)
            for beam in self.beams
        ]
        dofs = (self.first_dof[numbers][:, :, None] + np.arange(6)).reshape(-1, 12)
        at = (np.repeat(dofs, 12, axis=1).ravel(), np.tile(dofs, (1, 12)).ravel())
        shape = (self.size, self.size)
        stiffness, mass = (
            coo_array((np.array([pair[k] for pair in elements]).ravel(), at), shape=shape).tocsc() for k in (0, 1)
        )
        return symmetric(stiffness), symmetric(mass + sum_weighted_rows(list(self._inertias()), self.size))

    def _add(self, body: str, carrier: str, names: list[str]) -> None:
        self.names += names
        self.bodies += [body] * len(names)
        self.carriers += [carrier] * len(names)

    def _beams(self) -> Iterator[Beam]:
        structure = self.structure
        sections = {
            name: beam_properties(section, structure.material(section.material))
            for name, section in structure.sections.items()
        }
        for body, content in structure.bodies.items():
            for name, group in content.nodes.items():
                if group.section is not None and group.count is not None:
                    start = self._start[body, name]
                    for i in range(start, start + group.count - 1):
                        yield Beam(i, i + 1, sections[group.section], group.up)
            for beams in content.beams:
                stops = [[self.number(node) for node in nodes(structure, body, text)] for text in beams.through]
                for one, other in pairwise(stops):
                    for first, second in zip(one, other, strict=True):
                        yield Beam(first, second, sections[beams.section], beams.up)
        for axis, drive in ((axis, content.drive) for axis, content in structure.axes.items()):
            bar = rod(drive.screw.diameter, structure.material(drive.screw.material))
            for first, second in pairwise(self.screw(axis)):
                yield Beam(first, second, bar, None)

    def _inertias(self) -> Iterator[tuple[float, Row]]:
        """Inertia and the row of the velocity that it goes with."""
        for body, content in self.structure.bodies.items():
            for item in content.masses:
                for text in item.nodes:
                    for node in nodes(self.structure, body, text):
                        yield from self._rigid_mass(self.number(node), item.offset, item.mass, item.inertia)
        still = self.origins(dict.fromkeys(self.structure.axes, 0.0))
        positions = self.positions(still)
        for axis, feed in self.structure.axes.items():
            stator, rotor = feed.drive.stator, feed.drive.rotor
            carrier = self.number(node_of(stator.node))
            offset = positions[self.screw(axis)[0]] - positions[carrier]
            yield from self._rigid_mass(carrier, offset, stator.mass, stator.inertia)
            yield rotor.inertia, Row(np.array([self.rotor(axis)]), np.ones(1))

    def _rigid_mass(
        self, node: int, offset: Floats | tuple[float, ...], mass: float, inertia: tuple[float, ...]
    ) -> Iterator[tuple[float, Row]]:
        grip = rigid_grip(np.asarray(offset), np.zeros((1, 3)), [int(self.first_dof[node])])
        for direction, moment in zip(FRAME, inertia, strict=True):
            yield mass, grip.displacement(direction)
            yield moment, grip.rotation(direction)


def group_points(group: NodeGroup) -> Floats:
    """(n, 3) positions of a node, or of a line of nodes, in its body's frame [m]."""
    if group.at is not None:
        return np.array([group.at])
    assert group.start is not None
    assert group.end is not None
    assert group.count is not None
    return np.linspace(group.start, group.end, group.count)


def node_of(text: str) -> Node:
    """The node of "body.name" or "body.line.index", known to exist."""
    body, name, *index = text.split(".")
    return Node(body, name, int(index[0]) if index else None)


def sum_weighted_rows(terms: list[tuple[float, Row]], size: int) -> csc_array:
    """(size, size) sum of weight b b^T over rows b."""
    from scipy.sparse import csr_array

    lengths = [len(row.dofs) for _, row in terms]
    rows = csr_array(
        (
            np.concatenate([row.coefficients for _, row in terms]),
            np.concatenate([row.dofs for _, row in terms]),
            np.concatenate([[0], np.cumsum(lengths)]),
        ),
        shape=(len(terms), size),
    )
    weights = np.repeat([weight for weight, _ in terms], lengths)
    scaled = csr_array((rows.data * weights, rows.indices, rows.indptr), shape=rows.shape)
    return (rows.T @ scaled).tocsc()


def symmetric(matrix: csc_array) -> csc_array:
    """The matrix without the rounding by which its halves differ, nor stored zeros."""
    both = (0.5 * (matrix + matrix.T)).tocsc()
    both.sum_duplicates()
    both.eliminate_zeros()
    return both
