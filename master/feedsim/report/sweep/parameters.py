"""Table of what was varied in a study: keys, distributions with their numbers, and what was drawn."""

from __future__ import annotations

from html import escape
from math import isfinite

from feedsim.report.formatting import minus, number
from feedsim.report.sweep.account import Account, Input
from feedsim.report.tables import table


def parameters_section(account: Account) -> str:
    """The parameters, in their order."""
    rows = []
    for each in account.inputs:
        if each.words:
            span = ", ".join(each.words)
        elif len(each.values):
            span = f"{number(each.values.min())} to {number(each.values.max())}"
        else:
            span = ""
        keys = "<br>".join(f"<code>{escape(key)}</code>" for key in each.parameter.keys)
        rows.append(
            f"<tr><td>{escape(each.name)}</td><td>{keys}</td><td>{escape(law(each))}</td>"
            f"<td>{escape(minus(span))}</td><td>{escape(each.scale.shown_unit)}</td></tr>"
        )
    heads = [("Parameter", False), ("Key", False), ("Distribution", False), ("Drawn", False), ("Unit", False)]
    return '<h2 id="parameters">Parameters</h2>\n' + table(heads, rows)


def law(each: Input) -> str:
    """What a parameter is distributed like: "factor, normal, mean 1, deviation 0.07, from 0.85, to 1.2"."""
    found = each.parameter.distribution
    told = ["factor"] if each.parameter.factor else []
    if found is None:
        return ", ".join([*told, f"one of {len(each.parameter.choices)} values"])

    def say(word: str, value: float | None) -> None:
        if value is not None and isfinite(value):
            told.append(f"{word} {number(value * each.scale.factor)}")

    told.append(found.kind)
    say("mean", found.mean)
    say("deviation", found.deviation)
    say("from", found.low)
    if found.kind == "triangular":
        low, high = found.support
        say("mode", (low + high) / 2 if found.mode is None else found.mode)
    say("to", found.high)
    if found.count is not None:
        told.append(f"{found.count} values")
    return ", ".join(told)
