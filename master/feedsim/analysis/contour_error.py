"""Distance of the axes and of the tool from the path of an NC program, block by block, and what makes it.

The foot of a position is the nearest point of the programmed path within a window about where its setpoint was. With n
the unit vector from the foot p to the position x, the distance is n.(x - p), a sum of shares: plan n.(x_ref - p), with
the setpoint x_ref delayed as the drives are, at most the distance of x_ref from the path; friction, what the same
setpoints nearly without it leave less; structure n.(x_tool - x); servo is the rest. Definitions: docs/programs.md.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from feedsim.analysis.figures import Array, Figure
from feedsim.files.fields import Quantity
from feedsim.files.trace import Trace
from feedsim.files.trace.trace import require_column
from feedsim.motions.part_program.words import Motion
from feedsim.motions.planner.nearest import Feet
from feedsim.motions.program import ProgrammedGeometry
from feedsim.scenario import Drive, ForeignUnit, Machine
from feedsim.scenario.axis_units import ParameterGroup
from feedsim.simulation.nc import Program, Segment

if TYPE_CHECKING:
    from feedsim.simulation.cosim import Run
    from feedsim.simulation.cosim.schedule import Progress

Integers = NDArray[np.int64]

# Friction of the second run, as a share of the machine's.
NEARLY_NONE = 1e-6
# The delay of the drives: steps of Gauss and Newton, each of which squares the error, and the longest one [s].
DELAY_STEPS, LONGEST_DELAY = 5, 0.2
ROWS_AT_ONCE = 1 << 14
ROWS_OF_DELAY = 50_000  # that it is fitted to, spread over the program
# A position this near to the path [m] has no direction to it.
ON_THE_PATH = 1e-14
# Normal of the plane of two geometry axes (ISO 841): X to Y, Z to X, Y to Z turn counterclockwise about it.
SPACE = "XYZ"
PLANES = {frozenset("XY"): "Z", frozenset("XZ"): "Y", frozenset("YZ"): "X"}
# Shares, in the order in which they stand in tables, and what each is.
SHARE_WORDS = {
    "plan": "the planned path: rounded corners, compressor",
    "servo": "the drives, which do not follow alike",
    "friction": "friction, which the drives do not take up",
    "structure": "the structure between scales and tool",
}


@dataclass(frozen=True, eq=False)
class Deviations:
    """Distances of N positions from the programmed path, recorded at even intervals.

    Attributes:
        row (N,): of the moves, the block of the foot. s (N,): length of the path there [m].
        distance (N,): [m]. shares: name -> (N,) [m], which add up to the distance.
    """

    row: Integers
    s: Array
    distance: Array
    shares: Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class Vectors:
    """Of M positions what a distance is made of, axis by axis.

    Attributes:
        normal (M, A): unit vector from the foot to the position, 0 on the path. direction (M, A): unit vector of the
        programmed motion at the foot. shares: name -> (M, A) [m]; their sum over names and axes is the distance.
    """

    normal: Array
    direction: Array
    shares: Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class PerBlock:
    """Distances of each of M blocks [m], NaN where no position was recorded in it.

    Attributes:
        largest, rms, p95 (M,): [m]; p95: what 95 % of the positions do not exceed.
        at (M,): which of the positions is the furthest, -1 where there is none.
    """

    largest: Array
    rms: Array
    p95: Array
    at: Integers


@dataclass(frozen=True, eq=False)
class ContourError:
    """What came of an NC program.

    Attributes:
        segment: of the program. programmed: its path. delay: of the drives [s]. time (N,): of the positions [s].
        positions: setpoints and recorded positions. by: "scale" and, where it is recorded, "tool" -> deviations.
        torque: axis -> largest and rms torque of the motor [N.m], and its work [J]; of those that are recorded.
    """

    segment: Segment
    programmed: ProgrammedGeometry
    delay: float
    time: Array
    positions: Positions
    by: Mapping[str, Deviations]
    torque: Mapping[str, tuple[float, float, float]]

    @property
    def axes(self) -> tuple[str, ...]:
        return self.programmed.moves.axes

    @cached_property
    def cutting(self) -> NDArray[np.bool_]:
        """Which blocks count (M,): those at a feed; all, where there are none."""
        motion = self.programmed.moves.motion
        fed = (motion == Motion.LINE) | (motion == Motion.ARC)
        return np.asarray(fed if fed[self.by["scale"].row].any() else np.ones_like(fed))

    @cached_property
    def blocks(self) -> Mapping[str, PerBlock]:
        """By scale and tool: figures of each block."""
        count = len(self.programmed.moves)
        return {name: per_block(deviations.row, deviations.distance, count) for name, deviations in self.by.items()}

    def vectors(self, by: str, at: Integers) -> Vectors:
        """What the distances of the positions ``at`` (M,) are made of."""
        return self.positions.at(self.time[at], self.positions.first + at, self.programmed)[1][by]

    def sides(self, by: str, at: Integers) -> tuple[Array, Array]:
        """Of positions ``at`` (M,): the distance to the left of the motion in the plane, and along the plane's normal
        [m], (M,) each. The plane is that of the two axes that move, else X-Y."""
        vectors, distance = self.vectors(by, at), self.by[by].distance[at]
        own = [i for i, axis in enumerate(self.axes) if axis in SPACE]
        space = [SPACE.index(self.axes[i]) for i in own]
        moving = frozenset(axis for axis in self.programmed.axes if axis in SPACE)
        up = np.array([float(axis == PLANES.get(moving, "Z")) for axis in SPACE])
        off, direction = np.zeros((len(at), 3)), np.zeros((len(at), 3))
        off[:, space] = vectors.normal[:, own] * distance[:, None]
        direction[:, space] = vectors.direction[:, own]
        sideways = np.cross(up, direction)
        length = np.linalg.norm(sideways, axis=1)
        towards = np.divide((off * sideways).sum(axis=1), length, out=np.zeros(len(at)), where=length > 1e-9)
        return towards, off @ up

    def overall(self, by: str) -> tuple[float, float, float, int]:
        """Largest, rms and 95 % [m] over all blocks that count, and which position is the furthest."""
        deviations = self.by[by]
        counts = np.flatnonzero(self.cutting[deviations.row])
        distance = deviations.distance[counts]
        at = int(counts[distance.argmax()])
        rms = math.sqrt(float(np.mean(distance**2)))
        return float(deviations.distance[at]), rms, _percentile(np.sort(distance)), at

    def block(self, row: int) -> str:
        """A block as a sentence names it."""
        return f"{self.programmed.place(row)} ({self.programmed.moves.text(row)})"

    def main_share(self, by: str) -> tuple[str, float]:
        """The share that makes most of the largest distance, and how much of it [m]."""
        at = self.overall(by)[3]
        values = {name: float(share[at]) for name, share in self.by[by].shares.items()}
        name = max(values, key=lambda key: values[key])
        return name, values[name]

    def worst(self, count: int, by: str = "scale") -> list[int]:
        """Rows of the blocks with the largest distances, each block of the program once, the worst first."""
        largest = np.where(self.cutting, self.blocks[by].largest, np.nan)
        moves = self.programmed.moves
        seen: set[tuple[int, int]] = set()
        rows: list[int] = []
        for row in np.argsort(-np.nan_to_num(largest, nan=-1.0), kind="stable").tolist():
            key = (int(moves.file[row]), int(moves.line[row]))
            if math.isnan(largest[row]) or len(rows) == count:
                break
            if key not in seen:
                seen.add(key)
                rows.append(row)
        return rows

    def figures(self) -> dict[str, Figure]:
        """Figures of the whole program, without prefix."""
        result: dict[str, Figure] = {}
        for by, deviations in self.by.items():
            prefix, how = ("", "by the linear scales") if by == "scale" else ("tool.", "by the tool point")
            largest, rms, p95, at = self.overall(by)
            for name, value, meaning in (
                ("largest", largest, "largest distance from the programmed path"),
                ("rms", rms, "root mean square of the distance from the programmed path"),
                ("p95", p95, "distance from the programmed path that 95 % of the positions do not exceed"),
                *(
                    (name, float(share[at]), f"share of the largest distance: {SHARE_WORDS[name]}")
                    for name, share in deviations.shares.items()
                ),
            ):
                result[f"{prefix}{name}"] = Figure(value * 1e6, "um", f"{meaning}, {how}")
            line = int(self.programmed.moves.line[deviations.row[at]])
            result[f"{prefix}line"] = Figure(line, "1", f"line of the block with the largest distance, {how}")
        plan, motion = self.programmed.plan, self.programmed.moves.motion
        result["duration"] = Figure(self.segment.duration, "s", "duration of the program")
        fed = self.cutting[self.programmed.path.row]
        length = np.diff(self.programmed.path.s)[fed].sum()
        taken = float((plan.end_time - plan.start_time)[self.cutting & (motion != Motion.DWELL)].sum())
        speed = 6e4 * length / taken if taken > 0 else math.nan
        result["speed"] = Figure(speed, "mm/min", "mean speed along the programmed path, dwells and rapids left out")
        result["delay"] = Figure(self.delay * 1e3, "ms", "delay of the drives: the setpoints less this are compared")
        for axis, (largest, rms, work) in self.torque.items():
            result[f"torque_peak_{axis}"] = Figure(largest, "N.m", f"largest torque of the motor of {axis}")
            result[f"torque_rms_{axis}"] = Figure(rms, "N.m", f"root mean square of the torque of the motor of {axis}")
            result[f"work_{axis}"] = Figure(work, "W.s", f"work that the motor of {axis} does, braking taken off")
        return result


def per_block(row: Integers, distance: Array, count: int) -> PerBlock:
    """Figures of ``count`` blocks: distances (N,) and the row of each."""
    order = np.lexsort((distance, row))
    rows, first, sizes = np.unique(row[order], return_index=True, return_counts=True)
    last = first + sizes - 1
    largest, rms, p95, at = (np.full(count, np.nan) for _ in range(4))
    largest[rows], at[rows] = distance[order[last]], order[last]
    rms[rows] = np.sqrt(np.bincount(row, distance**2, count)[rows] / sizes)
    p95[rows] = distance[order[first + np.ceil(0.95 * sizes).astype(np.int64) - 1]]
    return PerBlock(largest, rms, p95, np.nan_to_num(at, nan=-1).astype(np.int64))


def _percentile(ascending: Array) -> float:
    return float(ascending[math.ceil(0.95 * len(ascending)) - 1])


def contour_error(
    trace: Trace, program: Program, segment: Segment, machine: Machine, frictionless: Trace | None = None
) -> ContourError:
    """Distances of the recorded positions from the path of a program.

    frictionless: of the same setpoints, nearly without friction. Raises InputError where positions are not recorded.
    """
    programmed = segment.geometry
    assert isinstance(programmed, ProgrammedGeometry)
    axes = programmed.moves.axes
    purpose = f"the contour error of {programmed.moves.files[0]}"
    setpoints = Setpoints(program, machine, axes)
    x = [require_column(trace, f"{axis}.x_a", purpose) for axis in axes]
    without = None if frictionless is None else [require_column(frictionless, f"{axis}.x_a", purpose) for axis in axes]
    tool = [trace[name] for axis in axes if (name := f"tcp.x_{axis}") in trace.columns]
    first, behind = np.searchsorted(trace.time, [segment.start - 1e-9, segment.end + LONGEST_DELAY])
    delay = setpoints.delay(trace.time[first:behind], [positions[first:behind] for positions in x])
    # What comes later is the standstill behind the program.
    first, behind = np.searchsorted(trace.time, [segment.start + delay - 1e-9, segment.end + delay + 1e-9])
    time = np.asarray(trace.time[first : max(behind, first + 1)])
    positions = Positions(setpoints, delay, int(first), x, without, tool if len(tool) == len(axes) else None)
    names = ["plan", "servo", *(["friction"] if without else [])]
    by = {
        name: Deviations(
            np.empty(len(time), dtype=np.int64), np.empty(len(time)), np.empty(len(time)),
            {share: np.empty(len(time)) for share in shares},
        )
        for name, shares in (("scale", names), *([("tool", [*names, "structure"])] if positions.tool else []))
    }  # fmt: skip
    for begin in range(0, len(time), ROWS_AT_ONCE):
        rows = slice(begin, min(begin + ROWS_AT_ONCE, len(time)))
        feet, vectors = positions.at(time[rows], slice(first + rows.start, first + rows.stop), programmed)
        for name, deviations in by.items():
            deviations.row[rows], deviations.s[rows] = feet[name].row, feet[name].s
            total = deviations.distance[rows]
            total[:] = 0.0
            for share, values in deviations.shares.items():
                values[rows] = vectors[name].shares[share].sum(axis=1)
                total += values[rows]
    motors = dict(_torques(trace, axes, slice(first, first + len(time))))
    return ContourError(segment, programmed, delay, time, positions, by, motors)


@dataclass(frozen=True, eq=False)
class Positions:
    """Setpoints, and recorded positions of the axes [m], nearly without friction, and of the tool, where known.

    first: row of the record at which the program begins.
    """

    setpoints: Setpoints
    delay: float
    first: int
    x: Sequence[Array]
    without: Sequence[Array] | None
    tool: Sequence[Array] | None

    def at(
        self, time: Array, rows: slice | Integers, programmed: ProgrammedGeometry
    ) -> tuple[dict[str, Feet], dict[str, Vectors]]:
        """Feet and vectors by "scale" and "tool" of the instants ``time`` [s], rows of the record."""
        at, path = time - self.delay, programmed.path
        x_ref, x = self.setpoints.at(at), _stack_columns(self.x, rows)
        s_ref = np.interp(at, programmed.time, programmed.s)
        planned = _length(x_ref - path.point(s_ref))
        reach = 2 * (_length(x - x_ref) + planned) + programmed.uneven
        own = path.nearest(x_ref, s_ref, 2 * planned + programmed.uneven).point
        most = _length(x_ref - own)
        parts = {"plan": x_ref, "servo": x}  # each the one before with one more cause
        if self.without is not None:
            parts = {"plan": x_ref, "servo": _stack_columns(self.without, rows), "friction": x}
        feet = {"scale": path.nearest(x, s_ref, reach)}
        vectors = {"scale": _vectors(feet["scale"], parts, most)}
        if self.tool is not None:
            tool = _stack_columns(self.tool, rows)
            feet["tool"] = path.nearest(tool, s_ref, reach + 2 * _length(tool - x))
            vectors["tool"] = _vectors(feet["tool"], {**parts, "structure": tool}, most)
        return feet, vectors


def _vectors(feet: Feet, parts: Mapping[str, Array], most: Array) -> Vectors:
    """Of positions by their feet; parts: name -> position (M, A), the last one what is measured.

    most (M,): distance of the plan itself from the path [m], which its share cannot exceed. Where the foot is the end
    of a line, at a stop or a reversal, the normal has a part along the path, and so has what the setpoint is ahead.
    """
    *_, measured = parts.values()
    normal = measured - feet.point
    normal /= np.maximum(_length(normal), ON_THE_PATH)[:, None]
    shares, before = {}, feet.point
    for name, position in parts.items():
        shares[name] = normal * (position - before)
        before = position
    along = np.abs(shares["plan"].sum(axis=1))
    kept = np.divide(most, along, out=np.ones_like(along), where=along > most)[:, None] * shares["plan"]
    shares["servo"] += shares["plan"] - kept
    shares["plan"] = kept
    return Vectors(normal, feet.direction, shares)


def _stack_columns(columns: Sequence[Array], rows: slice | Integers) -> Array:
    return np.stack([values[rows] for values in columns], axis=1)


def _length(vectors: Array) -> Array:
    """(N,) of (N, A)."""
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", vectors, vectors)))


def _torques(trace: Trace, axes: Sequence[str], rows: slice) -> Iterator[tuple[str, tuple[float, float, float]]]:
    for axis in axes:
        if f"{axis}.M_a" in trace.columns and f"{axis}.n_a" in trace.columns:
            M, n = trace[f"{axis}.M_a"][rows], trace[f"{axis}.n_a"][rows]
            work = float(np.trapezoid(M * n, trace.time[rows]))
            yield axis, (float(np.abs(M).max()), math.sqrt(float(np.mean(M**2))), work)


class Setpoints:
    """Setpoints of ``axes`` between the position cycles of a program, as its spline has them, and at rest outside."""

    def __init__(self, program: Program, machine: Machine, axes: Sequence[str]) -> None:
        self.cycle = machine.cycles.T_pos
        self.last = len(program.time) - 1
        self.x = [program.x_s[axis] for axis in axes]
        # Per cycle, as the coefficients of a cubic over it.
        self.v = [program.n_ffw[axis] * (machine.axes[axis].I_P * self.cycle) for axis in axes]

    def at(self, time: Array) -> Array:
        """Positions (N, A) [m] at instants (N,) [s]: the cubic of each axis with position and speed of the cycles."""
        k, u = self._cycles(time)
        result = np.empty((len(time), len(self.x)))
        for i, (x, v) in enumerate(zip(self.x, self.v, strict=True)):
            begin, slope, end_slope = x[k], v[k], v[k + 1]
            rise = x[k + 1] - begin
            square = 3 * rise - 2 * slope - end_slope
            result[:, i] = begin + u * (slope + u * (square + u * (rise - slope - square)))
        return result

    def delay(self, time: Array, x: Sequence[Array]) -> float:
        """Delay [s] with which the setpoints are nearest to the positions x of the axes at ``time``, least squares."""
        every = len(time) // ROWS_OF_DELAY + 1
        instants, measured = time[::every], np.stack([positions[::every] for positions in x], axis=1)
        delay = 0.0
        for _ in range(DELAY_STEPS):
            k, u = self._cycles(instants - delay)
            speed = np.stack([v[k] + u * (v[k + 1] - v[k]) for v in self.v], axis=1) / self.cycle
            square = float((speed * speed).sum())
            if square == 0.0:
                return 0.0
            behind = float((speed * (self.at(instants - delay) - measured)).sum()) / square
            delay = min(max(delay + behind, 0.0), LONGEST_DELAY)
        return delay

    def _cycles(self, time: Array) -> tuple[Integers, Array]:
        """Position cycle (N,) of instants, and the share of it that has passed."""
        passed = np.clip(time / self.cycle, 0.0, self.last)
        k = np.minimum(passed.astype(np.int64), self.last - 1)
        return k, passed - k


# --- The same setpoints nearly without friction -----------------------------------------------------------------------


def with_frictionless(run: Run, fmus: Path | None = None, progress: Progress | None = None) -> Run:
    """A run with the positions of a second one that nearly has no friction, and no compensation of it.

    Without those where another maker's unit is the friction of an axis: it cannot be taken away.

    Raises SimulationError: a unit failed.
    """
    from feedsim.simulation import cosim  # what reads records alone does without the units

    scenario = run.scenario
    machine = without_friction(scenario.machine)
    if machine is None:
        return run
    columns = tuple(f"{axis}.x_a" for axis in machine.axes)
    recording = scenario.recording.model_copy(update={"variables": columns})
    second = scenario.model_copy(update={"machine": machine, "recording": recording, "logging": None})
    return replace(run, frictionless=cosim.run(second, program=run.program, fmus=fmus, progress=progress).trace)


def without_friction(machine: Machine) -> Machine | None:
    """The machine with NEARLY_NONE of its friction at motors and guides; None where a friction is another maker's."""
    axes = {}
    for name, axis in machine.axes.items():
        if isinstance(axis.friction, ForeignUnit):
            return None
        changes: dict[str, object] = {"friction": _reduce_friction(axis.friction, "N.m")}
        if axis.guide is not None:
            changes["guide"] = _reduce_friction(axis.guide, "N")
        if isinstance(axis.drive, Drive):
            changes["drive"] = axis.drive.model_copy(update={"friction_pulse": None, "friction_table": None})
        axes[name] = axis.model_copy(update=changes)
    return machine.model_copy(update={"axes": axes})


def _reduce_friction(group: ParameterGroup, unit: str) -> ParameterGroup:
    """Friction with NEARLY_NONE of every torque or force, stiffness and damping: LuGre and GMS are linear in all."""
    return group.model_copy(
        update={
            name: NEARLY_NONE * value
            for name, value in group.parameters().items()
            if (quantity := Quantity.of(type(group).model_fields[name])) is not None
            and re.match(rf"{re.escape(unit)}(\.s)?(/|$)", quantity.unit)
            and isinstance(value, float)
        }
    )
