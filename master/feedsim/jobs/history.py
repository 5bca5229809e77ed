"""Results of months beside each other: what has changed, and when a limit is reached."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from feedsim.analysis import FigureTable
from feedsim.analysis.history import Array, Scatter, Series, changes, find_limit_crossing, scatter
from feedsim.estimation.identify.friction_file import fleet_yaml
from feedsim.estimation.least_squares import NORMAL_95
from feedsim.files.sheets import read_rows
from feedsim.files.source import json_file
from feedsim.files.trace.trace import MAX_MAGNITUDE
from feedsim.foundation.arguments import (
    Pairs,
    Value,
    amount,
    pairs,
    prefix_argument_errors,
    settings,
    spell_argument,
    split_names,
)
from feedsim.foundation.errors import Finding, InputError, find_nearest_name, shorten_list
from feedsim.jobs.parameters import (
    NO_WATCH,
    Archives,
    Argument,
    FigureKinds,
    File,
    Force,
    Option,
    Settings,
    Watch,
    job,
    output_option,
)
from feedsim.jobs.result import Kind, Result, claim_result_folder
from feedsim.jobs.run import load, run
from feedsim.report import history as page
from feedsim.report.history import Entry, FollowedValue, History
from feedsim.report.results import SUMMARY, Content
from feedsim.scenario import Friction, GmsFriction
from feedsim.scenario.roles import GMS

FORM = "YYYY-MM-DD or YYYY-MM-DDThh:mm"
COMPENSATIONS = ("friction_pulse", "friction_table")  # groups of a drive that compensate friction
LIST_COLUMNS = ("result", "date", "machine", "kind", "law", "quantity", "value", "unit", "sigma", "status")
EXAMPLE = "results/z_march@2026-03-01"
TEMPERATURE = "temperature [degC]"  # condition that results have by themselves


KIND = Kind("history", page.FILES, keeps=(page.FLEET,))


def result_of(history: History) -> Result[History]:
    """Results over time: values with their dates, what has changed of them, and the scatter between machines."""
    figures = FigureTable(page.figures_of(history))

    def files() -> Mapping[str, Content]:
        fleet = {page.FLEET: fleet_yaml(page.fleet_axes(history), history.machines)} if history.scatters else {}
        return {page.VALUES: page.values_csv(history), **(fleet or {page.CHANGES: page.changes_csv(history)})}

    return Result(
        KIND,
        history,
        partial(page.report_of, history, figures),
        figures=figures,
        details=partial(page.details, history),
        files=files,
        inputs=history.files,
        lines=partial(page.terminal_lines, history),
    )


@job("what has changed over months, from results with their dates")
def history(
    results: Annotated[
        str | Path | Sequence[str | Path],
        Argument(
            "RESULT",
            "folder of a result, with its date behind an @ where the result has none; or a CSV list of results or "
            "values (docs/history.md)",
            many=True,
        ),
    ],
    quantities: Annotated[
        str | Sequence[str],
        Option(
            "NAMES",
            "quantities that are looked at, such as Z.F_C,Z.sigma_2: fewer make each test sharper (default: all)",
        ),
    ] = (),
    *,
    limit: Annotated[
        Pairs[Value],
        Option(
            "QUANTITY=VALUE",
            "when a quantity reaches a value, e.g. F_C_Z='3 N.m'; with a scenario also a figure of its run, e.g. "
            "XZ.peak_Z='6 um'",
            many=True,
        ),
    ] = None,
    scenario: Annotated[
        File | None, Option("SCENARIO", "is run with the friction of each date, for limits of its figures")
    ] = None,
    set: Settings = None,
    machines: Annotated[
        bool,
        Option(
            "",
            "results are of several machines of one kind (column machine of a list, else the folder that a "
            "result lies in): scatter between and within them, and fleet.yaml for identify friction --prior",
        ),
    ] = False,
    fmus: Archives = None,
    out: Annotated[File | None, output_option("history")] = None,
    figures: FigureKinds = (),
    force: Force = False,
    watch: Watch = NO_WATCH,
) -> Result[History]:
    """Lay results of several dates beside each other: what has changed, at which rate, and when a limit is reached.

    Takes results of identify friction, identify drive, circle and replay. A change is named where the test of
    'constant' over all dates fails at 1 %, corrected for the number of quantities. A step, such as a lost preload or a
    lubrication, is distinguished from a rate, such as wear. Scatter between records counts, whether the intervals of
    the results hold it or not. With --machines the results are of several machines, and their scatter becomes a prior.

    Command line:
        feedsim example z_wear ball_screw fleet xz_circle
        feedsim history histories/z_wear.csv --limit F_C_Z="1.2 N.m"
        feedsim history histories/ball_screw.csv --scenario xz_circle.yaml --limit XZ.peak_Z="6 um"
        feedsim history results/z_january@2026-01-12 results/z_april@2026-04-13 results/z_july@2026-07-13
        feedsim history histories/fleet.csv --machines --out results/fleet

    Raises:
        InputError: a faulty file, a date that is missing or given twice, results that do not go together, one date
            alone.
        SimulationError: a unit failed.
        OutputError: `out` cannot be written.

    >>> import feedsim as fs
    >>> paths = fs.example("z_wear")
    >>> result = fs.history("histories/z_wear.csv", limit={"Z.F_C": "1.2 N.m"})
    >>> result.figures["Z.F_C.rate"].unit
    'N.m/month'
    """
    names = [results] if isinstance(results, str | Path) else results
    entries = [entry for name in names for entry in _entries(str(name))]
    if not entries:
        raise InputError(f"nothing to compare: a result is needed, for example {EXAMPLE}")
    if machines and (limit or scenario is not None):
        raise InputError(
            f"{spell_argument('machines')}: limits are of one machine; leave {spell_argument('limit')} or it out"
        )
    _check_same(entries, machines)
    chosen = [_find_quantity(name, entries) for name in split_names(quantities)]
    files = list(dict.fromkeys(entry.file for entry in entries))
    files += [Path(scenario)] if scenario is not None else []
    texts = settings(set)
    limits = pairs("limit", limit, "QUANTITY=VALUE is needed, e.g. F_C_Z='3 N.m'")
    asked = {
        "quantities": ",".join(chosen), "limit": ",".join(f"{name}={value}" for name, value in limits.items()),
        "set": " ".join(texts), "machines": "yes" if machines else "",
    }  # fmt: skip
    asked = {name: text for name, text in asked.items() if text}
    with claim_result_folder(out, KIND, watch, files, [f"{name}={text}" for name, text in asked.items()], force=force):
        if machines:
            fields = _of_machines(entries, chosen)
        else:
            fields = _of_dates(entries, chosen, limits, scenario, texts, fmus, watch)
        result = result_of(History(entries, files=files, settings=asked, scenario=str(scenario or ""), **fields))
        if out is not None:
            result.save(out, figures=figures, force=force)
    return result


# --- Results and lists as entries -------------------------------------------------------------------------------------


def _entries(name: str) -> Iterator[Entry]:
    """What a result, or a list, holds."""
    path, moment = Path(name), None
    before, at, after = name.rpartition("@")
    if at and not path.exists():
        path, moment = Path(before), _moment(after, name)
    if not path.exists():
        raise InputError(f"no such file or folder: {path}")
    if path.suffix.lower() == ".csv":
        if moment is not None:
            raise InputError(f"{name}: the dates of a list stand in its column date")
        yield from _read_list(path)
    else:
        yield _of_result(path, name, moment)


def _moment(text: str, where: str) -> datetime:
    try:
        moment = datetime.fromisoformat(text.strip())
    except ValueError:
        raise InputError(f"{where}: {text!r} is no date; {FORM} is needed") from None
    return moment.astimezone(UTC).replace(tzinfo=None) if moment.tzinfo else moment


def _of_result(
    path: Path, name: str, moment: datetime | None, machine: str = "", conditions: Mapping[str, float] | None = None
) -> Entry:
    """A folder of a result, or its summary.json."""
    file = path / SUMMARY if path.is_dir() else path
    if not file.is_file():
        raise InputError(f"{path}: holds no result of feedsim ({SUMMARY})")
    content = json_file(file)
    try:
        kind = str(content["kind"])
        values = dict(_values_of(kind, content))
        recorded = content.get("recorded")
        warm = (content.get("temperature") or {}).get("value")
        known = {TEMPERATURE: float(warm)} if warm is not None else {}
        own = (content.get("machine") or {}).get("name", "") if isinstance(content.get("machine"), dict) else ""
        law = content.get("settings", {}).get("law", Friction.law) if kind == "identify" else ""
    except (KeyError, TypeError, AttributeError, ValueError, OverflowError):
        raise InputError(f"{file}: is no summary of a result that this version can read") from None
    values = {name: one for name, one in values.items() if abs(one.value) <= MAX_MAGNITUDE and not one.sigma < 0}
    if not values:
        raise InputError(f"{file}: a result of kind {kind} holds no values to follow")
    if moment is None and recorded:
        moment = _moment(str(recorded), str(file))
    folder = file.absolute().parent
    return Entry(
        name,
        file,
        kind,
        moment,
        machine or own,
        machine or folder.parent.name,
        law,
        values,
        known | dict(conditions or {}),
    )


def _values_of(kind: str, content: Mapping[str, Any]) -> Iterator[tuple[str, FollowedValue]]:
    if kind == "identify":
        yield from _parameters(content["axis"], content["parameters"])
    elif kind == "identify-drive":
        for axis, group in content["axes"].items():
            yield from _parameters(axis, group["parameters"])
    else:
        half = {
            f"{prefix}.{cause['name']}": cause["half_interval"] / abs(cause["value"])
            for prefix, part in content.get("diagnosis", {}).items()
            for cause in part.get("causes", ())
            if cause.get("half_interval") is not None and cause.get("value")
        }
        for name, figure in content["figures"].items():
            if figure["value"] is not None:
                sigma = half.get(name, math.nan) * abs(figure["value"]) / NORMAL_95
                yield name, FollowedValue(float(figure["value"]), figure["unit"], sigma)


def _parameters(axis: str, values: Mapping[str, Any]) -> Iterator[tuple[str, FollowedValue]]:
    for name, entry in values.items():
        if entry["value"] is None:
            continue
        sigma = math.nan if entry["sigma"] is None else float(entry["sigma"])
        yield f"{axis}.{name}", FollowedValue(float(entry["value"]), entry["unit"], sigma, entry["status"])


def _read_list(path: Path) -> Iterator[Entry]:
    """Rows of a list: results with their dates, or values."""
    try:
        text = path.read_text(encoding="utf-8-sig").splitlines()
        rows = [
            (n, row)
            for n, line in enumerate(text, 1)
            if line.strip() and not line.startswith("#")
            for row in read_rows([line])
        ]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read: {error}") from None
    if not rows:
        raise InputError(
            f"{path}: is empty; a header with {' or '.join(LIST_COLUMNS[:1] + LIST_COLUMNS[5:6])} is needed"
        )
    heads = [head.strip() for head in rows[0][1]]
    values = "quantity" in heads
    needed = ("date", "quantity", "value", "unit") if values else ("result", "date")
    if missing := [head for head in needed if head not in heads]:
        raise InputError(
            f"{path}:{rows[0][0]}: no column {missing[0]}; columns of a list: result,date, or "
            "date,quantity,value,unit,sigma"
        )
    table = []
    for line, cells in rows[1:]:
        if len(cells) != len(heads):
            raise InputError(f"{path}:{line}: {len(cells)} cells, the header has {len(heads)}")
        table.append((f"{path}:{line}", dict(zip(heads, (cell.strip() for cell in cells), strict=True))))
    conditions = [head for head in heads if head not in LIST_COLUMNS]
    if not values:
        for where, row in table:
            moment = _moment(row["date"], where) if row["date"] else None
            yield _of_result(
                path.parent / row["result"],
                row["result"],
                moment,
                row.get("machine", ""),
                _conditions(row, conditions, where),
            )
        return
    yield from _of_values(path, table, conditions)


def _of_values(
    path: Path, table: Sequence[tuple[str, Mapping[str, str]]], conditions: Sequence[str]
) -> Iterator[Entry]:
    groups: dict[tuple[str, ...], list[tuple[str, Mapping[str, str]]]] = {}
    for where, row in table:
        key = tuple(row.get(name, "") for name in ("result", "date", "machine", "kind", "law"))
        groups.setdefault(key, []).append((where, row))
    for (result, day, machine, kind, law), rows in groups.items():
        fields: dict[str, FollowedValue] = {}
        for where, row in rows:
            if row["quantity"] in fields:
                raise InputError(f"{where}: {row['quantity']} is there twice of {day or 'one result'}")
            value = _number(row["value"], where, "value")
            sigma = _number(row["sigma"], where, "sigma") if row.get("sigma") else math.nan
            if sigma < 0:
                raise InputError(f"{where}: sigma {sigma:g}; a standard deviation is not below 0")
            fields[row["quantity"]] = FollowedValue(value, row["unit"], sigma, row.get("status") or "estimated")
        where, first = rows[0]
        moment = _moment(day, where) if day else None
        name = result or f"{path.name} of {day or machine}"
        yield Entry(
            name,
            path,
            kind or "identify",
            moment,
            machine,
            machine or path.stem,
            law or Friction.law,
            fields,
            _conditions(first, conditions, where),
        )


def _conditions(row: Mapping[str, str], names: Sequence[str], where: str) -> dict[str, float]:
    return {name: _number(row[name], where, name) for name in names if row[name]}


def _number(text: str, where: str, name: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) <= MAX_MAGNITUDE:
        raise InputError(f"{where}: {name} {text!r}; a number up to {MAX_MAGNITUDE:g} is needed")
    return value


def _check_same(entries: Sequence[Entry], machines: bool) -> None:
    """InputError: results that do not go together."""
    laws = {entry.law: entry.name for entry in entries if entry.kind == "identify"}
    if len(laws) > 1:
        (a, first), (b, second) = list(laws.items())[:2]
        raise InputError(
            f"{first} is of the friction law {a}, {second} of {b}: their parameters do not mean the same; identify all "
            "with one --law"
        )
    owners = {entry.machine: entry.name for entry in entries if entry.machine}
    if not machines and len(owners) > 1:
        (a, first), (b, second) = list(owners.items())[:2]
        raise InputError(
            f"{first} is of the machine {a}, {second} of {b}: a history is of one machine; for the scatter "
            f"between several give {spell_argument('machines')}"
        )
    units: dict[str, tuple[str, str]] = {}
    for entry in entries:
        for name, followed in entry.values.items():
            unit, before = units.setdefault(name, (followed.unit, entry.name))
            if unit != followed.unit:
                raise InputError(f"{name} is in {unit} in {before}, in {followed.unit} in {entry.name}")


def _find_quantity(name: str, entries: Sequence[Entry], more: str = "") -> str:
    """The quantity that is meant: "Z.F_C", or "F_C_Z". InputError: there is none."""
    known = list(dict.fromkeys(name for entry in entries for name in entry.values))
    result = _match_quantity(name, known)
    if result is None:
        near = find_nearest_name(name, known)
        there = f"did you mean {near}?" if near else f"there are {shorten_list(known, 20)}"
        raise InputError(f"no quantity {name!r}; {there}{more}")
    return result


def _match_quantity(name: str, known: Sequence[str]) -> str | None:
    parameter, _, axis = name.rpartition("_")
    return next((quantity for quantity in (name, f"{axis}.{parameter}") if quantity in known), None)


# --- One machine over time --------------------------------------------------------------------------------------------


def _of_dates(
    entries: Sequence[Entry],
    chosen: Sequence[str],
    asked: Mapping[str, Value],
    scenario: File | None,
    texts: Sequence[str],
    fmus: File | None,
    watch: Watch,
) -> dict[str, Any]:
    """Fields of a History of one machine."""
    for entry in entries:
        if entry.moment is None:
            raise InputError(f"{entry.name}: its record has no date; give one, for example {EXAMPLE}, or a list (CSV)")
    series, findings = _series(entries, chosen)
    known = [one.name for one in series]
    limits: dict[str, float] = {}
    simulated: list[str] = []
    for name, value in asked.items():
        with prefix_argument_errors("limit", f"{name}={value}"):
            meant = _match_quantity(name, known)
            if meant is None and scenario is None:
                more = f"; a figure of a run needs {spell_argument('scenario')}"
                _find_quantity(name, entries, more)
                raise InputError(
                    f"{name} is determined on one date alone, or is not among {spell_argument('quantities')}"
                )
            if meant is None:
                simulated.append(name)
            else:
                unit = next(one.unit for one in series if one.name == meant)
                limits[meant] = amount(value, unit, f"3 {unit}")
    if scenario is not None and not simulated:
        raise InputError(
            f"{spell_argument('scenario')} {scenario}: no {spell_argument('limit')} is of a figure of its run"
        )
    runs: list[Series] = []
    if scenario is not None:
        runs = _simulate_figures(entries, simulated, scenario, texts, fmus, watch)
        for one in runs:
            if one.name in asked:
                with prefix_argument_errors("limit", f"{one.name}={asked[one.name]}"):
                    limits[one.name] = amount(asked[one.name], one.unit, f"3 {one.unit}", positive=True)
            else:
                limits[one.name] = 0.0
    results = changes([*series, *runs])
    # Against no compensation a figure is below 0 as long as that helps.
    crossings = {
        one.series.name: find_limit_crossing(
            one.model, limits[one.series.name], 1 if one.series.name.endswith(page.COMPENSATION_SUFFIX) else 0
        )
        for one in results
        if one.series.name in limits
    }
    return {
        "changes": results,
        "limits": limits,
        "crossings": crossings,
        "findings": findings,
        "simulated": [one.name for one in runs],
    }


def _series(entries: Sequence[Entry], chosen: Sequence[str]) -> tuple[list[Series], list[Finding]]:
    """Every quantity that two dates determine, and what was left out."""
    order = sorted(entries, key=lambda entry: entry.moment or datetime.min)
    names = chosen or list(dict.fromkeys(name for entry in order for name in entry.values))
    result, findings = [], list[Finding]()
    for name in names:
        rows = [(entry, entry.values[name]) for entry in order if name in entry.values]
        good = [(entry, value) for entry, value in rows if value.status == "estimated"]
        omitted = [f"{entry.day} ({value.status})" for entry, value in rows if value.status != "estimated"]
        for (a, _), (b, _) in pairwise(good):
            if a.moment == b.moment:
                raise InputError(
                    f"{a.name} and {b.name}: both have {name} of {a.day}; give the times, too (T14:30), or leave one "
                    "of them out"
                )
        if good and omitted:
            text = f"{name}: left out, as not determined by the record: {shorten_list(omitted, 6)}"
            findings.append(Finding("parameter-undetermined", "note", text, name))
        if len(good) < 2:
            if good and len(order) > 1:
                text = f"{name}: determined on {good[0][0].day} alone, so it has no history"
                findings.append(Finding("history-of-one-date", "note", text, name))
            continue
        conditions = _common([entry for entry, _ in good])
        for key in dict.fromkeys(key for entry, _ in good for key in entry.conditions):
            if key not in conditions:
                text = f"{key}: some dates lack it, so it is not used"
                findings.append(Finding("condition-incomplete", "note", text, key))
        result.append(
            Series(
                name,
                good[0][1].unit,
                np.array([entry.days for entry, _ in good]),
                np.array([value.value for _, value in good]),
                np.array([value.sigma for _, value in good]),
                conditions,
            )
        )
    if not result:
        many = len(order)
        if many == 1:
            raise InputError(
                f"{order[0].name}: one date alone has no history; two show a difference, three or more a change"
            )
        axes = ", ".join(dict.fromkeys(name.partition(".")[0] for entry in order for name in entry.values))
        raise InputError(f"{many} results share no quantity that two dates determine (they are of {axes})")
    return result, list(dict.fromkeys(findings))


def _common(entries: Sequence[Entry]) -> dict[str, Array]:
    """Conditions that all records have."""
    return {
        key: np.array([entry.conditions[key] for entry in entries])
        for key in entries[0].conditions
        if all(key in entry.conditions for entry in entries)
    }


def _simulate_figures(
    entries: Sequence[Entry],
    names: Sequence[str],
    scenario: File,
    texts: Sequence[str],
    fmus: File | None,
    watch: Watch,
) -> list[Series]:
    """Magnitudes of figures of the scenario's run with the friction of each date; where the machine compensates
    friction, also how much larger each is than without."""
    order = sorted((entry for entry in entries if _frictions(entry)), key=lambda entry: entry.moment or datetime.min)
    if len(order) < 2:
        raise InputError(
            f"{spell_argument('scenario')} {scenario}: two results with friction are needed; there are {len(order)}"
        )
    days: list[float] = []
    dated: list[Entry] = []
    columns: dict[str, list[float]] = {}
    units: dict[str, str] = {}
    friction: dict[str, str] = {}
    for k, entry in enumerate(order):
        watch.progress("runs", k, len(order))
        friction |= _frictions(entry)
        plan = load(scenario, [*texts, *settings(friction)])
        figures = run(plan, fmus=fmus).figures
        for name in names:
            if name not in figures:
                near = find_nearest_name(name, list(figures))
                there = f"did you mean {near}?" if near else f"there are {shorten_list(list(figures), 12)}"
                raise InputError(f"{spell_argument('limit')} {name}: no figure of {scenario}; {there}")
        axes = {
            name: axis.model_copy(update={"drive": axis.drive.model_copy(update=off)})
            for name, axis in plan.machine.axes.items()
            if (off := {group: None for group in COMPENSATIONS if getattr(axis.drive, group, None) is not None})
        }
        values = {name: abs(figures[name].value) for name in names}
        units |= {name: figures[name].unit for name in names}
        if axes:
            machine = plan.machine.model_copy(update={"axes": {**plan.machine.axes, **axes}})
            without = run(plan.model_copy(update={"machine": machine}), fmus=fmus).figures
            values |= {
                f"{name} {page.COMPENSATION_SUFFIX}": abs(figures[name].value) - abs(without[name].value)
                for name in names
            }
            units |= {f"{name} {page.COMPENSATION_SUFFIX}": figures[name].unit for name in names}
        if days and entry.days == days[-1]:  # another axis on the same day
            for name, value in values.items():
                columns[name][-1] = value
            continue
        days.append(entry.days)
        dated.append(entry)
        for name, value in values.items():
            columns.setdefault(name, []).append(value)
    watch.progress("runs", len(order), len(order))
    result = []
    for name, column in columns.items():
        followed = np.array(column)
        if not np.all(np.isfinite(followed)):
            day = page.date_text(days[int(np.argmin(np.isfinite(followed)))])
            raise InputError(f"{name}: the run with the friction of {day} does not determine it")
        result.append(
            Series(name, units[name], np.array(days), followed, np.full(len(followed), math.nan), _common(dated))
        )
    return result


def _frictions(entry: Entry) -> dict[str, str]:
    """Key of a scenario -> parameter of friction, as a result of identify friction has it."""
    if entry.kind != "identify":
        return {}
    model = GmsFriction if entry.law == GMS else Friction
    return {
        f"machine.axes.{axis}.friction.{parameter}": f"{followed.value!r} {followed.unit}".removesuffix(" 1")
        for (axis, _, parameter), followed in ((name.partition("."), value) for name, value in entry.values.items())
        if parameter in model.model_fields
    }


# --- Several machines -------------------------------------------------------------------------------------------------


def _of_machines(entries: Sequence[Entry], chosen: Sequence[str]) -> dict[str, Any]:
    """Fields of a History of several machines."""
    owners = list(dict.fromkeys(entry.owner for entry in entries))
    if len(owners) < 2:
        raise InputError(
            f"{spell_argument('machines')}: all results are of {owners[0]}; two machines are needed, named in a "
            f"list's column "
            "machine, or by a folder each"
        )
    names = chosen or list(dict.fromkeys(name for entry in entries for name in entry.values))
    scatters: list[Scatter] = []
    findings: list[Finding] = []
    for name in names:
        groups = []
        for owner in owners:
            good = [
                entry.values[name]
                for entry in entries
                if entry.owner == owner and name in entry.values and entry.values[name].status == "estimated"
            ]
            if good:
                groups.append((np.array([v.value for v in good]), np.array([v.sigma for v in good])))
        if len(groups) < 2:
            if groups:
                text = f"{name}: determined of one machine alone, so nothing is known of its scatter"
                findings.append(Finding("scatter-unknown", "note", text, name))
            continue
        if len(groups) < len(owners):
            text = f"{name}: determined of {len(groups)} of {len(owners)} machines"
            findings.append(Finding("scatter-of-some-machines", "note", text, name))
        unit = next(entry.values[name].unit for entry in entries if name in entry.values)
        scatters.append(scatter(name, unit, groups))
    if not scatters:
        raise InputError(f"{len(owners)} machines share no quantity that their results determine")
    return {"scatters": scatters, "machines": owners, "findings": findings}
