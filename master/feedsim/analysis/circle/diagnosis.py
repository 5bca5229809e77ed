"""A circle taken apart: the terms of the fitted model in their own units, what friction makes where an axis reverses,
vibration, what remains, and the share that each has of G.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from feedsim.analysis.circle.cogging import fit_with_waves, remove_waves
from feedsim.analysis.circle.geometry import ANGLE_TERMS, CircleUnderTest, TurnedPath, enough_pitches
from feedsim.analysis.circle.model import ESSENTIAL, Fit
from feedsim.analysis.circle.setup import Offset
from feedsim.analysis.circularity import fitted_centre
from feedsim.analysis.figures import Array
from feedsim.estimation.least_squares import CHANGE_FLOOR, is_significant

# --- Vibrations on a circle, between the reversals: of every axis whose position is known, else of the radius ---------


AMPLITUDE_FLOOR = 10e-9  # an amplitude of less [m] is not reported: it may be a residual of the model
# Lines of the spectrum that belong to one vibration, and how far their mean stands out of what is around them, and of
# that on either side of them: a spectrum that falls steeply is form. Noise of the radius alone is modulated by the turn
# in the axes, so that its lines are not independent: five times is then reached now and then among some thousand lines.
VIBRATION_LINES, BACKGROUND_LINES, STANDS_OUT = 7, 101, 10.0
FIRST_ORDER = 13  # below it is form
LINE_STEP = 0.05  # of a line: the step in which the frequency is looked for
# about an axis' reversal its friction swings, not the machine
SECTOR_AHEAD, SECTOR_BEHIND = math.radians(5), math.radians(60)


@dataclass(frozen=True)
class Vibration:
    """Frequency at this path speed [Hz] and amplitude [m] of a vibration, with half of its interval [m]; the axis that
    carries it, "" where only the radius is known."""

    frequency: float
    amplitude: float
    half: float
    axis: str = ""


def vibrations(circle: CircleUnderTest, fit: Fit, paths: Sequence[TurnedPath]) -> tuple[Vibration, ...]:
    """The strongest vibration of each axis (of the radius, where the axes' positions are not known) that stands out.

    paths: all their samples, of whose turns ``fit`` is the model. The largest amplitude first.
    """
    best: dict[str, Vibration] = {}
    for k, path in enumerate(paths):
        part = path.covered / (2 * math.pi)  # an arc is taken for a turn: its waves are counted over what it covers
        for axis, angle, off, free in _signals(circle, fit, k, path):
            vibration = _find_strongest_vibration(
                replace(circle, radius=part * circle.radius), axis, angle / part, off, free, fit.quantile
            )
            if vibration is not None and (axis not in best or vibration.amplitude > best[axis].amplitude):
                best[axis] = vibration
    return tuple(sorted(best.values(), key=lambda entry: -entry.amplitude))


Signal = tuple[str, Array, Array, NDArray[np.bool_]]


def _signals(circle: CircleUnderTest, fit: Fit, k: int, path: TurnedPath) -> list[Signal]:
    """Axis, angle by which the motion has turned (N,) [rad], deviation (N,) [m], and what counts of it (N,)."""
    if path.phase is None or not path.whole:
        turned = path.sense * (np.unwrap(fit.angle[k]) - fit.angle[k][0])
        order = np.argsort(turned)
        return [("", turned[order], fit.residual[k][order], (fit.reversal[k] < 0)[order])]
    phase = path.phase[path.phase < 2 * math.pi]
    first = np.column_stack([np.cos(phase), np.sin(phase)])
    signals = []
    for axis, wave in zip(circle.axes, (np.cos, np.sin), strict=True):
        position = ((circle.radius + path.deviation) * wave(path.angle))[: len(phase)]
        a, b = np.linalg.lstsq(first, position - position.mean(), rcond=None)[0]
        # The axis turns round where it is farthest out, at atan2(b, a), and half a turn on.
        free = (phase - math.atan2(b, a) + SECTOR_AHEAD) % math.pi > SECTOR_AHEAD + SECTOR_BEHIND
        matrix = [np.ones(len(phase)), *first.T, np.sign(first @ (b, -a))]
        if enough_pitches(circle, axis):
            along = 2 * math.pi / circle.pitch[axis] * position
            matrix += [np.cos(along), np.sin(along)]
        columns = np.column_stack(matrix)
        values = np.linalg.lstsq(columns[free], position[free], rcond=None)[0]
        signals.append((axis, phase, position - columns @ values, free))
    return signals


def _find_strongest_vibration(
    circle: CircleUnderTest, axis: str, angle: Array, off: Array, free: NDArray[np.bool_], quantile: float
) -> Vibration | None:
    even = np.arange(len(angle)) * (2 * math.pi / len(angle))
    still = np.interp(even, angle, np.where(free, off, 0.0), period=2 * math.pi)
    usable = np.abs(np.fft.rfft(still))[FIRST_ORDER:] ** 2
    if len(usable) < 2 * BACKGROUND_LINES:
        return None
    mean = moving_mean(usable, VIBRATION_LINES)
    beside = np.pad(mean, 2 * VIBRATION_LINES, mode="edge")
    sides = np.maximum(beside[: -4 * VIBRATION_LINES], beside[4 * VIBRATION_LINES :])
    sides[: 2 * VIBRATION_LINES] = np.maximum(
        sides[: 2 * VIBRATION_LINES], mean[2 * VIBRATION_LINES : 4 * VIBRATION_LINES]
    )
    out = (mean > STANDS_OUT * np.maximum(_floor(usable), 1e-300)) & (mean > STANDS_OUT * sides)
    at = int(np.argmax(np.where(out, mean, 0.0)))
    if not out[at]:
        return None
    lines = np.arange(max(at - VIBRATION_LINES // 2, 0), min(at + VIBRATION_LINES // 2 + 1, len(usable)))
    orders = np.arange(lines[0], lines[-1] + LINE_STEP, LINE_STEP) + FIRST_ORDER
    power = [abs(np.exp(-1j * order * angle[free]) @ off[free]) for order in orders]
    order = float(orders[int(np.argmax(power))])
    amplitude, noise = _amplitude(angle[free], off[free], order)
    half = quantile * noise * math.sqrt(2 / max(int(free.sum()), 1))
    frequency = order * circle.speed / (2 * math.pi * circle.radius)
    return Vibration(frequency, amplitude, half, axis) if amplitude > AMPLITUDE_FLOOR else None


def _floor(power: Array) -> Array:
    """Mean power of the lines around each, if they are noise: their median is ln 2 of it."""
    edges = np.arange(0, len(power), BACKGROUND_LINES // 2)
    middle = [
        float(np.median(power[max(edge - BACKGROUND_LINES // 2, 0) : edge + BACKGROUND_LINES // 2 + 1]))
        for edge in edges
    ]
    return np.asarray(np.interp(np.arange(len(power)), edges, middle)) / math.log(2)


def _amplitude(angle: Array, off: Array, order: float) -> tuple[float, float]:
    """Amplitude of the orders about one, which holds what comes and goes: of the mean power; and what else there is."""
    beside = order + np.arange(-(VIBRATION_LINES // 2), VIBRATION_LINES // 2 + 1)
    matrix = np.column_stack([wave(n * angle) for n in beside for wave in (np.cos, np.sin)])
    swings = matrix @ np.linalg.lstsq(matrix, off, rcond=None)[0]
    return math.sqrt(2 * float(np.mean(swings**2))), float(np.std(off - swings))


# --- A circle taken apart: the terms of the fitted model in their own units, what friction makes where an axis
#     reverses,


# A peak is seen where its mean over this angle [deg], or over half of it again and again down to the least count of
# samples, exceeds this multiple of what noise makes of such means and of the fitted rest below them, and that multiple
# of what only this share of such means between the reversals exceed.
PEAK_ANGLE, MIN_PEAK_SAMPLES, PEAK_SIGMAS, OFF_REVERSAL_RATIO, CHANCE_SHARE = 1.0, 3, 5.5, 1.5, 1e-3
# Noise may change a height by this share: over so many samples it is averaged, and no more; nor over more than half of
# the angle in which the peak falls to half its height on its steeper side, which would take from its height.
BLUR = 0.015
ANGLE_SIGMAS = 2.0  # of what written angles may be off by, behind a reversal, within which a step is no peak
DEVIATION_FLOOR = 1e-9  # a deviation of less [m] is not worth a word
FORM = (3, 4, 5)
# Terms of which half an interval is as large as this [m] are not separated from this correlation on.
TRADES, UNSEPARATED = 0.9, 0.5e-6
SECTORS = 36  # of a turn, over whose means turns of one sense are compared


@dataclass(frozen=True)
class Term:
    """One cause.

    Attributes:
        key: "offset", "radius", "scale", "squareness", "servo", "squareness_or_servo", "lost_motion", "peaks", "pitch",
            "cogging" or "rest"; of records besides "straightness" (of second order), "third" (straightness of third
            order, that of the first axis less that of the second), "drift", "centres" and "radii" (of both directions,
            or of two turns in one).
        axis: the one it belongs to; "" where to the pair.
        value: in ``unit`` (SI); scale, servo: what the first axis travels further, answers later than the second;
            radii: what that of counterclockwise turns is larger. NaN where an arc does not determine it.
        half: half of its interval of 95 %; NaN where it has none.
        size: difference of the largest and the smallest radial deviation that it makes alone [m].
        share: of G: what it contributes where the deviation is largest, less where it is smallest, over G [1].
        gain: by how much G falls without it [m]; below 0 where it rises.
        order: of "cogging", waves in a turn of the motor; else 0.
    """

    key: str
    axis: str
    value: float
    half: float
    unit: str
    size: float
    share: float
    gain: float = 0.0
    order: int = 0

    @property
    def shows(self) -> bool:
        """Whether it differs from zero by more than its interval and rounding."""
        size = abs(self.value) if self.key == "radius" else self.size
        return size > DEVIATION_FLOOR and is_significant(self.value, self.half)

    @property
    def determined(self) -> bool:
        """Whether there is a value."""
        return math.isfinite(self.value)


@dataclass(frozen=True)
class Peak:
    """What stands out behind a reversal: name of the half axis ("X+"), the axis that reverses, sense of the turn,
    height over the fitted rest [m] (positive outside) with half of its interval, its angle [rad], its width at half the
    height and the time in which it falls to 1/e of it [s].

    Height 0, width and decay NaN where nothing stands out of the noise; half is then what would have."""

    name: str
    axis: str
    sense: int
    height: float
    half: float
    angle: float
    width: float
    decay: float


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """A circle taken apart.

    Attributes:
        circle, senses: what was tested, and in which senses.
        arc: the angle that arcs cover [rad]; None of full turns.
        G: largest less smallest radial deviation of all turns [m]; of arcs that about the circle that fits them.
        terms: those that are separated from zero first, by how much G falls without them, then by their size.
        peaks: of all reversals, in the order of the turns.
        vibrations: the strongest of each axis that stands out, of the radius where only that is known.
        lag: the part of the mean radius that the loops' response makes [m]; None where the drives are not known.
        unlike: how much further the first axis travels than the second by that response [1]; None as ``lag``.
        form: order -> amplitude of it in what remains [m].
        noise: standard deviation of what remains outside the windows behind the reversals [m].
        centre: fitted, from the programmed one [m].
        left_out: axes for whose pitch the circle is too small.
        apart: how far turns of one sense contradict each other, from peak to valley [m]; 0 where each is the only one.
        angles: by how much the written angles of a record are larger than the machine's; None where it is none.
        hidden: part of the squareness's interval that guides bent in third order make [rad].
        unseparated: of the centre, the radius and the ellipse, the keys of terms that arcs do not separate from others.
        rest: of every turn, what the model says without peaks: angle (N,) [rad], deviation (N,) [m].
    """

    circle: CircleUnderTest
    senses: tuple[int, ...]
    arc: float | None
    G: float
    terms: tuple[Term, ...]
    peaks: tuple[Peak, ...]
    vibrations: tuple[Vibration, ...]
    lag: float | None
    unlike: float | None
    form: dict[int, float]
    noise: float
    left_out: tuple[str, ...]
    centre: tuple[float, float]
    apart: float
    angles: Offset | None
    hidden: float
    unseparated: tuple[str, ...]
    rest: tuple[tuple[Array, Array], ...]

    def __getitem__(self, key: str) -> Term:
        """The term "servo", or "lost_motion X"; KeyError where the turns do not determine it."""
        for term in self.terms:
            if key == f"{term.key} {term.axis}".strip():
                return term
        raise KeyError(key)

    @property
    def vibration(self) -> Vibration | None:
        """The strongest; None where none stands out."""
        return self.vibrations[0] if self.vibrations else None

    def reverses(self, axis: str) -> bool:
        """Whether an axis reverses on the paths."""
        return any(peak.axis == axis for peak in self.peaks)

    @property
    def both(self) -> bool:
        """Whether both senses were driven."""
        return len(set(self.senses)) == 2


def diagnose(circle: CircleUnderTest, paths: Sequence[TurnedPath], *, centred: bool = False) -> Diagnosis:
    """Take turns of one sense or of both apart.

    centred: the centre is that of the measurement's set-up and no error of the machine; G is then about the fitted one.
    """
    whole, paths = paths, [path.thinned() for path in paths]
    fit, waves = fit_with_waves(circle, paths)
    circle = replace(circle, response=None)  # a result is data
    curves = _curves(fit, paths, circle)
    total = [path.deviation for path in paths]
    for wave in waves:
        curves[f"cogging {wave.axis} {wave.order}"] = [wave.curve(circle, path.angle, path.sense) for path in paths]
    orders = {f"cogging {wave.axis} {wave.order}": wave for wave in waves}
    whole, paths = remove_waves(circle, whole, waves), remove_waves(circle, paths, waves)
    if centred:
        offset = curves.pop("offset ")
        total = [e - part for e, part in zip(total, offset, strict=True)]
    e = np.concatenate(total)
    parts = {key: np.concatenate(part) for key, part in curves.items()}
    peaks = tuple(peak for k, path in enumerate(paths) for peak in _peaks(circle, fit, k, path))
    arc = None if all(path.whole for path in paths) else min(path.covered for path in paths)
    terms = []
    if arc is not None:
        e, parts = _about_their_circle(np.concatenate([path.angle for path in paths]), e, parts)
        for name in list(parts):
            key, _, axis = name.partition(" ")
            value, half, unit = _value(circle, fit, peaks, key, axis)
            if math.isnan(value):
                terms.append(Term(key, axis, value, half, unit, 0.0, 0.0))
                del parts[name]
    parts["rest "] = e - sum(parts.values())
    G, high, low = float(np.ptp(e)), int(e.argmax()), int(e.argmin())
    for name, part in parts.items():
        key, _, axis = name.partition(" ")
        order = 0
        if name in orders:
            axis, order = orders[name].axis, orders[name].order
            value, half, unit = orders[name].amplitude, orders[name].half, "N.m"
        else:
            value, half, unit = _value(circle, fit, peaks, key, axis)
        if key == "rest":
            value = float(np.ptp(part))
        share = float(part[high] - part[low]) / G if G > 0 else 0.0
        gain = G - float(np.ptp(e - part))
        terms.append(Term(key, axis, value, half, unit, float(np.ptp(part)), share, gain, order))
    if centred:
        value, half, unit = _value(circle, fit, peaks, "offset", "")
        terms.append(Term("offset", "", value, half, unit, 2 * value, 0.0))
    return Diagnosis(
        circle=circle,
        senses=tuple(path.sense for path in paths),
        arc=arc,
        G=G,
        terms=tuple(
            sorted(
                terms,
                key=lambda term: (
                    not term.shows or term.key == "rest",
                    -round(term.gain / DEVIATION_FLOOR),
                    -term.size,
                ),
            )
        ),
        peaks=peaks,
        vibrations=vibrations(circle, fit, whole),
        lag=_lag(circle),
        unlike=_gain_difference(circle),
        form=_form(fit),
        noise=fit.noise,
        left_out=fit.left_out,
        centre=(fit["offset_0"], fit["offset_1"]) if arc is None else _centre(circle, paths),
        apart=_difference_of_turns(paths),
        angles=fit.offset,
        hidden=2 / circle.radius * fit.hidden,
        unseparated=() if arc is None else _find_unseparated_terms(fit),
        rest=tuple((path.angle, path.deviation - residual) for path, residual in zip(paths, fit.residual, strict=True)),
    )


def _about_their_circle(angle: Array, e: Array, parts: Mapping[str, Array]) -> tuple[Array, dict[str, Array]]:
    """Deviations of arcs, and what each term makes of them (N,) [m], about the circle that fits them.

    An arc shows centre and radius badly, and terms that cancel one another in them would all look large.
    """
    circle = np.linalg.qr(np.column_stack([np.ones(len(angle)), np.cos(angle), np.sin(angle)]))[0]
    about, *shapes = (values - circle @ (circle.T @ values) for values in (e, *parts.values()))
    return about, dict(zip(parts, shapes, strict=True))


def _centre(circle: CircleUnderTest, paths: Sequence[TurnedPath]) -> tuple[float, float]:
    """Of the circle that fits arcs, from the programmed one [m]."""
    angle, deviation = (np.concatenate(values) for values in zip(*((p.angle, p.deviation) for p in paths), strict=True))
    x, y = fitted_centre(angle, deviation, circle.radius).tolist()
    return x, y


def _lag(circle: CircleUnderTest) -> float | None:
    """Of the mean response of both axes: what one makes more is scale; lagging more, it makes the ellipse slimmer."""
    if any(axis not in circle.gain for axis in circle.axes):
        return None
    return circle.radius * (abs(sum(circle.gain[axis] for axis in circle.axes)) / 2 - 1)


def _gain_difference(circle: CircleUnderTest) -> float | None:
    """Compliance behind a motor encoder makes an axis travel further; without feedforward the slower one falls back."""
    if any(axis not in circle.gain for axis in circle.axes):
        return None
    return float(abs(circle.gain[circle.axes[0]]) - abs(circle.gain[circle.axes[1]]))


def _curves(fit: Fit, paths: Sequence[TurnedPath], circle: CircleUnderTest) -> dict[str, list[Array]]:
    """ "term axis" -> radial deviation that it makes, of every path."""
    curves: dict[str, list[Array]] = {}
    of = dict(zip(fit.names, fit.values, strict=True))
    for k in range(len(paths)):
        made = {name: of[name] * column for name, column in fit.columns[k].items()}
        named = {
            "offset ": made["offset_0"] + made["offset_1"],
            "radius ": made["radius"],
            "scale ": made["scale"],
            ("squareness " if "servo" in made else "squareness_or_servo "): made["squareness"],
        }
        if "servo" in made:
            named["servo "] = made["servo"]
        for i, axis in enumerate(circle.axes):
            named[f"lost_motion {axis}"] = made[f"lost_{i}"]
            if f"pitch_{i}_cos" in made and axis not in fit.left_out:
                named[f"pitch {axis}"] = made[f"pitch_{i}_cos"] + made[f"pitch_{i}_sin"]
            own = (fit.reversal[k] >= 0) & (fit.reversal[k] % 2 == i)
            named[f"peaks {axis}"] = np.where(own, fit.residual[k], 0.0)
        if circle.recorded:
            named |= _set_up(circle, made)
        for name, curve in named.items():
            curves.setdefault(name, []).append(curve)
    return curves


def _set_up(circle: CircleUnderTest, made: Mapping[str, Array]) -> dict[str, Array]:
    """What only records have: bent guides, and a centre that moves."""
    named = {f"straightness {axis}": made[f"bend_{i}"] for i, axis in enumerate(circle.axes)}
    named |= {"third ": made["third"], "drift ": made["drift_0"] + made["drift_1"]}
    for key, stem in (("centres ", "centre_"), ("radii ", "radius_")):
        if several := [curve for name, curve in made.items() if name.startswith(stem)]:
            named[key] = np.sum(several, axis=0)
    return named


def _opposite_path(fit: Fit) -> int:
    """Number of the first path in the other direction than the first path; 1 where there is none."""
    return next((k for k, sense in enumerate(fit.senses) if sense != fit.senses[0]), 1)


def _value(circle: CircleUnderTest, fit: Fit, peaks: Sequence[Peak], key: str, axis: str) -> tuple[float, float, str]:
    """Value of a term, half of its interval, and their unit."""
    number = circle.axes.index(axis) if axis else 0
    if key == "peaks":
        own = max((peak for peak in peaks if peak.axis == axis), key=lambda peak: abs(peak.height), default=None)
        return (own.height, own.half, "m") if own else (math.nan, math.nan, "m")
    if key == "rest":
        return math.nan, math.nan, "m"
    names, factor, unit = {
        "offset": (("offset_0", "offset_1"), 1.0, "m"),
        "radius": (("radius",), 1.0, "m"),
        "scale": (("scale",), 2 / circle.radius, "1"),
        "squareness": (("squareness",), 2 / circle.radius, "rad"),
        "squareness_or_servo": (("squareness",), 1.0, "m"),
        "servo": (("servo",), 2 / circle.speed, "s"),
        "lost_motion": ((f"lost_{number}",), 1.0, "m"),
        "pitch": ((f"pitch_{number}_cos", f"pitch_{number}_sin"), 1.0, "m"),
        "straightness": ((f"bend_{number}",), 1.0, "m"),
        "third": (("third",), 1.0, "m"),
        "drift": (("drift_0", "drift_1"), 1.0, "m"),
        "centres": ((f"centre_{_opposite_path(fit)}_0", f"centre_{_opposite_path(fit)}_1"), 1.0, "m"),
        "radii": ((f"radius_{_opposite_path(fit)}",), -float(fit.senses[0]), "m"),
    }[key]
    if not fit.determined(*names):
        return math.nan, math.nan, unit
    value = math.hypot(fit[names[0]], fit[names[1]]) if len(names) == 2 else fit[names[0]]
    return factor * value, abs(factor) * fit.half(*names), unit


def _peaks(circle: CircleUnderTest, fit: Fit, k: int, path: TurnedPath) -> list[Peak]:
    """What stands out behind every reversal of path ``k``."""
    sense, per_sample = path.sense, path.covered / len(fit.angle[k])
    calm = _CalmMeans(fit, k, sense, max(1, round(math.radians(PEAK_ANGLE) / per_sample)))
    ellipse = math.hypot(fit["scale"], fit["squareness"] + sense * fit["servo"]) / circle.radius
    peaks = []
    for which in range(4):
        axis = circle.axes[which % 2]
        name = f"{axis}{'+' if which < 2 else '-'}"
        nothing = Peak(name, axis, sense, 0.0, math.nan, which * math.pi / 2, math.nan, math.nan)
        own = np.flatnonzero(fit.reversal[k] == which)
        own = own[np.argsort(fit.since[k][own])]
        if not path.whole and not (len(own) and fit.since[k][own[0]] < 0):  # an arc on which the axis does not reverse
            continue
        # Between two samples nobody knows on which side of a step of lost motion one is; nor within the angle from the
        # point that is given to the one that an ellipse makes of it, as instruments write the one or the other.
        near = 1.5 * per_sample + ellipse
        peak = _peak(circle, fit, k, nothing, own[np.abs(fit.since[k][own]) > near], calm)
        if fit.offset is not None and peak.height:
            # Nor within what written angles may be off by: there a step looks like a peak of either sign.
            near += ANGLE_SIGMAS * fit.offset.at_reversals[which]
            off = _peak(circle, fit, k, nothing, own[np.abs(fit.since[k][own]) > near], calm).height
            peak = replace(peak, half=max(peak.half, abs(peak.height - off)))
            if off * peak.height <= 0:
                peak = replace(nothing, half=peak.half)
        peaks.append(peak)
    return peaks


def _peak(circle: CircleUnderTest, fit: Fit, k: int, nothing: Peak, own: NDArray[np.intp], calm: _CalmMeans) -> Peak:
    """What stands out in the samples ``own`` of path ``k``, in their order; nothing: where that is none."""
    if len(own) < 5 * calm.wide:
        return nothing
    since, off = fit.since[k][own], fit.residual[k][own]
    clear, count = _find_clearest_mean(off, calm.levels)
    if clear < 1:
        return replace(nothing, half=calm.levels[calm.wide])
    curve, at, count = _sharpen_means(off, count, fit.noise)
    height = float(curve[at])
    # What averaging over as much again takes from it is not less than what averaging has taken already.
    blur = float(moving_mean(off, 2 * count)[at]) - height if count > 1 else 0.0
    relative, rate = curve / height, circle.speed / circle.radius
    begin, end = _fall_angle(since, relative, at, 0.5, -1), _fall_angle(since, relative, at, 0.5, 1)
    return replace(
        nothing,
        height=height,
        half=math.hypot(fit.quantile * calm.spread(count), blur),
        angle=float(fit.angle[k][own[at]]) + (fit.offset.angle if fit.offset else 0.0),
        width=float(end - begin) / rate,
        decay=float(_fall_angle(since, relative, at, 1 / math.e, 1) - since[at]) / rate,
    )


def _find_clearest_mean(off: Array, levels: Mapping[int, float]) -> tuple[float, int]:
    """How far means stand out, as a multiple of their level, and over how many samples they do so most.

    A narrow peak stands out most where as much is averaged as it is wide. levels: number of samples -> level [m].
    """
    clear = []
    for count, level in levels.items():
        curve, at = _find_largest_mean(off, count)
        clear.append((abs(float(curve[at])) / level, count))
    return max(clear)


def _sharpen_means(off: Array, count: int, noise: float) -> tuple[Array, int, int]:
    """Means over ``count`` samples, or over as few as noise allows and the steeper side of the peak needs; number of
    the largest, and over how many samples they are.

    Averaging makes a narrow peak look wide: as often as fewer samples show it narrower, fewer are taken.
    """
    while True:
        curve, at = _find_largest_mean(off, count)
        relative = np.abs(curve) / abs(curve[at])
        below = [np.flatnonzero(side < 0.5) for side in (relative[at:], relative[at::-1])]
        steeper = min((int(side[0]) for side in below if len(side)), default=2 * count)
        enough = max(1, min(count, math.ceil((noise / (BLUR * abs(curve[at]))) ** 2), steeper // 2))
        if enough == count:
            return curve, at, count
        count = enough


def _find_largest_mean(off: Array, count: int) -> tuple[Array, int]:
    """Means over ``count`` samples and the number of the largest; not of one at an end, which fewer samples make."""
    curve, end = moving_mean(off, count), count // 2
    return curve, end + int(np.abs(curve[end : len(curve) - end]).argmax())


class _CalmMeans:
    """Means of neighbouring samples of path ``k`` where no axis reverses: what those behind a reversal compare with.

    wide: over how many samples at most. levels: number of samples -> what such a mean must exceed to be a peak [m].
    """

    def __init__(self, fit: Fit, k: int, sense: int, wide: int) -> None:
        order = np.argsort(sense * fit.angle[k])
        self._off, self._free = fit.residual[k][order], (fit.reversal[k] < 0)[order]
        self._noise, self._rest = fit.noise, fit.rest_error
        self.wide, counts = wide, [wide]
        while counts[-1] // 2 >= MIN_PEAK_SAMPLES:
            counts.append(counts[-1] // 2)
        self.levels = {count: self._level(count) for count in counts}

    def spread(self, count: int) -> float:
        """Standard deviation of a mean over ``count`` samples behind a reversal [m]."""
        scatter = float(np.sqrt(np.mean(self._means(count) ** 2)))
        return math.hypot(max(self._noise / math.sqrt(count), scatter), self._rest)

    def _level(self, count: int) -> float:
        """What such a mean must exceed to be a peak [m]; noise does not, nor what swings all the way round."""
        usual = float(np.quantile(np.abs(self._means(count)), 1 - CHANCE_SHARE))
        return max(
            PEAK_SIGMAS * math.hypot(self._noise / math.sqrt(count), self._rest),
            OFF_REVERSAL_RATIO * usual,
            DEVIATION_FLOOR,
        )

    def _means(self, count: int) -> Array:
        whole = np.convolve(self._free, np.ones(count), "same") > count - 0.5
        return moving_mean(self._off, count)[whole if whole.any() else self._free]


def _fall_angle(since: Array, relative: Array, at: int, level: float, way: int) -> float:
    """Angle at which a peak falls to ``level`` of its height, on one side (``way`` +-1) of its top ``at``; NaN: never.

    Interpolated between two samples.
    """
    side = np.arange(at, len(since) if way > 0 else -1, way)
    below = np.flatnonzero(relative[side] < level)
    if len(below) == 0:
        return math.nan
    out, before = side[below[0]], side[below[0] - 1]
    share = (relative[before] - level) / (relative[before] - relative[out])
    return float(since[before] + share * (since[out] - since[before]))


def _difference_of_turns(paths: Sequence[TurnedPath]) -> float:
    """Difference of turns of one sense, from peak to valley of its means over SECTORS of a turn; the largest [m].

    Without its mean and its first order: the centre and the radius may drift from one turn to the next.
    """
    worst = 0.0
    middle = (np.arange(SECTORS) + 0.5) * (2 * math.pi / SECTORS) - math.pi
    circle = np.column_stack([np.ones(SECTORS), np.cos(middle), np.sin(middle)])
    for one, other in combinations(paths, 2):
        apart = _coarse(one) - _coarse(other)
        of_both = np.isfinite(apart)
        if one.sense == other.sense and of_both.sum() > circle.shape[1]:
            apart, columns = apart[of_both], circle[of_both]
            worst = max(worst, float(np.ptp(apart - columns @ np.linalg.lstsq(columns, apart, rcond=None)[0])))
    return worst


def _coarse(path: TurnedPath) -> Array:
    """Mean deviation in each of SECTORS of a turn (SECTORS,) [m]; NaN where there is no sample."""
    part = np.floor((path.angle / (2 * math.pi) + 0.5) * SECTORS).astype(int) % SECTORS
    count = np.bincount(part, minlength=SECTORS)
    return np.where(count > 0, np.bincount(part, path.deviation, SECTORS) / np.maximum(count, 1), math.nan)


def _find_unseparated_terms(fit: Fit) -> tuple[str, ...]:
    """Keys of terms that trade with others: what the arcs leave of their correlations."""
    spread = np.sqrt(np.maximum(np.diag(fit.covariance), CHANGE_FLOOR**2))
    correlation = np.abs(fit.covariance / np.outer(spread, spread)) - np.eye(len(spread))
    keys = {"offset_0": "offset", "offset_1": "offset"}
    if "servo" not in fit.names:
        keys["squareness"] = "squareness_or_servo"
    lengths = [name not in ANGLE_TERMS for name in fit.names]
    rows = [
        row
        for row, name in enumerate(fit.names)
        if name in ESSENTIAL and correlation[row, lengths].max() > TRADES and fit.half(name) > UNSEPARATED
    ]
    return tuple(dict.fromkeys(keys.get(fit.names[row], fit.names[row]) for row in rows))


def _form(fit: Fit) -> dict[int, float]:
    """Amplitude of the orders of FORM in what remains outside the windows [m]; none of arcs, which mix them."""
    if not fit.whole:
        return {}
    free: list[NDArray[np.bool_]] = [which < 0 for which in fit.reversal]
    angle = np.concatenate([a[keep] for a, keep in zip(fit.angle, free, strict=True)])
    off = np.concatenate([r[keep] for r, keep in zip(fit.residual, free, strict=True)])
    matrix = np.column_stack([wave(n * angle) for n in FORM for wave in (np.cos, np.sin)])
    values = np.linalg.lstsq(matrix, off, rcond=None)[0]
    return {n: float(np.hypot(*values[2 * i : 2 * i + 2])) for i, n in enumerate(FORM)}


def moving_mean(values: Array, count: int) -> Array:
    """Mean over ``count`` neighbours; fewer at the ends."""
    ones = np.ones(min(count, len(values)))
    return np.asarray(np.convolve(values, ones, "same") / np.convolve(np.ones(len(values)), ones, "same"))
