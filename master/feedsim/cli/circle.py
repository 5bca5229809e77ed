"""feedsim circle: why a recorded circle is not round."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from feedsim.cli.options import CONTROL, FIGURES, QUIET_OPTION, Command, Option, names, out, pairs
from feedsim.cli.terminal import call, finish

DESCRIPTION = """Take a recorded circle apart: servo mismatch, squareness, scale, lost motion, reversal peaks, pitch
errors, each with interval and share of G, in words. Files are CSV with units in the header, with positions of both axes
(linear scales, a control's log) or with angle and deviation (or radius) of a ballbar; both directions may be in one
file or in two. A result.csv of feedsim run is such a file."""
EPILOG = """examples:
  feedsim circle ballbar_ccw.csv ballbar_cw.csv --axes X,Y --radius "150 mm" --feed "1000 mm/min"
  feedsim circle scales.csv --axes X,Z --pitch X="10 mm" --pitch Z="10 mm"
  feedsim circle results/xz_circle/result.csv --axes X,Z --radius "15 mm" --centre X="785 mm" --centre Z="100 mm"
"""


def circle(options: Namespace) -> None:
    """feedsim circle."""
    from feedsim.jobs.circle import circle

    out: Path = options.out or Path("results") / f"circle_{options.records[0].stem}"
    centre = pairs("centre", options.centre, "AXIS=POSITION is needed, e.g. X=10mm")
    pitch = pairs("pitch", options.pitch, "AXIS=LENGTH is needed, e.g. X=10mm")
    result = call(circle, options, out=out, centre=centre, pitch=pitch)
    finish(options.quiet, result.findings, *result.lines, f"-> {out / 'report.html'}")


COMMAND = Command(
    "circle",
    "say why a recorded circle is not round (scales, ballbar, a control's log)",
    circle,
    (
        Option("records", "RECORD", "CSV file with one direction or both", type=Path, nargs="+"),
        Option("--axes", "A,B", "first and second axis of the plane (default: X,Y)", type=names, default=("X", "Y")),
        Option("--radius", "LENGTH", "programmed radius; needed where the file has deviations alone"),
        Option("--feed", "SPEED", "path speed; needed where the file has no time"),
        Option("--centre", "AXIS=POSITION", "programmed centre (default: fitted)", many=True),
        Option("--pitch", "AXIS=LENGTH", "look for an error that repeats with it", many=True),
        out("circle_<name of the first file>"),
        FIGURES,
        CONTROL,
        QUIET_OPTION,
    ),
    description=DESCRIPTION,
    epilog=EPILOG,
    job="circle",
)
