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
taken for lost motion, and where the data do not separate the two, the interval of the lost motion holds both.

On a fast circle a peak takes as long as a quarter turn, and no exponential is its shape. Where the drives are known, so
is that shape: Coulomb friction is a torque that changes sign where an axis reverses, and the position follows it by the
loops' response at the odd harmonics of the turn. It stands in the place of the exponentials, with its first two slopes,
as friction takes some way to turn round, and with the response to what friction rises with the speed. An error that
repeats with the pitch is one of the measured position there: the axis follows it by the response of its position loop.

Lost motion is a step, or play: then an axis stands behind a reversal until the play is used up, along R (1 - cos). That
of both is taken which leaves less there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feedsim.analysis.circle.doubts import MEANS_ANGLE, Tails, fading_tails, known_tails, remaining_after_windows
from feedsim.analysis.circle.geometry import (
    ANGLE_TERMS,
    FEWEST_PITCHES,
    PITCHES,
    PLAY,
    PLAYED,
    CircleUnderTest,
    CorrectedPath,
    TurnedPath,
    columns_of,
    correct_path,
    enough_pitches,
)
from feedsim.analysis.circle.setup import Offset, angle_offset, axle_by_clock, form_waves, set_up_moves
from feedsim.analysis.figures import Array
from feedsim.estimation.least_squares import (
    CHANGE_FLOOR,
    covariance_of,
    pair_quantile,
    robust_fit,
    rounding_columns,
    student,
)

# Angle ahead of a reversal and behind it that is left out [deg]; the second grows while the peak has not died away.
ANGLE_AHEAD, ANGLES_BEHIND = 2.0, (30.0, 45.0, 60.0)
# Just behind the window the deviation is calm if it is below this share of the peak, or not larger than noise makes it.
CALM_SHARE = 0.05
# The same where the angles may be off by as much [deg]: edges are looked for within.
EDGE_SEARCH_ANGLES = 10.0, 40.0
# Of the difference in third order that bent guides show, what their sum may add to the squareness.
THIRD_ORDER_SHARE = 0.45
# Neighbouring samples share what disturbs them. Blocks of this angle [deg] do not, as far as intervals are concerned.
BLOCK_ANGLE = 6.0
# Friction is no clean step: the response to it outside the windows is known to this share.
RESPONSE_TOLERANCE = 0.1
# Before it slides, friction is elastic, and no step at all: of a peak this share may look like lost motion. Between the
# reversals it changes with the speed: of the largest peak this share may look like any term.
# Where nothing is known of the drive, what winds up beside a peak may be this share of it.
WOUND, SPEED_SHARE, UNKNOWN_WOUND = 0.02, 0.005, 0.1
# Time in which a control that nobody knows lets a peak of friction fall to 1/e, or sooner [s].
SETTLES = 0.05
MAX_WINDOW_PASSES = 6
# Left out, they must leave this share of the noise to be taken in after all.
CLEARER = 0.5
# Of errors of fewer than PITCHES only where the model leaves more than this [m].
CLEAR_NOISE = 20e-9
# Neither of two models need be right: a term may be off by so much of their difference, as a standard deviation.
MODEL_DIFFERENCE_FACTOR = 1.5
REPEATS = 2.0  # and pitches that must lie between two windows, where the drives are known
# Other terms than these an arc may not separate from them: what they may make of these is in the intervals, as large as
# they may be (standard deviation) [m].
ESSENTIAL, ARC_SPREAD = ("offset_0", "offset_1", "radius", "scale", "squareness", "servo"), 5e-6
# Of that an arc leaves less where it shows such a term; and what the model leaves of any circle [m].
KNOWN_SHARE, MODEL_ERROR = 0.5, 20e-9
# The angle that is programmed and the one where the machine is differ by more than rounding from this deviation [m] on.
PROGRAMMED_TOLERANCE = 5e-9


@dataclass(frozen=True, eq=False)
class Fit:
    """The fitted model.

    Attributes:
        names: of the terms, as ``columns`` gives them. values: (K,) [m]; covariance: (K, K) [m2].
        quantile: of Student's distribution of ``free`` degrees of freedom, for intervals of 95 %.
        angle: of every path, undistorted (N,) [rad]; residual: (N,) [m]; reversal: within the window of which one a
            sample is, 0 to 3 from the half axis + of the first axis on, -1 in none (N,); since: the angle that the
            motion has turned since that reversal (N,) [rad].
        tail: of every path, the part of the residual that the peaks leave behind their windows (N,) [m].
        columns: of every path, radial deviation for 1 m of each term, name -> (N,).
        window: how far behind a reversal is left out [rad].
        noise: standard deviation of a sample outside the windows [m].
        left_out: pitch errors that the circle is too small for. senses: of the paths.
        wound: lost motion that friction at rest may make by itself, of "lost_0" and "lost_1" [m].
        unsure: what a term may be off by as the loops' response is not known better [m].
        offset: of the written angles; None where they are those of the machine's own scales. whole: no path is an arc.
        tails: of every path, the columns of which ``tail`` is the sum (N, T).
        moved: of recorded turns, what the terms would change by if another window were left out (K,) [m]; else 0.
    """

    names: tuple[str, ...]
    values: Array
    covariance: Array
    quantile: float
    moved: Array
    angle: tuple[Array, ...]
    residual: tuple[Array, ...]
    reversal: tuple[NDArray[np.int64], ...]
    since: tuple[Array, ...]
    tail: tuple[Array, ...]
    columns: tuple[Mapping[str, Array], ...]
    window: float
    noise: float
    left_out: tuple[str, ...]
    senses: tuple[int, ...]
    wound: Mapping[str, float]
    unsure: float = 0.0
    offset: Offset | None = None
    tails: tuple[Array, ...] = ()
    free: int = 2
    whole: bool = True

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
        besides = self.hidden if "squareness" in names else self.wound.get(names[0], 0.0)
        half = math.hypot(own, self.unsure, besides, float(np.linalg.norm(along * self.moved[rows])))
        # Noise alone makes an amplitude: it is one if both parts together differ from zero.
        zero = len(rows) == 2 and length < pair_quantile(self.free) * half / self.quantile
        return max(half, length) if zero else half

    def determined(self, *names: str) -> bool:
        """Whether the paths show a term, or an amplitude with two parts, at all: of arcs some are known beforehand."""
        if self.whole or set(names) <= set(ESSENTIAL):
            return True
        rows = [self.names.index(name) for name in names]
        return float(np.diag(self.covariance)[rows].max()) < (KNOWN_SHARE * ARC_SPREAD) ** 2

    @property
    def hidden(self) -> float:
        """What guides that are bent in third order may add to the squareness [m]; their sum does not show."""
        if "third" not in self.names:
            return 0.0
        row = self.names.index("third")
        size, variance = abs(float(self.values[row])), max(float(self.covariance[row, row]), CHANGE_FLOOR**2)
        return THIRD_ORDER_SHARE * size * size**2 / (size**2 + 4 * variance)


def fit(circle: CircleUnderTest, paths: Sequence[TurnedPath]) -> Fit:
    """The model fitted to turns of one sense or of both; windows behind reversals are as wide as their peaks need.

    A path of angle and radius alone may have the programmed angle in place of the one where the machine was: that of
    both which leaves less is taken.
    """
    if not circle.recorded:
        return _fit_with_lengths(circle, paths, {})
    still = dict.fromkeys(ANGLE_TERMS, (0.0, CHANGE_FLOOR))
    wide = _fit(circle, paths, ExcludedAngles(*np.radians(EDGE_SEARCH_ANGLES)), Shape(known=still))
    lost = [sum(wide[f"lost_{i}"] * columns[f"lost_{i}"] for i in (0, 1)) for columns in wide.columns]
    signals = [residual + step for residual, step in zip(wide.residual, lost, strict=True)]
    axle = axle_by_clock(paths, np.array([wide["offset_0"], wide["offset_1"]]), circle.radius)
    offset = angle_offset(paths, wide.angle, signals, [which < 0 for which in wide.reversal], axle)
    angles = (offset.angle, offset.deviation), *zip(offset.axle, offset.axle_deviation, strict=True)
    lengths = [(circle.radius * value, circle.radius * deviation) for value, deviation in angles]
    return replace(_fit_with_lengths(circle, paths, dict(zip(still, lengths, strict=True))), offset=offset)


def _fit_with_lengths(circle: CircleUnderTest, paths: Sequence[TurnedPath], known: KnownTerms) -> Fit:
    """With what is known of terms beforehand."""
    pitched = _fit_pitch_errors(circle, paths, Shape(known=known))
    moved = sum(math.hypot(pitched[a], pitched[b]) for a, b in (("offset_0", "offset_1"), ("scale", "servo")))
    moved += abs(pitched["squareness"])
    if all(path.phase is not None for path in paths) or moved**2 < circle.radius * PROGRAMMED_TOLERANCE:
        return pitched
    other = _fit_pitch_errors(circle, paths, Shape(by_program=True, known=known))
    return other if other.noise < pitched.noise else pitched


class ExcludedAngles(NamedTuple):
    """Angles ahead of a reversal and behind it that are left out [rad]."""

    ahead: float
    behind: float


# What is known of terms beforehand: name -> value and standard deviation [m].
KnownTerms = Mapping[str, tuple[float, float]]


class Shape(NamedTuple):
    """by_program: the angles are the programmed ones. play: lost motion is used up first. pitches: errors that repeat
    with a pitch are fitted even if they do not repeat between two windows. known: of terms, beforehand."""

    by_program: bool = False
    play: bool = False
    pitches: bool = False
    known: KnownTerms = MappingProxyType({})


def _fit_pitch_errors(circle: CircleUnderTest, paths: Sequence[TurnedPath], shape: Shape) -> Fit:
    """Without errors that hardly repeat between two windows, unless they make all of it much clearer.

    Where they do not, friction's response may look like them, or they like other terms: what they would move these is
    part of the intervals. Of fewer than PITCHES they are no terms, but are kept out of the others.
    """
    shaped = _fit_lost_motion(circle, paths, shape)
    least = PITCHES if shaped.noise < CLEAR_NOISE else FEWEST_PITCHES
    if not any(enough_pitches(circle, axis, least) for axis in shaped.left_out):
        return shaped
    other = _fit_lost_motion(circle, paths, shape._replace(pitches=True))
    if other.noise < CLEARER * shaped.noise:
        return other
    if not any(enough_pitches(circle, axis) for axis in shaped.left_out):
        return shaped
    moved = MODEL_DIFFERENCE_FACTOR * np.array([shaped[name] - other[name] for name in shaped.names])
    return replace(shaped, covariance=shaped.covariance + np.outer(moved, moved))


def _fit_lost_motion(circle: CircleUnderTest, paths: Sequence[TurnedPath], shape: Shape) -> Fit:
    """Lost motion as a step, or as play that is used up first, whichever leaves less behind the reversals."""
    windowed = _fit_windows(circle, paths, shape)
    if max(windowed["lost_0"], windowed["lost_1"]) < PLAY:
        return windowed
    other = _fit_windows(circle, paths, shape._replace(play=True))
    return other if _squares_after_reversals(other) < _squares_after_reversals(windowed) else windowed


def _squares_after_reversals(result: Fit) -> float:
    """What is left behind the reversals, in squares [m2]."""
    return sum(float((off[which >= 0] ** 2).sum()) for off, which in zip(result.residual, result.reversal, strict=True))


def _fit_windows(circle: CircleUnderTest, paths: Sequence[TurnedPath], shape: Shape) -> Fit:
    for degrees in ANGLES_BEHIND:
        result = _fit(circle, paths, ExcludedAngles(math.radians(ANGLE_AHEAD), math.radians(degrees)), shape)
        if _are_peaks_decayed(result):
            break
    if not (circle.recorded and result.whole):
        return result
    # Nobody knows how the peaks of a recorded machine die away.
    beside = ANGLES_BEHIND[2 if degrees == ANGLES_BEHIND[1] else 1]
    other = _fit(circle, paths, ExcludedAngles(math.radians(ANGLE_AHEAD), math.radians(beside)), shape)
    return replace(result, moved=result.values - other.values)


def separating_radius(circle: CircleUnderTest, axes: Sequence[str]) -> float:
    """The smallest radius from which on errors that repeat with the pitches of ``axes`` are separated [m]."""
    pitch = max(circle.pitch[axis] for axis in axes)
    free = math.pi / 2 - math.radians(ANGLES_BEHIND[0] + ANGLE_AHEAD)
    return max(PITCHES / 2, REPEATS / free if circle.drag else 0.0) * pitch


def _fit(circle: CircleUnderTest, paths: Sequence[TurnedPath], out: ExcludedAngles, shape: Shape) -> Fit:
    window = out.behind
    both, whole = len({path.sense for path in paths}) == 2, all(path.whole for path in paths)
    asked = [axis for axis in circle.axes if axis in circle.pitch]
    # Where friction's response reaches far, an error must be seen to repeat between two windows.
    free = math.inf
    if circle.drag and not shape.pitches:
        free = circle.radius * (math.pi / 2 - window - math.radians(ANGLE_AHEAD))
    least = FEWEST_PITCHES if shape.pitches else PITCHES
    circle = replace(
        circle,
        pitch={
            axis: p for axis, p in circle.pitch.items() if REPEATS * p <= free and enough_pitches(circle, axis, least)
        },
    )
    values = {name: value for name, (value, _) in shape.known.items()} | ({PLAYED: 1.0} if shape.play else {})
    moves = set_up_moves(paths) if circle.recorded else [{} for _ in paths]
    ends = np.cumsum([len(path.angle) for path in paths])[:-1]
    tails = Tails(np.empty((sum(len(path.angle) for path in paths), 0)), np.empty(0))
    residual: Array = np.empty(0)
    for number in range(MAX_WINDOW_PASSES):
        undone = [
            correct_path(circle, path, values, shape.by_program, moved)
            for path, moved in zip(paths, moves, strict=True)
        ]
        parts = [columns_of(circle, path, value, both, values) for value, path in zip(undone, paths, strict=True)]
        windows = [_windows(value, path.sense, out) for value, path in zip(undone, paths, strict=True)]
        arc = [name for name in parts[0] if name not in ESSENTIAL and not whole]
        beforehand = dict.fromkeys(arc, (0.0, ARC_SPREAD)) | dict(shape.known)
        names = tuple(sorted(parts[0], key=lambda name: name in beforehand))
        known = np.array([beforehand[name] for name in names if name in beforehand]).reshape(-1, 2)
        matrix = np.concatenate([np.column_stack([part[name] for name in names]) for part in parts])
        deviation: Array = np.concatenate([entry.deviation for entry in undone])
        which, since = (np.concatenate(window) for window in zip(*windows, strict=True))
        kept = which < 0
        if number == 2:  # the ellipse is undone, so that the windows show the peaks alone
            angles, clear = [entry.angle for entry in undone], [reversal < 0 for reversal, _ in windows]
            usual = _deviation_of_means(angles, np.split(residual, ends), [reversal for reversal, _ in windows])
            tails = (
                known_tails(circle, undone, paths, residual, which)
                if all(axis in circle.drag for axis in circle.axes)
                else fading_tails(undone, paths, remaining_after_windows(residual, which, since, window, usual), window)
            )
            if circle.recorded and whole:
                waves = form_waves(angles, [path.sense for path in paths], np.split(residual, ends), clear)
                tails = Tails(np.hstack([tails.columns, waves.columns]), np.concatenate([tails.spread, waves.spread]))
        # Terms that are known are counted in what is known of them: else an angle looks like nothing beside a length.
        unit = np.ones(len(names))
        unit[len(names) - len(known) :] = known[:, 1] / ARC_SPREAD
        fitted = (np.column_stack([unit * matrix, tails.columns]) if len(tails.spread) else unit * matrix)[kept]
        spread = np.concatenate([np.full(len(known), ARC_SPREAD), tails.spread])
        blocks = blocks_of([entry.angle for entry in undone])[kept] if len(spread) else np.empty(0)
        # What is known is known of a term, not of its change.
        past = np.zeros(len(names))
        if len(known):
            past[-len(known) :] = [values.get(name, 0.0) for name in names[-len(known) :]] - known[:, 0]
        aim = deviation + matrix @ past if len(known) else deviation
        robust = robust_fit(fitted, aim[kept], spread, blocks, MODEL_ERROR if len(known) else 0.0)
        step = unit * robust.values[: len(names)] - past
        values |= {name: values.get(name, 0.0) + float(d) for name, d in zip(names, step, strict=True)}
        residual = deviation - matrix @ step
        if number > 1 and float(np.abs(step).max()) < CHANGE_FLOOR:
            break
    tail = tails.columns @ robust.values[len(names) :]
    rounded = rounding_columns([path.deviation for path in paths], np.split(residual - tail, ends), robust.noise)[kept]
    covariance, count = covariance_of(
        fitted,
        (residual - tail)[kept],
        robust,
        spread,
        blocks_of([entry.angle for entry in undone])[kept],
        rounded,
    )
    wound = WOUND if len(circle.drag) == 2 else 0.0
    if circle.recorded:  # nobody knows how a peak dies away: what it leaves behind its window looks like lost motion
        wound = UNKNOWN_WOUND + math.exp(-window * circle.radius / circle.speed / (2 * SETTLES))
    return Fit(
        names=names,
        values=np.array([values[name] for name in names]),
        covariance=unit[:, None] * covariance[: len(names), : len(names)] * unit,
        quantile=student(count),
        moved=np.zeros(len(names)),
        free=count,
        angle=tuple(entry.angle for entry in undone),
        residual=tuple(np.split(residual, ends)),
        reversal=tuple(which for which, _ in windows),
        since=tuple(since for _, since in windows),
        tail=tuple(np.split(tail, ends)),
        columns=tuple(parts),
        window=window,
        noise=robust.noise,
        left_out=tuple(axis for axis in asked if not enough_pitches(circle, axis)),
        senses=tuple(path.sense for path in paths),
        wound={
            f"lost_{i}": wound * float(np.abs(residual[(which >= 0) & (which % 2 == i)]).max(initial=0.0))
            for i in (0, 1)
            if wound
        },
        unsure=_tail_uncertainty(circle, tail[kept], residual[~kept], window),
        tails=tuple(np.split(tails.columns, ends)),
        whole=whole,
    )


def _tail_uncertainty(circle: CircleUnderTest, tail: Array, peaks: Array, window: float) -> float:
    """What a term may be off by, as nobody knows how a peak dies away [m]. tail, peaks: behind the windows, in them."""
    if len(circle.drag) == 2:
        largest = float(np.abs(peaks).max(initial=0.0))
        return math.hypot(RESPONSE_TOLERANCE * float(np.abs(tail).max(initial=0.0)), SPEED_SHARE * largest)
    if not circle.recorded:
        return 0.0
    passed = window * circle.radius / circle.speed
    return float(np.abs(peaks).max(initial=0.0)) * math.exp(-passed / SETTLES)


def blocks_of(angles: Sequence[Array]) -> Array:
    """Which block of BLOCK_ANGLE each sample of all paths is in (N,), by their angles [rad]."""
    return np.concatenate([1000 * k + np.floor(angle / math.radians(BLOCK_ANGLE)) for k, angle in enumerate(angles)])


def _windows(undone: CorrectedPath, sense: int, out: ExcludedAngles) -> tuple[NDArray[np.int64], Array]:
    """Behind which reversal each sample is, -1 where behind none, and the angle since then [rad]."""
    which = np.full(len(undone.angle), -1)
    since = np.full(len(undone.angle), math.inf)
    for k in range(4):
        at = undone.turned[k % 2] + (math.pi if k > 1 else 0.0)
        passed = (sense * (undone.angle - at) + math.pi) % (2 * math.pi) - math.pi
        inside = (passed >= -out.ahead) & (passed < out.behind)
        which[inside], since[inside] = k, passed[inside]
    return which, since


def _deviation_of_means(
    angles: Sequence[Array], residuals: Sequence[Array], reversals: Sequence[NDArray[np.int64]]
) -> float:
    """Standard deviation of the means over NEXT of what is left between the windows [m]."""
    around = []
    for angle, residual, which in zip(angles, residuals, reversals, strict=True):
        _, block = np.unique(np.floor(angle[which < 0] / math.radians(MEANS_ANGLE)), return_inverse=True)
        around.append(np.bincount(block, residual[which < 0]) / np.bincount(block))
    return float(np.median(np.abs(np.concatenate(around)))) / 0.6745


def _are_peaks_decayed(result: Fit) -> bool:
    """Whether the peaks have died away where their windows end, as far as noise and what else is left let one see."""
    width = math.radians(MEANS_ANGLE)
    off = [residual - tail for residual, tail in zip(result.residual, result.tail, strict=True)]
    # What repeats all the way round, a pitch error or form, is no tail of a peak, however much a window leaves out.
    usual = _deviation_of_means(result.angle, off, result.reversal)
    for angle, residual, which, since in zip(result.angle, off, result.reversal, result.since, strict=True):
        for k in range(4):
            own = which == k
            if not own.any():
                continue
            last = angle[own][np.argmax(since[own])]
            next_ = np.abs((angle - last + math.pi) % (2 * math.pi) - math.pi) < width
            next_ &= which < 0
            if not next_.any():
                continue
            remaining = abs(float(residual[next_].mean()))
            if remaining > max(CALM_SHARE * float(np.abs(residual[own]).max()), 4 * usual):
                return False
    return True
