"""The model of a circle that is not round, and its robust fit.

A machine whose axes answer late, have scales of their own or are not square drives an ellipse about another centre.
With the unit vector u(phi) of the programmed circle, positions about the programmed centre are

    p = c + (1 + S) R u + lost motion + pitch error,   S = [[r + k, q], [q, r - k]],   q = q_0 + s m,

which radially is, to first order, c_1 cos phi + c_2 sin phi + r R + k R cos 2 phi + q R sin 2 phi. s is the sense of
the motion, +1 from the first axis towards the second: what a delay between the axes makes changes sign with it, what
their angle makes does not. Axis i that loses B where it reverses lags by B/2 all the way. The ellipse is undone
exactly, not to first order: 75 um of it on a radius of 15 mm have 0.4 um of second order, as much as is looked for.

What friction makes where an axis reverses is no part of the model. A window behind every reversal is left out, and what
else does not fit counts less (Tukey's biweight).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from feedsim.analysis.figures import Array

# Angle ahead of a reversal and behind it that is left out [deg]; the second grows while the peak has not died away.
AHEAD, BEHIND = 2.0, (30.0, 45.0, 60.0)
# Just behind the window the deviation is calm if it is below this share of the peak, or not larger than noise makes it.
CALM, NEXT = 0.05, 4.0
# Neighbouring samples share what disturbs them. Blocks of this angle [deg] do not, as far as intervals are concerned.
BLOCK = 6.0
BIWEIGHT = 4.685  # 95 % as efficient as least squares where the noise is normal
PASSES = 6
# Travel in pitches from which an error that repeats with the pitch is told from the circle's own shape.
PITCHES = 2.0
# More samples of a turn tell nothing more of its shape.
MOST = 8000
SETTLED = 1e-13  # changes of a term below this [m] are rounding


@dataclass(frozen=True)
class CircleUnderTest:
    """What is known of the circle: axes of its plane (first, second), radius [m], path speed [m/s]; the pitch of an
    axis [m] where an error that repeats with it is looked for; the response of an axis, x_a over x_s, at the circle's
    frequency [1], where its drive is known."""

    axes: tuple[str, str]
    radius: float
    speed: float
    pitch: Mapping[str, float] = field(default_factory=dict)
    gain: Mapping[str, complex] = field(default_factory=dict)


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
        columns: of every path, radial deviation for 1 m of each term, name -> (N,).
        window: how far behind a reversal is left out [rad].
        noise: standard deviation of a sample outside the windows [m].
        left_out: pitch errors that the circle is too small for.
    """

    names: tuple[str, ...]
    values: Array
    covariance: Array
    quantile: float
    angle: tuple[Array, ...]
    residual: tuple[Array, ...]
    reversal: tuple[NDArray[np.int64], ...]
    since: tuple[Array, ...]
    columns: tuple[Mapping[str, Array], ...]
    window: float
    noise: float
    left_out: tuple[str, ...]

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
        return self.quantile * math.sqrt(max(float(along @ self.covariance[np.ix_(rows, rows)] @ along), 0.0))


def enough_pitches(circle: CircleUnderTest, axis: str) -> bool:
    """Whether the circle is large enough to tell an error that repeats with the pitch of ``axis``."""
    return axis in circle.pitch and 2 * circle.radius >= PITCHES * circle.pitch[axis]


def fit(circle: CircleUnderTest, paths: Sequence[TurnedPath]) -> Fit:
    """The model fitted to turns of one sense or of both; windows behind reversals are as wide as their peaks need."""
    for degrees in BEHIND:
        found = _fit(circle, paths, math.radians(degrees))
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


def _fit(circle: CircleUnderTest, paths: Sequence[TurnedPath], window: float) -> Fit:
    both = len({path.sense for path in paths}) == 2
    values: dict[str, float] = {}
    for _ in range(PASSES):
        undone = [_undo(circle, path, values) for path in paths]
        parts = [_columns(circle, each, path.sense, both) for each, path in zip(undone, paths, strict=True)]
        windows = [_windows(each, path.sense, window) for each, path in zip(undone, paths, strict=True)]
        names = tuple(parts[0])
        matrix = np.concatenate([np.column_stack([part[name] for name in names]) for part in parts])
        deviation: Array = np.concatenate([each.deviation for each in undone])
        kept = np.concatenate([which < 0 for which, _ in windows])
        step, weights, slopes, noise = _robust(matrix[kept], deviation[kept])
        values = {name: values.get(name, 0.0) + float(d) for name, d in zip(names, step, strict=True)}
        if float(np.abs(step).max()) < SETTLED:
            break
    residual = deviation - matrix @ step
    blocks = np.concatenate([
        1000 * k + np.floor(each.angle / math.radians(BLOCK)) for k, each in enumerate(undone)
    ])  # fmt: skip
    covariance, quantile = _covariance(matrix[kept], residual[kept], weights, slopes, blocks[kept])
    ends = np.cumsum([len(path.angle) for path in paths])[:-1]
    return Fit(
        names=names,
        values=np.array([values[name] for name in names]),
        covariance=covariance,
        quantile=quantile,
        angle=tuple(each.angle for each in undone),
        residual=tuple(np.split(residual, ends)),
        reversal=tuple(which for which, _ in windows),
        since=tuple(since for _, since in windows),
        columns=tuple(parts),
        window=window,
        noise=noise,
        left_out=tuple(axis for axis in circle.axes if axis in circle.pitch and not enough_pitches(circle, axis)),
    )


def _undo(circle: CircleUnderTest, path: TurnedPath, values: Mapping[str, float]) -> _Undone:
    """The path with what ``values`` say taken off: displacements of the axes first, then the ellipse."""

    def of(name: str) -> float:
        return values.get(name, 0.0)

    r, k = of("radius") / circle.radius, of("scale") / circle.radius
    q = (of("squareness") + path.sense * of("servo")) / circle.radius
    distortion = np.array([[1 + r + k, q], [q, 1 + r - k]])
    # An axis is at its extreme where its row of the distortion points along u.
    turned = (math.atan2(q, 1 + r + k), math.atan2(1 + r - k, q))
    positions = (circle.radius + path.deviation) * np.array([np.cos(path.angle), np.sin(path.angle)])
    p = positions - np.array([[of("offset_0")], [of("offset_1")]])
    angle = np.arctan2(p[1], p[0])
    for name, (axis, displacement) in _displacements(circle, angle, positions, path.sense, turned).items():
        p[axis] -= of(name) * displacement
    plain = np.linalg.solve(distortion, p)
    return _Undone(positions, np.arctan2(plain[1], plain[0]), np.hypot(plain[0], plain[1]) - circle.radius, turned)


def _displacements(
    circle: CircleUnderTest, angle: Array, positions: Array, sense: int, turned: tuple[float, float]
) -> dict[str, tuple[int, Array]]:
    """Terms that displace one axis: its number, and the displacement for 1 m of the term."""
    found = {}
    for i in (0, 1):
        found[f"lost_{i}"] = (i, 0.5 * sense * np.sign(np.sin(angle - turned[i])))
    for i, axis in enumerate(circle.axes):
        if enough_pitches(circle, axis):
            phase = 2 * math.pi / circle.pitch[axis] * positions[i]
            found[f"pitch_{i}_cos"], found[f"pitch_{i}_sin"] = (i, np.cos(phase)), (i, np.sin(phase))
    return found


def _columns(circle: CircleUnderTest, undone: _Undone, sense: int, both: bool) -> dict[str, Array]:
    """Radial deviation for 1 m of every term; ``both`` senses are there to tell a delay from an angle."""
    angle = undone.angle
    along = np.cos(angle), np.sin(angle)
    found = {"offset_0": along[0], "offset_1": along[1], "radius": np.ones_like(angle), "scale": np.cos(2 * angle)}
    found["squareness"] = np.sin(2 * angle)
    if both:
        found["servo"] = sense * np.sin(2 * angle)
    displacements = _displacements(circle, angle, undone.positions, sense, undone.turned)
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


def _robust(matrix: Array, deviation: Array) -> tuple[Array, Array, Array, float]:
    """Values by least squares, each sample weighted by how well it fits.

    Besides: the weights, how fast the influence of a sample grows with its deviation, and the noise of a sample.
    """
    weights = slopes = np.ones(len(deviation))
    for _ in range(PASSES):
        normal = matrix.T @ (weights[:, None] * matrix)
        values = np.linalg.lstsq(normal, matrix.T @ (weights * deviation), rcond=None)[0]
        off = deviation - matrix @ values
        noise = float(np.median(np.abs(off))) / 0.6745
        if noise < SETTLED:
            break
        inner = np.clip(1 - (off / (BIWEIGHT * noise)) ** 2, 0.0, None)
        settled = float(np.abs(inner**2 - weights).max()) < 0.01
        weights, slopes = inner**2, inner * (5 * inner - 4)
        if settled:
            break
    return np.asarray(values), np.asarray(weights), np.asarray(slopes), noise


def _covariance(matrix: Array, residual: Array, weights: Array, slopes: Array, blocks: Array) -> tuple[Array, float]:
    """Covariance of the values and the quantile for intervals of 95 %.

    The larger of two: as if every sample had noise of its own, and as if only blocks of samples had.
    """
    inverse = np.linalg.pinv(matrix.T @ (slopes[:, None] * matrix))
    influence = weights * residual
    _, block = np.unique(blocks, return_inverse=True)
    count, terms = int(block.max()) + 1, matrix.shape[1]
    sums = np.zeros((count, terms))
    np.add.at(sums, block, influence[:, None] * matrix)
    free = max(count - terms, 2)
    single = inverse @ (matrix.T @ ((influence**2)[:, None] * matrix)) @ inverse
    blockwise = inverse @ (sums.T @ sums) @ inverse * (count / free)
    scale = np.sqrt(np.maximum(np.diag(single) / np.maximum(np.diag(blockwise), 1e-300), 1.0))
    return scale[:, None] * blockwise * scale, _student(free)


def _student(free: int) -> float:
    """Quantile 0.975 of Student's distribution of so many degrees of freedom, to 2e-7 of its value.

    Many: M. Abramowitz, I. A. Stegun, Handbook of Mathematical Functions, 1964, 26.7.5. Few: SciPy, whose special
    functions take a fiftieth of a run to load.
    """
    if free < 20:
        from scipy.special import stdtrit

        return float(stdtrit(free, 0.975))
    z = 1.959963984540054  # of the normal distribution
    series = (
        z,
        (z**3 + z) / 4,
        (5 * z**5 + 16 * z**3 + 3 * z) / 96,
        (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384,
        (79 * z**9 + 776 * z**7 + 1482 * z**5 - 1920 * z**3 - 945 * z) / 92160,
    )
    return math.fsum(term / free**k for k, term in enumerate(series))


def _calm(found: Fit) -> bool:
    """Whether the peaks have died away where their windows end, as far as noise and what else is left let one see."""
    width = math.radians(NEXT)
    around = []
    for angle, residual, which in zip(found.angle, found.residual, found.reversal, strict=True):
        _, block = np.unique(np.floor(angle[which < 0] / width), return_inverse=True)
        around.append(np.bincount(block, residual[which < 0]) / np.bincount(block))
    # What repeats all the way round, a pitch error or form, is no tail of a peak, however much a window leaves out.
    usual = float(np.median(np.abs(np.concatenate(around)))) / 0.6745
    for angle, residual, which, since in zip(found.angle, found.residual, found.reversal, found.since, strict=True):
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
