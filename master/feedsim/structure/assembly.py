"""A finite-element model of a machine at one pose: matrices, ports, and what is where."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from feedsim.foundation import errors
from feedsim.foundation.outputs import file_digest
from feedsim.scenario.structure import SI, UnitSystem

if TYPE_CHECKING:
    from scipy.sparse import csc_array

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Positions that are typed twice are the same where they differ by less [m].
SAME_POSITION = 1e-9
MAX_SHOWN_LABELS = 5  # labels in a message
DEGREES = ("degree of freedom", "degrees of freedom")


@dataclass(frozen=True, eq=False)
class Geometry:
    """Where the degrees of freedom are: for pictures, and to say what moves in a mode.

    Attributes:
        nodes: (K, 3) positions at the pose, machine frame [m].
        names: (K,) names such as "bed B1[3]".
        bodies: (K,) body that a node belongs to, such as "bed", "column", "screw X", "rotor X".
        dofs: (K, 6) degree of freedom of ux, uy, uz, rx, ry, rz of each node; -1 where it has none.
        lines: (L, 2) nodes that a line joins (beam, edge of an element, spring).
    """

    nodes: Floats
    names: tuple[str, ...]
    bodies: tuple[str, ...]
    dofs: Integers
    lines: Integers


class MountPort(NamedTuple):
    """A direction of a mount that is not linear.

    name: "bed.B0.4 X". element: K_lin [N/m], K_e [N/m], F_max [N], x_2 [m], K_v [N/m], c [N.s/m]. port: (N,) vector b,
    whose b^T u is its deflection.
    """

    name: str
    element: tuple[float, ...]
    port: Floats


@dataclass(frozen=True, eq=False)
class Assembly:
    """M u'' + K u = sum over the ports of b F;  the displacement at a port is b^T u.

    Ports of an axis A: n_A (rotor against stator: torque in, angle out), x_A (linear scale: travel out). Ports of the
    tool: tcp_X, tcp_Y, tcp_Z (tool against workpiece: force in, displacement out). SI units.

    Attributes:
        name: of the file it was made from, for messages.
        mass, stiffness: (N, N) sparse, symmetric [kg, kg.m, kg.m2; N/m, N, N.m].
        ports: port -> (N,) vector b.
        axes: names of the axes, in order.
        labels: (N,) what a degree of freedom is, such as "bed B1[3] ux".
        geometry: None where only matrices are known.
        pose: axis -> position [m]; empty where it is not known.
        units: that the file gives its numbers in; None of a structure without such a choice.
        mounts: directions of mounts that are not linear.
        tool: (3, N) absolute motion of the tool in X, Y and Z; None where only matrices are known.
    """

    name: str
    mass: csc_array
    stiffness: csc_array
    ports: Mapping[str, Floats]
    axes: tuple[str, ...]
    labels: tuple[str, ...]
    geometry: Geometry | None
    pose: Mapping[str, float]
    units: UnitSystem | None = SI
    mounts: tuple[MountPort, ...] = ()
    tool: Floats | None = None


def translating_mass(assembly: Assembly) -> Floats:
    """Mass that translates in X, Y and Z (3,) [kg]; 0 where the model does not say which way it moves.

    Degrees of freedom that are constrained have left the model and count no more. A rotor that stands as a mass on a
    displacement (docs/fe-import.md) counts as the mass that it is in the model.
    """
    masses = np.zeros(3)
    for d, direction in enumerate(("ux", "uy", "uz")):
        if assembly.geometry is not None:
            columns = assembly.geometry.dofs[:, d]
            unit = np.zeros(len(assembly.labels))
            unit[columns[columns >= 0]] = 1
        else:
            unit = np.array([label.endswith(f" {direction}") for label in assembly.labels], dtype=np.float64)
        masses[d] = unit @ (assembly.mass @ unit)
    return masses


def shorten_labels(labels: Sequence[str], indices: Integers) -> str:
    """The first labels, and how many there are beyond."""
    return errors.shorten_list([labels[int(i)] for i in indices], MAX_SHOWN_LABELS)


def count_text(count: int, one: str, several: str) -> str:
    """ "1 degree of freedom has", "3 degrees of freedom have"."""
    return f"{count} {one if count == 1 else several}"


# --- A structure file as solutions know it: in the state that it has, and the code that solves it ---------------------


# What separates a file from a later one of the same name.
State = tuple[int, int, int]
# What solutions of a structure follow from besides its file: the code that solves structures, and that describes them.
_SCENARIO = Path(__file__).parents[1] / "scenario"
CODE = (Path(__file__).parent, _SCENARIO / "structure.py", _SCENARIO / "structure_checks.py")


def state_of(file: Path) -> State:
    """Time of the last change [ns], length [byte] and number of a file. Raises OSError."""
    result = file.stat()
    return result.st_mtime_ns, result.st_size, result.st_ino


@lru_cache(maxsize=8)
def digest_of(file: Path, state: State) -> str:
    """SHA-256 of the file, which is read anew where its state is another one. Raises OSError."""
    return file_digest(file)
