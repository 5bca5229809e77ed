"""Structure files: which model each kind is read as, and what is checked of it as a whole."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from feedsim.errors import InputError
from feedsim.fields import brief, did_you_mean
from feedsim.files.checked import checked, read_group
from feedsim.files.problems import describe
from feedsim.files.source import Place
from feedsim.scenario.structure import Structure
from feedsim.scenario.structure import checks as structure_checks
from feedsim.scenario.structure.geometry import GeometryStructure
from feedsim.scenario.structure.matrices import AnsysStructure, CalculixStructure, MatrixMarketStructure

STRUCTURE_FILE = "structure.yaml"
STRUCTURE_KINDS: dict[str, type[Structure]] = {
    "geometry": GeometryStructure,
    "matrices": MatrixMarketStructure,
    "ansys": AnsysStructure,
    "calculix": CalculixStructure,
}


def contradictions_of(structure: Structure) -> Iterator[tuple[Place, str]]:
    """Place and message of what cannot go together in a structure of any kind."""
    if isinstance(structure, GeometryStructure):
        yield from structure_checks.contradictions(structure)


def load_structure(path: str | Path) -> Structure:
    """Read and check a structure: a structure file, or a folder with a structure.yaml, as the model its `kind` names.

    Raises InputError like load().
    """
    path = Path(path)
    path = path / STRUCTURE_FILE if path.is_dir() else path
    source = read_group(path)
    kind = source.data.get("kind")
    if kind is None:
        raise InputError(describe(source, ("kind",), f"missing key 'kind'; allowed: {', '.join(STRUCTURE_KINDS)}"))
    if not isinstance(kind, str) or kind not in STRUCTURE_KINDS:
        raise InputError(
            describe(source, ("kind",), f"unknown kind {brief(kind)}{did_you_mean(str(kind), [*STRUCTURE_KINDS])}")
        )
    return checked(source, STRUCTURE_KINDS[kind], path, contradictions_of)
