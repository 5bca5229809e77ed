"""A part program: the movements of an NC program, planned as a control plans them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, StrictBool, StrictStr

from feedsim.files.fields import File, Quantity
from feedsim.foundation.errors import Finding, InputError
from feedsim.motions.kind import Array, Course, Geometry, MotionKind, Start, whole_cycles

if TYPE_CHECKING:
    from feedsim.motions.part_program import Moves
    from feedsim.motions.planner import Limits, PlannedPath
    from feedsim.motions.planner.nearest import ProgrammedPath

# Blocks that are named one by one where they leave the travel; of a program with more their number follows.
MAX_BLOCKS_NAMED = 100
MAX_WORDS_NAMED = 8  # that were passed over
# Positions of the axes within this of the travel's end [m] are rounding.
TRAVEL_ROUNDING = 1e-9


class PartProgram(MotionKind):
    """An NC program from where the axes are: read by its dialect, planned within all limits of the machine."""

    names_axes: ClassVar[bool] = False
    kind: Literal["program"] = "program"
    file: File = Field(description="NC program, relative to this file; its subprograms are looked for beside it")
    dialect: StrictStr | None = Field(
        default=None, description="How it is written (default: by the ending of its name and by what it holds)"
    )
    feed_override: Annotated[float, Quantity("1", above=0, maximum=10, example="80 %")] = Field(
        default=1.0, description="Factor on the programmed feeds"
    )
    rapid_override: Annotated[float, Quantity("1", above=0, maximum=1, example="50 %")] = Field(
        default=1.0, description="Factor on the speed of rapid traverse"
    )
    blending: Literal["exact_stop", "continuous", "distance", "tolerance"] | None = Field(
        default=None, description="Passage between blocks in place of the program's: G60, G64, G641 or G642"
    )
    tolerance: Annotated[float, Quantity("m", above=0, example="10 um")] | None = Field(
        default=None,
        description="Tolerance of rounded corners and of the compressor (CTOL), or leg of a corner (ADIS), in place of "
        "the program's",
    )
    compressor: StrictBool | None = Field(
        default=None, description="Short blocks as one smooth path (COMPCAD), in place of what the program says"
    )

    @property
    def description(self) -> str:
        said = [f"program {self.file.name}"]
        said += [f"feed override {100 * self.feed_override:g} %"] if self.feed_override != 1 else []
        said += [f"rapid override {100 * self.rapid_override:g} %"] if self.rapid_override != 1 else []
        said += [f"blending {self.blending.replace('_', ' ')}"] if self.blending is not None else []
        said += [f"tolerance {self.tolerance * 1e6:g} um"] if self.tolerance is not None else []
        said += [f"compressor {'on' if self.compressor else 'off'}"] if self.compressor is not None else []
        return ", ".join(said)

    def moves(self, start: Start) -> Moves:
        """What the program commands from ``start`` on, with the overrides. Raises InputError with file and line."""
        from feedsim.motions.part_program import Blending, Motion, read_program
        from feedsim.motions.part_program.reading import TOLERANCE

        axes = tuple(start.position)
        here = [start.position[axis] for axis in axes]
        moves = read_program(self.file, axes=axes, start=here, dialect=self.dialect)
        changes: dict[str, object] = {"feed": moves.feed * self.feed_override}
        blending, compressed = moves.blending, moves.compressed
        if self.blending is not None:
            moving = moves.motion != Motion.DWELL
            blending = np.where(moving, Blending[self.blending.upper()], blending).astype(np.int8)
        if self.compressor is not None:
            compressed = (moves.motion == Motion.LINE) & self.compressor
        within = (blending == Blending.TOLERANCE) | (blending == Blending.DISTANCE) | compressed
        tolerance = np.where(np.isnan(moves.tolerance), TOLERANCE, moves.tolerance)
        changes["tolerance"] = np.where(within, tolerance if self.tolerance is None else self.tolerance, np.nan)
        changes |= {"blending": blending, "compressed": compressed}
        return replace(moves, **changes)  # type: ignore[arg-type]

    def _limit_rapids(self, moves: Moves, limits: Limits) -> Moves:
        """The moves with rapids at their override as lines at a feed: of what the slowest of their axes allows."""
        from feedsim.motions.part_program import Motion

        rapid = moves.motion == Motion.RAPID
        if self.rapid_override == 1 or not rapid.any():
            return moves
        way = np.abs(np.diff(np.vstack([moves.start, moves.end]), axis=0))[rapid]
        slowest = (way / limits.of(moves.axes)[0]).max(axis=1)
        length = np.linalg.norm(way, axis=1)
        feed, motion = moves.feed.copy(), moves.motion.copy()
        feed[rapid] = self.rapid_override * np.divide(length, slowest, out=np.ones(len(way)), where=slowest > 0)
        motion[rapid] = Motion.LINE
        return replace(moves, feed=feed, motion=motion)

    def plan(self, start: Start) -> Course:
        """The program's course from where the axes are.

        Raises InputError: a program that cannot be read, that does not move, or that leaves the travel, every block
        with file and line; or one that lasts too long.
        """
        from feedsim.motions.planner import plan_moves
        from feedsim.motions.planner.nearest import ProgrammedPath

        moves = self.moves(start)
        programmed = ProgrammedPath.of(moves)
        if not len(programmed.row):
            raise InputError(f"{self.file}: the program moves no axis")
        if problems := list(_report_overtravel(moves, programmed, start)):
            more = len(problems) - MAX_BLOCKS_NAMED
            rest = [f"{self.file}: and {more} blocks more"] if more > 0 else []
            raise InputError.of(f"{self.file}", [*problems[:MAX_BLOCKS_NAMED], *rest])
        axes, limits = moves.axes, start.limits
        assert limits is not None
        path = plan_moves(self._limit_rapids(moves, limits), limits)
        cycles = whole_cycles(path.duration, start.T_ipo)
        if cycles > start.most:
            raise InputError(
                f"lasts {path.duration:.6g} s; allowed in this program: {max(start.most, 0) * start.T_ipo:.6g} s"
            )
        instants = np.arange(cycles + 1, dtype=np.float64) * start.T_ipo
        sampled = path.sample(np.minimum(instants, path.duration))
        position, s = sampled.position, sampled.s
        end = moves.end[-1]
        position[-1] = end
        moved = np.ptp(position, axis=0) > 0
        return Course(
            duration=path.duration,
            cycles=cycles,
            points={axis: np.ascontiguousarray(position[1:, i]) for i, axis in enumerate(axes) if moved[i]},
            target={axis: float(end[i]) for i, axis in enumerate(axes) if moved[i]},
            moving=tuple(axis for i, axis in enumerate(axes) if moved[i]),
            geometry=ProgrammedGeometry(
                moves, programmed, path, start.time, np.asarray(instants + start.time, dtype=np.float64), s,
                tuple(axis for i, axis in enumerate(axes) if moved[i]),
            ),
        )  # fmt: skip


def _report_overtravel(moves: Moves, path: ProgrammedPath, start: Start) -> Iterator[str]:
    """A sentence for every block that leaves the travel of an axis, with what it reaches [mm]."""
    low, high = np.array([start.travel[axis] for axis in moves.axes]).T
    least, most = path.extent()
    # A block that begins outside is not to blame for that: the one before it is.
    beyond = ((least < low - TRAVEL_ROUNDING) | (most > high + TRAVEL_ROUNDING)).any(axis=1)
    for k in np.flatnonzero(beyond).tolist():
        row = int(path.row[k])
        for i, axis in enumerate(moves.axes):
            outside = [
                x for x in (least[k, i], most[k, i]) if not low[i] - TRAVEL_ROUNDING <= x <= high[i] + TRAVEL_ROUNDING
            ]
            if outside:
                there = " and ".join(dict.fromkeys(f"{x * 1e3:.7g}" for x in outside))
                yield (
                    f"{moves.files[moves.file[row]]}:{moves.line[row]}: {moves.text(row)}: "
                    f"axis {axis} reaches {there} mm; allowed travel {low[i] * 1e3:.7g} to {high[i] * 1e3:.7g} mm"
                )


@dataclass(frozen=True, eq=False)
class ProgrammedGeometry(Geometry):
    """The path of an NC program.

    moves: what the program commands. path: its lines and arcs. plan: the planned path, with what limits each block.
    time (K,) [s, program time], s (K,) [m]: the cycles of the interpolator, and where on the programmed path the plan
    then is. axes: that the program moves.
    """

    moves: Moves
    path: ProgrammedPath
    plan: PlannedPath
    begin: float
    time: Array
    s: Array
    axes: tuple[str, ...]

    @cached_property
    def limits(self) -> list[str]:
        """What held each block back for most of its time, in words: "F", "acceleration X"."""
        from feedsim.motions.planner import Acts

        words = {kind: "" if kind == Acts.NOTHING else "F" if kind == Acts.FEED else kind.name.lower() for kind in Acts}
        names = [*self.moves.axes, "path"]  # axis -1 is the path
        return [
            f"{words[Acts(kind)]} {names[axis]}" if kind > Acts.FEED else words[Acts(kind)]
            for kind, axis in zip(self.plan.acts.tolist(), self.plan.axis.tolist(), strict=True)
        ]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the program and its subprograms, without their folders."""
        return tuple(Path(file).name for file in self.moves.files)

    def place(self, row: int) -> str:
        """File and line of a row, in a report."""
        return f"{self.names[self.moves.file[row]]}:{self.moves.line[row]}"

    @property
    def notes(self) -> tuple[Finding, ...]:
        """What the plan has to say, and what the program says that moves no axis."""
        if not self.moves.notes:
            return self.plan.notes
        words = [f"{note.word} ({self.names[note.file]}:{note.line})" for note in self.moves.notes[:MAX_WORDS_NAMED]]
        more = len(self.moves.notes) - MAX_WORDS_NAMED
        words += [f"{more} more"] if more > 0 else []
        text = f"passed over, for it moves no axis: {', '.join(words)}"
        return (*self.plan.notes, Finding("words-passed-over", "note", text, self.names[0]))

    @cached_property
    def uneven(self) -> float:
        """How far the place between two cycles of the interpolator is off a straight line between them at most [m]."""
        return float(np.abs(np.diff(self.s, 2)).max(initial=0.0)) / 8

    @property
    def text(self) -> str:
        return f"{len(self.moves)} blocks, length {self.path.s[-1] * 1e3:.6g} mm"
