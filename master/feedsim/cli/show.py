"""feedsim show: results and records over each other."""

from __future__ import annotations

from argparse import Namespace
from functools import partial
from pathlib import Path

from feedsim.cli.options import CONTROL, FIGURES, QUIET_OPTION, Command, Option, out
from feedsim.cli.terminal import call, finish

DESCRIPTION = """Lay results of feedsim run, recorded CSV files and runs of studies over each other: contours of
circles, stops, following error, torque, speed, position and spectra, a table of their figures with differences, and
the parameters in which they differ. Sources are aligned by their setpoints, circles by the angle; the page says how.
A run of a study is FOLDER:17, FOLDER:min=FIGURE or FOLDER:max=FIGURE; it is made once more."""
EPILOG = """examples:
  feedsim example xz_circle z_stop
  feedsim run xz_circle.yaml --out results/as_is
  feedsim run xz_circle.yaml --set machine.axes.Z.drive.K_v="5 (m/min)/mm" --out results/faster
  feedsim show results/as_is results/faster
  feedsim show results/as_is/result.csv record.csv --out results/against_record
  feedsim sweep studies/z_stop.yaml
  feedsim show results/z_stop:min=Z.overshoot results/z_stop:max=Z.overshoot results/z_stop:17
"""


def show(options: Namespace) -> None:
    """feedsim show."""
    from feedsim.jobs.show import show

    out: Path = options.out or Path("results") / "show"
    over = call(partial(show, *options.results), options, out=out)
    finish(options.quiet, over.findings, *over.lines, f"-> {out / 'report.html'}")


COMMAND = Command(
    "show",
    "lay results and records over each other: pictures, figures with differences, parameters that differ",
    show,
    (
        Option(
            "results", "RESULT", "folder of feedsim run, CSV file with a column of time, or run of a study", nargs="+"
        ),
        out("show"),
        FIGURES,
        CONTROL,
        QUIET_OPTION,
    ),
    description=DESCRIPTION,
    epilog=EPILOG,
    job="show",
)
