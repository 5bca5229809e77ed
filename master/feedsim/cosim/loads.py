"""Loads in a run: torques and forces over time at inputs of the plant, and the work that they do.

A load acts as its mean over each control cycle: its impulse is exact whatever the rates are, and what is left of its
course within a cycle moves nothing by more than the second order of T_c. Held over a cycle, its work is the mean times
the way of the point where it acts; the way of a rotor is that of its speed by the trapezoidal rule.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feedsim.cosim.loop import REPORTED_EVERY
from feedsim.cosim.operations import Interpreter, Operation, When, copy, get_row, set_real
from feedsim.cosim.system import System
from feedsim.cosim.unit import Floats, Log, Port
from feedsim.errors import InputError
from feedsim.motions.setpoints import Recorded
from feedsim.nc import Program
from feedsim.scenario import Machine, Scenario
from feedsim.scenario.loads import LoadCourse, MotorLoad, SlideLoad, ToolLoad
from feedsim.trace import read_signals


@dataclass(frozen=True, eq=False)
class Acting:
    """A load over the time of a run.

    Attributes:
        place: where the scenario has it, as messages name it.
        time, values: (N,) [s] and [N.m] or [N]; before the first instant and behind the last there is none.
        held: each value holds until the next instant; else the load is linear in between.
    """

    place: str
    load: LoadCourse
    time: Floats
    values: Floats
    held: bool

    def means(self, edges: Floats) -> Floats:
        """(N - 1,) means over the stretches between the N instants `edges` [s]."""
        inside = self.time[np.searchsorted(self.time, edges[0]) : np.searchsorted(self.time, edges[-1])]
        nodes = np.union1d(edges, inside)
        # The course has no kink and no jump between two nodes: its mean there is its value in the middle.
        middle, length = (nodes[1:] + nodes[:-1]) / 2, np.diff(nodes)
        if self.held:
            row = np.searchsorted(self.time, middle, side="right") - 1
            acts = (row >= 0) & (row < len(self.time) - 1)
            value = np.where(acts, self.values[np.clip(row, 0, None)], 0.0)
        else:
            value = np.interp(middle, self.time, self.values, left=0.0, right=0.0)
        first = np.searchsorted(nodes, edges[:-1])
        return np.asarray(np.add.reduceat(value * length, first) / np.add.reduceat(length, first))

    def peak(self, duration: float) -> float:
        """The largest value, with its sign, that the file or table has within a run of `duration` [s]."""
        during = self.values[(self.time >= 0) & (self.time <= duration)]
        return float(during[np.argmax(np.abs(during))]) if during.size else 0.0


@dataclass(frozen=True)
class Work:
    """What a load has done over a run.

    Attributes:
        load: place, in the scenario's list, counted from 0.
        input: the plant's variable at which it acted, in `unit`.
        words: where it acted, for people.
        peak: largest mean over a control cycle, with its sign.
        given, taken: work done on the machine, and work taken from it, each summed up over the cycles [J].
    """

    load: int
    input: str
    words: str
    unit: str
    peak: float
    given: float
    taken: float

    @property
    def net(self) -> float:
        """Work on the machine [J]; below 0: the load takes energy from it."""
        return self.given - self.taken


def acting(scenario: Scenario, program: Program) -> tuple[Acting, ...]:
    """The loads of a scenario over the time of its program.

    Raises:
        InputError: lists every file that cannot be read, column that is missing or of another unit, and load that ends
            before the run begins or begins behind its end.
    """
    found: list[Acting] = []
    problems: list[str] = []
    for i, load in enumerate(scenario.loads):
        try:
            found.append(_course(load, scenario.at("loads", i), program))
        except InputError as error:
            problems += [f"{scenario.at('loads', i)}: {problem}" for problem in error.problems]
    if problems:
        raise InputError.of(f"{scenario.file}: the loads cannot be used", problems)
    return tuple(found)


def _course(load: LoadCourse, place: str, program: Program) -> Acting:
    if load.table is not None:
        time, values = (np.array(column, dtype=np.float64) for column in (load.table.time, load.table.values))
    else:
        assert load.file is not None
        assert load.column is not None
        columns = {"load": (load.column.column, load.column.unit)}
        rows = read_signals(load.file, columns, load.UNIT, time=(load.time.column, load.time.unit))
        time, values = rows.time, rows["load"]
    time = time + _begin(load, program)
    if time[-1] <= 0 or time[0] >= program.duration:
        raise InputError(
            f"the load acts from {time[0]:.6g} to {time[-1]:.6g} s of the run, which lasts from 0 to "
            f"{program.duration:.6g} s: it never acts; 'motion' names the motion that its time runs with"
        )
    return Acting(place, load, time, values * load.factor, load.held)


def _begin(load: LoadCourse, program: Program) -> float:
    """Instant of the run at which the load's own time is 0 [s]."""
    if load.motion is None:
        return 0.0
    segment = program.segments[load.motion]
    if isinstance(segment.geometry, Recorded):
        return segment.geometry.begin - segment.geometry.first
    return segment.start


class Loads:
    """The loads of a run, a buffered part of a :class:`~feedsim.cosim.loop.Loop`: sent, and their work counted.

    Attributes:
        operations: they send the loads of a cycle, and keep what their work is found from.
    """

    def __init__(self, system: System, loads: Sequence[Acting], T_c: float) -> None:
        self._loads, self._T_c, self._done = tuple(loads), T_c, 0
        self._axes = {axis: i for i, axis in enumerate(system.axes)}
        inputs = tuple(dict.fromkeys(each.load.input for each in loads))
        self._at = np.array([inputs.index(each.load.input) for each in loads], dtype=np.int64)
        # A constant load of the axis stays.
        M_0 = {f"{axis}.M_0": described.M_0 for axis, described in system.machine.axes.items()}
        self._constant = np.array([M_0.get(name, 0.0) for name in inputs])
        count = len(loads)
        self._values, self._last = np.zeros((REPORTED_EVERY, count)), np.zeros((2, count))
        self._table = np.zeros((REPORTED_EVERY, len(inputs)))
        self._peak, self._given, self._taken = np.zeros(count), np.zeros(count), np.zeros(count)
        self._measured = np.zeros((REPORTED_EVERY, system.measured.size))  # x_a and n_a of every axis
        tool = [f"tool.x_{each.load.direction}" for each in loads if isinstance(each.load, ToolLoad)]
        self._tool = Log(system.plant, tuple(dict.fromkeys(tool)), REPORTED_EVERY)
        always = When()
        self._kept = [copy(self._measured, system.measured, always), *get_row(self._tool, always)] if loads else []
        send = set_real(Port(system.plant, inputs), self._table) if loads else []
        self.operations: list[Operation] = [*send, *self._kept]

    def ahead(self, begin: int, end: int) -> None:
        """Be ready for the cycles `begin` to `end` - 1; those before are done."""
        self._count(begin)
        rows = np.arange(begin, end) % REPORTED_EVERY
        edges = np.arange(begin, end + 1, dtype=np.float64) * self._T_c
        self._table[rows] = self._constant
        for i, each in enumerate(self._loads):
            values = each.means(edges)
            self._values[rows, i] = values
            self._table[rows, self._at[i]] += values
            largest = values[np.argmax(np.abs(values))]
            self._peak[i] = largest if abs(largest) > abs(self._peak[i]) else self._peak[i]

    def finish(self, cycles: int) -> None:
        """Take in the end of the last of `cycles`."""
        self._count(cycles)
        Interpreter(self._kept, self._T_c).run(cycles, cycles + 1)
        self._count(cycles + 1)

    def _count(self, cycles: int) -> None:
        """Add the work of the cycles whose ends are known: all but the last of `cycles`."""
        if not self._loads or cycles <= self._done:
            return
        rows = np.arange(self._done, cycles) % REPORTED_EVERY
        where = np.stack([self._coordinate(each.load, rows) for each in self._loads], axis=1)
        values = self._values[rows]
        if self._done:
            where, values = np.vstack([self._last[:1], where]), np.vstack([self._last[1:], values])
        ways = np.stack([self._way(each.load, where[:, i]) for i, each in enumerate(self._loads)], axis=1)
        work = values[:-1] * ways
        self._given += np.where(work > 0, work, 0.0).sum(axis=0)
        self._taken -= np.where(work < 0, work, 0.0).sum(axis=0)
        self._last[0], self._last[1] = where[-1], values[-1]
        self._done = cycles

    def _coordinate(self, load: LoadCourse, rows: NDArray[np.int64]) -> Floats:
        """What its way is found from: the speed of a rotor, else a position."""
        if isinstance(load, MotorLoad):
            return np.asarray(self._measured[rows, 2 * self._axes[load.axis] + 1])
        if isinstance(load, SlideLoad):
            return np.asarray(self._measured[rows, 2 * self._axes[load.axis]])
        assert isinstance(load, ToolLoad)
        return np.asarray(self._tool.reals[rows, self._tool.real_names.index(f"tool.x_{load.direction}")])

    def _way(self, load: LoadCourse, coordinate: Floats) -> Floats:
        """Way in each cycle, positive where a positive load drives."""
        if isinstance(load, MotorLoad):  # which is counted against the motor torque
            return -self._T_c * (coordinate[1:] + coordinate[:-1]) / 2
        return np.diff(coordinate)

    @property
    def work(self) -> tuple[Work, ...]:
        """Of the cycles so far, load by load."""
        counted = zip(self._loads, self._peak, self._given, self._taken, strict=True)
        return tuple(
            Work(i, each.load.input, each.load.words, each.load.UNIT, float(peak), float(given), float(taken))
            for i, (each, peak, given, taken) in enumerate(counted)
        )


def at_motor(load: LoadCourse, value: float, machine: Machine) -> float | None:
    """A value of the load as a torque against that of the motor which carries it [N.m]: of a force that which holds it
    at rest. None where no axis has its direction."""
    if isinstance(load, MotorLoad):
        return value
    return -value * machine.axes[load.axis_name].I_P if load.axis_name in machine.axes else None
