"""Parts of a model that nothing connects: none may fly freely; one that is held on its own is worth a word."""

from __future__ import annotations

import math

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from feedsim.structure.assembly import DEGREES, SHOWN, Assembly, Integers, counted, few
from feedsim.structure.factor import symmetric_factors

# Round-off makes rigid modes of large stiff models mHz; a machine's or a mount's lowest mode is above 1 Hz.
RIGID = (2 * math.pi * 0.1) ** 2
MOST_RIGID = 7  # more than a free body has


def part_faults(assembly: Assembly) -> tuple[list[str], list[str]]:
    """Faults and warnings about parts that neither mass nor stiffness connects to the rest.

    The largest part is left to the solution, which counts its rigid modes. A rotor or a slide that nothing drives is a
    part of its own with a rigid mode, and its axis's ports touch it.
    """
    pattern = sparse.csc_array(abs(assembly.mass) + abs(assembly.stiffness))
    count, part = connected_components(pattern, directed=False)
    if count == 1:
        return [], []
    sizes = np.bincount(part, minlength=count)
    main = int(np.argmax(sizes))
    order = np.argsort(part, kind="stable")
    starts = np.concatenate([[0], np.cumsum(sizes)])
    free = _free_single(assembly, part, sizes)
    faults, held = [], []
    unknown = [p for p in range(count) if p != main and p not in free]
    for p in unknown:
        free[p] = _rigid_modes(assembly, order[starts[p] : starts[p + 1]])
    for p in range(count):
        if p == main:
            continue
        members = order[starts[p] : starts[p + 1]]
        axes = [axis for axis in assembly.axes if _touched(assembly, axis, members)]
        if free[p] > len(axes):
            faults.append((p, members, axes))
        elif free[p] == 0:
            held.append(members)
    return _flying(assembly, faults, free, sizes, main, count), _held(assembly, held, int(sizes[main]))


def _flying(
    assembly: Assembly,
    parts: list[tuple[int, Integers, list[str]]],
    free: dict[int, int],
    sizes: Integers,
    main: int,
    count: int,
) -> list[str]:
    faults = []
    for p, members, axes in parts[:SHOWN]:
        allowed = f" ({len(axes)} for the axes {', '.join(axes)} that act on it)" if axes else ""
        size = counted(len(members), *DEGREES)
        faults.append(
            f"a part flies freely: {size} ({few(assembly.labels, members)}) that nothing connects to the "
            f"{sizes[main]} of the largest part, with {_modes(free[p])}{allowed}; connect it, hold it or leave it out"
        )
    if len(parts) > SHOWN:
        faults.append(f"{len(parts) - SHOWN} more of the {count} parts fly freely")
    return faults


def _modes(count: int) -> str:
    return (
        f"{MOST_RIGID - 1} rigid modes or more" if count >= MOST_RIGID else counted(count, "rigid mode", "rigid modes")
    )


def _held(assembly: Assembly, parts: list[Integers], largest: int) -> list[str]:
    warnings = [
        f"a part of {counted(len(members), *DEGREES)} "
        f"({few(assembly.labels, members)}) is connected to the ground alone, not to the {largest} of the largest part"
        for members in parts[:SHOWN]
    ]
    if len(parts) > SHOWN:
        warnings.append(f"{len(parts) - SHOWN} more parts are connected to the ground alone")
    return warnings


def _touched(assembly: Assembly, axis: str, members: Integers) -> bool:
    return any(np.any(assembly.ports[f"{quantity}_{axis}"][members]) for quantity in ("n", "x"))


def _free_single(assembly: Assembly, part: Integers, sizes: Integers) -> dict[int, int]:
    """Rigid modes of the parts of one degree of freedom, all at once: there may be many."""
    alone = np.flatnonzero(sizes[part] == 1)
    k, m = assembly.stiffness.diagonal()[alone], assembly.mass.diagonal()[alone]
    rigid = (k <= RIGID * m) & (m > 0)
    return {int(part[i]): int(r) for i, r in zip(alone, rigid, strict=True)}


def _rigid_modes(assembly: Assembly, members: Integers) -> int:
    """How many modes of a part are below 0.1 Hz; at most MOST_RIGID are counted.

    That is how many pivots of K - omega2 M are negative, each omega2 of a mode below counting as often as it occurs
    (Sylvester's law of inertia). Scaled, so that displacements and rotations are eliminated alike.
    """
    shifted = sparse.csc_array(
        assembly.stiffness[members][:, members] - RIGID * assembly.mass[members][:, members], dtype=np.float64
    )
    diagonal = np.abs(shifted.diagonal())
    root = sparse.diags_array(1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0)))
    scaled = sparse.csc_array(root @ shifted @ root)
    try:
        factors = symmetric_factors(scaled)
    except RuntimeError:  # exactly singular: a direction with neither mass nor stiffness
        return MOST_RIGID
    return min(int(np.sum(factors.U.diagonal() < 0)), MOST_RIGID)
