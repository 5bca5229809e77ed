"""The setpoints of a record through the simulated axes, beside what was recorded."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated

from feedsim.analysis import Named
from feedsim.design.tune import Proposal
from feedsim.design.tune.proposals import of_drives
from feedsim.estimation.replay.compare import replayed
from feedsim.estimation.replay.open_loop import driven
from feedsim.files.trace import write_csv
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
    out,
)
from feedsim.jobs.records import Asked
from feedsim.jobs.result import Kind, Result, announce, kept
from feedsim.report.replay import report as page
from feedsim.report.replay.report import Replayed
from feedsim.scenario import Drive, Machine
from feedsim.structure import checked_modes

KIND = Kind("replay", page.FILES)


def result_of(done: Replayed, inputs: Sequence[Path]) -> Result[Replayed]:
    """A record beside the simulated machine that follows its setpoints. inputs: files that it rests on."""
    return Result(
        KIND,
        done,
        partial(page.report_of, done),
        figures=Named(done.figures),
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
    out: Annotated[File | None, out("replay_{record}")] = None,
    figures: FigureKinds = (),
    force: Force = False,
    control: ControlName = "",
    watch: Watch = NO_WATCH,
) -> Result[Replayed]:
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
    asked = Asked.of(record, machine, axes, columns, window, set)
    assert asked.subject is not None
    own = asked.subject.machine
    archives = None if fmus is None else Path(fmus)
    inputs = [*asked.inputs, own.modes]
    asked_for = [*asked.asked_for, *(["open_loop=yes"] if open_loop else [])]
    with kept(out, KIND, watch, inputs, asked_for, force=force):
        watch.progress("reading", 0, 3)
        records = asked.records
        announce(watch, own, archives)
        watch.progress("replay", 1, 3)
        beside = driven(own, records, asked.read, archives) if open_loop else replayed(own, records, archives)
        comparisons = list(beside.values())
        watch.progress("report", 2, 3)
        sources = [recorded.provenance for recorded in asked.read.values()]
        results = [finding for comparison in comparisons for finding in comparison.findings]
        settings = {**asked.settings, **({"open_loop": "yes"} if open_loop else {})}
        findings = dict.fromkeys([*results, *(text for source in sources for text in source.warnings)])
        findings |= dict.fromkeys(asked.unread(asked.read))
        done = Replayed(
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
