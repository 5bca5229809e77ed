"""feedsim replay and identify-drive: records of a control beside the simulated machine."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING

from feedsim.cli.options import CONTROL, FIGURES, FMUS, QUIET, Command, Option, names, out, quantity, settings
from feedsim.cli.terminal import announce, finish, progress_bar, results_in

if TYPE_CHECKING:
    from feedsim.scenario import Machine
    from feedsim.trace import Mark

REPLAY_DESCRIPTION = """Run the position setpoints of a record through the simulated axes, in closed loop, and show
what is left of position, torque and speed setpoint: over time, as figures, as a spectrum and over the position."""
REPLAY_EPILOG = """examples:
  feedsim example sinumerik_840d test_centre
  feedsim replay capture.json --machine machines/sinumerik_840d --axes X,Y
  feedsim replay log.csv --machine machines/test_centre --axes Z --window "0.5 s..2 s"
  feedsim replay log.csv --machine my_machine --axes Z --set axes.Z.drive.K_v="2 (m/min)/mm" --out results/other
"""
DRIVE_DESCRIPTION = """The drive of axes from a record of their control: delay of the setpoint, gain and feedforward of
the position loop by regression, speed controller, inertia and friction by output error in closed loop, each with its
interval. Leaves a machine folder (or, with --machine, the drive's parameters), and a report."""
DRIVE_EPILOG = """examples:
  feedsim example test_centre
  feedsim identify-drive capture.json --axes X,Y --out results/my_machine
  feedsim replay capture.json --machine results/my_machine --axes X,Y
  feedsim identify-drive log.csv --axes Z --machine machines/test_centre
"""


def replay(options: Namespace) -> None:
    """Read, run, compare, write."""
    from feedsim.files.columns import load_columns
    from feedsim.replay.closed_loop import read_axes, windowed
    from feedsim.replay.compare import replayed
    from feedsim.report import replay as report
    from feedsim.report.replay.report import Replayed
    from feedsim.scenario import load_subject

    subject = load_subject(options.machine, options.overrides)
    machine = subject.machine
    axes = _axes(options.axes, machine)
    mapping = load_columns(options.columns) if options.columns is not None else None
    directory: Path = options.out or Path("results") / f"replay_{options.record.stem}"
    marks = _marks(options.record)
    window = _window(options, marks)
    inputs = [options.record, *(file for _, file in subject.files), machine.modes]
    with (
        progress_bar(options.quiet) as progress,
        results_in(directory, report.check_writable, inputs, [*options.overrides, *_given(options)]),
    ):
        progress("reading", 0, 3)
        read = read_axes(options.record, axes, machine, mapping)
        records = {axis: windowed(axis, each, window) for axis, each in read.items()}
        announce(machine, options.fmus)
        progress("replay", 1, 3)
        comparisons = list(replayed(machine, records, options.fmus).values())
        progress("report", 2, 3)
        sources = [each.provenance for each in read.values()]
        found = [finding for each in comparisons for finding in each.findings]
        told = dict.fromkeys([*found, *(text for source in sources for text in source.warnings)])
        done = Replayed(
            comparisons, subject, sources, marks, dict(text.split("=", 1) for text in _given(options)),
            list(told),
        )  # fmt: skip
        report.write(done, directory, drawn=options.figures)
    finish(options.quiet, done.warnings, *report.summary_lines(done, directory))


def _given(options: Namespace) -> list[str]:
    """What was asked for, by option, without paths."""
    return [f"{name}={text}" for name in ("axes", "window") if (text := getattr(options, name))]


def _axes(text: str | None, machine: Machine | None) -> tuple[str, ...]:
    from feedsim.errors import InputError
    from feedsim.fields import no_axis

    if text is None:
        if machine is None:
            raise InputError("--axes: which axes of the record are meant? For example --axes X,Y")
        return tuple(machine.axes)
    found = names(text)
    for axis in found if machine is not None else ():
        if machine is not None and axis not in machine.axes:
            raise InputError(f"--axes {text}: {no_axis(axis, machine.axes)}")
    if not found or len(set(found)) < len(found):
        raise InputError(f"--axes {text}: names of axes are needed, each once, such as X,Y")
    return found


def _window(options: Namespace, marks: Sequence[Mark]) -> tuple[float, float] | None:
    from feedsim.replay.window import window

    return window(options.window, marks) if options.window is not None else None


def _marks(path: Path) -> Sequence[Mark]:
    from feedsim.trace import read_recording

    return read_recording(path).marks


def identify_drive(options: Namespace) -> None:
    """Read, identify, run what was found on the record, write."""
    from feedsim.files.columns import load_columns
    from feedsim.replay.closed_loop import read_axes, windowed
    from feedsim.replay.identified import identify_drives
    from feedsim.report.replay import drive as report
    from feedsim.scenario import load_subject

    subject = load_subject(options.machine, options.overrides) if options.machine is not None else None
    machine = subject.machine if subject is not None else None
    axes = _axes(options.axes, machine)
    mapping = load_columns(options.columns) if options.columns is not None else None
    directory: Path = options.out or Path("results") / f"drive_{options.record.stem}"
    marks = _marks(options.record)
    window = _window(options, marks)
    inputs = [options.record, *(file for _, file in (subject.files if subject is not None else ()))]
    name = options.name or options.record.stem
    cycle = quantity("position-cycle", options.position_cycle, "s", "1 ms") if options.position_cycle else None
    with (
        progress_bar(options.quiet) as progress,
        results_in(directory, report.check_writable(axes), inputs, [*options.overrides, *_given(options)]),
    ):
        progress("reading", 0, 1)
        read = read_axes(options.record, axes, machine, mapping)
        records = {axis: windowed(axis, each, window) for axis, each in read.items()}
        if machine is not None:
            announce(machine, options.fmus)
        found = identify_drives(
            read, records, machine, report.head(options.record, window, date.today().isoformat()), name,
            report.note(options.record), progress, options.fmus, cycle,
        )  # fmt: skip
        sources = [each.provenance for each in read.values()]
        done = report.DriveReport(
            found, sources, subject, name, dict(text.split("=", 1) for text in _given(options)),
            marks,
        )  # fmt: skip
        report.write(done, directory, drawn=options.figures)
    finish(options.quiet, done.warnings, *report.summary_lines(done, directory))


_RECORD = Option("record", "RECORD", "CSV or MAT file, or a capture of a SINUMERIK (.json) (docs/traces.md)", type=Path)
_AXES = Option("--axes", "NAMES", "axes, separated by commas, such as X,Y (default: all of the machine)")
_WINDOW = Option(
    "--window",
    "BEGIN..END",
    "the part of the record that counts, by times or by blocks of its program, e.g. '0.5 s..2 s', 'N7..N20', 'N7' "
    "(default: all of it)",
)
_COLUMNS = Option("--columns", "MAPPING.yaml", "which columns of the record are what (docs/traces.md)", type=Path)

REPLAY = Command(
    "replay",
    "a record's setpoints through the simulated axes, beside what was recorded",
    replay,
    (
        _RECORD,
        Option("--machine", "MACHINE-or-SCENARIO", "the machine that follows the record", type=Path, required=True),
        _AXES, _COLUMNS, _WINDOW, out("replay_<name of the record>"), FIGURES, CONTROL,
        settings("axes.Z.drive.K_v='2 (m/min)/mm'"), FMUS, QUIET,
    ),
    REPLAY_DESCRIPTION,
    REPLAY_EPILOG,
)  # fmt: skip
IDENTIFY_DRIVE = Command(
    "identify-drive",
    "drive, inertia and friction of axes from a record of their control, in closed loop",
    identify_drive,
    (
        _RECORD, _AXES,
        Option("--machine", "MACHINE-or-SCENARIO",
               "whose structure and friction are known (default: rigid axes, with what the record tells)", type=Path),
        _COLUMNS, _WINDOW,
        Option("--position-cycle", "VALUE",
               "cycle of the position loop of rigid axes, e.g. '2 ms' (default: the control cycle, as where the "
               "drive closes that loop itself, or that of the record's rows where the record speaks for it)"),
        Option("--name", "NAME", "of the machine that is written (default: name of the record)"),
        out("drive_<name of the record>"), FIGURES, CONTROL,
        settings("axes.Z.drive.K_v='2 (m/min)/mm'"), FMUS, QUIET,
    ),
    DRIVE_DESCRIPTION,
    DRIVE_EPILOG,
)  # fmt: skip
