"""Operations executed in Python, for where there is no native loop: slower, to the same bits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from feedsim.cosim.operations import Executor, Operation
from feedsim.cosim.unit import OK, WARNING

# An operation in cycle k, which begins at t [s]; it returns the unit's fmi2Status.
Act = Callable[[int, float], int]


class Interpreter(Executor):
    """Works operations one after the other."""

    def __init__(self, operations: Sequence[Operation], T_c: float) -> None:
        super().__init__(operations, T_c)
        self._acts = [_call(each) if each.unit else _arithmetic(each) for each in self._operations]

    def run(self, begin: int, end: int) -> None:
        for k in range(begin, end):
            t = k * self._T_c
            for at, act in enumerate(self._acts):
                if act(k, t) > WARNING:
                    self._fail(at)
            self.done = k + 1


def _call(o: Operation) -> Act:
    assert o.unit is not None
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


def _arithmetic(o: Operation) -> Act:
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


def _due(o: Operation, work: Callable[[int], int]) -> Act:
    """Done on one row of a table after the other, in the cycles that are due."""
    assert o.when is not None
    first, every, rows = o.when.first, o.when.every, len(o.y)

    def act(k: int, _: float) -> int:
        since = k - first
        return OK if since < 0 or since % every else work(since // every % rows)

    return act
