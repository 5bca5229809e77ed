"""Position in open loop: what the step found, for terminal, page, summary.json, friction.yaml and CSV."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np

from feedsim.identify.result import Balance, Identification
from feedsim.report.tables import table
from feedsim.report.words import minus, typeset
from feedsim.trace.csv import quoted, shortest

METHOD = (
    "Driven by the recorded torque, a rigid axis with this friction drifts away from the recorded position: what is "
    "wrong all through the record shows there, and is lost in the residual of the torque. Constant load M_0 and "
    "Coulomb friction F_C are therefore taken from the position in open loop, F_S moves with F_C."
)


def open_loop_line(found: Identification) -> str:
    """What the step did, in one line; empty where there is nothing to say: it was not asked for, or all are sines."""
    balance = found.balance
    if balance is None or not balance.applies:
        return ""
    if not balance.applied:
        return f"not applied: {balance.reason}"
    before, after = (1e3 * found.I_P * rms for rms in balance.position)
    parts = [f"position off by {after:.3g} mm rms instead of {before:.3g} mm"]
    if moved := _moved(balance):
        parts.append(", ".join(moved))
    return "; ".join([*parts, f"torque residual {_percent(*balance.torque)}"])


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
        _row("Error of the position, rms", balance.position, "rad", mm, "mm", _percent(*balance.position)),
        _row("Residual of the torque, rms", balance.torque, "N·m", 1 / found.I_P, "N", _percent(*balance.torque)),
    ]
    for name, pair in balance.changes.items():
        change = f"{pair[1] - pair[0]:+.3g} N·m" if name == "M_0" else _percent(*pair)
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


def _moved(balance: Balance) -> list[str]:
    """ "F_C and F_S -1.2 %" and "M_0 +0.0034 N.m", of those that did."""
    words: dict[str, list[str]] = {}
    for name, (before, after) in balance.changes.items():
        if after != before:
            text = f"{after - before:+.3g} N.m" if name == "M_0" else _percent(before, after)
            words.setdefault(text, []).append(name)
    return [f"{' and '.join(names)} {text}" for text, names in words.items()]


def _percent(before: float, after: float) -> str:
    """Change in percent of what was before; empty where that says nothing."""
    if not (math.isfinite(after) and math.isfinite(before) and before > 0):
        return ""
    return f"{100 * (after / before - 1):+.2g} %"


def _pair(pair: tuple[float, float], unit: str) -> dict[str, Any]:
    before, after = (float(value) if math.isfinite(value) else None for value in pair)
    return {"before": before, "after": after, "unit": unit}
