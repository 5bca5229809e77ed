"""A unit from outside, through the FMI alone: by variable names, with the messages it logs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from ctypes import byref, c_double, c_int, c_uint
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np
from fmpy import calloc, extract, free, read_model_description
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    fmi2CoSimulation,
)
from numpy.typing import ArrayLike, NDArray

Value = float | int | bool | str
Floats = NDArray[np.float64]


class Message(NamedTuple):
    """What a unit logs: status as fmi2Status (0 OK, 1 warning, 3 error)."""

    status: int
    category: str
    text: str


@dataclass(frozen=True)
class Archive:
    """An unpacked FMU."""

    folder: Path
    description: Any

    @classmethod
    def unpack(cls, path: Path, folder: Path) -> Archive:
        """Unpack the FMU at `path` into the new folder `folder`."""
        extract(str(path), unzipdir=str(folder))
        return cls(folder, read_model_description(str(folder)))

    def variable(self, name: str) -> Any:
        """The ScalarVariable of that name."""
        return next(variable for variable in self.description.modelVariables if variable.name == name)

    def instance(self, parameters: Mapping[str, Value] | None = None, **options: Any) -> Instance:
        """A started instance: see `Instance` and `Instance.start`."""
        instance = Instance(self)
        try:
            instance.start(parameters or {}, **options)
        except BaseException:
            instance.close()
            raise
        return instance


class Instance:
    """An instance, freed at the end of a `with` block.

    `messages` is the list it logs into, `blocks` the memory it has allocated and not yet given back: pass your own
    to see what a failing instantiation says and leaves. `resources` is the resourceLocation, False for NULL, True for
    that of the unpacked archive.
    """

    def __init__(
        self,
        archive: Archive,
        messages: list[Message] | None = None,
        blocks: set[int] | None = None,
        resources: bool | str = True,
    ) -> None:
        self.archive = archive
        self.messages = [] if messages is None else messages
        self.blocks = set() if blocks is None else blocks
        self.time = 0.0
        self.fmu = FMU2Slave(
            guid=archive.description.guid,
            unzipDirectory=str(archive.folder),
            modelIdentifier=archive.description.coSimulation.modelIdentifier,
            instanceName="unit",
        )
        callbacks = fmi2CallbackFunctions()
        callbacks.logger = fmi2CallbackLoggerTYPE(self._log)
        callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(self._allocate)
        callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(self._free)
        self._callbacks = callbacks  # ctypes needs them to stay alive
        self._references = {variable.name: variable.valueReference for variable in archive.description.modelVariables}
        if resources is True:
            self.fmu.instantiate(callbacks=callbacks)
        else:
            location = resources.encode() if isinstance(resources, str) else None
            self.fmu.component = self.fmu.fmi2Instantiate(
                b"unit", fmi2CoSimulation, archive.description.guid.encode(), location, byref(callbacks), False, False
            )
            if not self.fmu.component:
                raise RuntimeError("failed to instantiate")
        self.fmu.setDebugLogging(True, ["logStatusError", "logStatusWarning"])

    def __enter__(self) -> Instance:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _log(self, environment: object, name: bytes, status: int, category: bytes, text: bytes) -> None:
        # The logger is a printf: the shell hands over finished text in which % and # are doubled.
        self.messages.append(Message(status, category.decode(), text.decode().replace("%%", "%").replace("##", "#")))

    def _allocate(self, count: int, size: int) -> int | None:
        block: int | None = calloc(count, size)
        if block:
            self.blocks.add(block)
        return block

    def _free(self, block: int | None) -> None:
        if block:
            self.blocks.remove(block)
            free(block)

    def texts(self, status: int) -> str:
        """Everything logged with that status, a line each."""
        return "\n".join(message.text for message in self.messages if message.status == status)

    def start(
        self,
        parameters: Mapping[str, Value],
        inputs: Mapping[str, float] | None = None,
        time: float = 0.0,
        stop_time: float | None = None,
    ) -> None:
        """From instantiated (or reset) to step mode, with parameters and the inputs at the start."""
        self.set(parameters)
        self.fmu.setupExperiment(startTime=time, stopTime=stop_time)
        self.fmu.enterInitializationMode()
        self.set(inputs or {})
        self.fmu.exitInitializationMode()
        self.time = time

    def references(self, names: Iterable[str]) -> list[int]:
        """Value references."""
        return [self._references[name] for name in names]

    def set(self, values: Mapping[str, Value]) -> None:
        """Set variables of any type."""
        setters = {
            "Real": (self.fmu.setReal, float),
            "Integer": (self.fmu.setInteger, int),
            "Boolean": (self.fmu.setBoolean, bool),
            "String": (self.fmu.setString, str),
        }
        for name, value in values.items():
            setter, kind = setters[self.archive.variable(name).type]
            setter(self.references([name]), [kind(value)])

    def get(self, name: str) -> float:
        """A Real variable."""
        return float(self.fmu.getReal(self.references([name]))[0])

    def gets(self, names: Sequence[str]) -> Floats:
        """Real variables, shape (names,)."""
        return np.array(self.fmu.getReal(self.references(names)))

    def step(
        self, h: float, inputs: Mapping[str, float] | None = None, slopes: Mapping[str, float] | None = None
    ) -> None:
        """Set Real inputs and their slopes, then step by h [s]."""
        if inputs:
            self.fmu.setReal(self.references(inputs), list(inputs.values()))
        if slopes:
            self.fmu.setRealInputDerivatives(self.references(slopes), [1] * len(slopes), list(slopes.values()))
        self.fmu.doStep(self.time, h, False)
        self.time += h

    def run(
        self, h: float, inputs: Sequence[str], values: ArrayLike, outputs: Sequence[str], slopes: bool = True
    ) -> Floats:
        """Step through inputs that are linear between rows: values (N + 1, inputs) at the instants k h, k = 0..N.

        Returns the outputs at the instants h .. N h, shape (N, outputs). Without slopes, inputs are held.
        """
        grid = np.ascontiguousarray(np.asarray(values, dtype=float).reshape(-1, len(inputs)))
        steps = len(grid) - 1
        rises = np.diff(grid, axis=0) / h
        result = np.empty((steps, len(outputs)))
        component, n, m = self.fmu.component, len(inputs), len(outputs)
        read = (c_uint * m)(*self.references(outputs))
        write = (c_uint * n)(*self.references(inputs))
        orders = (c_int * n)(*([1] * n))
        for k in range(steps):
            self.fmu.fmi2SetReal(component, write, n, (c_double * n)(*grid[k]))
            if slopes:
                self.fmu.fmi2SetRealInputDerivatives(component, write, n, orders, (c_double * n)(*rises[k]))
            self.fmu.fmi2DoStep(component, self.time + k * h, h, 0)
            row = (c_double * m)()
            self.fmu.fmi2GetReal(component, read, m, row)
            result[k] = row
        self.time += steps * h
        return result

    def derivative(self, name: str) -> float:
        """First derivative of an output with respect to time at the end of the last step."""
        return float(self.fmu.getRealOutputDerivatives(self.references([name]), [1])[0])

    def partial(self, output: str, known: str) -> float:
        """Partial derivative of an output by an input."""
        out, by = self.references([output]), self.references([known])
        return float(self.fmu.getDirectionalDerivative(out, by, [1.0])[0])

    def state(self) -> Any:
        """The instance's state and time; `restore` takes it any number of times."""
        return self.fmu.getFMUState(), self.time

    def restore(self, state: Any) -> None:
        """Back to a state."""
        self.fmu.setFMUState(state[0])
        self.time = state[1]

    def serialized(self) -> bytes:
        """The state as bytes."""
        state = self.fmu.getFMUState()
        try:
            return bytes(self.fmu.serializeFMUState(state))
        finally:
            self.fmu.freeFMUState(state)

    def restore_serialized(self, content: bytes, time: float) -> None:
        """Back to a state from bytes, which stands at `time`."""
        state = self.fmu.deserializeFMUState(content)
        try:
            self.restore((state, time))
        finally:
            self.fmu.freeFMUState(state)

    def close(self) -> None:
        """Free the instance."""
        if self.fmu.component:
            self.fmu.freeInstance()
            self.fmu.component = None
