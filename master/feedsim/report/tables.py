"""Tables that every report has: figures, input files, archives, parameters."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape

from feedsim.analysis import Figure
from feedsim.report.formatting import display_unit, minus, shown, typeset
from feedsim.report.provenance import InputFile, archives, axis_parameters
from feedsim.scenario import Machine

NUMERIC = ' class="number"'


def table(heads: Sequence[tuple[str, bool]], rows: Iterable[str]) -> str:
    """A table that scrolls where the screen is narrow; heads: text and whether the column holds numbers."""
    cells = "".join(f"<th{NUMERIC if numeric else ''}>{escape(text)}</th>" for text, numeric in heads)
    head = f"<thead><tr>{cells}</tr></thead>\n" if heads else ""
    return f'<div class="scroll"><table>{head}<tbody>{"".join(rows)}</tbody></table></div>'


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


def pairs_table(rows: Iterable[tuple[str, str]]) -> str:
    """A table without head: what, and what it is."""
    return table([], [f"<tr><th>{escape(name)}</th><td>{escape(text)}</td></tr>" for name, text in rows])


def files_table(files: Iterable[InputFile]) -> str:
    """Input files with their hashes."""
    rows = [
        f"<tr><td>{escape(f.role)}</td><td>{escape(f.name)}</td><td><code>{f.sha256 or 'not readable'}</code></td></tr>"
        for f in files
    ]
    return table([("Input file", False), ("Name", False), ("SHA-256", False)], rows)


def archives_table(units: Mapping[str, Mapping[str, str]]) -> str:
    """The archives of a run's units (instance -> GUID and version); empty without units."""
    rows = [
        f"<tr><td>{escape(a.name)}</td><td>{escape(a.version)}</td><td><code>{escape(a.guid)}</code></td>"
        f"<td>{escape(', '.join(a.instances))}</td></tr>"
        for a in archives(units)
    ]
    return table([("Unit", False), ("Version", False), ("GUID", False), ("Instances", False)], rows) if rows else ""


def parameters_table(machine: Machine) -> str:
    """Drive and friction parameters in SI: one row per parameter, one column per axis."""
    by_axis = {name: axis_parameters(axis) for name, axis in machine.axes.items()}
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
