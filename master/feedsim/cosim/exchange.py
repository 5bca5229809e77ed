"""The native cycle loop's library (``src/exchange``): finding it, and a list of operations for it to execute.

It is built into the folder of the archives and is no part of any result: without it, or with one that was built from
other sources than this package, the loop runs in Python and gives the same bits. What a control cycle is made of says
:mod:`~feedsim.cosim.compiled`.
"""

from __future__ import annotations

import ctypes
import hashlib
import logging
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from feedsim.cosim.unit import GOING_BACK, KEEPING, RECORDING, Floats, Log, Port, Unit, reading, setting, stepping
from feedsim.errors import InputError

# src/exchange/exchange.h, word for word.
VERSION = 3
KINDS = (
    "set_real", "set_slopes", "do_step", "get_real", "get_slopes", "get_boolean", "get_state", "set_state",
    "copy", "line", "rate", "bond", "due", "end",
)  # fmt: skip
FIELDS = (
    ("int32_t", "kind"), ("int32_t", "count"),
    ("function", "call"), ("address", "component"), ("address", "references"), ("address", "orders"),
    ("address", "y"), ("double", "s"), ("double", "h"), ("address", "a"), ("address", "b"),
    ("int64_t", "what"), ("int64_t", "every"), ("int64_t", "next"), ("int64_t", "stride"), ("int64_t", "rows"),
    ("int64_t", "row"),
)  # fmt: skip
BOND = (
    "M_fr", "n", "n_slope", "assumed_torque", "n_end", "residual", "residual_peak", "dissipated",
)  # fmt: skip
INTERFACE = f"{VERSION}: {' '.join(KINDS)}; {' '.join(f'{kind} {name},' for kind, name in FIELDS)}; " + " ".join(
    f"address {name}," for name in BOND
)

_TYPES = {"int32_t": np.int32, "int64_t": np.int64, "double": np.float64, "function": np.uintp, "address": np.uintp}
_OPERATION = np.dtype([(name, _TYPES[kind]) for kind, name in FIELDS], align=True)
_LIBRARY = {"win32": "exchange.dll", "darwin": "exchange.dylib"}.get(sys.platform, "exchange.so")

_log = logging.getLogger(__name__)

Native = ctypes.CDLL  # the loaded library


class _Fault(ctypes.Structure):
    _fields_ = (("cycle", ctypes.c_int64), ("operation", ctypes.c_int64))


# By SHA-256 of the file: each study lays out a copy of its own, and what is loaded stays until the process ends.
_loaded: dict[bytes, Native] = {}


@cache
def library(folder: Path) -> Native | None:
    """The native loop beside the archives in `folder`; None where there is none that fits this package.

    Told once per folder: at debug level that there is none, as a warning that there is one that does not fit.
    """
    path = folder.resolve() / _LIBRARY
    if not path.is_file():
        _log.debug("%s: no such file; the cycle loop runs in Python, `make fmus` builds the native one", path)
        return None
    try:
        digest = hashlib.sha256(path.read_bytes()).digest()
        if (known := _loaded.get(digest)) is not None:
            return known
        loaded = ctypes.CDLL(str(path))
        interface = loaded.exchange_interface
        interface.restype = ctypes.c_char_p
        found = (interface() or b"").decode(errors="replace")
    except (OSError, AttributeError) as error:
        _log.warning("%s: cannot be used: %s; the cycle loop runs in Python, `make fmus` builds it anew", path, error)
        return None
    if found != INTERFACE:
        _log.warning(
            "%s: built from other sources (its interface is %r, wanted is %r); the cycle loop runs in Python, `make "
            "fmus` builds it anew", path, found, INTERFACE,
        )  # fmt: skip
        return None
    run = loaded.exchange_run
    run.restype = ctypes.c_int
    run.argtypes = (
        ctypes.c_void_p, ctypes.c_double, ctypes.c_int64, ctypes.c_int64, ctypes.POINTER(_Fault),
    )  # fmt: skip
    _loaded[digest] = loaded
    return loaded


def chosen(wanted: bool | None, *folders: Path) -> Native | None:
    """The native loop in the first of `folders` that has one. `wanted` None: where there is one that fits; False: not
    wanted.

    Raises:
        InputError: it is wanted, and there is none that fits.
    """
    found = None if wanted is False else next(filter(None, map(library, dict.fromkeys(folders))), None)
    if wanted and found is None:
        raise InputError(
            f"{', '.join(map(str, folders))}: no native cycle loop that fits this version; `make fmus` builds it"
        )
    return found


@dataclass(frozen=True)
class When:
    """Cycles in which an operation is due: `first`, and each `every` cycles from then on."""

    first: int = 0
    every: int = 1

    def row(self, k: int, rows: int) -> int | None:
        """Row of a table of `rows` that belongs to cycle k, used over and over; None where nothing is due."""
        since = k - self.first
        return None if since < 0 or since % self.every else since // self.every % rows


class Operations:
    """A control cycle as a list of operations, in their order, each one call of a unit or one line of arithmetic.

    Buffers and tables are numpy arrays whose memory the operations work on. With a table, an operation takes one row
    after the other, from the top again after the last, in the cycles that `when` says.
    """

    def __init__(self) -> None:
        self._rows: list[dict[str, Any]] = []
        self._calls: list[tuple[Unit, str] | None] = []  # whose, and what it was about, for messages
        self._kept: list[object] = []  # what the addresses belong to
        self._table = np.zeros(0, dtype=_OPERATION)
        self.failed_in = 0  # the cycle, where a unit has failed

    # --- calls

    def set(self, port: Port, table: Floats | None = None, when: When | None = None) -> None:
        self._call("set_real", "fmi2SetReal", port, setting(port.names), port.values, table, when)

    def set_slopes(self, port: Port, table: Floats | None = None, when: When | None = None) -> None:
        name = "fmi2SetRealInputDerivatives"
        self._call("set_slopes", name, port, setting(port.names, slopes=True), port.slopes, table, when)

    def get(self, port: Port) -> None:
        self._call("get_real", "fmi2GetReal", port, reading(port.names), port.values)

    def get_slopes(self, port: Port) -> None:
        name = "fmi2GetRealOutputDerivatives"
        self._call("get_slopes", name, port, reading(port.names, slopes=True), port.slopes)

    def keep(self, unit: Unit) -> None:
        """Its state, for :meth:`go_back`."""
        self._add("get_state", call=unit.address("fmi2GetFMUstate"), component=unit.component, y=unit.kept_state)
        self._calls[-1] = (unit, KEEPING)

    def go_back(self, unit: Unit) -> None:
        self._add("set_state", call=unit.address("fmi2SetFMUstate"), component=unit.component, y=unit.kept_state)
        self._calls[-1] = (unit, GOING_BACK)

    def step(self, unit: Unit, start: float, h: float) -> None:
        """From `start` [s] after the beginning of the cycle, over h [s]."""
        self._add("do_step", s=start, h=h, call=unit.address("fmi2DoStep"), component=unit.component)
        self._calls[-1] = (unit, stepping(h))

    def record(self, log: Log, when: When) -> None:
        """The variables of `log` into its next row."""
        unit = log.unit
        for kind, function, references, table in (
            ("get_real", "fmi2GetReal", log.real_references, log.reals),
            ("get_boolean", "fmi2GetBoolean", log.flag_references, log.flags),
        ):
            if references.size:
                self._add(kind, call=unit.address(function), component=unit.component, references=references)
                self._calls[-1] = (unit, RECORDING)
                self._tabled(table, when)

    # --- arithmetic

    def copy(self, y: Floats, a: Floats, when: When | None = None) -> None:
        """y = a; with `when`, the next row of y = a."""
        self._add("copy", count=a.size, y=y, a=a)
        if when is not None:
            self._tabled(y, when)

    def line(self, y: Floats, a: Floats, s: float, b: Floats) -> None:
        """y = a + s b"""
        self._add("line", count=y.size, y=y, a=a, s=s, b=b)

    def rate(self, y: Floats, a: Floats, b: Floats, s: float) -> None:
        """y = (a - b) / s"""
        self._add("rate", count=y.size, y=y, a=a, b=b, s=s)

    def bond(self, h: float, **vectors: Floats) -> None:
        """The energies of the bond between plant and friction over a step of h [s]; vectors by the names of BOND:

        taken = M_fr (n + h n_slope), residual += h/2 (assumed_torque n_end - taken), residual_peak its largest size
        so far, dissipated += h taken.
        """
        for name, vector in vectors.items():
            if vector.dtype != np.float64 or not vector.flags.c_contiguous:
                raise ValueError(f"bond: {name} must be contiguous float64")
        self._kept.extend(vectors.values())
        addresses = np.array([vectors[name].ctypes.data for name in BOND], dtype=np.uintp)
        self._add("bond", count=vectors["residual"].size, a=addresses, s=h)

    # --- how it is written down

    def _call(
        self, kind: str, function: str, port: Port, action: str, buffer: Floats, table: Floats | None = None,
        when: When | None = None,
    ) -> None:  # fmt: skip
        unit = port.unit
        self._add(
            kind, call=unit.address(function), component=unit.component,
            count=port.references.size, references=port.references, orders=port.orders, y=buffer,
        )  # fmt: skip
        self._calls[-1] = (unit, action)
        if table is not None:
            if table.dtype != np.float64 or table.size != len(table) * port.references.size:
                raise ValueError(f"port {port.names}: a table of rows of {port.references.size} float64 is needed")
            self._tabled(table, when or When())

    def _add(self, kind: str, **fields: Any) -> None:
        for name, value in fields.items():
            if isinstance(value, np.ndarray):
                if not value.flags.c_contiguous:
                    raise ValueError(f"{kind}: {name} must be contiguous in memory")
                self._kept.append(value)
                fields[name] = value.ctypes.data
        self._rows.append({"kind": KINDS.index(kind), **fields})
        self._calls.append(None)

    def _tabled(self, table: NDArray[Any], when: When) -> None:
        """The last operation works on rows of `table`."""
        if not table.flags.c_contiguous:
            raise ValueError("a table must be contiguous in memory")
        self._kept.append(table)
        self._rows[-1] |= {
            "count": table.size // len(table), "y": table.ctypes.data, "stride": table.strides[0], "rows": len(table),
            "next": when.first, "every": when.every,
        }  # fmt: skip

    # --- how it is executed

    def run(self, native: Native, T_c: float, begin: int, end: int) -> None:
        """Work the cycles `begin` to `end` - 1, each T_c [s] long; they follow those of the last call.

        Raises:
            SimulationError: a unit failed; the message names the unit, the time and the unit's reason.
        """
        if not len(self._table):
            rows = [*self._rows, {"kind": KINDS.index("end")}]
            self._table = np.zeros(len(rows), dtype=_OPERATION)
            for operation, row in zip(self._table, rows, strict=True):
                for name, value in row.items():
                    operation[name] = value
                if "every" in row:
                    operation["what"], operation["kind"] = row["kind"], KINDS.index("due")
        fault = _Fault()
        if native.exchange_run(self._table.ctypes.data, T_c, begin, end, ctypes.byref(fault)):
            self._fail(fault.cycle, fault.operation, T_c)

    def _fail(self, k: int, at: int, T_c: float) -> NoReturn:
        call = self._calls[at]
        assert call is not None, f"operation {at} is none that can fail"
        unit, action = call
        self.failed_in = k
        t = k * T_c
        if self._rows[at]["kind"] == KINDS.index("do_step"):
            t += self._rows[at]["s"]
        else:  # where the unit stands: at the end of its last step, if it has taken one in this cycle
            kept = t
            for row in self._rows[:at]:
                if row.get("component") != unit.component:
                    continue
                if row["kind"] == KINDS.index("do_step"):
                    t = k * T_c + row["s"] + row["h"]
                elif row["kind"] == KINDS.index("get_state"):
                    kept = t
                elif row["kind"] == KINDS.index("set_state"):
                    t = kept
        unit.fail(action, t)
