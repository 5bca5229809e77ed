"""Position in open loop: what the step found, for page, summary.json and CSV."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np

from feedsim.identify.friction_file import change_text
from feedsim.identify.result import Balance, Identification
from feedsim.report.formatting import minus, typeset
from feedsim.report.tables import table
from feedsim.trace.csv import quoted, shortest

METHOD = (
    "Driven by the recorded torque, a rigid axis with this friction drifts away from the recorded position: what is "
    "wrong all through the record shows there, and is lost in the residual of the torque. Constant load M_0 and "
    "Coulomb friction F_C are therefore taken from the position in open loop, F_S moves with F_C."
)


def open_loop_section(found: Identification) -> str:
    """HTML: applied or refused and why; position, torque and parameters before and after."""
    balance = found.balance
    if balance is None:
        return ""
    verdict = "Applied: the values above hold it." if balance.applied else f"Not applied: {balance.reason}."
    head = f'<h2 id="position-in-open-loop">Position in open loop</h2>\n<p>{escape(typeset(verdict))}</p>'
    note = f'<p class="muted">{escape(METHOD)}</p>'
    if not balance.drifts:
        return head + note
    mm = 1e3 * found.I_P
    rows = [
        _row("Error of the position, rms", balance.position, "rad", mm, "mm", change_text(*balance.position)),
        _row("Residual of the torque, rms", balance.torque, "N·m", 1 / found.I_P, "N", change_text(*balance.torque)),
    ]
    for name, pair in balance.changes.items():
        change = f"{pair[1] - pair[0]:+.3g} N·m" if name == "M_0" else change_text(*pair)
        rows.append(_row(f"<code>{name}</code>", pair, "N·m", 1 / found.I_P, "N", change))
    last = "After" if balance.applied else "Tried"
    heads = [
        ("", False), ("Before", True), (last, True), ("Unit", False), ("At the slide before", True),
        (last.lower(), True), ("Unit", False), ("Change", True),
    ]  # fmt: skip
    return head + table(heads, rows) + note


def open_loop_part(found: Identification) -> dict[str, Any] | None:
    """For summary.json; None where the step was not asked for."""
    balance = found.balance
    if balance is None:
        return None
    return {
        "applied": balance.applied,
        "applies": balance.applies,
        "reason": balance.reason,
        "records": list(balance.records),
        "position": {
            **_pair(balance.position, "rad"),
            "meaning": "rms of recorded less reached angle, with the values before and with those found",
            "at_slide": _pair((balance.position[0] * found.I_P, balance.position[1] * found.I_P), "m"),
        },
        "torque": {**_pair(balance.torque, "N.m"), "meaning": "rms of the torque residual"},
        "changes": {name: _pair(pair, "N.m") for name, pair in balance.changes.items()},
    }


def open_loop_csv(balance: Balance) -> str:
    """Recorded angle from the start on, and its error in open loop before and after, record after record."""
    lines = ["record,time [s],angle [rad],error before [rad],error after [rad]"]
    for drift in balance.drifts:
        columns: Sequence[Any] = (drift.time, drift.angle, drift.before, drift.after)
        texts = [shortest(np.asarray(values)) for values in columns]
        head = quoted(drift.record)
        lines += [f"{head},{','.join(row)}" for row in zip(*texts, strict=True)]
    return "\n".join(lines) + "\n"


def _row(name: str, pair: tuple[float, float], unit: str, factor: float, unit_there: str, change: str) -> str:
    here = "".join(f'<td class="number">{minus(f"{value:.4g}")}</td>' for value in pair)
    there = "".join(f'<td class="number">{minus(f"{factor * value:.4g}")}</td>' for value in pair)
    return (
        f"<tr><td>{name}</td>{here}<td>{unit}</td>{there}<td>{unit_there}</td>"
        f'<td class="number">{minus(change)}</td></tr>'
    )


def _pair(pair: tuple[float, float], unit: str) -> dict[str, Any]:
    before, after = (float(value) if math.isfinite(value) else None for value in pair)
    return {"before": before, "after": after, "unit": unit}
