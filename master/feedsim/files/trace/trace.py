"""A trace: time series with names and units over one time axis."""

from __future__ import annotations

import mmap
import tempfile
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from types import MappingProxyType
from typing import IO, TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feedsim.foundation.errors import InputError, OutputError, UnknownName, find_nearest_name, shorten_list
from feedsim.foundation.installation import require_module

if TYPE_CHECKING:
    import pandas


# --- Columns that are filled block by block: in memory while they are short, else in a file without a name ------------
# The file's pages are read through a mapping, as arrays that behave like any other; the system takes them back when
# it
# needs the memory, and :func:`release` at once. It has no name and vanishes with the last array that looks into it,
# whatever becomes of the process.


# Beyond this size [bytes] a table is a file.
IN_MEMORY = 16 * 2**20
# Rows that are worked on at a time where a column may be long.
STRETCH = 1 << 16
# Instants within this share of a sampling interval count as the same: recorded times carry rounding errors.
SAME_INSTANT = 1e-6


class Table:
    """``columns`` x ``rows`` numbers, appended from the first row on.

    filled: rows so far.
    """

    def __init__(self, columns: int, rows: int, folder: Path | None = None) -> None:
        """folder: where the file goes if there is to be one; default: the system's folder for temporary files.

        OutputError: the file cannot be made.
        """
        self.rows, self.filled = rows, 0
        self._values: Array | None = None
        self._file: IO[bytes] | None = None
        self._folder = folder or Path(tempfile.gettempdir())
        self._count = columns
        if 8 * columns * rows <= IN_MEMORY:
            self._values = np.zeros((columns, rows))
            return
        try:
            self._file = tempfile.TemporaryFile(prefix="feedsim-", dir=self._folder, buffering=0)  # noqa: SIM115
            self._file.truncate(8 * columns * rows)
        except OSError as error:
            raise self._unusable(error) from error

    def append(self, block: Array) -> None:
        """The next rows: (columns, n). OutputError: the disk is full."""
        first, last = self.filled, self.filled + block.shape[1]
        if block.shape[0] != self._count or last > self.rows:
            raise ValueError(f"{block.shape} behind row {first} of {self._count} columns x {self.rows} rows")
        if self._values is not None:
            self._values[:, first:last] = block
        elif self._file is not None:
            # Written, not mapped: a full disk is then an error that can be shown, not the end of the process.
            try:
                for i, values in enumerate(block):
                    self._file.seek(8 * (i * self.rows + first))
                    remaining = np.ascontiguousarray(values).data.cast("B")
                    while remaining:
                        remaining = remaining[self._file.write(remaining) :]
            except OSError as error:
                raise self._unusable(error) from error
        self.filled = last

    def columns(self) -> list[Array]:
        """Every column's rows so far, read-only. Nothing can be appended afterwards."""
        if self._file is not None:
            mapped = mmap.mmap(self._file.fileno(), 0, access=mmap.ACCESS_READ)
            self._file.close()
            self._file = None
            self._values = np.frombuffer(mapped, dtype=np.float64).reshape(self._count, self.rows)
        assert self._values is not None
        self._values.setflags(write=False)
        self.rows = self.filled  # appending now is a fault
        return [values[: self.filled] for values in self._values]

    def _unusable(self, error: OSError) -> OutputError:
        return OutputError(
            f"{self._folder}: a temporary file of {8e-6 * self._count * self.rows:.4g} MB for what does not fit into "
            f"memory cannot be written: {error.strerror or error}"
        )


def release(*arrays: Array) -> None:
    """Give back the memory that the pages of mapped arrays have taken; they stay readable. Others are left alone."""
    for mapped in {id(mapping): mapping for array in arrays if (mapping := _memory_map(array)) is not None}.values():
        if hasattr(mapped, "madvise"):  # not on Windows
            mapped.madvise(mmap.MADV_DONTNEED)


def stretches(*arrays: Array, rows: int = STRETCH) -> Iterator[tuple[Array, ...]]:
    """The same rows of several columns at a time, in their order, in memory that does not grow."""
    for first in range(0, len(arrays[0]), rows):
        yield tuple(array[first : first + rows] for array in arrays)
        release(*arrays)


def unchangeable(array: Array) -> bool:
    """Whether nobody can change the array, be it through another that shares its memory."""
    base: object = array
    while isinstance(base, np.ndarray):
        if base.flags.writeable:
            return False
        base = base.base
    return base is None or (isinstance(base, memoryview) and base.readonly)


def least_and_largest(values: Array) -> tuple[float, float]:
    """Of a column that may be long."""
    ends = [(float(part.min()), float(part.max())) for (part,) in stretches(values)]
    return min(low for low, _ in ends), max(high for _, high in ends)


def _memory_map(array: Array) -> mmap.mmap | None:
    base: object = array
    while isinstance(base, np.ndarray):
        base = base.base
    owner = base.obj if isinstance(base, memoryview) else base
    return owner if isinstance(owner, mmap.mmap) else None


Array = NDArray[np.float64]
Values = TypeVar("Values", bound=NDArray[Any])


class Columns(Generic[Values]):
    """Columns by name, with their units."""

    columns: Mapping[str, Values]
    units: Mapping[str, str]
    kind: ClassVar[str] = "column"

    def __getitem__(self, name: str) -> Values:
        """Values of a column; UnknownName with a suggestion if there is none of that name."""
        try:
            return self.columns[name]
        except KeyError:
            raise UnknownName(f"no {self.kind} {name!r}{suggest_name(name, self.columns)}") from None

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.columns)

    def unit(self, name: str) -> str:
        """Unit of a column as in the CSV header; "" where none is known."""
        self[name]
        return self.units[name]


class TimeColumns(Columns[Array]):
    """Columns over a common time."""

    time: Array

    def _settle(self) -> None:
        """Make the arrays read-only. InputError: not one-dimensional, lengths that differ, time that is not finite,
        a unit for a column that does not exist."""
        time = _frozen_array(self.time, "time")
        if (row := first_not_finite(time)) is not None:
            raise InputError(f"time is not finite at row {row} (counted from 0)")
        columns = {name: _frozen_array(values, name) for name, values in self.columns.items()}
        for name, values in columns.items():
            if values.shape != time.shape:
                raise InputError(f"column {name!r} has {values.size} values, the time has {time.size}")
        if unknown := sorted(set(self.units) - set(columns)):
            raise InputError(f"unit given for {unknown[0]!r}, which is no column")
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "columns", MappingProxyType(columns))
        object.__setattr__(self, "units", MappingProxyType({name: self.units.get(name, "") for name in columns}))

    def __len__(self) -> int:
        """Number of rows."""
        return int(self.time.size)


@dataclass(frozen=True, eq=False, repr=False)
class Trace(TimeColumns):
    """Columns of numbers over a common time.

    time     (N,) [s], strictly increasing; need not be even
    columns  name -> (N,) values
    units    name -> unit as written in a CSV header ("m", "rad/s"; "" where none is known)

    Arrays are copied to float64 and made read-only; those that nobody can change any more are taken as they are, so
    that a part of a trace costs no memory. InputError: lengths that differ, time that does not increase, a
    name or unit that could not be written to a CSV header and read back, a unit for a column that does not exist.

    >>> import feedsim as fs
    >>> trace = fs.Trace([0.0, 1.0], {"Z.x_a": [0.1, 0.2]}, {"Z.x_a": "m"})
    >>> trace["Z.x_a"], trace.unit("Z.x_a")
    (array([0.1, 0.2]), 'm')
    """

    time: Array
    columns: Mapping[str, Array]
    units: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in self.columns:
            check_name(name)
        self._settle()
        if (row := _first_not_later(self.time)) is not None:
            raise InputError(
                f"time must increase: {self.time[row]:.9g} s follows {self.time[row - 1]:.9g} s at row {row} "
                "(counted from 0)"
            )
        for unit in self.units.values():
            check_unit(unit)

    def between(self, t0: float, t1: float) -> Trace:
        """Rows with t0 <= time <= t1 [s], give or take a millionth of the mean step (k h is rounded)."""
        slack = 1e-6 * (self.time[-1] - self.time[0]) / (len(self) - 1) if len(self) > 1 else 0.0
        first = int(np.searchsorted(self.time, t0 - slack, side="left"))
        rows = slice(first, int(np.searchsorted(self.time, t1 + slack, side="right")))
        return Trace(self.time[rows], {name: values[rows] for name, values in self.columns.items()}, self.units)

    def __reduce__(self) -> tuple[Any, ...]:
        """What another process makes it of."""
        return Trace, (self.time, dict(self.columns), dict(self.units))

    def select(self, patterns: Iterable[str]) -> Trace:
        """Columns whose name matches any of the glob patterns (``"Z.*"``, ``"*.x_a"``), in their present order.

        InputError for a pattern that matches nothing.
        """
        kept = match_names(self.columns, patterns)
        return Trace(self.time, {name: self.columns[name] for name in kept}, {name: self.units[name] for name in kept})

    def to_pandas(self) -> pandas.DataFrame:
        """A DataFrame over time [s]; units in ``.attrs["units"]``. Raises InputError where pandas is not installed."""
        frames = require_module("pandas", "a DataFrame")
        table = frames.DataFrame(dict(self.columns), index=frames.Index(self.time, name="time [s]"))
        table.attrs["units"] = dict(self.units)
        return table

    def __repr__(self) -> str:
        span = f", {self.time[0]:.6g} to {self.time[-1]:.6g} s" if len(self) else ""
        return f"Trace: {len(self)} rows{span}; {len(self.names)} columns: {textwrap.shorten(', '.join(self), 60)}"


def matches(name: str, pattern: str) -> bool:
    """Whether a name is that of a glob pattern: * stands for anything, ? for one character.

    Brackets are themselves, as they are part of names: x[3] is the element 3 of x.
    """
    return name == pattern or fnmatchcase(name, pattern.replace("[", "[[]"))


def match_names(names: Iterable[str], patterns: Iterable[str]) -> list[str]:
    """Names that match any of the glob patterns, in their order; a name that is given as it is means itself alone.

    InputError for a pattern that matches nothing.
    """
    names, wanted = list(names), set[str]()
    for pattern in patterns:
        result = {pattern} if pattern in names else {name for name in names if matches(name, pattern)}
        if not result:
            raise InputError(f"no column matches {pattern!r}{suggest_name(pattern, names)}")
        wanted |= result
    return [name for name in names if name in wanted]


def check_name(name: str) -> str:
    """A name that a CSV header can hold and give back; InputError otherwise."""
    if not name or name != name.strip() or any(c in "[]" or not c.isprintable() for c in name):
        raise InputError(f"column name {name!r}: must be printable, without brackets and without blanks at its ends")
    if name == "time":
        raise InputError("column name 'time': the time is not a column of its own trace")
    return name


def check_unit(unit: str) -> str:
    """A unit that a CSV header can hold and give back; InputError otherwise."""
    if unit != unit.strip() or any(c in "[]" or not c.isprintable() for c in unit):
        raise InputError(f"unit {unit!r}: must be printable, without brackets and without blanks at its ends")
    return unit


def suggest_name(name: str, known: Iterable[str]) -> str:
    """'; did you mean ...?' or the list of what there is, as the tail of a message."""
    names = [str(item) for item in known]
    if near := find_nearest_name(name, names):
        return f"; did you mean {near!r}?"
    return f"; there is {shorten_list(names, 12) or 'none'}"


# magnitudes of recorded values: squares and products of three stay numbers
MAX_MAGNITUDE, MIN_MAGNITUDE = 1e100, 1e-100


def recordable_values(values: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Values as a record may hold them, and which of them it may not: no finite number, or beyond MAX_MAGNITUDE.

    What is below MIN_MAGNITUDE is zero: no sensor resolves it, and a quotient by it would be no number.
    """
    with np.errstate(invalid="ignore"):
        wrong = ~(np.abs(values) <= MAX_MAGNITUDE)
        return np.where(np.abs(values) < MIN_MAGNITUDE, 0.0, values), wrong


def first_not_finite(values: Array) -> int | None:
    """First row that holds no finite number."""
    first = 0
    for (part,) in stretches(values):
        finite = np.isfinite(part)
        if not finite.all():
            return first + int(np.argmin(finite))
        first += len(part)
    return None


def _first_not_later(time: Array) -> int | None:
    """First row that is not later than the one before."""
    for first in range(0, len(time), STRETCH):
        if (wrong := np.flatnonzero(np.diff(time[first : first + STRETCH + 1]) <= 0)).size:
            return first + int(wrong[0]) + 1
        release(time)
    return None


def _frozen_array(values: ArrayLike, name: str) -> Array:
    if isinstance(values, np.ndarray) and values.dtype == np.float64 and unchangeable(values):
        array: Array = values
    else:
        array = np.array(values, dtype=np.float64)
    if array.ndim != 1:
        raise InputError(f"column {name!r} must be one-dimensional, has shape {array.shape}")
    array.setflags(write=False)
    return array


def require_column(trace: Trace, name: str, purpose: str) -> Array:
    """Column ``name`` of the trace; raises InputError that names the purpose and what was recorded instead."""
    if name not in trace.columns:
        recorded = ", ".join(trace.columns) or "nothing"
        raise InputError(f"{purpose} needs {name}, which is not recorded; recorded: {recorded}")
    return np.asarray(trace[name], dtype=np.float64)


def find_rows(trace: Trace, begin: float, end: float, purpose: str, *, least: int = 2) -> slice:
    """Rows with begin <= time <= end [s]; raises InputError where the trace does not reach that far.

    The window may stick out of the recording by one sampling interval.
    """
    time = trace.time
    interval = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    slack = SAME_INSTANT * interval
    first = int(np.searchsorted(time, begin - slack, side="left"))
    last = int(np.searchsorted(time, end + slack, side="right"))
    short = len(time) == 0 or begin < time[0] - interval - slack or end > time[-1] + interval + slack
    if short or last - first < least:
        have = f"{time[0]:.6g} to {time[-1]:.6g} s" if len(time) else "nothing"
        raise InputError(
            f"{purpose} needs the trace from {begin:.6g} to {end:.6g} s with {least} samples or more; "
            f"recorded: {have}, {max(last - first, 0)} samples in that span"
        )
    return slice(first, last)
