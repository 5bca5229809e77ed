"""Bodies in space on paper: parallel projection with Y up, shaded faces, the hidden behind what hides it.

Start with Field, which draws them as shapes of an SVG.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter

import numpy as np

from feedsim.report.style import Array

Box = tuple[float, float, float, float]  # left, top, width, height [pixels]
# Towards the eye from the light: faces that look up are the brightest, those to the right the darkest.
LIGHT = np.array([-0.35, 0.85, 0.55]) / np.linalg.norm([-0.35, 0.85, 0.55])
OVERLAP = 0.35  # pixels of a face beyond its edges
SHADE = 0.42  # brightness of a face that looks away from the light, that of one towards it being 1


@dataclass(frozen=True, eq=False)
class View:
    """A direction to look from.

    Attributes:
        name: in words.
        basis: (3, 3) rows: to the right on paper, upwards on paper, towards the eye.
    """

    name: str
    basis: Array

    def flat(self, points: Array) -> Array:
        """(..., 2) on paper of (..., 3) in space."""
        return np.asarray(points @ self.basis[:2].T)

    def depth(self, points: Array) -> Array:
        """(...) distance towards the eye."""
        return np.asarray(points @ self.basis[2])


def view(name: str, towards_eye: Sequence[float], up: Sequence[float] = (0.0, 1.0, 0.0)) -> View:
    """The view from a direction, `up` upwards on paper."""
    eye = np.asarray(towards_eye, dtype=float) / np.linalg.norm(towards_eye)
    right = np.cross(up, eye)
    right /= np.linalg.norm(right)
    return View(name, np.array([right, np.cross(eye, right), eye]))


OBLIQUE = view("", (0.62, 0.46, 0.78))
FRONT = view("front, X–Y", (0, 0, 1))
SIDE = view("side, Z–Y", (1, 0, 0))
TOP = view("top, X–Z", (0, 1, 0), (0, 0, -1))


@dataclass(frozen=True, eq=False)
class Faces:
    """Quadrilaterals and other polygons of one number of corners: (F, c, 3) corners [m], (F, 3) colours 0..1."""

    corners: Array
    colours: Array


def tube(stations: Array, colour: Array) -> list[Faces]:
    """Faces of a body through cross-sections: stations (S, c, 3), corners of each in the same order; ends closed."""
    c = stations.shape[1]
    first, after = stations[:-1], stations[1:]
    turn = [(i + 1) % c for i in range(c)]
    sides = np.stack([first, first[:, turn], after[:, turn], after], axis=2).reshape(-1, 4, 3)
    ends = np.stack([stations[0][::-1], stations[-1]])
    faces = [Faces(sides, np.tile(colour, (len(sides), 1)))]
    return [*faces, Faces(ends, np.tile(colour, (2, 1)))]


class Field:
    """A view on paper: where points in space stand [pixels], and what is drawn there, from the back to the front.

    Its scale is the same in both directions. Shapes of a larger level cover those of a smaller one.
    """

    def __init__(self, where: View, box: Box, points: Array, margin: float = 0.03, below: float = 0.0) -> None:
        """Hold points (..., 3) in a box; margin, below: room on all sides, and below, as shares of their extent."""
        flat = where.flat(points.reshape(-1, 3))
        low, high = flat.min(axis=0), flat.max(axis=0)
        extent = float(np.max(high - low)) or 1.0
        low, high = low - margin * extent, high + margin * extent
        low[1] -= below * extent
        x, y, wide, tall = box
        self.where, self.box = where, box
        self.per = min(wide / (high[0] - low[0]), tall / (high[1] - low[1]))
        left, bottom = x + (wide - self.per * (high[0] - low[0])) / 2, y + (tall + self.per * (high[1] - low[1])) / 2
        self._origin = np.array([left - self.per * low[0], bottom + self.per * low[1]])
        self.corner = (left, bottom)
        self._shapes: list[tuple[float, str]] = []

    def at(self, points: Array) -> Array:
        """(..., 2) in pixels of (..., 3) in space."""
        return np.asarray(self._origin + self.where.flat(points) * np.array([self.per, -self.per]))

    def add(self, level: float, shape: str) -> None:
        """Draw a shape in front of those of smaller levels."""
        self._shapes.append((level, shape))

    def drawn(self) -> str:
        """All shapes as text of an SVG."""
        return "".join(shape for _, shape in sorted(self._shapes, key=lambda pair: pair[0]))

    def faces(self, level: float, groups: Sequence[Faces], *, flat: bool = False) -> None:
        """Paint faces from the back to the front, those that look away left out; `flat` without shading."""
        ways: list[str] = []
        paints: list[Array] = []
        depths: list[Array] = []
        for group in groups:
            corners = group.corners
            normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            size = np.linalg.norm(normal, axis=1)
            normal = normal / np.where(size > 0, size, 1)[:, None]
            seen = (size > 0) & (normal @ self.where.basis[2] > 1e-9)
            light = np.ones(len(corners)) if flat else SHADE + (1 - SHADE) * np.clip(0.5 + 0.5 * normal @ LIGHT, 0, 1)
            ways += [f"{_way(each)}Z" for each in _widened(self.at(corners[seen])).tolist()]
            paints.append((group.colours * light[:, None])[seen])
            depths.append(self.where.depth(corners[seen].mean(axis=1)))
        if ways:
            order = np.argsort(np.concatenate(depths), kind="stable").tolist()  # far ones first
            self.add(level, _painted([ways[k] for k in order], np.concatenate(paints)[order], "fill"))

    def lines(self, level: float, lines: Array, colours: Array, width: float) -> None:
        """Paint polylines (L, n, 3) in colours (L, 3), from the back to the front."""
        order = np.argsort(self.where.depth(lines.mean(axis=1)), kind="stable")
        drawn = _painted([_way(each) for each in self.at(lines[order]).tolist()], colours[order], "stroke")
        self.add(level, f'<g stroke-width="{width:g}" stroke-linecap="round" fill="none">{drawn}</g>')


def _way(points: Sequence[Sequence[float]]) -> str:
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points)


def _widened(corners: Array) -> Array:
    """Polygons (F, c, 2) a little larger on all sides: neighbours overlap, and no ground shines through."""
    edges = np.roll(corners, -1, axis=1) - corners
    normals = np.stack([edges[..., 1], -edges[..., 0]], axis=-1)
    lengths = np.linalg.norm(normals, axis=-1, keepdims=True)
    area = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
    normals *= np.sign(area)[:, None, None] / np.where(lengths > 0, lengths, 1.0)
    return np.asarray(corners + OVERLAP * (normals + np.roll(normals, 1, axis=1)))


def _painted(ways: Sequence[str], colours: Array, by: str) -> str:
    """Paths in their colours (N, 3), neighbours of one colour as one path; by: the attribute with the colour."""
    names = [hexadecimal(colour) for colour in colours]
    return "".join(
        f'<path {by}="{name}" d="{"".join(way for _, way in group)}"/>'
        for name, group in groupby(zip(names, ways, strict=True), key=itemgetter(0))
    )


def hexadecimal(colour: Array) -> str:
    """A colour (3,), 0 to 1, as an SVG has it."""
    return "#" + "".join(f"{round(255 * min(1.0, max(0.0, part))):02x}" for part in colour.tolist())
