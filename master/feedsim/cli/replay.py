"""feedsim replay and identify-drive: records of a control beside the simulated machine."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from feedsim.cli.options import CONTROL, FIGURES, FMUS, QUIET_OPTION, Command, Option, out, settings
from feedsim.cli.terminal import call, finish

REPLAY_DESCRIPTION = """Run the position setpoints of a record through the simulated axes, in closed loop, and show
what is left of position, torque and speed setpoint: over time, as figures, as a spectrum and over the position."""
REPLAY_EPILOG = """examples:
  feedsim example sinumerik_840d test_centre
  feedsim replay capture.json --machine machines/sinumerik_840d --axes X,Y
  feedsim replay log.csv --machine machines/test_centre --axes Z --window "0.5 s..2 s"
  feedsim replay log.csv --machine machines/test_centre --axes Z --open-loop
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
    """feedsim replay."""
    from feedsim.jobs.replay import replay

    out: Path = options.out or Path("results") / f"replay_{options.record.stem}"
    result = call(replay, options, out=out)
    head = f"{result.replayed.subject.machine.name} on {options.record.name} -> {out / 'report.html'}"
    finish(options.quiet, result.findings, head, *result.lines)


def identify_drive(options: Namespace) -> int:
    """feedsim identify-drive; the exit code."""
    from feedsim.jobs.identify_drive import identify_drive

    out: Path = options.out or Path("results") / f"drive_{options.record.stem}"
    result = call(identify_drive, options, out=out)
    drives_found = result.drives.found
    head = f"drive of {', '.join(drives_found.drives)} from {options.record.name} -> {out / 'report.html'}"
    written = (
        [f"  feedsim replay RECORD --machine {out} replays records on it"]
        if "machine.yaml" in drives_found.files
        else []
    )
    finish(options.quiet, result.findings, head, *result.lines, *written)
    return result.exit_code


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
        _AXES, _COLUMNS, _WINDOW,
        Option("--open-loop", "",
               "the recorded torque drives the rigid axis, from the recorded position and speed on, without its drive"),
        out("replay_<name of the record>"), FIGURES, CONTROL,
        settings("axes.Z.drive.K_v='2 (m/min)/mm'"), FMUS, QUIET_OPTION,
    ),
    REPLAY_DESCRIPTION,
    REPLAY_EPILOG,
    job="replay",
)  # fmt: skip
IDENTIFY_DRIVE = Command(
    "identify-drive",
    "drive, inertia and friction of axes from a record of their control, in closed loop",
    identify_drive,
    (
        _RECORD, _AXES,
        Option("--machine", "MACHINE-or-SCENARIO",
               "whose structure and friction are known (default: rigid axes, and what the record determines)",
               type=Path),
        _COLUMNS, _WINDOW,
        Option("--position-cycle", "VALUE",
               "cycle of the position loop of rigid axes, e.g. '2 ms' (default: the control cycle, as where the "
               "drive closes that loop itself, or that of the record's rows where the record speaks for it)"),
        Option("--modes", "0..5|auto",
               "elastic modes of every rigid axis; auto: as many as predict best what a fit has not seen (default: 0)",
               default="0"),
        Option("--name", "NAME", "of the machine that is written (default: name of the record)"),
        out("drive_<name of the record>"), FIGURES, CONTROL,
        settings("axes.Z.drive.K_v='2 (m/min)/mm'"), FMUS, QUIET_OPTION,
    ),
    DRIVE_DESCRIPTION,
    DRIVE_EPILOG,
    job="identify_drive",
)  # fmt: skip
