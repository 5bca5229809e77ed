"""The report of an import from a control's files: what was taken, what was not and why, what is missing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from feedsim.analysis import Figure
from feedsim.files import sheets
from feedsim.files.control.archive import Archive
from feedsim.files.control.reading import Reading, RefusedValue, TakenValue
from feedsim.foundation.errors import Finding
from feedsim.report.content import FOLDER, Bullets, Report, Section, Step, Table, Text, Tile, code, provenance_section
from feedsim.report.control_export import sources_section
from feedsim.report.formatting import Scale, count_things, minus, plain_unit, scale
from feedsim.report.provenance import hash_files, inputs_part
from feedsim.scenario.imported import ImportedMachine, machine_file_value, place_of
from feedsim.scenario.machine import Machine

SHEET = "sheet.csv"
FILES = (SHEET, Machine.IN_FOLDER, "modes.csv")  # besides report.html and summary.json
MOST_ODD = 20  # lines that were not understood are shown as examples
MOST_NAMED = 3


def doubtful(reading: Reading, made: ImportedMachine) -> list[RefusedValue]:
    """Values that were not taken although they may act."""
    return [entry for entry in (*reading.refused, *made.refused) if entry.weight == "doubt"]


def figures_of(archives: Sequence[Archive], reading: Reading, made: ImportedMachine) -> dict[str, Figure]:
    """How much of the files was understood."""
    read = sum(len(archive.entries) for archive in archives)
    odd = sum(archive.odd_count for archive in archives)
    return {
        "values.taken": Figure(
            float(len(made.values)), "1", "values that the machine file has from the control's files"
        ),
        "values.not_taken": Figure(
            float(len(doubtful(reading, made))), "1", "values that may act and were not taken, each with its reason"
        ),
        "parameters.read": Figure(float(read), "1", "parameters that were read in the files, of all axes and drives"),
        "lines.not_understood": Figure(float(odd), "1", "lines of the files that were not understood"),
        "keys.missing": Figure(float(len(made.missing)), "1", "keys that the machine file needs and has not"),
    }


def findings(archives: Sequence[Archive], reading: Reading, made: ImportedMachine) -> list[Finding]:
    """What is to be known before the machine file is used."""
    result: list[Finding] = []
    if not made.values:
        whose = "the draft is empty" if made.base is None else "the machine file is as it was"
        result.append(Finding("no-value-taken", "doubt", f"no value was taken; {whose}"))
    result += reading.doubts
    open_ones = doubtful(reading, made)
    if open_ones:
        shown = "; ".join(_refused_text(open_one) for open_one in open_ones[:MOST_NAMED])
        more = f"; and {len(open_ones) - MOST_NAMED} more in the report" if len(open_ones) > MOST_NAMED else ""
        text = f"{count_things(len(open_ones), 'value')} not taken: {shown}{more}"
        result.append(Finding("values-not-taken", "doubt", text))
    if made.missing:
        first_key = made.missing[0].partition(":")[0]
        result.append(Finding(
            "machine-file-draft", "doubt",
            f"the machine file is a draft: {count_things(len(made.missing), 'key')} missing, the first "
            f"{first_key}; the head of the file has them all",
            first_key,
        ))  # fmt: skip
    for archive in archives:
        if archive.odd:
            first = archive.odd[0]
            result.append(Finding(
                "lines-not-understood", "note",
                f"{archive.name}: {count_things(archive.odd_count, 'line')} not understood, the first in line "
                f"{first.line}: {first.reason}",
                f"{archive.name}:{first.line}",
            ))  # fmt: skip
        if archive.container:
            text = f"{archive.name} is a container with binary parts: only lines that are whole were read"
            result.append(Finding("binary-parts-not-read", "note", text, archive.name))
    return [*result, *reading.notes]


def answers(reading: Reading, made: ImportedMachine) -> list[str]:
    """How many values each axis has from the files."""
    per_axis = {axis: [value for value in made.values if value.axis == axis] for axis in reading.axes}
    said = [
        f"{axis}: {count_things(len(own), 'value')} of {_control_axis_text(reading, axis)}"
        + (f", {_leading_values_text(own)}" if _leading_values_text(own) else "")
        for axis, own in per_axis.items()
    ]
    return said


def _control_axis_text(reading: Reading, axis: str) -> str:
    lists = ", ".join(reading.places.get(axis, ()))
    return f"{reading.axes[axis]}{f' and {lists}' if lists else ''}"


def _leading_values_text(own: Sequence[TakenValue]) -> str:
    names = ("drive.K_v", "drive.K_p", "drive.T_n")
    shown = [taken for name in names for taken in own if taken.parameter == name and taken.entry is not None]
    return ", ".join(f"{taken.number} = {taken.text}{f' ({unit})' if (unit := plain_unit(taken.unit)) else ''}"
                     for taken in shown)  # fmt: skip


def _refused_text(refused: RefusedValue) -> str:
    axis = f"{refused.axis} " if refused.axis else ""
    return f"{axis}{refused.name.number} {refused.name.name} {refused.text[:24]} ({refused.reason})".replace("  ", " ")


def sheet(reading: Reading, made: ImportedMachine) -> str:
    """Every value as CSV: taken or not, in the control's words and in ours."""
    heads = ("axis", "number", "name", "value", "unit", "ours", "value in the machine file", "taken", "reason", "where")
    taken = (
        (
            value.axis,
            value.number,
            value.called,
            value.text,
            value.unit,
            value.parameter,
            _machine_value_text(value),
            "yes",
            "",
            value.where,
        )
        for value in made.values
    )
    refused = (
        (gone.axis, gone.name.number, gone.name.name, gone.text, gone.name.unit, gone.name.parameter, "", "no",
         gone.reason, gone.where)
        for gone in (*reading.refused, *made.refused)
    )  # fmt: skip
    return sheets.text_of((heads, *taken, *refused))


def report_of(archives: Sequence[Archive], reading: Reading, made: ImportedMachine, inputs: Sequence[Path]) -> Report:
    """Content of the report."""
    figures = figures_of(archives, reading, made)
    return Report(
        f"Machine file from {', '.join(archive.name for archive in archives)}",
        f"{reading.control} · {archives[0].form} · axes {', '.join(reading.axes)}",
        answer=answers(reading, made),
        warnings=findings(archives, reading, made),
        tiles=[
            Tile(f"{int(figures[name].value)}", label, figures[name].meaning)
            for name, label in (
                ("values.taken", "values taken"),
                ("values.not_taken", "values not taken"),
                ("lines.not_understood", "lines not understood"),
            )
        ],
        next_step=Step("Look at the machine, then simulate with it", "machine info", {"machine": FOLDER}),
        main=[
            _taken_section(made),
            _refused_section(reading, made),
            _missing_section(made),
            _unread_lines_section(archives),
            _sources(reading, made),
        ],
        provenance=provenance_section([("Control", reading.control)], hash_files([("file", path) for path in inputs])),
        footer="Every value with its place: sheet.csv and the remarks in machine.yaml. Names: docs/controls.md.",
    )


def _sources(reading: Reading, made: ImportedMachine) -> Section | None:
    refused = (*reading.refused, *made.refused)
    return sources_section([*(value.name for value in made.values), *(entry.name for entry in refused)])


def _taken_section(made: ImportedMachine) -> Section | None:
    rows: list[tuple[Text, ...]] = [
        (
            value.axis or "machine", code(value.number), value.called,
            minus(f"{value.text} {value.unit}".strip()), code(value.parameter),
            minus(_machine_value_text(value)), _previous_value_text(made, value), value.where or "–",
            "–" if value.condition else "confirmed" if value.name.confirmed else "not confirmed",
        )
        for value in made.values
    ]  # fmt: skip
    heads = ("Axis", "Number", "Name", "In the control", "Ours", "In the machine file", "Before", "Where", "Unit")
    return Section("Values that were taken", [Table("lllrlrrll", heads, rows)], "taken") if rows else None


def _machine_value_text(taken: TakenValue) -> str:
    """A value as the machine file has it, rounded, and in a unit that reads well."""
    value = machine_file_value(taken)
    if isinstance(value, bool):
        return str(value).lower()
    if not isinstance(taken.value, float):
        return str(value)
    unit = value.partition(" ")[2] if isinstance(value, str) else ""
    usual = scale(unit, np.array([taken.value])) if taken.value and unit != "1/s" else Scale(1.0, unit)
    return f"{taken.value * usual.factor:.6g} {usual.unit}".rstrip()


def _previous_value_text(made: ImportedMachine, taken: TakenValue) -> str:
    value = made.before.get(place_of(taken))
    if value is None or isinstance(value, dict | list):
        return "–"
    return str(value).lower() if isinstance(value, bool) else minus(str(value))


def _refused_section(reading: Reading, made: ImportedMachine) -> Section | None:
    rows: list[tuple[Text, ...]] = [
        (
            entry.axis or "machine",
            code(entry.name.number),
            entry.name.name,
            minus(entry.text),
            entry.reason,
            entry.where,
        )
        for weight in ("doubt", "note")
        for entry in (*reading.refused, *made.refused)
        if entry.weight == weight
    ]
    heads = ("Axis", "Number", "Name", "In the control", "Why", "Where")
    return Section("Values that were not taken", [Table("lllrpl", heads, rows)], "not-taken") if rows else None


def _missing_section(made: ImportedMachine) -> Section | None:
    return Section("What the machine file needs besides", [Bullets(made.missing)], "missing") if made.missing else None


def _unread_lines_section(archives: Sequence[Archive]) -> Section | None:
    rows = [(f"{archive.name}:{value.line}", value.reason, code(value.text)) for archive, value in _examples(archives)]
    total = sum(archive.odd_count for archive in archives)
    note = f"The first {len(rows)} of {total}, of each file by turns." if total > len(rows) else ""
    table = Table("lpl", ("Line", "Why", "Text"), rows, note)
    return Section("Lines that were not understood", [table], "odd") if rows else None


def _examples(archives: Sequence[Archive]) -> Iterator[tuple[Archive, Any]]:
    share = max(1, MOST_ODD // max(1, len(archives)))
    for archive in archives:
        for entry in archive.odd[:share]:
            yield archive, entry


def details(
    archives: Sequence[Archive], reading: Reading, made: ImportedMachine, inputs: Sequence[Path]
) -> Mapping[str, Any]:
    """What summary.json has besides the figures."""
    return {
        "control": reading.control,
        "axes": dict(reading.axes),
        "taken": [
            {"axis": taken.axis, "parameter": taken.parameter, "number": taken.number, "value": taken.value,
             "unit": taken.name.si, "text": taken.entry.text if taken.entry else None, "where": taken.where,
             "confirmed": None if taken.condition else taken.name.confirmed, "condition": taken.condition}
            for taken in made.values
        ],
        "not_taken": [
            {"axis": entry.axis, "parameter": entry.name.parameter, "number": entry.name.number, "text": entry.text,
             "reason": entry.reason, "where": entry.where, "acts": entry.weight == "doubt"}
            for entry in (*reading.refused, *made.refused)
        ],
        "missing": list(made.missing),
        "not_understood": [
            {"file": archive.name, "line": value.line, "text": value.text, "reason": value.reason}
            for archive, value in _examples(archives)
        ],
        "inputs": inputs_part(hash_files([("file", path) for path in inputs])),
    }  # fmt: skip
