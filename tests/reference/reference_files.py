"""Files of a reference case, after the FMI cross-check rules 4.1: <case>_in.csv, <case>_ref.csv and <case>_ref.opt.

CSV: first column "time" [s], double-quoted header of exact variable names, no row of units. Inputs run linearly between
the rows. An addition to the rules: <case>_par.csv with the columns "name","value" sets parameters.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

HERE = Path(__file__).parent
UNITS = ("friction", "plant", "controller")

Table = dict[str, NDArray[np.float64]]


@dataclass(frozen=True)
class Case:
    """One reference case; times in s, tables by variable name with a column "time"."""

    unit: str
    name: str
    stop: float
    step: float
    rel_tol: float
    inputs: Table
    parameters: Mapping[str, float] = field(default_factory=dict)
    reference: Table = field(default_factory=dict)


def _write_table(path: Path, table: Table) -> None:
    # 15 digits: 1e-15 m on a position of 1 m, below what two ways of computing it agree to
    header = ",".join(f'"{name}"' for name in table)
    rows = (",".join(format(value + 0.0, ".15g") for value in row) for row in zip(*table.values(), strict=True))
    path.write_text("\n".join([header, *rows]) + "\n", encoding="ascii", newline="\n")


def _read_table(path: Path) -> Table:
    with path.open(encoding="ascii", newline="") as stream:
        rows = list(csv.reader(stream))
    values = np.array(rows[1:], dtype=float)
    return {name: values[:, i] for i, name in enumerate(rows[0])}


def write_inputs(case: Case, root: Path = HERE) -> Case:
    """Write the inputs; return the case with the inputs as they stand in the file, rounded to its digits."""
    directory = root / case.unit
    directory.mkdir(exist_ok=True)
    path = directory / f"{case.name}_in.csv"
    _write_table(path, case.inputs)
    parameters = directory / f"{case.name}_par.csv"
    if case.parameters:
        lines = [f'"{name}",{value!r}' for name, value in case.parameters.items()]
        parameters.write_text("\n".join(['"name","value"', *lines]) + "\n", encoding="ascii", newline="\n")
    else:
        parameters.unlink(missing_ok=True)
    options = {"StartTime": 0.0, "StopTime": case.stop, "StepSize": case.step, "RelTol": case.rel_tol}
    text = "".join(f"{key},{value!r}\n" for key, value in options.items())
    (directory / f"{case.name}_ref.opt").write_text(text, encoding="ascii", newline="\n")
    return Case(case.unit, case.name, case.stop, case.step, case.rel_tol, _read_table(path), case.parameters)


def write_reference(case: Case, reference: Table, root: Path = HERE) -> None:
    """Write the reference results of a case."""
    _write_table(root / case.unit / f"{case.name}_ref.csv", reference)


def read_case(unit: str, name: str, root: Path = HERE) -> Case:
    """Read a whole case back."""
    directory = root / unit
    lines = (directory / f"{name}_ref.opt").read_text(encoding="ascii").split()
    options = {key: float(value) for key, value in (line.split(",") for line in lines)}
    parameters: dict[str, float] = {}
    path = directory / f"{name}_par.csv"
    if path.exists():
        with path.open(encoding="ascii", newline="") as stream:
            parameters = {row["name"]: float(row["value"]) for row in csv.DictReader(stream)}
    return Case(
        unit,
        name,
        options["StopTime"],
        options["StepSize"],
        options["RelTol"],
        _read_table(directory / f"{name}_in.csv"),
        parameters,
        _read_table(directory / f"{name}_ref.csv"),
    )


def case_names(unit: str, root: Path = HERE) -> list[str]:
    """Names of the pinned cases of a unit."""
    return sorted(path.name.removesuffix("_ref.csv") for path in (root / unit).glob("*_ref.csv"))
