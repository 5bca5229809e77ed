"""The report of a history: sentences, tables, a chart for each quantity, CSV files."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from feedsim.analysis import Figure
from feedsim.analysis.history import ERROR_RATE, MIN_RECORDS, Change, FittedChange, LimitCrossing, Scatter, testable
from feedsim.estimation.least_squares import NORMAL_95
from feedsim.files import sheets
from feedsim.foundation.errors import Finding
from feedsim.report import formatting
from feedsim.report.chart import Axis, Band, Chart, Curve, Level, Panel
from feedsim.report.content import FOLDER, Picture, Report, Section, Step, Table, Text, Tile, code, provenance_section
from feedsim.report.formatting import (
    ALLOWED_COLOUR,
    ALTERNATIVE_COLOUR,
    INK,
    MUTED,
    RECORDED_COLOUR,
    RESIDUAL_COLOUR,
    SIMULATED_COLOUR,
    count_things,
    display_unit,
    minus,
    plain_unit,
    typeset,
)
from feedsim.report.provenance import finite, hash_files, inputs_part

VALUES, CHANGES, FLEET = "history.csv", "changes.csv", "fleet.yaml"
FILES = (VALUES, CHANGES, FLEET)  # besides report.html and summary.json
FORMAT = 1
MONTH = 365.25 / 12  # [d]
EPOCH = datetime(1970, 1, 1)
FIRST_DAY, LAST_DAY = (float((edge - EPOCH).days) for edge in (datetime.min, datetime.max))
COMPENSATION_SUFFIX = "against no compensation"  # behind a figure: how much larger it is than without compensation
SCATTERS = 0.01  # chance of the scatter about a model, below which the intervals do not hold it
MOST_ANSWERS = 6
CURVE_POINTS = 60  # of a regime
Rows = tuple[Sequence[str], list[Sequence[str]]]  # heads, and a row a quantity

METHOD = (
    "A change is named where scatter alone explains it with a chance below its share of {rate:.0f} % (F tests of all "
    "models of a change, corrected for their number and for the {tested} quantities by Holm's method): the chance that "
    "any is named though none has changed is {rate:.0f} % at most. Scatter between records that the intervals of the "
    "results do not hold is estimated (Paule and Mandel) and counts. Dates of limits: inverse prediction (Fieller). "
    "docs/history.md"
)
FLEET_METHOD = (
    "value = mean + machine + record + error of its own interval. Between and within: standard deviations of machine "
    "and record (Paule and Mandel), with Q-profile intervals of 95 %. Changes of a machine over time count as within. "
    "docs/history.md"
)


@dataclass(frozen=True)
class FollowedValue:
    """A value of a result in `unit`; sigma: standard deviation, nan where there is none."""

    value: float
    unit: str
    sigma: float = math.nan
    status: str = "estimated"


@dataclass(frozen=True, eq=False)
class Entry:
    """A result with its date.

    Attributes:
        moment: of its record, UTC where the zone is known; None: not known.
        machine: "" where it is not known. owner: that, or the folder that the result lies in.
        law: of friction; "" of other kinds. conditions: of the record, such as "temperature [degC]".
    """

    name: str
    file: Path
    kind: str
    moment: datetime | None
    machine: str
    owner: str
    law: str
    values: Mapping[str, FollowedValue]
    conditions: Mapping[str, float]

    @property
    def days(self) -> float:
        """Since 1970 [d]."""
        return ((self.moment or EPOCH) - EPOCH).total_seconds() / 86400

    @property
    def day(self) -> str:
        """ "2026-03-01", with the time where it has one."""
        if self.moment is None:
            return ""
        text = self.moment.isoformat(timespec="minutes")
        return text.removesuffix("T00:00")


@dataclass(frozen=True, eq=False)
class History:
    """All of it.

    Attributes:
        entries, files: the results, and what was read.
        changes: of every quantity. limits: quantity -> limit; crossings: quantity -> when it is reached.
        simulated: names of the quantities that are figures of runs of `scenario`. settings: what was asked for.
        scatters: of machines of one kind, whose names are `machines`; empty of one machine over time.
    """

    entries: Sequence[Entry]
    files: Sequence[Path] = ()
    changes: Sequence[Change] = ()
    limits: Mapping[str, float] = field(default_factory=dict)
    crossings: Mapping[str, LimitCrossing] = field(default_factory=dict)
    findings: Sequence[Finding] = ()
    simulated: Sequence[str] = ()
    scenario: str = ""
    settings: Mapping[str, str] = field(default_factory=dict)
    scatters: Sequence[Scatter] = ()
    machines: Sequence[str] = ()

    @property
    def ranked(self) -> list[Change]:
        """What has changed first, the surest first; else in their order."""
        return sorted(self.changes, key=lambda one: (not one.changed, one.probability if one.changed else 0.0))

    @property
    def tested(self) -> int:
        """How many quantities were tested."""
        return sum(testable(one.series) for one in self.changes)


def typed_number(value: float, doubt: float) -> str:
    """A number to the second digit of its doubt, as it is typed."""
    return formatting.round_to_doubt(value, doubt).replace("−", "-")


def number(value: float) -> str:
    """A number of four digits, as it is typed."""
    return formatting.number(value).replace("−", "-")


def date_text(day: float) -> str:
    """Day since 1970 as a date; beyond the calendar its first or last one."""
    day = min(max(day, FIRST_DAY), LAST_DAY)
    return (EPOCH + timedelta(days=day)).date().isoformat()


# --- Sentences --------------------------------------------------------------------------------------------------------


def answers(history: History) -> list[str]:
    """When limits are reached, then what has changed, a sentence each, the surest first; of machines how far they
    scatter."""
    if history.scatters:
        return [_scatter_sentence(one) for one in history.scatters]
    changed = [one for one in history.ranked if one.changed]
    lines = [
        f"{one.series.name}: {_limit_sentence(history, one)}"
        for one in history.ranked
        if one.series.name in history.limits
    ]
    lines += [_change_sentence(one) for one in changed] or [_no_change_sentence(history)]
    if changed:
        same = len(history.changes) - len(changed)
        lines.append(
            f"{same} of {len(history.changes)} quantities have not changed beyond doubt; the chance of a false alarm "
            f"is {100 * ERROR_RATE:.0f} % at most."
        )
    return lines


def _no_change_sentence(history: History) -> str:
    first, last = (date_text(edge) for edge in _span(history))
    many = count_things(len(history.changes), "quantity", "quantities")
    if not history.tested:
        return (
            f"No change can be named: of {many} between {first} and {last} there are fewer than {MIN_RECORDS} dates, "
            "and two values may differ by scatter between records."
        )
    return (
        f"Nothing has changed beyond doubt: {many} between {first} and {last}; the chance of a false alarm is "
        f"{100 * ERROR_RATE:.0f} % at most."
    )


def _span(history: History) -> tuple[float, float]:
    days = np.concatenate([one.series.days for one in history.changes])
    return float(days.min()), float(days.max())


def sentence(change: Change, history: History) -> str:
    """What has changed, and when its limit is reached."""
    text = _change_sentence(change)
    if change.series.name in history.limits:
        text += f" {_capital(_limit_sentence(history, change))}"
    return text


def _change_sentence(change: Change) -> str:
    """Quantity, from, to, since when, at which rate or by which step."""
    model, series = change.model, change.series
    first, last = float(series.days[0]), float(series.days[-1])
    begin, end = model.level(first, 0), model.level(last)
    unit = plain_unit(series.unit)
    parts = []
    if model.rate:
        rate, half = model.rate_per_day()
        verb = "rises" if rate > 0 else "falls"
        words = f"{verb} by {_with_half(abs(rate) * MONTH, half * MONTH)} {unit} a month since {date_text(first)}"
        parts.append(" ".join(words.split()))
    for k, (size, half) in enumerate(model.step_sizes()):
        before, behind = (date_text(float(series.days[n])) for n in change.step_window(k))
        parts.append(f"steps by {_with_half(size, half)} {unit} between {before} and {behind}".replace("  ", " "))
    text = (
        f"{series.name} {' and '.join(parts)}: from {typed_number(*begin)} to {typed_number(*end)} {unit} on "
        f"{date_text(last)}"
    ).replace("  ", " ")
    relative = begin[0] * end[0] > 0 and not series.name.endswith(COMPENSATION_SUFFIX)
    text += f" ({_percent(begin[0], end[0])})." if relative else "."
    if change.rival is not None:
        text += f" {_describe_rival(change)}"
    return text


def _describe_rival(change: Change) -> str:
    """What fits about as well."""
    assert change.rival is not None
    what = {
        (True, 0): "a rate",
        (False, 1): "a step",
        (True, 1): "a rate and a step",
        (False, 2): "two steps",
    }[change.rival.rate, len(change.rival.steps)]
    return f"The dates fit {what} about as well; another record decides."


def _limit_sentence(history: History, change: Change) -> str:
    name = change.series.name
    at, unit = history.crossings[name], plain_unit(change.series.unit)
    where = f"{number(history.limits[name])} {unit}".strip()
    helps = name.endswith(COMPENSATION_SUFFIX)
    subject = "the compensation helps no more" if helps else f"{where} is reached"
    if at.state == "beyond":
        if helps:
            return "the compensation that is set does not help on the first date."
        return f"{where} is the value of the first date, or lies behind it."
    if at.state == "never":
        if not change.changed:
            return (
                f"{where} is not reached: no change is known beyond doubt."
                if not helps
                else "the compensation still helps."
            )
        return (
            "the compensation helps all the time."
            if helps
            else f"{where} is not reached: the value does not move towards it."
        )
    if at.state == "step":
        before, behind = (date_text(end) for end in at.interval)
        return f"{subject} between {before} and {behind}, by the step."
    low, high = (date_text(end) if math.isfinite(end) else "" for end in at.interval)
    interval = f"95 %: {low} to {high}" if low and high else f"95 %: not before {low}" if low else "95 %: open"
    if at.state == "passed":
        return f"{subject} since {date_text(at.day)} ({interval})."
    return f"{subject} on {date_text(at.day)} at this rate ({interval})."


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]


def _percent(before: float, after: float) -> str:
    share = 100 * (after - before) / abs(before)
    return f"{share:+.2g} %" if abs(share) < 100 else f"{share:+.0f} %"


def _with_half(value: float, half: float) -> str:
    return (
        f"{typed_number(value, half)} (95 %: {typed_number(value - half, half)} to {typed_number(value + half, half)})"
    )


def _scatter_sentence(one: Scatter) -> str:
    unit = plain_unit(one.unit)
    share = f" ({100 * one.between / abs(one.mean):.2g} %)" if one.mean else ""
    low, high = one.between_interval
    text = (
        f"{one.name}: {_with_half(one.mean, one.half)} {unit} over {one.machines} machines; between machines "
        f"{typed_number(one.between, one.between or 1)} {unit}{share}, 95 %: {typed_number(low, high)} to "
        f"{typed_number(high, high)}"
    )
    within = f"; within {typed_number(one.within, one.within)} {unit}" if one.within > 0 else ""
    return f"{text}{within}.".replace("  ", " ")


# --- Terminal, tables, CSV --------------------------------------------------------------------------------------------


def terminal_lines(history: History) -> list[str]:
    """The answers, and a table of all quantities."""
    heads, rows = _scatter_rows(history) if history.scatters else _change_rows(history)
    table = [[str(cell) for cell in row] for row in (heads, *rows)]
    widths = [max(len(row[k]) for row in table) for k in range(len(heads))]
    lines = [
        "  ".join(["", *(cell.ljust(width) for cell, width in zip(row, widths, strict=True))]).rstrip() for row in table
    ]
    return [*([] if history.scatters else answers(history)), *lines]


def _change_rows(history: History) -> Rows:
    rows: list[Sequence[str]] = []
    for one in history.ranked:
        series, model = one.series, one.model
        first, last = model.level(float(series.days[0]), 0), model.level(float(series.days[-1]))
        rate = _rate_text(model)
        steps = "; ".join(
            f"{typed_number(size, half)} at {date_text(float(series.days[k]))}"
            for k, (size, half) in zip(model.steps, model.step_sizes(), strict=True)
        )
        chance = f"{one.probability:.1g}" if testable(series) else "not tested"
        shown = [typed_number(*first), typed_number(*last)]
        if not testable(series):
            shown = [number(float(series.value[0])), number(float(series.value[-1]))]
        rows.append(
            (
                series.name,
                str(len(series.days)),
                *shown,
                plain_unit(series.unit),
                rate,
                steps,
                chance,
                _remark(one),
            )
        )
    return (
        "quantity",
        "dates",
        "first",
        "last",
        "unit",
        "rate per month",
        "steps",
        "chance of scatter",
        "remark",
    ), rows


def _rate_text(model: FittedChange) -> str:
    return _with_half(*(MONTH * part for part in model.rate_per_day())).replace("95 %: ", "") if model.rate else ""


def _remark(one: Change) -> str:
    """Scatter that the intervals do not hold, and what covariates explain."""
    parts = []
    if one.excess < SCATTERS and not testable(one.series):
        parts.append("differs by more than its intervals")
    elif one.excess < SCATTERS and one.model.tau2 > 0:
        spread, level = math.sqrt(one.model.tau2), abs(float(one.model.coefficients[0]))
        share = f" ({100 * spread / level:.2g} %)" if level else ""
        parts.append(
            f"scatters between records by {spread:.2g} {plain_unit(one.series.unit)}{share} besides its intervals"
        )
    parts += [f"{slope} over {name}" for name, slope, shown in _slopes(one) if shown]
    return "; ".join(parts).replace("  ", " ")


def _slopes(one: Change) -> Iterator[tuple[str, str, bool]]:
    """Covariates, their coefficients with intervals in words, and whether those do not hold 0."""
    for k, name in enumerate(one.series.columns, 1):
        spread = float(np.std(one.series.covariates[name]))
        value, half = (part / spread for part in one.model.coefficient(k))
        quantity_name, _, unit = name.partition("[")
        per = unit.rstrip("]").replace("degC", "K") or "1"
        slope = f"{_with_half(value, half)} {plain_unit(one.series.unit)}/{per}"
        yield quantity_name.strip(), slope, abs(value) > half


def _scatter_rows(history: History) -> Rows:
    rows: list[Sequence[str]] = []
    for one in history.scatters:
        low, high = one.between_interval
        within = typed_number(one.within, one.within) if math.isfinite(one.within) else "one result each"
        rows.append(
            (
                one.name,
                f"{one.records} of {one.machines}",
                _with_half(one.mean, one.half),
                plain_unit(one.unit),
                f"{typed_number(one.between, one.between)} ({typed_number(low, high)} to {typed_number(high, high)})",
                within,
                typed_number(one.predicted, one.predicted),
            )
        )
    heads = (
        "quantity",
        "results of machines",
        "mean (95 %)",
        "unit",
        "between machines (95 %)",
        "within",
        "new machine",
    )
    return heads, rows


def values_csv(history: History) -> str:
    """All values with their dates, as a list that feedsim history takes again."""
    conditions = list(dict.fromkeys(name for entry in history.entries for name in entry.conditions))
    heads = ("result", "date", "machine", "kind", "law", "quantity", "value", "unit", "sigma", "status", *conditions)
    rows = [
        (
            entry.name,
            entry.day,
            entry.owner if history.machines else entry.machine,
            entry.kind,
            entry.law,
            name,
            repr(value.value),
            value.unit,
            repr(value.sigma) if math.isfinite(value.sigma) else "",
            value.status,
            *(repr(entry.conditions[key]) if key in entry.conditions else "" for key in conditions),
        )
        for entry in history.entries
        for name, value in entry.values.items()
    ]
    runs = [
        (
            "",
            date_text(float(day)),
            "",
            "run",
            "",
            one.series.name,
            repr(float(value)),
            one.series.unit,
            "",
            "simulated",
            *[""] * len(conditions),
        )
        for one in history.changes
        if one.series.name in history.simulated
        for day, value in zip(one.series.days, one.series.value, strict=True)
    ]
    return sheets.text_of((heads, *rows, *runs))


def changes_csv(history: History) -> str:
    """A row a quantity: first and last level, rate, steps, chance, limit and its date."""
    heads = (
        "quantity",
        "unit",
        "dates",
        "first",
        "last",
        "changed",
        "rate per month",
        "rate low",
        "rate high",
        "steps",
        "chance",
        "threshold",
        "limit",
        "limit reached",
        "limit low",
        "limit high",
    )
    rows = []
    for one in history.ranked:
        series, model = one.series, one.model
        first, last = model.level(float(series.days[0]), 0)[0], model.level(float(series.days[-1]))[0]
        rate: Sequence[float | str] = ("", "", "")
        if model.rate:
            value, half = (MONTH * part for part in model.rate_per_day())
            rate = value, value - half, value + half
        steps = "; ".join(
            f"{size:+.6g} at {date_text(float(series.days[k]))}"
            for k, (size, _) in zip(model.steps, model.step_sizes(), strict=True)
        )
        at = history.crossings.get(series.name)
        limit: Sequence[float | str] = ("", "", "", "")
        if at is not None:
            ends = [date_text(end) if math.isfinite(end) else "" for end in at.interval]
            limit = history.limits[series.name], date_text(at.day) if math.isfinite(at.day) else at.state, *ends
        rows.append(
            (
                series.name,
                series.unit,
                len(series.days),
                first,
                last,
                "yes" if one.changed else "no",
                *rate,
                steps,
                one.probability if testable(series) else "",
                one.threshold or "",
                *limit,
            )
        )
    return sheets.text_of((heads, *rows))


def figures_of(history: History) -> Iterator[tuple[str, Figure]]:
    """Rates and last steps of what has changed; scatter of machines."""
    for one in history.changes:
        name, unit = one.series.name, one.series.unit
        if one.model.rate:
            per = "1/month" if unit == "1" else f"{unit}/month"
            yield f"{name}.rate", Figure(MONTH * one.model.rate_per_day()[0], per, f"rate of {name}")
        if one.model.steps:
            day = date_text(float(one.series.days[one.model.steps[-1]]))
            yield f"{name}.step", Figure(one.model.step_sizes()[-1][0], unit, f"last step of {name}, seen on {day}")
    for machine_scatter in history.scatters:
        yield (
            f"{machine_scatter.name}.mean",
            Figure(machine_scatter.mean, machine_scatter.unit, f"mean of {machine_scatter.name} over machines"),
        )
        yield (
            f"{machine_scatter.name}.between",
            Figure(
                machine_scatter.between,
                machine_scatter.unit,
                f"standard deviation of {machine_scatter.name} between machines",
            ),
        )
        if math.isfinite(machine_scatter.within):
            yield (
                f"{machine_scatter.name}.within",
                Figure(
                    machine_scatter.within,
                    machine_scatter.unit,
                    f"standard deviation of {machine_scatter.name} within a machine",
                ),
            )


def fleet_axes(history: History) -> dict[str, list[Scatter]]:
    """Axis -> scatter of its parameters; figures of other kinds are no parameters."""
    kinds = {name for entry in history.entries if entry.kind in ("identify", "identify-drive") for name in entry.values}
    result: dict[str, list[Scatter]] = {}
    for one in history.scatters:
        if one.name in kinds:
            result.setdefault(one.name.partition(".")[0], []).append(one)
    return result


# --- Page and summary -------------------------------------------------------------------------------------------------


def report_of(history: History, figures: Mapping[str, Figure]) -> Report:
    """Content of the report."""
    heads, rows = _scatter_rows(history) if history.scatters else _change_rows(history)
    letters = "lrrlrrr" if history.scatters else "lrrrlrlrp"
    table = Table(letters, [_capital(head) for head in heads], [[code(row[0]), *map(typeset, row[1:])] for row in rows])
    if history.scatters:
        method = FLEET_METHOD
        subtitle = f"{count_things(len(history.entries), 'result')} of {len(history.machines)} machines"
        prior = {"traces": ["log.csv"], "prior": f"{FOLDER}/{FLEET}"}
        next_step = Step("Use it for a further machine, here with its log in log.csv", "identify friction", prior)
    else:
        method = METHOD.format(rate=100 * ERROR_RATE, tested=history.tested)
        subtitle = (
            " to ".join(date_text(edge) for edge in _span(history))
            + f", {count_things(len(history.entries), 'result')}"
        )
        values = {"results": [f"{FOLDER}/{VALUES}"], "out": f"{FOLDER}_next"}
        next_step = Step(
            "Go on with this history; further results stand behind it, each with its date", "history", values
        )
    pictures = [_picture(one, history) for one in history.ranked]
    return Report(
        "Scatter between machines" if history.scatters else "History",
        subtitle,
        answer=answers(history),
        warnings=history.findings,
        tiles=_tiles(history),
        next_step=next_step,
        main=[
            Section("All quantities", [table]),
            *pictures,
            _machines_picture(history) if history.scatters else None,
            Section("Results", [_entries_table(history)]),
        ],
        provenance=provenance_section(
            [("Scenario", history.scenario)] if history.scenario else [],
            hash_files([("result", f) for f in history.files]),
        ),
        footer=f"{method}. All values: {VALUES}.",
    )


def _tiles(history: History) -> list[Tile]:
    tiles = []
    for one in history.ranked:
        if not one.changed:
            continue
        series, model = one.series, one.model
        first, last = model.level(float(series.days[0]), 0)[0], model.level(float(series.days[-1]))[0]
        tiles.append(
            Tile(
                minus(_percent(first, last) if first else number(last - first)),
                f"{series.name} since the first date",
                typeset(sentence(one, history)),
            )
        )
    return tiles


def _entries_table(history: History) -> Table:
    rows: list[tuple[Text, ...]] = [
        (
            entry.day or "–",
            entry.owner if history.machines else entry.machine or "–",
            entry.kind,
            code(entry.name),
            ", ".join(f"{key} {value:g}" for key, value in entry.conditions.items()),
        )
        for entry in sorted(history.entries, key=lambda entry: (entry.owner if history.machines else "", entry.days))
    ]
    return Table("llllp", ("Date", "Machine", "Kind", "Result", "Conditions"), rows)


def _picture(change: Change, history: History) -> Picture:
    """Values with their intervals over the date, the fitted change, and the limit."""
    series, model = change.series, change.model
    start = float(series.days[0])
    months = (series.days - start) / MONTH
    half = NORMAL_95 * np.nan_to_num(series.sigma)
    value = model.adjusted_values()
    curves = [
        Curve("95 %", np.array([x, x]), np.array([y - h, y + h]), MUTED, width=1.0)
        for x, y, h in zip(months, value, half, strict=True)
        if h > 0
    ]
    if series.columns:
        curves.append(Curve("as it was", months, series.value, ALTERNATIVE_COLOUR, dots=True))
    curves.append(Curve("value", months, value, RECORDED_COLOUR, dots=True))
    bands = []
    edges = [start, *(float(series.days[k]) for k in model.steps), _end(change, history)]
    for k in range(len(edges) - 1):
        days = np.linspace(edges[k], edges[k + 1], CURVE_POINTS)
        level = np.array([model.level(float(day), k) for day in days])
        x = (days - start) / MONTH
        curves.append(Curve("model", x, level[:, 0], SIMULATED_COLOUR))
        bands.append(
            Band("95 % of the model", level[:, 0] - level[:, 1], level[:, 0] + level[:, 1], x, SIMULATED_COLOUR)
        )
    levels = []
    if series.name in history.limits:
        levels.append(Level(history.limits[series.name], "limit", colour=RESIDUAL_COLOUR))
        at = history.crossings[series.name]
        if at.state in ("ahead", "passed"):
            levels.append(
                Level((at.day - start) / MONTH, date_text(at.day), upright=True, colour=RESIDUAL_COLOUR, dash="dotted")
            )
    text = sentence(change, history) if change.changed else f"{series.name} has not changed beyond doubt."
    remark = _remark(change)
    caption = typeset(f"{text}{f' It {remark}.' if remark.startswith(('scatters', 'differs')) else ''}")
    if series.columns:
        caption += f" Values are those at the mean {' and '.join(name.partition(' [')[0] for name in series.columns)}."
    whole = (edges[-1] - start) / MONTH
    x_axis = Axis(f"months since {date_text(start)}", span=(-0.03 * whole, 1.03 * whole))
    panel = Panel(
        series.name,
        x_axis,
        Axis(series.name, display_unit(series.unit), span=_heights(curves, levels)),
        curves,
        levels,
        bands,
    )
    stem = "".join(c if c.isalnum() or c in "_-" else "-" for c in series.name)
    return Picture(f"history-{stem}", series.name, caption, Chart([panel]))


def _heights(curves: Sequence[Curve], levels: Sequence[Level]) -> tuple[float, float]:
    """Ordinates with room about them; a limit is in sight."""
    y = np.concatenate([*(curve.y for curve in curves), [level.at for level in levels if not level.upright]])
    low, high = float(y.min()), float(y.max())
    room = 0.06 * (high - low) or 0.05 * abs(high) or 1.0
    return low - room, high + room


def _end(change: Change, history: History) -> float:
    """Up to which day a model is drawn: the last record, or the date of the limit, as long as that is near."""
    days = change.series.days
    at = history.crossings.get(change.series.name)
    last, span = float(days[-1]), float(np.ptp(days))
    return min(max(last, at.day), last + 2 * span) if at is not None and at.state == "ahead" else last


def _machines_picture(history: History) -> Picture:
    """Every value over its machine, relative to the mean of all."""
    panels = []
    names = history.machines
    for one in history.scatters:
        x, y = [], []
        for k, owner in enumerate(names):
            for entry in history.entries:
                if entry.owner == owner and one.name in entry.values and entry.values[one.name].status == "estimated":
                    x.append(float(k))
                    y.append(entry.values[one.name].value)
        curves = [Curve("value", np.array(x), np.array(y), RECORDED_COLOUR, dots=True)]
        band = [
            Band(
                "mean ± between",
                one.mean - one.between,
                one.mean + one.between,
                np.array([-0.5, len(names) - 0.5]),
                ALLOWED_COLOUR,
            )
        ]
        panels.append(
            Panel(
                one.name,
                Axis("", names=names, span=(-0.5, len(names) - 0.5)),
                Axis(one.name, display_unit(one.unit)),
                curves,
                [Level(one.mean, colour=INK)],
                band,
            )
        )
    caption = "Every value, the mean of the machines, and the standard deviation between them."
    return Picture("machines", "Values of the machines", caption, Chart(panels, (1.0, 1.0)))


def details(history: History) -> dict[str, Any]:
    """What summary.json has besides the figures."""
    content: dict[str, Any] = {"format": FORMAT}
    if history.scatters:
        content["machines"] = list(history.machines)
        content["scatter"] = {one.name: _scatter_part(one) for one in history.scatters}
    else:
        content |= {
            "error_rate": ERROR_RATE,
            "tested": history.tested,
            "quantities": {one.series.name: _change_part(one, history) for one in history.changes},
        }
    return content | {
        "results": [
            {
                "name": entry.name,
                "date": entry.day or None,
                "machine": entry.owner,
                "kind": entry.kind,
                "conditions": dict(entry.conditions),
            }
            for entry in history.entries
        ],
        "scenario": history.scenario or None,
        "settings": dict(history.settings),
        "inputs": inputs_part(hash_files([("result", file) for file in history.files])),
    }


def _change_part(one: Change, history: History) -> dict[str, Any]:
    series, model = one.series, one.model
    first, last = model.level(float(series.days[0]), 0), model.level(float(series.days[-1]))
    content: dict[str, Any] = {
        "unit": series.unit,
        "dates": [date_text(float(day)) for day in series.days],
        "values": [float(value) for value in series.value],
        "sigma": [finite(float(sigma)) for sigma in series.sigma],
        "changed": one.changed,
        "chance": one.probability if testable(series) else None,
        "threshold": one.threshold or None,
        "first": _level_part(first),
        "last": _level_part(last),
        "scatter_between_records": math.sqrt(model.tau2),
        "rate": None,
        "steps": [],
    }
    if model.rate:
        rate, half = (MONTH * part for part in model.rate_per_day())
        content["rate"] = {"value": rate, "unit": f"{series.unit}/month", "interval": [rate - half, rate + half]}
    for k, (size, half) in enumerate(model.step_sizes()):
        between = [date_text(float(series.days[n])) for n in one.step_window(k)]
        content["steps"].append({"value": size, "interval": [size - half, size + half], "between": between})
    if one.rival is not None:
        content["not_told_from"] = {"rate": one.rival.rate, "steps": len(one.rival.steps)}
    content["conditions"] = {name: slope for name, slope, _ in _slopes(one)}
    if series.name in history.limits:
        at = history.crossings[series.name]
        content["limit"] = {
            "value": history.limits[series.name],
            "state": at.state,
            "date": date_text(at.day) if math.isfinite(at.day) else None,
            "interval": [date_text(end) if math.isfinite(end) else None for end in at.interval],
        }
    return content


def _level_part(level: tuple[float, float]) -> dict[str, Any]:
    return {"value": level[0], "interval": [level[0] - level[1], level[0] + level[1]]}


def _scatter_part(one: Scatter) -> dict[str, Any]:
    return {
        "unit": one.unit,
        "machines": one.machines,
        "results": one.records,
        "mean": {"value": one.mean, "interval": [one.mean - one.half, one.mean + one.half]},
        "between": {"value": one.between, "interval": list(one.between_interval)},
        "within": {"value": finite(one.within), "interval": [finite(end) for end in one.within_interval]},
        "new_machine": one.predicted,
    }
