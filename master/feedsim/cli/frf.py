"""feedsim frf: frequency responses in closed form and measured on the units."""

from __future__ import annotations

from argparse import ArgumentTypeError, BooleanOptionalAction, Namespace
from pathlib import Path

from feedsim.cli.options import FIGURES, FMUS, QUIET_OPTION, Command, Group, Option, names, out, settings
from feedsim.cli.terminal import call, finish

DESCRIPTION = """Frequency responses of a machine's feed drives: speed-controlled system n/M, reference frequency
response of the speed controller, position loop, loop gains with their margins, x/M, and the compliance at the tool. In
closed form and, friction off, measured on the units with a multisine or a binary sequence."""
EPILOG = """examples:
  feedsim example xz_circle
  feedsim frf machines/test_centre --axes X,Z --out results/frf
  feedsim frf xz_circle.yaml --set "machine.axes.Z.drive.K_p=4 N.m.s/rad" --no-measure
  feedsim frf machines/test_centre --axes Z --friction --offset-speed "5 rad/s" --realisations 4
  feedsim frf machines/test_centre --axes Z --overlay measured.csv:Z.n_a/Z.n_s
"""


def frf(options: Namespace) -> None:
    """feedsim frf."""
    from feedsim.jobs.frf import frf

    named = options.subject.stem if options.subject.is_file() else options.subject.resolve().name
    out: Path = options.out or Path("results") / f"frf_{named}"
    result = call(frf, options, " cycles", shortened=True, out=out)
    finish(options.quiet, result.findings, *result.lines, f"-> {out / 'report.html'}")


def _names(text: str) -> tuple[str, ...]:
    if not (result := names(text)):
        raise ArgumentTypeError("names of axes are needed, such as X,Z")
    return result


COMMAND = Command(
    "frf",
    "frequency responses of the drives, in closed form and measured; Bode plots",
    frf,
    (
        Option("subject", "SCENARIO-or-MACHINE", "scenario file, machine file or machine folder", type=Path),
        out("frf_<name of the file>"), FIGURES,
        Option("--axes", "X,Z", "axes to look at (default: all)", type=_names),
        settings("machine.axes.Z.drive.K_p='4 N.m.s/rad'"),
        FMUS,
        Option("--band", "LOW..HIGH",
               "frequencies looked at (default: 1Hz..1000Hz, at most to half the sampling rate of the control cycle)"),
        Option("--tool", "", "with the compliance at the tool (default: yes)",
               action=BooleanOptionalAction, default=True),
        Option("--overlay", "FILE[:RESPONSE[=NAME]]",
               "lay a curve from a CSV or UFF58 file over, e.g. measured.csv:Z.n_a/Z.M_a; may be given several times",
               many=True),
        Option("--full-model", "",
               "where the machine names its structure: compare with all modes of the finite-element model "
               "(default: yes)", action=BooleanOptionalAction, default=True),
        QUIET_OPTION,
        Group(
            "measurement on the units",
            Option("--measure", "", "on the units besides (default: yes; --no-measure: closed form only)",
                   action=BooleanOptionalAction, default=True),
            Option("--excitation", "", "signal (default: multisine)",
                   choices=("multisine", "prbs"), default="multisine"),
            Option("--inject", "",
                   "where it is added: to the speed setpoint (finds n/M and n_a/n_s) or to the torque setpoint (finds "
                   "n/M); default: n_add", choices=("n_add", "M_add"), default="n_add"),
            Option("--amplitude", "VALUE",
                   "RMS of the signal, e.g. '0.5 rad/s' (default: 5 %% of the torque limit)"),
            Option("--periods", "N", "recorded periods (default: 2)", type=int, default=2),
            Option("--settle", "N", "periods ahead of those (default: 2)", type=int, default=2),
            Option("--realisations", "N",
                   "signals with other phases, averaged (default: 1, with friction 4: only between realisations does "
                   "the coherence see what is not linear)", type=int),
            Option("--seed", "N", "of the phases (default: 1)", type=int, default=1),
            Option("--friction", "", "with friction; the closed form knows none"),
            Option("--offset-speed", "VALUE", "motor speed at which the excited axis moves, e.g. '5 rad/s'"),
        ),
    ),
    DESCRIPTION,
    EPILOG,
    job="frf",
)  # fmt: skip
