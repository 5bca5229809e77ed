"""The table of a study: a row for every run, with the values of its parameters and its figures."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feedsim.errors import InputError
from feedsim.fields import did_you_mean
from feedsim.scenario import Parameter
from feedsim.sweep.design import Design
from feedsim.sweep.task import Outcome
from feedsim.trace import matches

OK, FAILED = "ok", "failed"
FIRST, LAST = ("run",), ("status", "message", "warnings", "seconds")


@dataclass(frozen=True, eq=False)
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
    found: dict[str, NDArray[np.float64]] = {}
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
            if name not in found:
                found[name] = np.full(rows, np.nan)
                units[name] = unit
            first[name] = min(first.get(name, (design.runs, 0)), (outcome.run, i))
            found[name][row] = value
    names = chosen(sorted(found, key=first.__getitem__), figures) if found else []
    columns: dict[str, NDArray[Any]] = {"run": runs}
    for i, parameter in enumerate(design.parameters):
        columns[parameter.name] = _parameter_column(parameter, design.values[runs, i])
    columns |= {name: found[name] for name in names}
    columns |= {"status": status, "message": message, "warnings": warnings, "seconds": seconds}
    heads = {parameter.name: parameter.unit for parameter in design.parameters}
    return Table(
        columns,
        {"run": "", **heads, **{name: units[name] for name in names}} | dict.fromkeys(LAST, "") | {"seconds": "s"},
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
