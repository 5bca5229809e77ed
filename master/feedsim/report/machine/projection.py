"""Bodies in space on paper: parallel projection with Y up, shaded faces, the hidden behind what hides it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from feedsim.report.style import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Towards the eye from the light: faces that look up are the brightest, those to the right the darkest.
LIGHT = np.array([-0.35, 0.85, 0.55]) / np.linalg.norm([-0.35, 0.85, 0.55])
# Beyond this many polygons or lines a drawing is an image inside the SVG: the file would be megabytes.
MOST_VECTORS = 400
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
    found = [Faces(sides, np.tile(colour, (len(sides), 1)))]
    return [*found, Faces(ends, np.tile(colour, (2, 1)))]


def draw_faces(axes: Axes, where: View, faces: Sequence[Faces], *, flat: bool = False, zorder: float = 2) -> None:
    """Paint faces from the back to the front, those that look away left out; `flat` without shading."""
    from matplotlib.collections import PolyCollection

    polygons: list[Array] = []
    paints: list[Array] = []
    depths: list[Array] = []
    for group in faces:
        corners = group.corners
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        size = np.linalg.norm(normal, axis=1)
        normal = normal / np.where(size > 0, size, 1)[:, None]
        seen = (size > 0) & (normal @ where.basis[2] > 1e-9)
        light = np.ones(len(corners)) if flat else SHADE + (1 - SHADE) * np.clip(0.5 + 0.5 * normal @ LIGHT, 0, 1)
        polygons += list(where.flat(corners[seen]))
        paints.append((group.colours * light[:, None])[seen])
        depths.append(where.depth(corners[seen].mean(axis=1)))
    if not polygons:
        return
    order = np.argsort(np.concatenate(depths), kind="stable")  # far ones first
    paint = np.concatenate(paints)[order]
    collection = PolyCollection(
        [polygons[i] for i in order.tolist()], facecolors=paint, edgecolors=paint, linewidths=0.6, zorder=zorder
    )
    collection.set_rasterized(len(polygons) > MOST_VECTORS)
    axes.add_collection(collection, autolim=False)


def draw_lines(axes: Axes, where: View, lines: Array, colours: Array, width: float, zorder: float = 2) -> None:
    """Paint polylines (L, n, 3) in colours (L, 3), from the back to the front."""
    from matplotlib.collections import LineCollection

    order = np.argsort(where.depth(lines.mean(axis=1)), kind="stable")
    collection = LineCollection(
        list(where.flat(lines[order])), colors=colours[order], linewidths=width, zorder=zorder, capstyle="round"
    )
    collection.set_rasterized(len(lines) > MOST_VECTORS)
    axes.add_collection(collection, autolim=False)


def frame_limits(axes: Axes, where: View, points: Array, margin: float = 0.05, below: float = 0.0) -> None:
    """Limits that hold all points (..., 3), equal scales, no frame around.

    margin, below: room on all sides, and below in addition, as shares of the larger extent.
    """
    flat = where.flat(points.reshape(-1, 3))
    low, high = flat.min(axis=0), flat.max(axis=0)
    room = margin * float(np.max(high - low))
    axes.set_xlim(low[0] - room, high[0] + room)
    axes.set_ylim(low[1] - room * (1 + below / margin), high[1] + room)
    axes.set_aspect("equal", adjustable="box")
    axes.set_axis_off()
