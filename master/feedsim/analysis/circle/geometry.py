"""A circle that is measured, and what displaces its points: the ellipse, lost motion and pitch errors.

model.py has the equations. Start reading at correct_path(), which takes known displacements off a path.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

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
ANGLE_TERMS = ("angle", "angle_cos", "angle_sin")  # terms that written angles may be larger by
# A full turn may lack this share of it; files often end one sample ahead of the full turn.
CLOSED_TURN_TOLERANCE = 0.01


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


# What moves the points of a path for 1 m of a term, as it follows from time and turn alone: name -> number of the axis,
# None where the radius grows, and the displacement (N,) [m].
AxisDisplacements = Mapping[str, tuple[int | None, Array]]


@dataclass(frozen=True, eq=False)
class TurnedPath:
    """A measured turn at constant speed: angle about the programmed centre (N,) [rad], deviation of the radius
    (N,) [m], and its sense, +1 from the first axis towards the second, else -1. In the order of the motion.

    phase: where both axes' positions were measured over time, the angle by which the motion has turned (N,) [rad], from
    0 on. clock: the same angle where an instrument has written an angle over time.
    """

    angle: Array
    deviation: Array
    sense: int
    phase: Array | None = None
    clock: Array | None = None

    def thinned(self) -> TurnedPath:
        """At most MAX_TURN_SAMPLES samples, evenly chosen."""
        step = -(-len(self.angle) // MAX_TURN_SAMPLES)
        phase, clock = (None if turned is None else turned[::step] for turned in (self.phase, self.clock))
        return TurnedPath(self.angle[::step], self.deviation[::step], self.sense, phase, clock)

    @cached_property
    def turned(self) -> Array:
        """The angle by which the path has turned (N,) [rad], by its angles."""
        turned = self.sense * np.unwrap(self.angle)
        return np.asarray(turned - turned[0])

    @cached_property
    def covered(self) -> float:
        """The angle of the path [rad]: 2 pi of a full turn, less of an arc."""
        covered = float(self.turned[-1])
        return 2 * math.pi if covered > 2 * math.pi * (1 - CLOSED_TURN_TOLERANCE) else covered

    @property
    def whole(self) -> bool:
        """Whether it is a full turn."""
        return self.covered == 2 * math.pi


@dataclass(frozen=True, eq=False)
class CorrectedPath:
    """A path with its distortion undone: angle [rad] and deviation of the radius [m]; measured positions (2, N) [m],
    where the axes reverse at their half axis + [rad], and what moved the centre."""

    positions: Array
    angle: Array
    deviation: Array
    turned: tuple[float, float]
    moved: AxisDisplacements


def enough_pitches(circle: CircleUnderTest, axis: str, pitches: float = PITCHES) -> bool:
    """Whether the circle is large enough to determine an error that repeats with the pitch of ``axis``."""
    return axis in circle.pitch and 2 * circle.radius >= pitches * circle.pitch[axis]


def follow_errors(circle: CircleUnderTest, i: int, angle: Array, positions: Array, sense: int) -> tuple[Array, Array]:
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


def correct_path(
    circle: CircleUnderTest, path: TurnedPath, values: Mapping[str, float], by_program: bool, moved: AxisDisplacements
) -> CorrectedPath:
    """The path with what ``values`` say taken off: displacements of the axes first, then the ellipse.

    values: of the terms [m]. by_program: its angles are the programmed ones, unless both axes' positions were measured.
    moved: what moved the centre, and the radius.
    """

    def of(name: str) -> float:
        return values.get(name, 0.0)

    r, k = of("radius") / circle.radius, of("scale") / circle.radius
    q = (of("squareness") + path.sense * of("servo")) / circle.radius
    distortion = np.array([[1 + r + k, q], [q, 1 + r - k]])
    # An axis is at its extreme where its row of the distortion points along u.
    turned = (math.atan2(q, 1 + r + k), math.atan2(1 + r - k, q))
    centre = np.array([[of("offset_0")], [of("offset_1")]])
    angle = path.angle - sum(of(name) / circle.radius * wave for name, wave in angle_waves(path).items())
    grown = sum(of(name) * change for name, (axis, change) in moved.items() if axis is None)
    deviation = path.deviation - grown
    ways = {name: (axis, way) for name, (axis, way) in moved.items() if axis is not None}
    if by_program and path.phase is None:
        programmed = circle.radius * np.array([np.cos(angle), np.sin(angle)])
        p = centre + distortion @ programmed
        own = displacements(circle, angle, programmed, path.sense, (0, math.pi / 2), values)
        for name, (axis, displacement) in (own | ways).items():
            p[axis] += of(name) * displacement
        angle = np.arctan2(p[1], p[0])
    positions = (circle.radius + deviation) * np.array([np.cos(angle), np.sin(angle)])
    p = positions - centre
    angle = np.arctan2(p[1], p[0])
    own = displacements(circle, angle, positions, path.sense, turned, values)
    for name, (axis, displacement) in (own | ways).items():
        p[axis] -= of(name) * displacement
    plain = np.linalg.solve(distortion, p)
    radius = np.hypot(plain[0], plain[1])
    return CorrectedPath(positions, np.arctan2(plain[1], plain[0]), radius - circle.radius, turned, moved)


def angle_waves(path: TurnedPath) -> dict[str, Array]:
    """What written angles may be larger by, 1 rad of each (N,): a constant, and what an axle of the instrument makes
    that lies off its centre. Positions of both axes give the angle without such an axle."""
    axle = 0.0 if path.phase is not None else 1.0
    waves = np.ones(len(path.angle)), axle * np.cos(path.angle), axle * np.sin(path.angle)
    return dict(zip(ANGLE_TERMS, waves, strict=True))


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
            cos, sin = follow_errors(circle, i, angle, positions[i], sense)
            result[f"pitch_{i}_cos"], result[f"pitch_{i}_sin"] = (i, cos), (i, sin)
    if circle.recorded:
        u, w = positions / circle.radius
        result |= {"bend_0": (1, u**2), "bend_1": (0, w**2), "third": (1, u**3 - u / 2)}
    return result


def columns_of(
    circle: CircleUnderTest, path: TurnedPath, undone: CorrectedPath, both: bool, values: Mapping[str, float]
) -> dict[str, Array]:
    """Radial deviation for 1 m of every term; ``both`` senses are there to separate a delay from an angle."""
    angle, sense = undone.angle, path.sense
    along = np.cos(angle), np.sin(angle)
    result = {"offset_0": along[0], "offset_1": along[1], "radius": np.ones_like(angle), "scale": np.cos(2 * angle)}
    result["squareness"] = np.sin(2 * angle)
    if both:
        result["servo"] = sense * np.sin(2 * angle)
    moved = displacements(circle, angle, undone.positions, sense, undone.turned, values) | dict(undone.moved)
    result |= {
        name: displacement if axis is None else along[axis] * displacement
        for name, (axis, displacement) in moved.items()
    }
    if circle.recorded:
        slope = _slope(circle, sense, result, values)
        result |= {name: -slope / circle.radius * wave for name, wave in angle_waves(path).items()}
    return result


def _slope(circle: CircleUnderTest, sense: int, columns: Mapping[str, Array], values: Mapping[str, float]) -> Array:
    """How the radial deviation changes with the angle by what is steepest of the model (N,) [m/rad]: the centre, the
    ellipse and errors that repeat with a pitch."""

    def of(name: str) -> float:
        return values.get(name, 0.0)

    cos, sin = columns["offset_0"], columns["offset_1"]
    q = of("squareness") + sense * of("servo")
    slope = of("offset_1") * cos - of("offset_0") * sin
    slope += 2 * (q * columns["scale"] - of("scale") * columns["squareness"])
    for i, way in enumerate((-sin, cos)):
        if f"pitch_{i}_cos" in columns:
            a, b = f"pitch_{i}_cos", f"pitch_{i}_sin"
            rate = 2 * math.pi * circle.radius / circle.pitch[circle.axes[i]]
            slope += rate * way * (of(b) * columns[a] - of(a) * columns[b])
    return np.asarray(slope)
