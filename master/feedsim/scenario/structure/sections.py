"""Materials and cross-sections of beams."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from feedsim.fields import Model, Quantity, fault
from feedsim.scenario.structure.fields import Name

Size = Annotated[float, Quantity("m", above=0)]


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
