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
from math import comb, exp, lgamma
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from feedsim.design.sweep.design import Array, Design, Outcome
from feedsim.files.fields import did_you_mean
from feedsim.files.sheets import read_rows, write_rows
from feedsim.files.source import json_file, json_value
from feedsim.files.trace import matches
from feedsim.files.trace.cells import duplicate_names, named_columns
from feedsim.files.trace.files import written_whole
from feedsim.foundation.errors import Finding, InputError, OutputError, no_such_file
from feedsim.foundation.installation import require_module
from feedsim.scenario.study import Parameter

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
        findings: run -> what there is to say of it; none where the table was read from a file.
    """

    columns: Mapping[str, NDArray[Any]]
    units: Mapping[str, str]
    parameters: tuple[str, ...]
    figures: tuple[str, ...]
    runs: int
    provenance: Mapping[str, Any] = field(default_factory=dict)
    findings: Mapping[int, tuple[Finding, ...]] = field(default_factory=dict)

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
        table = require_module("pandas", "a DataFrame").DataFrame(dict(self.columns))
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
    seconds, findings = np.full(rows, np.nan), dict[int, tuple[Finding, ...]]()
    for outcome in outcomes:
        row = place[outcome.run]
        if row < 0:  # counts from the end
            continue
        seconds[row] = outcome.seconds
        warnings[row] = in_one_line([finding.marked for finding in outcome.warnings])
        if outcome.warnings:
            findings[outcome.run] = outcome.warnings
        if outcome.figures is None:
            status[row], message[row] = FAILED, in_one_line([outcome.error or "failed"])
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
        {run: findings[run] for run in sorted(findings)},
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


def in_one_line(texts: Sequence[str]) -> str:
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
    require_module("pyarrow.parquet", "Parquet (--format csv does without)")
    return require_module("pyarrow", "Parquet")


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
    if doubled := duplicate_names(names):
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


# --- Failed runs by message, and the parameters whose values show where they lie --------------------------------------


# Chance that any parameter at all is named though the runs failed wherever they did.
LEVEL = 0.05
NUMBERS = 4  # tests of a numeric parameter: span, lower end, upper end, tendency
FEW_LEVELS = 12  # distinct values up to which a parameter is looked at level by level

Rows = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class SeparatingParameter:
    """A parameter whose values separate failed runs from those that are done.

    Attributes:
        parameter: its place in the design.
        values: of the failed runs: those that occur, where `by_level`; else the least and the greatest.
        failed, there: how many of the runs with these values, or between them, failed so, and how many there are.
        medians: of the failed and of the done runs, where the range does not show the tendency; else None.
    """

    parameter: int
    by_level: bool
    values: Array
    failed: int
    there: int
    medians: tuple[float, float] | None = None


@dataclass(frozen=True)
class Failure:
    """Runs that failed alike: an example of their message, their numbers, and where they lie, the surest first."""

    message: str
    runs: tuple[int, ...]
    where: tuple[SeparatingParameter, ...]


def failures(table: Table, design: Design) -> tuple[Failure, ...]:
    """Failed runs by message, numbers in it aside; the most frequent first."""
    runs = np.asarray(table["run"], dtype=np.int64)
    messages = [str(text) for text in table["message"]]
    groups: dict[str, list[int]] = {}
    for row in np.flatnonzero(~table.ok):
        groups.setdefault(shape(messages[row]), []).append(int(row))
    result = []
    for rows in sorted(groups.values(), key=lambda rows: (-len(rows), rows[0])):
        here = np.zeros(len(runs), dtype=bool)
        here[rows] = True
        numbers = tuple(int(run) for run in runs[rows])
        result.append(Failure(messages[rows[0]], numbers, _find_separating_parameters(design, runs, here, table.ok)))
    return tuple(result)


def shape(message: str) -> str:
    """A message without its numbers: what is the same for runs that fail alike."""
    return re.sub(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?", "#", message)


def kinds(table: Table) -> Iterator[tuple[tuple[Finding, ...], int]]:
    """Findings of runs, those that differ in numbers only as one: of its first run, and how many runs have them."""
    result: dict[str, tuple[tuple[Finding, ...], int]] = {}
    for findings in table.findings.values():
        alike = shape(in_one_line([finding.marked for finding in findings]))
        first, count = result.get(alike, (findings, 0))
        result[alike] = first, count + 1
    yield from result.values()


def levels(values: Array, *, worded: bool = False) -> Array:
    """Distinct values of a parameter where they are few and come back, or where they are words; else none."""
    result = np.unique(values)
    few = len(result) <= FEW_LEVELS and 2 * len(result) <= len(values)
    return result if worded or few else result[:0]


def _find_separating_parameters(
    design: Design, runs: NDArray[np.int64], here: Rows, ok: Rows
) -> tuple[SeparatingParameter, ...]:
    """The parameters whose values separate the rows `here` from those that are `ok` by more than chance.

    Other failures stay out: what they differ in would be laid at the door of these. Bonferroni's correction for the
    number of parameters and tests.
    """
    drawn = np.isin(runs, design.independent)
    reported: list[tuple[float, str, SeparatingParameter]] = []
    for place, parameter in enumerate(design.parameters):
        values = design.values[runs, place]
        if parameter.worded or len(levels(values)):
            chance = _level_chance(values[drawn], here[drawn], ok[drawn])
            where = _at_levels(place, values, here)
        else:
            chance = _chance(values, here, ok)
            where = _in_range(place, values, here, ok)
        if chance <= LEVEL / len(design.parameters):
            reported.append((chance, parameter.name, where))
    return tuple(value for *_, value in sorted(reported, key=lambda entry: entry[:2]))


def _at_levels(place: int, values: Array, here: Rows) -> SeparatingParameter:
    met = np.unique(values[here])
    return SeparatingParameter(place, True, met, int(here.sum()), int(np.isin(values, met).sum()))


def _in_range(place: int, values: Array, here: Rows, ok: Rows) -> SeparatingParameter:
    low, high = values[here].min(), values[here].max()
    failed, there = int(here.sum()), int(((values >= low) & (values <= high)).sum())
    tendency = 2 * failed < there and ok.any()
    medians = (float(np.median(values[here])), float(np.median(values[ok]))) if tendency else None
    return SeparatingParameter(place, False, np.array([low, high]), failed, there, medians)


def _chance(values: Array, here: Rows, ok: Rows) -> float:
    """Chance that values drawn alike lie as close together, as far to one side, or as much to one side."""
    from scipy.stats import mannwhitneyu

    # Rows of a Sobol design repeat values, which would count as so many independent ones.
    failed = np.unique(values[here])
    passed = np.setdiff1d(values[ok], failed)
    m, n = len(failed), len(failed) + len(passed)
    if m < 2 or m == n:
        return 1.0
    low, high = int((passed < failed[0]).sum()), int((passed > failed[-1]).sum())
    result = (
        span_chance(m, n, n - low - high),
        end_chance(m, n, low),
        end_chance(m, n, high),
        float(mannwhitneyu(failed, passed).pvalue),
    )
    return NUMBERS * min(result)


def span_chance(m: int, n: int, span: int) -> float:
    """Chance that m of n ranks, drawn without replacement, lie within `span` neighbouring ones."""
    # The smallest can stand in n - s + 1 places where they span s; the m - 2 between them are any of s - 2.
    from scipy.special import gammaln

    s = np.arange(m, span + 1)
    ways = gammaln(s - 1) - gammaln(m - 1) - gammaln(s - m + 1)
    return float(np.sum((n - s + 1) * np.exp(ways - _log_choose(n, m))))


def end_chance(m: int, n: int, beyond: int) -> float:
    """Chance that m of n ranks, drawn without replacement, leave the first `beyond` free."""
    return exp(_log_choose(n - beyond, m) - _log_choose(n, m))


def _log_choose(n: int, k: int) -> float:
    return lgamma(n + 1) - lgamma(k + 1) - lgamma(n - k + 1)


def _level_chance(values: Array, here: Rows, ok: Rows) -> float:
    """Chance that all failures meet as few of the values as they do, whichever these are."""
    failed, passed = values[here], values[ok]
    m, n = len(failed), len(failed) + len(passed)
    if not m or m == n:
        return 1.0
    met = np.unique(failed)
    everywhere = np.unique(np.concatenate([failed, passed]))
    inside = m + int(np.isin(passed, met).sum())
    return comb(len(everywhere), len(met)) * exp(_log_choose(inside, m) - _log_choose(n, m))
