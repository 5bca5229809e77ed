"""Captures of a SINUMERIK control that are made up: axes that go to and fro with a known inertia and friction."""

from __future__ import annotations

from typing import Any

import numpy as np

CYCLE = 0.002
SIGNALS = ("DES_POS", "ENC_POS", "CMD_SPEED", "TORQUE", "CURRENT", "POWER")
ROWS = 1000


def axis_signals(pitch: float, sign: int, amplitude: float = 100.0, per_minute: bool = False) -> dict[str, Any]:
    """An axis that goes to and fro at 1 Hz by `amplitude` mm, J = 0.02 kg.m2, F_C = 3 N.m; its torque and the
    speed of its motor count in `sign` times the position's direction."""
    t = CYCLE * np.arange(ROWS)
    x = amplitude * np.sin(2 * np.pi * t)
    v = amplitude * 2 * np.pi * np.cos(2 * np.pi * t)  # mm/s
    turning = 2 * np.pi * v / pitch
    torque = 0.02 * np.gradient(turning, t) + 3.0 * np.sign(turning)
    return {
        "DES_POS": x, "ENC_POS": x, "CMD_SPEED": v * (60 if per_minute else 1), "TORQUE": sign * torque,
        "CURRENT": sign * torque / 1.4, "POWER": torque * turning,
    }  # fmt: skip


def content(axes: dict[str, dict[str, Any]], counter: Any = None) -> dict[str, Any]:
    """A capture of axes, called name|number."""
    counter = 5000 + np.arange(ROWS) if counter is None else counter
    listed = [{"Name": "CYCLE", "Type": "INTEGER", "Axis": "Cycle", "Address": "CYCLE"}]
    columns = [counter]
    for called, signals in axes.items():
        name, _, number = called.partition("|")
        for signal, values in signals.items():
            listed.append({"Name": signal, "Type": "DOUBLE", "Axis": name, "Address": f"{signal}|{number}"})
            columns.append(values)
    rows = [[int(row[0]), *(float(cell) for cell in row[1:])] for row in zip(*columns, strict=True)]
    block = {"HFProbeCounter": int(counter[0]) + 50, "GCode": "N10 G0 Y100 "}
    return {
        "Header": {"SignalListHFData": listed, "CycleTimeMs": 2},
        "Payload": [{"HFData": rows[:400]}, {"HFBlockEvent": block}, {"HFData": rows[400:]}, {"LFData": []}],
    }
