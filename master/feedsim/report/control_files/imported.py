"""The report of an import from a control's files: what was taken, what was not and why, what is missing."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from feedsim.analysis import Figure
from feedsim.control.archive import Archive
from feedsim.control.reading import Reading, Refused, Taken
from feedsim.findings import Note
from feedsim.report.content import FOLDER, Bullets, Report, Section, Table, Text, Tile, code
from feedsim.report.control_files.sources import sources_section
from feedsim.report.formatting import Scale, counted, minus, plain_unit, scale
from feedsim.report.provenance import figures_part, hashed, inputs_part, software
from feedsim.report.results import REPORT, SUMMARY, check_place
from feedsim.report.sections import provenance_section
from feedsim.scenario.imported import Imported, place_of, written
from feedsim.scenario.machine import Machine

KIND = "machine import"
SHEET = "sheet.csv"
MOST_ODD = 20  # lines that were not understood are shown as examples
MOST_NAMED = 3


def check_writable(directory: Path | str, inputs: Sequence[Path] = ()) -> None:
    """Raise OutputError unless the results can be written to ``directory`` without one of ``inputs`` being lost."""
    check_place(directory, (REPORT, SUMMARY, SHEET, Machine.IN_FOLDER, "modes.csv"), inputs, kind=KIND)


def doubtful(reading: Reading, made: Imported) -> list[Refused]:
    """Values that were not taken although they may act."""
    return [each for each in (*reading.refused, *made.refused) if each.weight == "doubt"]


def figures_of(archives: Sequence[Archive], reading: Reading, made: Imported) -> dict[str, Figure]:
    """How much of the files was understood."""
    read = sum(len(each.entries) for each in archives)
    odd = sum(each.odd_count for each in archives)
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


def findings(archives: Sequence[Archive], reading: Reading, made: Imported) -> list[str]:
    """What is to be known before the machine file is used."""
    found: list[str] = []
    if not made.values:
        whose = "the draft is empty" if made.base is None else "the machine file is as it was"
        found.append(f"no value was taken; {whose}")
    found += reading.doubts
    open_ones = doubtful(reading, made)
    if open_ones:
        shown = "; ".join(_named(each) for each in open_ones[:MOST_NAMED])
        more = f"; and {len(open_ones) - MOST_NAMED} more in the report" if len(open_ones) > MOST_NAMED else ""
        found.append(f"{counted(len(open_ones), 'value')} not taken: {shown}{more}")
    if made.missing:
        found.append(
            f"the machine file is a draft: {counted(len(made.missing), 'key')} missing, the first "
            f"{made.missing[0].partition(':')[0]}; the head of the file has them all"
        )
    for archive in archives:
        if archive.odd:
            first = archive.odd[0]
            found.append(
                Note(
                    f"{archive.name}: {counted(archive.odd_count, 'line')} not understood, the first in line "
                    f"{first.line}: {first.reason}"
                )
            )
        if archive.container:
            found.append(Note(f"{archive.name} is a container with binary parts: only lines that are whole were read"))
    return [*found, *(Note(text) for text in reading.notes)]


def answers(archives: Sequence[Archive], reading: Reading, made: Imported) -> list[str]:
    """How many values each axis has from the files."""
    per_axis = {axis: [each for each in made.values if each.axis == axis] for axis in reading.axes}
    said = [
        f"{axis}: {counted(len(own), 'value')} of {_theirs(reading, axis)}"
        + (f", {_leading(own)}" if _leading(own) else "")
        for axis, own in per_axis.items()
    ]
    return said


def _theirs(reading: Reading, axis: str) -> str:
    lists = ", ".join(reading.places.get(axis, ()))
    return f"{reading.axes[axis]}{f' and {lists}' if lists else ''}"


def _leading(own: Sequence[Taken]) -> str:
    names = ("drive.K_v", "drive.K_p", "drive.T_n")
    shown = [each for name in names for each in own if each.parameter == name and each.entry is not None]
    return ", ".join(f"{each.number} = {each.text}{f' ({unit})' if (unit := plain_unit(each.unit)) else ''}"
                     for each in shown)  # fmt: skip


def _named(each: Refused) -> str:
    axis = f"{each.axis} " if each.axis else ""
    return f"{axis}{each.name.number} {each.name.name} {each.text[:24]} ({each.reason})".replace("  ", " ")


def sheet(reading: Reading, made: Imported) -> str:
    """Every value as CSV: taken or not, in the control's words and in ours."""
    out = io.StringIO()
    rows = csv.writer(out, lineterminator="\n")
    rows.writerow(["axis", "number", "name", "value", "unit", "ours", "value in the machine file", "taken", "reason",
                   "where"])  # fmt: skip
    for each in made.values:
        rows.writerow([each.axis, each.number, each.called, each.text, each.unit, each.parameter, _ours(each), "yes",
                       "", each.where])  # fmt: skip
    for gone in (*reading.refused, *made.refused):
        rows.writerow([gone.axis, gone.name.number, gone.name.name, gone.text, gone.name.unit, gone.name.parameter, "",
                       "no", gone.reason, gone.where])  # fmt: skip
    return out.getvalue()


def report_of(archives: Sequence[Archive], reading: Reading, made: Imported, inputs: Sequence[Path]) -> Report:
    """Content of the report."""
    figures = figures_of(archives, reading, made)
    return Report(
        f"Machine file from {', '.join(archive.name for archive in archives)}",
        f"{reading.control} · {archives[0].form} · axes {', '.join(reading.axes)}",
        answer=answers(archives, reading, made),
        warnings=findings(archives, reading, made),
        tiles=[
            Tile(f"{int(figures[name].value)}", label, figures[name].meaning)
            for name, label in (
                ("values.taken", "values taken"), ("values.not_taken", "values not taken"),
                ("lines.not_understood", "lines not understood"),
            )
        ],
        next_step=("Look at the machine, then simulate with it:\n", code(f"feedsim machine info {FOLDER}")),
        main=[_taken(made), _refused(reading, made), _missing(made), _odd(archives), _sources(reading, made)],
        provenance=provenance_section(
            [("Control", reading.control)], hashed([("file", path) for path in inputs])
        ),
        footer="Every value with its place: sheet.csv and the remarks in machine.yaml. Names: docs/control_names.md.",
    )  # fmt: skip


def _sources(reading: Reading, made: Imported) -> Section | None:
    refused = (*reading.refused, *made.refused)
    return sources_section([*(each.name for each in made.values), *(each.name for each in refused)])


def _taken(made: Imported) -> Section | None:
    rows: list[tuple[Text, ...]] = [
        (
            each.axis or "machine", code(each.number), each.called,
            minus(f"{each.text} {each.unit}".strip()), code(each.parameter),
            minus(_ours(each)), _before(made, each), each.where or "–",
            "–" if each.condition else "confirmed" if each.name.confirmed else "not confirmed",
        )
        for each in made.values
    ]  # fmt: skip
    heads = ("Axis", "Number", "Name", "In the control", "Ours", "In the machine file", "Before", "Where", "Unit")
    return Section("Values that were taken", [Table("lllrlrrll", heads, rows)], "taken") if rows else None


def _ours(each: Taken) -> str:
    """A value as the machine file has it, rounded, and in a unit that reads well."""
    value = written(each)
    if isinstance(value, bool):
        return str(value).lower()
    if not isinstance(each.value, float):
        return str(value)
    unit = value.partition(" ")[2] if isinstance(value, str) else ""
    usual = scale(unit, np.array([each.value])) if each.value and unit != "1/s" else Scale(1.0, unit)
    return f"{each.value * usual.factor:.6g} {usual.unit}".rstrip()


def _before(made: Imported, each: Taken) -> str:
    value = made.before.get(place_of(each))
    if value is None or isinstance(value, dict | list):
        return "–"
    return str(value).lower() if isinstance(value, bool) else minus(str(value))


def _refused(reading: Reading, made: Imported) -> Section | None:
    rows: list[tuple[Text, ...]] = [
        (each.axis or "machine", code(each.name.number), each.name.name, minus(each.text), each.reason, each.where)
        for weight in ("doubt", "note")
        for each in (*reading.refused, *made.refused)
        if each.weight == weight
    ]
    heads = ("Axis", "Number", "Name", "In the control", "Why", "Where")
    return Section("Values that were not taken", [Table("lllrpl", heads, rows)], "not-taken") if rows else None


def _missing(made: Imported) -> Section | None:
    return Section("What the machine file needs besides", [Bullets(made.missing)], "missing") if made.missing else None


def _odd(archives: Sequence[Archive]) -> Section | None:
    rows = [(f"{archive.name}:{each.line}", each.reason, code(each.text)) for archive, each in _examples(archives)]
    total = sum(archive.odd_count for archive in archives)
    note = f"The first {len(rows)} of {total}, of each file by turns." if total > len(rows) else ""
    table = Table("lpl", ("Line", "Why", "Text"), rows, note)
    return Section("Lines that were not understood", [table], "odd") if rows else None


def _examples(archives: Sequence[Archive]) -> Iterator[tuple[Archive, Any]]:
    share = max(1, MOST_ODD // max(1, len(archives)))
    for archive in archives:
        for each in archive.odd[:share]:
            yield archive, each


def summary(
    archives: Sequence[Archive], reading: Reading, made: Imported, inputs: Sequence[Path], names: Sequence[str]
) -> Mapping[str, Any]:
    """Content of summary.json."""
    return {
        "kind": KIND,
        "answer": answers(archives, reading, made),
        "control": reading.control,
        "axes": dict(reading.axes),
        "figures": figures_part(figures_of(archives, reading, made)),
        "taken": [
            {"axis": each.axis, "parameter": each.parameter, "number": each.number, "value": each.value,
             "unit": each.name.si, "text": each.entry.text if each.entry else None, "where": each.where,
             "confirmed": None if each.condition else each.name.confirmed, "condition": each.condition}
            for each in made.values
        ],
        "not_taken": [
            {"axis": each.axis, "parameter": each.name.parameter, "number": each.name.number, "text": each.text,
             "reason": each.reason, "where": each.where, "acts": each.weight == "doubt"}
            for each in (*reading.refused, *made.refused)
        ],
        "missing": list(made.missing),
        "not_understood": [
            {"file": archive.name, "line": each.line, "text": each.text, "reason": each.reason}
            for archive, each in _examples(archives)
        ],
        "software": software(),
        "inputs": inputs_part(hashed([("file", path) for path in inputs])),
        "files": list(names),
    }  # fmt: skip
