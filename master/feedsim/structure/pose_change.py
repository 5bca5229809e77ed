"""How far a motion leaves the pose at which the plant was linearised, and how much the modes change over it.

Modes of two poses of a machine of kind geometry are shapes of the same coordinates with the same mass matrix M, so that
they can be compared: with mass-normalised shapes MAC_ij = (phi_i^T M phi_j)^2 is 1 for the same shape and 0 for
orthogonal ones (R. J. Allemang, The modal assurance criterion, Sound and Vibration 37 (8), 2003, here weighted with M).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from feedsim.foundation import units
from feedsim.foundation.errors import FeedsimError, Finding, shorten_list
from feedsim.foundation.outputs import cache_answer
from feedsim.scenario import Machine
from feedsim.structure.assembly import CODE, MAX_SHOWN_LABELS, State, digest_of, state_of
from feedsim.structure.modes import TOOL_PORTS, Modes, parse_modes
from feedsim.structure.mounts import MountTable, read_mounts, table_of

if TYPE_CHECKING:
    from feedsim.structure.assembly import Assembly, Floats
    from feedsim.structure.geometry.assemble import Assembler
    from feedsim.structure.solve import Solution


# Closer to the pose nothing is calculated [m]: modes change by 0.1 % and less per millimetre.
MIN_POSE_DISTANCE = 1e-3
# Ends are calculated at positions rounded to so many decimals of a metre: the same in all runs whose motions differ by
# nanometres, as those of a study do. Up to 0.05 mm, modes change by 0.005 % and less.
DECIMALS = 4
# Modes up to here are looked at [Hz]; drives have their control loops below. At other poses up to twice that.
MAX_MODE_FREQUENCY = 200.0
# A mode is of interest where it holds this share of the static compliance of any port: who does not excite or see it
# need not know that it moves.
COMPLIANCE_SHARE = 0.01
# A shift beyond which the machine is another one. The resonance curve of a mode is 2 zeta wide at half its power, 4 to
# 6 % with the usual 2 to 3 %: one that has moved by as much answers where it did not before, and filters miss it.
LARGE_SHIFT = 0.05
# The static displacement is found step by step, the error shrinking by shift/(omega^2 + shift) each time; of a mode at
# 5 Hz to a seventh.
EIGENVALUE_SHIFT, SHIFT_STEPS = (2 * math.pi * 2.0) ** 2, 12


@dataclass(frozen=True)
class ModeChange:
    """A mode at the pose and at both ends of the positions reached.

    Attributes:
        frequency: at the pose [Hz].
        ends: at the lowest and the highest position [Hz].
        change: that of the two which is larger, relative [1].
        mac: the lower of the two [1]. Of modes close to one another it falls early: they mix.
        moving: what moves in it, at the pose.
    """

    frequency: float
    ends: tuple[float, float]
    change: float
    mac: float
    moving: str


@dataclass(frozen=True)
class Compliance:
    """A static compliance [m/(N.m)] or [m/N] at the lowest position, the pose and the highest position."""

    name: str
    unit: str
    values: tuple[float, float, float]


@dataclass(frozen=True)
class AxisChange:
    """An axis in a motion, and the modes over the positions it reaches, all other axes at the pose.

    Attributes:
        pose, low, high: position of the pose, lowest and highest one reached [m].
        modes: none where the axis stays near the pose, or where other poses are not known.
    """

    axis: str
    pose: float
    low: float
    high: float
    modes: tuple[ModeChange, ...] = ()
    compliances: tuple[Compliance, ...] = ()

    @property
    def distance(self) -> float:
        """Largest distance from the pose [m]."""
        return max(self.pose - self.low, self.high - self.pose)

    @property
    def largest(self) -> ModeChange | None:
        """The mode whose frequency changes most."""
        return max(self.modes, key=lambda mode: abs(mode.change), default=None)


@dataclass(frozen=True)
class PoseChange:
    """All axes in a motion. `unknown` says why nothing is known of other poses; empty where it is."""

    axes: tuple[AxisChange, ...]
    unknown: str

    @property
    def distance(self) -> float:
        """Largest distance of any axis from its pose [m]."""
        return max((axis.distance for axis in self.axes), default=0.0)

    @property
    def large(self) -> tuple[AxisChange, ...]:
        """The axes over whose positions a mode changes by more than LARGE_SHIFT."""
        return tuple(axis for axis in self.axes if axis.largest is not None and abs(axis.largest.change) > LARGE_SHIFT)


def pose_change(machine: Machine, ranges: Mapping[str, tuple[float, float]]) -> PoseChange:
    """What the plant of one pose leaves out when axes move over `ranges`, axis -> (lowest, highest position) [m].

    The ends of what is returned are exact; their modes and compliances belong to positions rounded to 0.1 mm, always,
    so that a run says the same alone and in a study, where solutions are kept for further runs. Modes change by 0.1 %
    and less per millimetre, hence by 0.005 % and less over the rounding: a thousandth of what is LARGE_SHIFT.
    """
    axes = tuple(
        AxisChange(axis, machine.pose[axis], min(low, machine.pose[axis]), max(high, machine.pose[axis]))
        for axis, (low, high) in ranges.items()
    )
    if all(axis.distance <= MIN_POSE_DISTANCE for axis in axes):
        return PoseChange(axes, "")
    if machine.structure is None:
        return PoseChange(axes, "the machine file names no structure file to compute the modes of other poses from")
    try:
        pose = _Pose(machine.structure, state_of(machine.structure), tuple(machine.pose.items()))
        return PoseChange(tuple(_with_modes(pose, axis) for axis in axes), "")
    except OSError as error:
        return PoseChange(axes, f"{error.filename or machine.structure}: cannot be read: {error.strerror}")
    except FeedsimError as error:  # the run itself needs no structure: it goes on without
        return PoseChange(axes, str(error).partition("\n")[0])


@dataclass(frozen=True, eq=False)
class ModesOverAxis:
    """Modes of interest (M,) while one axis moves and all others stay at the pose.

    Attributes:
        frequency: at the pose (M,) [Hz]. moving: what moves in each, at the pose.
        position: of the axis (P,) [m], rising. there: what each mode has become (P, M) [Hz].
    """

    frequency: Floats
    moving: tuple[str, ...]
    position: tuple[float, ...]
    there: Floats

    @property
    def largest(self) -> float:
        """The largest relative change [1]."""
        return float(np.abs(self.there / self.frequency - 1).max(initial=0.0))


def over_axis(machine: Machine, axis: str, positions: Sequence[float]) -> ModesOverAxis | None:
    """What :func:`pose_change` would find at ends of a motion (P,) [m]; None where no structure file describes them."""
    if machine.structure is None:
        return None
    try:
        pose = _Pose(machine.structure, state_of(machine.structure), tuple(machine.pose.items()))
        if axis not in _assembler(pose).structure.axes:
            return None
        solution, frequency = _solve_pose(pose)[1], _solve_pose(pose)[1].modes.frequency
        own = np.flatnonzero(_find_visible_modes(solution) & (frequency > 0) & (frequency <= MAX_MODE_FREQUENCY))
        there = [
            _end(pose, axis, None if abs(x - machine.pose[axis]) <= MIN_POSE_DISTANCE else round(x, DECIMALS))
            for x in positions
        ]
    except (OSError, FeedsimError):
        return None
    moving = tuple(str(solution.moving[mode]) for mode in own.tolist())
    return ModesOverAxis(frequency[own], moving, tuple(positions), np.array([end.frequency[own] for end in there]))


def warnings(change: PoseChange) -> tuple[Finding, ...]:
    """A finding for each axis that moves far enough for the modes to be others."""
    result = []
    for axis in change.large:
        mode = axis.largest
        assert mode is not None
        moving = mode.moving.partition(",")[0]
        follow = f"feedsim export --plant ... --poses {axis.axis}=20mm"
        result.append(Finding(
            "pose-left", "doubt",
            f"axis {axis.axis} moves {axis.distance * 1e3:.4g} mm away from the pose that the modes belong to; there "
            f"the mode at {mode.frequency:.4g} Hz ({moving}) has changed its frequency by {100 * mode.change:+.2g} %; "
            f"for a plant that follows: {follow}",
            axis.axis, follow,
        ))  # fmt: skip
    return tuple(result)


@dataclass(frozen=True)
class _Pose:
    """A structure file in the state that it has, at a pose (axis, position [m]): what all solutions depend on."""

    structure: Path
    state: State
    axes: tuple[tuple[str, float], ...]


@dataclass(frozen=True, eq=False)
class _End:
    """The modes of the pose where one axis has gone elsewhere.

    Attributes:
        frequency, mac: (n,) of what each mode of the pose has become there [Hz, 1].
        compliances: as _static has them.
    """

    frequency: Floats
    mac: Floats
    compliances: tuple[float, ...]


# Most of the time of a short run: the answer of an earlier process counts, for the same file, code and ends.
def _load_or_solve_changes(
    pose: _Pose, axis: str, low: float | None, high: float | None
) -> tuple[tuple[ModeChange, ...], tuple[Compliance, ...]]:
    """As _between; nothing of an axis that the structure does not know."""

    def find() -> Any:
        if axis not in _assembler(pose).structure.axes:
            return [[], []]
        modes, compliances = _changes_between(pose, axis, low, high)
        return [[astuple(mode) for mode in modes], [astuple(compliance) for compliance in compliances]]

    follows_from = [digest_of(pose.structure, pose.state), pose.axes, axis, low, high]
    modes, compliances = cache_answer("modes-over-pose", follows_from, CODE, find)
    return (
        tuple(ModeChange(f, (ends[0], ends[1]), change, mac, moving) for f, ends, change, mac, moving in modes),
        tuple(Compliance(name, unit, (at[0], at[1], at[2])) for name, unit, at in compliances),
    )


def _with_modes(pose: _Pose, axis: AxisChange) -> AxisChange:
    """The axis with its modes, where it goes far enough and the structure knows it."""
    if axis.distance <= MIN_POSE_DISTANCE:
        return axis
    low, high = (
        None if abs(position - axis.pose) <= MIN_POSE_DISTANCE else round(position, DECIMALS)
        for position in (axis.low, axis.high)
    )
    modes, compliances = _load_or_solve_changes(pose, axis.axis, low, high)
    return replace(axis, modes=modes, compliances=compliances)


# A few numbers per mode each: a study's runs, whose ends are the same to the rounding, find theirs here.
@lru_cache(maxsize=256)
def _changes_between(
    pose: _Pose, axis: str, low: float | None, high: float | None
) -> tuple[tuple[ModeChange, ...], tuple[Compliance, ...]]:
    """Of an axis that reaches from `low` to `high`, to be rounded by the caller; None stands for the pose itself."""
    ends, here = (_end(pose, axis, low), _end(pose, axis, high)), _end(pose, axis, None)
    return _modes(pose, ends), _compliances(axis, (ends[0], here, ends[1]))


@lru_cache(maxsize=256)
def _end(pose: _Pose, axis: str, position: float | None) -> _End:
    middle = _solve_pose(pose)
    model = middle
    if position is not None:
        # Beyond the structure's travel (a following error, a recording) its end counts.
        low, high = _assembler(pose).structure.axes[axis].travel
        model = _model(pose, {axis: min(max(position, low), high)}, described=False)
    return _End(*_match_modes(*middle, model[1]), tuple(_static(axis, *model)))


def _assembler(pose: _Pose) -> Assembler:
    from feedsim.structure.geometry.assemble import assembler_of  # loaded where there is something to solve

    return assembler_of(pose.structure, pose.state)


@lru_cache(maxsize=4)  # matrices: large ones of large structures
def _solve_pose(pose: _Pose) -> tuple[Assembly, Solution]:
    return _model(pose, {}, described=True)


def _model(pose: _Pose, moved: Mapping[str, float], described: bool) -> tuple[Assembly, Solution]:
    from feedsim.structure.solve import solve  # loaded where there is something to solve

    assembler = _assembler(pose)
    here = {axis: position for axis, position in pose.axes if axis in assembler.structure.axes}
    assembly = assembler.at({**here, **moved})
    damping = assembler.structure.damping
    # The sparse way: a few modes of many.
    cutoff = 2 * math.pi * 2 * MAX_MODE_FREQUENCY
    return assembly, solve(assembly, cutoff=cutoff, damping=damping, dense_limit=0, described=described)


def _modes(pose: _Pose, ends: Sequence[_End]) -> tuple[ModeChange, ...]:
    solution = _solve_pose(pose)[1]
    frequency = solution.modes.frequency
    changes = []
    for mode in np.flatnonzero(
        _find_visible_modes(solution) & (frequency > 0) & (frequency <= MAX_MODE_FREQUENCY)
    ).tolist():
        at_ends = [float(end.frequency[mode]) for end in ends]
        shifts = [f / float(frequency[mode]) - 1 for f in at_ends]
        changes.append(
            ModeChange(
                frequency=float(frequency[mode]),
                ends=(at_ends[0], at_ends[1]),
                change=max(shifts, key=abs),
                mac=min(float(end.mac[mode]) for end in ends),
                moving=str(solution.moving[mode]),
            )
        )
    return tuple(changes)


def _match_modes(assembly: Assembly, one: Solution, other: Solution) -> tuple[Floats, Floats]:
    """Per mode of `one`, frequency [Hz] and MAC of the mode of `other` that it becomes; each is taken once."""
    # scipy.optimize does the same for full matrices, but takes a tenth of a second to load.
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import min_weight_full_bipartite_matching

    if other is one:
        return one.modes.frequency, np.ones_like(one.modes.frequency)
    mac = (one.shapes.T @ (assembly.mass @ other.shapes)) ** 2
    rows, columns = min_weight_full_bipartite_matching(csr_array(2.0 - mac))  # an entry of 0 would be none
    frequency, best = np.full(len(mac), np.nan), np.zeros(len(mac))
    frequency[rows], best[rows] = other.modes.frequency[columns], mac[rows, columns]
    return frequency, best


def _find_visible_modes(solution: Solution) -> NDArray[np.bool_]:
    """(n,) modes that hold a share of the static compliance of a port."""
    modes = solution.modes
    stiffness = np.where(modes.rigid, np.inf, (2 * math.pi * modes.frequency) ** 2)
    shares = np.array([port**2 / stiffness for port in modes.ports.values()])
    total = shares.sum(axis=1, keepdims=True)
    return np.asarray(np.any(shares > COMPLIANCE_SHARE * total, axis=0))


def _compliances(axis: str, ends: tuple[_End, _End, _End]) -> tuple[Compliance, ...]:
    """Wind-up of the axis's drive per torque, and what the tool yields per force, of all modes of the model."""
    low, here, high = (end.compliances for end in ends)
    names = [
        (f"wind-up of drive {axis} (x_a less lead times motor angle) per torque", "m/(N.m)"),
        *((f"tool against workpiece in {port[-1]} per force", "m/N") for port in TOOL_PORTS),
    ]
    return tuple(Compliance(name, unit, (low[i], here[i], high[i])) for i, (name, unit) in enumerate(names))


def _static(axis: str, assembly: Assembly, solution: Solution) -> list[float]:
    """Displacements under unit loads, less the rigid motion that they accelerate."""
    from feedsim.structure.eigenpairs import SparseFactor

    rigid = solution.shapes[:, solution.modes.rigid]
    moved = assembly.mass @ rigid
    n, x = assembly.ports[f"n_{axis}"], assembly.ports[f"x_{axis}"]
    lead = (x @ rigid) @ (n @ rigid) / ((n @ rigid) @ (n @ rigid))
    loads = np.column_stack([n, *(assembly.ports[port] for port in TOOL_PORTS)])
    seen = np.column_stack([x - lead * n, *(assembly.ports[port] for port in TOOL_PORTS)])
    target = loads - moved @ (rigid.T @ loads)
    factor = SparseFactor(assembly, -EIGENVALUE_SHIFT)
    u = np.zeros_like(loads)
    for _ in range(SHIFT_STEPS):
        u = u + factor.solve(target - assembly.stiffness @ u)
        u -= rigid @ (moved.T @ u)
    return [float(a @ b) for a, b in zip(seen.T, u.T, strict=True)]


# --- Does a machine's table of modes belong to its structure, at its pose? Asked before the table is trusted ----------


# A table and a structure that belong together agree to the eigensolver's error (1e-8); a changed structure is far off.
EIGENVALUE_TOLERANCE = 1e-5
# A mode table belongs to a structure where its frequencies are the structure's, to the digits that tables are given in.
SAME_FREQUENCY = 1e-3
# Mode shapes at mounts, of the largest: the digits of tables, where modes lie near one another.
SAME_SHAPE = 1e-2


def table_mismatch(machine: Machine) -> Finding | None:
    """A finding where the table of modes is not that of the machine's pose by its structure; None where it is.

    None as well where it cannot be shown: no structure, matrices (of one pose, and costly to solve), or a structure
    that is faulty, which who needs it will say.
    """
    if machine.structure is None:
        return None
    structure = machine.structure

    def find() -> str:
        built = _modes_of_table(structure, state_of(structure), tuple(machine.pose.items()))
        if built is None:
            return ""
        table = parse_modes(machine.modes, tuple(machine.axes))
        return describe_stale_table(table, built[0], SAME_FREQUENCY) or _other_mounts(machine, table, built[1])

    try:
        paths = (structure, *([machine.mounts.table] if machine.mounts is not None else []))
        files = [*(digest_of(path, state_of(path)) for path in paths), machine.modes.digest]
        how = cache_answer("table-of-modes", [files, [*machine.pose.items()], [*machine.axes]], CODE, find)
    except (OSError, FeedsimError):
        return None
    if not how:
        return None
    build = f"feedsim machine build {machine.structure} --at {_pose_text(machine.pose, '=')} --out DIR"
    return Finding(
        "modes-stale", "doubt",
        f"the table of modes {machine.modes} is not that of the pose {_pose_text(machine.pose, ' ')}: {how}; build it "
        f"anew: {build}",
        str(machine.modes), build,
    )  # fmt: skip


def _pose_text(pose: Mapping[str, float], between: str) -> str:
    if between == "=":
        return " ".join(f"{axis}={1e3 * position:.9g}mm" for axis, position in pose.items())
    return ", ".join(f"{axis}{between}{units.show(position, 'm')}" for axis, position in pose.items())


@lru_cache(maxsize=32)
def _modes_of_table(
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
        own, others = (shorten_list(names, MAX_SHOWN_LABELS) for names in (table.names, built.names))
        return f"{machine.mounts.table} has the mounts {own}; the structure has {others}"
    if table.shapes.shape != built.shapes.shape:
        return ""  # cut off elsewhere, or with pseudo-modes
    off = np.abs(table.element - built.element) > SAME_FREQUENCY * np.abs(built.element)
    moved = np.abs(table.shapes - built.shapes).max(axis=1) > SAME_SHAPE * np.abs(built.shapes).max(axis=1)
    if not (off.any() or moved.any()):
        return ""
    name = table.names[int(np.flatnonzero(off.any(axis=1) | moved)[0])]
    return f"mount {name} of {machine.mounts.table} is another one than the structure's"


def describe_stale_table(table: Modes, built: Modes, tolerance: float = EIGENVALUE_TOLERANCE) -> str:
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
