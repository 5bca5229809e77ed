"""Tables of what moves the figures of a study."""

from __future__ import annotations

import math
from html import escape

from feedsim.report.formatting import minus, number
from feedsim.report.style import Array
from feedsim.report.sweep.account import Account
from feedsim.report.sweep.plots import drawn
from feedsim.report.tables import table
from feedsim.sweep.sensitivity import Indices, Trends

SOBOL_NOTE = (
    "First order: the share of the scatter that would be gone if the parameter were known. Total: the share that would "
    "stay if everything but it were known; a parameter with a total near 0 may be held where it is. Total above first "
    "order: it acts together with others. 95 % intervals by bootstrap over the base points, rough ones: docs/sweeps.md "
    "says how often they hold."
)
TREND_NOTE = (
    "Rank correlation: −1 to 1, how well “larger here, larger there” holds. Regression: standard deviations of the "
    "figure per standard deviation of the parameter; true as far as the share it explains (R²) is near 1."
)
SHARE_NOTE = (
    "Share: the part of the scatter between the parameter's values, where values repeat. None of them sees what only "
    "joint changes do, nor a minimum in the middle; Sobol indices (method: sensitivity) do."
)


def sensitivity_tables(account: Account) -> str:
    """One table per drawn figure; empty where there is nothing."""
    found = account.sensitivities
    parts = []
    for output in drawn(account):
        sobol, trend = found.sobol.get(output.name), found.trends[output.name]
        if sobol is None:
            body = _trends(found.parameters, trend)
        elif sobol.reason:  # the cheap measures need no whole base points
            body = f"<p>No Sobol indices: {escape(sobol.reason)}.</p>\n{_trends(found.parameters, trend)}"
        else:
            body = _sobol(found.parameters, sobol, trend)
        parts.append(f"<h3>{escape(output.name)}</h3>\n{body}")
    if not parts:
        return ""
    note = f"{SOBOL_NOTE} {TREND_NOTE}" if found.sobol else f"{TREND_NOTE} {SHARE_NOTE}"
    return "\n".join(['<h2 id="sensitivities">What moves the figures</h2>', f'<p class="muted">{note}</p>', *parts])


def _sobol(names: tuple[str, ...], found: Indices, trend: Trends) -> str:
    order = sorted(range(len(names)), key=lambda k: (-found.total[k], k))
    rows = [
        f"<tr><td>{escape(names[k])}</td>{_cell(_two(found.first[k]))}{_cell(_span(found.first_interval[k]))}"
        f"{_cell(_two(found.total[k]))}{_cell(_span(found.total_interval[k]))}"
        f"{_cell(_two(trend.rank_correlation[k]))}{_cell(_two(trend.regression[k]))}</tr>"
        for k in order
    ]
    sums = (_two(found.first.sum()), "", _two(found.total.sum()), "", "", "")
    rows.append(f"<tr><td>all</td>{''.join(map(_cell, sums))}</tr>")
    heads = [("Parameter", False), ("First order", True), ("95 %", True), ("Total", True), ("95 %", True)]
    heads += [("Rank correlation", True), ("Regression", True)]
    points = f"{found.used} base points" + (f", {found.left_out} left out" if found.left_out else "")
    return table(heads, rows) + f'<p class="muted">{points}. Of the samples A and B: {_fit(trend)}</p>'


def _trends(names: tuple[str, ...], found: Trends) -> str:
    if found.reason:
        return f"<p>No measures: {escape(found.reason)}.</p>"
    order = sorted(range(len(names)), key=lambda k: (-_size(found, k), k))
    rows = [
        f"<tr><td>{escape(names[k])}</td>{_cell(_two(found.rank_correlation[k]))}{_cell(_two(found.regression[k]))}"
        f"{_cell(_two(found.share[k]))}</tr>"
        for k in order
    ]
    heads = [("Parameter", False), ("Rank correlation", True), ("Regression", True), ("Share", True)]
    return table(heads, rows) + f'<p class="muted">{_fit(found)}</p>'


def _fit(found: Trends) -> str:
    """What the cheap measures are worth."""
    if found.reason:
        return f"no rank correlations: {escape(found.reason)}."
    explained = (
        f"the regression explains {100 * found.explained:.3g} % of the scatter (R²)"
        if math.isfinite(found.explained)
        else "no regression"
    )
    return f"{found.used} runs; {explained}; rank correlations up to ±{number(found.noise, 2)} can be chance."


def _size(found: Trends, k: int) -> float:
    sizes = [abs(each[k]) for each in (found.share, found.rank_correlation) if math.isfinite(each[k])]
    return float(sizes[0]) if sizes else 0.0


def _two(value: float) -> str:
    return minus(f"{value:.2f}").replace("−0.00", "0.00") if math.isfinite(value) else "–"


def _span(interval: Array) -> str:
    return " to ".join(_two(float(end)) for end in interval)


def _cell(text: str) -> str:
    return f'<td class="number">{text}</td>'
