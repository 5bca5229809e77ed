"""The model of a circle that is not round, and its robust fit.

A machine whose axes answer late, have scales of their own or are not square drives an ellipse about another centre.
With the unit vector u(phi) of the programmed circle, positions about the programmed centre are

    p = c + (1 + S) R u + lost motion + pitch error,   S = [[r + k, q], [q, r - k]],   q = q_0 + s m,

which radially is, to first order, c_1 cos phi + c_2 sin phi + r R + k R cos 2 phi + q R sin 2 phi. s is the sense of
the motion, +1 from the first axis towards the second: what a delay between the axes makes changes sign with it, what
their angle makes does not. Axis i that loses B where it reverses lags by B/2 all the way. The ellipse is undone
exactly, not to first order: 75 um of it on a radius of 15 mm have 0.4 um of second order, as much as is looked for.

What friction makes where an axis reverses is no part of the model. A window behind every reversal is left out, and what
else does not fit counts less (Tukey's biweight). Where a peak dies away slowly, what is left of it behind its window is
fitted as an exponential whose size and decay the window shows, the size to within its own amount: so the tail is not
taken for lost motion, and where the two are not told apart, the interval of the lost motion holds both.

On a fast circle a peak takes as long as a quarter turn, and no exponential is its shape. Where the drives are known, so
is that shape: Coulomb friction is a torque that changes sign where an axis reverses, and the position follows it by the
loops' response at the odd harmonics of the turn. It stands in the place of the exponentials, with its first two slopes,
as friction takes some way to turn round.

Lost motion is a step, or play: then an axis stands behind a reversal until the play is used up, along R (1 - cos). That
of both is taken which leaves less there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from feedsim.analysis.circle.robust import SETTLED, covariance_of, robust_fit, rounding
from feedsim.analysis.figures import Array

# Angle ahead of a reversal and behind it that is left out [deg]; the second grows while the peak has not died away.
AHEAD, BEHIND = 2.0, (30.0, 45.0, 60.0)
# Just behind the window the deviation is calm if it is below this share of the peak, or not larger than noise makes it.
CALM, NEXT = 0.05, 4.0
# What a peak leaves at the end of its window may be off by this multiple of what the window shows; less than the floor
# [m] is not looked at. Angles in which it may fall to 1/e [deg].
TAIL, TAIL_FLOOR = 2.0, 10e-9
DECAYS = (2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 12.0, 14.0, 16.0, 18.0, 21.0, 25.0, 30.0)
FALLEN = 2.0  # angle of the means [deg] that say where a peak has fallen to half its height
# Neighbouring samples share what disturbs them. Blocks of this angle [deg] do not, as far as intervals are concerned.
BLOCK = 6.0
# Friction is no clean step: the response to it outside the windows is known to this share.
KNOWN = 0.2
# Lost motion from which on its shape is looked at [m]; the mark that it is play.
PLAY, PLAYED = 0.2e-6, "play"
# Of known responses: the angle in which friction turns round [deg]; points of a turn.
TURNS, PERIOD = 10.0, 2048
PASSES = 6
# Travel in pitches from which an error that repeats with the pitch is told from the circle's own shape.
PITCHES = 2.0
REPEATS = 2.0  # and pitches that must lie between two windows, where the drives are known
# More samples of a turn tell nothing more of its shape.
MOST = 8000
# The angle that is programmed and the one where the machine is are told apart from this deviation [m] on.
UNSEEN = 5e-9


@dataclass(frozen=True)
class CircleUnderTest:
    """What is known of the circle: axes of its plane (first, second), radius [m], path speed [m/s]; the pitch of an
    axis [m] where an error that repeats with it is looked for; where the drive of an axis is known, its response x_a
    over x_s at the circle's frequency [1], and x_a over a torque at the motor at the odd multiples of it, from the
    first on [m/(N.m)]."""

    axes: tuple[str, str]
    radius: float
    speed: float
    pitch: Mapping[str, float] = field(default_factory=dict)
    gain: Mapping[str, complex] = field(default_factory=dict)
    drag: Mapping[str, NDArray[np.complex128]] = field(default_factory=dict)


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
        """At most MOST samples, evenly chosen."""
        step = -(-len(self.angle) // MOST)
        phase = None if self.phase is None else self.phase[::step]
        return TurnedPath(self.angle[::step], self.deviation[::step], self.sense, phase)


@dataclass(frozen=True, eq=False)
class Fit:
    """The fitted model.

    Attributes:
        names: of the terms, as ``columns`` gives them. values: (K,) [m]; covariance: (K, K) [m2].
        quantile: of Student's distribution, for intervals of 95 %.
        angle: of every path, undistorted (N,) [rad]; residual: (N,) [m]; reversal: within the window of which one a
            sample is, 0 to 3 from the half axis + of the first axis on, -1 in none (N,); since: the angle that the
            motion has turned since that reversal (N,) [rad].
        tail: of every path, the part of the residual that the peaks leave behind their windows (N,) [m].
        columns: of every path, radial deviation for 1 m of each term, name -> (N,).
        window: how far behind a reversal is left out [rad].
        noise: standard deviation of a sample outside the windows [m].
        left_out: pitch errors that the circle is too small for.
        unsure: what a term may be off by as the loops' response is not known better [m].
    """

    names: tuple[str, ...]
    values: Array
    covariance: Array
    quantile: float
    angle: tuple[Array, ...]
    residual: tuple[Array, ...]
    reversal: tuple[NDArray[np.int64], ...]
    since: tuple[Array, ...]
    tail: tuple[Array, ...]
    columns: tuple[Mapping[str, Array], ...]
    window: float
    noise: float
    left_out: tuple[str, ...]
    unsure: float = 0.0

    def __getitem__(self, name: str) -> float:
        return float(self.values[self.names.index(name)]) if name in self.names else 0.0

    @property
    def rest_error(self) -> float:
        """Standard deviation of the model's own deviation where it is known least well, behind the reversals [m]."""
        worst = 0.0
        for k, which in enumerate(self.reversal):
            x = np.column_stack([self.columns[k][name] for name in self.names])[which >= 0]
            worst = max(worst, float(np.einsum("ij,jk,ik->i", x, self.covariance, x).max(initial=0.0)))
        return math.sqrt(worst)

    def half(self, *names: str) -> float:
        """Half of the interval of a term [m]; of an amplitude with two parts, along its direction."""
        rows = [self.names.index(name) for name in names]
        part = self.values[rows]
        length = float(np.hypot(*part)) if len(rows) == 2 else 0.0
        along = part / length if length > 0 else np.full(len(rows), 1 / math.sqrt(len(rows)))
        own = self.quantile * math.sqrt(max(float(along @ self.covariance[np.ix_(rows, rows)] @ along), 0.0))
        return math.hypot(own, self.unsure)


def enough_pitches(circle: CircleUnderTest, axis: str) -> bool:
    """Whether the circle is large enough to tell an error that repeats with the pitch of ``axis``."""
    return axis in circle.pitch and 2 * circle.radius >= PITCHES * circle.pitch[axis]


def fit(circle: CircleUnderTest, paths: Sequence[TurnedPath]) -> Fit:
    """The model fitted to turns of one sense or of both; windows behind reversals are as wide as their peaks need.

    A path of angle and radius alone may have the programmed angle in place of the one where the machine was: that of
    both which leaves less is taken.
    """
    found = _shaped(circle, paths, told=False)
    moved = sum(math.hypot(found[a], found[b]) for a, b in (("offset_0", "offset_1"), ("scale", "servo")))
    moved += abs(found["squareness"])
    if all(path.phase is not None for path in paths) or moved**2 < circle.radius * UNSEEN:
        return found
    other = _shaped(circle, paths, told=True)
    return other if other.noise < found.noise else found


def _shaped(circle: CircleUnderTest, paths: Sequence[TurnedPath], told: bool) -> Fit:
    """Lost motion as a step, or as play that is used up first, whichever leaves less behind the reversals."""
    found = _windowed(circle, paths, told, play=False)
    if max(found["lost_0"], found["lost_1"]) < PLAY:
        return found
    other = _windowed(circle, paths, told, play=True)
    return other if _behind(other) < _behind(found) else found


def _behind(found: Fit) -> float:
    """What is left behind the reversals, in squares [m2]."""
    return sum(float((off[which >= 0] ** 2).sum()) for off, which in zip(found.residual, found.reversal, strict=True))


def _windowed(circle: CircleUnderTest, paths: Sequence[TurnedPath], told: bool, play: bool) -> Fit:
    for degrees in BEHIND:
        found = _fit(circle, paths, math.radians(degrees), told, play)
        if _calm(found):
            break
    return found


@dataclass(frozen=True, eq=False)
class _Undone:
    """A path with its distortion undone: angle [rad] and deviation of the radius [m]; measured positions (2, N) [m],
    and where the axes reverse at their half axis + [rad]."""

    positions: Array
    angle: Array
    deviation: Array
    turned: tuple[float, float]


@dataclass(frozen=True, eq=False)
class _Tails:
    """Columns of what peaks leave behind their windows, 1 m at the windows' end (N, T), and how large they may be (T,)
    [m]."""

    columns: Array
    spread: Array


def _fit(circle: CircleUnderTest, paths: Sequence[TurnedPath], window: float, told: bool, play: bool) -> Fit:
    both = len({path.sense for path in paths}) == 2
    asked = [axis for axis in circle.axes if axis in circle.pitch]
    # Where friction's response reaches far, an error must be seen to repeat between two windows.
    free = circle.radius * (math.pi / 2 - window - math.radians(AHEAD)) if circle.drag else math.inf
    circle = replace(circle, pitch={axis: p for axis, p in circle.pitch.items() if REPEATS * p <= free})
    values: dict[str, float] = {PLAYED: 1.0} if play else {}
    ends = np.cumsum([len(path.angle) for path in paths])[:-1]
    tails = _Tails(np.empty((sum(len(path.angle) for path in paths), 0)), np.empty(0))
    residual: Array = np.empty(0)
    for number in range(PASSES):
        undone = [_undo(circle, path, values, told) for path in paths]
        parts = [_columns(circle, each, path.sense, both, values) for each, path in zip(undone, paths, strict=True)]
        windows = [_windows(each, path.sense, window) for each, path in zip(undone, paths, strict=True)]
        names = tuple(parts[0])
        matrix = np.concatenate([np.column_stack([part[name] for name in names]) for part in parts])
        deviation: Array = np.concatenate([each.deviation for each in undone])
        which, since = (np.concatenate(each) for each in zip(*windows, strict=True))
        kept = which < 0
        if number == 2:  # the ellipse is undone, so that the windows show the peaks alone
            usual = _usual([each.angle for each in undone], np.split(residual, ends), [free for free, _ in windows])
            tails = (
                _known_tails(circle, undone, paths, residual, which)
                if all(axis in circle.drag for axis in circle.axes)
                else _tails(undone, paths, _left(residual, which, since, window, usual), window)
            )
        fitted = (np.column_stack([matrix, tails.columns]) if len(tails.spread) else matrix)[kept]
        blocks = _blocks(undone)[kept] if len(tails.spread) else np.empty(0)
        robust = robust_fit(fitted, deviation[kept], tails.spread, blocks)
        step = robust.values[: len(names)]
        values |= {name: values.get(name, 0.0) + float(d) for name, d in zip(names, step, strict=True)}
        residual = deviation - matrix @ step
        if number > 1 and float(np.abs(step).max()) < SETTLED:
            break
    tail = tails.columns @ robust.values[len(names) :]
    rounded = rounding([path.deviation for path in paths], np.split(residual - tail, ends), robust.noise)[kept]
    covariance, quantile = covariance_of(
        fitted, (residual - tail)[kept], robust, tails.spread, _blocks(undone)[kept], rounded
    )
    return Fit(
        names=names,
        values=np.array([values[name] for name in names]),
        covariance=covariance[: len(names), : len(names)],
        quantile=quantile,
        angle=tuple(each.angle for each in undone),
        residual=tuple(np.split(residual, ends)),
        reversal=tuple(which for which, _ in windows),
        since=tuple(since for _, since in windows),
        tail=tuple(np.split(tail, ends)),
        columns=tuple(parts),
        window=window,
        noise=robust.noise,
        left_out=tuple(axis for axis in asked if not enough_pitches(circle, axis)),
        unsure=KNOWN * float(np.abs(tail[kept]).max(initial=0.0)) if len(circle.drag) == 2 else 0.0,
    )


def _blocks(undone: Sequence[_Undone]) -> Array:
    """Which block of BLOCK each sample of all paths is in (N,)."""
    return np.concatenate([1000 * k + np.floor(each.angle / math.radians(BLOCK)) for k, each in enumerate(undone)])


def _left(
    residual: Array, which: NDArray[np.int64], since: Array, window: float, usual: float
) -> list[tuple[float, float]]:
    """What the peak at each half axis leaves at the end of its window [m], and the angle in which that falls to 1/e
    [rad], one for both sides of an axis; 0, 0: nothing.

    An exponential over a constant, which lost motion that is not yet known is: of means of the axis' displacement, from
    where the peak has fallen to half on. usual: of means elsewhere, above which a peak must stand [m]. A
    tail is one that is more than what the exponential leaves of the means.
    """
    width = math.radians(FALLEN)
    decays = np.radians(DECAYS)[:, None]
    found = [(0.0, 0.0)] * 4
    for axis in (0, 1):
        sizes: dict[int, Array] = {}
        errors: dict[int, Array] = {}
        for k in (axis, axis + 2):
            own = (which == k) & (since > 0)
            part = np.floor(since[own] / width).astype(int)
            means = np.bincount(part, residual[own] / np.cos(since[own])) / np.maximum(np.bincount(part), 1)
            top = int(np.abs(means).argmax()) if len(means) else 0
            if len(means) == 0 or abs(means[top]) <= NEXT * usual:
                continue
            means *= np.sign(means[top])
            fallen = top + np.flatnonzero(means[top:] < 0.5 * means[top])
            if len(fallen) == 0 or len(means) - fallen[0] < 3:
                continue
            left = means[fallen[0] :]
            left = left - left.mean()
            tail = np.exp((window - (np.arange(fallen[0], len(means)) + 0.5) * width) / decays)
            tail -= tail.mean(axis=1, keepdims=True)
            sizes[k] = tail @ left / (tail**2).sum(axis=1)
            errors[k] = ((left - sizes[k][:, None] * tail) ** 2).mean(axis=1)
        best = int(np.sum(list(errors.values()), axis=0).argmin()) if errors else 0
        for k, size in sizes.items():
            if size[best] > math.sqrt(errors[k][best]):
                found[k] = (float(size[best]), float(decays[best, 0]))
    return found


def _tails(
    undone: Sequence[_Undone], paths: Sequence[TurnedPath], left: Sequence[tuple[float, float]], window: float
) -> _Tails:
    """Tails of the peaks at the half axes; both senses share one: the axis reverses there from the same way.

    left: what each peak leaves at the end of its window [m], and the angle in which that falls to 1/e [rad].
    """
    columns, spread = [], []
    for k, (size, decay) in enumerate(left):
        if size < TAIL_FLOOR:
            continue
        parts = []
        for each, path in zip(undone, paths, strict=True):
            at = each.turned[k % 2] + (math.pi if k > 1 else 0.0)
            since = path.sense * (each.angle - at) % (2 * math.pi)
            along = np.abs((np.cos if k % 2 == 0 else np.sin)(each.angle))
            parts.append(np.where(since < math.pi, along * np.exp((window - since) / decay), 0.0))
        columns.append(np.concatenate(parts))
        spread.append(TAIL * size)
    samples = sum(len(each.angle) for each in undone)
    return _Tails(np.column_stack(columns) if columns else np.empty((samples, 0)), np.array(spread))


def _known_tails(
    circle: CircleUnderTest,
    undone: Sequence[_Undone],
    paths: Sequence[TurnedPath],
    residual: Array,
    which: NDArray[np.int64],
) -> _Tails:
    """The same where the loops' response is known: of each axis the periodic response to its friction, and the slope.

    A torque that is -F sgn(v) moves the axis by F 4/pi sum over odd k of Im(T_k exp(i k theta))/k, theta its own angle
    from the half axis + on, T_k its response. The columns are 1 m at their largest; friction is as large as the
    windows' peaks, or less, and turns round within TURNS: so do the first two slopes of the response.
    """
    columns, spread = [], []
    for i, axis in enumerate(circle.axes):
        peak = float(np.abs(residual[(which >= 0) & (which % 2 == i)]).max(initial=0.0))
        if peak < TAIL_FLOOR:
            continue
        k = 2 * np.arange(len(circle.drag[axis])) + 1
        waves = circle.drag[axis] / k
        theta = np.linspace(0, 2 * math.pi, PERIOD, endpoint=False)
        turned = np.exp(1j * np.outer(theta, k))
        largest = float(np.abs((turned @ waves).imag).max())
        within = math.radians(TURNS)
        for order, size in enumerate((TAIL, within, within**2)):
            own = (turned @ ((1j * k) ** order * waves)).imag / largest
            parts = []
            for each, path in zip(undone, paths, strict=True):
                passed = path.sense * (each.angle - each.turned[i]) % (2 * math.pi)
                along = (np.cos, np.sin)[i](each.angle)
                parts.append(along * np.interp(passed, theta, own, period=2 * math.pi))
            columns.append(np.concatenate(parts))
            spread.append(size * peak)
    return _Tails(np.column_stack(columns) if columns else np.empty((len(residual), 0)), np.array(spread))


def _undo(circle: CircleUnderTest, path: TurnedPath, values: Mapping[str, float], told: bool) -> _Undone:
    """The path with what ``values`` say taken off: displacements of the axes first, then the ellipse.

    told: its angles are the programmed ones, unless both axes' positions were measured.
    """

    def of(name: str) -> float:
        return values.get(name, 0.0)

    r, k = of("radius") / circle.radius, of("scale") / circle.radius
    q = (of("squareness") + path.sense * of("servo")) / circle.radius
    distortion = np.array([[1 + r + k, q], [q, 1 + r - k]])
    # An axis is at its extreme where its row of the distortion points along u.
    turned = (math.atan2(q, 1 + r + k), math.atan2(1 + r - k, q))
    centre = np.array([[of("offset_0")], [of("offset_1")]])
    angle = path.angle
    if told and path.phase is None:
        programmed = circle.radius * np.array([np.cos(angle), np.sin(angle)])
        p = centre + distortion @ programmed
        for name, (axis, displacement) in _displacements(
            circle, angle, programmed, path.sense, (0, math.pi / 2), values
        ).items():
            p[axis] += of(name) * displacement
        angle = np.arctan2(p[1], p[0])
    positions = (circle.radius + path.deviation) * np.array([np.cos(angle), np.sin(angle)])
    p = positions - centre
    angle = np.arctan2(p[1], p[0])
    for name, (axis, displacement) in _displacements(circle, angle, positions, path.sense, turned, values).items():
        p[axis] -= of(name) * displacement
    plain = np.linalg.solve(distortion, p)
    return _Undone(positions, np.arctan2(plain[1], plain[0]), np.hypot(plain[0], plain[1]) - circle.radius, turned)


def _displacements(
    circle: CircleUnderTest,
    angle: Array,
    positions: Array,
    sense: int,
    turned: tuple[float, float],
    values: Mapping[str, float],
) -> dict[str, tuple[int, Array]]:
    """Terms that displace one axis: its number, and the displacement for 1 m of the term. Play of `values` is used up
    behind a reversal before it is lost."""
    found = {}
    for i in (0, 1):
        side = sense * np.sign(np.sin(angle - turned[i]))
        lost = values.get(f"lost_{i}", 0.0)
        if lost > 0 and PLAYED in values:
            since = sense * (angle - turned[i]) % math.pi
            way = circle.radius * (1 - np.cos(since))
            found[f"lost_{i}"] = (i, side * np.clip(way / lost - 0.5, -0.5, 0.5))
        else:
            found[f"lost_{i}"] = (i, 0.5 * side)
    for i, axis in enumerate(circle.axes):
        if enough_pitches(circle, axis):
            phase = 2 * math.pi / circle.pitch[axis] * positions[i]
            found[f"pitch_{i}_cos"], found[f"pitch_{i}_sin"] = (i, np.cos(phase)), (i, np.sin(phase))
    return found


def _columns(
    circle: CircleUnderTest, undone: _Undone, sense: int, both: bool, values: Mapping[str, float]
) -> dict[str, Array]:
    """Radial deviation for 1 m of every term; ``both`` senses are there to tell a delay from an angle."""
    angle = undone.angle
    along = np.cos(angle), np.sin(angle)
    found = {"offset_0": along[0], "offset_1": along[1], "radius": np.ones_like(angle), "scale": np.cos(2 * angle)}
    found["squareness"] = np.sin(2 * angle)
    if both:
        found["servo"] = sense * np.sin(2 * angle)
    displacements = _displacements(circle, angle, undone.positions, sense, undone.turned, values)
    return found | {name: along[axis] * displacement for name, (axis, displacement) in displacements.items()}


def _windows(undone: _Undone, sense: int, window: float) -> tuple[NDArray[np.int64], Array]:
    """Behind which reversal each sample is, -1 where behind none, and the angle since then [rad]."""
    which = np.full(len(undone.angle), -1)
    since = np.full(len(undone.angle), math.inf)
    for k in range(4):
        at = undone.turned[k % 2] + (math.pi if k > 1 else 0.0)
        passed = (sense * (undone.angle - at) + math.pi) % (2 * math.pi) - math.pi
        inside = (passed >= -math.radians(AHEAD)) & (passed < window)
        which[inside], since[inside] = k, passed[inside]
    return which, since


def _usual(angles: Sequence[Array], residuals: Sequence[Array], reversals: Sequence[NDArray[np.int64]]) -> float:
    """Standard deviation of the means over NEXT of what is left between the windows [m]."""
    around = []
    for angle, residual, which in zip(angles, residuals, reversals, strict=True):
        _, block = np.unique(np.floor(angle[which < 0] / math.radians(NEXT)), return_inverse=True)
        around.append(np.bincount(block, residual[which < 0]) / np.bincount(block))
    return float(np.median(np.abs(np.concatenate(around)))) / 0.6745


def _calm(found: Fit) -> bool:
    """Whether the peaks have died away where their windows end, as far as noise and what else is left let one see."""
    width = math.radians(NEXT)
    off = [residual - tail for residual, tail in zip(found.residual, found.tail, strict=True)]
    # What repeats all the way round, a pitch error or form, is no tail of a peak, however much a window leaves out.
    usual = _usual(found.angle, off, found.reversal)
    for angle, residual, which, since in zip(found.angle, off, found.reversal, found.since, strict=True):
        for k in range(4):
            own = which == k
            if not own.any():
                continue
            last = angle[own][np.argmax(since[own])]
            next_ = np.abs((angle - last + math.pi) % (2 * math.pi) - math.pi) < width
            next_ &= which < 0
            if not next_.any():
                continue
            left = abs(float(residual[next_].mean()))
            if left > max(CALM * float(np.abs(residual[own]).max()), 4 * usual):
                return False
    return True
