"""Drive, inertia and friction of axes from a record of their control, in closed loop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import date
from functools import partial
from pathlib import Path
from typing import Annotated

from feedsim.analysis import FigureTable
from feedsim.estimation.replay.identified import identify_drives
from feedsim.estimation.replay.machine_files import MOST_MODES, file_names
from feedsim.foundation.arguments import Value, quantity, spell_argument
from feedsim.foundation.errors import InputError
from feedsim.jobs.parameters import (
    NO_WATCH,
    Archives,
    ControlName,
    FigureKinds,
    File,
    Force,
    Option,
    RecordArgument,
    RecordAxes,
    RecordColumns,
    RecordWindow,
    Settings,
    Watch,
    job,
    output_option,
)
from feedsim.jobs.replay import ReplayRequest
from feedsim.jobs.result import Kind, Result, announce_programs, claim_result_folder
from feedsim.report import identified_drive as page
from feedsim.report.identified_drive import DriveReport

KIND = Kind("identify-drive", keeps=("*",))


def result_of(drives: DriveReport, inputs: Sequence[Path]) -> Result[DriveReport]:
    """Drives of axes: what was found of every axis, its files, and the record beside a run of it."""
    return Result(
        KIND,
        drives,
        partial(page.report_of, drives),
        figures=FigureTable(drives.figures),
        details=partial(page.details, drives),
        files=lambda: drives.found.files,
        inputs=inputs,
        lines=partial(page.summary_lines, drives),
    )


@job("drive, inertia and friction from a record of a control")
def identify_drive(
    record: RecordArgument,
    axes: RecordAxes = None,
    machine: Annotated[
        File | None,
        Option(
            "MACHINE-or-SCENARIO",
            "whose structure and friction are known (default: rigid axes, and what the record determines)",
        ),
    ] = None,
    *,
    columns: RecordColumns = None,
    window: RecordWindow = None,
    position_cycle: Annotated[
        Value | None,
        Option(
            "VALUE",
            "cycle of the position loop of rigid axes, e.g. '2 ms' (default: the control cycle, as "
            "where the drive closes that loop itself, or that of the record's rows where the record"
            " speaks for it)",
        ),
    ] = None,
    modes: Annotated[
        int | str,
        Option(
            "0..5|auto",
            "elastic modes of every rigid axis; auto: as many as predict best what a fit has not seen (default: 0)",
        ),
    ] = 0,
    name: Annotated[str | None, Option("NAME", "of the machine that is written (default: name of the record)")] = None,
    set: Settings = None,
    fmus: Archives = None,
    out: Annotated[File | None, output_option("drive_{record}")] = None,
    figures: FigureKinds = (),
    force: Force = False,
    control: ControlName = "",
    watch: Watch = NO_WATCH,
) -> Result[DriveReport]:
    """Identify the drive of axes: delay of the setpoint, position loop, speed controller, inertia and friction.

    Every value has an interval. Leaves a machine folder (or, with --machine, the drive's parameters), and a report.

    Command line:
        feedsim example test_centre
        feedsim identify drive capture.json --axes X,Y --out results/my_machine
        feedsim replay capture.json --machine results/my_machine --axes X,Y
        feedsim identify drive log.csv --axes Z --machine machines/test_centre

    Raises:
        InputError: a faulty file, no such window; of no axis a drive follows from the record. Of some axes: the others
            are in the result, with the reason among its findings.
        SimulationError: a unit failed.
        OutputError: `out` cannot be written.

    >>> import feedsim as fs
    >>> fs.identify_drive("log.csv", "Z", "machines/nowhere")
    Traceback (most recent call last):
    feedsim.foundation.errors.InputError: no such file: machines/nowhere
    """
    asked = ReplayRequest.of(record, machine, axes, columns, window, set)
    path = asked.recording.path
    title = name or path.stem
    cycle = quantity("position_cycle", position_cycle, "s", "1 ms") if position_cycle else None
    count = count_of_modes(modes, asked.machine is not None)
    archives = None if fmus is None else Path(fmus)
    kind = replace(KIND, may_write=file_names(asked.axes))
    head = page.head(path, asked.window, date.today().isoformat())
    with claim_result_folder(out, kind, watch, asked.inputs, asked.asked_for, force=force):
        watch.progress("reading", 0, 1)
        read, records, refused = asked.each_axis()
        if asked.machine is not None:
            announce_programs(watch, asked.machine, archives)
        drives_found = identify_drives(
            read,
            records,
            asked.machine,
            head,
            title,
            page.note(path, count),
            watch.progress,
            archives,
            cycle,
            count,
            asked.recording.control,
            refused,
        )
        sources = [recorded.provenance for recorded in read.values()]
        unread = asked.unread(read)
        done = DriveReport(drives_found, sources, asked.subject, title, asked.settings, asked.marks, unread)
        result = result_of(done, asked.inputs)
        if out is not None:
            result.save(out, figures=figures, force=force, control=control)
    return result


def count_of_modes(modes: int | str, structure_known: bool) -> int | None:
    """0 to 5, or None of "auto". InputError: neither, or modes where the machine has its own."""
    text = str(modes)
    if text != "auto" and not (text.isdecimal() and int(text) <= MOST_MODES):
        raise InputError(f"{spell_argument('modes')} {text}: 0 to {MOST_MODES}, or auto")
    if structure_known and text != "0":
        known = f"the structure is that of {spell_argument('machine')}"
        raise InputError(f"{spell_argument('modes')} {text}: {known}; leave one of the two out")
    return None if text == "auto" else int(text)
