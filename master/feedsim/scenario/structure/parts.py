"""What a machine written as geometry is made of: materials and cross-sections of beams; ball-screw drive, linear scale
and tool.
"""

from __future__ import annotations

import re
from functools import partial
from math import hypot, isfinite, pi
from typing import Annotated, Any, Literal, Self

from pydantic import Field, PlainValidator, StrictInt, WithJsonSchema, field_validator, model_validator

from feedsim.fields import Model, Quantity, brief, fault

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
    return PlainValidator(partial(_read, pattern, what)), WithJsonSchema(_schema(pattern))


def _texts(pattern: str, what: str) -> tuple[PlainValidator, WithJsonSchema]:
    """One text of the pattern or a list of them; kept as a tuple."""

    def read(value: Any) -> tuple[str, ...]:
        if isinstance(value, (list, tuple)):
            if not value:
                raise fault(f"an empty list; a {what} is needed")
            return tuple(_read(pattern, what, item) for item in value)
        return (_read(pattern, what, value),)

    one = _schema(pattern)
    return PlainValidator(read), WithJsonSchema({"anyOf": [one, {"type": "array", "items": one, "minItems": 1}]})


def _read(pattern: str, what: str, value: Any) -> str:
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
    def _held(cls, bearings: tuple[Bearing, ...]) -> tuple[Bearing, ...]:
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
