"""feedsim tune drive: parameters of a drive within stability margins."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from feedsim.cli.options import CONTROL, FIGURES, FMUS, JUDGED_ON_DRAWS, QUIET_OPTION, Command, Option, out, settings
from feedsim.cli.terminal import call, finish

DESCRIPTION = """Find better values of K_p, T_n, K_v, T_sym, T_dyn, the reference model and the current setpoint filters
of an axis. Gain and phase margin of its speed and position loop hold at every pose given and for elastic modes 10 %
lower and higher. Candidates run moves and circles; the result is judged on others. Where nothing better is found, the
present values stay."""
EPILOG = """examples:
  feedsim example z_positioning
  feedsim tune drive z_positioning.yaml --axis Z
  feedsim tune drive z_positioning.yaml --axis Z --control sinumerik --at Z=600mm --at X=100mm,Z=600mm
  feedsim run z_positioning.yaml --set machine.axes.Z.drive=results/tune_drive_z_positioning_Z/drive_Z.yaml
"""


def drive(options: Namespace) -> None:
    """feedsim tune drive."""
    from feedsim.jobs.tune_drive import tune_drive

    directory: Path = options.out or Path("results") / f"tune_drive_{options.scenario.stem}_{options.axis}"
    result = call(tune_drive, options, " runs", out=directory)
    finish(options.quiet, result.findings, *result.lines, f"-> {directory / 'report.html'}")


DRIVE = Command(
    "drive",
    "values of a drive within stability margins",
    drive,
    (
        Option("scenario", "SCENARIO.yaml", "scenario whose machine is meant", type=Path),
        Option("--axis", "NAME", "axis whose drive is tuned", required=True),
        Option("--gain-margin", "DB", "least gain margin (default: 8 dB)", default="8 dB"),
        Option("--phase-margin", "DEG", "least phase margin (default: 40 deg)", default="40 deg"),
        Option("--encoder-noise", "ANGLE", "standard deviation of the motor encoder's angle per control cycle; it "
               "bounds the gains (default: 10 urad)", default="10 urad"),
        Option("--at", "POSE", "a further pose at which the margins hold, such as X=100mm,Z=600mm; may be given "
               "several times", many=True),
        Option("--evaluations", "N", "candidates per start of the search (default: 130)", type=int, default=130),
        JUDGED_ON_DRAWS,
        out("tune_drive_<name of the file>_<axis>"), FIGURES, settings(), CONTROL, FMUS, QUIET_OPTION,
    ),
    DESCRIPTION,
    EPILOG,
    job="tune_drive",
)  # fmt: skip
