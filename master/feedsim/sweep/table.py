"""The table of a study: a row for every run, with the values of its parameters and its figures.

As a file: CSV for everything, or Parquet (with pyarrow), which has units and provenance in its metadata.
"""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from feedsim.errors import InputError, OutputError, no_such_file
from feedsim.extras import need
from feedsim.fields import did_you_mean
from feedsim.files.regular import json_file, json_value
from feedsim.scenario.study import Parameter
from feedsim.sheets import read_rows, write_rows
from feedsim.sweep.design import Design, Outcome
from feedsim.trace import matches
from feedsim.trace.files import written_whole
from feedsim.trace.layout import named_columns, twice

if TYPE_CHECKING:
    import pandas

OK, FAILED = "ok", "failed"
FIRST_COLUMNS, LAST_COLUMNS = ("run",), ("status", "message", "warnings", "seconds")
Format = Literal["csv", "parquet"]
STEM = "table"
RECORD = "study.json"
_KEY = b"feedsim"  # of the metadata
_HEADER = re.compile(r"(.*?)(?: \[([^\[\]]*)\])?")


@dataclass(frozen=True, eq=False, repr=False)
class Table:
    """The runs that are done, in their order.

    Attributes:
        columns: name -> (rows,) values: float64, NaN where there is none; int64 for `run`; objects (str) for text.
        units: name -> unit; "" for text and `run`.
        parameters, figures: names of their columns.
        runs: number of runs of the study.
        provenance: what the rows come from, plain values.
    """

    columns: Mapping[str, NDArray[Any]]
    units: Mapping[str, str]
    parameters: tuple[str, ...]
    figures: tuple[str, ...]
    runs: int
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __getitem__(self, name: str) -> NDArray[Any]:
        if name not in self.columns:
            raise InputError(f"no column {name!r}{did_you_mean(name, [*self.columns])}")
        return self.columns[name]

    def __len__(self) -> int:
        return len(self.columns["run"])

    def unit(self, name: str) -> str:
        """Unit of a column; "" for text."""
        return self.units.get(name, "")

    def label(self, name: str) -> str:
        """Head of a column: "XZ.G [m]"."""
        unit = self.unit(name)
        return f"{name} [{unit}]" if unit else name

    def to_pandas(self) -> pandas.DataFrame:
        """A DataFrame with a row per run; units in ``.attrs["units"]``. Raises InputError where pandas is missing."""
        table = need("pandas", "a DataFrame").DataFrame(dict(self.columns))
        table.attrs["units"] = dict(self.units)
        return table

    def __repr__(self) -> str:
        failed = len(self) - int(self.ok.sum())
        return (
            f"Table: {len(self)} of {self.runs} runs{f', {failed} failed' * bool(failed)}; "
            f"parameters {', '.join(self.parameters)}; {len(self.figures)} figures"
        )

    @property
    def ok(self) -> NDArray[np.bool_]:
        """(rows,) whether the run is done without a failure."""
        return np.asarray(self.columns["status"] == OK, dtype=np.bool_)

    @property
    def partial(self) -> bool:
        """Whether runs are missing."""
        return len(self) < self.runs


def table_of(
    design: Design,
    done: Iterable[int],
    outcomes: Iterable[Outcome],
    figures: Sequence[str] | None,
    provenance: Mapping[str, Any],
) -> Table:
    """The table of the runs that are `done`; their outcomes may come in any order, those of other runs are left out.
    `figures`: patterns; None: all.

    InputError: a pattern matches none of the figures.
    """
    runs = np.array(sorted(done), dtype=np.int64)
    rows = len(runs)
    place = np.full(design.runs, -1, dtype=np.int64)
    place[runs] = np.arange(rows)
    result: dict[str, NDArray[np.float64]] = {}
    units: dict[str, str] = {}
    first: dict[str, tuple[int, int]] = {}  # figure -> the first run that has it, and where in it
    status, message, warnings = (np.full(rows, text, dtype=object) for text in (OK, "", ""))
    seconds = np.full(rows, np.nan)
    for outcome in outcomes:
        row = place[outcome.run]
        if row < 0:  # counts from the end
            continue
        seconds[row] = outcome.seconds
        warnings[row] = _in_one_line(outcome.warnings)
        if outcome.figures is None:
            status[row], message[row] = FAILED, _in_one_line([outcome.error or "failed"])
            continue
        for i, (name, (value, unit)) in enumerate(outcome.figures.items()):
            if name not in result:
                result[name] = np.full(rows, np.nan)
                units[name] = unit
            first[name] = min(first.get(name, (design.runs, 0)), (outcome.run, i))
            result[name][row] = value
    names = chosen(sorted(result, key=first.__getitem__), figures) if result else []
    columns: dict[str, NDArray[Any]] = {"run": runs}
    for i, parameter in enumerate(design.parameters):
        columns[parameter.name] = _parameter_column(parameter, design.values[runs, i])
    columns |= {name: result[name] for name in names}
    columns |= {"status": status, "message": message, "warnings": warnings, "seconds": seconds}
    heads = {parameter.name: parameter.unit for parameter in design.parameters}
    return Table(
        columns,
        {"run": "", **heads, **{name: units[name] for name in names}}
        | dict.fromkeys(LAST_COLUMNS, "")
        | {"seconds": "s"},
        tuple(heads),
        tuple(names),
        design.runs,
        provenance,
    )


def chosen(names: Sequence[str], patterns: Sequence[str] | None) -> list[str]:
    """Figures that match any of the patterns; InputError for a pattern that matches none."""
    if patterns is None:
        return [*names]
    for pattern in patterns:
        if not any(matches(name, pattern) for name in names):
            raise InputError(f"figures: {pattern!r} is none of the figures{did_you_mean(pattern, [*names])}")
    return [name for name in names if any(matches(name, pattern) for pattern in patterns)]


def _parameter_column(parameter: Parameter, values: NDArray[np.float64]) -> NDArray[Any]:
    if not parameter.worded:
        return values.copy()
    labels = np.array([choice.label for choice in parameter.choices], dtype=object)
    return labels[values.astype(np.int64)]


def _in_one_line(texts: Sequence[str]) -> str:
    """Texts as a cell that is one line."""
    return " | ".join(" ".join(text.split()) for text in texts)


def write_table(table: Table, path: str | Path) -> None:
    """Write a table, whole or not at all: .csv or .parquet.

    The same rows give the same bytes, the column of seconds aside. OutputError: it cannot be written; InputError: no
    such format, or pyarrow is missing.
    """
    path = Path(path)
    if path.suffix == ".parquet":
        _write_parquet(table, path)
    elif path.suffix == ".csv":
        with written_whole(path) as file:
            text = io.TextIOWrapper(file, encoding="utf-8", newline="")
            write_rows(text, _rows(table))
            text.detach()
    else:
        raise InputError(f"{path}: a table is written as .csv or .parquet")


def read_table(path: str | Path) -> Table:
    """Read a table from its file, or from the folder of a study.

    What the study was comes from the file's metadata (Parquet) or the study.json beside it; without that, the columns
    between `run` and `status` all count as figures. InputError: no table, or one that cannot be read.
    """
    path = Path(path)
    if path.is_dir():
        paths = [path / f"{STEM}.{kind}" for kind in ("parquet", "csv") if (path / f"{STEM}.{kind}").is_file()]
        if not paths:
            raise InputError(f"{path}: no {STEM}.csv and no {STEM}.parquet in this folder")
        path = max(paths, key=lambda file: file.stat().st_mtime_ns)
    if not path.is_file():
        raise InputError(no_such_file(path))
    return _read_parquet(path) if path.suffix == ".parquet" else _read_csv(path)


def record_of(directory: Path) -> dict[str, Any]:
    """study.json of a folder: how its runs were made; empty where there is none, or none that can be read."""
    try:
        result = json_file(directory / RECORD)
    except InputError:
        return {}
    return result if isinstance(result, dict) else {}


def parquet() -> Any:
    """pyarrow. Raises MissingPackage."""
    need("pyarrow.parquet", "Parquet (--format csv does without)")
    return need("pyarrow", "Parquet")


def _rows(table: Table) -> Iterator[list[str]]:
    yield [table.label(name) for name in table.columns]
    # A row at a time: of many columns as text only one is held.
    for row in zip(*table.columns.values(), strict=True):
        yield [_cell(value) for value in row]


def _cell(value: Any) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, np.integer):
        return str(int(value))
    number = float(value)
    return "" if np.isnan(number) else repr(number)


def _read_csv(path: Path) -> Table:
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = named_columns([row for row in read_rows(file) if row])
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path} cannot be read: {error}") from None
    if not rows or "run" not in rows[0] or "status" not in rows[0]:
        raise InputError(f"{path}:1: not the table of a study: it has no columns run and status")
    heads = [_head(text) for text in rows[0]]
    names = [name for name, _ in heads]
    if doubled := twice(names):
        raise InputError(f"{path}:1: two columns are called {doubled[0]!r}")
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != len(heads):
            raise InputError(f"{path}:{number}: {len(row)} cells, {len(heads)} columns")
    columns: dict[str, NDArray[Any]] = {}
    for i, (name, unit) in enumerate(heads):
        cells = [row[i] for row in rows[1:]]
        try:
            if name == "run":
                columns[name] = np.array([int(cell) for cell in cells], dtype=np.int64)
            elif unit:
                columns[name] = np.array([float(cell) if cell else np.nan for cell in cells], dtype=np.float64)
            else:
                columns[name] = np.array(cells, dtype=object)
        except (ValueError, OverflowError) as error:
            raise InputError(f"{path}: column {name!r}: {error}") from None
    return _read_table(columns, dict(heads), record_of(path.parent))


def _head(text: str) -> tuple[str, str]:
    match = _HEADER.fullmatch(text)
    return (match[1], match[2] or "") if match else (text, "")


def _read_table(columns: dict[str, NDArray[Any]], units: dict[str, str], record: Mapping[str, Any]) -> Table:
    between = [name for name in columns if name not in FIRST_COLUMNS + LAST_COLUMNS]
    listed = record.get("parameters")
    entries = listed if isinstance(listed, list) else []
    parameters = [entry["name"] for entry in entries if isinstance(entry, dict) and "name" in entry]
    known = tuple(name for name in between if name in parameters)
    sampling = record.get("sampling")
    runs = sampling.get("runs") if isinstance(sampling, dict) else None
    figures = tuple(name for name in between if name not in known)
    runs = runs if isinstance(runs, int) else 0
    return Table(columns, units, known, figures, runs or len(columns["run"]), record)


def _write_parquet(table: Table, path: Path) -> None:
    arrow = parquet()
    fields, arrays = [], []
    for name, values in table.columns.items():
        kind = arrow.string() if values.dtype == object else arrow.int64() if name == "run" else arrow.float64()
        fields.append(arrow.field(name, kind, metadata={"unit": table.unit(name)}))
        # NaN means that there is no value, which Parquet says as null.
        arrays.append(arrow.array(values, kind, from_pandas=True))
    content = json.dumps(dict(table.provenance), ensure_ascii=False, sort_keys=True)
    whole = arrow.Table.from_arrays(arrays, schema=arrow.schema(fields, metadata={_KEY: content}))
    try:
        with written_whole(path) as file:
            arrow.parquet.write_table(whole, file)
    except arrow.ArrowException as error:
        raise OutputError(f"{path} cannot be written: {error}") from None


def _read_parquet(path: Path) -> Table:
    arrow = parquet()
    try:
        whole = arrow.parquet.read_table(path)
    except (OSError, arrow.ArrowException) as error:
        raise InputError(f"{path} cannot be read: {error}") from None
    if not {"run", "status"} <= set(whole.column_names):
        raise InputError(f"{path}: not the table of a study: it has no columns run and status")
    columns: dict[str, NDArray[Any]] = {}
    units: dict[str, str] = {}
    try:
        for column in whole.schema:
            values = whole.column(column.name)
            if arrow.types.is_string(column.type):
                columns[column.name] = np.array(values.to_pylist(), dtype=object)
            else:
                of_kind = np.int64 if column.name == "run" else np.float64
                columns[column.name] = np.asarray(values.to_numpy(), dtype=of_kind)
            units[column.name] = (column.metadata or {}).get(b"unit", b"").decode()
    except (ValueError, TypeError, KeyError, OverflowError, arrow.ArrowException) as error:
        raise InputError(f"{path}: cannot be read as the table of a study: {error}") from None
    try:
        record = json_value((whole.schema.metadata or {}).get(_KEY, b"{}"), str(path))
    except InputError:
        record = {}
    return _read_table(columns, units, record)
