"""Setpoint unit's reference: its own table, looked up in whole microseconds."""

from __future__ import annotations

import csv

import numpy as np
from reference_files import HERE, Case, Table

TABLE = HERE.parents[1] / "src" / "setpoint_fmu" / "resources" / "setpoints.csv"


def solve(case: Case, every: float, outputs: tuple[str, ...]) -> Table:
    """The named outputs every `every` seconds: the row whose cycle has begun, the last one from then on."""
    with TABLE.open(encoding="ascii", newline="") as stream:
        header, *rows = csv.reader(stream)
    names = [name.partition(" [")[0] for name in header]
    micro = [round(float(row[0]) * 1e6) for row in rows]
    step, count = round(every * 1e6), round((case.stop - case.start) / every)
    elapsed = [i * step for i in range(count + 1)]
    last = [max(sum(begun <= now for begun in micro) - 1, 0) for now in elapsed]
    table: Table = {"time": np.array([round(case.start + now * 1e-6, 9) for now in elapsed])}
    for j, name in enumerate(names[1:], 1):
        table[name] = np.array([float(rows[i][j]) for i in last])
    table["finished"] = np.array([float(i == len(rows) - 1) for i in last])
    table["row"] = np.array(last, dtype=np.float64)
    return {name: table[name] for name in ("time", *outputs)}
