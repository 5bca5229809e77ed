"""A machine written as geometry: bodies of beams and masses that move with axes, guides, drives, tool."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, StrictInt, field_validator, model_validator

from feedsim.fields import AxisName, Model, Quantity, fault
from feedsim.scenario.structure import Structure
from feedsim.scenario.structure.parts import (
    Direction,
    Drive,
    Inertia,
    Mass,
    Material,
    Name,
    NodeList,
    Nodes,
    OwnNode,
    Point,
    Rail,
    Scale,
    Section,
    Stiffness,
    StiffnessOrNone,
    Tool,
)

MOST_NODES = 10_000


class NodeGroup(Model):
    """One node, or a straight line of equally spaced nodes."""

    at: Point | None = Field(default=None, description="Position of a single node, in the body's frame")
    start: Point | None = Field(default=None, description="First node of a line, in the body's frame")
    end: Point | None = Field(default=None, description="Last node of a line")
    count: Annotated[StrictInt, Field(ge=2, le=MOST_NODES)] | None = Field(
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
    def _elastic_is_left(self) -> Self:
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
    def _ascending(cls, travel: tuple[float, float]) -> tuple[float, float]:
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
