"""Levelling mounts that are not linear: their table, which the plant reads, and what they are to a linear view.

Each direction p of a mount has an elastic, a friction and a Maxwell element (M. Berg, "A non-linear rubber spring model
for rail vehicle dynamics analysis", Vehicle System Dynamics 30 (1998) 197-212; equations: src/plant_fmu/mount.h). The
modes hold a linear spring K_lin in its place, and the plant adds F(x) - K_lin x at its mode shapes.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from feedsim.files.trace.files import written_whole
from feedsim.foundation.errors import InputError
from feedsim.structure.assembly import Assembly, Floats

MOUNTS_FILE = "mounts.csv"


@dataclass(frozen=True, eq=False)
class MountTable:
    """Directions of mounts that are not linear.

    Attributes:
        names: (P,) such as "bed.B0.4 X".
        element: (P, 6) K_lin [N/m], K_e [N/m], F_max [N], x_2 [m], K_v [N/m], c [N.s/m].
        shapes: (P, N) mass-normalised mode shapes there [1/kg^0.5].
    """

    names: tuple[str, ...]
    element: Floats
    shapes: Floats


def table_of(assembly: Assembly, shapes: Floats) -> MountTable | None:
    """The mounts of a finite-element model that are not linear, shapes (N, modes); None where all are."""
    if not assembly.mounts:
        return None
    return MountTable(
        tuple(mount.name for mount in assembly.mounts),
        np.array([mount.element for mount in assembly.mounts]),
        np.array([mount.port @ shapes for mount in assembly.mounts]),
    )


def write_mounts(path: Path, table: MountTable) -> None:
    """Write mounts.csv, numbers with the fewest digits that give them back exactly. Raises OutputError."""
    from feedsim_packager.machine_tables import mounts_header

    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(mounts_header(table.shapes.shape[1]))
    for name, element, shape in zip(table.names, table.element.tolist(), table.shapes.tolist(), strict=True):
        writer.writerow((name, *map(repr, element), *map(repr, shape)))
    with written_whole(path) as file:
        file.write(text.getvalue().encode())


def read_mounts(path: Path, modes: int) -> MountTable:
    """Read mounts.csv, for a table of so many modes.

    Raises:
        InputError: lists what is wrong, with file and line.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read as a table of mounts: {error.strerror}") from error
    return _read_table(path, content, modes)


@lru_cache(maxsize=8)
def _read_table(path: Path, content: bytes, modes: int) -> MountTable:
    from feedsim_packager.machine_tables import mount_problems

    if problems := list(mount_problems(content, modes)):
        raise InputError.of(f"{path}: not a table of the mounts of these modes", problems)
    rows = list(csv.reader(io.StringIO(content.decode("utf-8-sig"))))[1:]
    numbers = np.array([row[1:] for row in rows if row], dtype=np.float64)
    return MountTable(tuple(row[0].strip() for row in rows if row), numbers[:, :6], numbers[:, 6:])


def friction_cycle(F_max: Floats, x_2: Floats, x_0: Floats) -> tuple[Floats, Floats]:
    """Stiffness F_0/x_0 [N/m] and loss stiffness E/(pi x_0^2) [N/m] of the friction in a steady cycle of amplitude x_0
    [m] (0: at rest), in closed form; (P,) each."""
    # F_0 in the form that does not cancel where x_0 is small.
    stiffness = 2 * F_max / (np.sqrt(x_2**2 + x_0**2 + 6 * x_2 * x_0) + x_2 + x_0)
    share = np.divide(stiffness * x_0, F_max, out=np.zeros_like(x_0), where=F_max > 0)
    wide = x_2 * (1 + share)
    E = 2 * F_max * (2 * x_0 - wide * (1 + share) * np.log1p(2 * x_0 / wide))
    # The loss is of third order in x_0: below that its closed form is rounding.
    swings = x_0 > 1e-4 * x_2
    return stiffness, np.divide(np.maximum(E, 0), np.pi * x_0**2, out=np.zeros_like(x_0), where=swings)


def viscous_cycle(K_v: Floats, c: Floats, omega: float) -> tuple[Floats, Floats]:
    """Stiffness and loss stiffness [N/m] of the Maxwell element at omega [rad/s]; (P,) each."""
    r = np.divide(omega * c, K_v, out=np.zeros_like(c), where=K_v > 0)
    return K_v * r**2 / (1 + r**2), K_v * r / (1 + r**2)


def scale_elements(table: MountTable, factors: Mapping[str, Any]) -> Floats:
    """The elements (P, 6) with the factors that a machine has for all of them."""
    names = ("K_lin", "K_e", "F_max", "x_2", "K_v", "c")
    return np.asarray(table.element * np.array([float(factors.get(name, 1.0)) for name in names]))
