"""What stands on either side of a comparison: a simulator's CSV, or the record of a drive."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from feedsim.trace import Array, Series

# What a record's signals are called here, and their units.
UNITS = {"x_a": "m", "x_s": "m", "n_a": "rad/s", "M_a": "N.m"}


def read_side(path: Path, time: str | None, mapping: Path | None, options: Namespace) -> Series:
    """Read a file. time: NAME[:UNIT] of its time column; mapping: for a drive's record. InputError."""
    from feedsim.errors import InputError
    from feedsim.trace import read_series

    if mapping is not None:
        return read_record(path, mapping, options.axis, options.machine)
    if path.suffix.lower() == ".mat":
        raise InputError(f"{path}: a MAT file needs a mapping of its columns: --columns or --reference-columns")
    return read_series(path, time=time)


def read_record(path: Path, mapping: Path, axis: str | None, machine: Path | None) -> Series:
    """The record of an axis A as A.x_a, A.n_a, A.M_a and A.x_s, as far as it holds them.

    Between the pieces of a record with gaps stands a row without numbers, so that nothing is compared there.
    """
    import numpy as np

    from feedsim.errors import InputError
    from feedsim.identify.read import read_records
    from feedsim.scenario import load_columns, load_subject
    from feedsim.trace import Series

    subject = load_subject(machine) if machine is not None else None
    found = read_records(path, load_columns(mapping), axis, subject.machine if subject else None)
    told = found.provenance
    named = told.axis or axis
    if not named:
        raise InputError(f"{path}: the record does not tell which axis it is of; give --axis, for example --axis Z")
    lead = None if told.pitch is None else told.pitch / (2 * np.pi)
    pieces: dict[str, list[Array]] = {"time": []}
    for i, record in enumerate(found.records):
        columns = {"time": record.time, "n_a": record.speed, "M_a": record.torque}
        if lead is not None:
            columns["x_a"] = None if record.angle is None else record.angle * lead
            columns["x_s"] = None if record.setpoint is None else record.setpoint * lead
        for name, values in columns.items():
            if values is None:
                continue
            parts = pieces.setdefault(name, [])
            if i:
                gap = 0.5 * (found.records[i - 1].time[-1] + record.time[0])
                parts.append(np.array([gap if name == "time" else np.nan]))
            parts.append(values)
    joined = {name: np.concatenate(parts) for name, parts in pieces.items()}
    time = joined.pop("time")
    return Series(
        time,
        {f"{named}.{name}": values for name, values in joined.items()},
        {f"{named}.{name}": UNITS[name] for name in joined},
    )
