"""feedsim identify-modes: elastic modes of an axis from measured responses."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from feedsim.cli.options import FIGURES, QUIET_OPTION, Command, Option, out, settings
from feedsim.cli.terminal import call, finish

DESCRIPTION = """Elastic modes of an axis from a measured response: time signals (--input, --motor) or a file of
frequency responses (--motor). Rigid motion, delays and modes, whose number cross-validation decides; written as the
machine's table of modes, beside the measured lines and the machine's own response."""
EPILOG = """examples:
  feedsim example test_centre
  feedsim identify-modes bench.mat --machine machines/test_centre --axis X --input iq_adx:A --motor theta_mx:rad \\
    --scale theta_my:rad --interval 0.4ms
  feedsim identify-modes responses.uff --machine machines/test_centre --axis Z --motor "n/M:(rad/s)/(N.m)" --modes 2
"""


def identify_modes(options: Namespace) -> None:
    """feedsim identify-modes."""
    from feedsim.jobs.identify_modes import identify_modes

    out: Path = options.out or Path("results") / f"modes_{options.response.stem}"
    result = call(identify_modes, options, out=out)
    where = f"modes of {result.axis.axis} from {options.response.name} -> {out / 'report.html'}"
    finish(options.quiet, result.findings, where, *result.lines)


COMMAND = Command(
    "identify-modes",
    "elastic modes of an axis from measured responses",
    identify_modes,
    (
        Option("response", "RESPONSE", "time signals (CSV, MAT, a trace), or frequency responses (CSV, UFF58, XML)",
               type=Path),
        Option("--machine", "MACHINE-or-SCENARIO", "whose axis it is", type=Path, required=True),
        Option("--axis", "NAME", "the axis (default: the first one)"),
        Option("--input", "NAME[:UNIT]", "of time signals: torque or current; of several runs NAME,NAME:UNIT"),
        Option("--motor", "NAME[:UNIT]", "angle, speed or acceleration of the motor (default: the only response)"),
        Option("--scale", "NAME[:UNIT]", "position, speed or acceleration at the scale, or at the load"),
        Option("--sensor", "NAME[:UNIT]", "a further sensor; may be given several times", many=True),
        Option("--modes", "0..5|auto", "how many modes (default: auto, by cross-validation)", default="auto"),
        Option("--band", "LOW..HIGH", "lines that are used, e.g. 11Hz..250Hz (default: all that are excited)"),
        Option("--period", "SAMPLES", "period of the excitation (default: looked for)", type=int),
        Option("--time", "NAME[:UNIT]", "column of the time (default: time or t)"),
        Option("--interval", "VALUE", "of the samples, in place of a time, e.g. 0.4ms"),
        out("modes_<name of the file>"), FIGURES, settings("axes.Z.drive.K_v='2 (m/min)/mm'"), QUIET_OPTION,
    ),
    DESCRIPTION,
    EPILOG,
    job="identify_modes",
)  # fmt: skip
