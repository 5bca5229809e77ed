"""What a run records: which signals of which unit, row by row, and the trace they become.

The cycle loop writes rows into rings that hold a stretch of a run, over and over again; what they hold is taken over
into the table of the whole run before it is overwritten.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feedsim.files.trace import Table, Trace, match_names
from feedsim.foundation.errors import InputError
from feedsim.foundation.outputs import defer_signals
from feedsim.scenario import Machine, Scenario
from feedsim.scenario.roles import DRIVE, FRICTION_ROLE
from feedsim.simulation.cosim import system as wiring
from feedsim.simulation.cosim.operations import DueCycles, Interpreter, Operation, copy, get_row
from feedsim.simulation.cosim.schedule import REPORTED_EVERY, RING, Cycle
from feedsim.simulation.cosim.unit import Floats, Log
from feedsim.simulation.cosim.worker import watched_process
from feedsim.simulation.nc import Program

PLANT_SIGNALS = ("x_a", "n_a")
MEASURED_POSITION = "x_m"  # of a drive: of the present inputs
GUIDE_SIGNAL = "guide.F_fr"  # of axes with friction there
TRANSMISSION_SIGNALS = ("transmission.F", "transmission.way")  # of axes with one
MOUNT_SIGNALS = ("mounts.E", "mounts.x_max")  # where some are not linear
TOOL_SIGNALS = ("tool.x_X", "tool.x_Y", "tool.x_Z", "tcp.x_X", "tcp.x_Y", "tcp.x_Z")
# Of the coupling, not of a unit: recorded where it is asked for.
RESIDUAL, RESIDUAL_UNIT = "residual", "J"
# The drives' limits are looked at in every run: a warning must not depend on what is recorded.
LIMITS = ("torque_limited", "voltage_limited")

Sink = Callable[[Trace], None]


def recorded_columns(scenario: Scenario) -> list[str]:
    """Columns of the trace that a run of `scenario` will leave.

    Raises:
        InputError: an entry of recording.variables matches none.
    """
    wanted = scenario.recording.variables
    if wanted is None:
        return columns_of(scenario.machine, loaded_inputs(scenario))
    try:
        return match_names(columns_of(scenario.machine, loaded_inputs(scenario), residual=True), wanted)
    except InputError as error:
        raise InputError(f"{scenario.file}: recording.variables: {error}") from None


def columns_of(machine: Machine, loaded: Sequence[str] = (), *, residual: bool = False) -> list[str]:
    """All columns that can be recorded, in the order of a trace. loaded: the plant's variables at which loads act."""
    result: list[str] = []
    for name, axis in machine.axes.items():
        shown = (*DRIVE.shown(axis.drive), *FRICTION_ROLE.shown(axis.friction), *([RESIDUAL] if residual else []))
        result += (f"{name}.{signal}" for signal in (*wiring.SETPOINT_UNITS, *PLANT_SIGNALS, *shown))
    return [*result, *_effects(machine), *TOOL_SIGNALS, *loaded]


def _effects(machine: Machine) -> list[str]:
    """Columns of the plant that only machines with such an effect have."""
    guides = [f"{name}.{GUIDE_SIGNAL}" for name in machine.guided]
    transmissions = [f"{name}.{signal}" for name in machine.transmitted for signal in TRANSMISSION_SIGNALS]
    return [*guides, *transmissions, *(MOUNT_SIGNALS if machine.mounts is not None else ())]


def loaded_inputs(scenario: Scenario) -> list[str]:
    """The plant's variables at which loads act, each once."""
    return list(dict.fromkeys(load.input for load in scenario.loads))


class Recording:
    """Rows of signals, one every `every` control cycles; a buffered part of a
    :class:`~feedsim.simulation.cosim.schedule.Loop`.

    Attributes:
        limited: axis and limit -> rows in which the drive was at it.
        sinking: time that the sink has taken [s].
    """

    def __init__(
        self,
        cycle: Cycle,
        loaded: Sequence[str],
        program: Program,
        cycles: int,
        ratio: int,
        every: int,
        columns: Collection[str],
        *,
        scratch: Path | None = None,
        sink: Sink | None = None,
    ) -> None:
        """
        Args:
            loaded: the plant's variables at which loads act.
            cycles: control cycles of the run; `ratio` of them are a position cycle.
            columns: of the trace to be; the units are asked for nothing else but their limits.
            scratch: folder for the file that holds a long trace.
            sink: called with the rows, a stretch at a time, as soon as they are there.

        Raises:
            InputError: a column that there is not.
            OutputError: the file cannot be made.
        """
        system = cycle.system
        self._axes = system.axes
        self.every, self._ratio, self._T_c = every, ratio, cycle.cycle
        self._columns = match_names(columns_of(system.machine, loaded, residual=True), columns)
        self._total, self._scratch = cycles // every + 1, scratch
        self._ring = min(self._total, max(RING, 2 * (REPORTED_EVERY // every + 1)))
        self._sink, self.sinking = sink, 0.0
        self._units: dict[str, str] = {}
        self._logs: list[tuple[Log, dict[str, str]]] = []  # with the names that its signals have in the trace
        setpoints = {f"{axis}.{name}": unit for axis in system.axes for name, unit in wiring.SETPOINT_UNITS.items()}
        self._units |= {name: unit for name, unit in setpoints.items() if name in self._columns}
        plant = [f"{axis}.{signal}" for axis in system.axes for signal in PLANT_SIGNALS]
        self._log(
            wiring.PLANT, {name: name for name in (*plant, *_effects(system.machine), *TOOL_SIGNALS, *loaded)}, cycle
        )
        self.limited: dict[str, int] = {}
        self._measured: list[Operation] = []
        for axis, described in system.machine.axes.items():
            drive, friction = DRIVE.shown(described.drive), FRICTION_ROLE.shown(described.friction)
            self.limited |= {f"{axis}.{limit}": 0 for limit in LIMITS if limit in drive}
            self._log(wiring.controller(axis), {signal: f"{axis}.{signal}" for signal in drive}, cycle)
            if (
                f"{axis}.{MEASURED_POSITION}" in self._columns
            ):  # it follows the inputs, which the drive gets behind the recording
                self._measured += cycle.measured(axis)
            self._log(wiring.friction(axis), {signal: f"{axis}.{signal}" for signal in friction}, cycle)
        residuals = [f"{axis}.{RESIDUAL}" for axis in system.axes]
        self._residual = np.zeros((self._ring, len(system.axes)))
        self._residual_names = residuals if any(name in self._columns for name in residuals) else []
        self._units |= {name: RESIDUAL_UNIT for name in residuals if name in self._columns}
        self._cycle = cycle
        self.restart(program)

    def restart(self, program: Program) -> None:
        """Begin anew with no row, on setpoints at as many instants."""
        self._table = Table(1 + len(self._columns), self._total, self._scratch)
        self.limited = dict.fromkeys(self.limited, 0)
        planned = {"x_s": program.x_s, "n_ffw": program.n_ffw}
        self._setpoints = {
            name: planned[setpoint][axis]
            for axis in self._axes
            for setpoint in planned
            if (name := f"{axis}.{setpoint}") in self._columns
        }

    def _log(self, instance: str, names: dict[str, str], cycle: Cycle) -> None:
        """Record the signals of a unit that are among the columns; `names`: signal -> column."""
        asked = {signal: name for signal, name in names.items() if name in self._columns or signal in LIMITS}
        if not asked:
            return
        log = Log(cycle.system.units[instance], list(asked), self._ring)
        self._logs.append((log, asked))
        for signal, name in asked.items():
            if name in self._columns:
                self._units[name] = log.unit.unit_of(signal)

    @property
    def rows(self) -> int:
        """How many have been taken over."""
        return self._table.filled

    @property
    def operations(self) -> list[Operation]:
        """What is done ahead of each cycle; the end of the last one is left to :meth:`record`."""
        when = DueCycles(every=self.every)
        kept = [copy(self._residual, self._cycle.bond.residual, when)] if self._residual_names else []
        rows = (operation for log, _ in self._logs for operation in get_row(log, when))
        return [*self._measured, *rows, *kept]

    def record(self, k: int) -> None:
        """Record the instant k T_c, where it is one to be recorded; those before are done."""
        self.ahead(k, k + 1)
        Interpreter(self.operations, self._T_c).run(k, k + 1)

    def ahead(self, begin: int, end: int) -> None:
        """Make room for the rows of the cycles `begin` to `end` - 1."""
        if -(-end // self.every) - self.rows > self._ring or (self._sink is not None and watched_process() is not None):
            self.collect(begin)

    def collect(self, cycles: int) -> None:
        """Take over the rows of the instants before that of `cycles`.

        Raises:
            OutputError: the disk is full; or what the sink raises.
        """
        first, last = self.rows, min(-(-cycles // self.every), self._table.rows)
        if first >= last:
            return
        with defer_signals():  # neither half a row nor one twice
            block = self._block(np.arange(first, last))
            self._table.append(block)
            if self._sink is not None:
                begun = perf_counter()
                self._sink(self._as_trace(list(block)))
                self.sinking += perf_counter() - begun

    def _block(self, rows: NDArray[np.int64]) -> Floats:
        """Time and columns of rows that the rings hold, (1 + columns, n)."""
        cycle = rows * self.every
        result: dict[str, Floats] = {}
        for log, names in self._logs:
            columns = log.columns(self._of_rows(log.reals, rows), self._of_rows(log.flags, rows))
            result |= {names[signal]: values for signal, values in columns.items()}
        for name in self.limited:
            self.limited[name] += int(np.count_nonzero(result[name]))
        position_cycle = cycle // self._ratio
        low, high = int(position_cycle[0]), int(position_cycle[-1]) + 1
        result |= {name: values[low:high][position_cycle - low] for name, values in self._setpoints.items()}
        if self._residual_names:
            result |= dict(zip(self._residual_names, self._of_rows(self._residual, rows).T, strict=True))
        block = np.empty((1 + len(self._columns), len(rows)))
        block[0] = cycle * self._T_c
        for i, name in enumerate(self._columns):
            block[1 + i] = result[name]
        return block

    def _of_rows(self, ring: NDArray[Any], rows: NDArray[np.int64]) -> NDArray[Any]:
        """What a ring holds of consecutive rows; not copied where they do not go over its end."""
        first, last = int(rows[0]) % self._ring, int(rows[-1]) % self._ring + 1
        return ring[first:last] if first < last else np.concatenate((ring[first:], ring[:last]))

    def share(self, limit: str) -> float:
        """Share of the recorded instants at which a drive was at a limit, "A.torque_limited"."""
        return self.limited[limit] / self.rows if self.rows else 0.0

    def trace(self) -> Trace:
        """The rows that were taken over; nothing can be recorded afterwards."""
        return self._as_trace(self._table.columns())

    def _as_trace(self, columns: list[Floats]) -> Trace:
        time, *values = columns
        return Trace(time, dict(zip(self._columns, values, strict=True)), self._units)
