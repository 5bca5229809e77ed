"""Structure files: what every kind gives, and what a machine written as geometry is made of.

Read by structure_checks.py (load_structure), which sees the parts together.
"""

from __future__ import annotations

import re
from functools import partial
from math import hypot, isfinite, pi
from typing import Annotated, Any, Literal, Self

from pydantic import (
    Field,
    PlainValidator,
    StrictInt,
    StrictStr,
    ValidationInfo,
    WithJsonSchema,
    field_validator,
    model_validator,
)

from feedsim.files.fields import AxisName, File, Model, Quantity, brief, fault


class DampingStep(Model):
    """A damping ratio that counts for low frequencies."""

    below: Annotated[float, Quantity("rad/s", above=0, example="30 Hz")] = Field(
        description="Modes of lower frequency have this ratio"
    )
    ratio: Annotated[float, Quantity("1", minimum=0, maximum=1, example="6 %")] = Field(description="Damping ratio")


class Damping(Model):
    """Modal damping: one ratio, others for low frequencies."""

    ratio: Annotated[float, Quantity("1", minimum=0, maximum=1, example="2 %")] = Field(description="Damping ratio")
    steps: tuple[DampingStep, ...] = Field(
        default=(), description="Ratios of low modes; the step of the lowest frequency above a mode's counts"
    )


class Structure(Model):
    """What every kind of structure file gives. Frequencies are angular [rad/s]."""

    name: StrictStr = Field(default="", description="Name in reports")
    note: StrictStr = Field(default="", description="Remark shown wherever the structure's numbers are shown")
    damping: Damping = Field(description="Modal damping")
    cutoff: Annotated[float, Quantity("rad/s", above=0, example="1000 Hz")] = Field(
        default=6283.185307179586, description="Modes above this frequency are dropped"
    )


# --- Field types of a machine written as geometry: points, directions, names of nodes ---------------------------------


NAME_PATTERN = r"[A-Za-z][A-Za-z0-9_]*"
NODE = rf"{NAME_PATTERN}(?:\.[0-9]+)?"
NODES = rf"{NAME_PATTERN}(?:\.[0-9]+(?:\.\.[0-9]+)?)?"
FRAME = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}

Length = Annotated[float, Quantity("m")]
Point = tuple[Length, Length, Length]
Stiffness = Annotated[float, Quantity("N/m", above=0)]
StiffnessOrNone = Annotated[float, Quantity("N/m", minimum=0)]
Mass = Annotated[float, Quantity("kg", above=0)]
Inertia = Annotated[float, Quantity("kg.m^2", minimum=0)]


def _text(pattern: str, what: str) -> tuple[PlainValidator, WithJsonSchema]:
    """Text of a pattern; `what` says what it is in messages."""
    return PlainValidator(partial(_match_text, pattern, what)), WithJsonSchema(_schema(pattern))


def _texts(pattern: str, what: str) -> tuple[PlainValidator, WithJsonSchema]:
    """One text of the pattern or a list of them; kept as a tuple."""

    def read(value: Any) -> tuple[str, ...]:
        if isinstance(value, (list, tuple)):
            if not value:
                raise fault(f"an empty list; a {what} is needed")
            return tuple(_match_text(pattern, what, item) for item in value)
        return (_match_text(pattern, what, value),)

    one = _schema(pattern)
    return PlainValidator(read), WithJsonSchema({"anyOf": [one, {"type": "array", "items": one, "minItems": 1}]})


def _match_text(pattern: str, what: str, value: Any) -> str:
    if not isinstance(value, str) or not re.fullmatch(pattern, value):
        raise fault(f"{brief(value)} is no {what}")
    return value


def _schema(pattern: str) -> dict[str, Any]:
    return {"type": "string", "pattern": f"^(?:{pattern})$"}


def _direction(value: Any) -> tuple[float, float, float]:
    shown = "a direction is expected: X, Y or Z of the frame, -X, -Y, -Z, or a list of three numbers"
    if isinstance(value, str):
        sign, letter = (-1.0, value[1:]) if value.startswith("-") else (1.0, value.removeprefix("+"))
        if letter not in FRAME:
            raise fault(f"{brief(value)}; {shown}")
        x, y, z = (sign * part + 0.0 for part in FRAME[letter])
        return x, y, z
    if not isinstance(value, (list, tuple)) or len(value) != 3:
        raise fault(f"{brief(value)}; {shown}")
    if any(isinstance(part, bool) or not isinstance(part, (int, float)) for part in value):
        raise fault(f"a direction takes plain numbers, for example [0, 0.6, 0.8]; {shown}")
    length = hypot(*value)
    if not isfinite(length) or length < 1e-12:
        raise fault(f"[{', '.join(str(part) for part in value)}] points nowhere; {shown}")
    x, y, z = (float(part) / length for part in value)
    return x, y, z


# A direction in the machine's frame: X, -X, ... or a list of three numbers; kept as a unit vector.
_DIRECTION_LETTERS = {"type": "string", "enum": [sign + letter for sign in ("", "-", "+") for letter in FRAME]}
_VECTOR = {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}
Direction = Annotated[
    tuple[float, float, float], PlainValidator(_direction), WithJsonSchema({"anyOf": [_DIRECTION_LETTERS, _VECTOR]})
]
Name = Annotated[str, *_text(NAME_PATTERN, "name: a letter, then letters, digits and _")]
# Inside a body: one node; a node, a node of a line, some of its nodes, all of them.
OwnNode = Annotated[str, *_text(NODE, "node of this body, such as top or post.3")]
Nodes = Annotated[tuple[str, ...], *_texts(NODES, "node of this body, such as top, post.3, post.2..6 or post (all)")]
NodeList = tuple[Annotated[str, *_text(NODES, "node of this body, such as top, post.3, post.2..6 or post (all)")], ...]
# Anywhere: the body first.
BodyNode = Annotated[str, *_text(rf"{NAME_PATTERN}\.{NODE}", "node, such as column.top or bed.rail.3")]
Rail = Annotated[str, *_text(rf"{NAME_PATTERN}\.{NAME_PATTERN}", "line of nodes, such as bed.rail")]
Hold = Annotated[
    tuple[str, ...],
    *_texts(
        rf"{NAME_PATTERN}\.{NODE}|rail {NAME_PATTERN}\.{NAME_PATTERN}",
        "place to hold on to: a node such as column.top or bed.rail.3, a list of nodes, or 'rail bed.rail'",
    ),
]


Size = Annotated[float, Quantity("m", above=0)]
End = Literal["start", "end"]
MOST_NODES = 1000


class Material(Model):
    """An isotropic elastic material."""

    E: Annotated[float, Quantity("Pa", above=0)] = Field(description="Modulus of elasticity")
    nu: Annotated[float, Quantity("1", above=-1, maximum=0.5, example="0.3")] = Field(description="Poisson's ratio")
    rho: Annotated[float, Quantity("kg/m^3", above=0)] = Field(description="Density")

    @property
    def G(self) -> float:
        """Shear modulus [Pa]: E / (2 (1 + nu))."""
        return self.E / (2 * (1 + self.nu))


class SectionBase(Model):
    """What every section has."""

    material: Name | None = Field(default=None, description="Material; may be left out where there is only one")
    mass_factor: Annotated[float, Quantity("1", above=0, example="1.1")] = Field(
        default=1.0, description="Mass per length over that of the bare section: ribs, covers, cables add no stiffness"
    )


class Box(SectionBase):
    """A hollow rectangle. Height is measured along the beam's local y, width along its local z."""

    kind: Literal["box"] = "box"
    width: Size = Field(description="Outer width, along local z")
    height: Size = Field(description="Outer height, along local y (upwards in a beam that is not upright)")
    wall: Size = Field(description="Wall thickness")

    @model_validator(mode="after")
    def _hollow(self) -> Self:
        if self.wall * 2 >= min(self.width, self.height):
            raise fault(
                f"a wall of {self.wall:.9g} m leaves no hole in {self.width:.9g} x {self.height:.9g} m; "
                "less than half the smaller side is allowed"
            )
        return self


class Rectangle(SectionBase):
    """A solid rectangle. Height is measured along the beam's local y, width along its local z."""

    kind: Literal["rectangle"] = "rectangle"
    width: Size = Field(description="Width, along local z")
    height: Size = Field(description="Height, along local y (upwards in a beam that is not upright)")


class Rod(SectionBase):
    """A solid circle."""

    kind: Literal["rod"] = "rod"
    diameter: Size = Field(description="Diameter")


class Tube(SectionBase):
    """A hollow circle."""

    kind: Literal["tube"] = "tube"
    diameter: Size = Field(description="Outer diameter")
    wall: Size = Field(description="Wall thickness")

    @model_validator(mode="after")
    def _hollow(self) -> Self:
        if self.wall * 2 >= self.diameter:
            raise fault(
                f"a wall of {self.wall:.9g} m leaves no hole in a tube of {self.diameter:.9g} m; "
                "less than half the diameter is allowed (a solid one is a rod)"
            )
        return self


class Properties(SectionBase):
    """A section given by its properties."""

    kind: Literal["properties"] = "properties"
    A: Annotated[float, Quantity("m^2", above=0)] = Field(description="Area")
    Iy: Annotated[float, Quantity("m^4", above=0)] = Field(description="Second moment of area about local y")
    Iz: Annotated[float, Quantity("m^4", above=0)] = Field(description="Second moment of area about local z")
    J: Annotated[float, Quantity("m^4", above=0)] = Field(description="Torsion constant")


Section = Annotated[Box | Rectangle | Rod | Tube | Properties, Field(discriminator="kind")]


class Screw(Model):
    """A ball screw: a rod that lies along the axis and moves with a body."""

    body: Name = Field(description="Body in whose frame start and end are given, and with which the screw moves")
    start: Point = Field(description="End at the motor")
    end: Point = Field(description="Other end")
    diameter: Annotated[float, Quantity("m", above=0, example="50 mm")] = Field(description="Diameter of the rod")
    nodes: Annotated[StrictInt, Field(ge=2, le=MOST_NODES)] = Field(
        default=13, description="Equally spaced nodes, both ends included"
    )
    material: Name | None = Field(default=None, description="Material; may be left out where there is only one")


class Bearing(Model):
    """A bearing at an end of the screw."""

    at: End = Field(description="End of the screw: start (at the motor) or end")
    held_by: Hold = Field(description="What carries it: a node, a list of nodes (their mean)")
    axial: StiffnessOrNone = Field(default=0.0, description="Stiffness along the screw; 0 N/m is a floating bearing")
    radial: StiffnessOrNone = Field(default=0.0, description="Stiffness across the screw, in every direction")


class Nut(Model):
    """The ball nut."""

    body: Name = Field(description="Body in whose frame `at` is given, and with which the nut moves")
    at: Point = Field(description="Where the nut sits on the screw")
    held_by: Hold = Field(description="What carries it: a node, a list of nodes (their mean), or a rail")
    rotation_of: Hold | None = Field(
        default=None, description="What the nut turns with about the screw; what carries it where left out"
    )
    axial: Stiffness = Field(description="Stiffness along the screw")
    radial: StiffnessOrNone = Field(default=0.0, description="Stiffness across the screw, in every direction")


class Rotor(Model):
    """The motor's rotor: it turns, and nothing else."""

    inertia: Annotated[float, Quantity("kg.m^2", above=0)] = Field(description="Inertia, with half of the coupling")
    coupling: Annotated[float, Quantity("N.m/rad", above=0)] = Field(
        description="Torsional stiffness of the coupling to the screw's start"
    )


class Stator(Model):
    """The motor's housing, at the start of the screw."""

    node: BodyNode = Field(description="Node that carries it and takes the reaction of the motor's torque")
    mass: Annotated[float, Quantity("kg", minimum=0)] = Field(default=0.0, description="Mass")
    inertia: tuple[Inertia, Inertia, Inertia] = Field(
        default=(0.0, 0.0, 0.0), description="Moments of inertia about its own centre, about X, Y, Z of the frame"
    )


class Drive(Model):
    """Motor, screw, bearings and nut of an axis."""

    pitch: Annotated[float, Quantity("m", above=0, example="20 mm")] = Field(
        description="Travel of the axis per turn of the screw"
    )
    screw: Screw
    bearings: tuple[Bearing, ...] = Field(description="Bearings of the screw")
    nut: Nut
    rotor: Rotor
    stator: Stator

    @property
    def I_P(self) -> float:
        """Lead [m/rad]: pitch / 2 pi."""
        return self.pitch / (2 * pi)

    @field_validator("bearings")
    @classmethod
    def _check_bearings(cls, bearings: tuple[Bearing, ...]) -> tuple[Bearing, ...]:
        if not any(bearing.axial > 0 for bearing in bearings):
            raise fault("no bearing holds the screw along its axis; at least one needs axial above 0 N/m")
        return bearings


class Scale(Model):
    """The linear scale: travel of the axis as its position control sees it."""

    body: Name = Field(description="Body in whose frame `at` is given, and with which the reading point moves")
    at: Point = Field(description="Point where the scale is read")
    moving: Hold = Field(description="What moves with the axis: a node, a list of nodes (their mean), or a rail")
    against: Hold = Field(description="What the travel is measured against")


class Tool(Model):
    """The tool's point, and the workpiece that it works on."""

    body: Name = Field(description="Body in whose frame `at` is given")
    at: Point = Field(description="Tool centre point")
    held_by: Hold = Field(description="What carries the tool")
    against: Hold = Field(description="What carries the workpiece")


# --- A machine written as geometry: bodies of beams and masses that move with axes, guides, drives, tool --------------


MOST_GEOMETRY_NODES = 10_000


class NodeGroup(Model):
    """One node, or a straight line of equally spaced nodes."""

    at: Point | None = Field(default=None, description="Position of a single node, in the body's frame")
    start: Point | None = Field(default=None, description="First node of a line, in the body's frame")
    end: Point | None = Field(default=None, description="Last node of a line")
    count: Annotated[StrictInt, Field(ge=2, le=MOST_GEOMETRY_NODES)] | None = Field(
        default=None, description="Nodes of a line, both ends included"
    )
    section: Name | None = Field(default=None, description="Section of the beams along a line; none: nodes only")
    up: Direction | None = Field(default=None, description="Direction that local y of the beams is turned towards")

    @model_validator(mode="after")
    def _node_or_line(self) -> Self:
        line = {"start": self.start, "end": self.end, "count": self.count}
        if self.at is not None:
            if extra := [key for key, value in (line | {"section": self.section, "up": self.up}).items() if value]:
                raise fault(f"'at' makes this a single node and '{extra[0]}' a line of nodes; one of them is meant")
        elif missing := [key for key, value in line.items() if value is None]:
            if len(missing) == len(line):
                raise fault("a node needs 'at', a line of nodes needs 'start', 'end' and 'count'")
            raise fault(f"a line of nodes needs 'start', 'end' and 'count'; '{missing[0]}' is missing")
        elif self.start == self.end:
            raise fault("start and end are the same point; a line of nodes has a length")
        return self


class Beams(Model):
    """Beams through nodes of the body, one from each to the next."""

    section: Name = Field(description="Section")
    through: Annotated[NodeList, Field(min_length=2)] = Field(
        description="Nodes that the beams join, in order; lines of equal count are joined node by node"
    )
    up: Direction | None = Field(default=None, description="Direction that local y of the beams is turned towards")


class PointMass(Model):
    """A rigid mass on a node, or one on each of several nodes."""

    nodes: Nodes = Field(description="Node, or nodes that carry one such mass each")
    offset: Point = Field(default=(0.0, 0.0, 0.0), description="Its centre, as seen from the node")
    mass: Mass = Field(description="Mass (of each)")
    inertia: tuple[Inertia, Inertia, Inertia] = Field(
        default=(0.0, 0.0, 0.0), description="Moments of inertia about its own centre, about X, Y, Z of the frame"
    )


Stiffnesses = tuple[StiffnessOrNone, StiffnessOrNone, StiffnessOrNone]
Force = Annotated[float, Quantity("N", minimum=0)]
Deflection = Annotated[float, Quantity("m", above=0, example="20 um")]
Damper = Annotated[float, Quantity("N.s/m", minimum=0)]


class MountFriction(Model):
    """Friction of a mount: stiff where it turns back, and never beyond its limit."""

    F_max: tuple[Force, Force, Force] = Field(description="Limit of the force along X, Y, Z; 0 N: none")
    x_2: tuple[Deflection, Deflection, Deflection] = Field(
        description="Deflection from rest at which half of F_max is reached"
    )


class MountViscous(Model):
    """Spring and damper in series, beside the rest of a mount."""

    K_v: Stiffnesses = Field(description="Stiffness of the spring along X, Y, Z")
    c: tuple[Damper, Damper, Damper] = Field(description="Damper")


class Mount(Model):
    """A spring to the ground at a node, or one at each of several nodes; with friction or a viscous part it is not
    linear."""

    nodes: Nodes = Field(description="Node, or nodes with one such mount each")
    offset: Point = Field(default=(0.0, 0.0, 0.0), description="Where the mount acts, as seen from the node")
    stiffness: tuple[Stiffness, Stiffness, Stiffness] = Field(
        description="Stiffness (of each) along X, Y, Z of the frame; that of the modes"
    )
    elastic: Stiffnesses | None = Field(
        default=None, description="Elastic part of a mount that is not linear (default: stiffness less F_max/x_2)"
    )
    friction: MountFriction | None = Field(default=None, description="Friction, beside the elastic part")
    viscous: MountViscous | None = Field(default=None, description="Spring and damper in series, beside both")

    @property
    def linear(self) -> bool:
        """Whether it is the spring of the modes and nothing else."""
        return self.elastic is None and self.friction is None and self.viscous is None

    @property
    def elements(self) -> tuple[tuple[float, float, float, float, float, float], ...]:
        """K_lin [N/m], K_e [N/m], F_max [N], x_2 [m], K_v [N/m], c [N.s/m] along X, Y, Z. Without friction x_2 is
        1 m, which acts nowhere."""
        result = []
        for d, K_lin in enumerate(self.stiffness):
            F_max, x_2 = (self.friction.F_max[d], self.friction.x_2[d]) if self.friction else (0.0, 1.0)
            K_v, c = (self.viscous.K_v[d], self.viscous.c[d]) if self.viscous else (0.0, 0.0)
            K_e = K_lin - F_max / x_2 if self.elastic is None else self.elastic[d]
            result.append((K_lin, K_e, F_max, x_2, K_v, c))
        return tuple(result)

    @model_validator(mode="after")
    def _check_elastic_force(self) -> Self:
        for direction, (K_lin, K_e, F_max, x_2, _, _) in zip("XYZ", self.elements, strict=True):
            if K_e < 0:
                raise fault(
                    f"along {direction} friction has the stiffness F_max/x_2 = {F_max / x_2 / 1e6:.6g} N/um at rest, "
                    f"more than the mount's {K_lin / 1e6:.6g} N/um: less F_max, a larger x_2, or give the elastic part",
                    beside=("friction",),
                )
        return self


class Carriage(Model):
    """A guide carriage: fixed to a node of this body, riding on a rail of another."""

    node: OwnNode = Field(description="Node of this body that carries it")
    at: Point = Field(description="Where it meets the rail, in this body's frame")
    rail: Rail = Field(description="Line of nodes that it rides on, such as bed.rail")
    stiffness: Stiffness = Field(description="Stiffness in each of the directions")
    directions: Annotated[tuple[Direction, ...], Field(min_length=1)] = Field(
        description="Directions in which the carriage holds, such as [Y, Z]"
    )


class Body(Model):
    """What moves as one with the axes: beams and masses in a frame of their own."""

    origin: Point = Field(
        default=(0.0, 0.0, 0.0), description="Origin of the body's frame in the machine's, where every axis is at 0"
    )
    moves_with: tuple[AxisName, ...] = Field(default=(), description="Axes that carry it; none for the machine's base")
    nodes: Annotated[dict[Name, NodeGroup], Field(min_length=1)] = Field(description="Nodes and lines of nodes")
    beams: tuple[Beams, ...] = Field(default=(), description="Beams between nodes")
    masses: tuple[PointMass, ...] = Field(default=(), description="Rigid masses")
    mounts: tuple[Mount, ...] = Field(default=(), description="Springs to the ground")
    carriages: tuple[Carriage, ...] = Field(default=(), description="Guide carriages on rails of other bodies")


class StructureAxis(Model):
    """A linear feed axis."""

    direction: Direction = Field(description="Way that the bodies go that move with it: X, -X, ... or three numbers")
    travel: tuple[Annotated[float, Quantity("m")], Annotated[float, Quantity("m")]] = Field(
        description="Lowest and highest position"
    )
    drive: Drive
    scale: Scale

    @field_validator("travel")
    @classmethod
    def _check_ascending(cls, travel: tuple[float, float]) -> tuple[float, float]:
        if travel[0] >= travel[1]:
            raise fault(f"travel from {travel[0]:.9g} m to {travel[1]:.9g} m; the first must be the lower end")
        return travel


class GeometryStructure(Structure):
    """A machine as geometry. Frame and directions: X, Y, Z of the machine; Y is up where a beam has no `up`."""

    kind: Literal["geometry"] = "geometry"
    materials: Annotated[dict[Name, Material], Field(min_length=1)] = Field(description="Materials")
    sections: dict[Name, Section] = Field(default={}, description="Cross-sections of beams")
    bodies: Annotated[dict[Name, Body], Field(min_length=1)] = Field(description="Bodies, from the base to the tool")
    axes: Annotated[dict[AxisName, StructureAxis], Field(min_length=1)] = Field(
        description="Feed axes in the order of the plant"
    )
    tool: Tool = Field(description="Tool against workpiece")

    def material(self, name: str | None) -> Material:
        """The material of that name; the only one where it is not named."""
        return self.materials[name] if name is not None else next(iter(self.materials.values()))


# --- Structures that come as finite-element matrices: Matrix Market, ANSYS, CalculiX ----------------------------------


class UnitSystem(Model):
    """Units that a finite-element program calculated in; forces are those that follow from them.

    Millimetre, tonne, second goes with newton and MPa; metre, kilogram, second with newton and Pa.
    """

    length: Literal["m", "cm", "mm"] = Field(description="Unit of coordinates and displacements")
    mass: Literal["kg", "g", "t"] = Field(description="Unit of mass")
    time: Literal["s", "ms"] = Field(default="s", description="Unit of time")


SI = UnitSystem(length="m", mass="kg")


class FiniteElements(Structure):
    """What every finite-element model gives beside its matrices."""

    axes: tuple[AxisName, ...] = Field(default=(), description="Axes in the order of the plant; none: for inspection")
    pose: dict[AxisName, Annotated[float, Quantity("m", example="800 mm")]] = Field(
        default={}, description="Axis positions at which the matrices were made"
    )
    ports: File | None = Field(
        default=None,
        validate_default=True,
        description="Table of ports: port, node, direction, coefficient, or port, dof, coefficient; needed with axes",
    )
    nodes: File | None = Field(default=None, description="Table of nodes: node, x, y, z, and name, body where known")
    lines: File | None = Field(default=None, description="Table of lines between nodes for pictures: from, to")

    @field_validator("axes")
    @classmethod
    def _unique(cls, axes: tuple[str, ...]) -> tuple[str, ...]:
        for name in axes:
            if axes.count(name) > 1:
                raise fault(f"axis {name!r} occurs twice")
        return axes

    @field_validator("ports")
    @classmethod
    def _for_the_axes(cls, ports: object, info: ValidationInfo) -> object:
        axes = info.data.get("axes")
        if axes and ports is None:
            raise fault(
                f"missing key 'ports'; the axes {', '.join(axes)} need ports n_{axes[0]}, x_{axes[0]} and so on"
            )
        return ports

    @field_validator("pose")
    @classmethod
    def _of_the_axes(cls, pose: dict[str, float], info: ValidationInfo) -> dict[str, float]:
        axes = info.data.get("axes")
        if pose and axes is not None and set(pose) != set(axes):
            given, wanted = ", ".join(pose), ", ".join(axes) or "none"
            raise fault(f"the pose names {given}; the axes are {wanted}")
        return pose


class MatrixMarketStructure(FiniteElements):
    """Mass and stiffness as Matrix Market files."""

    kind: Literal["matrices"] = "matrices"
    mass: File = Field(description="Mass matrix, Matrix Market file")
    stiffness: File = Field(description="Stiffness matrix, Matrix Market file")
    units: UnitSystem = Field(default=SI, description="Units of matrices, ports and nodes; metre, kilogram by default")


class AnsysStructure(FiniteElements):
    """Matrices of an ANSYS modal analysis."""

    kind: Literal["ansys"] = "ansys"
    full: File = Field(description="Binary file with mass and stiffness (jobname.full) of a modal analysis")
    units: UnitSystem = Field(description="Units of the analysis, for example {length: mm, mass: t}")


class CalculixStructure(FiniteElements):
    """Matrices that CalculiX stores with *FREQUENCY, SOLVER=MATRIXSTORAGE."""

    kind: Literal["calculix"] = "calculix"
    stiffness: File = Field(description="Stiffness matrix (jobname.sti)")
    mass: File = Field(description="Mass matrix (jobname.mas)")
    dofs: File = Field(description="Node and direction of each row (jobname.dof)")
    mesh: File | None = Field(
        default=None, description="Input file with nodes and elements (jobname.inp); then no table of nodes is needed"
    )
    units: UnitSystem = Field(description="Units of the analysis, for example {length: mm, mass: t}")

    @field_validator("mesh")
    @classmethod
    def _one_source_of_nodes(cls, mesh: object, info: ValidationInfo) -> object:
        if mesh is not None and info.data.get("nodes") is not None:
            raise fault("nodes come from the mesh or from the table under 'nodes', not from both", beside=("nodes",))
        return mesh
