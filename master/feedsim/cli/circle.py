"""feedsim circle: why a recorded circle is not round."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from feedsim.cli.options import FIGURES, QUIET, Command, Option, lengths, names, out, quantity
from feedsim.cli.terminal import finish, results_in
from feedsim.errors import InputError

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
    """Read, take apart, write."""
    from feedsim.analysis.circle import diagnose
    from feedsim.analysis.circle.records import read_circle
    from feedsim.report import circle as report

    axes = options.axes
    if len(axes) != 2 or axes[0] == axes[1]:
        raise InputError(f"--axes {','.join(axes)}: two different axes of the plane are needed, for example --axes X,Z")
    directory: Path = options.out or Path("results") / f"circle_{options.records[0].stem}"
    radius = None if options.radius is None else quantity("radius", options.radius, "m", "150 mm", positive=True)
    feed = None if options.feed is None else quantity("feed", options.feed, "m/s", "1000 mm/min", positive=True)
    centre = lengths("centre", options.centre, "POSITION", "10mm")
    pitch = lengths("pitch", options.pitch, "LENGTH", "10mm", positive=True)
    for option, named in (("centre", centre), ("pitch", pitch)):
        if other := [axis for axis in named if axis not in axes]:
            raise InputError(f"--{option}: {other[0]} is no axis of the plane; --axes says {', '.join(axes)}")
    if centre and len(centre) != 2:
        raise InputError(f"--centre: is given of {' and '.join(centre)} alone; give it of {axes[0]} and {axes[1]}")
    with results_in(directory, report.check_writable, options.records):
        recorded = read_circle(
            options.records,
            (axes[0], axes[1]),
            radius=radius,
            feed=feed,
            centre=(centre[axes[0]], centre[axes[1]]) if centre else None,
            pitch=pitch,
        )
        diagnosis = diagnose(recorded.circle, [turn.path for turn in recorded.turns], centred=recorded.centred)
        report.write(recorded, diagnosis, options.records, directory, drawn=options.figures)
    finish(options.quiet, recorded.doubts, *report.lines(diagnosis, recorded), f"-> {directory / 'report.html'}")


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
        QUIET,
    ),
    description=DESCRIPTION,
    epilog=EPILOG,
)
