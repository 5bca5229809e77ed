"""What a run records: which signals of which unit, row by row, and the trace they become."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from feedsim.cosim import wiring
from feedsim.cosim.exchange import When
from feedsim.cosim.loop import Record
from feedsim.cosim.system import System
from feedsim.cosim.unit import Floats, Log
from feedsim.errors import InputError
from feedsim.nc import Program
from feedsim.scenario import Scenario
from feedsim.trace import Trace, matching

CONTROLLER_SIGNALS = (
    "M_a", "x_e", "n_s", "n_ref", "M_s", "i_d", "i_q", "u_d", "u_q", "torque_limited", "voltage_limited",
)  # fmt: skip
FRICTION_SIGNALS = ("M_fr", "z", "c", "k", "lambda")
PLANT_SIGNALS = ("x_a", "n_a")
TOOL_SIGNALS = ("tool.x_X", "tool.x_Y", "tool.x_Z", "tcp.x_X", "tcp.x_Y", "tcp.x_Z")


def recorded_columns(scenario: Scenario) -> list[str]:
    """Columns of the trace that a run of `scenario` will leave.

    Raises:
        InputError: an entry of recording.variables matches none.
    """
    names = [
        f"{axis}.{signal}"
        for axis in scenario.machine.axes
        for signal in (*wiring.SETPOINT_UNITS, *PLANT_SIGNALS, *CONTROLLER_SIGNALS, *FRICTION_SIGNALS)
    ]
    names += TOOL_SIGNALS
    if scenario.recording.variables is None:
        return names
    try:
        return matching(names, scenario.recording.variables)
    except InputError as error:
        raise InputError(f"{scenario.file}: recording.variables: {error}") from None


class Recording:
    """Rows of the units' signals, one every `every` control cycles.

    Attributes:
        logs: instance -> its :class:`Log`.
    """

    def __init__(self, system: System, cycles: int, every: int, only: Collection[str] | None = None) -> None:
        """`only`: columns of the trace to be; None: all."""
        self.system = system
        self.every = every
        self.only = only
        rows = cycles // every + 1
        plant = [f"{axis}.{signal}" for axis in system.axes for signal in PLANT_SIGNALS] + list(TOOL_SIGNALS)
        self.logs = {wiring.PLANT: Log(system.plant, [name for name in plant if self._wanted(name)], rows)}
        for axis in system.axes:
            for instance, signals in (
                (wiring.controller(axis), CONTROLLER_SIGNALS),
                (wiring.friction(axis), FRICTION_SIGNALS),
            ):
                names = [signal for signal in signals if self._wanted(f"{axis}.{signal}")]
                self.logs[instance] = Log(system.units[instance], names, rows)

    def _wanted(self, column: str) -> bool:
        return self.only is None or column in self.only

    def record(self, k: int) -> None:
        """Record the instant k T_c, where it is one to be recorded."""
        if k % self.every == 0:
            for log in self.logs.values():
                log.record(k // self.every)

    @property
    def activities(self) -> list[Record]:
        """The same for the cycle loop; the end of the last cycle is left to :meth:`record`."""
        return [Record(log, When(every=self.every)) for log in self.logs.values()]

    def trace(self, program: Program, T_c: float, ratio: int) -> Trace:
        """The signals over time; setpoints are those of the position cycle, `ratio` control cycles long."""
        plant = self.logs[wiring.PLANT]
        of_plant = plant.columns()
        cycle = np.arange(len(plant.reals)) * self.every
        position_cycle = cycle // ratio
        columns: dict[str, Floats] = {}
        units: dict[str, str] = {}
        for axis in self.system.axes:
            for setpoint, values in (("x_s", program.x_s), ("n_ffw", program.n_ffw)):
                if not self._wanted(f"{axis}.{setpoint}"):
                    continue
                columns[f"{axis}.{setpoint}"] = values[axis][position_cycle]
                units[f"{axis}.{setpoint}"] = wiring.SETPOINT_UNITS[setpoint]
            for name in (f"{axis}.{signal}" for signal in PLANT_SIGNALS):
                if name in of_plant:
                    columns[name] = of_plant[name]
                    units[name] = plant.unit.archive.unit_of(name)
            for log in (self.logs[wiring.controller(axis)], self.logs[wiring.friction(axis)]):
                for signal, column in log.columns().items():
                    columns[f"{axis}.{signal}"] = column
                    units[f"{axis}.{signal}"] = log.unit.archive.unit_of(signal)
        for signal in TOOL_SIGNALS:
            if signal in of_plant:
                columns[signal] = of_plant[signal]
                units[signal] = plant.unit.archive.unit_of(signal)
        return Trace(time=np.asarray(cycle * T_c, dtype=np.float64), columns=columns, units=units)
