"""What is the matter with a recorded circle before anything is diagnosed in it: a wrong unit, radius or feed, samples
that are missing, stand out alone, or come from a scale that is too coarse or at its end.

A radius or feed that contradicts the record is refused; the rest is said, as somebody at the machine knows best.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feedsim.analysis.circle.geometry import CircleUnderTest, CorrectedPath, TurnedPath
from feedsim.analysis.figures import Array
from feedsim.foundation.errors import Finding, InputError

# Of a radius and of a feed that are given, the share by which the record may differ: path lag changes the former.
OFF_RADIUS, OFF_FEED = 0.2, 0.05
RATIO_TOLERANCE = 0.02  # relative; a ratio that is so near to one of these is called so
RATIOS = {
    2.0: "the diameter?", 25.4: "inches, under a header of mm?", 1000.0: "another unit of length?",
    10.0: "centimetres?", 60.0: "per minute for per second?", 0.06: "m/min for mm/s?",
}  # fmt: skip
# A radius is below a millimetre, or above metres, where metres and millimetres were mistaken for one another; a feed of
# millimetres per minute, or of thousands of metres, where seconds and milliseconds were [m], [m/s].
LEAST_RADIUS, MOST_RADIUS = 1e-3, 5.0
LEAST_FEED, MOST_FEED, USUAL_FEEDS = 10e-3 / 60, 1000.0 / 60, (50e-3 / 60, 200.0 / 60)
RADIUS_STEP, IN_INCHES, ROUND_TOLERANCE = 0.5e-3, 5e-3, 5e-4  # a radius in mm is a multiple of these [m], to this share
# Samples are missing where the angle goes on by so many usual steps, and by so much [rad].
GAP_STEPS, GAP_ANGLE = 5.0, math.radians(2)
# A step of the positions that is this share of the range of the deviation hides what there is to see.
COARSE_STEP_SHARE = 0.2
# A scale is at its end where it says the same in so many samples, and the circle would move by so many of its steps.
STILL, MOVED = 5, 3.0
# A sample stands out alone where it is off the median of so many neighbours by so many times their scatter, and by so
# much of the range of all others: more where an axis reverses, as peaks of friction are narrow.
OUTLIER_NEIGHBOURS, OUTLIER_SCATTER, OF_RANGE, OF_RANGE_AT_REVERSAL, REVERSAL = 3, 8.0, 0.3, 2.0, math.radians(6)
ROUNDING_STEP = 1e-12  # [m]; below it a step is rounding


@dataclass(frozen=True, eq=False)
class CheckedTurn:
    """keep: rows of a turn that are no spikes (N,) bool. doubts: findings about it."""

    keep: NDArray[np.bool_]
    doubts: tuple[Finding, ...]


def check_radius(where: str, given: float | None, own: float) -> None:
    """Refuse a radius that is not the record's. given: as programmed, None where nobody says; own: of the turns [m]."""
    if given is None or abs(own / given - 1) <= OFF_RADIUS:
        return
    raise InputError(
        f"{where}: the turns have a radius of {own * 1e3:.6g} mm, given is {given * 1e3:.6g} mm"
        f"{_ratio(own / given)}; allowed: 20 % apart. Give the radius that was programmed, in the unit of the record"
    )


def check_feed(where: str, given: float | None, own: float | None) -> None:
    """Refuse a feed that is not the record's. own: of its radius and its time [m/s], None where it has no time."""
    if given is None or own is None or abs(own / given - 1) <= OFF_FEED:
        return
    raise InputError(
        f"{where}: the turns were driven at {own * 6e4:.5g} mm/min, by their radius and their time; given is "
        f"{given * 6e4:.5g} mm/min{_ratio(own / given)}; allowed: {100 * OFF_FEED:g} % apart. Leave --feed out, or "
        "give the feed that was driven, override included"
    )


def _ratio(ratio: float) -> str:
    for value, words in RATIOS.items():
        if min(abs(ratio / value - 1), abs(ratio * value - 1)) < RATIO_TOLERANCE:
            return f": {words}"
    larger = max(ratio, 1 / ratio)
    return f", {larger:.3g} times {'less' if ratio > 1 else 'as much'}"


def unusual_radius(radius: float) -> list[Finding]:
    """That a radius [m] which nobody has given would be usual if the record were in inches, metres or mm."""

    def multiple(value: float, of: float) -> bool:
        return value >= of and abs(value / of - round(value / of)) * of < ROUND_TOLERANCE * value

    if multiple(25.4 * radius, IN_INCHES) and not multiple(radius, RADIUS_STEP) and radius < 0.02:
        return [_unusual_radius(radius, "inches", radius * 25.4e3)]
    for factor, unit in ((1e3, "m"), (1e-3, "mm")):
        if not LEAST_RADIUS <= radius <= MOST_RADIUS and LEAST_RADIUS <= factor * radius <= MOST_RADIUS:
            return [_unusual_radius(radius, unit, factor * radius * 1e3)]
    return []


def _unusual_radius(radius: float, unit: str, other: float) -> Finding:
    """radius [m]; other: in `unit` [mm]."""
    remedy = "look at the unit in its header, or give --radius"
    text = f"the radius is {radius * 1e3:.5g} mm; were the record in {unit}, it would be {other:.5g} mm: {remedy}"
    return Finding("radius-unusual", "doubt", text, "", remedy)


def unusual_feed(feed: float) -> list[Finding]:
    """That a feed [m/s] by radius and time would be a usual one if the time were in milliseconds, or in seconds."""
    for factor, unit in ((1e3, "ms"), (1e-3, "s")):
        if not LEAST_FEED <= feed <= MOST_FEED and USUAL_FEEDS[0] <= factor * feed <= USUAL_FEEDS[1]:
            remedy = "look at the unit of the time in the header, or give --feed"
            return [Finding(
                "feed-unusual", "doubt",
                f"the feed is {feed * 6e4:.5g} mm/min, by radius and time; were the time in {unit}, it would be "
                f"{factor * feed * 6e4:.5g} mm/min: {remedy}",
                "", remedy,
            )]  # fmt: skip
    return []


def check_turn(angle: Array, deviation: Array, radius: float, by_axes: bool, axes: tuple[str, str]) -> CheckedTurn:
    """A turn, (N,) angles as they follow [rad] and deviations from `radius` [m]; by_axes: from positions of `axes`."""
    turned = np.unwrap(angle)
    keep = ~_find_outliers(turned, deviation)
    doubts = list(_report_spikes(turned, deviation, keep)) + list(_report_gaps(turned[keep]))
    angles, rest = turned[keep], deviation[keep]
    if by_axes:
        columns = {axes[0]: (radius + rest) * np.cos(angles), axes[1]: (radius + rest) * np.sin(angles)}
        steps = {axis: _step(values) for axis, values in columns.items()}
        for (axis, values), other in zip(columns.items(), reversed(columns.values()), strict=True):
            doubts += _clipped_position(axis, values, other, radius, steps[axis])
    else:
        steps = {"the deviation": _step(rest)}
        doubts += _clipped_deviation(rest)
    span = float(np.ptp(rest))
    for what, step in steps.items():
        if step > COARSE_STEP_SHARE * span > 0:
            doubts.append(Finding(
                "resolution-coarse", "doubt",
                f"{what} has steps of {step * 1e6:.4g} um, the radial deviation ranges over {span * 1e6:.4g} um: "
                "nothing smaller than a step can be diagnosed",
            ))  # fmt: skip
    return CheckedTurn(keep, tuple(doubts))


def _find_outliers(turned: Array, deviation: Array) -> NDArray[np.bool_]:
    """Rows that stand out alone, one or two beside each other."""
    padded = np.pad(deviation, OUTLIER_NEIGHBOURS, mode="edge")
    median = np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * OUTLIER_NEIGHBOURS + 1), axis=1)
    off = np.abs(deviation - median)
    scatter = 1.4826 * float(np.median(off))
    ordered = np.sort(deviation)
    span = float(min(ordered[-3] - ordered[0], ordered[-1] - ordered[2], ordered[-2] - ordered[1]))
    to_reversal = np.abs((turned + math.pi / 4) % (math.pi / 2) - math.pi / 4)
    share = np.where(to_reversal < REVERSAL, OF_RANGE_AT_REVERSAL, OF_RANGE)
    values = (off > OUTLIER_SCATTER * scatter) & (off > share * span) & (off > ROUNDING_STEP)
    # Three beside each other are a motion.
    three = values & np.r_[False, values[:-1]] & np.r_[values[1:], False]
    wide = three | np.r_[False, three[:-1]] | np.r_[three[1:], False]
    alone: NDArray[np.bool_] = values & ~wide
    return alone


def _report_spikes(turned: Array, deviation: Array, keep: NDArray[np.bool_]) -> Iterator[Finding]:
    rows = np.flatnonzero(~keep)
    if rows.size:
        worst = int(rows[np.argmax(np.abs(deviation[rows] - np.median(deviation)))])
        near = float(np.median(deviation[max(0, worst - OUTLIER_NEIGHBOURS) : worst + OUTLIER_NEIGHBOURS + 1]))
        several = f"{len(rows)} samples stand" if len(rows) > 1 else "one sample stands"
        yield Finding(
            "samples-stand-out", "doubt",
            f"{several} out alone, at {_degrees(turned[worst])} deg by {(deviation[worst] - near) * 1e6:.4g} um: a "
            "fault of the measurement; left out",
        )  # fmt: skip


def _report_gaps(turned: Array) -> Iterator[Finding]:
    steps = np.abs(np.diff(turned))
    usual = float(np.median(steps))
    for row in np.flatnonzero((steps > GAP_STEPS * usual) & (steps > GAP_ANGLE)):
        yield Finding(
            "rows-missing", "doubt",
            f"samples are missing from {_degrees(turned[row])} to {_degrees(turned[row + 1])} deg: what happens there "
            "is not seen, and G may be larger",
        )  # fmt: skip


def _step(values: Array) -> float:
    """The step that all values are multiples of, 0 where there is none."""
    steps = np.diff(np.unique(values))
    steps = steps[steps > ROUNDING_STEP]
    if not steps.size:
        return 0.0
    step = float(steps.min())
    counts = steps / step
    return step if float(np.abs(counts - np.round(counts)).max()) < 0.05 and len(steps) < 0.9 * len(values) else 0.0


def longest_run(same: NDArray[np.bool_]) -> tuple[int, int]:
    """First row and length of the longest run of true."""
    edges = np.flatnonzero(np.diff(np.r_[False, same, False].astype(int)))
    if not edges.size:
        return 0, 0
    lengths = edges[1::2] - edges[::2]
    k = int(np.argmax(lengths))
    return int(edges[2 * k]), int(lengths[k])


def _clipped_position(axis: str, values: Array, other: Array, radius: float, step: float) -> Iterator[Finding]:
    for end, word in ((float(values.max()), "largest"), (float(values.min()), "smallest")):
        first, length = longest_run(np.abs(values - end) <= ROUNDING_STEP)
        rows = slice(first, first + length)
        moves = np.sqrt(np.maximum(radius**2 - other[rows] ** 2, 0.0))
        if length >= STILL and (gone := float(np.ptp(moves))) > max(MOVED * step, 1e-6):
            yield Finding(
                "record-clipped", "doubt",
                f"{axis} stands at its {word} value for {length} samples, where the circle moves it by "
                f"{gone * 1e6:.4g} um: the scale, or the range of the file, is at its end",
            )  # fmt: skip


def _clipped_deviation(values: Array) -> Iterator[Finding]:
    for end, word, inner in ((float(values.max()), "largest", -1), (float(values.min()), "smallest", 1)):
        same = np.abs(values - end) <= ROUNDING_STEP
        _, length = longest_run(same)
        levels, counts = np.unique(values, return_counts=True)
        beside = counts[-6:-1] if inner < 0 else counts[1:6]
        if length >= STILL and len(levels) > 2 * STILL and same.sum() > 5 * np.median(beside):
            yield Finding(
                "record-clipped", "doubt",
                f"the deviation stands at its {word} value of {end * 1e6:.4g} um for {length} samples: the instrument, "
                "or the range of the file, is at its end",
            )  # fmt: skip


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle) % 360:.4g}"


# --- What friction leaves of a reversal peak behind its window, as columns of a fit -----------------------------------
# An exponential, where the window shows one; or, where the drives are known, the loops' own response to friction. Start
# reading at fading_tails() and known_tails().


MEANS_ANGLE = 4.0  # angle of the means [deg] between the windows
# What a peak leaves at the end of its window may be off by this multiple of what the window shows; less than the floor
# [m] is not looked at. Angles in which it may fall to 1/e [deg].
TAIL, TAIL_FLOOR = 2.0, 10e-9
DECAY_ANGLES = (2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 12.0, 14.0, 16.0, 18.0, 21.0, 25.0, 30.0)
HALF_HEIGHT_ANGLE = 2.0  # angle of the means [deg] that say where a peak has fallen to half its height
# Of known responses: the angle in which friction turns round [deg]; points of a turn.
TURNS, PERIOD = 10.0, 2048
# Friction rises with the logarithm of 1 + v/RISE_SPEED [m/s] of the slide, by this share of its size at rest for every
# factor of e, or less: usual values of v_log at a slide are 5 to 15 mm/s, of F_log/F_C 0.1 to 0.3.
RISE_SPEED, RISE_SPREAD = 0.012, 0.5


@dataclass(frozen=True, eq=False)
class Tails:
    """Columns of what peaks leave behind their windows, 1 m at the windows' end (N, T), and how large they may be (T,)
    [m]."""

    columns: Array
    spread: Array


def remaining_after_windows(
    residual: Array, which: NDArray[np.int64], since: Array, window: float, usual: float
) -> list[tuple[float, float]]:
    """What the peak at each half axis leaves at the end of its window [m], and the angle in which that falls to 1/e
    [rad], one for both sides of an axis; 0, 0: nothing.

    An exponential over a constant, which lost motion that is not yet known is: of means of the axis' displacement, from
    where the peak has fallen to half on. usual: of means elsewhere, above which a peak must stand [m]. A
    tail is one that is more than what the exponential leaves of the means.
    """
    width = math.radians(HALF_HEIGHT_ANGLE)
    decays = np.radians(DECAY_ANGLES)[:, None]
    result = [(0.0, 0.0)] * 4
    for axis in (0, 1):
        sizes: dict[int, Array] = {}
        errors: dict[int, Array] = {}
        for k in (axis, axis + 2):
            own = (which == k) & (since > 0)
            part = np.floor(since[own] / width).astype(int)
            means = np.bincount(part, residual[own] / np.cos(since[own])) / np.maximum(np.bincount(part), 1)
            top = int(np.abs(means).argmax()) if len(means) else 0
            if len(means) == 0 or abs(means[top]) <= MEANS_ANGLE * usual:
                continue
            means *= np.sign(means[top])
            fallen = top + np.flatnonzero(means[top:] < 0.5 * means[top])
            if len(fallen) == 0 or len(means) - fallen[0] < 3:
                continue
            remaining = means[fallen[0] :]
            remaining = remaining - remaining.mean()
            tail = np.exp((window - (np.arange(fallen[0], len(means)) + 0.5) * width) / decays)
            tail -= tail.mean(axis=1, keepdims=True)
            sizes[k] = tail @ remaining / (tail**2).sum(axis=1)
            errors[k] = ((remaining - sizes[k][:, None] * tail) ** 2).mean(axis=1)
        best = int(np.sum(list(errors.values()), axis=0).argmin()) if errors else 0
        for k, size in sizes.items():
            if size[best] > math.sqrt(errors[k][best]):
                result[k] = (float(size[best]), float(decays[best, 0]))
    return result


def fading_tails(
    undone: Sequence[CorrectedPath],
    paths: Sequence[TurnedPath],
    remaining: Sequence[tuple[float, float]],
    window: float,
) -> Tails:
    """Tails of the peaks at the half axes; both senses share one: the axis reverses there from the same way.

    remaining: what each peak leaves at the end of its window [m], and the angle in which that falls to 1/e [rad].
    """
    columns, spread = [], []
    for k, (size, decay) in enumerate(remaining):
        if size < TAIL_FLOOR:
            continue
        parts = []
        for value, path in zip(undone, paths, strict=True):
            at = value.turned[k % 2] + (math.pi if k > 1 else 0.0)
            since = path.sense * (value.angle - at) % (2 * math.pi)
            along = np.abs((np.cos if k % 2 == 0 else np.sin)(value.angle))
            parts.append(np.where(since < math.pi, along * np.exp((window - since) / decay), 0.0))
        columns.append(np.concatenate(parts))
        spread.append(TAIL * size)
    samples = sum(len(entry.angle) for entry in undone)
    return Tails(np.column_stack(columns) if columns else np.empty((samples, 0)), np.array(spread))


def known_tails(
    circle: CircleUnderTest,
    undone: Sequence[CorrectedPath],
    paths: Sequence[TurnedPath],
    residual: Array,
    which: NDArray[np.int64],
) -> Tails:
    """The same where the loops' response is known: of each axis the periodic response to its friction, and the slope.

    A torque that is -F sgn(v) moves the axis by F 4/pi sum over odd k of Im(T_k exp(i k theta))/k, theta its own angle
    from the half axis + on, T_k its response. The columns are 1 m at their largest; friction is as large as the
    windows' peaks, or less, and turns round within TURNS: so do the first two slopes of the response. Between reversals
    it rises with the speed, by sgn(v) ln(1 + |v|/RISE_SPEED): the fourth column.
    """
    columns, spread = [], []
    for i, axis in enumerate(circle.axes):
        peak = float(np.abs(residual[(which >= 0) & (which % 2 == i)]).max(initial=0.0))
        if peak < TAIL_FLOOR:
            continue
        k = 2 * np.arange(len(circle.drag[axis])) + 1
        waves = circle.drag[axis] / k
        theta = np.linspace(0, 2 * math.pi, PERIOD, endpoint=False)
        largest = float(np.abs(_of_harmonics(k, waves)).max())
        within = math.radians(TURNS)
        # sgn v ln(1 + |v|/RISE_SPEED), as a multiple of the harmonics 4/(pi k) of sgn v.
        way = np.sin(theta)
        course = np.fft.rfft(np.sign(way) * np.log1p(circle.speed / RISE_SPEED * np.abs(way)))
        rising = -math.pi / (2 * PERIOD) * course.imag[k]
        shapes = [(TAIL, waves), (within, 1j * k * waves), (within**2, -(k**2) * waves)]
        shapes.append((RISE_SPREAD, rising * circle.drag[axis]))
        for size, shape in shapes:
            own = _of_harmonics(k, shape) / largest
            parts = []
            for value, path in zip(undone, paths, strict=True):
                passed = path.sense * (value.angle - value.turned[i]) % (2 * math.pi)
                along = (np.cos, np.sin)[i](value.angle)
                parts.append(along * np.interp(passed, theta, own, period=2 * math.pi))
            columns.append(np.concatenate(parts))
            spread.append(size * peak)
    return Tails(np.column_stack(columns) if columns else np.empty((len(residual), 0)), np.array(spread))


def _of_harmonics(k: NDArray[np.int64], waves: NDArray[np.complex128]) -> Array:
    """Im sum of waves exp(i k theta) at PERIOD angles theta of a turn, k (K,) below PERIOD / 2."""
    spectrum = np.zeros(PERIOD // 2 + 1, complex)
    spectrum[k] = -0.5j * PERIOD * waves
    return np.asarray(np.fft.irfft(spectrum, PERIOD))
