"""A circle that is measured, and what displaces its points: the ellipse, lost motion and pitch errors.

model.py has the equations. Start reading at undo(), which takes known displacements off a path.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from feedsim.analysis.figures import Array

# Lost motion from which on its shape is looked at [m]; the mark that it is play.
PLAY, PLAYED = 0.2e-6, "play"
# Travel in pitches from which an error that repeats with the pitch differs from the circle's own shape; and from which
# it is taken in where it explains what is left, however well the circle determines it.
PITCHES, FEWEST_PITCHES = 2.0, 0.5
# Points of a turn at which the way of an axis is taken through the response of its loops.
COURSE_POINTS = 1024
# More samples of a turn add nothing to its shape.
MAX_TURN_SAMPLES = 8000


@dataclass(frozen=True)
class CircleUnderTest:
    """What is known of the circle: axes of its plane (first, second), radius [m], path speed [m/s]; the pitch of an
    axis [m] where an error that repeats with it is looked for; where the drive of an axis is known, its response x_a
    over x_s at the circle's frequency [1], and x_a over a torque at the motor at the odd multiples of it, from the
    first on [m/(N.m)]; how an axis follows an error of its measured position at the multiples of that frequency, from
    the first on [1], 1 where it follows all of it; x_a over a torque on the rotor as a function of axis and frequencies
    (F,) [Hz].

    recorded: an instrument at the tool has measured it. Then guides may be bent, the centre may move while turns are
    driven, and the angles may be off by a constant (setup.py)."""

    axes: tuple[str, str]
    radius: float
    speed: float
    pitch: Mapping[str, float] = field(default_factory=dict)
    gain: Mapping[str, complex] = field(default_factory=dict)
    drag: Mapping[str, NDArray[np.complex128]] = field(default_factory=dict)
    following: Mapping[str, NDArray[np.complex128]] = field(default_factory=dict)
    recorded: bool = False
    response: Callable[[str, Array], NDArray[np.complex128]] | None = None


# Displacements for 1 m of a term that follow from time and turn alone: name -> number of the axis, (N,) [m].
Moved = Mapping[str, tuple[int, Array]]


@dataclass(frozen=True, eq=False)
class TurnedPath:
    """A measured turn at constant speed: angle about the programmed centre (N,) [rad], deviation of the radius
    (N,) [m], and its sense, +1 from the first axis towards the second, else -1. In the order of the motion.

    phase: where both axes' positions were measured over time, the angle by which the motion has turned (N,) [rad], from
    0 on."""

    angle: Array
    deviation: Array
    sense: int
    phase: Array | None = None

    def thinned(self) -> TurnedPath:
        """At most MAX_TURN_SAMPLES samples, evenly chosen."""
        step = -(-len(self.angle) // MAX_TURN_SAMPLES)
        phase = None if self.phase is None else self.phase[::step]
        return TurnedPath(self.angle[::step], self.deviation[::step], self.sense, phase)


@dataclass(frozen=True, eq=False)
class Undone:
    """A path with its distortion undone: angle [rad] and deviation of the radius [m]; measured positions (2, N) [m],
    where the axes reverse at their half axis + [rad], and what moved the centre."""

    positions: Array
    angle: Array
    deviation: Array
    turned: tuple[float, float]
    moved: Moved


def enough_pitches(circle: CircleUnderTest, axis: str, pitches: float = PITCHES) -> bool:
    """Whether the circle is large enough to determine an error that repeats with the pitch of ``axis``."""
    return axis in circle.pitch and 2 * circle.radius >= pitches * circle.pitch[axis]


def followed(circle: CircleUnderTest, i: int, angle: Array, positions: Array, sense: int) -> tuple[Array, Array]:
    """What axis ``i`` does of errors cos(2 pi x/p) and sin(2 pi x/p) of its measured position at angles (N,) [rad] of a
    turn, x its positions (N,) [m]: 1 m of each, as far as the loops follow, where their response is known."""
    axis = circle.axes[i]
    rate = 2 * math.pi / circle.pitch[axis]
    if axis not in circle.following:
        return np.cos(rate * positions), np.sin(rate * positions)
    time = np.linspace(0, 2 * math.pi, COURSE_POINTS, endpoint=False)
    way = rate * circle.radius * (np.cos, np.sin)[i](time)
    courses = []
    for wave in (np.cos, np.sin):
        spectrum = np.fft.rfft(wave(way))
        top = len(circle.following[axis]) + 1
        spectrum[1:top] *= circle.following[axis]
        spectrum[top:] = 0
        courses.append(np.interp(sense * angle % (2 * math.pi), time, np.fft.irfft(spectrum), period=2 * math.pi))
    # In the other sense the second axis goes the other way.
    return courses[0], courses[1] * (sense if i else 1)


def undo(
    circle: CircleUnderTest, path: TurnedPath, values: Mapping[str, float], by_program: bool, moved: Moved
) -> Undone:
    """The path with what ``values`` say taken off: displacements of the axes first, then the ellipse.

    values: of the terms [m], and "angle", by which the written angles are larger [rad]. by_program: its angles are the
    programmed ones, unless both axes' positions were measured. moved: what moved the centre.
    """

    def of(name: str) -> float:
        return values.get(name, 0.0)

    r, k = of("radius") / circle.radius, of("scale") / circle.radius
    q = (of("squareness") + path.sense * of("servo")) / circle.radius
    distortion = np.array([[1 + r + k, q], [q, 1 + r - k]])
    # An axis is at its extreme where its row of the distortion points along u.
    turned = (math.atan2(q, 1 + r + k), math.atan2(1 + r - k, q))
    centre = np.array([[of("offset_0")], [of("offset_1")]])
    angle = path.angle - of("angle")
    if by_program and path.phase is None:
        programmed = circle.radius * np.array([np.cos(angle), np.sin(angle)])
        p = centre + distortion @ programmed
        own = displacements(circle, angle, programmed, path.sense, (0, math.pi / 2), values)
        for name, (axis, displacement) in (own | dict(moved)).items():
            p[axis] += of(name) * displacement
        angle = np.arctan2(p[1], p[0])
    positions = (circle.radius + path.deviation) * np.array([np.cos(angle), np.sin(angle)])
    p = positions - centre
    angle = np.arctan2(p[1], p[0])
    own = displacements(circle, angle, positions, path.sense, turned, values)
    for name, (axis, displacement) in (own | dict(moved)).items():
        p[axis] -= of(name) * displacement
    plain = np.linalg.solve(distortion, p)
    radius = np.hypot(plain[0], plain[1])
    return Undone(positions, np.arctan2(plain[1], plain[0]), radius - circle.radius, turned, moved)


def displacements(
    circle: CircleUnderTest,
    angle: Array,
    positions: Array,
    sense: int,
    turned: tuple[float, float],
    values: Mapping[str, float],
) -> dict[str, tuple[int, Array]]:
    """Terms that displace one axis: its number, and the displacement for 1 m of the term. Play of `values` is used up
    behind a reversal before it is lost."""
    result = {}
    for i in (0, 1):
        side = sense * np.sign(np.sin(angle - turned[i]))
        lost = values.get(f"lost_{i}", 0.0)
        if lost > 0 and PLAYED in values:
            since = sense * (angle - turned[i]) % math.pi
            way = circle.radius * (1 - np.cos(since))
            result[f"lost_{i}"] = (i, side * np.clip(way / lost - 0.5, -0.5, 0.5))
        else:
            result[f"lost_{i}"] = (i, 0.5 * side)
    for i, axis in enumerate(circle.axes):
        if axis in circle.pitch:
            cos, sin = followed(circle, i, angle, positions[i], sense)
            result[f"pitch_{i}_cos"], result[f"pitch_{i}_sin"] = (i, cos), (i, sin)
    if circle.recorded:
        u, w = positions / circle.radius
        result |= {"bend_0": (1, u**2), "bend_1": (0, w**2), "third": (1, u**3 - u / 2)}
    return result


def columns_of(
    circle: CircleUnderTest, undone: Undone, sense: int, both: bool, values: Mapping[str, float]
) -> dict[str, Array]:
    """Radial deviation for 1 m of every term; ``both`` senses are there to separate a delay from an angle."""
    angle = undone.angle
    along = np.cos(angle), np.sin(angle)
    result = {"offset_0": along[0], "offset_1": along[1], "radius": np.ones_like(angle), "scale": np.cos(2 * angle)}
    result["squareness"] = np.sin(2 * angle)
    if both:
        result["servo"] = sense * np.sin(2 * angle)
    moved = displacements(circle, angle, undone.positions, sense, undone.turned, values) | dict(undone.moved)
    return result | {name: along[axis] * displacement for name, (axis, displacement) in moved.items()}
