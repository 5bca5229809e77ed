"""From a structure file and a pose to the machine's modes: assemble, check, solve."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse
from scipy.linalg import eigh_tridiagonal
from scipy.sparse.csgraph import connected_components

from feedsim.foundation import units
from feedsim.foundation.errors import Finding, InputError
from feedsim.scenario.structure import FiniteElements, GeometryStructure, Structure
from feedsim.structure.assembly import (
    DEGREES,
    MAX_SHOWN_LABELS,
    SAME_POSITION,
    Assembly,
    Floats,
    Integers,
    count_text,
    shorten_labels,
    translating_mass,
)
from feedsim.structure.eigenpairs import symmetric_factors
from feedsim.structure.geometry.assemble import assemble as assemble_geometry
from feedsim.structure.matrices.build import import_model
from feedsim.structure.solve import Solution, solve

if TYPE_CHECKING:
    from numpy.typing import NDArray


# --- Whether the mass is positive and the stiffness not negative, as far as that shows without factorising them -------
# Necessary conditions with the degrees of freedom that break them: diagonal entries, then each pair's 2 by 2 minor,
# then
# the lowest eigenvalue that a few Lanczos steps find of the matrix scaled to a diagonal of ones. A negative Ritz
# value
# proves a negative direction, and its vector says where; none found is no proof, for the solver's inertia count is
# that.


# Of the scaled matrix, whose diagonal is 1. Assembly and text of 13 digits leave 1e-12.
NEGATIVE_TOLERANCE = 1e-9
# Round-off of a minor: |a_ij| may exceed sqrt(a_ii a_jj) by this share where two degrees of freedom move as one.
MINOR_ROUNDING = 1e-9
LANCZOS_STEPS = 60


def mass_faults(assembly: Assembly) -> tuple[list[str], list[Finding]]:
    """Faults and warnings of the mass matrix. Degrees of freedom without mass are fine where stiffness holds them."""
    faults = _indefinite(assembly, assembly.mass, "mass")
    if faults:
        return faults, []
    massless = np.flatnonzero(assembly.mass.diagonal() == 0)
    if not len(massless):
        return [], []
    if len(massless) == len(assembly.labels):
        return ["the mass matrix is zero"], []
    loose = _find_unheld_freedoms(assembly.stiffness, massless)
    if loose is not None:
        return [
            f"{shorten_labels(assembly.labels, massless[loose])}: no mass, and no stiffness against moving on "
            f"their own; give "
            "them a mass, hold them, or leave them out"
        ], []
    return [], [
        Finding(
            "freedom-massless",
            "doubt",
            f"{count_text(len(massless), 'degree of freedom follows', 'degrees of freedom follow')} statically, "
            f"without mass: "
            f"{shorten_labels(assembly.labels, massless)}",
        )
    ]


def stiffness_faults(assembly: Assembly) -> tuple[list[str], list[Finding]]:
    """Faults and warnings of the stiffness matrix."""
    return _indefinite(assembly, assembly.stiffness, "stiffness"), []


def _indefinite(assembly: Assembly, matrix: sparse.csc_array, what: str) -> list[str]:
    diagonal = matrix.diagonal()
    negative = np.flatnonzero(diagonal < 0)
    if len(negative):
        worst = negative[np.argsort(diagonal[negative])]
        return [
            f"{count_text(len(worst), 'degree of freedom has', 'degrees of freedom have')} negative {what} on the "
            f"diagonal, down to {diagonal[worst[0]]:.6g} at {shorten_labels(assembly.labels, worst)}"
        ]
    pair = _worst_pair(matrix, diagonal)
    if pair is not None:
        i, j = pair
        return [
            f"the {what} matrix is not positive semidefinite: {assembly.labels[i]} and {assembly.labels[j]} are "
            f"coupled by {matrix[i, j]:.6g}, more than the root of their diagonal entries {diagonal[i]:.6g} and "
            f"{diagonal[j]:.6g} multiplied"
        ]
    value, vector = _lowest_ritz_pair(matrix, diagonal)
    if value < -NEGATIVE_TOLERANCE:
        most = np.argsort(-np.abs(vector))
        most = most[np.abs(vector[most]) > 0.3 * np.abs(vector[most[0]])]
        return [
            f"the {what} matrix is not positive semidefinite: a motion mainly of "
            f"{shorten_labels(assembly.labels, most)} has "
            f"negative {what} ({value:.3g} of that of its degrees of freedom alone)"
        ]
    return []


def _worst_pair(matrix: sparse.csc_array, diagonal: Floats) -> tuple[int, int] | None:
    """The pair that breaks |a_ij| <= sqrt(a_ii a_jj) most; None where none does."""
    entries = matrix.tocoo()
    off = entries.row < entries.col
    rows, columns, values = entries.row[off], entries.col[off], np.abs(entries.data[off])
    root = np.sqrt(diagonal)
    limit = root[rows] * root[columns]
    broken = np.flatnonzero((values > limit * (1 + MINOR_ROUNDING)) & (values > 0))
    if not len(broken):
        return None
    with np.errstate(divide="ignore"):
        worst = broken[np.argmax(values[broken] / limit[broken])]
    return int(rows[worst]), int(columns[worst])


def _lowest_ritz_pair(matrix: sparse.csc_array, diagonal: Floats) -> tuple[float, Floats]:
    """Lowest Ritz value of D^-1/2 A D^-1/2 after some Lanczos steps with full reorthogonalisation, and its vector (N,)
    in the coordinates of A; 0 where the diagonal is 0."""
    positive = diagonal > 0
    root = np.zeros_like(diagonal)
    root[positive] = 1 / np.sqrt(diagonal[positive])
    steps = min(LANCZOS_STEPS, int(positive.sum()))
    if steps == 0:
        return 0.0, np.zeros_like(diagonal)
    start = np.random.default_rng(1).standard_normal(len(diagonal)) * positive
    basis = np.zeros((steps, len(diagonal)))
    basis[0] = start / np.linalg.norm(start)
    alpha, beta = np.zeros(steps), np.zeros(steps)
    done = steps
    for k in range(steps):
        following = root * (matrix @ (root * basis[k]))
        alpha[k] = following @ basis[k]
        for _ in range(2):  # twice is enough
            following -= basis[: k + 1].T @ (basis[: k + 1] @ following)
        beta[k] = np.linalg.norm(following)
        if beta[k] < 1e-12 or k + 1 == steps:
            done = k + 1
            break
        basis[k + 1] = following / beta[k]
    values, vectors = eigh_tridiagonal(alpha[:done], beta[: done - 1], select="i", select_range=(0, 0))
    return float(values[0]), root * (basis[:done].T @ vectors[:, 0])


def _find_unheld_freedoms(stiffness: sparse.csc_array, massless: NDArray[np.int64]) -> NDArray[np.int64] | None:
    """Positions within `massless` that no stiffness holds (their own block of K is singular); None where all are held.

    The factorisation is of that block alone, which falls into small parts: rotations of single nodes, say.
    """
    block = stiffness[massless][:, massless].tocsc()
    diagonal = block.diagonal()
    if np.any(diagonal <= 0):
        return np.flatnonzero(diagonal <= 0)
    root = sparse.diags_array(1 / np.sqrt(diagonal))
    scaled = (root @ block @ root).tocsc()
    try:
        factors = symmetric_factors(scaled)
    except RuntimeError:  # exactly singular
        shifted = scaled + 1e-12 * sparse.eye_array(len(massless))
        factors = symmetric_factors(shifted.tocsc())
    pivots = factors.U.diagonal()
    if np.min(np.abs(pivots)) > 1e-10:
        return None
    # Inverse iteration: what moves against least stiffness.
    vector = np.random.default_rng(1).standard_normal(len(massless))
    for _ in range(3):
        vector = factors.solve(vector)
        vector /= np.linalg.norm(vector)
    moving = np.abs(vector)
    return np.flatnonzero(moving > 0.1 * moving.max())


# --- Checks of a finite-element model before it is solved: whether it can be a machine, each fault with its own message
# Cheap beside solving: products with the sparse matrices, no dense matrix, and factorisations of small parts only.
# What
# only the solution can show stays with it: how many rigid modes there are, and negative stiffness too small to show
# here.


# Round-off of an element's assembly is 1e-12 of an entry's scale and less; a matrix that is wrong is off by more.
ASYMMETRY = 1e-9
# Round-off makes rigid modes of large stiff models mHz; a machine's or a mount's lowest mode is above 1 Hz.
RIGID_EIGENVALUE = (2 * math.pi * 0.1) ** 2
MOST_RIGID = 7  # more than a free body has


def check(assembly: Assembly) -> list[Finding]:
    """Warnings about a model that can be solved.

    Raises:
        InputError: the model cannot be solved or cannot be a machine; lists what is wrong.
    """
    for faults in (_shapes(assembly), _finite(assembly), _symmetry(assembly)):
        _refuse(assembly, faults)  # what follows needs each of these
    faults, warnings = _report_empty_freedoms(assembly), list[Finding]()
    _refuse(assembly, faults)
    for more_faults, more_warnings in (mass_faults(assembly), stiffness_faults(assembly), _ports(assembly)):
        faults += more_faults
        warnings += more_warnings
    if not faults:
        more_faults, more_warnings = _part_faults(assembly)
        faults += more_faults
        warnings += more_warnings
    _refuse(assembly, faults)
    return warnings + unit_warnings(assembly)


def _refuse(assembly: Assembly, faults: Iterable[str]) -> None:
    problems = [f"{assembly.name}: {fault}" for fault in faults]
    if problems:
        raise InputError.of(f"{assembly.name}: not a usable model", problems)


def _shapes(assembly: Assembly) -> list[str]:
    size = len(assembly.labels)
    if size == 0:
        return ["there is no degree of freedom in it"]
    faults = [
        f"the {what} matrix is {matrix.shape[0]} by {matrix.shape[1]}; {size} degrees of freedom need {size} by {size}"
        for what, matrix in (("mass", assembly.mass), ("stiffness", assembly.stiffness))
        if matrix.shape != (size, size)
    ]
    return faults + [
        f"port {port}: a vector of shape {vector.shape}; {size} degrees of freedom need {size} coefficients"
        for port, vector in assembly.ports.items()
        if vector.shape != (size,)
    ]


def _finite(assembly: Assembly) -> list[str]:
    faults = []
    for what, matrix in (("mass", assembly.mass), ("stiffness", assembly.stiffness)):
        bad = np.flatnonzero(~np.isfinite(matrix.data))
        if len(bad):
            row = int(matrix.indices[bad[0]])
            column = int(np.searchsorted(matrix.indptr, bad[0], side="right")) - 1
            faults.append(
                f"{count_text(len(bad), 'entry', 'entries')} of the {what} matrix not finite, the first "
                f"{matrix.data[bad[0]]} at ({assembly.labels[row]}, {assembly.labels[column]})"
            )
    for port, vector in assembly.ports.items():
        bad = np.flatnonzero(~np.isfinite(vector))
        if len(bad):
            faults.append(f"port {port}: the coefficient at {assembly.labels[bad[0]]} is {vector[bad[0]]}")
    return faults


def _symmetry(assembly: Assembly) -> list[str]:
    faults = []
    for what, matrix in (("mass", assembly.mass), ("stiffness", assembly.stiffness)):
        difference = (matrix - matrix.T).tocoo()
        if not difference.nnz:
            continue
        diagonal = np.sqrt(np.abs(matrix.diagonal()))
        # Where a diagonal entry is 0, any other entry in the row is wrong: the largest of the matrix is the scale then.
        scale = diagonal[difference.row] * diagonal[difference.col]
        scale = np.where(scale > 0, scale, np.max(np.abs(matrix.data)))
        far = np.abs(difference.data) / scale
        worst = int(np.argmax(far))
        if far[worst] <= ASYMMETRY:
            continue
        i, j = sorted((int(difference.row[worst]), int(difference.col[worst])))
        a, b = matrix[i, j], matrix[j, i]
        text = (
            f"the {what} matrix is not symmetric: ({assembly.labels[i]}, {assembly.labels[j]}) is {a:.9g}, "
            f"({assembly.labels[j]}, {assembly.labels[i]}) is {b:.9g}"
        )
        if _triangular(matrix):
            text += "; only one triangle is filled: a Matrix Market file then says 'symmetric' in its first line and "
            text += "holds the lower triangle"
        faults.append(text)
    return faults


def _triangular(matrix: object) -> bool:
    return bool(sparse.tril(matrix, -1).nnz == 0 or sparse.triu(matrix, 1).nnz == 0)


def _report_empty_freedoms(assembly: Assembly) -> list[str]:
    """Degrees of freedom with neither mass nor stiffness: nothing says how they move."""
    used = _columns(assembly.mass) | _columns(assembly.stiffness)
    empty = np.flatnonzero(~used)
    if not len(empty):
        return []
    return [
        f"{count_text(len(empty), 'degree of freedom has', 'degrees of freedom have')} neither mass nor stiffness: "
        f"{shorten_labels(assembly.labels, empty)}; constrain them or leave them out"
    ]


def _columns(matrix: object) -> np.ndarray:
    """(N,) which columns hold something other than zero."""
    absolute: Floats = np.asarray(abs(matrix).sum(axis=0)).ravel()  # type: ignore[arg-type]
    return absolute > 0


def _ports(assembly: Assembly) -> tuple[list[str], list[Finding]]:
    faults, warnings = [], []
    for axis in assembly.axes:
        for port in (f"n_{axis}", f"x_{axis}"):
            vector = assembly.ports.get(port)
            if vector is None:
                faults.append(f"axis {axis} has no port {port}")
            elif not np.any(vector):
                faults.append(f"port {port} excites nothing: all its coefficients are 0")
    idle = [port for port, vector in assembly.ports.items() if port.startswith("tcp_") and not np.any(vector)]
    if idle:
        ports = ", ".join(idle)
        text = f"ports {ports} excite nothing: forces there move nothing, displacements stay 0"
        warnings.append(Finding("port-idle", "doubt", text, ports))
    return faults, warnings


LEAST_MASS, MOST_MASS = 20.0, 1e6  # [kg] a test bench, a portal machine
LEAST_SIZE, MOST_SIZE = 0.05, 100.0  # [m]
LEAST_FREQUENCY, MOST_FREQUENCY = 1.0, 2000.0  # [Hz] of the lowest elastic mode
# Units of files -> in words, the likely ones first.
MASS_UNITS = {"t": "tonnes", "kg": "kilograms", "g": "grams"}
LENGTH_UNITS = {"mm": "millimetres", "m": "metres", "cm": "centimetres"}


def unit_warnings(assembly: Assembly) -> list[Finding]:
    """What looks like another unit than the one that is stated."""
    warnings = []
    masses = translating_mass(assembly)
    if np.any(masses) and not LEAST_MASS <= np.max(masses) <= MOST_MASS:
        mass = float(np.max(masses))
        text = f"the model's mass is {mass:.4g} kg; a machine has {LEAST_MASS:g} kg to {MOST_MASS:g} kg"
        stated_mass = assembly.units.mass if assembly.units else ""
        hint = _unit_hint("mass", mass, stated_mass, MASS_UNITS, LEAST_MASS, MOST_MASS)
        warnings.append(Finding("model-mass-unusual", "doubt", text + hint))
    geometry = assembly.geometry
    if geometry is not None and len(geometry.nodes) > 1:
        size = float(np.max(np.ptp(geometry.nodes, axis=0)))
        if not LEAST_SIZE <= size <= MOST_SIZE:
            text = f"the model measures {size:.4g} m; a machine measures {LEAST_SIZE:g} m to {MOST_SIZE:g} m"
            stated = assembly.units.length if assembly.units else ""
            hint = _unit_hint("length", size, stated, LENGTH_UNITS, LEAST_SIZE, MOST_SIZE)
            if not hint and LEAST_SIZE <= size * 1000 <= MOST_SIZE:
                hint = "; was it converted from millimetres twice?"
            warnings.append(Finding("model-size-unusual", "doubt", text + hint))
    return warnings


def _unit_hint(key: str, value: float, stated: str, names: Mapping[str, str], least: float, most: float) -> str:
    """What the file's own number may be, where that is usual: another unit than the stated one. value: in SI."""
    si = "kg" if key == "mass" else "m"
    own = units.convert(value, si, stated) if stated else 0.0
    fitting = [
        f"; {own:.4g} looks like {name}, units: {{{key}: {unit}}}"
        for unit, name in names.items()
        if unit != stated and least <= units.convert(own, unit, si) <= most
    ]
    return fitting[0] if fitting else ""


def frequency_warnings(omega: float) -> list[Finding]:
    """About the lowest elastic mode's angular frequency [rad/s], once it is known."""
    frequency = omega / (2 * math.pi)
    if LEAST_FREQUENCY <= frequency <= MOST_FREQUENCY:
        return []
    text = (
        f"the lowest elastic mode is at {frequency:.4g} Hz; a machine's is from {LEAST_FREQUENCY:g} Hz to "
        f"{MOST_FREQUENCY:g} Hz"
    )
    # Mass in kg beside stiffness in N/mm: too low by the root of 1000; mass in t beside N/m: too high by it.
    if frequency < LEAST_FREQUENCY:
        why = "is the stiffness in N/mm beside a mass in kg, or something held by nearly nothing?"
    else:
        why = "is the mass in tonnes beside a stiffness in N/m?"
    return [Finding("mode-frequency-unusual", "doubt", f"{text}; {why}")]


def _part_faults(assembly: Assembly) -> tuple[list[str], list[Finding]]:
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
    faults, fixed = [], []
    unknown = [p for p in range(count) if p != main and p not in free]
    for p in unknown:
        free[p] = _rigid_modes(assembly, order[starts[p] : starts[p + 1]])
    for p in range(count):
        if p == main:
            continue
        members = order[starts[p] : starts[p + 1]]
        axes = [axis for axis in assembly.axes if _drives_part(assembly, axis, members)]
        if free[p] > len(axes):
            faults.append((p, members, axes))
        elif free[p] == 0:
            fixed.append(members)
    return _report_flying_parts(assembly, faults, free, sizes, main, count), _grounded_parts(
        assembly, fixed, int(sizes[main])
    )


def _report_flying_parts(
    assembly: Assembly,
    parts: list[tuple[int, Integers, list[str]]],
    free: dict[int, int],
    sizes: Integers,
    main: int,
    count: int,
) -> list[str]:
    faults = []
    for p, members, axes in parts[:MAX_SHOWN_LABELS]:
        allowed = f" ({len(axes)} for the axes {', '.join(axes)} that act on it)" if axes else ""
        size = count_text(len(members), *DEGREES)
        faults.append(
            f"a part flies freely: {size} ({shorten_labels(assembly.labels, members)}) that nothing connects to the "
            f"{sizes[main]} of the largest part, with {_modes(free[p])}{allowed}; connect it, hold it or leave it out"
        )
    if len(parts) > MAX_SHOWN_LABELS:
        faults.append(f"{len(parts) - MAX_SHOWN_LABELS} more of the {count} parts fly freely")
    return faults


def _modes(count: int) -> str:
    return (
        f"{MOST_RIGID - 1} rigid modes or more"
        if count >= MOST_RIGID
        else count_text(count, "rigid mode", "rigid modes")
    )


def _grounded_parts(assembly: Assembly, parts: list[Integers], largest: int) -> list[Finding]:
    texts = [
        f"a part of {count_text(len(members), *DEGREES)} "
        f"({shorten_labels(assembly.labels, members)}) is connected to the ground alone, not to the {largest} of "
        f"the largest part"
        for members in parts[:MAX_SHOWN_LABELS]
    ]
    if len(parts) > MAX_SHOWN_LABELS:
        texts.append(f"{len(parts) - MAX_SHOWN_LABELS} more parts are connected to the ground alone")
    return [Finding("part-on-ground", "doubt", text) for text in texts]


def _drives_part(assembly: Assembly, axis: str, members: Integers) -> bool:
    return any(np.any(assembly.ports[f"{quantity}_{axis}"][members]) for quantity in ("n", "x"))


def _free_single(assembly: Assembly, part: Integers, sizes: Integers) -> dict[int, int]:
    """Rigid modes of the parts of one degree of freedom, all at once: there may be many."""
    alone = np.flatnonzero(sizes[part] == 1)
    k, m = assembly.stiffness.diagonal()[alone], assembly.mass.diagonal()[alone]
    rigid = (k <= RIGID_EIGENVALUE * m) & (m > 0)
    return {int(part[i]): int(r) for i, r in zip(alone, rigid, strict=True)}


def _rigid_modes(assembly: Assembly, members: Integers) -> int:
    """How many modes of a part are below 0.1 Hz; at most MOST_RIGID are counted.

    That is how many pivots of K - omega2 M are negative, each omega2 of a mode below counting as often as it occurs
    (Sylvester's law of inertia). Scaled, so that displacements and rotations are eliminated alike.
    """
    shifted = sparse.csc_array(
        assembly.stiffness[members][:, members] - RIGID_EIGENVALUE * assembly.mass[members][:, members],
        dtype=np.float64,
    )
    diagonal = np.abs(shifted.diagonal())
    root = sparse.diags_array(1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0)))
    scaled = sparse.csc_array(root @ shifted @ root)
    try:
        factors = symmetric_factors(scaled)
    except RuntimeError:  # exactly singular: a direction with neither mass nor stiffness
        return MOST_RIGID
    return min(int(np.sum(factors.U.diagonal() < 0)), MOST_RIGID)


@dataclass(frozen=True, eq=False)
class Built:
    """A machine's finite-element model at a pose, its modes, and what a person should know of both."""

    assembly: Assembly
    solution: Solution
    warnings: tuple[Finding, ...]


def assemble(structure: Structure, pose: Mapping[str, float]) -> tuple[Assembly, tuple[Finding, ...]]:
    """The finite-element model at a pose (axis -> position [m]), and notes on the import.

    Matrices were made at one pose: theirs, if they name it, counts for axes that `pose` leaves out.

    Raises:
        InputError: the structure is faulty, the pose is incomplete or out of travel, or not that of the matrices.
    """
    if isinstance(structure, GeometryStructure):
        return assemble_geometry(structure, pose), ()
    if not isinstance(structure, FiniteElements):
        raise TypeError(f"no kind of structure: {type(structure).__name__}")
    model = import_model(structure)
    own = model.assembly.pose
    for axis, position in pose.items():
        if axis not in structure.axes:
            known = ", ".join(structure.axes) or "none"
            raise InputError(f"{model.assembly.name}: the pose names {axis!r}, which is no axis; axes: {known}")
        if axis in own and abs(own[axis] - position) > SAME_POSITION:
            raise InputError(
                f"{model.assembly.name}: the matrices were made with {axis} at {units.show(own[axis], 'm')}; modes at "
                f"{units.show(position, 'm')} need matrices of that pose, or a structure of kind geometry"
            )
    return model.assembly, model.notes


def build(
    structure: Structure,
    pose: Mapping[str, float],
    *,
    cutoff: float | None = None,
    static_correction: bool = False,
    progress: Callable[[str], None] | None = None,
) -> Built:
    """Assemble a structure at a pose (axis -> position [m]), check it, and compute its modes.

    cutoff: [rad/s], in place of the structure's own. static_correction: see :func:`feedsim.structure.solve.solve`.

    Raises:
        InputError: from any of the three, each fault with its own message.
    """
    say = progress or (lambda _: None)
    say("assembling")
    assembly, notes = assemble(structure, pose)
    say(f"checking {assembly.mass.shape[0]} degrees of freedom")
    warnings = check(assembly)
    solution = solve(
        assembly,
        cutoff=structure.cutoff if cutoff is None else cutoff,
        damping=structure.damping,
        static_correction=static_correction,
        progress=progress,
    )
    elastic = solution.modes.frequency[solution.modes.frequency > 0]
    if len(elastic):
        warnings += frequency_warnings(2 * math.pi * float(elastic.min()))
    return Built(assembly, solution, (*notes, *warnings))
