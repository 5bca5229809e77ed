"""Mass and stiffness from the .full file of an ANSYS modal analysis."""

from __future__ import annotations

import importlib
import importlib.util
import sys
import warnings
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from feedsim.files import source
from feedsim.foundation.errors import Finding, InputError
from feedsim.scenario.structure import AnsysStructure
from feedsim.structure.assembly import DEGREES, count_text
from feedsim.structure.matrices.tables import FREEDOM_NAMES, RawModel, from_triangle, read_points

READER = "ansys.mapdl.reader"
INSTALL = "make ansys (outside a checkout: pip install --no-deps ansys-mapdl-reader)"
# ANSYS numbers its degrees of freedom UX, UY, UZ, ROTX, ROTY, ROTZ from 1.
MECHANICAL_DIRECTIONS = range(1, len(FREEDOM_NAMES) + 1)


def read_model(structure: AnsysStructure) -> RawModel:
    """The model, constrained degrees of freedom marked.

    Raises:
        InputError: the reader is not installed; the file is none of a modal analysis; it holds what cannot be used
            (constraint equations, lumped or unsymmetric matrices, degrees of freedom other than displacements).
    """
    file = structure.full
    source.refuse_unread(file)
    module = _reader()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a missing matrix comes back as None, which is reported below
            content = module.FullFile(file)
            reference, stiffness, mass = content.load_km(as_sparse=True, sort=False)
            kinds = _kinds(file)
    except NotImplementedError as error:
        raise InputError(f"{file}: {error}; LUMPM,OFF and a symmetric eigensolver (MODOPT,LANB) are needed") from error
    except Exception as error:  # the reader meets what is no .full file in many ways
        raise InputError(f"{file}: cannot be read as an ANSYS .full file: {error!r}") from error
    if mass is None or stiffness is None:
        lacking = "mass" if mass is None else "stiffness"
        raise InputError(f"{file}: no {lacking} matrix in it; the file of a modal analysis (ANTYPE,MODAL) has both")
    equations = int(content._header["ncefull"])
    if equations:
        raise InputError(
            f"{file}: {equations} constraint equations (CE, CP, RBE3, bonded contact by MPC), which are not "
            "resolved; join the nodes by stiff elements (beams, contact by penalty) instead"
        )
    nodes = tuple(str(node) for node in reference[:, 0].tolist())
    directions = _directions(file, reference, kinds)
    fixed = np.zeros(len(nodes), dtype=bool)
    row = {pair: i for i, pair in enumerate(zip(nodes, reference[:, 1].tolist(), strict=True))}
    for node, count in content.const.tolist():
        fixed[row[str(node), count]] = True
    points = read_points(structure.nodes, structure.lines) if structure.nodes else None
    matrices = []
    for matrix in (mass, stiffness):
        entries = matrix.tocoo()
        rows, columns = entries.row.astype(np.int64), entries.col.astype(np.int64)
        matrices.append(from_triangle(rows, columns, entries.data.astype(np.float64), len(nodes), file))
    text = f"{count_text(int(fixed.sum()), *DEGREES)} constrained: removed"
    notes = (Finding("freedom-constrained", "doubt", text),) if np.any(fixed) else ()
    return RawModel(
        matrices[0],
        matrices[1],
        nodes,
        directions,
        fixed,
        "the elements there do not use it, or it was condensed",
        points,
        notes,
    )


def _reader() -> Any:
    """The reader's module for .full files.

    Its package loads pyvista and vtk as soon as it is imported, which want a graphics library and take their time;
    the matrices need neither. So the module is imported beside its package's front door.
    """
    if READER in sys.modules:
        return importlib.import_module(f"{READER}.full")
    try:
        specification = importlib.util.find_spec(READER)
    except ImportError:
        specification = None
    if specification is None or specification.submodule_search_locations is None:
        raise InputError(f"ANSYS files are read by the package ansys-mapdl-reader, which is not installed: {INSTALL}")
    stand_in = ModuleType(READER)
    stand_in.__path__ = list(specification.submodule_search_locations)
    sys.modules[READER] = stand_in
    try:
        return importlib.import_module(f"{READER}.full")
    except ImportError as error:
        raise InputError(f"the package ansys-mapdl-reader cannot be loaded: {error}; {INSTALL}") from error
    finally:
        del sys.modules[READER]


def _kinds(file: Path) -> list[int]:
    """ANSYS numbers of the degrees of freedom that occur, in the order in which nodes have them."""
    from ansys.mapdl.reader.common import read_table

    with file.open("rb") as stream:
        read_table(stream, skip=True)  # standard header
        read_table(stream, skip=True)  # header of the .full file
        return [int(kind) for kind in read_table(stream)]


def _directions(file: Path, reference: np.ndarray, kinds: list[int]) -> np.ndarray:
    """(N,) 0 ... 5. The reader counts each node's degrees of freedom; `kinds` says what the count means."""
    others = [kind for kind in kinds if kind not in MECHANICAL_DIRECTIONS]
    if others:
        raise InputError(f"{file}: degrees of freedom other than displacements and rotations (ANSYS numbers {others})")
    counts = np.asarray(reference[:, 1], dtype=np.int64)
    _, per_node = np.unique(reference[:, 0], return_counts=True)
    # A node with fewer than all of them has the first three: a solid beside beams or shells.
    if not np.all((per_node == len(kinds)) | ((per_node == 3) & (kinds[:3] == [1, 2, 3]))):
        raise InputError(
            f"{file}: nodes with {sorted(set(per_node.tolist()))} of {len(kinds)} degrees of freedom; which ones is "
            "not known; nodes need all of them or UX, UY, UZ"
        )
    return np.asarray(kinds, dtype=np.int64)[counts] - 1
