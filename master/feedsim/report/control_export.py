"""The report of an export to a control's files: what was changed, what is to be typed, old and new values."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from feedsim.analysis import Figure
from feedsim.files import sheets
from feedsim.files.control import Name
from feedsim.files.control.archive import Archive
from feedsim.files.control.writing import WrittenFiles
from feedsim.foundation.errors import Finding
from feedsim.report.content import FOLDER, Report, Section, Step, Table, Text, Tile, code, provenance_section
from feedsim.report.formatting import count_things, minus, plain_unit
from feedsim.report.provenance import hash_files, inputs_part
from feedsim.report.results import REPORT, SUMMARY
from feedsim.scenario.machine import Machine

# --- Which public source says what a number of a control means, and in which unit -------------------------------------


NOTE = (
    "Confirmed: a public source that was opened states meaning and unit. Of all others the unit is supposed: they are "
    "taken and written only where --checked names them, or where the file states the unit."
)


def sources_section(names: Iterable[Name]) -> Section | None:
    """A row for every name, confirmed ones first."""
    each_once = sorted(dict.fromkeys(names), key=lambda name: not name.confirmed)
    rows: list[tuple[Text, ...]] = [
        (
            code(name.number),
            name.name,
            name.unit or "–",
            "confirmed" if name.confirmed else "not confirmed",
            name.source,
        )
        for name in each_once
    ]
    heads = ("Number", "Name", "Unit", "Unit and meaning", "Source")
    return Section("Where names and units come from", [Table("llllp", heads, rows, NOTE)], "sources") if rows else None


# --- The report of an export to a control's files: what was changed, what is to be typed, old and new values ----------


SHEET = "sheet.csv"
MOST_NAMED = 3
UNTOUCHED_REMARK = "No byte of the files differs but those of the values that are listed as written."


def names_of_written_files(names: Iterable[str]) -> list[str]:
    """Names of the written files; one that a result has itself gets a word ahead."""
    own = {REPORT, SUMMARY, SHEET, "figures"}
    return [f"control_{name}" if name in own else name for name in names]


def name_contents(contents: Mapping[str, bytes]) -> dict[str, bytes]:
    """Name of the written file -> content."""
    return dict(zip(names_of_written_files(contents), contents.values(), strict=True))


def figures_of(written: WrittenFiles) -> dict[str, Figure]:
    """How many values differ."""
    done = [change for change in written.changes if change.written]
    return {
        "values.changed": Figure(float(len(done)), "1", "values of the files that were changed"),
        "values.to_type": Figure(
            float(len(written.changes) - len(done)), "1", "values that could not be written, each with its reason"
        ),
        "values.same": Figure(float(len(written.same)), "1", "values of the files that are those of the machine file"),
    }


def findings(written: WrittenFiles) -> list[Finding]:
    """Values to type, and what was not touched."""
    result: list[Finding] = []
    typed = [change for change in written.changes if not change.written]
    if typed:
        shown = "; ".join(
            f"{change.axis} {change.name.number} {change.name.name} {change.new} ({change.reason})"
            for change in typed[:MOST_NAMED]
        )
        more = f"; and {len(typed) - MOST_NAMED} more on the sheet" if len(typed) > MOST_NAMED else ""
        text = f"{count_things(len(typed), 'value')} not written: {shown}{more}"
        result.append(Finding("values-to-type", "doubt", text))
    return [*result, *written.notes]


def answers(written: WrittenFiles, axes: Mapping[str, str]) -> list[str]:
    """How many values of each axis were changed."""
    said = []
    for axis, theirs in axes.items():
        own = [change for change in written.changes if change.axis == axis]
        done = sum(change.written for change in own)
        said.append(f"{axis} ({theirs}): {count_things(done, 'value')} changed, {len(own) - done} to type")
    return said


def change_lines(written: WrittenFiles) -> list[str]:
    """Every changed value, a line each."""
    return [
        f"{change.axis} {name.number} {name.name}: {change.old} -> {change.new} {plain_unit(name.unit)}".rstrip()
        for change in written.changes
        if change.written
        for name in (change.name,)
    ]


def sheet(written: WrittenFiles) -> str:
    """Old and new values as CSV, in the control's words."""
    heads = ("axis", "number", "name", "old", "new", "unit", "unit confirmed", "written", "reason", "where")
    rows = (
        (change.axis, change.name.number, change.name.name, change.old, change.new, change.name.unit,
         "yes" if change.name.confirmed else "no", "yes" if change.written else "no", change.reason, change.where)
        for change in written.changes
    )  # fmt: skip
    return sheets.text_of((heads, *rows))


def report_of(
    archives: Sequence[Archive],
    written: WrittenFiles,
    machine: Machine,
    axes: Mapping[str, str],
    inputs: Sequence[Path],
) -> Report:
    """Content of the report."""
    figures = figures_of(written)
    return Report(
        f"{machine.name} for {', '.join(archive.name for archive in archives)}",
        f"{archives[0].control} · {archives[0].form} · axes {', '.join(axes)}",
        answer=answers(written, axes),
        warnings=findings(written),
        notes=[machine.note] if machine.note else [],
        tiles=[
            Tile(f"{int(figure.value)}", name.partition(".")[2].replace("_", " "), figure.meaning)
            for name, figure in figures.items()
        ],
        next_step=Step(
            "See what the control would have",
            "machine import",
            {"files": [f"{FOLDER}/{archive.name}" for archive in archives], "machine": None},
        ),
        main=[
            _changes(written, True, "Values that were changed", UNTOUCHED_REMARK),
            _changes(written, False, "Values to type", "They are not in the files; the last column says why."),
            sources_section(change.name for change in written.changes),
        ],
        provenance=provenance_section(
            [("Machine", machine.name), ("Control", archives[0].control)],
            hash_files([("file", path) for path in inputs]),
        ),
        footer="The same as a table: sheet.csv. Names and their sources: docs/controls.md.",
    )


def _changes(written: WrittenFiles, done: bool, title: str, note: str) -> Section | None:
    rows: list[tuple[Text, ...]] = [
        (
            change.axis,
            code(change.name.number),
            change.name.name,
            minus(change.old) or "–",
            minus(change.new),
            change.name.unit,
            "confirmed" if change.name.confirmed else "not confirmed",
            change.where or "–",
            change.reason or "–",
        )
        for change in written.changes
        if change.written == done
    ]
    heads = ("Axis", "Number", "Name", "Old", "New", "Unit", "Unit is", "Where", "Remark")
    return Section(title, [Table("lllrrlllp", heads, rows, note)]) if rows else None


def details(
    written: WrittenFiles, machine: Machine, axes: Mapping[str, str], inputs: Sequence[Path]
) -> Mapping[str, Any]:
    """What summary.json has besides the figures."""
    return {
        "machine": machine.name,
        "axes": dict(axes),
        "changes": [
            {"axis": change.axis, "parameter": change.name.parameter, "number": change.name.number, "old": change.old,
             "new": change.new, "unit": change.name.unit, "written": change.written, "reason": change.reason,
             "where": change.where}
            for change in written.changes
        ],
        "inputs": inputs_part(hash_files([("file", path) for path in inputs])),
    }  # fmt: skip
