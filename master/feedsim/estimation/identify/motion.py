"""Smooth motion between the samples of a record, its derivative at any instant, and which parts of it move."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from math import ceil, comb, nan, pi, sqrt
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PPoly
from scipy.ndimage import maximum_filter1d
from scipy.optimize import least_squares
from scipy.signal import butter, sosfiltfilt

from feedsim.estimation.identify.plateaus import resolution
from feedsim.estimation.identify.record import Array, Record, runs
from feedsim.estimation.identify.result import Plateau
from feedsim.foundation.errors import InputError

if TYPE_CHECKING:
    from feedsim.simulation.cosim.friction_law import FrictionLaw


Source = Literal["speed", "angle"]

# Longest step of the friction law between samples.
LAW_STEP = 0.5e-3
SMOOTHING_NOISE = 0.01  # noise of the acceleration over its RMS, from which on a motion is smoothed
ACCELERATION_BAND = 20.0  # [Hz] up to which the acceleration's RMS is read
MIN_CUTOFF = 20.0  # [Hz] cut-off below which no motion is smoothed: friction would be gone with the noise
DIFFERENCES = 4  # order of the differences that noise is read from: what is left of a 10 Hz sine at 500 Hz is 2e-4


@dataclass(frozen=True, eq=False)
class Motion:
    """Speed of one axis as a piecewise polynomial, and instants to look at it.

    What shifts the motion by half a sampling interval is taken for bristle damping: differences of two positions at
    500 Hz put it 15 to 30 % high. A spline through the samples shifts nothing.

    Attributes:
        time: (N,) [s] of the record.
        interval: between its rows [s].
        speed: n over time [rad/s].
        source: what it was made of.
        noise: standard deviation of that speed [rad/s], from differences of the samples.
        parts: steps of the friction law per row.
    """

    time: Array
    interval: float
    speed: PPoly
    source: Source
    noise: float
    parts: int

    @property
    def step(self) -> float:
        """Of the friction law [s]."""
        return self.interval / self.parts

    def fine(self, delay: float) -> Array:
        """((N - 1) parts + 1,) speed [rad/s] at the law's instants, `delay` [s] before those of the record.

        What lies before the first sample has the first sample's speed, what lies after the last the last one's.
        """
        count = (len(self.time) - 1) * self.parts + 1
        return self._at(self.time[0] - delay + np.arange(count) * self.step)

    def acceleration(self, delay: float) -> Array:
        """(N,) dn/dt [rad/s2], `delay` [s] before the record's instants; 0 outside of the record."""
        instants = self.time - delay
        inside = (instants >= self.time[0]) & (instants <= self.time[-1])
        return np.where(inside, self.speed(np.clip(instants, self.time[0], self.time[-1]), 1), 0.0)

    def coarse(self, delay: float = 0.0) -> Array:
        """(N,) speed [rad/s], `delay` [s] before the record's instants."""
        return self._at(self.time - delay)

    def _at(self, instants: Array) -> Array:
        return np.asarray(self.speed(np.clip(instants, self.time[0], self.time[-1])), dtype=np.float64)


def noise_of(values: Array) -> float:
    """Standard deviation of white noise on smooth samples (N,), from the median of their fourth differences.

    The median, because the corners that friction makes at reversals are few. Rest, where a quantised signal does not
    change at all, is left out.
    """
    away = np.abs(np.diff(values, DIFFERENCES))
    away = away[away > 0]
    if len(away) == 0:
        return 0.0
    return float(np.median(away)) / 0.6745 / sqrt(comb(2 * DIFFERENCES, DIFFERENCES))


def quiet(values: Array, interval: float, order: int, smoother: float = 1.0) -> Array:
    """Samples (N,) with so much of their noise taken away that their derivative of `order` is usable.

    A low-pass run forwards and backwards (no lag), with the highest cut-off at which the acceleration's noise is a
    hundredth of the acceleration. Samples that are that quiet already stay untouched: reversals are sharp, and every
    low-pass rounds them.

    smoother: factor by which the cut-off lies lower than that; above 1 untouched samples pass just below their
    Nyquist frequency.
    """
    noise, rate = noise_of(values), 1 / interval
    rough = (
        sosfiltfilt(butter(2, ACCELERATION_BAND, fs=rate, output="sos"), values)
        if rate > 4 * ACCELERATION_BAND
        else values
    )
    slope = rough
    for _ in range(order):
        slope = np.gradient(slope, interval)
    allowed = SMOOTHING_NOISE * float(np.sqrt(np.mean(slope**2)))

    def acceleration_noise(cutoff: float) -> float:
        # White noise up to the cut-off, weighted with omega^order.
        return float(noise * (2 * pi * cutoff) ** order * sqrt(2 * cutoff / rate / (2 * order + 1)))

    highest = rate / 2
    cutoff = 0.45 * rate
    if allowed > 0 and acceleration_noise(highest) > allowed:
        cutoff = min(max(highest * (allowed / acceleration_noise(highest)) ** (1 / (order + 0.5)), MIN_CUTOFF), cutoff)
        cutoff /= smoother
    elif smoother == 1:
        return values
    return np.asarray(sosfiltfilt(butter(2, cutoff, fs=rate, output="sos"), values), dtype=np.float64)


def motion(record: Record, source: Source | None = None, *, smoother: float = 1.0) -> Motion:
    """Motion of a record.

    From samples of the speed: the cubic spline through them. From positions: the derivative of the cubic spline
    through them (of fourth order in the interval, like the other). From both, the one that leaves less noise on the
    speed; friction asks for the motor's own speed where they are equally good, as a scale at the slide sees the
    elasticity between. Drift between both matters to nothing here: the friction law forgets.

    Args:
        source: what to make it from; default: as said.
        smoother: as in :func:`quiet`.

    Raises InputError: too few rows, or the record lacks what `source` names.
    """
    if len(record) < 2 * DIFFERENCES:
        raise InputError(f"{record.name}: {len(record)} rows are too few for a motion; at least {2 * DIFFERENCES}")
    if source is not None and getattr(record, source) is None:
        raise InputError(f"{record.name}: the record has no {source}")
    interval = record.interval
    time = record.time[0] + interval * np.arange(len(record))
    result: dict[Source, tuple[PPoly, float]] = {}
    if record.speed is not None and source != "angle":
        result["speed"] = CubicSpline(time, quiet(record.speed, interval, 1, smoother)), noise_of(record.speed)
    if record.angle is not None and source != "speed":
        # sqrt(3)/interval: what the derivative of a cubic spline at its knots makes of white noise, within some per
        # cent (sum over its weights 3 (sqrt(3) - 2)^k / interval).
        noise = noise_of(record.angle) * sqrt(3) / interval
        path = quiet(record.angle - record.angle[0], interval, 2, smoother)
        result["angle"] = CubicSpline(time, path).derivative(), noise
    # 3: the motor's own speed is preferred unless the scale is clearly quieter.
    best = min(result, key=lambda name: (result[name][1] * (1 if name == "speed" else 3), name))
    speed, noise = result[best]
    return Motion(time, interval, speed, best, noise, max(1, ceil(interval / LAW_STEP - 1e-9)))


PAUSE = 0.08  # [s] at rest that parts two stretches; a reversal of a sine down to 1 Hz is over before
REST_SHARE = 1e-3  # of the highest speed: what counts as rest, if it is above the noise
NOISES = 6  # standard deviations of the speed's noise that count as motion
MIN_STRETCH_ROWS = 20  # rows that make a stretch
LEAST_PERIODS = 2.5  # that make a sine
# of the speed's mean square that may be something else: friction bends sines by up to 0.005, ramps are 0.1
SINE_SHARE = 0.03


@dataclass(frozen=True)
class Part:
    """Rows first <= i < last of a record that move.

    Attributes:
        amplitude: of a sine, that of its fundamental; else half the range of the angle [rad].
        frequency: [Hz], nan where it is no sine.
        reversals: number of changes of the direction.
    """

    first: int
    last: int
    kind: Literal["sine", "motion"]
    amplitude: float
    frequency: float
    reversals: int

    @property
    def rows(self) -> slice:
        """Of the record."""
        return slice(self.first, self.last)


def parts(record: Record, motion: Motion) -> tuple[Part, ...]:
    """Stretches of a record in the order of time.

    What rests is left out: a controller creeps there, and the noise of hours at rest must not drown the moves. Where
    the setpoint was recorded, it says when the axis is asked to move; else the speed does.
    """
    speed = motion.coarse()
    moving = _find_moving_rows(record, motion, speed)
    angle = np.asarray(motion.speed.antiderivative()(motion.time), dtype=np.float64)
    result = [
        _part(motion, speed, angle, first, last) for first, last in runs(moving) if last - first >= MIN_STRETCH_ROWS
    ]
    return tuple(result)


def _find_moving_rows(record: Record, motion: Motion, speed: Array) -> NDArray[np.bool_]:
    """(N,) whether the axis moves within half a pause about each row."""
    asked = np.abs(speed) > max(REST_SHARE * float(np.max(np.abs(speed))), NOISES * motion.noise)
    if record.setpoint is not None:
        steps = np.abs(np.diff(record.setpoint, prepend=record.setpoint[0]))
        if np.any(steps > 0):
            # A setpoint that changes makes the axis move; a creeping axis alone does not count.
            asked = steps > REST_SHARE * float(np.max(steps)) * 1e-2
    width = 2 * round(PAUSE / 2 / motion.interval) + 1
    return np.asarray(maximum_filter1d(asked.astype(np.int8), width) > 0)


def _part(motion: Motion, speed: Array, angle: Array, first: int, last: int) -> Part:
    rows = slice(first, last)
    n = speed[rows]
    loud = n[np.abs(n) > max(NOISES * motion.noise, 0.05 * float(np.max(np.abs(n))))]
    reversals = int(np.count_nonzero(np.diff(np.sign(loud))))
    half_range = float(np.ptp(angle[rows])) / 2
    sine = _sine(motion.interval, n, reversals)
    if sine is not None:
        amplitude, frequency = sine
        return Part(first, last, "sine", amplitude, frequency, reversals)
    return Part(first, last, "motion", half_range, nan, reversals)


def _sine(interval: float, speed: Array, reversals: int) -> tuple[float, float] | None:
    """Amplitude of the angle [rad] and frequency [Hz] of the middle half of a stretch; None: it is no sine."""
    if reversals < 2 * LEAST_PERIODS:
        return None
    count = len(speed)
    middle = speed[count // 4 : count - count // 4]
    time = np.arange(len(middle)) * interval
    window = np.hanning(len(middle))
    size = 8 * len(middle)
    spectrum = np.abs(np.fft.rfft((middle - middle.mean()) * window, size))
    start = float(np.argmax(spectrum) / (size * interval))
    if start * time[-1] < 0.8:
        return None

    def columns(frequency: float) -> Array:
        turn = 2 * pi * frequency * time
        return np.column_stack([np.cos(turn), np.sin(turn), np.ones_like(time)])

    def rest(frequency: Array) -> Array:
        shape = columns(float(frequency[0]))
        return np.asarray(middle - shape @ np.linalg.lstsq(shape, middle, rcond=None)[0], dtype=np.float64)

    frequency = float(least_squares(rest, [start], x_scale=start, xtol=1e-8).x[0])
    shape = columns(frequency)
    weights = np.linalg.lstsq(shape, middle, rcond=None)[0]
    remaining = middle - shape @ weights
    if np.mean(remaining**2) > SINE_SHARE * np.mean(middle**2):
        return None
    return float(np.hypot(weights[0], weights[1])) / (2 * pi * frequency), frequency


# --- What the drive's torque ought to be: inertia, load and the friction law on recorded motion, as the log saw it ----


STARTS = ("z", "c")  # state at a record's begin, as shares
START_PRIOR = {"z": 3**-0.5, "c": 12**-0.5}  # standard deviation of what may lie anywhere within its range
QUANTISATION_SHARE = 0.1  # of the noise: steps of samples that are drawn as such; finer ones are white noise
# results of the law kept per record: a difference quotient of another record's start asks for the same again
MAX_CACHED_RESPONSES = 4

# Parameters, and what z and c were at the record's begin, as shares.
Point = tuple[Mapping[str, float], float, float]


def deflection(values: Mapping[str, float]) -> float:
    """Largest bristle deflection at rest, F_S/sigma_0 [rad]."""
    return values["F_S"] / values["sigma_0"]


class RecordTorque:
    """Model of one record's torque, at the rows of its stretches.

    The torque recorded at t is that of t - delay. The motion is looked at earlier by the delay; the noisy torque is
    left as it is. The law runs over the whole record, as it remembers what lies between the stretches too.

    What z and c were when the record began is not known (an axis at rest keeps any of them). They are parameters of
    their own, as shares of what is possible: `z` of F_S/sigma_0, within -1 and 1, `c` of W, within -1/2 and 1/2. How
    much they matter, and for how long, the sensitivities then determine by themselves: after travelling W in one
    direction nothing is left of them.
    """

    def __init__(
        self, record: Record, law: FrictionLaw, *, coarse: bool = False, without: Sequence[Plateau] = ()
    ) -> None:
        """coarse: a step of the law per row, for a first look. without: plateaus whose rows do not count."""
        self.record, self.law = record, law
        self.motion: Motion = motion(record)
        self.count = 1 if coarse else self.motion.parts
        counted = np.ones(len(record), dtype=np.bool_) if record.clipped is None else ~record.clipped
        for plateau in without:
            if plateau.record == record.name:
                counted &= (record.time < plateau.begin) | (record.time > plateau.end)
        moving = [(part, part.first + np.flatnonzero(counted[part.rows])) for part in parts(record, self.motion)]
        moving = [(part, rows) for part, rows in moving if len(rows) >= MIN_STRETCH_ROWS]
        self.parts: tuple[Part, ...] = tuple(part for part, _ in moving)
        chosen = [rows for _, rows in moving]
        self.rows = np.concatenate(chosen) if chosen else np.zeros(0, dtype=np.intp)
        # Which stretch a row belongs to.
        self.stretch = np.repeat(np.arange(len(chosen)), [len(rows) for rows in chosen])
        self.measured = record.torque[self.rows]
        self._law: dict[tuple[float, ...], Array] = {}
        self._prepared: dict[tuple[float, ...], Array] = {}
        self._moved: dict[float, tuple[Array, Array, Array, Array]] = {}

    def recorded_rms(self) -> Array:
        """(stretches,) RMS of the recorded torque [N.m]; never 0, as it is divided by."""
        squares = np.bincount(self.stretch, self.measured**2) / np.bincount(self.stretch)
        return np.asarray(np.sqrt(np.maximum(squares, 1e-30)), dtype=np.float64)

    def friction(self, values: Mapping[str, float], z: float, c: float) -> Array:
        """(rows,) friction torque [N.m] without its viscous part."""
        key = self._key(values, z, c)
        known = self._prepared if key in self._prepared else self._law
        if key not in known:
            if len(self._law) >= MAX_CACHED_RESPONSES:
                del self._law[next(iter(self._law))]
            (self._law[key],) = self.respond(self.moved(values["delay"])[0], [(values, z, c)])
        return known[key]

    def work_ahead(self, points: Sequence[Point], parts: int) -> list[tuple[Array, list[Point]]]:
        """Arguments of :meth:`respond` for what :meth:`friction` is asked for next, in so many parts or more."""
        self._prepared = {}
        new: dict[float, dict[tuple[float, ...], Point]] = {}
        for point in points:
            key = self._key(*point)
            if key not in self._law:
                new.setdefault(point[0]["delay"], {})[key] = point
        result = []
        for delay, asked in new.items():
            alike, fine = list(asked.values()), self.moved(delay)[0]
            result += [(fine, alike[first::parts]) for first in range(min(parts, len(alike)))]
        return result

    def remember(self, points: Sequence[Point], responses: Sequence[Array]) -> None:
        """What :meth:`respond` has returned, until the next work ahead."""
        self._prepared |= {self._key(*point): row for point, row in zip(points, responses, strict=True)}

    def _key(self, values: Mapping[str, float], z: float, c: float) -> tuple[float, ...]:
        """What the friction torque without its viscous part depends on."""
        return (*(values[name] for name in self.law.names if name != "sigma_2"), values["delay"], z, c)

    def respond(self, fine: Array, points: Sequence[Point]) -> list[Array]:
        """(rows,) friction torque [N.m] without its viscous part at points of one delay, whose speed is `fine`.

        Several threads may call it.
        """
        # Linear in sigma_2: that part is added outside and costs no run.
        M_fr = self.law.torques(
            [{name: values[name] for name in self.law.names} | {"sigma_2": 0.0} for values, _, _ in points],
            fine,
            self.record.interval / self.count,
            z=[z * deflection(values) for values, z, _ in points],
            c=[c * values.get("W", 0.0) for values, _, c in points],
            every=self.count,
        )
        return [row[self.rows] for row in M_fr]

    def moved(self, delay: float) -> tuple[Array, Array, Array, Array]:
        """Speed at the law's instants; speed, acceleration and known load at the rows; all `delay` before the log."""
        if delay not in self._moved:
            fine = self.motion.fine(delay)
            step = self.motion.parts
            speed = fine[::step]
            if self.count == 1:
                fine = speed
            load = np.zeros(len(self.rows))
            if self.record.load is not None:
                load = np.interp(self.record.time - delay, self.record.time, self.record.load)[self.rows]
            if len(self._moved) >= MAX_CACHED_RESPONSES:
                del self._moved[next(iter(self._moved))]
            self._moved[delay] = (
                np.ascontiguousarray(fine),
                speed[self.rows],
                self.motion.acceleration(delay)[self.rows],
                load,
            )
        return self._moved[delay]

    def friction_measured(self, values: Mapping[str, float]) -> Array:
        """(rows,) recorded torque less inertia, known and constant load [N.m]."""
        _, _, acceleration, load = self.moved(values["delay"])
        return np.asarray(self.measured - values["J"] * acceleration - load - values["M_0"], dtype=np.float64)

    def friction_model(self, values: Mapping[str, float], z: float, c: float) -> Array:
        """(rows,) friction torque [N.m]."""
        return self.friction(values, z, c) + values["sigma_2"] * self.moved(values["delay"])[1]

    def residual(self, values: Mapping[str, float], z: float, c: float) -> Array:
        """(rows,) model less record [N.m]."""
        return self.friction_model(values, z, c) - self.friction_measured(values)

    def disturbed(self, rng: np.random.Generator) -> RecordTorque | None:
        """The same rows, had the motion that is taken for true been recorded with the record's noise and in its steps;
        None where it has neither."""
        source = self.motion.source
        samples = getattr(self.record, source)
        noise, step = noise_of(samples), resolution(samples)
        if noise == 0:
            return None
        path = self.motion.speed if source == "speed" else self.motion.speed.antiderivative()
        true = np.asarray(path(self.motion.time), dtype=np.float64)
        # Of steps above the noise the steps are drawn: where the axis is slow, their errors hang together in time.
        seen = true + np.sqrt(max(noise**2 - step**2 / 12, 0.0)) * rng.standard_normal(len(true))
        if step > QUANTISATION_SHARE * noise:
            first = rng.uniform(0, step)
            seen = np.round((seen + first) / step) * step - first
        return self._with_motion(motion(replace(self.record, **{source: seen}), source))

    def smoother(self, factor: float) -> RecordTorque:
        """The same rows with the motion smoothed by a low-pass whose cut-off is lower by the factor."""
        return self._with_motion(motion(self.record, self.motion.source, smoother=factor))

    def _with_motion(self, other: Motion) -> RecordTorque:
        moved = copy(self)
        moved.motion = other
        moved._law, moved._prepared, moved._moved = {}, {}, {}
        return moved


def models(
    records: Sequence[Record], law: FrictionLaw, *, coarse: bool = False, without: Sequence[Plateau] = ()
) -> tuple[RecordTorque, ...]:
    """Of the records that move at all."""
    made = (RecordTorque(record, law, coarse=coarse, without=without) for record in records)
    return tuple(model for model in made if len(model.rows))
