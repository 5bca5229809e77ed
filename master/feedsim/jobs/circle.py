"""Why a recorded circle is not round."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

from feedsim.analysis import Diagnosis, Figure, Named
from feedsim.analysis.circle import diagnose, further
from feedsim.analysis.circle.records import RecordedCircle, read_circle
from feedsim.arguments import Pairs, Value, lengths, listed, pairs, quantity, spelt
from feedsim.errors import InputError
from feedsim.jobs.parameters import Argument, ControlName, FigureKinds, File, Force, Option, job, out
from feedsim.jobs.result import Result, kept
from feedsim.jobs.watch import NO_WATCH, Watch
from feedsim.report import circle as page
from feedsim.report.content import Report

LENGTH_NEEDED = "AXIS=LENGTH is needed, e.g. X=10mm"


@dataclass(frozen=True, eq=False, repr=False)
class CircleResult(Result):
    """A recorded circle taken apart.

    recorded: turns, axes, radius [m], speed [m/s]. diagnosis: the causes, each with interval and share of G. records:
    the files.
    """

    recorded: RecordedCircle
    diagnosis: Diagnosis
    records: Sequence[Path]

    kind = "circle"

    @property
    def inputs(self) -> Sequence[Path]:
        """The records."""
        return self.records

    @cached_property
    def figures(self) -> Mapping[str, Figure]:
        """As of a run: "XY.G", "XY.squareness", ..."""
        return Named(page.figures_of(self.recorded, self.diagnosis))

    @property
    def findings(self) -> Sequence[str]:
        """What is the matter with the records."""
        return self.recorded.doubts

    @property
    def answers(self) -> Sequence[str]:
        """Why the circle is not round."""
        return page.answers(self.diagnosis)

    @property
    def lines(self) -> Sequence[str]:
        """The answer, and how the files were read."""
        return [*self.answers, *further(self.diagnosis), *(f"  {note}" for note in self.recorded.notes)]

    def report(self) -> Report:
        """Content of report.html."""
        return page.report_of(self.recorded, self.diagnosis, self.figures, self.records)

    def summary(self, names: Sequence[str]) -> Mapping[str, Any]:
        """Content of summary.json."""
        return page.summary(self.recorded, self.diagnosis, self.figures, self.records, names)


@job("why a recorded circle is not round")
def circle(
    records: Annotated[File | Sequence[File], Argument("RECORD", "CSV file with one direction or both", many=True)],
    axes: Annotated[str | Sequence[str], Option("A,B", "first and second axis of the plane (default: X,Y)")] = (
        "X",
        "Y",
    ),
    *,
    radius: Annotated[
        Value | None, Option("LENGTH", "programmed radius; needed where the file has deviations alone")
    ] = None,
    feed: Annotated[Value | None, Option("SPEED", "path speed; needed where the file has no time")] = None,
    centre: Annotated[Pairs[Value], Option("AXIS=POSITION", "programmed centre (default: fitted)", many=True)] = None,
    pitch: Annotated[Pairs[Value], Option("AXIS=LENGTH", "look for an error that repeats with it", many=True)] = None,
    out: Annotated[File | None, out("circle_{records}")] = None,
    figures: FigureKinds = (),
    force: Force = False,
    control: ControlName = "",
    watch: Watch = NO_WATCH,
) -> CircleResult:
    """Take a recorded circle apart: servo mismatch, squareness, scale, lost motion, reversal peaks, pitch errors.

    Each cause has an interval and its share of G. Files are CSV with units in the header, with positions of both axes
    (linear scales, a control's log) or with angle and deviation (or radius) of a ballbar; both directions may be in one
    file or in two. A result.csv of feedsim run is such a file.

    Command line:
        feedsim circle ballbar_ccw.csv ballbar_cw.csv --axes X,Y --radius "150 mm" --feed "1000 mm/min"
        feedsim circle scales.csv --axes X,Z --pitch X="10 mm" --pitch Z="10 mm"
        feedsim circle results/xz_circle/result.csv --axes X,Z --radius "15 mm" --centre X="785 mm" --centre Z="100 mm"

    Raises:
        InputError: wrong arguments, or files that hold no circle.
        OutputError: `out` cannot be written.

    >>> import feedsim as fs
    >>> paths = fs.run("xz_circle.yaml").save("circle")
    >>> result = fs.circle("circle/result.csv", "X,Z", radius="15 mm", centre={"X": "785 mm", "Z": 0.1})
    >>> result.figures["XZ.servo_mismatch"].unit
    'ms'
    """
    plane = listed(axes)
    if len(plane) != 2 or plane[0] == plane[1]:
        option = spelt("axes")
        raise InputError(
            f"{option} {','.join(plane)}: two different axes of the plane are needed, for example {option} X,Z"
        )
    files = [Path(file) for file in ([records] if isinstance(records, str | Path) else records)]
    about = lengths("centre", pairs("centre", centre, LENGTH_NEEDED), "10mm")
    pitches = lengths("pitch", pairs("pitch", pitch, LENGTH_NEEDED), "10mm", positive=True)
    for name, values in (("centre", about), ("pitch", pitches)):
        if other := [axis for axis in values if axis not in plane]:
            raise InputError(
                f"{spelt(name)}: {other[0]} is no axis of the plane; {spelt('axes')} says {', '.join(plane)}"
            )
    if about and len(about) != 2:
        raise InputError(
            f"{spelt('centre')}: is given of {' and '.join(about)} alone; give it of {plane[0]} and {plane[1]}"
        )
    r = None if radius is None else quantity("radius", radius, "m", "150 mm", positive=True)
    v = None if feed is None else quantity("feed", feed, "m/s", "1000 mm/min", positive=True)
    with kept(out, CircleResult.check_place, watch, files, force=force):
        recorded = read_circle(
            files,
            (plane[0], plane[1]),
            radius=r,
            feed=v,
            centre=(about[plane[0]], about[plane[1]]) if about else None,
            pitch=pitches,
        )
        diagnosis = diagnose(recorded.circle, [turn.path for turn in recorded.turns], centred=recorded.centred)
        result = CircleResult(recorded, diagnosis, files)
        if out is not None:
            result.save(out, figures=figures, force=force, control=control)
    return result
