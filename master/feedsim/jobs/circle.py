"""Why a recorded circle is not round."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Annotated

from feedsim.analysis import Diagnosis, FigureTable
from feedsim.analysis.circle import diagnose, suggest_circles
from feedsim.analysis.circle.records import SAME_FEED, RecordedCircle, read_circle
from feedsim.analysis.circle.words import Change
from feedsim.analysis.circularity import axis_letters
from feedsim.files.columns import load_columns
from feedsim.foundation.arguments import Pairs, Value, lengths, pairs, quantity, spell_argument, split_names
from feedsim.foundation.errors import InputError
from feedsim.jobs.parameters import (
    NO_WATCH,
    Argument,
    ControlName,
    FigureKinds,
    File,
    Force,
    Option,
    Watch,
    job,
    output_option,
)
from feedsim.jobs.result import Kind, Result, claim_result_folder
from feedsim.report import circle as page
from feedsim.report.page import sheet_html
from feedsim.report.results import Content
from feedsim.report.run import sheet

LENGTH_NEEDED = "AXIS=LENGTH is needed, e.g. X=10mm"


KIND = Kind("circle", (sheet.HTML, sheet.CSV))


@dataclass(frozen=True, eq=False)
class CircleDiagnosis:
    """A recorded circle taken apart.

    recorded: turns, axes, radius [m], speed [m/s]. diagnosis: the causes, each with interval and share of G. records:
    the files. after: records of the circle after a change, taken apart; None without.
    """

    recorded: RecordedCircle
    diagnosis: Diagnosis
    records: Sequence[Path]
    after: CircleDiagnosis | None = None

    @property
    def changes(self) -> Sequence[Change]:
        """What the records after a change show of every cause; none without them."""
        return [] if self.after is None else page.changes_of(self.taken, self.after.taken)

    @cached_property
    def taken(self) -> page.DiagnosedRecords:
        """With its figures."""
        figures = page.figures_of(self.recorded, self.diagnosis)
        return page.DiagnosedRecords(self.recorded, self.diagnosis, figures, self.records)


def result_of(circle: CircleDiagnosis) -> Result[CircleDiagnosis]:
    """Why a recorded circle is not round; figures are named as those of a run, "XY.G"."""
    diagnosis = circle.diagnosis
    if circle.after is not None:
        return _result_of_both(circle, circle.taken, circle.after.taken)
    return Result(
        KIND,
        circle,
        lambda: page.report_of(circle.recorded, diagnosis, circle.taken.figures, circle.records),
        figures=FigureTable(circle.taken.figures),
        details=lambda: page.details(circle.recorded, diagnosis, circle.records),
        inputs=circle.records,
        rows=[*suggest_circles(diagnosis), *(f"  {note}" for note in circle.recorded.notes)],
    )


def _result_of_both(
    circle: CircleDiagnosis, before: page.DiagnosedRecords, after: page.DiagnosedRecords
) -> Result[CircleDiagnosis]:
    """What a change has done to a circle; figures of the records after it are "after.XY.G", ..."""
    inputs = [*before.files, *after.files]

    def files() -> Mapping[str, Content]:
        sheets = page.sheets_of_both(before, after)
        title = f"Circle {axis_letters(circle.recorded.circle.axes)}, before and after"
        return {sheet.HTML: sheet_html(title, sheets, ""), sheet.CSV: sheet.table(sheets)}

    return Result(
        KIND,
        circle,
        partial(page.report_of_both, before, after),
        figures=FigureTable({**before.figures, **{f"after.{name}": one for name, one in after.figures.items()}}),
        details=lambda: {
            **page.details(circle.recorded, circle.diagnosis, inputs),
            "changed": page.changes_part(before, after),
        },
        files=files,
        inputs=inputs,
    )


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
    out: Annotated[File | None, output_option("circle_{records}")] = None,
    figures: FigureKinds = (),
    force: Force = False,
    control: ControlName = "",
    watch: Watch = NO_WATCH,
) -> Result[CircleDiagnosis]:
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
    plane = split_names(axes)
    if len(plane) != 2 or plane[0] == plane[1]:
        option = spell_argument("axes")
        raise InputError(
            f"{option} {','.join(plane)}: two different axes of the plane are needed, for example {option} X,Z"
        )
    files = [Path(file) for file in ([records] if isinstance(records, str | Path) else records)]
    about = lengths("centre", pairs("centre", centre, LENGTH_NEEDED), "10mm")
    pitches = lengths("pitch", pairs("pitch", pitch, LENGTH_NEEDED), "10mm", positive=True)
    for name, values in (("centre", about), ("pitch", pitches)):
        if other := [axis for axis in values if axis not in plane]:
            raise InputError(
                f"{spell_argument(name)}: {other[0]} is no axis of the plane; {spell_argument('axes')} says "
                f"{', '.join(plane)}"
            )
    if about and len(about) != 2:
        raise InputError(
            f"{spell_argument('centre')}: is given of {' and '.join(about)} alone; give it of {plane[0]} and {plane[1]}"
        )
    r = None if radius is None else quantity("radius", radius, "m", "150 mm", positive=True)
    v = None if feed is None else quantity("feed", feed, "m/s", "1000 mm/min", positive=True)
    later, mappings = (
        [Path(file) for file in ([given] if isinstance(given, str | Path) else given)] for given in (after, columns)
    )

    def taken(from_files: Sequence[Path], radius: float | None) -> CircleDiagnosis:
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
        return CircleDiagnosis(recorded, diagnosis, from_files)

    with claim_result_folder(out, KIND, watch, [*files, *later, *mappings], force=force):
        circle = taken(files, r)
        if later:
            own = circle.recorded.circle  # its radius counts for both: files of positions do not have it
            second = taken(later, own.radius)
            if abs(second.recorded.circle.speed / own.speed - 1) > SAME_FEED:
                raise InputError(
                    f"{spell_argument('after')}: the feed is {6e4 * second.recorded.circle.speed:.4g} mm/min, "
                    f"that of the "
                    f"records before {6e4 * own.speed:.4g} mm/min; allowed: {100 * SAME_FEED:g} % apart, as peaks and "
                    "lags grow with it"
                )
            circle = replace(circle, after=second)
        result = result_of(circle)
        if out is not None:
            result.save(out, figures=figures, force=force, control=control)
    return result
