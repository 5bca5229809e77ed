"""Sections and tables that reports of several kinds have: figures, and where the numbers come from."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from feedsim.analysis import Figure
from feedsim.report.content import Part, Section, Span, Table, Text, code
from feedsim.report.formatting import display_unit, minus, shown, typeset
from feedsim.report.provenance import InputFile, archives, axis_parameters, software
from feedsim.scenario import Machine

FIGURES_ANCHOR = "figures"


def figures_section(figures: Mapping[str, Figure]) -> Section | None:
    """Every derived figure with unit and meaning."""
    if not figures:
        return None
    rows = [(code(name), *shown(figure), typeset(figure.meaning)) for name, figure in figures.items()]
    table = Table("lrlp", ("Figure", "Value", "Unit", "Meaning"), rows)
    return Section("Derived figures", [table], FIGURES_ANCHOR)


def figures_footer(rest: str, documents: str = "docs/figures.md") -> Text:
    """Text that leads to :func:`figures_section` and to its definitions, and goes on with ``rest``."""
    return (
        "What each figure means stands beside it in the table ",
        Span("Derived figures", "link", FIGURES_ANCHOR),
        f"; the full definitions come with the software ({documents}). {rest}",
    )


def provenance_section(
    rows: Iterable[tuple[str, str]], files: Iterable[InputFile], *further: Part | None, software_of: str = "Software"
) -> Section:
    """Where the numbers come from: what and what it is, the software, input files with their hashes, and further."""
    used = ", ".join(f"{name} {text}" for name, text in software().items())
    return Section(
        "Where the numbers come from", [pairs_table([*rows, (software_of, used)]), files_table(files), *further]
    )


def pairs_table(rows: Sequence[tuple[str, str]]) -> Table:
    """A table without heads: what, and what it is."""
    return Table("hl", (), rows)


def files_table(files: Iterable[InputFile]) -> Table:
    """Input files with their hashes."""
    rows = [(f.role, f.name, code(f.sha256 or "not readable")) for f in files]
    return Table("lll", ("Input file", "Name", "SHA-256"), rows)


def archives_table(units: Mapping[str, Mapping[str, str]]) -> Table | None:
    """The archives of a run's units (instance -> GUID and version); none without units."""
    rows = [(a.name, a.version, code(a.guid), ", ".join(a.instances)) for a in archives(units)]
    return Table("llll", ("Unit", "Version", "GUID", "Instances"), rows) if rows else None


def parameters_section(machine: Machine) -> Section:
    """Drive and friction parameters in SI: one row per parameter, one column per axis."""
    by_axis = {name: axis_parameters(axis) for name, axis in machine.axes.items()}
    keys = dict.fromkeys((g, n) for groups in by_axis.values() for g, names in groups.items() for n in names)
    rows: list[tuple[Text, ...]] = []
    for group, name in keys:
        result = [groups[group].get(name) for groups in by_axis.values()]
        unit = next(pair[1] for pair in result if pair is not None)
        values = (_value(pair[0]) if pair else "–" for pair in result)
        rows.append((group, code(name), display_unit(unit), *values))
    heads = ("Group", "Parameter", "SI unit", *by_axis)
    note = "A parameter that is not listed has the start value of its unit."
    return Section("Parameters of the axes", [Table("lll" + "r" * len(by_axis), heads, rows, note)])


def _value(value: float | int | bool | str) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return minus(f"{value:.6g}") if isinstance(value, float) else str(value)
