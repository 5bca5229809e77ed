"""Columns of a MAT file, as the programs call them that have written it.

Vectors, rows and columns of matrices, and fields of structures are called as MATLAB writes them: `rec.pos`,
`data(:,2)`, `simout.signals(1).values`. Simulink ("Structure With Time", "Structure", "To File"), timeseries that are
structures, and ControlDesk (X and Y) give besides which of them is the time, and names of the others. Result files of
Modelica tools have tables of their own: modelica.py.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feedsim.errors import InputError
from feedsim.files.spellings import known_unit, spelled
from feedsim.trace import modelica
from feedsim.trace.mat import REAL, Other, Value, flat, lines, read_mat

MAT = ".mat"
TIME, TIME_FIELDS = "time", ("time", "t")
# What to type in MATLAB for an object that only MATLAB reads.
_ADVICE = {
    "timeseries": "t = {0}.Time; x = {0}.Data; save('record.mat', 't', 'x', '-v7')",
    "Simulink.SimulationData.Dataset":
        "x = {0}{{1}}.Values; t = x.Time; x = x.Data; save('record.mat', 't', 'x', '-v7')",
    "timetable": "t = seconds({0}.(1)); x = {0}.(2); save('record.mat', 't', 'x', '-v7')",
    "table": "s = table2struct({0}, 'ToScalar', true); save('record.mat', 's', '-v7')",
}  # fmt: skip
MIN_MATRIX_ROWS = 8  # of a matrix whose columns are signals: a record has as many
_UNIT_BEHIND = re.compile(r"(.*\S)\s*\[([^\[\]]*)\]")
_ONE_OF_A_VECTOR = re.compile(r"\((?::|:,1|1,:)\)$")

Numbers = NDArray[np.generic]


@dataclass
class MatColumns:
    """Columns of a file.

    Attributes:
        columns: name -> numbers (N,). units: name -> unit, "" where none is known. scalars: single numbers.
        spellings: what MATLAB calls a column, without what may be omitted -> its name here.
        others: what is neither column nor number -> in words. notes: what a reader should know.
    """

    columns: dict[str, Numbers] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    scalars: dict[str, float] = field(default_factory=dict)
    spellings: dict[str, str] = field(default_factory=dict)
    others: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def add(self, name: str, values: Numbers, unit: str = "", written: str = "") -> None:
        """A column. written: as MATLAB calls it, where that is not its name."""
        self.columns[name], self.units[name] = values, unit
        self.spellings[_short(written or name)] = name


def named(name: str, names: Iterable[str], spellings: Mapping[str, str]) -> str:
    """The name of a column in any of its spellings; as it is where there is none."""
    if name in names:
        return name
    short = _short(name)
    return spellings.get(short) or spellings.get(_ONE_OF_A_VECTOR.sub("", short), name)


def _short(text: str) -> str:
    """What MATLAB calls a value, without blanks and the (1) of what is one alone."""
    return re.sub(r"\s+|\(1\)|\{1\}", "", text)


def read_columns(path: Path) -> MatColumns:
    """Columns of a MAT file. InputError: what read_mat() refuses, no column, tables of Modelica that do not fit."""
    content = {name: value for name, value in read_mat(path).items() if name and not name.startswith("__")}
    result = MatColumns()
    if modelica.is_result(content):
        for column in modelica.columns(path, content):
            result.add(column.name, column.values, column.unit)
            if column.constant:
                result.scalars[column.name] = float(column.values[0].item())
    else:
        groups = [group for name, value in content.items() for group in _groups(name, value)]
        _add_groups(result, groups, taken=set(content))
        _add_rest(result, content, groups)
        _time_of_rows(path, result, content)
    if not result.columns:
        there = f"; there is {', '.join(result.others.values())}" if result.others else ""
        raise InputError(f"{path}: no variable is a vector of real numbers{there}")
    return result


# --- what programs write besides plain variables ---


@dataclass(frozen=True)
class _Signal:
    """Numbers, how MATLAB calls them, and the label and unit that the program gives them."""

    written: str
    values: Numbers
    label: str = ""
    unit: str = ""


@dataclass(frozen=True)
class _Group:
    """Signals over one time, which may be missing. whole: nothing else of the variable is a column."""

    written: str
    time: _Signal | None
    signals: tuple[_Signal, ...]
    whole: bool = True


def _groups(written: str, value: Value) -> Iterator[_Group]:
    """Groups of a variable, and within its structures."""
    if isinstance(value, list):
        for number, inner in enumerate(value, 1):
            yield from _groups(f"{written}({number})", inner)
    elif isinstance(value, dict):
        own = [*_of_simulink(written, value), *_of_control_desk(written, value), *_of_timeseries(written, value)]
        yield from own
        if not own:
            for name, inner in value.items():
                yield from _groups(f"{written}.{name}", inner)


def _of_simulink(written: str, value: Mapping[str, Value]) -> Iterator[_Group]:
    signals = list(_elements(f"{written}.signals", value.get("signals")))
    if not signals or not all(isinstance(signal.get("values"), np.ndarray) for _, signal in signals):
        return
    time = _numbers(value.get("time"))
    yield _Group(
        written,
        None if time is None else _Signal(f"{written}.time", time),
        tuple(
            _Signal(f"{name}.values", numbers, *_label(_text(signal.get("label"))))
            for name, signal in signals
            if (numbers := _numbers(signal["values"])) is not None
        ),
    )


def _of_control_desk(written: str, value: Mapping[str, Value]) -> Iterator[_Group]:
    times, signals = (list(_elements(f"{written}.{name}", value.get(name))) for name in ("X", "Y"))
    if not times or not signals or not all("Data" in element for _, element in (*times, *signals)):
        return
    paths = [_text(signal.get("Name")).strip("\"'") for _, signal in signals]
    ends = [re.split(r"[/\\]", path)[-1].strip("\"'") for path in paths]
    labels = [end if ends.count(end) == 1 else path for end, path in zip(ends, paths, strict=True)]
    for number, (name, element) in enumerate(times, 1):
        time = _numbers(element["Data"])
        own = [
            _Signal(f"{written_signal}.Data", numbers, *_label(label, _text(signal.get("Unit"))))
            for (written_signal, signal), label in zip(signals, labels, strict=True)
            if (numbers := _numbers(signal["Data"])) is not None
            and (len(times) == 1 or _index(signal.get("XIndex")) == number)
        ]
        if own:
            yield _Group(written, None if time is None else _Signal(f"{name}.Data", time), tuple(own))


def _of_timeseries(written: str, value: Mapping[str, Value]) -> Iterator[_Group]:
    time, data = _numbers(value.get("Time")), _numbers(value.get("Data"))
    if time is None or data is None:
        return
    about = value.get("DataInfo")
    label = _label(_text(value.get("Name")), _text(about.get("Units")) if isinstance(about, dict) else "")
    yield _Group(
        written, _Signal(f"{written}.Time", time), (_Signal(f"{written}.Data", data, *label),), "TimeInfo" in value
    )


def _elements(written: str, value: Value | None) -> Iterator[tuple[str, dict[str, Value]]]:
    """Structures, one or several, each as MATLAB calls it."""
    for number, element in enumerate(value if isinstance(value, list) else [value], 1):
        if isinstance(element, dict):
            yield (f"{written}({number})" if isinstance(value, list) else written), element


def _numbers(value: Value | None) -> Numbers | None:
    """Real numbers without dimensions of length 1, more than one; None: it is something else."""
    if not isinstance(value, np.ndarray) or value.dtype.kind not in REAL or value.size < 2:
        return None
    return value.squeeze()


def _index(value: Value | None) -> int:
    """Which X a signal goes with; the first one, where it does not say so."""
    number = value.item() if isinstance(value, np.ndarray) and value.dtype.kind in REAL and value.size == 1 else 1
    return int(number) if np.isfinite(number) else 1


def _text(value: Value | None) -> str:
    return " ".join(lines(value)).strip()


def _label(text: str, unit: str = "") -> tuple[str, str]:
    """Label and unit; of "pos [mm]" its parts."""
    if (match := _UNIT_BEHIND.fullmatch(text)) and not match[2].strip().isdecimal() and known_unit(match[2]):
        text, unit = match[1], match[2]
    return text, spelled(unit) if unit and known_unit(unit) else ""


def _add_groups(result: MatColumns, groups: list[_Group], taken: set[str]) -> None:
    """Signals by their labels, where each has its own; the time of all of them as "time". taken: names of variables."""
    times = [group.time for group in groups if group.time is not None]
    one = bool(times) and all(np.array_equal(times[0].values, time.values) for time in times) and TIME not in taken
    for time in times:
        result.add(TIME if one else time.written, time.values, "s", time.written)
    labels = Counter(signal.label for group in groups for signal in group.signals)
    for group in groups:
        for signal in group.signals:
            own = labels[signal.label] == 1 and signal.label not in {*taken, *result.columns, TIME}
            for part, values in _vectors(signal.values, len(group.time.values) if group.time is not None else None):
                name = f"{signal.label}{part}" if signal.label and own else f"{signal.written}{part}"
                result.add(name, values, signal.unit, f"{signal.written}{part}")


# --- plain variables ---


def _vectors(values: Numbers, length: int | None = None) -> Iterator[tuple[str, Numbers]]:
    """Columns within an array, and how MATLAB calls each: of a matrix those of `length`, else the longer ones."""
    if values.ndim == 1:
        yield "", values
    elif values.ndim == 2:
        down = values.shape[0] >= values.shape[1] if length not in values.shape else length == values.shape[0]
        for k, vector in enumerate(values.T if down else values, 1):
            yield f"(:,{k})" if down else f"({k},:)", vector
    elif values.ndim == 3 and length == values.shape[2]:
        for i, j in np.ndindex(*values.shape[:2]):
            yield f"({i + 1},{j + 1},:)", values[i, j]


def _add_rest(result: MatColumns, content: Mapping[str, Value], groups: list[_Group]) -> None:
    """What no group has."""
    whole = tuple(f"{group.written}." for group in groups if group.whole)
    plain: dict[str, Numbers] = {}
    for name, value in flat(content):
        if name.startswith(whole) or _short(name) in result.spellings:
            continue
        if isinstance(value, Other):
            result.others[name] = _other(name, value)
        elif value.dtype.kind not in REAL:
            kind = "text" if value.dtype.kind == "U" else f"{value.dtype} of shape {value.shape}"
            result.others[name] = f"{name!r} ({kind})"
        elif value.size == 1:
            result.scalars[name] = float(value.item())
        elif (value.ndim == 1 and value.size) or (value.ndim == 2 and max(value.shape) >= MIN_MATRIX_ROWS):
            vectors = _vectors(value)
            plain |= {f"{name}{part}": vector for part, vector in vectors}
        else:
            result.others[name] = f"{name!r} ({value.dtype} of shape {value.shape})"
    times = [name for name in plain if name.rpartition(".")[2].lower() in TIME_FIELDS]
    inside = len(times) == 1 and times[0].lower() not in TIME_FIELDS and TIME not in result.columns
    for name, vector in plain.items():
        result.add(TIME if inside and name == times[0] else name, vector, written=name)


def _other(name: str, value: Other) -> str:
    if not value.opaque:
        return f"{name!r} ({value.what})"
    of_class = value.what.rpartition(" ")[2]
    advice = _ADVICE.get(of_class, "").format(name) or "save what it holds as vectors"
    return f"{name!r} ({value.what}, which only MATLAB reads; there: {advice})"


def _time_of_rows(path: Path, result: MatColumns, content: Mapping[str, Value]) -> None:
    """The first row of a file's only matrix as the time, where it can be: Simulink's "To File" writes it so."""
    names = [name for name in content if f"{name}(1,:)" in result.columns]
    if len(names) != 1 or not all(name.startswith(f"{names[0]}(") for name in result.columns):
        return
    first = f"{names[0]}(1,:)"
    if bool(np.all(np.diff(result.columns[first].astype(np.float64)) > 0)):
        columns = dict(result.columns)
        result.columns.clear()
        result.add(TIME, columns.pop(first), "s", first)
        result.columns |= columns
        result.notes.append(f"{path}: {first} is taken to be the time in s, as Simulink's To File writes it")
