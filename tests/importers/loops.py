"""Master algorithms of other simulators, each as a few lines of our own: the oracle that says why results differ.

An importer steps the units of a :class:`System` in one of two ways: all of them from what they knew at the beginning of
the step (parallel), or one after the other in some order, each with the newest outputs of those before it (sequential).
Values are held over a step. What remains is what initialisation and the first step see, and further lags.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np

from feedsim.simulation.cosim.archive import Archive
from feedsim.simulation.cosim.operations import Interpreter, do_step
from feedsim.simulation.cosim.unit import Port, Unit
from importers.system import Experiment, Result, System, boolean


@dataclass(frozen=True)
class Master:
    """How an importer goes about it.

    Attributes:
        sequential: each instance gets the outputs of those that were stepped before it in the same step.
        settled: connected inputs are brought to the sources' initial outputs in initialization mode, until nothing
            changes; else they have their start values there.
        zeros: the first step is made with 0 on every connected input; else with the sources' initial outputs.
        lag: further steps by which connected inputs are late: all those whose name ends with `late`.
    """

    sequential: bool = False
    settled: bool = True
    zeros: bool = False
    lag: int = 0
    late: str = ""


class _Signals:
    """Real and Boolean variables of a unit, exchanged together; `values` (n,) as `names`, the Real ones first."""

    def __init__(self, unit: Unit, names: Sequence[str]) -> None:
        reals = [name for name in names if not boolean(name)]
        flags = [name for name in names if boolean(name)]
        self.names = (*reals, *flags)
        self.values = np.zeros(len(self.names))
        self._fmu = unit._fmu
        self._port = Port(unit, reals, self.values[: len(reals)])
        self._flags = unit.references(flags).tolist()
        self._at = len(reals)

    def set(self) -> None:
        self._port.set()
        if self._flags:
            self._fmu.setBoolean(self._flags, [bool(value) for value in self.values[self._at :]])

    def get(self) -> None:
        self._port.get()
        if self._flags:
            self.values[self._at :] = [float(value != 0) for value in self._fmu.getBoolean(self._flags)]


class _Member:
    def __init__(self, name: str, unit: Unit, system: System, step: float) -> None:
        self.unit = unit
        self.steps = Interpreter([do_step(unit, 0.0, step)], step)
        self.sources = system.sources(name)
        self.inputs = _Signals(unit, list(self.sources))
        wanted = sorted({source[1] for source, _ in system.connections if source[0] == name})
        self.outputs = _Signals(unit, wanted)
        self.position = {variable: i for i, variable in enumerate(self.outputs.names)}
        self.take: list[Callable[[], float]] = []

    def receive(self) -> None:
        for i, value in enumerate(self.take):
            self.inputs.values[i] = value()
        if self.take:
            self.inputs.set()

    def tell(self) -> None:
        if self.position:
            self.outputs.get()


def run(system: System, experiment: Experiment, master: Master) -> Result:
    """Step `system` as `master` says."""
    with ExitStack() as stack:
        archives: dict[str, Archive] = {}
        members: dict[str, _Member] = {}
        for name, component in system.components.items():
            path = str(component.archive)
            if path not in archives:
                archives[path] = stack.enter_context(Archive(component.archive))
            unit = Unit(archives[path], name)
            stack.callback(unit.close)
            unit.set_parameters(component.start)
            members[name] = _Member(name, unit, system, experiment.step)
        for member in members.values():
            for name in member.inputs.names:
                instance, variable = member.sources[name]
                source = members[instance]
                member.take.append(
                    lambda values=source.outputs.values, i=source.position[variable]: values[i]  # type: ignore[misc]
                )
        recorded = {
            instance: Port(members[instance].unit, [v for i, v in experiment.record if i == instance])
            for instance in dict.fromkeys(instance for instance, _ in experiment.record)
        }
        result: Result = {key: np.empty(experiment.steps + 1) for key in experiment.record}

        def note(k: int) -> None:
            for instance, port in recorded.items():
                port.get()
                for variable, value in zip(port.names, port.values, strict=True):
                    result[instance, variable][k] = value

        _initialise(members, experiment, master)
        note(0)
        held = [[member.inputs.values.copy() for member in members.values()] for _ in range(master.lag)]
        for k in range(experiment.steps):
            if not master.sequential:
                for member in members.values():
                    if master.zeros and k == 0:
                        if member.sources:
                            member.inputs.values[:] = 0.0
                            member.inputs.set()
                    else:
                        member.receive()
                if master.lag:
                    held.append([member.inputs.values.copy() for member in members.values()])
                    for member, values in zip(members.values(), held.pop(0), strict=True):
                        late = [name.endswith(master.late) for name in member.inputs.names]
                        member.inputs.values[late] = values[late]
                        if member.sources:
                            member.inputs.set()
            for member in members.values():
                if master.sequential:
                    member.receive()
                member.steps.run(k, k + 1)
                if master.sequential:
                    member.tell()
            for member in members.values():
                member.tell()
            note(k + 1)
        return result


def _initialise(members: dict[str, _Member], experiment: Experiment, master: Master) -> None:
    for member in members.values():
        member.unit.enter_initialisation(0.0, experiment.stop)
    for _ in members if master.settled else ():
        for member in members.values():
            member.tell()
        for member in members.values():
            member.receive()
    for member in members.values():
        member.unit.exit_initialisation()
    for member in members.values():
        member.tell()
