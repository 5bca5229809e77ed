"""The setpoints of a record through the simulated axes, beside what was recorded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Annotated

from feedsim.analysis import FigureTable
from feedsim.analysis.proposals import Proposal, of_drives
from feedsim.estimation.identify import RecordedAxis, best_window, total_time
from feedsim.estimation.replay.closed_loop import AxisRecord, cut_window, read_axes
from feedsim.estimation.replay.closed_loop import window as window_of
from feedsim.estimation.replay.compare import drive_axes, replay_records
from feedsim.files.columns import Columns, load_columns
from feedsim.files.fields import no_axis
from feedsim.files.trace import Mark, Recording, read_recording, write_csv
from feedsim.foundation.arguments import Changes, prefix_argument_errors, settings, spell_argument, split_names
from feedsim.foundation.errors import Finding, InputError, shorten_list
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
from feedsim.jobs.result import Kind, Result, announce_programs, claim_result_folder
from feedsim.report import replay as page
from feedsim.report.replay import ReplayReport
from feedsim.scenario import Drive, Machine, Subject, load_subject
from feedsim.structure import checked_modes

# --- A record of a control and the machine that goes with it, as replays and identifications of drives read them ------


MOST_NAMED = 20  # columns that a note names
MAX_DRIVE_TIME = 30.0  # [s] of a record that a drive is identified from


@dataclass(frozen=True, eq=False)
class ReplayRequest:
    """A recording, the axes of it, and the part that counts.

    window: begin and end [s]; None: all. settings: what was asked for by argument, as the user wrote it, without paths.
    changes: of the machine.
    """

    recording: Recording
    subject: Subject | None
    axes: tuple[str, ...]
    mapping: Columns | None
    window: tuple[float, float] | None
    settings: Mapping[str, str]
    changes: Sequence[str]

    @classmethod
    def of(
        cls,
        record: File,
        machine: File | None,
        axes: str | Sequence[str] | None,
        columns: File | None,
        window: str | None,
        changes: Changes,
    ) -> ReplayRequest:
        """Read machine, mapping and recording. Raises InputError: a faulty file, no such axis, no such window."""
        texts = settings(changes)
        subject = load_subject(machine, texts) if machine is not None else None
        chosen = _axes(axes, subject.machine if subject is not None else None)
        mapping = load_columns(columns) if columns is not None else None
        recording = read_recording(record)
        part = None
        if window is not None:
            with prefix_argument_errors("window", window):
                part = window_of(window, recording.marks)
        text = axes if isinstance(axes, str) else ",".join(axes or ())
        asked = {name: value for name, value in (("axes", text), ("window", window or "")) if value}
        return cls(recording, subject, chosen, mapping, part, asked, texts)

    @property
    def machine(self) -> Machine | None:
        """The machine, where one is given."""
        return self.subject.machine if self.subject is not None else None

    @property
    def marks(self) -> Sequence[Mark]:
        """Events of the record, such as blocks of its program."""
        return self.recording.marks

    @property
    def inputs(self) -> list[Path]:
        """Files that are read."""
        return [self.recording.path, *(file for _, file in (self.subject.files if self.subject is not None else ()))]

    @property
    def asked_for(self) -> list[str]:
        """All that was asked for, as texts."""
        return [*self.changes, *(f"{name}={text}" for name, text in self.settings.items())]

    @cached_property
    def read(self) -> Mapping[str, RecordedAxis]:
        """Axis -> all of its record."""
        return read_axes(self.recording, self.axes, self.machine, self.mapping)

    @cached_property
    def records(self) -> dict[str, AxisRecord]:
        """Axis -> the stretch of its record that holds the window."""
        return {axis: cut_window(axis, recorded, self.window) for axis, recorded in self.read.items()}

    def each_axis(self) -> tuple[dict[str, RecordedAxis], dict[str, AxisRecord], dict[str, str]]:
        """`read` and `records` of the axes that have them, and why another one has none; of long records the part that
        a drive is identified from.

        Raises InputError: none of them has.
        """
        read: dict[str, RecordedAxis] = {}
        records: dict[str, AxisRecord] = {}
        refused: dict[str, str] = {}
        for axis in self.axes:
            try:
                recorded = read_axes(self.recording, [axis], self.machine, self.mapping)[axis]
                records[axis], read[axis] = self._part_for_drive(axis, recorded)
            except InputError as error:
                refused[axis] = str(error)
        if not read:
            raise InputError.of(f"{self.recording.path}", dict.fromkeys(refused.values()))
        return read, records, refused

    def _part_for_drive(self, axis: str, recorded: RecordedAxis) -> tuple[AxisRecord, RecordedAxis]:
        """The stretch that the drive of an axis is identified from, and what the regression of its position loop
        takes: all of the record unless it is long."""
        if total_time(recorded.records) <= MAX_DRIVE_TIME:
            return cut_window(axis, recorded, self.window), recorded
        part, longest = self.window, max(recorded.records, key=len)
        said = recorded.provenance.warnings
        if part is None and total_time([longest]) > MAX_DRIVE_TIME:
            part = best_window(longest, MAX_DRIVE_TIME)
            option = spell_argument("window")
            text = (
                f"axis {axis}: of {total_time([longest]):.6g} s the drive is identified from {part[0]:.6g} to "
                f"{part[1]:.6g} s, the part that determines it best; {option} takes another one"
            )
            said = (*said, Finding("record-excerpt", "note", text, axis, f"Give {option} for another part"))
        cut = cut_window(axis, recorded, part)
        return cut, replace(recorded, records=(cut.record,), provenance=replace(recorded.provenance, warnings=said))

    def unread(self, read: Mapping[str, RecordedAxis]) -> list[Finding]:
        """A note on the columns of the file that none of the axes is read from; those of the axes come first."""
        used = {column for recorded in read.values() for column in recorded.provenance.columns.values()}
        numbers = {name.rpartition("|")[2] for name in used if "|" in name}  # of the axes of a capture
        used |= {f"POWER|{number}" for number in numbers}  # which their pitch is by
        others = [name for name in self.recording.names if name not in used]
        names = sorted(others, key=lambda name: name.rpartition("|")[2] not in numbers)
        text = f"{self.recording.path}: columns that are not read: {shorten_list(names, MOST_NAMED)}"
        return [Finding("columns-not-read", "note", text, str(self.recording.path))] if names else []


def _axes(axes: str | Sequence[str] | None, machine: Machine | None) -> tuple[str, ...]:
    option = spell_argument("axes")
    if axes is None:
        if machine is None:
            raise InputError(f"{option}: which axes of the record are meant? For example {option} X,Y")
        return tuple(machine.axes)
    result = split_names(axes)
    text = axes if isinstance(axes, str) else ",".join(axes)
    for axis in result if machine is not None else ():
        if machine is not None and axis not in machine.axes:
            raise InputError(f"{option} {text}: {no_axis(axis, machine.axes)}")
    if not result or len({*result}) < len(result):
        raise InputError(f"{option} {text}: names of axes are needed, each once, such as X,Y")
    return result


# --- The setpoints of a record through the simulated axes, beside what was recorded -----------------------------------


KIND = Kind("replay", page.FILES)


def result_of(done: ReplayReport, inputs: Sequence[Path]) -> Result[ReplayReport]:
    """A record beside the simulated machine that follows its setpoints. inputs: files that it rests on."""
    return Result(
        KIND,
        done,
        partial(page.report_of, done),
        figures=FigureTable(done.figures),
        details=partial(page.details, done),
        files=lambda: {page.REPLAY: partial(write_csv, trace=done.trace)},
        inputs=inputs,
        lines=partial(page.lines, done),
    )


@job("run a record's setpoints on simulated axes, and compare")
def replay(
    record: RecordArgument,
    machine: Annotated[File, Option("MACHINE-or-SCENARIO", "the machine that follows the record")],
    axes: RecordAxes = None,
    *,
    columns: RecordColumns = None,
    window: RecordWindow = None,
    open_loop: Annotated[
        bool,
        Option(
            "", "the recorded torque drives the rigid axis, from the recorded position and speed on, without its drive"
        ),
    ] = False,
    set: Settings = None,
    fmus: Archives = None,
    out: Annotated[File | None, output_option("replay_{record}")] = None,
    figures: FigureKinds = (),
    force: Force = False,
    control: ControlName = "",
    watch: Watch = NO_WATCH,
) -> Result[ReplayReport]:
    """Run the position setpoints of a record through the simulated axes, in closed loop, and compare.

    Shows what is left of position, torque and speed setpoint: over time, as figures, as a spectrum and over the
    position. In open loop the recorded torque drives the axes instead, from the recorded position and speed on.

    Command line:
        feedsim example sinumerik_840d test_centre
        feedsim replay capture.json --machine machines/sinumerik_840d --axes X,Y
        feedsim replay log.csv --machine machines/test_centre --axes Z --window "0.5 s..2 s"
        feedsim replay log.csv --machine machines/test_centre --axes Z --open-loop
        feedsim replay log.csv --machine my_machine --axes Z --set axes.Z.drive.K_v="2 (m/min)/mm" --out results/other

    Raises:
        InputError: a faulty file, no such axis, no such window, no setpoint or no position in the record; in open loop
            no torque.
        SimulationError: a unit failed.
        OutputError: `out` cannot be written.

    >>> import feedsim as fs
    >>> paths = fs.run("z_positioning.yaml").save("positioned")
    >>> result = fs.replay("positioned/result.csv", "machines/test_centre", "Z")
    >>> result.figures["Z.position_rms"].unit
    'um'
    """
    asked = ReplayRequest.of(record, machine, axes, columns, window, set)
    assert asked.subject is not None
    own = asked.subject.machine
    archives = None if fmus is None else Path(fmus)
    inputs = [*asked.inputs, own.modes.file]
    asked_for = [*asked.asked_for, *(["open_loop=yes"] if open_loop else [])]
    with claim_result_folder(out, KIND, watch, inputs, asked_for, force=force):
        watch.progress("reading", 0, 3)
        records = asked.records
        announce_programs(watch, own, archives)
        watch.progress("replay", 1, 3)
        beside = drive_axes(own, records, asked.read, archives) if open_loop else replay_records(own, records, archives)
        comparisons = list(beside.values())
        watch.progress("report", 2, 3)
        sources = [recorded.provenance for recorded in asked.read.values()]
        results = [finding for comparison in comparisons for finding in comparison.findings]
        settings = {**asked.settings, **({"open_loop": "yes"} if open_loop else {})}
        findings = dict.fromkeys([*results, *(warning for source in sources for warning in source.warnings)])
        findings |= dict.fromkeys(asked.unread(asked.read))
        done = ReplayReport(
            comparisons, asked.subject, sources, asked.marks, settings, [*findings], _proposals(own, asked.axes)
        )
        result = result_of(done, inputs)
        if out is not None:
            result.save(out, figures=figures, force=force, control=control)
    return result


def _proposals(machine: Machine, axes: Sequence[str]) -> list[Proposal]:
    """What of the drives does not fit together; none of drives of other makers."""
    own = [axis for axis in axes if isinstance(machine.axes[axis].drive, Drive)]
    return of_drives(machine, checked_modes(machine), own, "the drive does not fit together")
