"""The kinds of structure files: which model each is read as, and what is checked of it as a whole."""

from __future__ import annotations

from collections.abc import Iterator

from feedsim.scenario.source import Place
from feedsim.scenario.structure import Structure
from feedsim.scenario.structure import checks as structure_checks
from feedsim.scenario.structure.geometry import GeometryStructure
from feedsim.scenario.structure.matrices import AnsysStructure, CalculixStructure, MatrixMarketStructure

KINDS: dict[str, type[Structure]] = {
    "geometry": GeometryStructure,
    "matrices": MatrixMarketStructure,
    "ansys": AnsysStructure,
    "calculix": CalculixStructure,
}


def contradictions_of(structure: Structure) -> Iterator[tuple[Place, str]]:
    """Place and message of what cannot go together in a structure of any kind."""
    if isinstance(structure, GeometryStructure):
        yield from structure_checks.contradictions(structure)
