"""One FMU instance, through fmpy and ctypes.

A :class:`Unit` is an instance of an archive; a :class:`Port` is a group of Real variables of one unit that travel
together. A port's buffers are numpy arrays, possibly views of a larger one, whose
addresses go straight into the FMI calls: wiring two units is sharing memory, and a cycle makes no copies.
"""

from __future__ import annotations

import copy
import ctypes
import re
import weakref
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from typing import Any, NoReturn, Self

import numpy as np
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import defaultCallbacks, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from numpy.typing import NDArray

from feedsim.foundation.errors import Finding, InputError, SimulationError
from feedsim.simulation.cosim.archive import Archive, preserve_float_settings
from feedsim.simulation.cosim.worker import mark_call

Floats = NDArray[np.float64]

# Compiled ahead: what a signal raises inside a callback is lost, so callbacks are kept short.
_CALL = re.compile(r"^fmi2[A-Za-z]+: ")
OK, WARNING, DISCARD, ERROR, FATAL, PENDING = range(6)  # fmi2Status
_STATUSES = ("ok", "warning", "discard", "error", "fatal", "pending")
MAX_WARNINGS = 20  # of a unit that are shown
MAX_TEXT = 1000  # bytes of a unit's message

_STATUS, _ADDRESS, _COUNT, _TIME = ctypes.c_int, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_double
_VALUES = ctypes.CFUNCTYPE(_STATUS, _ADDRESS, _ADDRESS, _COUNT, _ADDRESS)
_SLOPES = ctypes.CFUNCTYPE(_STATUS, _ADDRESS, _ADDRESS, _COUNT, _ADDRESS, _ADDRESS)
_STEP = ctypes.CFUNCTYPE(_STATUS, _ADDRESS, _TIME, _TIME, ctypes.c_int)
_STATE = ctypes.CFUNCTYPE(_STATUS, _ADDRESS, _ADDRESS)
# What the operations of a cycle call (feedsim.simulation.cosim.operations).
_CALLS = {
    "set_real": ("fmi2SetReal", _VALUES),
    "set_slopes": ("fmi2SetRealInputDerivatives", _SLOPES),
    "do_step": ("fmi2DoStep", _STEP),
    "get_real": ("fmi2GetReal", _VALUES),
    "get_slopes": ("fmi2GetRealOutputDerivatives", _SLOPES),
    "get_boolean": ("fmi2GetBoolean", _VALUES),
    "get_state": ("fmi2GetFMUstate", _STATE),
    "set_state": ("fmi2SetFMUstate", _STATE),
    "free_state": ("fmi2FreeFMUstate", _STATE),
}


def status_name(status: int) -> str:
    """For messages, such as "status discard"."""
    return f"status {_STATUSES[status]}" if 0 <= status < len(_STATUSES) else f"status {status}, which FMI has not"


def decode_unit_text(text: bytes | None) -> str:
    """What a unit has passed as a text, be it NULL, no UTF-8, or without an end in sight."""
    return (text or b"")[:MAX_TEXT].decode("utf-8", errors="replace").strip()


@dataclass
class _InstanceState:
    """Where an instance stands, by whatever signals it is known.

    may_terminate: it has been initialised, and nothing has happened behind which FMI 2.0 forbids fmi2Terminate.
    may_free: likewise fmi2FreeInstance, and all else.
    """

    time: float = 0.0
    may_terminate: bool = False
    may_free: bool = True


@dataclass(frozen=True)
class Alias:
    """A variable that stands for a signal of the system: signal = factor * variable + offset, in the SI unit `unit`;
    None where it is that which the archive declares."""

    name: str
    unit: str | None = None
    factor: float = 1.0
    offset: float = 0.0

    @property
    def converts(self) -> bool:
        return (self.factor, self.offset) != (1.0, 0.0)

    def to_own(self, signal: Any) -> Any:
        """Values of the variable for those of the signal."""
        return signal * (1 / self.factor) - self.offset / self.factor if self.converts else signal

    def to_signal(self, variable: Any) -> Any:
        """Values of the signal for those of the variable."""
        return variable * self.factor + self.offset if self.converts else variable


class Unit:
    """An instance of an archive. Every failed call raises :class:`SimulationError` with the unit's own message."""

    def __init__(self, archive: Archive, name: str, signals: Mapping[str, Alias] | None = None) -> None:
        """signals: what the system calls the variables that it exchanges and records; None: as the archive does."""
        self.archive = archive
        self.signals = signals
        self.name = name
        self.role = ""  # what it is in the machine, such as "friction of Z"
        self.warnings: list[Finding] = []
        self._messages: list[str] = []
        self._last_text = ""
        self._stand = _InstanceState()
        self._fmu = archive.slave(name)
        callbacks = fmi2CallbackFunctions()
        callbacks.logger = fmi2CallbackLoggerTYPE(self._log)
        if signals is not None:
            _UNITS[id(self)] = self
            callbacks.componentEnvironment = id(self)
            callbacks.logger = _LOG_CALLBACK
            _print_messages(callbacks)
        callbacks.allocateMemory = defaultCallbacks.allocateMemory
        callbacks.freeMemory = defaultCallbacks.freeMemory
        try:
            with self.calls("fmi2Instantiate", f" ({archive.path})"):
                self._fmu.instantiate(callbacks=callbacks, loggingOn=True)
        except Exception as error:
            raise InputError(f"unit {name}: cannot be instantiated: {self._words() or error}") from error
        known = {category.name for category in archive.description.logCategories or ()}
        if wanted := [name for name in ("logStatusWarning", "logStatusError") if name in known]:
            try:
                with self.calls("fmi2SetDebugLogging"):
                    self._fmu.setDebugLogging(True, wanted)
            except FMICallException as error:  # it goes on with fewer messages
                self.note_status(error)
                self._call_failed(f"fmi2SetDebugLogging failed: {self.said(error)}")
        self._component = self._fmu.component
        self._last_text = ""  # what it says of its making explains no later fault
        self.kept_state: NDArray[np.uintp] = np.zeros(1, dtype=np.uintp)  # an fmi2FMUstate; 0: none yet

    def _log(self, environment: object, name: bytes, status: int, category: bytes, message: bytes) -> None:
        text = decode_unit_text(message).replace("%%", "%").replace("##", "#")
        text = _CALL.sub("", text)  # which call it was says nothing to the master's user
        self._last_text = text or self._last_text
        if status == WARNING:
            self._warn(
                Finding("unit-warns", "doubt", f"{self.name}: {text or 'a warning without a message'}", self.name)
            )
        elif status > WARNING and text and len(self._messages) < MAX_WARNINGS:
            self._messages.append(text)

    def _warn(self, finding: Finding) -> None:
        if finding in self.warnings:
            return
        if len(self.warnings) < MAX_WARNINGS:
            self.warnings.append(finding)
        elif len(self.warnings) == MAX_WARNINGS:
            text = f"{self.name}: more warnings, which are not shown"
            self.warnings.append(Finding("unit-warns-often", "doubt", text, self.name))

    def _call_failed(self, text: str) -> None:
        """A call failed without which the run goes on."""
        self._warn(Finding("unit-call-failed", "doubt", f"{self.name}: {text}", self.name))

    def warn_of_arithmetic(self) -> None:
        """That it has left the processor's settings changed."""
        self._warn(Finding(
            "unit-changes-arithmetic", "doubt",
            f"{self.name}: it changes how its process computes (rounding, denormal numbers or traps: fesetround, "
            "MXCSR), which changes what other units compute; this is put back after each of its calls",
            self.name,
        ))  # fmt: skip

    @contextmanager
    def calls(self, action: str, where: str = "") -> Iterator[None]:
        """A block that calls the unit; `where` stands behind its name in messages."""
        with preserve_float_settings(self.warn_of_arithmetic), mark_call(f"unit {self.name}{where}: {action}"):
            yield

    def _words(self) -> str:
        """What it has said since that is no warning."""
        said = "; ".join(self._messages)
        self._messages.clear()
        return said

    def said(self, error: int | Exception | None) -> str:
        """The same for a message about a call that has failed with a status, or an exception that has one."""
        status = getattr(error, "status", None) if isinstance(error, Exception) else error
        last = f"no message (its last was: {self._last_text})" if self._last_text else "no message"
        return f"{self._words() or last}{'' if status is None else f' ({status_name(status)})'}"

    def note_status(self, error: int | Exception) -> None:
        """What FMI 2.0.4, section 4.2.4, still allows behind the status of a call."""
        status = getattr(error, "status", None) if isinstance(error, Exception) else error
        if status is not None and status not in (OK, WARNING, DISCARD):
            self._stand.may_terminate = False
        if status == FATAL:
            self.archive.note_fatal()
        if status == PENDING:  # a step goes on beside this program
            self._stand.may_free = False

    def fail(self, action: str, error: int | Exception, t: float | None = None, hint: str = "") -> NoReturn:
        """Raise for a call that failed with a status, or an exception that has one, at t [s]; without it where the
        unit stands. hint: what to do."""
        if t is not None:
            self._stand.time = t
        self.note_status(error)
        raise SimulationError(f"{self.where}: {action} failed: {self.said(error)}{hint and f'; {hint}'}")

    @property
    def where(self) -> str:
        """What a message about it begins with."""
        return f"unit {self.name}, t = {self._stand.time:.9g} s"

    @property
    def known_as(self) -> str:
        """Its name, and what it is in the machine."""
        return f"unit {self.name}{self.role and f' ({self.role})'}"

    def _checked(self, action: str, call: Any, *arguments: Any) -> None:
        """A call of fmpy's own wrapper: it raises without the unit's words, which belong into the message."""
        try:
            with self.calls(action, f", t = {self._stand.time:.9g} s"):
                call(*arguments)
        except Exception as error:
            self.fail(action, error)

    @property
    def library(self) -> ctypes.CDLL:
        """The unit's shared library, loaded for as long as its archive is open."""
        library: ctypes.CDLL = self._fmu.dll
        return library

    @property
    def component(self) -> int:
        """Address of the instance, the first argument of every FMI function."""
        return int(self._component)

    def call(self, operation: str) -> Callable[..., int]:
        """What an operation calls, on this instance; it returns the fmi2Status."""
        function, prototype = _CALLS[operation]
        return partial(prototype((function, self.library)), self.component)

    def address(self, operation: str) -> int:
        """Address of the function that an operation calls, for those who call it without Python in between."""
        return ctypes.cast(getattr(self.library, _CALLS[operation][0]), ctypes.c_void_p).value or 0

    def set_parameters(self, parameters: Mapping[str, float | int | bool | str]) -> None:
        """Set start values by name, before initialisation.

        Raises:
            InputError: the unit has no such variable, or refuses the value.
        """
        real, integer, flag = (self._fmu.setReal, float), (self._fmu.setInteger, int), (self._fmu.setBoolean, bool)
        kinds: dict[str, Any] = {"Real": real, "Integer": integer, "Enumeration": integer, "Boolean": flag}
        groups: dict[Any, list[tuple[str, int, Any]]] = {}
        for name, value in parameters.items():
            variable = self.archive.variables.get(name)
            if variable is None:
                raise InputError(f"{self.archive.path.name}: no variable '{name}'")
            setter, of_type = kinds.get(variable.type, (self._fmu.setString, str))
            groups.setdefault(setter, []).append((name, variable.valueReference, of_type(value)))
        for setter, group in groups.items():
            try:
                with self.calls(f"setting {', '.join(name for name, _, _ in group)}"):
                    setter([reference for _, reference, _ in group], [value for _, _, value in group])
            except Exception as error:
                self.note_status(error)
                self._words()
                self._set_one_by_one(setter, group)

    def _set_one_by_one(self, setter: Any, group: Iterable[tuple[str, int, Any]]) -> None:
        """Set start values one by one: name, reference, value. InputError names the one that is refused."""
        for name, reference, value in group:
            try:
                with self.calls(f"setting {name}"):
                    setter([reference], [value])
            except Exception as error:
                self.note_status(error)
                raise InputError(f"unit {self.name} refuses {name} = {value!r}: {self.said(error)}") from None

    def reset(self) -> None:
        """Back to where it was instantiated: all variables have the archive's start values."""
        self._stand.time, self._stand.may_terminate = 0.0, False
        self.warnings.clear()
        self._checked("fmi2Reset", self._fmu.reset)

    def enter_initialisation(self, start: float, stop: float) -> None:
        self._stand.time = start
        self._checked("fmi2SetupExperiment", self._fmu.setupExperiment, None, start, stop)
        self._checked("fmi2EnterInitializationMode", self._fmu.enterInitializationMode)

    def exit_initialisation(self) -> None:
        self._checked("fmi2ExitInitializationMode", self._fmu.exitInitializationMode)
        self._stand.may_terminate = True

    def check_parameters(self) -> None:
        """In initialisation mode: let the unit judge its parameters together, by asking for an initial value.

        Raises:
            InputError: with the unit's own words.
        """
        reals = [v for v in self.archive.variables.values() if v.causality == "output" and v.type == "Real"]
        try:
            with self.calls("judging its parameters"):
                self._fmu.getReal([reals[0].valueReference])
        except Exception as error:
            self.note_status(error)
            raise InputError(f"unit {self.name} refuses its parameters: {self.said(error)}") from None

    def value(self, name: str) -> float:
        """A Real or Integer variable as it is now; for what is read once, ports and logs are faster.

        Raises:
            InputError: the unit has no such variable.
        """
        reference = self.references([name]).tolist()
        kind = self.archive.variables[name].type
        try:
            with self.calls(f"reading {name}"):
                values = self._fmu.getInteger(reference) if kind == "Integer" else self._fmu.getReal(reference)
        except Exception as error:
            self.fail(f"reading {name}", error)
        return float(values[0])

    def part(self, signals: Mapping[str, Alias]) -> Self:
        """The same instance, known by the signals of a part inside it. It is not to be closed."""
        part = copy.copy(self)
        part.signals = signals
        return part

    def terminate(self) -> None:
        """End its simulation, where FMI 2.0 allows that; never raises. A warning says where it fails."""
        if self._component is None or self.archive.fatal or not self._stand.may_terminate:
            return
        self._stand.may_terminate = False
        try:
            with self.calls("fmi2Terminate"):
                self._fmu.terminate()
        except Exception as error:
            self.note_status(error)
            self._call_failed(f"fmi2Terminate, after the last step, failed: {self.said(error)}")

    def close(self) -> None:
        """Free the instance; never raises, so that it can stand in a `finally`."""
        if self._component is not None and self._stand.may_free and not self.archive.fatal:
            with suppress(OSError):  # how Windows shows a crash
                if self.kept_state[0]:
                    with self.calls("fmi2FreeFMUstate"):
                        self.call("free_state")(self.kept_state.ctypes.data)
                with self.calls("fmi2FreeInstance"):
                    self._fmu.fmi2FreeInstance(self._component)  # the library stays loaded, for other instances
        self._component = None

    def alias(self, name: str) -> Alias:
        """The variable that stands for a signal; where the unit has no signals, the one of that name."""
        return Alias(name) if self.signals is None or name not in self.signals else self.signals[name]

    def unit_of(self, name: str) -> str:
        """Unit of a signal, or of the variable of that name; "1" where there is none."""
        return self.alias(name).unit or self.archive.unit_of(name)

    def references(self, names: Iterable[str]) -> NDArray[np.uint32]:
        """Value references of the named variables.

        Raises:
            InputError: the unit has no such variable.
        """
        known = self.archive.variables
        names = [self.alias(name).name for name in names]
        for name in names:
            if name not in known:
                raise InputError(f"{self.archive.path.name}: no variable '{name}'")
        return np.array([known[name].valueReference for name in names], dtype=np.uint32)


class UnloadedUnit(Unit):
    """A unit whose library is not loaded: it has its names, answers nothing and judges nothing."""

    def __init__(self, archive: Archive, name: str, signals: Mapping[str, Alias] | None = None) -> None:
        """InputError: the archive has no library for this platform."""
        self.archive, self.name, self.signals = archive, name, signals
        self._component = None
        self.role = ""
        archive.library()
        self.warnings = [Finding(
            "unit-not-checked", "doubt",
            f"{name}: not checked: what {archive.path} itself says of its parameters, and whether it can be loaded; "
            "its program is another maker's, which only a run executes",
            name,
        )]  # fmt: skip

    def call(self, operation: str) -> Callable[..., int]:
        return lambda *_: OK

    def set_parameters(self, parameters: Mapping[str, float | int | bool | str]) -> None:
        self.references(parameters)

    def enter_initialisation(self, start: float, stop: float) -> None:
        pass

    def exit_initialisation(self) -> None:
        pass

    def check_parameters(self) -> None:
        pass

    def value(self, name: str) -> float:
        self.references([name])
        return 0.0


def not_finite(names: Sequence[str], values: Floats) -> str:
    """Which of the values are none that can be passed on, for messages; empty where all are finite."""
    return ", ".join(
        f"{name} = {value:g}, which is not finite"
        for name, value in zip(names, values.flat, strict=False)
        if not np.isfinite(value)
    )


def describe_exchange(operation: str, names: Sequence[str]) -> str:
    """What a unit is at, for messages."""
    done = "setting" if operation.startswith("set") else "reading"
    return f"{done} {'slopes of ' if operation.endswith('slopes') else ''}{', '.join(names)}"


# Another maker's unit leaves it to the importer's logger to print numbers into its messages, as in C. FMPy's library
# does, and hands over to a logger that is the same for all units: which unit it is says the environment.
_UNITS: weakref.WeakValueDictionary[int, Unit] = weakref.WeakValueDictionary()


def _log_message(environment: int | None, *message: Any) -> None:
    if (unit := _UNITS.get(environment or 0)) is not None:
        unit._log(environment, *message)


_LOG_CALLBACK = fmi2CallbackLoggerTYPE(_log_message)


def _print_messages(callbacks: fmi2CallbackFunctions) -> None:
    try:
        from fmpy.logging import addLoggerProxy
    except OSError:  # FMPy has none for this platform: messages come as they are
        return
    addLoggerProxy(ctypes.byref(callbacks))


class Port:
    """Real variables of one unit that are exchanged in one call.

    Attributes:
        references, orders: (n,) value references, and the order of the derivatives (1), as the FMI functions take them.
        aliases: of the variables.
        values, slopes: (n,) signals and their first time derivatives, shared with other units.
        own_values, own_slopes: (n,) the same as the unit has them: the same memory, unless there is a unit of
            measurement to be converted.
    """

    def __init__(
        self, unit: Unit, names: Sequence[str], values: Floats | None = None, slopes: Floats | None = None
    ) -> None:
        self.unit = unit
        self.names = tuple(names)
        count = len(self.names)
        self.values = np.zeros(count) if values is None else values
        self.slopes = np.zeros(count) if slopes is None else slopes
        for buffer in (self.values, self.slopes):
            if buffer.shape != (count,) or buffer.dtype != np.float64 or not buffer.flags.c_contiguous:
                raise ValueError(f"port {self.names}: a buffer of {count} contiguous float64 is needed")
        self.references = unit.references(self.names)
        self.orders = np.ones(count, dtype=np.int32)
        self.aliases = tuple(map(unit.alias, self.names))
        self.converts = any(alias.converts for alias in self.aliases)
        self.own_values, self.own_slopes = (
            (np.zeros(count), np.zeros(count)) if self.converts else (self.values, self.slopes)
        )

    def to_own(self, values: Floats) -> Floats:
        """Signals (..., n) as the unit is to get them."""
        if not self.converts:
            return values
        columns = [alias.to_own(values[..., i]) for i, alias in enumerate(self.aliases)]
        return np.ascontiguousarray(np.stack(columns, axis=-1))

    def set(self) -> None:
        """Send the values now."""
        if self.converts:
            self.own_values[:] = self.to_own(self.values)
        self._exchange("set_real")

    def get(self) -> None:
        """Find the values now."""
        self._exchange("get_real")
        if fault := not_finite(self.names, self.own_values):
            raise SimulationError(f"{self.unit.known_as}: gives {fault}")
        if self.converts:
            self.values[:] = [
                alias.to_signal(value) for alias, value in zip(self.aliases, self.own_values, strict=True)
            ]

    def _exchange(self, operation: str) -> None:
        at, count, action = self.references.ctypes.data, self.references.size, describe_exchange(operation, self.names)
        with self.unit.calls(action):
            status = self.unit.call(operation)(at, count, self.own_values.ctypes.data)
        if status not in (OK, WARNING):
            self.unit.fail(action, status)


class Log:
    """Rows of a unit's variables, written by the unit itself into preallocated memory.

    Attributes:
        reals: (rows, n) of the Real variables `real_names`.
        flags: (rows, m) of the Boolean variables `flag_names`, 0 or 1.
        real_references, flag_references: (n,) and (m,) value references.
    """

    def __init__(self, unit: Unit, names: Sequence[str], rows: int) -> None:
        self.unit = unit
        unit.references(names)  # names must exist before their types are asked
        kinds = {name: unit.archive.variables[unit.alias(name).name].type for name in names}
        self.real_names = tuple(name for name in names if kinds[name] == "Real")
        self.flag_names = tuple(name for name in names if kinds[name] == "Boolean")
        if len(self.real_names) + len(self.flag_names) != len(names):
            raise InputError(f"{unit.archive.path.name}: only Real and Boolean variables can be recorded, not {names}")
        self.reals = np.zeros((rows, len(self.real_names)))
        self.flags = np.zeros((rows, len(self.flag_names)), dtype=np.int32)
        self.real_references = unit.references(self.real_names)
        self.flag_references = unit.references(self.flag_names)

    def columns(self, reals: Floats | None = None, flags: NDArray[Any] | None = None) -> dict[str, Floats]:
        """Columns by the signals' names, each (rows,): of these rows, or of all."""
        reals, flags = self.reals if reals is None else reals, self.flags if flags is None else flags
        columns = {name: self.unit.alias(name).to_signal(reals[:, i]) for i, name in enumerate(self.real_names)}
        columns.update({name: flags[:, i].astype(np.float64) for i, name in enumerate(self.flag_names)})
        return columns
