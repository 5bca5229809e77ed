"""Result files of Modelica tools: Dymola, OpenModelica, OMSimulator.

A MAT file with Aclass, name, description, dataInfo, and tables data_1, data_2, ... "binTrans" has a column for each
name, "binNormal" a row. A row of dataInfo is of a name: table (0: the abscissa of all), column of it (negative: with
the opposite sign), interpolation, and what is beyond its ends (-1: nothing, 0: the end's value, 1: a line). Each table
has its abscissa first; data_1 has parameters and constants, at the first and the last instant.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feedsim.errors import InputError
from feedsim.files.spellings import known_unit, spelled
from feedsim.trace.mat import Value, lines
from feedsim.trace.trace import Array

REAL = "fiu"
TIME = "time"
NOT_BEYOND, LINE_BEYOND = -1, 1  # of the last column of dataInfo
_UNIT = re.compile(r".*\[([^\[\]|]+)(?:\|[^\[\]]*)?\]\s*")  # "angle [rad|deg]"


@dataclass(frozen=True)
class Column:
    """A variable of a result over the time of the result. constant: it is the same throughout, and in one number."""

    name: str
    values: NDArray[np.generic]
    unit: str
    constant: bool


def is_result(content: Mapping[str, Value]) -> bool:
    """Whether variables of a MAT file are those of a result."""
    return {"Aclass", "name", "dataInfo"} <= content.keys() and any(name.startswith("data_") for name in content)


def columns(path: Path, content: Mapping[str, Value]) -> Iterator[Column]:
    """Variables of a result, the time first, called "time". InputError: tables that do not fit one another."""
    across = any("binTrans" in row for row in lines(content["Aclass"])) or any(
        "binTrans" in row for row in lines(_turned(content["Aclass"]))
    )
    names, texts = (lines(_turned(content.get(key)) if across else content.get(key)) for key in ("name", "description"))
    info = _table(path, content, "dataInfo", across)
    if info.shape[1] < 4 or len(names) != len(info) or not np.all(np.isfinite(info)):
        raise InputError(
            f"{path}: a result file of Modelica with {len(names)} names, but dataInfo of {info.shape[0]} rows and "
            f"{info.shape[1]} columns; as many rows as names, and 4 columns of whole numbers, are expected"
        )
    numbered = {int(key[5:]): key for key in content if re.fullmatch(r"data_[1-9][0-9]{0,3}", key)}
    tables = {number: _table(path, content, key, across) for number, key in numbered.items()}
    if not tables:
        raise InputError(f"{path}: a result file of Modelica without data_1, data_2, ...")
    longest = max(tables.values(), key=len)
    time = np.asarray(longest[:, 0])
    yield Column(TIME, time, _unit(texts, int(np.argmax(info[:, 0] == 0))) or "s", False)
    seen = {TIME}
    for k, (name, row) in enumerate(zip(names, info.tolist(), strict=True)):
        number, place, beyond = int(row[0]), int(row[1]), int(row[3])
        if number == 0 or not name or name in seen:
            continue
        table = tables.get(number)
        if table is None or not 1 <= abs(place) <= table.shape[1]:
            there = f"which has {table.shape[1]}" if table is not None else "which is missing"
            raise InputError(f"{path}: {name[:60]!r} is to be column {abs(place)} of data_{number}, {there}")
        seen.add(name)
        values = table[:, abs(place) - 1] if place > 0 else -table[:, abs(place) - 1]
        constant = bool(np.all(values == values[0]))
        over_time = _over(time, table[:, 0], values, beyond, constant)
        yield Column(name, over_time, _unit(texts, k), constant and number == 1)


def _over(time: Array, own: Array, values: Array, beyond: int, constant: bool) -> Array:
    """Values of a table over the time of the result."""
    if len(own) == len(time) and bool(np.all(own == time)):
        return values
    if constant:
        return np.broadcast_to(values[:1], time.shape)
    result = np.interp(time, own, values)
    if beyond == NOT_BEYOND:
        result[(time < own[0]) | (time > own[-1])] = np.nan
    elif beyond == LINE_BEYOND:
        for outside, a, b in ((time < own[0], 0, 1), (time > own[-1], -2, -1)):
            run = own[b] - own[a]
            result[outside] = values[a] + (time[outside] - own[a]) * ((values[b] - values[a]) / run if run else 0.0)
    return result


def _table(path: Path, content: Mapping[str, Value], key: str, across: bool) -> Array:
    value = content[key]
    if not isinstance(value, np.ndarray) or value.dtype.kind not in REAL or value.ndim != 2 or not value.size:
        raise InputError(f"{path}: a result file of Modelica, whose {key} is no table of numbers")
    return np.asarray(value.T if across else value, dtype=np.float64)


def _turned(value: Value | None) -> Value | None:
    return value.T if isinstance(value, np.ndarray) else value


def _unit(texts: list[str], k: int) -> str:
    """Unit at the end of a description."""
    match = _UNIT.fullmatch(texts[k]) if k < len(texts) else None
    return spelled(match[1].strip()) if match and known_unit(match[1].strip()) else ""
