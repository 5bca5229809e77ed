"""Records of circles with what real ones have, as a ballbar that is set up badly sees the motion of two axes.

Besides the causes of drawn_circles: guides bent in second and third order, a centre that drifts while the turns are
driven, an eccentric pivot that turns with the ballbar, and angles that are off by a constant.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from drawn_circles import Causes, driven

from feedsim.analysis.circle import CircleUnderTest, TurnedPath


@dataclass(frozen=True)
class Seen:
    """second, third: straightness of the guides of X (error along Z) and of Z (error along X), at the edge of the
    circle [m]: the second order from the tangent at the centre, the third from the line of least squares, of which it
    is a (x^3 - 0.6 R^2 x). drift: of the centre along X and Z [m/turn]. eccentric: of the pivot [m], and its angle
    where a turn begins [rad]. angle: by which the written angles are larger [rad]. rest: between the turns [turns]."""

    causes: Causes = field(default_factory=Causes)
    second: tuple[float, float] = (0.0, 0.0)
    third: tuple[float, float] = (0.0, 0.0)
    drift: tuple[float, float] = (0.0, 0.0)
    eccentric: tuple[float, float] = (0.0, 0.0)
    angle: float = 0.0
    rest: float = 0.5


def recorded(
    circle: CircleUnderTest, seen: Seen, rng: np.random.Generator, samples: int, senses: tuple[int, ...] = (1, -1)
) -> list[TurnedPath]:
    """A turn in each sense, one after the other, by angle and radius alone."""
    paths = []
    for number, sense in enumerate(senses):
        path = driven(circle, seen.causes, sense, rng, samples)
        assert path.phase is not None
        turns = number * (1 + seen.rest) + path.phase / (2 * math.pi)
        x = (circle.radius + path.deviation) * np.cos(path.angle)
        z = (circle.radius + path.deviation) * np.sin(path.angle)
        u, w = x / circle.radius, z / circle.radius
        own = seen.eccentric[1] + sense * path.phase
        moved_x = seen.second[1] * w**2 + seen.third[1] * (w**3 - 0.6 * w) + seen.drift[0] * turns
        moved_z = seen.second[0] * u**2 + seen.third[0] * (u**3 - 0.6 * u) + seen.drift[1] * turns
        x, z = x + moved_x, z + moved_z
        radius = np.hypot(x, z) + seen.eccentric[0] * np.cos(own)
        written = np.arctan2(z, x) + seen.angle
        paths.append(TurnedPath(np.arctan2(np.sin(written), np.cos(written)), radius - circle.radius, sense))
    return paths
