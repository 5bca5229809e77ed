"""A recorded file as it is: the columns of a CSV file, the variables of a MAT file or the signals of a control's
capture, read when they are asked for.

MAT files are those of version 4 to 7; a field inside a structure is "structure.field". Captures: capture.py.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from feedsim import units
from feedsim.errors import InputError, few
from feedsim.files.spellings import spelled
from feedsim.trace import capture, sinumerik_xml
from feedsim.trace.capture_axes import CaptureAxis
from feedsim.trace.cells import TIME_NAMES, Table, read_table, usual_column
from feedsim.trace.csv import write_csv
from feedsim.trace.layout import titles
from feedsim.trace.mat import Other, Value, flat, read_mat
from feedsim.trace.scopes import read_scope
from feedsim.trace.trace import MAX_MAGNITUDE, Array, Trace, recorded, suggest

MAT = ".mat"
REAL = "fiu"  # kinds of numpy's types


@dataclass(frozen=True, eq=False)
class Recording:
    """What a file holds.

    Attributes:
        path: the file.
        names: its columns: of a CSV file without their units, of a MAT file its vectors, rows and columns alike.
        units: column -> unit as the header has it; "" where it shows none, as always in MAT files.
        scalars: numbers that stand beside the columns (MAT).
        axes: of a capture, whose columns are called NAME|number of the axis; empty for other files.
        marks: what the control did, and when (capture).
        notes: what a reader of the file should know.
        remarks: lines ahead of the header (CSV).
    """

    path: Path
    names: tuple[str, ...]
    units: Mapping[str, str]
    scalars: Mapping[str, float] = field(default_factory=dict)
    axes: tuple[CaptureAxis, ...] = ()
    marks: tuple[capture.Mark, ...] = ()
    notes: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    _table: Table | None = None  # of a CSV file
    _variables: Mapping[str, Value] = field(default_factory=dict)  # of a MAT file or a capture

    def read(self, names: Iterable[str]) -> dict[str, Array]:
        """Values of columns, all of one length.

        Raises InputError with file and line (element, in MAT files): no such column, a cell that is empty, NaN or no
        number, decimal marks that are not clear; variables of different lengths.
        """
        wanted = list(dict.fromkeys(names))
        if self._table is not None:
            read = self._table.values(map(self._table.index, wanted)).values()
            return {name: recorded(column)[0] for name, column in zip(wanted, read, strict=True)}
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

    def called(self, text: str) -> str | None:
        """The column of a name, or of a path as a control has it; None: there is none."""
        if text in self.units:
            return text
        return next((title for title in titles([text]) if title in self.units), None)

    def clock(self) -> tuple[str, float] | None:
        """The column of the time, by its usual names, else the first one if its unit is a time; and the factor of its
        values to s. Without a unit it is in s. None: there is none.

        Raises InputError: several are called so; its unit is no time.
        """
        known = [self.units[name] for name in self.names]
        index = usual_column(self.names, known, TIME_NAMES, "s", self.header)
        if index is None:
            return None
        name = self.names[index]
        try:
            return name, float(units.factor(spelled(self.units[name]) or "s", "s"))
        except InputError as error:
            raise InputError(f"{self.header}: column {name!r}: {error}") from None

    @property
    def control(self) -> str:
        """The control whose own file it is, by the name that machine files have for it; empty where any program may
        have written it."""
        return "sinumerik" if self.axes or self.path.suffix.lower() == sinumerik_xml.SUFFIX else ""

    def of_axis(self, axis: CaptureAxis) -> Recording:
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
    """Look into a CSV file, a MAT file (shown by its ending .mat) or a control's capture (.json).

    Raises InputError: what read_csv() and read_capture() refuse; a MAT file that is not there or is none, one of
    version 7.3, which is HDF5, or one without a vector of real numbers.
    """
    path = Path(path)
    if path.suffix.lower() == MAT:
        return _read_mat(path)
    if (recording := of_control(path)) is not None:
        return recording
    table = read_table(path)
    # A bracket with digits alone is the index of a parameter, r0078[0], not a unit.
    units = ["" if unit.isdecimal() else unit for unit in table.units]
    return Recording(
        path, table.names, dict(zip(table.names, units, strict=True)),
        notes=table.notes, remarks=table.remarks, _table=table,
    )  # fmt: skip


def of_control(path: Path) -> Recording | None:
    """What a control has recorded, in a format of its own; its time is "time" [s]. None: another file. InputError."""
    if path.suffix.lower() == capture.SUFFIX:
        result = capture.read_capture(path)
        return Recording(
            path, tuple(result.columns), result.units, axes=result.axes, marks=result.marks, _variables=result.columns
        )
    signals = sinumerik_xml.read_signals(path) if path.suffix.lower() == sinumerik_xml.SUFFIX else read_scope(path)
    if signals is None:
        return None
    _check(path, signals.columns)
    return Recording(path, tuple(signals.columns), signals.units, notes=signals.notes, _variables=signals.columns)


def _check(path: Path, columns: Mapping[str, Array]) -> None:
    """InputError: a value that nothing records."""
    for name, values in columns.items():
        if (wrong := recorded(values)[1]).any():
            row = int(np.argmax(wrong))
            raise InputError(
                f"{path}: {name!r} is {values[row]:.6g} at sample {row + 1}; allowed: up to {MAX_MAGNITUDE:g}"
            )


def _read_mat(path: Path) -> Recording:
    variables = _load(path)
    vectors: list[str] = []
    scalars: dict[str, float] = {}
    others: list[str] = []
    for name, value in flat(variables):
        if isinstance(value, Other):
            others.append(
                "an object such as a table or timetable, which only MATLAB reads: save its columns as vectors"
                if value.opaque
                else f"{name!r} ({value.what})"
            )
        elif value.dtype.kind in REAL and value.ndim == 1 and value.size > 1:
            vectors.append(name)
        elif value.dtype.kind in REAL and value.size == 1:
            scalars[name] = float(value.item())
        else:
            others.append(f"{name!r} ({value.dtype} of shape {value.shape})")
    if not vectors:
        there = f"; there is {', '.join(others)}" if others else ""
        raise InputError(f"{path}: no variable is a vector of real numbers{there}")
    return Recording(path, tuple(vectors), dict.fromkeys(vectors, ""), scalars, _variables=variables)


def convert(file: str | Path | Recording, columns: Sequence[tuple[str, str, str]], out: str | Path) -> Trace:
    """Write columns of a recording as a CSV trace and return the trace.

    columns  (variable, new name, unit); the first must be the time (name "time", any unit of time). Values whose unit
             the file shows are converted to that unit; others are taken to be in it. A variable inside a structure of
             a MAT file is "structure.field". Empty: all columns, as the file calls them.

    Raises InputError: what read_recording() refuses, a variable that is missing (with those there are), no vector of
    real finite numbers, or of another length than the time. OutputError: `out` cannot be written.
    """
    if columns and columns[0][1] != "time":
        raise InputError("the first column must be the time, for example t=time:s")
    factor = float(units.factor(columns[0][2], "s")) if columns else 1.0
    for _, _, unit in columns[1:]:
        units.unit(unit)
    if doubled := [name for i, (_, name, _) in enumerate(columns) if name in [other for _, other, _ in columns[:i]]]:
        raise InputError(f"two columns are to be called {doubled[0]!r}")
    recording = file if isinstance(file, Recording) else read_recording(file)
    path = recording.path
    if not columns:
        clock = recording.clock()
        if clock is None or not (recording.units[clock[0]] or recording._table):
            raise InputError(
                f"{path}: which column is the time? --column t=time:s, and one for each other column; there are "
                f"{few(sorted(recording.names), 20)}"
            )
        at, factor = clock
        columns = [(at, "time", recording.units[at] or "s")]
        columns += [(name, name, recording.units[name]) for name in recording.names if name != at]
    read = recording.read(variable for variable, _, _ in columns)
    scales = {variable: _scale(recording, variable, unit) for variable, _, unit in columns}
    read = {name: values if scales[name] == 1 else values * scales[name] for name, values in read.items()}
    time = read[columns[0][0]] * factor
    try:
        trace = Trace(time, {name: read[variable] for variable, name, _ in columns[1:]},
                      {name: unit for _, name, unit in columns[1:] if unit})  # fmt: skip
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    write_csv(out, trace)
    return trace


def _scale(recording: Recording, variable: str, unit: str) -> float:
    """From the file's unit to `unit`; 1 where the file has none that is known. InputError: of another dimension."""
    known = recording.units.get(variable, "")
    if not known or known == unit:
        return 1.0
    try:
        units.unit(known)
    except InputError:
        return 1.0
    try:
        return float(units.factor(known, unit))
    except InputError as error:
        raise InputError(f"{recording.path}: column {variable!r}: {error}") from None


def _load(path: Path) -> dict[str, Value]:
    return {name: value for name, value in read_mat(path).items() if name and not name.startswith("__")}


def _vector(path: Path, variables: Mapping[str, Value], variable: str) -> Array:
    names = [variable] if variable in variables else variable.split(".")
    value = variables.get(names[0])
    if value is None:
        raise InputError(f"{path}: no variable {names[0]!r}{suggest(names[0], variables)}")
    for depth, name in enumerate(names[1:], start=1):
        if not isinstance(value, dict):
            raise InputError(f"{path}: {'.'.join(names[:depth])!r} is no structure")
        if name not in value:
            raise InputError(f"{path}: no field {name!r} in {'.'.join(names[:depth])!r}{suggest(name, value)}")
        value = value[name]
    if isinstance(value, (dict, Other)):
        raise InputError(f"{path}: {variable!r} is no numbers; a vector of real numbers is needed")
    if value.dtype.kind not in REAL or value.ndim != 1:
        kind = f"{value.dtype} of shape {value.shape}"
        raise InputError(f"{path}: {variable!r} is {kind}; a vector of real numbers is needed")
    numbers = value.astype(np.float64)
    if not np.all(np.isfinite(numbers)):
        raise InputError(f"{path}: {variable!r} is not finite at element {int(np.argmin(np.isfinite(numbers))) + 1}")
    numbers, wrong = recorded(numbers)
    if wrong.any():
        row = int(np.argmax(wrong))
        raise InputError(
            f"{path}: {variable!r} is {numbers[row]:g} at element {row + 1}; allowed: up to {MAX_MAGNITUDE:g}"
        )
    return numbers
