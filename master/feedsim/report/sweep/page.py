"""report.html of a study."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from feedsim.report.frame import Tile, frame, picture_section
from feedsim.report.people import number
from feedsim.report.style import Picture
from feedsim.report.sweep.account import Account
from feedsim.report.sweep.plots import drawn, varying
from feedsim.report.sweep.provenance import provenance_section
from feedsim.report.sweep.sensitivity_tables import sensitivity_tables
from feedsim.report.tables import table
from feedsim.report.words import counted, minus

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
            _parameters(account),
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
    rows = []
    for each in account.outputs:
        statistics = each.statistics
        keys = ("mean", "std", "q5", "q50", "q95", "min", "max")
        cells = "".join(f'<td class="number">{number(statistics[key])}</td>' for key in keys)
        rows.append(
            f"<tr><td><code>{escape(each.name)}</code></td><td>{escape(each.scale.shown_unit)}</td>{cells}"
            f'<td class="number">{len(each.known)}</td></tr>'
        )
    heads = [("Figure", False), ("Unit", False)]
    heads += [(text, True) for text in ("Mean", "Std", "5 %", "50 %", "95 %", "Min", "Max", "Runs")]
    told = {
        "grid": "On a grid the numbers describe the grid, no probability.",
        "sensitivity": "Here and in the pictures these are the runs of the samples A and B, which are independent; the "
        "others serve the Sobol indices.",
    }.get(account.study.sampling.method, "They are worth what the distributions of the parameters are worth.")
    note = f'<p class="muted">Over the runs that have the figure. {told}</p>'
    return '<h2 id="figures">Figures of all runs</h2>\n' + table(heads, rows) + note if rows else ""


def _failures(account: Account) -> str:
    if not account.failures:
        return ""
    rows = []
    for each in account.failures[:MOST_FAILURES]:
        numbers = ", ".join(str(run) for run in each.runs[:MOST_RUNS])
        more = f" and {len(each.runs) - MOST_RUNS} more" if len(each.runs) > MOST_RUNS else ""
        rows.append(
            f'<tr><td class="number">{len(each.runs)}</td><td class="meaning">{escape(each.message)}</td>'
            f"<td>{escape(each.where)}</td><td>{numbers}{more}</td></tr>"
        )
    left = len(account.failures) - MOST_FAILURES
    heads = [("Runs", True), ("Message (of the first)", False), ("Where", False), ("Numbers", False)]
    note = (
        '<p class="muted">Messages that differ in numbers only are one. Where: parameters of which these runs hold a '
        f"small part of the values.{f' {left} more kinds of messages in the table.' if left > 0 else ''}</p>"
    )
    return '<h2 id="failed">Failed runs</h2>\n' + table(heads, rows) + note


def _parameters(account: Account) -> str:
    rows = []
    for each in account.inputs:
        law = each.parameter.distribution
        kind: str = law.kind if law is not None else "values"
        kind += " factor" if each.parameter.factor else ""
        if each.words:
            span = ", ".join(each.words)
        elif len(each.values):
            span = f"{number(each.values.min())} to {number(each.values.max())}"
        else:
            span = ""
        keys = "<br>".join(f"<code>{escape(key)}</code>" for key in each.parameter.keys)
        rows.append(
            f"<tr><td>{escape(each.name)}</td><td>{keys}</td><td>{escape(kind)}</td><td>{escape(minus(span))}</td>"
            f"<td>{escape(each.scale.shown_unit)}</td></tr>"
        )
    heads = [("Parameter", False), ("Key", False), ("Distribution", False), ("Drawn", False), ("Unit", False)]
    return '<h2 id="parameters">Parameters</h2>\n' + table(heads, rows)
