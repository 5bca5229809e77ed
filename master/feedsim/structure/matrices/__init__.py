"""Finite-element models of other programs: Matrix Market, ANSYS and CalculiX matrices with ports, as an Assembly."""

from __future__ import annotations

from feedsim.scenario.structure.matrices import (
    AnsysStructure,
    CalculixStructure,
    FiniteElements,
    MatrixMarketStructure,
)
from feedsim.structure.assembly import Assembly
from feedsim.structure.matrices.build import Imported, build

__all__ = ["Imported", "assemble", "import_model"]


def import_model(structure: FiniteElements) -> Imported:
    """The model of a structure file of kind matrices, ansys or calculix, and notes on the import.

    Raises:
        InputError: a file is not readable or the files contradict one another.
    """
    if isinstance(structure, MatrixMarketStructure):
        from feedsim.structure.matrices import market

        return build(structure, structure.units, market.read(structure), structure.name or str(structure.stiffness))
    if isinstance(structure, AnsysStructure):
        from feedsim.structure.matrices import ansys

        return build(structure, structure.units, ansys.read(structure), structure.name or str(structure.full))
    if isinstance(structure, CalculixStructure):
        from feedsim.structure.matrices import calculix

        return build(structure, structure.units, calculix.read(structure), structure.name or str(structure.stiffness))
    raise TypeError(f"no kind of finite-element model: {type(structure).__name__}")


def assemble(structure: FiniteElements) -> Assembly:
    """The model alone; see import_model."""
    return import_model(structure).assembly
