"""Structures that come as finite-element matrices: Matrix Market, ANSYS, CalculiX."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, field_validator

from feedsim.fields import AxisName, File, Model, Quantity, fault
from feedsim.scenario.structure import Structure


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
