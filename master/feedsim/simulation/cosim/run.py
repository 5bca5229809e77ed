"""Run a scenario on the units: plan the motion, build the system, exchange at the control cycle, record."""

from __future__ import annotations

import math
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from feedsim.files.trace import Table, Trace, least_and_largest, release, stretches
from feedsim.foundation.errors import Finding, InputError, SimulationError
from feedsim.foundation.installation import fmus_directory
from feedsim.foundation.outputs import BlockResource
from feedsim.scenario import Coupling, Drive, Level, Logging, Machine, Scenario
from feedsim.simulation.cosim.exchange import any_foreign, choose_native_loop
from feedsim.simulation.cosim.feedforward import TorqueFeedforward, feeders
from feedsim.simulation.cosim.loads import ActingLoad, Loads, Work, compute_acting_loads
from feedsim.simulation.cosim.recording import Recording, Sink, columns_of, loaded_inputs, recorded_columns
from feedsim.simulation.cosim.schedule import Cycle, Loop, Progress, Setpoints
from feedsim.simulation.cosim.system import System
from feedsim.simulation.cosim.unit import Floats
from feedsim.simulation.cosim.whole import cycle_of, system_of
from feedsim.simulation.cosim.worker import deliver
from feedsim.simulation.nc import Program, plan
from feedsim.structure.modes import checked_modes
from feedsim.structure.pack import POSES_IN_ARCHIVE

if TYPE_CHECKING:
    from feedsim.structure.poses import GridAxis

# --- The log of a run as a control records it: sampled, delayed, disturbed by noise, rounded --------------------------
# Sampling is at instants, without a filter ahead of it. What a signal is between two control cycles is known exactly,
# or
# to far below a log's resolution: currents and motor torque run linearly over a cycle (so is the drive computed),
# setpoints are held, position and speed are smooth and interpolated by a cubic through four cycles.


LINEAR_SIGNALS = ("i_d", "i_q", "M_a", "M_fr", "z", "c")
SMOOTH_SIGNALS = ("x_a", "n_a")
# Signals of the drive that jump where the current loop is ideal: what a cycle ends with holds over all of it.
IDEAL_LOOP_SIGNALS = ("i_d", "i_q", "M_a")
ON_THE_GRID = 1e-6  # of a control cycle: instants come from decimal text
# Below this share of the largest speed setpoint an axis stands: the spline of the setpoints rings down exponentially.
STANDSTILL_SHARE = 1e-9
# Rows that are worked on at a time.
ROWS_AT_ONCE = 1 << 19


def log(fine: Trace, logging: Logging, ideal: Sequence[str] = (), scratch: Path | None = None) -> Trace:
    """The log of signals at the control cycle: columns "A.signal", a row per logging interval, the first at 0.

    fine: columns "A.signal" at k T_c from 0; with A.n_ffw where noise is given as a share. Before the start every
    signal has been as it is at 0. Noise of every signal is a random stream of its own, made of the seed and
    the column's name. scratch: folder for the file that holds a long log.
    """
    cycle = float(fine.time[-1] - fine.time[0]) / max(len(fine) - 1, 1)
    every = round(logging.interval / cycle)
    if every < 1 or abs(logging.interval / cycle - every) > ON_THE_GRID * every:
        raise InputError(
            f"logging.interval: {logging.interval:.9g} s is no whole multiple of the signals' cycle, {cycle:.9g} s"
        )
    rows = -(-len(fine) // every)
    noise, steps, delays = logging.noise.given(), logging.quantisation.given(), logging.delay.given()
    axes = logging.axes or dict.fromkeys(name.partition(".")[0] for name in fine)
    names = [(axis, signal) for axis in axes for signal in logging.signals]
    logs = []
    for axis, signal in names:
        name = f"{axis}.{signal}"
        course, delay = _course(signal, axis in ideal), delays.get(signal, 0.0) / cycle
        deviation = _deviation(noise[signal], fine, axis, name) if signal in noise else None
        logs.append(_Column(fine[name], course, delay, deviation, _stream(logging.seed, name), steps.get(signal)))
    table = Table(1 + len(logs), rows, scratch)
    for first in range(0, rows, ROWS_AT_ONCE):
        at = np.arange(first, min(first + ROWS_AT_ONCE, rows)) * every
        table.append(np.array([at * cycle, *(column.at(at) for column in logs)]))
        release(*(column.values for column in logs))
    time, *columns = table.columns()
    result = {f"{axis}.{signal}": column for (axis, signal), column in zip(names, columns, strict=True)}
    return Trace(time, result, {name: fine.unit(name) for name in result})


@dataclass(frozen=True, eq=False)
class _Column:
    """A signal at the control cycle, and what becomes of it on its way into a log."""

    values: Floats
    course: str
    delay: float  # cycles
    deviation: float | None  # of the noise
    stream: np.random.Generator
    quantum: float | None

    def at(self, rows: NDArray[np.int64]) -> Floats:
        """The log at the next of its rows."""
        values = sample_delayed(self.values, rows, self.delay, self.course)
        if self.deviation is not None:
            values = values + self.deviation * self.stream.standard_normal(len(values))
        if self.quantum is not None:
            values = np.round(values / self.quantum) * self.quantum
        return values


def sample_delayed(values: Floats, rows: NDArray[np.int64], delay: float, course: str) -> Floats:
    """Values (N,) at the cycles ``rows`` less ``delay`` [cycles, any fraction].

    course: "linear" between cycles, "cubic" (Lagrange through four of them), "held" from a cycle on, "ahead": held from
    the cycle before.
    """
    at = np.maximum(rows - delay, 0.0)
    nearest = np.rint(at)
    at = np.where(np.abs(at - nearest) <= ON_THE_GRID, nearest, at)
    before = np.floor(at).astype(np.int64)
    share = at - before
    last = len(values) - 1
    after = np.minimum(before + 1, last)
    if course == "held" or not share.any():
        return np.asarray(values[before])
    if course == "ahead":
        return np.asarray(np.where(share > 0, values[after], values[before]))
    if course == "linear" or len(values) < 4:
        return np.asarray(values[before] + share * (values[after] - values[before]))
    first = np.clip(before - 1, 0, last - 3)
    u = at - first
    # Differences from the first point keep the digits of a small motion far from the origin.
    origin = values[first]
    d1, d2, d3 = (values[first + i] - origin for i in (1, 2, 3))
    cubic = d1 * u * (u - 2) * (u - 3) / 2 - d2 * u * (u - 1) * (u - 3) / 2 + d3 * u * (u - 1) * (u - 2) / 6
    return np.asarray(np.where(share > 0, origin + cubic, values[before]))


def logged_axes(scenario: Scenario) -> tuple[str, ...]:
    """Axes of a scenario's log, in the machine's order unless named."""
    if scenario.logging is None:
        return ()
    moved = {axis for motion in scenario.motions for axis in motion.axes}
    if not all(motion.names_axes for motion in scenario.motions):
        moved = set(scenario.machine.axes)
    return scenario.logging.axes or tuple(axis for axis in scenario.machine.axes if axis in moved)


def ideal_axes(scenario: Scenario) -> tuple[str, ...]:
    """Axes with an ideal current loop. Of another maker's drive that is not known; its torque counts as linear."""
    drives = {name: axis.drive for name, axis in scenario.machine.axes.items()}
    return tuple(name for name, drive in drives.items() if isinstance(drive, Drive) and drive.ideal_current_loop)


def full_rate_columns(scenario: Scenario) -> tuple[str, ...]:
    """What must be recorded at the control cycle for a scenario's log; none without one.

    The setpoints show when an axis moves.
    """
    if scenario.logging is None:
        return ()
    return tuple(
        f"{axis}.{signal}"
        for axis in logged_axes(scenario)
        for signal in dict.fromkeys(("x_s", "n_ffw", *scenario.logging.signals))
    )


def _course(signal: str, ideal: bool) -> str:
    if ideal and signal in IDEAL_LOOP_SIGNALS:
        return "ahead"
    return "linear" if signal in LINEAR_SIGNALS else "cubic" if signal in SMOOTH_SIGNALS else "held"


def _deviation(level: Level, fine: Trace, axis: str, name: str) -> float:
    if not level.relative:
        return level.value
    speed = fine[f"{axis}.n_ffw"]
    stands = STANDSTILL_SHARE * max(abs(end) for end in least_and_largest(speed))
    means: list[float] = []
    counts: list[int] = []
    for n, values in stretches(speed, fine[name], rows=ROWS_AT_ONCE):
        if (moving := np.abs(n) > stands).any():
            means.append(float(np.mean(values[moving] ** 2)))
            counts.append(int(np.count_nonzero(moving)))
    # A single stretch keeps the digits of its mean.
    mean = means[0] if len(means) == 1 else float(np.dot(means, counts)) / max(sum(counts), 1)
    return level.value * math.sqrt(mean)


def _stream(seed: int, name: str) -> np.random.Generator:
    """A random stream that depends on the seed and the name alone."""
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=tuple(name.encode()))))


# --- Which axis was the first to leave its setpoint, for the message of a run that has failed -------------------------


# Of its travel: an axis that is off by more has left its setpoint; at rapid traverse without feedforward it is off by
# 1 %.
SETPOINT_LEFT_SHARE = 0.02


def first_departure(trace: Trace, program: Program, machine: Machine) -> str:
    """Which axis was the first to leave its setpoint, for the message of a run that has failed; "" where none has.

    trace: the rows so far. The unit that fails first is often that of another axis, which the structure has dragged
    along. An axis has left its setpoint where it is off by more than SETPOINT_LEFT_SHARE of its travel; of axes that
    leave in the same row it is the one that is off the furthest, each as a share of its travel.
    """
    result: list[tuple[float, float, str, float]] = []
    for name, axis in machine.axes.items():
        if (column := f"{name}.x_a") not in trace.columns:
            continue
        setpoint = np.interp(trace.time, program.time, program.x_s[name])
        with np.errstate(invalid="ignore"):
            off = np.nan_to_num(np.abs(np.asarray(trace[column]) - setpoint), nan=np.inf)
        share = off / (axis.travel[1] - axis.travel[0])
        if (rows := np.flatnonzero(share > SETPOINT_LEFT_SHARE)).size:
            row = int(rows[0])
            result.append((float(trace.time[row]), -float(share[row]), name, float(off[row])))
    if not result:
        return ""
    at, _, name, largest = min(result)
    return f"; axis {name} left its setpoint first: {largest * 1e3:.3g} mm off at {at:.9g} s"


# --- The grid of poses in a plant's archive, and what happened where the plant changed from one to the next -----------


@dataclass(frozen=True)
class Crossings:
    """What happened where the plant changed cells, over a whole run.

    Attributes:
        count: crossings.
        kinetic_lost, elastic_lost: energy before less energy after, summed up [J].
        held: largest jump of an axis position that was taken back [m].
        jump_x_a, jump_tool: largest jump of an axis position, of the tool [m].
        jump_n_a: of a motor speed [rad/s].
    """

    count: int
    kinetic_lost: float
    elastic_lost: float
    held: float
    jump_x_a: float
    jump_n_a: float
    jump_tool: float


def grid_of(system: System) -> tuple[GridAxis, ...]:
    """The axes whose pose the plant of a system follows; none where it has one pose."""
    if system.takes_modes:
        return ()
    file = system.plant.archive.directory / POSES_IN_ARCHIVE
    if not file.is_file():
        return ()
    from feedsim.structure.poses import read_grid  # whose room solves structures, which few runs do

    return read_grid(file, system.plant_axes)


def crossings_of(system: System) -> Crossings:
    """The crossings so far, of a plant that follows its axes."""
    names = ("crossings", "E_kin_lost", "E_el_lost", "held", "jump_x_a", "jump_n_a", "jump_tool")
    count, *values = (system.plant.value(f"pose.{name}") for name in names)
    return Crossings(round(count), *values)


@dataclass(frozen=True, repr=False)
class Run:
    """What a run leaves behind; nothing of it is judged (:func:`feedsim.simulation.judge.judge_run` does).

    Long traces and programs are in files without names, and read page by page: they vanish, and give back the disk,
    with the last array that looks into them; nothing is to be closed or removed. A copy (``numpy.array(column)``) is in
    memory as usual.

    Attributes:
        trace: recorded signals, columns "X.x_a" ... in SI units.
        coupling: per axis, interface energy residual [J], its peak, and the friction work [J] to hold it against.
        wall_time: duration of the cycle loop [s], without the calls of a `sink`, but with what the loop waits for where
            a sink works in a thread beside it. cpu_time: of this thread in it.
        native: whether the native loop has executed it.
        units: per instance, GUID and version of its archive.
        notes: what the units and their exchange say of themselves.
        executor_notes: why the native loop has not executed it, where it was not asked to stand aside.
        limited: axis and limit of its drive, "X.torque_limited" -> share of the recorded instants at which it was met.
        grid: the axes whose pose the plant follows; none where it has one pose.
        crossings: what happened where that plant changed cells; None where it has one pose.
        acting: the scenario's loads over time, as read.
        loads: what each of them has done.
        fine: the log's signals, and the setpoints of its axes, at the control cycle; None without a log. Other logs can
            be made of it: :func:`feedsim.simulation.cosim.logged`.
        log: the log as the scenario asks for it; None without one.
        frictionless: the positions "X.x_a" of the same setpoints nearly without friction, where they were asked for.
        clamped: the same on mounts that hold still, where the machine's are not linear.
    """

    scenario: Scenario
    program: Program
    trace: Trace
    coupling: Mapping[str, float]
    wall_time: float
    cpu_time: float
    units: Mapping[str, Mapping[str, str]]
    notes: tuple[Finding, ...] = ()
    executor_notes: tuple[Finding, ...] = ()
    limited: Mapping[str, float] = field(default_factory=dict)
    grid: tuple[GridAxis, ...] = ()
    crossings: Crossings | None = None
    acting: tuple[ActingLoad, ...] = ()
    loads: tuple[Work, ...] = ()
    fine: Trace | None = None
    log: Trace | None = None
    native: bool = False
    frictionless: Trace | None = None
    clamped: Trace | None = None

    def __repr__(self) -> str:
        return f"Run of {self.scenario.name!r}: {self.program.duration:.4g} s, {len(self.trace)} rows"


class OpenUnits(BlockResource):
    """The units of runs that follow one another, shipped ones: a machine that differs from the one before in values and
    modes alone gets them again, reset."""

    def __init__(self) -> None:
        self._system: System | None = None

    @contextmanager
    def of(self, machine: Machine, coupling: Coupling, fmus: Path) -> Iterator[System]:
        """A block with the units of a machine. A unit that has failed does not serve again.

        InputError: a unit refuses a value, or the archives do not fit the machine.
        """
        try:
            if self._system is not None and coupling.units != "one" and self._system.serves(machine, fmus):
                self._system.renew(machine)
            else:
                self.close()
                self._system = system_of(machine, coupling, fmus)
            yield self._system
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        if self._system is not None:
            self._system.close()
            self._system = None


def run(
    scenario: Scenario,
    *,
    program: Program | None = None,
    fmus: Path | None = None,
    progress: Progress | None = None,
    torque_feedforward: TorqueFeedforward | None = None,
    native: bool | None = None,
    scratch: Path | None = None,
    sink: Sink | None = None,
    units: OpenUnits | None = None,
) -> Run:
    """Run `scenario` and return its trace.

    Args:
        program: the scenario's planned motions, where the caller has them already.
        fmus: folder with plant.fmu, controller.fmu, friction.fmu, or machine.fmu; default
            :func:`fmus_directory`.
        progress: called now and then with (cycles done, cycles in all).
        torque_feedforward: axis -> torque [N.m] added to its torque setpoint at the instants k T_c, from 0 to the
            program's end.
        native: whether the native cycle loop beside the archives is to work (else Python does, to the same bits);
            default: where there is one.
        scratch: folder for the files without names that hold what is long; default: the system's for temporary files.
        sink: called with the rows of the trace, a stretch at a time, while the run goes on; of one that fails or is
            interrupted it has got all rows up to there when the exception arrives.
        units: those of the runs before, which stay open; None: they are opened for this run. Units of other makers
            are.

    Raises:
        InputError: the motion violates a limit, a load cannot be read, the archives do not fit the machine, `native`
            without such a loop.
        SimulationError: a unit failed; the message names the unit, the time and the unit's reason.
        OutputError: a file without a name cannot be written.
    """
    program = program or plan(scenario, scratch=scratch)
    fmus = fmus or fmus_directory()
    limit = scenario.coupling.call_limit
    if any_foreign(scenario.machine, fmus, scenario.coupling):
        from feedsim.simulation.cosim import worker  # where all programs are the shipped ones there is none

        return worker.call(
            _run, scenario, program, fmus, limit=limit, progress=progress, torque_feedforward=torque_feedforward,
            native=native, scratch=scratch, sink=sink,
        )  # fmt: skip
    return _run(
        scenario, program, fmus, progress=progress, torque_feedforward=torque_feedforward, native=native,
        scratch=scratch, sink=sink, units=units,
    )  # fmt: skip


def _run(
    scenario: Scenario,
    program: Program,
    fmus: Path,
    *,
    progress: Progress | None = None,
    torque_feedforward: TorqueFeedforward | None = None,
    native: bool | None = None,
    scratch: Path | None = None,
    sink: Sink | None = None,
    units: OpenUnits | None = None,
) -> Run:
    """A run in this process."""
    recorded = recorded_columns(scenario)
    loads, loaded = compute_acting_loads(scenario, program), loaded_inputs(scenario)
    checked_modes(scenario.machine)  # refused ahead of the units, with file and line
    cycles = scenario.machine.cycles
    ratio = round(cycles.T_pos / cycles.T_c)
    every = round(scenario.recording.interval / cycles.T_c)
    total = (len(program.time) - 1) * ratio
    library, executor_notes = choose_native_loop(
        native, fmus, fmus_directory()
    )  # archives out of an SSP file bring none along
    opened = system_of if units is None else units.of
    with opened(scenario.machine, scenario.coupling, fmus) as system:
        cycle = cycle_of(system, scenario.coupling)
        recording = Recording(cycle, loaded, program, total, ratio, every, recorded, scratch=scratch, sink=sink)
        recordings, at_full_rate = [recording], None
        if scenario.logging:
            columns = full_rate_columns(scenario)
            at_full_rate = Recording(cycle, loaded, program, total, ratio, 1, columns, scratch=scratch)
            recordings.append(at_full_rate)
        drives, loading = Setpoints(system, program, ratio), Loads(system, loads, cycles.T_c)
        # What is recorded of a cycle is the load that acts in it.
        before = [*drives.operations, *loading.before]
        before += (operation for recording in recordings for operation in recording.operations)
        before += feeders(system, torque_feedforward or {}, total + 1)
        loop = Loop(cycle, before, loading.after, library, (drives, loading, *recordings))
        system.initialise(program, stop=total * cycles.T_c)
        begun, worked = time.perf_counter(), time.thread_time()
        try:
            loop.run(total, progress)
        except SimulationError as error:
            recording.collect(loop.done)
            first = first_departure(recording.trace(), program, scenario.machine)
            raise SimulationError(f"{error}{first}") from error
        except BaseException:
            recording.collect(loop.done)
            raise
        for entry in recordings:
            entry.record(total)
            entry.collect(total + 1)
        loading.count(total)
        wall_time, cpu_time = time.perf_counter() - begun - recording.sinking, time.thread_time() - worked
        grid = grid_of(system)
        fine = None if at_full_rate is None else at_full_rate.trace()
        done = Run(
            scenario=scenario,
            program=program,
            trace=recording.trace(),
            coupling=_energies(cycle),
            wall_time=wall_time,
            cpu_time=cpu_time,
            units=system.archives,
            notes=(*system.warnings, *cycle.warnings),
            executor_notes=executor_notes,
            limited={limit: recording.share(limit) for limit in recording.limited},
            grid=grid,
            crossings=crossings_of(system) if grid else None,
            acting=tuple(loads),
            loads=loading.work,
            fine=fine,
            log=None
            if fine is None or scenario.logging is None
            else log(fine, scenario.logging, ideal_axes(scenario), scratch),
            native=library is not None,
        )
        deliver(done)
    return replace(done, notes=(*system.warnings, *cycle.warnings))  # with what units have said at their end


def _energies(cycle: Cycle) -> dict[str, float]:
    """Per axis "A.residual", "A.residual_peak" and "A.friction_work" [J]; see
    feedsim.simulation.cosim.operations.Bond."""
    bond = cycle.bond
    kinds = {"residual": bond.residual, "residual_peak": bond.residual_peak, "friction_work": bond.dissipated}
    return {f"{axis}.{kind}": float(kinds[kind][i]) for i, axis in enumerate(cycle.system.axes) for kind in kinds}


@dataclass(frozen=True, eq=False)
class PreparedLoop:
    """The cycle loop of a system with what it works on, for runs of one length; shape: what they have in common."""

    shape: tuple[Any, ...]
    cycle: Cycle
    setpoints: Setpoints
    recording: Recording
    loop: Loop

    def restart(self, program: Program) -> None:
        """Begin anew, of a system that was renewed."""
        self.cycle.restart()
        self.setpoints.restart(program)
        self.recording.restart(program)
        self.loop.restart()


class Follower(BlockResource):
    """The axes of machines on setpoints from anywhere: their units, exchanged as :func:`run` does, and nothing judged.

    Units stay open, as :class:`OpenUnits` does; without loads, so does the loop of runs that differ in values alone.
    """

    def __init__(
        self, *, coupling: Coupling | None = None, fmus: Path | None = None, native: bool | None = None
    ) -> None:
        self._coupling, self._fmus, self._native = coupling or Coupling(), fmus or fmus_directory(), native
        self._units = OpenUnits()
        self._prepared: PreparedLoop | None = None

    def follow(
        self, machine: Machine, program: Program, columns: Collection[str], interval: float,
        *, loads: Sequence[ActingLoad] = (),
    ) -> Trace:  # fmt: skip
        """
        Args:
            columns: what is recorded, by name ("Z.x_a"). interval: of the rows [s], a whole multiple of the control
                cycle.
            loads: what acts on the machine meanwhile.

        Raises:
            InputError, SimulationError: as :func:`run`.
        """
        if any_foreign(machine, self._fmus, self._coupling):
            from feedsim.simulation.cosim import worker

            given = (machine, program, columns, interval, loads, self._coupling, self._fmus, self._native)
            return worker.call(_follow, *given, limit=self._coupling.call_limit)
        return self._follow(machine, program, columns, interval, loads)

    def _follow(
        self, machine: Machine, program: Program, columns: Collection[str], interval: float, loads: Sequence[ActingLoad]
    ) -> Trace:
        """The same in this process."""
        cycles = machine.cycles
        ratio, every = round(cycles.T_pos / cycles.T_c), round(interval / cycles.T_c)
        total = (len(program.time) - 1) * ratio
        library, _ = choose_native_loop(self._native, self._fmus, fmus_directory())
        with self._units.of(machine, self._coupling, self._fmus) as system:
            substeps, known = self._coupling.steps(machine), tuple(columns_of(machine, residual=True))
            shape = system, cycles.T_c, substeps, total, ratio, every, tuple(columns), known
            prepared = self._prepared
            if prepared is not None and prepared.shape == shape and not loads:
                prepared.restart(program)
            else:
                cycle = cycle_of(system, self._coupling)
                recording = Recording(cycle, (), program, total, ratio, every, columns)
                setpoints, loading = Setpoints(system, program, ratio), Loads(system, loads, cycles.T_c)
                before = [*setpoints.operations, *loading.before, *recording.operations]
                loop = Loop(cycle, before, loading.after, library, (setpoints, loading, recording))
                prepared = PreparedLoop(shape, cycle, setpoints, recording, loop)
            self._prepared = None if loads else prepared
            system.initialise(program, stop=total * cycles.T_c)
            prepared.loop.run(total)
            prepared.recording.record(total)
            prepared.recording.collect(total + 1)
            return prepared.recording.trace()

    def close(self) -> None:
        self._prepared = None
        self._units.close()


def follow(
    machine: Machine, program: Program, columns: Collection[str], interval: float,
    *, loads: Sequence[ActingLoad] = (), coupling: Coupling | None = None, fmus: Path | None = None,
    native: bool | None = None,
) -> Trace:  # fmt: skip
    """One machine on setpoints; arguments as those of :class:`Follower` and its follow()."""
    with Follower(coupling=coupling, fmus=fmus, native=native) as follower:
        return follower.follow(machine, program, columns, interval, loads=loads)


def _follow(
    machine: Machine, program: Program, columns: Collection[str], interval: float, loads: Sequence[ActingLoad],
    coupling: Coupling, fmus: Path, native: bool | None,
) -> Trace:  # fmt: skip
    """In a worker process."""
    with Follower(coupling=coupling, fmus=fmus, native=native) as follower:
        return follower._follow(machine, program, columns, interval, loads)


@dataclass(frozen=True, eq=False)
class Ready:
    """What is known of a scenario ahead of its first step; notes, grid and acting as of a :class:`Run`."""

    notes: tuple[Finding, ...]
    grid: tuple[GridAxis, ...]
    acting: tuple[ActingLoad, ...]


def check(scenario: Scenario, program: Program, *, fmus: Path | None = None) -> Ready:
    """Build and initialise the units of a scenario, without a step.

    The shipped units judge their parameters. No other program is executed: of another maker's unit counts what its
    archive says of itself, and a note says what is not checked.

    Raises:
        InputError: what :func:`run` would refuse before its first step.
    """
    recorded_columns(scenario)
    loads = compute_acting_loads(scenario, program)
    checked_modes(scenario.machine)
    fmus = fmus or fmus_directory()
    with system_of(scenario.machine, scenario.coupling, fmus, only_shipped=True) as system:
        system.initialise(program, stop=float(program.time[-1]))
        cycle = cycle_of(system, scenario.coupling)
        return Ready((*system.warnings, *cycle.warnings), grid_of(system), tuple(loads))


def logged(source: Run | Trace, logging: Logging | None = None, *, ideal: Sequence[str] = ()) -> Trace:
    """A log of a run that has been simulated, without simulating again.

    Args:
        source: a run with its signals at the control cycle (`fine`), or those signals alone.
        logging: how to log; default: as the run's scenario says. Its interval must be a multiple of the control cycle
            of the signals, its axes and signals among theirs.
        ideal: axes with an ideal current loop, where `source` is a trace; of a run they are known.

    Raises:
        InputError: a run without logging, a signal that was not recorded, an interval off the grid.
    """
    if isinstance(source, Trace):
        fine = source
    else:
        if source.fine is None:
            raise InputError(f"{source.scenario.file}: the run has no signals at the control cycle; give it 'logging'")
        fine = source.fine
        logging = logging or source.scenario.logging
        ideal = ideal_axes(source.scenario)
    return log(fine, logging or Logging(), ideal)
