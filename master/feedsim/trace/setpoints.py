"""Recorded position setpoints: columns of a CSV file in any unit -> positions of axes in SI."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from feedsim import units
from feedsim.errors import InputError
from feedsim.trace.csv import read_csv
from feedsim.trace.trace import Trace

FEWEST_ROWS = 4  # a cubic needs them


def read_setpoints(
    path: str | Path,
    columns: Mapping[str, tuple[str, str | None]],
    *,
    time: tuple[str, str | None] = ("time", None),
    between: tuple[float, float] | None = None,
) -> Trace:
    """Positions over time from a recording.

    columns  axis -> (column name, unit or None for that of the header)
    time     (column name, unit or None); without any unit: s
    between  part to read, first and last recorded time [s]

    Returns a trace with a column [m] per axis whose time begins at 0. Raises InputError: what read_csv() refuses, a
    unit that is missing, contradicts the header or is no length, fewer than 4 rows in the part.
    """
    path = Path(path)
    time_name, time_unit = time
    names = dict.fromkeys(name for name, _ in columns.values())
    trace = read_csv(path, columns=names, time=time_name, time_unit=time_unit)
    whole = trace
    if between is not None:
        trace = trace.between(*between)
    if len(trace) < FEWEST_ROWS:
        part = f" between {between[0]:.9g} and {between[1]:.9g} s" if between else ""
        raise InputError(
            f"{path}: {len(trace)} row{'s'[: len(trace) != 1]}{part}; at least {FEWEST_ROWS} are needed "
            f"(the file runs from {whole.time[0]:.9g} to {whole.time[-1]:.9g} s)"
        )
    values = {}
    for axis, (name, unit) in columns.items():
        known = trace.unit(name)
        if unit and known and units.unit(unit).factor != units.unit(known).factor:
            raise InputError(f"{path}:1: column {name!r} is in {known} by its header, in {unit} by the scenario")
        if not (given := unit or known):
            raise InputError(
                f"{path}:1: column {name!r} has no unit; write '{name} [mm]' in the header or give the unit"
            )
        try:
            factor = units.factor(given, "m")
        except InputError as error:
            raise InputError(f"{path}:1: column {name!r}: {error}") from None
        values[axis] = trace[name] * float(factor)
    return Trace(np.asarray(trace.time - trace.time[0]), values, dict.fromkeys(values, "m"))
