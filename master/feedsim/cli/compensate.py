"""feedsim compensate: friction compensation by torque feedforward, judged by a circle."""

from __future__ import annotations

from argparse import BooleanOptionalAction, Namespace
from pathlib import Path

from feedsim.cli.options import FIGURES, FMUS, QUIET_OPTION, UNCERTAIN, Command, Option, out, pairs, settings
from feedsim.cli.terminal import call, finish

DESCRIPTION = """Run a circle without and with friction compensation. A friction model, driven by the speed setpoint
with the lag of the axis, gives a torque that is added to the torque setpoint of every axis that moves. Without
--friction the model has the machine's own parameters: what is possible at best. With the file of an identified set it
shows what that set is worth."""
EPILOG = """examples:
  feedsim example xz_circle
  feedsim compensate xz_circle.yaml --out results/compensate
  feedsim compensate xz_circle.yaml --friction X=friction_x.yaml --friction Z=friction_z.yaml
  feedsim compensate xz_circle.yaml --delay "4.2 ms" --no-table
"""


def compensate(options: Namespace) -> None:
    """feedsim compensate."""
    from feedsim.jobs.compensate import compensate

    out: Path = options.out or Path("results") / f"compensate_{options.scenario.stem}"
    friction = pairs("friction", options.friction, "AXIS=FILE.yaml is needed, such as Z=friction_z.yaml")
    delay = pairs("delay", options.delay, "[AXIS=]VALUE is needed, such as Z='4.2 ms'", common=True)
    result = call(compensate, options, "it", shortened=True, out=out, friction=friction, delay=delay)
    name = result.compensation.scenario.name
    finish(options.quiet, result.findings, f"{name}: friction compensation -> {out / 'report.html'}", *result.lines)


COMMAND = Command(
    "compensate",
    "friction compensation by torque feedforward: a circle without and with it",
    compensate,
    (
        Option("scenario", "SCENARIO.yaml", "scenario with a circle", type=Path),
        out("compensate_<name of the file>"), FIGURES,
        Option("--friction", "AXIS=FILE.yaml",
               "friction parameters that the compensation of an axis uses (default: the machine's own, which the "
               "machine keeps in any case); may be given several times", many=True),
        Option("--delay", "[AXIS=]VALUE",
               "delay of the feedforward behind the speed setpoint, e.g. '4.2 ms' (default: from the parameters of the "
               "drive); may be given several times", many=True),
        Option("--table", "",
               "with the runs that show what errors of the delay and of the parameters cost (default: yes)",
               action=BooleanOptionalAction, default=True),
        UNCERTAIN, settings(), FMUS, QUIET_OPTION,
    ),
    DESCRIPTION,
    EPILOG,
    job="compensate",
)  # fmt: skip
