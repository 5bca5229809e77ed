"""feedsim show: results and records over each other."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from feedsim.cli.options import FIGURES, QUIET, Command, Option, out
from feedsim.cli.terminal import finish, results_in

DESCRIPTION = """Lay results of feedsim run and recorded CSV files over each other: contours of circles, following
error, torque, speed and position, a table of their figures with differences, and the parameters in which they
differ."""
EPILOG = """examples:
  feedsim run scenarios/xz_circle.yaml --out results/as_is
  feedsim run scenarios/xz_circle.yaml --set machine.axes.Z.drive.K_v="5 (m/min)/mm" --out results/faster
  feedsim show results/as_is results/faster
  feedsim show results/as_is/result.csv record.csv --out results/against_record
"""


def show(options: Namespace) -> None:
    """Read, compare, write."""
    from feedsim.analysis.side_by_side import read_sources
    from feedsim.report import show as report
    from feedsim.report.show.report import files_of

    directory: Path = options.out or Path("results") / "show"
    sources = read_sources(options.results)
    with results_in(directory, report.check_writable, files_of(sources)):
        report.write(sources, directory, drawn=options.figures)
    finish(options.quiet, (), *report.lines(sources), f"-> {directory / 'report.html'}")


COMMAND = Command(
    "show",
    "lay results and records over each other: pictures, figures with differences, parameters that differ",
    show,
    (
        Option("results", "RESULT", "folder of feedsim run, or CSV file with a column of time", type=Path, nargs="+"),
        out("show"),
        FIGURES,
        QUIET,
    ),
    description=DESCRIPTION,
    epilog=EPILOG,
)
