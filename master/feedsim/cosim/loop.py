"""The cycle loop of a run: control cycles, what the units are told ahead of each, and what is written down.

Executed natively where the library is at hand (:mod:`~feedsim.cosim.exchange`), else in Python, with the same result.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from feedsim.cosim.compiled import compile_cycle
from feedsim.cosim.exchange import Native, Operations, When
from feedsim.cosim.schedule import Cycle
from feedsim.cosim.system import System
from feedsim.cosim.unit import Floats, Log, Port
from feedsim.errors import SimulationError
from feedsim.nc import Program
from feedsim.trace import release

Progress = Callable[[int, int], None]

# Cycles between two reports of progress, some 60 ms in Python, 3 ms in the native loop, which is interrupted here only.
REPORTED_EVERY = 2048
# Rows that are held at the least of what is long.
RING = 1024


class Activity(Protocol):
    """What happens beside the cycle itself."""

    def __call__(self, k: int) -> None:
        """Do it, where it is due in cycle k."""

    def compile(self, to: Operations) -> None:
        """The same as operations."""


@dataclass(frozen=True, eq=False)
class Send:
    """Inputs of a unit that are known ahead: a row of `values`, and of `slopes` where there are any, at a time.

    Attributes:
        values, slopes: (rows, n) for the n variables of the port.
    """

    port: Port
    values: Floats
    when: When
    slopes: Floats | None = None

    def __call__(self, k: int) -> None:
        row = self.when.row(k, len(self.values))
        if row is None:
            return
        self.port.values[:] = self.values[row]
        self.port.set()
        if self.slopes is not None:
            self.port.slopes[:] = self.slopes[row]
            self.port.set_slopes()

    def compile(self, to: Operations) -> None:
        to.set(self.port, np.ascontiguousarray(self.values, dtype=np.float64), self.when)
        if self.slopes is not None:
            to.set_slopes(self.port, np.ascontiguousarray(self.slopes, dtype=np.float64), self.when)


@dataclass(frozen=True, eq=False)
class Record:
    """Variables of a unit into a row of a log at a time."""

    log: Log
    when: When

    def __call__(self, k: int) -> None:
        row = self.when.row(k, len(self.log.reals))
        if row is not None:
            self.log.record(row)

    def compile(self, to: Operations) -> None:
        to.record(self.log, self.when)


@dataclass(frozen=True, eq=False)
class Keep:
    """A shared buffer (n,) into a row of a table (rows, n) at a time."""

    buffer: Floats
    table: Floats
    when: When

    def __call__(self, k: int) -> None:
        row = self.when.row(k, len(self.table))
        if row is not None:
            self.table[row] = self.buffer

    def compile(self, to: Operations) -> None:
        to.copy(self.table, self.buffer, self.when)


class Buffered(Protocol):
    """What holds a stretch of a run only: it is refilled, or emptied, between the cycles."""

    def ahead(self, begin: int, end: int) -> None:
        """Be ready for the cycles `begin` to `end` - 1; those before are done."""


@dataclass(eq=False)
class Loop:
    """Control cycles with what happens `before` and `after` each, in that order.

    Attributes:
        native: the library that executes it; None: Python does.
        buffered: what is told of every stretch of cycles ahead of it.
        done: cycles so far.
    """

    cycle: Cycle
    before: tuple[Activity, ...]
    after: tuple[Activity, ...]
    native: Native | None
    buffered: tuple[Buffered, ...] = ()
    done: int = 0

    def run(self, total: int, progress: Progress | None = None) -> None:
        """Work `total` cycles from the first one on.

        Raises:
            SimulationError: a unit failed; the message names the unit, the time and the unit's reason.
        """
        work = self._python() if self.native is None else self._compiled(self.native)
        with np.errstate(over="ignore", invalid="ignore"):  # the unit that meets an overflow reports it
            for begin in range(0, total, REPORTED_EVERY):
                end = min(begin + REPORTED_EVERY, total)
                for part in self.buffered:
                    part.ahead(begin, end)
                work(begin, end)
                if progress is not None and end - begin == REPORTED_EVERY:
                    progress(end, total)
        if progress is not None:
            progress(total, total)

    def _python(self) -> Callable[[int, int], None]:
        before, cycle, after = self.before, self.cycle, self.after

        def work(begin: int, end: int) -> None:
            for k in range(begin, end):
                for activity in before:
                    activity(k)
                cycle.run(k)
                for activity in after:
                    activity(k)
                self.done = k + 1

        return work

    def _compiled(self, native: Native) -> Callable[[int, int], None]:
        operations = Operations()
        for activity in self.before:
            activity.compile(operations)
        compile_cycle(self.cycle, operations)
        for activity in self.after:
            activity.compile(operations)

        def work(begin: int, end: int) -> None:
            try:
                operations.run(native, self.cycle.cycle, begin, end)
            except SimulationError:
                self.done = operations.failed_in
                raise
            self.done = end

        return work


class Setpoints:
    """The setpoints of each position cycle, `ratio` control cycles long, for the drives; of a long program a stretch.

    Attributes:
        sends: one per axis.
    """

    def __init__(self, system: System, program: Program, ratio: int) -> None:
        self._columns = [(program.x_s[axis], program.n_ffw[axis]) for axis in system.axes]
        self._ratio = ratio
        self._rows = min(len(program.time), max(RING, 2 * (REPORTED_EVERY // ratio + 1)))
        self._filled = 0
        when = When(every=ratio)
        self.sends = [Send(control.setpoint, np.zeros((self._rows, 2)), when) for control in system.controllers]

    def ahead(self, begin: int, end: int) -> None:
        done, needed = -(-begin // self._ratio), -(-end // self._ratio)
        if needed <= self._filled:
            return
        last = min(done + self._rows, len(self._columns[0][0]))
        at = np.arange(self._filled, last) % self._rows
        for send, columns in zip(self.sends, self._columns, strict=True):
            for i, column in enumerate(columns):
                send.values[at, i] = column[self._filled : last]
        release(*(column for columns in self._columns for column in columns))
        self._filled = last
