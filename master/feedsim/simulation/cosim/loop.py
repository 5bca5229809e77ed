"""The cycle loop of a run: control cycles, what the units are given ahead of each, and what is written down.

Executed natively where the library is at hand (:mod:`~feedsim.simulation.cosim.exchange`), else in Python, with the
same result.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Protocol

import numpy as np

from feedsim.files.trace import release
from feedsim.simulation.cosim.exchange import Exchange, Native
from feedsim.simulation.cosim.operations import Interpreter, Operation, When, set_real
from feedsim.simulation.cosim.schedule import Cycle
from feedsim.simulation.cosim.system import System
from feedsim.simulation.nc import Program

Progress = Callable[[int, int], None]

# Cycles between two reports of progress, some 60 ms in Python, 3 ms in the native loop, which is interrupted here only.
REPORTED_EVERY = 2048
# The same in a process that is watched: at first, and in the end; an eighth of what has been done between.
WATCHED = 16, 512
# Rows that are held at the least of what is long.
RING = 1024


class Buffered(Protocol):
    """What holds a stretch of a run only: it is refilled, or emptied, between the cycles."""

    def ahead(self, begin: int, end: int) -> None:
        """Be ready for the cycles `begin` to `end` - 1; those before are done."""


class Loop:
    """Control cycles with what happens `before` and `after` each, in that order."""

    def __init__(
        self,
        cycle: Cycle,
        before: Iterable[Operation],
        after: Iterable[Operation],
        native: Native | None,
        buffered: tuple[Buffered, ...] = (),
    ) -> None:
        """
        Args:
            native: the library that executes it; None: Python does.
            buffered: what is given of every stretch of cycles ahead of it.
        """
        operations = [*before, *cycle.operations(), *after]
        T_c = cycle.cycle
        self._executor = Interpreter(operations, T_c) if native is None else Exchange(native, operations, T_c)
        self._buffered = buffered
        self._watched = self._executor.mark is not None

    @property
    def done(self) -> int:
        """Cycles so far."""
        return self._executor.done

    def run(self, total: int, progress: Progress | None = None) -> None:
        """Work `total` cycles from the first one on.

        Raises:
            SimulationError: a unit failed; the message names the unit, the time and the unit's reason.
        """
        with np.errstate(over="ignore", invalid="ignore"):  # the unit that meets an overflow reports it
            for begin, end in self._stretches(total):
                for part in self._buffered:
                    part.ahead(begin, end)
                self._executor.run(begin, end)
                if progress is not None and (end - begin == REPORTED_EVERY or self._watched):
                    progress(end, total)
        if progress is not None:
            progress(total, total)

    def _stretches(self, total: int) -> Iterator[tuple[int, int]]:
        """Between which cycles rows are taken over. Where a unit may crash, little of a run is then in its process."""
        end = 0
        while end < total:
            length = min(max(end // 8, WATCHED[0]), WATCHED[1]) if self._watched else REPORTED_EVERY
            begin, end = end, min(end + length, total)
            yield begin, end


class Setpoints:
    """The setpoints of each position cycle, `ratio` control cycles long, for the drives; of a long program a stretch.

    Attributes:
        operations: they send it, one per axis.
    """

    def __init__(self, system: System, program: Program, ratio: int) -> None:
        ports = [control.setpoint for control in system.controllers]
        planned = {"x_s": program.x_s, "n_ffw": program.n_ffw}
        self._columns = [
            [(alias, planned[name][axis]) for alias, name in zip(port.aliases, port.names, strict=True)]
            for axis, port in zip(system.axes, ports, strict=True)
        ]
        self._ratio, self._length = ratio, len(program.time)
        self._rows = min(len(program.time), max(RING, 2 * (REPORTED_EVERY // ratio + 1)))
        self._filled = 0
        when = When(every=ratio)
        self._tables = [np.zeros((self._rows, len(port.names))) for port in ports]
        self.operations = [
            operation
            for port, table in zip(ports, self._tables, strict=True)
            for operation in set_real(port, table, when)
        ]

    def ahead(self, begin: int, end: int) -> None:
        done, needed = -(-begin // self._ratio), -(-end // self._ratio)
        if needed <= self._filled:
            return
        last = min(done + self._rows, self._length)
        at = np.arange(self._filled, last) % self._rows
        for table, columns in zip(self._tables, self._columns, strict=True):
            for i, (alias, column) in enumerate(columns):
                table[at, i] = alias.to_own(column[self._filled : last])
        release(*(column for columns in self._columns for _, column in columns))
        self._filled = last
