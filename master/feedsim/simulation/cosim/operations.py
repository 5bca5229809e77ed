"""What a control cycle is made of: operations, each one call of a unit or one line of arithmetic.

A list of them says what happens, in which order, on which memory; :mod:`~feedsim.simulation.cosim.schedule` writes it.
Two executors work it, to the same bits: the native loop (:mod:`~feedsim.simulation.cosim.exchange`) and the one in
Python below (:class:`Interpreter`). Names and meanings are those of src/exchange/exchange.h.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from feedsim.foundation.errors import SimulationError
from feedsim.simulation.cosim import archive
from feedsim.simulation.cosim.unit import ERROR, OK, WARNING, Floats, Log, Port, Unit, describe_exchange, not_finite
from feedsim.simulation.cosim.worker import watched_process

MAX_WITHOUT_SLOPE = 10  # exchange steps in a row that a unit may give slopes that are not finite

# An operation in cycle k, which begins at t [s]; it returns the unit's fmi2Status.
Action = Callable[[int, float], int]


def _empty_values() -> Floats:
    return np.zeros(0)


@dataclass(frozen=True)
class DueCycles:
    """Cycles in which an operation is due: `first`, and each `every` cycles from then on."""

    first: int = 0
    every: int = 1


@dataclass(frozen=True, eq=False)
class Bond:
    """The bond between plant and friction over an exchange step, (axes,) each: what it is found from, and its energies.

    Attributes:
        residual: interface energy residual so far [J]: what the plant gives to the bond less what friction takes from
            it, over the steps' ends (Rodriguez et al., Multibody System Dynamics 55, 2022).
        residual_peak: largest absolute residual met [J].
        dissipated: friction work so far [J].
    """

    M_fr: Floats
    n: Floats
    n_slope: Floats
    assumed_torque: Floats
    n_end: Floats
    residual: Floats
    residual_peak: Floats
    dissipated: Floats


@dataclass(frozen=True, eq=False)
class Operation:
    """What is done (`kind`), with which unit and on which memory: arrays, contiguous, that others own and look into.

    Attributes:
        y: values that are sent or found; with `when` a table, of which one row after the other is used in the cycles
            that are due, from the top again after the last.
        a, b: operands of the arithmetic; s: its number, or when in the cycle a step of h begins [s].
        references, orders: of the variables that a call exchanges.
        about: what the unit is at, for messages. hint: what to do where it fails.
        names: of the signals that a call exchanges.
    """

    kind: str
    y: NDArray[Any] = field(default_factory=_empty_values)
    a: Floats = field(default_factory=_empty_values)
    b: Floats = field(default_factory=_empty_values)
    s: float = 0.0
    h: float = 0.0
    bond: Bond | None = None
    unit: Unit | None = None
    references: NDArray[Any] = field(default_factory=_empty_values)
    orders: NDArray[Any] = field(default_factory=_empty_values)
    about: str = ""
    hint: str = ""
    names: tuple[str, ...] = ()
    when: DueCycles | None = None

    def __post_init__(self) -> None:
        vectors = vars(self.bond) if self.bond else {"y": self.y, "a": self.a, "b": self.b}
        for name, array in vectors.items():
            if not array.flags.c_contiguous:
                raise ValueError(f"{self.kind}: {name} must be contiguous in memory")
        if self.when and self.y.size != len(self.y) * self.count:
            raise ValueError(f"{self.about or self.kind}: rows of {self.count} are needed, not {self.y.shape}")

    @property
    def count(self) -> int:
        """Variables that are exchanged, or entries of the vectors."""
        return self.bond.residual.size if self.bond else self.references.size or self.a.size


# --- calls of a unit


def set_real(port: Port, table: Floats | None = None, when: DueCycles | None = None) -> list[Operation]:
    """Send the port's values; with a table (rows, n), which is as the unit takes it, its next row, by default in every
    cycle."""
    return _sent("set_real", port, table, when)


def set_slopes(port: Port, table: Floats | None = None, when: DueCycles | None = None) -> list[Operation]:
    return _sent("set_slopes", port, table, when)


def get_real(port: Port) -> list[Operation]:
    return [_exchange("get_real", port), *_conversions("get_real", port)]


def get_slopes(port: Port, hint: str = "", without: Floats | None = None) -> list[Operation]:
    """Find the port's slopes.

    Args:
        hint: what to do where there are none.
        without: (2,) how often they were not finite: in a row, in all. They count as 0 then, MAX_WITHOUT_SLOPE times in
            a row; a unit that finds them by differences has none before its second step. None: they are finite.
    """
    got = [replace(_exchange("get_slopes", port), hint=hint)]
    if without is not None:
        got.append(replace(got[0], kind="finite", a=without, s=MAX_WITHOUT_SLOPE))
    return [*got, *_conversions("get_slopes", port)]


def _sent(kind: str, port: Port, table: Floats | None, when: DueCycles | None) -> list[Operation]:
    return [*(_conversions(kind, port) if table is None else ()), _exchange(kind, port, table, when)]


def _conversions(kind: str, port: Port) -> list[Operation]:
    """Units of measurement on the way into the unit or out of it; nothing where none is to be converted."""
    slopes = kind.endswith("slopes")
    own, signals = (port.own_slopes, port.slopes) if slopes else (port.own_values, port.values)
    operations = []
    for i, alias in enumerate(port.aliases) if port.converts else ():
        at = slice(i, i + 1)
        offset = 0.0 if slopes else alias.offset
        if kind.startswith("set"):
            operations.append(line(own[at], np.array([-offset / alias.factor]), 1 / alias.factor, signals[at]))
        else:
            operations.append(line(signals[at], np.array([offset]), alias.factor, own[at]))
    return operations


def do_step(unit: Unit, start: float, h: float) -> Operation:
    """From `start` [s] after the beginning of the cycle, over h [s]."""
    return Operation("do_step", unit=unit, s=start, h=h, about=f"step of {h:.6g} s")


def get_state(unit: Unit) -> Operation:
    """Keep it, for :func:`set_state` to go back to."""
    return Operation("get_state", unit=unit, y=unit.kept_state, about="keeping the state")


def set_state(unit: Unit) -> Operation:
    return Operation("set_state", unit=unit, y=unit.kept_state, about="going back to the state kept")


def get_row(log: Log, when: DueCycles) -> list[Operation]:
    """The variables of a log into its next row."""
    tables = (("get_real", log.real_references, log.reals), ("get_boolean", log.flag_references, log.flags))
    return [
        Operation(kind, unit=log.unit, references=references, y=table, about="recording", when=when)
        for kind, references, table in tables
        if references.size
    ]


def _exchange(kind: str, port: Port, table: Floats | None = None, when: DueCycles | None = None) -> Operation:
    y, about = port.own_slopes if kind.endswith("slopes") else port.own_values, describe_exchange(kind, port.names)
    if table is not None:
        y, when = np.ascontiguousarray(table, dtype=np.float64), when or DueCycles()
    unit, references, orders, names = port.unit, port.references, port.orders, port.names
    return Operation(
        kind, y, unit=unit, references=references, orders=orders, about=about, names=names, when=when
    )  # fmt: skip


# --- arithmetic on vectors with an entry per axis; y may be one of the operands


def copy(y: Floats, a: Floats, when: DueCycles | None = None) -> Operation:
    """y = a; with `when`, the next row of y = a."""
    return Operation("copy", y=y, a=a, when=when)


def line(y: Floats, a: Floats, s: float, b: Floats) -> Operation:
    """y = a + s b"""
    return Operation("line", y=y, a=a, s=s, b=b)


def rate(y: Floats, a: Floats, b: Floats, s: float) -> Operation:
    """y = (a - b) / s"""
    return Operation("rate", y=y, a=a, b=b, s=s)


def exchange_energy(bond: Bond, h: float) -> Operation:
    """What a step of h [s] does to the energies of the bond:

    taken = M_fr (n + h n_slope), residual += h/2 (assumed_torque n_end - taken), residual_peak its largest size so far,
    dissipated += h taken.
    """
    return Operation("bond", bond=bond, s=h)


# --- how they are worked


class Executor:
    """Works a list of operations in every control cycle.

    Attributes:
        done: cycles so far; of one that was not worked to its end, not counting it.
        mark: where whose call it is is noted, for a process that watches; None: nobody does.
    """

    def __init__(self, operations: Sequence[Operation], T_c: float) -> None:
        self._operations = tuple(operations)
        self._T_c = T_c
        self.done = 0
        here = watched_process()
        self.mark = None if here is None else here.mark
        if here is not None:
            here.describe(T_c, [(o.unit.name if o.unit else "", o.about or o.kind, o.s if o.kind == "do_step" else 0.0)
                                for o in self._operations])  # fmt: skip

    def restart(self) -> None:
        """Begin anew with cycle 0 and the first rows of all tables."""
        self.done = 0

    def run(self, begin: int, end: int) -> None:
        """Work the cycles `begin` to `end` - 1; they follow those of the last call.

        Raises:
            SimulationError: a unit failed; the message names the unit, the time and the unit's reason.
        """
        raise NotImplementedError

    def _fail(self, at: int, status: int) -> NoReturn:
        """Raise for the operation `at`, which has failed with a status in the cycle after those done."""
        failed = self._operations[at]
        assert failed.unit is not None, f"operation {at}, {failed.kind}, is none that can fail"
        stands = self._stands(failed.unit, at)
        if failed.kind == "finite":
            raise SimulationError(
                f"{failed.unit.known_as}, t = {stands:.9g} s: {failed.about}: not finite {MAX_WITHOUT_SLOPE + 1} times "
                f"in a row; {failed.hint}"
            )
        if giver := self._giver(at):
            failed.unit.note_status(status)
            i, fault = giver
            unit = self._operations[i].unit
            assert unit is not None
            raise SimulationError(
                f"{unit.known_as}, t = {self._stands(unit, at):.9g} s: gives {fault}; unit {failed.unit.name} gets it: "
                f"{failed.about} failed: {failed.unit.said(status)}"
            )
        failed.unit.fail(failed.about, status, self._begin + failed.s if failed.kind == "do_step" else stands,
                         failed.hint)  # fmt: skip

    @property
    def _begin(self) -> float:
        """Of the cycle after those done [s]."""
        return self.done * self._T_c

    def _stands(self, unit: Unit, at: int) -> float:
        """Where a unit stands at the operation `at` of that cycle: at the end of its last step, if it has taken one."""
        t = kept = self._begin
        for operation in self._operations[:at]:
            if operation.unit is not unit:
                continue
            if operation.kind == "do_step":
                t = self._begin + operation.s + operation.h
            elif operation.kind == "get_state":
                kept = t
            elif operation.kind == "set_state":
                t = kept
        return t

    def _giver(self, at: int) -> tuple[int, str] | None:
        """The first of the calls up to the operation `at` that has given what is not finite, and what.

        Who refuses it, or cannot go on with it, is not who gave it. Of the cycle before is what comes behind `at`.
        """
        count = len(self._operations)
        for i in ((at + 1 + k) % count for k in range(count - 1)):
            operation = self._operations[i]
            is_output = operation.kind in ("get_real", "get_slopes") and operation.when is None
            if is_output and (fault := not_finite(operation.names, operation.y)):
                return i, f"slope of {fault}" if operation.kind == "get_slopes" else fault
        return None


class Interpreter(Executor):
    """Works operations one after the other in Python, for where there is no native loop: slower, to the same bits."""

    def __init__(self, operations: Sequence[Operation], T_c: float) -> None:
        super().__init__(operations, T_c)
        self._acts = [_call(operation) if operation.unit else _arithmetic(operation) for operation in self._operations]

    def run(self, begin: int, end: int) -> None:
        noted = None if self.mark is None else self.mark.numbers
        own = archive.settings()
        for k in range(begin, end):
            t = k * self._T_c
            for at, act in enumerate(self._acts):
                if noted is not None:
                    noted[0], noted[1] = k, at
                status = act(k, t)
                if noted is not None and archive.restore(own) and (unit := self._operations[at].unit) is not None:
                    unit.warn_of_arithmetic()
                if not OK <= status <= WARNING:
                    self._fail(at, status)
            self.done = k + 1
        if self.mark is not None:
            self.mark.back()


def _call(o: Operation) -> Action:
    assert o.unit is not None
    if o.kind == "finite":
        return _finite(o)
    call, y = o.unit.call(o.kind), o.y.ctypes.data
    if o.kind == "do_step":
        return lambda _, t: call(t + o.s, o.h, True)
    if o.kind == "get_state":
        return lambda *_: call(y)
    if o.kind == "set_state":
        return lambda *_: call(int(o.y[0]))
    orders = [o.orders.ctypes.data] if o.kind.endswith("slopes") else []
    exchange = partial(call, o.references.ctypes.data, o.count, *orders)
    if o.when:
        return _due(o, lambda row: exchange(y + row * o.y.strides[0]))
    return lambda *_: exchange(y)


def _finite(o: Operation) -> Action:
    def act(*_: float) -> int:
        missing = ~np.isfinite(o.y)
        o.y[missing] = 0.0
        o.a[0] = o.a[0] + 1 if missing.any() else 0
        o.a[1] += missing.any()
        return ERROR if o.a[0] > o.s else OK

    return act


def _arithmetic(o: Operation) -> Action:
    y, a, b, s = o.y, o.a, o.b, o.s
    scaled = np.zeros(o.count)

    def copy(*_: float) -> int:
        y[:] = a
        return OK

    def copy_row(row: int) -> int:
        y[row] = a
        return OK

    def line(*_: float) -> int:
        np.multiply(s, b, out=scaled)
        np.add(a, scaled, out=y)
        return OK

    def rate(*_: float) -> int:
        np.subtract(a, b, out=y)
        np.divide(y, s, out=y)
        return OK

    def bond(*_: float) -> int:
        bond, h = o.bond, o.s
        assert bond is not None
        taken = bond.M_fr * (bond.n + h * bond.n_slope)
        np.add(bond.residual, 0.5 * h * (bond.assumed_torque * bond.n_end - taken), out=bond.residual)
        np.maximum(bond.residual_peak, np.abs(bond.residual), out=bond.residual_peak)
        np.add(bond.dissipated, h * taken, out=bond.dissipated)
        return OK

    return _due(o, copy_row) if o.when else {"copy": copy, "line": line, "rate": rate, "bond": bond}[o.kind]


def _due(o: Operation, work: Callable[[int], int]) -> Action:
    """Done on one row of a table after the other, in the cycles that are due."""
    assert o.when is not None
    first, every, rows = o.when.first, o.when.every, len(o.y)

    def act(k: int, _: float) -> int:
        since = k - first
        return OK if since < 0 or since % every else work(since // every % rows)

    return act
