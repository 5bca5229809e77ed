"""The native cycle loop (``src/exchange``): finding its library, and operations executed by it.

It is built into the folder of the archives and is no part of any result: without it, or with one that was built from
other sources than this package, the loop runs in Python, which takes longer, says so, and gives the same bits.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import zipfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import fields
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feedsim.foundation import installation
from feedsim.foundation.errors import Finding, InputError
from feedsim.foundation.installation import fmus_directory, repair_advice
from feedsim.scenario import Coupling, Machine
from feedsim.scenario.roles import DRIVE, FRICTION_ROLE
from feedsim.simulation.cosim.archive import Archive, folders
from feedsim.simulation.cosim.operations import Bond, Executor, Operation
from feedsim.simulation.cosim.roles import archive_path

# src/exchange/exchange.h, word for word.
VERSION = 5
OPERATION_CODES = (
    "set_real", "set_slopes", "do_step", "get_real", "get_slopes", "get_boolean", "get_state", "set_state",
    "finite", "copy", "line", "rate", "bond", "due", "end",
)  # fmt: skip
FIELDS = (
    ("int32_t", "kind"), ("int32_t", "count"),
    ("function", "call"), ("address", "component"), ("address", "references"), ("address", "orders"),
    ("address", "y"), ("double", "s"), ("double", "h"), ("address", "a"), ("address", "b"),
    ("int64_t", "what"), ("int64_t", "every"), ("int64_t", "next"), ("int64_t", "stride"), ("int64_t", "rows"),
    ("int64_t", "row"),
)  # fmt: skip
BOND = tuple(field.name for field in fields(Bond))
INTERFACE = (
    f"{VERSION}: {' '.join(OPERATION_CODES)}; {' '.join(f'{kind} {name},' for kind, name in FIELDS)}; "
    + " ".join(f"address {name}," for name in BOND)
)

_TYPES = {"int32_t": np.int32, "int64_t": np.int64, "double": np.float64, "function": np.uintp, "address": np.uintp}
_OPERATION = np.dtype([(name, _TYPES[kind]) for kind, name in FIELDS], align=True)
LIBRARY_NAME = installation.library_name("exchange")

Native = ctypes.CDLL  # the loaded library


class _Fault(ctypes.Structure):
    _fields_ = tuple((name, ctypes.c_int64) for name in ("cycle", "operation", "looked_at", "changed_by"))


@cache
def library(folder: Path) -> Native | str:
    """The native loop beside the archives in `folder`, or why none there can be used, without the folder's name."""
    loaded = installation.library("exchange", folder, INTERFACE)
    if not isinstance(loaded, str):
        for run in (loaded.exchange_run, loaded.exchange_run_marked):
            run.restype = ctypes.c_int
            run.argtypes = (
                ctypes.c_void_p, ctypes.c_double, ctypes.c_int64, ctypes.c_int64, ctypes.POINTER(_Fault),
            )  # fmt: skip
    return loaded


def choose_native_loop(wanted: bool | None, *folders: Path) -> tuple[Native | None, tuple[Finding, ...]]:
    """The native loop in the first of `folders` that has one; without one, unless it is not wanted, what that costs.

    wanted: None: where there is one that fits; False: Python is to work.

    Raises:
        InputError: it is wanted, and there is none that fits.
    """
    if wanted is False:
        return None, ()
    reasons = []
    for cdll in map(library, dict.fromkeys(folders)):
        if not isinstance(cdll, str):
            return cdll, ()
        reasons.append(cdll)
    why = f"{'; '.join(dict.fromkeys(reasons))}; {repair_advice('the native loop')}"
    if wanted:
        raise InputError(f"{', '.join(map(str, folders))}: no native cycle loop that fits this version: {why}")
    text = f"the cycle loop ran in Python, some 30 times slower than the native one, same bits: {why}"
    return None, (Finding("native-loop-missing", "note", text, "", repair_advice("the native loop")),)


def _address(array: NDArray[Any]) -> int:
    """Of its first entry; array.ctypes takes five times as long."""
    return int(array.__array_interface__["data"][0])


class Exchange(Executor):
    """Has operations worked by the native loop."""

    def __init__(self, loop: Native, operations: Sequence[Operation], T_c: float) -> None:
        super().__init__(operations, T_c)
        self._native = loop
        self._bonds: list[NDArray[np.uintp]] = []  # as the operations point to them
        self._fault = _Fault()
        self._looked_at = -1  # the last operation whose unit was found to change how the process computes
        self._table = np.zeros(len(self._operations) + 1, dtype=_OPERATION)
        self._table["kind"] = OPERATION_CODES.index("end")
        for at, operation in enumerate(self._operations):
            self._table[at] = self._row(operation)
        self._begin_table = self._table.copy()  # the loop counts rows in it

    def restart(self) -> None:
        super().restart()
        self._table[:] = self._begin_table

    def _row(self, o: Operation) -> tuple[float, ...]:
        """Its fields, in their order. A row at once is written in a tenth of the time of its fields one by one."""
        kind, what, call, component, a = OPERATION_CODES.index(o.kind), 0, 0, 0, _address(o.a)
        first = every = stride = rows = 0
        if o.unit is not None and o.kind != "finite":
            call, component = o.unit.address(o.kind), o.unit.component
        if o.bond is not None:
            self._bonds.append(np.array([_address(getattr(o.bond, name)) for name in BOND], dtype=np.uintp))
            a = _address(self._bonds[-1])
        if o.when is not None:
            kind, what = OPERATION_CODES.index("due"), kind
            first, every, rows, stride = o.when.first, o.when.every, len(o.y), o.y.strides[0]
        references, orders, y, b = (_address(array) for array in (o.references, o.orders, o.y, o.b))
        return (
            kind, o.count, call, component, references, orders, y, o.s, o.h, a, b, what, every, first, stride, rows, 0
        )  # fmt: skip

    def run(self, begin: int, end: int) -> None:
        mark = self.mark
        fault = self._fault if mark is None else _Fault.from_address(mark.numbers.ctypes.data)
        # Windows has no process of its own for other makers' units: there all are looked after.
        run = self._native.exchange_run if mark is None and os.name == "posix" else self._native.exchange_run_marked
        fault.looked_at, fault.changed_by = self._looked_at, -1
        status = run(self._table.ctypes.data, self._T_c, begin, end, ctypes.byref(fault))
        if fault.changed_by >= 0:
            self._looked_at = fault.changed_by
            unit = self._operations[fault.changed_by].unit
            assert unit is not None
            unit.warn_of_arithmetic()
        if status:
            self.done = fault.cycle
            self._fail(fault.operation, status)
        self.done = end
        if mark is not None:
            mark.back()


# --- Whose programs an archive holds: those that this installation ships, or another maker's, which only a run
#     executes
# A program is known by its bytes, not by the name of its archive: a plant that is packed for a machine, or an SSP that
# was exported here, holds the shipped libraries; whatever differs in one byte is another maker's.


SHIPPED_ARCHIVES = ("plant.fmu", "controller.fmu", "friction.fmu", "friction_gms.fmu", "setpoint.fmu", "machine.fmu")
Programs = Mapping[str, str]  # path inside the archive -> SHA-256, of all files beside the library for this platform


def is_shipped(archive: Archive) -> bool:
    """Whether all that can be loaded from an archive is what this installation ships, to the last byte."""
    return _is_ours(archive.path) or programs(archive) in _shipped_programs(*_states(fmus_directory()))


def programs(archive: Archive) -> dict[str, str]:
    """What of an archive can be loaded on this platform."""
    root = archive.directory
    paths = [file for folder in folders() for file in (root / "binaries" / folder).rglob("*") if file.is_file()]
    return {file.relative_to(root).as_posix(): _content_digest(file.read_bytes()) for file in sorted(paths)}


def _parts(machine: Machine, folder: Path, coupling: Coupling | None) -> dict[Path, list[str]]:
    """Archives that a run of the machine takes out of a folder or from elsewhere, and the parts that they play."""
    if coupling is not None and coupling.units == "one":
        return {folder / "machine.fmu": ["machine"]}
    parts: dict[Path, list[str]] = {machine.plant or folder / "plant.fmu": ["plant"]}
    for axis in machine.axes:
        for role in (DRIVE, FRICTION_ROLE):
            parts.setdefault(archive_path(machine, axis, role, folder), []).append(f"{role.name} of {axis}")
    return parts


def any_foreign(machine: Machine, fmus: Path, coupling: Coupling | None = None) -> bool:
    """Whether a run of the machine executes a program that is not shipped; what cannot be opened is none."""
    try:
        states = [(path, path.stat().st_mtime_ns, path.stat().st_size) for path in _parts(machine, fmus, coupling)]
    except OSError:
        return False  # the run says which archive is missing
    ours = fmus_directory()
    return any(_is_foreign(*state, ours) for state in states) or _loop(fmus, ours) is not None


def _loop(folder: Path, ours: Path) -> str | None:
    """SHA-256 of the cycle loop beside the archives of a folder, where it is another one than the shipped one."""
    with suppress(OSError):
        if folder != ours and (digest := _content_digest((folder / LIBRARY_NAME).read_bytes())) != _content_digest(
            (ours / LIBRARY_NAME).read_bytes()
        ):
            return digest
    return None


@lru_cache(maxsize=64)
def _is_foreign(path: Path, changed: int, size: int, ours: Path) -> bool:
    """Of an archive in that state, where the shipped ones are in the folder `ours`."""
    if _is_ours(path):
        return False
    with suppress(InputError), Archive(path) as archive:
        return not is_shipped(archive)
    return False


def describe_programs(machine: Machine, fmus: Path | None, coupling: Coupling | None = None) -> list[str]:
    """What a run of the machine executes that is not shipped, a sentence for each archive: who, what, its SHA-256.

    What cannot be opened is left out: the run says why. fmus: folder of the archives, where one was named. coupling:
    of the run; None: of units of their own.
    """
    folder = fmus or fmus_directory()
    parts = _parts(machine, folder, coupling)
    sentences = [
        sentence for path, who in parts.items() for sentence in describe_archive_programs(path, ", ".join(who))
    ]
    if (digest := _loop(folder, fmus_directory())) is not None:
        sentences.append(f"executes {folder / LIBRARY_NAME} as cycle loop, SHA-256 {digest}")
    return sentences


def describe_archive_programs(path: Path, who: str) -> list[str]:
    """The same of one archive, for the part that it plays; nothing of a shipped one."""
    if _is_ours(path):
        return []
    with suppress(InputError), Archive(path) as archive:
        if not is_shipped(archive):
            # Of the whole archive: what a wrapper's library executes may lie beside it, in resources/.
            return [
                f"executes {path} as {who}: {', '.join(programs(archive))}; SHA-256 "
                f"{_content_digest(path.read_bytes())}"
            ]
    return []


def _is_ours(path: Path) -> bool:
    return path in [fmus_directory() / name for name in SHIPPED_ARCHIVES]


def _content_digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _states(folder: Path) -> list[tuple[Path, int, int]]:
    there = [path for name in SHIPPED_ARCHIVES if (path := folder / name).is_file()]
    return [(path, path.stat().st_mtime_ns, path.stat().st_size) for path in there]


@lru_cache(maxsize=4)
def _shipped_programs(*states: tuple[Path, int, int]) -> list[Programs]:
    """Programs of the shipped archives, none of which is unpacked for it."""
    wanted = tuple(f"binaries/{folder}/" for folder in folders())
    result: list[Programs] = []
    for path, _, _ in states:
        with suppress(OSError, zipfile.BadZipFile), zipfile.ZipFile(path) as package:
            names = [zip_info.filename for zip_info in package.infolist() if not zip_info.is_dir()]
            result.append({name: _content_digest(package.read(name)) for name in names if name.startswith(wanted)})
    return result
