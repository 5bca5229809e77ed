"""Tables of the report: derived figures, motions, and where the numbers come from."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from html import escape

from feedsim.analysis import Figure
from feedsim.nc import Circular, Recorded, Segment, Straight
from feedsim.report.provenance import archives, axis_parameters, input_files
from feedsim.report.summary import Run, software

DISPLAY_UNITS = {"um": "µm", "1": ""}
NOT_DETERMINED = "not determined"
MOST_MOTIONS = 200
NUMERIC = ' class="number"'


def shown(figure: Figure) -> tuple[str, str]:
    """Value and unit for display; "not determined" and no unit where there is no value."""
    if not math.isfinite(figure.value):
        return NOT_DETERMINED, ""
    digits = {"um": 2, "ms": 1, "Hz": 2, "N.m": 3, "s": 4}.get(figure.unit)
    text = f"{figure.value:.{digits}f}" if digits is not None else f"{figure.value:.5g}"
    return minus(text), display_unit(figure.unit)


def display_unit(unit: str) -> str:
    """A unit as it is printed: µm, N·m; nothing for a plain number."""
    return DISPLAY_UNITS.get(unit, unit.replace(".", "·"))


def minus(text: str) -> str:
    """A number with a minus sign in place of the hyphen."""
    return text.replace("-", "−")


def typeset(text: str) -> str:
    """A meaning as the analyses word it (ASCII), with µ and ±."""
    return re.sub(r"\bum\b", "µm", text.replace("+-", "±"))


def figures_table(figures: Mapping[str, Figure]) -> str:
    """Every derived figure with unit and meaning."""
    if not figures:
        return ""
    rows = []
    for name, figure in figures.items():
        value, unit = shown(figure)
        rows.append(
            f'<tr><td><code>{escape(name)}</code></td><td class="number">{value}</td><td>{escape(unit)}</td>'
            f'<td class="meaning">{escape(typeset(figure.meaning))}</td></tr>'
        )
    return '<h2 id="figures">Derived figures</h2>\n' + table(
        [("Figure", False), ("Value", True), ("Unit", False), ("Meaning", False)], rows
    )


def motions_table(run: Run) -> str:
    """Every motion with its path, its start and its exact end."""
    segments = run.program.segments
    rows = [
        f'<tr><td class="number">{segment.index}</td><td>{escape(segment.description)}</td>'
        f'<td>{escape(path(segment))}</td><td class="number">{segment.start:.4f}</td>'
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


def path(segment: Segment) -> str:
    """Length, or radius and angle, of a motion's path."""
    geometry = segment.geometry
    if isinstance(geometry, Straight):
        return f"length {geometry.length * 1e3:.6g} mm"
    if isinstance(geometry, Circular):
        angle = f"{math.degrees(geometry.sweep):.6g}°"
        turns = f" ({len(geometry.turns)} full turn{'s'[: len(geometry.turns) != 1]})" if geometry.turns else ""
        return f"R {geometry.radius * 1e3:.6g} mm, {angle}{turns}"
    return f"recording of {', '.join(geometry.axes)}" if isinstance(geometry, Recorded) else ""


def provenance(run: Run) -> str:
    """Inputs, units, coupling, and the parameters of every axis."""
    scenario, machine = run.scenario, run.scenario.machine
    cycles, coupling = machine.cycles, scenario.coupling
    rows = [
        ("Scenario", f"{scenario.name} ({scenario.file.name})"),
        ("Set in the scenario", ", ".join(scenario.settings) or "nothing"),
        ("Set on the command line", ", ".join(scenario.overrides) or "nothing"),
        ("Machine", machine.name),
        ("Cycles", ", ".join(f"{n} {duration(getattr(cycles, n))}" for n in ("T_c", "T_pos", "T_ipo"))),
        ("Recording", f"every {duration(scenario.recording.interval)}, {len(run.trace)} rows"),
        ("Coupling", f"{coupling.scheme}, {coupling.substeps} exchange step(s) per control cycle"),
        ("Software", ", ".join(f"{name} {text}" for name, text in software().items())),
    ]
    general = table([], [f"<tr><th>{escape(name)}</th><td>{escape(text)}</td></tr>" for name, text in rows])
    files = [
        f"<tr><td>{escape(f.role)}</td><td>{escape(f.name)}</td><td><code>{f.sha256 or 'not readable'}</code></td></tr>"
        for f in input_files(scenario)
    ]
    units = [
        f"<tr><td>{escape(a.name)}</td><td>{escape(a.version)}</td><td><code>{escape(a.guid)}</code></td>"
        f"<td>{escape(', '.join(a.instances))}</td></tr>"
        for a in archives(run.units)
    ]
    parts = [
        '<section class="provenance">\n<h2>Where the numbers come from</h2>',
        general,
        table([("Input file", False), ("Name", False), ("SHA-256", False)], files),
        table([("Unit", False), ("Version", False), ("GUID", False), ("Instances", False)], units) if units else "",
        _coupling(run.coupling),
        _parameters(run),
        "</section>",
    ]
    return "\n".join(part for part in parts if part)


def duration(seconds: float) -> str:
    """A time in the unit that reads best: 125 µs, 1 ms, 2 s."""
    for unit, scale in (("s", 1.0), ("ms", 1e3), ("µs", 1e6)):
        if seconds * scale >= 1 - 1e-9:
            return f"{seconds * scale:.6g} {unit}"
    return f"{seconds * 1e6:.6g} µs"


def table(heads: Sequence[tuple[str, bool]], rows: Iterable[str]) -> str:
    """A table that scrolls where the screen is narrow; heads: text and whether the column holds numbers."""
    cells = "".join(f"<th{NUMERIC if numeric else ''}>{escape(text)}</th>" for text, numeric in heads)
    head = f"<thead><tr>{cells}</tr></thead>\n" if heads else ""
    return f'<div class="scroll"><table>{head}<tbody>{"".join(rows)}</tbody></table></div>'


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


def _parameters(run: Run) -> str:
    """One row per parameter, one column per axis."""
    by_axis = {name: axis_parameters(axis) for name, axis in run.scenario.machine.axes.items()}
    keys = dict.fromkeys((g, n) for groups in by_axis.values() for g, names in groups.items() for n in names)
    rows = []
    for group, name in keys:
        found = [groups[group].get(name) for groups in by_axis.values()]
        unit = next(pair[1] for pair in found if pair is not None)
        cells = "".join(f'<td class="number">{_value(pair[0]) if pair else "–"}</td>' for pair in found)
        rows.append(
            f"<tr><td>{group}</td><td><code>{escape(name)}</code></td><td>{escape(display_unit(unit))}</td>{cells}</tr>"
        )
    heads = [("Group", False), ("Parameter", False), ("SI unit", False), *((f"{axis}", True) for axis in by_axis)]
    note = '<p class="muted">A parameter that is not listed has the start value of its unit.</p>'
    return "<h3>Parameters of the axes</h3>\n" + table(heads, rows) + note


def _value(value: float | int | bool | str) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return minus(f"{value:.6g}") if isinstance(value, float) else escape(str(value))
