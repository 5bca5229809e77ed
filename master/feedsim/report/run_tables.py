"""Tables of a run's report: its motions, and where the numbers come from."""

from __future__ import annotations

import math
from collections.abc import Mapping
from html import escape

from feedsim.report.log_part import log_text
from feedsim.report.parts import software
from feedsim.report.provenance import friction_origins, input_files
from feedsim.report.summary import Run
from feedsim.report.tables import archives_table, files_table, pairs_table, parameters_table, table
from feedsim.report.words import duration, minus

MOST_MOTIONS = 200


def motions_table(run: Run) -> str:
    """Every motion with its path, its start and its exact end."""
    segments = run.program.segments
    rows = [
        f'<tr><td class="number">{segment.index}</td><td>{escape(segment.description)}</td>'
        f'<td>{escape(segment.way)}</td><td class="number">{segment.start:.4f}</td>'
        f'<td class="number">{segment.end:.4f}</td></tr>'
        for segment in segments[:MOST_MOTIONS]
    ]
    more = len(segments) - MOST_MOTIONS
    tail = f'<p class="muted">and {more} more</p>' if more > 0 else ""
    T_ipo = run.scenario.machine.cycles.T_ipo
    note = (
        f'<p class="muted">Every motion ends exactly where its profile does; the next one starts on the next instant '
        f"of the interpolator (T_ipo {duration(T_ipo)}).</p>"
    )
    heads = [("No.", True), ("Motion", False), ("Path", False), ("Start [s]", True), ("End [s]", True)]
    return "<h2>Motions</h2>\n" + table(heads, rows) + tail + note


def provenance(run: Run) -> str:
    """Inputs, units, coupling, and the parameters of every axis."""
    scenario, machine = run.scenario, run.scenario.machine
    cycles, coupling = machine.cycles, scenario.coupling
    rows = [
        ("Scenario", f"{scenario.name} ({scenario.file.name})"),
        ("Set in the scenario", ", ".join(scenario.settings) or "nothing"),
        ("Set on the command line", ", ".join(scenario.overrides) or "nothing"),
        ("Machine", machine.name),
        *((f"Friction of {axis}", text) for axis, text in friction_origins(machine).items()),
        ("Cycles", ", ".join(f"{n} {duration(getattr(cycles, n))}" for n in ("T_c", "T_pos", "T_ipo"))),
        ("Recording", f"every {duration(scenario.recording.interval)}, {len(run.trace)} rows"),
        *([("Log", log_text(scenario.logging, run.log))] if scenario.logging is not None else []),
        ("Coupling", f"{coupling.scheme}, {coupling.substeps} exchange step(s) per control cycle"),
        ("Software", ", ".join(f"{name} {text}" for name, text in software().items())),
    ]
    parts = [
        '<section class="provenance">\n<h2>Where the numbers come from</h2>',
        pairs_table(rows),
        files_table(input_files(scenario)),
        archives_table(run.units),
        _coupling(run.coupling),
        parameters_table(machine),
        "</section>",
    ]
    return "\n".join(part for part in parts if part)


def _coupling(coupling: Mapping[str, float]) -> str:
    axes = dict.fromkeys(name.partition(".")[0] for name in coupling)
    rows = []
    for axis in axes:
        work, residual = (coupling.get(f"{axis}.{name}", math.nan) for name in ("friction_work", "residual"))
        share = abs(residual / work) if work else math.nan
        texts = [minus(f"{value:.3g}") if math.isfinite(value) else "–" for value in (work, residual, share)]
        cells = "".join(f'<td class="number">{text}</td>' for text in texts)
        rows.append(f"<tr><td>{escape(axis)}</td>{cells}</tr>")
    heads = [("Axis", False), ("Friction work [J]", True), ("Interface energy residual [J]", True), ("Share", True)]
    note = (
        '<p class="muted">The residual is the energy that the exchange between plant and friction creates or loses.</p>'
    )
    return "<h3>Coupling</h3>\n" + table(heads, rows) + note if rows else ""
