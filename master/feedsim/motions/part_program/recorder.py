"""Movements become rows of Moves: frames, places in the program, and corners that are rounded between two movements.

Inside, a position has X, Y, Z, which a machine may lack, and then its other axes, in mm.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feedsim.motions.part_program.geometry import (  # fmt: skip
    IDENTITY,
    MIN_DISTANCE,
    Arc,
    Element,
    Frame,
    Point,
    Vector,
    add,
    chamfer,
    corner_angle,
    cross,
    dot,
    rounding_arc,
    unit,
)
from feedsim.motions.part_program.words import Motion, Moves, Note, row_type

GEOMETRY_AXES = ("X", "Y", "Z")
MAX_ROWS = 5_000_000  # some 170 bytes each
MAX_COORDINATE = 1e7  # [mm], 10 km: no machine, and far from where a double loses 1e-9 mm
ROWS_PER_CHUNK = 8192
RAPID, LINE, ARC, DWELL = int(Motion.RAPID), int(Motion.LINE), int(Motion.ARC), int(Motion.DWELL)
NO_ARC = ((math.nan,) * 3, (math.nan,) * 3, math.nan)
TANGENT_ANGLE = 1e-6  # [rad], below which a path has no corner

Options = tuple[int, float, bool, bool, bool]  # blending, tolerance [mm], jerk_limited, feedforward, compressed
ArcInSpace = tuple[Sequence[float], Sequence[float], float]  # centre, normal, angle


class Fault(Exception):
    """What cannot be taken of a program: word and reason; file (index) and line where not the present ones."""

    def __init__(self, word: str, reason: str, line: int | None = None, file: int | None = None) -> None:
        super().__init__(word, reason)
        self.word, self.reason, self.line, self.file = word, reason, line, file


@dataclass(frozen=True)
class Corner:
    """Between the last movement and the next one. word: RND, RNDM, CHR, CHF. size [mm]: radius, or of a chamfer.

    feed [mm/s]: FRC, or None. plane: its axes, as unit vectors of the machine's frame. line, file: where it stands.
    modal: RNDM, which asks for nothing where there is no corner. leg: whether a chamfer's size is that of its legs.
    """

    word: str
    size: float
    feed: float | None
    plane: tuple[Vector, Vector]
    line: int
    file: int
    modal: bool = False
    leg: bool = False


class Recorder:
    """Rows of a program that is being read, and where its axes are.

    position: of the machine. frame: between the program's points and it. file, line: of the block being read.
    """

    def __init__(self, axes: Sequence[str], start: Sequence[float]) -> None:
        """axes: names; start [mm]: of each."""
        given = dict(zip(axes, start, strict=True))
        self.axes = tuple(
            sorted(axes, key=lambda name: (name not in GEOMETRY_AXES, name if name in GEOMETRY_AXES else ""))
        )
        self.names = (*GEOMETRY_AXES, *(name for name in self.axes if name not in GEOMETRY_AXES))
        self.start = [given[name] for name in self.axes]
        self.position: Sequence[float] = tuple(given.get(name, 0.0) for name in self.names)
        self.frame = Frame(IDENTITY, (0.0,) * len(self.names))
        self.identity = True
        self._axes_of_arcs: dict[tuple[int, int, int], Vector] = {}
        self.corner: Corner | None = None
        self.file, self.line = 0, 0
        self.rows: list[tuple[Any, ...]] = []
        self.count = 0
        self._before: Sequence[float] = self.position  # where the last movement that has a length began
        self._last: tuple[Any, ...] | None = None
        self._chunks: list[NDArray[Any]] = []
        self._type = row_type(len(self.names))
        self._notes: dict[str, list[int]] = {}

    def note(self, word: str) -> None:
        """A word that does not move the path."""
        self._notes.setdefault(word, [0, self.file, self.line])[0] += 1

    def set_frame(self, frame: Frame) -> None:
        numbers = [x for row in frame.matrix for x in row]
        if not all(abs(x) <= 1e4 for x in numbers) or not all(abs(x) <= MAX_COORDINATE for x in frame.offset):
            raise ValueError("the frame scales by more than 10,000, or shifts by more than 10 km")
        self.frame = frame
        self.identity = frame.plain and not any(frame.offset)
        self._axes_of_arcs = {}

    def straight(self, point: Sequence[float], rapid: bool, feed: float, options: Options) -> None:
        """A line, or a rapid, to a point of the program. feed [mm/s]."""
        end = tuple(point) if self.identity else tuple(self.frame.machine(point))
        self.move(RAPID if rapid else LINE, end, NO_ARC, feed, options)

    def move(self, motion: int, end: Sequence[float], arc: ArcInSpace, feed: float, options: Options) -> None:
        """A movement to a position of the machine."""
        if self.corner is not None:
            corner = self.corner
            try:
                arc = self._insert_corner(motion, end, arc, feed, options)
            except ValueError as error:
                raise Fault(corner.word, str(error), corner.line, corner.file) from None
        row = (motion, end, *arc, feed, 0.0, *options, self.file, self.line)
        self.rows.append(row)
        if end != self.position or motion == ARC:
            self._before, self._last = self.position, row
            self.position = end
        if len(self.rows) > ROWS_PER_CHUNK:
            self._store()

    def dwell(self, seconds: float, options: Options) -> None:
        if self.corner is not None and not self.corner.modal:
            raise Fault(self.corner.word, "a dwell follows, so there is no corner", self.corner.line, self.corner.file)
        self.corner = None
        row = (DWELL, tuple(self.position), *NO_ARC, math.nan, seconds, *options, self.file, self.line)
        self.rows.append(row)

    def arc_in_space(self, plane: tuple[int, int, int], start: Sequence[float], arc: Arc, turns: int) -> ArcInSpace:
        """An arc of the program's plane (axes: first, second, normal) in the machine's frame, with additional turns."""
        first, second, _ = plane
        about = self._axis_of(plane)
        centre = list(start)
        centre[first], centre[second] = arc.centre
        if arc.sense < 0:
            about = (-about[0], -about[1], -about[2])
        moved = centre if self.identity else self.frame.machine(centre)
        return moved[:3], about, arc.angle + 2 * math.pi * turns

    def _axis_of(self, plane: tuple[int, int, int]) -> Vector:
        """Axis of counter-clockwise arcs of the program's plane, in the machine's frame."""
        if plane not in self._axes_of_arcs:
            (u, v), _ = self.plane(plane)
            along = self.frame.linear([float(i == plane[2]) for i in range(3)])
            about = cross(u, v)
            if abs(dot(u, v)) > 1e-9 or math.hypot(*cross(about, along)) > 1e-9 * math.hypot(*along):
                raise ValueError("the frame inclines the axes of the plane, which makes an arc an ellipse")
            self._axes_of_arcs[plane] = about
        return self._axes_of_arcs[plane]

    def plane(self, plane: tuple[int, int, int]) -> tuple[tuple[Vector, Vector], float]:
        """First and second axis of the program's plane, as unit vectors of the machine's frame; their scale."""
        u, v = (self.frame.linear([float(i == axis) for i in range(3)]) for axis in plane[:2])
        size = math.hypot(*u)
        if abs(size - math.hypot(*v)) > 1e-9 * size:
            raise ValueError("the frame scales the axes of the plane differently, which makes an arc an ellipse")
        return (unit(u), unit(v)), size

    def tangent(self) -> Vector | None:
        """Direction of the program at the end of the last movement; not a unit vector. None: nothing has moved."""
        if self._last is None:
            return None
        if self._last[0] == ARC:
            centre, normal = self._last[2], self._last[3]
            return self.frame.unlinear(cross(normal, add(tuple(self.position[:3]), centre, -1.0)))  # type: ignore[arg-type]
        return self.frame.unlinear(add(tuple(self.position[:3]), tuple(self._before[:3]), -1.0))  # type: ignore[arg-type]

    # --- Corners -----------------------------------------------------------------------------------------------------

    def _element(self, motion: int, start: Sequence[float], end: Sequence[float], arc: ArcInSpace) -> Element | None:
        """A movement in the plane of the corner; None: it has no way there."""
        assert self.corner is not None
        u, v = self.corner.plane
        normal = cross(u, v)
        a, b = (dot(start[:3], u), dot(start[:3], v)), (dot(end[:3], u), dot(end[:3], v))
        rises = abs(dot(normal, end[:3]) - dot(normal, start[:3])) > MIN_DISTANCE or end[3:] != start[3:]
        if motion != ARC and math.dist(a, b) < MIN_DISTANCE:
            return None
        if motion == RAPID:
            raise ValueError("corners of rapid movements are not rounded here")
        if rises:
            raise ValueError("a movement at the corner leaves the plane, which is not rounded here")
        if motion != ARC:
            return Element(a, b)
        centre, about, angle = arc
        sense = dot(about, normal)
        if abs(sense) < 1 - 1e-9:
            raise ValueError("an arc at the corner lies in another plane")
        flat = (dot(centre, u), dot(centre, v))
        return Element(a, b, Arc(flat, 1 if sense > 0 else -1, math.remainder(angle - math.pi, 2 * math.pi) + math.pi))

    def _insert_corner(
        self, motion: int, end: Sequence[float], arc: ArcInSpace, feed: float, options: Options
    ) -> ArcInSpace:
        """Cuts the last movement, adds the rounding or chamfer. Returns what is left of the next movement's arc."""
        corner = self.corner
        assert corner is not None
        here, row = self.position, self._last
        first = None
        if row is not None and self.rows and self.rows[-1] is row:
            first = self._element(row[0], self._before, here, row[2:5])
        second = self._element(motion, here, end, arc)
        self.corner = None
        if row is None or first is None or second is None:
            if corner.modal:
                return arc
            raise ValueError("a movement at the corner has no way in the plane")
        if abs(corner_angle(first, second)) < TANGENT_ANGLE:
            return arc
        u, v = corner.plane
        origin = (dot(here[:3], u), dot(here[:3], v))

        def in_space(point: Point) -> tuple[float, ...]:
            moved = add(add(tuple(here[:3]), u, point[0] - origin[0]), v, point[1] - origin[1])  # type: ignore[arg-type]
            return (*moved, *here[3:])

        inserted: ArcInSpace = NO_ARC
        if corner.word in ("CHF", "CHR"):
            a, b = chamfer(first, second, *((corner.size, 0.0) if corner.leg else (0.0, corner.size)))
        else:
            a, b, round_ = rounding_arc(first, second, corner.size)
            normal = cross(u, v)
            inserted = (in_space(round_.centre)[:3], tuple(round_.sense * x for x in normal), round_.angle)
        cut = list(row)
        cut[1] = in_space(a)
        if row[0] == ARC:
            cut[4] -= first.length - first.place(a)
        self.rows[-1] = tuple(cut)
        kind = ARC if inserted is not NO_ARC else LINE
        feed = feed if corner.feed is None else corner.feed
        self.rows.append((kind, in_space(b), *inserted, feed, 0.0, *options, row[-2], row[-1]))
        self.position = in_space(b)
        if motion == ARC:
            return arc[0], arc[1], arc[2] - second.place(b)
        return arc

    # --- Rows --------------------------------------------------------------------------------------------------------

    def _store(self, keep: int = 1) -> None:
        """Rows but for the last ones become an array."""
        stored = np.array(self.rows[: len(self.rows) - keep], dtype=self._type)
        far = np.flatnonzero(~(np.abs(stored["end"]) <= MAX_COORDINATE).all(axis=1))
        if far.size:
            raise Fault(
                "position",
                "an axis is commanded beyond 10 km",
                *(int(stored[name][far[0]]) for name in ("line", "file")),
            )
        self._chunks.append(stored)
        self.count += len(stored)
        if self.count > MAX_ROWS:
            raise Fault("program", f"more than {MAX_ROWS:,} movements")
        del self.rows[: len(self.rows) - keep]

    def finish(self, files: Sequence[str], texts: Sequence[str]) -> Moves:
        """All rows, in SI."""
        if self.corner is not None and not self.corner.modal:
            raise Fault(
                self.corner.word, "no movement follows, so there is no corner", self.corner.line, self.corner.file
            )
        self._store(0)
        columns: dict[str, Any] = {
            name: np.concatenate([chunk[name] for chunk in self._chunks]) for name in self._type.names or ()
        }
        for name in ("end", "centre", "feed", "tolerance"):
            columns[name] /= 1e3
        columns["end"] = np.ascontiguousarray(columns["end"][:, [self.names.index(name) for name in self.axes]])
        notes = tuple(Note(word, *numbers) for word, numbers in self._notes.items())
        start = np.array(self.start) / 1e3
        return Moves(axes=self.axes, start=start, files=tuple(files), texts=tuple(texts), notes=notes, **columns)
