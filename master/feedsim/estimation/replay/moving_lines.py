"""Vibration from outside while an axis moves: lines in what a simulation leaves of its position.

A line is a sine of one frequency, amplitude and phase over a motion in one direction, and it has to pass four tests:

* it stands out of its surroundings in the spectrum by several tapers (D. J. Thomson, *Proc. IEEE* 70, 1982): F-test,
  corrected for the number of frequencies that were looked at;
* all thirds of the motion show it with about the same amplitude and phase, and no other line is beside it: a transient
  of the motion has a band;
* it takes more than a resonance does that the setpoints of all axes of the record drive;
* its frequency does not follow the speed, as that of cogging, of the screw and of its balls does;
* neither the record's known load nor its torque drives it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.optimize import least_squares
from scipy.signal.windows import dpss
from scipy.stats import f as f_distribution

from feedsim.estimation.replay.closed_loop import MOVES, AxisRecord
from feedsim.estimation.replay.machine_files import DAMPING_RATIOS, resonator
from feedsim.files.trace.trace import Array

# --- Vibration from outside: lines in a record of an axis at rest, which go on while it moves -------------------------
# A spindle or a pump shakes an axis whether it moves or not. No drive and no mode of the axis explains such a line,
# and
# a fit takes it for elasticity of its own if one is near. It is found where the axis stands still, ahead of a motion
# and
# behind it: a sine of one frequency, amplitude and phase over both, so that either side predicts the other. Between
# them
# it is taken to go on as it was.
# A line that the record's known load has, or by which its torque moves the axis, is the axis' own.


REST_WINDOW = 0.5  # [s] at rest on either side of a motion that are looked at
MIN_REST_TIME_BESIDE = 0.1  # [s] at rest that are needed there
DIES_AWAY = 0.12  # [s] behind a motion in which the axis itself still swings
PERIODS = 2  # of a line on the shorter side
BELOW_RATE = 0.4  # of the rows' rate: above it nothing is separated
LINE_SUBDIVISIONS = 8  # frequencies per line width
PREDICTED_SHARE = 0.5  # share of the variance at rest that either side has to predict of the other
MOST_LINES = 3
MAX_NAMED_LINES = 4  # in a note
SAME_LINE = 1.0  # by how many line widths frequencies of one line differ at most
MIN_AMPLITUDE = 1e-8  # [m] amplitude: less is the digits of a record
# Of a known load: frequencies beside a line, in line widths, and the share of their power that the line has to have.
BAND_WIDTHS, LOAD_SHARE = 3, 0.5
MOVED_BY_TORQUE = 0.3  # of the amplitude: how near the axis comes to what its torque does to its inertia


@dataclass(frozen=True)
class Line:
    """A line from outside. frequency [Hz], position [m] and torque [N.m] amplitudes; begin, end: between which rows of
    the record's time [s] it was taken out."""

    frequency: float
    position: float
    torque: float
    begin: float
    end: float

    @property
    def duration(self) -> float:
        """[s]"""
        return self.end - self.begin

    def at(self, frequency: float) -> Line:
        """The same of another frequency [Hz]."""
        return replace(self, frequency=frequency)

    @property
    def text(self) -> str:
        """In words, without the name of the axis."""
        torque = f" and {self.torque:.2g} N.m" if self.torque else ""
        return (
            f"{self.frequency:.4g} Hz with {1e6 * self.position:.2g} um{torque} (amplitudes), {self.begin:.3g} to "
            f"{self.end:.3g} s"
        )


def without_outside(axis_record: AxisRecord, J: float | None = None) -> tuple[AxisRecord, tuple[Line, ...]]:
    """The record without lines from outside, and those lines; the record itself where there are none.

    J: inertia of the axis [kg.m2], where it is known.
    """
    position, torque = axis_record.position.copy(), axis_record.record.torque.copy()
    time, clean = axis_record.record.time, 0  # clean: rows ahead of it have lost their lines
    lines: list[Line] = []
    for before, after in _rests(axis_record):
        # A short rest is behind one motion and ahead of the next one: either side is looked at as it was recorded.
        own, beside = axis_record.position.copy(), axis_record.record.torque.copy()
        whole = np.arange(before[0], after[-1] + 1)
        rows, count = whole[whole >= clean], len(lines)
        for _ in range(MOST_LINES):
            frequency = _line(time, own, before, after)
            if frequency is None:
                break
            sine = _sine(time, own, frequency, before, after)
            if np.hypot(*sine) < MIN_AMPLITUDE:
                break
            wave = waves(time[whole], frequency)
            own[whole] -= wave @ sine
            force = _sine(time, beside, frequency, before, after) if axis_record.record.driven else np.zeros(2)
            beside[whole] -= wave @ force
            if driven_by_record(axis_record, frequency, (before, after), sine, force, J):
                continue
            sizes = float(np.hypot(*sine)), float(np.hypot(*force))
            lines.append(Line(frequency, *sizes, float(time[rows[0]]), float(time[rows[-1]])))
        if len(lines) > count:
            position[rows], torque[rows], clean = own[rows], beside[rows], int(rows[-1]) + 1
    if not lines:
        return axis_record, ()
    record = replace(axis_record.record, angle=position / axis_record.I_P, torque=torque)
    return replace(axis_record, record=record), tuple(lines)


def _rests(axis_record: AxisRecord) -> Iterator[tuple[Rows, Rows]]:
    """Rows at rest ahead of every motion and behind it, where there are enough of both."""
    h = axis_record.record.interval
    moving = replace(axis_record, rows=np.ones_like(axis_record.rows)).moving
    behind = np.ones(round(DIES_AWAY / h) + 1)
    moving = np.convolve(moving, behind)[: len(moving)] > 0.5
    edges = np.flatnonzero(np.diff(moving.astype(int)))
    stretches = np.split(np.arange(len(moving)), edges + 1)  # at rest and in motion in turns
    beside, shortest = round(REST_WINDOW / h), round(MIN_REST_TIME_BESIDE / h)
    for k in range(1, len(stretches) - 1):
        before, after = stretches[k - 1][-beside:], stretches[k + 1][:beside]
        if moving[stretches[k][0]] and min(len(before), len(after)) >= shortest:
            yield before, after


def _line(time: Array, position: Array, before: Rows, after: Rows) -> float | None:
    """Frequency [Hz] of the line that explains most of the position at rest; None: neither side predicts the other."""
    h = float(time[1] - time[0])
    width = h * (after[-1] - before[0])
    quiet = np.zeros(after[-1] - before[0] + 1)
    for rows in (before, after):
        quiet[rows - before[0]] = remove_parabola(position, rows)
    size = LINE_SUBDIVISIONS * len(quiet)
    power, grid = np.abs(np.fft.rfft(quiet, size)), np.fft.rfftfreq(size, h)
    power[(grid < PERIODS / (h * min(len(before), len(after)))) | (grid > BELOW_RATE / h)] = 0.0
    best, step = float(grid[int(np.argmax(power))]), 0.5 / (LINE_SUBDIVISIONS * width)
    for _ in range(3):  # the sine that leaves least is near the highest line
        near = best + step * np.arange(-3, 4)
        best = float(near[int(np.argmin([_remaining_squares(time, position, f, before, after) for f in near]))])
        step /= 3
    sides = [(before, remove_parabola(position, before)), (after, remove_parabola(position, after))]
    for (own, y), (other, z) in (sides, sides[::-1]):
        W, V = (remove_parabola(waves(time, best), rows) for rows in (own, other))
        sine = np.linalg.lstsq(W, y, rcond=None)[0]
        if not np.sum((z - V @ sine) ** 2) < (1 - PREDICTED_SHARE) * np.sum(z**2):
            return None
    return best


def _remaining_squares(time: Array, signal: Array, frequency: float, before: Rows, after: Rows) -> float:
    """Sum of squares that one sine over both sides leaves."""
    W, y = _detrend_sides(time, signal, frequency, before, after)
    return float(np.sum((y - W @ np.linalg.lstsq(W, y, rcond=None)[0]) ** 2))


def _sine(time: Array, signal: Array, frequency: float, before: Rows, after: Rows) -> Array:
    """(2,) cosine and sine of one line over both sides."""
    return np.asarray(np.linalg.lstsq(*_detrend_sides(time, signal, frequency, before, after), rcond=None)[0])


def _detrend_sides(time: Array, signal: Array, frequency: float, before: Rows, after: Rows) -> tuple[Array, Array]:
    wave, sides = waves(time, frequency), (before, after)
    return tuple(np.concatenate([remove_parabola(of, rows) for rows in sides]) for of in (wave, signal))  # type: ignore[return-value]


def driven_by_record(
    axis_record: AxisRecord, frequency: float, stretches: Sequence[Rows], sine: Array, force: Array, J: float | None
) -> bool:
    """Whether a line is the axis' own: the known load has it, or the torque moves the inertia so.

    The torque of a drive that answers to a line from outside has another size and phase.

    Args:
        stretches: rows over which the line is. sine, force: (2,) cosine and sine of position [m] and torque [N.m].
    """
    record = axis_record.record
    if record.load is not None:
        time, width = record.time, 1 / (record.time[stretches[-1][-1]] - record.time[stretches[0][0]])
        band = [frequency, *(frequency + side * k * width for k in range(1, BAND_WIDTHS + 1) for side in (-1, 1))]
        every = np.column_stack([waves(time, one) for one in band if one > 0])
        columns, load = (
            np.concatenate([remove_parabola(of, rows) for rows in stretches]) for of in (every, record.load)
        )
        line, whole = (part @ np.linalg.lstsq(part, load, rcond=None)[0] for part in (columns[:, :2], columns))
        if line @ line > LOAD_SHARE * (whole @ whole):
            return True
    if J is None:
        return False
    angle = sine / axis_record.I_P
    off = angle + force / (J * (2 * np.pi * frequency) ** 2)
    return bool(np.hypot(*off) < MOVED_BY_TORQUE * np.hypot(*angle))


def waves(time: Array, frequency: float) -> Array:
    """(N, 2) cosine and sine of 2 pi `frequency` `time`."""
    phase = 2 * np.pi * frequency * time
    return np.column_stack([np.cos(phase), np.sin(phase)])


def remove_parabola(signal: Array, rows: Rows) -> Array:
    """Rows of a signal (N,) or (N, K) less their parabola: creep at rest is no vibration."""
    t = np.linspace(-1.0, 1.0, len(rows))
    trend = np.linalg.qr(np.column_stack([np.ones_like(t), t, t**2]))[0]
    return np.asarray(signal[rows] - trend @ (trend.T @ signal[rows]))


def in_words(axis: str, lines: Sequence[Line], moving: bool = False) -> str:
    """A note on them: each frequency once, the first ones, and how many there are beyond."""
    named = _by_frequency(lines)
    more = f" and {len(named) - MAX_NAMED_LINES} more" if len(named) > MAX_NAMED_LINES else ""
    when, what = ("while it moves", "no setpoint drives") if moving else ("at rest", "no drive and no mode explains")
    return (
        f"axis {axis}: {when} the record has {'; '.join(line.text for line in named[:MAX_NAMED_LINES])}{more}: "
        f"vibration from outside the axis, which {what}"
    )


def same_line(one: Line, other: Line) -> bool:
    """Whether two lines have the same frequency, as far as the shorter one determines it."""
    return abs(one.frequency - other.frequency) * min(one.duration, other.duration) < SAME_LINE


def _by_frequency(lines: Sequence[Line]) -> list[Line]:
    """Lines of one frequency as one, with the largest amplitudes."""
    result: list[Line] = []
    for line in sorted(lines, key=lambda line: (line.begin, line.frequency)):
        k = next((k for k, other in enumerate(result) if same_line(line, other)), None)
        if k is None:
            result.append(line)
            continue
        both = line, result[k]
        longer = max(both, key=lambda one: one.duration)
        begin, end = min(one.begin for one in both), max(one.end for one in both)
        result[k] = Line(
            longer.frequency, max(one.position for one in both), max(one.torque for one in both), begin, end
        )
    return result


Rows = NDArray[np.int64]

MIN_MOTION_TIME = 0.5  # [s] of a motion in one direction
MIN_COMPARED_TIME = 0.25  # [s] of one that a resonance has to predict
MAX_MOTION_TIME, MAX_MOTIONS = 4.0, 12  # [s] of a motion, its middle, and how many, the longest ones
MIN_INTERVAL = 2e-3  # [s] of the rows that are looked at: rows that are nearer are averaged
MIN_FREQUENCY, MIN_CYCLES = 8.0, 4.0  # [Hz] and per motion: below, errors of friction and drive are broad
RATE_SHARE = 0.2  # of the rows' rate: above it the position shows nothing
TAPER_PRODUCT, TAPERS = 1.5, 2  # time-bandwidth product of the tapers, and how many
BAND_PRODUCT, BAND_TAPERS = 3.0, 5  # the same of the band in which a line is compared with a resonance
OVERSAMPLING = 8  # frequencies per line width
SIDE_SHARE, MIN_SIDE = 0.35, 4.0  # of the frequency, and in line widths, to either side
INDEPENDENT_SHARE = 0.7  # share of the lines of the surroundings that are independent ones
MAX_LINES = 8  # in a motion
MIN_DISTANCE = 2.0  # line widths between one and the next
CANDIDATE_RATIO = 5.0  # of a line to its surroundings, for a first look
MAX_CHANCE = 0.1  # that a record without lines has one
PARTS = 3
MIN_PROJECTION = 0.4  # of the amplitude over a third on that over the motion
MIN_OTHER_POWER = 0.25  # power of another motion there, of what the resonance takes
MAX_UNPREDICTED = 0.7  # share of that which a resonance leaves at most
DRIVEN_SHARE = 0.01  # share of what an axis' setpoint drives in all of the record
TRIED_RESONANCES = 5  # frequencies within a line width at which a resonance is tried
UNDECIDED_GAIN, ORDER_GAIN = 0.8, 1.1  # gain of a sine over the angle, of the one over time
MAX_LINE_WIDTH = 0.25  # orders that a line width is at most where whole orders are separated
TREND_COLUMNS = 4  # columns of a polynomial over the motion


@dataclass(frozen=True)
class _MotionLine:
    """A line of a motion: Hz, probability under noise alone, speed [turns/s], whether it may be a whole order of it,
    and whether the motion separates orders."""

    line: Line
    chance: float
    turns: float
    order: bool
    separated: bool


def lines_in_motion(
    axis_record: AxisRecord,
    error: Array,
    torque_error: Array | None,
    axes: Sequence[AxisRecord],
    J: float | None = None,
) -> tuple[Line, ...]:
    """Lines in an axis' motion that no axis drives, by time and frequency.

    Args:
        error: (N,) recorded position less that of the simulation [m]. torque_error: (N,) the same of the torque [N.m].
        axes: all that were recorded over the same time, this one included. J: inertia [kg.m2], where it is known.
    """
    if RATE_SHARE / axis_record.record.interval <= MIN_FREQUENCY:  # the rows are too far apart for any line
        return ()
    longest = sorted(_one_way(axis_record), key=len)[-MAX_MOTIONS:]
    every = [
        _Motion(axis_record, rows, error, torque_error, axes, J) for rows in sorted(longest, key=lambda rows: rows[0])
    ]
    motions = [motion for motion in every if motion.duration >= MIN_MOTION_TIME]
    lines = [
        one
        for motion in motions
        for one in motion.lines([other for other in every if other is not motion])
        if one.chance * len(motions) < MAX_CHANCE
    ]

    def no_order(one: _MotionLine) -> bool:
        """Whether motions of other speeds leave it open, or show, that the frequency does not follow the turns."""
        others = [
            other
            for other in lines
            if one.turns and abs(other.turns / one.turns - 1) * one.line.frequency * one.line.duration > 1
        ]
        if any(same_line(one.line.at(one.line.frequency * other.turns / one.turns), other.line) for other in others):
            return False
        # Of two speeds that are whole multiples, different orders have the same frequency.
        return not one.order or any(
            same_line(one.line, other.line) and not (other.order and other.separated and one.separated)
            for other in others
        )

    return tuple(one.line for one in lines if no_order(one))


def _one_way(axis_record: AxisRecord) -> Iterator[Rows]:
    """Rows of every motion in one direction that is long enough."""
    h = axis_record.record.interval
    speed = np.gradient(axis_record.setpoint, h)
    way = np.where(axis_record.rows & (np.abs(speed) > MOVES * np.max(np.abs(speed), initial=0.0)), np.sign(speed), 0.0)
    for rows in np.split(np.arange(len(way)), np.flatnonzero(np.diff(way)) + 1):
        if way[rows[0]] and len(rows) * h >= MIN_COMPARED_TIME:
            middle, most = len(rows) // 2, round(MAX_MOTION_TIME / h / 2)
            yield rows[max(middle - most, 0) : middle + most]


def _without_trend(signal: Array) -> Array:
    """(N,) or (N, K) less a polynomial over the rows."""
    basis = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, len(signal)), TREND_COLUMNS))[0]
    return np.asarray(signal - basis @ (basis.T @ signal))


def _fit(columns: Array, signal: Array) -> Array:
    return np.asarray(np.linalg.lstsq(columns, signal, rcond=None)[0])


def _square(signal: Array) -> float:
    return float(signal @ signal)


@dataclass(eq=False)
class _Motion:
    """A motion of an axis, and what the simulation leaves of it."""

    axis_record: AxisRecord
    rows: Rows
    error: Array
    torque_error: Array | None
    axes: Sequence[AxisRecord]
    J: float | None

    def __post_init__(self) -> None:
        own = self.axis_record.record.interval  # [s] of the rows of the record
        step = max(round(MIN_INTERVAL / own), 1)
        self.rows, self.h = self.rows[::step], step * own
        self.time = self.axis_record.record.time[self.rows]
        self.duration = len(self.rows) * self.h
        self.y = _without_trend(uniform_filter1d(self.error, step)[self.rows])
        self.force = (
            None if self.torque_error is None else _without_trend(uniform_filter1d(self.torque_error, step)[self.rows])
        )
        self.tapers = dpss(len(self.rows), TAPER_PRODUCT, TAPERS)
        self.wide = dpss(len(self.rows), BAND_PRODUCT, BAND_TAPERS)
        self.size = OVERSAMPLING * len(self.rows)
        self.frequency = np.fft.rfftfreq(self.size, self.h)

    @cached_property
    def accelerations(self) -> list[Array]:
        """(N,) of every axis' setpoint [m/s2], over the whole record."""
        return [np.gradient(np.gradient(one.setpoint, one.record.interval), one.record.interval) for one in self.axes]

    @cached_property
    def own_range(self) -> Rows:
        """Places of the frequencies that are looked at."""
        low = max(MIN_FREQUENCY, MIN_CYCLES / self.duration)
        return np.flatnonzero((self.frequency > low) & (self.frequency < RATE_SHARE / self.h))

    def lines(self, others: Sequence[_Motion]) -> list[_MotionLine]:
        """Lines that pass all tests but that of the speed. others: further motions of the axis."""
        kept = self._kept(self._candidates())
        # Lines side by side are one whose amplitude changes.
        kept = [f for f in kept if sum(abs(f - other) * self.duration < MIN_DISTANCE for other in kept) == 1]
        return [one for k in range(len(kept)) if (one := self._judge_line(kept, k, others)) is not None]

    def _error_without(self, frequencies: Sequence[float]) -> Array:
        """(N,) error without sines of these frequencies."""
        if not len(frequencies):
            return self.y
        W = _without_trend(np.column_stack([waves(self.time, one) for one in frequencies]))
        return np.asarray(self.y - W @ _fit(W, self.y))

    def _spectra(self, signal: Array) -> tuple[Array, Array]:
        """Of every frequency: mean power over the tapers, and that of a sine which all tapers agree on."""
        lines, sums = np.fft.rfft(self.tapers * signal, self.size), np.sum(self.tapers, axis=1)
        mean = (sums @ lines) / _square(sums)
        return np.mean(np.abs(lines) ** 2, axis=0), np.abs(mean) ** 2 * _square(sums)

    @cached_property
    def _sides(self) -> tuple[Rows, Array]:
        """Of every frequency that is looked at: (4, N) where both sides of its surroundings begin and end; (N,) degrees
        of freedom of one side."""
        at = self.frequency[self.own_range]
        gap = TAPER_PRODUCT / self.duration
        width = np.maximum(SIDE_SHARE * at, MIN_SIDE / self.duration)
        ends = np.searchsorted(self.frequency, [at - gap - width, at - gap, at + gap, at + gap + width])
        lowest = np.searchsorted(self.frequency, gap)
        return np.maximum(ends, lowest), 2 * INDEPENDENT_SHARE * width * self.duration

    def _surroundings(self, power: Array, k: int) -> float:
        """Power about the k-th frequency that is looked at: the median of the side that has more."""
        a, b, c, d = self._sides[0][:, k]
        return float(max(np.median(power[a:b]) if b > a else 0.0, np.median(power[c:d])))

    def _candidates(self) -> list[float]:
        """Frequencies of sines, one after the other where a spectrum stands out most, fitted together."""
        result: list[float] = []
        scale = float(np.std(self.y)) or 1.0
        for _ in range(MAX_LINES):
            power, sine = self._spectra(self._error_without(result))
            peaks = self._peaks(sine)
            ratio = [sine[self.own_range[k]] / self._surroundings(power, k) for k in peaks]
            if not ratio or not max(ratio) > CANDIDATE_RATIO:
                break
            begin = [*result, float(self.frequency[self.own_range[peaks[int(np.argmax(ratio))]]])]
            x = least_squares(lambda x: self._error_without(x) / scale, begin, diff_step=1e-4, max_nfev=6).x
            low, high = self.frequency[self.own_range[[0, -1]]]
            result = [float(one) for one in x if low < one < high]
        return result

    def _peaks(self, sine: Array) -> Rows:
        """Local maxima among the frequencies that are looked at."""
        own = sine[self.own_range]
        return np.flatnonzero((own[1:-1] > own[:-2]) & (own[1:-1] >= own[2:])) + 1

    def _chance(self, frequencies: Sequence[float], k: int) -> float:
        """Probability that noise has such a line at any of the frequencies that are looked at."""
        looked_at = self.frequency[self.own_range]
        place = int(np.argmin(np.abs(looked_at - frequencies[k])))
        around = self._surroundings(self._spectra(self._error_without(frequencies))[0], place)
        sine = self._spectra(self._error_without([*frequencies[:k], *frequencies[k + 1 :]]))[1][self.own_range[place]]
        count = self.duration * (looked_at[-1] - looked_at[0])
        return float(f_distribution.sf(sine / around, 2, self._sides[1][place]) * count)

    def _kept(self, frequencies: list[float]) -> list[float]:
        """The candidates without the least likely one, as long as that may be chance."""
        while frequencies:
            chances = [self._chance(frequencies, k) for k in range(len(frequencies))]
            worst = int(np.argmax(chances))
            if chances[worst] < MAX_CHANCE:
                break
            frequencies = [*frequencies[:worst], *frequencies[worst + 1 :]]
        return frequencies

    def _judge_line(self, kept: Sequence[float], k: int, others: Sequence[_Motion]) -> _MotionLine | None:
        """A line, where the whole motion shows it, whatever the axes drive."""
        f, z = kept[k], self._error_without([*kept[:k], *kept[k + 1 :]])
        W = _without_trend(waves(self.time, f))
        c = _fit(W, z)
        size = float(np.hypot(*c))
        thirds = np.array_split(np.arange(len(z)), PARTS)
        own = [_fit(_without_trend(waves(self.time[one], f)), _without_trend(z[one])) @ c / size**2 for one in thirds]
        gain = _square(W @ c)
        if size < MIN_AMPLITUDE or min(own) < MIN_PROJECTION:
            return None
        apart = [one for one in kept if abs(one - f) * self.duration > BAND_PRODUCT]
        if self._is_driven(f, self._error_without(apart), others):
            return None
        over_angle, near, separated, turns = self._over_angle(f, z)
        if over_angle > ORDER_GAIN * gain:
            return None
        force = np.zeros(2) if self.force is None else _fit(W, self.force)
        if driven_by_record(self.axis_record, f, [self.rows], c, force, self.J):
            return None
        line = Line(f, size, float(np.hypot(*force)), float(self.time[0]), float(self.time[-1]))
        return _MotionLine(line, self._chance(kept, k), turns, near and over_angle > UNDECIDED_GAIN * gain, separated)

    def near(self, f: float) -> Array:
        """(2 BAND_TAPERS, N) orthonormal: what a signal over the rows has in a band about a frequency."""
        waved = [taper * wave for taper in self.wide for wave in waves(self.time, f).T]
        return np.asarray(np.linalg.qr(np.array(waved).T)[0].T)

    def _is_driven(self, f: float, z: Array, others: Sequence[_Motion]) -> bool:
        """Whether a resonance that the setpoints drive takes more of z near a frequency than a sine of that does, and
        predicts the other motions, as far as they have something there."""
        near, h = self.near(f), self.axis_record.record.interval
        own, sine = near @ z, near @ waves(self.time, f)
        most, best = _square(sine @ _fit(sine, own)), None
        for one in f + np.linspace(-1, 1, TRIED_RESONANCES) / self.duration:
            for D in DAMPING_RATIOS:
                answers = [resonator(one, D, a, h) for a in self.accelerations]
                driven = [q for q in answers if np.ptp(q[self.rows]) > DRIVEN_SHARE * np.ptp(q)]
                if not driven:  # nothing accelerates: no resonance is driven
                    continue
                q = np.column_stack(driven)
                V = near @ q[self.rows]
                c = _fit(V, own)
                if _square(V @ c) > most:
                    most, best = _square(V @ c), q @ c
        if best is None:
            return False
        size = most / len(self.rows)
        for other in others:
            near = other.near(f)
            own = near @ other.y
            if _square(own) > MIN_OTHER_POWER * size * len(other.rows):
                return _square(own - near @ best[other.rows]) < MAX_UNPREDICTED * _square(own)
        return True

    def _over_angle(self, f: float, z: Array) -> tuple[float, bool, bool, float]:
        """What a sine over the motor's angle takes of z, whether it may be a whole order, whether the motion is long
        enough to separate orders, and turns per second."""
        turn = self.axis_record.position[self.rows] / (2 * np.pi * self.axis_record.I_P)
        rates = np.abs(np.gradient(turn, self.h))
        turns = float(np.median(rates)) or float(np.mean(rates))  # a coarse encoder repeats its value in most rows
        if not turns:  # the setpoint moves, the axis does not: no order
            return 0.0, False, False, 0.0
        order, width = f / turns, 1 / (turns * self.duration)
        gains = []
        for own in order + width * np.linspace(-1, 1, 21):
            W = _without_trend(waves(turn, own))
            gains.append(_square(W @ _fit(W, z)))
        return max(gains), abs(order - round(order)) < width, width < MAX_LINE_WIDTH, turns
