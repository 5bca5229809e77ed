"""Run a scenario on the units: plan the motion, build the system, exchange at the control cycle, record."""

from __future__ import annotations

import time
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from feedsim.cosim.binaries import any_foreign, fmus_directory
from feedsim.cosim.departure import first_departure
from feedsim.cosim.exchange import chosen
from feedsim.cosim.feedforward import TorqueFeedforward, feeders
from feedsim.cosim.loads import Acting, Loads, Work, acting
from feedsim.cosim.logging import full_rate_columns, ideal_axes, log
from feedsim.cosim.loop import Loop, Progress, Setpoints
from feedsim.cosim.mark import deliver
from feedsim.cosim.poses import Crossings, crossings_of, grid_of
from feedsim.cosim.recording import Recording, Sink, loaded_inputs, recorded_columns
from feedsim.cosim.schedule import Cycle
from feedsim.cosim.system import System
from feedsim.cosim.whole import cycle_of, system_of
from feedsim.errors import InputError, SimulationError
from feedsim.nc import Program, plan
from feedsim.owned import Closing
from feedsim.scenario import Coupling, Logging, Machine, Scenario
from feedsim.structure.modes import checked_modes
from feedsim.structure.poses_file import GridAxis
from feedsim.trace import Trace


@dataclass(frozen=True, repr=False)
class Run:
    """What a run leaves behind; nothing of it is judged (:func:`feedsim.judge.judged` does).

    Long traces and programs are in files without names, and read page by page: they vanish, and give back the disk,
    with the last array that looks into them; nothing is to be closed or removed. A copy (``numpy.array(column)``) is in
    memory as usual.

    Attributes:
        trace: recorded signals, columns "X.x_a" ... in SI units.
        coupling: per axis, interface energy residual [J], its peak, and the friction work [J] to hold it against.
        wall_time: duration of the cycle loop [s], without what a `sink` has taken. cpu_time: of this thread in it.
        native: whether the native loop has executed it.
        units: per instance, GUID and version of its archive.
        notes: what the units and their exchange say of themselves, a sentence each.
        executor_notes: why the native loop has not executed it, where it was not asked to stand aside.
        limited: axis and limit of its drive, "X.torque_limited" -> share of the recorded instants at which it was met.
        grid: the axes whose pose the plant follows; none where it has one pose.
        crossings: what happened where that plant changed cells; None where it has one pose.
        acting: the scenario's loads over time, as read.
        loads: what each of them has done.
        fine: the log's signals, and the setpoints of its axes, at the control cycle; None without a log. Other logs can
            be made of it: :func:`feedsim.cosim.logged`.
        log: the log as the scenario asks for it; None without one.
    """

    scenario: Scenario
    program: Program
    trace: Trace
    coupling: Mapping[str, float]
    wall_time: float
    cpu_time: float
    units: Mapping[str, Mapping[str, str]]
    notes: tuple[str, ...] = ()
    executor_notes: tuple[str, ...] = ()
    limited: Mapping[str, float] = field(default_factory=dict)
    grid: tuple[GridAxis, ...] = ()
    crossings: Crossings | None = None
    acting: tuple[Acting, ...] = ()
    loads: tuple[Work, ...] = ()
    fine: Trace | None = None
    log: Trace | None = None
    native: bool = False

    def __repr__(self) -> str:
        return f"Run of {self.scenario.name!r}: {self.program.duration:.4g} s, {len(self.trace)} rows"


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
        from feedsim.cosim import worker  # where all programs are the shipped ones there is none

        return worker.call(
            _run, scenario, program, fmus, limit=limit, progress=progress, torque_feedforward=torque_feedforward,
            native=native, scratch=scratch, sink=sink,
        )  # fmt: skip
    return _run(
        scenario, program, fmus, progress=progress, torque_feedforward=torque_feedforward, native=native,
        scratch=scratch, sink=sink,
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
) -> Run:
    """A run in this process."""
    recorded = recorded_columns(scenario)
    loads, loaded = acting(scenario, program), loaded_inputs(scenario)
    checked_modes(scenario.machine)  # refused ahead of the units, with file and line
    cycles = scenario.machine.cycles
    ratio = round(cycles.T_pos / cycles.T_c)
    every = round(scenario.recording.interval / cycles.T_c)
    total = (len(program.time) - 1) * ratio
    library, executor_notes = chosen(native, fmus, fmus_directory())  # archives out of an SSP file bring none along
    with system_of(scenario.machine, scenario.coupling, fmus) as system:
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
    """Per axis "A.residual", "A.residual_peak" and "A.friction_work" [J]; see feedsim.cosim.operations.Bond."""
    bond = cycle.bond
    kinds = {"residual": bond.residual, "residual_peak": bond.residual_peak, "friction_work": bond.dissipated}
    return {f"{axis}.{kind}": float(kinds[kind][i]) for i, axis in enumerate(cycle.system.axes) for kind in kinds}


class Follower(Closing):
    """The axes of machines on setpoints from anywhere: their units, exchanged as :func:`run` does, and nothing judged.

    Units stay open: a machine that differs from the one before in values and modes alone gets them again, reset.
    """

    def __init__(
        self, *, coupling: Coupling | None = None, fmus: Path | None = None, native: bool | None = None
    ) -> None:
        self._coupling, self._fmus, self._native = coupling or Coupling(), fmus or fmus_directory(), native
        self._system: System | None = None

    def follow(
        self, machine: Machine, program: Program, columns: Collection[str], interval: float,
        *, loads: Sequence[Acting] = (),
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
            from feedsim.cosim import worker

            given = (machine, program, columns, interval, loads, self._coupling, self._fmus, self._native)
            return worker.call(_follow, *given, limit=self._coupling.call_limit)
        return self._follow(machine, program, columns, interval, loads)

    def _follow(
        self, machine: Machine, program: Program, columns: Collection[str], interval: float, loads: Sequence[Acting]
    ) -> Trace:
        """The same in this process."""
        cycles = machine.cycles
        ratio, every = round(cycles.T_pos / cycles.T_c), round(interval / cycles.T_c)
        total = (len(program.time) - 1) * ratio
        library, _ = chosen(self._native, self._fmus, fmus_directory())
        try:
            system = self._opened(machine)
            cycle = cycle_of(system, self._coupling)
            recording = Recording(cycle, (), program, total, ratio, every, columns)
            drives, loading = Setpoints(system, program, ratio), Loads(system, loads, cycles.T_c)
            before = [*drives.operations, *loading.before, *recording.operations]
            loop = Loop(cycle, before, loading.after, library, (drives, loading, recording))
            system.initialise(program, stop=total * cycles.T_c)
            loop.run(total)
            recording.record(total)
            recording.collect(total + 1)
            return recording.trace()
        except BaseException:  # a unit that has failed need not serve again
            self.close()
            raise

    def _opened(self, machine: Machine) -> System:
        if self._system is not None and self._system.serves(machine, self._fmus):
            self._system.renew(machine)
        else:
            self.close()
            self._system = system_of(machine, self._coupling, self._fmus)
        return self._system

    def close(self) -> None:
        if self._system is not None:
            self._system.close()
            self._system = None


def follow(
    machine: Machine, program: Program, columns: Collection[str], interval: float,
    *, loads: Sequence[Acting] = (), coupling: Coupling | None = None, fmus: Path | None = None,
    native: bool | None = None,
) -> Trace:  # fmt: skip
    """One machine on setpoints; arguments as those of :class:`Follower` and its follow()."""
    with Follower(coupling=coupling, fmus=fmus, native=native) as follower:
        return follower.follow(machine, program, columns, interval, loads=loads)


def _follow(
    machine: Machine, program: Program, columns: Collection[str], interval: float, loads: Sequence[Acting],
    coupling: Coupling, fmus: Path, native: bool | None,
) -> Trace:  # fmt: skip
    """In a worker process."""
    with Follower(coupling=coupling, fmus=fmus, native=native) as follower:
        return follower._follow(machine, program, columns, interval, loads)


@dataclass(frozen=True, eq=False)
class Ready:
    """What is known of a scenario ahead of its first step; notes, grid and acting as of a :class:`Run`."""

    notes: tuple[str, ...]
    grid: tuple[GridAxis, ...]
    acting: tuple[Acting, ...]


def check(scenario: Scenario, program: Program, *, fmus: Path | None = None) -> Ready:
    """Build and initialise the units of a scenario, without a step.

    The shipped units judge their parameters. No other program is executed: of another maker's unit counts what its
    archive says of itself, and a note says what is not checked.

    Raises:
        InputError: what :func:`run` would refuse before its first step.
    """
    recorded_columns(scenario)
    loads = acting(scenario, program)
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
