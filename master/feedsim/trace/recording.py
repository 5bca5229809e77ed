"""A recorded file as it is: the columns of a CSV file or the variables of a MAT file, read when they are asked for."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from feedsim.errors import InputError
from feedsim.trace.csv import Table, read_table
from feedsim.trace.mat import Variables, read_mat
from feedsim.trace.numbers import Decimal, decimal_mark, numbers
from feedsim.trace.trace import Array, suggest

MAT = ".mat"


@dataclass(frozen=True, eq=False)
class Recording:
    """What a file holds.

    Attributes:
        path: the file.
        names: its columns: of a CSV file without their units, of a MAT file its vectors.
        units: column -> unit as the header has it; "" where it tells none, as always in MAT files.
        scalars: numbers that stand beside the columns (MAT).
    """

    path: Path
    names: tuple[str, ...]
    units: Mapping[str, str]
    scalars: Mapping[str, float] = field(default_factory=dict)
    _table: Table | None = None
    _variables: Variables | None = None

    def read(self, names: Iterable[str]) -> dict[str, Array]:
        """Values of columns, all of one length.

        Raises InputError with file and line (element, in MAT files): no such column, a cell that is empty, NaN or no
        number, decimal marks that are not clear; variables of different lengths.
        """
        wanted = list(dict.fromkeys(names))
        for name in wanted:
            if name not in self.names:
                raise InputError(f"{self.header}: no column {name!r}{suggest(name, self.names)}")
        if self._table is not None:
            return _cells(self._table, wanted)
        assert self._variables is not None
        values = {name: self._variables.vector(name) for name in wanted}
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
        hint = "" if self._variables is not None else "; a CSV file has none, write the number itself"
        raise InputError(f"{self.path}: no variable {name!r}{hint or suggest(name, self.scalars)}")

    @property
    def header(self) -> str:
        """Where the columns are named, for messages: "file.csv:1"."""
        return str(self.path) if self._table is None else f"{self._table.where}:{self._table.header_line}"

    def row(self, index: int) -> str:
        """Where a row stands, counted from 0: "file.csv:17" or "file.mat, element 16"."""
        if self._table is None:
            return f"{self.path}, element {index + 1}"
        return f"{self._table.where}:{self._table.lines[index]}"


def read_recording(path: str | Path) -> Recording:
    """Look into a CSV or MAT file (told by its ending .mat). InputError: what read_csv() and read_mat() refuse."""
    path = Path(path)
    if path.suffix.lower() == MAT:
        variables = read_mat(path)
        if not variables.vectors:
            there = f"; there is {', '.join(variables.kinds.values())}" if variables.kinds else ""
            raise InputError(f"{path}: no variable is a vector of real numbers{there}")
        return Recording(
            path, variables.vectors, dict.fromkeys(variables.vectors, ""), variables.scalars, _variables=variables
        )
    table = read_table(path)
    # A bracket with digits alone is the index of a parameter, r0078[0], not a unit.
    units = ["" if unit.isdecimal() else unit for unit in table.units]
    return Recording(path, table.names, dict(zip(table.names, units, strict=True)), _table=table)


def _cells(table: Table, names: list[str]) -> dict[str, Array]:
    columns = {name: table.columns[table.index(name)] for name in names}
    mark: Decimal = "."
    if table.decimal_comma:
        mark = decimal_mark(list(columns.values()), table.lines, table.where)
    return {name: np.asarray(numbers(cells, mark, table.lines, table.where, name)) for name, cells in columns.items()}
