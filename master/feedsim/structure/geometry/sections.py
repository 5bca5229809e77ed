"""Stiffness and inertia per length of a beam, from its cross-section and material."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from feedsim.scenario.structure.sections import Material, Section


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
