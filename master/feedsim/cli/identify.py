"""feedsim identify: friction parameters from recorded traces."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from feedsim.cli.options import FIGURES, FMUS, Command, Group, Option, names, out, pairs
from feedsim.cli.terminal import call, finish

DESCRIPTION = """Friction parameters of an axis from recorded traces: the Stribeck curve from stretches at constant
speed, pre-sliding from moves that reverse, with confidence intervals. Leaves friction.yaml, which scenarios and machine
files take as it is, a report with figures, and what the figures show as CSV."""
EPILOG = """examples:
  feedsim example identify_z_constant identify_z_sine xz_circle
  feedsim run identify_z_constant.yaml && feedsim run identify_z_sine.yaml
  feedsim identify results/identify_z_constant/log.csv results/identify_z_sine/log.csv --axis Z \\
      --machine machines/test_centre
  feedsim identify record.mat --columns record.yaml --delay 0
  feedsim identify z.csv --axis Z --machine my_machine --hold "beta=1" --free v_log
  feedsim run xz_circle.yaml --set machine.axes.Z.friction=results/identify_z/friction.yaml --out results/own
"""
HOLD_NEEDS = "NAME=VALUE is needed, for example beta=1 or v_log='3 rad/s'"


def identify(options: Namespace) -> None:
    """feedsim identify."""
    from feedsim.jobs.identify import AXIS, identify
    from feedsim.report.identify import terminal_lines, terminal_warnings

    out: Path = options.out or Path("results") / f"identify_{AXIS}"
    hold = pairs("hold", [part for text in options.hold for part in names(text)], HOLD_NEEDS)
    free = [name for text in options.free for name in names(text)]
    result = call(identify, options, out=out, hold=hold, free=free)
    folder = Path(str(out).replace(AXIS, result.found.axis.lower()))
    # Without the table, all warnings: it holds the reasons that some only repeat.
    warnings = result.findings if options.quiet else terminal_warnings(result.identified)
    finish(options.quiet, warnings, *terminal_lines(result.identified, folder))


COMMAND = Command(
    "identify",
    "friction parameters from recorded traces, with uncertainties; friction.yaml and a report",
    identify,
    (
        Option("traces", "TRACE", "CSV or MAT file (docs/traces.md)", type=Path, nargs="+"),
        Option("--axis", "NAME", "axis that is identified (default: the only one)"),
        Option("--machine", "MACHINE-or-SCENARIO",
               "gives pitch, torque constant and inertia of the axis, and values for what the traces do not determine",
               type=Path),
        Option("--columns", "MAPPING.yaml", "which columns of the traces are what (docs/traces.md)", type=Path),
        out("identify_<axis>, in small letters"), FIGURES,
        Group(
            "what is known",
            Group(
                "",
                Option("--inertia", "VALUE",
                       "all that the motor accelerates, e.g. '0.0164 kg.m^2', or 'estimate' (default: of the mapping, "
                       "else of the machine's modes, else estimated)"),
                Option("--mass", "VALUE", "the same at the slide, e.g. '1600 kg'"),
            ),
            Option("--delay", "VALUE",
                   "by how much the torque is logged later than the motion, e.g. '0.5 ms' or 0, or 'estimate' "
                   "(default: of the mapping, else estimated)"),
            Option("--hold", "NAME=VALUE,...", "parameters that keep a value, e.g. beta=1", many=True),
            Option("--free", "NAME,...", "parameters that are else held: beta, v_log", many=True),
            Option("--stages", "", "1: Stribeck curve, 2: pre-sliding (default: both)",
                   choices=("1", "2", "both"), default="both"),
            Option("--law", "", "law of the pre-sliding: LuGre, or generalised Maxwell slip (default: lugre)",
                   choices=("lugre", "gms"), default="lugre"),
        ),
        FMUS,
        Option("--quiet", "", "no progress bar and no table"),
    ),
    DESCRIPTION,
    EPILOG,
    job="identify",
)  # fmt: skip
