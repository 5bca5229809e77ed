"""The report on a study of many runs: summary.json, report.html and figures beside its table, whole or not at all."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from feedsim.design.sweep.sensitivity import Indices, Trends, is_constant
from feedsim.design.sweep.table import record_of
from feedsim.report.chart import Chart, Grid
from feedsim.report.content import (
    FOLDER,
    LEAD_ROWS,
    Paragraph,
    Part,
    Picture,
    Report,
    Section,
    Step,
    Table,
    Text,
    Tile,
    code,
    parameters_section,
    provenance_section,
    with_remark,
)
from feedsim.report.formatting import (
    NARROW,
    Array,
    count_things,
    minus,
    number,
    round_to_doubt,
    three_digits,
    with_interval,
)
from feedsim.report.results import write_report
from feedsim.report.run.report import HEADER, is_leading
from feedsim.report.sweep.account import (
    QUANTILES,
    RANK,
    SHARE_HEADING,
    TOTAL,
    ZERO_SHARE,
    Account,
    Input,
    Measure,
    Output,
    details,
    measures,
    study_files,
)
from feedsim.report.sweep.figure_plots import grid_picture, of_account

if TYPE_CHECKING:
    from feedsim.design.sweep.design import Design
    from feedsim.design.sweep.table import Table as Runs
    from feedsim.scenario.study import Study


# --- All pictures of a study in the order of the page, and the first of them: which parameter moves which figure ------


MOST_FIGURES = 8  # drawn one by one; the tables hold all
MOST_ROWS, MOST_COLUMNS = 30, 20  # of the overview


def varying_outputs(account: Account) -> list[Output]:
    """Figures that are not the same in all runs."""
    return [output for output in account.outputs if len(output.known) and not is_constant(output.known)]


def drawn_outputs(account: Account) -> list[Output]:
    """Figures that are drawn one by one: those that differ from run to run, the leading ones first."""
    known = varying_outputs(account)
    leading = [output for output in known if is_leading(output.name, HEADER)]
    return [*leading, *(output for output in known if output not in leading)][:MOST_FIGURES]


def pictures_of(account: Account) -> tuple[list[Picture], list[Picture]]:
    """Pictures of the whole study, and those of single figures."""
    overview = overview_picture(account)
    result = measures(account)
    single: list[Picture] = []
    taken: set[str] = set()
    for output in drawn_outputs(account):
        stem = _stem(output.name, taken)
        over_grid = grid_picture(account, output, stem)
        single += [over_grid] if over_grid is not None else of_account(account, output, result[output.name], stem)
    return [overview] if overview is not None else [], single


def _stem(name: str, taken: set[str]) -> str:
    """A figure's name as part of a file name, different from those taken."""
    stem = re.sub(r"[^A-Za-z0-9_-]+", "-", name.replace("+", "-plus")).strip("-") or "figure"
    number = 2
    unique = stem
    while unique in taken:
        unique, number = f"{stem}-{number}", number + 1
    taken.add(unique)
    return unique


def overview_picture(account: Account) -> Picture | None:
    """The matrix in colours and numbers; None where there is nothing to compare."""
    result = [measure for measure in measures(account).values() if measure.known]
    result = [measure for measure in result if measure.kind == result[0].kind][:MOST_ROWS]
    if not result or len(account.inputs) < 2:
        return None
    ranks = sorted(range(len(account.inputs)), key=lambda k: -max(measure.size(k) for measure in result))
    columns = sorted(ranks[:MOST_COLUMNS])
    left_out = len(account.inputs) - len(columns)
    more = f" {left_out} parameters that move no figure more are left out." if left_out else ""
    values = np.array([[float(measure.values[k]) for k in columns] for measure in result])
    bold = np.array([[measure.significant(k) for k in columns] for measure in result])
    if result[0].kind == TOTAL:
        values = np.where(np.abs(values) < ZERO_SHARE, np.nan, values)
    names, figures = [account.inputs[k].name for k in columns], [measure.figure for measure in result]
    span = (-1.0, 1.0) if result[0].kind == RANK else (0.0, 1.0)
    chart = Chart([Grid("", names, figures, values, span, 2, bold)])
    title = "Which parameter moves which figure"
    return Picture("sensitivities", title, result[0].caption + more, chart, worded=True)


METHODS = {
    "grid": "grid: every combination",
    "latin_hypercube": "Latin hypercube",
    "sobol": "Sobol sequence",
    "sensitivity": "samples for Sobol indices",
}
MOST_FAILURES = 50  # kinds
MOST_ANSWERS = 4  # figures that are shown first
MIN_NAMED_SHARE = 0.05  # share of the scatter, from which a parameter is said to move a figure
EDGE = 0.01  # share of a parameter's range, up to which a value lies at its end
MOST_RUNS = 12  # numbers of a kind
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
FAILURES_NOTE = (
    "Messages that differ in numbers only are one. Where: parameters whose values separate these runs from those that "
    "are done by more than chance (5 %, corrected for the number of tests), with the range that the runs lie in and "
    "how many of all runs there failed so; empty where no parameter does, or too few runs are done."
)
# What the record of a study holds of how it was made, and in words.
PROVENANCE_NAMES = {
    "command": "Command", "workers": "Made by", "began": "Began", "ended": "Ended", "machine": "Computer",
    "versions": "Software of the runs", "fingerprint": "Fingerprint",
}  # fmt: skip


def write(
    table: Runs, study: Study, design: Design, directory: Path | str, *, drawn: Sequence[str] = ()
) -> tuple[Path, ...]:
    """Write report.html, summary.json and figures/*.png beside the table; returns their paths.

    The table may be that of an unfinished study. The table's own files are left as they are. Raises OutputError.
    """
    account = account_of(table, study, design, Path(directory))
    return write_report(directory, drawn_report(account), details(account), {}, drawn, kind="sweep")


def account_of(table: Runs, study: Study, design: Design, directory: Path) -> Account:
    """What table, study and the record in `directory` come to."""
    return Account(table, study, design, record_of(directory))


def drawn_report(account: Account) -> Report:
    """Content of the report, with its pictures."""
    study = account.study
    machine = study.base.scenario.machine
    remark = f"{study.name}. {machine.name}. {machine.note}".strip()
    whole, single = (with_remark(pictures, remark, *NARROW) for pictures in pictures_of(account))
    return report_of(account, whole, single)


def report_of(account: Account, whole: Sequence[Picture], single: Sequence[Picture]) -> Report:
    """Content of the report: pictures of the whole study, and those of single figures."""
    study, scenario = account.study, account.study.base.scenario
    method = METHODS.get(study.sampling.method, study.sampling.method)
    return Report(
        study.name,
        f"{scenario.name} · {scenario.machine.name} · {count_things(len(study.parameters), 'parameter')} · {method}",
        answer=answers(account),
        warnings=account.warnings,
        notes=(scenario.machine.note, scenario.note, study.note),
        tiles=[*_goal_tiles(account), *_range_tiles(account), *_tiles(account)],
        lead=lead_picture(account, whole, single),
        next_step=_next_step(account),
        main=[
            _statistics(account),
            *whole,
            Section("Figure by figure", [_not_drawn(account), *single]) if single else _not_drawn(account),
            _sensitivities(account),
            _failures(account),
            _parameters(account),
        ],
        provenance=_provenance(account),
        footer="Every run is a row of the table beside this page; values here in full precision: summary.json. Figures "
        "are defined in docs/figures.md, sampling and sensitivities in docs/sweeps.md, which come with the software.",
    )


def _range_tiles(account: Account) -> Iterator[Tile]:
    """Of a study without a goal: least and greatest value of the figure that it asks about, or of the first one."""
    if account.best is not None or not (outputs := drawn_outputs(account)):
        return
    output = next((output for output in outputs if output.name == account.study.explain), outputs[0])
    unit = output.scale.shown_unit
    for key, what in (("min", "smallest"), ("max", "largest")):
        yield Tile(
            f"{three_digits(output.statistics[key])} {unit}".rstrip(), f"{what} {output.name}", f"{what} of all runs"
        )


def _tiles(account: Account) -> Iterator[Tile]:
    rows, asked = len(account.table), account.design.runs
    yield Tile(str(rows), "runs" if rows == asked else f"of {asked} runs", "rows of the table")
    yield Tile(str(account.failed), "failed", "runs that have no figures; their messages stand below")
    if (wall := account.wall_time) is not None:
        yield Tile(f"{wall:.4g} s", "time of all runs", "from the beginning to the end of all runs")


def _goal_tiles(account: Account) -> Iterator[Tile]:
    """The best value, what the scenario has without changes, and what lies between them."""
    if (result := account.best) is None:
        return
    output, row = result
    unit, value = output.scale.shown_unit, float(output.values[row])
    way = account.study.goal[0] if account.study.goal else ""
    yield Tile(
        f"{three_digits(value)} {unit}".rstrip(), f"{way} {output.name}, run {account.runs[row]}", "the run looked for"
    )
    if math.isfinite(output.nominal):
        yield Tile(f"{three_digits(output.nominal)} {unit}".rstrip(), "the scenario unchanged", "value without changes")
        more = minus(f"{100 * (value / output.nominal - 1):+.1f} %") if output.nominal else ""
        yield Tile(more or "–", "against the scenario", "difference of the two")


def question(table: Runs, study: Study, design: Design) -> list[str]:
    """The answer to the goal of a study, for the terminal; empty without a goal."""
    return goal_words(Account(table, study, design))


def goal_words(account: Account) -> list[str]:
    """The answer to the question of the study: the best value, where it lies, and that of the scenario unchanged."""
    if account.study.goal is None:
        return []
    way, name = account.study.goal
    if (result := account.best) is None:
        return [f"{way.capitalize()} {name}: no run has this figure."]
    output, row = result
    unit = output.scale.shown_unit
    at = ", ".join(f"{entry.name} {entry.text(float(entry.values[row]))} {entry.scale.shown_unit}".rstrip()
                   for entry in account.inputs)  # fmt: skip
    nominal = f"; the scenario unchanged has {three_digits(output.nominal)} {unit}".rstrip()
    own = nominal if math.isfinite(output.nominal) else ""
    edge = [entry.name for entry in account.inputs if _at_edge(entry, row)]
    more = f". It lies at the end of what was tried of {' and '.join(edge)}: try further" if edge else ""
    return [f"{way.capitalize()} {name}: {three_digits(float(output.values[row]))} {unit}".rstrip()
            + f" in run {account.runs[row]}, with {at}{own}{more}."]  # fmt: skip


def _at_edge(entry: Input, row: int) -> bool:
    """Whether a run has the least or the greatest of a parameter's values, to a hundredth of their range."""
    if entry.words or (reach := float(np.ptp(entry.values))) == 0:
        return False
    value = float(entry.values[row])
    return min(value - float(entry.values.min()), float(entry.values.max()) - value) <= EDGE * reach


def lead_picture(account: Account, whole: Sequence[Picture], single: Sequence[Picture]) -> Picture | None:
    """The picture that belongs to the study's question: its figure over the parameters, or what moves it."""
    asked = account.study.explain or (account.study.goal[1] if account.study.goal else "")
    titles = (f"{asked} over the parameters", f"Distribution of {asked}")
    own = [picture for picture in (*single, *whole) if asked and picture.title in titles]
    begin = "distribution-" if account.study.explain else "scatter-"
    first = next((picture for picture in own if picture.stem.startswith(begin)), next(iter(own), None))
    return first.first_rows(LEAD_ROWS) if first is not None else None


def _next_step(account: Account) -> Step | None:
    study = account.study
    if (result := account.best) is not None:
        row = {"scenario": study.file, "row": account.runs[result[1]]}
        return Step("See the command that makes this run by itself", "check", row)
    if not (outputs := drawn_outputs(account)):
        return None
    name = study.explain or outputs[0].name
    return Step(
        "Lay the two ends over each other", "diff", {"results": [f"{FOLDER}:min={name}", f"{FOLDER}:max={name}"]}
    )


def answers(account: Account) -> list[str]:
    """The answer to the study's question; how far the leading figures scatter, and what moves them most."""
    result, grid = measures(account), account.study.sampling.method == "grid"
    lines = goal_words(account)
    asked = account.study.explain
    shown = sorted(drawn_outputs(account), key=lambda output: output.name != asked)
    for output in shown[:MOST_ANSWERS]:
        reported, unit = output.statistics, output.scale.shown_unit
        low, high = (three_digits(reported[key]) for key in (("min", "max") if grid else ("q5", "q95")))
        spread = f"{low} to {high} {unit}".rstrip() + (" over the grid" if grid else " in nine of ten runs")
        middle = "" if grid else f"{three_digits(reported['q50'])} {unit}".rstrip() + " in the median, "
        lines.append(f"{output.name}: {middle}{spread}; {_strongest_parameters_text(account, result[output.name])}.")
    return lines


def _strongest_parameters_text(account: Account, measure: Measure) -> str:
    """The parameters that move a figure most, with their measure."""
    leading = [
        k
        for k in measure.ranked()
        if measure.significant(k) or (measure.kind == SHARE_HEADING and measure.size(k) > MIN_NAMED_SHARE)
    ]
    if not leading:
        return "no parameter moves it by more than chance"
    first, *further = (f"{account.inputs[k].name} ({_two_digits(float(measure.values[k]))})" for k in leading[:3])
    more = f", then {' and '.join(further)}" if further else ""
    return f"{first} moves it most{more} ({measure.kind})"


def _speed_rows(account: Account) -> Iterator[tuple[str, str]]:
    """How fast the runs were made."""
    rows, reported = len(account.table), []
    if (wall := account.wall_time) is not None:
        reported.append(f"{rows / wall:.3g} runs per second")
    if rows:
        reported.append(f"{1e3 * account.busy / rows:.3g} ms per run")
    if (processes := account.processes) is not None:
        reported.append(count_things(processes, "process", "processes"))
    if (efficiency := account.efficiency) is not None:
        reported.append(f"{100 * efficiency:.0f} % of their time went into runs")
    if reported:
        yield "Speed", ", ".join(reported)


def _not_drawn(account: Account) -> Paragraph | None:
    left_out = len(varying_outputs(account)) - len(drawn_outputs(account))
    count = f"{count_things(left_out, 'figure')} more in the tables and in summary.json, not drawn; "
    return Paragraph((count, code("figures:"), " in the study file chooses."), "muted") if left_out > 0 else None


def _statistics(account: Account) -> Section | None:
    grid = account.study.sampling.method == "grid"
    nominal = any(math.isfinite(output.nominal) for output in account.outputs)
    rows: list[tuple[Text, ...]] = []
    for entry in account.outputs:
        statistics = entry.statistics
        cells = [three_digits(entry.nominal)] if nominal else []
        mean, std = statistics["mean"], statistics["std"]
        cells += [number(mean) if grid else round_to_doubt(mean, std / math.sqrt(max(len(entry.known), 1)))]
        cells.append(number(std, 4 if grid else 3))
        for share in QUANTILES:
            value, ends = statistics[f"q{share}"], entry.quantile_intervals[f"q{share}"]
            cells.append(number(value) if grid else with_interval(value, ends))
        cells += [number(statistics["min"]), number(statistics["max"]), str(len(entry.known))]
        rows.append((code(entry.name), entry.scale.shown_unit, *cells))
    heads = ("Figure", "Unit", *(("Nominal",) if nominal else ()),
             "Mean", "Std", "5 %", "50 %", "95 %", "Min", "Max", "Runs")  # fmt: skip
    reported = {
        "grid": "On a grid the numbers describe the grid, no probability.",
        "sensitivity": "Here and in the pictures these are the runs of the samples A and B, which are independent; the "
        "others serve the Sobol indices.",
    }.get(account.study.sampling.method, "They are as good as the distributions of the parameters.")
    if not grid:
        reported += (
            " In brackets the 95 % interval of a quantile, between two of the sorted values; none where the runs are "
            "too few."
        )
    reported += " Nominal: the scenario without changes." if nominal else ""
    table = Table("ll" + "r" * (len(heads) - 2), heads, rows, f"Over the runs that have the figure. {reported}")
    return Section("Figures of all runs", [table], "figures") if rows else None


def _sensitivities(account: Account) -> Section | None:
    """A table per drawn figure of what moves it; None where there is nothing."""
    result = account.sensitivities
    parts: list[Part] = []
    for output in drawn_outputs(account):
        sobol, trend = result.sobol.get(output.name), result.trends[output.name]
        if sobol is not None and not sobol.reason:
            body: list[Part] = [_sobol(result.parameters, sobol, trend)]
        else:  # the cheap measures need no whole base points
            body = [Paragraph(f"No Sobol indices: {sobol.reason}.")] if sobol is not None else []
            body.append(_trends(result.parameters, trend))
        parts.append(Section(output.name, body))
    note = f"{SOBOL_NOTE} {TREND_NOTE}" if result.sobol else f"{TREND_NOTE} {SHARE_NOTE}"
    return Section("What moves the figures", [Paragraph(note, "muted"), *parts], "sensitivities") if parts else None


def _sobol(names: tuple[str, ...], indices: Indices, trend: Trends) -> Table:
    order = sorted(range(len(names)), key=lambda k: (-indices.total[k], k))
    rows = [
        (names[k], _two_digits(indices.first[k]), _span(indices.first_interval[k]), _two_digits(indices.total[k]),
         _span(indices.total_interval[k]), _two_digits(trend.rank_correlation[k]), _two_digits(trend.regression[k]))
        for k in order
    ]  # fmt: skip
    rows.append(("all", _two_digits(indices.first.sum()), "", _two_digits(indices.total.sum()), "", "", ""))
    heads = ("Parameter", "First order", "95 %", "Total", "95 %", "Rank correlation", "Regression")
    points = f"{indices.used} base points" + (f", {indices.left_out} left out" if indices.left_out else "")
    return Table("lrrrrrr", heads, rows, f"{points}. Of the samples A and B: {_fit(trend)}")


def _trends(names: tuple[str, ...], trends: Trends) -> Part:
    if trends.reason:
        return Paragraph(f"No measures: {trends.reason}.")
    order = sorted(range(len(names)), key=lambda k: (-_size(trends, k), k))
    columns = (trends.rank_correlation, trends.regression, trends.share)
    rows = [(names[k], *(_two_digits(column[k]) for column in columns)) for k in order]
    return Table("lrrr", ("Parameter", "Rank correlation", "Regression", "Share"), rows, _fit(trends))


def _fit(trends: Trends) -> str:
    """What the cheap measures are worth."""
    if trends.reason:
        return f"no rank correlations: {trends.reason}."
    explained = (
        f"the regression explains {100 * trends.explained:.3g} % of the scatter (R²)"
        if math.isfinite(trends.explained)
        else "no regression"
    )
    return f"{trends.used} runs; {explained}; rank correlations up to ±{number(trends.noise, 2)} can be chance."


def _size(trends: Trends, k: int) -> float:
    sizes = [abs(values[k]) for values in (trends.share, trends.rank_correlation) if math.isfinite(values[k])]
    return float(sizes[0]) if sizes else 0.0


def _two_digits(value: float) -> str:
    return minus(f"{value:.2f}").replace("−0.00", "0.00") if math.isfinite(value) else "–"


def _span(interval: Array) -> str:
    return " to ".join(_two_digits(float(end)) for end in interval)


def _failures(account: Account) -> Section | None:
    rows = []
    for failure in account.failures[:MOST_FAILURES]:
        numbers = ", ".join(str(run) for run in failure.runs[:MOST_RUNS])
        more = f" and {len(failure.runs) - MOST_RUNS} more" if len(failure.runs) > MOST_RUNS else ""
        rows.append((str(len(failure.runs)), failure.message, account.where(failure), numbers + more))
    remaining = len(account.failures) - MOST_FAILURES
    note = FAILURES_NOTE + (f" {remaining} more kinds of messages in the table." if remaining > 0 else "")
    table = Table("rpll", ("Runs", "Message (of the first)", "Where", "Numbers"), rows, note)
    return Section("Failed runs", [table], "failed") if rows else None


def _parameters(account: Account) -> Section:
    """What was varied: keys, distributions with their numbers, and what was drawn."""
    rows: list[tuple[Text, ...]] = []
    for entry in account.inputs:
        if entry.words:
            span = ", ".join(entry.words)
        else:
            span = f"{number(entry.values.min())} to {number(entry.values.max())}" if len(entry.values) else ""
        keys = tuple(part for key in entry.parameter.keys for part in ("\n", code(key)))[1:]
        rows.append((entry.name, keys, law(entry), minus(span), entry.scale.shown_unit))
    heads = ("Parameter", "Key", "Distribution", "Drawn", "Unit")
    return Section("Parameters", [Table("lllll", heads, rows)], "parameters")


def law(entry: Input) -> str:
    """What a parameter is distributed like: "factor, normal, mean 1, deviation 0.07, from 0.85, to 1.2"."""
    result = entry.parameter.distribution
    reported = ["factor"] if entry.parameter.factor else []
    if result is None:
        return ", ".join([*reported, f"one of {len(entry.parameter.choices)} values"])
    middle = sum(result.support) / 2 if result.mode is None else result.mode
    mode = middle if result.kind == "triangular" else None
    reported.append(result.kind)
    for word, value in (
        ("mean", result.mean),
        ("deviation", result.deviation),
        ("from", result.low),
        ("mode", mode),
        ("to", result.high),
    ):
        if value is not None and math.isfinite(value):
            reported.append(f"{word} {number(value * entry.scale.factor)}")
    if result.count is not None:
        reported.append(f"{result.count} values")
    return ", ".join(reported)


def _provenance(account: Account) -> Section:
    study, scenario = account.study, account.study.base.scenario
    rows = [
        ("Study", f"{study.name} ({study.file.name})"),
        ("Scenario", f"{scenario.name} ({scenario.file.name})"),
        ("Set on the command line", ", ".join(study.overrides) or "nothing"),
        ("Sampling", f"{study.sampling.method}, {account.design.runs} runs, seed {study.sampling.seed}"),
        ("Machine", scenario.machine.name),
        *_provenance_rows(account.record),
        *_speed_rows(account),
    ]
    note = Paragraph("The parameters are the scenario's; each run changes those above.", "muted")
    parameters = parameters_section(scenario.machine)
    return provenance_section(rows, study_files(account), parameters, note, software_of="Software of this page")


def _provenance_rows(record: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """What is on record of how the table was made."""
    for key, name in PROVENANCE_NAMES.items():
        value = record.get(key)
        if value in (None, "", {}, []):
            continue
        if isinstance(value, Mapping):
            yield name, ", ".join(f"{part} {text}" for part, text in value.items())
        elif isinstance(value, list):
            yield name, " ".join(str(part) for part in value)
        else:
            yield name, str(value)
    parts = record.get("parts")
    if isinstance(parts, Mapping):
        yield from ((f"Hash of {part}", str(text)) for part, text in parts.items() if isinstance(text, str))
