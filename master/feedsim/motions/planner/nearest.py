"""The programmed path over its length, and its nearest points to where the axes are (``src/planner/nearest.c``)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feedsim.foundation.errors import InputError
from feedsim.motions.part_program.words import Motion, Moves
from feedsim.motions.planner import planned

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Feet:
    """Nearest points of a path to N positions.

    row (N,): of the moves; s (N,): length along the path [m]; point, direction (N, A): position [m], unit vector of the
    motion there.
    """

    row: NDArray[np.int64]
    s: Array
    point: Array
    direction: Array


@dataclass(frozen=True)
class ProgrammedPath:
    """Lines and arcs of a program, E of them, one after the other; rows of the program that do not move have none.

    A point of an element at its share u is begin + u line + cosine (cos(u angle) - 1) + sine sin(u angle); vectors are
    (E, A) [m], angle (E,) [rad] is 0 of lines. s (E + 1,): length at their ends [m]. row (E,): of the moves.
    """

    begin: Array
    line: Array
    cosine: Array
    sine: Array
    angle: Array
    s: Array
    row: NDArray[np.int64]

    @classmethod
    def of(cls, moves: Moves) -> ProgrammedPath:
        """The path that moves command."""
        begin = np.vstack([moves.start, moves.end[:-1]])
        line = moves.end - begin
        cosine, sine, angle = np.zeros_like(line), np.zeros_like(line), np.zeros(len(moves))
        arcs = np.flatnonzero(moves.motion == Motion.ARC)
        if len(arcs):
            # In the space of X, Y, Z; of an axis that is not there nothing of an arc lies along.
            space = np.array(["XYZ".index(axis) for axis in moves.axes if axis in ("X", "Y", "Z")])
            own = np.array([i for i, axis in enumerate(moves.axes) if axis in ("X", "Y", "Z")])
            at = np.zeros((len(arcs), 3))
            at[:, space] = begin[np.ix_(arcs, own)]
            normal = moves.normal[arcs]
            radius = at - moves.centre[arcs]
            radius[:, np.setdiff1d(np.arange(3), space)] = 0.0
            radius -= (radius * normal).sum(axis=1, keepdims=True) * normal
            cosine[np.ix_(arcs, own)] = radius[:, space]
            sine[np.ix_(arcs, own)] = np.cross(normal, radius)[:, space]
            angle[arcs] = moves.angle[arcs]
            # What the arc alone leaves is the way along its normal, and rounding of its end.
            turned = angle[arcs, None]
            line[arcs] -= cosine[arcs] * (np.cos(turned) - 1.0) + sine[arcs] * np.sin(turned)
        length = np.hypot(np.linalg.norm(cosine, axis=1) * angle, np.linalg.norm(line, axis=1))
        row = np.flatnonzero(length > 0)
        s = np.concatenate([[0.0], np.cumsum(length[row])])
        return cls(begin[row], line[row], cosine[row], sine[row], angle[row], s, row)

    def extent(self) -> tuple[Array, Array]:
        """Least and largest position of the axes in each element behind its begin (E, A) [m]."""
        turned = self.angle[:, None]
        end = self.begin + self.line + self.cosine * (np.cos(turned) - 1.0) + self.sine * np.sin(turned)
        least, most = end.copy(), end.copy()
        arc = np.flatnonzero(self.angle > 0)
        cosine, sine, line = self.cosine[arc], self.sine[arc], self.line[arc]
        middle, radius = self.begin[arc] - cosine, np.hypot(cosine, sine)
        for extreme, sign, choose in ((most, 1.0, np.maximum), (least, -1.0, np.minimum)):
            phi = np.arctan2(sign * sine, sign * cosine) % (2 * np.pi)
            share = phi / self.angle[arc, None]  # what a helix has gone along its normal there
            reached = middle + sign * radius + share * line
            met = (phi > 0) & (phi < self.angle[arc, None]) & (radius > 0)
            extreme[arc] = np.where(met, choose(extreme[arc], reached), extreme[arc])
        return least, most

    def point(self, s: Array) -> Array:
        """Points (N, A) [m] at lengths s (N,) [m]; before the begin and behind the end those."""
        k = np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self.row) - 1)
        u = np.clip((s - self.s[k]) / (self.s[k + 1] - self.s[k]), 0.0, 1.0)[:, None]
        turned = u * self.angle[k][:, None]
        way = u * self.line[k] + self.cosine[k] * (np.cos(turned) - 1.0) + self.sine[k] * np.sin(turned)
        return np.asarray(self.begin[k] + way, dtype=np.float64)

    def nearest(self, x: Array, at: Array, reach: Array) -> Feet:
        """Nearest points to positions x (N, A) [m] within ``reach`` (N,) [m] of the lengths ``at`` (N,) [m].

        Of points equally near to 1 nm that one counts which is nearer to ``at``.

        Raises InputError: more axes than the library takes, or no library.
        """
        count, axes = x.shape
        if axes > planned.MAX_PLANNED_AXES:
            raise InputError(f"contour error of {axes} axes; allowed: {planned.MAX_PLANNED_AXES}")
        given = [np.ascontiguousarray(values, dtype=np.float64) for values in (x, at, reach)]
        element = np.empty(count, dtype=np.int64)
        s, point, direction = np.empty(count), np.empty((count, axes)), np.empty((count, axes))
        elements = (self.begin, self.line, self.cosine, self.sine, self.angle, self.s)
        path = planned.ProgrammedPath(axes, len(self.row), *elements)
        columns = (*given, element, s, point, direction)
        planned.load().planner_nearest(path, count, *(values.ctypes.data for values in columns))
        return Feet(self.row[element], s, point, direction)
