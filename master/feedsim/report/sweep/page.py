"""report.html of a study."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape

from feedsim.report.formatting import counted, minus, number
from feedsim.report.frame import Tile, frame, picture_section
from feedsim.report.style import Picture
from feedsim.report.sweep.account import QUANTILES, Account
from feedsim.report.sweep.parameters import parameters_section
from feedsim.report.sweep.plots import drawn, varying
from feedsim.report.sweep.provenance import provenance_section
from feedsim.report.sweep.sensitivity_tables import sensitivity_tables
from feedsim.report.tables import table

METHODS = {
    "grid": "grid: every combination",
    "latin_hypercube": "Latin hypercube",
    "sobol": "Sobol sequence",
    "sensitivity": "samples for Sobol indices",
}
MOST_FAILURES = 50  # kinds
MOST_RUNS = 12  # numbers of a kind


def page(account: Account, whole: Sequence[Picture], single: Sequence[Picture]) -> str:
    """HTML text of the report."""
    study, scenario = account.study, account.study.base.scenario
    method = METHODS.get(study.sampling.method, study.sampling.method)
    left_out = len(varying(account)) - len(drawn(account))
    drawn_note = (
        f'<p class="muted">{counted(left_out, "figure")} more in the tables and in summary.json, not drawn; '
        "<code>figures:</code> in the study file chooses.</p>"
        if left_out > 0
        else ""
    )
    return frame(
        study.name,
        f"{scenario.name} · {scenario.machine.name} · {counted(len(study.parameters), 'parameter')} · {method}",
        warnings=account.warnings,
        notes=(scenario.machine.note, scenario.note, study.note),
        tiles=_tiles(account),
        main=[
            _statistics(account),
            *(picture_section(picture) for picture in whole),
            *(["<h2>Figure by figure</h2>"] if single else []),
            drawn_note,
            *(picture_section(picture) for picture in single),
            sensitivity_tables(account),
            _failures(account),
            parameters_section(account),
            provenance_section(account),
        ],
        footer="Every run is a row of the table beside this page; values here in full precision: summary.json. Figures "
        "are defined in docs/figures.md, sampling and sensitivities in docs/sweeps.md, which come with the software.",
    )


def _tiles(account: Account) -> list[Tile]:
    rows = len(account.table)
    tiles = [
        Tile(
            str(rows), "runs" if rows == account.design.runs else f"of {account.design.runs} runs", "rows of the table"
        ),
        Tile(str(account.failed), "failed", "runs that have no figures; their messages stand below"),
    ]
    if (wall := account.wall_time) is not None:
        tiles.append(Tile(f"{wall:.4g} s", "time", "from the beginning to the end of all runs"))
        tiles.append(Tile(f"{rows / wall:.3g} 1/s", "runs per second", "rows over time"))
    if rows:
        tiles.append(Tile(f"{1e3 * account.busy / rows:.3g} ms", "per run", "mean time of a run on its worker"))
    if (processes := account.processes) is not None:
        tiles.append(Tile(str(processes), "process" if processes == 1 else "processes", "that made the runs"))
    if (efficiency := account.efficiency) is not None:
        tiles.append(Tile(f"{100 * efficiency:.0f} %", "efficiency", "share of the workers' time that went into runs"))
    return tiles


def _statistics(account: Account) -> str:
    grid = account.study.sampling.method == "grid"
    nominal = any(math.isfinite(each.nominal) for each in account.outputs)
    rows = []
    for each in account.outputs:
        statistics = each.statistics
        cells = [number(each.nominal, 3)] if nominal else []
        mean, std = statistics["mean"], statistics["std"]
        cells += [number(mean) if grid else rounded(mean, std / math.sqrt(max(len(each.known), 1)))]
        cells.append(number(std, 4 if grid else 3))
        for share in QUANTILES:
            value, ends = statistics[f"q{share}"], each.quantile_intervals[f"q{share}"]
            cells.append(number(value) if grid else with_interval(value, ends))
        cells += [number(statistics["min"]), number(statistics["max"]), str(len(each.known))]
        rows.append(
            f"<tr><td><code>{escape(each.name)}</code></td><td>{escape(each.scale.shown_unit)}</td>"
            + "".join(f'<td class="number">{cell}</td>' for cell in cells)
            + "</tr>"
        )
    heads = [("Figure", False), ("Unit", False)] + ([("Nominal", True)] if nominal else [])
    heads += [(text, True) for text in ("Mean", "Std", "5 %", "50 %", "95 %", "Min", "Max", "Runs")]
    told = {
        "grid": "On a grid the numbers describe the grid, no probability.",
        "sensitivity": "Here and in the pictures these are the runs of the samples A and B, which are independent; the "
        "others serve the Sobol indices.",
    }.get(account.study.sampling.method, "They are worth what the distributions of the parameters are worth.")
    if not grid:
        told += (
            " In brackets the 95 % interval of a quantile, between two of the sorted values; none where the runs are "
            "too few."
        )
    told += " Nominal: the scenario without changes." if nominal else ""
    note = f'<p class="muted">Over the runs that have the figure. {told}</p>'
    return '<h2 id="figures">Figures of all runs</h2>\n' + table(heads, rows) + note if rows else ""


def with_interval(value: float, ends: tuple[float, float]) -> str:
    """A value with its interval, both with the digits that the interval leaves."""
    low, high = ends
    if not (math.isfinite(low) and math.isfinite(high)):
        return number(value, 3)
    width = max(value - low, high - value)
    return " ".join([rounded(value, width), f"({rounded(low, width)} to {rounded(high, width)})"])


def rounded(value: float, doubt: float) -> str:
    """A number to the second digit of its doubt."""
    if not (math.isfinite(value) and math.isfinite(doubt) and doubt > 0):
        return number(value)
    return minus(f"{value:.{max(0, 1 - math.floor(math.log10(doubt)))}f}")


def _failures(account: Account) -> str:
    if not account.failures:
        return ""
    rows = []
    for each in account.failures[:MOST_FAILURES]:
        numbers = ", ".join(str(run) for run in each.runs[:MOST_RUNS])
        more = f" and {len(each.runs) - MOST_RUNS} more" if len(each.runs) > MOST_RUNS else ""
        rows.append(
            f'<tr><td class="number">{len(each.runs)}</td><td class="meaning">{escape(each.message)}</td>'
            f"<td>{escape(account.where(each))}</td><td>{numbers}{more}</td></tr>"
        )
    left = len(account.failures) - MOST_FAILURES
    heads = [("Runs", True), ("Message (of the first)", False), ("Where", False), ("Numbers", False)]
    note = (
        '<p class="muted">Messages that differ in numbers only are one. Where: parameters whose values tell '
        "these runs from those that are done by more than chance (5 %, corrected for the number of tests), "
        "with the range that the runs lie in and how many of all runs there failed so; empty where no parameter does, "
        "or too few runs are done."
        f"{f' {left} more kinds of messages in the table.' if left > 0 else ''}</p>"
    )
    return '<h2 id="failed">Failed runs</h2>\n' + table(heads, rows) + note
