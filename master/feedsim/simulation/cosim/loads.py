"""Loads in a run: torques and forces over time at inputs of the plant, and the work that they do.

A load acts as its mean over each control cycle: its impulse is exact whatever the rates are, and what is left of its
course within a cycle moves nothing by more than the second order of T_c. Held over a cycle, its work is the mean times
the way of the point where it acts; the way of a rotor is that of its speed by the trapezoidal rule.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from feedsim.files.trace import read_signals
from feedsim.foundation.errors import InputError
from feedsim.motions.setpoints import RecordedGeometry
from feedsim.scenario import Machine, Scenario
from feedsim.scenario.loads import LoadCourse, MotorLoad, Noise, ToolLoad
from feedsim.simulation.cosim.operations import DueCycles, Operation, copy, get_row, set_real
from feedsim.simulation.cosim.schedule import REPORTED_EVERY
from feedsim.simulation.cosim.system import System
from feedsim.simulation.cosim.unit import Floats, Log, Port
from feedsim.simulation.nc import Program

# A load acts where it is more than this share of its largest value; and does work that shows something where that is
# more than this share of the motor's, as much as the friction of a good model is off by.
ACTS, TELLS = 0.1, 0.05
LOAD_TAKEN_UP = 1.0  # s; position and speed controller together settle in some tenths of it
NOISE_SAMPLES = 10  # of a random load per time constant of its low-pass


@dataclass(frozen=True, eq=False)
class ActingLoad:
    """A load over the time of a run.

    Attributes:
        place: where the scenario has it, as messages name it.
        time, values: (N,) [s] and [N.m] or [N]; before the first instant and behind the last there is none.
        torque: (N,) of the motor that carries it, as recorded [N.m]; None where it was not.
    """

    place: str
    load: LoadCourse
    time: Floats
    values: Floats
    torque: Floats | None = None

    def means(self, edges: Floats) -> Floats:
        """(N - 1,) means over the stretches between the N instants `edges` [s]."""
        return stretch_means(self.time, self.values, edges, held=self.load.held)

    def peak(self, duration: float) -> float:
        """The largest value, with its sign, that the file or table has within a run of `duration` [s]."""
        during = self.values[(self.time >= 0) & (self.time <= duration)]
        return float(during[np.argmax(np.abs(during))]) if during.size else 0.0


def stretch_means(time: Floats, values: Floats, edges: Floats, *, held: bool) -> Floats:
    """(N - 1,) means of a course over the stretches between the N instants `edges`.

    It goes through `values` at `time`, linear in between or held up to the next instant, and is 0 before and behind.
    """
    nodes = np.union1d(edges, time[np.searchsorted(time, edges[0]) : np.searchsorted(time, edges[-1])])
    # The course has no kink and no jump between two nodes: its mean there is its value in the middle.
    middle, length = (nodes[1:] + nodes[:-1]) / 2, np.diff(nodes)
    if held:
        row = np.searchsorted(time, middle, side="right") - 1
        acts = (row >= 0) & (row < len(time) - 1)
        value = np.where(acts, values[np.clip(row, 0, None)], 0.0)
    else:
        value = np.interp(middle, time, values, left=0.0, right=0.0)
    first = np.searchsorted(nodes, edges[:-1])
    return np.asarray(np.add.reduceat(value * length, first) / np.add.reduceat(length, first))


@dataclass(frozen=True)
class Drives:
    """What the motor that carries a load has done while that acted, in the run and in the record [J].

    Attributes:
        run, record: work of the motor torque; of the recorded one on the way of the run.
        turned: the same of the recorded torque's magnitude.
        load: work of the load on the machine in that time.
    """

    run: float
    record: float
    turned: float
    load: float

    @property
    def factor(self) -> float | None:
        """By which the load is to be multiplied for both to do the same work; None where the load does next to none.

        The drive gives what friction takes, and the load: of a load that is larger by the factor f it gives less by
        (f - 1) times the load's work on the machine, and friction takes the same.
        """
        return 1 + (self.run - self.record) / self.load if abs(self.load) > TELLS * self.turned else None


@dataclass(frozen=True)
class Work:
    """What a load has done over a run.

    Attributes:
        load: place, in the scenario's list, counted from 0.
        input: the plant's variable at which it acted, in `unit`.
        words: where it acted, for people.
        peak: largest mean over a control cycle, with its sign.
        given, taken: work done on the machine, and work taken from it, each summed up over the cycles [J].
        drives: the motor against its recorded torque; None where that was not recorded.
    """

    load: int
    input: str
    words: str
    unit: str
    peak: float
    given: float
    taken: float
    drives: Drives | None = None

    @property
    def net(self) -> float:
        """Work on the machine [J]; below 0: the load takes energy from it."""
        return self.given - self.taken


def compute_acting_loads(scenario: Scenario, program: Program) -> tuple[ActingLoad, ...]:
    """The loads of a scenario over the time of its program.

    Raises:
        InputError: lists every file that cannot be read, column that is missing or of another unit, and load that ends
            before the run begins or begins behind its end.
    """
    result: list[ActingLoad] = []
    problems: list[str] = []
    for i, load in enumerate(scenario.loads):
        try:
            result.append(_course(load, scenario.at("loads", i), program))
        except InputError as error:
            problems += [f"{scenario.at('loads', i)}: {problem}" for problem in error.problems]
    if problems:
        raise InputError.of(f"{scenario.file}: the loads cannot be used", problems)
    return tuple(result)


def _course(load: LoadCourse, place: str, program: Program) -> ActingLoad:
    torque = None
    if load.noise is not None:
        time, values = _random(load.noise, program.duration)
    elif load.table is not None:
        time, values = (np.array(column, dtype=np.float64) for column in (load.table.time, load.table.values))
    else:
        assert load.file is not None
        assert load.column is not None
        clock = (load.time.column, load.time.unit)
        rows = read_signals(load.file, {"load": (load.column.column, load.column.unit)}, load.UNIT, time=clock)
        time, values = rows.time, rows["load"]
        if (drive := load.motor_torque) is not None:
            torque = read_signals(load.file, {"torque": (drive.column, drive.unit)}, "N.m", time=clock)["torque"]
    time = time + _load_start(load, program)
    if time[-1] <= 0 or time[0] >= program.duration:
        raise InputError(
            f"the load acts from {time[0]:.6g} to {time[-1]:.6g} s of the run, which lasts from 0 to "
            f"{program.duration:.6g} s: it never acts; 'motion' names the motion that its time runs with"
        )
    return ActingLoad(place, load, time, values * load.factor, torque)


def _random(noise: Noise, duration: float) -> tuple[Floats, Floats]:
    """Instants [s] over a run, and a load with the spectrum of white noise behind a first-order low-pass, (N,) each.

    Of a sample the share exp(-2 pi f_c h) stays in the next one, h later. The course is linear in between, where its
    variance is less; it is `rms` squared on average over time.
    """
    from scipy.signal import lfilter  # half a second that no other load needs

    h = 1 / (NOISE_SAMPLES * 2 * pi * noise.bandwidth)
    stays = np.exp(-1 / NOISE_SAMPLES)
    drawn = np.random.default_rng(noise.seed).standard_normal(int(np.ceil(duration / h)) + 2)
    drawn[1:] *= np.sqrt(1 - stays**2)  # the first one has the whole deviation: it has always been there
    values = lfilter([1.0], [1.0, -stays], drawn)
    rms = noise.rms / np.sqrt((2 + stays) / 3)
    return h * np.arange(len(drawn), dtype=np.float64), float(rms) * np.asarray(values, dtype=np.float64)


def _load_start(load: LoadCourse, program: Program) -> float:
    """Instant of the run at which the load's own time is 0 [s]."""
    if load.motion is None:
        return 0.0
    segment = program.segments[load.motion]
    if isinstance(segment.geometry, RecordedGeometry):
        return segment.geometry.begin - segment.geometry.first
    return segment.start


class _Account:
    """What a load has done so far, and its means over the cycles of the stretch at hand, (REPORTED_EVERY,)."""

    def __init__(self, number: int, acting: ActingLoad, axes: Sequence[str], T_c: float) -> None:
        load = acting.load
        self.load, self.at = load, axes.index(load.axis_name) if load.axis_name in axes else None
        self.values = np.zeros(REPORTED_EVERY)
        self._number, self._acting, self._T_c = number, acting, T_c
        self._torques = np.zeros(REPORTED_EVERY)  # recorded
        self._acts = ACTS * float(np.abs(acting.values).max())
        self._peak = self._given = self._taken = 0.0
        self._drives = np.zeros(4)

    def fill(self, rows: NDArray[np.int64], edges: Floats) -> None:
        """Means over the cycles between `edges` [s] into `rows`."""
        self.values[rows] = values = self._acting.means(edges)
        if self._acting.torque is not None:
            self._torques[rows] = stretch_means(self._acting.time, self._acting.torque, edges, held=False)
        self._peak = max((self._peak, float(values[np.argmax(np.abs(values))])), key=abs)

    def count(self, rows: NDArray[np.int64], place: Floats, speed: Floats | None, torque: Floats | None) -> None:
        """Add the work of the cycles in `rows`; what else there is, is known at their ends, a row more.

        place: where slide or tool is [m]. speed, torque: of the motor that carries the load, if there is one.
        """
        turned = np.zeros(len(rows)) if speed is None else self._T_c * (speed[1:] + speed[:-1]) / 2
        # A torque at the motor counts against that of the drive.
        work = self.values[rows] * (-turned if isinstance(self.load, MotorLoad) else np.diff(place))
        self._given += float(work[work > 0].sum())
        self._taken -= float(work[work < 0].sum())
        if self._acting.torque is not None and torque is not None:
            now = np.abs(self.values[rows]) >= self._acts
            record, run = self._torques[rows] * turned, (torque[1:] + torque[:-1]) / 2 * turned
            self._drives += [values[now].sum() for values in (run, record, np.abs(record), work)]

    @property
    def work(self) -> Work:
        drives = None if self._acting.torque is None else Drives(*map(float, self._drives))
        place = (self._number, self.load.input, self.load.words, self.load.UNIT)
        return Work(*place, self._peak, self._given, self._taken, drives)


class Loads:
    """The loads of a run, a buffered part of a :class:`~feedsim.simulation.cosim.schedule.Loop`: sent, and their work
    counted.

    Attributes:
        before, after: operations that send the loads of a cycle, and keep what their work is found from.
    """

    def __init__(self, system: System, loads: Sequence[ActingLoad], T_c: float) -> None:
        self._system, self._T_c, self._done = system, T_c, 0
        self._accounts = [_Account(i, value, system.axes, T_c) for i, value in enumerate(loads)]
        inputs = tuple(dict.fromkeys(entry.load.input for entry in loads))
        self._at = [inputs.index(entry.load.input) for entry in loads]
        # A constant load of the axis stays.
        M_0 = {f"{axis}.M_0": described.M_0 for axis, described in system.machine.axes.items()}
        self._constant = np.array([M_0.get(name, 0.0) for name in inputs])
        self._table = np.zeros((REPORTED_EVERY, len(inputs)))
        # What is known when a cycle ends: x_a and n_a of every axis, motor torques, displacements at the tool.
        self._measured = np.zeros((REPORTED_EVERY, system.measured.size))
        self._motors = np.zeros((REPORTED_EVERY, len(system.axes)))
        tool = dict.fromkeys(f"tool.x_{entry.load.direction}" for entry in loads if isinstance(entry.load, ToolLoad))
        self._tool = Log(system.plant, tuple(tool), REPORTED_EVERY)
        self._ended: list[Floats] = []  # the same at the end of the cycles that are counted
        self.before: list[Operation] = []
        self.after: list[Operation] = []
        if loads:
            always = DueCycles()
            self.before += set_real(Port(system.plant, inputs), self._table)
            self.after += [copy(self._measured, system.measured, always), copy(self._motors, system.M_a_end, always)]
            self.after += get_row(self._tool, always)

    def ahead(self, begin: int, end: int) -> None:
        """Be ready for the cycles `begin` to `end` - 1; those before are done."""
        if not self._accounts:
            return
        self.count(begin)
        rows = np.arange(begin, end) % REPORTED_EVERY
        edges = np.arange(begin, end + 1, dtype=np.float64) * self._T_c
        self._table[rows] = self._constant
        for at, account in zip(self._at, self._accounts, strict=True):
            account.fill(rows, edges)
            self._table[rows, at] += account.values[rows]

    def count(self, cycles: int) -> None:
        """Take in what was done in the first `cycles`."""
        if not self._accounts:
            return
        if not self._ended:  # before the first; displacements count from the start
            system = self._system
            self._ended = [system.measured.copy(), system.M_a_end.copy(), np.zeros(len(self._tool.real_names))]
        rows = np.arange(self._done, cycles) % REPORTED_EVERY
        rings = (self._measured, self._motors, self._tool.reals)
        measured, motors, tool = (
            np.vstack([ended, ring[rows]]) for ended, ring in zip(self._ended, rings, strict=True)
        )
        for account in self._accounts:
            load, at = account.load, account.at
            place = np.zeros(len(measured)) if at is None else measured[:, 2 * at]
            if isinstance(load, ToolLoad):
                place = tool[:, self._tool.real_names.index(f"tool.x_{load.direction}")]
            speed, torque = (None, None) if at is None else (measured[:, 2 * at + 1], motors[:, at])
            account.count(rows, place, speed, torque)
        self._ended, self._done = [measured[-1], motors[-1], tool[-1]], cycles

    @property
    def work(self) -> tuple[Work, ...]:
        """Of the cycles counted, load by load."""
        return tuple(account.work for account in self._accounts)


def at_motor(load: LoadCourse, value: float, machine: Machine) -> float | None:
    """A value of the load as a torque against that of the motor which carries it [N.m]: of a force that which holds it
    at rest. None where no axis has its direction."""
    if isinstance(load, MotorLoad):
        return value
    return -value * machine.axes[load.axis_name].I_P if load.axis_name in machine.axes else None
