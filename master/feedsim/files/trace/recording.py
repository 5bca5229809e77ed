"""A recorded file as it is: the columns of a CSV file, the variables of a MAT file or the signals of a control's
capture, read when they are asked for.

MAT files and what their columns are called: mat_columns.py. Captures: capture.py.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from feedsim.files.trace import capture, sinumerik_xml
from feedsim.files.trace.capture import CaptureAxis
from feedsim.files.trace.cells import TIME_NAMES, Table, read_finite_table, titles, usual_column
from feedsim.files.trace.files import write_csv
from feedsim.files.trace.mat import MAT, read_columns
from feedsim.files.trace.mat import find_column as named_so
from feedsim.files.trace.response_files import UNIVERSAL, read_signals_uff
from feedsim.files.trace.scopes import read_scope
from feedsim.files.trace.trace import MAX_MAGNITUDE, Array, Trace, recordable_values, suggest_name
from feedsim.foundation import units
from feedsim.foundation.errors import Finding, InputError, shorten_list
from feedsim.foundation.units import spell_unit

if TYPE_CHECKING:
    from feedsim.files.columns import Columns, Factor


@dataclass(frozen=True, eq=False)
class Recording:
    """What a file holds.

    Attributes:
        path: the file.
        names: its columns: of a CSV file without their units, of a MAT file its vectors, rows and columns alike.
        units: column -> unit as the header has it; "" where it shows none, as mostly in MAT files.
        scalars: numbers that stand beside the columns (MAT).
        axes: of a capture, whose columns are called NAME|number of the axis; empty for other files.
        marks: what the control did, and when (capture).
        notes: what a reader of the file should know.
        remarks: lines ahead of the header (CSV).
        unread: what the file holds besides, in words (MAT).
    """

    path: Path
    names: tuple[str, ...]
    units: Mapping[str, str]
    scalars: Mapping[str, float] = field(default_factory=dict)
    axes: tuple[CaptureAxis, ...] = ()
    marks: tuple[capture.Mark, ...] = ()
    notes: tuple[Finding, ...] = ()
    remarks: tuple[str, ...] = ()
    unread: Mapping[str, str] = field(default_factory=dict)
    _table: Table | None = None  # of a CSV file
    _columns: Mapping[str, NDArray[np.generic]] = field(default_factory=dict)  # of all other files
    _spellings: Mapping[str, str] = field(default_factory=dict)  # other ways to write a name (MAT)
    _rows: NDArray[np.bool_] | None = None  # that are read (MAT)

    def read(self, names: Iterable[str]) -> dict[str, Array]:
        """Values of columns, all of one length.

        Raises InputError with file and line (element, in MAT files): no such column, a cell that is empty, NaN or no
        number, decimal marks that are not clear; variables of different lengths.
        """
        wanted = list(dict.fromkeys(names))
        if self._table is not None:
            read = self._table.values(map(self._table.index, wanted)).values()
            return {name: recordable_values(column)[0] for name, column in zip(wanted, read, strict=True)}
        values = {name: self._vector(name) for name in wanted}
        for name in wanted[1:]:
            if values[name].size != values[wanted[0]].size:
                raise InputError(
                    f"{self.path}: {name!r} has {values[name].size} values, {wanted[0]!r} has {values[wanted[0]].size}"
                )
        return values

    @property
    def day(self) -> str:
        """On which it was recorded, ISO 8601, as its time stamps have it; "" where they have none."""
        return self._table.day if self._table is not None else ""

    def _vector(self, name: str) -> Array:
        """InputError: no such column, a number that is not finite or too large."""
        values = self._columns.get(self.called(name) or name)
        if values is None:
            other = self.unread.get(name)
            if name not in self.scalars and other is None:
                raise InputError(f"{self.path}: no variable {name!r}{suggest_name(name, self.names)}")
            what = other or f"{name!r} is a single number"
            raise InputError(f"{self.path}: {what}; a vector of real numbers is needed")
        if self._rows is not None and len(values) == len(self._rows):
            values = values[self._rows]
        numbers = values.astype(np.float64)
        if not np.all(np.isfinite(numbers)):
            row = int(np.argmin(np.isfinite(numbers))) + 1
            raise InputError(f"{self.path}: {name!r} is not finite at element {row}")
        numbers, wrong = recordable_values(numbers)
        if wrong.any():
            row = int(np.argmax(wrong))
            raise InputError(
                f"{self.path}: {name!r} is {numbers[row]:g} at element {row + 1}; allowed: up to {MAX_MAGNITUDE:g}"
            )
        return numbers

    @property
    def there(self) -> str:
        """What the file holds, for messages."""
        unread = f"; not read: {shorten_list([*self.unread.values()], 5)}" if self.unread else ""
        return f"{shorten_list(self.names, 20)}{unread}"

    def scalar(self, name: str) -> float:
        """A number of the file. InputError: there is none of that name."""
        if name in self.scalars:
            return self.scalars[name]
        if name in self.names:
            raise InputError(f"{self.path}: variable {name!r} is a vector; a factor must be one number")
        hint = "; a CSV file has none, write the number itself" if self._table else suggest_name(name, self.scalars)
        raise InputError(f"{self.path}: no variable {name!r}{hint}")

    def beside(self, time: str) -> list[tuple[str, str, str]]:
        """Columns as long as that of the time: name, the same as a CSV file may have it, unit."""
        there = [
            name for name in self.names
            if name != time and (not self._columns or len(self._columns[name]) == len(self._columns[time]))
        ]  # fmt: skip
        return [(name, re.sub(r"\[(.*?)\]", r"(\1)", name), self.units[name]) for name in there]

    def called(self, text: str) -> str | None:
        """The column of a name in any of its spellings, signals(2).values, or a path of a control."""
        if (name := named_so(text, self._columns, self._spellings)) in self.units:
            return name
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
            return name, float(units.factor(spell_unit(self.units[name]) or "s", "s"))
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
    """Look into a CSV file, a MAT file (shown by its ending .mat), a universal file of time responses (.uff, .unv, .uf,
    .bunv) or a control's capture (.json).

    Raises InputError: what read_csv() and read_capture() refuse; a MAT file that is not there or is none, or one
    without a vector of real numbers.
    """
    path = Path(path)
    if path.suffix.lower() == MAT:
        return _read_mat(path)
    if path.suffix.lower() in UNIVERSAL:
        columns, unit_texts, notes = read_signals_uff(path)
        return Recording(path, tuple(columns), unit_texts, notes=notes, _columns=columns)
    if (recording := of_control(path)) is not None:
        return recording
    table = read_finite_table(path)
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
            path, tuple(result.columns), result.units, axes=result.axes, marks=result.marks, _columns=result.columns
        )
    signals = sinumerik_xml.read_signals(path) if path.suffix.lower() == sinumerik_xml.SUFFIX else read_scope(path)
    if signals is None:
        return None
    _check(path, signals.columns)
    return Recording(path, tuple(signals.columns), signals.units, notes=signals.notes, _columns=signals.columns)


def _check(path: Path, columns: Mapping[str, Array]) -> None:
    """InputError: a value that nothing records."""
    for name, values in columns.items():
        if (wrong := recordable_values(values)[1]).any():
            row = int(np.argmax(wrong))
            raise InputError(
                f"{path}: {name!r} is {values[row]:.6g} at sample {row + 1}; allowed: up to {MAX_MAGNITUDE:g}"
            )


def _read_mat(path: Path) -> Recording:
    """A MAT file; of rows at one instant, as simulators write them at events, the last one counts."""
    mat = read_columns(path)
    rows, notes = None, tuple(mat.notes)
    time = mat.columns.get("time", np.zeros(0))
    if len(time) > 1 and bool(np.any(again := np.diff(time) == 0)) and mat.units["time"]:
        rows = np.append(~again, True)
        count = int(again.sum())
        text = f"{path}: {count} of {len(time)} rows are left out: of rows at one instant the last counts"
        notes = (*notes, Finding("rows-left-out", "doubt", text, str(path)))
    return Recording(
        path, tuple(mat.columns), mat.units, mat.scalars, notes=notes, unread=mat.others,
        _columns=mat.columns, _spellings=mat.spellings, _rows=rows,
    )  # fmt: skip


# Role of a mapping file -> the column of a result that it is, of an axis, and its unit.
MAPPED_NAMES = {
    "position": ("{}.x_a", "m"),
    "setpoint": ("{}.x_s", "m"),
    "deviation": ("{}.x_e", "m"),
    "speed": ("{}.n_a", "rad/s"),
    "torque": ("{}.M_a", "N.m"),
    "current": ("{}.i_q", "A"),
    "angle": ("angle", "rad"),
    "radius": ("radius", "m"),
    "radial_deviation": ("deviation", "m"),
}


def map_columns(recording: Recording, mappings: Sequence[Columns]) -> Recording:
    """A record with its columns called as those of results are, X.x_a [m], by mapping files, one for each axis.

    Without mapping files it is what it was. Raises InputError: a mapping of positions that names no axis, a column that
    there is not, a unit that is not known.
    """
    from feedsim.files.columns import target_of

    if not mappings:
        return recording
    columns: dict[str, Array] = {}
    known: dict[str, str] = {}
    for mapping in mappings:
        clock = mapping.time
        if clock.interval is not None:
            first = next(name for role in MAPPED_NAMES if (one := mapping.signal(role)) for name in [one.column])
            columns["time"] = clock.interval * np.arange(len(recording.read([first])[first]), dtype=np.float64)
        elif clock.column is not None:
            columns["time"] = _scale_column(recording, "time", clock.column, clock.unit, clock.factor)
        elif (known_clock := recording.clock()) is not None:
            columns["time"] = recording.read([known_clock[0]])[known_clock[0]] * known_clock[1]
        for role, (name, unit) in MAPPED_NAMES.items():
            signal = mapping.signal(role)
            if signal is None:
                continue
            if "{}" in name and mapping.axis is None:
                raise InputError(f"{mapping.where(role)}: of which axis is not said: add a line such as axis: X")
            values = signal.sign * _scale_column(recording, role, signal.column, signal.unit, signal.factor)
            own = str(target_of(role, _unit_of(recording, signal.column, signal.unit, signal.factor)))
            if own != unit:
                if mapping.pitch is None:
                    raise InputError(f"{mapping.where(role)}: is in {own}; for {unit} the mapping needs the pitch")
                per_turn = mapping.pitch / (2 * np.pi)
                values = np.asarray(values * (per_turn if own.startswith("rad") else 1 / per_turn), dtype=np.float64)
            columns[name.format(mapping.axis)] = values
            known[name.format(mapping.axis)] = unit
    if "time" in columns:
        known["time"] = "s"
    text = f"{recording.path}: columns by {', '.join(str(mapping.file or 'a mapping') for mapping in mappings)}"
    note = Finding("columns-mapped", "doubt", text, str(recording.path))
    return Recording(
        recording.path, tuple(columns), known, notes=(*recording.notes, note), remarks=recording.remarks,
        _columns=columns,
    )  # fmt: skip


def _unit_of(recording: Recording, name: str, unit: str | None, factor: Factor | None) -> units.Unit:
    from feedsim.files.columns import resulting_unit

    if name not in recording.units:
        raise InputError(f"{recording.header}: no column {name!r}{suggest_name(name, recording.names)}")
    return resulting_unit(unit or spell_unit(recording.units[name]) or "1", factor.unit if factor is not None else "1")


def _scale_column(recording: Recording, role: str, name: str, unit: str | None, factor: Factor | None) -> Array:
    """Values of a column in the SI unit of its role."""
    from feedsim.files.columns import target_of

    given = _unit_of(recording, name, unit, factor)
    target = target_of(role, given)
    scale = 1.0
    if factor is not None:
        scale = factor.value if factor.value is not None else recording.scalar(str(factor.variable))
    return recording.read([name])[name] * scale * float(given.factor / units.unit(target).factor)


def convert(file: str | Path | Recording, columns: Sequence[tuple[str, str, str]], out: str | Path) -> Trace:
    """Write columns of a recording as a CSV trace and return the trace.

    columns  (variable, new name, unit); the first must be the time (name "time", any unit of time). Values whose unit
             the file shows are converted to that unit; others are taken to be in it. Variables of a MAT file are
             called as MATLAB writes them: structure.field, data(:,2). Empty: all columns, as the file calls them.

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
            first = next((name for name in recording.names if name.lower() in TIME_NAMES), recording.names[0])
            text = f"{first}=time:s"
            raise InputError(
                f"{path}: which column is the time? --column {quote(text)}, and one "
                f"for each other column; there are {recording.there}"
            )
        at, _ = clock
        columns = [(at, "time", recording.units[at] or "s"), *recording.beside(at)]
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
    known = recording.units.get(recording.called(variable) or variable, "")
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
