"""Stretches of constant speed in a record, and the mean torque over each of them."""

from __future__ import annotations

from itertools import pairwise
from math import ceil, hypot, inf, sqrt

import numpy as np
from numpy.polynomial import legendre
from scipy.ndimage import uniform_filter1d

from feedsim.estimation.identify.record import Array, Record, runs
from feedsim.estimation.identify.result import Plateau
from feedsim.estimation.least_squares import correlation_length

# --- Averages of disturbed signals with an honest standard deviation: correlated noise, drift, quantised values -------


def window(rows: int, taper: int) -> Array:
    """(rows,) weights of sum 1 that rise and fall as a raised cosine over `taper` rows, 0 at both ends.

    A ring-down that a plain mean would take in by its phase at the ends is averaged away.
    """
    taper = max(min(taper, (rows - 1) // 2), 1)
    weights = np.ones(rows)
    rise = 0.5 - 0.5 * np.cos(np.pi * np.arange(taper) / taper)
    weights[:taper] = rise
    weights[rows - taper :] = rise[::-1]
    return np.asarray(weights / np.sum(weights), dtype=np.float64)


def derivative(weights: Array, signal: Array, interval: float, order: int) -> float:
    """Weighted mean of the first or second derivative of a signal, whose derivative is not taken: the weights are, by
    summation by parts. They must be 0 at both ends."""
    padded = np.concatenate([[0.0], weights, [0.0]])
    centred = signal - signal[0]
    if order == 1:
        return float(-np.sum((padded[2:] - padded[:-2]) * centred) / (2 * interval))
    return float(np.sum((padded[2:] - 2 * padded[1:-1] + padded[:-2]) * centred) / interval**2)


def resolution(signal: Array) -> float:
    """Smallest step between values that occur; 0 for a constant. Of a signal that is not quantised: next to nothing."""
    steps = np.diff(np.unique(signal))
    # Decimal values differ by rounding of their binary form: that is no step.
    steps = steps[steps > 1e-9 * max(float(np.max(np.abs(signal))), 1e-300)]
    return float(np.min(steps)) if len(steps) else 0.0


def white(signal: Array) -> float:
    """Standard deviation of the white noise on a smooth signal, quantisation included.

    From third differences (variance 20 times the noise's), which leave little of the motion; their median, which the
    jerky parts do not move. A signal that stands still most of the time shows no noise but has a resolution.
    """
    if len(signal) < 4:
        return 0.0
    third = np.diff(signal, 3)
    moving = third[third != 0]
    noise = float(np.median(np.abs(moving))) / 0.6745 / np.sqrt(20) if len(moving) else 0.0
    return hypot(noise, resolution(signal) / np.sqrt(12))


def mean(signal: Array, weights: Array, step: float, *, trend: bool = False) -> tuple[float, float]:
    """Weighted mean and its standard deviation.

    step: of the quantisation. Noise well above a step averages the rounding away; below, the mean stays wrong by up to
    half of it (the fundamental of the rounding error falls with exp(-2 pi^2 scatter^2 / step^2) where the scatter is
    white; ring-down rounds in step with itself, of which a tenth of the variance is kept).
    trend: a linear trend does not count as scatter.
    """
    middle = float(np.sum(weights * signal))
    residuals = signal - middle
    if trend:
        along = np.arange(len(signal)) - 0.5 * (len(signal) - 1)
        residuals = residuals - np.mean(residuals) - along * np.sum(along * residuals) / np.sum(along**2)
    scatter = float(np.std(residuals))
    variance = scatter**2 * correlation_length(residuals - np.mean(residuals), of_mean=True) * float(np.sum(weights**2))
    if step > 0:
        variance += step**2 / 12 * max(float(np.exp(-4 * np.pi**2 * (scatter / step) ** 2)), 0.1)
    return middle, float(np.sqrt(variance))


# How plateaus are looked for: times [s], the travel [rad].
BLOCK_TIME = 0.04  # speeds are compared as means over this time
BLOCK_SPEED_CHANGE = 0.01  # largest relative change of speed from block to block, twice that from the plateau's own
SETTLE_TIME = 0.1  # left out at the start: control and structure ring down
# Left out at the start as well: bristles and the engaging zone (0.04 rad is usual) come to rest. Of a stretch short of
# travel at most that share is left out for it.
SETTLE_TRAVEL, SETTLE_SHARE = 0.06, 0.4
# Relative difference of torque between the first and the last third that passes for settled, and that beyond which a
# stretch is refused; between both, the drift adds to the standard deviation.
DRIFT, LIMIT = 1e-3, 0.05
MARGIN = 0.01  # left out at the end, for channels that are late
TAPER = 0.05  # the weights of the mean rise and fall over it; two periods of the lowest mode damp it best, one does
MIN_PLATEAU_TIME = 0.1  # time that must be left
MOST_DROPPED = 0.6  # of a stretch, looking for where its torque has settled
PLATEAU_SIGMAS = 4.0  # standard deviations that pass for noise
QUIETER = 1.5  # times less noise in the speed that the angle determines, for the recorded speed to be passed over
LONGER = (1, 4, 16)  # times the block, one after the other as far as noise asks for it
# share of a speed that the noise of a block may have (PLATEAU_SIGMAS of its standard deviations)
BLOCK_NOISE_SHARE = 0.2
REST_SPEED_SHARE = 1e-5  # of the highest speed: what is slower counts as rest
MAX_GAP_BLOCKS = 5  # blocks that an interruption lasts at most
SPEED_TOLERANCE = 0.1  # relative difference of speed on both sides of an interruption
DWELL = 0.1  # of its own duration that a stretch in coarse steps of speed may have in the next step on both sides
MIN_PLATEAU_ROWS = 20  # rows that a mean and its correlation can be had from


def plateaus(record: Record, J: float) -> tuple[Plateau, ...]:
    """Plateaus of a record in time order.

    J: inertia seen at the motor [kg.m2]; the mean of J dn/dt is small, J need not be sharp.
    """
    taken: list[Plateau] = []
    highest = inf
    for longer in LONGER:
        # Blocks as long as noise asks for: slow plateaus show in long ones only, fast ones are too short for them.
        motion = _Motion(record, longer * BLOCK_TIME)
        lowest = motion.noise(motion.rows) * PLATEAU_SIGMAS / BLOCK_NOISE_SHARE if longer < LONGER[-1] else 0.0
        for first, last in _candidates(motion):
            if not lowest <= abs(float(np.median(motion.blocks[first:last]))) < highest:
                continue
            if (result := _plateau(record, motion, first, last, J)) is not None:
                taken.append(result)
        highest = lowest
        if lowest <= REST_SPEED_SHARE * float(np.max(np.abs(motion.blocks))):
            break
    return tuple(sorted(taken, key=lambda plateau: plateau.begin))


class _Motion:
    """Travel and speed over blocks, from the speed where it was recorded, else from the angle. Where both were, and the
    angle determines a much quieter speed, from the angle.

    travel: (N,) [rad]. blocks: (N,) mean speed over a block about each row [rad/s]. direct: from the speed.
    """

    def __init__(self, record: Record, block: float) -> None:
        self.interval = record.interval
        self.rows = max(ceil(block / self.interval) | 1, 3)
        half = self.rows // 2
        self.direct = record.speed is not None and (
            record.angle is None or self._noise(record.speed, True) <= QUIETER * self._noise(record.angle, False)
        )
        if self.direct:
            assert record.speed is not None
            self.signal = record.speed
            steps = 0.5 * (record.speed[1:] + record.speed[:-1]) * self.interval
            self.travel = np.concatenate([[0.0], np.cumsum(steps)])
            self.blocks = uniform_filter1d(record.speed, self.rows, mode="nearest")
        else:
            assert record.angle is not None  # the record has a speed or an angle
            self.signal = self.travel = record.angle
            spread = np.pad(record.angle, half, mode="reflect", reflect_type="odd")
            self.blocks = (spread[2 * half :] - spread[: len(spread) - 2 * half]) / (2 * half * self.interval)
        self.scatter = white(self.signal)

    def _noise(self, signal: Array, direct: bool) -> float:
        """Of a block's mean speed, separated from one signal or the other."""
        return white(signal) * (1 / sqrt(self.rows) if direct else sqrt(2) / (self.rows * self.interval))

    def noise(self, rows: int) -> float:
        """Of a mean over rows that lie within reach of each other."""
        if self.direct:
            return self.scatter / sqrt(rows)
        return self.scatter * sqrt(2) / (rows * self.interval)

    def speed(self, first: int, last: int) -> float:
        """Plain mean over rows first <= i < last."""
        if self.direct:
            return float(np.mean(self.signal[first:last]))
        return float((self.signal[last - 1] - self.signal[first]) / ((last - 1 - first) * self.interval))


def _candidates(motion: _Motion) -> list[tuple[int, int]]:
    """Rows (first, behind the last) of stretches whose speed changes little from block to block and that do move."""
    rows, blocks = motion.rows, motion.blocks
    if len(blocks) < 3 * rows:
        return []
    half = rows // 2
    noise = motion.noise(rows)
    # Blocks that adjoin at each row.
    ahead, behind = np.roll(blocks, -half - 1), np.roll(blocks, half + 1)
    quiet = np.abs(ahead - behind) <= BLOCK_SPEED_CHANGE * np.abs(blocks) + PLATEAU_SIGMAS * np.sqrt(2) * noise
    moving = np.abs(blocks) > max(PLATEAU_SIGMAS * noise, REST_SPEED_SHARE * float(np.max(np.abs(blocks))))
    inside = quiet & moving
    inside[: half + 1] = inside[len(inside) - half - 1 :] = False
    # A change of sign parts two stretches even if noise hides what lies between.
    inside[1:] &= np.sign(blocks[1:]) == np.sign(blocks[:-1])
    return _join_parts(runs(inside), blocks, rows)


def _join_parts(parts: list[tuple[int, int]], blocks: Array, rows: int) -> list[tuple[int, int]]:
    """Neighbours at nearly one speed as one stretch: an axis that breaks loose interrupts it, and what comes before is
    its settling."""
    whole: list[tuple[int, int]] = []
    for first, last in parts:
        if whole and first - whole[-1][1] <= MAX_GAP_BLOCKS * rows:
            here, before = np.median(blocks[first:last]), np.median(blocks[slice(*whole[-1])])
            if abs(here - before) <= SPEED_TOLERANCE * abs(here):
                whole[-1] = (whole[-1][0], last)
                continue
        whole.append((first, last))
    return whole


def _plateau(record: Record, motion: _Motion, first: int, last: int, J: float) -> Plateau | None:
    """The plateau within a candidate, if there is one."""
    interval = motion.interval
    least = max(ceil(MIN_PLATEAU_TIME / interval), MIN_PLATEAU_ROWS)
    if last - first < least:
        return None
    speed = float(np.median(motion.blocks[first:last]))
    noise = PLATEAU_SIGMAS * motion.noise(motion.rows)
    if abs(speed) <= noise:  # joined across a stretch that may be at rest
        return None
    allowed = 0.5 * BLOCK_SPEED_CHANGE * abs(speed) + noise
    near = np.flatnonzero(np.abs(motion.blocks[first:last] - speed) <= allowed)
    # Of an even number of blocks in coarse steps the median may lie between two of them, and near to none.
    if len(near) < 0.5 * (last - first):
        return None
    begin, end = first + int(near[0]), first + int(near[-1]) + 1
    if not _is_steady(motion, begin, end) or _is_crest(motion, begin, end):
        return None
    end -= ceil(MARGIN / interval)
    earliest = begin + max(ceil(SETTLE_TIME / interval), _rows_of_settling_travel(motion, begin, end))
    if end - earliest < least:
        return None
    torque = record.torque if record.load is None else record.torque - record.load
    step = resolution(record.torque)
    start, drift = _find_settled_row(torque, earliest, begin + int(MOST_DROPPED * (end - begin)), end, least, step)
    if record.clipped is not None and np.any(record.clipped[start:end]):
        return None
    weights = _weights(end - start, TAPER, interval)
    order = 1 if motion.direct else 2
    average, sigma = mean(torque[start:end], weights, step)
    average -= J * derivative(weights, motion.signal[start:end], interval, order)
    if drift > LIMIT * abs(average):
        return None
    mean_speed = (
        float(np.sum(weights * motion.signal[start:end]))
        if motion.direct
        else derivative(weights, motion.signal[start:end], interval, 1)
    )
    if abs(mean_speed - speed) > allowed:
        return None
    return Plateau(
        record.name,
        float(record.time[start]),
        float(record.time[end - 1]),
        mean_speed,
        average,
        # A drift that is left is as good as a rectangular distribution of so much width.
        hypot(sigma, drift / np.sqrt(12)),
        end - start,
        float((record.time[start] + record.time[end - 1]) / 2 - record.time[0]),
    )


def _is_steady(motion: _Motion, begin: int, end: int) -> bool:
    """Whether the speed of the later part keeps its value over four quarters (the start may still ring)."""
    begin += (end - begin) // 5
    bounds = np.linspace(begin, end, 5).astype(int)
    if bounds[1] - bounds[0] < 3:
        return False
    means = [motion.speed(int(a), int(b)) for a, b in pairwise(bounds)]
    noise = PLATEAU_SIGMAS * np.sqrt(2) * motion.noise(int(bounds[1] - bounds[0]))
    allowed = BLOCK_SPEED_CHANGE * abs(float(np.mean(means)))
    return bool(np.ptp(means) <= allowed + noise) and _bend(motion, begin, end) <= allowed


def _bend(motion: _Motion, begin: int, end: int) -> float:
    """Range of the speed's parabola over rows begin <= i < end beyond its own noise [rad/s], least squares.

    In coarse steps of the angle quarters show no crest of a sine; all rows together do.
    """
    rows, order = end - begin, 2 if motion.direct else 3
    place = np.linspace(-1.0, 1.0, rows)
    values = legendre.legfit(place, motion.signal[begin:end], order)
    remaining = float(np.std(motion.signal[begin:end] - legendre.legval(place, values)))
    # Coefficients of Legendre polynomials on many even points are independent, of variance (2 k + 1) / rows.
    sigmas = remaining * np.sqrt((2 * np.arange(order + 1) + 1) / rows)
    if motion.direct:
        ranges, shape, scale = np.array([0.0, 2.0, 1.5]), values, 1.0
    else:  # ranges of the derivatives of P_2 and P_3
        ranges, shape = np.array([0.0, 0.0, 6.0, 7.5]), legendre.legder(values)
        scale = 2 / ((rows - 1) * motion.interval)
    noise = PLATEAU_SIGMAS * float(np.linalg.norm(ranges * sigmas))
    return scale * (float(np.ptp(legendre.legval(place, shape))) - noise)


def _is_crest(motion: _Motion, begin: int, end: int) -> bool:
    """Whether a speed in steps coarser than what may change seems constant only: a crest, parabola over time, spends at
    least 0.2 times as long in the next step on either side of it; a plateau is left at once."""
    if not motion.direct:
        return False
    step, rows = resolution(motion.signal), end - begin
    level = float(np.median(motion.signal[begin:end]))
    if not BLOCK_SPEED_CHANGE * abs(level) < step < 0.75 * abs(level):  # else fine, or the next step is rest
        return False
    sides = motion.signal[max(begin - rows, 0) : begin], motion.signal[end : end + rows]
    spent = [np.count_nonzero(np.abs(np.abs(side - level) / step - 1) < 0.5) for side in sides]
    return bool(min(spent) > DWELL * rows)


def _rows_of_settling_travel(motion: _Motion, begin: int, end: int) -> int:
    """Rows until the settling travel is behind."""
    travel = np.abs(motion.travel[begin:end] - motion.travel[begin])
    needed = min(SETTLE_TRAVEL, SETTLE_SHARE * float(travel[-1]))
    return int(np.argmax(travel >= needed))


def _weights(rows: int, taper: float, interval: float) -> Array:
    """At most a fifth of the rows at either end is tapered: the loss of rows stays below 15 %."""
    return window(rows, min(ceil(taper / interval), rows // 5))


def _find_settled_row(
    torque: Array, earliest: int, latest: int, end: int, least: int, step: float
) -> tuple[int, float]:
    """Row from which on the torque has settled, and how much it still drifts (0: not beyond noise and `DRIFT`).

    Where it never settles (torque that depends on position) the earliest row stays: leaving more out gains nothing.
    """
    first_drift = 0.0
    for start in np.linspace(earliest, max(latest, earliest), 8).astype(int):
        third = (end - start) // 3
        if end - start < least or third < 4:
            break
        weights = window(third, third // 4)
        before, before_sigma = mean(torque[start : start + third], weights, step, trend=True)
        after, after_sigma = mean(torque[end - third : end], weights, step, trend=True)
        drift = abs(after - before)
        if drift <= max(PLATEAU_SIGMAS * hypot(before_sigma, after_sigma), DRIFT * abs(after)):
            return int(start), 0.0
        if start == earliest:
            first_drift = drift
    return earliest, first_drift
