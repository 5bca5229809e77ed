"""What a run leaves in a folder: its rows, its report, summary.json, log, sheets and the machine page.

Start reading at write().
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from feedsim.analysis import (
    CircleTask,
    Diagnosis,
    Figure,
    contours,
    tasks,
)
from feedsim.analysis.proposals import Proposal
from feedsim.files.trace import Trace, write_csv
from feedsim.foundation.installation import require_extras
from feedsim.motions.circular import SENSE_WORDS
from feedsim.report.changes import action, changes_part
from feedsim.report.content import Report
from feedsim.report.page import PARTIAL, Partial, sheet_html
from feedsim.report.provenance import (
    input_files,
    inputs_part,
    machine_part,
    quantity,
)
from feedsim.report.results import Content
from feedsim.report.run import sheet
from feedsim.report.run.contour import BLOCKS_FILE, blocks_csv, contour_part
from feedsim.report.run.pose import diagnosis_part, pose_part
from feedsim.report.run.report import (
    COUPLING_MEANINGS,
    LOG,
    PAGE,
    RESULT,
    draw,
    first_proposals,
    leading_names,
    real_time_factor,
    report_of,
    signal_unit,
)
from feedsim.report.uncertainty import BANDS, bands_csv, summary_part, with_intervals
from feedsim.scenario import Logging
from feedsim.simulation.judge import JudgedRun

if TYPE_CHECKING:
    from feedsim.design.uncertainty import Uncertainty
    from feedsim.report.run.sheet import FilledSheet


# --- Acceptance sheets as an Excel workbook: numbers as numbers, whatever the decimal sign of the reader's country ----
# A worksheet per sheet, in the order of sheet.html; all digits of sheet.csv. Sole user of XlsxWriter.


MAX_SHEET_NAME = 31  # of a worksheet, which Excel also forbids these characters in
FORBIDDEN = re.compile(r"[\[\]:*?/\\']")
CREATION_DATE = datetime(1980, 1, 1, tzinfo=UTC)  # the same result has the same bytes
WIDTHS = (24, 44, 14, 14, 14, 14)  # of the first columns, in characters
LONGEST_TEXT = 32767  # of a cell


def require_workbooks() -> None:
    """Raise MissingPackage unless workbooks can be written."""
    require_extras("sheet.xlsx (sheet: {xlsx: true})", "xlsx")


def workbook(sheets: Sequence[FilledSheet], rule: str) -> bytes:
    """Content of sheet.xlsx. rule: how a figure is judged. Raises MissingPackage without XlsxWriter."""
    require_workbooks()
    import xlsxwriter

    content = io.BytesIO()
    # A text of the user that looks like a formula or an address stays a text.
    options = {"in_memory": True, "strings_to_formulas": False, "strings_to_urls": False}
    with xlsxwriter.Workbook(content, options) as book:
        book.set_properties(
            {"title": "Acceptance sheet", "created": CREATION_DATE, "comments": "Written by feedsim run."}
        )
        names: set[str] = set()
        for sheet in sheets:
            _fill(book, book.add_worksheet(_name(sheet.title, names)), sheet, rule)
    return content.getvalue()


def _name(title: str, taken: set[str]) -> str:
    """Name of a worksheet, and no second one of that name; Excel ignores upper and lower case."""
    plain = FORBIDDEN.sub(" ", title).strip() or "sheet"
    name, count = plain[:MAX_SHEET_NAME], 1
    while name.casefold() in taken:
        count += 1
        end = f" ({count})"
        name = plain[: MAX_SHEET_NAME - len(end)] + end
    taken.add(name.casefold())
    return name


def _fill(book: Any, page: Any, sheet: FilledSheet, rule: str) -> None:
    title = book.add_format({"bold": True, "font_size": 14})
    head = book.add_format({"bold": True, "bottom": 1, "text_wrap": True, "valign": "top"})
    verdict = book.add_format({"bold": True, "border": 2, "align": "center"})
    wrapped = book.add_format({"text_wrap": True, "valign": "top"})
    figure, reading = (book.add_format({"num_format": digits}) for digits in ("0.00", "0.000"))
    for column, width in enumerate(WIDTHS):
        page.set_column(column, column, width)
    page.set_paper(9)  # A4
    page.set_landscape()
    page.fit_to_pages(1, 0)
    page.set_footer("&L&F&R&P / &N")

    row = 0

    def line(*cells: object, style: Any = None) -> None:
        nonlocal row
        for column, cell in enumerate(cells):
            if isinstance(cell, str):
                page.write_string(row, column, cell[:LONGEST_TEXT], style)
            elif isinstance(cell, (int, float)) and math.isfinite(cell):
                page.write_number(row, column, cell, style)
        row += 1

    line(sheet.title, style=title)
    line(f"Acceptance sheet in the letters of {sheet.standard}")
    if sheet.verdict:
        line(sheet.verdict.upper(), style=verdict)
    row += 1
    line("Symbol", "Meaning", "Value [µm]", "Limit [µm]", "U (k = 2) [µm]", "Verdict", style=head)
    for result in sheet.results:
        page.write_string(row, 0, result.symbol)
        page.write_string(row, 1, result.meaning, wrapped)
        page.write_string(row, 5, result.verdict)
        for column, value in ((2, result.value), (3, result.limit), (4, sheet.uncertainty)):
            if math.isfinite(value):
                page.write_number(row, column, value, figure)
        row += 1
    page.merge_range(row, 0, row, len(WIDTHS) - 1, rule, wrapped)
    page.set_row(row, 45)
    row += 2
    line("Condition", "", style=head)
    for what, how in sheet.conditions:
        line(what, how, style=wrapped)
    row += 1
    line(*sheet.heads, style=head)
    for cells in sheet.numbers:
        line(*cells, style=reading)
    page.repeat_rows(0)
    line()
    line("Date", "Name, signature", style=book.add_format({"top": 1}))


# --- What a run leaves in a folder: its rows, its report, summary.json, log, sheets and the machine page --------------


FORMAT = 1


FILES = (RESULT, LOG, PAGE, BANDS, BLOCKS_FILE, sheet.HTML, sheet.CSV, sheet.XLSX, PARTIAL)  # besides the report


def growing_result(directory: Path | str) -> Partial:
    """What takes a run's rows while it goes on, for :func:`files_of`."""
    return Partial(directory, RESULT)


def page_of(
    run: JudgedRun,
    figures: Mapping[str, Figure],
    causes: Mapping[str, Diagnosis],
    proposals: Sequence[Proposal],
    *,
    page: bool,
    uncertainty: Uncertainty | None,
) -> Report:
    """Content of the report, with the intervals where there are some."""
    report = report_of(run, figures, draw(run, figures, causes), causes, proposals, page=page)
    return report if uncertainty is None else with_intervals(report, uncertainty, figures, leading_names(figures))


def files_of(
    run: JudgedRun, page: str = "", recorded: Partial | None = None, uncertainty: Uncertainty | None = None
) -> dict[str, Content]:
    """Name -> content of all files besides the report.

    page: the machine as a page that computes. recorded: the run's rows where they have been written already, in the
    folder that the result goes to; the file becomes result.csv, or stays as it is where the result cannot be written.
    """

    def result(path: Path) -> Path | None:
        if recorded is None or not recorded.has_rows:
            write_csv(path, run.trace)
            return None
        recorded.finished()
        return recorded.path

    files: dict[str, Content] = {RESULT: result}
    if run.log is not None:
        files[LOG] = partial(write_csv, trace=run.log)
    for prefix, error in contours(run).items():
        files[BLOCKS_FILE if prefix == "contour" else f"{prefix.replace('#', '-')}-{BLOCKS_FILE}"] = blocks_csv(error)
    if uncertainty is not None:
        files[BANDS] = bands_csv(uncertainty)
    if page:
        files[PAGE] = page
    if sheets := sheet.sheets_of(run):
        files[sheet.HTML] = sheet_html(run.scenario.name, sheets, sheet.RULE)
        files[sheet.CSV] = sheet.table(sheets)
    if sheet.in_workbook(run.scenario):
        files[sheet.XLSX] = workbook(sheets, sheet.RULE)
    return files


def details(
    run: JudgedRun,
    figures: Mapping[str, Figure],
    causes: Mapping[str, Diagnosis],
    proposals: Sequence[Proposal],
    uncertainty: Uncertainty | None = None,
) -> dict[str, Any]:
    """What summary.json has besides the figures; a figure that could not be determined has the value null."""
    scenario, machine = run.scenario, run.scenario.machine
    return {
        "format": FORMAT,
        "action": action(first_proposals(proposals, causes), machine),
        **({"uncertain": summary_part(uncertainty, figures)} if uncertainty is not None else {}),
        "changes": changes_part(proposals),
        "circles": _circles(run, causes),
        "diagnosis": {prefix: diagnosis_part(diagnosis) for prefix, diagnosis in causes.items()},
        "contours": {prefix: contour_part(error) for prefix, error in contours(run).items()},
        "scenario": {
            "name": scenario.name,
            "file": scenario.file.name,
            "note": scenario.note,
            "set": list(scenario.settings),
            "overrides": list(scenario.overrides),
            "duration": quantity(run.program.duration, "s"),
            "coupling": scenario.coupling.model_dump() | {"substeps": scenario.coupling.steps(machine)},
            "recording_interval": quantity(scenario.recording.interval, "s"),
            "logging": logging_part(scenario.logging, run.log),
            "motions": [
                {
                    "description": segment.description,
                    "start": quantity(segment.start, "s"),
                    "end": quantity(segment.end, "s"),
                }
                for segment in run.program.segments
            ],
        },
        "loads": [
            {
                "acts": work.words,
                "input": work.input,
                "largest": quantity(work.peak, work.unit),
                "work_on_machine": quantity(work.given, "J"),
                "work_taken": quantity(work.taken, "J"),
                "motor_while_it_acts": None
                if work.drives is None
                else {
                    "work_in_run": quantity(work.drives.run, "J"),
                    "work_in_record": quantity(work.drives.record, "J"),
                },
            }
            for work in run.loads
        ],
        "machine": machine_part(machine),
        "pose": pose_part(run.pose),
        "inputs": inputs_part(input_files(scenario)),
        "units": {name: dict(unit) for name, unit in run.units.items()},
        "coupling": {
            name: {"value": value, "unit": "J", "meaning": COUPLING_MEANINGS[name.partition(".")[2]]}
            for name, value in run.coupling.items()
        },
        "performance": {
            "wall_time": quantity(run.wall_time, "s"),
            "real_time_factor": quantity(real_time_factor(run), "1"),
            "cycle_loop": "native" if run.native else "Python",
        },
    }


def _circles(run: JudgedRun, causes: Mapping[str, Diagnosis]) -> dict[str, Any]:
    """The turns that figures are of: who lays them over others needs no scenario."""
    result = [task for task in tasks(run.scenario, run.program) if task.prefix in causes] if causes else []
    return {
        task.prefix: [
            {
                "axes": list(turn.axes),
                "centre": quantity(list(turn.centre), "m"),
                "radius": quantity(turn.radius, "m"),
                "direction": SENSE_WORDS[turn.sense],
                "begin": quantity(turn.begin, "s"),
                "end": quantity(turn.end, "s"),
            }
            for turn in task.turns
        ]
        for task in result
        if isinstance(task, CircleTask)
    }


def logging_part(logging: Logging | None, log: Trace | None) -> dict[str, Any] | None:
    """Settings of a log in SI; None where there is none."""
    if logging is None:
        return None
    return {
        "interval": quantity(logging.interval, "s"),
        "columns": list(log) if log is not None else [],
        "noise": {
            signal: {"value": level.value, "unit": "of the RMS" if level.relative else signal_unit(signal, log)}
            for signal, level in logging.noise.given().items()
        },
        "quantisation": {
            signal: {"value": step, "unit": signal_unit(signal, log)}
            for signal, step in logging.quantisation.given().items()
        },
        "delay": {signal: quantity(delay, "s") for signal, delay in logging.delay.given().items()},
        "seed": logging.seed,
    }
