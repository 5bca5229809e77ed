"""feedsim tune compensation: the values of a friction compensation as controls have it."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from feedsim.cli.options import FIGURES, FMUS, JUDGED_ON_DRAWS, QUIET_OPTION, Command, Option, names, out, settings
from feedsim.cli.terminal import call, finish

DESCRIPTION = """Find the values of a friction compensation: a pulse on the speed setpoint, constant or with a
characteristic over the acceleration (SINUMERIK), a torque over the commanded speed (TwinCAT CNC), or the friction model
as torque feedforward. They are found on short circles of the plane of the scenario's first circle, and judged on the
practical range of radii and feeds."""
EPILOG = """examples:
  feedsim example xz_circle
  feedsim tune compensation xz_circle.yaml --kind pulse
  feedsim tune compensation xz_circle.yaml --kind table --axes Z --out results/table
"""


def compensation(options: Namespace) -> None:
    """feedsim tune compensation."""
    from feedsim.jobs.tune_compensation import tune_compensation

    directory: Path = options.out or Path("results") / f"tune_{options.scenario.stem}"
    result = call(tune_compensation, options, " runs", out=directory)
    finish(options.quiet, result.findings, *result.lines, f"-> {directory / 'report.html'}")


COMPENSATION = Command(
    "compensation",
    "values of a friction compensation, judged on other circles",
    compensation,
    (
        Option("scenario", "SCENARIO.yaml", "scenario with a circle", type=Path),
        Option("--kind", "KIND", "pulse, pulse_characteristic, table or model (default: pulse_characteristic)",
               default="pulse_characteristic"),
        Option("--axes", "NAMES", "axes of the plane that are compensated (default: both)", type=names),
        Option("--objective", "NAME", "what is minimised: ratio, worst or largest (default: ratio)", default="ratio"),
        JUDGED_ON_DRAWS,
        out("tune_<name of the file>"), FIGURES, settings(), FMUS, QUIET_OPTION,
    ),
    DESCRIPTION,
    EPILOG,
    job="tune_compensation",
)  # fmt: skip
