"""A recorded file as it is: the columns of a CSV file, the variables of a MAT file or the signals of a control's
capture, read when they are asked for.

MAT files are those of version 4 to 7; a field inside a structure is "structure.field". Captures: capture.py.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from feedsim import units
from feedsim.errors import InputError
from feedsim.trace import capture
from feedsim.trace.cells import Table, read_table
from feedsim.trace.csv import write_csv
from feedsim.trace.trace import Array, Trace, suggest

MAT = ".mat"


@dataclass(frozen=True, eq=False)
class Recording:
    """What a file holds.

    Attributes:
        path: the file.
        names: its columns: of a CSV file without their units, of a MAT file its vectors, rows and columns alike.
        units: column -> unit as the header has it; "" where it tells none, as always in MAT files.
        scalars: numbers that stand beside the columns (MAT).
        axes: of a capture, whose columns are called NAME|number of the axis; empty for other files.
        marks: what the control did, and when (capture).
    """

    path: Path
    names: tuple[str, ...]
    units: Mapping[str, str]
    scalars: Mapping[str, float] = field(default_factory=dict)
    axes: tuple[capture.CaptureAxis, ...] = ()
    marks: tuple[capture.Mark, ...] = ()
    _table: Table | None = None  # of a CSV file
    _variables: Mapping[str, Any] = field(default_factory=dict)  # of a MAT file or a capture

    def read(self, names: Iterable[str]) -> dict[str, Array]:
        """Values of columns, all of one length.

        Raises InputError with file and line (element, in MAT files): no such column, a cell that is empty, NaN or no
        number, decimal marks that are not clear; variables of different lengths.
        """
        wanted = list(dict.fromkeys(names))
        if self._table is not None:
            return dict(zip(wanted, self._table.values(map(self._table.index, wanted)).values(), strict=True))
        values = {name: _vector(self.path, self._variables, name) for name in wanted}
        for name in wanted[1:]:
            if values[name].size != values[wanted[0]].size:
                raise InputError(
                    f"{self.path}: {name!r} has {values[name].size} values, {wanted[0]!r} has {values[wanted[0]].size}"
                )
        return values

    def scalar(self, name: str) -> float:
        """A number of the file. InputError: there is none of that name."""
        if name in self.scalars:
            return self.scalars[name]
        if name in self.names:
            raise InputError(f"{self.path}: variable {name!r} is a vector; a factor must be one number")
        hint = "; a CSV file has none, write the number itself" if self._table else suggest(name, self.scalars)
        raise InputError(f"{self.path}: no variable {name!r}{hint}")

    def of_axis(self, axis: capture.CaptureAxis) -> Recording:
        """The signals of one axis of a capture alone, and the time."""
        own = tuple(name for name in self.names if "|" not in name or name.endswith(f"|{axis.number}"))
        return replace(self, names=own, axes=(axis,))

    @property
    def header(self) -> str:
        """Where the columns are named, for messages: "file.csv:1"."""
        return str(self.path) if self._table is None else self._table.head

    def row(self, index: int) -> str:
        """Where a row stands, counted from 0: "file.csv:17" or "file.mat, element 16"."""
        if self._table is None:
            return f"{self.path}, element {index + 1}"
        return f"{self._table.where}:{self._table.lines[index]}"


def read_recording(path: str | Path) -> Recording:
    """Look into a CSV file, a MAT file (told by its ending .mat) or a control's capture (.json).

    Raises InputError: what read_csv() and read_capture() refuse; a MAT file that is not there or is none, one of
    version 7.3, which is HDF5, or one without a vector of real numbers.
    """
    path = Path(path)
    if path.suffix.lower() == capture.SUFFIX:
        found = capture.read_capture(path)
        return Recording(
            path, tuple(found.columns), found.units, axes=found.axes, marks=found.marks, _variables=found.columns
        )
    if path.suffix.lower() == MAT:
        return _read_mat(path)
    table = read_table(path)
    # A bracket with digits alone is the index of a parameter, r0078[0], not a unit.
    units = ["" if unit.isdecimal() else unit for unit in table.units]
    return Recording(path, table.names, dict(zip(table.names, units, strict=True)), _table=table)


def _read_mat(path: Path) -> Recording:
    variables = _load(path)
    vectors: list[str] = []
    scalars: dict[str, float] = {}
    others: list[str] = []
    for name, value in _flat(variables):
        array = np.asarray(value)
        if array.dtype.kind in "fiu" and array.ndim == 1 and array.size > 1:
            vectors.append(name)
        elif array.dtype.kind in "fiu" and array.size == 1:
            scalars[name] = float(array.item())
        elif type(value).__name__ in ("MatlabOpaque", "MatlabFunction"):
            others.append(
                "an object such as a table or timetable, which only MATLAB reads: save its columns as vectors"
            )
        else:
            others.append(f"{name!r} ({array.dtype} of shape {array.shape})")
    if not vectors:
        there = f"; there is {', '.join(others)}" if others else ""
        raise InputError(f"{path}: no variable is a vector of real numbers{there}")
    return Recording(path, tuple(vectors), dict.fromkeys(vectors, ""), scalars, _variables=variables)


def _flat(content: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Variables, those inside structures too, each with its name."""
    for name, value in content.items():
        fields = getattr(value, "_fieldnames", None)
        if fields is None:
            yield prefix + name, value
        else:
            yield from _flat({each: getattr(value, each) for each in fields}, f"{prefix}{name}.")


def convert(path: str | Path, columns: Sequence[tuple[str, str, str]], out: str | Path) -> Trace:
    """Write columns of a recording as a CSV trace and return the trace.

    columns  (variable, new name, unit of the values); the first must be the time (name "time", any unit of time). A
             variable inside a structure of a MAT file is "structure.field". Empty: all columns, as the file calls them.

    Raises InputError: what read_recording() refuses, a variable that is missing (with those there are), no vector of
    real finite numbers, or of another length than the time. OutputError: `out` cannot be written.
    """
    path = Path(path)
    if columns and columns[0][1] != "time":
        raise InputError("the first column must be the time, for example t=time:s")
    factor = units.factor(columns[0][2], "s") if columns else 1
    for _, _, unit in columns[1:]:
        units.unit(unit)
    if doubled := [name for i, (_, name, _) in enumerate(columns) if name in [other for _, other, _ in columns[:i]]]:
        raise InputError(f"two columns are to be called {doubled[0]!r}")
    recording = read_recording(path)
    if not columns:
        if recording.units.get("time") != "s":
            raise InputError(f"{path}: which column is the time? --column t=time:s, and one for each other column")
        columns = [("time", "time", "s")]
        columns += [(name, name, recording.units[name]) for name in recording.names if name != "time"]
    read = recording.read(variable for variable, _, _ in columns)
    time = read[columns[0][0]] * float(factor)
    try:
        trace = Trace(time, {name: read[variable] for variable, name, _ in columns[1:]},
                      {name: unit for _, name, unit in columns[1:] if unit})  # fmt: skip
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    write_csv(out, trace)
    return trace


def _load(path: Path) -> dict[str, Any]:
    from scipy.io import loadmat

    try:
        # Read into memory first: given a name, the reader tries further names of its own.
        with path.open("rb") as file:
            content = loadmat(file, struct_as_record=False, squeeze_me=True)
    except FileNotFoundError:
        raise InputError(f"no such file: {path}") from None
    except NotImplementedError:
        raise InputError(f"{path} is a MAT file of version 7.3 (HDF5); save it with -v7") from None
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from None
    except Exception as error:  # the reader raises many kinds on a file that is none
        raise InputError(f"{path} is no MAT file that can be read: {error}") from error
    return {name: value for name, value in content.items() if not name.startswith("__")}


def _vector(path: Path, variables: Mapping[str, Any], variable: str) -> Array:
    names = variable.split(".")
    value: Any = variables.get(names[0])
    if value is None:
        raise InputError(f"{path}: no variable {names[0]!r}{suggest(names[0], variables)}")
    for depth, name in enumerate(names[1:], start=1):
        fields = getattr(value, "_fieldnames", None)
        if fields is None:
            raise InputError(f"{path}: {'.'.join(names[:depth])!r} is no structure")
        if name not in fields:
            raise InputError(f"{path}: no field {name!r} in {'.'.join(names[:depth])!r}{suggest(name, fields)}")
        value = getattr(value, name)
    array = np.asarray(value)
    if array.dtype.kind not in "fiu" or array.ndim != 1:
        kind = f"{array.dtype} of shape {array.shape}" if array.dtype.kind in "fiucb" else "no numbers"
        raise InputError(f"{path}: {variable!r} is {kind}; a vector of real numbers is needed")
    numbers = array.astype(np.float64)
    if not np.all(np.isfinite(numbers)):
        raise InputError(f"{path}: {variable!r} is not finite at element {int(np.argmin(np.isfinite(numbers))) + 1}")
    return numbers
