"""friction.yaml of an identification."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from feedsim import units
from feedsim.identify.result import NORMAL_95, Estimate
from feedsim.report.identify.account import Account, interval_text, relative_text, remark_text, value_text
from feedsim.report.identify.open_loop import open_loop_line
from feedsim.report.parts import software
from feedsim.scenario.friction_file import Line, friction_text
from feedsim.scenario.machine import Friction

EXACT = 8  # significant digits of the other values of a group `identified`


def friction_file(account: Account) -> str:
    """Text of friction.yaml. Raises OutputError where the values make no friction, e.g. one beyond its range."""
    names = [name for name in Friction.model_fields if name in account.found.estimates]
    lines = {name: _line(account.found.estimates[name]) for name in names}
    return friction_text(lines, identified(account), _head(account), name=FRICTION)


FRICTION = "friction.yaml"


def constant_load_hint(account: Account) -> str:
    """How to set the constant load, which is no friction; empty where there is none beyond doubt."""
    load = account.found.estimates.get("M_0")
    if load is None or load.status == "held" or not abs(load.value) > NORMAL_95 * np.nan_to_num(load.sigma):
        return ""
    key = f"machine.axes.{account.found.axis}.constant_load"
    interval = f" (95 %: {interval_text(load)})" if interval_text(load) else ""
    text = f"constant load M_0 {value_text(load)} N.m{interval} is no part of the friction"
    lean = account.found.estimates.get("asymmetry")
    if lean is not None and lean.status == "estimated" and abs(lean.value) > NORMAL_95 * lean.sigma:
        text += ", but goes with this asymmetry (either alone is wrong)"
    return f'{text}; set it with {key}="{load.value:.6g} N.m"'


def identified(account: Account) -> dict[str, Any]:
    """The group `identified`: where the values come from, for people and programs."""
    found = account.found
    content: dict[str, Any] = {
        "axis": found.axis,
        "date": account.date,
        "traces": [
            {"file": name, "sha256": source.sha256}
            for name, source in zip(account.traces, account.sources, strict=True)
        ],
    }
    if account.subject is not None:
        content["machine"] = {"name": account.subject.machine.name, "note": account.subject.machine.note}
    if account.settings:
        content["settings"] = dict(account.settings)
    content["lead"] = _quantity(found.I_P, "m/rad")
    named = {"M_0": "constant_load", "J": "inertia", "delay": "delay"}
    for name, key in named.items():
        if (estimate := found.estimates.get(name)) is not None:
            content[key] = {"value": _quantity(estimate.value, estimate.unit), **_interval(estimate)}
    if line := open_loop_line(found):
        content["open_loop"] = line
    content["parameters"] = {
        name: _interval(estimate) for name, estimate in found.estimates.items() if name not in named
    }
    correlation = found.correlation
    if correlation.names:
        content["correlation"] = {
            "names": list(correlation.names),
            "matrix": [[round(float(value), 4) for value in row] for row in correlation.matrix],
        }
    if account.warnings:
        content["warnings"] = account.warnings
    versions = software()
    content["software"] = {name: versions[name] for name in ("feedsim", "python", "numpy", "scipy")}
    return content


def _line(estimate: Estimate) -> Line:
    interval = interval_text(estimate)
    relative = relative_text(estimate)
    spread = f"95 %: {interval}" + (f" (+-{relative})" if relative else "") if interval else ""
    return Line(estimate.value, "; ".join(part for part in (spread, remark_text(estimate)) if part))


def _head(account: Account) -> Sequence[str]:
    axis = account.found.axis
    machine = f" of {account.subject.machine.name}" if account.subject is not None else ""
    lines = [
        f"Friction of axis {axis}{machine}, identified by feedsim {software()['feedsim']} on {account.date} from",
        *(f"  {name}" for name in account.traces),
        *account.notes,
        "Motor side. Behind a value its 95 % confidence interval, from the model linearised at the optimum.",
        f"To use: feedsim run SCENARIO.yaml --set machine.axes.{axis}.friction={FRICTION}",
    ]
    hint = constant_load_hint(account)
    return [*lines, f"The {hint}"] if hint else lines


def _interval(estimate: Estimate) -> Mapping[str, Any]:
    low, high = estimate.interval
    content: dict[str, Any] = {"status": estimate.status}
    if low == low and high == high and abs(low) < float("inf"):  # neither nan nor inf
        content["interval"] = [_quantity(low, estimate.unit), _quantity(high, estimate.unit)]
    return content | ({"reason": estimate.reason} if estimate.reason else {})


def _quantity(value: float, unit: str) -> str | float:
    return float(f"{value:.{EXACT}g}") if unit == units.DIMENSIONLESS else f"{value:.{EXACT}g} {unit}"
