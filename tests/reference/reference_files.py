"""Files of a reference case, after the FMI cross-check rules 4.1: <case>_in.csv, <case>_ref.csv and <case>_ref.opt.

CSV: first column "time" [s], double-quoted header of exact variable names, no row of units. Inputs run linearly between
the rows, Boolean ones keep the value of a row until the next. Additions to the rules: <case>_par.csv with the columns
"name","value" sets parameters; <case>_ref.bounds.csv tells what lies between the rows of
<case>_ref.csv (feedsim.comparison.between); held/<case>_ref.csv is what comes out where the importer holds every input
over a step of StepSize; <case>_modes.csv is a table of modes that the plant takes instead of its archive's (parameter
modes_file).
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feedsim.comparison import thin_series
from feedsim.files.trace import Series

HERE = Path(__file__).parent
UNITS = ("friction", "friction_gms", "plant", "controller", "setpoint")
HELD = "held"
# What the inputs of cases.py are rounded to; speeds, torques and forces elsewhere to 1e-9.
LAST_DIGIT = {"time": 1e-12, "x_s": 1e-12, "x_a": 1e-12, "n_fr": 1e-12}

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
    start: float = 0.0
    held: bool = False  # inputs held over each step, instead of linear between their rows
    modes: Path | None = None  # table of modes that replaces the archive's own

    @property
    def moving(self) -> bool:
        """An input changes, so that holding it over a step makes a difference to a continuous unit."""
        return any(np.ptp(values) > 0 for name, values in self.inputs.items() if name != "time")


def booleans(table: Table, name: str, t: NDArray[np.float64]) -> NDArray[np.float64]:
    """A Boolean column at the times `t`, 0 or 1: it keeps the value of a row until the next one."""
    row = np.searchsorted(table["time"], t + 1e-9, side="right") - 1
    return np.asarray(table[name][row] != 0, dtype=np.float64)


def write_table(path: Path, table: Table, digits: int = 15) -> None:
    """Write a CSV. 15 digits: 1e-15 m on a position of 1 m, below what two ways of computing it agree to."""
    header = ",".join(f'"{name}"' for name in table)
    rows = (",".join(format(value + 0.0, f".{digits}g") for value in row) for row in zip(*table.values(), strict=True))
    path.write_text("\n".join([header, *rows]) + "\n", encoding="ascii", newline="\n")


def read_table(path: Path) -> Table:
    """Read a CSV by its columns."""
    with path.open(encoding="ascii", newline="") as stream:
        rows = list(csv.reader(stream))
    values = np.array(rows[1:], dtype=float)
    return {name: values[:, i] for i, name in enumerate(rows[0])}


def same_but_for_the_last_digit(fresh: Table, path: Path) -> bool:
    """Whether a file holds the inputs `fresh`, give or take one unit of the last digit that cases.py rounds them to.

    That one hangs on the processor where a value lies between two: by the last bit of numpy's sines and powers.
    """
    if (
        not path.exists()
        or list(pinned := read_table(path)) != list(fresh)
        or len(pinned["time"]) != len(fresh["time"])
    ):
        return False
    return all(np.all(np.abs(fresh[n] - kept) <= 1.5 * LAST_DIGIT.get(n, 1e-9)) for n, kept in pinned.items())


def write_inputs(case: Case, root: Path = HERE) -> Case:
    """Write the inputs; return the case with the inputs as they stand in the file, rounded to its digits.

    Pinned ones stay as they are where what is made today is the same but for the last digit.
    """
    directory = root / case.unit
    directory.mkdir(parents=True, exist_ok=True)
    path = directory / f"{case.name}_in.csv"
    if case.inputs:
        pinned = HERE / case.unit / path.name
        write_table(path, read_table(pinned) if same_but_for_the_last_digit(case.inputs, pinned) else case.inputs)
    parameters = directory / f"{case.name}_par.csv"
    if case.parameters:
        lines = [f'"{name}",{value!r}' for name, value in case.parameters.items()]
        parameters.write_text("\n".join(['"name","value"', *lines]) + "\n", encoding="ascii", newline="\n")
    else:
        parameters.unlink(missing_ok=True)
    options = {"StartTime": case.start, "StopTime": case.stop, "StepSize": case.step, "RelTol": case.rel_tol}
    text = "".join(f"{key},{value!r}\n" for key, value in options.items())
    (directory / f"{case.name}_ref.opt").write_text(text, encoding="ascii", newline="\n")
    return replace(case, inputs=read_table(path) if case.inputs else {})


def write_reference(case: Case, dense: Table, every: float, root: Path = HERE) -> None:
    """Write the reference results of a case every `every` seconds, and what lies between; below held/ of held inputs.

    dense: the results at every step.
    """
    directory = root / case.unit / (HELD if case.held else "")
    directory.mkdir(parents=True, exist_ok=True)
    steps = round(every / case.step)
    write_table(directory / f"{case.name}_ref.csv", {name: values[::steps] for name, values in dense.items()})
    write_bounds(directory / f"{case.name}_ref.bounds.csv", dense, steps)


def write_bounds(path: Path, dense: Table, every: int, digits: int = 15) -> None:
    """Write what lies between the rows of a reference that has every `every`-th row of `dense`.

    digits: with which the reference is written; what is below them is none. To three digits, away from 0.
    """
    assert (len(dense["time"]) - 1) % every == 0, f"{path}: the last row would not be kept"
    if every == 1:
        path.unlink(missing_ok=True)
        return
    columns = {name: values for name, values in dense.items() if name != "time"}
    table = {"time": dense["time"][::every]}
    for name, values in thin_series(Series(dense["time"], columns), every)[1].columns.items():
        least = 10.0**-digits * float(np.abs(columns[name.rpartition(".")[0]]).max())
        table[name] = np.array([_outward(value) if abs(value) > least else 0.0 for value in values])
    write_table(path, table)


def _outward(value: float) -> float:
    """A bound to three digits, away from 0."""
    unit = 10.0 ** (math.floor(math.log10(abs(value))) - 2)
    return float(f"{math.copysign(math.ceil(abs(value) / unit) * unit, value):.3g}")


def read_case(unit: str, name: str, root: Path = HERE, *, held: bool = False) -> Case:
    """Read a whole case back, with the results for linear or for held inputs."""
    directory = root / unit
    lines = (directory / f"{name}_ref.opt").read_text(encoding="ascii").split()
    options = {key: float(value) for key, value in (line.split(",") for line in lines)}
    parameters: dict[str, float] = {}
    path = directory / f"{name}_par.csv"
    if path.exists():
        with path.open(encoding="ascii", newline="") as stream:
            parameters = {row["name"]: float(row["value"]) for row in csv.DictReader(stream)}
    inputs, modes = directory / f"{name}_in.csv", directory / f"{name}_modes.csv"
    return Case(
        unit=unit,
        name=name,
        start=options["StartTime"],
        stop=options["StopTime"],
        step=options["StepSize"],
        rel_tol=options["RelTol"],
        inputs=read_table(inputs) if inputs.exists() else {},
        parameters=parameters,
        reference=read_table(directory / (HELD if held else "") / f"{name}_ref.csv"),
        held=held,
        modes=modes if modes.exists() else None,
    )


def case_names(unit: str, root: Path = HERE, *, held: bool = False) -> list[str]:
    """Names of the pinned cases of a unit; with `held`, of those that have results for held inputs."""
    directory = root / unit / (HELD if held else "")
    return sorted(path.name.removesuffix("_ref.csv") for path in directory.glob("*_ref.csv"))


def all_cases(root: Path = HERE) -> list[tuple[str, str, bool]]:
    """Unit, name and `held` of every pinned reference of a unit."""
    return [
        (unit, name, held) for unit in UNITS for held in (False, True) for name in case_names(unit, root, held=held)
    ]
