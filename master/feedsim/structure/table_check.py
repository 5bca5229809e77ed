"""Does a machine's table of modes belong to its structure, at its pose? Asked before the table is trusted."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

import numpy as np

from feedsim.foundation import units
from feedsim.foundation.cache import cached
from feedsim.foundation.errors import FeedsimError, few
from feedsim.scenario import Machine
from feedsim.structure.assembly import CODE, MAX_SHOWN_LABELS, State, digest_of, state_of
from feedsim.structure.modes import Modes, read_modes
from feedsim.structure.mounts import MountTable, read_mounts, table_of

# A table and a structure that belong together agree to the eigensolver's error (1e-8); a changed structure is far off.
EIGENVALUE_TOLERANCE = 1e-5
# A mode table belongs to a structure where its frequencies are the structure's, to the digits that tables are given in.
SAME_FREQUENCY = 1e-3
# Mode shapes at mounts, of the largest: the digits of tables, where modes lie near one another.
SAME_SHAPE = 1e-2


def table_mismatch(machine: Machine) -> str | None:
    """A sentence where the table of modes is not that of the machine's pose by its structure; None where it is.

    None as well where it cannot be shown: no structure, matrices (of one pose, and costly to solve), or a structure
    that is faulty, which who needs it will say.
    """
    if machine.structure is None:
        return None
    structure = machine.structure

    def find() -> str:
        built = _modes(structure, state_of(structure), tuple(machine.pose.items()))
        if built is None:
            return ""
        table = read_modes(machine.modes, list(machine.axes))
        return stale(table, built[0], SAME_FREQUENCY) or _other_mounts(machine, table, built[1])

    try:
        paths = (structure, machine.modes, *([machine.mounts.table] if machine.mounts is not None else []))
        files = [digest_of(path, state_of(path)) for path in paths]
        how = cached("table-of-modes", [files, [*machine.pose.items()], [*machine.axes]], CODE, find)
    except (OSError, FeedsimError):
        return None
    if not how:
        return None
    return (
        f"the table of modes {machine.modes} is not that of the pose {_shown(machine.pose, ' ')}: {how}; build it "
        f"anew: feedsim machine build {machine.structure} --at {_shown(machine.pose, '=')} --out DIR"
    )


def _shown(pose: Mapping[str, float], between: str) -> str:
    if between == "=":
        return " ".join(f"{axis}={1e3 * position:.9g}mm" for axis, position in pose.items())
    return ", ".join(f"{axis}{between}{units.show(position, 'm')}" for axis, position in pose.items())


@lru_cache(maxsize=32)
def _modes(
    structure: Path, state: State, pose: tuple[tuple[str, float], ...]
) -> tuple[Modes, MountTable | None] | None:
    """Modes at the pose, and mounts that are not linear; `state` is that of the file: a changed one is read anew."""
    # Loaded where there is something to solve.
    from feedsim.structure.geometry.assemble import assembler_of, structure_axes, structure_of
    from feedsim.structure.solve import solve

    description = structure_of(structure, state)
    axes = structure_axes(description)
    if not axes:
        return None
    assembly = assembler_of(structure, state).at({axis: position for axis, position in pose if axis in axes})
    # The sparse way: of a model of some hundred degrees of freedom, in less than half the time of full matrices.
    found = solve(assembly, cutoff=description.cutoff, damping=description.damping, dense_limit=0, described=False)
    return found.modes, table_of(assembly, found.shapes)


def _other_mounts(machine: Machine, modes: Modes, built: MountTable | None) -> str:
    """In words where the machine's table of mounts is not the structure's; "" where it is, or there is none."""
    if machine.mounts is None:
        return ""
    if built is None:
        return f"{machine.mounts.table} has mounts that are not linear; the structure has none"
    table = read_mounts(machine.mounts.table, len(modes.frequency))
    if table.names != built.names:
        own, others = (few(names, MAX_SHOWN_LABELS) for names in (table.names, built.names))
        return f"{machine.mounts.table} has the mounts {own}; the structure has {others}"
    if table.shapes.shape != built.shapes.shape:
        return ""  # cut off elsewhere, or with pseudo-modes
    off = np.abs(table.element - built.element) > SAME_FREQUENCY * np.abs(built.element)
    moved = np.abs(table.shapes - built.shapes).max(axis=1) > SAME_SHAPE * np.abs(built.shapes).max(axis=1)
    if not (off.any() or moved.any()):
        return ""
    name = table.names[int(np.flatnonzero(off.any(axis=1) | moved)[0])]
    return f"mount {name} of {machine.mounts.table} is another one than the structure's"


def stale(table: Modes, built: Modes, tolerance: float = EIGENVALUE_TOLERANCE) -> str:
    """In words where a table of modes is not what the structure gives at the pose that it belongs to; "" where it is.

    Compared are what the drives see of it: frequencies of modes and inertias of axes. A table may have been cut off
    elsewhere, and may end in pseudo-modes of a static correction: then the modes that both have count.

    built: modes without pseudo-modes. tolerance: relative [1].
    """
    count = min(len(table.frequency), len(built.frequency))
    whole = len(table.frequency) == len(built.frequency)
    here, there = table.frequency[:count], built.frequency[:count]
    off = np.flatnonzero(np.abs(here - there) > tolerance * there)
    if len(off):
        k = int(off[0])
        # At most one pseudo-mode per port, after the modes; one elastic mode at least has to agree for that.
        corrected = len(table.frequency) - k <= len(table.ports) and bool(np.any(there[:k] > 0))
        if whole or not corrected:
            return f"mode {k} has {here[k]:.6g} Hz; the structure gives {there[k]:.6g} Hz"
    for axis in built.axes:
        inertias = [("J_tot", table.J_tot(axis), built.J_tot(axis))]
        if whole:  # it is a sum over all modes
            inertias.append(("J_inf", table.J_inf(axis), built.J_inf(axis)))
        for what, own, other in inertias:
            if abs(own - other) > tolerance * other:
                return f"{what} of {axis} is {own:.6g} kg.m2 by it; the structure gives {other:.6g} kg.m2"
    return ""
