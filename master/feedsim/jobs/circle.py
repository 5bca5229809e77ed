"""Why a recorded circle is not round."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

from feedsim.analysis import Diagnosis, Figure, Named
from feedsim.analysis.circle import diagnose, further
from feedsim.analysis.circle.changed import Change
from feedsim.analysis.circle.records import SAME_FEED, RecordedCircle, read_circle
from feedsim.analysis.circularity import axis_letters
from feedsim.files.columns import load_columns
from feedsim.foundation.arguments import Pairs, Value, lengths, listed, pairs, quantity, spelt
from feedsim.foundation.errors import InputError
from feedsim.jobs.parameters import NO_WATCH, Argument, ControlName, FigureKinds, File, Force, Option, Watch, job, out
from feedsim.jobs.result import Result, kept
from feedsim.report import circle as page
from feedsim.report.content import Report
from feedsim.report.page import sheet_html
from feedsim.report.results import Content
from feedsim.report.run import sheet

LENGTH_NEEDED = "AXIS=LENGTH is needed, e.g. X=10mm"


@dataclass(frozen=True, eq=False, repr=False)
class CircleResult(Result):
    """A recorded circle taken apart.

    recorded: turns, axes, radius [m], speed [m/s]. diagnosis: the causes, each with interval and share of G. records:
    the files. after: records of the circle after a change, taken apart; None without.
    """

    recorded: RecordedCircle
    diagnosis: Diagnosis
    records: Sequence[Path]
    after: CircleResult | None = None

    kind = "circle"
    may_write = (sheet.HTML, sheet.CSV)

    @property
    def inputs(self) -> Sequence[Path]:
        """The records."""
        return [*self.records, *(self.after.records if self.after is not None else ())]

    @cached_property
    def figures(self) -> Mapping[str, Figure]:
        """As of a run: "XY.G", "XY.squareness", ...; of records after a change "after.XY.G", ..."""
        later = {} if self.after is None else {f"after.{name}": one for name, one in self.after.figures.items()}
        return Named({**page.figures_of(self.recorded, self.diagnosis), **later})

    @property
    def changes(self) -> Sequence[Change]:
        """What the records after a change show of every cause; none without them."""
        return [] if self.after is None else page.changes_of(self._taken, self.after._taken)

    @property
    def findings(self) -> Sequence[str]:
        """What is the matter with the records."""
        return [*self.recorded.doubts, *(self.after.recorded.doubts if self.after is not None else ())]

    @property
    def answers(self) -> Sequence[str]:
        """Why the circle is not round; with records after a change what has changed."""
        if self.after is not None:
            return page.answers_of_both(self._taken, self.after._taken)
        return page.answers(self.diagnosis)

    @property
    def lines(self) -> Sequence[str]:
        """The answer, what to type, and how the files were read."""
        if self.after is not None:
            return page.lines_of_both(self._taken, self.after._taken)
        action = page.first_action(self.diagnosis)
        notes = (f"  {note}" for note in self.recorded.notes)
        return [*self.answers, *filter(None, [action]), *further(self.diagnosis), *notes]

    @property
    def _taken(self) -> page.Taken:
        return page.Taken(self.recorded, self.diagnosis, self.figures, self.records)

    def report(self) -> Report:
        """Content of report.html."""
        if self.after is not None:
            return page.report_of_both(self._taken, self.after._taken)
        return page.report_of(self.recorded, self.diagnosis, self.figures, self.records)

    def files(self) -> Mapping[str, Content]:
        """Of records before and after a change the acceptance sheet of both."""
        if self.after is None:
            return {}
        sheets = page.sheets_of_both(self._taken, self.after._taken)
        title = f"Circle {axis_letters(self.recorded.circle.axes)}, before and after"
        return {sheet.HTML: sheet_html(title, sheets, ""), sheet.CSV: sheet.table(sheets)}

    def summary(self, names: Sequence[str]) -> Mapping[str, Any]:
        """Content of summary.json."""
        content = page.summary(self.recorded, self.diagnosis, self.figures, self.inputs, names)
        if self.after is None:
            return content
        changes = page.changes_part(self._taken, self.after._taken)
        return {**content, "answer": list(self.answers), "changed": changes}


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
    after: Annotated[
        File | Sequence[File],
        Option("FILE", "records of the circle after a change: what has changed beyond doubt", several=True),
    ] = (),
    columns: Annotated[
        File | Sequence[File],
        Option("MAPPING.yaml", "which columns of the records are what; one for each axis (docs/traces.md)", many=True),
    ] = (),
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
        feedsim circle ccw.csv cw.csv --radius "150 mm" --feed "1 m/min" --after ccw_after.csv cw_after.csv
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
    later, mappings = (
        [Path(file) for file in ([given] if isinstance(given, str | Path) else given)] for given in (after, columns)
    )

    def taken(from_files: Sequence[Path], radius: float | None) -> CircleResult:
        recorded = read_circle(
            from_files,
            (plane[0], plane[1]),
            radius=radius,
            feed=v,
            centre=(about[plane[0]], about[plane[1]]) if about else None,
            pitch=pitches,
            mappings=[load_columns(file) for file in mappings],
        )
        diagnosis = diagnose(recorded.circle, [turn.path for turn in recorded.turns], centred=recorded.centred)
        return CircleResult(recorded, diagnosis, from_files)

    with kept(out, CircleResult.check_place, watch, [*files, *later, *mappings], force=force):
        result = taken(files, r)
        if later:
            own = result.recorded.circle  # its radius counts for both: files of positions do not have it
            second = taken(later, own.radius)
            if abs(second.recorded.circle.speed / own.speed - 1) > SAME_FEED:
                raise InputError(
                    f"{spelt('after')}: the feed is {6e4 * second.recorded.circle.speed:.4g} mm/min, that of the "
                    f"records before {6e4 * own.speed:.4g} mm/min; allowed: {100 * SAME_FEED:g} % apart, as peaks and "
                    "lags grow with it"
                )
            result = replace(result, after=second)
        if out is not None:
            result.save(out, figures=figures, force=force, control=control)
    return result
