"""Levelling mounts of a machine from ring-downs behind stops."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated

from feedsim.analysis import FigureTable
from feedsim.estimation.modal.measured import Channel
from feedsim.estimation.replay.mounts import Accelerometer, read_stops, start_factors, with_accelerometer
from feedsim.estimation.replay.mounts import identify_mounts as identified
from feedsim.files.columns import load_columns
from feedsim.files.fields import no_axis
from feedsim.files.trace import read_recording
from feedsim.foundation.arguments import Value, amount, prefix_argument_errors, settings, spell_argument
from feedsim.foundation.errors import Finding, InputError
from feedsim.jobs.parameters import (
    NO_WATCH,
    Archives,
    Argument,
    FigureKinds,
    File,
    Force,
    Option,
    RecordColumns,
    Settings,
    Watch,
    job,
    output_option,
)
from feedsim.jobs.result import Kind, Result, announce_programs, claim_result_folder
from feedsim.report import mounts as page
from feedsim.scenario import load_subject
from feedsim.simulation.judge import warn_mount_damping as damped_twice

SIGNALS = ("position", "speed")


KIND = Kind("identify-mounts", page.FILES, keeps=page.KEPT_FILES)


def result_of(identified: page.MountsReport) -> Result[page.MountsReport]:
    """Levelling mounts, identified: whether they are linear, and what they are."""
    return Result(
        KIND,
        identified,
        partial(page.report_of, identified),
        figures=FigureTable(identified.figures).with_intervals(
            {name: (100 * one.interval[0], 100 * one.interval[1]) for name, one in identified.estimates.items()}
        ),
        details=partial(page.details, identified),
        files=partial(page.files_of, identified),
        inputs=[*identified.files, *(file for _, file in identified.subject.files)],
        rows=partial(page.rows, identified),
    )


@job("levelling mounts from the ring-downs of stops")
def identify_mounts(
    logs: Annotated[
        File | Sequence[File],
        Argument(
            "LOG", "stops: position setpoint, and position or speed; or an accelerometer (CSV, MAT, UFF)", many=True
        ),
    ],
    machine: Annotated[
        File, Option("MACHINE-or-SCENARIO", "with a table of mounts (key mounts), whose elements are the start")
    ],
    axes: Annotated[str | None, Option("NAME", "the axis that stops (default: the only one of the logs)")] = None,
    *,
    columns: RecordColumns = None,
    signal: Annotated[
        str | None,
        Option(
            "", "which one of the axis counts (default: position where it is recorded)", choices=("position", "speed")
        ),
    ] = None,
    accelerometer: Annotated[
        str | None,
        Option(
            "DIRECTION=NAME[:UNIT]",
            "acceleration of the tool in place of the axis: direction X, Y or Z, its column, and its unit where the "
            "file has none, e.g. Z=1:+Z or Z=a:g; setpoints are those of the scenario, or of the log of a machine",
        ),
    ] = None,
    jerks: Annotated[
        str | Sequence[Value],
        Option(
            "VALUES",
            "jerk of the scenario's path, one a log of an accelerometer, e.g. '150 m/s^3,500 m/s^3' (default: its own)",
        ),
    ] = (),
    set: Settings = None,
    fmus: Archives = None,
    out: Annotated[File | None, output_option("mounts_{logs}")] = None,
    figures: FigureKinds = (),
    force: Force = False,
    watch: Watch = NO_WATCH,
) -> Result[page.MountsReport]:
    """Identify levelling mounts whose stiffness and damping depend on the amplitude, from the ring-downs of stops.

    Needs stops at two or more jerks, or one long decay. Leaves mounts.yaml, which machine files and scenarios take as
    they do the group `mounts`, and a report: frequency and damping over the amplitude, recorded and simulated.

    Command line:
        feedsim example elastomer_mounts z_elastomer_mounts
        feedsim identify mounts records/elastomer_mounts/stop_150.csv records/elastomer_mounts/stop_500.csv \
          --machine z_elastomer_mounts.yaml --axes Z
        feedsim identify mounts slow.uff fast.uff --machine stop.yaml --accelerometer Z=1:+Z \
          --jerks "150 m/s^3,500 m/s^3"

    Raises:
        InputError: a faulty file, no stop in a log, a machine without a table of mounts, wrong arguments.
        SimulationError: a unit failed.
        OutputError: `out` cannot be written.

    >>> import feedsim as fs
    >>> fs.identify_mounts("log.csv", "machines/test_centre", "Z")
    Traceback (most recent call last):
    feedsim.foundation.errors.InputError: Test centre: its mounts are springs; mounts are identified by a table of \
them (key mounts of the machine file, written by machine build), whose friction and viscous part are the start
    """
    files = [Path(file) for file in ([logs] if isinstance(logs, str | Path) else logs)]
    texts = settings(set)
    subject = load_subject(machine, texts)
    own = subject.machine
    if axes is not None and axes not in own.axes:
        raise InputError(f"{spell_argument('axes')} {axes}: {no_axis(axes, own.axes)}")
    if signal is not None and signal not in SIGNALS:
        raise InputError(f"{spell_argument('signal')} {signal}: {' or '.join(SIGNALS)}")
    sensor = _accelerometer(accelerometer) if accelerometer is not None else None
    each_jerk = _jerks(jerks, len(files), sensor is not None and subject.scenario is not None)
    mapping = load_columns(columns) if columns is not None else None
    start_factors(own)
    asked = {"axes": axes, "signal": signal, "accelerometer": accelerometer, "jerks": _text(jerks) or None}
    chosen = {name: str(value) for name, value in asked.items() if value is not None}
    inputs = [*files, *([Path(columns)] if columns is not None else []), *(file for _, file in subject.files)]
    asked_for = [*texts, *(f"{name}={text}" for name, text in chosen.items())]
    with claim_result_folder(out, KIND, watch, inputs, asked_for, force=force):
        watch.progress("reading", 0, 1)
        stops, notes = [], list[Finding]()
        for file, jerk in zip(files, each_jerk, strict=True):
            log, said = read_stops(
                read_recording(file), subject, axes, mapping, prefer=signal or "", accelerometer=sensor, jerk=jerk
            )
            stops.append(log)
            notes += said
        announce_programs(watch, own, None if fmus is None else Path(fmus))
        seen = own if sensor is None else with_accelerometer(own)
        mounts = identified(seen, stops, None if fmus is None else Path(fmus), watch.progress)
        findings = [*dict.fromkeys(notes), *damped_twice(own)]
        result = result_of(page.MountsReport(mounts, files, subject, chosen, findings))
        if out is not None:
            result.save(out, figures=figures, force=force)
    return result


def _accelerometer(text: str) -> Accelerometer:
    direction, equals, column = text.partition("=")
    if not equals or direction.strip() not in ("X", "Y", "Z") or not column.strip():
        raise InputError(
            f"{spell_argument('accelerometer')} {text}: DIRECTION=NAME or DIRECTION=NAME:UNIT is needed, such as "
            f"Z=a:m/s^2"
        )
    name, colon, unit = column.strip().rpartition(":")
    if colon and not unit.startswith(("+", "-")):  # the direction of a name in a universal file, 1:+Z
        return Accelerometer(
            direction.strip(), Channel.of(name, spell_argument("accelerometer")).names[0], unit.strip()
        )
    return Accelerometer(direction.strip(), column.strip())


def _text(jerks: str | Sequence[Value]) -> str:
    return jerks if isinstance(jerks, str) else ",".join(map(str, jerks))


def _jerks(jerks: str | Sequence[Value], logs: int, used: bool) -> list[float | None]:
    values = [part.strip() for part in jerks.split(",") if part.strip()] if isinstance(jerks, str) else list(jerks)
    if not values:
        return [None] * logs
    if not used:
        raise InputError(
            f"{spell_argument('jerks')} {_text(jerks)}: are those of a scenario, for logs of an accelerometer; "
            f"here the logs "
            "have their setpoints"
        )
    if len(values) != logs:
        raise InputError(
            f"{spell_argument('jerks')} {_text(jerks)}: {len(values)} values for {logs} logs; one a log is needed"
        )
    with prefix_argument_errors("jerks", _text(jerks)):
        return [amount(value, "m/s^3", "150 m/s^3", positive=True) for value in values]
