"""The shipped machines as structures, changed copies of them, and their modes by a dense eigensolver."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from scipy.linalg import eigh

from feedsim.scenario.structure import GeometryStructure
from feedsim.scenario.structure_checks import load_structure
from feedsim.structure.assembly import Assembly

Floats = NDArray[np.float64]

MACHINES = Path(__file__).resolve().parent.parent / "scenarios" / "machines"
GIVEN_POSE = {"X": 0.8, "Y": 0.327, "Z": 0.1}


def geometry(path: Path) -> GeometryStructure:
    """The structure of a machine's folder or of a file."""
    structure = load_structure(path)
    assert isinstance(structure, GeometryStructure)
    return structure


def default_structure() -> GeometryStructure:
    return geometry(MACHINES / "test_centre")


def one_axis_text() -> str:
    return (MACHINES / "one_axis" / "structure.yaml").read_text(encoding="utf-8")


def one_axis_data() -> Any:
    """The tree of the one-axis machine's file, to be changed and written again."""
    return yaml.safe_load(one_axis_text())


def from_data(data: Any, folder: Path) -> GeometryStructure:
    """The structure that a tree of plain values describes."""
    path = folder / "structure.yaml"
    path.write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
    return geometry(path)


def dense_modes(assembly: Assembly) -> tuple[Floats, Floats]:
    """(N,) frequencies [Hz] and (N, N) mass-normalised shapes (columns), lowest first."""
    squared, shapes = eigh(assembly.stiffness.toarray(), assembly.mass.toarray())
    return np.sqrt(np.abs(squared)) / (2 * np.pi), shapes
