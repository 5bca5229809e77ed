"""Levelling mounts from ring-downs: the elements that make simulated stops swing as the recorded ones did.

The units follow the setpoints of each record, and what they leave of its signal while the setpoint stands still is made
least over factors on the elements of all mounts (F = K_e x + friction(F_max, x_2) + Maxwell element (K_v, c), after M.
Berg, Vehicle System Dynamics 30 (1998) 197-212; src/plant_fmu/mount.h). What is left is compared with that of linear
mounts. Beside it, without any model: frequency and damping of every stretch of a ring-down, by a damped oscillation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import exp, nan, pi, sqrt
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d
from scipy.optimize import least_squares
from scipy.signal import butter, sosfiltfilt

from feedsim.estimation.identify.read import read_records
from feedsim.estimation.identify.record import even_pieces, runs
from feedsim.estimation.identify.result import Estimate
from feedsim.estimation.least_squares import (
    LeastSquares,
    Point,
    correlation_length,
    half_width,
    is_determined,
    reason,
    secant,
)
from feedsim.estimation.parameter import Parameter
from feedsim.estimation.replay.closed_loop import AxisRecord, Replay
from feedsim.files.columns import Columns
from feedsim.files.trace import Recording
from feedsim.files.trace.trace import Array
from feedsim.foundation import units
from feedsim.foundation.errors import FeedsimError, Finding, InputError
from feedsim.scenario import Machine, Subject
from feedsim.scenario.structure_checks import load_structure
from feedsim.simulation.cosim import Follower
from feedsim.simulation.nc import Program, plan
from feedsim.structure.build import build
from feedsim.structure.modes import checked_modes, table_of_modes
from feedsim.structure.pose_change import SAME_FREQUENCY, describe_stale_table

MEANINGS = {
    "K_e": "elastic stiffness",
    "F_max": "limit of the friction force",
    "x_2": "deflection at which half of the friction is reached",
    "K_v": "stiffness of the viscous part",
    "c": "damper of the viscous part",
}
LINEAR = ("K_e", "K_v", "c")  # what a mount without friction has
REST_WAY, REST_TIME = 1e-6, 0.15  # a setpoint stands still that stays within so many m for so many s
SPANS = (0.12, 0.3, np.inf)  # [s] of the ring-downs that are fitted, one after the other: no swing is missed by one
PRIOR = 1.0  # standard deviation of the logarithm of a factor about that of the machine file
RANGE = 2.3  # of that logarithm, to either side
# Of differences, of that logarithm: friction of the axes makes the ring-downs jump a little where a reversal comes to
# lie in another step; across that the slopes are true to 1 %.
DIFFERENCES = {"K_e": 1e-2, "F_max": 2e-2, "x_2": 2e-2, "K_v": 1e-2, "c": 1e-2}
COARSE_TOLERANCE, FINE_TOLERANCE = 3e-3, 1e-5  # share of the cost: predicted reduction of a step at which a search ends
# Sum of squares, of unit variance, by which friction in the mounts has to be the better explanation: two parameters
# more, one of them at its bound, gain that with a chance below 1e-5.
CLEAR_LIKELIHOOD_GAIN = 25.0
# Gauss-Newton steps that finish a search, until one gains less than FINISHED of the sum of squares; ways of positions
# that differences are taken over.
MOST_FINISHING, FINISHED, SMALLEST_WAY, LARGEST_WAY = 6, 0.05, 1e-3, 0.4
LOW_PASS = 80.0  # [Hz] of accelerations: the mounts' modes lie far below, those of the frame above
STRETCH_SWINGS, HOP_SWINGS = 2.0, 0.5  # swings that a stretch of a ring-down holds, and from one to the next
LEAST_FREQUENCY, MOST_FREQUENCY = 4.0, 60.0  # [Hz] of modes on mounts
G = 9.80665  # [m/s^2]
CLEAR_RATIO = 3.0  # standard deviations of the noise: least amplitude of a stretch
SHARP_HALF_WIDTH = 0.04  # half of the interval of a stretch's frequency that is shown, over the frequency


@dataclass(frozen=True, eq=False)
class StopLog:
    """A record of stops, and the setpoints that lead to them.

    Attributes:
        name: of the file. signal: column of the simulation that it is, "Z.x_a", "Z.n_a", or "tool.x_Z", whose
            acceleration it is then. unit: of the values, SI.
        time: (N,) even, from 0 at the first row [s]. values: (N,).
        program: setpoints of the run. pose: where its axes start [m]. lead: time of the run at the first row [s].
        aligned: whether the clock is that of the setpoints; else by how much it is off is found, too.
    """

    name: str
    signal: str
    unit: str
    time: Array
    values: Array
    program: Program
    pose: Mapping[str, float]
    lead: float
    aligned: bool = True

    @property
    def accelerometer(self) -> bool:
        """Whether it is of an accelerometer at the tool."""
        return self.signal.startswith("tool.")


@dataclass(frozen=True, eq=False)
class Swing:
    """A stretch of a ring-down as a damped oscillation: amplitude at its begin in the signal's unit, frequency [Hz],
    damping ratio [1], each with its standard deviation."""

    time: float
    amplitude: float
    frequency: float
    damping: float
    frequency_sigma: float
    damping_sigma: float


@dataclass(frozen=True, eq=False)
class RingDown:
    """A stop.

    Attributes:
        name: of the record, and which stop of it. unit: of the signal.
        time: (N,) from when the setpoint stands still [s]. recorded, simulated, before: (N,) about their means: of the
            record, with the mounts that were found, and with those of the machine file.
        deflection: largest of a mount in the run up to here [m].
        recorded_swings, simulated_swings: stretch by stretch.
        noise: standard deviation of what is left, as many rows as are correlated counted as one.
    """

    name: str
    unit: str
    time: Array
    recorded: Array
    simulated: Array
    before: Array
    deflection: float
    recorded_swings: Sequence[Swing]
    simulated_swings: Sequence[Swing]
    noise: float

    @property
    def remaining(self) -> float:
        """What the simulation leaves of the record, root mean square."""
        return float(np.sqrt(np.mean((self.simulated - self.recorded) ** 2)))


Verdict = Literal["not linear", "linear", "open"]


@dataclass(frozen=True, eq=False)
class FoundMounts:
    """What ring-downs say of the mounts.

    Attributes:
        estimates: K_e, F_max, x_2, K_v, c as factors on the table of the machine file [1].
        factors: what a run takes: of what is not determined the value that goes with the others.
        verdict: "open": linear mounts and those of the machine file explain the records about equally well.
        gain: sum of squares, of unit variance, by which mounts with friction leave less than linear ones.
        ring_downs: the stops.
        runs: of the units.
    """

    estimates: Mapping[str, Estimate]
    factors: Mapping[str, float]
    verdict: Verdict
    gain: float
    ring_downs: Sequence[RingDown]
    runs: int


def read_stops(
    recording: Recording,
    subject: Subject,
    axis: str | None,
    mapping: Columns | None = None,
    *,
    prefer: str = "",
    accelerometer: Accelerometer | None = None,
    jerk: float | None = None,
) -> tuple[StopLog, Sequence[Finding]]:
    """A record of stops, and what a user should know of it.

    axis: that moves; None: that of the mapping, or the only one. prefer: "position" or "speed" where both are recorded.
    accelerometer: at the tool, in place of both. Its setpoints are those of the scenario of the subject, on a clock of
    their own; of a machine those in the record. jerk: of the scenario's path [m/s^3].

    Raises InputError: as read_records; no setpoint; no such column.
    """
    machine = subject.machine
    if accelerometer is not None and subject.scenario is not None:
        scenario = subject.scenario
        if jerk is not None:
            path = machine.path.model_copy(update={"jerk": jerk})
            machine = machine.model_copy(update={"path": path})
            scenario = scenario.model_copy(update={"machine": machine})
        time, values = accelerometer.read(recording)
        program = plan(scenario)
        return StopLog(
            recording.path.name, accelerometer.signal, "m/s^2", time, values, program, {}, 0.0, aligned=False
        ), recording.notes  # fmt: skip
    read = read_records(recording, mapping, axis, machine, driven=False)
    record = max(read.records, key=len)
    if record.setpoint is None:
        raise InputError(
            f"{recording.path}: no position setpoint is read; the simulation follows it. Name its column in a mapping "
            "file: setpoint: {column: ..., unit: mm}"
        )
    own = read.provenance.axis or next(iter(machine.axes))
    I_P = machine.axes[own].I_P
    replay = Replay(machine, {own: AxisRecord(own, record, I_P, np.ones(len(record), dtype=np.bool_))})
    time = record.time - record.time[0]
    if accelerometer is not None:
        clock, values = accelerometer.read(recording)
        first = int(np.searchsorted(clock, record.time[0] - 0.5 * record.interval))
        signal, unit, values = accelerometer.signal, "m/s^2", values[first : first + len(time)]
    elif record.angle is None or (prefer == "speed" and record.speed is not None):
        assert record.speed is not None
        signal, unit, values = f"{own}.n_a", "rad/s", record.speed
    else:
        signal, unit, values = f"{own}.x_a", "m", I_P * record.angle
    log = StopLog(record.name, signal, unit, time, values, replay.program(machine), replay.pose, float(replay.lead))
    return log, read.provenance.warnings


@dataclass(frozen=True)
class Accelerometer:
    """An accelerometer at the tool: direction X, Y or Z of the machine, column, unit ("": as the file has it)."""

    direction: str
    column: str
    unit: str = ""

    @property
    def signal(self) -> str:
        """Column of the simulation."""
        return f"tool.x_{self.direction}"

    def read(self, recording: Recording) -> tuple[Array, Array]:
        """(N,) even time [s] and (N,) acceleration [m/s^2]. InputError: no such column, no time, no acceleration."""
        name = recording.called(self.column)
        if name is None:
            raise InputError(f"{recording.header}: no column {self.column!r}; there is {recording.there}")
        if (clock := recording.clock()) is None:
            raise InputError(f"{recording.header}: no column of time; there is {recording.there}")
        unit = self.unit or recording.units[name]
        try:
            factor = G if unit in ("g", "G") else float(units.factor(unit or "1", "m/s^2"))
        except InputError as error:
            raise InputError(
                f"{recording.header}: column {name!r}: {error}; give it: {self.direction}={name}:m/s^2, or :g"
            ) from None
        read = recording.read([clock[0], name])
        pieces, _ = even_pieces(clock[1] * read[clock[0]], recording.row)
        piece = max(pieces, key=lambda one: one.last - one.first)
        return piece.time - piece.time[0], factor * read[name][piece.first : piece.last]


def with_accelerometer(machine: Machine) -> Machine:
    """The machine whose tool signals are those of an accelerometer, the absolute motion of the tool in place of that
    against the workpiece.

    Raises InputError: no structure of beams and masses, or another one than that of the table of modes.
    """
    if machine.structure is None:
        raise InputError(
            f"{machine.name}: an accelerometer at the tool measures its absolute motion, which follows from the "
            "structure; the machine has no key structure"
        )
    structure = load_structure(machine.structure)
    built = build(structure, {axis: machine.pose[axis] for axis in machine.axes})
    tool, modes = built.assembly.tool, checked_modes(machine.model_copy(update={"mounts": None}))
    if tool is None:
        raise InputError(
            f"{machine.structure}: of matrices the absolute motion of the tool is not known; beams are needed"
        )
    if how := describe_stale_table(modes, built.solution.modes, SAME_FREQUENCY):
        raise InputError(f"{machine.modes}: is not the table of {machine.structure} at the pose of the machine: {how}")
    shapes = tool @ built.solution.shapes[:, : len(modes.frequency)]
    if shapes.shape[1] < len(modes.frequency):
        raise InputError(f"{machine.modes}: has pseudo-modes, or is cut off above that of {machine.structure}")
    ports = dict(modes.ports) | {f"tcp_{letter}": row for letter, row in zip("XYZ", shapes, strict=True)}
    return machine.model_copy(update={"modes": table_of_modes(replace(modes, ports=ports), machine.modes.file)})


def rests(program: Program) -> list[tuple[float, float]]:
    """Begin and end [s] of every rest behind a motion: no setpoint leaves REST_WAY for REST_TIME."""
    T = float(program.time[1] - program.time[0])
    count = max(round(REST_TIME / T), 1)
    still = np.ones(len(program.time) - count, dtype=np.bool_)
    for x in program.x_s.values():
        ahead = [
            f(x, count + 1, origin=-((count + 1) // 2))[: len(still)] for f in (maximum_filter1d, minimum_filter1d)
        ]
        still &= ahead[0] - ahead[1] < REST_WAY
    return [
        (float(program.time[first]), float(program.time[last - 1 + count])) for first, last in runs(still) if first > 0
    ]


class Stops:
    """Records of stops and a machine whose mounts swing behind them; its units stay open until it is closed."""

    def __init__(self, machine: Machine, logs: Sequence[StopLog], fmus: Path | None = None) -> None:
        self.machine, self.logs, self.runs = machine, list(logs), 0
        self.begin = start_factors(machine)
        self._follower = Follower(fmus=fmus)
        self._kept: dict[tuple[int, tuple[float, ...]], tuple[Array, Array, float]] = {}
        self.recorded = [
            _low_passed(log.values, float(log.time[1] - log.time[0])) if log.accelerometer else log.values
            for log in self.logs
        ]
        self.shifts = [0.0 if log.aligned else self._shift(k) for k, log in enumerate(self.logs)]
        self.rows: list[tuple[int, NDArray[np.int64], float]] = []  # log, rows, begin [s of the run]
        for k, log in enumerate(self.logs):
            at = log.time + log.lead + self.shifts[k]
            for begin, end in rests(log.program):
                rows = np.asarray(np.flatnonzero((at >= begin) & (at <= end)), dtype=np.int64)
                if len(rows) > 20 and at[rows[-1]] - at[rows[0]] > REST_TIME:
                    self.rows.append((k, rows, begin))
            if not any(own == k for own, _, _ in self.rows):
                raise InputError(
                    f"{log.name}: no stop with {1e3 * REST_TIME:.0f} ms of rest behind it; a ring-down is recorded "
                    "while the setpoint stands still behind a motion"
                )
        self.weights = [self._noise(self.recorded[k][rows]) for k, rows, _ in self.rows]

    def close(self) -> None:
        """End the units."""
        self._follower.close()

    @staticmethod
    def _noise(values: Array) -> float:
        """Standard deviation to begin with, of second differences."""
        jumps = np.diff(values, 2)
        return max(
            float(np.median(np.abs(jumps - np.median(jumps)))) / (0.6745 * sqrt(6)), 1e-2 * float(np.std(values))
        )

    def simulated(self, k: int, values: Mapping[str, float]) -> tuple[Array, Array, float]:
        """Time of the run [s], the signal of log k, and the largest deflection of a mount [m], with these factors."""
        whole = self.begin | dict(values)
        key = k, tuple(whole.values())
        if key not in self._kept:
            log, T_c = self.logs[k], self.machine.cycles.T_c
            assert self.machine.mounts is not None
            mounts = self.machine.mounts.model_copy(update=whole)
            machine = self.machine.model_copy(update={"mounts": mounts, "pose": {**self.machine.pose, **log.pose}})
            trace = self._follower.follow(machine, log.program, [log.signal, "mounts.x_max"], T_c)
            self.runs += 1
            signal = np.array(trace[log.signal])
            if log.accelerometer:
                signal = _low_passed(np.gradient(np.gradient(signal, T_c), T_c), T_c)
            if len(self._kept) > 4 * len(self.logs):
                self._kept.pop(next(iter(self._kept)))
            self._kept[key] = np.array(trace.time), signal, float(trace["mounts.x_max"][-1])
        return self._kept[key]

    def _shift(self, k: int) -> float:
        """By how much the run is ahead of a record with a clock of its own [s]: where both go together best."""
        log = self.logs[k]
        time, signal, _ = self.simulated(k, {})
        h = float(log.time[1] - log.time[0])
        own = np.interp(np.arange(0.0, float(time[-1]), h), time, signal)
        together = np.correlate(self.recorded[k] - np.mean(self.recorded[k]), own - np.mean(own), "full")
        return (len(own) - 1 - int(np.argmax(together))) * h

    def errors(self, values: Mapping[str, float]) -> list[Array]:
        """What is left of every stop about its mean, in the unit of its signal."""
        result = []
        for i, (k, rows, begin) in enumerate(self.rows):
            log = self.logs[k]
            time, signal, _ = self.simulated(k, values)
            at = begin + self.since(i)
            error = np.interp(at, time, signal) - self.recorded[k][rows]
            if not log.aligned:  # and with the rest of the shift that fits best
                slope = np.interp(at, time, np.gradient(signal, time))
                slope = slope - np.mean(slope)
                error = error - slope * float(slope @ (error - np.mean(error)) / max(slope @ slope, 1e-300))
            result.append(np.asarray(error - np.mean(error), dtype=np.float64))
        return result

    def problem(self, free: Sequence[str], fixed: Mapping[str, float], span: float = np.inf) -> LeastSquares:
        """Least squares over the free factors, the first `span` [s] of every stop counting; fixed: the others."""
        parameters = [
            Parameter(
                name, self.begin[name], self.begin[name] * exp(-RANGE), self.begin[name] * exp(RANGE), PRIOR,
                log=True, origin=self.begin[name],
            )
            for name in free
        ]  # fmt: skip
        weights = [np.where(self.since(i) <= span, weight, np.inf) for i, weight in enumerate(self.weights)]
        return LeastSquares(
            lambda values: np.concatenate(self.errors({**fixed, **values})), parameters,
            np.array([DIFFERENCES[name] for name in free]), np.array, np.concatenate(weights),
        )  # fmt: skip

    def since(self, stop: int) -> Array:
        """(N,) time of a stop's rows since its setpoint stands still [s]."""
        k, rows, begin = self.rows[stop]
        return np.asarray(self.logs[k].time[rows] + self.logs[k].lead + self.shifts[k] - begin)

    def searched(
        self,
        starts: Sequence[Mapping[str, float]],
        free: Sequence[str],
        progress: Callable[[], None],
        tolerance: float = FINE_TOLERANCE,
    ) -> tuple[dict[str, float], Point]:
        """All factors and where the search ends: from the best start, over longer and longer ring-downs."""
        problems = [self.problem(free, start, SPANS[0]) for start in starts]
        costs = [self._cost(one, one.position(start)) for one, start in zip(problems, starts, strict=True)]
        values = dict(starts[int(np.argmin(costs))])
        slopes = np.full((sum(len(rows) for _, rows, _ in self.rows), len(free)), nan)
        for span in SPANS:
            progress()
            problem = self.problem(free, values, span)
            point = secant(problem, problem.position(values), slopes, COARSE_TOLERANCE if span < np.inf else tolerance)
            slopes, values = point.slopes, values | problem.values(point.x)
        return values, point

    @staticmethod
    def finished(problem: LeastSquares, point: Point) -> tuple[dict[str, float], Array]:
        """Free factors and the covariance (P, P) of their positions where a search has ended.

        The residuals jump a little where a reversal of an axis' friction comes to lie in another step, which spoils
        differences over a small way in directions that hardly matter. So Gauss-Newton steps are taken with differences
        along the axes of the ellipsoid of the step before, a standard deviation to either side.
        """

        def residuals(x: Array) -> Array:
            return problem.weighted(x, problem.errors(x))

        x, here = point.x, problem.weighted(point.x, point.errors)
        ways = np.diag(problem.steps)
        for k in range(MOST_FINISHING):
            ends = [[np.clip(x + side * way, problem.low, problem.high) for side in (1, -1)] for way in ways.T]
            slopes = np.column_stack([(residuals(ahead) - residuals(behind)) / 2 for ahead, behind in ends])
            ways = np.column_stack([(ahead - behind) / 2 for ahead, behind in ends])
            normal = slopes.T @ slopes
            step = -np.linalg.lstsq(normal, slopes.T @ here, rcond=None)[0]
            covariance = ways @ np.linalg.pinv(normal) @ ways.T
            ahead = np.clip(x + ways @ step, problem.low, problem.high)
            there = residuals(ahead)
            if there @ there < here @ here:
                x, here = ahead, there
            if k > 0 and step @ normal @ step < FINISHED:
                break
            sizes, axes = np.linalg.eigh(covariance)
            ways = axes * np.clip(np.sqrt(np.maximum(sizes, 0.0)), SMALLEST_WAY, LARGEST_WAY)
        return problem.values(x), covariance

    @staticmethod
    def _cost(problem: LeastSquares, x: Array) -> float:
        try:
            return problem.cost(x, problem.errors(x))
        except FeedsimError:  # mounts that hold nothing, or are too stiff for the step
            return np.inf

    def squares(self, values: Mapping[str, float]) -> float:
        """Sum of squares that is left, of unit variance."""
        return float(sum(np.sum((e / w) ** 2) for e, w in zip(self.errors(values), self.weights, strict=True)))

    def weigh(self, values: Mapping[str, float]) -> None:
        """Take what is left with these factors as noise, as many rows as are correlated as one."""
        self.weights = [sqrt(float(np.mean(error**2)) * correlation_length(error)) for error in self.errors(values)]


def identify_mounts(
    machine: Machine,
    logs: Sequence[StopLog],
    fmus: Path | None = None,
    progress: Callable[[str, int, int], None] = lambda what, done, total: None,
) -> FoundMounts:
    """Factors on the elements of all mounts of a machine, by the ring-downs of records.

    Raises:
        InputError: the machine's mounts are linear; a record without a stop.
        SimulationError: a unit failed with the mounts of the machine file.
    """
    stops = Stops(machine, logs, fmus)
    try:
        return _identify_mounts(stops, progress)
    finally:
        stops.close()


def _identify_mounts(stops: Stops, progress: Callable[[str, int, int], None]) -> FoundMounts:
    names, begin = tuple(MEANINGS), stops.begin
    steps = iter(range(1000))

    def step() -> None:
        progress("fit", next(steps), 2 * len(SPANS) + 2)

    before = stops.errors({})  # a unit that fails here fails with a message
    stiffer = [begin | {"K_e": begin["K_e"] * e, "F_max": begin["F_max"] * f}
               for e in (0.5, 0.7, 1.0, 1.4, 2.0) for f in (0.4, 1.0, 2.0)]  # fmt: skip
    values, point = stops.searched(stiffer, names, step)
    for _ in range(2):
        stops.weigh(values)
        problem = stops.problem(names, values)
        point = secant(problem, point.x, point.slopes, FINE_TOLERANCE)
        values = problem.values(point.x)
    step()
    values, covariance = stops.finished(problem, point)
    springs = [begin | {"F_max": 0.0, "K_e": begin["K_e"] * e} for e in (0.5, 0.75, 1.0, 1.3, 1.7, 2.2, 3.0)]
    linear, line = stops.searched(springs, LINEAR, step)
    least = stops.squares(values)
    gain = stops.squares(linear) - least
    verdict: Verdict = "not linear"
    free: Sequence[str] = names
    if gain < CLEAR_LIKELIHOOD_GAIN:
        own, _ = stops.searched(
            [values | {"F_max": begin["F_max"], "x_2": begin["x_2"]}], LINEAR, lambda: None, COARSE_TOLERANCE
        )
        verdict = "linear" if stops.squares(own) - least > CLEAR_LIKELIHOOD_GAIN else "open"
    if verdict == "linear":
        free = LINEAR
        values, covariance = stops.finished(stops.problem(LINEAR, linear), line)
        values = linear | values
    sigmas = {name: values[name] * PRIOR * sqrt(covariance[k, k]) for k, name in enumerate(free)}
    estimates = {name: _estimate(name, values[name], sigmas.get(name, nan), verdict) for name in names}
    step()
    return FoundMounts(estimates, values, verdict, gain, _ring_downs(stops, values, before), stops.runs)


def start_factors(machine: Machine) -> dict[str, float]:
    if machine.mounts is None:
        raise InputError(
            f"{machine.name}: its mounts are springs; mounts are identified by a table of them (key mounts of the "
            "machine file, written by machine build), whose friction and viscous part are the start"
        )
    given = machine.mounts.parameters()
    return {name: float(given.get(name, 1.0)) for name in MEANINGS}


def _estimate(name: str, value: float, sigma: float, verdict: Verdict) -> Estimate:
    whole = Estimate(name, value, "1", f"{MEANINGS[name]}, as a share of that in the table of mounts")
    if not sigma >= 0:
        why = "the ring-downs are those of linear mounts, without friction"
        return replace(whole, status="undetermined", reason=why)
    if verdict == "open":
        why = "linear mounts explain the ring-downs about as well: their amplitudes are too small, or too much alike"
        return replace(whole, sigma=sigma, status="undetermined", reason=why)
    if not is_determined(value, half_width(sigma)):
        why = f"{reason(value, half_width(sigma))}: stops at a further jerk, with other amplitudes, determine it"
        return replace(whole, sigma=sigma, status="undetermined", reason=why)
    return replace(whole, sigma=sigma)


# --- Frequency and damping over amplitude, without a model of the machine ---------------------------------------------


def swings(time: Array, values: Array, frequency: float) -> list[Swing]:
    """Stretches of a ring-down (N,) that swings at about `frequency` [Hz], each fitted by
    a + b t + exp(-D w t)(C cos(w' t) + S sin(w' t)), w' = w sqrt(1 - D^2), w = 2 pi f.

    Stretches overlap; intervals are those of white noise of the scatter that is left. Stretches whose frequency is not
    known to SHARP are left out.
    """
    result: list[Swing] = []
    length, hop = STRETCH_SWINGS / frequency, HOP_SWINGS / frequency
    begin = float(time[0]) + HOP_SWINGS / frequency  # what the position loop makes of the stop has died away
    while begin + length <= time[-1]:
        rows = (time >= begin) & (time < begin + length)
        one = _fit_swing(time[rows] - begin, values[rows], result[-1].frequency if result else frequency)
        if one is not None:
            result.append(replace(one, time=begin))
        elif result:  # it has died away
            break
        begin += hop
    return result


def _fit_swing(t: Array, y: Array, frequency: float) -> Swing | None:
    size = float(np.std(y))
    if len(t) < 12 or not size > 0:
        return None

    def columns(f: float, D: float) -> Array:
        w = 2 * pi * f
        decay, turn = np.exp(-D * w * t), w * sqrt(max(1 - D * D, 1e-6)) * t
        return np.column_stack([np.ones_like(t), t / t[-1], decay * np.cos(turn), decay * np.sin(turn)])

    def remaining(p: Array) -> Array:
        A = columns(*p)
        return np.asarray((A @ np.linalg.lstsq(A, y, rcond=None)[0] - y) / size)

    bounds = ([0.5 * frequency, -0.2], [2.0 * frequency, 0.6])
    end = least_squares(remaining, [frequency, 0.05], bounds=bounds, x_scale=[frequency, 0.1])
    variance = 2 * end.cost * size**2 / max(len(t) - 6, 1)
    A = columns(*end.x)
    linear = np.linalg.lstsq(A, y, rcond=None)[0]
    h = np.array([1e-5 * frequency, 1e-6])
    slopes = [(columns(*(end.x + d)) - columns(*(end.x - d))) @ linear / (2 * h[k]) for k, d in enumerate(np.diag(h))]
    covariance = np.linalg.pinv(np.column_stack([*slopes, A]).T @ np.column_stack([*slopes, A])) * variance
    sigma = np.sqrt(np.maximum(np.diag(covariance)[:2], 0.0))
    amplitude = float(np.hypot(linear[2], linear[3]))
    if (
        not half_width(sigma[0]) < SHARP_HALF_WIDTH * end.x[0]
        or np.any(end.active_mask)
        or amplitude < CLEAR_RATIO * sqrt(variance)
    ):
        return None
    return Swing(nan, amplitude, float(end.x[0]), float(end.x[1]), float(sigma[0]), float(sigma[1]))


def main_frequency(time: Array, values: Array) -> float:
    """The strongest frequency [Hz] of a ring-down between LEAST_FREQUENCY and MOST_FREQUENCY."""
    bent = values - np.polyval(np.polyfit(time, values, 1), time)
    frequency = np.arange(LEAST_FREQUENCY, MOST_FREQUENCY, 0.1)
    return float(
        frequency[np.argmax(np.abs(np.exp(-2j * pi * np.outer(frequency, time)) @ (np.hanning(len(bent)) * bent)))]
    )


def _ring_downs(stops: Stops, values: Mapping[str, float], before: Sequence[Array]) -> list[RingDown]:
    result = []
    after = stops.errors(values)
    for i, (k, rows, begin) in enumerate(stops.rows):
        log = stops.logs[k]
        recorded = stops.recorded[k][rows]
        recorded = recorded - np.mean(recorded)
        time = log.time[rows] + log.lead + stops.shifts[k] - begin
        frequency = main_frequency(time, recorded + after[i])
        own = [number for number, (of, _, _) in enumerate(stops.rows) if of == k]
        name = log.name if len(own) == 1 else f"{log.name}, stop {own.index(i) + 1}"
        result.append(
            RingDown(
                name, log.unit, time, recorded, recorded + after[i], recorded + before[i],
                stops.simulated(k, values)[2],
                swings(time, recorded, frequency), swings(time, recorded + after[i], frequency), stops.weights[i],
            )
        )  # fmt: skip
    return result


def _low_passed(values: Array, h: float) -> Array:
    return np.asarray(sosfiltfilt(butter(4, LOW_PASS, fs=1 / h, output="sos"), values), dtype=np.float64)
