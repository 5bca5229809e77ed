"""summary.json of an identification, the table for the terminal, and the CSV files."""

from __future__ import annotations

import math
import shlex
import textwrap
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from feedsim.estimation.identify import IdentifiedFriction, friction_file
from feedsim.estimation.identify.friction_file import FRICTION_FILE
from feedsim.estimation.identify.read import recording_day, recording_temperature
from feedsim.estimation.identify.result import Balance, Estimate, Identification
from feedsim.files.trace.cells import quote_cell, shortest_numbers
from feedsim.foundation.errors import Finding
from feedsim.report.formatting import Array, count_things
from feedsim.report.identify import stribeck_plots as quantities
from feedsim.report.identify.stribeck_plots import MM_PER_MIN
from feedsim.report.provenance import finite, inputs_part, machine_part, quantity

FORMAT = 1
TABLE_COLUMNS = 118  # columns of the terminal's table


def details(identified: IdentifiedFriction) -> dict[str, Any]:
    """What summary.json has besides the figures; what could not be determined is null."""
    identification = identified.found
    return {
        "format": FORMAT,
        "advice": list(identification.advice),
        "axis": identification.axis,
        "date": identified.date,
        "recorded": recording_day(identified.sources),
        "temperature": quantity(recording_temperature(identified.sources), "degC"),
        "lead": quantity(identification.I_P, "m/rad"),
        "parameters": {
            name: _estimate(estimate, identification.I_P) for name, estimate in identification.estimates.items()
        },
        "rigid_axis": {
            name: _estimate(estimate, identification.I_P) for name, estimate in identification.rigid.items()
        },
        "correlation": {
            "names": list(identification.correlation.names),
            "matrix": _matrix(identification.correlation.matrix),
        },
        "curve": _curve(identification),
        "pre_sliding": _pre_sliding(identification),
        "open_loop": _open_loop(identification),
        "settings": dict(identified.settings),
        "machine": machine_part(identified.subject.machine) if identified.subject is not None else None,
        "traces": [
            {
                "file": name,
                "sha256": source.sha256,
                "columns": dict(source.columns),
                "note": source.note,
                "pitch": quantity(source.pitch, "m"),
                "torque_constant": quantity(source.torque_constant, "N.m/A"),
            }
            for name, source in zip(identified.traces, identified.sources, strict=True)
        ],
        "records": [
            {"name": r.name, "rows": len(r), "interval": quantity(r.interval, "s")} for r in identified.records
        ],
        "inputs": inputs_part(quantities.input_files(identified)),
        "performance": {step: quantity(taken, "s") for step, taken in identification.seconds.items()},
    }


def terminal_lines(identified: IdentifiedFriction, directory: Path | None = None) -> list[str]:
    """What the terminal shows: headline, table, what was done besides, advice, and how to use friction.yaml.

    directory: where the result is; None: nowhere yet.
    """
    identification = identified.found
    lines = [f"axis {identification.axis}: {headline(identified)}", *table_lines(identified)]
    if line := friction_file.open_loop_line(identification):
        lines.append(f"  open loop: {line}")
    if line := rigid_line(identified):
        lines.append(f"  {line}")
    lines += [f"  advice: {advice}" for advice in identification.advice]
    if hint := friction_file.constant_load_hint(identification):
        lines.append(f"  {hint}")
    if directory is None:
        return lines
    setting = shlex.quote(f"machine.axes.{identification.axis}.friction={directory / FRICTION_FILE}")
    return [*lines, f"  use: feedsim run SCENARIO.yaml --set {setting}"]


def table_lines(identified: IdentifiedFriction) -> list[str]:
    """Parameter, value, 95 % interval, relative, note: a line each, for the terminal."""
    identification = identified.found
    rows = [("", "value", "95 % interval", "+-", "")]
    for estimate in identification.estimates.values():
        factor, unit = quantities.shown_unit(estimate)
        value = f"{friction_file.value_text(estimate, factor)} {unit}".removesuffix(" 1")
        interval, relative = friction_file.interval_text(estimate, factor), friction_file.relative_text(estimate)
        rows.append((estimate.name, value, interval, relative, friction_file.remark_text(estimate)))
    widths = [max(len(row[i]) for row in rows) for i in range(4)]
    room = max(20, TABLE_COLUMNS - sum(widths) - 10)
    lines = []
    for name, value, interval, relative, note in rows:
        note = textwrap.shorten(note, room, placeholder=" ...")
        cells = (name.ljust(widths[0]), value.ljust(widths[1]), interval.ljust(widths[2]), relative.rjust(widths[3]))
        lines.append("  ".join(("", *cells, note)).rstrip())
    return lines


def terminal_warnings(warnings: Iterable[Finding], estimates: Iterable[Estimate]) -> list[Finding]:
    """Warnings without those that say no more than the reason of a parameter, which the table holds."""
    reasoned = [estimate for estimate in estimates if estimate.reason]
    return [finding for finding in warnings if not any(_repeats(finding, estimate) for estimate in reasoned)]


def _repeats(finding: Finding, estimate: Estimate) -> bool:
    """Whether a finding says of a parameter, as the first one, what is the reason of its estimate."""
    names = finding.place.split(", ") if finding.code in ("parameter-held", "parameter-undetermined") else ()
    return estimate.name in names[:1] and finding.text.endswith(f": {estimate.reason}")


def headline(identified: IdentifiedFriction) -> str:
    """How well curve and pre-sliding are known, in one line."""
    identification, parts = identified.found, []
    if (stage := identification.stationary) is not None:
        low, high = (n * identification.I_P * MM_PER_MIN for n in stage.range)
        what = "curve" if identification.prior else "curve of stage 1 alone"
        error = f"within {100 * quantities.curve_error(stage):.2g} % (95 %)"
        within = f"{what} {error} from {float(f'{low:.3g}'):g} to {high:.5g} mm/min"
        plateaus = count_things(len(stage.plateaus), "plateau")
        no_curve = f"no curve: {count_things(quantities.speeds_of(stage), 'speed')}"
        parts.append(f"{within if quantities.is_curve(stage) else no_curve}, {plateaus}")
    if (dynamic := identification.dynamic) is not None:
        stretches = count_things(len(dynamic.stretches), "stretch", "stretches")
        parts.append(f"pre-sliding from {stretches}, residual {dynamic.rms:.2g} N.m rms")
    return "; ".join(parts) or "neither plateaus nor reversals"


def plateaus_csv(identification: Identification) -> str:
    """Every plateau: record, begin, end, speed, torque and its standard deviation, rows."""
    assert identification.stationary is not None
    lines = ["record,begin [s],end [s],speed [rad/s],torque [N.m],sigma [N.m],rows"]
    for p in identification.stationary.plateaus:
        numbers = shortest_numbers(np.array([p.begin, p.end, p.speed, p.torque, p.sigma]))
        lines.append(",".join([quote_cell(p.record), *numbers, str(p.rows)]))
    return "\n".join(lines) + "\n"


def residuals_csv(identification: Identification) -> str:
    """Time, measured and model torque of every stretch, one after another; the stretch is numbered from 1."""
    assert identification.dynamic is not None
    lines = ["stretch,record,time [s],angle [rad],speed [rad/s],measured [N.m],model [N.m],residual [N.m]"]
    for number, stretch in enumerate(identification.dynamic.stretches, 1):
        torques = (stretch.measured, stretch.model, stretch.measured - stretch.model)
        lines += _rows(f"{number},{quote_cell(stretch.record)}", stretch.time, stretch.angle, stretch.speed, *torques)
    return "\n".join(lines) + "\n"


def open_loop_csv(balance: Balance) -> str:
    """Recorded angle from the start on, and its error in open loop before and after, record after record."""
    lines = ["record,time [s],angle [rad],error before [rad],error after [rad]"]
    for drift in balance.drifts:
        lines += _rows(quote_cell(drift.record), drift.time, drift.angle, drift.before, drift.after)
    return "\n".join(lines) + "\n"


def _rows(head: str, *columns: Array) -> Iterator[str]:
    """Lines of a CSV file: head, and the columns' values."""
    texts = [shortest_numbers(np.asarray(values)) for values in columns]
    return (f"{head},{','.join(row)}" for row in zip(*texts, strict=True))


def _estimate(estimate: Estimate, I_P: float) -> dict[str, Any]:
    slide = quantities.at_slide(estimate.name, I_P)
    low, high = estimate.interval
    return {
        **quantity(estimate.value, estimate.unit),
        "sigma": finite(estimate.sigma),
        "interval": [low, high] if math.isfinite(low) and math.isfinite(high) else None,
        "status": estimate.status,
        "reason": estimate.reason,
        "meaning": estimate.meaning,
        "at_slide": quantity(slide[0] * estimate.value, slide[1]) if slide else None,
    }


def _curve(identification: Identification) -> dict[str, Any] | None:
    stage = identification.stationary
    if stage is None:
        return None
    error = quantities.curve_error(stage) if quantities.is_curve(stage) else math.nan
    return {
        "error": quantity(error, "1", meaning="largest half width of its 95 % band"),
        "worst_plateau": quantity(stage.worst_curve, "1", meaning="largest relative deviation"),
        "rms": quantity(stage.rms, "N.m", meaning="residual of the plateaus"),
        "used": identification.prior,
        "warnings": [str(warning) for warning in stage.warnings],
        "plateaus": len(stage.plateaus),
        "distinct_speeds": quantities.speeds_of(stage),
        "speeds": {"value": list(stage.range), "unit": "rad/s"},
        "correlation": {"names": list(stage.correlation.names), "matrix": _matrix(stage.correlation.matrix)},
    }


def _pre_sliding(identification: Identification) -> dict[str, Any] | None:
    stage = identification.dynamic
    if stage is None:
        return None
    return {
        "rms": quantity(stage.rms, "N.m"),
        "stretches": [
            {
                "record": stretch.record,
                "kind": stretch.kind,
                "begin": quantity(float(stretch.time[0]), "s"),
                "end": quantity(float(stretch.time[-1]), "s"),
                "amplitude": quantity(stretch.amplitude, "rad"),
                "frequency": quantity(stretch.frequency, "Hz"),
                "rms": quantity(stretch.rms, "N.m"),
            }
            for stretch in stage.stretches
        ],
        "sigma_were_the_delay_known": {name: finite(sigma) for name, sigma in stage.without_delay.items()},
    }


def _open_loop(identification: Identification) -> dict[str, Any] | None:
    """For summary.json; None where the step was not asked for."""
    balance = identification.balance
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
            "at_slide": _pair(
                (balance.position[0] * identification.I_P, balance.position[1] * identification.I_P), "m"
            ),
        },
        "torque": {**_pair(balance.torque, "N.m"), "meaning": "rms of the torque residual"},
        "changes": {name: _pair(pair, "N.m") for name, pair in balance.changes.items()},
        "load_rates": {record: _estimate(rate, identification.I_P) for record, rate in balance.load_rates.items()},
    }


def _pair(pair: tuple[float, float], unit: str) -> dict[str, Any]:
    return {"before": finite(pair[0]), "after": finite(pair[1]), "unit": unit}


def _matrix(matrix: Any) -> list[list[float | None]]:
    return [[finite(float(value)) for value in row] for row in matrix]


def rigid_line(identified: IdentifiedFriction) -> str:
    """The simple model in one line; empty where there is none."""
    estimated = [estimate for estimate in identified.found.rigid.values() if estimate.status == "estimated"]
    parts = [f"{estimate.name} {friction_file.value_text(estimate)} {estimate.unit}" for estimate in estimated]
    return f"rigid axis with simple friction: {', '.join(parts)}" if parts else ""
